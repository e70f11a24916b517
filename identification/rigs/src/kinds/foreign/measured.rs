//! A foreign model with its records, as the engine of the diagnosis sees it.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use plant::signal_path::{SignalEffects, SignalPath};
use rayon::prelude::*;

use super::catalogue::{self, Site};
use super::{Extension, ForeignModel, KIND, Trial};
use crate::kinds::NamedValue;
use crate::kinds::parts::{self, EVERYTHING, File, InParts, NAMES, places};
use diagnosis::{Candidate, Point, SimulatedModel};
use recordings::mean_and_deviation;

/// Samples that a first look sees at least.
const SCREENED: usize = 1000;
/// Cosine between the traces of two effects of one kind beyond which the records cannot tell them
/// apart, and of two kinds, which may be alike while they are small.
const ALIKE: f64 = 0.999;
const THE_SAME: f64 = 0.999_999;
/// Numbers that are kept of simulations.
const KEPT: usize = 8_000_000;
/// Lags at which a delay is looked for at most.
const LAGS: usize = 4000;

/// What a simulation depends on: the record and the values of everything before the outputs.
type Key = (usize, Vec<(usize, u64)>);

/// The model, its candidates and the samples of every record.
pub(super) struct Bordered<'a> {
    pub(super) model: &'a ForeignModel<'a>,
    sites: Vec<Site>,
    candidates: Vec<Candidate>,
    /// Variation of every output as measured.
    scales: Vec<f64>,
    /// Per record and trial, the places of its samples.
    pub(super) places: Vec<Vec<Vec<usize>>>,
    alike: Vec<Vec<bool>>,
    /// Simulations without effects after the outputs, newest first.
    known: Mutex<VecDeque<(Key, usize, Outputs)>>,
    most_known: usize,
}

/// One value per sample for every output.
type Outputs = Arc<Vec<Vec<f64>>>;

impl<'a> Bordered<'a> {
    /// None where the nominal model cannot be simulated on the records.
    pub(super) fn new(model: &'a ForeignModel<'a>) -> Option<Self> {
        let of_output = |j: usize| -> f64 {
            let measured = model.trials.iter().flat_map(|trial| &trial.outputs[j]);
            let measured: Vec<f64> = measured.copied().filter(|y| y.is_finite()).collect();
            mean_and_deviation(&measured).1
        };
        let scales: Vec<f64> = (0..model.outputs.len()).map(of_output).collect();
        // A sample counts where an output was measured; which varies by its outputs together.
        let together: Vec<Vec<f64>> = model
            .trials
            .iter()
            .map(|trial| {
                let at = |k: usize| {
                    let own = trial.outputs.iter().zip(&scales);
                    let own = own.map(|(y, scale)| y[k] / scale).filter(|y| y.is_finite());
                    own.reduce(|sum, y| sum + y).unwrap_or(f64::NAN)
                };
                (0..trial.samples()).map(at).collect()
            })
            .collect();
        let files: Vec<File<'_>> = together
            .iter()
            .zip(&model.trials)
            .map(|(output, trial)| File {
                output,
                left_out: &trial.left_out,
                is_given: &[],
            })
            .collect();
        let longest = model.trials.iter().map(Trial::samples).max().unwrap_or(1);
        let numbers = longest * model.outputs.len().max(1);
        let mut own = Self {
            model,
            sites: Vec::new(),
            candidates: Vec::new(),
            scales,
            places: places(&files, SCREENED),
            alike: Vec::new(),
            known: Mutex::default(),
            most_known: (KEPT / numbers).clamp(4, 64),
        };
        let nominal = |t: usize| own.simulate(&own.origin(), t, model.trials[t].samples());
        let nominal: Vec<Vec<Vec<f64>>> = (0..model.trials.len())
            .map(nominal)
            .collect::<Option<_>>()?;
        let all = catalogue::catalogue(model, &nominal);
        (own.sites, own.candidates) = all.into_iter().unzip();
        own.alike = own.likenesses();
        Some(own)
    }

