//! Diagnosis of a case of the shake table: from folder to verdict, extended model and gain.

use std::collections::BTreeMap;

use plant::identified::effects::Effects;
use plant::identified::shake_table::ShakeTable;
use plant::sensors::instrumentation::Instrumentation;
use plant::specimens::linear::LinearSpecimen;

use super::command;
use super::course::{Course, courses};
use super::experiment::{self, SeparatingExperiment};
use super::friction::{by_cause, cause, note};
use super::gain::{Gain, gain};
use super::health::{RelationReport, health};
use super::left_over::{self, Residual};
use super::mains::{Line, line, readable};
use super::relations::{misfit, relations};
use super::sentence::{MOST, of_courses, of_findings, said, sentence};
use crate::case::{
    Case, CaseError, ControlLaw, Nominal, blind_spot, noise_ratios, problems,
    too_little_excitation, unstated_rail,
};
use crate::kinds::INTERVAL_95;
use crate::kinds::shake_table::catalogue::{Prepared, ShakeTableModel, TOO_LOUD, loudest};
use crate::kinds::shake_table::predictor::{Disturbance, Predictor, Samples, total};
use diagnosis::{ExtensibleModel, Judgement, NamedEffect, ParameterEstimate};
use diagnosis::{FLOOR, Observer, Point, Role, SUREST, Test, Verdict, WeighedModel, judge};
use recordings::{Channel, OUTPUT_NAMES, Recording};

/// Standard deviations by which an effect predicts an unseen record better, from which on it is there, even where its
/// parameters make up for each other.
const PROVEN: f64 = 3.0;

/// The effect of the mains in the catalogue.
const MAINS: &str = "mains_hum";

/// Standard deviations of what was stated beyond which a nominal parameter is a finding.
const SURPRISING: f64 = 2.0;

/// A channel whose noise is this many times what is stated is reported as loud.
const LOUD: f64 = 2.0;

/// The parameter set that the FMUs of table, specimen and instrumentation take, SI.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ExtendedModel {
    /// Actuator and table, nominal values corrected within their uncertainty.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
    /// The effects found.
    pub effects: Effects,
    /// The sensors' effects found.
    pub sensors: Instrumentation,
    /// Standard errors, SI: of the effects' parameters as `effect.parameter`, of the nominal ones
    /// by their names in [`PARAMETERS`](plant::identified::nominal::PARAMETERS).
    pub standard_errors: BTreeMap<String, f64>,
}

impl ExtendedModel {
    /// What was known before any diagnosis.
    pub fn known(nominal: &Nominal) -> Self {
        Self {
            shake_table: nominal.shake_table,
            specimen: nominal.specimen,
            effects: nominal.effects,
            sensors: nominal.sensors,
            standard_errors: BTreeMap::new(),
        }
    }
}

/// What an effect brings on the validation record: against the model without it, its other parameters
/// refitted under the same noises.
#[derive(Debug, Clone, PartialEq)]
pub struct Ablation {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Error without it, relative to the channels' standard deviations.
    pub without_nrmse: f64,
    /// And with it.
    pub with_nrmse: f64,
    /// Whitened error without it, in units of the noise floor.
    pub without_ratio: f64,
    /// And with it.
    pub with_ratio: f64,
    /// 95 % interval of the share of the error that it takes away, from a moving-block bootstrap.
    pub interval_95: [f64; 2],
    /// Standard deviations by which the likelihood of the record rises with it.
    pub deviations: f64,
}

/// A nominal parameter that the records put beyond two standard deviations of what was stated.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Finding {
    /// Its name.
    pub parameter: String,
    /// What was stated, SI.
    pub stated: f64,
    /// What the records say, SI.
    pub found: f64,
    /// One standard deviation of that.
    pub standard_error: f64,
    /// How far it is from what was stated, in standard deviations of that; absent where none is stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviations: Option<f64>,
    /// SI unit.
    pub unit: String,
}

