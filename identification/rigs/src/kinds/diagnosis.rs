//! The diagnosis of a rig on real data.

use std::cell::LazyCell;
use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::alternatives::{
    Item, least_needed, nearly_without, of_its_class, proposals, replaced, simplest,
};
use super::cause::Cause;
use super::causes::{FAR, Standing, causes};
use super::confirmed::{
    Confirmed, NEAR, NominalFits, Refused, TOO_SMALL, agrees, confirm, is_vital, unfit,
};
use super::measured::Measured;
use super::named_value::NamedValue;
use super::part_report::{PartEffect, PartReport, UNUSED, part_report, rivals};
use super::parts::{EVERYTHING, InParts, LOST, Part};
use super::readings::{Crossed, Reading, Weighed, ranked, with_and_without};
use super::{Description, DescriptionError, Measurement};
use diagnosis::{
    Observer, Point, Progress, Simulated, Verdict, all_errors, completed, refit, select,
    select_jointly,
};

/// Share of the described model's error that is left, in both parts, where a nominal parameter that is far from what
/// was stated is a cause although the errors do not agree.
const MOST: f64 = 0.5;
/// Error of a model with effects over that of one without, below which its nominal parameters count for more.
const RICHER: f64 = 0.7;
/// Why an effect is not named that the data do not need for sure.
const DOUBTED: &str = "the prediction of either part is hardly worse without it";
/// Why an effect is not named where what one part finds predicts the data far better.
const BEHIND: &str = "models of other effects predict either part far better";
/// Squared error of a prediction over that of what one part alone found from which on it is far worse, and logarithm of
/// how much likelier a model must be to be believed against it.
const WORSE: f64 = 4.0;
const LIKELIER: f64 = 3.0;
/// Error on all data over that of a model with more nominal parameters, up to which it does as well.
const AS_WELL: f64 = 1.02;
/// Error of a model, over the output, that leaves nothing to doubt in how the output is measured.
const SMALL: f64 = 0.05;
/// Share of the described model's squared error that is nothing to explain.
const NOTHING: f64 = 1e-3;

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
        if without.leaves_nothing() || !crossed.needs(&errors) {
            without.widen_to(&with_all);
            (confirmed, crossed, refused, findings) = (without, errors, reasons, own);
        }
    }
    // What is written may be far worse than what one part found alone.
    let proposed = [&start.point, &as_described.point, &swapped.point];
    let refitted = LazyCell::new(|| proposed.map(|point| refit(measured, point, EVERYTHING)));
    let alone = || match observer.is_over() {
        true => Vec::new(),
        false => unnamed(measured, &*refitted),
    };
    let is_behind = |own: f64, alone: &PartReport| {
        own > NEAR && own.powi(2) > WORSE * alone.extended_error.powi(2)
    };
    let mut found_alone = None;
    if !confirmed.effects.is_empty()
        && (is_behind(confirmed.error, &as_described)
            || is_behind(confirmed.swapped_error, &swapped))
    {
        let mut others = alone();
        let is_far = |own: &Weighed| own.crossed.likelier_than(&crossed) > LIKELIER;
        if others.iter().any(is_far) {
            weighed.extend(Weighed::of(measured, &confirmed.point, crossed));
            let mut bare = confirmed.point.clone();
            let gone = bare.effects.drain(..);
            refused.extend(gone.map(|(i, _)| (i, BEHIND.to_owned())));
            findings.clear();
            confirmed = confirm(measured, &nominal, &bare, &mut refused, &mut findings)?;
            crossed = Crossed::of(measured, &confirmed.point)?;
            weighed.append(&mut others);
        }
        found_alone = Some(others);
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
    let standing = Standing { holds, explains };
    let mut found = causes(measured, &mut confirmed, &crossed, standing, observer);
    // A model that lacks an effect bends towards it, and so does a zero: an asymmetry moves the middle of the motion.
    if confirmed.effects.is_empty() && !holds && !found.named.is_empty() && !observer.is_over() {
        for richer in richer(measured, &*refitted, confirmed.fitted_error) {
            found.doubt(measured, &richer);
        }
    }
    weighed.extend(found.weighed);
    // What sensors tell alone they tell better than a model in which others make up for it.
    let is_open = |own: &Cause| !measured.is_read(&own.found.name);
    let [mut causes, mut suspected] = [found.named, found.suspected]
        .map(|all| all.into_iter().filter(is_open).collect::<Vec<Cause>>());
    // Of records that no model explains, sensors tell less too.
    let is_explained = confirmed.fitted_error < NEAR;
    let tells = holds || explains || leaves_little || is_explained;
    let (clear, unclear): (Vec<Cause>, Vec<Cause>) = measured
        .contradictions()
        .into_iter()
        .filter(|cause| tells || cause.deviations() > FAR)
        .partition(Cause::is_clear);
    causes.extend(clear);
    suspected.splice(0..0, unclear);
    let leaves_nothing = confirmed.leaves_nothing();
    let is_answered = !confirmed.effects.is_empty() || !causes.is_empty() || leaves_nothing;
    // What was found and is not named is ranked.
    if !is_answered {
        weighed.extend(found_alone.unwrap_or_else(alone));
    }
    let told = [&causes[..], &found.doubted, &suspected];
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

/// A model that was proposed, fitted to all data, with standard deviations.
type Refitted = Option<(Simulated, Vec<f64>)>;

/// Nominal parameters of the models with effects among those `refitted` that leave far less than `error`.
fn richer<M: InParts>(measured: &M, refitted: &[Refitted], error: f64) -> Vec<Vec<NamedValue>> {
    let leaves = |point: &Point| measured.normalised_error(point, EVERYTHING);
    let all = refitted.iter().flatten();
    let with_effects = all.filter(|(found, _)| !found.point.effects.is_empty());
    let better = with_effects.filter(|(found, _)| leaves(&found.point) < RICHER * error);
    better
        .map(|(found, deviations)| measured.parameters(&found.point, deviations))
        .collect()
}

/// The models of different effects among those `refitted`, without effects that all data do not show.
fn unnamed<M: InParts>(measured: &M, refitted: &[Refitted]) -> Vec<Weighed> {
    let mut known = BTreeSet::from([BTreeSet::new()]);
    let weighed = refitted.iter().flatten().filter_map(|(found, deviations)| {
        let refused = unfit(measured, &found.point, deviations, EVERYTHING);
        let mut shown = found.point.clone();
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
