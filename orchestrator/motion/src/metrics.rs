//! How well a table followed its reference.

pub mod laboratory;
mod response_spectrum;

pub use response_spectrum::{
    Measure, Peak, USUAL_DAMPING, pseudo_acceleration, response_peaks, response_spectrum,
};

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use thiserror::Error;

use self::laboratory::Laboratory;
use crate::{Motion, peak};

/// Highest frequency of the frequency-domain error, Hz.
pub const HIGHEST_FREQUENCY: f64 = 25.0;
/// Longest rest after a motion that belongs to it, s.
pub const LONGEST_REST: f64 = 1.0;
/// Largest delay that is looked for, s.
const LONGEST_DELAY: f64 = 0.5;

/// Why two histories cannot be compared.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MetricsError {
    /// The histories are of different length, or longer than the motion.
    #[error(
        "{displacement} samples of displacement, {acceleration} of acceleration, {reference} of the reference"
    )]
    Lengths {
        /// Samples of the table's displacement.
        displacement: usize,
        /// Samples of the table's acceleration.
        acceleration: usize,
        /// Samples of the reference.
        reference: usize,
    },
    /// Less than a period of the highest frequency that is compared.
    #[error(
        "a motion of {samples} samples is shorter than a period of {HIGHEST_FREQUENCY} Hz; play at least {} s",
        1.0 / HIGHEST_FREQUENCY
    )]
    TooShort {
        /// Samples of both histories.
        samples: usize,
    },
    /// The reference does not move.
    #[error("the reference has no acceleration or no displacement")]
    AtRest,
    /// The table's motion is not finite.
    #[error("the table's motion is not finite at sample {0}")]
    NotFinite(usize),
}

/// Figures of tracking, SI units where not named otherwise.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Tracking {
    /// `100 rms(a_ref - a) / max|a_ref|` over the motion as played, %.
    pub time_domain_percent: f64,
    /// `100 rms over 0 < f <= 25 Hz of | |2 A_ref/N| - |2 A/N| | / max|a_ref|`, %.
    pub frequency_domain_percent: f64,
    /// `100 rms(x_ref - x) / max|x_ref|`, %.
    pub displacement_percent: f64,
    /// Largest displacement of the table, m.
    #[serde(rename = "peak_displacement_m")]
    pub peak_displacement: f64,
    /// Largest displacement error, m.
    #[serde(rename = "peak_displacement_error_m")]
    pub peak_displacement_error: f64,
    /// Largest acceleration of the table, m/s^2.
    #[serde(rename = "peak_acceleration_m_s2")]
    pub peak_acceleration: f64,
    /// Largest acceleration error, m/s^2.
    #[serde(rename = "peak_acceleration_error_m_s2")]
    pub peak_acceleration_error: f64,
    /// Correlation coefficient of the two accelerations as they stand.
    #[serde(deserialize_with = "nan_if_null")]
    pub correlation: f64,
    /// Time by which the table's acceleration lags the reference, s, from the largest
    /// cross-correlation within half a second; negative when it leads.
    #[serde(rename = "delay_s")]
    pub delay: f64,
    /// What laboratories read off a test; absent from the files of older versions.
    #[serde(flatten)]
    pub laboratory: Option<Laboratory>,
}

/// JSON has no NaN, which the correlation with a table at rest is.
fn nan_if_null<'de, D: serde::Deserializer<'de>>(json: D) -> Result<f64, D::Error> {
    let number: Option<f64> = serde::Deserialize::deserialize(json)?;
    Ok(number.unwrap_or(f64::NAN))
}

/// Compares the table's motion with the reference, sample by sample. Where less than the motion was
/// played, errors are relative to the peaks of what was. A rest of more than [`LONGEST_REST`] after the motion
/// is in the peaks, but not in the means, which would fall with every second of waiting.
///
/// # Errors
/// Histories that do not fit together, a reference at rest, a table motion that is not finite.
pub fn tracking(
    reference: &Motion,
    displacement: &[f64],
    acceleration: &[f64],
) -> Result<Tracking, MetricsError> {
    let mut figures = errors(reference, displacement, acceleration)?;
    let wanted = &reference.acceleration[..acceleration.len()];
    figures.laboratory = Some(Laboratory::new(wanted, acceleration, reference.dt));
    Ok(figures)
}

