//! The parameters of the FMU and what the law is built from.

use controllers::aids::rig::KnownRig;
use controllers::surface_control::{Parameters, Variant};
use fmu_kit::{Enumeration, Item, Variable};
use plant::ModelError;
use serde::{Deserialize, Serialize};

use crate::SurfaceControl;

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
    law: Parameters,
    pub(crate) variant: i32,
    loop_delay_samples: i32,
    reference_lead_samples: i32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            law: Parameters::default(),
            variant: 1,
            loop_delay_samples: 0,
            reference_lead_samples: 0,
        }
    }
}

impl Settings {
    /// What the law is built from; refuses a negative count by name.
    pub fn parameters(&self, period: f64) -> Result<Parameters, ModelError> {
        Ok(Parameters {
            variant: match self.variant {
                2 => Variant::DynamicSurface,
                3 => Variant::RecedingHorizon,
                _ => Variant::MultipleSurface,
            },
            rig: KnownRig {
                delay: ModelError::count("loop_delay_samples", self.loop_delay_samples)?,
                ..self.law.rig
            },
            lead: ModelError::count("reference_lead_samples", self.reference_lead_samples)?,
            period,
            ..self.law
        })
    }
}

/// The table's rows of the parameters.
pub fn variables() -> Vec<Variable<SurfaceControl>> {
    fmu_kit::table! { SurfaceControl, s:
        parameter("loop_delay_samples", s.settings.loop_delay_samples, "Samples by which measurements are late").min(0.0).max(4.0);
        parameter("valve_limit", s.settings.law.limit, "Largest magnitude of the valve command", "V");
        parameter("surface_rate", s.settings.law.surface_rate, "lambda", "1/s");
        parameter("motion_reaching_rate", s.settings.law.reaching_rates[0], "K1, of the motion's surface", "1/s");
        parameter("oil_reaching_rate", s.settings.law.reaching_rates[1], "K2, of the oil's", "1/s");
        parameter("spool_reaching_rate", s.settings.law.reaching_rates[2], "K3, of the spool's", "1/s");
        parameter("oil_filter_time", s.settings.law.filter_times[0], "Dynamic surface: lag of the wanted force", "s");
        parameter("spool_filter_time", s.settings.law.filter_times[1], "Dynamic surface: lag of the wanted opening", "s");
        parameter("reference_lead_samples", s.settings.reference_lead_samples, "Surfaces: samples by which the motion that they follow is ahead").min(0.0).max(20.0);
        parameter("move_weight", s.settings.law.move_weight, "Receding horizon: weight of the command's change a sample", "m/(V.s)");
        parameter("displacement_measurement_noise", s.settings.law.uncertainty.measurement[0], "Standard deviation of the sensor", "m" => "in");
        parameter("velocity_measurement_noise", s.settings.law.uncertainty.measurement[1], "Standard deviation of the sensor", "m/s" => "in/s");
        parameter("acceleration_measurement_noise", s.settings.law.uncertainty.measurement[2], "Standard deviation of the sensor", "m/s2" => "g");
        parameter("valve_noise", s.settings.law.uncertainty.valve, "Standard deviation of white noise on the valve command", "V");
        parameter("force_noise", s.settings.law.uncertainty.force, "Standard deviation of white noise of the force on the table", "N" => "lbf");
        parameter("force_step", s.settings.law.uncertainty.force_step, "Standard deviation of the unknown force's step a sample", "N" => "lbf");
        parameter("offset_step", s.settings.law.uncertainty.offset_step, "Standard deviation of the step of the valve's offset a sample", "V");
        parameter("spool_lag", s.settings.law.rig.hydraulics.spool_lag, "2 D/w of the spool", "s");
        parameter("spool_inertia", s.settings.law.rig.hydraulics.spool_inertia, "1/w^2 of the spool", "s2");
        parameter("force_rate", s.settings.law.rig.hydraulics.force_rate, "Rate of the force under a valve open by one volt", "N/(V.s)" => "lbf/(V.s)");
        parameter("oil_stiffness", s.settings.law.rig.hydraulics.oil_stiffness, "Stiffness of the oil column", "N/m" => "lbf/in");
        parameter("leakage_rate", s.settings.law.rig.hydraulics.leakage_rate, "Rate at which leakage empties it", "1/s");
        parameter("seal_damping", s.settings.law.rig.hydraulics.seal_damping, "Viscous damping of the seals", "N.s/m" => "lbf.s/in");
        parameter("table_mass", s.settings.law.rig.table.mass, "Mass of the table", "kg" => "lbf.s2/in");
        parameter("table_damping", s.settings.law.rig.table.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
        parameter("table_stiffness", s.settings.law.rig.table.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::Component;
    use fmu_kit::conformance::allocations;

    #[test]
    fn no_variant_allocates_in_its_steps() {
        for variant in VARIANTS.items {
            let mut component = SurfaceControl::default();
            component.settings.variant = variant.value;
            component.settings.loop_delay_samples = 1;
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
