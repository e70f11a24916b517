//! `diagnose`: what the nominal model of a case gets wrong, why, and what knowing it brings.

pub mod co_simulation;
mod health;
mod page;
mod pictures;
mod text;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use identification::diagnosis::case::{CHANNELS, Case, CaseError};
use identification::diagnosis::engine::NamedEffect;
use identification::diagnosis::rigs::shake_table::{self, Diagnosis};
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::extended_model::ExtendedModel;
use crate::pack::{self, FmiVersion, PackedFmu};
use crate::report;
use crate::results::Results;
use crate::system::model::component_of;
use co_simulation::{Comparison, RigFmus};
pub use health::RelationReport;

/// File with the extended model, in the folder of `--out`.
pub const EXTENDED_MODEL: &str = "extended_model.toml";
/// File with the JSON object, in the folder of `--out`.
pub const DIAGNOSIS: &str = "diagnosis.json";
/// File with the report, in the folder of `--out`.
pub const REPORT: &str = "report.html";

/// The JSON object of `diagnose`; SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisReport {
    /// One sentence.
    pub sentence: String,
    /// `adequate`, `named`, `ambiguous` or `unexplained`.
    pub verdict: &'static str,
    /// The effects.
    pub effects: Vec<EffectReport>,
    /// Rival sets of effects.
    #[serde(borrow)]
    pub alternatives: Vec<Vec<&'static str>>,
    /// The experiment that would tell the first rival apart.
    pub separating_experiment: Option<String>,
    /// What the extended model brings, one step ahead.
    pub gain: GainReport,
    /// The same in closed-loop co-simulation through the FMUs.
    pub co_simulation: Option<GainReport>,
    /// Where the extended model was written.
    pub extended_model: Option<PathBuf>,
    /// The FMU (3.0) with the first of the effects.
    pub extended_fmu: Option<PathBuf>,
    /// All FMUs of the extended model.
    pub extended_fmus: Vec<PathBuf>,
    /// The relations R1 to R5 on the identification record.
    #[serde(borrow)]
    pub relations: BTreeMap<&'static str, RelationReport>,
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectReport {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Its parameters by name.
    pub parameters: BTreeMap<String, ParameterReport>,
    /// 0 to 1.
    pub confidence: f64,
}

/// A parameter in [`EffectReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterReport {
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// One standard deviation.
    pub standard_error: f64,
}

/// A gain in [`DiagnosisReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainReport {
    /// Root mean square over the channels of their errors over their variation, nominal.
    pub before_nrmse: f64,
    /// The same for the extended model.
    pub after_nrmse: f64,
    /// The same for a perfect model.
    pub noise_floor_nrmse: f64,
    /// 95 % interval of the share of the error that is gone.
    pub interval_95: [f64; 2],
    /// The record, which was not fitted.
    pub record: &'static str,
    /// Error before, in units of the noise floor.
    pub before_ratio: f64,
    /// And after.
    pub after_ratio: f64,
    /// By channel: before, after, floor.
    #[serde(borrow)]
    pub channels: BTreeMap<&'static str, [f64; 3]>,
}

impl DiagnosisReport {
    fn new(diagnosis: &Diagnosis) -> Self {
        let gain = &diagnosis.gain;
        Self {
            sentence: diagnosis.sentence.clone(),
            verdict: diagnosis.verdict.word(),
            effects: diagnosis.effects.iter().map(effect).collect(),
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
            co_simulation: None,
            extended_model: None,
            extended_fmu: None,
            extended_fmus: Vec::new(),
            relations: BTreeMap::new(),
            remaining: diagnosis
                .remaining
                .iter()
                .map(|test| (test.what.clone(), test.deviate))
                .collect(),
            share_explained: diagnosis.share_explained,
            notes: diagnosis.notes.clone(),
            wall_s: 0.0,
        }
    }
}

