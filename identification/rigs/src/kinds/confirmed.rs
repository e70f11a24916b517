//! The model with the effects that every part of the data shows: its estimates, what they differ by
//! between parts and files, and what it brings on data that were not fitted.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::alternatives::{alike, in_place_of};
use super::cause::{INTERVAL_95, measure};
use super::named_value::NamedValue;
use super::parts::{EVERYTHING, InParts, LOST, Part, file};
use super::readings::NEEDED;
use crate::report::ends_or_not_a_number;
use diagnosis::resampling::{correlation_time, gain_interval};
use diagnosis::{
    AGAIN, Candidate, Free, Point, Role, VITAL, all_errors, completed, estimates, least_squares,
    looked, refit, settled, squares,
};
use recordings::mean_and_deviation;

/// Error of a model, over the output, that leaves nothing to explain.
pub(super) const NEAR: f64 = 0.01;
/// Errors on data that were not fitted that still agree with those on fitted ones: at most so many times these.
const AGREE: f64 = 2.0;
/// A parameter differs between parts where its estimates lie this many of their standard errors
/// apart. Some twenty are compared.
const DIFFERS: f64 = 3.5;
/// A refitted nominal parameter is surprising where it lies this many stated deviations off.
const SURPRISING: f64 = 3.0;
/// Share of the least size worth a name below which an effect has none.
const LEAST: f64 = 0.5;
/// Why an effect is not named of which models that do as well have none.
const UNKNOWN: &str = "its size differs so much between models that explain the data as well that the 95 % \
                       interval contains zero";
/// Samples that a file must bring to be fitted by itself.
const FEWEST: usize = 500;

/// The confirmed model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Confirmed {
    /// Normalised error on the held-out data of the model fitted to the rest.
    pub error: f64,
    /// The same with the parts swapped.
    pub swapped_error: f64,
    /// 95 % interval of the share of the refitted nominal model's squared error that the effects
    /// take away on the held-out data.
    #[serde(deserialize_with = "ends_or_not_a_number")]
    pub gain_interval: (f64, f64),
    /// Normalised error on all data of the nominal model refitted to all data.
    pub refitted_error: f64,
    /// The same of the confirmed model.
    pub fitted_error: f64,
    /// Nominal parameters of the nominal model, refitted to all data.
    pub refitted: Vec<NamedValue>,
    /// Nominal parameters of the confirmed model, fitted to all data.
    pub parameters: Vec<NamedValue>,
    /// Parameters of its effects.
    pub effects: Vec<(String, Vec<NamedValue>)>,
    /// Those of which one part of the data tells nothing, such as a rail that its motion does not reach.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub on_one_part: Vec<String>,
    /// Whether the effects gain on either part, from a fit to the other.
    #[serde(skip)]
    pub(super) pays: bool,
    /// Standard errors of the nominal parameters by the fit and its scatter between parts, before other models widen them.
    #[serde(skip)]
    pub(super) of_the_fit: Vec<f64>,
    /// Where it is.
    #[serde(skip)]
    pub(super) point: Point,
    /// Where the refitted nominal model is.
    #[serde(skip)]
    pub(super) refitted_point: Point,
}

impl Confirmed {
    /// Widens standard errors to half of what an estimate differs by from that of `other`, another model of the
    /// same data.
    pub(super) fn widen_to(&mut self, other: &Self) {
        self.widen(&other.parameters, &other.effects);
    }

    /// Whether nothing is left to explain of either part.
    pub(super) fn leaves_nothing(&self) -> bool {
        self.error < NEAR && self.swapped_error < NEAR
    }

    /// The effects of which the widened intervals hold zero.
    pub(super) fn vanished(&self, candidates: &[Candidate]) -> Vec<Refused> {
        let own = self.effects.iter().zip(&self.point.effects);
        let vanished =
            own.filter(|((_, values), (index, _))| !differs_from_zero(&candidates[*index], values));
        vanished
            .map(|(_, (index, _))| (*index, UNKNOWN.to_owned()))
            .collect()
    }

    /// As [`Self::widen_to`] by the model at `point`.
    pub(super) fn widen_by<M: InParts>(&mut self, measured: &M, point: &Point) {
        self.widen(
            &measured.parameters(point, &[]),
            &effects(measured, point, &[]),
        );
    }

