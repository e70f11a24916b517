#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Linear specimen on the table as an FMU.

use fmu_kit::{Component, ComponentResult, Dependency::Dependent, Terminal, Variable};
use plant::identified::effects::{
    self, AtStart, Component as Part, Effects, Family, Field, SpecimenEffects,
};
use plant::specimens::extended::{ExtendedSpecimen, ExtendedSpecimenState};
use plant::specimens::linear::{LinearSpecimen, SampledSpecimen};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// The linear specimen between the table's acceleration and its force on the table.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Specimen {
    specimen: LinearSpecimen,
    effects: SpecimenEffects,
    state: ExtendedSpecimenState,
    table_acceleration: f64,
    force: f64,
    acceleration: f64,
    drift_acceleration: f64,
    #[serde(skip)]
    sampled: Option<SampledSpecimen>,
    #[serde(skip)]
    extended: Option<ExtendedSpecimen>,
}

/// The effects' parameters as variables.
fn effect_parameters() -> impl Iterator<Item = Variable<Specimen>> {
    effects::variables(Part::Specimen).filter_map(|(name, parameter)| {
        let Some(Field::Specimen(field)) = parameter.field else {
            return None;
        };
        let variable =
            Variable::parameter_within(name, move |s: &mut Specimen| field(&mut s.effects));
        Some(
            variable
                .about(parameter.about)
                .measured_in(parameter.quantity.fmi, parameter.quantity.fmi_display)
                .between(parameter.min, parameter.max),
        )
    })
}

impl Specimen {
    /// The specimen with its effects, where one of them is on.
    fn extended(&mut self) -> Option<ExtendedSpecimen> {
        if !self.effects.is_active() {
            return None;
        }
        if self.extended.is_none() {
            self.extended = Some(ExtendedSpecimen::new(Some(self.specimen), &self.effects));
        }
        self.extended
    }

    /// The derivative of `unknown` by `known` in central differences.
    fn slope(&self, unknown: &str, known: &str) -> f64 {
        const AMOUNT: f64 = 1e-6;
        let mut sides = [0.0; 2];
        for (side, sign) in sides.iter_mut().zip([-1.0, 1.0]) {
            let mut moved = self.clone();
            *match known {
                "drift" => &mut moved.state.specimen.drift,
                vocabulary::DRIFT_VELOCITY => &mut moved.state.specimen.drift_velocity,
                _ => &mut moved.table_acceleration,
            } += sign * AMOUNT;
            moved.update_outputs(0.0);
            *side = match unknown {
                "force" => moved.force,
                "acceleration" => moved.acceleration,
                _ => moved.drift_acceleration,
            };
        }
        (sides[1] - sides[0]) / (2.0 * AMOUNT)
    }
}

impl Component for Specimen {
    const NAME: &'static str = "Specimen";
    const DESCRIPTION: &'static str = "Linear one-storey specimen on a shake table";
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
    const PARTIAL_DERIVATIVES: bool = true;

    fn variables() -> Vec<Variable<Self>> {
        let mut variables = fmu_kit::table! { Self, s:
            input(vocabulary::TABLE_ACCELERATION, s.table_acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0);
            output("force", s.force, "Force on the table", "N" => "lbf")
                .nominal(400.0).depends_on(&["drift", vocabulary::DRIFT_VELOCITY], Dependent);
            output("acceleration", s.acceleration, "Absolute acceleration of the mass", "m/s2" => "g")
                .nominal(10.0).depends_on(&["drift", vocabulary::DRIFT_VELOCITY], Dependent);
            output("drift", s.state.specimen.drift, "Displacement relative to the table", "m" => "in").nominal(0.05);
            output(vocabulary::DRIFT_VELOCITY, s.state.specimen.drift_velocity, "Velocity relative to the table", "m/s" => "in/s")
                .nominal(0.3).derivative_of("drift");
            group(s.specimen);
        };
        variables.extend(effect_parameters());
        variables.extend(fmu_kit::table! { Self, s:
            local("der(drift_velocity)", s.drift_acceleration, "Acceleration relative to the table", "m/s2" => "g")
                .derivative_of(vocabulary::DRIFT_VELOCITY)
                .depends_on(&[vocabulary::TABLE_ACCELERATION], Dependent)
                .depends_on(&["drift", vocabulary::DRIFT_VELOCITY], Dependent)
                .initially_depends_on(&[vocabulary::TABLE_ACCELERATION])
                .initially_depends_on(&effects::acting_at_start(Part::Specimen, AtStart::Acceleration));
        });
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.specimen.validate()?;
        ExtendedSpecimen::validate(&self.effects)?;
        self.state = ExtendedSpecimenState::default();
        self.sampled = Some(self.specimen.sample(Self::STEP_SIZE));
        self.extended = None;
        Ok(())
    }

