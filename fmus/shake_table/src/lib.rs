#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Shake table with its hydraulic actuator as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Variable};
use plant::identified::effects::Effects;
use plant::identified::extended_table::{ExtendedTable, ExtendedTableState};
use plant::identified::shake_table::{SampledShakeTable, ShakeTable as Rig, ShakeTableState};
use serde::{Deserialize, Serialize};

/// The identified shake table between valve command, specimen force and motion.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct ShakeTable {
    rig: Rig,
    effects: Effects,
    state: ExtendedTableState,
    /// With effects, the step that the memory of delays belongs to, s; 0 before the first.
    period: f64,
    valve_command: f64,
    specimen_force: f64,
    acceleration: f64,
    actuator_rates: [f64; 3],
    #[serde(skip)]
    sampled: Option<SampledShakeTable>,
    #[serde(skip)]
    extended: Option<ExtendedTable>,
}

/// What the command and the openings of the valve make of the rates at the start.
const VALVE: [&str; 8] = [
    "valve_null_bias.offset",
    "valve_dead_band.half_width",
    "valve_flow_gain.relative_change",
    "valve_asymmetric_gain.asymmetry",
    "valve_spool_lag.frequency",
    "valve_hysteresis.half_width",
    "command_delay.delay",
    "valve_spool_saturation.limit",
];

impl ShakeTable {
    /// The table with its effects, where one of them is on.
    fn extended(&mut self) -> Option<ExtendedTable> {
        if !ExtendedTable::is_active(&self.effects) {
            return None;
        }
        if self.extended.is_none() {
            self.extended = Some(ExtendedTable::new(&self.rig, &self.effects));
        }
        self.extended
    }

    /// The derivative of `unknown` by `known` in central differences.
    fn slope(&self, unknown: &str, known: &str) -> f64 {
        let mut sides = [0.0; 2];
        // Velocities are small beside friction's change of sign.
        let amount = if known == "velocity" { 1e-6 } else { 1e-4 };
        for (side, sign) in sides.iter_mut().zip([-1.0, 1.0]) {
            let mut moved = self.clone();
            let table = &mut moved.state.table;
            *match known {
                "valve_command" => &mut moved.valve_command,
                "specimen_force" => &mut moved.specimen_force,
                "displacement" => &mut table.displacement,
                "velocity" => &mut table.velocity,
                "actuator_force" => &mut table.actuator[0],
                "actuator_state[2]" => &mut table.actuator[1],
                _ => &mut table.actuator[2],
            } += sign * amount;
            moved.update_outputs(0.0);
            *side = match unknown {
                "acceleration" => moved.acceleration,
                "der(actuator_force)" => moved.actuator_rates[0],
                "der(actuator_state[2])" => moved.actuator_rates[1],
                _ => moved.actuator_rates[2],
            };
        }
        (sides[1] - sides[0]) / (2.0 * amount)
    }
}