    fn widen(&mut self, parameters: &[NamedValue], effects: &[(String, Vec<NamedValue>)]) {
        widen(&mut self.parameters, parameters);
        for (name, own) in &mut self.effects {
            let same = effects.iter().find(|(known, _)| known == name);
            widen(own, same.map_or(&[], |(_, values)| values));
        }
    }
}

fn widen(own: &mut [NamedValue], other: &[NamedValue]) {
    for own in own {
        let same = other.iter().find(|other| other.name == own.name);
        if let Some(other) = same.filter(|other| other.value.is_finite()) {
            let half = 0.5 * (own.value - other.value).abs();
            own.standard_error = own.standard_error.max(half);
        }
    }
}

/// Why an effect is not named without which the error hardly grows.
pub(super) const TOO_SMALL: &str = "it is too small to matter";

/// An effect with a reason why it is not named.
pub(super) type Refused = (usize, String);

/// Why effects of `point`, fitted to `record`, are not to be named: a size at its bound, or sizes of
/// which none differs from zero. Where standard errors do not show that one does, since its parameters
/// or others make up for each other or stand near where they must end, the effect itself is tested: its
/// interval by the profile of the likelihood (Venzon and Moolgavkar, Applied Statistics 37, 1988)
/// holds zero where the fit without it is as good.
pub(super) fn unfit<M: InParts>(
    measured: &M,
    point: &Point,
    deviations: &[f64],
    record: usize,
) -> Vec<Refused> {
    let mut refused = Vec::new();
    let mut place = point.nuisance.len();
    for (index, internal) in &point.effects {
        let candidate = &measured.candidates()[*index];
        let (mut clear, mut sizes, mut matters) = (false, false, false);
        for (parameter, &q) in candidate.parameters.iter().zip(internal) {
            let error = deviations.get(place).copied().unwrap_or(f64::NAN);
            place += 1;
            if !matches!(parameter.role, Role::Shape { .. }) {
                sizes = true;
                clear |= q.abs() > INTERVAL_95 * error;
                matters |= q.abs() > LEAST;
            }
        }
        let bound = candidate.bound(internal).map(|parameter| {
            let values = candidate.parameters.iter().zip(internal);
            let own = values.into_iter().find(|(p, _)| p.name == parameter.name);
            let value = own.map_or(f64::NAN, |(p, &q)| p.scale.to_value(q));
            let of = candidate.parameters.iter();
            let place = of.clone().position(|p| p.name == parameter.name);
            let unit = measured.unit(*index, place.unwrap_or(0));
            let name = parameter.name;
            format!("`{name}` is at its bound of {value:.4e} {unit}")
        });
        if let Some(reason) = bound {
            refused.push((*index, reason));
        } else if sizes && !matters && !is_felt(measured, point, *index, record) {
            refused.push((*index, TOO_SMALL.to_owned()));
        } else if sizes && !clear && !is_missed(measured, point, *index, record) {
            refused.push((
                *index,
                "the 95 % interval of its size contains zero".to_owned(),
            ));
        }
    }
    refused
}

/// `point` without an effect.
pub(super) fn without_effect(point: &Point, effect: usize) -> Point {
    let mut without = point.clone();
    without.effects.retain(|(known, _)| *known != effect);
    without
}

/// Errors on `record` of the fit without an effect and of the one with it.
fn without_and_with<M: InParts>(
    measured: &M,
    point: &Point,
    effect: usize,
    record: usize,
) -> Option<[Vec<f64>; 2]> {
    let without = settled(measured, &without_effect(point, effect), record)?;
    Some([&without, point].map(|point| all_errors(measured, point, record)))
}

/// Whether the fit to `record` without an effect is worse by more than chance.
fn is_missed<M: InParts>(measured: &M, point: &Point, effect: usize, record: usize) -> bool {
    without_and_with(measured, point, effect, record)
        .is_some_and(|[before, after]| clearly_better(&before, &after, &lengths(measured, record)))
}

/// Whether the squared error of the fit to `record` grows by more than a tenth without an effect.
fn is_felt<M: InParts>(measured: &M, point: &Point, effect: usize, record: usize) -> bool {
    without_and_with(measured, point, effect, record)
        .is_some_and(|[before, after]| squares(&before) > NEEDED * squares(&after))
}

