//! The parameters of the FMU and what the controller is built from.

use controllers::preview::adaptation::Adaptation;
use controllers::preview::load::KnownLoad;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::preview::{Parameters, Role};
use fmu_kit::{Enumeration, Item, Variable};
use plant::ModelError;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::YieldingSpecimen;
use serde::{Deserialize, Serialize};

use crate::PreviewControl;

/// The choices of `role`.
pub const ROLES: Enumeration = Enumeration {
    name: "Role",
    items: &[
        Item {
            name: "control",
            value: 1,
            description: "Drives the valve",
        },
        Item {
            name: "compensation",
            value: 2,
            description: "Adds to controller_command what friction and specimen take",
        },
        Item {
            name: "multi-metric",
            value: 3,
            description: "Drives the valve by command shaping and feedback of what is left",
        },
    ],
};

/// All parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    law: Parameters,
    shake_table: ShakeTable,
    hydraulics: Hydraulics,
    hydraulics_known: bool,
    specimen: YieldingSpecimen,
    specimen_known: bool,
    adaptive: bool,
    adaptation: Adaptation,
    pub(crate) role: i32,
    loop_delay_samples: i32,
    shaping_lead_samples: i32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            law: Parameters::default(),
            shake_table: ShakeTable::default(),
            hydraulics: Hydraulics::default(),
            hydraulics_known: false,
            specimen: YieldingSpecimen::default(),
            specimen_known: false,
            adaptive: false,
            adaptation: Adaptation::default(),
            role: 1,
            loop_delay_samples: 0,
            shaping_lead_samples: 0,
        }
    }
}

impl Settings {
    /// What the controller is built from; refuses a negative count by name.
    pub fn parameters(&self, period: f64) -> Result<Parameters, ModelError> {
        Ok(Parameters {
            role: match self.role {
                2 => Role::Compensation,
                3 => Role::MultiMetric,
                _ => Role::Control,
            },
            rig: RigModel {
                shake_table: self.shake_table,
                hydraulics: self.hydraulics_known.then_some(self.hydraulics),
            },
            load: KnownLoad {
                specimen: self.specimen_known.then_some(self.specimen),
                ..self.law.load
            },
            adaptation: self.adaptive.then_some(self.adaptation),
            delay: ModelError::count("loop_delay_samples", self.loop_delay_samples)?,
            shaping_lead: ModelError::count("shaping_lead_samples", self.shaping_lead_samples)?,
            period,
            ..self.law
        })
    }
}

