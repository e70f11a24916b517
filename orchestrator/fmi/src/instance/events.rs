//! What has to be known of an FMU whose events are handled outside of it.

use super::super::error::InstanceError;
use super::super::native::Events;
use super::super::{Causality, Description, Kind, Ticks};

/// The clocks of an FMU that declares event mode in co-simulation; none for others.
///
/// # Errors
/// Clocks that cannot be ticked: what there is instead.
pub(super) fn of(description: &Description) -> Result<Option<Events>, InstanceError> {
    if !description.has_stepped_events() {
        let mut inputs = description.input_clocks.iter();
        return match inputs.find(|clock| clock.ticks != Ticks::Triggered) {
            None => Ok(None),
            Some(clock) => Err(InstanceError::Clock(clock.name.clone())),
        };
    }
    let outputs = description.of(Causality::Output);
    let outputs = outputs.map(|at| &description.variables[at]);
    let clocks = outputs.filter(|variable| variable.kind == Kind::Clock);
    Ok(Some(Events {
        inputs: description.input_clocks.clone(),
        outputs: clocks
            .map(|clock| (clock.name.clone(), clock.reference))
            .collect(),
        variable_step: description.variable_step,
    }))
}