fn effect(named: &NamedEffect) -> EffectReport {
    let parameters = named.parameters.iter().map(|p| {
        let report = ParameterReport {
            value: p.value,
            unit: p.unit,
            standard_error: p.standard_error,
        };
        (p.name.clone(), report)
    });
    EffectReport {
        effect: named.effect,
        parameters: parameters.collect(),
        confidence: named.confidence,
    }
}

/// Diagnoses the case in folder `case` and writes the extended model, its FMUs, the JSON object and
/// the report into `folder`, all or nothing.
///
/// # Errors
/// A case that cannot be read, records that would mislead, a folder that cannot be written.
pub fn diagnose(case: &Path, folder: &Path) -> Result<DiagnosisReport, Error> {
    let begun = Instant::now();
    let fail = |path: &Path, reason: String| Error::File {
        path: path.into(),
        reason,
    };
    Results::check(folder)?;
    let read = Case::read(case).map_err(|error| match error {
        CaseError::File { file, reason } => Error::File { path: file, reason },
        other => fail(case, other.to_string()),
    })?;
    let diagnosis = shake_table::diagnose(&read, false).map_err(|e| fail(case, e.to_string()))?;
    let mut report = DiagnosisReport::new(&diagnosis);
    report.relations = health::relations(&read, &diagnosis);
    let model = ExtendedModel::new(&diagnosis.extended_model, &diagnosis.modelled);
    if report.effects.is_empty() && !diagnosis.modelled.is_empty() {
        let names: Vec<&str> = diagnosis.modelled.iter().map(|e| e.effect).collect();
        report.notes.push(format!(
            "in the extended model for the help they are, not as the cause: {}",
            names.join(" and ")
        ));
    }
    let model_path = folder.join(EXTENDED_MODEL);
    let model_text = model
        .toml()
        .map_err(|error| fail(&model_path, error.to_string()))?;
    report.extended_model = Some(model_path);
    let mut results = Results::begin(folder)?;
    results.write_text(EXTENDED_MODEL, &model_text)?;
    let mut comparison = None;
    match fmus(&model, &mut results, folder) {
        Ok((built, _staged)) => {
            let home = |fmu: &&(PackedFmu, PathBuf)| {
                let first = diagnosis.modelled.first();
                let component =
                    first.map_or("ShakeTable", |named| component_of(named.effect).name());
                fmu.0.version == FmiVersion::V3 && fmu.0.name == component
            };
            report.extended_fmu = built.iter().find(home).map(|fmu| fmu.1.clone());
            match in_closed_loop(&read, &diagnosis, &built) {
                Ok(found) => comparison = Some(found),
                Err(reason) => report
                    .notes
                    .push(format!("not co-simulated in closed loop: {reason}")),
            }
            report.extended_fmus = built.into_iter().map(|fmu| fmu.1).collect();
        }
        Err(error) => report
            .notes
            .push(format!("no FMUs of the extended model: {error}")),
    }
    report.co_simulation = comparison.as_ref().map(|found| found.gain.clone());
    report.wall_s = begun.elapsed().as_secs_f64();
    let page = page::page(
        case,
        &read,
        &report,
        &diagnosis,
        &model,
        comparison.as_ref(),
    );
    let page = report::html(&page).map_err(|e| fail(&folder.join(REPORT), e.to_string()))?;
    results.write_text(REPORT, &page)?;
    results.write_text(DIAGNOSIS, &format!("{:#}\n", serde_json::json!(report)))?;
    results.finish()?;
    Ok(report)
}

/// The FMUs of the extended model with the places they will have, and the folder where they are
/// until then.
type Built = (Vec<(PackedFmu, PathBuf)>, tempfile::TempDir);

