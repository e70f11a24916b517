//! A rig with its measurements, as the engine of the diagnosis sees it.

use super::cause::joined;
use super::named_value::NamedValue;
use super::parts::{self, EVERYTHING, File, InParts, NAMES, places};
use super::{Begun, Cause, Effect, Measurement, Natural, Rig, SessionRole, Values};
use diagnosis::{Candidate, Point, SimulatedModel, WEAK, squares};
use recordings::Channel;

/// Samples up to which more may be tried.
const CHEAP: usize = 40_000;

/// Logarithm, in deviations, of a nominal parameter that is none: nothing depends on it any more.
const GONE: f64 = -40.0;

/// Logarithm of the share of what was stated below which a nominal parameter has vanished.
const VANISHED: f64 = -5.0;
/// The least of it for a parameter that may be nothing: with less a fit does not find it again.
const LEAST: f64 = -7.0;

/// Error over the output's deviation from which on fits begin from what is read off as well.
const SHAKY: f64 = 0.2;

/// Width of the priors that hold: nothing moves.
const HELD: f64 = 1e-3;

/// Its records are those of [`places`].
pub struct Measured<'a> {
    /// Its equations.
    pub rig: &'a dyn Rig,
    /// Its data.
    pub measurement: &'a Measurement,
    /// Nominal values and standard deviations.
    nominal: Vec<(f64, f64)>,
    /// What they are at most.
    most: Vec<f64>,
    /// Which of them are uncertain.
    uncertain: Vec<usize>,
    /// One standard deviation of each parameter of a file, SI.
    session: Vec<f64>,
    effects: Vec<Effect>,
    candidates: Vec<Candidate>,
    /// Per record and recording, the places of its samples.
    places: Vec<Vec<Vec<usize>>>,
    /// Whether the first file is the reference for the others.
    holds_first: bool,
    /// How much wider than stated the priors of nominal parameters count.
    width: f64,
    /// What the rig is called.
    name: String,
    /// The uncertain parameter that does not move, and its value.
    pinned: Option<(usize, f64)>,
}

impl<'a> Measured<'a> {
    /// The rig with nominal values and standard deviations in its order.
    pub fn new(rig: &'a dyn Rig, measurement: &'a Measurement, nominal: Vec<(f64, f64)>) -> Self {
        let values: Vec<f64> = nominal.iter().map(|(value, _)| *value).collect();
        let natural: Natural = rig.natural(&values, &measurement.recordings);
        let has = |channel| {
            let mut all = measurement.recordings.iter();
            all.all(|one| !one.input(channel).is_empty())
        };
        let effects: Vec<Effect> = rig
            .effects()
            .into_iter()
            .map(|effect| {
                let mut effect = if rig.is_scaled() {
                    effect.scaled(&natural)
                } else {
                    effect
                };
                let needs = |names: &[&str]| names.contains(&effect.candidate.effect);
                let mut optional = rig.optional().iter();
                let is_uncertain = |name: &str| {
                    let place = rig
                        .parameters()
                        .iter()
                        .position(|(known, _)| *known == name);
                    place.is_some_and(|i| nominal[i].1 > 0.0)
                };
                let is_said =
                    |(own, by): &(&str, &str)| *own == effect.candidate.effect && is_uncertain(by);
                if optional.any(|(channel, names)| needs(names) && !has(*channel))
                    || rig.said_by().iter().any(is_said)
                {
                    // Without a start it is not tried.
                    effect.candidate.starts.clear();
                }
                effect
            })
            .collect();
        Self {
            most: rig
                .parameters()
                .iter()
                .map(|(name, _)| {
                    let mut limits = rig.limits().iter();
                    let limit = limits.find(|(known, _)| known == name);
                    limit.map_or(f64::INFINITY, |(_, most)| *most)
                })
                .collect(),
            uncertain: (0..nominal.len()).filter(|&i| nominal[i].1 > 0.0).collect(),
            session: rig
                .session()
                .iter()
                .map(|own| own.spread * natural.unit(own.unit))
                .collect(),
            candidates: effects
                .iter()
                .map(|effect| effect.candidate.clone())
                .collect(),
            effects,
            places: {
                let recordings = measurement.recordings.iter();
                let files: Vec<File<'_>> = recordings
                    .map(|one| File {
                        output: one.output(),
                        left_out: &one.left_out,
                        is_given: &one.is_given,
                    })
                    .collect();
                places(&files, rig.screened())
            },
            name: String::new(),
            holds_first: true,
            width: WEAK,
            pinned: None,
            rig,
            measurement,
            nominal,
        }
    }

