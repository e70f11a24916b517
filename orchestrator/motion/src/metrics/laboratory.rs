//! What laboratories read off a test: response spectra, transfer function and coherence by band, the
//! strong part of the motion, its energy.

use std::f64::consts::{PI, TAU};

use sysid::spectra::Spectra;

use super::{USUAL_DAMPING, pseudo_acceleration, rms};
use crate::peak;

/// Bands in which figures are given, Hz.
pub const BANDS: [[f64; 2]; 5] = [[0.5, 1.0], [1.0, 2.0], [2.0, 4.0], [4.0, 8.0], [8.0, 15.0]];
/// Bands above them in which response spectra are compared, Hz. The transfer function is not: the motions have
/// no power there.
pub const HIGH_BANDS: [[f64; 2]; 2] = [[15.0, 30.0], [30.0, 50.0]];
/// Least coherence at which the phase of a band is a delay: below it, noise or a resonance sets the phase.
pub const LEAST_COHERENCE: f64 = 0.9;
/// Oscillators an octave at least.
const PER_OCTAVE: f64 = 24.0;
/// Oscillators between the two neighbours of the one that is farthest off.
const BETWEEN: usize = 8;
/// Segments of the transfer function, s: Hann windows that overlap by half.
const SEGMENT: f64 = 8.0;

/// How far the response spectrum of the table is from the reference's, in a band.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SpectrumDeviation {
    /// From and to, Hz.
    pub band_hz: [f64; 2],
    /// Largest `100 |S_table / S_reference - 1|`, %.
    pub largest: f64,
    /// Natural frequency of the oscillator where it is, Hz.
    #[serde(default)]
    pub largest_at_hz: f64,
    /// Its mean over the band, oscillators evenly spaced by the logarithm of frequency, %.
    pub mean: f64,
}

/// The transfer function from the reference's to the table's acceleration in a band; means weigh each
/// frequency by the reference's power there.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Transfer {
    /// From and to, Hz.
    pub band_hz: [f64; 2],
    /// Gain.
    pub gain: f64,
    /// Delay of the table by the phase, s; negative when it leads.
    pub delay_s: f64,
    /// Coherence.
    pub coherence: f64,
}

/// Figures of a laboratory.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Laboratory {
    /// Response spectra at 5 % damping, by band.
    pub response_spectrum_percent: [SpectrumDeviation; BANDS.len()],
    /// The same above 15 Hz, to where the spectrum is the peak acceleration.
    #[serde(default)]
    pub response_spectrum_above_percent: [SpectrumDeviation; HIGH_BANDS.len()],
    /// Transfer function, by band; none for a motion shorter than two segments.
    pub coherence: Option<[Transfer; BANDS.len()]>,
    /// `100 rms(a_ref - a) / max|a_ref|` over the time in which the reference's Arias intensity goes
    /// from 5 to 95 %, %.
    pub significant_duration_percent: f64,
    /// That time, s.
    pub significant_duration_s: f64,
    /// Peak acceleration of the table over the reference's.
    pub peak_ratio: f64,
    /// Arias intensity of the table over the reference's.
    pub arias_ratio: f64,
}

impl Laboratory {
    /// Compares accelerations of the same length that are finite, a sample every `dt` s; `wanted`
    /// is not at rest.
    pub(super) fn new(wanted: &[f64], found: &[f64], dt: f64) -> Self {
        let energy = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>();
        let [from, to] = significant(wanted);
        let strong: Vec<f64> = wanted[from..to]
            .iter()
            .zip(&found[from..to])
            .map(|(wanted, found)| wanted - found)
            .collect();
        Self {
            response_spectrum_percent: BANDS.map(|band| deviation(wanted, found, dt, band)),
            response_spectrum_above_percent: HIGH_BANDS
                .map(|band| deviation(wanted, found, dt, band)),
            coherence: transfer(wanted, found, dt),
            significant_duration_percent: 100.0 * rms(&strong) / peak(wanted),
            significant_duration_s: (to - from) as f64 * dt,
            peak_ratio: peak(found) / peak(wanted),
            arias_ratio: energy(found) / energy(wanted),
        }
    }

    /// The largest deviation of the response spectra from 0.5 to 15 Hz, %.
    #[must_use]
    pub fn largest_spectrum_deviation(&self) -> f64 {
        let bands = self.response_spectrum_percent.iter();
        bands.map(|band| band.largest).fold(0.0, f64::max)
    }

