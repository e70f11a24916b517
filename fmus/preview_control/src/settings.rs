//! The parameters of the FMU and what the controller is built from.

use controllers::preview::adaptation::Adaptation;
use controllers::preview::load::KnownLoad;
use controllers::preview::model::{Hydraulics, RigModel};
use controllers::preview::{Parameters, Role};
use fmu_kit::{Enumeration, Item, Variable};
use plant::identified::shake_table::ShakeTable;
use plant::specimens::YieldingSpecimen;
use serde::{Deserialize, Serialize};
use units::vocabulary::{SPECIMEN_DAMPING, SPECIMEN_MASS};

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
        }
    }
}

impl Settings {
    /// What the controller is built from.
    pub fn parameters(&self, period: f64) -> Parameters {
        Parameters {
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
            period,
            ..self.law
        }
    }
}

/// The table's rows of the parameters.
pub fn variables() -> Vec<Variable<PreviewControl>> {
    fmu_kit::table! { PreviewControl, s:
        group(s.settings.law);
        group(s.settings.law.load);
        parameter("specimen_known", s.settings.specimen_known, "Whether the specimen's reaction is computed ahead");
        parameter(SPECIMEN_MASS, s.settings.specimen.mass, "Mass of the specimen", "kg" => "lbf.s2/in");
        parameter(SPECIMEN_DAMPING, s.settings.specimen.damping, "Viscous damping of the specimen", "N.s/m" => "lbf.s/in");
        parameter("specimen_yield_force", s.settings.specimen.columns.yield_force, "Yield force of its columns", "N" => "lbf");
        parameter("specimen_yield_displacement", s.settings.specimen.columns.yield_displacement, "Drift at which they yield", "m" => "in");
        parameter("specimen_post_yield_ratio", s.settings.specimen.columns.post_yield_ratio, "Stiffness after yielding over that before; 1: elastic");
        parameter("adaptive", s.settings.adaptive, "Whether the specimen's mass, stiffness and strength are estimated");
        group(s.settings.adaptation);
        parameter("hydraulics_known", s.settings.hydraulics_known, "Whether valve and oil stand for the actuator of Eq 2-4");
        group(s.settings.hydraulics);
        group(s.settings.shake_table.table);
        group(s.settings.shake_table.actuator);
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
                settings.law.delay = 1;
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