    /// Values of the nominal parameters at `point`, SI; those that must be positive stay so.
    pub fn nominal_values(&self, point: &Point) -> Vec<f64> {
        let mut values: Vec<f64> = self.nominal.iter().map(|(value, _)| *value).collect();
        for (place, (&i, p)) in self.uncertain.iter().zip(&point.nuisance).enumerate() {
            let (value, deviation) = self.nominal[i];
            if let Some((_, held)) = self.pinned.filter(|(own, _)| *own == place) {
                values[i] = held;
                continue;
            }
            // Sizes stay positive: counted by their logarithm unless they may be zero.
            values[i] = if self.is_logarithmic(i) {
                value * (p * deviation / value).exp() * f64::from(*p > GONE)
            } else {
                value + p * deviation
            };
            // Not `min`, which takes what is not a number for the limit.
            if values[i] > self.most[i] {
                values[i] = self.most[i];
            }
        }
        values
    }

    /// Whether the nominal parameter `i` is counted by its logarithm.
    /// The place of a nominal parameter.
    fn place(&self, name: &str) -> Option<usize> {
        let mut all = self.rig.parameters().iter();
        all.position(|(own, _)| *own == name)
    }

    fn is_logarithmic(&self, i: usize) -> bool {
        let (value, deviation) = self.nominal[i];
        value > 0.0 && deviation <= value
    }

    /// The coordinate of the nominal parameter `i`, as which it has `value`.
    fn coordinate(&self, i: usize, value: f64) -> f64 {
        let (stated, deviation) = self.nominal[i];
        if self.is_logarithmic(i) {
            (value / stated).ln() * stated / deviation
        } else {
            (value - stated) / deviation
        }
    }

    /// Where the coordinate of the nominal parameter `i` ends: from where no fit comes back, and at the most.
    fn bounds(&self, i: usize) -> (f64, f64) {
        let (value, deviation) = self.nominal[i];
        let may_be_nothing = value > 0.0 && deviation == value;
        let least = if may_be_nothing {
            LEAST
        } else {
            f64::NEG_INFINITY
        };
        (least, self.coordinate(i, self.most[i]))
    }