    /// The deviations of the response spectra in all bands from 0.5 to 50 Hz.
    pub fn spectrum_deviations(&self) -> impl Iterator<Item = &SpectrumDeviation> {
        let above = self.response_spectrum_above_percent.iter();
        self.response_spectrum_percent.iter().chain(above)
    }

    /// The band from 0.5 to 50 Hz in which the response spectra are farthest apart.
    #[must_use]
    pub fn worst_band(&self) -> &SpectrumDeviation {
        let first = &self.response_spectrum_percent[0];
        self.spectrum_deviations().fold(first, |worst, band| {
            if band.largest > worst.largest {
                band
            } else {
                worst
            }
        })
    }
}

/// Samples between which the Arias intensity goes from 5 to 95 %.
fn significant(acceleration: &[f64]) -> [usize; 2] {
    let whole: f64 = acceleration.iter().map(|a| a * a).sum();
    let mut sum = 0.0;
    let (mut from, mut to) = (0, acceleration.len());
    for (n, a) in acceleration.iter().enumerate() {
        if sum <= 0.05 * whole {
            from = n;
        }
        sum += a * a;
        if sum <= 0.95 * whole {
            to = n + 1;
        }
    }
    [from, to.max(from + 1)]
}

fn deviation(wanted: &[f64], found: &[f64], dt: f64, band: [f64; 2]) -> SpectrumDeviation {
    let octaves = (band[1] / band[0]).log2();
    let count = (octaves * PER_OCTAVE).ceil().max(1.0);
    let at = |place: f64| band[0] * (octaves * (place / count).clamp(0.0, 1.0)).exp2();
    let off = |places: &[f64]| -> Vec<f64> {
        let frequencies: Vec<f64> = places.iter().map(|place| at(*place)).collect();
        let [reference, table] =
            [wanted, found].map(|a| pseudo_acceleration(a, dt, &frequencies, USUAL_DAMPING));
        let pairs = table.iter().zip(&reference);
        pairs
            .map(|(table, reference)| 100.0 * (table / reference - 1.0).abs())
            .collect()
    };
    let largest = |places: &[f64], off: &[f64]| {
        let pairs = places.iter().copied().zip(off.iter().copied());
        pairs.fold(
            (0.0, 0.0),
            |most: (f64, f64), one| {
                if one.1 > most.1 { one } else { most }
            },
        )
    };
    let places: Vec<f64> = (0..=count as usize).map(|n| n as f64).collect();
    let all = off(&places);
    let coarse = largest(&places, &all);
    // The curve between the neighbours of the largest one.
    let finer: Vec<f64> = (0..BETWEEN)
        .map(|n| coarse.0 - 1.0 + 2.0 * (n as f64 + 0.5) / BETWEEN as f64)
        .collect();
    let fine = largest(&finer, &off(&finer));
    let worst = if fine.1 > coarse.1 { fine } else { coarse };
    SpectrumDeviation {
        band_hz: band,
        largest: worst.1,
        largest_at_hz: at(worst.0),
        mean: all.iter().sum::<f64>() / (count + 1.0),
    }
}

