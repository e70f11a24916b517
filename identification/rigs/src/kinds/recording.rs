//! One recording of a rig as its equations read it.

use std::sync::OnceLock;

use recordings::IdentificationError;
use recordings::{Channel, Recording};
use sysid::interpolation::band_limited;

/// A recording on an even base, with what equations ask of it beside its channels.
#[derive(Debug, Clone, PartialEq)]
pub struct RigRecording {
    /// The channels, SI.
    recording: Recording,
    /// Sampling period before neighbouring samples became means, s.
    pub recorded_period: f64,
    /// What is simulated and compared.
    output: Channel,
    /// Further outputs that are compared, each with its size for one of the output, SI.
    also: Vec<(Channel, f64)>,
    /// The output, and after it those in the output's unit; empty where there are none.
    together: Vec<f64>,
    /// The first input without what a median of five samples takes out.
    pub cleaned: Vec<f64>,
    /// True where the first input lies half way between its neighbours to rounding: such a sample
    /// was interpolated, not measured.
    pub between: Vec<bool>,
    /// Middle of the first input's range.
    pub middle: f64,
    /// True where a sample is left out of the fit.
    pub left_out: Vec<bool>,
    /// Where equations that can restart do so, in order; the first at sample 0.
    pub begins: Vec<Begin>,
    /// True where the output tells how something begins and is not compared; empty where nowhere.
    pub is_given: Vec<bool>,
    /// Whether the record is one period of a motion that goes on.
    pub is_periodic: bool,
    /// The first input between its samples.
    between_samples: OnceLock<Vec<f64>>,
}

/// A place at which a simulation begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Begin {
    /// The sample.
    pub at: usize,
    /// Samples from there on whose output may be used to find the state.
    pub known: usize,
}

/// Known samples at the begin of a recording that says nothing of them.
const KNOWN: usize = 20;

/// Places in which [`RigRecording::between_samples`] parts a sample.
pub const PLACES: usize = 16;

impl RigRecording {
    /// A recording of which nothing is left out; `inputs` are the rig's.
    pub fn new(recording: Recording, inputs: &[Channel], output: Channel) -> Self {
        let first = inputs
            .first()
            .map_or(&[][..], |input| recording.samples(*input));
        let low = first.iter().copied().fold(f64::INFINITY, f64::min);
        let high = first.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self {
            recorded_period: recording.period(),
            cleaned: median_of_five(first),
            between: half_way(first, high - low),
            middle: 0.5 * (low + high),
            left_out: vec![false; recording.len()],
            begins: vec![Begin {
                at: 0,
                known: KNOWN,
            }],
            is_given: Vec::new(),
            is_periodic: false,
            between_samples: OnceLock::new(),
            output,
            also: Vec::new(),
            together: Vec::new(),
            recording,
        }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.recording.name
    }

    /// Sampling period, s.
    pub fn period(&self) -> f64 {
        self.recording.period()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.recording.len()
    }

    /// True without samples.
    pub fn is_empty(&self) -> bool {
        self.recording.is_empty()
    }

    /// Samples of an input, SI; none where the rig does not have it.
    pub fn input(&self, channel: Channel) -> &[f64] {
        self.recording.samples(channel)
    }

    /// `first` (the first input) as the band-limited signal through its samples, at `PLACES`
    /// places a sample.
    pub fn between_samples(&self, first: Channel) -> &[f64] {
        self.between_samples
            .get_or_init(|| band_limited(self.input(first), PLACES, self.is_periodic))
    }

    /// The measured output, SI, and after it those of [`Self::compare_also`]; not a number where a sample is
    /// missing.
    pub fn output(&self) -> &[f64] {
        if self.together.is_empty() {
            self.recording.samples(self.output)
        } else {
            &self.together
        }
    }

    /// Compares further outputs, each with its size for one of the output, SI: they follow it in
    /// [`Self::output`], divided by that size, and are left out where it is.
    pub fn compare_also(&mut self, also: Vec<(Channel, f64)>) {
        let own = also.iter().flat_map(|(channel, size)| {
            let values = self.recording.samples(*channel).iter();
            values.map(move |value| value / size)
        });
        let first = self.recording.samples(self.output).iter().copied();
        self.together = first.chain(own).collect();
        self.left_out = self.left_out.repeat(1 + also.len());
        self.also = also;
    }

    /// What [`Self::compare_also`] was given.
    pub fn also(&self) -> &[(Channel, f64)] {
        &self.also
    }

