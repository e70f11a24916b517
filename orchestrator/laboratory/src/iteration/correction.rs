//! The correction of a drive from what a run left over (Eq 1-5 to 1-7, gain by frequency and
//! coherence).

use std::f64::consts::TAU;

use identification::estimation::spectra::Spectra;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

use motion::Motion;
use motion::metrics::spectrum;

/// Segments of the transfer function, s.
const SEGMENT: f64 = 4.0;
/// Most by which a line of the transfer function is inverted: what the table hardly follows is not
/// forced.
const MOST_GAIN: f64 = 3.0;
/// Quiet time after a motion, s: the correction of its end does not reach around to its beginning.
const QUIET: f64 = 8.0;
/// Share of the strongest line's power below which a drive has nothing at a line, and coherence below which
/// drive and response have nothing to do with each other.
const FAINT: f64 = 1e-10;
const UNRELATED: f64 = 0.2;
/// Time at either end in which corrections rise from nothing, s.
const EDGE: f64 = 0.5;

/// What was measured of a table, on the reference's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Displacement, m.
    pub displacement: Vec<f64>,
    /// Acceleration, m/s².
    pub acceleration: Vec<f64>,
}

/// A line of the transfer function from drive to table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Where it lies, Hz.
    pub frequency: f64,
    /// Its size.
    pub gain: f64,
    /// Part of the table's motion that is linear in the drive.
    pub coherence: f64,
}

/// The transfer function from drive to table, and how what is measured becomes one error.
#[derive(Debug, Clone)]
pub struct Inverse {
    /// Line distance, Hz.
    step: f64,
    /// The transfer function within the band, where it was measured.
    response: Vec<Line>,
    /// Coherence times the inverse of the transfer function, a line each.
    lines: Vec<Complex64>,
    /// Frequency below which displacement counts and above which acceleration does, Hz.
    crossover: f64,
    /// Frequencies between which errors are corrected, Hz.
    band: [f64; 2],
}

/// The transfer function from a drive to what it moves, over lines of a constant distance.
#[derive(Debug, Clone)]
pub struct Response {
    /// Line distance, Hz.
    step: f64,
    gain: Vec<Complex64>,
    coherence: Vec<f64>,
}

impl Response {
    /// From pairs of drive and response with a sample every `dt` s; none for one shorter than two segments.
    #[must_use]
    pub fn new(pairs: &[[&[f64]; 2]], dt: f64) -> Option<Self> {
        let length = (SEGMENT / dt) as usize;
        let all = pairs.iter().map(|pair| Spectra::new(pair, dt, length));
        let all = all.collect::<Result<Vec<_>, _>>().ok()?;
        let frequency = &all.first()?.frequency;
        let drives = |k| all.iter().map(|own| own.power(0, k)).sum::<f64>();
        let most = (0..frequency.len()).map(drives).fold(0.0, f64::max);
        let (mut gain, mut coherence) = (Vec::new(), Vec::new());
        for k in 0..frequency.len() {
            let power = |channel| all.iter().map(|own| own.power(channel, k)).sum::<f64>();
            let cross: Complex64 = all.iter().map(|own| own.cross(1, 0, k)).sum();
            let (input, output) = (power(0), power(1));
            let common = cross.norm_sqr() / (input * output).max(f64::MIN_POSITIVE);
            // What was hardly driven, or not followed, says nothing of a response there.
            let says = input > FAINT * most && common > UNRELATED;
            gain.push(if says {
                cross / input
            } else {
                Complex64::new(0.0, 0.0)
            });
            coherence.push(if says { common } else { 0.0 });
        }
        // The mean is taken from every segment: what is steady follows as the slowest line does.
        gain[0] = Complex64::new(gain.get(1)?.re, 0.0);
        coherence[0] = *coherence.get(1)?;
        Some(Self {
            step: *frequency.get(1)?,
            gain,
            coherence,
        })
    }

    fn at(&self, frequency: f64) -> Complex64 {
        let place = frequency / self.step;
        let (k, part) = (place as usize, place.fract());
        match (self.gain.get(k), self.gain.get(k + 1)) {
            (Some(low), Some(high)) => low * (1.0 - part) + high * part,
            (Some(last), None) => *last,
            _ => Complex64::new(0.0, 0.0),
        }
    }

