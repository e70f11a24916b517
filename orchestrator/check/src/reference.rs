//! Results that an archive brings along (`extra/org.fmi-standard.fmi-ls-ref/NAME_out.csv`, or a CSV
//! whose name ends in `_ref` or `_out`), compared with a run.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use zip::ZipArchive;

use super::Findings;
use super::calls::RunError;
use fmi_import::{Fmu, Isolation, Kind, Options};
use fmi_master::{Algorithm, Outcome, Pace, Plan, Samples, Simulation};
use fmi_system::{Files, SystemFile, assemble};

/// Larger differences, over the largest value of a column, are an error.
const ALLOWED: f64 = 1e-3;
/// More steps are a mistake: a record of them would not fit into memory.
const MOST_STEPS: f64 = 1e10;
/// Longer tables are not compared, bytes.
const LARGEST: u64 = 64 << 20;

/// Compares the results that the archive holds, if it holds some.
pub(super) fn check(findings: &mut Findings, fmu: &Arc<Fmu>, path: &Path, guest: Option<&Path>) {
    let Some((name, text)) = table(path) else {
        findings.note("archive", "there is no reference result for comparison");
        return;
    };
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let clean = |cell: &str| cell.trim().trim_matches('"').to_string();
    let Some(head) = lines.next() else {
        findings.warning(&name, "is empty");
        return;
    };
    let columns: Vec<String> = head.split(',').map(clean).collect();
    if columns.first().map(String::as_str) != Some("time") {
        findings.warning(&name, "the first column is not `time`");
        return;
    }
    let rows: Vec<Vec<String>> = lines
        .map(|line| line.split(',').map(clean).collect())
        .collect();
    let time = |row: &Vec<String>| row.first().and_then(|cell| cell.parse::<f64>().ok());
    let (Some(first), Some(last)) = (rows.first().and_then(time), rows.last().and_then(time))
    else {
        findings.warning(&name, "the times cannot be read");
        return;
    };
    let times: Vec<f64> = rows.iter().filter_map(time).collect();
    let spans = times.windows(2).map(|pair| pair[1] - pair[0]);
    let usual = spans
        .filter(|span| *span > 0.0)
        .fold(f64::INFINITY, f64::min);
    // Without the rounding of differences.
    let usual = (usual * 1e12).round() / 1e12;
    let step = fmu.description.preferred_step.unwrap_or(usual);
    if !(last > first && step.is_finite()) {
        findings.warning(&name, "holds no run");
        return;
    }
    let outcome = match run(path, step, last - first, guest) {
        Ok(outcome) => outcome,
        Err(reason) => {
            findings.error(
                &name,
                format!("the run for comparison cannot start: {reason}"),
            );
            return;
        }
    };
    if !outcome.ended.is_regular() {
        findings.error(
            &name,
            format!("the run for comparison failed: {}", outcome.ended.message()),
        );
        return;
    }
    let record = &outcome.record;
    let ours = record.column("time").unwrap_or_default();
    let mut compared = 0;
    for (place, column) in columns.iter().enumerate().skip(1) {
        if fmu.description.array(column).is_some() {
            continue;
        }
        let Some(variable) = fmu.description.variable(column) else {
            findings.warning(&name, format!("`{column}` is not a variable"));
            continue;
        };
        if !matches!(variable.kind, Kind::Float64 | Kind::Float32) {
            continue;
        }
        let found = record.columns.iter().position(|known| {
            known
                .split_once('.')
                .is_some_and(|(_, variable)| variable == column)
        });
        let Some(found) = found else {
            continue;
        };
        let values: Vec<f64> = record.rows().map(|row| row[found]).collect();
        let (mut worst, mut at, mut size): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for row in &rows {
            let cells = (
                time(row),
                row.get(place).and_then(|cell| cell.parse::<f64>().ok()),
            );
            let (Some(time), Some(theirs)) = cells else {
                continue;
            };
            size = size.max(theirs.abs());
            let near = ours.iter().position(|own| (own - time).abs() < 1e-6 * step);
            if let Some(near) = near {
                let difference = (values[near] - theirs).abs();
                if difference > worst {
                    (worst, at) = (difference, time);
                }
            }
        }
        compared += 1;
        if worst > ALLOWED * size.max(1e-9) {
            findings.error(
                &name,
                format!(
                    "`{column}` differs by {worst:.3e} at {at} s (its largest value is {size:.3e})"
                ),
            );
        }
    }
    findings.check(format!(
        "{name}: {compared} columns compared with a run of {step} s steps"
    ));
}

/// Runs the FMU alone for `duration` seconds in steps of `step` seconds.
fn run(path: &Path, step: f64, duration: f64, guest: Option<&Path>) -> Result<Outcome, RunError> {
    let steps = (duration / step).round();
    if !(1.0..=MOST_STEPS).contains(&steps) {
        return Err(RunError::Steps {
            duration,
            steps,
            step,
        });
    }
    let file = SystemFile::of_fmu(path);
    let system = assemble(&file, &[], &mut Files::of(&file))?;
    // A row at the end, too.
    let rows = steps as usize + 1;
    let plan = Plan {
        algorithm: Algorithm::default(),
        step,
        stop: rows as f64 * step,
        variable: None,
    };
    let options = Options {
        isolation: Isolation::All,
        guest: guest.map(Path::to_path_buf),
        ..Options::default()
    };
    let simulation = Simulation::planned(&system, &Samples::none(step), &plan, &options)?;
    Ok(simulation.run(rows, Pace::Fastest, &mut |_| {}))
}

/// The table with results, by its name.
fn table(path: &Path) -> Option<(String, String)> {
    let mut archive = ZipArchive::new(File::open(path).ok()?).ok()?;
    let names: Vec<String> = archive
        .file_names()
        .filter_map(|name| Some(name.ok()?.to_string()))
        .collect();
    let fits = |name: &&String| {
        ["_out.csv", "_ref.csv"]
            .iter()
            .any(|end| name.ends_with(end))
    };
    let name = names.iter().find(fits)?.clone();
    let mut text = String::new();
    let entry = archive.by_name(&name).ok()?;
    entry.take(LARGEST).read_to_string(&mut text).ok()?;
    Some((name, text))
}
