//! The effects of the plant as candidates of the engine.

use plant::identified::effects::{self, Effect, Parameter};

use diagnosis::{Candidate, EffectParameter, Role, Scale};

/// Every candidate with its effect, for records whose largest command is `peak_command` (V),
/// sampled every `period` s.
pub fn catalogue(peak_command: f64, period: f64) -> Vec<(Candidate, &'static Effect)> {
    effects::all()
        .map(|effect| (candidate(effect, peak_command, period), effect))
        .collect()
}

fn candidate(effect: &'static Effect, peak_command: f64, period: f64) -> Candidate {
    let start = |values: &&[f64]| -> Vec<f64> {
        let pairs = effect.estimated().zip(values.iter());
        pairs
            .map(|(parameter, value)| parameter.basis_value(peak_command) * value)
            .collect()
    };
    Candidate {
        effect: effect.name,
        parameters: effect
            .estimated()
            .filter_map(|p| estimated(p, peak_command, period))
            .collect(),
        starts: effect.starts.iter().map(start).collect(),
        look_alikes: effect.confounded_with,
        tolerance: effect.tolerance,
        contains: effect.contains,
        is_linear: effect.is_linear,
    }
}

/// The engine's view of a parameter; none where it is not estimated.
fn estimated(parameter: &Parameter, peak_command: f64, period: f64) -> Option<EffectParameter> {
    let (of, role) = match parameter.role {
        effects::Role::Size { scale, weak } => {
            let weak = parameter.basis_value(peak_command) * weak;
            (scale, Role::Size { weak })
        }
        effects::Role::Shape {
            scale,
            typical,
            spread,
        } => (scale, Role::Shape { typical, spread }),
        effects::Role::Given => return None,
    };
    let scale = match of {
        effects::Scale::Linear(unit) => Scale::Linear(unit),
        effects::Scale::Factor(unit) => Scale::Factor(unit),
        effects::Scale::Logarithmic => Scale::Logarithmic,
        effects::Scale::Inverse(unit) => Scale::Inverse(unit),
    };
    Some(EffectParameter {
        name: parameter.name,
        unit: parameter.quantity.si,
        scale,
        role,
        bounds: parameter.bounds_on(peak_command, period),
    })
}
