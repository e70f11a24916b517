//! The report of a diagnosis: what is printed as JSON, written, drawn and handed on.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize};

use super::kinds::shake_table::experiment::SeparatingExperiment;
use super::kinds::shake_table::{self, Course, Finding, RelationReport};
use super::kinds::{Cause, NamedValue, Reading, RigDiagnosis};
use diagnosis::{NamedEffect, Part, Test, Verdict, WeighedModel};

/// Confidence of a parameter that is beyond its interval of 95 % and beyond what was stated.
const CLEAR_CAUSE: f64 = 0.95;

/// A diagnosis of a case or of a rig; SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisReport {
    /// One sentence.
    pub sentence: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The effects.
    pub effects: Vec<EffectReport>,
    /// Rival sets of effects.
    pub alternatives: Vec<Vec<String>>,
    /// The experiment that would tell the first rival apart, or show more of what is not explained.
    pub separating_experiment: Option<String>,
    /// Its motion, as `run --reference` plays it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separating_motion: Option<PathBuf>,
    /// What the extended model brings on data that were not fitted.
    pub gain: GainReport,
    /// Where the extended model was written.
    pub extended_model: Option<PathBuf>,
    /// The FMU (3.0) with the first of the effects.
    pub extended_fmu: Option<PathBuf>,
    /// All FMUs of the extended model.
    pub extended_fmus: Vec<PathBuf>,
    /// All models that were weighed, the best first, also where none is named.
    #[serde(default)]
    pub candidates: Vec<CandidateReport>,
    /// Nominal parameters beyond two standard deviations of what was stated.
    #[serde(default)]
    pub findings: Vec<Finding>,
    /// Effects that do not act throughout a record.
    #[serde(default)]
    pub courses: Vec<Course>,
    /// Where more than noise is left.
    #[serde(default)]
    pub left: Vec<LeftReport>,
    /// Whether a time limit ended the search before its end.
    #[serde(default)]
    pub time_limit_reached: bool,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// What the verdict rests on.
    #[serde(flatten)]
    pub evidence: Evidence,
    /// Time taken, s.
    pub wall_s: f64,
}

/// What a verdict rests on, which differs with the noise that a right model leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Evidence {
    /// White innovations.
    ShakeTable(ShakeTableEvidence),
    /// Correlated errors of a simulation.
    Rig(Box<RigEvidence>),
}

/// What a verdict on a case rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShakeTableEvidence {
    /// The gain in closed-loop co-simulation through the FMUs.
    pub co_simulation: Option<GainReport>,
    /// The relations R1 to R5 on the identification record.
    pub relations: BTreeMap<String, RelationReport>,
    /// Traces left over, strongest first, as normal deviates.
    pub remaining: Vec<(String, f64)>,
    /// Share of the nominal model's excess error that the effects explain.
    pub share_explained: f64,
}

/// What a verdict on a rig rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigEvidence {
    /// Share of the nominal model's squared error on the held-out data that stays unexplained.
    pub unexplained_share: f64,
    /// What each part of the data says, tested on the other.
    pub rig: RigDiagnosis,
}

/// A model that was weighed against others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateReport {
    /// Its effects.
    pub effects: Vec<String>,
    /// Posterior share among the models weighed, 0 to 1.
    pub weight: f64,
    /// Its effects' parameters, as `effect.parameter`.
    pub parameters: BTreeMap<String, ParameterReport>,
    /// Share of the nominal model's excess error that it explains, %.
    pub explains_percent: f64,
}

/// Where more than noise is left: a band or a part of a record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftReport {
    /// The channel; none where all were looked at together.
    pub channel: Option<String>,
    /// From and to this frequency, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band_hz: Option<[f64; 2]>,
    /// From and to this time, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<[f64; 2]>,
    /// Root mean square error there, in units of the noise floor.
    pub over_floor: f64,
}

/// What an effect brings by itself, on data that were not fitted: against the model without it, refitted
/// under the same noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectGain {
    /// Error without it, relative to the variation of what was measured.
    pub without_nrmse: f64,
    /// And with it.
    pub with_nrmse: f64,
    /// Error without it in units of the noise floor.
    #[serde(default)]
    pub without_ratio: f64,
    /// And with it.
    #[serde(default)]
    pub with_ratio: f64,
    /// Standard deviations by which the likelihood of the data rises with it.
    #[serde(default)]
    pub deviations: f64,
    /// 95 % interval of the share of the error that it takes away.
    pub interval_95: [f64; 2],
}

/// An effect in a [`DiagnosisReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectReport {
    /// Its name in the catalogue.
    pub effect: String,
    /// Its parameters by name.
    pub parameters: BTreeMap<String, ParameterReport>,
    /// 0 to 1.
    pub confidence: f64,
    /// Of a rig: by how much the squared error on unseen data grows without it, as a share of the
    /// nominal model's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share_explained: Option<f64>,
    /// Of a rig: whether every part of the data shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_every_part: Option<bool>,
    /// What it brings by itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<EffectGain>,
}

