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
    let Some((name, text)) = table_in(path) else {
        findings.note("archive", "there is no reference result for comparison");
        return;
    };
    let table = match Table::read(&text) {
        Ok(table) => table,
        Err(what) => {
            findings.warning(&name, what);
            return;
        }
    };
    let step = fmu.description.preferred_step.unwrap_or(table.step);
    let outcome = match run(path, step, table.duration, guest) {
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
    for (place, column) in table.columns.iter().enumerate().skip(1) {
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
        let Difference { worst, at, size } = table.difference(place, &ours, &values, 1e-6 * step);
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

/// Results over time.
struct Table {
    /// Headings, the time first.
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
    /// From the first row to the last, s.
    duration: f64,
    /// Shortest time between two rows, s.
    step: f64,
}

/// How far a column is from another.
#[derive(Debug, PartialEq)]
struct Difference {
    worst: f64,
    /// Time of it, s.
    at: f64,
    /// Largest value of the table's column.
    size: f64,
}

fn number(row: &[String], place: usize) -> Option<f64> {
    row.get(place)?.parse().ok()
}

impl Table {
    /// A table as text.
    ///
    /// # Errors
    /// What it lacks.
    fn read(text: &str) -> Result<Self, &'static str> {
        let mut lines = text.lines().filter(|line| !line.trim().is_empty());
        let clean = |cell: &str| cell.trim().trim_matches('"').to_string();
        let head = lines.next().ok_or("is empty")?;
        let columns: Vec<String> = head.split(',').map(clean).collect();
        if columns.first().map(String::as_str) != Some("time") {
            return Err("the first column is not `time`");
        }
        let rows = lines.map(|line| line.split(',').map(clean).collect());
        let rows: Vec<Vec<String>> = rows.collect();
        let time = |row: Option<&Vec<String>>| row.and_then(|row| number(row, 0));
        let (Some(first), Some(last)) = (time(rows.first()), time(rows.last())) else {
            return Err("the times cannot be read");
        };
        let times: Vec<f64> = rows.iter().filter_map(|row| number(row, 0)).collect();
        let spans = times.windows(2).map(|pair| pair[1] - pair[0]);
        let step = spans
            .filter(|span| *span > 0.0)
            .fold(f64::INFINITY, f64::min);
        let duration = last - first;
        if duration.is_nan() || duration <= 0.0 || step.is_infinite() {
            return Err("holds no run");
        }
        Ok(Self {
            columns,
            rows,
            duration,
            // Without the rounding of differences.
            step: (step * 1e12).round() / 1e12,
        })
    }

    /// The largest difference of column `place` from `values` at `times`, where one of these is at most `near` away.
    fn difference(&self, place: usize, times: &[f64], values: &[f64], near: f64) -> Difference {
        let (mut worst, mut at, mut size): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for row in &self.rows {
            let (Some(time), Some(theirs)) = (number(row, 0), number(row, place)) else {
                continue;
            };
            size = size.max(theirs.abs());
            if let Some(own) = times.iter().position(|own| (own - time).abs() < near) {
                let difference = (values[own] - theirs).abs();
                if difference > worst {
                    (worst, at) = (difference, time);
                }
            }
        }
        Difference { worst, at, size }
    }
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
fn table_in(path: &Path) -> Option<(String, String)> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_without_a_run_says_what_it_lacks() {
        for (text, lack) in [
            ("", "is empty"),
            ("\n  \n", "is empty"),
            ("t,x\n0,1\n1,2\n", "the first column is not `time`"),
            ("time,x\n", "the times cannot be read"),
            ("time,x\n0,1\nend,2\n", "the times cannot be read"),
            ("time,x\n0,1\n", "holds no run"),
            ("time,x\n1,1\n0,1\n", "holds no run"),
            ("time,x\n0,1\nNaN,1\n", "holds no run"),
        ] {
            assert_eq!(Table::read(text).err(), Some(lack), "{text:?}");
        }
    }

    #[test]
    fn step_and_duration_are_those_of_the_rows() {
        // An event's time is there twice; the first row is at 2 s.
        let text = "\"time\", \"x\"\n\n2,1\n 2.1 ,1\n2.1,4\n2.4,4\n";
        let table = Table::read(text).unwrap();
        assert_eq!(table.columns, ["time", "x"]);
        assert_eq!(table.rows.len(), 4);
        assert_eq!(table.step, 0.1);
        assert!((table.duration - 0.4).abs() < 1e-12);
    }

    #[test]
    fn a_column_differs_by_its_worst_row_where_both_have_a_time() {
        let table = Table::read("time,a,x\n0,9,1\n0.1,9,2.5\n0.2,9,-4\n0.3,9,?\n0.35,9,3\n");
        let (times, values) = ([0.0, 0.1, 0.2, 0.3], [1.0, 2.0, -3.75, 100.0]);
        let found = table.unwrap().difference(2, &times, &values, 1e-6);
        // At 0.1 s; a cell that is no number and a time that the run lacks are left out.
        let (worst, at, size) = (0.5, 0.1, 4.0);
        assert_eq!(found, Difference { worst, at, size });
    }
}