/// What came out of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// One sentence for a laboratory engineer.
    pub sentence: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects, with estimates in SI.
    pub effects: Vec<NamedEffect>,
    /// Rival sets of effects.
    pub alternatives: Vec<Vec<&'static str>>,
    /// The experiment that would tell the first rival apart, or show more of what is not explained.
    pub separating_experiment: Option<SeparatingExperiment>,
    /// What the extended model brings on the validation record.
    pub gain: Gain,
    /// The extended model.
    pub extended_model: ExtendedModel,
    /// The effects in it: [`Self::effects`], and under `Unexplained` those that only help.
    pub modelled: Vec<NamedEffect>,
    /// The five relations on the identification record.
    pub relations: BTreeMap<&'static str, RelationReport>,
    /// Traces left over, strongest first.
    pub remaining: Vec<Test>,
    /// Share of the nominal model's excess error that the effects explain.
    pub share_explained: f64,
    /// All models that were weighed, the best first.
    pub candidates: Vec<WeighedModel>,
    /// Nominal parameters that are not what was stated.
    pub findings: Vec<Finding>,
    /// Effects that do not act throughout a record: those of the model, or of the first candidate where none is
    /// named.
    pub courses: Vec<Course>,
    /// What every effect brings by itself.
    pub ablations: Vec<Ablation>,
    /// Error of the nominal model as it was described, not refitted, on the validation record, in units of
    /// the noise floor.
    pub as_described: f64,
    /// What the reader should know: missing channels, a law that does not hold.
    pub notes: Vec<String>,
    /// The validation record before and after.
    pub validation: Validation,
}

/// One-step errors on the validation record, whitened: the noise alone has a deviation of one.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// Sampling period, s.
    pub period: f64,
    /// What acted and what was measured, SI.
    pub samples: Samples,
    /// Whether the command that acted follows from the readings by the stated law (R5), free of the
    /// recorder's noise, rather than the recorded one.
    pub by_law: bool,
    /// Errors of the nominal model, four channels a sample.
    pub before: Vec<f64>,
    /// Errors of the extended model.
    pub after: Vec<f64>,
}

/// Model and recordings of a case, after its checks; sentences on what is missing go to `notes`.
fn prepare(case: &Case, notes: &mut Vec<String>) -> Result<ShakeTableModel, CaseError> {
    let nominal = &case.nominal;
    let mut found: Vec<String> = case
        .recordings()
        .flat_map(|recording| problems(recording, nominal))
        .collect();
    if found.is_empty() {
        let to_be_moved = [&case.identification, &case.validation];
        let still = |recording: &&Recording| too_little_excitation(recording, nominal);
        found.extend(to_be_moved.iter().filter_map(still));
    }
    let (fitted, unseen) = (&case.identification, &case.validation);
    let is_same = |channel: &Channel| fitted.samples(*channel) == unseen.samples(*channel);
    if [Channel::ValveCommand, Channel::Displacement]
        .iter()
        .all(is_same)
    {
        found.push(format!(
            "{}: its samples are those of {}: expected a different record to test the model",
            unseen.name, fitted.name
        ));
    }
    let has = |recording: &Recording| {
        Channel::OUTPUTS.map(|channel| recording.channel(channel).is_some())
    };
    let present = has(&case.identification);
    for recording in case.recordings() {
        if found.is_empty() && has(recording) != present {
            found.push(format!(
                "{}: its channels differ from those of {}; check that both records are of one rig",
                recording.name, case.identification.name
            ));
        }
        let own = recording.notes.iter();
        notes.extend(own.map(|note| format!("{}: {note}", recording.name)));
        notes.extend(unstated_rail(recording, nominal));
    }
    if !found.is_empty() {
        return Err(CaseError::Unfit { problems: found });
    }
    let mut noise = nominal.noise;
    for (i, there) in present.into_iter().enumerate() {
        if !there {
            noise[i] = f64::INFINITY;
            notes.push(format!(
                "column `{}` is missing: {}",
                OUTPUT_NAMES[i],
                blind_spot(Channel::OUTPUTS[i])
            ));
        }
    }
    let mut records = Vec::new();
    let ordered = [
        Some((&case.identification, true)),
        case.small.as_ref().map(|recording| (recording, true)),
        case.baseline.as_ref().map(|recording| (recording, false)),
        Some((&case.validation, true)),
    ];
    for (recording, with_effects) in ordered.into_iter().flatten() {
        let by_law = command::by_stated_law(recording, nominal, notes);
        records.push(Prepared {
            name: recording.name.clone(),
            with_effects,
            by_law: by_law.is_some(),
            samples: match by_law {
                Some(command) => Samples::of(recording, command),
                None => Samples::of(
                    recording,
                    command::shown(recording, 1.0 / nominal.sample_rate),
                ),
            },
        });
    }
    Ok(ShakeTableModel::new(nominal, noise, records))
}

