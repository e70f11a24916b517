//! Resonances from a low-level search: frequencies and damping with intervals, and their shift.
//!
//! The transfer function from the table's to the specimen's acceleration has a maximum near each resonance.
//! There `(b0 + b1 s)/(s² + 2 zeta omega s + omega²) + d` is fitted to the transforms of the whole records,
//! which begin and end at rest, so that no window biases the damping. Intervals are those of least squares with
//! the errors that the fit left.

use std::f64::consts::TAU;

use motion::metrics::spectrum;
use motion::{Motion, smooth_step};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};
use sysid::spectra::Spectra;
use units::STANDARD_GRAVITY;

use crate::rule::Search;

/// Segments of the averaged transfer function, s.
const SEGMENT: f64 = 8.0;
/// Least amplification and coherence of a resonance.
const LEAST_GAIN: f64 = 1.8;
const LEAST_COHERENCE: f64 = 0.5;
/// The fit goes from a resonance over this factor and to one over it.
const REACH: f64 = 1.25;
/// Resonances that are reported at most.
const MOST: usize = 6;
/// 97.5 % of a normal distribution.
const NORMAL: f64 = 1.959_963_985;
/// Rise and fall of a search's motion, s, and rest after it.
const EDGE: f64 = 2.0;
const REST: f64 = 4.0;

/// How a search moves the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Excitation {
    /// One sine sweep upwards, by octaves.
    Sweep,
    /// Random, flat in acceleration, for 60 s.
    Random,
}

/// A resonance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Resonance {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Its 95 % interval, Hz.
    pub interval_95: [f64; 2],
    /// Damping ratio.
    pub damping: f64,
    /// Its 95 % interval.
    pub damping_interval_95: [f64; 2],
    /// Amplification there.
    pub gain: f64,
    /// Coherence there.
    pub coherence: f64,
}

/// A resonance before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shift {
    /// Before, Hz.
    pub before_hz: f64,
    /// After, Hz.
    pub after_hz: f64,
    /// Change of the frequency, %.
    pub shift_percent: f64,
    /// Its 95 % interval, %.
    pub interval_95: [f64; 2],
    /// Whether the interval excludes zero.
    pub changed: bool,
}

/// The averaged transfer function.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Transfer {
    /// Hz.
    pub frequency_hz: Vec<f64>,
    /// Specimen over table.
    pub gain: Vec<f64>,
    /// Coherence.
    pub coherence: Vec<f64>,
}

/// What a search found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Resonances by frequency.
    pub resonances: Vec<Resonance>,
    /// The transfer function.
    pub transfer: Transfer,
}

/// The motion of a search, at rest at both ends; below the frequency at which its level would need more than
/// the displacement `most` (m) it is smaller.
#[must_use]
pub fn excitation(search: &Search, how: Excitation, seed: u64, dt: f64, most: f64) -> Motion {
    let [low, high] = search.band_hz;
    let octaves = (high / low).log2();
    let peak = search.level_g * STANDARD_GRAVITY;
    let (duration, phases): (f64, Vec<f64>) = match how {
        Excitation::Sweep => (60.0 * octaves / search.octaves_per_minute, Vec::new()),
        Excitation::Random => {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            (
                60.0,
                (0..((high - low) * 60.0) as usize)
                    .map(|_| random.random_range(0.0..TAU))
                    .collect(),
            )
        }
    };
    let duration = duration.max(4.0 * EDGE);
    let samples = (duration / dt) as usize + 1;
    let rate = octaves * std::f64::consts::LN_2 / duration;
    // The frequency changes slowly: the displacement is `-a/omega²` closely. Its derivatives are taken of itself.
    let mut displacement: Vec<f64> = (0..samples)
        .map(|n| {
            let t = n as f64 * dt;
            let window = smooth_step((t / EDGE).min(1.0))[0]
                * smooth_step(((duration - t).max(0.0) / EDGE).min(1.0))[0];
            let value = match how {
                Excitation::Sweep => {
                    let omega = TAU * low * (rate * t).exp();
                    let phase = TAU * low / rate * ((rate * t).exp() - 1.0);
                    -(peak / (omega * omega)).min(most) * phase.sin()
                }
                Excitation::Random => phases
                    .iter()
                    .enumerate()
                    .map(|(k, phase)| {
                        let omega = TAU * (low + k as f64 / 60.0);
                        // Peaks of many lines are about four times their root mean square.
                        let part = 0.35 / (phases.len() as f64).sqrt();
                        -part * (peak / (omega * omega)).min(most) * (omega * t + phase).sin()
                    })
                    .sum(),
            };
            window * value
        })
        .collect();
    displacement.resize(samples + (REST / dt) as usize, 0.0);
    let [velocity, acceleration] = derivatives(&displacement, dt);
    Motion {
        name: format!("resonance search, {} g", search.level_g),
        dt,
        displacement,
        velocity,
        acceleration,
        notes: Vec::new(),
        seed: (how == Excitation::Random).then_some(seed),
        across: None,
    }
}

