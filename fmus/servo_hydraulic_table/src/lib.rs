#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Servo-hydraulic shake table from first principles as an FMU.

use fmu_kit::{
    Component, ComponentResult,
    Dependency::{Dependent, Fixed},
    Event, Terminal, Variable,
};
use plant::servo_hydraulic::{
    ExtendedServoHydraulicState, ExtendedServoHydraulicTable as Rig, ServoHydraulicInput,
    ServoHydraulicState, Supply,
};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// The physical table between valve command, specimen force and motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ServoHydraulicTable {
    rig: Rig,
    state: ExtendedServoHydraulicState,
    /// Step on which the memory of a late command is built, s; 0 before the first one.
    period: f64,
    rates: ServoHydraulicState,
    valve_command: f64,
    specimen_force: f64,
    actuator_force: f64,
    supply_flow: f64,
    supply_loss_time: f64,
    estimate_error: bool,
    displacement_error: f64,
    stop_hit: bool,
}

/// A supply that is never lost.
const NEVER: f64 = 1e9;

impl Default for ServoHydraulicTable {
    fn default() -> Self {
        let rig = Rig::default();
        Self {
            rig,
            state: rig.rest(),
            period: 0.0,
            rates: ServoHydraulicState::default(),
            valve_command: 0.0,
            specimen_force: 0.0,
            actuator_force: 0.0,
            supply_flow: 0.0,
            supply_loss_time: NEVER,
            estimate_error: false,
            displacement_error: 0.0,
            stop_hit: false,
        }
    }
}

impl ServoHydraulicTable {
    fn input(&self, time: f64) -> ServoHydraulicInput {
        ServoHydraulicInput {
            valve_command: self.valve_command,
            specimen_force: self.specimen_force,
            supply_lost: time >= self.supply_loss_time - 1e-9,
        }
    }
}

impl Component for ServoHydraulicTable {
    const NAME: &'static str = "ServoHydraulicTable";
    const DESCRIPTION: &'static str = "Uniaxial servo-hydraulic shake table from first principles";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const TERMINALS: &'static [Terminal] = &[
        Terminal::VALVE,
        Terminal::bus(
            "motion",
            "motion",
            &[
                ("displacement", "displacement"),
                ("velocity", "velocity"),
                ("acceleration", "acceleration"),
                ("force", vocabulary::ACTUATOR_FORCE),
            ],
        ),
        Terminal::plug(
            "mount",
            "mount",
            &[
                ("acceleration", "acceleration"),
                ("force", vocabulary::SPECIMEN_FORCE),
            ],
        ),
    ];