    /// The response to `drive`, a sample every `dt` s.
    #[must_use]
    pub fn of(&self, drive: &[f64], dt: f64) -> Vec<f64> {
        let length = padded(drive.len(), dt);
        let step = 1.0 / (length as f64 * dt);
        let lines = spectrum(drive, length).into_iter().enumerate();
        let lines = lines.map(|(k, line)| line * self.at(k as f64 * step));
        let mut history = from_spectrum(lines.collect(), length);
        history.truncate(drive.len());
        history
    }
}

impl Inverse {
    /// Of the response of displacements alone, within `band` where their coherence is at least `coherent`.
    #[must_use]
    pub fn of(response: &Response, band: [f64; 2], coherent: f64) -> Self {
        let mut shown = Vec::new();
        let all = response.gain.iter().zip(&response.coherence).enumerate();
        let lines = all.map(|(k, (gain, &coherence))| {
            let frequency = k as f64 * response.step;
            if (band[0]..=band[1]).contains(&frequency) {
                shown.push(Line {
                    frequency,
                    gain: gain.norm(),
                    coherence,
                });
            }
            if coherence < coherent {
                return Complex64::new(0.0, 0.0);
            }
            let size = gain.norm().max(1.0 / MOST_GAIN);
            coherence * gain.conj() / (size * gain.norm().max(f64::MIN_POSITIVE))
        });
        Self {
            step: response.step,
            lines: lines.collect(),
            crossover: f64::INFINITY,
            band,
            response: shown,
        }
    }

    /// What a drive of displacement lacks for an `error` of displacement, both m, a sample every `dt` s.
    #[must_use]
    pub fn correction(&self, error: &[f64], dt: f64) -> Vec<f64> {
        let (samples, length) = (error.len(), padded(error.len(), dt));
        let step = 1.0 / (length as f64 * dt);
        let lines = spectrum(error, length).into_iter().enumerate();
        let lines = lines.map(|(k, line)| {
            let frequency = k as f64 * step;
            line * self.at(frequency) * inside(frequency, self.band)
        });
        let mut history = from_spectrum(lines.collect(), length);
        history.truncate(samples);
        for (n, value) in history.iter_mut().enumerate() {
            *value *= window(n, samples, dt)[0];
        }
        history
    }

    /// The lowest and the highest frequency that are corrected, Hz.
    #[must_use]
    pub fn corrected_band(&self) -> [f64; 2] {
        let is_corrected = |line: &&Line| {
            let k = (line.frequency / self.step).round() as usize;
            self.lines.get(k).is_some_and(|line| line.norm() > 0.0)
        };
        let mut all = self.response.iter().filter(is_corrected);
        let first = all.next().map_or(f64::NAN, |line| line.frequency);
        [first, all.next_back().map_or(first, |line| line.frequency)]
    }

    /// From a run of `drive`; none for one shorter than two segments.
    #[must_use]
    pub fn new(
        drive: &Motion,
        measured: &Measured,
        crossover: f64,
        band: [f64; 2],
    ) -> Option<Self> {
        let dt = drive.dt;
        let length = (SEGMENT / dt) as usize;
        let output = joined(
            &measured.displacement,
            &measured.acceleration,
            dt,
            crossover,
            [0.0, 0.5 / dt],
        );
        let input = joined(
            &drive.displacement,
            &drive.acceleration,
            dt,
            crossover,
            [0.0, 0.5 / dt],
        );
        let spectra = Spectra::new(&[&input, &output], dt, length).ok()?;
        let mut response = Vec::new();
        let lines = (0..spectra.frequency.len())
            .map(|k| {
                let coherence = spectra.coherence(0, 1, k);
                let gain = spectra.gain(0, 1, k);
                let frequency = spectra.frequency[k];
                if (band[0]..=band[1]).contains(&frequency) {
                    response.push(Line {
                        frequency,
                        gain: gain.norm(),
                        coherence,
                    });
                }
                let size = gain.norm().max(1.0 / MOST_GAIN);
                coherence * gain.conj() / (size * gain.norm().max(f64::MIN_POSITIVE))
            })
            .collect();
        Some(Self {
            step: spectra.frequency.get(1).copied()?,
            lines,
            crossover,
            band,
            response,
        })
    }

