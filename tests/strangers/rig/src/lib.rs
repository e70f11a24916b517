#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! A servo-hydraulic table that shares no equation's code with the project's own, as an FMU with the same
//! connections as `ServoHydraulicTable`; a specimen may stand on it inside.

use fmu_kit::{
    Component, ComponentResult,
    Dependency::{Dependent, Fixed},
    Variable,
};
use serde::{Deserialize, Serialize};
use strangers::hydraulic::{Bristles, Now, Rig, State};

/// The rig between valve command and motion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StrangerRig {
    rig: Rig,
    state: State,
    elasto_plastic: bool,
    valve_command: f64,
    specimen_force: f64,
    acceleration: f64,
    actuator_force: f64,
    specimen_acceleration: f64,
    supply_flow: f64,
}

impl Default for StrangerRig {
    fn default() -> Self {
        let rig = Rig::default();
        Self {
            state: rig.rest(),
            rig,
            elasto_plastic: false,
            valve_command: 0.0,
            specimen_force: 0.0,
            acceleration: 0.0,
            actuator_force: 0.0,
            specimen_acceleration: 0.0,
            supply_flow: 0.0,
        }
    }
}

impl Component for StrangerRig {
    const NAME: &'static str = "StrangerRig";
    const DESCRIPTION: &'static str =
        "Servo-hydraulic shake table of another form, with its specimen";

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("valve_command", s.valve_command, "Voltage to the servo valve", "V").discrete().nominal(10.0);
            input("specimen_force", s.specimen_force, "Force of a specimen outside on the table", "N" => "lbf").nominal(400.0);
            output("displacement", s.state.values[4], "Displacement of the table", "m" => "in").nominal(0.0381);
            output("velocity", s.state.values[5], "Velocity of the table", "m/s" => "in/s").nominal(0.5);
            output("acceleration", s.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0)
                .depends_on(&["specimen_force"], Fixed)
                .initially_depends_on(&["specimen_force", "table_mass", "payload"]);
            output("actuator_force", s.actuator_force, "Force of the actuator on the table", "N" => "lbf")
                .nominal(400.0).depends_on(&["specimen_force"], Dependent);
            output("specimen_acceleration", s.specimen_acceleration, "Acceleration of the specimen inside", "m/s2" => "g").nominal(10.0);
            output("supply_pressure", s.rig.supply, "Pressure of the supply", "Pa" => "psi").nominal(2e7);
            output("supply_flow", s.supply_flow, "Flow that the valve draws", "m3/s" => "in3/s").nominal(2e-4)
                .initially_depends_on(&["null_bias", "flow_coefficient"]);
            parameter("overlap", s.rig.overlap, "Half width of the valve's overlap", "V").min(0.0);
            parameter("null_loss", s.rig.null_loss, "Share of the flow gain that is lost at null", "1").min(0.0).max(1.0);
            parameter("null_width", s.rig.null_width, "Opening over which it comes back", "V");
            parameter("null_bias", s.rig.null_bias, "Opening at zero command", "V");
            parameter("asymmetry", s.rig.asymmetry, "q of the flow gains 1 + q and 1 - q", "1");
            parameter("delay", s.rig.delay, "Pure delay of the command", "s" => "ms").min(0.0).max(0.02);
            parameter("valve_frequency", s.rig.valve_frequency, "Natural frequency of the spool", "Hz");
            parameter("flow_coefficient", s.rig.flow_coefficient, "Flow through an edge per volt and root of pressure, m3/(s V sqrt(Pa))");
            parameter("bulk_modulus", s.rig.bulk_modulus, "Effective bulk modulus", "Pa" => "psi");
            parameter("coulomb", s.rig.coulomb, "Coulomb friction", "N" => "lbf").min(0.0);
            parameter("breakaway", s.rig.breakaway, "Friction at which the seals give way", "N" => "lbf").min(0.0);
            parameter("deflection", s.rig.deflection, "Deflection at which they give way", "m" => "in");
            parameter("elasto_plastic", s.elasto_plastic, "Friction by an elasto-plastic law in place of LuGre");
            parameter("table_mass", s.rig.table_mass, "Mass of the table", "kg" => "lbf.s2/in");
            parameter("table_stiffness", s.rig.table_stiffness, "Stiffness from table to ground", "N/m" => "lbf/in").min(0.0);
            parameter("payload", s.rig.payload, "Rigid mass on the table", "kg" => "lbf.s2/in").min(0.0);
            parameter("specimen_mass", s.rig.specimen_mass, "Mass of the specimen inside; 0 is none", "kg" => "lbf.s2/in").min(0.0);
            parameter("specimen_frequency", s.rig.specimen_frequency, "Its natural frequency", "Hz");
            parameter("disturbance", s.rig.disturbance, "Unseen voltage at the spool, rms", "V").min(0.0);
            parameter("disturbance_frequency", s.rig.disturbance_frequency, "Centre of three tenths of its power", "Hz");
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        if self.rig.table_mass <= 0.0 || self.rig.deflection <= 0.0 {
            return Err(
                "parameters `table_mass` and `deflection`: expected positive numbers".into(),
            );
        }
        self.rig.bristles = if self.elasto_plastic {
            Bristles::ElastoPlastic
        } else {
            Bristles::LuGre
        };
        self.state = self.rig.rest();
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        let now: Now = self
            .rig
            .now(&self.state.values, self.valve_command, self.specimen_force);
        self.acceleration = now.acceleration;
        self.actuator_force = now.force;
        self.specimen_acceleration = now.specimen_acceleration;
        self.supply_flow = now.flow;
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        let (u, push) = (self.valve_command, self.specimen_force);
        self.rig.advance(&mut self.state, time, step_size, u, push);
        if self.state.values.iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        Err(format!("the state is not finite after {} s", time + step_size).into())
    }
}

fmu_kit::export!(StrangerRig);
