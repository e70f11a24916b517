//! The file of a transfer function: read by people and programs, and by the diagnosis as the description
//! of a closed-loop actuator, or of an axis without its loop where a voltage makes a speed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use units::vocabulary;

use serde::Serialize;

use super::OneInput;
use crate::kinds::{self, Column, FittedNominal, Quantity, Windows, fit_nominal};
use recordings::IdentificationError;
use recordings::{Channel, Named};
use sysid::state_variable_filter::Between;

/// One over the angular frequency at which a table's mass swings on the oil, before it is fitted: 30 Hz.
const RESONANCE: f64 = 5.3e-3;

#[derive(Serialize)]
struct File {
    #[serde(flatten)]
    description: Option<Description>,
    transfer_function: Section,
}

/// A [`crate::kinds::Description`] as it is written.
#[derive(Serialize)]
struct Description {
    name: String,
    kind: &'static str,
    data: Vec<PathBuf>,
    columns: BTreeMap<&'static str, Column>,
    nominal: BTreeMap<&'static str, Quantity>,
    left_out: BTreeMap<&'static str, Quantity>,
    #[serde(skip_serializing_if = "Option::is_none")]
    windows: Option<Windows>,
}

#[derive(Serialize)]
struct Section {
    input: &'static str,
    input_unit: &'static str,
    output: &'static str,
    output_unit: &'static str,
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    delay: f64,
    between_samples: &'static str,
    sample_rate: f64,
    noise: BTreeMap<&'static str, f64>,
    standard_errors: Errors,
}

#[derive(Serialize)]
struct Errors {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    delay: f64,
}

