//! The effects of the plant as candidates of the engine.

use plant::identified::effects::{self, Effect, Parameter};

use diagnosis::{Candidate, EffectParameter, Role, Scale};

/// Delays from which fits begin, in the middle of a sample each, s. At a whole number of samples the likelihood has
/// ridges.
const DELAYS: [f64; 6] = [0.003, 0.0045, 0.0065, 0.009, 0.013, 0.018];

/// Effects of the linear part that no noise looks like: what one sensor shows of the motion that another one shows as
/// well, whatever drives it.
const OF_KINEMATICS: [&str; 1] = ["accelerometer_tilt"];

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
    let is_delay = effect
        .estimated()
        .all(|p| p.basis == effects::Basis::Memory);
    let within = |start: &f64| ((start / period).floor() + 0.5) * period;
    Candidate {
        effect: effect.name,
        parameters: effect
            .estimated()
            .filter_map(|p| estimated(p, peak_command, period))
            .collect(),
        starts: if is_delay && effect.estimated().next().is_some() {
            DELAYS.iter().map(|start| vec![within(start)]).collect()
        } else {
            effect.starts.iter().map(start).collect()
        },
        look_alikes: effect.confounded_with,
        tolerance: effect.tolerance,
        contains: effect.contains,
        law: effect.law,
        is_linear: effect.is_linear && !OF_KINEMATICS.contains(&effect.name),
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