fn prediction(
    model: &ShakeTableModel,
    point: &Point,
    record: usize,
) -> Option<(Predictor, Vec<f64>)> {
    let rig = model.rig(point);
    let predictor = Predictor::design(&rig, model.period, &model.noise).ok()?;
    let samples = &model.records[record].samples;
    let mut out = vec![0.0; 4 * samples.len()];
    let sampled = predictor.sample(&rig).ok()?;
    predictor
        .innovations(&sampled, samples, &mut out)
        .then_some((predictor, out))
}

/// Diagnoses a case; `observer` receives the steps of the search.
///
/// # Errors
/// Records that would mislead, by record, column and place.
pub fn diagnose(case: &Case, observer: Observer<'_>) -> Result<Diagnosis, CaseError> {
    let unfit = |problem: &str| CaseError::Unfit {
        problems: vec![problem.into()],
    };
    let mut notes = Vec::new();
    let mut model = prepare(case, &mut notes)?;
    let relations = relations(&case.identification, &case.nominal);
    let of_validation = super::relations::relations(&case.validation, &case.nominal);
    for (recording, own) in [
        (&case.identification, &relations),
        (&case.validation, &of_validation),
    ] {
        if let Some(problem) = misfit(own) {
            return Err(unfit(&format!("{}: {problem}", recording.name)));
        }
    }
    let held_out = model.records.len() - 1;
    let fitted: Vec<usize> = (0..held_out).collect();
    let origin = Point {
        nuisance: vec![0.0; ExtensibleModel::nuisance(&model)],
        effects: Vec::new(),
    };
    let lost = || {
        unfit(
            "the nominal model gives no finite output on these records: check that its units and \
             those of the columns match",
        )
    };
    let mut judgement = judge(&mut model, &fitted, &[held_out], observer).ok_or_else(lost)?;
    let described = prediction(&model, &origin, held_out).ok_or_else(lost)?;
    let before = prediction(&model, &judgement.nominal, held_out).ok_or_else(lost)?;
    let mut doubts = at_their_ends(&model, &judgement.best.point);
    for doubt in at_their_ends(&model, &judgement.all.point) {
        if !doubts.contains(&doubt) {
            doubts.push(doubt);
        }
    }
    if judgement.verdict != Verdict::Unexplained {
        let effects = judgement.effects.iter().zip(&judgement.unseen_gains);
        let unproven = effects.filter(|(_, gain)| gain.is_none_or(|gain| gain < PROVEN));
        doubts.extend(unproven.filter_map(|(own, _)| indistinct(own)));
    }
    if !doubts.is_empty() || loudest(&model.noise, &model.stated_noise, model.period) > TOO_LOUD {
        judgement.verdict = Verdict::Unexplained;
    }
    notes.extend(doubts);
    notes.extend(noise_note(&model));
    let mains = mains(&model, &judgement);
    if let Some((named, _)) = &mains {
        match judgement.verdict {
            Verdict::Adequate | Verdict::Named => {
                judgement.verdict = Verdict::Named;
                judgement.effects.push(named.clone());
            }
            _ => notes.push(said(named)),
        }
    }
    let samples = &model.records[held_out].samples;
    let after = prediction(&model, &judgement.best.point, held_out).ok_or_else(lost)?;
    let compared = |own: &(Predictor, Vec<f64>)| {
        gain(
            samples,
            &OUTPUT_NAMES,
            (&own.0, &own.1),
            (&after.0, &after.1),
        )
    };
    let against = compared(&before);
    let ablations = judgement
        .effects
        .iter()
        .zip(&judgement.without)
        .zip(&judgement.unseen_gains)
        .filter_map(|((effect, without), deviations)| {
            let own = compared(&prediction(&model, without.as_ref()?, held_out)?);
            Some(Ablation {
                effect: by_cause(effect.clone()).effect,
                without_nrmse: own.before_nrmse,
                with_nrmse: own.after_nrmse,
                without_ratio: own.before_ratio,
                with_ratio: own.after_ratio,
                interval_95: own.interval_95,
                deviations: (*deviations)?,
            })
        })
        .collect();
    let as_described = compared(&described).before_ratio;
    let mut rig = model.rig(&judgement.all.point);
    if let Some((_, line)) = mains.filter(|_| judgement.verdict == Verdict::Named) {
        rig.sensors.acceleration.hum_amplitude = line.amplitude;
        rig.sensors.acceleration.hum_frequency = line.frequency;
    }
    let leads = |own: &&WeighedModel| own.explains > MOST;
    let followed = match judgement.verdict {
        Verdict::Unexplained => judgement
            .candidates
            .first()
            .filter(leads)
            .map(|own| &own.point),
        _ => Some(&judgement.all.point),
    };
    let courses = followed.map_or(Vec::new(), |point| courses(&model, point));
    let effects = readable(judgement.effects);
    let separating_experiment = case.nominal.controller.and_then(|law| {
        if judgement.verdict == Verdict::Unexplained {
            return unexplained(&model, &judgement.best.point, &law);
        }
        let rival = model.rig(judgement.rival_points.first()?);
        let noise = &case.nominal.noise;
        experiment::separate(&rig, &rival, &law, noise, model.period)
    });
    let fits_fitted = {
        let squares: f64 = judgement.best.residuals.iter().map(|r| r * r).sum();
        squares / (judgement.best.residuals.len().max(1) as f64)
    };
    if judgement.verdict == Verdict::Unexplained && fits_fitted < 1.03 && against.after_ratio > 1.2
    {
        notes.push(
            "the model explains the fitted records but not the validation record: check that the \
             records are of one rig"
                .into(),
        );
    }
    if judgement.verdict == Verdict::Unexplained {
        let ratios = noise_ratios(&case.identification, &case.nominal);
        for (channel, ratio) in OUTPUT_NAMES.iter().zip(ratios) {
            if let Some(ratio) = ratio.filter(|ratio| *ratio > LOUD) {
                notes.push(format!(
                    "the noise of `{channel}` is {ratio:.1} times the value in nominal.toml"
                ));
            }
        }
    }
    let standard_errors = effects
        .iter()
        .flat_map(|e| {
            e.parameters
                .iter()
                .map(|p| (format!("{}.{}", e.effect, p.name), p.standard_error))
        })
        .chain(
            model
                .nominal_rig()
                .parameters()
                .zip(&judgement.nuisance_errors)
                .map(|((parameter, value), error)| {
                    let error = value.abs() * model.uncertainty * error;
                    (parameter.name.to_string(), error)
                }),
        )
        .filter(|(_, error)| error.is_finite())
        .collect();
    notes.extend(note(&effects));
    let effects: Vec<NamedEffect> = effects.into_iter().map(by_cause).collect();
    for own in &mut judgement.candidates {
        let effects = std::mem::take(&mut own.effects);
        own.effects = effects.into_iter().map(by_cause).collect();
    }
    for set in &mut judgement.alternatives {
        set.iter_mut().for_each(|effect| *effect = cause(effect));
    }
    let findings: Vec<Finding> = model
        .nominal_rig()
        .parameters()
        .zip(&judgement.all.point.nuisance)
        .zip(&judgement.nuisance_errors)
        .filter(|((_, deviation), _)| deviation.abs() > SURPRISING)
        .map(|(((parameter, value), deviation), error)| {
            let found = value * (model.uncertainty * deviation).exp();
            Finding {
                parameter: parameter.name.to_string(),
                stated: value,
                found,
                standard_error: found.abs() * model.uncertainty * error,
                deviations: Some(*deviation),
                unit: parameter.unit().unwrap_or("1").to_string(),
            }
        })
        .collect();
    let sentence = sentence(
        judgement.verdict,
        &effects,
        &judgement.alternatives,
        &against,
        &judgement.tests,
        &judgement.candidates,
    ) + &of_courses(&courses)
        + &of_findings(&findings);
    Ok(Diagnosis {
        sentence,
        verdict: judgement.verdict,
        effects: if judgement.verdict == Verdict::Unexplained {
            Vec::new()
        } else {
            effects.clone()
        },
        modelled: effects,
        alternatives: judgement.alternatives,
        separating_experiment,
        gain: against,
        extended_model: ExtendedModel {
            shake_table: rig.shake_table,
            specimen: rig.specimen,
            effects: rig.effects,
            sensors: rig.sensors,
            standard_errors,
        },
        relations: health(
            case,
            &relations,
            &Nominal {
                shake_table: rig.shake_table,
                specimen: rig.specimen,
                ..case.nominal.clone()
            },
        ),
        remaining: judgement
            .tests
            .into_iter()
            .filter(|test| test.deviate > 3.5)
            .take(12)
            .collect(),
        share_explained: judgement.share_explained,
        candidates: judgement.candidates,
        findings,
        courses,
        ablations,
        as_described,
        notes,
        validation: Validation {
            period: model.period,
            samples: samples.clone(),
            by_law: model.records[held_out].by_law,
            before: before.1,
            after: after.1,
        },
    })
}