    /// The effects around the model at `point`.
    pub(super) fn extension(&self, point: &Point) -> Extension {
        let mut extension = Extension {
            inputs: vec![SignalEffects::NONE; self.model.inputs.len()],
            outputs: vec![SignalEffects::NONE; self.model.outputs.len()],
            parameters: Vec::new(),
        };
        for (index, internal) in &point.effects {
            let Some(&value) = self.candidates[*index].values(internal).first() else {
                continue;
            };
            match self.sites[*index] {
                Site::Input(i, border) => border.put(value, &mut extension.inputs[i]),
                Site::Output(j, border) => border.put(value, &mut extension.outputs[j]),
                Site::Parameter(k) => {
                    let parameter = &self.model.parameters[k];
                    let unit = catalogue::drift_unit(parameter);
                    extension
                        .parameters
                        .push((k, parameter.value + value * unit));
                }
            }
        }
        extension
    }

    /// Outputs of the first `samples` samples of a trial at `point`; none where the model does not come
    /// so far.
    pub(super) fn simulate(
        &self,
        point: &Point,
        trial: usize,
        samples: usize,
    ) -> Option<Vec<Vec<f64>>> {
        let extension = self.extension(point);
        let before = self.before_outputs(point, &extension, trial, samples)?;
        let of = &self.model.trials[trial];
        let period = of.step * of.stride as f64;
        before
            .iter()
            .zip(&extension.outputs)
            .map(|(signal, effects)| {
                let signal = &signal[..samples];
                SignalPath::pass(*effects, period, signal).ok()
            })
            .collect()
    }

    /// What the model itself puts out; simulations are kept, since nothing behind the outputs changes
    /// them.
    fn before_outputs(
        &self,
        point: &Point,
        extension: &Extension,
        trial: usize,
        samples: usize,
    ) -> Option<Outputs> {
        let inside = point.effects.iter().filter(|(index, _)| {
            let site = self.sites.get(*index);
            !matches!(site, Some(Site::Output(..)) | None)
        });
        let mut values: Vec<(usize, u64)> = inside
            .flat_map(|(index, internal)| internal.iter().map(|q| (*index, q.to_bits())))
            .collect();
        values.sort_unstable();
        let key = (trial, values);
        {
            let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            let place = known
                .iter()
                .position(|(own, length, _)| *own == key && *length >= samples);
            if let Some(found) = place.and_then(|place| known.remove(place)) {
                let outputs = found.2.clone();
                known.push_front(found);
                return Some(outputs);
            }
        }
        let of = &self.model.trials[trial];
        let steps = of.steps(samples);
        let inputs: Vec<Cow<'_, [f64]>> = of
            .inputs
            .iter()
            .zip(&extension.inputs)
            .map(|(signal, effects)| {
                let signal = signal.get(..steps)?;
                if *effects == SignalEffects::NONE {
                    return Some(Cow::Borrowed(signal));
                }
                let passed = SignalPath::pass(*effects, of.step, signal).ok()?;
                Some(Cow::Owned(passed))
            })
            .collect::<Option<_>>()?;
        let inputs: Vec<&[f64]> = inputs.iter().map(AsRef::as_ref).collect();
        let simulator = self.model.simulator;
        let found = simulator.simulate(&inputs, &extension.parameters, of.step, steps)?;
        let at_samples = |signal: Vec<f64>| -> Option<Vec<f64>> {
            let own: Vec<f64> = signal.into_iter().step_by(of.stride).collect();
            (own.len() == samples && own.iter().all(|y| y.is_finite())).then_some(own)
        };
        let outputs: Vec<Vec<f64>> = found.into_iter().map(at_samples).collect::<Option<_>>()?;
        let outputs = Arc::new(outputs);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.push_front((key, samples, outputs.clone()));
        known.truncate(self.most_known);
        Some(outputs)
    }