/// First and second derivative by central differences of the fourth order.
fn derivatives(x: &[f64], dt: f64) -> [Vec<f64>; 2] {
    let at = |n: usize, k: isize| {
        let place = n as isize + k;
        usize::try_from(place)
            .ok()
            .and_then(|place| x.get(place))
            .copied()
            .unwrap_or(0.0)
    };
    let first = |n: usize| (8.0 * (at(n, 1) - at(n, -1)) - (at(n, 2) - at(n, -2))) / (12.0 * dt);
    let second = |n: usize| {
        (16.0 * (at(n, 1) + at(n, -1)) - (at(n, 2) + at(n, -2)) - 30.0 * at(n, 0))
            / (12.0 * dt * dt)
    };
    [
        (0..x.len()).map(first).collect(),
        (0..x.len()).map(second).collect(),
    ]
}

/// Resonances of a specimen's acceleration over its table's within a band (Hz), samples every `dt` s.
#[must_use]
pub fn find(table: &[f64], specimen: &[f64], dt: f64, band: [f64; 2]) -> Found {
    let samples = table.len().min(specimen.len());
    let (table, specimen) = (&table[..samples], &specimen[..samples]);
    let segment = ((SEGMENT / dt) as usize).min(samples / 4) & !1;
    let Ok(spectra) = Spectra::new(&[table, specimen], dt, segment) else {
        return Found::default();
    };
    let lines = 0..spectra.frequency.len();
    let inside: Vec<usize> = lines
        .filter(|k| (band[0]..=band[1]).contains(&spectra.frequency[*k]))
        .collect();
    let transfer = Transfer {
        frequency_hz: inside.iter().map(|&k| spectra.frequency[k]).collect(),
        gain: inside
            .iter()
            .map(|&k| spectra.gain(0, 1, k).norm())
            .collect(),
        coherence: inside.iter().map(|&k| spectra.coherence(0, 1, k)).collect(),
    };
    let gain = &transfer.gain;
    let mut peaks: Vec<usize> = (1..gain.len().saturating_sub(1))
        .filter(|&n| {
            let near = |other: &usize| {
                let ratio = transfer.frequency_hz[*other] / transfer.frequency_hz[n];
                (1.0 / REACH..=REACH).contains(&ratio)
            };
            let highest = (0..gain.len())
                .filter(near)
                .all(|other| gain[other] <= gain[n]);
            highest && gain[n] >= LEAST_GAIN && transfer.coherence[n] >= LEAST_COHERENCE
        })
        .collect();
    peaks.sort_by(|a, b| gain[*b].total_cmp(&gain[*a]));
    peaks.truncate(MOST);
    peaks.sort_unstable();
    let length = samples.next_multiple_of(1000);
    let transforms = [spectrum(table, length), spectrum(specimen, length)];
    let step = 1.0 / (length as f64 * dt);
    let resonances = peaks.iter().filter_map(|&n| {
        let start = transfer.frequency_hz[n];
        let fitted = fit(&transforms, step, start, band)?;
        Some(Resonance {
            gain: gain[n],
            coherence: transfer.coherence[n],
            ..fitted
        })
    });
    Found {
        resonances: resonances.collect(),
        transfer,
    }
}

/// Columns of the linear part: `b0`, `b1`, `d` of the model, at frequency and damping.
fn columns(
    [omega, zeta]: [f64; 2],
    lines: &[(f64, Complex64, Complex64)],
) -> (DMatrix<f64>, DVector<f64>) {
    let mut matrix = DMatrix::zeros(2 * lines.len(), 3);
    let mut wanted = DVector::zeros(2 * lines.len());
    for (n, (w, input, output)) in lines.iter().enumerate() {
        let s = Complex64::new(0.0, *w);
        let under = input / (omega * omega - w * w + 2.0 * zeta * omega * s);
        for (k, value) in [under * omega * omega, under * s * omega, *input]
            .iter()
            .enumerate()
        {
            matrix[(2 * n, k)] = value.re;
            matrix[(2 * n + 1, k)] = value.im;
        }
        wanted[2 * n] = output.re;
        wanted[2 * n + 1] = output.im;
    }
    (matrix, wanted)
}

