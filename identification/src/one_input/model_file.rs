//! The file of a transfer function: read by people and programs, and, of a rig with a loop of its own,
//! by the diagnosis as the description of a closed-loop actuator.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::OneInput;
use crate::IdentificationError;
use crate::data::{Channel, Named};
use crate::diagnosis::rigs::{Column, Quantity};
use crate::estimation::state_variable_filter::Between;

#[derive(Serialize)]
struct File {
    #[serde(flatten)]
    description: Option<Description>,
    transfer_function: Section,
}

/// A [`crate::diagnosis::rigs::Description`] as it is written.
#[derive(Serialize)]
struct Description {
    name: String,
    kind: &'static str,
    data: Vec<PathBuf>,
    columns: BTreeMap<&'static str, Column>,
    nominal: BTreeMap<&'static str, Quantity>,
    left_out: BTreeMap<&'static str, Quantity>,
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
    /// The text of the model file. Of a rig whose input is a displacement and whose data are in
    /// `data`, with these `columns`, it is a description for the diagnosis as well.
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
        let file = File {
            description: self.description(name, data, columns),
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
        let text = toml::to_string(&file).map_err(|error| IdentificationError::ModelFile {
            path: name.into(),
            what: error.to_string(),
            expected: "finite numbers",
        })?;
        let diagnosis = match file.description {
            Some(_) => "# shakebench diagnose THIS.toml says what the rig does beyond it.\n",
            None => "",
        };
        Ok(format!(
            "# Command to displacement, descending powers of s, SI: numerator/denominator exp(-s delay).\n\
             {diagnosis}{text}"
        ))
    }

    /// The description of a closed-loop actuator that comes nearest.
    fn description(&self, name: &str, data: &[PathBuf], columns: &[Named]) -> Option<Description> {
        if self.input != Channel::Reference {
            return None;
        }
        let column = |channel: Channel| {
            let own = columns.iter().find(|own| own.channel == channel)?;
            Some(Column {
                column: own.head.clone(),
                unit: own.unit.clone(),
            })
        };
        let columns = BTreeMap::from([
            ("time", column(Channel::Time)?),
            ("command", column(Channel::Reference)?),
            ("displacement", column(Channel::Displacement)?),
        ]);
        // The response's fall and lateness at low frequencies: 1/K + lag.
        let scale = self.model.response(1e-3, self.period).re;
        let slowest = self.model.poles().into_iter().map(|pole| pole.norm());
        let loop_gain = slowest.fold(f64::INFINITY, f64::min);
        let low = 0.05 * loop_gain;
        let lateness = -self.model.response(low, self.period).arg() / low;
        let lag = (lateness - 1.0 / loop_gain).max(self.period);
        let quantity = |value: f64, plus_minus: f64, unit: &str| Quantity {
            value,
            plus_minus,
            unit: unit.into(),
        };
        let moves = self
            .rest
            .first()
            .map_or(1e-3, |own| crate::data::mean_and_deviation(&own.measured).1);
        let nominal = BTreeMap::from([
            ("loop_gain", quantity(loop_gain, 0.2 * loop_gain, "1/s")),
            ("command_lag", quantity(lag, lag, "s")),
            ("scale", quantity(scale, 0.02, "1")),
            ("offset", quantity(0.0, 0.1 * moves, "m")),
        ]);
        Some(Description {
            name: name.into(),
            kind: "closed_loop_actuator",
            data: data.iter().map(|path| absolute(path)).collect(),
            columns,
            nominal,
            left_out: BTreeMap::from([("every_second_block", quantity(2.0, 0.0, "s"))]),
        })
    }
}

/// From anywhere.
fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}
