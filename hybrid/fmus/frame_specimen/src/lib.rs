#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! The specimen of the two-actuator benchmark as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use hybrid::marths::{InterfaceForce, JointMotion, PERIOD, Specimen};
use serde::{Deserialize, Serialize};

/// Two columns and a beam, held at one joint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct FrameSpecimen {
    specimen: Option<Specimen>,
    motion: JointMotion,
    force: InterfaceForce,
}

const MOTION: [&str; 2] = ["translation", "rotation"];

impl Component for FrameSpecimen {
    const NAME: &'static str = "FrameSpecimen";
    const DESCRIPTION: &'static str =
        "Two columns and a beam that are held at one joint, for hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("translation", s.motion.translation, "Translation of the held joint", "m" => "mm").nominal(5e-3);
            input("rotation", s.motion.rotation, "Rotation of the held joint", "rad").nominal(1e-2);
            output("force", s.force.force, "Force on the interface", "N" => "kN").discrete().nominal(1e4).depends_on(&MOTION, Dependent);
            output("moment", s.force.moment, "Moment on the interface", "N.m").discrete().nominal(1e3).depends_on(&MOTION, Dependent);
            output("other_moment", s.force.other_moment, "Moment on the other upper joint", "N.m").discrete().nominal(1e2).depends_on(&MOTION, Dependent);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.specimen = Some(Specimen::new()?);
        self.force = InterfaceForce::default();
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        if let Some(specimen) = &mut self.specimen {
            self.force = specimen.step(self.motion);
        }
        Ok(())
    }
}

fmu_kit::export!(FrameSpecimen);