    /// The point of a model that was read from recording `block`; none where it has an unknown effect.
    fn point_of(&self, own: &Begun, block: usize) -> Option<Point> {
        let mut nuisance = vec![0.0; self.nuisance()];
        for (p, &i) in nuisance.iter_mut().zip(&self.uncertain) {
            *p = self.coordinate(i, own.nominal[i]);
        }
        let first = self.uncertain.len() + block * self.session.len();
        let session = own.session.iter().zip(&self.session);
        for (p, (read, one)) in nuisance.iter_mut().skip(first).zip(session) {
            *p = read / one;
        }
        let effects = match &own.effect {
            None => Vec::new(),
            Some((name, values)) => {
                let index = self.candidates.iter().position(|c| c.effect == *name)?;
                vec![(index, self.candidates[index].internal(values))]
            }
        };
        let is_finite = nuisance.iter().all(|p| p.is_finite());
        is_finite.then_some(Point { nuisance, effects })
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

    /// Parameters of a file at `point`, SI.
    pub fn session_values(&self, point: &Point, recording: usize) -> Vec<f64> {
        let first = self.uncertain.len() + recording * self.session.len();
        let own = point.nuisance.iter().skip(first);
        let is_first = recording == 0 && self.holds_first;
        let table = self.rig.session().iter();
        own.zip(&self.session)
            .zip(table)
            .map(|((p, one), of)| match of.role {
                SessionRole::AgainstFirst if is_first => 0.0,
                _ => p * one,
            })
            .collect()
    }

    /// The same where the first file is none of those that the model was fitted to.
    #[must_use]
    pub fn of_later_files(mut self) -> Self {
        self.holds_first = false;
        self
    }

    /// The same rig under its name.
    #[must_use]
    pub fn called(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Puts the same parameters of a file into every one.
    pub fn set_session(&self, point: &mut Point, values: &[f64]) {
        let own = point.nuisance.iter_mut().skip(self.uncertain.len());
        let all = values.iter().zip(&self.session).cycle();
        for (p, (value, one)) in own.zip(all) {
            *p = value / one;
        }
    }

    /// As [`InParts::normalised_error`], by output, with each root mean square, SI.
    pub fn errors_by_output(&self, point: &Point, record: usize) -> Vec<(Channel, f64, f64)> {
        let errors = self.errors_by_recording(point, record);
        let outputs = self.outputs().enumerate();
        outputs
            .map(|(i, channel)| {
                let (errors, size, count) = self.squares_of(&errors, record, Some(i));
                let mean = errors / count.max(1) as f64;
                (channel, (errors / size).sqrt(), mean.sqrt())
            })
            .collect()
    }

    /// Channels that are simulated and compared.
    fn outputs(&self) -> impl Iterator<Item = Channel> + '_ {
        let first = self.measurement.recordings.first().into_iter();
        first.flat_map(|one| one.outputs().map(|(channel, _)| channel))
    }

    /// Errors at `point` on `record`, a recording each.
    fn errors_by_recording(&self, point: &Point, record: usize) -> Vec<Vec<f64>> {
        let all = 0..self.measurement.recordings.len();
        all.map(|s| self.errors(point, record, s)).collect()
    }

    /// Sums on `record` of the squared errors `all` ([`Self::errors_by_recording`]) and of the squared output about its
    /// mean, and their number; of one `output`, SI, or of all as they are fitted.
    fn squares_of(
        &self,
        all: &[Vec<f64>],
        record: usize,
        output: Option<usize>,
    ) -> (f64, f64, usize) {
        let (mut errors, mut size, mut count) = (0.0, 0.0, 0);
        let recordings = self.measurement.recordings.iter().zip(all);
        for (places, (one, own)) in self.places[record].iter().zip(recordings) {
            for (i, (_, size_of_one)) in one.outputs().enumerate() {
                let unit = match output {
                    Some(wanted) if wanted != i => continue,
                    Some(_) => size_of_one,
                    None => 1.0,
                };
                let mine = places.iter().zip(own).filter(|(k, _)| **k / one.len() == i);
                let (measured, off): (Vec<f64>, Vec<f64>) = mine
                    .map(|(&k, e)| (unit * one.output()[k], unit * e))
                    .unzip();
                let mean = measured.iter().sum::<f64>() / measured.len().max(1) as f64;
                errors += squares(&off);
                size += measured.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
                count += off.len();
            }
        }
        (errors, size, count)
    }

    /// Everything that the equations read for `recording`, SI.
    pub fn values(&self, point: &Point, recording: usize) -> Values {
        Values {
            nominal: self.nominal_values(point),
            effects: self.effect_values(point),
            session: self.session_values(point, recording),
        }
    }

    /// What the equations read out of the recordings beside their inputs.
    pub fn notes(&self, point: &Point) -> Vec<String> {
        let nominal = self.nominal_values(point);
        let recordings = self.measurement.recordings.iter();
        recordings
            .flat_map(|one| self.rig.notes(one, &nominal))
            .collect()
    }

    /// Simulated output of one recording.
    pub fn simulate(&self, point: &Point, recording: usize) -> Vec<f64> {
        let samples = self.measurement.recordings[recording].output().len();
        self.simulate_to(point, recording, samples)
    }

    /// As [`Self::simulate`], the first `samples` only.
    pub fn simulate_to(&self, point: &Point, recording: usize, samples: usize) -> Vec<f64> {
        let mut out = vec![0.0; samples];
        let values = self.values(point, recording);
        let recording = &self.measurement.recordings[recording];
        self.rig.simulate(recording, &values, &mut out);
        out
    }
}

impl SimulatedModel for Measured<'_> {
    fn nuisance(&self) -> usize {
        self.uncertain.len() + self.measurement.recordings.len() * self.session.len()
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn moved(&self, point: &Point, step: &[f64]) -> Point {
        let mut moved = point.moved(step, &self.candidates);
        for (place, &i) in self.uncertain.iter().enumerate() {
            let (least, most) = self.bounds(i);
            let p = &mut moved.nuisance[place];
            // What is gone stays so.
            *p = if point.nuisance[place] > GONE || !self.is_logarithmic(i) {
                p.max(least).min(most)
            } else {
                GONE
            };
        }
        moved
    }

    fn blocks(&self) -> usize {
        self.measurement.recordings.len()
    }

    fn block_of(&self, i: usize) -> Option<usize> {
        let own = i.checked_sub(self.uncertain.len())?;
        own.checked_div(self.session.len())
    }

    fn tells(&self, fitted: usize, i: usize, tested: usize) -> bool {
        let Some(own) = i.checked_sub(self.uncertain.len()) else {
            return true;
        };
        let (block, place) = (own / self.session.len(), own % self.session.len());
        let [fitted, tested] = [fitted, tested].map(|record| &self.places[record][block]);
        // How a file begins has died away where a later part of it was fitted.
        let is_start = self.rig.session()[place].role == SessionRole::Start;
        !fitted.is_empty() && (!is_start || tested.first() >= fitted.first())
    }

    fn samples(&self, record: usize, block: usize) -> usize {
        self.places[record][block].len()
    }

    fn errors(&self, point: &Point, record: usize, block: usize) -> Vec<f64> {
        self.first_errors(point, record, block, usize::MAX)
    }

    // No more is simulated than is asked for.
    fn first_errors(&self, point: &Point, record: usize, block: usize, count: usize) -> Vec<f64> {
        let places = &self.places[record][block];
        let places = &places[..count.min(places.len())];
        let length = places.last().map_or(0, |last| last + 1);
        let simulated = self.simulate_to(point, block, length);
        let measured = self.measurement.recordings[block].output();
        places.iter().map(|&k| measured[k] - simulated[k]).collect()
    }

    fn folds(&self, record: usize) -> [usize; 2] {
        parts::folds(record)
    }

    fn screen(&self, record: usize) -> usize {
        parts::screen(record)
    }

    fn prior_width(&self) -> f64 {
        self.width
    }

    fn held(&self) -> Self {
        Self {
            rig: self.rig,
            measurement: self.measurement,
            nominal: self.nominal.clone(),
            most: self.most.clone(),
            uncertain: self.uncertain.clone(),
            session: self.session.clone(),
            effects: self.effects.clone(),
            candidates: self.candidates.clone(),
            places: self.places.clone(),
            holds_first: self.holds_first,
            name: self.name.clone(),
            width: HELD,
            pinned: self.pinned,
        }
    }

    fn is_cheap(&self) -> bool {
        let all = self.places[EVERYTHING].iter();
        self.rig.screened() == usize::MAX && all.map(Vec::len).sum::<usize>() < CHEAP
    }

    fn record_name(&self, record: usize) -> &str {
        let of_file = || {
            Some(
                self.measurement
                    .recordings
                    .get(record.checked_sub(NAMES.len())?)?
                    .name(),
            )
        };
        NAMES
            .get(record)
            .copied()
            .or_else(of_file)
            .unwrap_or("none")
    }

    fn starts(&self, base: &Point, record: usize) -> Vec<(usize, Vec<f64>)> {
        let Some(block) = (0..self.blocks()).max_by_key(|&b| self.samples(record, b)) else {
            return Vec::new();
        };
        let recording = &self.measurement.recordings[block];
        let mut errors = vec![f64::NAN; recording.output().len()];
        let own = self.errors(base, record, block);
        for (&place, error) in self.places[record][block].iter().zip(own) {
            errors[place] = error;
        }
        let nominal = self.nominal_values(base);
        let starts = self.rig.starts(recording, &nominal, &errors).into_iter();
        let place = |name: &str| self.candidates.iter().position(|c| c.effect == name);
        starts
            .filter_map(|(name, values)| Some((place(name)?, values)))
            .filter(|(i, _)| !self.candidates[*i].starts.is_empty())
            .collect()
    }

    fn estimated(&self, record: usize) -> Option<Point> {
        let block = (0..self.blocks()).max_by_key(|&b| self.samples(record, b))?;
        let recording = &self.measurement.recordings[block];
        let stated: Vec<f64> = self.nominal.iter().map(|(value, _)| *value).collect();
        let nominal = self
            .rig
            .estimated(recording, &self.places[record][block], &stated)?;
        let own = Begun {
            nominal,
            session: vec![0.0; self.session.len()],
            effect: None,
        };
        // From the stated point into bounds.
        let there = self.point_of(&own, block)?;
        Some(self.moved(&self.origin(), &there.nuisance))
    }

    fn begun(&self, base: &Point, record: usize) -> Vec<Point> {
        if self.normalised_error(base, record) < SHAKY {
            return Vec::new();
        }
        let Some(block) = (0..self.blocks()).max_by_key(|&b| self.samples(record, b)) else {
            return Vec::new();
        };
        let recording = &self.measurement.recordings[block];
        let stated: Vec<f64> = self.nominal.iter().map(|(value, _)| *value).collect();
        let places = &self.places[record][block];
        let all = self.rig.read_off(recording, places, &stated).into_iter();
        all.filter_map(|own| self.point_of(&own, block)).collect()
    }
}

impl InParts for Measured<'_> {
    fn subject(&self) -> &str {
        &self.name
    }

