//! The mains in a channel: a line that stands out of the spectrum near it.
//!
//! The mains is never quite at its nominal frequency, and records begin at any phase of it. The learned
//! noises follow such a line as a sharp resonance; here it gets its name and its amplitude, from periodograms
//! of the channel under Hann's window.

use nalgebra::Complex;
use std::f64::consts::TAU;

/// Nominal frequencies, Hz, and how far the mains may be from them.
const NOMINAL: [f64; 2] = [50.0, 60.0];
const OFF: f64 = 0.5;
/// Steps of the frequency, in lines of a periodogram: to find the line, and to refine it.
const STEPS: [f64; 2] = [0.25, 0.02];
/// Lines of a periodogram to either side that show what is near: beyond the window's own width.
const NEAR: (usize, usize) = (4, 24);
/// Power over that of what is near, from which on it is a line. Among some hundred frequencies noise alone
/// passes it once in a million records.
const STANDS_OUT: f64 = 20.0;

/// A sinusoid in the records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Hz.
    pub frequency: f64,
    /// Root mean square over the records of its amplitude, in the channel's unit.
    pub amplitude: f64,
    /// One standard deviation of that.
    pub standard_error: f64,
}

/// The strongest line of the mains in a channel's `records`, sampled every `period` s; none where nothing
/// stands out.
pub fn line(records: &[&[f64]], period: f64) -> Option<Line> {
    let longest = records.iter().map(|record| record.len()).max()? as f64 * period;
    let highest = 0.45 / period;
    let all = NOMINAL.into_iter().filter(|nominal| *nominal < highest);
    let found = all.filter_map(|nominal| {
        let power = |frequency: f64| -> f64 {
            let powers = records
                .iter()
                .map(|r| spectrum(r, period, frequency).norm_sqr());
            powers.sum()
        };
        let (mut best, mut within) = (nominal, OFF);
        for step in STEPS {
            let count = (within * longest / step).ceil() as i32;
            let centre = best;
            let mut tried = (-count..=count).map(|i| centre + f64::from(i) * step / longest);
            best = tried
                .by_ref()
                .max_by(|a, b| power(*a).total_cmp(&power(*b)))?;
            within = step / longest;
        }
        let near = (NEAR.0..NEAR.1).flat_map(|i| {
            let off = i as f64 / longest;
            [best - off, best + off]
        });
        let near: Vec<f64> = near.map(power).collect();
        let background = near.iter().sum::<f64>() / near.len() as f64;
        let own = power(best);
        let count = records.len() as f64;
        (own > STANDS_OUT * background).then(|| Line {
            frequency: best,
            amplitude: (own / count).sqrt(),
            standard_error: (0.5 * background).sqrt() / count,
        })
    });
    found.max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))
}

/// Amplitude and phase of `series` at `frequency` (Hz) under Hann's window.
fn spectrum(series: &[f64], period: f64, frequency: f64) -> Complex<f64> {
    let n = series.len() as f64;
    let turn = Complex::from_polar(1.0, -TAU * frequency * period);
    let step = Complex::from_polar(1.0, TAU / n);
    let (mut at, mut window) = (Complex::from(1.0), Complex::from(1.0));
    let mut sum = Complex::from(0.0);
    for value in series {
        sum += at * (value * (1.0 - window.re));
        at *= turn;
        window *= step;
    }
    sum * (2.0 / n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Motion at 3 Hz, a resonance at 54 Hz and white noise, with a line of `amplitude` at `frequency`.
    fn records(amplitude: f64, frequency: f64) -> Vec<Vec<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let record = |phase: f64| {
            let mut past = [0.0; 2];
            let series = (0..7500).map(|k| {
                let t = f64::from(k) * 2e-3;
                let new: f64 = StandardNormal.sample(&mut random);
                let angle: f64 = TAU * 54.0 * 2e-3;
                let next = 1.9 * angle.cos() * past[0] - 0.9025 * past[1] + 0.02 * new;
                past = [next, past[0]];
                let white: f64 = StandardNormal.sample(&mut random);
                (TAU * 3.0 * t).sin()
                    + next
                    + 0.05 * white
                    + amplitude * (TAU * frequency * t + phase).sin()
            });
            series.collect()
        };
        [0.3, 2.0, 4.0].map(record).into()
    }

    #[test]
    fn the_mains_is_found_at_its_frequency_with_its_amplitude_whatever_its_phases() {
        for (amplitude, frequency) in [(0.05, 50.07), (0.3, 59.94)] {
            let records = records(amplitude, frequency);
            let series: Vec<&[f64]> = records.iter().map(Vec::as_slice).collect();
            let found = line(&series, 2e-3).unwrap();
            assert!((found.frequency - frequency).abs() < 5e-3, "{found:?}");
            let off = (found.amplitude - amplitude).abs();
            assert!(off < 3.0 * found.standard_error, "{found:?}");
            assert!(found.standard_error < 0.1 * amplitude, "{found:?}");
        }
    }

    #[test]
    fn a_resonance_nearby_is_not_the_mains() {
        let records = records(0.0, 50.0);
        let series: Vec<&[f64]> = records.iter().map(Vec::as_slice).collect();
        assert_eq!(line(&series, 2e-3), None);
    }
}
