#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Clipped-optimal control of a magnetorheological damper as an FMU.

use controllers::Controller;
use controllers::clipped_optimal::{
    ClippedOptimal, ClippedOptimalDesign, ClippedOptimalInput, DamperControl,
};
use fmu_kit::{Causality, Component, ComponentResult, Dependency::Dependent, Variable};
use fmu_kit::{Enumeration, Item};
use plant::specimens::MAX_STOREYS;
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// From floors' accelerations and damper's force to its voltage.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ClippedOptimalControl {
    design: ClippedOptimalDesign,
    storeys: i32,
    damper_storey: i32,
    control: i32,
    law: Option<ClippedOptimal>,
    input: ClippedOptimalInput,
    voltage: f64,
    wanted_force: f64,
}

impl Default for ClippedOptimalControl {
    fn default() -> Self {
        let design = ClippedOptimalDesign::default();
        Self {
            storeys: design.storeys as i32,
            damper_storey: design.damper_storey as i32 + 1,
            control: 0,
            design,
            law: None,
            input: ClippedOptimalInput::default(),
            voltage: 0.0,
            wanted_force: 0.0,
        }
    }
}

const CONTROLS: Enumeration = Enumeration {
    name: "DamperControl",
    items: &[
        item(
            "clipped_optimal",
            0,
            "All voltage or none, after the best force",
        ),
        item("passive_off", 1, "No voltage"),
        item("passive_on", 2, "All voltage"),
    ],
};

const fn item(name: &'static str, value: i32, description: &'static str) -> Item {
    Item {
        name,
        value,
        description,
    }
}

fn each(
    name: &str,
    causality: Causality,
    about: &str,
    [unit, shown]: [&'static str; 2],
    field: fn(&mut ClippedOptimalControl) -> &mut [f64],
) -> Vec<Variable<ClippedOptimalControl>> {
    let elements = Variable::array(name, causality, MAX_STOREYS, field).into_iter();
    let named = elements.enumerate().map(|(i, element)| {
        let about = format!("{about} {}", i + 1);
        element.about(&about).unit(unit).shown_in(shown)
    });
    named.collect()
}

impl Component for ClippedOptimalControl {
    const NAME: &'static str = "ClippedOptimalControl";
    const DESCRIPTION: &'static str = "Clipped-optimal control of a magnetorheological damper";
    const DOCUMENTATION: &'static str = include_str!("../README.md");

    fn variables() -> Vec<Variable<Self>> {
        let mut inputs: Vec<String> = (1..=MAX_STOREYS)
            .map(|i| format!("floor_acceleration[{i}]"))
            .collect();
        inputs.push("damper_force".into());
        let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
        let mut variables = fmu_kit::table! { Self, s:
            input("damper_force", s.input.damper_force, "Force of the damper against the drift of its storey", "N" => "lbf").nominal(50.0);
            output("voltage", s.voltage, "Voltage of the damper's driver", "V")
                .discrete().nominal(1.0).depends_on(&inputs, Dependent);
            output("wanted_force", s.wanted_force, "The force that would be best", "N" => "lbf")
                .discrete().nominal(50.0).depends_on(&inputs, Dependent);
            parameter("storeys", s.storeys, "Number of storeys").min(1.0).max(10.0);
            parameter(vocabulary::DAMPER_STOREY, s.damper_storey, "Storey of the damper, the lowest 1").min(1.0).max(10.0);
            parameter(vocabulary::ACCELERATION_WEIGHT, s.design.acceleration_weight, "Weight of each floor's absolute acceleration", "s2/m").min(0.0);
            parameter("drift_weight", s.design.drift_weight, "Weight of each storey's drift", "1/m").min(0.0);
            parameter("force_weight", s.design.force_weight, "Weight of the force", "1/N").min(0.0);
            parameter("ground_noise", s.design.ground_noise, "White noise that the ground's acceleration is taken for, one standard deviation", "m/s2" => "g").min(0.0);
            parameter(vocabulary::SENSOR_NOISE, s.design.measurement_noise, "Noise of the measured accelerations, one standard deviation", "m/s2" => "g").min(0.0);
            parameter("largest_voltage", s.design.largest_voltage, "The voltage that is given", "V").min(0.0);
        };
        variables.push(
            Variable::choice("control", CONTROLS, |s: &mut Self| &mut s.control)
                .about("What the damper is told"),
        );
        for (name, causality, about, units, field) in [
            (
                "floor_acceleration",
                Causality::Input,
                "Absolute acceleration of floor",
                ["m/s2", "g"],
                (|s| &mut s.input.floor_acceleration) as fn(&mut Self) -> &mut [f64],
            ),
            (
                "mass",
                Causality::Parameter,
                "Mass of floor",
                ["kg", "lbf.s2/in"],
                |s| &mut s.design.mass,
            ),
            (
                "damping",
                Causality::Parameter,
                "Viscous damping of storey",
                ["N.s/m", "lbf.s/in"],
                |s| &mut s.design.damping,
            ),
            (
                "stiffness",
                Causality::Parameter,
                "Stiffness of storey before it yields",
                ["N/m", "lbf/in"],
                |s| &mut s.design.stiffness,
            ),
        ] {
            variables.extend(each(name, causality, about, units, field));
        }
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        let index = |from_one: i32| usize::try_from(from_one - 1).unwrap_or(usize::MAX - 1);
        let design = ClippedOptimalDesign {
            storeys: usize::try_from(self.storeys).unwrap_or(0),
            damper_storey: index(self.damper_storey),
            control: match self.control {
                0 => DamperControl::ClippedOptimal,
                1 => DamperControl::PassiveOff,
                _ => DamperControl::PassiveOn,
            },
            ..self.design
        };
        let law = design.law(units::constants::SAMPLING_PERIOD)?;
        law.validate()?;
        self.law = Some(law);
        (self.voltage, self.wanted_force) = (0.0, 0.0);
        Ok(())
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if let Some(law) = &mut self.law {
            self.voltage = law.step(&self.input, step_size);
            self.wanted_force = law.wanted_force();
        }
        Ok(())
    }
}

fmu_kit::export!(ClippedOptimalControl);