/// Errors that are left at frequency and damping, with the best linear part.
fn left(at: [f64; 2], lines: &[(f64, Complex64, Complex64)]) -> Option<DVector<f64>> {
    let (matrix, wanted) = columns(at, lines);
    let square = matrix.transpose() * &matrix;
    let solution = square.cholesky()?.solve(&(matrix.transpose() * &wanted));
    Some(wanted - matrix * solution)
}

/// Gauss and Newton on frequency and damping, from the maximum of the transfer function.
fn fit(
    [table, specimen]: &[Vec<Complex64>; 2],
    step: f64,
    start: f64,
    band: [f64; 2],
) -> Option<Resonance> {
    let [low, high] = [
        (start / REACH).max(0.9 * band[0]),
        (start * REACH).min(1.1 * band[1]),
    ];
    let lines: Vec<(f64, Complex64, Complex64)> = (1..table.len())
        .map(|k| (k as f64 * step, k))
        .filter(|(f, _)| (low..=high).contains(f))
        .map(|(f, k)| (TAU * f, table[k], specimen[k]))
        .collect();
    if lines.len() < 8 {
        return None;
    }
    let mut at = [TAU * start, 0.05];
    let (mut damping, mut cost) = (1e-3, left(at, &lines)?.norm_squared());
    let mut information = DMatrix::<f64>::zeros(2, 2);
    for _ in 0..60 {
        let errors = left(at, &lines)?;
        let slopes = [0, 1].map(|k| {
            let mut moved = at;
            let by = 1e-5 * [TAU * start, 0.05][k];
            moved[k] += by;
            left(moved, &lines).map(|other| (other - &errors) / by)
        });
        let [Some(first), Some(second)] = slopes else {
            return None;
        };
        let jacobian = DMatrix::from_columns(&[first, second]);
        information = jacobian.transpose() * &jacobian;
        let slope = jacobian.transpose() * &errors;
        let mut damped = information.clone();
        for k in 0..2 {
            damped[(k, k)] *= 1.0 + damping;
        }
        let change = damped.cholesky()?.solve(&slope);
        let next = [at[0] - change[0], (at[1] - change[1]).clamp(1e-4, 0.7)];
        let found = left(next, &lines).map_or(f64::INFINITY, |own| own.norm_squared());
        if found <= cost {
            let moved = ((next[0] - at[0]) / at[0]).abs() + (next[1] - at[1]).abs();
            (at, cost, damping) = (next, found, 0.3 * damping);
            if moved < 1e-10 {
                break;
            }
        } else {
            damping = (10.0 * damping).max(1e-6);
            if damping > 1e8 {
                break;
            }
        }
    }
    let free = (2 * lines.len() - 5) as f64;
    let covariance = information.try_inverse()? * (cost / free);
    let [frequency, deviation] = [at[0] / TAU, covariance[(0, 0)].max(0.0).sqrt() / TAU];
    let spread = covariance[(1, 1)].max(0.0).sqrt();
    let is_inside = frequency > low && frequency < high && deviation < 0.2 * frequency;
    is_inside.then(|| Resonance {
        frequency_hz: frequency,
        interval_95: [
            frequency - NORMAL * deviation,
            frequency + NORMAL * deviation,
        ],
        damping: at[1],
        damping_interval_95: [(at[1] - NORMAL * spread).max(0.0), at[1] + NORMAL * spread],
        gain: 0.0,
        coherence: 0.0,
    })
}