    /// From the whole of a `drive` that ends at rest and the answer of something linear without noise: exact
    /// to its last line.
    #[must_use]
    pub fn exact(drive: &Motion, answer: &Measured, crossover: f64, band: [f64; 2]) -> Self {
        let dt = drive.dt;
        let length = padded(drive.len(), dt);
        let all = [0.0, 0.5 / dt];
        let [input, output] = [
            (&drive.displacement, &drive.acceleration),
            (&answer.displacement, &answer.acceleration),
        ]
        .map(|(x, a)| spectrum(&joined(x, a, dt, crossover, all), length));
        let lines = input.iter().zip(&output).map(|(input, output)| {
            let gain = output / input;
            let size = gain.norm();
            // Nothing is there at rest.
            if size.is_normal() {
                gain.conj() / (size * size.max(1.0 / MOST_GAIN))
            } else {
                Complex64::new(0.0, 0.0)
            }
        });
        Self {
            step: 1.0 / (length as f64 * dt),
            lines: lines.collect(),
            crossover,
            band,
            response: Vec::new(),
        }
    }

    /// Mean coherence over the band.
    #[must_use]
    pub fn coherence(&self) -> f64 {
        let sum: f64 = self.response.iter().map(|line| line.coherence).sum();
        sum / f64::max(self.response.len() as f64, 1.0)
    }

    /// The transfer function within the band.
    #[must_use]
    pub fn response(&self) -> &[Line] {
        &self.response
    }

    /// The same, which corrects nothing outside of its band: what an error that is cut off at its end has at the
    /// lowest frequencies would otherwise become a slow drift of the drive.
    #[must_use]
    pub fn within_band(mut self) -> Self {
        for (k, line) in self.lines.iter_mut().enumerate() {
            *line *= inside(k as f64 * self.step, self.band);
        }
        self
    }

    fn at(&self, frequency: f64) -> Complex64 {
        let place = frequency / self.step;
        let (k, part) = (place as usize, place.fract());
        match (self.lines.get(k), self.lines.get(k + 1)) {
            (Some(low), Some(high)) => low * (1.0 - part) + high * part,
            _ => Complex64::new(0.0, 0.0),
        }
    }

    /// Acceleration error within the band, from displacement where that is more certain, m/s².
    #[must_use]
    pub fn error(&self, wanted: &Motion, measured: &Measured) -> Vec<f64> {
        let less = |wanted: &[f64], got: &[f64]| -> Vec<f64> {
            wanted.iter().zip(got).map(|(w, g)| w - g).collect()
        };
        let displacement = less(&wanted.displacement, &measured.displacement);
        let acceleration = less(&wanted.acceleration, &measured.acceleration);
        joined(
            &displacement,
            &acceleration,
            wanted.dt,
            self.crossover,
            self.band,
        )
    }

    /// Adds `gain` times the inverse of what `error` (m/s²) is to `drive`.
    pub fn correct(&self, drive: &mut Motion, error: &[f64], gain: f64) {
        let (samples, dt) = (drive.len(), drive.dt);
        let length = padded(samples, dt);
        let step = 1.0 / (length as f64 * dt);
        let lines: Vec<Complex64> = spectrum(error, length)
            .iter()
            .enumerate()
            .map(|(k, line)| gain * line * self.at(k as f64 * step))
            .collect();
        let history = |power: i32| {
            let lines = lines.iter().enumerate().map(|(k, line)| {
                let s = Complex64::new(0.0, TAU * k as f64 * step);
                if k == 0 {
                    Complex64::new(0.0, 0.0)
                } else {
                    line * s.powi(power)
                }
            });
            from_spectrum(lines.collect(), length)
        };
        let (x, v, a) = (history(-2), history(-1), history(0));
        for n in 0..samples {
            let [w, dw, ddw] = window(n, samples, dt);
            drive.displacement[n] += w * x[n];
            drive.velocity[n] += w * v[n] + dw * x[n];
            drive.acceleration[n] += w * a[n] + 2.0 * dw * v[n] + ddw * x[n];
        }
    }
}