/// The motion that shows more of what the model at `point` does not explain.
fn unexplained(
    model: &ShakeTableModel,
    point: &Point,
    law: &ControlLaw,
) -> Option<SeparatingExperiment> {
    let records = model.records.iter().enumerate();
    let records = records.filter(|(_, record)| record.with_effects);
    let left: Vec<(&Samples, Vec<f64>)> = records
        .filter_map(|(place, record)| Some((&record.samples, prediction(model, point, place)?.1)))
        .collect();
    let residuals: Vec<Residual<'_>> = left
        .iter()
        .map(|(samples, whitened)| Residual { samples, whitened })
        .collect();
    left_over::probe(&model.rig(point), law, &residuals, model.period)
}

/// Effects whose size ran to the end of what is tried: no cause, but a nominal model of another rig.
fn at_their_ends(model: &ShakeTableModel, point: &Point) -> Vec<String> {
    let mut notes = Vec::new();
    for (index, internal) in &point.effects {
        let candidate = &ExtensibleModel::candidates(model)[*index];
        for (parameter, value) in candidate.parameters.iter().zip(candidate.values(internal)) {
            let (low, high) = parameter.bounds;
            let near = |end: f64| (value - end).abs() < 1e-3 * end.abs();
            if matches!(parameter.role, Role::Size { .. }) && (near(low) || near(high)) {
                let unit = Some(parameter.unit).filter(|unit| *unit != "1");
                notes.push(format!(
                    "{}.{} reached the limit of its plausible range, {value:.3}{}{}: check that \
                     nominal.toml belongs to this rig",
                    candidate.effect,
                    parameter.name,
                    unit.map_or("", |_| " "),
                    unit.unwrap_or_default()
                ));
            }
        }
    }
    notes
}

