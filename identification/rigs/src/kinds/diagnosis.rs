//! The diagnosis of a rig on real data.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::alternatives::{
    Item, least_needed, nearly_without, of_its_class, proposals, replaced, simplest,
};
use super::cause::{Cause, FROM, INTERVAL_95, effect_in_words, in_own_words, joined, undetermined};
use super::confirmed::{
    Confirmed, NEAR, NominalFits, Refused, TOO_SMALL, agrees, confirm, effects as named_values,
    is_vital, lengths, needed, unfit,
};
use super::measured::Measured;
use super::named_value::NamedValue;
use super::parts::{EVERYTHING, InParts, LOST, Part};
use super::profile::{self, Open, Profiled};
use super::readings::{Crossed, Reading, Weighed, in_words, instead, ranked, with_and_without};
use super::{Description, DescriptionError, Measurement};
use crate::report::ends_or_not_a_number;
use diagnosis::resampling::gain_interval;
use diagnosis::{
    Observer, Point, Progress, Selected, Verdict, all_errors, completed, refit, select,
    select_jointly, settled, squares,
};

/// Share of the described model's error that is left, in both parts, where a nominal parameter that is so many
/// standard errors from what was stated is a cause although the errors do not agree.
const MOST: f64 = 0.5;
const FAR: f64 = 5.0;
/// Why an effect is not named that the data do not need for sure.
const DOUBTED: &str = "the prediction of either part is hardly worse without it";
/// Why an effect is not named that does not help to predict the other part.
const UNUSED: &str = "the prediction of the other part is better without it";
/// Error on all data over that of a model with more nominal parameters, up to which it does as well.
const AS_WELL: f64 = 1.02;
/// Error of a model, over the output, that leaves nothing to doubt in how the output is measured.
const SMALL: f64 = 0.05;
/// Share of the described model's squared error that is nothing to explain.
const NOTHING: f64 = 1e-3;
/// Share of the squared error beyond which what is explained is all of it.
const ALL: f64 = 0.98;

/// An effect that one part of the data asks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartEffect {
    /// Its name.
    pub effect: String,
    /// Its parameters.
    pub parameters: Vec<NamedValue>,
    /// Probability that its gain on unseen data is not due to chance, with correlated samples
    /// counted once.
    pub confidence: f64,
    /// By how much the squared error on the data not fitted grows without it (all else refitted),
    /// as a share of the nominal model's.
    pub share: f64,
    /// Why it is nevertheless not named: it is at its bound, its interval contains zero, or the
    /// other part is predicted worse with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objection: Option<String>,
}

/// What one part of the data says, tested on the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartReport {
    /// Normalised error of the nominal model on the data not fitted.
    pub nominal_error: f64,
    /// With its parameters refitted.
    pub refitted_error: f64,
    /// Extended, on the data not fitted.
    pub extended_error: f64,
    /// Extended, on the fitted data.
    pub fitted_error: f64,
    /// 95 % interval of the share of the refitted model's squared error that the effects explain
    /// on the data not fitted.
    #[serde(deserialize_with = "ends_or_not_a_number")]
    pub gain_interval: (f64, f64),
    /// Nominal parameters as refitted.
    pub parameters: Vec<NamedValue>,
    /// The effects.
    pub effects: Vec<PartEffect>,
    /// Share of the nominal model's squared error on the data not fitted that the extended model
    /// explains.
    pub explained: f64,
    /// Pairs of an effect that nearly did as well and the one that was taken.
    pub rivals: Vec<(String, String)>,
    /// Where the extended model is.
    #[serde(skip)]
    pub(super) point: Point,
}

/// The diagnosis of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigDiagnosis {
    /// The rig.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// What is simulated.
    pub output: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Effects that both parts of the data name.
    pub named: Vec<String>,
    /// Effects that only one part names.
    pub not_confirmed: Vec<String>,
    /// Fitted as described, tested on the held-out part.
    pub as_described: PartReport,
    /// Fitted on the held-out part, tested on the rest.
    pub swapped: PartReport,
    /// What was found and is not named, with the reason.
    #[serde(default)]
    pub set_aside: Vec<SetAside>,
    /// Nominal parameters such as a scale that are not what was stated, and sensors that contradict each
    /// other.
    #[serde(default)]
    pub causes: Vec<Cause>,
    /// What the data may mean where they do not tell for sure, the likeliest first; otherwise none.
    #[serde(default)]
    pub readings: Vec<Reading>,
    /// Parameters that differ between parts of the data or from what was stated.
    #[serde(default)]
    pub findings: Vec<String>,
    /// Sentences of the effects that are the user's own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sentences: BTreeMap<String, String>,
    /// The model with the named effects alone.
    pub confirmed: Confirmed,
    /// Share of the squared error on the held-out data that the confirmed model leaves.
    pub unexplained: f64,
}