/// As [`tracking`], without what laboratories read off a test, which takes most of the time.
///
/// # Errors
/// As [`tracking`].
pub fn errors(
    reference: &Motion,
    displacement: &[f64],
    acceleration: &[f64],
) -> Result<Tracking, MetricsError> {
    let samples = acceleration.len();
    if displacement.len() != samples || samples > reference.len() {
        return Err(MetricsError::Lengths {
            displacement: displacement.len(),
            acceleration: samples,
            reference: reference.len(),
        });
    }
    if samples < 2 || samples as f64 * reference.dt * HIGHEST_FREQUENCY < 1.0 {
        return Err(MetricsError::TooShort { samples });
    }
    let infinite = |n: &usize| !(displacement[*n].is_finite() && acceleration[*n].is_finite());
    if let Some(n) = (0..samples).find(infinite) {
        return Err(MetricsError::NotFinite(n));
    }
    let x_ref = &reference.displacement[..samples];
    let a_ref = &reference.acceleration[..samples];
    let (a_peak, x_peak) = (peak(a_ref), peak(x_ref));
    if !(a_peak > 0.0 && x_peak > 0.0) {
        return Err(MetricsError::AtRest);
    }
    let x_error = difference(x_ref, displacement);
    let a_error = difference(a_ref, acceleration);
    let moving = moving(x_ref, a_ref, reference.dt);
    let amplitudes = amplitude_error(&a_ref[..moving], &acceleration[..moving], reference.dt);
    Ok(Tracking {
        time_domain_percent: 100.0 * rms(&a_error[..moving]) / a_peak,
        frequency_domain_percent: 100.0 * amplitudes / a_peak,
        displacement_percent: 100.0 * rms(&x_error[..moving]) / x_peak,
        peak_displacement: peak(displacement),
        peak_displacement_error: peak(&x_error),
        peak_acceleration: peak(acceleration),
        peak_acceleration_error: peak(&a_error),
        correlation: correlation(a_ref, acceleration),
        delay: delay(a_ref, acceleration, reference.dt),
        laboratory: None,
    })
}

/// Samples of a reference until it rests for good, at least [`LONGEST_REST`]; all if it rests for less than that.
fn moving(displacement: &[f64], acceleration: &[f64], dt: f64) -> usize {
    let (samples, end) = (acceleration.len(), displacement.last());
    let moves = |n: &usize| acceleration[*n] != 0.0 || Some(&displacement[*n]) != end;
    let moving = (0..samples).rev().find(moves).map_or(0, |last| last + 1);
    let rest = (LONGEST_REST / dt) as usize;
    match samples - moving > rest {
        true => moving.max(rest),
        false => samples,
    }
}

/// Amplitudes of a Fourier series: `|2 A_k / N|` at `k/(N dt)` for `0 < f <= highest`.
/// Returns frequencies (Hz) and amplitudes (the unit of `history`).
#[must_use]
pub fn fourier_amplitudes(history: &[f64], dt: f64, highest: f64) -> (Vec<f64>, Vec<f64>) {
    let count = history.len() as f64;
    let step = 1.0 / (count * dt);
    // 25 Hz itself belongs to the band, whatever the rounding of k/(N dt).
    let lines = (highest / step * (1.0 + 1e-12)) as usize;
    let spectrum = spectrum(history, history.len());
    let band = spectrum.iter().enumerate().skip(1).take(lines);
    band.map(|(k, line)| (k as f64 * step, 2.0 * line.norm() / count))
        .unzip()
}

/// rms over 0 < f <= 25 Hz of the difference of Fourier amplitudes.
fn amplitude_error(reference: &[f64], history: &[f64], dt: f64) -> f64 {
    let (_, wanted) = fourier_amplitudes(reference, dt, HIGHEST_FREQUENCY);
    let (_, found) = fourier_amplitudes(history, dt, HIGHEST_FREQUENCY);
    rms(&difference(&wanted, &found))
}

