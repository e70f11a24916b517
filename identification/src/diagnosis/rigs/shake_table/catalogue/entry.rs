//! Building blocks of the catalogue's entries.

use plant::identified::effects::valve::MAX_DELAY_SAMPLES;
use plant::identified::rig::IdentifiedRig;

use crate::diagnosis::engine::{Candidate, EffectParameter, Role, Scale};

/// Turns an effect on: its parameters' values in SI, in the order of the catalogue.
pub type Apply = fn(&mut IdentifiedRig, &[f64]);

/// A parameter that tells how strong the effect is.
pub(super) fn size(
    name: &'static str,
    unit: &'static str,
    scale: Scale,
    weak: f64,
    bounds: (f64, f64),
) -> EffectParameter {
    EffectParameter {
        name,
        unit,
        scale,
        role: Role::Size { weak },
        bounds,
    }
}

/// A parameter that tells a detail of its form.
pub(super) fn shape(
    name: &'static str,
    unit: &'static str,
    scale: Scale,
    typical: f64,
    spread: f64,
    bounds: (f64, f64),
) -> EffectParameter {
    EffectParameter {
        name,
        unit,
        scale,
        role: Role::Shape { typical, spread },
        bounds,
    }
}

/// A size that may have either sign, from zero; `weak` and `strong` in SI.
pub(super) fn signed(
    name: &'static str,
    unit: &'static str,
    weak: f64,
    strong: f64,
) -> EffectParameter {
    let most = 4.0 * strong;
    size(name, unit, Scale::Linear(weak), weak, (-most, most))
}

/// A relative change that may have either sign.
pub(super) fn relative(weak: f64, strong: f64) -> EffectParameter {
    let most = (4.0 * strong).min(0.9);
    size(
        "relative_change",
        "1",
        Scale::Factor(weak),
        weak,
        (-most, 4.0 * strong),
    )
}

/// A size that has one sign, from zero.
pub(super) fn positive(
    name: &'static str,
    unit: &'static str,
    weak: f64,
    strong: f64,
) -> EffectParameter {
    size(name, unit, Scale::Linear(weak), weak, (0.0, 4.0 * strong))
}

/// A size that is weak when large: frequencies, limits.
pub(super) fn inverse(
    name: &'static str,
    unit: &'static str,
    weak: f64,
    strong: f64,
) -> EffectParameter {
    size(
        name,
        unit,
        Scale::Inverse(weak),
        weak,
        (0.3 * strong, 3.0 * weak),
    )
}

/// An entry; `starts` in SI.
pub(super) fn candidate(
    effect: &'static str,
    parameters: Vec<EffectParameter>,
    starts: &[&[f64]],
) -> Candidate {
    Candidate {
        effect,
        parameters,
        starts: starts.iter().map(|start| start.to_vec()).collect(),
        look_alikes: match effect {
            "coulomb_friction" => &["stribeck_friction"],
            "stribeck_friction" => &["coulomb_friction"],
            "valve_flow_gain" => &["supply_pressure_droop", "load_cell_scale"],
            "supply_pressure_droop" => &["valve_flow_gain"],
            _ => &[],
        },
        // Where the table sticks the constant gain is not the best one and leaves traces.
        tolerance: if effect.ends_with("friction") {
            1.6
        } else {
            1.0
        },
        contains: (effect == "stribeck_friction").then_some("coulomb_friction"),
    }
}

/// The size of a delay, up to what the rig's memory holds.
pub(super) fn delay(period: f64) -> EffectParameter {
    let late = (MAX_DELAY_SAMPLES - 1) as f64 * period;
    size("delay", "s", Scale::Linear(0.004), 0.004, (0.0, late))
}
