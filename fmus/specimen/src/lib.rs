#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Linear specimen on the table as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Constant, Dependency::Fixed, Variable};
use plant::specimen::{LinearSpecimen, SampledSpecimen, SpecimenState};
use serde::{Deserialize, Serialize};

/// The linear specimen between the table's acceleration and its force on the table.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Specimen {
    specimen: LinearSpecimen,
    state: SpecimenState,
    table_acceleration: f64,
    force: f64,
    acceleration: f64,
    drift_acceleration: f64,
    #[serde(skip)]
    sampled: Option<SampledSpecimen>,
}

impl Component for Specimen {
    const NAME: &'static str = "Specimen";
    const DESCRIPTION: &'static str = "Linear one-storey specimen on a shake table";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const PARTIAL_DERIVATIVES: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("table_acceleration", s.table_acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0);
            output("force", s.force, "Force on the table", "N" => "lbf")
                .nominal(400.0).depends_on(&["drift", "drift_velocity"], Fixed);
            output("acceleration", s.acceleration, "Absolute acceleration of the mass", "m/s2" => "g")
                .nominal(10.0).depends_on(&["drift", "drift_velocity"], Fixed);
            output("drift", s.state.drift, "Displacement relative to the table", "m" => "in").nominal(0.05);
            output("drift_velocity", s.state.drift_velocity, "Velocity relative to the table", "m/s" => "in/s")
                .nominal(0.3).derivative_of("drift");
            parameter("mass", s.specimen.mass, "Mass of the storey", "kg" => "lbf.s2/in");
            parameter("damping", s.specimen.damping, "Viscous damping of the storey", "N.s/m" => "lbf.s/in");
            parameter("stiffness", s.specimen.stiffness, "Stiffness of the storey", "N/m" => "lbf/in");
            local("der(drift_velocity)", s.drift_acceleration, "Acceleration relative to the table", "m/s2" => "g")
                .derivative_of("drift_velocity")
                .depends_on(&["table_acceleration"], Constant)
                .depends_on(&["drift", "drift_velocity"], Fixed)
                .initially_depends_on(&["table_acceleration"]);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.specimen.validate()?;
        self.state = SpecimenState::default();
        self.sampled = Some(self.specimen.sample(Self::STEP_SIZE));
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        self.force = self.specimen.force(&self.state);
        self.acceleration = self.specimen.acceleration(&self.state);
        self.drift_acceleration = self.acceleration - self.table_acceleration;
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        let kept = self.sampled.filter(|sampled| sampled.step() == step_size);
        let sampled = kept.unwrap_or_else(|| self.specimen.sample(step_size));
        self.sampled = Some(sampled);
        self.state = sampled.advance(&self.state, self.table_acceleration);
        Ok(())
    }

    fn partial_derivative(&self, unknown: &str, known: &str) -> f64 {
        let force = match known {
            "drift" => self.specimen.stiffness,
            "drift_velocity" => self.specimen.damping,
            _ => return -1.0,
        };
        if unknown == "force" {
            force
        } else {
            -force / self.specimen.mass
        }
    }
}

fmu_kit::export!(Specimen);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::number;

    #[test]
    fn parameters_and_state_arrive_where_they_belong() {
        let mut component = Specimen::default();
        let names = [
            "mass",
            "damping",
            "stiffness",
            "drift",
            "drift_velocity",
            "table_acceleration",
        ];
        number(&mut component, &names);
        let expected = LinearSpecimen {
            mass: 1.0,
            damping: 2.0,
            stiffness: 3.0,
        };
        assert_eq!(component.specimen, expected);
        component.update_outputs(0.0);
        // force = k d + c d' = 12 + 10; acceleration = -force / m; d'' = acceleration - 6.
        assert_eq!(component.force, 22.0);
        assert_eq!(component.acceleration, -22.0);
        assert_eq!(component.drift_acceleration, -28.0);
    }
}
