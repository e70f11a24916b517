//! What a laboratory plays: earthquakes, drawn or recorded, and multisines.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use crate::dice::Dice;
use crate::noise::{forward, inverse};

/// Bounds that a motion is scaled to: the first that is met.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Largest displacement, in the unit of length.
    pub displacement: f64,
    /// Largest acceleration, in that unit a second squared.
    pub acceleration: f64,
}

/// An earthquake of Clough and Penzien's spectrum under an envelope: displacement of `n` samples.
pub fn earthquake(n: usize, rate: f64, bounds: Bounds, dice: &mut Dice) -> Vec<f64> {
    let ground = (dice.between(1.5, 4.0), dice.even(0.3, 0.7));
    let lowest = (dice.between(0.2, 0.5), 0.6);
    let corner = dice.between(8.0, 15.0);
    let (rise, hold) = (dice.even(0.05, 0.2), dice.even(0.1, 0.4));
    let decay = dice.even(4.0, 9.0);
    let mut acceleration: Vec<f64> = (0..n)
        .map(|k| {
            let t = k as f64 / n as f64;
            let envelope =
                (t / rise).min(1.0).powi(2) * (-decay * (t - rise - hold).max(0.0)).exp();
            envelope * dice.gauss()
        })
        .collect();
    let shape = |f: f64| {
        let r2 = (f / ground.0).powi(2);
        let damped = 4.0 * ground.1 * ground.1 * r2;
        let soil = (1.0 + damped) / ((1.0 - r2).powi(2) + damped);
        let q2 = (f / lowest.0).powi(2);
        let rock = q2 * q2 / ((1.0 - q2).powi(2) + 4.0 * lowest.1 * lowest.1 * q2);
        (soil * rock).sqrt()
    };
    acceleration[0] = 0.0;
    displacement(&acceleration, rate, bounds, |f| {
        shape(f) / (1.0 + (f / corner).powi(8)).sqrt()
    })
}

/// `n` samples of a recorded earthquake, its strongest part; `None` where the file cannot be read.
pub fn recorded(path: &Path, n: usize, rate: f64, bounds: Bounds) -> Option<Vec<f64>> {
    let text = fs::read_to_string(path).ok()?;
    let mut step: Option<f64> = None;
    let mut values = Vec::new();
    if path.extension().is_some_and(|e| e == "AT2") {
        let mut lines = text.lines().skip(3);
        let head = lines.next()?;
        let after = head.split("DT=").nth(1)?;
        step = after.split_whitespace().next()?.parse().ok();
        values.extend(
            lines
                .flat_map(str::split_whitespace)
                .filter_map(|v| v.parse::<f64>().ok()),
        );
    } else {
        let rows = text.lines().filter_map(|line| {
            let (time, value) = line.split_once(',')?;
            Some((time.parse::<f64>().ok()?, value.parse::<f64>().ok()?))
        });
        let rows: Vec<(f64, f64)> = rows.collect();
        if let [first, second, ..] = rows[..] {
            step = Some(second.0 - first.0);
        }
        values.extend(rows.iter().map(|row| row.1));
    }
    let step = step?;
    let at = |t: f64| {
        let place = t / step;
        let (k, share) = (place.floor() as usize, place.fract());
        let value = |k: usize| values.get(k).copied().unwrap_or(0.0);
        value(k) * (1.0 - share) + value(k + 1) * share
    };
    let all: Vec<f64> = (0..(values.len() as f64 * step * rate) as usize)
        .map(|k| at(k as f64 / rate))
        .collect();
    // The window of the largest energy.
    let energy = |from: usize| -> f64 {
        all[from..(from + n).min(all.len())]
            .iter()
            .map(|a| a * a)
            .sum()
    };
    let begin = (0..all.len().saturating_sub(n) + 1)
        .step_by(rate as usize)
        .max_by(|a, b| energy(*a).total_cmp(&energy(*b)))?;
    let mut window: Vec<f64> = all[begin..(begin + n).min(all.len())].to_vec();
    window.resize(n, 0.0);
    Some(displacement(&window, rate, bounds, |f| {
        let (low, high) = (f / 0.3, f / 18.0);
        low.powi(4) / (1.0 + low.powi(8)).sqrt() / (1.0 + high.powi(8)).sqrt()
    }))
}

/// Sines of random phase on a grid up to 15 Hz.
pub fn multisine(n: usize, rate: f64, bounds: Bounds, dice: &mut Dice) -> Vec<f64> {
    let corner = dice.between(0.8, 2.0);
    let mut bins = vec![realfft::num_complex::Complex::new(0.0, 0.0); n / 2 + 1];
    for (k, bin) in bins.iter_mut().enumerate().skip(1) {
        let f = k as f64 * rate / n as f64;
        let phase = dice.even(0.0, TAU);
        if (0.1..15.0).contains(&f) && !dice.chance(0.3) {
            let size = 1.0 / (1.0 + (f / corner).powi(2));
            *bin = realfft::num_complex::Complex::from_polar(size, phase);
        }
    }
    let length = 2 * (n / 2);
    let mut motion = inverse(bins, length);
    motion.resize(n, 0.0);
    faded(motion, rate, bounds)
}

/// Displacement of an acceleration that was passed through the amplitude `filter`.
fn displacement(
    acceleration: &[f64],
    rate: f64,
    bounds: Bounds,
    filter: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let n = acceleration.len();
    let length = 2 * n;
    let mut padded = acceleration.to_vec();
    padded.resize(length, 0.0);
    let mut bins = forward(&padded);
    for (k, bin) in bins.iter_mut().enumerate() {
        let f = k as f64 * rate / length as f64;
        *bin *= if k == 0 {
            0.0
        } else {
            -filter(f) / (TAU * f).powi(2)
        };
    }
    let mut motion = inverse(bins, length);
    motion.truncate(n);
    faded(motion, rate, bounds)
}

/// Faded in and out within a second and scaled.
fn faded(mut motion: Vec<f64>, rate: f64, bounds: Bounds) -> Vec<f64> {
    let n = motion.len();
    for (k, value) in motion.iter_mut().enumerate() {
        let edge = (k.min(n - 1 - k) as f64 / rate).min(1.0);
        *value *= edge.powi(3) * (10.0 - 15.0 * edge + 6.0 * edge * edge);
    }
    let peak = motion.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let sharpest = motion
        .windows(3)
        .map(|w| (w[0] - 2.0 * w[1] + w[2]) * rate * rate)
        .fold(0.0f64, |m, a| m.max(a.abs()));
    let factor = (bounds.displacement / peak).min(bounds.acceleration / sharpest);
    motion.iter_mut().for_each(|value| *value *= factor);
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_keep_their_bounds_and_end_at_rest() {
        let bounds = Bounds {
            displacement: 1.0,
            acceleration: 100.0,
        };
        for seed in 0..4 {
            let dice = &mut Dice::new(seed, 0);
            for motion in [
                earthquake(7500, 500.0, bounds, dice),
                multisine(7500, 500.0, bounds, dice),
            ] {
                let peak = motion.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                assert!(peak <= 1.0 + 1e-12 && peak > 0.05, "{peak}");
                assert!(motion[0].abs() < 1e-9 && motion[7499].abs() < 1e-9);
            }
        }
    }
}
