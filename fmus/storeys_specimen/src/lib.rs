#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Specimen of several storeys on the table as an FMU.

use fmu_kit::{Causality, Component, ComponentResult, Terminal, Variable};
use plant::ModelError;
use plant::specimens::hysteresis::BoucWen;
use plant::specimens::{
    ControlledState, ControlledStoreys, MAX_STOREYS, MagnetorheologicalDamper, Storeys, TunedMass,
    YieldingSpecimen,
};
use serde::{Deserialize, Serialize};
use units::vocabulary;

/// A value of each storey, the lowest first.
type EachStorey = [f64; MAX_STOREYS];

/// A shear building between the table's acceleration and its force on the table.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StoreysSpecimen {
    storeys: i32,
    mass: EachStorey,
    damping: EachStorey,
    yield_force: EachStorey,
    yield_displacement: EachStorey,
    post_yield_ratio: EachStorey,
    /// Storey of the damper, from 1; 0 for none.
    damper_storey: i32,
    damper: MagnetorheologicalDamper,
    /// Floor of the tuned mass, from 1; 0 for none.
    tuned_mass_floor: i32,
    tuned_mass: TunedMass,
    state: ControlledState,
    table_acceleration: f64,
    damper_voltage: f64,
    damper_force: f64,
    force: f64,
    acceleration: f64,
    floor_acceleration: EachStorey,
    drift: EachStorey,
}

impl Default for StoreysSpecimen {
    fn default() -> Self {
        // Three storeys of 100 lbf together, first period 0.5 s, stiffness-proportional damping of 5 %
        // there; strength falls with height as the shear does.
        const LOWEST: [f64; 3] = [26.7, 22.2, 13.3];
        const STIFFNESS: f64 = 12_050.0;
        let strength: EachStorey = std::array::from_fn(|i| LOWEST[i.min(2)]);
        Self {
            storeys: 3,
            mass: [15.11; MAX_STOREYS],
            damping: [2.0 * 0.05 * STIFFNESS / 12.57; MAX_STOREYS],
            yield_force: strength,
            yield_displacement: strength.map(|force| force / STIFFNESS),
            post_yield_ratio: [0.05; MAX_STOREYS],
            damper_storey: 0,
            // With all voltage half of the strength of the lowest storey, 3 % of the building's weight: some
            // 5 N without voltage, 15 N with all of it.
            damper: MagnetorheologicalDamper {
                size: 0.011,
                ..MagnetorheologicalDamper::default()
            },
            tuned_mass_floor: 0,
            // A twentieth of the building, tuned to its first mode.
            tuned_mass: TunedMass {
                floor: 0,
                mass: 2.27,
                frequency: 11.8,
                damping_ratio: 0.135,
            },
            state: ControlledState::default(),
            table_acceleration: 0.0,
            damper_voltage: 0.0,
            damper_force: 0.0,
            force: 0.0,
            acceleration: 0.0,
            floor_acceleration: [0.0; MAX_STOREYS],
            drift: [0.0; MAX_STOREYS],
        }
    }
}

impl StoreysSpecimen {
    fn building(&self) -> Result<ControlledStoreys, ModelError> {
        let storey = |i: usize| YieldingSpecimen {
            mass: self.mass[i],
            damping: self.damping[i],
            columns: BoucWen {
                yield_force: self.yield_force[i],
                yield_displacement: self.yield_displacement[i],
                post_yield_ratio: self.post_yield_ratio[i],
                ..BoucWen::default()
            },
        };
        let count = usize::try_from(self.storeys).unwrap_or(0);
        // 0 is none; what is no index is refused as too large.
        let place = |from_one: i32| {
            (from_one != 0).then(|| usize::try_from(from_one - 1).unwrap_or(usize::MAX - 1))
        };
        let building = ControlledStoreys {
            storeys: Storeys {
                storey: std::array::from_fn(storey),
                count,
            },
            damper: place(self.damper_storey).map(|storey| (storey, self.damper)),
            tuned_mass: place(self.tuned_mass_floor).map(|floor| TunedMass {
                floor,
                ..self.tuned_mass
            }),
        };
        building.validate()?;
        Ok(building)
    }
}