/// Whether all data cannot do without an effect of `point`, to which they are fitted.
pub(super) fn is_vital<M: InParts>(measured: &M, point: &Point, effect: usize) -> bool {
    let without = looked(measured, &without_effect(point, effect), EVERYTHING);
    without.is_some_and(|without| {
        let [bare, with] =
            [&without, point].map(|point| squares(&all_errors(measured, point, EVERYTHING)));
        bare > VITAL * with
    })
}

/// Whether the data of `part` tell nothing of an effect that all data cannot do without: as it is in all of them, it
/// makes nothing worse there. A rail is silent where no motion reaches it.
fn is_silent<M: InParts>(measured: &M, fits: &Fits, effect: usize, part: Part) -> bool {
    let all = &fits.everything.0;
    let is_as_good = || {
        let (own, record) = (&fits.parts[part as usize].0, part as usize);
        // A fit keeps the effects and their order.
        let at = own.effects.iter().position(|(known, _)| *known == effect)?;
        let mut held = own.clone();
        held.effects[at].clone_from(&all.effects[at]);
        let before = &held.effects[..at];
        let from =
            held.nuisance.len() + before.iter().map(|(_, values)| values.len()).sum::<usize>();
        let place = from..from + held.effects[at].1.len();
        let is_free = |i: usize| !place.contains(&i);
        let held = least_squares(measured, &held, record, &Free::Chosen(&is_free), AGAIN)?;
        let [bare, _] = without_and_with(measured, own, effect, record)?;
        let lengths = lengths(measured, record);
        Some(!needed(&held.errors, &bare, &lengths))
    };
    is_vital(measured, all, effect) && is_as_good() == Some(true)
}

/// Whether an error on data that were not fitted agrees with that of a fit to them.
pub(super) fn agrees(error: f64, fitted: f64) -> bool {
    error < LOST && (error < NEAR || error < AGREE * fitted)
}

/// The model `own`, fitted to `part`, where it predicts the other part, and its error there. A part that does not tell a parameter may
/// fit its own scatter with it and lose the other part altogether: where the model of `all` data serves it about
/// as well, it contradicts nothing of it.
pub(super) fn on_the_other<M: InParts>(
    measured: &M,
    all: impl FnOnce() -> Option<Point>,
    own: &Point,
    part: Part,
) -> (Point, f64) {
    let (fitted, other) = (part as usize, part.other() as usize);
    let used = completed(measured, own, Some(fitted), other);
    let error = measured.normalised_error(&used, other);
    if error < LOST {
        return (used, error);
    }
    let serves = |all: &Point| {
        let [error, own] = [all, own].map(|point| measured.normalised_error(point, fitted));
        agrees(error, own)
    };
    match all().filter(serves) {
        Some(all) => {
            let error = measured.normalised_error(&all, other);
            (all, error)
        }
        None => (used, error),
    }
}

/// Samples of each file in `record`, of those that have some.
pub(super) fn lengths<M: InParts>(measured: &M, record: usize) -> Vec<usize> {
    let all = (0..measured.blocks()).map(|block| measured.samples(record, block));
    all.filter(|count| *count > 0).collect()
}

/// Whether the squared errors `after` are smaller than those `before` by more than chance, correlated
/// samples counted once: by the ratio of the likelihoods, or, where slow drift in both hides that, by the
/// differences (Vuong, Econometrica 57, 1989; for nested models half the root of the ratio's chi-square
/// at most). `lengths` are those of the files that follow one another: what differs from file to file, such as
/// a zero of the first alone, does not count as drift.
pub(super) fn clearly_better(before: &[f64], after: &[f64], lengths: &[usize]) -> bool {
    let (mut independent, mut gain, mut variance) = (0.0, 0.0, 0.0);
    let mut from = 0;
    for length in lengths {
        let place = from..(from + length).min(after.len()).min(before.len());
        from += length;
        let (before, after) = (&before[place.clone()], &after[place]);
        independent += after.len() as f64 / correlation_time(after);
        let pairs = before.iter().zip(after);
        let differences: Vec<f64> = pairs.map(|(b, a)| b * b - a * a).collect();
        let (mean, deviation) = mean_and_deviation(&differences);
        gain += mean * differences.len() as f64;
        variance +=
            deviation * deviation * differences.len() as f64 * correlation_time(&differences);
    }
    let ratio = independent * (squares(before) / squares(after)).ln();
    ratio > INTERVAL_95 * INTERVAL_95 || gain > INTERVAL_95 * variance.sqrt()
}

