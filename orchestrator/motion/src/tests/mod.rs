//! Tests of ground motions, and what they share.

mod processing;
mod reading;
mod synthetic;

use std::path::PathBuf;

use std::path::Path;

use super::*;
use units::convert;
use units::{INCH, STANDARD_GRAVITY};

/// The folder of the shared records.
fn shared_records() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(beside, PathBuf::from);
    shared.join("records")
}

/// Writes `text` to a file of that name and reads it as a record.
fn record(name: &str, text: &str) -> Result<Record, MotionError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_record(&path)
}

/// The message of the error, without the temporary folder.
fn message(name: &str, text: &str) -> String {
    let text = record(name, text).unwrap_err().to_string();
    text[text.find(name).unwrap()..].to_string()
}

fn reference(text: &str, options: &Options) -> Result<Motion, MotionError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.csv");
    std::fs::write(&path, text).unwrap();
    load_reference(&path, options)
}

fn reference_message(text: &str) -> String {
    let text = reference(text, &Options::default())
        .unwrap_err()
        .to_string();
    text[text.find("reference").unwrap()..].to_string()
}

/// Plain trapezoidal integral from rest.
fn trapezoid(values: &[f64], dt: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut integral = vec![0.0];
    for pair in values.windows(2) {
        sum += 0.5 * dt * (pair[0] + pair[1]);
        integral.push(sum);
    }
    integral
}

/// A record of `points` values of a decaying 2 Hz burst, as rows of `t_s,a_g`.
fn burst(points: usize, dt: f64) -> String {
    let mut text = String::from("# a burst\nt_s,a_g\n");
    for n in 0..points {
        let t = n as f64 * dt;
        let a = 0.2 * (t / 3.0).powi(2) * (2.0 - t).exp() * (12.5 * t).sin();
        text.push_str(&format!("{t:.4},{a:.8}\n"));
    }
    text
}

/// Played motion: starts and ends at rest; velocity and acceleration are the derivatives of the
/// displacement. Independent of how they were made: an eighth-order difference formula, and the
/// sum of the acceleration (Simpson) ends at zero velocity.
fn check_motion(motion: &Motion) {
    let h = motion.dt;
    let derivative = |f: &[f64], n: usize| {
        let pair = |k: usize| f[n + k] - f[n - k];
        (672.0 * pair(1) - 168.0 * pair(2) + 32.0 * pair(3) - 3.0 * pair(4)) / (840.0 * h)
    };
    for (of, rate) in [
        (&motion.displacement, &motion.velocity),
        (&motion.velocity, &motion.acceleration),
    ] {
        let size = peak(rate);
        let worst = (4..of.len() - 4)
            .map(|n| (derivative(of, n) - rate[n]).abs())
            .fold(0.0, f64::max);
        assert!(
            worst < 2e-4 * size,
            "{}: {} of the peak",
            motion.name,
            worst / size
        );
    }
    for history in [&motion.displacement, &motion.velocity, &motion.acceleration] {
        assert_eq!(history.len(), motion.len());
        assert!(history.iter().all(|value| value.is_finite()));
        assert!(history[0].abs() < 1e-12 && history[history.len() - 1].abs() < 1e-12);
    }
    let velocity = trapezoid(&motion.acceleration, h);
    let displacement = trapezoid(&velocity, h);
    assert!(velocity[velocity.len() - 1].abs() < 1e-6 * motion.peak_velocity());
    assert!(displacement[displacement.len() - 1].abs() < 1e-4 * motion.peak_displacement());
}