    fn kind(&self) -> &str {
        self.rig.kind()
    }

    fn output(&self) -> String {
        let all = self.outputs().map(|own| own.name().to_owned());
        joined(&all.collect::<Vec<_>>())
    }

    fn normalised_error(&self, point: &Point, record: usize) -> f64 {
        let errors = self.errors_by_recording(point, record);
        let (errors, size, _) = self.squares_of(&errors, record, None);
        (errors / size).sqrt()
    }

    fn error_by_output(&self, point: &Point, record: usize) -> Vec<(&'static str, f64)> {
        if self.outputs().count() < 2 {
            return Vec::new();
        }
        let all = self.errors_by_output(point, record).into_iter();
        all.map(|(channel, error, _)| (channel.name(), error))
            .collect()
    }

    fn parameters(&self, point: &Point, deviations: &[f64]) -> Vec<NamedValue> {
        let values = self.nominal_values(point);
        let names = self.uncertain_names();
        let known = self.rig.parameters();
        names
            .iter()
            .enumerate()
            .filter_map(|(i, name)| {
                let place = known.iter().position(|(k, _)| k == name)?;
                let mut moved = point.clone();
                // A small step: the logarithm of a badly known parameter is curved.
                moved.nuisance[i] += 1e-3;
                let slope = (self.nominal_values(&moved)[place] - values[place]).abs() / 1e-3;
                Some(NamedValue {
                    name: (*name).to_owned(),
                    value: values[place],
                    unit: known[place].1.to_owned(),
                    standard_error: slope * deviations.get(i).copied().unwrap_or(f64::NAN),
                })
            })
            .collect()
    }

