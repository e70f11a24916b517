//! Runs laid over each other: any folders of `shakebench run`, whatever made them.

mod differences;
mod page;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use differences::Difference;

use crate::error::Error;
use crate::results::{Out, Results};
use crate::run::manifest::Manifest;
use crate::run::signals::{RESULTS, read_csv};
use crate::run::summary::Summary;
use fmi_master::{Ending, Record};
use motion::metrics::Tracking;
use pages::report::{self, UnitSystem};

/// File with the figures and the differences.
pub const RUNS: &str = "runs.json";

/// Runs in comparison: `runs.json`, and what `--json` prints.
#[derive(Debug, Serialize)]
pub struct RunComparison {
    /// The runs, in the order in which they were named.
    pub runs: Vec<ComparedRun>,
    /// What is not the same in all of them.
    pub differences: Vec<Difference>,
}

/// One of the runs.
#[derive(Debug, Serialize)]
pub struct ComparedRun {
    /// Short name, not that of another.
    pub label: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Its system.
    pub system: String,
    /// Its motion.
    pub motion: String,
    /// How it ended.
    pub ended: Ending,
    /// How well the table followed.
    pub tracking: Option<Tracking>,
    /// For the plots and the differences.
    #[serde(skip)]
    files: Files,
}

/// What the folder of a run holds.
#[derive(Debug)]
struct Files {
    manifest: Manifest,
    record: Record,
}

/// Reads runs, with differences in these units; a folder without a run stands for the runs in the folders below it.
///
/// # Errors
/// A folder that holds no run, a file of one at fault, fewer than two runs.
pub fn read(folders: &[PathBuf], units: UnitSystem) -> Result<RunComparison, Error> {
    let places = find(folders)?;
    let runs: Result<Vec<ComparedRun>, Error> =
        places.iter().map(|place| read_one(place)).collect();
    let mut runs = runs?;
    if runs.len() < 2 {
        return Err(Error::Option {
            option: "compare",
            reason: "this is one run; expected two or more folders of runs, one that contains \
                several, or a system to run beside it, such as three-variable"
                .into(),
        });
    }
    name(&mut runs);
    let manifests: Vec<&Manifest> = runs.iter().map(|run| &run.files.manifest).collect();
    let differences = differences::of(&manifests, units);
    Ok(RunComparison { runs, differences })
}

/// The folders of the runs in these folders.
///
/// # Errors
/// A folder that holds no run.
pub fn find(folders: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let found: Result<Vec<Vec<PathBuf>>, Error> =
        folders.iter().map(|folder| runs_in(folder)).collect();
    Ok(found?.concat())
}

fn has_run(folder: &Path) -> bool {
    folder.join("manifest.json").is_file() && folder.join(RESULTS).is_file()
}

fn runs_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let fault = |reason: String| Error::File {
        path: folder.to_path_buf(),
        reason,
    };
    if has_run(folder) {
        return Ok(vec![folder.to_path_buf()]);
    }
    if !folder.is_dir() {
        return Err(fault(
            "is not a folder; expected the folder of a run (`shakebench run --out DIR`)".into(),
        ));
    }
    let entries = std::fs::read_dir(folder).map_err(|error| fault(error.to_string()))?;
    let mut below: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| has_run(path))
        .collect();
    below.sort();
    if below.is_empty() {
        return Err(fault(
            "contains no run; expected manifest.json, summary.json and results.csv".into(),
        ));
    }
    Ok(below)
}

fn read_one(folder: &Path) -> Result<ComparedRun, Error> {
    let manifest = Manifest::read(&folder.join("manifest.json"))?;
    let summary = Summary::read(&folder.join("summary.json"))?;
    let record = read_csv(&folder.join(RESULTS))?;
    Ok(ComparedRun {
        label: String::new(),
        folder: folder.to_path_buf(),
        system: summary.system.clone(),
        motion: summary.motion.name.clone(),
        ended: summary.ended,
        tracking: summary.tracking,
        files: Files { manifest, record },
    })
}

/// Names the runs by their folders; by the whole path where two folders have the same name.
fn name(runs: &mut [ComparedRun]) {
    let short = |run: &ComparedRun| {
        let absolute = std::path::absolute(&run.folder);
        let absolute = absolute.unwrap_or_else(|_| run.folder.clone());
        let name = absolute.file_name().unwrap_or(absolute.as_os_str());
        name.to_string_lossy().into_owned()
    };
    let names: Vec<String> = runs.iter().map(short).collect();
    for (run, name) in runs.iter_mut().zip(&names) {
        let is_only = names.iter().filter(|other| *other == name).count() == 1;
        run.label = if is_only {
            name.clone()
        } else {
            run.folder.display().to_string()
        };
    }
}

impl RunComparison {
    /// Writes `report.html`, `runs.json` and `runs.csv`; says where.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Out) -> Result<Vec<PathBuf>, Error> {
        let mut results = Results::begin(folder)?;
        results.write_page(report::FILE, &page::report(self))?;
        results.write_text(RUNS, &format!("{:#}\n", serde_json::json!(self)))?;
        results.write("runs.csv", |file| {
            let mut csv = csv::Writer::from_writer(file);
            csv.write_record([
                "run",
                "system",
                "motion",
                "ended",
                "time_domain_percent",
                "frequency_domain_percent",
                "peak_displacement_m",
                "delay_s",
            ])?;
            for run in &self.runs {
                let figure = |value: fn(&Tracking) -> f64| {
                    let tracking = run.tracking.as_ref();
                    tracking.map_or(String::new(), |tracking| value(tracking).to_string())
                };
                csv.write_record([
                    run.label.clone(),
                    run.system.clone(),
                    run.motion.clone(),
                    run.ended.word().to_string(),
                    figure(|t| t.time_domain_percent),
                    figure(|t| t.frequency_domain_percent),
                    figure(|t| t.peak_displacement),
                    figure(|t| t.delay),
                ])?;
            }
            csv.flush()
        })?;
        Ok(results.finish()?)
    }

    /// The figures, one row per run with a line of headings.
    pub fn figures(&self, system: UnitSystem) -> Vec<Vec<String>> {
        page::figures(self)
            .iter()
            .map(|row| row.iter().map(|cell| cell.text(system)).collect())
            .collect()
    }
}