/// Whether the squared errors grow without something, from those `with` to the `bare` ones, by a tenth and by more
/// than chance.
pub(super) fn needed(bare: &[f64], with: &[f64], lengths: &[usize]) -> bool {
    squares(bare) > NEEDED * squares(with) && clearly_better(bare, with, lengths)
}

/// Parameters of the effects at `point` with standard errors, under the model's names.
pub(super) fn effects<M: InParts>(
    measured: &M,
    point: &Point,
    deviations: &[f64],
) -> Vec<(String, Vec<NamedValue>)> {
    let named = estimates(measured.candidates(), point, deviations);
    let own = named.into_iter().zip(&point.effects);
    own.map(|(effect, (index, _))| {
        let values = effect.parameters.into_iter().enumerate();
        let values = values.map(|(i, p)| NamedValue {
            name: p.name,
            value: p.value,
            unit: measured.unit(*index, i),
            standard_error: p.standard_error,
        });
        (measured.name(*index), values.collect())
    })
    .collect()
}

/// All parameters of a fit, by a name for people.
fn listed<M: InParts>(measured: &M, point: &Point, deviations: &[f64]) -> Vec<NamedValue> {
    let mut all = measured.parameters(point, deviations);
    for (effect, values) in effects(measured, point, deviations) {
        all.extend(values.into_iter().map(|value| NamedValue {
            name: format!("{effect}.{}", value.name),
            ..value
        }));
    }
    all
}

/// The nominal model, fitted to all data, with standard deviations, and to either part.
pub(super) struct NominalFits {
    everything: (Point, Vec<f64>),
    parts: [Point; 2],
}

impl NominalFits {
    /// Of the data of `measured`; what cannot be fitted stays as described.
    pub(super) fn of<M: InParts>(measured: &M) -> Self {
        let origin = measured.origin();
        let part = |part: Part| {
            settled(measured, &origin, part as usize).unwrap_or_else(|| origin.clone())
        };
        Self {
            everything: refit(measured, &origin, EVERYTHING).map_or_else(
                || (origin.clone(), Vec::new()),
                |(found, deviations)| (found.point, deviations),
            ),
            parts: [part(Part::Fitted), part(Part::LeftOut)],
        }
    }
}

/// One model, fitted to parts and to files.
struct Fits {
    everything: (Point, Vec<f64>),
    parts: [(Point, Vec<f64>); 2],
    files: Vec<(usize, Point, Vec<f64>)>,
}

fn fits<M: InParts>(measured: &M, start: &Point) -> Option<Fits> {
    // What one part hardly shows stays where all data have it.
    let everything = refit(measured, start, EVERYTHING)?;
    let (first, second) = rayon::join(
        || refit(measured, &everything.0.point, Part::Fitted as usize),
        || refit(measured, &everything.0.point, Part::LeftOut as usize),
    );
    let (first, second) = (first?, second?);
    let many = measured.blocks() > 2;
    let own = (0..measured.blocks()).into_par_iter();
    let files = own
        .filter(|&s| many && measured.samples(EVERYTHING, s) >= FEWEST)
        .filter_map(|s| {
            let (found, deviations) = refit(measured, &everything.0.point, file(s))?;
            Some((s, found.point, deviations))
        })
        .collect();
    Some(Fits {
        everything: (everything.0.point, everything.1),
        parts: [(first.0.point, first.1), (second.0.point, second.1)],
        files,
    })
}

/// The effects that are unfit in all data or in a part, and the names of those on which one part is silent.
fn refused_by<M: InParts>(measured: &M, fits: &Fits) -> (Vec<Refused>, Vec<String>) {
    let of = |(point, deviations): &(Point, Vec<f64>), record: usize| {
        unfit(measured, point, deviations, record)
    };
    let has = |list: &[Refused], i: usize| list.iter().any(|(known, _)| *known == i);
    let mut out = of(&fits.everything, EVERYTHING);
    let parts = [Part::Fitted, Part::LeftOut];
    let own = parts.map(|part| of(&fits.parts[part as usize], part as usize));
    let mut silent = Vec::new();
    for part in parts {
        for (i, reason) in &own[part as usize] {
            if has(&out, *i) {
                continue;
            }
            let is_shown = !has(&own[part.other() as usize], *i);
            if is_shown && is_silent(measured, fits, *i, part) {
                silent.push(measured.name(*i));
            } else {
                out.push((*i, reason.clone()));
            }
        }
    }
    (out, silent)
}

