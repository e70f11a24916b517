#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Shake table with its hydraulic actuator as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::identified::effects::{self, AtStart, Component as Part, Effects, Field};
use plant::identified::extended_table::{ExtendedTable, ExtendedTableState};
use plant::identified::shake_table::{SampledShakeTable, ShakeTable as Rig, ShakeTableState};
use serde::{Deserialize, Serialize};
use units::vocabulary;

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

/// The effects' parameters as variables.
fn effect_parameters() -> impl Iterator<Item = Variable<ShakeTable>> {
    effects::variables(Part::ShakeTable).filter_map(|(name, parameter)| {
        let Some(Field::Table(field)) = parameter.field else {
            return None;
        };
        let variable =
            Variable::parameter_within(name, move |s: &mut ShakeTable| field(&mut s.effects));
        Some(
            variable
                .about(parameter.about)
                .measured_in(parameter.quantity.fmi, parameter.quantity.fmi_display)
                .between(parameter.min, parameter.max),
        )
    })
}

impl ShakeTable {
    /// The table with its effects, where one of them is on.
    fn extended(&mut self) -> Option<ExtendedTable> {
        if !self.effects.is_active_on_table() {
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
                vocabulary::VALVE_COMMAND => &mut moved.valve_command,
                vocabulary::SPECIMEN_FORCE => &mut moved.specimen_force,
                "displacement" => &mut table.displacement,
                "velocity" => &mut table.velocity,
                vocabulary::ACTUATOR_FORCE => &mut table.actuator[0],
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
    const PARTIAL_DERIVATIVES: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input(vocabulary::VALVE_COMMAND, s.valve_command, "Voltage to the servo valve", "V")
                .discrete().nominal(10.0);
            input(vocabulary::SPECIMEN_FORCE, s.specimen_force, "Force of the specimen on the table", "N" => "lbf")
                .nominal(400.0);
            output("displacement", s.state.table.displacement, "Displacement of the table", "m" => "in")
                .nominal(0.0381);
            output("velocity", s.state.table.velocity, "Velocity of the table", "m/s" => "in/s")
                .nominal(0.5).derivative_of("displacement");
            output("acceleration", s.acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0).derivative_of("velocity")
                .depends_on(&[vocabulary::SPECIMEN_FORCE, "displacement", "velocity", vocabulary::ACTUATOR_FORCE], Dependent)
                .initially_depends_on(&[vocabulary::SPECIMEN_FORCE, vocabulary::TABLE_MASS])
                .initially_depends_on(&effects::acting_at_start(Part::ShakeTable, AtStart::Acceleration));
            output(vocabulary::ACTUATOR_FORCE, s.state.table.actuator[0], "Force of the actuator on the table", "N" => "lbf")
                .nominal(400.0);
            group(s.rig.table);
            group(s.rig.actuator);
        };
        variables.extend(effect_parameters());
        let actuator = effects::acting_at_start(Part::ShakeTable, AtStart::ActuatorRates);
        variables.extend(fmu_kit::table! { Self, s:
            local("actuator_state[2]", s.state.table.actuator[1], "Second state of the actuator", "N/s").nominal(1e5);
            local("actuator_state[3]", s.state.table.actuator[2], "Third state of the actuator", "N/s2").nominal(1e6);
            local("der(actuator_force)", s.actuator_rates[0], "Rate of the actuator's force", "N/s")
                .derivative_of(vocabulary::ACTUATOR_FORCE)
                .depends_on(&[vocabulary::VALVE_COMMAND, "velocity", vocabulary::ACTUATOR_FORCE, "actuator_state[2]"], Dependent)
                .initially_depends_on(&[vocabulary::VALVE_COMMAND, "actuator_b2"])
                .initially_depends_on(&actuator);
            local("der(actuator_state[2])", s.actuator_rates[1], "Rate of the second state", "N/s2")
                .derivative_of("actuator_state[2]")
                .depends_on(&[vocabulary::VALVE_COMMAND, "velocity", vocabulary::ACTUATOR_FORCE, "actuator_state[2]", "actuator_state[3]"], Dependent)
                .initially_depends_on(&[vocabulary::VALVE_COMMAND, "actuator_b1", "actuator_b2"])
                .initially_depends_on(&actuator);
            local("der(actuator_state[3])", s.actuator_rates[2], "Rate of the third state", "N/s3")
                .derivative_of("actuator_state[3]")
                .depends_on(&[vocabulary::VALVE_COMMAND, "velocity", vocabulary::ACTUATOR_FORCE, "actuator_state[2]"], Dependent)
                .initially_depends_on(&[vocabulary::VALVE_COMMAND, "actuator_b0", "actuator_b2"])
                .initially_depends_on(&actuator);
        });
        variables
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
        match effects::needing_co_simulation(Part::ShakeTable, &self.effects) {
            Some(effect) => Err(format!(
                "{} is on: the continuous states do not tell all of it, which needs co-simulation",
                effect.name
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
        if self.effects.is_active_on_table() {
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
            vocabulary::VALVE_COMMAND => actuator.voltage_to_force[row],
            "velocity" => actuator.velocity_to_force[row],
            vocabulary::ACTUATOR_FORCE => -actuator.denominator[row],
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
