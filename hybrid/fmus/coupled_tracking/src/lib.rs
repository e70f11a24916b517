#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking laws for two coupled actuators as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Enumeration, Item, Variable};
use hybrid::laws::extrapolation::WINDOW_SAMPLES;
use hybrid::marths::laws::{DecentralisedAdaptive, NoControl, Predictive, PredictiveDesign};
use hybrid::marths::names::{COMMAND, MEASURED_STROKE};
use hybrid::marths::{PERIOD, Pair, Volts};
use serde::{Deserialize, Serialize};

/// From two targets and measured strokes to two commands.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct CoupledTracking {
    choice: i32,
    design: PredictiveDesign,
    law: Option<Law>,
    target: Pair,
    measured: Pair,
    command: Pair,
    volt: Pair,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
enum Law {
    Predictive(Box<Predictive>),
    DecentralisedAdaptive(Box<DecentralisedAdaptive>),
    None,
}

const LAWS: Enumeration = Enumeration {
    name: "CoupledLaw",
    items: &[
        Item {
            name: "predictive",
            value: 0,
            description: "Both actuators at once over a horizon",
        },
        Item {
            name: "decentralised_adaptive",
            value: 1,
            description: "The benchmark's sample law",
        },
        Item {
            name: "none",
            value: 2,
            description: "The targets are the commands",
        },
    ],
};

const SIGNALS: [&str; 4] = [
    "target[1]",
    "target[2]",
    MEASURED_STROKE[0],
    MEASURED_STROKE[1],
];

impl Component for CoupledTracking {
    const NAME: &'static str = "CoupledTracking";
    const DESCRIPTION: &'static str = "Tracking laws for two coupled actuators";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const STEP_SIZE: f64 = PERIOD;
    const ANY_STEP_SIZE: bool = false;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input("target[1]", s.target[0], "Target stroke of actuator 1", "m" => "mm").nominal(5e-3);
            input("target[2]", s.target[1], "Target stroke of actuator 2", "m" => "mm").nominal(5e-3);
            input(MEASURED_STROKE[0], s.measured[0], "Measured stroke of actuator 1", "m" => "mm").nominal(5e-3);
            input(MEASURED_STROKE[1], s.measured[1], "Measured stroke of actuator 2", "m" => "mm").nominal(5e-3);
            output(COMMAND[0], s.command[0], "Command of actuator 1", "m" => "mm").discrete().nominal(5e-3).depends_on(&SIGNALS, Dependent);
            output(COMMAND[1], s.command[1], "Command of actuator 2", "m" => "mm").discrete().nominal(5e-3).depends_on(&SIGNALS, Dependent);
            output("volt[1]", s.volt[0], "Command 1 in volt", "V").discrete().nominal(1.0).depends_on(&SIGNALS, Dependent);
            output("volt[2]", s.volt[1], "Command 2 in volt", "V").discrete().nominal(1.0).depends_on(&SIGNALS, Dependent);
            parameter("adaptive", s.design.adaptive, "Whether the model of `predictive` follows the measurement");
            parameter("horizon_samples", s.design.horizon, "Horizon of `predictive`, samples").min(2.0).max(24.0);
            parameter("order", s.design.order, "Order of the polynomials that continue the targets").min(0.0).max(5.0);
            parameter(WINDOW_SAMPLES, s.design.window, "Samples that they are fitted to").min(6.0).max(32.0);
            parameter("effort", s.design.effort, "Weight of the commands against the strokes' errors").min(0.0);
        };
        variables
            .push(Variable::choice("law", LAWS, |s: &mut Self| &mut s.choice).about("The law"));
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.law = Some(match self.choice {
            0 => Law::Predictive(Box::new(Predictive::new(self.design)?)),
            1 => Law::DecentralisedAdaptive(Box::default()),
            _ => Law::None,
        });
        self.command = [0.0; 2];
        self.volt = Volts::default().of(self.command);
        Ok(())
    }

    fn step(&mut self, _time: f64, _step_size: f64) -> ComponentResult {
        let law: &mut dyn hybrid::marths::laws::Law = match &mut self.law {
            Some(Law::Predictive(law)) => law.as_mut(),
            Some(Law::DecentralisedAdaptive(law)) => law.as_mut(),
            _ => &mut NoControl,
        };
        law.feedback(self.measured);
        self.command = law.step(self.target, self.measured);
        self.volt = Volts::default().of(self.command);
        Ok(())
    }
}

fmu_kit::export!(CoupledTracking);
