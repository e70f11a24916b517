//! The files of a run.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use units::vocabulary;

use sha2::{Digest, Sha256};

use super::axes;
use super::experiment::Prepared;
use super::identity;
use super::manifest::{Manifest, MotionEntry};
use super::signals::{
    COLUMNS, PARQUET, RESULTS, columns, read_csv, write_columns, write_csv, write_parquet,
};
use super::summary::{Summary, asked};
use super::table::Table;
use super::text::steps_in_words;
use crate::error::Error;
use crate::results::{Out, Results};
use fmi_import::hexadecimal;
use fmi_master::{Outcome, Record};
use motion::Motion;
use pages::report::number::significant;
use pages::report::{self, Cell, Component, Report, SpecimenHistory, UnitSystem};

/// Writes the files of a run and says where they are; the signals as Parquet too where that is asked for.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(
    folder: &Out,
    prepared: &Prepared,
    outcome: &Outcome,
    summary: &Summary,
    manifest: &mut Manifest,
    parquet: bool,
) -> Result<Vec<PathBuf>, Error> {
    manifest.changes.clone_from(&outcome.changes);
    let mut results = Results::begin(folder)?;
    let mut sum = Sha256::new();
    results.write(RESULTS, |file| {
        let mut both = Hashed {
            file,
            sum: &mut sum,
        };
        write_csv(&outcome.record, &mut both)
    })?;
    manifest.results_sha256 = hexadecimal(&sum.finalize());
    // A page of an earlier run here would be another run's.
    results.replaces(&[report::FILE, PARQUET]);
    let columns = columns(&prepared.system, &outcome.record);
    results.write(COLUMNS, |file| write_columns(&columns, file))?;
    if parquet {
        results.write(PARQUET, |file| {
            write_parquet(&outcome.record, &columns, file)
        })?;
    }
    results.write_json("summary.json", summary)?;
    results.write_json("manifest.json", manifest)?;
    let motion = &prepared.motion;
    if let Some(page) = page(summary, manifest, motion, &outcome.record, folder.units()) {
        results.write_page(report::FILE, &page)?;
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

/// The report; none where there is no table.
fn page(
    summary: &Summary,
    manifest: &Manifest,
    motion: &Motion,
    record: &Record,
    units: UnitSystem,
) -> Option<Report> {
    let names = manifest.components.keys().map(String::as_str);
    let both = axes::tables(names, &manifest.connections, record);
    if let (Some(tables), Some(motions), [_, _]) = (both, axes::motions(motion), &summary.axes[..])
    {
        let histories = tables.each_ref().map(|table| histories(record, table));
        let axes = [0, 1].map(|n| {
            let own = &summary.axes[n];
            let run = run_of(
                summary,
                manifest,
                record,
                &tables[n],
                motions[n],
                &histories[n],
                units,
            );
            report::AxisRun {
                name: axes::NAMES[n],
                run: report::Run {
                    tracking: own.tracking.as_ref(),
                    duration: own.motion.duration_s,
                    ..run
                },
                at_rest: own
                    .at_rest
                    .map(|own| [own.displacement_percent, own.acceleration_percent]),
            }
        });
        return Some(report::run_along(&axes));
    }
    let table = Table::find(manifest, record)?;
    let asked = asked(record, motion);
    let motion = asked.as_ref().unwrap_or(motion);
    let histories = histories(record, &table);
    let run = run_of(summary, manifest, record, &table, motion, &histories, units);
    Some(report::run(&run))
}

/// Displacement, velocity and acceleration of a table.
fn histories(record: &Record, table: &Table<'_>) -> [Vec<f64>; 3] {
    ["displacement", "velocity", "acceleration"]
        .map(|output| record.column(&table.name(output)).unwrap_or_default())
}

/// What a page draws of a run along one axis.
fn run_of<'a>(
    summary: &'a Summary,
    manifest: &Manifest,
    record: &Record,
    table: &Table<'_>,
    motion: &'a Motion,
    [displacement, velocity, acceleration]: &'a [Vec<f64>; 3],
    units: UnitSystem,
) -> report::Run<'a> {
    let row = |name: &str, value: String| (name.to_string(), Cell::from(value));
    let settings = vec![
        row("FMI", summary.fmi.clone()),
        row("algorithm", summary.algorithm.clone()),
        row(
            "coupling step",
            match &summary.variable_step {
                Some(_) => steps_in_words(summary),
                None => format!("{} ms", 1e3 * summary.step_s),
            },
        ),
        row(
            "speed",
            format!(
                "{} times real time ({} s elapsed)",
                significant(summary.real_time_factor, 2),
                significant(summary.wall_s, 2)
            ),
        ),
    ];
    let commands = table.valve.iter().filter_map(|name| {
        let values = record.column(name)?;
        Some((name.clone(), values))
    });
    report::Run {
        system: &summary.system,
        identity: identity::of_run(manifest, summary, units),
        motion,
        duration: summary.motion.duration_s,
        displacement,
        velocity,
        acceleration,
        commands: commands.collect(),
        valve_limit: valve_limit(manifest, &table.valve),
        specimen: specimen(manifest, record),
        trip: summary
            .trip
            .as_ref()
            .map(|trip| (trip.time_s, trip.cause.clone())),
        tracking: summary.tracking.as_ref(),
        ended: summary
            .ended_because
            .as_deref()
            .unwrap_or(summary.ended.word()),
        changed: identity::changed(manifest),
        components: components(manifest, summary),
        settings,
        footer: format!(
            "shakebench {}; repeat with: shakebench run --manifest manifest.json",
            manifest.shakebench
        ),
    }
}

