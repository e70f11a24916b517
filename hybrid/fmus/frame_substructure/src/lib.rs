#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! The computed frame of the two-actuator benchmark as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use hybrid::marths::{Freedom, InterfaceForce, Newmark, PERIOD, Structure};
use serde::{Deserialize, Serialize};

/// A frame under the ground and the specimen's force.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct FrameSubstructure {
    whole: bool,
    frame: Option<Newmark>,
    force: InterfaceForce,
    ground: f64,
    motion: [f64; 6],
}

const FORCES: [&str; 4] = ["force", "moment", "other_moment", "ground_acceleration"];

impl Component for FrameSubstructure {
    const NAME: &'static str = "FrameSubstructure";
    const DESCRIPTION: &'static str =
        "A three-storey frame without its specimen, for hybrid simulation";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("force", s.force.force, "Force of the specimen on the interface", "N" => "kN").nominal(1e4);
            input("moment", s.force.moment, "Moment of the specimen on the interface", "N.m").nominal(1e3);
            input("other_moment", s.force.other_moment, "Moment of the specimen on its other upper joint", "N.m").nominal(1e2);
            input("ground_acceleration", s.ground, "Acceleration of the ground", "m/s2" => "g").nominal(3.0);
            output("translation", s.motion[0], "Translation of the interface", "m" => "mm").discrete().nominal(5e-3).depends_on(&FORCES, Dependent);
            output("rotation", s.motion[1], "Rotation of the interface, in the coupler's axes", "rad").discrete().nominal(1e-2).depends_on(&FORCES, Dependent);
            output("storey_2_translation", s.motion[2], "Translation of storey 2", "m" => "mm").discrete().nominal(1e-2).depends_on(&FORCES, Dependent);
            output("storey_2_rotation", s.motion[3], "Rotation of a joint of storey 2", "rad").discrete().nominal(1e-2).depends_on(&FORCES, Dependent);
            output("storey_3_translation", s.motion[4], "Translation of storey 3", "m" => "mm").discrete().nominal(1e-2).depends_on(&FORCES, Dependent);
            output("storey_3_rotation", s.motion[5], "Rotation of a joint of storey 3", "rad").discrete().nominal(1e-2).depends_on(&FORCES, Dependent);
            parameter("whole", s.whole, "Whether the frame keeps what the specimen stands for");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        let structure = if self.whole {
            Structure::reference()
        } else {
            Structure::numerical()?
        };
        self.frame = Some(Newmark::new(&structure)?);
        self.motion = [0.0; 6];
        Ok(())
    }

    fn step(&mut self, time: f64, _step_size: f64) -> ComponentResult {
        let Some(frame) = &mut self.frame else {
            return Ok(());
        };
        frame.propose(self.ground);
        frame.accept(self.force.by_freedom());
        self.motion = Freedom::COMPARED.map(|(freedom, sign)| sign * frame.displacement(freedom));
        if self.motion.iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        Err(format!("the frame's motion is no longer finite at t = {time} s").into())
    }
}

fmu_kit::export!(FrameSubstructure);
