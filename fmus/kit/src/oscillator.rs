//! A mass on a spring, the component of the kit's own tests: `m a + k x = force`.

use serde::{Deserialize, Serialize};

use crate::{
    component::{Component, ComponentResult},
    fault::Status,
    instance::Instance,
    log::{Log, Sink},
    model::Model,
    phase::Kind,
    variable::{Dependency, Variable},
};

#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Oscillator {
    pub force: f64,
    pub position: f64,
    pub velocity: f64,
    acceleration: f64,
    pub mass: f64,
    stiffness: f64,
    steps: i32,
    note: String,
}

impl Default for Oscillator {
    fn default() -> Self {
        Self {
            force: 0.0,
            position: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
            mass: 2.0,
            stiffness: 50.0,
            steps: 0,
            note: "a < b & \"c\"".into(),
        }
    }
}

pub(crate) const FORCE: u32 = 1;
pub(crate) const POSITION: u32 = 2;
pub(crate) const VELOCITY: u32 = 3;
pub(crate) const ACCELERATION: u32 = 4;
pub(crate) const MASS: u32 = 5;
pub(crate) const STEPS: u32 = 7;
pub(crate) const NOTE: u32 = 8;

impl Component for Oscillator {
    const NAME: &'static str = "Oscillator";
    const DESCRIPTION: &'static str = "A mass on a spring";
    const PARTIAL_DERIVATIVES: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        crate::table! { Self, s:
            input("force", s.force, "Force on the mass", "N" => "lbf");
            output("position", s.position, "Position", "m" => "in");
            output("velocity", s.velocity, "Velocity", "m/s").derivative_of("position");
            output("acceleration", s.acceleration, "Acceleration", "m/s2" => "g")
                .derivative_of("velocity")
                .depends_on(&["position", "force"], Dependency::Fixed)
                .initially_depends_on(&["force", "mass"]);
            parameter("mass", s.mass, "Mass", "kg").min(0.1);
            parameter("stiffness", s.stiffness, "Stiffness", "N/m");
            output("steps", s.steps, "Steps done");
            parameter("note", s.note, "Free text <&>");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        if self.mass > 1e6 {
            return Err("parameter `mass` is too large".into());
        }
        (self.position, self.velocity, self.steps) = (0.0, 0.0, 0);
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        self.acceleration = (self.force - self.stiffness * self.position) / self.mass;
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        assert!(self.force != 666.0, "a force that makes the step panic");
        if self.force == 13.0 {
            return Err("a force that the step refuses".into());
        }
        self.update_outputs(0.0);
        self.velocity += step_size * self.acceleration;
        self.position += step_size * self.velocity;
        self.steps += 1;
        Ok(())
    }

    fn partial_derivative(&self, _unknown: &str, known: &str) -> f64 {
        if known == "force" {
            1.0 / self.mass
        } else {
            -self.stiffness / self.mass
        }
    }
}

pub(crate) fn instance(kind: Kind) -> Instance<Oscillator> {
    let model = Model::get().unwrap();
    Instance::new(
        model,
        Oscillator::default(),
        kind,
        Log::new(Sink::None, c"it", false),
    )
}

/// An instance that stands at t = 0 in step or event mode.
pub(crate) fn running(kind: Kind) -> Instance<Oscillator> {
    let mut instance = instance(kind);
    instance.set_up(0.0, None).unwrap();
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    instance
}

/// The message of a refusal.
pub(crate) fn refusal<T: std::fmt::Debug>(outcome: crate::fault::Outcome<T>) -> String {
    let fault = outcome.unwrap_err();
    assert_eq!(fault.status, Status::Error);
    fault.message
}
