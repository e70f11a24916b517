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