impl Component for ShakeTable {
    const NAME: &'static str = "ShakeTable";
    const DESCRIPTION: &'static str = "Uniaxial shake table with its identified hydraulic actuator";
    const DOCUMENTATION: &'static str = include_str!("../README.md");
    const PARTIAL_DERIVATIVES: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        fmu_kit::table! { Self, s:
            input("valve_command", s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0);
            input("specimen_force", s.specimen_force, "Force of the specimen on the table", "N" => "lbf")
                .nominal(400.0);
            output("displacement", s.state.table.displacement, "Displacement of the table", "m" => "in")
                .nominal(0.0381);
            output("velocity", s.state.table.velocity, "Velocity of the table", "m/s" => "in/s")
                .nominal(0.5).derivative_of("displacement");
            output("acceleration", s.acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0).derivative_of("velocity")
                .depends_on(&["specimen_force", "displacement", "velocity", "actuator_force"], Dependent)
                .initially_depends_on(&["specimen_force", "table_mass", "added_payload.mass"]);
            output("actuator_force", s.state.table.actuator[0], "Force of the actuator on the table", "N" => "lbf")
                .nominal(400.0);
            parameter("table_mass", s.rig.table.mass, "Mass of the table", "kg" => "lbf.s2/in");
            parameter("table_damping", s.rig.table.damping, "Viscous damping of the table", "N.s/m" => "lbf.s/in");
            parameter("table_stiffness", s.rig.table.stiffness, "Stiffness from table to ground", "N/m" => "lbf/in");
            parameter("actuator_a2", s.rig.actuator.denominator[0], "Actuator, denominator, s^2", "1/s");
            parameter("actuator_a1", s.rig.actuator.denominator[1], "Actuator, denominator, s", "1/s2");
            parameter("actuator_a0", s.rig.actuator.denominator[2], "Actuator, denominator, constant", "1/s3");
            parameter("actuator_b2", s.rig.actuator.voltage_to_force[0], "Valve command to force, s^2", "N/(V.s)" => "lbf/(V.s)");
            parameter("actuator_b1", s.rig.actuator.voltage_to_force[1], "Valve command to force, s", "N/(V.s2)" => "lbf/(V.s2)");
            parameter("actuator_b0", s.rig.actuator.voltage_to_force[2], "Valve command to force, constant", "N/(V.s3)" => "lbf/(V.s3)");
            parameter("actuator_e2", s.rig.actuator.velocity_to_force[0], "Velocity to force, s^2", "N/m" => "lbf/in");
            parameter("actuator_e1", s.rig.actuator.velocity_to_force[1], "Velocity to force, s", "N/(m.s)" => "lbf/(in.s)");
            parameter("actuator_e0", s.rig.actuator.velocity_to_force[2], "Velocity to force, constant", "N/(m.s2)" => "lbf/(in.s2)");
            parameter("valve_null_bias.offset", s.effects.valve.null_bias, "Offset at the spool; 0 is off", "V");
            parameter("valve_dead_band.half_width", s.effects.valve.dead_band, "Half width of the spool's overlap; 0 is off", "V").min(0.0);
            parameter("valve_flow_gain.relative_change", s.effects.valve.flow_gain, "Relative change of the flow gain; 0 is off", "1");
            parameter("valve_asymmetric_gain.asymmetry", s.effects.valve.asymmetry, "q of the gains 1 + q for positive and 1 - q for negative flow; 0 is off", "1");
            parameter("valve_spool_lag.frequency", s.effects.valve.spool_frequency, "Natural frequency of the second-order spool; 0 is an ideal spool", "Hz").min(0.0);
            parameter("valve_spool_lag.damping_ratio", s.effects.valve.spool_damping, "Damping ratio of the spool", "1").min(1e-3);
            parameter("command_delay.delay", s.effects.valve.command_delay, "Pure delay of the command, at most 30 steps; 0 is off", "s" => "ms").min(0.0);
            parameter("valve_spool_saturation.limit", s.effects.valve.spool_limit, "Travel limit of the spool; 0 is none", "V").min(0.0);
            parameter("valve_hysteresis.half_width", s.effects.valve.hysteresis, "Half width of the play between command and spool; 0 is off", "V").min(0.0);
            parameter("valve_flow_saturation.stall_force", s.effects.hydraulics.stall_force, "Force at which the flow stops, flow times sqrt(1 - sign(u) F / stall_force); 0 is none", "N" => "lbf").min(0.0);
            parameter("supply_pressure_droop.loss_per_volt", s.effects.hydraulics.droop_loss, "Relative loss of flow per volt of recent mean demand; 0 is off", "1/V").min(0.0);
            parameter("supply_pressure_droop.accumulator_time", s.effects.hydraulics.droop_time, "Time constant of the accumulator", "s").min(1e-3);
            parameter("supply_pressure_droop.form", s.effects.hydraulics.droop_form, "c of the flow's factor (1 - c loss mean)^(1/c); 1 is a straight line, not 0", "1");
            parameter("supply_pressure_droop.floor", s.effects.hydraulics.droop_floor, "Share of the flow that the droop leaves at least", "1").min(0.0).max(1.0);
            parameter("internal_leakage.leakage", s.effects.hydraulics.leakage, "Flow lost in proportion to force; 0 is off", "V/N" => "V/lbf");
            parameter("oil_column_compliance.compliance", s.effects.hydraulics.compliance, "Flow lost in proportion to the rate of force; 0 is off", "V.s/N" => "V.s/lbf").min(0.0);
            parameter("coulomb_friction.coulomb_force", s.effects.friction.coulomb_force, "Constant force opposing the velocity, also that of Stribeck friction; 0 is off", "N" => "lbf");
            parameter("coulomb_friction.transition_velocity", s.effects.friction.transition_velocity, "Velocity over which friction changes its sign: tanh(v / transition_velocity)", "m/s" => "in/s").min(1e-6);
            parameter("stribeck_friction.stribeck_force", s.effects.friction.stribeck_force, "Breakaway bump above the Coulomb force at low speed; 0 is off", "N" => "lbf");
            parameter("stribeck_friction.stribeck_velocity", s.effects.friction.stribeck_velocity, "Velocity at which the bump has fallen to 1/e", "m/s" => "in/s").min(1e-6);
            parameter("stribeck_friction.stribeck_exponent", s.effects.friction.stribeck_exponent, "Exponent delta in the bump's exp(-|v / stribeck_velocity|^delta)", "1").min(1e-2);
            parameter("added_payload.mass", s.effects.table.added_mass, "Mass on the table that the model does not know; 0 is off", "kg" => "lbf.s2/in");
            parameter("viscous_damping.damping", s.effects.table.viscous_damping, "Extra damping of the table; 0 is off", "N.s/m" => "lbf.s/in");
            parameter("cubic_stiffness.stiffness", s.effects.table.cubic_stiffness, "k3 of an extra force k3 x^3; 0 is off", "N/m3" => "lbf/in3");
            parameter("foundation_compliance.frequency", s.effects.foundation.frequency, "Natural frequency of the reaction mass, relative to which the piston moves; 0 is rigid", "Hz").min(0.0);
            parameter("foundation_compliance.mass_ratio", s.effects.foundation.mass_ratio, "Reaction mass in masses of the table", "1").min(1e-3);
            parameter("foundation_compliance.damping_ratio", s.effects.foundation.damping_ratio, "Damping ratio of the reaction mass", "1").min(0.0);
            local("actuator_state[2]", s.state.table.actuator[1], "Second state of the actuator", "N/s").nominal(1e5);
            local("actuator_state[3]", s.state.table.actuator[2], "Third state of the actuator", "N/s2").nominal(1e6);
            local("der(actuator_force)", s.actuator_rates[0], "Rate of the actuator's force", "N/s")
                .derivative_of("actuator_force")
                .depends_on(&["valve_command", "velocity", "actuator_force", "actuator_state[2]"], Dependent)
                .initially_depends_on(&["valve_command", "actuator_b2", "oil_column_compliance.compliance"])
                .initially_depends_on(&VALVE);
            local("der(actuator_state[2])", s.actuator_rates[1], "Rate of the second state", "N/s2")
                .derivative_of("actuator_state[2]")
                .depends_on(&["valve_command", "velocity", "actuator_force", "actuator_state[2]", "actuator_state[3]"], Dependent)
                .initially_depends_on(&["valve_command", "actuator_b1", "actuator_b2", "oil_column_compliance.compliance"])
                .initially_depends_on(&VALVE);
            local("der(actuator_state[3])", s.actuator_rates[2], "Rate of the third state", "N/s3")
                .derivative_of("actuator_state[3]")
                .depends_on(&["valve_command", "velocity", "actuator_force", "actuator_state[2]"], Dependent)
                .initially_depends_on(&["valve_command", "actuator_b0", "actuator_b2", "oil_column_compliance.compliance"])
                .initially_depends_on(&VALVE);
        }
    }

    fn initialize(&mut self) -> ComponentResult {
        self.rig.validate()?;
        ExtendedTable::validate(&self.effects, self.rig.table.mass)?;
        self.effects.valve.validate_delay(Self::STEP_SIZE)?;
        self.state = ExtendedTableState::default();
        self.period = 0.0;
        self.sampled = Some(self.rig.sample(Self::STEP_SIZE));
        self.extended = None;
        Ok(())
    }

    fn allow_model_exchange(&self) -> ComponentResult {
        let Effects {
            valve,
            hydraulics,
            foundation,
            ..
        } = &self.effects;
        let needing = [
            ("valve_spool_lag", valve.spool_frequency),
            ("command_delay", valve.command_delay),
            ("valve_hysteresis", valve.hysteresis),
            ("supply_pressure_droop", hydraulics.droop_loss),
            ("foundation_compliance", foundation.frequency),
        ];
        match needing.into_iter().find(|(_, size)| *size != 0.0) {
            Some((effect, _)) => Err(format!(
                "{effect} is on: the continuous states do not tell all of it, which needs \
                 co-simulation"
            )
            .into()),
            None => Ok(()),
        }
    }

    fn update_outputs(&mut self, _time: f64) {
        if let Some(extended) = self.extended() {
            (self.acceleration, self.actuator_rates) =
                extended.outputs(&self.state, self.valve_command, self.specimen_force);
            return;
        }
        let ShakeTableState {
            actuator: [z1, z2, z3],
            velocity,
            ..
        } = self.state.table;
        let actuator = &self.rig.actuator;
        self.acceleration = self
            .rig
            .acceleration(&self.state.table, self.specimen_force);
        for (i, next) in [z2, z3, 0.0].into_iter().enumerate() {
            self.actuator_rates[i] = next - actuator.denominator[i] * z1
                + actuator.voltage_to_force[i] * self.valve_command
                + actuator.velocity_to_force[i] * velocity;
        }
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if let Some(extended) = self.extended() {
            let valve = &self.effects.valve;
            if self.period != step_size && valve.command_delay > 0.0 {
                valve.validate_delay(step_size)?;
                if self.period != 0.0 {
                    return Err("command_delay.delay needs steps of one length".into());
                }
            }
            self.period = step_size;
            let (command, force) = (self.valve_command, self.specimen_force);
            extended.advance(&mut self.state, command, force, step_size);
            return Ok(());
        }
        let kept = self.sampled.filter(|sampled| sampled.step() == step_size);
        let sampled = kept.unwrap_or_else(|| self.rig.sample(step_size));
        self.sampled = Some(sampled);
        let (command, force) = (self.valve_command, self.specimen_force);
        self.state.table = sampled.advance(&self.state.table, command, force);
        Ok(())
    }

    fn partial_derivative(&self, unknown: &str, known: &str) -> f64 {
        if ExtendedTable::is_active(&self.effects) {
            return self.slope(unknown, known);
        }
        let (table, actuator) = (&self.rig.table, &self.rig.actuator);
        let row = match unknown {
            "acceleration" => {
                return match known {
                    "displacement" => -table.stiffness / table.mass,
                    "velocity" => -table.damping / table.mass,
                    _ => 1.0 / table.mass,
                };
            }
            "der(actuator_force)" => 0,
            "der(actuator_state[2])" => 1,
            _ => 2,
        };
        match known {
            "valve_command" => actuator.voltage_to_force[row],
            "velocity" => actuator.velocity_to_force[row],
            "actuator_force" => -actuator.denominator[row],
            "actuator_state[2]" if row > 0 => 0.0,
            _ => 1.0,
        }
    }
}