    /// Which candidates leave the same trace in all outputs.
    fn likenesses(&self) -> Vec<Vec<bool>> {
        let origin = self.origin();
        let trace = |index: usize| -> Option<Vec<f64>> {
            let candidate = &self.candidates[index];
            let mut point = origin.clone();
            let start = candidate.starts.last()?;
            point.effects.push((index, candidate.internal(start)));
            let mut trace = Vec::new();
            for (trial, of) in self.model.trials.iter().enumerate() {
                let nominal = self.simulate(&origin, trial, of.samples())?;
                let moved = self.simulate(&point, trial, of.samples())?;
                // How a record begins is known too badly to tell anything apart by.
                let later = of.samples() / 2;
                for ((a, b), scale) in nominal.iter().zip(&moved).zip(&self.scales) {
                    let pairs = a[later..].iter().zip(&b[later..]);
                    trace.extend(pairs.map(|(a, b)| (b - a) / scale));
                }
            }
            Some(trace)
        };
        let count = self.candidates.len();
        let traces: Vec<Option<Vec<f64>>> = (0..count).into_par_iter().map(trace).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let cosine = |a: usize, b: usize| -> f64 {
            let (Some(a), Some(b)) = (&traces[a], &traces[b]) else {
                return 0.0;
            };
            let both = (dot(a, a) * dot(b, b)).sqrt();
            if both > 0.0 {
                (dot(a, b) / both).abs()
            } else {
                0.0
            }
        };
        let same_kind = |a: usize, b: usize| self.candidates[a].effect == self.candidates[b].effect;
        let alike = |a: usize, b: usize| {
            let least = if same_kind(a, b) { ALIKE } else { THE_SAME };
            a == b || cosine(a, b) > least
        };
        (0..count)
            .map(|a| (0..count).map(|b| alike(a, b)).collect())
            .collect()
    }

    /// Measured outputs of a trial that are there at sample `k`, with their variation.
    fn measured(&self, trial: usize, k: usize) -> impl Iterator<Item = (usize, f64, f64)> {
        let own = self.model.trials[trial].outputs.iter().zip(&self.scales);
        let all = own
            .enumerate()
            .map(move |(j, (y, scale))| (j, y[k], *scale));
        all.filter(|(_, y, scale)| y.is_finite() && *scale > 0.0)
    }
}