/// Spectrum of `history`, padded with zeros to `length`; empty when there is nothing.
pub fn spectrum(history: &[f64], length: usize) -> Vec<Complex64> {
    if history.is_empty() {
        return Vec::new();
    }
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut input = history.to_vec();
    input.resize(length, 0.0);
    let mut lines = forward.make_output_vec();
    // The lengths come from the plan itself: it cannot fail.
    let done = forward.process(&mut input, &mut lines);
    debug_assert!(done.is_ok());
    lines
}

/// Lag of `history` behind `reference`, s: the largest cross-correlation, between samples by a
/// parabola through its neighbours.
fn delay(reference: &[f64], history: &[f64], dt: f64) -> f64 {
    let longest = ((LONGEST_DELAY / dt) as usize).min(history.len() - 1);
    let length = (history.len() + longest + 1).next_multiple_of(2);
    let mut cross = spectrum(history, length);
    for (line, of) in cross.iter_mut().zip(spectrum(reference, length)) {
        *line *= of.conj();
    }
    let inverse = RealFftPlanner::<f64>::new().plan_fft_inverse(length);
    let mut correlation = inverse.make_output_vec();
    if inverse.process(&mut cross, &mut correlation).is_err() {
        return 0.0;
    }
    let longest = longest as isize;
    let at = |lag: isize| correlation[lag.rem_euclid(length as isize) as usize];
    let best = (-longest..=longest)
        .max_by(|&a, &b| at(a).total_cmp(&at(b)))
        .unwrap_or(0);
    let (before, here, after) = (at(best - 1), at(best), at(best + 1));
    let bend = before - 2.0 * here + after;
    let inside = best.abs() < longest && bend < 0.0;
    let between = if inside {
        0.5 * (before - after) / bend
    } else {
        0.0
    };
    (best as f64 + between) * dt
}

fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let product: f64 = one.iter().zip(other).map(|(a, b)| a * b).sum();
    let size = one.len() as f64 * rms(one) * rms(other);
    if size > 0.0 { product / size } else { 0.0 }
}

fn difference(one: &[f64], other: &[f64]) -> Vec<f64> {
    one.iter().zip(other).map(|(a, b)| a - b).collect()
}

