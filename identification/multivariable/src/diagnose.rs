//! Diagnosis: which fault, of which actuator, explains what a model of the healthy rig does not.

use serde::Serialize;

use crate::description::Pins;
use crate::residuals::Case;
use crate::{Error, Model, Recording};

/// A fault that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// The fault's name.
    pub effect: String,
    /// Its actuators, from 1.
    pub actuators: Vec<usize>,
    /// Its parameter; none for a swap.
    pub value: Option<f64>,
    /// SI unit of the parameter.
    pub unit: String,
    /// One standard error.
    pub standard_error: Option<f64>,
    /// In words.
    pub words: String,
}

/// Verdict of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The model explains the recording.
    Adequate,
    /// A fault is named.
    Named,
    /// Several faults explain the recording alike.
    Ambiguous,
    /// No fault of the catalogue explains it.
    Unexplained,
}

/// Result of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in words.
    pub sentence: String,
    /// The faults.
    pub effects: Vec<Found>,
    /// Faults that explain nearly as much as the first one.
    pub alternatives: Vec<Found>,
    /// What is compared: strokes, then strokes against the joint.
    pub channels: Vec<String>,
    /// Root mean square of each channel's residual over its noise, with the model.
    pub before: Vec<f64>,
    /// The same with the faults.
    pub after: Vec<f64>,
}

/// Mean square over noise of a channel above which the model does not explain it.
pub(crate) const EXPLAINED: f64 = 1.3;

/// Diagnoses recordings of a rig whose healthy state is `model`. `pins` are used where the joint was measured.
///
/// # Errors
/// A recording whose actuators or sampling period are not those of the model.
pub fn diagnose(model: &Model, pins: &Pins, recordings: &[Recording]) -> Result<Diagnosis, Error> {
    for recording in recordings {
        let refused = |what: String| Err(Error::at(recording.name.clone(), what));
        if recording.commands.len() != model.actuators() {
            return refused(format!(
                "{} actuators, but the model has {}; expected recordings of the same rig",
                recording.commands.len(),
                model.actuators()
            ));
        }
        let off = (recording.period / model.period_s - 1.0).abs();
        if off > 1e-3 {
            return refused(format!(
                "a sample every {:.4e} s, but the model was identified at {:.4e} s; expected the same sampling",
                recording.period, model.period_s
            ));
        }
    }
    let mut case = Case {
        model,
        pins,
        recordings,
        noise: Vec::new(),
    };
    case.noise = case.noise();
    Ok(case.search())
}

/// The verdict in words.
pub(crate) fn sentence(
    verdict: Verdict,
    effects: &[Found],
    alternatives: &[Found],
    after: &[f64],
) -> String {
    let words = |all: &[Found]| {
        all.iter()
            .map(|own| own.words.as_str())
            .collect::<Vec<_>>()
            .join(" and ")
    };
    let largest = after.iter().copied().fold(0.0, f64::max);
    match verdict {
        Verdict::Adequate => "The model explains the recordings; no fault is found.".into(),
        Verdict::Unexplained => format!(
            "No fault of the catalogue explains the recordings: the residual is up to {largest:.1} times the noise."
        ),
        Verdict::Ambiguous => {
            let mut others: Vec<&str> = alternatives.iter().map(|own| own.words.as_str()).collect();
            others.truncate(3);
            format!(
                "Several faults explain the recordings alike: {}, or {}.",
                words(effects),
                others.join(", or ")
            )
        }
        Verdict::Named => {
            let rest = match largest > EXPLAINED.sqrt() {
                true => format!(" A residual of up to {largest:.1} times the noise is left."),
                false => String::new(),
            };
            let mut text = words(effects);
            if let Some(first) = text.get(..1).map(str::to_uppercase) {
                text.replace_range(..1, &first);
            }
            format!("{text}.{rest}")
        }
    }
}