/// Whether an effect is at its bound in all data or in a part.
fn is_at_bound<M: InParts>(measured: &M, fits: &Fits, index: usize) -> bool {
    let candidate = &measured.candidates()[index];
    let points = fits.parts.iter().chain([&fits.everything]);
    let mut own = points.flat_map(|(point, _)| point.effects.iter().filter(|(i, _)| *i == index));
    own.any(|(_, internal)| candidate.bound(internal).is_some())
}

/// Whether an effect's size differs from zero: the interval of one of its parameters, shapes apart, excludes zero.
fn differs_from_zero(effect: &Candidate, values: &[NamedValue]) -> bool {
    let pairs = effect.parameters.iter().zip(values);
    let mut sizes = pairs.filter(|(parameter, _)| !matches!(parameter.role, Role::Shape { .. }));
    sizes.any(|(_, own)| own.value.abs() > INTERVAL_95 * own.standard_error)
}

/// What is found beside the effects, and the model; none where it cannot be fitted. Effects of
/// `start` that turn out to be unfit leave it, each with its reason.
pub(super) fn confirm<M: InParts>(
    measured: &M,
    nominal: &NominalFits,
    start: &Point,
    refused: &mut Vec<Refused>,
    findings: &mut Vec<String>,
) -> Option<Confirmed> {
    let mut start = start.clone();
    let (fits, on_one_part) = loop {
        let fits = fits(measured, &start)?;
        let (out, silent) = refused_by(measured, &fits);
        if out.is_empty() {
            break (fits, silent);
        }
        for (index, reason) in out {
            if refused.iter().all(|(known, _)| *known != index) {
                refused.push((index, reason));
            }
            let Some(place) = start.effects.iter().position(|(i, _)| *i == index) else {
                continue;
            };
            // At its bound it stands for another of its class: a gain that falls to nothing is a dead band.
            let is_out = |i: usize| refused.iter().any(|(known, _)| *known == i);
            let other = alike(measured, &start, index).find(|i| !is_out(*i));
            let other = other.filter(|_| is_at_bound(measured, &fits, index));
            match other.and_then(|other| in_place_of(measured, &start, place, other)) {
                Some(replaced) => start = replaced,
                None => {
                    start.effects.remove(place);
                }
            }
        }
    };
    let (point, deviations) = &fits.everything;
    let (refitted, refitted_deviations) = &nominal.everything;
    let own = measured.parameters(point, deviations);
    let count = own.len();
    let mut all = listed(measured, point, deviations);
    differences(measured, &fits, &mut all, findings);
    surprises(measured, &all, count, findings);
    let scattered: Vec<f64> = all.iter().map(|value| value.standard_error).collect();
    let with_errors = |values: Vec<NamedValue>, from: usize| -> Vec<NamedValue> {
        let pairs = values.into_iter().zip(&scattered[from..]);
        pairs
            .map(|(value, &standard_error)| NamedValue {
                standard_error,
                ..value
            })
            .collect()
    };
    let mut from = count;
    let effects: Vec<(String, Vec<NamedValue>)> = effects(measured, point, deviations)
        .into_iter()
        .map(|(name, values)| {
            let first = from;
            from += values.len();
            (name, with_errors(values, first))
        })
        .collect();
    let on = |part: Part| {
        let all = || Some(point.clone());
        on_the_other(measured, all, &fits.parts[part as usize].0, part)
    };
    let [(here, error), (there, swapped_error)] = [Part::Fitted, Part::LeftOut].map(on);
    for (part, used) in [(Part::Fitted, &here), (Part::LeftOut, &there)] {
        if used == point && fits.parts[part as usize].0 != *point {
            findings.push(format!(
                "the fit to `{}` alone loses the other part; the model of all data, which serves it about as well, \
                 takes its place",
                measured.record_name(part as usize)
            ));
        }
    }
    let (tested, swapped) = (Part::LeftOut as usize, Part::Fitted as usize);
    let gain = |part: Part, own: &Point| {
        let (fitted, tested) = (part as usize, part.other() as usize);
        let nominal = completed(measured, &nominal.parts[fitted], Some(fitted), tested);
        let errors = |point: &Point| all_errors(measured, point, tested);
        gain_interval(&errors(&nominal), &errors(own))
    };
    let gains = [gain(Part::Fitted, &here), gain(Part::LeftOut, &there)];
    let by_output = measured.error_by_output(&here, tested);
    let swapped_by_output = measured.error_by_output(&there, swapped);
    let pairs = by_output.into_iter().zip(swapped_by_output);
    findings.extend(pairs.map(|((name, error), (_, other))| {
        format!(
            "error of {name} on the held-out data: {:.1} %; swapped: {:.1} %",
            100.0 * error,
            100.0 * other
        )
    }));
    Some(Confirmed {
        error,
        swapped_error,
        gain_interval: gains[0],
        pays: gains.iter().all(|own| own.0 > 0.0),
        refitted_error: measured.normalised_error(refitted, EVERYTHING),
        fitted_error: measured.normalised_error(point, EVERYTHING),
        refitted: measured.parameters(refitted, refitted_deviations),
        parameters: with_errors(own, 0),
        effects,
        on_one_part,
        of_the_fit: scattered[..count].to_vec(),
        point: point.clone(),
        refitted_point: refitted.clone(),
    })
}