/// An effect that pays on a part of the data and is not named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SetAside {
    /// The effect.
    pub effect: String,
    /// Why.
    pub reason: String,
}

/// Diagnoses a rig on its measurements.
///
/// # Errors
/// When the description does not fit the rig, or the nominal model cannot be simulated.
pub fn diagnose(
    description: &Description,
    measurement: &Measurement,
    observer: Observer<'_>,
) -> Result<RigDiagnosis, DescriptionError> {
    let rig = description.rig()?;
    let nominal = description.nominal(rig)?;
    let measured = Measured::new(rig, measurement, nominal).called(&description.name);
    let mut found = judge(&measured, observer).ok_or_else(|| no_output(description))?;
    found
        .findings
        .extend(measured.notes(&found.confirmed.point));
    let own = description.hypotheses.iter();
    found.sentences = own
        .map(|(name, own)| (name.clone(), own.sentence.clone()))
        .collect();
    Ok(found)
}

/// Diagnoses a model on its data; none where the nominal model cannot be simulated.
pub(super) fn judge<M: InParts>(measured: &M, observer: Observer<'_>) -> Option<RigDiagnosis> {
    let part = |fitted: Part| -> Option<PartReport> {
        let record = fitted as usize;
        observer.tell(|| Progress::Fitting(measured.record_name(record).to_owned()));
        let selected = select(measured, record, observer)?;
        Some(part_report(measured, fitted, &selected))
    };
    let mut as_described = part(Part::Fitted)?;
    let swapped = part(Part::LeftOut)?;
    let list = |part: &PartReport| -> Vec<String> {
        part.effects
            .iter()
            .map(|effect| effect.effect.clone())
            .collect()
    };
    let (here, there) = (list(&as_described), list(&swapped));
    as_described.rivals = rivals([&as_described, &swapped]);
    // Effects that records of a rig cannot tell apart confirm each other.
    let alike = |name: &str, other: &str| {
        let known = |name: &str| measured.index(name);
        name == other
            || matches!((known(name), known(other)), (Some(a), Some(b)) if measured.are_alike(a, b))
    };
    let in_both = |name: &String, others: &[String]| others.iter().any(|other| alike(name, other));
    // Either part proposes; all data together decide by how either part predicts the other.
    let (found, other) = select_jointly(
        measured,
        &proposals(measured, [&as_described, &swapped]),
        EVERYTHING,
        observer,
    )?;
    let nominal = NominalFits::of(measured);
    // What a part gives a reason against is not named, unless the other part names it without one.
    let both = || as_described.effects.iter().chain(&swapped.effects);
    let judged = |point: &Point| {
        let (mut refused, mut findings): (Vec<Refused>, _) = (Vec::new(), Vec::new());
        let mut left = point.clone();
        for effect in both() {
            let (Some(index), Some(reason)) = (measured.index(&effect.effect), &effect.objection)
            else {
                continue;
            };
            if both().any(|own| own.effect == effect.effect && own.objection.is_none()) {
                continue;
            }
            // A part without it is predicted by a fit that bends to make up for it, and may be so by chance.
            if reason == UNUSED && is_vital(measured, &left, index) {
                continue;
            }
            left.effects.retain(|(known, _)| *known != index);
            if refused.iter().all(|(known, _)| *known != index) {
                refused.push((index, reason.clone()));
            }
        }
        let confirmed = confirm(measured, &nominal, &left, &mut refused, &mut findings)?;
        Some((confirmed, refused, findings))
    };
    let stands_whole =
        |point: &Point| judged(point).filter(|own| own.0.effects.len() == point.effects.len());
    let other = other.and_then(|other| Some((stands_whole(&other.point)?, other)));
    let ((mut confirmed, mut refused, mut findings), start) = match other {
        Some(other) => other,
        None => (judged(&found.point)?, found),
    };
    let mut set_aside: Vec<SetAside> = Vec::new();
    let mut not_confirmed: Vec<String> = Vec::new();
    let kept: Vec<String> = start
        .point
        .effects
        .iter()
        .map(|(i, _)| measured.name(*i))
        .collect();
    for effect in here.iter().chain(&there) {
        let known = set_aside.iter().any(|known| known.effect == *effect);
        if known || in_both(effect, &kept) {
            continue;
        }
        let reason = if in_both(effect, &here) && in_both(effect, &there) {
            "neither part predicts the other better with it"
        } else {
            not_confirmed.push(effect.clone());
            "one part of the data shows it and the other does not"
        };
        set_aside.push(SetAside {
            effect: effect.clone(),
            reason: reason.to_owned(),
        });
    }
    let crossed = Crossed::of(measured, &confirmed.point)?;
    let mut of_its_class = of_its_class(measured, &confirmed.point, crossed, observer).into_iter();
    let (best, mut crossed) = of_its_class.next()?;
    if replaced(&confirmed.point, &best).is_some() {
        let mut new = refused.clone();
        let again = confirm(measured, &nominal, &best, &mut new, &mut Vec::new());
        let as_many = |again: &Confirmed| again.effects.len() == confirmed.effects.len();
        if let Some(again) = again.filter(as_many) {
            crossed = Crossed::of(measured, &again.point)?;
            (confirmed, refused) = (again, new);
            findings.clear();
        } else {
            crossed = Crossed::of(measured, &confirmed.point)?;
        }
    }
    // What else the data may mean: everything that is not needed for sure goes, the least needed first.
    let mut weighed: Vec<Weighed> = Vec::new();
    let mut asked: Option<Vec<Item>> = None;
    let fitted = |own: &Confirmed| measured.normalised_error(&own.point, EVERYTHING);
    let mut most = AS_WELL * fitted(&confirmed);
    if !observer.is_over()
        && let Some((left, without)) = simplest(measured, &confirmed.point, &crossed, most)
    {
        findings.clear();
        confirmed = confirm(measured, &nominal, &left, &mut refused, &mut findings)?;
        crossed = without;
    }
    let with_all = confirmed.clone();
    while !observer.is_over()
        && let Some((left, without)) =
            least_needed(measured, &confirmed.point, &crossed, most, &mut asked)
    {
        let gone = confirmed.point.effects.iter();
        let mut gone = gone.filter(|(i, _)| left.effects.iter().all(|(known, _)| known != i));
        if let Some((i, _)) = gone.next() {
            refused.push((*i, DOUBTED.to_owned()));
            weighed.extend(Weighed::of(measured, &confirmed.point, crossed));
        }
        findings.clear();
        let had = confirmed.point.effects.len();
        confirmed = confirm(measured, &nominal, &left, &mut refused, &mut findings)?;
        crossed = without;
        if confirmed.point.effects.len() < had {
            most = most.max(AS_WELL * fitted(&confirmed));
        }
    }
    // Nor do they tell an effect from all of its class.
    let own: Vec<usize> = confirmed.point.effects.iter().map(|(i, _)| *i).collect();
    let is_own = |effect: &str| own.iter().any(|i| measured.name(*i) == effect);
    as_described.rivals.retain(|(rival, _)| !is_own(rival));
    for (point, errors) in of_its_class {
        if let Some((against, rival)) = replaced(&best, &point)
            && own.contains(&against)
            && !own.contains(&rival)
        {
            let pair = (measured.name(rival), measured.name(against));
            if !as_described.rivals.contains(&pair) {
                as_described.rivals.push(pair);
            }
            confirmed.widen_by(measured, &point);
            weighed.extend(Weighed::of(measured, &point, errors));
        }
    }
    let is_told = |(i, value): (usize, &NamedValue)| {
        let is_cause = measured.is_cause(i) && !measured.is_of_first_file(i);
        is_cause && Cause::of(value.clone(), measured.stated(i)).is_some()
    };
    if !observer.is_over() && confirmed.parameters.iter().enumerate().any(is_told) {
        for near in nearly_without(measured, &confirmed.point) {
            confirmed.widen_by(measured, &near);
        }
    }
    // What the model may lack or not changes the others by as much as is not known.
    confirmed.widen_to(&with_all);
    let vanished = confirmed.vanished(measured.candidates());
    if !vanished.is_empty() {
        let mut left = confirmed.point.clone();
        let is_gone = |i: usize| vanished.iter().any(|(gone, _)| *gone == i);
        left.effects.retain(|(i, _)| !is_gone(*i));
        let (mut reasons, mut own) = ([refused.clone(), vanished].concat(), Vec::new());
        let mut without = confirm(measured, &nominal, &left, &mut reasons, &mut own)?;
        let errors = Crossed::of(measured, &without.point)?;
        // Of an effect that predictions need, the size alone is not known.
        if !crossed.needs(&errors) {
            without.widen_to(&with_all);
            (confirmed, crossed, refused, findings) = (without, errors, reasons, own);
        }
    }
    for (i, reason) in refused {
        let effect = measured.name(i);
        if set_aside.iter().all(|known| known.effect != effect) {
            set_aside.push(SetAside { effect, reason });
        }
    }
    let or_its_like = |name: &String| {
        let rivals = as_described.rivals.iter();
        let own = rivals.filter(|(rival, against)| against == name && alike(against, rival));
        let mut all: Vec<&str> = own.map(|(rival, _)| rival.as_str()).collect();
        if all.is_empty() && !there.contains(name) {
            let other = there.iter().find(|other| alike(name, other));
            all.extend(other.map(String::as_str));
        }
        all.insert(0, name);
        all.join(" or ")
    };
    let named: Vec<String> = confirmed
        .effects
        .iter()
        .map(|(name, _)| or_its_like(name))
        .collect();
    let is_named = |effect: &str| confirmed.effects.iter().any(|(name, _)| name == effect);
    let rivalled = as_described
        .rivals
        .iter()
        .any(|(rival, against)| is_named(against) && !alike(against, rival));
    // Each part is predicted from the other about as well as it is fitted.
    let tests = [
        (confirmed.error, as_described.fitted_error),
        (confirmed.swapped_error, swapped.fitted_error),
    ];
    let holds = tests
        .into_iter()
        .all(|(error, fitted)| agrees(error, fitted));
    let leaves_little = tests.into_iter().all(|(error, _)| error < SMALL);
    // Where they do not agree so well, since friction or the like is missed, what either part predicts of
    // the other still shows a zero or a delay that is far from what was stated in both.
    let explains = [
        (confirmed.error, as_described.nominal_error),
        (confirmed.swapped_error, swapped.nominal_error),
    ];
    let explains = explains
        .into_iter()
        .all(|(error, nominal)| error < LOST && error < MOST * nominal);
    // A zero shows in a file by itself, whatever a part tells of another.
    let believed = |i: usize, cause: &Cause| {
        holds || ((explains || measured.is_of_first_file(i)) && cause.deviations() > FAR)
    };
    // One fit serves every parameter that is profiled.
    let mut profiled = None;
    let mut causes: Vec<Cause> = Vec::new();
    let mut doubted: Vec<Cause> = Vec::new();
    let mut hidden: Vec<Cause> = Vec::new();
    for i in (0..confirmed.parameters.len()).filter(|i| measured.is_cause(*i)) {
        let stated = measured.stated(i);
        let mut fitted = NamedValue {
            standard_error: confirmed.of_the_fit[i],
            ..confirmed.parameters[i].clone()
        };
        if Cause::of(fitted.clone(), stated).is_none()
            && !measured.is_of_first_file(i)
            && holds
            && !observer.is_over()
        {
            let profiled =
                profiled.get_or_insert_with(|| profile::beside(measured, &confirmed.point));
            if let Some(own) = profiled {
                hidden.extend(beyond(own, i, &fitted, stated, &confirmed.parameters));
                fitted.value = own.value(i).unwrap_or(fitted.value);
            }
        }
        let Some(mut told) = Cause::of(fitted, stated) else {
            continue;
        };
        hidden.retain(|own| own.found.name != told.found.name);
        if !believed(i, &told) || told.makes_up(&confirmed.parameters) {
            continue;
        }
        let mut as_stated = None;
        if !measured.is_of_first_file(i)
            && !observer.is_over()
            && let Some(own) =
                profiled.get_or_insert_with(|| profile::beside(measured, &confirmed.point))
            && let Some(open) = own.open(i, stated.0)
        {
            let own = &mut confirmed.parameters[i];
            let (low, high) = open.ends(own.value, stated.0);
            told.widen((low, high));
            let farthest = (own.value - low).max(high - own.value);
            own.standard_error = own.standard_error.max(farthest / INTERVAL_95);
            match open {
                Open::Stated(point) => {
                    confirmed.widen_by(measured, &point);
                    as_stated = Some(point);
                }
                Open::Within(low, high) if told.is_usual((low, high), stated.1) => {
                    hidden.push(told);
                    continue;
                }
                Open::Within(..) => {}
            }
        }
        let without = measured.pinned(i, stated.0).and_then(|own| {
            // No part tells another one's zero.
            if measured.is_of_first_file(i) {
                let best = settled(&own, &confirmed.point, EVERYTHING)?;
                let errors = Crossed::of(&own, &best)?;
                let bare = all_errors(&own, &best, EVERYTHING);
                let with = all_errors(measured, &confirmed.point, EVERYTHING);
                let is_needed = needed(&bare, &with, &lengths(measured, EVERYTHING));
                return Some((own, best, errors, is_needed));
            }
            let is_open = as_stated.is_some();
            let best = as_stated.unwrap_or_else(|| confirmed.point.clone());
            let looked = Crossed::looked(&own, &best)?;
            if !is_open && crossed.is_far_from(&looked) {
                return Some((own, best, looked, true));
            }
            let errors = looked.settled(&own)?;
            let is_needed = !is_open && crossed.needs(&errors);
            Some((own, best, errors, is_needed))
        });
        match without {
            Some((own, best, errors, false)) => {
                doubted.push(told);
                weighed.extend(Weighed::of(&own, &best, errors));
            }
            _ => causes.push(told),
        }
    }
    // Of records that no model explains, sensors tell less too.
    let tells = holds || explains || leaves_little;
    let (clear, mut suspected): (Vec<_>, Vec<_>) = measured
        .contradictions()
        .into_iter()
        .filter(|cause| tells || cause.deviations() > FAR)
        .partition(Cause::is_clear);
    causes.extend(clear);
    suspected.extend(hidden);
    let leaves_nothing = tests.into_iter().all(|(error, _)| error < NEAR);
    let is_answered = !confirmed.effects.is_empty() || !causes.is_empty() || leaves_nothing;
    // What was found and is not named is ranked.
    if !is_answered && !observer.is_over() {
        let proposed = [&start.point, &as_described.point, &swapped.point];
        weighed.extend(unnamed(measured, proposed));
    }
    let told = [&causes[..], &doubted, &suspected];
    let readings = readings(measured, weighed, told, (&confirmed, crossed));
    let of_parts = [&as_described, &swapped].into_iter();
    let mut matter: Vec<&PartEffect> = of_parts.flat_map(|part| &part.effects).collect();
    matter.retain(|own| own.objection.as_deref() != Some(TOO_SMALL) && own.share > NOTHING);
    let verdict = match (named.is_empty() || !confirmed.pays, rivalled) {
        (true, _) if !causes.is_empty() => Verdict::Named,
        (true, _) if leaves_nothing || (matter.is_empty() && holds) => Verdict::Adequate,
        (true, _) => Verdict::Unexplained,
        (_, true) => Verdict::Ambiguous,
        _ => Verdict::Named,
    };
    Some(RigDiagnosis {
        name: measured.subject().to_owned(),
        kind: measured.kind().to_owned(),
        output: measured.output(),
        verdict,
        named,
        not_confirmed,
        set_aside,
        causes,
        readings,
        findings,
        sentences: BTreeMap::new(),
        unexplained: (confirmed.error / as_described.nominal_error).powi(2),
        confirmed,
        as_described,
        swapped,
    })
}

