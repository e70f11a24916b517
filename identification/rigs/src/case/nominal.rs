//! `nominal.toml`: what the laboratory believes.

use std::collections::BTreeMap;

use super::nominal_error::NominalError;
use crate::identify::model_file::{EffectSections, HydraulicSection};
use plant::identified::actuator::IdentifiedActuator;
use plant::identified::effects::{self, Effects};
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::sensors::instrumentation::Instrumentation;
use plant::specimens::linear::LinearSpecimen;
use serde::Deserialize;
use serde::de::IgnoredAny;
use units::constants::{INCH, LBF, LBF_PER_INCH, LBF_S_PER_INCH, LBF_S2_PER_INCH};

/// The nominal rig, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Nominal {
    /// Samples per second.
    pub sample_rate: f64,
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one is believed to stand on the table.
    pub specimen: Option<LinearSpecimen>,
    /// The law that made the command, if stated.
    pub controller: Option<ControlLaw>,
    /// Noise of displacement (m), acceleration (m/s²), actuator force (N), specimen acceleration
    /// (m/s²): one standard deviation.
    pub noise: [f64; 4],
    /// Noise of the recorded command, V.
    pub command_noise: f64,
    /// Relative standard deviation of every plant parameter.
    pub uncertainty: f64,
    /// Effects of the rig that are known already, as an identification or an earlier diagnosis
    /// found them.
    pub effects: Effects,
    /// Those of its sensors.
    pub sensors: Instrumentation,
}

/// Relation R5: three-variable control as sampled by the rig's computer, SI.
///
/// Its arithmetic is not that of `controllers::three_variable`: velocities are differences, and the
/// integral runs on at the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLaw {
    /// V/m.
    pub proportional: f64,
    /// V/(m s).
    pub integral: f64,
    /// V s/m.
    pub velocity_feedforward: f64,
    /// V s²/m.
    pub acceleration_feedforward: f64,
    /// V s/m.
    pub velocity_feedback: f64,
    /// V s²/m.
    pub acceleration_feedback: f64,
    /// Share of the newest difference in the filtered velocity.
    pub velocity_filter: f64,
    /// V.
    pub limit: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    units: Units,
    sample_rate: f64,
    actuator: Option<Actuator>,
    table: Oscillator,
    specimen: Option<Oscillator>,
    controller: Option<Controller>,
    noise: Noise,
    uncertainty: Uncertainty,
    command_delay: Option<f64>,
    hydraulics: Option<HydraulicSection>,
    #[serde(default)]
    effects: EffectSections,
    // What an identification says of its errors besides.
    #[serde(rename = "covariance")]
    _covariance: Option<IgnoredAny>,
    #[serde(rename = "standard_errors")]
    _standard_errors: Option<IgnoredAny>,
    // What a diagnosis began from.
    #[serde(rename = "described")]
    _described: Option<IgnoredAny>,
}

/// Units of all numbers of the file.
#[derive(Deserialize, Clone, Copy, PartialEq, Default)]
#[serde(rename_all = "lowercase")]
enum Units {
    /// Inch, lbf, s, V.
    #[default]
    #[serde(alias = "inch, lbf, second, volt")]
    Laboratory,
    /// m, N, kg, s, V.
    #[serde(alias = "SI", alias = "metre, newton, second, volt")]
    Si,
}

