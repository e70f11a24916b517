//! The parameters of the FMU and what the law is built from.

use controllers::surface_control::{Parameters, Variant};
use fmu_kit::{Enumeration, Item};
use serde::{Deserialize, Serialize};

/// The choices of `variant`.
pub const VARIANTS: Enumeration = Enumeration {
    name: "Variant",
    items: &[
        Item {
            name: "multiple-surface",
            value: 1,
            description: "Derivatives by differences",
        },
        Item {
            name: "dynamic-surface",
            value: 2,
            description: "Derivatives by lags",
        },
        Item {
            name: "receding-horizon",
            value: 3,
            description: "One surface over the next samples",
        },
    ],
};

/// All parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    pub(crate) law: Parameters,
    pub(crate) variant: i32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            law: Parameters::default(),
            variant: 1,
        }
    }
}

impl Settings {
    /// What the law is built from.
    pub fn parameters(&self, period: f64) -> Parameters {
        Parameters {
            variant: match self.variant {
                2 => Variant::DynamicSurface,
                3 => Variant::RecedingHorizon,
                _ => Variant::MultipleSurface,
            },
            period,
            ..self.law
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceControl;
    use fmu_kit::Component;
    use fmu_kit::conformance::allocations;

    #[test]
    fn no_variant_allocates_in_its_steps() {
        for variant in VARIANTS.items {
            let mut component = SurfaceControl::default();
            component.settings.variant = variant.value;
            component.settings.law.rig.delay = 1;
            component.initialize().unwrap();
            let counted = allocations(|| {
                for k in 0..1000 {
                    let time = SurfaceControl::STEP_SIZE * f64::from(k);
                    component.reference.velocity = -0.25 * (12.0 * time).cos();
                    component.reference.acceleration = 3.0 * (12.0 * time).sin();
                    component.velocity_ahead.fill(component.reference.velocity);
                    component.step(time, SurfaceControl::STEP_SIZE).unwrap();
                }
            });
            assert_eq!(counted, 0, "{}", variant.name);
            assert!(component.valve_command.abs() > 1e-6, "{}", variant.name);
        }
    }
}