    fn allow_model_exchange(&self) -> ComponentResult {
        let effects = Effects {
            specimen: self.effects,
            ..Effects::default()
        };
        match effects::needing_co_simulation(Part::Specimen, &effects) {
            Some(effect) => Err(format!(
                "{} is on: drift and drift_velocity do not tell all of it, which needs \
                 co-simulation",
                effect.name
            )
            .into()),
            None => Ok(()),
        }
    }

    fn update_outputs(&mut self, _time: f64) {
        if let Some(extended) = self.extended() {
            let at = self.table_acceleration;
            (self.force, self.acceleration) = extended.outputs(&self.state, at);
            self.drift_acceleration = if extended.is_present() {
                self.acceleration - at
            } else {
                0.0
            };
            return;
        }
        self.force = self.specimen.force(&self.state.specimen);
        self.acceleration = self.specimen.acceleration(&self.state.specimen);
        self.drift_acceleration = self.acceleration - self.table_acceleration;
    }

    fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
        if let Some(extended) = self.extended() {
            extended.advance(&mut self.state, self.table_acceleration, step_size);
            return Ok(());
        }
        let kept = self.sampled.filter(|sampled| sampled.step() == step_size);
        let sampled = kept.unwrap_or_else(|| self.specimen.sample(step_size));
        self.sampled = Some(sampled);
        self.state.specimen = sampled.advance(&self.state.specimen, self.table_acceleration);
        Ok(())
    }

    fn partial_derivative(&self, unknown: &str, known: &str) -> f64 {
        if self.effects.is_active() {
            return self.slope(unknown, known);
        }
        let force = match known {
            "drift" => self.specimen.stiffness,
            vocabulary::DRIFT_VELOCITY => self.specimen.damping,
            _ => return -1.0,
        };
        if unknown == "force" {
            force
        } else {
            -force / self.specimen.mass
        }
    }
}

fmu_kit::export!(Specimen);

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_kit::conformance::number;

    #[test]
    fn parameters_and_state_arrive_where_they_belong() {
        let mut component = Specimen::default();
        let names = [
            "mass",
            "damping",
            "stiffness",
            "drift",
            "drift_velocity",
            "table_acceleration",
        ];
        number(&mut component, &names);
        let expected = LinearSpecimen {
            mass: 1.0,
            damping: 2.0,
            stiffness: 3.0,
        };
        assert_eq!(component.specimen, expected);
        component.update_outputs(0.0);
        // force = k d + c d' = 12 + 10; acceleration = -force / m; d'' = acceleration - 6.
        assert_eq!(component.force, 22.0);
        assert_eq!(component.acceleration, -22.0);
        assert_eq!(component.drift_acceleration, -28.0);
    }

    #[test]
    fn an_effect_moves_the_component_as_the_plant() {
        let mut component = Specimen::default();
        component.effects.yield_displacement = 0.01;
        component.effects.degradation_loss = 0.2;
        component.initialize().unwrap();
        let plant = ExtendedSpecimen::new(Some(component.specimen), &component.effects);
        let mut state = ExtendedSpecimenState::default();
        for k in 0..1000 {
            component.table_acceleration = (0.0126 * f64::from(k)).sin();
            component.step(0.0, 0.002).unwrap();
            plant.advance(&mut state, component.table_acceleration, 0.002);
        }
        assert_eq!(component.state, state);
        assert!(state.peak_drift > 0.02, "{}", state.peak_drift);
        let refused = component.allow_model_exchange().unwrap_err().to_string();
        assert!(refused.contains("co-simulation"), "{refused}");
        component.effects.absent = 0.5;
        let refused = component.initialize().unwrap_err().to_string();
        assert!(refused.contains("specimen_absent.absent"), "{refused}");
    }
}
