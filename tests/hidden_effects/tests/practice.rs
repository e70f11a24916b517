//! The independent rig against the practice cases in which nothing is hidden.

use std::path::PathBuf;
use std::{env, fs};

use hidden_effects::hidden::Hidden;
use hidden_effects::law::Law;
use hidden_effects::plant::NOMINAL;
use hidden_effects::rig::{RATE, Rig};

fn record(case: &str, name: &str) -> Vec<Vec<f64>> {
    let shared = env::var_os("SHAKEBENCH_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let path = shared
        .join("hidden-effects/cases")
        .join(case)
        .join(format!("{name}.csv"));
    let text = fs::read_to_string(&path).expect("a file of the shared data");
    let rows = text.lines().skip(1);
    rows.map(|row| {
        row.split(',')
            .map(|cell| cell.parse().expect("a number"))
            .collect()
    })
    .collect()
}

fn derivatives(reference: &[f64], k: usize) -> [f64; 3] {
    let last = reference.len() - 1;
    let (before, after) = (reference[k.saturating_sub(1)], reference[(k + 1).min(last)]);
    let second = (after - 2.0 * reference[k] + before) * RATE * RATE;
    [reference[k], (after - before) * RATE / 2.0, second]
}

#[needs::shared("hidden-effects/cases")]
#[test]
fn the_law_gives_the_recorded_voltage_to_its_noise() {
    for case in ["dev-01", "dev-04", "dev-11"] {
        let rows = record(case, "identification");
        let reference: Vec<f64> = rows.iter().map(|row| row[6]).collect();
        let mut law = Law::default();
        let residuals: Vec<f64> = rows
            .iter()
            .enumerate()
            .map(|(k, row)| row[1] - law.command(derivatives(&reference, k), row[2], row[3]))
            .collect();
        // The ends depend on how the reference is continued beyond the record.
        let inner = &residuals[5..residuals.len() - 5];
        let rms = (inner.iter().map(|e| e * e).sum::<f64>() / inner.len() as f64).sqrt();
        assert!((rms - 0.0005).abs() < 0.00005, "{case}: {rms} V");
    }
}

#[needs::shared("hidden-effects/cases")]
#[test]
fn the_nominal_rig_follows_the_records_within_the_mismatch() {
    for case in ["dev-01", "dev-02"] {
        let rows = record(case, "identification");
        let reference: Vec<f64> = rows.iter().map(|row| row[6]).collect();
        let mut rig = Rig::new(NOMINAL, Hidden::default());
        let mut law = Law::default();
        let mut errors = [0.0; 4];
        let mut sizes = [0.0; 4];
        for (k, row) in rows.iter().enumerate() {
            let now = rig.sample();
            for (i, simulated) in [now.x, now.a, now.f, now.s].into_iter().enumerate() {
                errors[i] += (row[i + 2] - simulated).powi(2);
                sizes[i] += row[i + 2].powi(2);
            }
            rig.advance(law.command(derivatives(&reference, k), now.x, now.a), 0.0);
        }
        for (i, channel) in ["x", "a", "F", "as"].into_iter().enumerate() {
            let relative = (errors[i] / sizes[i]).sqrt();
            println!("{case} {channel}: {relative:.4}");
            assert!(relative < 0.12, "{case} {channel}: {relative}");
        }
    }
}