    fn stated(&self, i: usize) -> (f64, f64) {
        self.nominal[self.uncertain[i]]
    }

    fn is_cause(&self, i: usize) -> bool {
        let (name, _) = self.rig.parameters()[self.uncertain[i]];
        self.rig.causes().contains(&name)
    }

    fn is_of_first_file(&self, i: usize) -> bool {
        let (_, unit) = self.rig.parameters()[self.uncertain[i]];
        let mut session = self.rig.session().iter();
        self.is_cause(i)
            && session.any(|own| own.role == SessionRole::AgainstFirst && own.unit == unit)
    }

    fn at(&self, point: &Point, i: usize, value: f64) -> Option<Point> {
        let mut there = point.clone();
        there.nuisance[i] = self.coordinate(self.uncertain[i], value);
        self.is_cause(i).then_some(there)
    }

    fn pinned(&self, i: usize, value: f64) -> Option<Self> {
        let mut same = self.held();
        same.width = self.width;
        same.pinned = Some((i, value));
        self.is_cause(i).then_some(same)
    }

    fn without(&self, point: &Point, i: usize) -> Option<Point> {
        let (value, deviation) = self.nominal[*self.uncertain.get(i)?];
        let may_be_nothing = value > 0.0 && deviation == value;
        let mut without = point.clone();
        without.nuisance[i] = GONE;
        (may_be_nothing && point.nuisance[i] > GONE).then_some(without)
    }