/// Acceleration from displacement below and from acceleration above `crossover`, within `band`.
fn joined(
    displacement: &[f64],
    acceleration: &[f64],
    dt: f64,
    crossover: f64,
    band: [f64; 2],
) -> Vec<f64> {
    let samples = displacement.len().min(acceleration.len());
    let length = padded(samples, dt);
    let step = 1.0 / (length as f64 * dt);
    let slow = spectrum(&displacement[..samples], length);
    let quick = spectrum(&acceleration[..samples], length);
    let lines = slow.iter().zip(&quick).enumerate().map(|(k, (x, a))| {
        let frequency = k as f64 * step;
        let below = 1.0 / (1.0 + (frequency / crossover).powi(4));
        let omega = TAU * frequency;
        (-omega * omega * below * x + (1.0 - below) * a) * inside(frequency, band)
    });
    let mut history = from_spectrum(lines.collect(), length);
    history.truncate(samples);
    history
}

/// 1 within the band, 0 half an octave beyond, straight by the logarithm between.
fn inside(frequency: f64, [low, high]: [f64; 2]) -> f64 {
    if frequency <= 0.0 {
        return 0.0;
    }
    let beyond = if low > 0.0 {
        (low / frequency).log2()
    } else {
        0.0
    };
    let beyond = beyond.max((frequency / high).log2()).max(0.0);
    (1.0 - 2.0 * beyond).max(0.0)
}

pub(super) fn padded(samples: usize, dt: f64) -> usize {
    (samples + (QUIET / dt) as usize).next_multiple_of(1000)
}

/// A history from its spectrum.
pub(super) fn from_spectrum(mut lines: Vec<Complex64>, length: usize) -> Vec<f64> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(length);
    let mut history = plan.make_output_vec();
    // The first and the last line of a real history are real.
    if let Some(first) = lines.first_mut() {
        first.im = 0.0;
    }
    if let Some(last) = lines.last_mut() {
        last.im = 0.0;
    }
    // The lengths come from the plan itself: it cannot fail.
    let done = plan.process(&mut lines, &mut history);
    debug_assert!(done.is_ok());
    history.iter_mut().for_each(|value| *value /= length as f64);
    history
}