/// Widens the standard errors of `all` to the scatter between parts and files, and tells which parameters are not the
/// same there. Other files show nothing of the first file's zero: without that file it makes up for a zero of theirs.
fn differences<M: InParts>(
    measured: &M,
    fits: &Fits,
    all: &mut [NamedValue],
    findings: &mut Vec<String>,
) {
    let of = |record: usize, point: &Point, deviations: &[f64]| {
        let values = listed(measured, point, deviations);
        (record, measured.record_name(record).to_owned(), values)
    };
    let lists: Vec<(usize, String, Vec<NamedValue>)> = if fits.files.is_empty() {
        let parts = [Part::Fitted, Part::LeftOut].map(|part| part as usize);
        let own = parts.map(|part| (part, &fits.parts[part]));
        own.map(|(part, (point, deviations))| of(part, point, deviations))
            .into()
    } else {
        let own = fits.files.iter();
        own.map(|(s, point, deviations)| of(file(*s), point, deviations))
            .collect()
    };
    let nominal = measured.parameters(&fits.everything.0, &[]).len();
    let tells = |record: usize, i: usize| {
        let is_of_first = i < nominal && measured.is_of_first_file(i);
        !is_of_first || measured.samples(record, 0) > 0
    };
    for (i, parameter) in all.iter_mut().enumerate() {
        let own: Vec<(&str, &NamedValue)> = lists
            .iter()
            .filter(|(record, ..)| tells(*record, i))
            .filter_map(|(_, name, list)| Some((name.as_str(), list.get(i)?)))
            .filter(|(_, value)| value.value.is_finite() && value.standard_error.is_finite())
            .collect();
        let n = own.len() as f64;
        if own.len() < 2 {
            continue;
        }
        let mean = own.iter().map(|(_, v)| v.value).sum::<f64>() / n;
        let variance = own
            .iter()
            .map(|(_, v)| (v.value - mean).powi(2))
            .sum::<f64>()
            / (n - 1.0);
        let scatter = (variance / n).sqrt();
        if scatter > parameter.standard_error || parameter.standard_error.is_nan() {
            parameter.standard_error = scatter;
        }
        let ends = |order: fn(f64, f64) -> bool| {
            own.iter()
                .copied()
                .reduce(|a, b| if order(a.1.value, b.1.value) { a } else { b })
        };
        let (Some(low), Some(high)) = (ends(|a, b| a < b), ends(|a, b| a > b)) else {
            continue;
        };
        let apart = high.1.value - low.1.value;
        if apart > DIFFERS * low.1.standard_error.hypot(high.1.standard_error) {
            let told = |(name, v): (&str, &NamedValue)| {
                let own = measure(v.value, v.standard_error, &v.unit);
                format!("{own} ({name})")
            };
            findings.push(format!(
                "`{}` differs between parts: {} and {}; its interval includes the scatter",
                parameter.name,
                told(low),
                told(high)
            ));
        }
    }
}

