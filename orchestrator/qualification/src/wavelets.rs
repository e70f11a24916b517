//! Matching in time (Lilhanand and Tseng 1988; Al Atik and Abrahamson 2010): wavelets are added where
//! oscillators have their largest responses, so that these change by what they lack.
//!
//! A wavelet is a displacement `(1 - u²)⁴ cos` or `sin` of some cycles, and its velocity and acceleration are
//! the exact derivatives. It begins and ends at rest where it came from, so that no baseline is corrected. The
//! responses of all oscillators at their times to all wavelets are a linear system with two wavelets per
//! oscillator; its solution of the least norm is added, and the spectrum is computed again.

use std::f64::consts::TAU;

use motion::metrics::{Measure, Peak, response_peaks};
use nalgebra::{DMatrix, DVector};
use units::STANDARD_GRAVITY;

use crate::rule::{Rule, grid};

/// Rounds at most.
const ROUNDS: usize = 24;
/// Part of what is lacking that a round adds.
const PART: f64 = 0.8;
/// Regularisation relative to the mean of the diagonal.
const REGULARISATION: f64 = 3e-3;
/// Where the centre of a wavelet is before the largest response, in its lengths.
const BEFORE: f64 = 0.3;
/// Decay after which an oscillator has forgotten, in time constants.
const FORGOTTEN: f64 = 5.0;

/// A spectrum to come to.
#[derive(Debug, Clone)]
pub struct Aim {
    /// Oscillators, Hz.
    pub frequencies: Vec<f64>,
    /// Their required response, m/s².
    pub required: Vec<f64>,
    /// Damping ratio.
    pub damping: f64,
    /// What is required of them.
    pub measure: Measure,
    /// Ratio to come to.
    pub centre: f64,
    /// Ratios that are good enough.
    pub enough: [f64; 2],
}

impl Aim {
    /// That of a rule: its band and a little beyond, at 24 or more oscillators per octave.
    #[must_use]
    pub fn of(rule: &Rule, centre: f64, enough: [f64; 2]) -> Self {
        let per_octave = if rule.damping < 0.035 { 36 } else { 24 };
        let [low, high] = rule.band_hz;
        let frequencies = grid([low, high], per_octave, 0.0);
        Self {
            required: frequencies
                .iter()
                .map(|f| STANDARD_GRAVITY * rule.required(*f))
                .collect(),
            frequencies,
            damping: rule.damping,
            measure: rule.measure,
            centre,
            enough,
        }
    }

    pub(crate) fn peaks(&self, acceleration: &[f64], dt: f64) -> Vec<Peak> {
        response_peaks(
            acceleration,
            dt,
            &self.frequencies,
            self.damping,
            self.measure,
        )
    }

    pub(crate) fn ratios(&self, peaks: &[Peak]) -> Vec<f64> {
        let both = peaks.iter().zip(&self.required);
        both.map(|(peak, required)| peak.value.abs() / required)
            .collect()
    }
}

/// Displacement, velocity and acceleration, SI.
pub type Histories = [Vec<f64>; 3];

/// Adds wavelets to `histories` until the spectrum of the acceleration `seen` (of equal length; it moves by
/// what is added) is near its aim; the best round is kept. Returns the rounds and lowest and highest ratio.
pub fn refine(aim: &Aim, seen: &[f64], histories: &mut Histories, dt: f64) -> (usize, [f64; 2]) {
    let mut seen = seen.to_vec();
    let mut best: Option<(f64, Histories, [f64; 2])> = None;
    let mut round = 0;
    loop {
        let peaks = aim.peaks(&seen, dt);
        let ratios = aim.ratios(&peaks);
        let bounds = ratios
            .iter()
            .fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], r| {
                [low.min(*r), high.max(*r)]
            });
        let off = (bounds[1] / aim.centre)
            .ln()
            .max((aim.centre / bounds[0]).ln());
        if best.as_ref().is_none_or(|(before, ..)| off < *before) {
            best = Some((off, histories.clone(), bounds));
        }
        let good = bounds[0] >= aim.enough[0] && bounds[1] <= aim.enough[1];
        if good || round == ROUNDS || !off.is_finite() {
            break;
        }
        if !add(aim, &peaks, &ratios, &mut seen, histories, dt) {
            break;
        }
        round += 1;
    }
    match best {
        Some((_, own, bounds)) => {
            *histories = own;
            (round, bounds)
        }
        None => (round, [0.0; 2]),
    }
}

