#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Yielding specimen on the table as an FMU.

use fmu_kit::{
    Component, ComponentResult,
    Dependency::{Constant, Dependent},
    Event, Terminal, Variable,
};
use plant::specimens::{YieldingSpecimen as Storey, YieldingState};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// The yielding specimen between the table's acceleration and its force on the table.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct YieldingSpecimen {
    storey: Storey,
    state: YieldingState,
    rates: YieldingState,
    table_acceleration: f64,
    force: f64,
    acceleration: f64,
    break_off_time: f64,
}

/// A specimen that never breaks off.
const NEVER: f64 = 1e9;

impl Default for YieldingSpecimen {
    fn default() -> Self {
        Self {
            storey: Storey::default(),
            state: YieldingState::default(),
            rates: YieldingState::default(),
            table_acceleration: 0.0,
            force: 0.0,
            acceleration: 0.0,
            break_off_time: NEVER,
        }
    }
}

impl YieldingSpecimen {
    fn is_off(&self, time: f64) -> bool {
        time >= self.break_off_time - 1e-9
    }
}

impl Component for YieldingSpecimen {
    const NAME: &'static str = "YieldingSpecimen";
    const DESCRIPTION: &'static str = "Yielding one-storey specimen on a shake table";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::plug(
            "mount",
            "mount",
            &[
                ("acceleration", vocabulary::TABLE_ACCELERATION),
                ("force", "force"),
            ],
        ),
        Terminal::plug(
            "motion",
            "specimen-motion",
            &[("acceleration", "acceleration")],
        ),
    ];

    fn variables() -> Vec<Variable<Self>> {
        const STATES: [&str; 3] = [
            "drift",
            vocabulary::DRIFT_VELOCITY,
            "hysteretic_force_ratio",
        ];
        const MEMORY: [&str; 3] = [
            vocabulary::DRIFT_VELOCITY,
            "hysteretic_force_ratio",
            "hysteretic_work",
        ];
        fmu_kit::table! { Self, s:
            input(vocabulary::TABLE_ACCELERATION, s.table_acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0);
            output("force", s.force, "Force on the table", "N" => "lbf")
                .nominal(400.0).depends_on(&STATES, Dependent);
            output("acceleration", s.acceleration, "Absolute acceleration of the mass", "m/s2" => "g")
                .nominal(10.0).depends_on(&STATES, Dependent);
            output("drift", s.state.drift, "Displacement relative to the table", "m" => "in").nominal(0.05);
            output(vocabulary::DRIFT_VELOCITY, s.state.drift_velocity, "Velocity relative to the table", "m/s" => "in/s")
                .nominal(0.3).derivative_of("drift");
            group(s.storey);
            parameter("break_off_time", s.break_off_time, "Fault: the specimen is off the table from this time on", "s");
            local("hysteretic_force_ratio", s.state.hysteresis.z, "Hysteretic force over its yield force").nominal(1.0);
            local("hysteretic_work", s.state.hysteresis.work, "Work on the hysteretic part over yield force and displacement").nominal(10.0);
            local("der(drift_velocity)", s.rates.drift_velocity, "Acceleration relative to the table", "m/s2" => "g")
                .derivative_of(vocabulary::DRIFT_VELOCITY)
                .depends_on(&[vocabulary::TABLE_ACCELERATION], Constant).depends_on(&STATES, Dependent)
                .initially_depends_on(&[vocabulary::TABLE_ACCELERATION]);
            local("der(hysteretic_force_ratio)", s.rates.hysteresis.z, "Rate of the hysteretic force ratio", "1/s")
                .derivative_of("hysteretic_force_ratio").depends_on(&MEMORY, Dependent);
            local("der(hysteretic_work)", s.rates.hysteresis.work, "Rate of the hysteretic work", "1/s")
                .derivative_of("hysteretic_work").depends_on(&[vocabulary::DRIFT_VELOCITY, "hysteretic_force_ratio"], Dependent);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.storey.validate()?;
        self.state = YieldingState::default();
        Ok(())
    }

    fn update_outputs(&mut self, time: f64) {
        if self.is_off(time) {
            (self.force, self.acceleration) = (0.0, 0.0);
            self.state.drift_velocity = 0.0;
            self.rates = YieldingState::default();
            return;
        }
        self.force = self.storey.force(&self.state);
        self.acceleration = self.storey.acceleration(&self.state);
        self.rates = self
            .storey
            .derivatives(&self.state, self.table_acceleration);
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        if self.is_off(time) {
            return Ok(());
        }
        self.state = self
            .storey
            .advance(&self.state, self.table_acceleration, step_size);
        if self.state.drift.is_finite() && self.state.hysteresis.z.is_finite() {
            return Ok(());
        }
        Err(format!(
            "the drift is no longer finite after t = {} s",
            time + step_size
        )
        .into())
    }

    fn handle_event(&mut self, time: f64) -> Result<Event, Box<dyn std::error::Error>> {
        let ahead = self.break_off_time < NEVER && !self.is_off(time);
        Ok(Event {
            states_changed: self.is_off(time) && self.state.drift_velocity != 0.0,
            next_event_time: ahead.then_some(self.break_off_time),
        })
    }
}

fmu_kit::export!(YieldingSpecimen);