fmu_kit::export!(ShakeTable);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::number;
    use plant::identified::{actuator::IdentifiedActuator, table::Table};

    #[test]
    fn parameters_arrive_where_they_belong() {
        let mut component = ShakeTable::default();
        let names = [
            "table_mass",
            "table_damping",
            "table_stiffness",
            "actuator_a2",
            "actuator_a1",
            "actuator_a0",
            "actuator_b2",
            "actuator_b1",
            "actuator_b0",
            "actuator_e2",
            "actuator_e1",
            "actuator_e0",
        ];
        number(&mut component, &names);
        let expected = Rig {
            table: Table {
                mass: 1.0,
                damping: 2.0,
                stiffness: 3.0,
            },
            actuator: IdentifiedActuator {
                denominator: [4.0, 5.0, 6.0],
                voltage_to_force: [7.0, 8.0, 9.0],
                velocity_to_force: [10.0, 11.0, 12.0],
            },
        };
        assert_eq!(component.rig, expected);
    }

    #[test]
    fn derivatives_are_those_of_the_plant() {
        let mut component = ShakeTable::default();
        let names = [
            "actuator_force",
            "actuator_state[2]",
            "actuator_state[3]",
            "displacement",
            "velocity",
            "valve_command",
            "specimen_force",
        ];
        number(&mut component, &names);
        component.update_outputs(0.0);
        let (a, b) = component.rig.dynamics();
        let state = [1.0, 2.0, 3.0, 4.0, 5.0];
        let expected = a * nalgebra::SVector::from(state) + b * nalgebra::vector![6.0, 7.0];
        let [z1, z2, z3] = component.actuator_rates;
        let got = [
            z1,
            z2,
            z3,
            component.state.table.velocity,
            component.acceleration,
        ];
        for (got, expected) in got.iter().zip(expected.iter()) {
            assert!(
                (got - expected).abs() <= 1e-12 * expected.abs(),
                "{got} against {expected}"
            );
        }
    }

    #[test]
    fn without_effects_the_transition_is_the_exact_one_to_the_bit() {
        let mut component = ShakeTable::default();
        component.effects.valve.spool_damping = 0.5;
        component.effects.foundation.mass_ratio = 3.0;
        component.initialize().unwrap();
        let exact = component.rig.sample(0.002);
        let mut state = ShakeTableState::default();
        for k in 0..500 {
            let (u, force) = ((0.03 * f64::from(k)).sin(), (0.02 * f64::from(k)).cos());
            (component.valve_command, component.specimen_force) = (u, force);
            component.step(0.0, 0.002).unwrap();
            state = exact.advance(&state, u, force);
        }
        let bits =
            |s: ShakeTableState| [s.actuator[0], s.displacement, s.velocity].map(f64::to_bits);
        assert_eq!(bits(component.state.table), bits(state));
    }

    #[test]
    fn an_effect_moves_the_component_as_the_plant() {
        let mut component = ShakeTable::default();
        component.effects.valve.dead_band = 0.1;
        component.effects.valve.command_delay = 0.005;
        component.effects.friction.coulomb_force = 9.0;
        component.effects.foundation.frequency = 9.0;
        component.initialize().unwrap();
        let plant = ExtendedTable::new(&component.rig, &component.effects);
        let mut state = ExtendedTableState::default();
        for k in 0..500 {
            let (u, force) = ((0.03 * f64::from(k)).sin(), (0.02 * f64::from(k)).cos());
            (component.valve_command, component.specimen_force) = (u, force);
            component.step(0.0, 0.002).unwrap();
            plant.advance(&mut state, u, force, 0.002);
        }
        assert_eq!(component.state, state);
        assert!(state.table.displacement.abs() > 1e-4);
        let refused = component.allow_model_exchange().unwrap_err().to_string();
        assert!(refused.contains("command_delay is on"), "{refused}");
        let refused = component.step(0.0, 0.001).unwrap_err().to_string();
        assert!(refused.contains("command_delay"), "{refused}");
    }
}