/// Standard errors that no valley makes up for.
const HOPELESS: f64 = 50.0;

/// That the parameter `i` is farther from what was `stated` than the `found` value, which others of the `parameters` can
/// make up for; none where the data tell that it is not.
fn beyond<M: InParts>(
    profiled: &mut Profiled<'_, M>,
    i: usize,
    found: &NamedValue,
    (stated, within): (f64, f64),
    parameters: &[NamedValue],
) -> Option<Cause> {
    [1.0, -1.0].into_iter().find_map(|side| {
        let threshold = stated + side * FROM * within;
        let off = (threshold - found.value).abs();
        // Nor is a model to be believed that is as far off on the other side.
        if off > HOPELESS * found.standard_error || off > 2.0 * FROM * within {
            return None;
        }
        let mut cause = Cause {
            found: NamedValue {
                value: threshold,
                ..found.clone()
            },
            stated,
        };
        if cause.makes_up(parameters) || !profiled.may_be(i, threshold) {
            return None;
        }
        let far = profiled.far_end(i, threshold)?;
        // As far to the near side, if not as stated.
        let best = profiled.value(i)?;
        let near = if profiled.may_be(i, stated) || (best - stated) * side < (far - best) * side {
            stated
        } else {
            2.0 * best - far
        };
        let (low, high) = (near.min(far), near.max(far));
        cause.found.value = 0.5 * (low + high);
        cause.found.standard_error = 0.5 * (high - low) / INTERVAL_95;
        Some(cause)
    })
}

