//! The two-actuator benchmark beside the figures that lie with its data.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use hybrid::marths::criteria::{COLUMNS, criteria};
use hybrid::marths::laws::{Class, DecentralisedAdaptive, Predictive, PredictiveDesign};
use hybrid::marths::run::{Setting, ground, perfect, reference, run};
use hybrid::marths::{
    Deviation, PlantParameters, Structure, corners, independent_noise, published_noise,
};

const MOTIONS: [&str; 3] = ["el-centro", "kobe", "morgan-hill"];
const INTENSITY: f64 = 0.4;

fn folder() -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    let folder = folder.join("marths");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED: {} is missing (set SHAKEBENCH_SHARED)",
        folder.display()
    );
    None
}

fn rows(folder: &std::path::Path, file: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    let cells = |line: &str| line.split(',').map(str::to_string).collect();
    text.lines().map(cells).collect()
}

fn record(folder: &std::path::Path, motion: &str) -> Vec<f64> {
    let rows = rows(folder, &format!("{motion}.csv"));
    let time = |i: usize| rows[i][0].parse::<f64>().unwrap();
    let values: Vec<f64> = rows[1..].iter().map(|r| r[1].parse().unwrap()).collect();
    ground(time(2) - time(1), &values, INTENSITY)
}

#[test]
fn matrices_are_those_of_the_published_files() {
    let Some(folder) = folder() else { return };
    let frame = Structure::reference();
    for (i, row) in rows(&folder, "reference-stiffness.csv").iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            let off = frame.stiffness[(i, j)] - value.parse::<f64>().unwrap();
            assert!(off.abs() < 1e-14 * frame.stiffness.amax(), "{i} {j} {off}");
        }
    }
    for (i, row) in rows(&folder, "reference-mass.csv")
        .iter()
        .skip(1)
        .enumerate()
    {
        let off = frame.mass[i] - row[1].parse::<f64>().unwrap();
        assert!(off.abs() < 1e-8, "{i} {off}");
    }
}

#[test]
fn the_published_noise_starts_as_published() {
    let published = [
        -0.008749763346302297,
        -0.007692099372252357,
        -0.00887861753565702,
        -0.018437956521645395,
        -0.0029498416289833475,
    ];
    for (pair, wanted) in published_noise(5).iter().zip(published) {
        assert!((1000.0 * pair[0] - wanted).abs() < 1e-12, "{pair:?}");
        assert_eq!(pair[0], pair[1]);
    }
}

#[test]
fn the_reference_has_the_stated_peaks() {
    let Some(folder) = folder() else { return };
    for row in &rows(&folder, "peaks.csv")[1..] {
        let ground = record(&folder, &row[0]);
        assert_eq!(ground.len(), row[1].parse::<usize>().unwrap());
        let motions = reference(&ground).unwrap();
        let peak = |v: &[f64]| v.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        for (history, (cell, unit)) in [0, 1, 2, 4].into_iter().zip([
            (&row[2], 1e3),
            (&row[3], 1.0),
            (&row[4], 1e3),
            (&row[5], 1e3),
        ]) {
            let wanted: f64 = cell.parse().unwrap();
            let got = unit * peak(&motions[history]);
            assert!(
                (got / wanted - 1.0).abs() < 1e-5,
                "{} {got} {wanted}",
                row[0]
            );
        }
    }
}

#[test]
fn the_sample_law_scores_as_stated() {
    let Some(folder) = folder() else { return };
    let table = rows(&folder, "rodeac-nominal.csv");
    let columns: BTreeMap<&str, usize> = COLUMNS
        .iter()
        .enumerate()
        .map(|(i, name)| (*name, i))
        .collect();
    let mut largest = [0.0f64; 2];
    for motion in MOTIONS {
        let ground = record(&folder, motion);
        let (whole, ideal) = (reference(&ground).unwrap(), perfect(&ground).unwrap());
        for row in table.iter().filter(|row| row[0] == motion) {
            let quiet = row[1] == "none";
            let noise = match quiet {
                true => vec![[0.0; 2]; ground.len()],
                false => published_noise(ground.len()),
            };
            let setting = Setting {
                plant: &PlantParameters::default(),
                ground: &ground,
                noise: &noise,
            };
            let histories = run(&setting, &mut DecentralisedAdaptive::default()).unwrap();
            let scores = criteria(&histories, &whole, &ideal);
            for (name, cell) in table[0].iter().zip(row).skip(2) {
                let (got, wanted) = (scores[columns[name.as_str()]], cell.parse::<f64>().unwrap());
                let within = if quiet { 0.01 } else { 0.025 };
                let worst = &mut largest[usize::from(!quiet)];
                *worst = worst.max((got - wanted).abs());
                assert!(
                    (got - wanted).abs() <= within,
                    "{motion} {} {name}: {got} {wanted}",
                    row[1]
                );
            }
        }
    }
    println!(
        "largest differences: quiet {}, published noise {}",
        largest[0], largest[1]
    );
}