impl File {
    /// The same in the laboratory's units.
    fn in_laboratory_units(mut self) -> Self {
        if self.units == Units::Laboratory {
            return self;
        }
        let in_units = |values: &mut [f64], unit: f64| values.iter_mut().for_each(|v| *v /= unit);
        if let Some(actuator) = &mut self.actuator {
            in_units(&mut actuator.voltage_to_force, LBF);
            in_units(&mut actuator.velocity_to_force, LBF_S_PER_INCH);
        }
        for body in [Some(&mut self.table), self.specimen.as_mut()]
            .into_iter()
            .flatten()
        {
            body.mass /= LBF_S2_PER_INCH;
            body.damping /= LBF_S_PER_INCH;
            body.stiffness /= LBF_PER_INCH;
        }
        if let Some(c) = &mut self.controller {
            // Volt over a length, here and there.
            for gain in [
                &mut c.proportional,
                &mut c.integral,
                &mut c.velocity_feedforward,
                &mut c.acceleration_feedforward,
                &mut c.velocity_feedback,
                &mut c.acceleration_feedback,
            ] {
                *gain *= INCH;
            }
        }
        let noise = &mut self.noise;
        noise.displacement /= INCH;
        noise.acceleration /= INCH;
        noise.specimen_acceleration /= INCH;
        noise.actuator_force /= LBF;
        self.units = Units::Laboratory;
        self
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Actuator {
    denominator: [f64; 4],
    voltage_to_force: [f64; 3],
    velocity_to_force: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Oscillator {
    mass: f64,
    damping: f64,
    stiffness: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Controller {
    kind: String,
    proportional: f64,
    integral: f64,
    velocity_feedforward: f64,
    acceleration_feedforward: f64,
    velocity_feedback: f64,
    acceleration_feedback: f64,
    velocity_filter: f64,
    limit: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Noise {
    displacement: f64,
    acceleration: f64,
    actuator_force: f64,
    specimen_acceleration: f64,
    valve_command: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Uncertainty {
    relative: f64,
}

impl Nominal {
    /// Reads the text of a `nominal.toml`, in inch, lbf, s, V or, where it says `units = "si"`, in SI;
    /// a sentence says what is wrong. A model file is one, as `shakebench identify` writes it: the
    /// effects that it knows of are then those of the nominal rig.
    ///
    /// # Errors
    /// What is not TOML or has an unknown key, with line and column; values out of range.
    pub fn parse(text: &str) -> Result<Self, NominalError> {
        let file: File = toml::from_str(text)?;
        let file = file.in_laboratory_units();
        let (effects, sensors) = known_effects(&file)?;
        let actuator = file.actuator.ok_or(NominalError::NoActuator)?;
        let lead = actuator.denominator[0];
        if lead.is_nan() || lead <= 0.0 {
            return Err(out_of_range(
                "actuator.denominator:",
                "the leading coefficient must be positive",
            ));
        }
        let over_lead = |c: [f64; 3]| c.map(|value| value / lead);
        let [_, a2, a1, a0] = actuator.denominator;
        let shake_table = ShakeTable {
            actuator: IdentifiedActuator::from_thesis_units(
                over_lead([a2, a1, a0]),
                over_lead(actuator.voltage_to_force),
                over_lead(actuator.velocity_to_force),
            ),
            table: Table::from_thesis_units(
                file.table.mass,
                file.table.damping,
                file.table.stiffness,
            ),
        };
        shake_table.validate()?;
        let specimen = file.specimen.map(|specimen| LinearSpecimen {
            mass: specimen.mass * LBF_S2_PER_INCH,
            damping: specimen.damping * LBF_S_PER_INCH,
            stiffness: specimen.stiffness * LBF_PER_INCH,
        });
        if let Some(specimen) = &specimen {
            specimen.validate()?;
        }
        let controller = match file.controller {
            None => None,
            Some(c) if c.kind == "three_variable_control" => Some(ControlLaw {
                proportional: c.proportional / INCH,
                integral: c.integral / INCH,
                velocity_feedforward: c.velocity_feedforward / INCH,
                acceleration_feedforward: c.acceleration_feedforward / INCH,
                velocity_feedback: c.velocity_feedback / INCH,
                acceleration_feedback: c.acceleration_feedback / INCH,
                velocity_filter: c.velocity_filter,
                limit: c.limit,
            }),
            Some(c) => {
                return Err(NominalError::UnknownControl(c.kind));
            }
        };
        let noise = [
            file.noise.displacement * INCH,
            file.noise.acceleration * INCH,
            file.noise.actuator_force * LBF,
            file.noise.specimen_acceleration * INCH,
        ];
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !noise.iter().all(|&sd| positive(sd)) {
            return Err(out_of_range(
                "noise:",
                "every standard deviation must be positive",
            ));
        }
        if !positive(file.sample_rate) {
            return Err(out_of_range("sample_rate", "must be positive"));
        }
        if !(0.0..0.5).contains(&file.uncertainty.relative) {
            return Err(out_of_range(
                "uncertainty.relative",
                "must lie between 0 and 0.5",
            ));
        }
        Ok(Self {
            sample_rate: file.sample_rate,
            shake_table,
            specimen,
            controller,
            noise,
            command_noise: file.noise.valve_command.max(0.0),
            uncertainty: file.uncertainty.relative,
            effects,
            sensors,
        })
    }
}

fn out_of_range(key: &'static str, expected: &'static str) -> NominalError {
    NominalError::OutOfRange { key, expected }
}

/// What the file knows of delay, friction and sensors, and its `[effects]`.
fn known_effects(file: &File) -> Result<(Effects, Instrumentation), NominalError> {
    let (mut effects, mut sensors) = (Effects::default(), Instrumentation::default());
    effects.valve.command_delay = file.command_delay.unwrap_or(0.0);
    if let Some(own) = &file.hydraulics {
        let friction = &mut effects.friction;
        friction.coulomb_force = own.seal_friction;
        friction.stribeck_force = own.seal_friction * own.seal_excess;
        friction.stribeck_velocity = own.seal_stribeck_velocity.max(1e-6);
        sensors.acceleration.scale_error = own.accelerometer_scale - 1.0;
        sensors.acceleration.delay = own.accelerometer_delay.max(0.0);
    }
    for (name, values) in &file.effects {
        set_effect(name, values, &mut effects, &mut sensors)?;
    }
    effects.validate()?;
    sensors.validate_values()?;
    Ok((effects, sensors))
}

/// Sets the effect of a section `[effects.name]`.
pub(super) fn set_effect(
    name: &str,
    values: &BTreeMap<String, f64>,
    effects: &mut Effects,
    sensors: &mut Instrumentation,
) -> Result<(), NominalError> {
    let known = || effects::all().map(|effect| effect.name);
    let effect = effects::find(name).ok_or_else(|| NominalError::UnknownEffect {
        effect: name.to_owned(),
        hint: units::hint(name, known()),
    })?;
    for (parameter, value) in values {
        let own = || effect.parameters.iter();
        let field = own().find(|p| p.name == parameter).and_then(|p| p.field);
        let field = field.ok_or_else(|| NominalError::UnknownParameter {
            effect: name.to_owned(),
            parameter: parameter.clone(),
            hint: units::hint(parameter, own().map(|p| p.name)),
        })?;
        *field.of(effects, sensors) = *value;
    }
    Ok(())
}

impl ControlLaw {
    /// The law at rest, sampled every `period` s.
    pub fn start(&self, period: f64) -> ControlLawState {
        ControlLawState {
            law: *self,
            period,
            before: None,
            velocity: 0.0,
            integral: 0.0,
        }
    }

    /// The commands of the law for the measured signals (V), sampled every `period` s; from
    /// rest. As many as the shortest column has samples.
    pub fn commands(
        &self,
        reference: &[f64],
        displacement: &[f64],
        acceleration: &[f64],
        period: f64,
    ) -> Vec<f64> {
        let mut state = self.start(period);
        let n = reference
            .len()
            .min(displacement.len())
            .min(acceleration.len());
        (0..n)
            .map(|k| state.command(&reference[..n], k, displacement[k], acceleration[k]))
            .collect()
    }
}

/// Memory of a [`ControlLaw`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlLawState {
    law: ControlLaw,
    period: f64,
    before: Option<f64>,
    velocity: f64,
    integral: f64,
}

impl ControlLawState {
    /// The command (V) at sample `k` of `reference` (m), from the measured displacement (m) and
    /// acceleration (m/s²).
    pub fn command(
        &mut self,
        reference: &[f64],
        k: usize,
        displacement: f64,
        acceleration: f64,
    ) -> f64 {
        let (law, period) = (&self.law, self.period);
        let difference = displacement - self.before.unwrap_or(displacement);
        self.before = Some(displacement);
        self.velocity += law.velocity_filter * (difference / period - self.velocity);
        let error = reference[k] - displacement;
        self.integral += law.integral * error * period;
        let ahead = reference[(k + 1).min(reference.len() - 1)];
        let behind = reference[k.saturating_sub(1)];
        let reference_velocity = (ahead - behind) / (2.0 * period);
        let reference_acceleration = (ahead - 2.0 * reference[k] + behind) / (period * period);
        let u = law.proportional * error
            + self.integral
            + law.velocity_feedforward * reference_velocity
            + law.acceleration_feedforward * reference_acceleration
            - law.velocity_feedback * self.velocity
            - law.acceleration_feedback * acceleration;
        u.clamp(-law.limit, law.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABORATORY: &str = r#"
sample_rate = 500.0
[actuator]
denominator = [2.0, 1000.0, 400000.0, 2000000.0]
voltage_to_force = [0.0, 0.0, 80000000.0]
velocity_to_force = [-9000.0, -4000000.0, -900000000.0]
[table]
mass = 0.12
damping = 0.5
stiffness = 3.0
[controller]
kind = "three_variable_control"
proportional = 3.0
integral = 0.1
velocity_feedforward = 0.05
acceleration_feedforward = 0.002
velocity_feedback = 0.01
acceleration_feedback = 0.001
velocity_filter = 0.5
limit = 10.0
[noise]
displacement = 0.0005
acceleration = 1.5
actuator_force = 0.3
specimen_acceleration = 1.0
valve_command = 0.001
[uncertainty]
relative = 0.05
"#;

    fn told(from: &str, to: &str) -> String {
        assert!(LABORATORY.contains(from));
        let text = LABORATORY.replacen(from, to, 1);
        Nominal::parse(&text).unwrap_err().to_string()
    }

    #[test]
    fn a_file_is_in_the_units_of_the_laboratory_unless_it_says_others() {
        let own = Nominal::parse(LABORATORY).unwrap();
        let close = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        };
        // Over the leading coefficient, and a lbf is 4.4482216 N, an inch 25.4 mm.
        let actuator = own.shake_table.actuator;
        assert_eq!(actuator.denominator, [500.0, 200_000.0, 1_000_000.0]);
        close(actuator.voltage_to_force[2], 4e7 * 4.448_221_615_260_5);
        close(
            actuator.velocity_to_force[0],
            -4500.0 * 4.448_221_615_260_5 / 0.0254,
        );
        close(
            own.shake_table.table.mass,
            0.12 * 4.448_221_615_260_5 / 0.0254,
        );
        close(own.noise[0], 0.0005 * 0.0254);
        close(own.noise[1], 1.5 * 0.0254);
        close(own.noise[2], 0.3 * 4.448_221_615_260_5);
        let law = own.controller.unwrap();
        close(law.proportional, 3.0 / 0.0254);
        close(law.acceleration_feedback, 0.001 / 0.0254);
        assert_eq!((law.velocity_filter, law.limit), (0.5, 10.0));
        assert_eq!((own.command_noise, own.uncertainty), (0.001, 0.05));
        assert!(own.specimen.is_none());
        // The same numbers in SI.
        let si = Nominal::parse(&format!("units = \"si\"\n{LABORATORY}")).unwrap();
        close(si.shake_table.actuator.voltage_to_force[2], 4e7);
        close(si.shake_table.actuator.velocity_to_force[0], -4500.0);
        let table = si.shake_table.table;
        for (found, expected) in [
            (table.mass, 0.12),
            (table.damping, 0.5),
            (table.stiffness, 3.0),
            (si.noise[0], 0.0005),
            (si.noise[1], 1.5),
            (si.noise[2], 0.3),
            (si.noise[3], 1.0),
        ] {
            close(found, expected);
        }
        let law = si.controller.unwrap();
        for (found, expected) in [
            (law.proportional, 3.0),
            (law.integral, 0.1),
            (law.velocity_feedforward, 0.05),
            (law.acceleration_feedforward, 0.002),
            (law.velocity_feedback, 0.01),
            (law.acceleration_feedback, 0.001),
        ] {
            close(found, expected);
        }
    }

    #[test]
    fn values_that_cannot_be_are_refused_with_their_key() {
        for (from, to, key) in [
            ("[2.0, 1000.0", "[0.0, 1000.0", "actuator.denominator"),
            ("displacement = 0.0005", "displacement = 0.0", "noise"),
            ("sample_rate = 500.0", "sample_rate = -500.0", "sample_rate"),
            ("relative = 0.05", "relative = 0.5", "uncertainty.relative"),
            ("\"three_variable_control\"", "\"pid\"", "pid"),
            ("mass = 0.12", "mass = -0.12", "mass"),
        ] {
            let told = told(from, to);
            assert!(told.contains(key), "{told}");
        }
        let without = LABORATORY.replace("[actuator]", "[actuator_of_another]");
        assert!(Nominal::parse(&without).is_err());
    }

    fn law() -> ControlLaw {
        ControlLaw {
            proportional: 100.0,
            integral: 0.0,
            velocity_feedforward: 0.0,
            acceleration_feedforward: 0.0,
            velocity_feedback: 0.0,
            acceleration_feedback: 0.0,
            velocity_filter: 0.5,
            limit: 10.0,
        }
    }

    #[test]
    fn every_gain_of_the_law_acts_on_its_own_signal() {
        const PERIOD: f64 = 0.002;
        let at = |power: i32| -> Vec<f64> {
            (0..200)
                .map(|k| (f64::from(k) * PERIOD).powi(power))
                .collect()
        };
        let (rest, still, ramp, bowl) = (vec![0.0; 200], vec![0.01; 200], at(1), at(2));
        let last = |law: ControlLaw, signals: [&[f64]; 3]| {
            let [reference, displacement, acceleration] = signals;
            let all = law.commands(reference, displacement, acceleration, PERIOD);
            assert_eq!(all.len(), 200);
            // The last one has no reference ahead of it.
            all[198]
        };
        let none = ControlLaw {
            proportional: 0.0,
            ..law()
        };
        for (law, signals, expected) in [
            (law(), [&still, &rest, &rest], 1.0),
            (law(), [&rest, &still, &rest], -1.0),
            // 0.01 m over 199 samples of 2 ms.
            (
                ControlLaw {
                    integral: 50.0,
                    ..none
                },
                [&still, &rest, &rest],
                0.199,
            ),
            (
                ControlLaw {
                    velocity_feedforward: 3.0,
                    ..none
                },
                [&ramp, &rest, &rest],
                3.0,
            ),
            (
                ControlLaw {
                    acceleration_feedforward: 0.4,
                    ..none
                },
                [&bowl, &rest, &rest],
                0.8,
            ),
            (
                ControlLaw {
                    velocity_feedback: 3.0,
                    ..none
                },
                [&rest, &ramp, &rest],
                -3.0,
            ),
            (
                ControlLaw {
                    acceleration_feedback: 5.0,
                    ..none
                },
                [&rest, &rest, &still],
                -0.05,
            ),
            (
                ControlLaw {
                    limit: 0.5,
                    ..law()
                },
                [&still, &rest, &rest],
                0.5,
            ),
        ] {
            let found = last(law, signals.map(|own| &own[..]));
            assert!(
                (found - expected).abs() < 1e-6,
                "{law:?}: {found}, expected {expected}"
            );
        }
        // Half of the newest difference is in the velocity at once.
        let own = ControlLaw {
            velocity_feedback: 1.0,
            ..none
        };
        let first = own.commands(&rest, &ramp, &rest, PERIOD);
        assert_eq!(first[0], 0.0);
        assert!((first[1] + 0.5).abs() < 1e-9 && (first[2] + 0.75).abs() < 1e-9);
    }
}