/// The mains on the accelerometer, where it is strong enough to matter and no effect of the model yet: its
/// phase differs from record to record, so that the noises follow it.
fn mains(model: &ShakeTableModel, judgement: &Judgement) -> Option<(NamedEffect, Line)> {
    if judgement.effects.iter().any(|own| own.effect == MAINS) {
        return None;
    }
    let mut candidates = ExtensibleModel::candidates(model).iter();
    let candidate = candidates.find(|candidate| candidate.effect == MAINS)?;
    let Role::Size { weak } = candidate.parameters.first()?.role else {
        return None;
    };
    let channel: Vec<Vec<f64>> = model
        .records
        .iter()
        .map(|record| record.samples.channels.iter().map(|row| row[1]).collect())
        .collect();
    let records: Vec<&[f64]> = channel.iter().map(Vec::as_slice).collect();
    let line = line(&records, model.period)?;
    let estimate = |name: &str, value, unit, standard_error, is_shape| ParameterEstimate {
        name: name.into(),
        value,
        unit,
        standard_error,
        is_shape,
    };
    let resolution = line.standard_error
        / line.amplitude
        / model.period
        / channel.iter().map(Vec::len).max()? as f64;
    let named = NamedEffect {
        effect: candidate.effect,
        parameters: vec![
            estimate(
                "amplitude",
                line.amplitude,
                "m/s^2",
                line.standard_error,
                false,
            ),
            estimate("frequency", line.frequency, "Hz", resolution, true),
        ],
        confidence: SUREST,
    };
    (line.amplitude > FLOOR * weak).then_some((named, line))
}

