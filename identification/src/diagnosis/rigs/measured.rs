//! A rig with its measurements, as the engine of the diagnosis sees it.

use super::{Effect, Measurement, Rig};
use crate::diagnosis::engine::{Candidate, ExtensibleModel, Point, SimulatedModel};

/// Runs into which a part is cut for the check inside it.
const RUNS: usize = 16;

/// The selections of samples that can be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// What the description fits.
    Fitted = 0,
    /// What it leaves out.
    LeftOut = 1,
}

impl Part {
    /// The other part.
    pub fn other(self) -> Self {
        match self {
            Self::Fitted => Self::LeftOut,
            Self::LeftOut => Self::Fitted,
        }
    }
}

/// Records 0 and 1 are the two parts of the data, 2 to 5 the folds inside each.
pub struct Measured<'a> {
    /// Its equations.
    pub rig: &'a dyn Rig,
    /// Its data.
    pub measurement: &'a Measurement,
    /// Nominal values and standard deviations.
    nominal: Vec<(f64, f64)>,
    /// Which of them are uncertain.
    uncertain: Vec<usize>,
    effects: Vec<Effect>,
    candidates: Vec<Candidate>,
    channel: [&'static str; 1],
    /// Per record and recording, the places of its samples.
    places: Vec<Vec<Vec<usize>>>,
    /// Error that counts as one.
    scale: f64,
}

const NAMES: [&str; 6] = [
    "fitted",
    "left out",
    "fitted, fold 1",
    "fitted, fold 2",
    "left out, fold 1",
    "left out, fold 2",
];

impl<'a> Measured<'a> {
    /// The rig with nominal values and standard deviations in its order.
    pub fn new(rig: &'a dyn Rig, measurement: &'a Measurement, nominal: Vec<(f64, f64)>) -> Self {
        let mut places = vec![vec![Vec::new(); measurement.recordings.len()]; NAMES.len()];
        for part in 0..2 {
            let in_part = |out: &bool| usize::from(*out) == part;
            let count: usize = measurement
                .recordings
                .iter()
                .flat_map(|one| &one.left_out)
                .filter(|o| in_part(o))
                .count();
            let mut seen = 0;
            for (s, recording) in measurement.recordings.iter().enumerate() {
                for (k, _) in recording
                    .left_out
                    .iter()
                    .enumerate()
                    .filter(|(_, o)| in_part(o))
                {
                    places[part][s].push(k);
                    places[2 + 2 * part + (seen * RUNS / count) % 2][s].push(k);
                    seen += 1;
                }
            }
        }
        let effects = rig.effects();
        Self {
            uncertain: (0..nominal.len()).filter(|&i| nominal[i].1 > 0.0).collect(),
            candidates: effects
                .iter()
                .map(|effect| effect.candidate.clone())
                .collect(),
            effects,
            channel: [rig.output().name()],
            rig,
            measurement,
            nominal,
            places,
            scale: 1.0,
        }
    }

    /// Values of the nominal parameters at `point`, SI; those that must be positive stay so.
    pub fn nominal_values(&self, point: &Point) -> Vec<f64> {
        let mut values: Vec<f64> = self.nominal.iter().map(|(value, _)| *value).collect();
        for (&i, p) in self.uncertain.iter().zip(&point.nuisance) {
            let (value, deviation) = self.nominal[i];
            // Sizes stay positive: counted by their logarithm unless they may be zero.
            values[i] = if value > 0.0 && deviation <= value {
                value * (p * deviation / value).exp()
            } else {
                value + p * deviation
            };
        }
        values
    }

    /// Names of the uncertain nominal parameters, in the order of the nuisance.
    pub fn uncertain_names(&self) -> Vec<&'static str> {
        self.uncertain
            .iter()
            .map(|&i| self.rig.parameters()[i].0)
            .collect()
    }

    fn effect_values(&self, point: &Point) -> Vec<f64> {
        let mut values = Vec::new();
        for (i, effect) in self.effects.iter().enumerate() {
            match point.effects.iter().find(|(index, _)| *index == i) {
                Some((_, internal)) => values.extend(effect.candidate.values(internal)),
                None => values.extend(&effect.off),
            }
        }
        values
    }

    /// Simulated output of one recording.
    pub fn simulate(&self, point: &Point, recording: usize) -> Vec<f64> {
        let recording = &self.measurement.recordings[recording];
        let mut out = vec![0.0; recording.len()];
        let (nominal, effects) = (self.nominal_values(point), self.effect_values(point));
        self.rig.simulate(recording, &nominal, &effects, &mut out);
        out
    }

    /// `||y - m|| / ||m - mean||` on the samples of `record`, the mean taken in each recording.
    pub fn normalised_error(&self, point: &Point, record: usize) -> f64 {
        let errors = self.errors(point, record);
        let mut size = 0.0;
        for (s, places) in self.places[record].iter().enumerate() {
            let measured = self.measurement.recordings[s].output();
            let mean =
                places.iter().map(|&k| measured[k]).sum::<f64>() / places.len().max(1) as f64;
            size += places
                .iter()
                .map(|&k| (measured[k] - mean).powi(2))
                .sum::<f64>();
        }
        (errors.iter().map(|e| e * e).sum::<f64>() / size).sqrt()
    }
}

impl ExtensibleModel for Measured<'_> {
    type Predictor = ();

    fn nuisance(&self) -> usize {
        self.uncertain.len()
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn records(&self) -> usize {
        self.places.len()
    }

    fn record_name(&self, record: usize) -> &str {
        NAMES[record]
    }

    fn channels(&self) -> &[&'static str] {
        &self.channel
    }

    fn regressors(&self, _record: usize) -> Vec<(String, Vec<f64>)> {
        Vec::new()
    }

    fn disturbed(&self, factor: f64) -> Self {
        self.with_scale(self.scale * factor)
    }

    fn residual_count(&self, record: usize) -> usize {
        self.places[record].iter().map(Vec::len).sum()
    }

    fn sample_count(&self, record: usize) -> usize {
        self.residual_count(record)
    }

    fn predictor(&self, _point: &Point) -> Option<()> {
        Some(())
    }

    fn log_determinant(&self, (): &()) -> f64 {
        0.0
    }

    fn residuals(&self, (): &(), point: &Point, record: usize, out: &mut [f64]) -> bool {
        let errors = self.errors(point, record);
        for (o, e) in out.iter_mut().zip(&errors) {
            *o = e / self.scale;
        }
        errors.len() == out.len() && out.iter().all(|r| r.is_finite())
    }
}

impl SimulatedModel for Measured<'_> {
    fn errors(&self, point: &Point, record: usize) -> Vec<f64> {
        let mut errors = Vec::with_capacity(self.residual_count(record));
        for (s, places) in self.places[record].iter().enumerate() {
            if !places.is_empty() {
                let simulated = self.simulate(point, s);
                let measured = self.measurement.recordings[s].output();
                errors.extend(places.iter().map(|&k| measured[k] - simulated[k]));
            }
        }
        errors
    }

    fn folds(&self, record: usize) -> [usize; 2] {
        [2 + 2 * record, 3 + 2 * record]
    }

    fn scale(&self) -> f64 {
        self.scale
    }

    fn with_scale(&self, scale: f64) -> Self {
        Self {
            rig: self.rig,
            measurement: self.measurement,
            nominal: self.nominal.clone(),
            uncertain: self.uncertain.clone(),
            effects: self.effects.clone(),
            candidates: self.candidates.clone(),
            channel: self.channel,
            places: self.places.clone(),
            scale,
        }
    }
}