/// The limit of the component that gives the first command.
fn valve_limit(manifest: &Manifest, commands: &[String]) -> Option<f64> {
    let (controller, _) = commands.first()?.rsplit_once('.')?;
    let component = manifest.components.get(controller)?;
    component
        .parameters
        .get(vocabulary::VALVE_LIMIT)?
        .0
        .as_f64()
}

/// Drift and force of the first component that has both.
fn specimen(manifest: &Manifest, record: &Record) -> Option<SpecimenHistory> {
    let mut names = manifest.components.keys();
    names.find_map(|name| {
        Some(SpecimenHistory {
            drift: record.column(&format!("{name}.drift"))?,
            force: record.column(&format!("{name}.force"))?,
        })
    })
}

fn components(manifest: &Manifest, summary: &Summary) -> Vec<Component> {
    let all = manifest.components.iter();
    all.map(|(name, component)| {
        let sum = component.sha256.get(..16).unwrap_or(&component.sha256);
        let file = component.fmu.file_name().unwrap_or_default();
        Component {
            name: name.clone(),
            model: format!(
                "{}, FMI {}, SHA-256 {sum}",
                file.to_string_lossy(),
                component.fmi
            ),
            time: summary.component_wall_s.get(name).copied(),
        }
    })
    .collect()
}

