//! A signal behind a coarse converter: what its readings say of it.

use std::f64::consts::TAU;

use nalgebra::Complex;
use realfft::RealFftPlanner;
use recordings::clipping;

use crate::spectra::Spectra;

/// Samples that a level must have on average for the readings to be a coarse converter's.
const A_LEVEL: usize = 4;
/// Samples of a segment of the spectrum, and of the filter.
const SEGMENT: usize = 256;
/// Lines to either side over which the spectrum is averaged.
const BESIDE: usize = 3;

/// A converter whose steps are coarse beside the signal that it reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarse {
    /// Distance of its levels.
    pub step: f64,
}

impl Coarse {
    /// That of which `values` are readings; none where its steps are fine.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let step = clipping::step(values);
        let (low, high) = values
            .iter()
            .fold((f64::MAX, f64::MIN), |(low, high), own| {
                (low.min(*own), high.max(*own))
            });
        let levels = (high - low) / step.max(f64::MIN_POSITIVE);
        (step > 0.0 && levels * A_LEVEL as f64 <= values.len() as f64).then_some(Self { step })
    }

    /// Standard deviation of its rounding: that of an even distribution over a step.
    #[must_use]
    pub fn error(self) -> f64 {
        self.step / 12f64.sqrt()
    }
}

/// The best linear estimate of the signal of which `values`, a sample every `period` s, are readings of a `coarse`
/// converter (Wiener's filter, without delay).
///
/// An input that is read with an error seems to do less than it does, the more so the weaker it is. A fit to the
/// readings finds less gain where the signal has little power, which looks like a lag. The error of the estimate does
/// not go with the estimate, so that a fit to it is right (regression calibration; Carroll et al., Measurement Error
/// in Nonlinear Models, 2006, ch. 4). Rounding adds white noise.
#[must_use]
pub fn estimated(values: &[f64], period: f64, coarse: Coarse) -> Vec<f64> {
    match filter(values, period, coarse) {
        Some(half) => convolved(values, &half),
        None => values.to_vec(),
    }
}

/// The symmetric filter's middle and one half; none for a record that is too short.
fn filter(values: &[f64], period: f64, coarse: Coarse) -> Option<Vec<f64>> {
    let spectra = Spectra::new(&[values], period, SEGMENT).ok()?;
    // Of a Hann window: three eighths of its length.
    let error = coarse.error().powi(2) * 0.375 * (SEGMENT * spectra.segments()) as f64;
    let last = SEGMENT / 2;
    let mut gains: Vec<Complex<f64>> = (0..=last)
        .map(|line| {
            let near = line.saturating_sub(BESIDE).max(1)..=(line + BESIDE).min(last);
            let count = near.clone().count() as f64;
            let power = near.map(|own| spectra.power(0, own)).sum::<f64>() / count;
            Complex::new((1.0 - error / power.max(error)).max(0.0), 0.0)
        })
        .collect();
    // The mean of each segment was taken away: at rest the readings are right.
    gains[0].re = 1.0;
    let mut kernel = vec![0.0; SEGMENT];
    let inverse = RealFftPlanner::<f64>::new().plan_fft_inverse(SEGMENT);
    inverse.process(&mut gains, &mut kernel).ok()?;
    let tapered = kernel[..last].iter().enumerate().map(|(k, own)| {
        let window = 0.5 + 0.5 * (TAU * k as f64 / SEGMENT as f64).cos();
        own / SEGMENT as f64 * window
    });
    let mut half: Vec<f64> = tapered.collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half[0] += 1.0 - sum;
    Some(half)
}

/// `values` through a symmetric filter; before and after the record its ends go on.
fn convolved(values: &[f64], half: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    (0..values.len())
        .map(|k| {
            let both = half.iter().enumerate().skip(1).map(|(age, own)| {
                own * (values[k.saturating_sub(age)] + values[(k + age).min(last)])
            });
            half[0] * values[k] + both.sum::<f64>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A slow part of four steps and a fast one of half a step, at 1 and 30 Hz with a little of all frequencies.
    fn signal() -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut phase = || random.random_range(0.0..TAU);
        let mut sines = Vec::new();
        for k in 0..60 {
            let k = f64::from(k);
            sines.push([4.0 / 60f64.sqrt(), 0.2 + 0.05 * k, phase()]);
            sines.push([0.5 / 60f64.sqrt(), 28.0 + 0.1 * k, phase()]);
        }
        (0..16_000)
            .map(|k| {
                let t = 0.004 * f64::from(k);
                let all = sines.iter();
                all.map(|[size, f, phase]| size * (TAU * f * t + phase).sin())
                    .sum()
            })
            .collect()
    }

    /// A signal's regression on what stands for it, between two frequencies.
    fn slope(of: &[f64], on: &[f64], band: (f64, f64)) -> f64 {
        let spectra = Spectra::new(&[on, of], 0.004, 512).unwrap();
        let lines = spectra.frequency.iter().enumerate();
        let (mut cross, mut power) = (0.0, 0.0);
        for (line, _) in lines.filter(|(_, f)| (band.0..band.1).contains(*f)) {
            cross += spectra.cross(1, 0, line).re;
            power += spectra.power(0, line);
        }
        cross / power
    }

    #[test]
    fn a_fit_to_the_estimate_is_right_where_one_to_the_readings_is_not() {
        let truth = signal();
        let rounded: Vec<f64> = truth.iter().map(|value| value.round()).collect();
        let coarse = Coarse::of(&rounded).unwrap();
        assert_eq!(coarse.step, 1.0);
        let estimate = estimated(&rounded, 0.004, coarse);
        let (fast, slow) = ((20.0, 45.0), (0.5, 3.0));
        let by_readings = slope(&truth, &rounded, fast);
        let by_estimate = slope(&truth, &estimate, fast);
        assert!(by_readings < 0.9, "{by_readings}");
        assert!((by_estimate - 1.0).abs() < 0.03, "{by_estimate}");
        assert!((slope(&truth, &estimate, slow) - 1.0).abs() < 0.002);
        let miss = |own: &[f64]| -> f64 {
            let pairs = own.iter().zip(&truth);
            pairs.map(|(a, b)| (a - b).powi(2)).sum()
        };
        assert!(miss(&estimate) < 0.8 * miss(&rounded));
    }

    #[test]
    fn fine_steps_are_not_coarse_and_a_constant_has_none() {
        assert_eq!(Coarse::of(&signal()), None);
        let fine: Vec<f64> = signal().iter().map(|v| (v * 1e3).round() / 1e3).collect();
        assert_eq!(Coarse::of(&fine), None);
        assert_eq!(Coarse::of(&[2.0; 500]), None);
    }
}