/// Each resonance before with the nearest one after, within a factor of 1.25.
#[must_use]
pub fn shifts(before: &[Resonance], after: &[Resonance]) -> Vec<Shift> {
    let distance = |a: &Resonance, b: &Resonance| (a.frequency_hz / b.frequency_hz).ln().abs();
    let pairs = before.iter().filter_map(|one| {
        let nearest = after
            .iter()
            .min_by(|a, b| distance(a, one).total_cmp(&distance(b, one)))?;
        (distance(nearest, one) < REACH.ln()).then_some((one, nearest))
    });
    pairs
        .map(|(one, other)| {
            let deviation = |own: &Resonance| 0.5 * (own.interval_95[1] - own.interval_95[0]);
            let shift = 100.0 * (other.frequency_hz / one.frequency_hz - 1.0);
            let half = 100.0 * deviation(one).hypot(deviation(other)) / one.frequency_hz;
            Shift {
                before_hz: one.frequency_hz,
                after_hz: other.frequency_hz,
                shift_percent: shift,
                interval_95: [shift - half, shift + half],
                changed: shift.abs() > half,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rule;

    /// Acceleration of an oscillator on a table, integrated in small steps, with noise in both.
    fn search(frequency: f64, damping: f64, how: Excitation, seed: u64) -> Found {
        let own = Rule::ac156(1.0, 0.0, false).search;
        let drive = excitation(&own, how, seed, 0.002, 1.0);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut x, mut v, omega) = (0.0, 0.0, TAU * frequency);
        let mut noise = || 0.04 * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        let (mut table, mut specimen) = (Vec::new(), Vec::new());
        for pair in drive.acceleration.windows(2) {
            table.push(pair[0] + noise());
            specimen.push(-(omega * omega * x + 2.0 * damping * omega * v) + noise());
            for part in 0..20 {
                let a = pair[0] + (pair[1] - pair[0]) * f64::from(part) / 20.0;
                v += 1e-4 * (-a - omega * omega * x - 2.0 * damping * omega * v);
                x += 1e-4 * v;
            }
        }
        find(&table, &specimen, 0.002, own.band_hz)
    }

    #[test]
    fn a_resonance_is_found_with_its_interval_by_sweep_and_by_noise() {
        for how in [Excitation::Sweep, Excitation::Random] {
            let found = search(4.0, 0.03, how, 2).resonances;
            assert_eq!(found.len(), 1, "{how:?} {found:?}");
            let own = &found[0];
            println!("{own:?}");
            assert!((own.frequency_hz / 4.0 - 1.0).abs() < 3e-3, "{own:?}");
            assert!((own.damping / 0.03 - 1.0).abs() < 0.05, "{own:?}");
            assert!(own.interval_95[1] - own.interval_95[0] < 0.04, "{own:?}");
        }
    }

    /// Of a frequency that grows evenly in octaves, `(high - low) T / ln(high / low)` cycles pass in T; one octave
    /// takes 30 s at two a minute.
    #[test]
    fn a_sweep_has_the_cycles_of_its_band_and_the_level_of_its_search() {
        let search = Search {
            level_g: 0.1,
            octaves_per_minute: 2.0,
            band_hz: [2.0, 16.0],
        };
        let motion = excitation(&search, Excitation::Sweep, 1, 0.002, 10.0);
        let crossings = motion
            .displacement
            .windows(2)
            .filter(|pair| pair[0] * pair[1] < 0.0);
        let cycles = 0.5 * crossings.count() as f64;
        let expected = 14.0 * 90.0 / f64::ln(8.0);
        assert!((cycles - expected).abs() < 2.0, "{cycles} {expected}");
        let middle = &motion.acceleration[motion.len() / 3..motion.len() / 2];
        let peak = motion::peak(middle) / (0.1 * STANDARD_GRAVITY);
        assert!((peak - 1.0).abs() < 0.03, "{peak}");
        // A table of a tenth of a millimetre moves no further.
        let short = excitation(&search, Excitation::Sweep, 1, 0.002, 1e-4);
        assert!(motion::peak(&short.displacement) <= 1.000_001e-4);
    }

    #[test]
    fn five_percent_less_stiffness_is_a_shift_and_none_is_not() {
        let before = search(6.0, 0.04, Excitation::Sweep, 3).resonances;
        let same = search(6.0, 0.04, Excitation::Sweep, 4).resonances;
        let softer = search(6.0 * 0.95_f64.sqrt(), 0.04, Excitation::Sweep, 5).resonances;
        let kept = shifts(&before, &same);
        assert!(kept.len() == 1 && !kept[0].changed, "{kept:?}");
        let changed = shifts(&before, &softer);
        assert!(changed.len() == 1 && changed[0].changed, "{changed:?}");
        let expected = 100.0 * (0.95_f64.sqrt() - 1.0);
        assert!(
            (changed[0].shift_percent - expected).abs() < 0.2,
            "{changed:?}"
        );
    }
}
