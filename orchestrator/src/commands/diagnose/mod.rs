//! `diagnose`: what the nominal model of a case gets wrong, why, and what knowing it brings.

mod page;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use identification::case::{Case, CaseError};
use identification::diagnosis::shake_table::{self, Diagnosis};
use serde::Serialize;

use crate::error::Error;
use crate::report;
use crate::results::Results;

/// File with the extended model, in the folder of `--out`.
pub const EXTENDED_MODEL: &str = "extended_model.toml";
/// File with the report, in the folder of `--out`.
pub const REPORT: &str = "report.html";

/// The JSON object of `diagnose`; SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiagnosisReport {
    /// One sentence.
    pub sentence: String,
    /// `adequate`, `named`, `ambiguous` or `unexplained`.
    pub verdict: &'static str,
    /// The effects.
    pub effects: Vec<EffectReport>,
    /// Rival sets of effects.
    pub alternatives: Vec<Vec<&'static str>>,
    /// The experiment that would tell the first rival apart.
    pub separating_experiment: Option<String>,
    /// What the extended model brings.
    pub gain: GainReport,
    /// Where the extended model was written.
    pub extended_model: Option<PathBuf>,
    /// Where its FMU was written.
    pub extended_fmu: Option<PathBuf>,
    /// Errors of the relations R1 to R5 in units of the sensors' noise, nominal model.
    pub relations: BTreeMap<&'static str, f64>,
    /// Traces left over, strongest first, as normal deviates.
    pub remaining: Vec<(String, f64)>,
    /// Share of the nominal model's excess error that the effects explain.
    pub share_explained: f64,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// Time taken, s.
    pub wall_s: f64,
}

/// An effect in [`DiagnosisReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectReport {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Its parameters by name.
    pub parameters: BTreeMap<String, ParameterReport>,
    /// 0 to 1.
    pub confidence: f64,
}

/// A parameter in [`EffectReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterReport {
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// One standard deviation.
    pub standard_error: f64,
}

/// The gain in [`DiagnosisReport`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainReport {
    /// Root mean square over the channels of their one-step errors over their variation, nominal.
    pub before_nrmse: f64,
    /// The same for the extended model.
    pub after_nrmse: f64,
    /// The same for a perfect model.
    pub noise_floor_nrmse: f64,
    /// 95 % interval of the share of the error that is gone.
    pub interval_95: [f64; 2],
    /// The record, which was not fitted.
    pub record: &'static str,
    /// Whitened error before, in units of the noise floor.
    pub before_ratio: f64,
    /// And after.
    pub after_ratio: f64,
    /// By channel: before, after, floor.
    pub channels: BTreeMap<&'static str, [f64; 3]>,
}

impl DiagnosisReport {
    fn new(diagnosis: &Diagnosis, extended_model: Option<PathBuf>, wall_s: f64) -> Self {
        let gain = &diagnosis.gain;
        Self {
            sentence: diagnosis.sentence.clone(),
            verdict: diagnosis.verdict.word(),
            effects: diagnosis
                .effects
                .iter()
                .map(|effect| EffectReport {
                    effect: effect.effect,
                    parameters: effect
                        .parameters
                        .iter()
                        .map(|p| {
                            let report = ParameterReport {
                                value: p.value,
                                unit: p.unit,
                                standard_error: p.standard_error,
                            };
                            (p.name.clone(), report)
                        })
                        .collect(),
                    confidence: effect.confidence,
                })
                .collect(),
            alternatives: diagnosis.alternatives.clone(),
            separating_experiment: diagnosis.separating_experiment.clone(),
            gain: GainReport {
                before_nrmse: gain.before_nrmse,
                after_nrmse: gain.after_nrmse,
                noise_floor_nrmse: gain.noise_floor_nrmse,
                interval_95: gain.interval_95,
                record: "validation",
                before_ratio: gain.before_ratio,
                after_ratio: gain.after_ratio,
                channels: gain
                    .channels
                    .iter()
                    .map(|c| (c.channel, [c.before, c.after, c.floor]))
                    .collect(),
            },
            extended_model,
            extended_fmu: None,
            relations: diagnosis
                .relations
                .iter()
                .map(|relation| (relation.name, relation.ratio))
                .collect(),
            remaining: diagnosis
                .remaining
                .iter()
                .map(|test| (test.what.clone(), test.deviate))
                .collect(),
            share_explained: diagnosis.share_explained,
            notes: diagnosis.notes.clone(),
            wall_s,
        }
    }
}

/// Diagnoses the case in folder `case`; with `out`, writes the extended model and the HTML report
/// there, all or nothing.
///
/// # Errors
/// A case that cannot be read, records that would mislead, a folder that cannot be written.
pub fn diagnose(case: &Path, out: Option<&Path>) -> Result<DiagnosisReport, Error> {
    let begun = Instant::now();
    let fail = |path: &Path, reason: String| Error::File {
        path: path.into(),
        reason,
    };
    if let Some(folder) = out {
        Results::check(folder)?;
    }
    let read = Case::read(case).map_err(|error| match error {
        CaseError::File { file, reason } => Error::File { path: file, reason },
        other => fail(case, other.to_string()),
    })?;
    let diagnosis = shake_table::diagnose(&read, false).map_err(|e| fail(case, e.to_string()))?;
    let extended_model = out.map(|folder| folder.join(EXTENDED_MODEL));
    let wall = begun.elapsed().as_secs_f64();
    let report = DiagnosisReport::new(&diagnosis, extended_model, wall);
    if let Some(folder) = out {
        let model = toml::to_string(&diagnosis.extended_model)
            .map_err(|error| fail(&folder.join(EXTENDED_MODEL), error.to_string()))?;
        let page = report::html(&page::page(
            &case.display().to_string(),
            &report,
            &diagnosis,
        ))
        .map_err(|error| fail(&folder.join(REPORT), error.to_string()))?;
        let mut results = Results::begin(folder)?;
        results.write_text(EXTENDED_MODEL, &model)?;
        results.write_text(REPORT, &page)?;
        results.finish()?;
    }
    Ok(report)
}

/// Diagnoses a case, writes its files and prints what was found.
///
/// # Errors
/// As [`diagnose`]; nothing is written then.
pub fn execute(case: &Path, out: Option<&Path>, json: bool) -> Result<ExitCode, Error> {
    let folder = out.map_or_else(
        || {
            let place = std::path::absolute(case).unwrap_or_else(|_| case.to_path_buf());
            let name = place.file_name().unwrap_or_default().to_string_lossy();
            Path::new("shakebench-results").join(format!("diagnosis-{name}"))
        },
        Path::to_path_buf,
    );
    let report = diagnose(case, Some(&folder))?;
    if json {
        println!("{}", serde_json::json!(report));
    } else {
        print!("{}", page::text(&report));
        println!("\nwritten ({:.1} s):", report.wall_s);
        for file in [EXTENDED_MODEL, REPORT] {
            println!("  {}", folder.join(file).display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