    fn as_stated(&self, point: &Point) -> Point {
        diagnosis::as_stated(self, point)
    }

    fn restored(&self, point: &Point) -> Point {
        let mut restored = point.clone();
        for (place, &i) in self.uncertain.iter().enumerate() {
            let (value, deviation) = self.nominal[i];
            let has_vanished = restored.nuisance[place] * deviation / value < VANISHED;
            if self.is_logarithmic(i) && has_vanished
                || !self.is_logarithmic(i) && self.is_cause(place)
            {
                restored.nuisance[place] = 0.0;
            }
        }
        restored
    }

    fn contradictions(&self) -> Vec<Cause> {
        let causes = self.rig.contradictions(&self.measurement.recordings);
        // Of a nominal parameter it is what was stated that they contradict.
        let causes = causes
            .into_iter()
            .filter_map(|cause| match self.place(&cause.found.name) {
                Some(i) => Cause::perhaps(cause.found, self.nominal[i]),
                None => Some(cause),
            });
        causes.collect()
    }

    fn is_read(&self, name: &str) -> bool {
        let causes = self.rig.contradictions(&self.measurement.recordings);
        let mut read = causes.iter().filter(|own| own.found.name == name);
        self.place(name).is_some() && read.next().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::RigRecording;
    use recordings::Recording;

    const COMMAND: Channel = Channel::Other {
        name: "command",
        unit: "m",
    };

    #[test]
    fn a_zero_many_deviations_off_comes_back_and_what_may_be_nothing_does_not() {
        let rig = crate::kinds::of_kind("closed_loop_actuator").unwrap();
        let wave: Vec<f64> = (0..600).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let channels = vec![(COMMAND, wave.clone()), (Channel::Displacement, wave)];
        let recording = Recording::new("one", 0.01, channels).unwrap();
        let measurement = Measurement {
            recordings: vec![RigRecording::new(
                recording,
                &[COMMAND],
                Channel::Displacement,
            )],
        };
        let stated = |name: &str| match name {
            "loop_gain" => (20.0, 5.0),
            "integral" => (0.1, 0.1),
            "offset" => (0.0, 1e-3),
            _ => (0.0, 0.0),
        };
        let nominal = rig.parameters().iter().map(|(name, _)| stated(name));
        let measured = Measured::new(rig, &measurement, nominal.collect());
        let names = ["loop_gain", "offset", "integral"];
        let origin = measured.origin();
        let values = |point: &Point| measured.parameters(point, &[]);
        let found: Vec<String> = values(&origin).into_iter().map(|own| own.name).collect();
        assert_eq!(found, names);
        let mut step = vec![0.0; origin.nuisance.len()];
        step[1] = -50.0;
        let far = measured.moved(&origin, &step);
        assert!((values(&far)[1].value + 0.05).abs() < 1e-12);
        step[1] = 20.0;
        let back = measured.moved(&far, &step);
        assert!((values(&back)[1].value + 0.03).abs() < 1e-12);
        // What differs from file to file stays as it is there.
        let mut later = far.clone();
        *later.nuisance.last_mut().unwrap() = 3.0;
        let stated = measured.as_stated(&later);
        let same = values(&stated).into_iter().zip(values(&origin));
        assert!(
            same.into_iter()
                .all(|(own, as_stated)| own.value == as_stated.value)
        );
        assert_eq!(stated.nuisance.last(), Some(&3.0));
        let none = measured.without(&origin, 2).unwrap();
        step[2] = 1.0;
        assert_eq!(values(&measured.moved(&none, &step))[2].value, 0.0);
        // A gain has vanished below e^-5 of what was stated.
        let mut small = origin.clone();
        for (power, comes_back) in [(-4.9, false), (-5.1, true)] {
            small.nuisance[0] = power * 20.0 / 5.0;
            let found = values(&small)[0].value;
            assert!((found / 20.0 / f64::exp(power) - 1.0).abs() < 1e-12);
            let restored = measured.restored(&small);
            let expected = if comes_back { &origin } else { &small };
            assert_eq!(restored.nuisance, expected.nuisance);
        }
    }
}