    fn variables() -> Vec<Variable<Self>> {
        const MOTION: [&str; 2] = ["displacement", "velocity"];
        const OIL: [&str; 3] = ["pressure_a", "pressure_b", "seal_deflection"];
        const CHAMBERS: [&str; 6] = [
            "pressure_a",
            "pressure_b",
            "supply_pressure",
            "spool",
            "displacement",
            "velocity",
        ];
        const VALVE: [&str; 7] = [
            "null_leakage",
            vocabulary::PUMP_PRESSURE,
            "pump_gain",
            "pump_limit",
            vocabulary::BULK_MODULUS,
            vocabulary::OIL_VOLUME,
            vocabulary::PISTON_LEAKAGE,
        ];
        fmu_kit::table! { Self, s:
            input(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0);
            input(vocabulary::SPECIMEN_FORCE, s.specimen_force, "Force of the specimen on the table", "N" => "lbf")
                .nominal(400.0);
            output("displacement", s.state.table.displacement, "Displacement of the table", "m" => "in")
                .nominal(0.0381);
            output("velocity", s.state.table.velocity, "Velocity of the table", "m/s" => "in/s")
                .nominal(0.5).derivative_of("displacement");
            output("acceleration", s.rates.velocity, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0).derivative_of("velocity")
                .depends_on(&[vocabulary::SPECIMEN_FORCE], Fixed).depends_on(&MOTION, Dependent).depends_on(&OIL, Dependent)
                .initially_depends_on(&[vocabulary::SPECIMEN_FORCE, vocabulary::TABLE_MASS, vocabulary::ADDED_PAYLOAD]);
            output(vocabulary::ACTUATOR_FORCE, s.actuator_force, "Force of the actuator on the table", "N" => "lbf")
                .nominal(400.0).depends_on(&MOTION, Dependent).depends_on(&OIL, Dependent);
            output("supply_pressure", s.state.table.supply_pressure, "Pressure of the supply", "Pa" => "psi")
                .nominal(2e7).initially_depends_on(&VALVE);
            output("supply_flow", s.supply_flow, "Flow that the valve draws from the supply", "m3/s" => "in3/s")
                .nominal(2e-4).depends_on(&["pressure_a", "pressure_b", "supply_pressure", "spool"], Dependent)
                .initially_depends_on(&VALVE);
            parameter("estimate_error", s.estimate_error, "Estimate the error of every step");
            group(s.rig.table.supply);
            parameter("command_delay.delay", s.rig.command_delay, "Pure delay of the command, at most 30 steps; 0 is off", "s" => "ms").min(0.0);
            parameter("valve_hysteresis.half_width", s.rig.hysteresis, "Half width of the play between command and spool; 0 is off", "V").min(0.0);
            parameter("foundation_compliance.frequency", s.rig.foundation.frequency, "Natural frequency of the reaction mass, relative to which the piston moves; 0 is rigid", "Hz").min(0.0);
            parameter("foundation_compliance.mass_ratio", s.rig.foundation.mass_ratio, "Reaction mass in masses of the table", "1").min(1e-3);
            parameter("foundation_compliance.damping_ratio", s.rig.foundation.damping_ratio, "Damping ratio of the reaction mass", "1").min(0.0);
            parameter("supply_loss_time", s.supply_loss_time, "Fault: the supply is lost from this time on", "s");
            parameter(Supply::SUPPLY_DRAIN_TIME, s.rig.table.supply.drain_time, "Time constant at which a lost supply drains", "s");
            group(s.rig.table.valve);
            group(s.rig.table.cylinder);
            group(s.rig.table.friction);
            group(s.rig.table.stops);
            group(s.rig.table.table);
            parameter(vocabulary::ADDED_PAYLOAD, s.rig.table.added_payload, "Mass on the table that a model does not know of", "kg" => "lbf.s2/in");
            parameter(vocabulary::CUBIC_STIFFNESS, s.rig.table.cubic_stiffness, "Factor of an additional force with the cube of the displacement", "N/m3" => "lbf/in3");
            local("stop_hit", s.stop_hit, "Whether a hard stop is touched");
            local("displacement_error", s.displacement_error, "Estimated error of the displacement made in the last step, if asked for", "m" => "in")
                .discrete().nominal(1e-6);
            local("spool", s.state.table.spool, "Position of the spool", "V").nominal(10.0);
            local("spool_velocity", s.state.table.spool_velocity, "Velocity of the spool", "V/s")
                .nominal(1e3).derivative_of("spool");
            local("pressure_a", s.state.table.pressures[0], "Pressure of chamber A, which extends the rod", "Pa" => "psi")
                .nominal(1e7).initially_depends_on(&VALVE);
            local("pressure_b", s.state.table.pressures[1], "Pressure of chamber B", "Pa" => "psi")
                .nominal(1e7).initially_depends_on(&VALVE);
            local("seal_deflection", s.state.table.seal_deflection, "Deflection of the seals", "m" => "in")
                .nominal(2e-5);
            local("der(spool_velocity)", s.rates.spool_velocity, "Acceleration of the spool", "V/s2")
                .derivative_of("spool_velocity")
                .depends_on(&[vocabulary::VALVE_COMMAND], Dependent).depends_on(&["spool", "spool_velocity"], Fixed)
                .initially_depends_on(&[vocabulary::VALVE_COMMAND, vocabulary::VALVE_NULL_BIAS, "spool_travel_limit", "spool_slew_limit", vocabulary::VALVE_FREQUENCY]);
            local("der(pressure_a)", s.rates.pressures[0], "Rate of the pressure of chamber A", "Pa/s")
                .derivative_of("pressure_a").depends_on(&CHAMBERS, Dependent).initially_depends_on(&VALVE);
            local("der(pressure_b)", s.rates.pressures[1], "Rate of the pressure of chamber B", "Pa/s")
                .derivative_of("pressure_b").depends_on(&CHAMBERS, Dependent).initially_depends_on(&VALVE);
            local("der(seal_deflection)", s.rates.seal_deflection, "Rate of the seals' deflection", "m/s")
                .derivative_of("seal_deflection").depends_on(&["velocity", "seal_deflection"], Dependent);
            local("der(supply_pressure)", s.rates.supply_pressure, "Rate of the supply pressure", "Pa/s")
                .derivative_of("supply_pressure")
                .depends_on(&["pressure_a", "pressure_b", "supply_pressure", "spool"], Dependent)
                .initially_depends_on(&VALVE)
                .initially_depends_on(&["accumulator_gas_volume", "polytropic_exponent", "supply_loss_time"]);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.rig.validate()?;
        self.rig.validate_delay(Self::STEP_SIZE)?;
        if let Some(effect) = self.rig.active_effect().filter(|_| self.estimate_error) {
            return Err(format!("estimate_error is on, expected off with {effect}").into());
        }
        self.state = self.rig.rest();
        self.period = 0.0;
        self.displacement_error = 0.0;
        self.stop_hit = false;
        Ok(())
    }

    fn allow_model_exchange(&self) -> ComponentResult {
        self.rig.active_effect().map_or(Ok(()), |effect| {
            Err(format!(
                "{effect} is on: the continuous states do not tell all of it, which needs \
                 co-simulation"
            )
            .into())
        })
    }

    fn update_outputs(&mut self, time: f64) {
        let table = &self.rig.table;
        self.actuator_force = table.actuator_force(&self.state.table);
        self.rates = table.derivatives(&self.state.table, &self.input(time));
        self.supply_flow = table.supply_flow(&self.state.table);
        self.stop_hit = table.stops.is_hit(self.state.table.displacement);
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        let input = self.input(time);
        if self.rig.active_effect().is_some() {
            if self.period != step_size && self.rig.command_delay > 0.0 {
                self.rig.validate_delay(step_size)?;
                if self.period != 0.0 {
                    return Err("command_delay.delay needs steps of one length".into());
                }
            }
            self.period = step_size;
            self.rig.advance(&mut self.state, &input, step_size);
        } else if self.estimate_error {
            let table = &self.rig.table;
            let (next, error) =
                table.advance_with_error(&self.state.table, &input, step_size, table.inner_step());
            (self.state.table, self.displacement_error) = (next, error.displacement);
        } else {
            self.state.table = self.rig.table.advance(&self.state.table, &input, step_size);
        }
        let state = &self.state.table;
        if state.displacement.is_finite() && state.supply_pressure.is_finite() {
            return Ok(());
        }
        Err(format!(
            "the state is no longer finite after t = {} s",
            time + step_size
        )
        .into())
    }

    fn handle_event(&mut self, time: f64) -> Result<Event, Box<dyn std::error::Error>> {
        let ahead = self.supply_loss_time < NEVER && time < self.supply_loss_time - 1e-9;
        Ok(Event {
            next_event_time: ahead.then_some(self.supply_loss_time),
            ..Event::default()
        })
    }
}

fmu_kit::export!(ServoHydraulicTable);