/// Tells which nominal parameters are not what was stated.
fn surprises<M: InParts>(
    measured: &M,
    all: &[NamedValue],
    count: usize,
    findings: &mut Vec<String>,
) {
    // The effects' parameters follow the nominal ones.
    for (i, value) in all.iter().take(count).enumerate() {
        let (stated, deviation) = measured.stated(i);
        let off = (value.value - stated).abs();
        if off > SURPRISING * deviation && off > SURPRISING * value.standard_error {
            findings.push(format!(
                "`{}` is {} from these data, stated as {} with a deviation of {}",
                value.name,
                measure(value.value, value.standard_error, &value.unit),
                measure(stated, f64::NAN, &value.unit),
                measure(deviation, f64::NAN, &value.unit),
            ));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::super::measured::Measured;
    use super::super::{Measurement, RigRecording, of_kind};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use recordings::{Channel, Recording};

    #[test]
    fn a_gain_all_along_is_clear_and_one_by_chance_or_of_a_slow_drift_is_not() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let noise: Vec<f64> = (0..2000).map(|_| random.random_range(-1.0..1.0)).collect();
        let wave = |k: usize| 0.3 * (0.05 * k as f64).sin();
        let with = |more: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let all = noise.iter().enumerate();
            all.map(|(k, e)| e + more(k)).collect()
        };
        let clearly_better =
            |before: &[f64], after: &[f64]| clearly_better(before, after, &[before.len()]);
        assert!(clearly_better(&with(&wave), &noise));
        assert!(!clearly_better(&noise, &with(&wave)));
        let chance = |k: usize| 1e-3 * wave(k);
        assert!(!clearly_better(&with(&chance), &noise));
        // A drift that is few samples in truth.
        let drift: Vec<f64> = (0..2000).map(|k| (2e-3 * f64::from(k)).sin()).collect();
        let shifted: Vec<f64> = drift.iter().map(|e| e + 0.05).collect();
        assert!(!clearly_better(&shifted, &drift));
    }

    #[test]
    fn an_effect_of_which_another_model_leaves_nothing_vanishes() {
        let rig = super::super::of_kind("closed_loop_actuator").unwrap();
        let candidates: Vec<Candidate> = rig.effects().into_iter().map(|e| e.candidate).collect();
        let value = |name: &str, value: f64, standard_error: f64| NamedValue {
            name: name.into(),
            value,
            unit: "1".into(),
            standard_error,
        };
        let own = |values: [f64; 3]| {
            let [compression, error, sliding] = values;
            let effects = vec![
                (
                    "flow_saturation".to_owned(),
                    vec![value("compression", compression, 5e-3)],
                ),
                (
                    "friction".to_owned(),
                    vec![
                        value("breakaway_error", error, 1e-6),
                        value("sliding_speed", sliding, 1e-5),
                    ],
                ),
            ];
            let place = |name: &str| candidates.iter().position(|c| c.effect == name).unwrap();
            let places = effects.iter().map(|(name, _)| (place(name), Vec::new()));
            let point = Point {
                nuisance: Vec::new(),
                effects: places.collect(),
            };
            Confirmed {
                error: 0.0,
                swapped_error: 0.0,
                gain_interval: (0.0, 0.0),
                refitted_error: 0.0,
                fitted_error: 0.0,
                refitted: Vec::new(),
                parameters: Vec::new(),
                effects,
                on_one_part: Vec::new(),
                pays: true,
                of_the_fit: Vec::new(),
                refitted_point: point.clone(),
                point,
            }
        };
        let first = own([0.127, 2e-5, 1e-3]);
        let gone = |other: [f64; 3]| {
            let mut first = first.clone();
            first.widen_to(&own(other));
            let vanished = first.vanished(&candidates);
            let names = vanished.into_iter().map(|(i, _)| candidates[i].effect);
            names.collect::<Vec<_>>()
        };
        assert!(gone([0.2, 2.2e-5, 1e-3]).is_empty());
        // A sliding speed is no size.
        assert!(gone([0.2, 2.2e-5, 0.1]).is_empty());
        assert_eq!(gone([0.43, 2.2e-5, 1e-3]), ["flow_saturation"]);
    }

    const COMMAND: Channel = Channel::Other {
        name: "command",
        unit: "m",
    };

    /// Two files of command and displacement at 100 Hz, the second left out.
    fn two_files(files: [(Vec<f64>, Vec<f64>); 2]) -> Measurement {
        let recordings = files.into_iter().enumerate();
        let recordings = recordings.map(|(i, (command, displacement))| {
            let channels = vec![(COMMAND, command), (Channel::Displacement, displacement)];
            let recording = Recording::new("one", 0.01, channels).unwrap();
            let mut own = RigRecording::new(recording, &[COMMAND], Channel::Displacement);
            own.left_out.fill(i == 1);
            own
        });
        Measurement {
            recordings: recordings.collect(),
        }
    }

    /// A closed loop of which gain, scale and zero are uncertain.
    fn measured(measurement: &Measurement) -> Measured<'_> {
        let rig = of_kind("closed_loop_actuator").unwrap();
        let stated = |name: &str| match name {
            "loop_gain" => (20.0, 5.0),
            "scale" => (1.0, 0.01),
            "offset" => (0.0, 1e-3),
            _ => (0.0, 0.0),
        };
        let nominal = rig.parameters().iter().map(|(name, _)| stated(name));
        Measured::new(rig, measurement, nominal.collect())
    }

    #[test]
    fn a_part_that_does_not_tell_a_gain_keeps_that_of_all_data() {
        // x' = 20 (r - x) by small steps, at 30 rad/s and so slowly that any gain follows.
        let file = |frequency: f64| {
            let wave = |t: f64| (frequency * t).sin();
            let (mut x, mut displacement) = (0.0, Vec::new());
            for k in 0..600 {
                displacement.push(x);
                for part in 0..100 {
                    let t = 0.01 * (f64::from(k) + 0.01 * f64::from(part));
                    x += 1e-4 * 20.0 * (wave(t) - x);
                }
            }
            let command = (0..600).map(|k| wave(0.01 * f64::from(k))).collect();
            (command, displacement)
        };
        let measurement = two_files([file(30.0), file(0.5)]);
        let measured = measured(&measurement);
        let all = measured.origin();
        let at = |gain: f64| {
            let mut point = all.clone();
            point.nuisance[0] = (gain / 20.0).ln() * 20.0 / 5.0;
            point
        };
        let (own, near) = (at(4.0), at(18.0));
        let of_all = |point: &Point| {
            let point = point.clone();
            || Some(point)
        };
        let used = |of: &Point, own: &Point, part| on_the_other(&measured, of_all(of), own, part).0;
        let gain = |point: &Point| point.nuisance[0];
        assert_eq!(gain(&used(&all, &own, Part::LeftOut)), gain(&all));
        // What predicts the other part counts as it is, and a model that the part contradicts does not stand for it.
        assert_eq!(gain(&used(&all, &near, Part::LeftOut)), gain(&near));
        assert_eq!(gain(&used(&at(0.1), &own, Part::LeftOut)), gain(&own));
    }

    #[test]
    fn of_the_first_files_zero_no_later_file_tells() {
        let wave: Vec<f64> = (0..600).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let measurement = two_files([(wave.clone(), wave.clone()), (wave.clone(), wave)]);
        let measured = measured(&measurement);
        let all = measured.origin();
        let mut later = all.clone();
        later.nuisance.iter_mut().for_each(|p| *p = 2.0);
        let deviations = vec![0.01; all.nuisance.len()];
        let fits = Fits {
            everything: (all.clone(), deviations.clone()),
            parts: [
                (all.clone(), deviations.clone()),
                (later, deviations.clone()),
            ],
            files: Vec::new(),
        };
        let mut values = listed(&measured, &all, &deviations);
        let own: Vec<f64> = values.iter().map(|value| value.standard_error).collect();
        let mut findings = Vec::new();
        differences(&measured, &fits, &mut values, &mut findings);
        let widened = values.iter().zip(&own);
        let widened = widened.filter(|(value, own)| value.standard_error > 10.0 * **own);
        let names: Vec<&str> = widened.map(|(value, _)| value.name.as_str()).collect();
        assert_eq!(names, ["loop_gain", "scale"]);
        assert!(
            findings.iter().all(|one| !one.contains("offset")),
            "{findings:?}"
        );
    }

    #[test]
    fn a_zero_of_the_first_of_two_files_is_clear() {
        // Errors of slow waves; without the zero the first file has a constant besides.
        let wave = |k: usize| 0.03 * (0.02 * k as f64).sin() + 0.02 * (0.37 * k as f64).cos();
        let after: Vec<f64> = (0..8000).map(wave).collect();
        let shifted = |(k, e): (usize, &f64)| e + if k < 4000 { 0.06 } else { 0.0 };
        let before: Vec<f64> = after.iter().enumerate().map(shifted).collect();
        assert!(clearly_better(&before, &after, &[4000, 4000]));
        assert!(!clearly_better(&after, &before, &[4000, 4000]));
    }
}