/// Means and largest values over the motions on given plants with independent noise.
fn scores(
    folder: &std::path::Path,
    plants: &[PlantParameters],
    design: PredictiveDesign,
) -> BTreeMap<&'static str, [f64; 2]> {
    let mut rows = Vec::new();
    for (m, motion) in MOTIONS.iter().enumerate() {
        let ground = record(folder, motion);
        let (whole, ideal) = (reference(&ground).unwrap(), perfect(&ground).unwrap());
        for (p, plant) in plants.iter().enumerate() {
            let noise = independent_noise(2026, (m << 8 | p) as u64, ground.len());
            let setting = Setting {
                plant,
                ground: &ground,
                noise: &noise,
            };
            let histories = run(&setting, &mut Predictive::new(design).unwrap()).unwrap();
            assert_eq!(histories.samples(), ground.len(), "{motion} plant {p}");
            rows.push(criteria(&histories, &whole, &ideal));
        }
    }
    let of = |i: usize| {
        let values = rows.iter().map(|row| row[i]);
        let mean = values.clone().sum::<f64>() / rows.len() as f64;
        [mean, values.fold(0.0, f64::max)]
    };
    COLUMNS
        .into_iter()
        .enumerate()
        .map(|(i, name)| (name, of(i)))
        .collect()
}

fn estimating() -> PredictiveDesign {
    PredictiveDesign {
        class: Class::Estimate,
        order: 3,
        ..PredictiveDesign::default()
    }
}

#[test]
fn adaptive_predictive_laws_meet_their_targets_on_plants_they_have_not_seen() {
    let Some(folder) = folder() else { return };
    let nominal = PlantParameters::default();
    let drawn = (1..=3).map(|i| Deviation::default().draw(&nominal, 2026, i));
    let plants: Vec<_> = std::iter::once(nominal).chain(drawn).collect();
    for (design, targets) in [
        (
            PredictiveDesign::default(),
            [
                [3.75, 5.1],
                [1.92, 2.6],
                [0.65, 1.0],
                [0.37, 0.55],
                [0.12, 0.2],
            ],
        ),
        (
            estimating(),
            [
                [3.5, 4.75],
                [1.8, 2.45],
                [0.15, 0.3],
                [0.08, 0.15],
                [0.03, 0.06],
            ],
        ),
    ] {
        let scores = scores(&folder, &plants, design);
        // Not J3, which is the largest draw of the sensors' noise: with a perfect actuator, too.
        let columns = ["J2_1", "J2_2", "true_J2_1", "true_J2_2", "H8"];
        for (column, [mean, largest]) in columns.into_iter().zip(targets) {
            let got = scores[column];
            println!("{:?} {column} {got:.3?}", design.class);
            assert!(
                got[0] <= mean && got[1] <= largest,
                "{:?} {column} {got:?}",
                design.class
            );
        }
    }
}

/// Three deviations at once, static gains 5 % off, every command a sample late.
#[test]
fn adaptive_predictive_laws_track_at_the_corners() {
    let Some(folder) = folder() else { return };
    let nominal = PlantParameters::default();
    let plants: Vec<_> = corners(3.0)
        .step_by(171)
        .enumerate()
        .map(|(i, by)| {
            let mut plant = Deviation::default().moved(&nominal, by);
            let off = if i % 2 == 0 { 1.05 } else { 0.95 };
            for gain in plant.static_gain.iter_mut().flatten() {
                *gain *= off;
            }
            plant.delay = [1; 2];
            plant
        })
        .collect();
    for (design, target) in [(PredictiveDesign::default(), 1.0), (estimating(), 0.7)] {
        let scores = scores(&folder, &plants, design);
        for column in ["true_J2_1", "true_J2_2"] {
            println!("{:?} {column} {:.3?}", design.class, scores[column]);
            assert!(scores[column][1] <= target, "{:?} {column}", design.class);
        }
    }
}
