//! Recordings on an even time base.

mod even_base;
mod faults;

use crate::IdentificationError;

pub use faults::Finding;

/// Channels of one test on an even time base, SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// What the recording is called in messages.
    pub name: String,
    /// Sampling period, s.
    pub period: f64,
    /// Time of the first sample, s.
    pub start: f64,
    /// The file or test it comes from; pieces of one recording share it.
    pub source: String,
    channels: Vec<(String, Vec<f64>)>,
}

impl Recording {
    /// Joins channels that are sampled evenly.
    ///
    /// # Errors
    /// Channels of different length, a period that is not positive, samples that are not finite.
    pub fn new(
        name: &str,
        period: f64,
        channels: Vec<(String, Vec<f64>)>,
    ) -> Result<Self, IdentificationError> {
        let unreadable = |what: String, expected| IdentificationError::Unreadable {
            recording: name.to_string(),
            what,
            expected,
        };
        if !(period.is_finite() && period > 0.0) {
            return Err(unreadable(
                format!("the period is {period} s"),
                "a positive sampling period",
            ));
        }
        let length = channels.first().map_or(0, |channel| channel.1.len());
        for (channel, values) in &channels {
            if values.len() != length {
                return Err(unreadable(
                    format!("`{channel}` has {} samples, not {length}", values.len()),
                    "channels of one length",
                ));
            }
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(unreadable(
                    format!("`{channel}` has no number at sample {}", at + 1),
                    "finite numbers",
                ));
            }
        }
        Ok(Self {
            name: name.to_string(),
            period,
            start: 0.0,
            source: name.to_string(),
            channels,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.channels.first().map_or(0, |channel| channel.1.len())
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Length in seconds.
    pub fn duration(&self) -> f64 {
        self.len() as f64 * self.period
    }

    /// Names of the channels.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|channel| channel.0.as_str())
    }

    /// The samples of a channel, if it was recorded.
    pub fn channel(&self, name: &str) -> Option<&[f64]> {
        let found = self.channels.iter().find(|channel| channel.0 == name)?;
        Some(&found.1)
    }

    /// The samples of a channel that must be there and must move.
    ///
    /// # Errors
    /// It is missing or constant.
    pub fn require(
        &self,
        name: &str,
        expected: &'static str,
    ) -> Result<&[f64], IdentificationError> {
        let values = self
            .channel(name)
            .ok_or_else(|| IdentificationError::MissingChannel {
                recording: self.name.clone(),
                channel: name.to_string(),
                found: self.names().collect::<Vec<_>>().join(", "),
                expected,
            })?;
        match values.first() {
            Some(&value) if is_constant(values) => Err(IdentificationError::ConstantChannel {
                recording: self.name.clone(),
                channel: name.to_string(),
                value,
            }),
            _ => Ok(values),
        }
    }

    /// The samples `first..end` as a recording.
    pub fn cut(&self, first: usize, end: usize) -> Self {
        let (first, end) = (first.min(self.len()), end.min(self.len()));
        Self {
            name: self.name.clone(),
            period: self.period,
            start: self.start + first as f64 * self.period,
            source: self.source.clone(),
            channels: self
                .channels
                .iter()
                .map(|(name, values)| (name.clone(), values[first..end.max(first)].to_vec()))
                .collect(),
        }
    }
}

/// Mean, and root mean square about it.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
    (mean, square.sqrt())
}

/// `100 (1 - ||y - m|| / ||y - mean(y)||)`, per cent.
pub fn fit_percent(measured: &[f64], model: &[f64]) -> f64 {
    let (mean, _) = mean_and_deviation(measured);
    let error: f64 = measured
        .iter()
        .zip(model)
        .map(|(y, m)| (y - m) * (y - m))
        .sum();
    let size: f64 = measured.iter().map(|y| (y - mean) * (y - mean)).sum();
    100.0 * (1.0 - (error / size).sqrt())
}

fn is_constant(values: &[f64]) -> bool {
    let (mean, deviation) = mean_and_deviation(values);
    deviation <= 1e-12 * mean.abs() || deviation == 0.0
}