/// Window at sample `n` of `samples` and its first two derivatives by time.
fn window(n: usize, samples: usize, dt: f64) -> [f64; 3] {
    let rise = |time: f64| {
        let u = (time / EDGE).clamp(0.0, 1.0);
        let left = 1.0 - u;
        [
            u.powi(4) * (35.0 - 84.0 * u + 70.0 * u * u - 20.0 * u.powi(3)),
            140.0 * (u * left).powi(3) / EDGE,
            420.0 * (u * left).powi(2) * (1.0 - 2.0 * u) / (EDGE * EDGE),
        ]
    };
    let [a, da, dda] = rise(n as f64 * dt);
    let [b, db, ddb] = rise((samples - 1 - n) as f64 * dt);
    [a * b, da * b - a * db, dda * b - 2.0 * da * db + a * ddb]
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::{Options, built_in};

    /// A table that answers as a lag of 20 ms with a gain of 0.8, on displacement, velocity and
    /// acceleration alike.
    fn table(drive: &Motion) -> Measured {
        let lag = |history: &[f64]| {
            let mut y = 0.0;
            let part = 1.0 - (-drive.dt / 0.02).exp();
            history
                .iter()
                .map(|u| {
                    y += part * (0.8 * u - y);
                    y
                })
                .collect::<Vec<f64>>()
        };
        Measured {
            displacement: lag(&drive.displacement),
            acceleration: lag(&drive.acceleration),
        }
    }

    #[test]
    fn a_linear_table_is_corrected_at_once_and_its_drive_stays_one_motion() {
        let wanted = built_in(5, &Options::default()).unwrap();
        let other = built_in(6, &Options::default()).unwrap();
        let inverse = Inverse::new(&other, &table(&other), 5.0, [0.3, 20.0]).unwrap();
        assert!(inverse.coherence() > 0.98, "{}", inverse.coherence());
        let mut drive = wanted.clone();
        let size = |drive: &Motion| {
            let error = inverse.error(&wanted, &table(drive));
            motion::metrics::rms(&error) / wanted.peak_acceleration()
        };
        let before = size(&drive);
        let error = inverse.error(&wanted, &table(&drive));
        inverse.correct(&mut drive, &error, 1.0);
        let after = size(&drive);
        println!("{before:.4} to {after:.4}");
        assert!(before > 0.05 && after < 0.15 * before, "{before} {after}");
        // Velocity and acceleration stay the slopes of displacement and velocity.
        for (of, rate) in [
            (&drive.displacement, &drive.velocity),
            (&drive.velocity, &drive.acceleration),
        ] {
            let largest = rate.iter().fold(0.0f64, |m, r| m.max(r.abs()));
            for n in 1..of.len() - 1 {
                let slope = (of[n + 1] - of[n - 1]) / (2.0 * drive.dt);
                assert!((slope - rate[n]).abs() < 0.03 * largest, "sample {n}");
            }
        }
        assert_eq!((drive.displacement[0], drive.velocity[0]), (0.0, 0.0));
    }

    #[test]
    fn a_response_is_linear_between_its_lines_and_nothing_beyond() {
        let response = Response {
            step: 0.5,
            gain: vec![
                Complex64::new(1.0, 0.0),
                Complex64::new(3.0, 0.0),
                Complex64::new(0.0, 5.0),
            ],
            coherence: vec![1.0; 3],
        };
        for (frequency, re, im) in [
            (0.0, 1.0, 0.0),
            (0.25, 2.0, 0.0),
            (0.5, 3.0, 0.0),
            (0.75, 1.5, 2.5),
            (1.0, 0.0, 5.0),
            (1.2, 0.0, 5.0),
            (1.6, 0.0, 0.0),
        ] {
            let found = response.at(frequency);
            assert!(
                (found - Complex64::new(re, im)).norm() < 1e-12,
                "{frequency} Hz: {found}"
            );
        }
    }

    /// A pulse about the middle of `samples`, its second derivative by time, and so many samples.
    fn pulse(samples: usize, dt: f64) -> (Vec<f64>, Vec<f64>) {
        let width = 0.15;
        let at = |k: usize| {
            let u = (k as f64 - 0.5 * samples as f64) * dt / width;
            let value = (-u * u).exp();
            (value, value * (4.0 * u * u - 2.0) / (width * width))
        };
        (0..samples).map(at).unzip()
    }

    fn largest(one: &[f64], other: &[f64]) -> f64 {
        assert_eq!(one.len(), other.len());
        let off = one.iter().zip(other).map(|(a, b)| (a - b).abs());
        off.fold(0.0, f64::max)
    }

    #[test]
    fn displacement_and_acceleration_of_one_motion_join_to_its_acceleration() {
        let dt = 0.005;
        let (displacement, acceleration) = pulse(1200, dt);
        let still = vec![0.0; 1200];
        let all = [0.0, 0.5 / dt];
        let peak = acceleration.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
        let near = |own: Vec<f64>| largest(&own, &acceleration) < 1e-3 * peak;
        for crossover in [0.5, 2.0, 20.0] {
            let own = joined(&displacement, &acceleration, dt, crossover, all);
            assert!(near(own), "{crossover}");
        }
        // Far below the crossover the displacement alone counts, far above the acceleration alone.
        assert!(near(joined(&displacement, &still, dt, 1e4, all)));
        assert!(near(joined(&still, &acceleration, dt, 1e-3, all)));
        let half = joined(&displacement, &still, dt, 2.0, all);
        assert!(!near(half));
        // Nothing of it is beyond 20 Hz, and nearly all below 8 Hz.
        let beyond = joined(&displacement, &acceleration, dt, 2.0, [20.0, 50.0]);
        assert!(largest(&beyond, &still) < 1e-3 * peak);
        assert!(near(joined(
            &displacement,
            &acceleration,
            dt,
            2.0,
            [0.0, 8.0]
        )));
        // As many samples as both have.
        let short = joined(&displacement[..900], &acceleration, dt, 2.0, all);
        assert_eq!(short.len(), 900);
    }

    #[test]
    fn a_band_ends_within_half_an_octave() {
        let band = [2.0, 8.0];
        for (frequency, expected) in [
            (2.0, 1.0),
            (4.0, 1.0),
            (8.0, 1.0),
            (8.0 * 2_f64.powf(0.25), 0.5),
            (8.0 * 2_f64.powf(0.5), 0.0),
            (16.0, 0.0),
            (2.0 / 2_f64.powf(0.25), 0.5),
            (1.0, 0.0),
            (0.0, 0.0),
            (-4.0, 0.0),
        ] {
            let found = inside(frequency, band);
            assert!((found - expected).abs() < 1e-12, "{frequency}: {found}");
        }
        assert_eq!(inside(1e-6, [0.0, 8.0]), 1.0);
        assert_eq!(inside(0.0, [0.0, 8.0]), 0.0);
    }

    #[test]
    fn the_window_rises_and_falls_with_its_own_derivatives() {
        let (samples, dt) = (2001, 0.001);
        let at = |n: usize| window(n, samples, dt);
        assert_eq!(at(0), [0.0; 3]);
        assert_eq!(at(2000), [0.0; 3]);
        assert_eq!(at(1000), [1.0, 0.0, 0.0]);
        // Half way up at half of the edge, alike at both ends.
        assert!((at(250)[0] - 0.5).abs() < 1e-12);
        for n in 1..2000 {
            let [before, own, after] = [at(n - 1), at(n), at(n + 1)];
            for order in 0..2 {
                let slope = (after[order] - before[order]) / (2.0 * dt);
                let size = [4.4, 31.0][order];
                assert!((slope - own[order + 1]).abs() < 1e-3 * size, "sample {n}");
            }
            assert!((own[0] - at(2000 - n)[0]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_history_is_that_of_its_spectrum_and_quiet_follows_it() {
        let values: Vec<f64> = (0..1000).map(|k| f64::from((k * k) % 17) - 8.0).collect();
        let again = from_spectrum(spectrum(&values, 1000), 1000);
        assert!(largest(&values, &again) < 1e-12);
        // Eight seconds at the least, in thousands.
        for (samples, dt, expected) in [
            (1000, 0.01, 2000),
            (1200, 0.01, 2000),
            (1201, 0.01, 3000),
            (1, 0.008, 2000),
        ] {
            assert_eq!(padded(samples, dt), expected);
        }
    }

    /// Noise of a linear congruential generator, from -0.5 to 0.5.
    fn noise(samples: usize, seed: u32) -> Vec<f64> {
        let mut state = seed;
        let next = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        (0..samples).map(next).collect()
    }

    #[test]
    fn a_response_is_that_of_the_table_and_predicts_it() {
        let dt = 0.01;
        let table = |drive: &[f64]| -> Vec<f64> {
            let at = |k: usize| 0.6 * drive[k] + if k > 0 { 0.3 * drive[k - 1] } else { 0.0 };
            (0..drive.len()).map(at).collect()
        };
        let drives = [noise(6000, 1), noise(5000, 2)];
        let shown = drives.each_ref().map(|drive| table(drive));
        let pairs = [0, 1].map(|k| [drives[k].as_slice(), shown[k].as_slice()]);
        let found = Response::new(&pairs, dt).unwrap();
        assert_eq!(found.step, 1.0 / SEGMENT);
        // 0.6 + 0.3 exp(-i w dt), whose gain falls from 0.9 to 0.3.
        for frequency in [1.0, 10.0, 25.0, 40.0, 49.0] {
            let turn = Complex64::from_polar(0.3, -TAU * frequency * dt);
            let off = found.at(frequency) - (turn + 0.6);
            assert!(off.norm() < 0.02, "{frequency} Hz: {off}");
        }
        assert!(found.coherence.iter().all(|own| *own > 0.98));
        let other = noise(3000, 3);
        let (predicted, played) = (found.of(&other, dt), table(&other));
        let rest: Vec<f64> = predicted.iter().zip(&played).map(|(a, b)| a - b).collect();
        let share = motion::metrics::rms(&rest) / motion::metrics::rms(&played);
        assert!(share < 0.03, "{share}");
        // What has nothing to do with the drive is no response.
        let unrelated = noise(6000, 9);
        let none = Response::new(&[[&drives[0], &unrelated]], dt).unwrap();
        let known = none.coherence.iter().filter(|own| **own > 0.0).count();
        assert!(10 * known < none.coherence.len(), "{known}");
        assert!(Response::new(&[[&other[..400], &played[..400]]], dt).is_none());
        assert!(Response::new(&[], dt).is_none());
    }

    #[test]
    fn an_inverse_is_limited_where_the_table_hardly_follows() {
        let turned = Complex64::from_polar(0.1, 0.7);
        let response = Response {
            step: 0.5,
            gain: vec![
                Complex64::new(1.0, 0.0),
                Complex64::new(2.0, 0.0),
                turned,
                Complex64::new(0.0, 4.0),
                Complex64::new(1.0, 0.0),
            ],
            coherence: vec![1.0, 0.8, 1.0, 0.4, 0.9],
        };
        let own = Inverse::of(&response, [0.5, 1.6], 0.5);
        let expected = [
            Complex64::new(1.0, 0.0),
            // Its coherence of its inverse; at most three; none where it is not coherent.
            Complex64::new(0.4, 0.0),
            Complex64::from_polar(3.0, -0.7),
            Complex64::new(0.0, 0.0),
            Complex64::new(0.9, 0.0),
        ];
        for (k, expected) in expected.iter().enumerate() {
            let off = (own.lines[k] - expected).norm();
            assert!(off < 1e-12, "line {k}: {}", own.lines[k]);
        }
        let shown: Vec<f64> = own.response().iter().map(|line| line.frequency).collect();
        assert_eq!(shown, [0.5, 1.0, 1.5]);
        assert!((own.coherence() - (0.8 + 1.0 + 0.4) / 3.0).abs() < 1e-12);
        assert_eq!(own.corrected_band(), [0.5, 1.0]);
        // Between lines it is linear; beyond the last there is nothing.
        assert!((own.at(0.25) - Complex64::new(0.7, 0.0)).norm() < 1e-12);
        assert_eq!(own.at(2.1), Complex64::new(0.0, 0.0));
        // Half an octave beyond its band nothing is left.
        let kept = own.within_band();
        assert_eq!(kept.lines[0].norm(), 0.0);
        assert_eq!(kept.lines[1], expected[1]);
        assert!((kept.lines[2] - expected[2]).norm() < 1e-12);
        let part = inside(2.0, [0.5, 1.6]);
        assert!(part > 0.0 && part < 1.0);
        assert!((kept.lines[4] - 0.9 * part).norm() < 1e-12);
        let nothing = Inverse::of(&response, [5.0, 6.0], 0.5);
        assert_eq!(nothing.coherence(), 0.0);
        assert!(nothing.corrected_band().iter().all(|bound| bound.is_nan()));
    }

    #[test]
    fn a_correction_of_a_drive_makes_up_for_a_smaller_table() {
        let dt = 0.01;
        let half = Response {
            step: 0.25,
            gain: vec![Complex64::new(0.5, 0.0); 201],
            coherence: vec![1.0; 201],
        };
        let inverse = Inverse::of(&half, [0.0, 50.0], 0.5);
        // A pulse without a mean: 0 Hz is not corrected.
        let (_, error) = pulse(600, dt);
        let own = inverse.correction(&error, dt);
        let twice: Vec<f64> = error.iter().map(|value| 2.0 * value).collect();
        let peak = error.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
        assert!(largest(&own, &twice) < 1e-3 * peak);
        assert_eq!((own[0], own[599]), (0.0, 0.0));
    }
}
