//! Nominal parameters from all data of a description, without an effect.

use super::measured::Measured;
use super::parts::{EVERYTHING, InParts, Part};
use super::{Description, DescriptionError, NamedValue};
use diagnosis::{nominal, refit};

/// A nominal model as the data have it.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedNominal {
    /// The parameters that the description leaves open, SI.
    pub parameters: Vec<NamedValue>,
    /// `||y - m|| / ||m - mean||` over all data.
    pub error: f64,
}

/// Fits what `description` leaves open of its nominal model to all its data; none where no start can be
/// simulated.
///
/// # Errors
/// A description or data at fault.
pub fn fit_nominal(description: &Description) -> Result<Option<FittedNominal>, DescriptionError> {
    let rig = description.rig()?;
    let measurement = description.measurement(&[])?;
    let measured = Measured::new(rig, &measurement, description.nominal(rig)?);
    let begun = nominal(&measured, Part::Fitted as usize);
    let found = begun.and_then(|begun| refit(&measured, &begun.point, EVERYTHING));
    Ok(found.map(|(found, deviations)| FittedNominal {
        parameters: measured.parameters(&found.point, &deviations),
        error: measured.normalised_error(&found.point, EVERYTHING),
    }))
}