/// The table's rows of the parameters.
pub fn variables() -> Vec<Variable<PreviewControl>> {
    fmu_kit::table! { PreviewControl, s:
        parameter("preview", s.settings.law.preview, "Whether the reference ahead is connected; else it is extrapolated");
        parameter("loop_delay_samples", s.settings.loop_delay_samples, "Samples by which measurements are late").min(0.0).max(4.0);
        parameter("valve_limit", s.settings.law.limit, "Largest magnitude of the valve command", "V");
        parameter("displacement_shaping", s.settings.law.shaping[0], "Multi-metric: command per displacement of the motion ahead", "V/m" => "V/in");
        parameter("velocity_shaping", s.settings.law.shaping[1], "Multi-metric: command per velocity", "V.s/m" => "V.s/in");
        parameter("acceleration_shaping", s.settings.law.shaping[2], "Multi-metric: command per acceleration", "V.s2/m" => "V.s2/in");
        parameter("jerk_shaping", s.settings.law.shaping[3], "Multi-metric: command per jerk, a difference of two samples", "V.s3/m" => "V.s3/in");
        parameter("shaping_lead_samples", s.settings.shaping_lead_samples, "Multi-metric: samples by which the motion shaped is ahead").min(0.0).max(20.0);
        parameter("tracking_displacement_weight", s.settings.law.tracking_weights[0], "Feedforward: weight of the displacement's error", "1/m");
        parameter("tracking_velocity_weight", s.settings.law.tracking_weights[1], "Feedforward: weight of the velocity's error", "s/m");
        parameter("tracking_acceleration_weight", s.settings.law.tracking_weights[2], "Feedforward: weight of the acceleration's error", "s2/m");
        parameter("move_weight", s.settings.law.move_weight, "Feedforward: weight of the command's change a sample", "1/V");
        parameter("feedback_displacement_weight", s.settings.law.feedback_weights[0], "Feedback: weight of the displacement's error", "1/m");
        parameter("feedback_velocity_weight", s.settings.law.feedback_weights[1], "Feedback: weight of the velocity's error", "s/m");
        parameter("feedback_acceleration_weight", s.settings.law.feedback_weights[2], "Feedback: weight of the acceleration's error", "s2/m");
        parameter("command_weight", s.settings.law.command_weight, "Feedback: weight of the command", "1/V");
        parameter("displacement_measurement_noise", s.settings.law.uncertainty.measurement[0], "Standard deviation of the sensor", "m" => "in");
        parameter("velocity_measurement_noise", s.settings.law.uncertainty.measurement[1], "Standard deviation of the sensor", "m/s" => "in/s");
        parameter("acceleration_measurement_noise", s.settings.law.uncertainty.measurement[2], "Standard deviation of the sensor", "m/s2" => "g");
        parameter("valve_noise", s.settings.law.uncertainty.valve, "Standard deviation of white noise on the valve command", "V");
        parameter("force_noise", s.settings.law.uncertainty.force, "Standard deviation of white noise of the force on the table", "N" => "lbf");
        parameter("force_step", s.settings.law.uncertainty.force_step, "Standard deviation of the unknown force's step a sample", "N" => "lbf");
        parameter("offset_step", s.settings.law.uncertainty.offset_step, "Standard deviation of the step of the valve's offset a sample", "V");
        parameter("seal_friction", s.settings.law.load.friction, "Coulomb friction of the seals; 0: no compensation", "N" => "lbf").min(0.0);
        parameter("seal_presliding", s.settings.law.load.shape.presliding, "Their deflection before they slide", "m" => "in");
        parameter("seal_excess", s.settings.law.load.shape.excess, "Breakaway force over the Coulomb force, less one");
        parameter("seal_stribeck_velocity", s.settings.law.load.shape.stribeck_velocity, "Stribeck velocity", "m/s" => "in/s");
        parameter("seal_sharpness", s.settings.law.load.shape.sharpness, "Exponent with which they begin to slide");
        parameter("seal_relaxation", s.settings.law.load.shape.relaxation, "Damping of their deflection over its stiffness", "s");
        parameter("specimen_known", s.settings.specimen_known, "Whether the specimen's reaction is computed ahead");
        parameter("specimen_mass", s.settings.specimen.mass, "Mass of the specimen", "kg" => "lbf.s2/in");
        parameter("specimen_damping", s.settings.specimen.damping, "Viscous damping of the specimen", "N.s/m" => "lbf.s/in");
        parameter("specimen_yield_force", s.settings.specimen.columns.yield_force, "Yield force of its columns", "N" => "lbf");
        parameter("specimen_yield_displacement", s.settings.specimen.columns.yield_displacement, "Drift at which they yield", "m" => "in");
        parameter("specimen_post_yield_ratio", s.settings.specimen.columns.post_yield_ratio, "Stiffness after yielding over that before; 1: elastic");
        parameter("adaptive", s.settings.adaptive, "Whether the specimen's mass, stiffness and strength are estimated");
        parameter("adaptation_spread", s.settings.adaptation.spread, "Standard deviation of what is known of them, relative");
        parameter("adaptation_drift", s.settings.adaptation.drift, "Standard deviation of what they change by in a second, relative");
        parameter("adaptation_acceleration_noise", s.settings.adaptation.acceleration_noise, "What specimen and model differ by", "m/s2" => "g");
        parameter("adaptation_force_noise", s.settings.adaptation.force_noise, "What the balance of forces is off by", "N" => "lbf");
        parameter("hydraulics_known", s.settings.hydraulics_known, "Whether valve and oil stand for the actuator of Eq 2-4");
        parameter("spool_lag", s.settings.hydraulics.spool_lag, "2 D/w of the spool", "s");
        parameter("spool_inertia", s.settings.hydraulics.spool_inertia, "1/w^2 of the spool", "s2");
        parameter("force_rate", s.settings.hydraulics.force_rate, "Rate of the force under a valve open by one volt", "N/(V.s)" => "lbf/(V.s)");
        parameter("oil_stiffness", s.settings.hydraulics.oil_stiffness, "Stiffness of the oil column", "N/m" => "lbf/in");
        parameter("leakage_rate", s.settings.hydraulics.leakage_rate, "Rate at which leakage empties it", "1/s");
        parameter("seal_damping", s.settings.hydraulics.seal_damping, "Viscous damping of the seals", "N.s/m" => "lbf.s/in");
        parameter("table_mass", s.settings.shake_table.table.mass, "Mass of the table", "kg" => "lbf.s2/in");
        parameter("table_damping", s.settings.shake_table.table.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
        parameter("table_stiffness", s.settings.shake_table.table.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
        parameter("actuator_a2", s.settings.shake_table.actuator.denominator[0], "Actuator, denominator, s^2", "1/s");
        parameter("actuator_a1", s.settings.shake_table.actuator.denominator[1], "Actuator, denominator, s", "1/s2");
        parameter("actuator_a0", s.settings.shake_table.actuator.denominator[2], "Actuator, denominator, constant", "1/s3");
        parameter("actuator_b2", s.settings.shake_table.actuator.voltage_to_force[0], "Valve command to force, s^2", "N/(V.s)" => "lbf/(V.s)");
        parameter("actuator_b1", s.settings.shake_table.actuator.voltage_to_force[1], "Valve command to force, s", "N/(V.s2)" => "lbf/(V.s2)");
        parameter("actuator_b0", s.settings.shake_table.actuator.voltage_to_force[2], "Valve command to force, constant", "N/(V.s3)" => "lbf/(V.s3)");
        parameter("actuator_e2", s.settings.shake_table.actuator.velocity_to_force[0], "Velocity to force, s^2", "N/m" => "lbf/in");
        parameter("actuator_e1", s.settings.shake_table.actuator.velocity_to_force[1], "Velocity to force, s", "N/(m.s)" => "lbf/(in.s)");
        parameter("actuator_e0", s.settings.shake_table.actuator.velocity_to_force[2], "Velocity to force, constant", "N/(m.s2)" => "lbf/(in.s2)");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::Component;
    use fmu_kit::conformance::allocations;

    #[test]
    fn no_role_allocates_in_its_steps_learning_or_not() {
        for role in ROLES.items {
            for adaptive in [false, true] {
                let mut component = PreviewControl::default();
                let settings = &mut component.settings;
                settings.role = role.value;
                settings.adaptive = adaptive;
                settings.specimen_known = true;
                settings.hydraulics_known = true;
                settings.law.load.friction = 13.0;
                settings.loop_delay_samples = 1;
                component.initialize().unwrap();
                let counted = allocations(|| {
                    for k in 0..1000 {
                        let time = PreviewControl::STEP_SIZE * f64::from(k);
                        component.reference.acceleration = 3.0 * (12.0 * time).sin();
                        component
                            .acceleration_ahead
                            .fill(component.reference.acceleration);
                        component.measured.acceleration = 0.9 * component.reference.acceleration;
                        component.specimen_acceleration = -2.0 * (12.0 * time).sin();
                        component.actuator_force = 30.0 * (12.0 * time).sin();
                        component.step(time, PreviewControl::STEP_SIZE).unwrap();
                    }
                });
                assert_eq!(counted, 0, "{} {adaptive}", role.name);
                // What stands still would prove nothing.
                assert!(component.valve_command.abs() > 1e-6, "{}", role.name);
                let known = component.settings.specimen.mass;
                let learns = adaptive && role.name != "multi-metric";
                assert_eq!(component.specimen_mass != known, learns, "{}", role.name);
            }
        }
    }
}