/// A parameter in an [`EffectReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterReport {
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: String,
    /// One standard deviation; not a number where it is unknown.
    #[serde(deserialize_with = "or_not_a_number")]
    pub standard_error: f64,
}

/// What the extended model brings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainReport {
    /// Error over the variation of what was measured, nominal; of a case the root mean square over
    /// its channels.
    pub before_nrmse: f64,
    /// The same for the extended model.
    pub after_nrmse: f64,
    /// The same for a perfect model, where the sensors' noise is known.
    pub noise_floor_nrmse: Option<f64>,
    /// 95 % interval of the share of the error that is gone.
    #[serde(deserialize_with = "ends_or_not_a_number")]
    pub interval_95: (f64, f64),
    /// What exactly the interval is of, where it is not that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_of: Option<String>,
    /// The data, which were not fitted.
    pub record: String,
    /// By channel and against the noise, of a case.
    #[serde(flatten)]
    pub against_noise: Option<GainAgainstNoise>,
}

/// A gain where the noise of every channel is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainAgainstNoise {
    /// Error before, in units of the noise floor.
    pub before_ratio: f64,
    /// And after.
    pub after_ratio: f64,
    /// By channel: before, after, floor.
    pub channels: BTreeMap<String, [f64; 3]>,
}

/// JSON has no word for what is not a number but `null`.
pub(super) fn or_not_a_number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

/// As [`or_not_a_number`], two of them.
pub(super) fn ends_or_not_a_number<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<(f64, f64), D::Error> {
    let (low, high): (Option<f64>, Option<f64>) = Deserialize::deserialize(from)?;
    Ok((low.unwrap_or(f64::NAN), high.unwrap_or(f64::NAN)))
}

impl From<&NamedEffect> for EffectReport {
    fn from(named: &NamedEffect) -> Self {
        let parameters = named.parameters.iter().map(|p| {
            let report = ParameterReport {
                value: p.value,
                unit: p.unit.to_owned(),
                standard_error: p.standard_error,
            };
            (p.name.clone(), report)
        });
        Self {
            effect: named.effect.to_owned(),
            parameters: parameters.collect(),
            confidence: named.confidence,
            share_explained: None,
            on_every_part: None,
            gain: None,
        }
    }
}

impl From<&NamedValue> for ParameterReport {
    fn from(own: &NamedValue) -> Self {
        Self {
            value: own.value,
            unit: own.unit.clone(),
            standard_error: own.standard_error,
        }
    }
}

impl From<&Cause> for EffectReport {
    fn from(cause: &Cause) -> Self {
        let own = &cause.found;
        let report = ParameterReport::from(own);
        Self {
            effect: own.name.clone(),
            parameters: BTreeMap::from([(own.name.clone(), report)]),
            confidence: CLEAR_CAUSE,
            share_explained: None,
            on_every_part: None,
            gain: None,
        }
    }
}

impl From<&Cause> for Finding {
    fn from(cause: &Cause) -> Self {
        let own = &cause.found;
        Self {
            parameter: own.name.clone(),
            stated: cause.stated,
            found: own.value,
            standard_error: own.standard_error,
            deviations: None,
            unit: own.unit.clone(),
        }
    }
}

impl EffectReport {
    fn with_gain(named: &NamedEffect, ablations: &[shake_table::Ablation]) -> Self {
        let own = ablations.iter().find(|own| own.effect == named.effect);
        Self {
            gain: own.map(|own| EffectGain {
                without_nrmse: own.without_nrmse,
                with_nrmse: own.with_nrmse,
                without_ratio: own.without_ratio,
                with_ratio: own.with_ratio,
                deviations: own.deviations,
                interval_95: own.interval_95,
            }),
            ..named.into()
        }
    }
}

impl From<&WeighedModel> for CandidateReport {
    fn from(model: &WeighedModel) -> Self {
        let mut parameters = BTreeMap::new();
        for own in &model.effects {
            for (name, parameter) in EffectReport::from(own).parameters {
                parameters.insert(format!("{}.{name}", own.effect), parameter);
            }
        }
        Self {
            effects: model
                .effects
                .iter()
                .map(|own| own.effect.to_owned())
                .collect(),
            weight: model.weight,
            parameters,
            explains_percent: 100.0 * model.explains,
        }
    }
}

impl From<&Reading> for CandidateReport {
    fn from(own: &Reading) -> Self {
        let causes = own.causes.iter().map(|cause| &cause.found);
        let effects = own.effects.iter();
        let of_effects = effects.clone().flat_map(|(name, values)| {
            let values = values.iter();
            values.map(move |p| (format!("{name}.{}", p.name), ParameterReport::from(p)))
        });
        Self {
            effects: causes
                .clone()
                .map(|value| &value.name)
                .chain(effects.map(|(name, _)| name))
                .cloned()
                .collect(),
            weight: own.weight,
            parameters: causes
                .map(|value| (value.name.clone(), ParameterReport::from(value)))
                .chain(of_effects)
                .collect(),
            explains_percent: 100.0 * own.explains,
        }
    }
}