/// A round; false where the system has no solution.
fn add(
    aim: &Aim,
    peaks: &[Peak],
    ratios: &[f64],
    seen: &mut [f64],
    histories: &mut Histories,
    dt: f64,
) -> bool {
    let count = peaks.len();
    let duration = (seen.len() - 1) as f64 * dt;
    let waves: Vec<Wavelet> = (0..count)
        .map(|n| Wavelet::new(aim.frequencies[n], aim.damping, peaks[n].time, duration, dt))
        .collect();
    // Relative: the response of oscillator i per its requirement to wavelet j of the size of j's.
    let mut system = DMatrix::<f64>::zeros(count, 2 * count);
    for (i, peak) in peaks.iter().enumerate() {
        let kernel = kernel(aim, aim.frequencies[i], peak.time, dt);
        let last = kernel.last;
        let sign = peak.value.signum() / aim.required[i];
        for (j, wave) in waves.iter().enumerate() {
            let first = wave.first.max((last + 1).saturating_sub(kernel.back.len()));
            let end = (wave.first + wave.cosine[2].len()).min(last + 1);
            let (mut cosine, mut sine) = (0.0, 0.0);
            for n in first..end {
                let weight = kernel.back[last - n];
                cosine += weight * wave.cosine[2][n - wave.first];
                sine += weight * wave.sine[2][n - wave.first];
            }
            system[(i, 2 * j)] = sign * aim.required[j] * cosine;
            system[(i, 2 * j + 1)] = sign * aim.required[j] * sine;
        }
    }
    let mut gram = &system * system.transpose();
    let floor = REGULARISATION * gram.diagonal().mean();
    for n in 0..count {
        gram[(n, n)] += floor;
    }
    let lacking = ratios
        .iter()
        .map(|ratio| PART * (aim.centre - ratio).clamp(-0.5, 0.5));
    let lacking = DVector::from_iterator(count, lacking);
    let Some(factors) = gram.cholesky() else {
        return false;
    };
    let sizes = system.transpose() * factors.solve(&lacking);
    for (j, wave) in waves.iter().enumerate() {
        let [c, s] = [sizes[2 * j], sizes[2 * j + 1]].map(|size| size * aim.required[j]);
        for (order, history) in histories.iter_mut().enumerate() {
            for (n, own) in wave.cosine[order].iter().zip(&wave.sine[order]).enumerate() {
                history[wave.first + n] += c * own.0 + s * own.1;
            }
        }
        for (n, own) in wave.cosine[2].iter().zip(&wave.sine[2]).enumerate() {
            seen[wave.first + n] += c * own.0 + s * own.1;
        }
    }
    true
}

/// What accelerations before a time count for the response then, the latest first.
struct Kernel {
    /// The sample at or before that time.
    last: usize,
    back: Vec<f64>,
}

fn kernel(aim: &Aim, frequency: f64, time: f64, dt: f64) -> Kernel {
    let (omega, zeta) = (TAU * frequency, aim.damping);
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let last = (time / dt) as usize;
    let length = ((FORGOTTEN / (zeta * omega) / dt) as usize).min(last) + 1;
    let offset = time - last as f64 * dt;
    let back = (0..length).map(|n| {
        let since = n as f64 * dt + offset;
        let (sine, cosine) = (damped * since).sin_cos();
        let decay = (-zeta * omega * since).exp() * dt;
        let displacement = -decay * sine / damped;
        match aim.measure {
            Measure::AbsoluteAcceleration => {
                let velocity = -decay * (cosine - zeta * omega / damped * sine);
                -(omega * omega * displacement + 2.0 * zeta * omega * velocity)
            }
            _ => omega * omega * displacement,
        }
    });
    Kernel {
        last,
        back: back.collect(),
    }
}

/// Two wavelets of one place and frequency, each with its displacement, velocity and acceleration; the latter
/// is about 1.
struct Wavelet {
    first: usize,
    cosine: Histories,
    sine: Histories,
}

impl Wavelet {
    fn new(frequency: f64, damping: f64, time: f64, duration: f64, dt: f64) -> Self {
        let cycles = (0.25 / damping).clamp(3.0, 8.0);
        let half = (0.5 * cycles / frequency).min(0.25 * duration);
        let centre = (time - 2.0 * BEFORE * half).clamp(half, duration - half);
        let omega = TAU * frequency;
        let first = ((centre - half) / dt).ceil() as usize;
        let last = ((centre + half) / dt).floor() as usize;
        let mut own = Self {
            first,
            cosine: Default::default(),
            sine: Default::default(),
        };
        for n in first..=last {
            let t = n as f64 * dt - centre;
            let u = t / half;
            let rest = (1.0 - u * u).max(0.0);
            // The bump with its first two derivatives by time.
            let b = rest.powi(4);
            let db = -8.0 * u * rest.powi(3) / half;
            let ddb = (48.0 * u * u * rest.powi(2) - 8.0 * rest.powi(3)) / (half * half);
            let (s, c) = (omega * t).sin_cos();
            for (all, value, slope) in [
                (&mut own.cosine, c, -omega * s),
                (&mut own.sine, s, omega * c),
            ] {
                let [x, v, a] = all;
                let scale = -1.0 / (omega * omega);
                x.push(scale * b * value);
                v.push(scale * (db * value + b * slope));
                a.push(scale * (ddb * value + 2.0 * db * slope - b * omega * omega * value));
            }
        }
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lightly damped oscillators answer in a narrower band: 36 in an octave in place of 24.
    #[test]
    fn an_aim_has_more_oscillators_where_they_are_damped_less() {
        for (damping, per_octave) in [(2.0, 36.0), (5.0, 24.0)] {
            let rule = Rule::ieee693("any", 1.0, damping);
            let aim = Aim::of(&rule, 1.1, [1.0, 1.3]);
            let octaves = (rule.band_hz[1] / rule.band_hz[0]).log2();
            // Both ends are among them.
            assert_eq!(
                aim.frequencies.len(),
                (octaves * per_octave).ceil() as usize + 1
            );
            assert_eq!(aim.required.len(), aim.frequencies.len());
            let (f, required) = (aim.frequencies[7], aim.required[7]);
            assert!((required / (STANDARD_GRAVITY * rule.required(f)) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_wavelet_is_one_motion_and_at_rest_at_both_ends() {
        let dt = 0.002;
        let wave = Wavelet::new(3.0, 0.05, 10.0, 30.0, dt);
        for [x, v, a] in [&wave.cosine, &wave.sine] {
            let largest = motion::peak(v);
            let mut velocity = 0.0;
            for n in 1..a.len() {
                velocity += 0.5 * dt * (a[n - 1] + a[n]);
                assert!((velocity - v[n]).abs() < 1e-3 * largest);
            }
            assert!(velocity.abs() < 1e-6 * largest);
            assert!(x[0].abs() < 1e-6 * motion::peak(x));
            assert!((motion::peak(a) - 1.0).abs() < 0.2);
        }
    }
}
