//! The reference ahead of the present sample, as inputs of a controller with preview.

use crate::{Causality, Variable};

/// The fields of displacement, velocity and acceleration ahead, the next sample first.
pub type Fields<C> = [fn(&mut C) -> &mut [f64]; 3];

/// Inputs `reference_displacement[i]` (m), `reference_velocity[i]` and `reference_acceleration[i]` for the
/// samples `i = 1` to `count` ahead.
pub fn reference_ahead<C>(count: usize, fields: Fields<C>) -> Vec<Variable<C>> {
    let quantities = [
        ("displacement", "m", "in", 0.0381),
        ("velocity", "m/s", "in/s", 0.5),
        ("acceleration", "m/s2", "g", 10.0),
    ];
    let inputs = |((quantity, unit, shown, nominal), field)| {
        let name = format!("reference_{quantity}");
        let elements = Variable::array(&name, Causality::Input, count, field);
        let described = move |(i, element): (usize, Variable<C>)| {
            element
                .about(&format!(
                    "Wanted {quantity} {} samples ahead, for `preview`",
                    i + 1
                ))
                .unit(unit)
                .shown_in(shown)
                .nominal(nominal)
        };
        elements.into_iter().enumerate().map(described)
    };
    quantities
        .into_iter()
        .zip(fields)
        .flat_map(inputs)
        .collect()
}