/// What is weighed against the named model, and that model with what is doubted in it, each with and without what
/// is suspected.
fn readings<M: InParts>(
    measured: &M,
    mut weighed: Vec<Weighed>,
    [causes, doubted, suspected]: [&[Cause]; 3],
    (named, crossed): (&Confirmed, Crossed),
) -> Vec<Reading> {
    if weighed.is_empty() && suspected.is_empty() {
        return Vec::new();
    }
    for own in &mut weighed {
        own.causes.extend_from_slice(causes);
    }
    weighed.push(Weighed {
        causes: causes.iter().chain(doubted).cloned().collect(),
        effects: named.effects.clone(),
        crossed,
    });
    let tested = Part::LeftOut as usize;
    let origin = completed(measured, &measured.origin(), None, tested);
    let ranked = ranked(weighed, &all_errors(measured, &origin, tested));
    suspected.iter().fold(ranked, with_and_without)
}

/// The models of different effects among those `proposed`, fitted to all data, without effects that these do not show.
fn unnamed<M: InParts>(measured: &M, proposed: [&Point; 3]) -> Vec<Weighed> {
    let mut known = BTreeSet::from([BTreeSet::new()]);
    let weighed = proposed.into_iter().filter_map(|point| {
        let (found, deviations) = refit(measured, point, EVERYTHING)?;
        let refused = unfit(measured, &found.point, &deviations, EVERYTHING);
        let mut shown = found.point;
        shown
            .effects
            .retain(|(i, _)| refused.iter().all(|(gone, _)| gone != i));
        let own: BTreeSet<usize> = shown.effects.iter().map(|(i, _)| *i).collect();
        if !known.insert(own) {
            return None;
        }
        let crossed = Crossed::of(measured, &shown)?;
        Weighed::of(measured, &shown, crossed)
    });
    weighed.collect()
}

