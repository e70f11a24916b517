//! The mains in a channel: a line that stands out of the spectrum near it.
//!
//! The mains is never quite at its nominal frequency, and records begin at any phase of it. The learned
//! noises follow such a line as a sharp resonance; here it gets its name and its amplitude, from periodograms
//! of the channel under Hann's window.

use nalgebra::Complex;
use std::f64::consts::TAU;

use diagnosis::NamedEffect;
use plant::identified::effects::{self, Reporting};

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

/// Two quadratures as amplitude and phase, if the effect is reported in this form. A line that was read from the
/// spectra has its amplitude already.
pub fn readable(mut named: Vec<NamedEffect>) -> Vec<NamedEffect> {
    for effect in &mut named {
        let reporting = effects::find(effect.effect).map(|known| known.reporting);
        if let (Some(Reporting::AmplitudeAndPhase), [a, b]) =
            (reporting, effect.parameters.as_mut_slice())
            && !b.is_shape
        {
            let (p, q) = (a.value, b.value);
            let amplitude = p.hypot(q);
            a.name = "amplitude".into();
            a.value = amplitude;
            b.name = "phase".into();
            b.value = q.atan2(p);
            b.unit = "rad";
            b.standard_error /= amplitude.max(f64::MIN_POSITIVE);
            b.is_shape = true;
        }
    }
    named
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnosis::ParameterEstimate;
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

    #[test]
    fn quadratures_become_an_amplitude_and_an_amplitude_stays() {
        let named = |parameters: [(&str, f64, bool); 2]| {
            let parameters = parameters.map(|(name, value, is_shape)| ParameterEstimate {
                name: name.into(),
                value,
                unit: "m/s^2",
                standard_error: 0.01,
                is_shape,
            });
            let effect = NamedEffect {
                effect: "mains_hum",
                parameters: parameters.into(),
                confidence: 0.95,
            };
            let said = readable(vec![effect]).remove(0).parameters;
            said.into_iter()
                .map(|p| (p.name, p.value))
                .collect::<Vec<_>>()
        };
        let of_quadratures = named([("in_phase", 0.03, false), ("quadrature", 0.04, false)]);
        assert_eq!(of_quadratures[0], ("amplitude".into(), 0.05));
        let of_a_line = named([("amplitude", 0.03, false), ("frequency", 49.99, true)]);
        assert_eq!(
            of_a_line,
            [("amplitude".into(), 0.03), ("frequency".into(), 49.99)]
        );
    }
}
