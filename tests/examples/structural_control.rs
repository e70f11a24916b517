//! Devices in a building of three yielding storeys on the physical rig, on recorded motions: peak and rms of drifts and
//! of the floors' accelerations over those of the building without device. Prints the table of
//! `docs/structural-control.md`.
//!
//! `cargo run --release -p acceptance --example structural_control -- FOLDER [INSTANCE.VARIABLE=VALUE...]`

use std::error::Error;
use std::path::{Path, PathBuf};

use fmi_master::Algorithm;
use laboratory::run::experiment::{Request, prepare};

const STOREYS: usize = 3;
/// Name, specimen, what the damper is told.
const DEVICES: [(&str, &str, Option<&str>); 5] = [
    ("none", "storeys", None),
    ("tuned mass", "storeys-tuned-mass", None),
    ("damper, no voltage", "storeys-damped", Some("passive_off")),
    ("damper, all voltage", "storeys-damped", Some("passive_on")),
    (
        "damper, clipped-optimal",
        "storeys-damped",
        Some("clipped_optimal"),
    ),
];

/// Of all storeys together: peak and rms drift (m), peak and rms acceleration of a floor (m/s²); then the first
/// floor's peak acceleration, and the damper's largest force (N).
type Figures = [f64; 6];

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

fn play(
    record: &Path,
    device: &(&str, &str, Option<&str>),
    settings: &[String],
) -> Result<Figures, Box<dyn Error>> {
    let (_, specimen, told) = device;
    let mut set: Vec<String> = Vec::new();
    if let Some(told) = told {
        set.push(format!("damper_control.control={told}"));
        set.extend_from_slice(settings);
    }
    let prepared = prepare(&Request {
        plant: "servohydraulic".to_string(),
        specimen: specimen.to_string(),
        record: Some(record.to_path_buf()),
        set,
        ..Request::built_in("preview")
    })?;
    let outcome = prepared.run(Algorithm::GaussSeidel)?;
    if !outcome.ended.is_regular() {
        return Err(format!("{}: {:?}", record.display(), outcome.ended).into());
    }
    let column = |name: String| outcome.record.column(&name).unwrap_or_default();
    let mut figures = [0.0; 6];
    for storey in 1..=STOREYS {
        let drift = column(format!("specimen.drift[{storey}]"));
        let acceleration = column(format!("specimen.floor_acceleration[{storey}]"));
        if storey == 1 {
            figures[4] = largest(&acceleration);
        }
        let own = [
            largest(&drift),
            rms(&drift),
            largest(&acceleration),
            rms(&acceleration),
        ];
        for (figure, own) in figures.iter_mut().zip(own) {
            *figure = figure.max(own);
        }
    }
    figures[5] = largest(&column("specimen.damper_force".to_string()));
    Ok(figures)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len() % 2 == 1 {
        values[half]
    } else {
        0.5 * (values[half - 1] + values[half])
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("expected a folder of records")?;
    let settings: Vec<String> = arguments.collect();
    let mut records: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension()
                .is_some_and(|kind| kind == "csv" || kind == "AT2")
        })
        .collect();
    records.sort();
    let mut bare = Vec::new();
    println!(
        "medians over {} records, % of the building without device",
        records.len()
    );
    println!(
        "| device | peak drift | rms drift | peak acceleration | rms acceleration | first floor's peak | largest force, N |"
    );
    println!("|---|---|---|---|---|---|---|");
    for device in &DEVICES {
        let mut all = Vec::new();
        for record in &records {
            all.push(play(record, device, &settings)?);
        }
        if bare.is_empty() {
            bare.clone_from(&all);
        }
        let share = |i: usize| {
            let ratios = all.iter().zip(&bare);
            median(ratios.map(|(own, bare)| 100.0 * own[i] / bare[i]).collect())
        };
        let force = largest(&all.iter().map(|own| own[5]).collect::<Vec<_>>());
        println!(
            "| {} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {force:.0} |",
            device.0,
            share(0),
            share(1),
            share(2),
            share(3),
            share(4)
        );
    }
    Ok(())
}