impl SimulatedModel for Bordered<'_> {
    fn nuisance(&self) -> usize {
        0
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn blocks(&self) -> usize {
        self.model.trials.len()
    }

    fn block_of(&self, _: usize) -> Option<usize> {
        None
    }

    fn samples(&self, record: usize, block: usize) -> usize {
        let places = self.places[record][block].iter();
        places.map(|&k| self.measured(block, k).count()).sum()
    }

    fn errors(&self, point: &Point, record: usize, block: usize) -> Vec<f64> {
        let places = &self.places[record][block];
        let length = places.last().map_or(0, |last| last + 1);
        let Some(simulated) = self.simulate(point, block, length) else {
            return vec![f64::NAN; self.samples(record, block)];
        };
        let mut errors = Vec::new();
        for j in 0..self.model.outputs.len() {
            for &k in places {
                let mut own = self.measured(block, k).filter(|(at, ..)| *at == j);
                errors.extend(
                    own.next()
                        .map(|(_, y, scale)| (y - simulated[j][k]) / scale),
                );
            }
        }
        errors
    }

    fn folds(&self, record: usize) -> [usize; 2] {
        parts::folds(record)
    }

    fn screen(&self, record: usize) -> usize {
        parts::screen(record)
    }

    fn held(&self) -> Self {
        Self {
            model: self.model,
            sites: self.sites.clone(),
            candidates: self.candidates.clone(),
            scales: self.scales.clone(),
            places: self.places.clone(),
            alike: self.alike.clone(),
            known: Mutex::default(),
            most_known: self.most_known,
        }
    }

    fn is_cheap(&self) -> bool {
        // It has no parameters that could be held.
        false
    }

    fn rivals_leave(&self) -> f64 {
        // What a right one leaves is noise, or the verdict is none.
        1.1
    }

    fn record_name(&self, record: usize) -> &str {
        let of_file = || {
            let trial = self.model.trials.get(record.checked_sub(NAMES.len())?);
            trial.map(|trial| trial.name.as_str())
        };
        let known = NAMES.get(record).copied();
        known.or_else(of_file).unwrap_or("none")
    }

    /// The shift at which the simulated outputs fit the measured ones best starts every delay and
    /// every lag: from a small one the way to it may be barred by a period of the motion.
    fn starts(&self, base: &Point, record: usize) -> Vec<(usize, Vec<f64>)> {
        let Some(block) = (0..self.blocks()).max_by_key(|&b| self.samples(record, b)) else {
            return Vec::new();
        };
        let trial = &self.model.trials[block];
        let places = &self.places[record][block];
        let length = places.last().map_or(0, |last| last + 1);
        let Some(simulated) = self.simulate(base, block, length) else {
            return Vec::new();
        };
        let most = (length / 4).min(LAGS);
        let mean_square = |lag: usize| {
            let (mut sum, mut count) = (0.0, 0usize);
            for &k in places {
                for (j, y, scale) in self.measured(block, k) {
                    let then = simulated[j][k.saturating_sub(lag)];
                    sum += ((y - then) / scale).powi(2);
                    count += 1;
                }
            }
            sum / count.max(1) as f64
        };
        let best = (0..=most)
            .into_par_iter()
            .map(|lag| (lag, mean_square(lag)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((lag @ 1.., _)) = best else {
            return Vec::new();
        };
        let time = lag as f64 * trial.step * trial.stride as f64;
        let all = self.candidates.iter().enumerate();
        let late =
            all.filter(|(_, c)| !c.starts.is_empty() && ["delay", "lag"].contains(&c.effect));
        let late = late.map(|(i, _)| (i, vec![time]));
        late.collect()
    }
}

impl InParts for Bordered<'_> {
    fn subject(&self) -> &str {
        &self.model.name
    }

    fn kind(&self) -> &str {
        KIND
    }

    fn output(&self) -> String {
        let names: Vec<&str> = self.model.outputs.iter().map(|o| o.name.as_str()).collect();
        names.join(", ")
    }

    fn normalised_error(&self, point: &Point, record: usize) -> f64 {
        let (mut wrong, mut size) = (0.0, 0.0);
        for block in 0..self.blocks() {
            let errors = self.errors(point, record, block);
            wrong += errors.iter().map(|e| e * e).sum::<f64>();
            for j in 0..self.model.outputs.len() {
                let places = self.places[record][block].iter();
                let own: Vec<f64> = places
                    .flat_map(|&k| self.measured(block, k).filter(|(at, ..)| *at == j))
                    .map(|(_, y, scale)| y / scale)
                    .collect();
                size += own.len() as f64 * mean_and_deviation(&own).1.powi(2);
            }
        }
        (wrong / size).sqrt()
    }

    fn parameters(&self, _: &Point, _: &[f64]) -> Vec<NamedValue> {
        Vec::new()
    }

    fn stated(&self, _: usize) -> (f64, f64) {
        (f64::NAN, f64::NAN)
    }

    fn name(&self, candidate: usize) -> String {
        let model = self.model;
        match self.sites.get(candidate) {
            Some(Site::Input(i, border)) => format!("{}.{}", model.inputs[*i].name, border.name()),
            Some(Site::Output(j, border)) => {
                format!("{}.{}", model.outputs[*j].name, border.name())
            }
            Some(Site::Parameter(k)) => catalogue::drift(&model.parameters[*k]),
            None => String::new(),
        }
    }

    fn unit(&self, candidate: usize, _: usize) -> String {
        let model = self.model;
        match self.sites.get(candidate) {
            Some(Site::Input(i, border)) => border.unit(&model.inputs[*i].unit),
            Some(Site::Output(j, border)) => border.unit(&model.outputs[*j].unit),
            Some(Site::Parameter(k)) if model.parameters[*k].value == 0.0 => {
                model.parameters[*k].unit.clone()
            }
            Some(Site::Parameter(_)) => "1".to_owned(),
            None => String::new(),
        }
    }

    fn are_alike(&self, one: usize, other: usize) -> bool {
        self.alike[one][other]
    }
}

impl Bordered<'_> {
    /// Errors of one output of a trial at `point`, a sample each, not a number where it was not measured.
    pub(super) fn errors_over_time(
        &self,
        trial: usize,
        output: usize,
        simulated: &[f64],
    ) -> Vec<f64> {
        let measured = &self.model.trials[trial].outputs[output];
        let pairs = measured.iter().zip(simulated);
        pairs
            .map(|(y, own)| (y - own) / self.scales[output])
            .collect()
    }

    /// Variation of an output as measured.
    pub(super) fn scale(&self, output: usize) -> f64 {
        self.scales[output]
    }

    /// The samples of everything that was measured in a trial, and whether each is left out.
    pub(super) fn measured_samples(&self, trial: usize) -> Vec<(usize, bool)> {
        let left_out = &self.model.trials[trial].left_out;
        let own = self.places[EVERYTHING][trial].iter();
        own.map(|&k| (k, left_out[k])).collect()
    }
}
