//! What was measured: channels of one test in SI units.

use super::{Channel, is_constant};
use crate::IdentificationError;

/// When the samples of a recording were taken.
#[derive(Debug, Clone, PartialEq)]
pub enum TimeBase {
    /// Not said: points of a path.
    Unknown,
    /// At these times, as the acquisition wrote them, s.
    Stamps(Vec<f64>),
    /// Every `period` s from `start` s on.
    Even {
        /// s.
        start: f64,
        /// s.
        period: f64,
    },
}

/// Channels of one test, of one length, in SI units. A sample that is missing is NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// What the recording is called in messages.
    pub name: String,
    /// The file or test it comes from; pieces of one recording share it.
    pub source: String,
    /// When its samples were taken.
    pub time: TimeBase,
    /// What its reader should know of the file.
    pub notes: Vec<String>,
    /// Headings of the file's columns that are not channels.
    pub left_alone: Vec<String>,
    pub(super) channels: Vec<(Channel, Vec<f64>)>,
}

impl Recording {
    /// Joins channels of one length; their samples may be missing.
    ///
    /// # Errors
    /// Channels, or time stamps, of different length.
    pub fn measured(
        name: &str,
        time: TimeBase,
        channels: Vec<(Channel, Vec<f64>)>,
    ) -> Result<Self, IdentificationError> {
        let length = match &time {
            TimeBase::Stamps(stamps) => stamps.len(),
            _ => channels.first().map_or(0, |channel| channel.1.len()),
        };
        if let Some((channel, values)) = channels.iter().find(|(_, own)| own.len() != length) {
            return Err(IdentificationError::Unreadable {
                recording: name.to_string(),
                what: format!(
                    "`{}` has {} samples, not {length}",
                    channel.name(),
                    values.len()
                ),
                expected: "columns of one length",
            });
        }
        Ok(Self {
            name: name.to_string(),
            source: name.to_string(),
            time,
            notes: Vec::new(),
            left_alone: Vec::new(),
            channels,
        })
    }

    /// Joins channels that are sampled evenly and whole.
    ///
    /// # Errors
    /// Channels of different length, a period that is not positive, samples that are not finite.
    pub fn new(
        name: &str,
        period: f64,
        channels: Vec<(Channel, Vec<f64>)>,
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
        for (channel, values) in &channels {
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(unreadable(
                    format!("`{}` has no number at sample {}", channel.name(), at + 1),
                    "finite numbers",
                ));
            }
        }
        let time = TimeBase::Even { start: 0.0, period };
        Self::measured(name, time, channels)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        match &self.time {
            TimeBase::Stamps(stamps) => stamps.len(),
            _ => self.channels.first().map_or(0, |channel| channel.1.len()),
        }
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sampling period, s; NaN where the samples are on no even base.
    pub fn period(&self) -> f64 {
        match self.time {
            TimeBase::Even { period, .. } => period,
            _ => f64::NAN,
        }
    }

    /// Time of a sample, s; NaN where it is not known.
    pub fn time_at(&self, sample: usize) -> f64 {
        match &self.time {
            TimeBase::Unknown => f64::NAN,
            TimeBase::Stamps(stamps) => stamps.get(sample).copied().unwrap_or(f64::NAN),
            TimeBase::Even { start, period } => start + sample as f64 * period,
        }
    }

    /// The time stamps as they were recorded, s, where there are some.
    pub fn stamps(&self) -> Option<&[f64]> {
        match &self.time {
            TimeBase::Stamps(stamps) => Some(stamps),
            _ => None,
        }
    }

    /// Length in seconds.
    pub fn duration(&self) -> f64 {
        self.len() as f64 * self.period()
    }

    /// The channels that were recorded.
    pub fn channels(&self) -> impl Iterator<Item = (Channel, &[f64])> {
        self.channels
            .iter()
            .map(|(channel, values)| (*channel, values.as_slice()))
    }

    /// The samples of a channel, if it was recorded.
    pub fn channel(&self, channel: Channel) -> Option<&[f64]> {
        let found = self.channels.iter().find(|own| own.0 == channel)?;
        Some(&found.1)
    }

    /// The samples of a channel; none where it was not recorded.
    pub fn samples(&self, channel: Channel) -> &[f64] {
        self.channel(channel).unwrap_or_default()
    }

    /// Puts other samples in the place of a channel's, or adds the channel.
    ///
    /// # Errors
    /// Samples of another number than the recording has.
    pub fn replace(
        &mut self,
        channel: Channel,
        values: Vec<f64>,
    ) -> Result<(), IdentificationError> {
        if values.len() != self.len() {
            return Err(IdentificationError::Unreadable {
                recording: self.name.clone(),
                what: format!(
                    "`{}` has {} samples, not {}",
                    channel.name(),
                    values.len(),
                    self.len()
                ),
                expected: "columns of one length",
            });
        }
        match self.channels.iter_mut().find(|own| own.0 == channel) {
            Some(own) => own.1 = values,
            None => self.channels.push((channel, values)),
        }
        Ok(())
    }

    /// The same without a channel.
    #[must_use]
    pub fn without(mut self, channel: Channel) -> Self {
        self.channels.retain(|own| own.0 != channel);
        self
    }

    /// The samples of a channel that must be there and must move.
    ///
    /// # Errors
    /// It is missing or constant.
    pub fn require(
        &self,
        channel: Channel,
        expected: &'static str,
    ) -> Result<&[f64], IdentificationError> {
        let values = self
            .channel(channel)
            .ok_or_else(|| IdentificationError::MissingChannel {
                recording: self.name.clone(),
                channel: channel.name().to_string(),
                found: self
                    .channels()
                    .map(|own| own.0.name())
                    .collect::<Vec<_>>()
                    .join(", "),
                expected,
            })?;
        match values.first() {
            Some(&value) if is_constant(values) => Err(IdentificationError::ConstantChannel {
                recording: self.name.clone(),
                channel: channel.name().to_string(),
                value,
            }),
            _ => Ok(values),
        }
    }

    /// The samples `first..end` as a recording.
    #[must_use]
    pub fn cut(&self, first: usize, end: usize) -> Self {
        let end = end.min(self.len());
        let first = first.min(end);
        Self {
            name: self.name.clone(),
            source: self.source.clone(),
            time: match &self.time {
                TimeBase::Unknown => TimeBase::Unknown,
                TimeBase::Stamps(stamps) => TimeBase::Stamps(stamps[first..end].to_vec()),
                TimeBase::Even { start, period } => TimeBase::Even {
                    start: start + first as f64 * period,
                    period: *period,
                },
            },
            notes: self.notes.clone(),
            left_alone: self.left_alone.clone(),
            channels: self
                .channels
                .iter()
                .map(|(channel, values)| (*channel, values[first..end].to_vec()))
                .collect(),
        }
    }
}