/// Root of the mean square; 0 for nothing.
#[must_use]
pub fn rms(values: &[f64]) -> f64 {
    let sum: f64 = values.iter().map(|value| value * value).sum();
    if values.is_empty() {
        0.0
    } else {
        (sum / values.len() as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{Options, built_in};

    fn motion(samples: usize, dt: f64, a: impl Fn(f64) -> f64) -> Motion {
        let acceleration: Vec<f64> = (0..samples).map(|n| a(n as f64 * dt)).collect();
        Motion {
            name: "test".into(),
            dt,
            displacement: acceleration.iter().map(|a| -0.01 * a).collect(),
            velocity: vec![0.0; samples],
            acceleration,
            notes: Vec::new(),
            seed: None,
            across: None,
        }
    }

    fn close(found: f64, expected: f64, within: f64) {
        assert!(
            (found - expected).abs() <= within,
            "{found} is not {expected}"
        );
    }

    /// Two whole periods of tones, the table with 0.9 of the first and 0.7 of the second:
    /// errors in closed form.
    #[test]
    fn whole_tones_give_the_figures_of_the_closed_form() {
        // 4 s at 2 ms: lines 0.25 Hz apart, 100 of them up to 25 Hz. Peak exactly 3 + 1 at 0 s.
        let wanted = |t: f64| 3.0 * (TAU * 2.0 * t).cos() + (TAU * 8.0 * t).cos();
        let found = |t: f64| 2.7 * (TAU * 2.0 * t).cos() + 0.7 * (TAU * 8.0 * t).cos();
        let (reference, table) = (motion(2000, 0.002, wanted), motion(2000, 0.002, found));
        let figures = tracking(&reference, &table.displacement, &table.acceleration).unwrap();
        // Errors 0.3 and 0.3 in amplitude: rms sqrt(0.09/2 + 0.09/2) = 0.3; lines: two of 100.
        close(figures.time_domain_percent, 100.0 * 0.3 / 4.0, 1e-10);
        close(figures.displacement_percent, 100.0 * 0.3 / 4.0, 1e-10);
        let lines = (2.0 * 0.3_f64.powi(2) / 100.0).sqrt();
        close(figures.frequency_domain_percent, 100.0 * lines / 4.0, 1e-10);
        close(figures.peak_acceleration, 3.4, 1e-12);
        close(figures.peak_displacement, 0.034, 1e-12);
        close(figures.peak_acceleration_error, 0.6, 1e-12);
        close(figures.peak_displacement_error, 0.006, 1e-12);
        // <a b> = (3*2.7 + 1*0.7)/2, <a a> = (9 + 1)/2, <b b> = (2.7^2 + 0.7^2)/2.
        let correlation = 8.8 / (10.0 * (2.7_f64.powi(2) + 0.7_f64.powi(2))).sqrt();
        close(figures.correlation, correlation, 1e-12);
    }

    /// The same definition with a discrete Fourier transform written out, for lengths of every
    /// kind (even, odd, prime).
    #[test]
    fn frequency_error_agrees_with_a_transform_written_out() {
        for samples in [500, 501, 503, 1024] {
            let dt = 0.004;
            let reference = motion(samples, dt, |t| (7.0 * t * t).sin() * (-t).exp());
            let table = motion(samples, dt, |t| {
                0.8 * (7.3 * t * t + 0.1).sin() * (-t).exp()
            });
            let (mut sum, mut lines) = (0.0, 0);
            for k in 1..=samples / 2 {
                if k as f64 > 25.0 * samples as f64 * dt {
                    break;
                }
                let amplitude = |a: &[f64]| {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (n, a) in a.iter().enumerate() {
                        let angle = TAU * ((k * n) % samples) as f64 / samples as f64;
                        re += a * angle.cos();
                        im -= a * angle.sin();
                    }
                    2.0 / samples as f64 * (re * re + im * im).sqrt()
                };
                let error = amplitude(&reference.acceleration) - amplitude(&table.acceleration);
                sum += error * error;
                lines += 1;
            }
            let expected = 100.0 * (sum / f64::from(lines)).sqrt() / peak(&reference.acceleration);
            let figures = tracking(&reference, &table.displacement, &table.acceleration).unwrap();
            close(figures.frequency_domain_percent, expected, 1e-9 * expected);
        }
    }

    /// Constant velocity is not rest, and a pulse counts with what follows it.
    #[test]
    fn a_rest_begins_where_the_displacement_ends() {
        let ends = |x: &[f64], a: &[f64]| moving(x, a, 0.01);
        let ramp: Vec<f64> = (0..300).map(f64::from).collect();
        let pulse = |at: u32| -> Vec<f64> { (0..300).map(|n| f64::from(n == at)).collect() };
        assert_eq!(ends(&ramp, &pulse(1)), 300);
        assert_eq!(ends(&[7.0; 300], &pulse(1)), 100);
        assert_eq!(ends(&[7.0; 300], &pulse(150)), 151);
        assert_eq!(ends(&[7.0; 300], &pulse(250)), 300);
    }

    /// Waiting after a motion does not make the table better.
    #[test]
    fn a_long_rest_after_the_motion_changes_no_error() {
        let wave = |t: f64| (TAU * 3.0 * t).sin();
        let ends = |t: f64| if t < 4.0 { wave(t) } else { 0.0 };
        let [short, long] = [2000, 20_000].map(|samples| {
            let reference = motion(samples, 0.002, ends);
            let table = motion(samples, 0.002, |t| 0.8 * ends(t));
            errors(&reference, &table.displacement, &table.acceleration).unwrap()
        });
        // The last sample of the wave is the first zero of the rest.
        close(long.time_domain_percent, short.time_domain_percent, 0.01);
        close(
            long.frequency_domain_percent,
            short.frequency_domain_percent,
            0.01,
        );
        close(long.displacement_percent, short.displacement_percent, 0.01);
        assert_eq!(long.peak_acceleration, short.peak_acceleration);
    }

    #[test]
    fn a_perfect_table_has_no_error() {
        let reference = built_in(3, &Options::default()).unwrap();
        let figures =
            tracking(&reference, &reference.displacement, &reference.acceleration).unwrap();
        assert_eq!(figures.time_domain_percent, 0.0);
        assert_eq!(figures.frequency_domain_percent, 0.0);
        close(figures.correlation, 1.0, 1e-12);
        close(figures.delay, 0.0, 1e-6);
    }

    /// A late table: the delay is found, also between samples, and shows in time but hardly in
    /// Fourier amplitudes.
    #[test]
    fn a_delay_beyond_the_longest_is_the_longest() {
        // Half a slow wave, a second late: the correlation still rises where the search ends.
        let (dt, late) = (0.01, 100);
        let wave = |k: i32| {
            let t = f64::from(k) * dt;
            if (0.0..10.0).contains(&t) {
                (0.1 * std::f64::consts::PI * t).sin()
            } else {
                0.0
            }
        };
        let reference: Vec<f64> = (0..1500).map(wave).collect();
        let history: Vec<f64> = (0..1500).map(|k| wave(k - late)).collect();
        assert_eq!(delay(&reference, &history, dt), LONGEST_DELAY);
        assert_eq!(delay(&history, &reference, dt), -LONGEST_DELAY);
    }

    #[test]
    fn a_late_table_has_a_delay() {
        let burst = |t: f64| (-(t - 3.0).powi(2)).exp() * (TAU * 2.0 * t).sin();
        let reference = motion(3000, 0.002, burst);
        for late in [0.020, 0.0067, -0.013] {
            let table = motion(3000, 0.002, |t| burst(t - late));
            let figures = tracking(&reference, &table.displacement, &table.acceleration).unwrap();
            close(figures.delay, late, 2e-5);
            assert!(figures.frequency_domain_percent < 1e-3);
            assert!(figures.time_domain_percent > 1.0);
        }
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let reference = motion(100, 0.01, f64::sin);
        let a = &reference.acceleration;
        let error = |x: &[f64], a: &[f64]| tracking(&reference, x, a).unwrap_err().to_string();
        assert_eq!(
            error(&a[..50], a),
            "50 samples of displacement, 100 of acceleration, 100 of the reference"
        );
        assert_eq!(
            error(&a[..1], &a[..1]),
            "a motion of 1 samples is shorter than a period of 25 Hz; play at least 0.04 s"
        );
        let mut broken = a.clone();
        broken[7] = f64::NAN;
        assert_eq!(
            error(&broken, a),
            "the table's motion is not finite at sample 7"
        );
        let rest = motion(100, 0.01, |_| 0.0);
        assert_eq!(tracking(&rest, a, a).unwrap_err(), MetricsError::AtRest);
        assert_eq!(tracking(&reference, a, a).unwrap().time_domain_percent, 0.0);
    }

    /// A shortened run has the figures of a motion that is as short, whatever follows.
    #[test]
    fn errors_are_relative_to_what_was_played() {
        let growing = motion(1000, 0.002, |t| t * t * (TAU * 2.0 * t).sin());
        let table: Vec<f64> = growing.acceleration.iter().map(|a| 0.9 * a).collect();
        let moved: Vec<f64> = growing.displacement.iter().map(|x| 0.9 * x).collect();
        let begun = tracking(&growing, &moved[..300], &table[..300]).unwrap();
        let short = motion(300, 0.002, |t| t * t * (TAU * 2.0 * t).sin());
        assert_eq!(
            begun,
            tracking(&short, &moved[..300], &table[..300]).unwrap()
        );
        // 10 % too small everywhere: a tenth of the rms over the peak of the 300 samples.
        let share = rms(&short.acceleration) / peak(&short.acceleration);
        close(begun.time_domain_percent, 10.0 * share, 1e-9);
        let still = motion(100, 0.01, |t| f64::from(t > 0.5));
        let zeros = [0.0; 40];
        assert_eq!(tracking(&still, &zeros, &zeros), Err(MetricsError::AtRest));
    }
}