fn transfer(wanted: &[f64], found: &[f64], dt: f64) -> Option<[Transfer; BANDS.len()]> {
    const WANTED: usize = 0;
    const FOUND: usize = 1;
    let spectra = Spectra::new(&[wanted, found], dt, (SEGMENT / dt) as usize).ok()?;
    let power: Vec<f64> = (0..spectra.frequency.len())
        .map(|k| spectra.power(WANTED, k))
        .collect();
    Some(BANDS.map(|band| {
        let inside = |k: &usize| (band[0]..=band[1]).contains(&spectra.frequency[*k]);
        let lines: Vec<usize> = (0..power.len()).filter(inside).collect();
        let weight: f64 = lines.iter().map(|&k| power[k]).sum();
        let mean = |value: &dyn Fn(usize) -> f64| {
            let sum: f64 = lines.iter().map(|&k| power[k] * value(k)).sum();
            sum / weight.max(f64::MIN_POSITIVE)
        };
        // The delay that fits the phases best.
        let omega = |k: usize| TAU * spectra.frequency[k];
        let phase = |k: usize| {
            let angle = spectra.cross(FOUND, WANTED, k).arg();
            if angle > PI { angle - TAU } else { angle }
        };
        Transfer {
            band_hz: band,
            gain: mean(&|k| spectra.gain(WANTED, FOUND, k).norm()),
            delay_s: -mean(&|k| omega(k) * phase(k)) / mean(&|k| omega(k).powi(2)),
            coherence: mean(&|k| spectra.coherence(WANTED, FOUND, k)),
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn noise(samples: usize, seed: u64) -> Vec<f64> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..samples)
            .map(|_| random.sample(StandardNormal))
            .collect()
    }

    #[test]
    fn a_late_and_smaller_table_has_its_delay_and_gain_and_the_noise_its_coherence() {
        let (dt, late) = (0.002, 5);
        let wanted = noise(60_000, 4);
        let other = noise(60_000, 5);
        // Half of the power of the table is its own.
        let found: Vec<f64> = (0..wanted.len())
            .map(|n| 0.8 * (wanted[n.saturating_sub(late)] + other[n]))
            .collect();
        let own = Laboratory::new(&wanted, &found, dt);
        for band in own.coherence.unwrap() {
            // Three standard errors of the phase over so many independent lines (Bendat and Piersol).
            let lines = wanted.len() as f64 * dt * (band.band_hz[1] - band.band_hz[0]);
            let phase = (0.5 / (2.0 * 0.5 * lines)).sqrt();
            let middle = 0.5 * (band.band_hz[0] + band.band_hz[1]);
            let error = 3.0 * phase / (TAU * middle);
            assert!((band.delay_s - 0.010).abs() < error, "{band:?}, {error}");
            assert!((band.gain - 0.8).abs() < 0.15, "{band:?}");
            assert!((band.coherence - 0.5).abs() < 0.15, "{band:?}");
        }
    }

    #[test]
    fn a_table_that_is_a_tenth_too_strong_shows_it_everywhere() {
        let dt = 0.002;
        let mut wanted = noise(10_000, 7);
        wanted[..4000].fill(0.0);
        wanted[6000..].fill(0.0);
        let found: Vec<f64> = wanted.iter().map(|a| 1.1 * a).collect();
        let own = Laboratory::new(&wanted, &found, dt);
        for band in own.spectrum_deviations() {
            assert!((band.largest - 10.0).abs() < 1e-9 && (band.mean - 10.0).abs() < 1e-9);
        }
        assert!((own.peak_ratio - 1.1).abs() < 1e-12);
        assert!((own.arias_ratio - 1.21).abs() < 1e-12);
        // White noise: its energy grows evenly over the 4 s of which 90 % remain.
        assert!((own.significant_duration_s - 3.6).abs() < 0.1);
        let strong = &wanted[4000..6000];
        let expected = 10.0 * rms(strong) / peak(strong);
        let got = own.significant_duration_percent;
        assert!((got / expected - 1.0).abs() < 0.05, "{got} {expected}");
    }

    #[test]
    fn the_frequency_of_the_largest_error_is_where_a_resonance_was_added() {
        let dt = 0.002;
        for resonance in [6.31, 22.7, 41.3] {
            let wanted = noise(10_000, 9);
            // A narrow resonance of 1 % damping in parallel, by its exact response to held samples.
            let w = TAU * resonance;
            let (zeta, damped) = (0.01, w * (1.0_f64 - 1e-4).sqrt());
            let decay = (-zeta * w * dt).exp();
            let (mut one, mut two) = (0.0, 0.0);
            let found: Vec<f64> = wanted
                .iter()
                .map(|a| {
                    let now =
                        2.0 * decay * (damped * dt).cos() * one - decay * decay * two + 0.05 * a;
                    (two, one) = (one, now);
                    a + now
                })
                .collect();
            let own = Laboratory::new(&wanted, &found, dt);
            let worst = own.worst_band();
            assert!(
                (worst.largest_at_hz / resonance - 1.0).abs() < 0.03,
                "{worst:?} for {resonance} Hz"
            );
            // As an independent scan of 200 oscillators an octave finds it.
            let [low, high] = worst.band_hz;
            let count = (200.0 * (high / low).log2()) as usize;
            let scan: Vec<f64> = (0..=count)
                .map(|n| low * (high / low).powf(n as f64 / count as f64))
                .collect();
            let [reference, table] =
                [&wanted, &found].map(|a| pseudo_acceleration(a, dt, &scan, USUAL_DAMPING));
            let pairs = table.iter().zip(&reference);
            let most = pairs.fold(0.0_f64, |most, (t, r)| {
                most.max(100.0 * (t / r - 1.0).abs())
            });
            assert!(
                (worst.largest / most - 1.0).abs() < 0.02,
                "{worst:?}, {most} %"
            );
        }
    }
}