fn each(
    name: &str,
    causality: Causality,
    about: &str,
    [unit, shown]: [&'static str; 2],
    field: fn(&mut StoreysSpecimen) -> &mut [f64],
) -> Vec<Variable<StoreysSpecimen>> {
    let elements = Variable::array(name, causality, MAX_STOREYS, field).into_iter();
    let named = elements.enumerate().map(|(i, element)| {
        let element = element.about(&format!("{about} {}", i + 1));
        if unit.is_empty() {
            element
        } else {
            element.unit(unit).shown_in(shown)
        }
    });
    named.collect()
}

impl Component for StoreysSpecimen {
    const NAME: &'static str = "StoreysSpecimen";
    const DESCRIPTION: &'static str = "Specimen of several yielding storeys on a shake table";
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
        let mut variables = fmu_kit::table! { Self, s:
            input(vocabulary::TABLE_ACCELERATION, s.table_acceleration, "Absolute acceleration of the table", "m/s2" => "g")
                .nominal(10.0);
            output("force", s.force, "Force on the table", "N" => "lbf").nominal(400.0);
            output("acceleration", s.acceleration, "Acceleration that times the whole mass is the force", "m/s2" => "g")
                .nominal(10.0);
            input("damper_voltage", s.damper_voltage, "Voltage of the magnetorheological damper's driver", "V").nominal(1.0);
            output("damper_force", s.damper_force, "Force of the damper against the drift of its storey", "N" => "lbf").nominal(50.0);
            parameter("storeys", s.storeys, "Number of storeys").min(1.0).max(10.0);
        };
        variables.extend(fmu_kit::table! { Self, s:
            parameter(vocabulary::DAMPER_STOREY, s.damper_storey, "Storey with a magnetorheological damper, the lowest 1; 0 is none").min(0.0).max(10.0);
            group(s.damper);
            parameter("tuned_mass_floor", s.tuned_mass_floor, "Floor with a tuned mass damper, the lowest 1; 0 is none").min(0.0).max(10.0);
            parameter("tuned_mass", s.tuned_mass.mass, "Its mass", "kg" => "lbf.s2/in").min(0.0);
            parameter("tuned_mass_frequency", s.tuned_mass.frequency, "Its own frequency", "rad/s").min(0.0);
            parameter("tuned_mass_damping_ratio", s.tuned_mass.damping_ratio, "Its own damping ratio").min(0.0);
        });
        let mut add = |more: Vec<Variable<Self>>| variables.extend(more);
        let (output, parameter) = (Causality::Output, Causality::Parameter);
        add(each(
            "floor_acceleration",
            output,
            "Absolute acceleration of floor",
            ["m/s2", "g"],
            |s| &mut s.floor_acceleration,
        ));
        add(each("drift", output, "Drift of storey", ["m", "in"], |s| {
            &mut s.drift
        }));
        add(each(
            "mass",
            parameter,
            "Mass of storey",
            ["kg", "lbf.s2/in"],
            |s| &mut s.mass,
        ));
        add(each(
            "damping",
            parameter,
            "Viscous damping of storey",
            ["N.s/m", "lbf.s/in"],
            |s| &mut s.damping,
        ));
        add(each(
            "yield_force",
            parameter,
            "Yield force of storey",
            ["N", "lbf"],
            |s| &mut s.yield_force,
        ));
        add(each(
            "yield_displacement",
            parameter,
            "Yield displacement of storey",
            ["m", "in"],
            |s| &mut s.yield_displacement,
        ));
        add(each(
            "post_yield_ratio",
            parameter,
            "Stiffness after yielding over that before, 1 elastic, of storey",
            ["", ""],
            |s| &mut s.post_yield_ratio,
        ));
        variables
    }

    fn initialize(&mut self) -> ComponentResult {
        self.building()?;
        self.state = ControlledState::default();
        Ok(())
    }

    fn update_outputs(&mut self, _time: f64) {
        // Parameters that make no building were refused at the start.
        let Ok(building) = self.building() else {
            return;
        };
        self.force = building.force(&self.state);
        self.acceleration = -self.force / building.mass();
        self.floor_acceleration = building.accelerations(&self.state);
        self.drift = self.state.storeys.storey.map(|storey| storey.drift);
        self.damper_force = building.damper_force(&self.state);
    }

    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult {
        let building = self.building()?;
        let (shaken, voltage) = (self.table_acceleration, self.damper_voltage);
        self.state = building.advance(&self.state, shaken, voltage, step_size);
        let finite = |storey: &plant::specimens::YieldingState| storey.drift.is_finite();
        if self.state.storeys.storey.iter().all(finite) {
            return Ok(());
        }
        Err(format!(
            "a drift is no longer finite after t = {} s",
            time + step_size
        )
        .into())
    }
}

fmu_kit::export!(StoreysSpecimen);

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn the_default_building_has_its_first_period() {
        let mut component = StoreysSpecimen {
            damping: [0.0; MAX_STOREYS],
            post_yield_ratio: [1.0; MAX_STOREYS],
            ..StoreysSpecimen::default()
        };
        component.initialize().unwrap();
        // Resonance in the first mode: free vibration after a push counts its zero crossings.
        component.table_acceleration = 0.1;
        component.step(0.0, 0.25).unwrap();
        component.table_acceleration = 0.0;
        let mut drifts = Vec::new();
        for k in 0..5000 {
            component.step(0.002 * f64::from(k), 0.002).unwrap();
            component.update_outputs(0.0);
            drifts.push(component.drift.iter().sum::<f64>());
        }
        let crossings = drifts.windows(2).filter(|d| d[0] * d[1] < 0.0).count();
        let frequency = crossings as f64 / 2.0 / 10.0;
        // Closed form for equal storeys: 2 w0 sin(pi/14).
        let omega = 2.0 * (12_050.0_f64 / 15.11).sqrt() * (PI / 14.0).sin();
        assert!((frequency - omega / TAU).abs() < 0.06, "{frequency}");
        assert!((frequency - 2.0).abs() < 0.06, "{frequency}");
    }

    #[test]
    fn no_storeys_are_refused_by_name() {
        let mut component = StoreysSpecimen {
            storeys: 11,
            ..StoreysSpecimen::default()
        };
        let said = component.initialize().unwrap_err().to_string();
        assert!(said.contains("storeys"), "{said}");
    }
}
