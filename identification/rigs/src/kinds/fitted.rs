//! Nominal parameters from all data of a description, without an effect.

use super::measured::Measured;
use super::parts::{EVERYTHING, InParts, Part};
use super::{Description, DescriptionError, NamedValue};
use diagnosis::{Point, nominal, refit};

/// Error on all data over that of the whole model, up to which a simpler one is as good.
const AS_GOOD: f64 = 1.01;

/// A nominal model as the data have it.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedNominal {
    /// The parameters that the description leaves open, SI.
    pub parameters: Vec<NamedValue>,
    /// `||y - m|| / ||m - mean||` over all data.
    pub error: f64,
}

/// Fits what `description` leaves open of its nominal model to all its data, and without what it does not need:
/// a pole that a zero cancels tells nothing of another loop gain. None where no start can be simulated.
///
/// # Errors
/// A description or data at fault.
pub fn fit_nominal(description: &Description) -> Result<Option<FittedNominal>, DescriptionError> {
    let rig = description.rig()?;
    let measurement = description.measurement(&[])?;
    let measured = Measured::new(rig, &measurement, description.nominal(rig)?);
    let begun = nominal(&measured, Part::Fitted as usize);
    let fitted = |start: &Point| {
        let (found, deviations) = refit(&measured, start, EVERYTHING)?;
        let error = measured.normalised_error(&found.point, EVERYTHING);
        Some((found.point, deviations, error))
    };
    let Some(mut found) = begun.and_then(|begun| fitted(&begun.point)) else {
        return Ok(None);
    };
    let most = AS_GOOD * found.2;
    loop {
        let without = (0..found.0.nuisance.len())
            .filter_map(|i| fitted(&measured.without(&found.0, i)?))
            .min_by(|a, b| a.2.total_cmp(&b.2));
        match without {
            Some(simpler) if simpler.2 < most => found = simpler,
            _ => break,
        }
    }
    let (point, deviations, error) = found;
    Ok(Some(FittedNominal {
        parameters: measured.parameters(&point, &deviations),
        error,
    }))
}