impl OneInput {
    /// The text of the model file. Of a rig whose data are in `data`, with these `columns`, it is a
    /// description for the diagnosis as well. The description's nominal values are fitted to all data, so that
    /// it predicts as it stands.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn to_toml(
        &self,
        name: &str,
        data: &[PathBuf],
        columns: &[Named],
    ) -> Result<String, IdentificationError> {
        let poles = self.structure.poles;
        let (denominator, rest) = self.standard_error.split_at(poles);
        let (numerator, delay) = rest.split_at(self.structure.zeros + 1);
        let mut errors = vec![0.0];
        errors.extend(denominator);
        if self.structure.integrates {
            errors.push(0.0);
        }
        let noise = [self.input, Channel::Displacement]
            .iter()
            .zip(self.noise)
            .map(|(channel, value)| (channel.name(), value))
            .collect();
        let mut description = self.description(name, data, columns);
        let fitted = description.as_mut().and_then(Description::fit);
        let file = File {
            description,
            transfer_function: Section {
                input: self.input.name(),
                input_unit: self.input.unit(),
                output: Channel::Displacement.name(),
                output_unit: Channel::Displacement.unit(),
                numerator: self.model.numerator.clone(),
                denominator: self.model.denominator.clone(),
                delay: self.model.delay,
                between_samples: match self.model.between {
                    Between::Held => "held",
                    Between::Straight => "straight",
                },
                sample_rate: 1.0 / self.period,
                noise,
                standard_errors: Errors {
                    numerator: numerator.to_vec(),
                    denominator: errors,
                    delay: delay.first().copied().unwrap_or(0.0),
                },
            },
        };
        let text = toml::to_string(&file).map_err(|error| refused(name, &error))?;
        let mut diagnosis = String::new();
        if file.description.is_some() {
            diagnosis += "# shakebench diagnose THIS.toml finds effects that this model lacks.\n";
        }
        if let Some(fitted) = fitted {
            diagnosis += &format!(
                "# [nominal] is fitted to all data and leaves {:.1} % of the displacement;\n\
                 # shakebench diagnose --model THIS.toml --validate OTHER.csv predicts with it.\n",
                100.0 * fitted.error
            );
        }
        Ok(format!(
            "# Command to displacement, descending powers of s, SI: numerator/denominator exp(-s delay).\n\
             {diagnosis}{text}"
        ))
    }

    /// The description that comes nearest.
    fn description(&self, name: &str, data: &[PathBuf], columns: &[Named]) -> Option<Description> {
        let column = |channel: Channel| {
            let own = columns.iter().find(|own| own.channel == channel)?;
            Some(Column {
                column: own.head.clone(),
                unit: own.unit.clone(),
            })
        };
        let has_loop = self.input == Channel::Reference;
        let (input, output) = if has_loop {
            ("command", "displacement")
        } else {
            ("motor_voltage", "position")
        };
        let columns = BTreeMap::from([
            ("time", column(Channel::Time)?),
            (input, column(self.input)?),
            (output, column(Channel::Displacement)?),
        ]);
        let (kind, nominal) = if has_loop {
            ("closed_loop_actuator", BTreeMap::from(self.closed_loop()))
        } else {
            ("linear_axis", self.axis().unwrap_or_default())
        };
        Some(Description {
            name: name.into(),
            kind,
            data: data.iter().map(|path| absolute(path)).collect(),
            columns,
            nominal,
            left_out: BTreeMap::from([("every_second_block", quantity(2.0, 0.0, "s"))]),
            windows: (!has_loop).then(|| Windows {
                length: quantity(2.0, 0.0, "s"),
                known: quantity(0.1, 0.0, "s"),
            }),
        })
    }

    /// Root mean square of the displacement, m, and of its speed, m/s.
    fn sizes(&self) -> (f64, f64) {
        let Some(own) = self.rest.first() else {
            return (1e-3, 1e-2);
        };
        let steps = own.measured.windows(2).map(|pair| pair[1] - pair[0]);
        let (_, step) = recordings::mean_and_deviation(&steps.collect::<Vec<f64>>());
        let (_, moves) = recordings::mean_and_deviation(&own.measured);
        (moves, step / own.period)
    }

    /// Nominal values of a closed loop, by the response's slowest pole and its delay.
    fn closed_loop(&self) -> [(&'static str, Quantity); 11] {
        let scale = self.model.response(1e-3, self.period).re;
        let slowest = self.model.poles().into_iter().map(|pole| pole.norm());
        let gain = slowest.fold(f64::INFINITY, f64::min);
        let (moves, _) = self.sizes();
        [
            ("loop_gain", quantity(gain, 0.5 * gain, "1/s")),
            ("loop_lag", quantity(0.1 / gain, 0.1 / gain, "s")),
            ("resonance", quantity(RESONANCE, RESONANCE, "s")),
            ("resonance_damping", quantity(0.5, 0.3, "1")),
            ("command_lag", quantity(0.0, 0.0, "s")),
            ("feedforward", quantity(0.1, 0.1, "1")),
            ("integral", quantity(0.1, 0.1, "1/s")),
            ("spring_droop", quantity(0.01, 0.01, "1")),
            ("command_delay", quantity(self.model.delay, 3e-3, "s")),
            ("scale", quantity(scale, 0.02, "1")),
            ("offset", quantity(0.0, 0.1 * moves, "m")),
        ]
    }

    /// Nominal values of an axis of mass one (voltage and position tell forces only against it): speed over
    /// voltage and the slowest pole beside the one at zero, or the poles on a spring. None where the poles
    /// are those of no axis.
    fn axis(&self) -> Option<BTreeMap<&'static str, Quantity>> {
        let (viscous, stiffness, gain) = if self.structure.integrates {
            let poles = self.model.poles().into_iter().map(|pole| pole.norm());
            let viscous = poles
                .filter(|own| *own > 1e-6)
                .fold(f64::INFINITY, f64::min);
            let low = 1e-3 * viscous;
            let speed = self.model.response(low, self.period).norm() * low;
            (viscous, None, speed * viscous)
        } else {
            let gain = *self.model.numerator.last()?;
            match self.model.denominator[..] {
                [.., mass, viscous, stiffness] => {
                    (viscous / mass, Some(stiffness / mass), gain / mass)
                }
                [viscous, stiffness] => {
                    // The mass of a lag is one whose pole is faster than the samples show.
                    let slow = stiffness / viscous;
                    let fast = (10.0 * slow).max(1.0 / self.period);
                    (fast + slow, Some(fast * slow), gain / viscous * fast)
                }
                _ => return None,
            }
        };
        let (_, speed_found) = self.sizes();
        let force = viscous * speed_found;
        let is_an_axis = |own: f64| own.is_finite() && own > 0.0;
        if ![viscous, gain, stiffness.unwrap_or(1.0)]
            .into_iter()
            .all(is_an_axis)
        {
            return None;
        }
        let mut all = BTreeMap::from([
            ("mass", quantity(1.0, 0.0, "kg")),
            (vocabulary::FORCE_GAIN, quantity(gain, 0.5 * gain, "N/V")),
            (
                "viscous_friction",
                quantity(viscous, 0.5 * viscous, "N s/m"),
            ),
            (
                vocabulary::COULOMB_FRICTION,
                quantity(0.05 * force, 0.05 * force, "N"),
            ),
            ("offset", quantity(0.0, 0.1 * force, "N")),
        ]);
        let spring = stiffness.map(|own| ("stiffness", quantity(own, 0.5 * own, "N/m")));
        all.extend(spring);
        Some(all)
    }
}

impl Description {
    /// Puts the values that all data give into the nominal model; none, and as it was, where it cannot be
    /// fitted.
    fn fit(&mut self) -> Option<FittedNominal> {
        if self.nominal.is_empty() {
            let text = toml::to_string(&self).ok()?;
            let bare = kinds::Description::parse(Path::new(&self.name), &text).ok()?;
            let begun = kinds::guess::begun(&bare).ok()?.into_iter();
            let begun = begun
                .map(|(name, value, deviation, unit)| (name, quantity(value, deviation, unit)));
            self.nominal.extend(begun);
        }
        let text = toml::to_string(&self).ok()?;
        let own = kinds::Description::parse(Path::new(&self.name), &text).ok()?;
        let found = fit_nominal(&own).ok()??;
        for parameter in &found.parameters {
            if let Some(quantity) = self.nominal.get_mut(parameter.name.as_str()) {
                quantity.value = parameter.value;
            }
        }
        Some(found)
    }
}

fn refused(name: &str, error: &toml::ser::Error) -> IdentificationError {
    IdentificationError::ModelFile {
        path: name.into(),
        what: error.to_string(),
        expected: "finite numbers",
    }
}

fn quantity(value: f64, plus_minus: f64, unit: &str) -> Quantity {
    Quantity {
        value,
        plus_minus,
        unit: unit.into(),
    }
}

/// From anywhere.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}