fn fmus(model: &ExtendedModel, results: &mut Results, folder: &Path) -> Result<Built, Error> {
    let staged = tempfile::tempdir().map_err(|error| Error::File {
        path: std::env::temp_dir(),
        reason: error.to_string(),
    })?;
    let originals = pack::all_fmus()?;
    let written = model.write_fmus(originals, staged.path())?;
    let mut built = Vec::new();
    for fmu in written {
        let name = format!("{}/{}.fmu", fmu.version.folder(), fmu.name);
        let content = std::fs::read(&fmu.path).map_err(|error| Error::File {
            path: fmu.path.clone(),
            reason: error.to_string(),
        })?;
        results.write(&name, |file| file.write_all(&content))?;
        built.push((fmu, folder.join(name)));
    }
    Ok((built, staged))
}

/// The validation record against both rigs in closed loop; a sentence where that cannot be had.
fn in_closed_loop(
    case: &Case,
    diagnosis: &Diagnosis,
    extended: &[(PackedFmu, PathBuf)],
) -> Result<Comparison, String> {
    let record = &case.validation;
    let law = case.nominal.controller.ok_or("the case states no law")?;
    if record.reference.len() != record.len() {
        return Err("the validation record has no column `reference`".into());
    }
    if let Some(missing) = [0, 1].into_iter().find(|&i| record.channels[i].is_empty()) {
        return Err(format!(
            "without `{}` nothing tells whether the stated law made the command (R5)",
            CHANNELS[missing]
        ));
    }
    // The law's command is used wherever it explains the recorded one.
    if diagnosis.validation.signals.command == record.valve_command {
        return Err("the stated law did not make the recorded command (R5)".into());
    }
    let originals = pack::all_fmus().map_err(|error| error.to_string())?;
    let original = |name: &str| {
        let mut all = originals.iter();
        all.find(|fmu| fmu.version == FmiVersion::V3 && fmu.name == name)
            .map(|fmu| fmu.path.clone())
            .ok_or_else(|| format!("there is no component `{name}`"))
    };
    let changed = |name: &str| {
        let mut all = extended.iter();
        let found = all.find(|(fmu, _)| fmu.version == FmiVersion::V3 && fmu.name == name);
        found.map_or_else(|| original(name), |(fmu, _)| Ok(fmu.path.clone()))
    };
    let rig = |file: &dyn Fn(&str) -> Result<PathBuf, String>| -> Result<RigFmus, String> {
        Ok(RigFmus {
            table: (file("ShakeTable")?, Vec::new()),
            specimen: match case.nominal.specimen {
                Some(_) => Some((file("Specimen")?, Vec::new())),
                None => None,
            },
            sensors: file("Instrumentation")?,
            control: file("ThreeVariableControl")?,
        })
    };
    let before = rig(&original)?.nominal(&case.nominal);
    co_simulation::compare(record, &case.nominal, &law, &before, &rig(&changed)?)
}

/// The report of the diagnosis whose `diagnosis.json` lies in `folder`, without the pictures, which
/// need the records.
///
/// # Errors
/// A file that cannot be read or is none of a diagnosis.
pub(super) fn page_again(folder: &Path) -> Result<String, Error> {
    let path = folder.join(DIAGNOSIS);
    let fault = |reason: String| Error::File {
        path: path.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&path).map_err(|error| fault(error.to_string()))?;
    // Its names are those of the catalogue, kept as long as the program runs.
    let report = serde_json::from_str::<DiagnosisReport>(text.leak())
        .map_err(|error| fault(format!("not the JSON of a diagnosis: {error}")))?;
    report::html(&page::without_pictures(folder, &report)).map_err(|e| fault(e.to_string()))
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
    let report = diagnose(case, &folder)?;
    if json {
        println!("{}", serde_json::json!(report));
    } else {
        print!("{}", text::text(&report));
        println!("\nwritten ({:.1} s):", report.wall_s);
        for file in [REPORT, DIAGNOSIS, EXTENDED_MODEL] {
            println!("  {}", folder.join(file).display());
        }
        for fmu in &report.extended_fmus {
            println!("  {}", fmu.display());
        }
    }
    Ok(ExitCode::SUCCESS)
}