impl LeftReport {
    fn of(test: &Test, period: f64) -> Option<Self> {
        let place = test.place.as_ref()?;
        let (band_hz, time_s) = match place.part {
            Part::Whole => return None,
            Part::Band(low, high) => (Some([low / period, high / period]), None),
            Part::Samples(from, to) => (None, Some([from as f64 * period, to as f64 * period])),
        };
        Some(Self {
            channel: place.channel.clone(),
            band_hz,
            time_s,
            over_floor: place.over_floor,
        })
    }
}

impl From<&shake_table::gain::Gain> for GainReport {
    fn from(gain: &shake_table::gain::Gain) -> Self {
        let channels = gain.channels.iter();
        Self {
            before_nrmse: gain.before_nrmse,
            after_nrmse: gain.after_nrmse,
            noise_floor_nrmse: Some(gain.noise_floor_nrmse),
            interval_95: gain.interval_95.into(),
            interval_of: None,
            record: "validation".to_owned(),
            against_noise: Some(GainAgainstNoise {
                before_ratio: gain.before_ratio,
                after_ratio: gain.after_ratio,
                channels: channels
                    .map(|c| (c.channel.to_owned(), [c.before, c.after, c.floor]))
                    .collect(),
            }),
        }
    }
}

impl From<&shake_table::Diagnosis> for DiagnosisReport {
    fn from(found: &shake_table::Diagnosis) -> Self {
        let owned = |set: &Vec<&str>| set.iter().map(ToString::to_string).collect();
        let relations = found.relations.iter();
        Self {
            sentence: found.sentence.clone(),
            verdict: found.verdict,
            effects: found
                .effects
                .iter()
                .map(|own| EffectReport::with_gain(own, &found.ablations))
                .collect(),
            alternatives: found.alternatives.iter().map(owned).collect(),
            separating_experiment: found
                .separating_experiment
                .as_ref()
                .map(SeparatingExperiment::sentence),
            separating_motion: None,
            gain: (&found.gain).into(),
            extended_model: None,
            extended_fmu: None,
            extended_fmus: Vec::new(),
            candidates: found.candidates.iter().map(CandidateReport::from).collect(),
            findings: found.findings.clone(),
            courses: found.courses.clone(),
            left: found
                .remaining
                .iter()
                .filter_map(|test| LeftReport::of(test, found.validation.period))
                .collect(),
            time_limit_reached: false,
            notes: found.notes.clone(),
            evidence: Evidence::ShakeTable(ShakeTableEvidence {
                co_simulation: None,
                relations: relations
                    .map(|(name, r)| ((*name).to_owned(), *r))
                    .collect(),
                remaining: found
                    .remaining
                    .iter()
                    .map(|test| (test.what.clone(), test.deviate))
                    .collect(),
                share_explained: found.share_explained,
            }),
            wall_s: 0.0,
        }
    }
}

impl From<&RigDiagnosis> for DiagnosisReport {
    fn from(found: &RigDiagnosis) -> Self {
        let part = &found.as_described;
        let confirmed = &found.confirmed;
        let effect = |own: &(String, Vec<NamedValue>)| {
            let (name, values) = own;
            let parameters = values
                .iter()
                .map(|p| (p.name.clone(), ParameterReport::from(p)));
            let (confidence, share_explained) = found.confidence_and_share(own);
            EffectReport {
                effect: name.clone(),
                parameters: parameters.collect(),
                confidence,
                share_explained,
                on_every_part: Some(!confirmed.on_one_part.contains(name)),
                gain: None,
            }
        };
        let rivals = part.rivals.iter();
        Self {
            sentence: found.sentence(),
            verdict: found.verdict,
            effects: found
                .causes
                .iter()
                .map(EffectReport::from)
                .chain(confirmed.effects.iter().map(effect))
                .collect(),
            alternatives: rivals
                .map(|(rival, _)| rival.as_str())
                .chain(
                    (found.causes.iter())
                        .filter_map(|own| own.or(&confirmed.parameters).map(|(name, _)| name)),
                )
                .map(|name| vec![name.to_owned()])
                .collect(),
            separating_experiment: None,
            separating_motion: None,
            gain: GainReport {
                before_nrmse: part.nominal_error,
                after_nrmse: confirmed.error,
                noise_floor_nrmse: None,
                interval_95: confirmed.gain_interval,
                interval_of: Some(
                    "share of the refitted model's squared error that the effects explain".into(),
                ),
                record: "left out".to_owned(),
                against_noise: None,
            },
            extended_model: None,
            extended_fmu: None,
            extended_fmus: Vec::new(),
            candidates: found.readings.iter().map(CandidateReport::from).collect(),
            findings: found.causes.iter().map(Finding::from).collect(),
            courses: Vec::new(),
            left: Vec::new(),
            time_limit_reached: false,
            notes: found.notes(),
            evidence: Evidence::Rig(Box::new(RigEvidence {
                unexplained_share: found.unexplained,
                rig: found.clone(),
            })),
            wall_s: 0.0,
        }
    }
}
