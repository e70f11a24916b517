//! Real rigs: what was measured, what the nominal model gets wrong, which cause it has.
//!
//! A rig is one file that meets [`Rig`]; a set of measurements is a [`Description`] in TOML. The
//! diagnosis never asks for white residuals, which no real rig leaves: it names a cause that pays
//! on data not fitted and that is found on each part of the data.

mod closed_loop_actuator;
mod cyclic_material;
mod description;
mod hysteretic_device;
mod measured;
mod positioning_drive;
mod report;
mod resampling;
mod selection;
pub mod shake_table;

pub use description::{Description, DescriptionError, LeftOut, Measurement, Quantity, Series};
pub use report::{EffectReport, PartReport, Report, Value, diagnose};
pub use resampling::{correlation_time, gain_interval, normalised_error};

use crate::diagnosis::engine::{Candidate, EffectParameter, Role, Scale};

/// A quantity by name and SI unit.
pub type Named = (&'static str, &'static str);

/// An effect that a rig may have, with the values at which it is absent.
#[derive(Debug, Clone)]
pub struct Effect {
    /// What the engine searches.
    pub candidate: Candidate,
    /// Values (SI) without the effect.
    pub off: Vec<f64>,
}

impl Effect {
    /// The same with effects that records of a rig often cannot tell from it.
    fn like(mut self, names: &'static [&'static str]) -> Self {
        self.candidate.look_alikes = names;
        self
    }
}

/// A kind of rig: its equations and the effects it may have.
pub trait Rig: Sync {
    /// What the data must hold beside the output.
    fn inputs(&self) -> &'static [Named];

    /// What is simulated and compared.
    fn output(&self) -> Named;

    /// Parameters of the nominal model.
    fn parameters(&self) -> &'static [Named];

    /// The effects.
    fn effects(&self) -> Vec<Effect>;

    /// Output for the inputs of `series` alone, with the nominal parameters and the values of all
    /// effects' parameters in order.
    fn simulate(&self, series: &Series, nominal: &[f64], effects: &[f64], out: &mut [f64]);
}

/// Kinds of rig, by the name a description uses.
pub const KINDS: [&str; 4] = [
    "closed_loop_actuator",
    "positioning_drive",
    "hysteretic_device",
    "cyclic_material",
];

/// The rig of a kind.
pub fn of_kind(kind: &str) -> Option<Box<dyn Rig>> {
    Some(match kind {
        "closed_loop_actuator" => Box::new(closed_loop_actuator::ClosedLoopActuator),
        "positioning_drive" => Box::new(positioning_drive::PositioningDrive),
        "hysteretic_device" => Box::new(hysteretic_device::HystereticDevice),
        "cyclic_material" => Box::new(cyclic_material::CyclicMaterial),
        _ => return None,
    })
}

/// A size counted in `unit`; `weak` is the least worth a name.
fn size(name: &'static str, si: &'static str, unit: f64, bounds: (f64, f64)) -> EffectParameter {
    EffectParameter {
        name,
        unit: si,
        scale: Scale::Linear(unit),
        role: Role::Size { weak: unit },
        bounds,
    }
}

/// A positive detail of form, usually `typical`, within a factor `e^spread`.
fn shape(name: &'static str, si: &'static str, typical: f64, spread: f64) -> EffectParameter {
    EffectParameter {
        name,
        unit: si,
        scale: Scale::Logarithmic,
        role: Role::Shape { typical, spread },
        bounds: (
            typical * (-6.0 * spread).exp(),
            typical * (6.0 * spread).exp(),
        ),
    }
}

fn effect(
    name: &'static str,
    parameters: Vec<EffectParameter>,
    off: &[f64],
    starts: &[&[f64]],
) -> Effect {
    Effect {
        candidate: Candidate {
            effect: name,
            parameters,
            starts: starts.iter().map(|start| start.to_vec()).collect(),
            look_alikes: &[],
            tolerance: 1.0,
            contains: None,
        },
        off: off.to_vec(),
    }
}