/// What speaks against naming `effect`: an interval of 95 % that holds zero for everything that says how
/// strong it is.
fn indistinct(effect: &NamedEffect) -> Option<String> {
    let mut sizes = effect.parameters.iter().filter(|p| !p.is_shape).peekable();
    sizes.peek()?;
    sizes
        .all(|size| size.value.abs() < INTERVAL_95 * size.standard_error)
        .then(|| {
            format!(
                "{} would improve the fit, but on all records its size does not differ from zero",
                effect.effect
            )
        })
}

/// The noises that were learned, where they are not those that were stated.
fn noise_note(model: &ShakeTableModel) -> Option<String> {
    let noise = &model.noise;
    if *noise == model.stated_noise {
        return None;
    }
    let mut sensors = Vec::new();
    for (i, name) in OUTPUT_NAMES.iter().enumerate() {
        let stated = model.stated_noise.white[i];
        if !stated.is_finite() {
            continue;
        }
        let size = noise.of_channel(i) / stated;
        let parts = described(&noise.coloured[i], model.period, |sigma| {
            format!("{:.2}", sigma / stated)
        });
        sensors.push(format!("{name} {size:.2}{parts}"));
    }
    let parts = described(&noise.unseen, model.period, |sigma| {
        format!("{:.1} mV", 1e3 * sigma)
    });
    Some(format!(
        "noise in the records: {:.1} mV added to the command{parts}; sensors relative to the stated \
         noise: {}",
        1e3 * total(&noise.unseen),
        sensors.join(", ")
    ))
}

/// The parts of a noise, each with its size and where it lies.
fn described(parts: &[Disturbance], period: f64, size: impl Fn(f64) -> String) -> String {
    let parts: Vec<String> = parts
        .iter()
        .map(|part| {
            let own = size(part.sigma);
            match part.frequency(period) {
                Some(frequency) => format!("{own} at {frequency:.1} Hz"),
                None => format!("{own} below {:.2} Hz", part.corner(period)),
            }
        })
        .collect();
    if parts.is_empty() {
        String::new()
    } else {
        format!(" ({})", parts.join(", "))
    }
}