/// The report of the run whose files lie in `folder`; of a motion that was not played to its end, it
/// draws what was played.
///
/// # Errors
/// A file that is missing or is none of a run.
pub fn page_again(folder: &Path, units: UnitSystem) -> Result<Report, Error> {
    let manifest = Manifest::read(&folder.join("manifest.json"))?;
    let summary = Summary::read(&folder.join("summary.json"))?;
    let place = folder.join(RESULTS);
    let record = read_csv(&place)?;
    let column = |quantity: &str| {
        let name = format!("reference.{quantity}");
        record.column(&name).ok_or_else(|| Error::File {
            path: place.clone(),
            reason: format!("not the results of a run: there is no column `{name}`"),
        })
    };
    let played = |entry: &MotionEntry, axis: &str| -> Result<Motion, Error> {
        Ok(Motion {
            name: entry.name.clone(),
            dt: entry.dt_s,
            displacement: column(&format!("displacement{axis}"))?,
            velocity: column(&format!("velocity{axis}"))?,
            acceleration: column(&format!("acceleration{axis}"))?,
            notes: entry.notes.clone(),
            seed: entry.seed,
            across: None,
        })
    };
    let mut motion = played(&manifest.motion, "")?;
    if let Some(across) = &manifest.motion.across {
        motion.across = Some(Box::new(played(across, "_y")?));
    }
    page(&summary, &manifest, &motion, &record, units).ok_or_else(|| Error::File {
        path: folder.to_path_buf(),
        reason: "no component of the run is a table with displacement, velocity and acceleration, \
                 which a report needs"
            .into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::{self, summary, write_files, write_run};
    use crate::run::axes::{Axis, CrossMotion};
    use crate::run::experiment::Request;
    use crate::run::summary::{MotionSummary, Trip};
    use fmi_master::{Change, Ending, RealTime, StepsTaken};
    use pages::report::UnitSystem;

    fn shown(report: &Report, units: UnitSystem) -> String {
        let text = expected::text_of(report, units).replace(env!("CARGO_PKG_VERSION"), "VERSION");
        // Checksums are those of an archive whose bytes are not fixed here.
        let lines = text.lines().map(|line| match line.split_once("SHA-256 ") {
            Some((before, after)) => format!("{before}SHA-256 SUM{}", &after[16..]),
            None => line.to_string(),
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    fn words(text: &str) -> String {
        format!("{text}\n======\n")
    }

    #[test]
    fn a_run_is_reported_again_from_its_files() {
        let folder = tempfile::tempdir().unwrap();
        let request = Request {
            set: vec!["control.proportional_gain=5 V/in".into()],
            ..Request::built_in("mpc")
        };
        let (mut summary, mut manifest) = write_run(folder.path(), &request, 0.9);
        let page = page_again(folder.path(), UnitSystem::Us).unwrap();
        let mut text = words(&shown(&page, UnitSystem::Us));
        // Stopped, with changes, and steps that varied.
        let motion = made::wave("wave", 2000);
        let mut record = Record::with_capacity(made::followed(&motion, 0.9).columns, 0);
        made::followed(&motion, 0.9)
            .rows()
            .take(900)
            .for_each(|row| record.push(row[0], &row[1..], &[]));
        summary.tracking = None;
        summary.ended = Ending::Interlock;
        summary.ended_because = Some("interlock: stroke".into());
        summary.trip = Some(Trip {
            time_s: 1.5,
            cause: "the table left its stroke".into(),
        });
        summary.variable_step = Some(taken());
        manifest.request.variable_step_percent = Some(0.1);
        manifest.request.tuning = Some(crate::systems::tuning::Tuning::Printed);
        manifest.changes = vec![change()];
        write_files(folder.path(), &summary, &manifest, &record);
        let page = page_again(folder.path(), UnitSystem::Si).unwrap();
        text += &shown(&page, UnitSystem::Si);
        expected::compare(env!("CARGO_MANIFEST_DIR"), "run.txt", &text);
    }

    #[test]
    fn a_run_without_a_table_or_reference_has_no_page() {
        let folder = tempfile::tempdir().unwrap();
        let (summary, mut manifest) = write_run(folder.path(), &Request::built_in("mpc"), 0.9);
        let told = |record: &Record, manifest: &Manifest| {
            write_files(folder.path(), &summary, manifest, record);
            page_again(folder.path(), UnitSystem::Us)
                .err()
                .unwrap()
                .to_string()
        };
        let bare = Record::of(vec!["time".into()], vec![0.0, 1.0], Vec::new(), Vec::new()).unwrap();
        let no_reference = told(&bare, &manifest);
        assert!(
            no_reference.contains("there is no column `reference.displacement`"),
            "{no_reference}"
        );
        manifest.components.remove("table");
        let record = made::followed(&made::wave("wave", 20), 0.9);
        let no_table = told(&record, &manifest);
        assert!(
            no_table.contains("no component of the run is a table"),
            "{no_table}"
        );
        let place = folder.path().join("none");
        assert!(
            page_again(&place, UnitSystem::Us)
                .unwrap_err()
                .to_string()
                .contains("manifest.json")
        );
    }

    fn taken() -> StepsTaken {
        StepsTaken {
            tolerance_percent: 0.1,
            least_s: 1e-5,
            greatest_s: 0.002,
            shortest_s: 0.000_25,
            longest_s: 0.002,
            repeated: 17,
            over: 0,
            worst_percent: 0.0876,
            worst_signal: Some("table.force".into()),
        }
    }

    fn change() -> Change {
        Change {
            variable: "control.proportional_gain".into(),
            time_s: 0.5,
            sample: 250,
            samples: 500,
            from: 196.85,
            to: 393.7,
        }
    }

    #[test]
    fn figures_of_a_run_are_printed_as_tables() {
        use crate::run::refinement::CouplingError;
        use crate::run::text::text;
        let motion = made::wave("wave", 2000);
        let record = made::followed(&motion, 0.9);
        let plain = summary(&motion, &record);
        let mut all = vec![
            text(&plain, &record, &motion, UnitSystem::Us),
            text(&plain, &record, &motion, UnitSystem::Si),
        ];
        let mut more = plain.clone();
        more.variable_step = Some(taken());
        more.coupling_error = Some(CouplingError {
            percent: 0.123_45,
            signal: "table.force".into(),
            wanted_percent: 0.5,
            steps_s: vec![0.002],
        });
        more.real_time = Some(RealTime {
            deadlines: 100,
            missed: 3,
            worst_s: 0.0123,
            jitter_median_s: 5e-6,
            jitter_p99_s: 45e-6,
        });
        more.tracking = None;
        all.push(text(&more, &record, &motion, UnitSystem::Si));
        // Two axes, of which the second rests.
        let still = motion.at_rest();
        let both = motion.clone().along_two_axes(still);
        let axis = |name: &str, tracking, at_rest| Axis {
            axis: name.into(),
            motion: MotionSummary::of(&motion),
            tracking,
            at_rest,
        };
        let cross = CrossMotion {
            displacement_percent: 1.25,
            acceleration_percent: 2.5,
            peak_displacement_m: 0.001,
            peak_acceleration_m_s2: 0.5,
        };
        let mut biaxial = plain.clone();
        biaxial.axes = vec![
            axis("x", plain.tracking, None),
            axis("y", None, Some(cross)),
        ];
        all.push(text(&biaxial, &record, &both, UnitSystem::Us));
        let none = Motion {
            displacement: Vec::new(),
            velocity: Vec::new(),
            acceleration: Vec::new(),
            ..motion.clone()
        };
        let mut bare = plain;
        bare.tracking = None;
        bare.variable_step = Some(StepsTaken {
            shortest_s: 0.002,
            worst_signal: None,
            ..taken()
        });
        all.push(text(&bare, &record, &none, UnitSystem::Us));
        expected::compare(
            env!("CARGO_MANIFEST_DIR"),
            "run-figures.txt",
            &all.join("\n======\n"),
        );
    }

    #[test]
    fn a_run_is_measured_and_its_files_are_written() {
        let motion = made::wave("wave", 2000);
        let prepared = made::prepared(motion.clone(), made::follows);
        let outcome = prepared.run(prepared.algorithm).unwrap();
        assert_eq!(
            (outcome.ended.kind(), outcome.record.len()),
            (Ending::Complete, motion.len())
        );
        let how = (prepared.algorithm, prepared.step, prepared.samples);
        let request = Request::built_in("mpc");
        let mut manifest = Manifest::new(&request, &prepared.system, &motion, how);
        let summary = Summary::new(&prepared, &outcome, &manifest);
        let tracking = summary.tracking.unwrap();
        // A tenth of the motion is missing, and a step passes until the table moves.
        let missing = 1.0 - tracking.peak_acceleration / motion.peak_acceleration();
        assert!((missing - 0.1).abs() < 1e-6, "{missing}");
        assert!(
            tracking.delay > 0.0 && tracking.delay < 0.005,
            "{}",
            tracking.delay
        );
        assert_eq!(
            (&*summary.system, &*summary.fmi, summary.steps),
            ("rig", "3.0", outcome.steps)
        );
        assert!(
            summary.trip.is_none() && summary.warnings.is_empty(),
            "{:?}",
            summary.warnings
        );
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("out"));
        let written = write(&out, &prepared, &outcome, &summary, &mut manifest, true).unwrap();
        assert_eq!(written.len(), 6);
        let bytes = std::fs::read(out.join(RESULTS)).unwrap();
        assert_eq!(manifest.results_sha256, fmi_import::digest(&bytes));
        let again = Manifest::read(&out.join("manifest.json")).unwrap();
        assert!(manifest.differences(&again).is_empty());
        let page = page_again(&out, UnitSystem::Us).unwrap();
        assert_eq!(page.title, "rig on wave");
    }

    #[test]
    fn a_table_that_does_not_follow_at_all_has_failed() {
        fn runs_away(inputs: &[f64], outputs: &mut [f64]) {
            made::follows(inputs, outputs);
            outputs[0] *= -9.0;
        }
        let prepared = made::prepared(made::wave("wave", 500), runs_away);
        let outcome = prepared.run(prepared.algorithm).unwrap();
        assert_eq!(outcome.ended.kind(), Ending::Failed, "{:?}", outcome.ended);
    }
}