    /// Every output that is compared, in the order of [`Self::output`], with its size for one of the first, SI.
    pub fn outputs(&self) -> impl Iterator<Item = (Channel, f64)> + '_ {
        [(self.output, 1.0)]
            .into_iter()
            .chain(self.also.iter().copied())
    }

    /// Restarts every `length` samples, from the `known` ones there, which are not compared.
    pub fn begin_every(&mut self, length: usize, known: usize) {
        let places = (0..self.len()).step_by(length.max(1));
        self.begins = places.map(|at| Begin { at, known }).collect();
        let is_given = (0..self.len()).map(|k| k % length.max(1) < known);
        self.is_given = is_given.collect();
    }

    /// Restarts wherever a run of known outputs begins, and again before the end of a long one.
    pub fn begin_where_known(&mut self) {
        let is_known: Vec<bool> = self.output().iter().map(|y| y.is_finite()).collect();
        let mut begins = Vec::new();
        let mut at = 0;
        while at < is_known.len() {
            let run = is_known[at..].iter().take_while(|known| **known).count();
            if run > 0 || at == 0 {
                begins.push(Begin { at, known: run });
            }
            let end = at + run;
            if run > 2 * KNOWN && end < is_known.len() {
                let last = Begin {
                    at: end - KNOWN,
                    known: KNOWN,
                };
                begins.push(last);
            }
            at = end + is_known[end..].iter().take_while(|known| !**known).count();
        }
        self.begins = begins;
    }

    /// The same with another signal in the place of an input's; `inputs` are the rig's. None where their
    /// numbers of samples differ.
    pub fn with_input(
        &self,
        channel: Channel,
        values: Vec<f64>,
        inputs: &[Channel],
    ) -> Option<Self> {
        let mut recording = self.recording.clone();
        recording.replace(channel, values).ok()?;
        let changed = Self::new(recording, inputs, self.output);
        Some(Self {
            left_out: self.left_out.clone(),
            also: self.also.clone(),
            together: self.together.clone(),
            begins: self.begins.clone(),
            is_given: self.is_given.clone(),
            is_periodic: self.is_periodic,
            ..changed
        })
    }

    /// Puts another output in the place of the measured one, which is then compared alone.
    ///
    /// # Errors
    /// Samples of another number.
    pub fn replace_output(&mut self, values: Vec<f64>) -> Result<(), IdentificationError> {
        self.left_out.truncate(self.recording.len());
        self.also.clear();
        self.together.clear();
        self.recording.replace(self.output, values)
    }
}

/// Single samples half way between two that differ.
fn half_way(values: &[f64], range: f64) -> Vec<bool> {
    let mut between = vec![false; values.len()];
    for (k, v) in values.windows(3).enumerate() {
        let step = v[2] - v[0];
        between[k + 1] = !between[k]
            && (v[1] - v[0] - 0.5 * step).abs() < 1e-10 * range
            && step.abs() > 1e-10 * range;
    }
    between
}

fn median_of_five(values: &[f64]) -> Vec<f64> {
    let mut cleaned = values.to_vec();
    for (window, middle) in values.windows(5).zip(cleaned.iter_mut().skip(2)) {
        let mut sorted = [window[0], window[1], window[2], window[3], window[4]];
        sorted.sort_by(f64::total_cmp);
        *middle = sorted[2];
    }
    cleaned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulation_begins_wherever_outputs_are_known() {
        let missing = f64::NAN;
        let mut output = vec![1.0; 130];
        output[..10].fill(missing);
        output[12..20].fill(missing);
        output[70..].fill(missing);
        let channels = vec![
            (Channel::Velocity, vec![0.0; 130]),
            (Channel::Displacement, output),
        ];
        let even = recordings::TimeBase::Even {
            start: 0.0,
            period: 1.0,
        };
        let recording = Recording::measured("known", even, channels).unwrap();
        let mut recording =
            RigRecording::new(recording, &[Channel::Velocity], Channel::Displacement);
        recording.begin_where_known();
        let begins: Vec<(usize, usize)> =
            recording.begins.iter().map(|b| (b.at, b.known)).collect();
        assert_eq!(begins, [(0, 0), (10, 2), (20, 50), (50, KNOWN)]);
        recording.begin_every(50, 3);
        assert_eq!(recording.begins.len(), 3);
        assert_eq!(recording.is_given.iter().filter(|given| **given).count(), 9);
    }

    #[test]
    fn samples_half_way_between_two_readings_are_told_from_readings() {
        let between = half_way(&[0.0, 1.0, 2.0, 4.0, 6.0, 6.5, 9.0, 9.0], 9.0);
        assert_eq!(
            between,
            [false, true, false, true, false, false, false, false]
        );
    }
}
