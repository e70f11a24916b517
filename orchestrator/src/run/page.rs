//! The files of a run.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::experiment::Prepared;
use super::manifest::Manifest;
use super::signals::{read_csv, write_csv};
use super::summary::{Summary, Table};
use crate::error::Error;
use crate::fmu::hexadecimal;
use crate::master::{Outcome, Record};
use crate::motion::Motion;
use crate::report::number::significant;
use crate::report::{self, Cell, Whole};
use crate::results::Results;
use crate::units::STANDARD_GRAVITY;

/// Writes the files of a run and says where they are.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(
    folder: &Path,
    prepared: &Prepared,
    outcome: &Outcome,
    summary: &Summary,
    manifest: &mut Manifest,
) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    let mut sum = Sha256::new();
    results.write("results.csv", |file| {
        let mut both = Hashed {
            file,
            sum: &mut sum,
        };
        write_csv(&outcome.record, &mut both)
    })?;
    manifest.results_sha256 = hexadecimal(&sum.finalize());
    // A page of an earlier run here would be another run's.
    results.replaces(&["report.html"]);
    results.write_text("summary.json", &json(summary))?;
    results.write_text("manifest.json", &json(manifest))?;
    let motion = &prepared.motion;
    if let Some(page) = page(summary, manifest, motion, motion.into(), &outcome.record) {
        results.write_text("report.html", &page)?;
    }
    Ok(results.finish()?)
}

/// A file whose checksum is taken on the way.
struct Hashed<'a, W> {
    file: W,
    sum: &'a mut Sha256,
}

impl<W: Write> Write for Hashed<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.sum.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// The report; none where there is no table.
fn page(
    summary: &Summary,
    manifest: &Manifest,
    motion: &Motion,
    whole: Whole,
    record: &Record,
) -> Option<String> {
    let table = Table::find(manifest, record)?;
    let column = |output| record.column(&table.name(output)).unwrap_or_default();
    let valve = table.valve.as_ref().and_then(|name| record.column(name));
    let row = |name: &str, value: String| (name.to_string(), Cell::from(value));
    let mut settings = vec![
        row("FMI", summary.fmi.clone()),
        row("Algorithm", summary.algorithm.clone()),
        row("Step", format!("{} ms", 1e3 * summary.step_s)),
        row(
            "Speed",
            format!(
                "{} times real time",
                significant(summary.real_time_factor, 2)
            ),
        ),
    ];
    for (name, component) in &manifest.components {
        let file = component.fmu.file_name().unwrap_or_default();
        let sum = component.sha256.get(..16).unwrap_or(&component.sha256);
        settings.push(row(
            name,
            format!("{}, SHA-256 {sum}", file.to_string_lossy()),
        ));
    }
    let run = report::Run {
        system: &summary.system,
        motion,
        whole,
        displacement: &column("displacement"),
        velocity: &column("velocity"),
        acceleration: &column("acceleration"),
        valve_command: valve.as_deref(),
        tracking: summary.tracking.as_ref(),
        ended: summary
            .ended_because
            .as_deref()
            .unwrap_or(summary.ended.word()),
        settings,
        footer: format!(
            "shakebench {}; repeat with: shakebench run --manifest manifest.json",
            manifest.shakebench
        ),
    };
    report::html(&report::run(&run)).ok()
}

/// The report of the run whose files lie in `folder`; of a motion that was not played to its end, it
/// draws what was played.
///
/// # Errors
/// A file that is missing or is none of a run.
pub fn page_again(folder: &Path) -> Result<String, Error> {
    let manifest = Manifest::read(&folder.join("manifest.json"))?;
    let place = folder.join("summary.json");
    let fault = |reason: String| Error::File {
        path: place.clone(),
        reason,
    };
    let text = std::fs::read_to_string(&place).map_err(|error| fault(error.to_string()))?;
    let summary: Summary = serde_json::from_str(&text)
        .map_err(|error| fault(format!("not the summary of a run: {error}")))?;
    let place = folder.join("results.csv");
    let record = read_csv(&place)?;
    let column = |quantity| {
        let name = format!("reference.{quantity}");
        record.column(&name).ok_or_else(|| Error::File {
            path: place.clone(),
            reason: format!("not the results of a run: there is no column `{name}`"),
        })
    };
    let motion = Motion {
        name: manifest.motion.name.clone(),
        dt: manifest.motion.dt_s,
        displacement: column("displacement")?,
        velocity: column("velocity")?,
        acceleration: column("acceleration")?,
        notes: manifest.motion.notes.clone(),
        seed: manifest.motion.seed,
    };
    let whole = Whole {
        duration: summary.motion.duration_s,
        peak_displacement: summary.motion.peak_displacement_m,
        peak_acceleration: summary.motion.pga_g * STANDARD_GRAVITY,
    };
    page(&summary, &manifest, &motion, whole, &record).ok_or_else(|| Error::File {
        path: folder.to_path_buf(),
        reason: "no component of the run is a table with displacement, velocity and acceleration, \
                 which a report needs"
            .into(),
    })
}