fn no_output(description: &Description) -> DescriptionError {
    DescriptionError::Description {
        path: description.path.clone(),
        what: "the nominal model gives no finite output on these data: check the values in \
            `nominal` (such as a mass of zero) and the units of `columns`"
            .to_owned(),
    }
}

/// Pairs of a rival and the effect that was taken, as told by the first of `parts` that asks for the effect.
fn rivals([first, second]: [&PartReport; 2]) -> Vec<(String, String)> {
    let asks = |effect: &str| first.effects.iter().any(|own| own.effect == effect);
    let more = second.rivals.iter().filter(|(_, against)| !asks(against));
    first.rivals.iter().chain(more).cloned().collect()
}

fn part_report<M: InParts>(measured: &M, fitted: Part, selected: &Selected) -> PartReport {
    let (own, tested) = (fitted as usize, fitted.other() as usize);
    // What belongs to a file and not to the rig is fitted there, for every model alike.
    let on_tested = |point: &Point| completed(measured, point, Some(own), tested);
    let origin = completed(measured, &measured.origin(), None, tested);
    let before = squares(&all_errors(measured, &origin, tested));
    let nominal = on_tested(&selected.nominal.point);
    let point = on_tested(&selected.extended.point);
    let refitted = all_errors(measured, &nominal, tested);
    let extended = all_errors(measured, &point, tested);
    let after = squares(&extended);
    let found = &selected.extended.point;
    let objections = unfit(measured, found, &selected.deviations, own);
    let mut effects = Vec::new();
    for (i, (effect, parameters)) in named_values(measured, found, &selected.deviations)
        .into_iter()
        .enumerate()
    {
        let without = on_tested(&selected.without[i].point);
        let without = squares(&all_errors(measured, &without, tested));
        let share = (without - after) / before;
        let objection = objections
            .iter()
            .find(|(index, _)| *index == found.effects[i].0)
            .map(|(_, reason)| reason.clone());
        let negative = || UNUSED.to_owned();
        effects.push(PartEffect {
            effect,
            parameters,
            confidence: confidence(selected.deviates[i]),
            share,
            objection: objection.or_else(|| (share <= 0.0).then(negative)),
        });
    }
    let name = |i: usize| measured.name(i);
    PartReport {
        nominal_error: measured.normalised_error(&origin, tested),
        refitted_error: measured.normalised_error(&nominal, tested),
        extended_error: measured.normalised_error(&point, tested),
        fitted_error: measured.normalised_error(found, own),
        gain_interval: gain_interval(&refitted, &extended),
        parameters: measured.parameters(found, &selected.deviations),
        effects,
        explained: 1.0 - after / before,
        rivals: selected
            .rivals
            .iter()
            .map(|r| (name(r.effect), name(r.against)))
            .collect(),
        point: found.clone(),
    }
}

/// Probability below `deviate` of Student's distribution with four degrees of freedom: two folds of two
/// parts tell how far it may be off, so that no confidence is that of a normal tail.
fn confidence(deviate: f64) -> f64 {
    // What is not known is as likely as not.
    let square = (4.0 / (1.0 + 4.0 / (deviate * deviate))).max(0.0);
    0.5 + 0.375 * square.sqrt().copysign(deviate) * (1.0 - square / 12.0)
}

impl RigDiagnosis {
    /// What the reader should know beside the verdict, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let aside = self.set_aside.iter();
        let aside = aside.map(|one| format!("`{}` is not named: {}", one.effect, one.reason));
        aside
            .chain(self.findings.iter().cloned())
            .chain(undetermined(&self.confirmed.effects))
            .collect()
    }

    /// What was found, in a sentence, and what else the data may mean.
    pub fn sentence(&self) -> String {
        let is_named = |name: &str| {
            let mut effects = self.confirmed.effects.iter();
            self.causes.iter().any(|own| own.found.name == name)
                || effects.any(|(own, _)| {
                    own == name || self.instead_of(own).any(|(rival, _)| rival == name)
                })
        };
        self.named_in_words() + &in_words(&self.readings, &is_named)
    }

    /// How sure the parts are of `named`, or of an effect that records cannot tell from it. Where neither part
    /// proposes one, as sure as its first value is of not being zero.
    pub(crate) fn confidence_and_share(
        &self,
        (named, values): &(String, Vec<NamedValue>),
    ) -> (f64, Option<f64>) {
        let parts = [&self.as_described, &self.swapped];
        let of = |name: &str| {
            let mut all = parts.iter().flat_map(|part| &part.effects);
            all.find(|one| one.effect == name)
        };
        let own = of(named).or_else(|| self.rivals_of(named).find_map(of));
        if let Some(own) = own {
            return (own.confidence, Some(own.share));
        }
        let first = values.first();
        let deviate = first.map_or(0.0, |own| (own.value / own.standard_error).abs());
        (confidence(deviate), None)
    }

    /// Effects that records cannot tell from `named`, with their parameters.
    fn instead_of(&self, named: &str) -> impl Iterator<Item = (&str, &[NamedValue])> {
        self.rivals_of(named).filter_map(move |rival| {
            let values = instead(&self.readings, named, rival)?;
            Some((rival, values))
        })
    }

    /// The names of what does nearly as well in the place of `named`.
    fn rivals_of(&self, named: &str) -> impl Iterator<Item = &str> {
        let rivals = self.as_described.rivals.iter();
        let own = rivals.filter(move |(_, against)| against == named);
        own.map(|(rival, _)| rival.as_str())
    }

    fn causes_in_words(&self) -> Vec<String> {
        let causes = self.causes.iter();
        let words = causes.map(|own| match own.or(&self.confirmed.parameters) {
            Some((_, other)) => format!("{} or {other}", own.words()),
            None => own.words(),
        });
        words.collect()
    }

    /// The named effects, each `with_values`, after what shows them.
    fn shown_in_words(&self, with_values: Vec<String>) -> Vec<String> {
        let names = self.confirmed.effects.iter().map(|(name, _)| name);
        let (one, every): (Vec<_>, Vec<_>) = names
            .zip(with_values)
            .partition(|(name, _)| self.confirmed.on_one_part.contains(name));
        let said = |begin: &str, all: Vec<(&String, String)>| {
            let all: Vec<String> = all.into_iter().map(|(_, words)| words).collect();
            (!all.is_empty()).then(|| format!("{begin} {}", joined(&all)))
        };
        let every = said("every part of the data shows", every);
        let one = said(
            "one part of the data, the other not reaching it, shows",
            one,
        );
        every.into_iter().chain(one).collect()
    }

    fn named_in_words(&self) -> String {
        let effects = self.confirmed.effects.iter();
        let with_values: Vec<String> = effects
            .map(|(name, values)| {
                let own = match self.sentences.get(name) {
                    Some(sentence) => in_own_words(sentence, values),
                    None => effect_in_words(name, values),
                };
                let others = self.instead_of(name);
                others.fold(own, |all, (rival, values)| {
                    format!("{all} or {}", effect_in_words(rival, values))
                })
            })
            .collect();
        let shown = self.shown_in_words(with_values);
        let part = &self.as_described;
        let falls = format!(
            "the error of {} on the held-out data falls from {:.1} to {:.1} %",
            self.output,
            100.0 * part.nominal_error,
            100.0 * self.confirmed.error
        );
        let name = &self.name;
        match self.verdict {
            Verdict::Adequate => format!(
                "{name}: the nominal model is adequate; refitted{}, its error of {} on the \
                 held-out data is {:.1} %.",
                if self.findings.is_empty() {
                    " within its uncertainty"
                } else {
                    ""
                },
                self.output,
                100.0 * part.refitted_error
            ),
            Verdict::Named => {
                let mut all = self.causes_in_words();
                all.extend(shown);
                let is_modelled = |own: &Cause| {
                    let mut parameters = self.confirmed.parameters.iter();
                    parameters.any(|p| p.name == own.found.name)
                };
                if self.confirmed.effects.is_empty() && !self.causes.iter().any(is_modelled) {
                    return format!(
                        "{name}: {}; the refitted model does not depend on it, and its error of {} on the held-out \
                         data is {:.1} %.",
                        joined(&all),
                        self.output,
                        100.0 * self.confirmed.error
                    );
                }
                let left = 1.0 - self.unexplained;
                let count = self.causes.len() + self.confirmed.effects.len();
                let share = match (count, left > ALL) {
                    _ if left <= 0.0 => {
                        return format!(
                            "{name}: {}; the error of {} on the held-out data, {:.1} %, is not theirs.",
                            joined(&all),
                            self.output,
                            100.0 * part.nominal_error
                        );
                    }
                    (1, true) => "that is all of the error".to_owned(),
                    (_, true) => "together they are all of the error".to_owned(),
                    (1, _) => format!("it explains {:.0} % of the squared error", 100.0 * left),
                    (..) => format!("they explain {:.0} % of the squared error", 100.0 * left),
                };
                format!("{name}: {}; {share}; {falls}.", joined(&all))
            }
            Verdict::Ambiguous => {
                let causes = self.causes_in_words();
                let causes = match causes.as_slice() {
                    [] => String::new(),
                    some => format!("{}; ", joined(some)),
                };
                let mut rivals: Vec<String> = Vec::new();
                for (own, _) in &self.confirmed.effects {
                    let is_shown =
                        |rival: &str| self.instead_of(own).any(|(shown, _)| shown == rival);
                    let all = self.rivals_of(own).filter(|rival| !is_shown(rival));
                    let all: Vec<&str> = all.collect();
                    if !all.is_empty() {
                        rivals.push(format!("{} instead of {own}", all.join(" or ")));
                    }
                }
                let nearly = match rivals.as_slice() {
                    [] => String::new(),
                    some => format!(", and {} explains it nearly as well", joined(some)),
                };
                let nearly = nearly.replace('_', " ");
                format!("{name}: {causes}{}{nearly}; {falls}.", shown.join(" and "))
            }
            Verdict::Unexplained if part.effects.is_empty() && self.swapped.effects.is_empty() => {
                format!(
                    "{name}: no effect improves the model, and the nominal model is not adequate: \
                     refitted, its error of {} \
                     on the held-out data is {:.1} %.",
                    self.output,
                    100.0 * part.refitted_error
                )
            }
            Verdict::TooSmall | Verdict::Unexplained => {
                let one = if part.effects.is_empty() {
                    &self.swapped
                } else {
                    part
                };
                let own = one.effects.iter();
                let own: Vec<String> = own
                    .map(|own| effect_in_words(&own.effect, &own.parameters))
                    .collect();
                format!(
                    "{name}: no effect is shown by every part of the data and improves the model on \
                     all of them; with {} of one part, the error of {} on the other falls from {:.1} to {:.1} %.",
                    joined(&own),
                    self.output,
                    100.0 * one.nominal_error,
                    100.0 * one.extended_error
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PartEffect, PartReport, Point, confidence, rivals};

    fn part(effects: &[&str], rivals: &[(&str, &str)]) -> PartReport {
        let effect = |name: &&str| PartEffect {
            effect: (*name).into(),
            parameters: Vec::new(),
            confidence: 1.0,
            share: 0.1,
            objection: None,
        };
        let rivals = rivals.iter();
        PartReport {
            nominal_error: 0.1,
            refitted_error: 0.1,
            extended_error: 0.01,
            fitted_error: 0.01,
            gain_interval: (0.9, 1.0),
            parameters: Vec::new(),
            effects: effects.iter().map(effect).collect(),
            explained: 0.9,
            rivals: rivals.map(|(a, b)| ((*a).into(), (*b).into())).collect(),
            point: Point::default(),
        }
    }

    #[test]
    fn the_first_part_that_asks_for_an_effect_tells_its_rivals() {
        let first = part(&["delay"], &[("valve_lag", "delay")]);
        let second = part(
            &["delay", "free_play"],
            &[("friction", "free_play"), ("dead_band", "delay")],
        );
        let pairs = |parts| rivals(parts).into_iter();
        let names: Vec<String> = pairs([&first, &second]).map(|(rival, _)| rival).collect();
        assert_eq!(names, ["valve_lag", "friction"]);
        let names: Vec<String> = pairs([&second, &first]).map(|(rival, _)| rival).collect();
        assert_eq!(names, ["friction", "dead_band"]);
    }

    /// Quantiles of Student's distribution with four degrees of freedom, from printed tables.
    #[test]
    fn a_confidence_is_that_of_four_degrees_of_freedom() {
        for (deviate, below) in [
            (-2.1318, 0.05),
            (0.0, 0.5),
            (0.7407, 0.75),
            (2.7764, 0.975),
            (f64::INFINITY, 1.0),
            (f64::NAN, 0.5),
        ] {
            let found = confidence(deviate);
            assert!((found - below).abs() < 1e-5, "{found} at {deviate}");
        }
    }
}
