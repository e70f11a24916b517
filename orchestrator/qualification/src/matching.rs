//! A motion whose response spectrum fits a required one.
//!
//! 1. A Fourier series, of random phases under an envelope or of a record with its phases, is shaped by
//!    frequency: each line times required over found spectrum, some times.
//! 2. Wavelets bring the rest (`wavelets`).
//!
//! Displacement is what is put together; velocity and acceleration are its exact derivatives. The motion is at
//! rest, and where it began, in its first and last sample.

use std::f64::consts::TAU;

use motion::metrics::{response_spectrum, rms, spectrum};
use motion::{Motion, Options, Record, Scaling, peak};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use sysid::spectra::Spectra;
use units::STANDARD_GRAVITY;

pub use crate::wavelets::{Aim, Histories, refine};

use crate::QualificationError;
use crate::rule::{Rule, grid};
use crate::verdict::{extremes, ratios};

/// Ratio of test to required spectrum that a motion is made for, and what is good enough.
pub const CENTRE: f64 = 1.065;
/// Ratios that are good enough.
pub const ENOUGH: [f64; 2] = [1.03, 1.105];
/// Rounds of shaping by frequency.
const SHAPING: usize = 12;
/// Seeds that are tried at most.
const SEEDS: u64 = 4;
/// Quiet time behind a series, s.
const QUIET: f64 = 4.0;
/// Taper at either end of a record, s.
const TAPER: f64 = 1.0;
/// Segments of the coherence of two axes, s.
const SEGMENT: f64 = 2.0;

/// A motion that was matched.
#[derive(Debug, Clone)]
pub struct Matched {
    /// The motion.
    pub motion: Motion,
    /// Rounds of wavelets.
    pub rounds: usize,
    /// Lowest and highest ratio of its spectrum to the required one on 1/12 octaves over the band.
    pub ratios: [f64; 2],
}

/// Lowest and highest ratio on 1/12 octaves over a rule's band.
#[must_use]
pub fn twelfths(rule: &Rule, acceleration: &[f64], dt: f64) -> [f64; 2] {
    extremes(&ratios(
        rule,
        acceleration,
        dt,
        &grid(rule.band_hz, 12, 0.0),
    ))
}

/// Of random phases: rises, is strong for the rule's time, and decays. Up to four seeds from `seed` on are
/// tried, the best is kept and named.
#[must_use]
pub fn from_noise(rule: &Rule, seed: u64, dt: f64) -> Matched {
    let mut best: Option<Matched> = None;
    for seed in seed..seed.saturating_add(SEEDS) {
        let found = of_seed(rule, seed, dt);
        let is_better = |other: &Matched| miss(&found) < miss(other);
        let good = found.ratios[0] >= 1.0 && found.ratios[1] <= 1.15;
        if best.as_ref().is_none_or(is_better) {
            best = Some(found.clone());
        }
        if good {
            break;
        }
    }
    best.unwrap_or_else(|| of_seed(rule, seed, dt))
}

/// How far a match is from its centre.
fn miss(own: &Matched) -> f64 {
    (own.ratios[1] / CENTRE)
        .ln()
        .max((CENTRE / own.ratios[0]).ln())
}

fn of_seed(rule: &Rule, seed: u64, dt: f64) -> Matched {
    let samples = (rule.duration_s / dt).round() as usize + 1;
    let length = padded(samples, dt);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let step = 1.0 / (length as f64 * dt);
    let lines: Vec<Complex64> = (0..length / 2 + 1)
        .map(|k| {
            let phase: f64 = random.random_range(0.0..TAU);
            let frequency = (k as f64 * step).max(step);
            // About what makes a spectrum of this level: its square goes as the density times frequency.
            Complex64::from_polar(rule.required(frequency) / frequency.sqrt(), phase)
        })
        .collect();
    let edge = 0.5 * (rule.duration_s - rule.strong_s);
    let name = format!("{} seed {seed}", rule.name);
    let series = Series {
        lines,
        length,
        samples,
        dt,
        edge,
    };
    let note = format!("random phases of seed {seed} under an envelope");
    let mut found = series.matched(rule, name, note);
    found.motion.seed = Some(seed);
    found
}

/// Of a record, whose phases are kept.
///
/// # Errors
/// A record that cannot be resampled over the rule's band.
pub fn from_record(rule: &Rule, record: &Record, dt: f64) -> Result<Matched, QualificationError> {
    let [low, high] = content(rule);
    let options = Options {
        sample_time: dt,
        band_hz: [0.5 * low, high],
        taper: TAPER,
        scaling: Some(Scaling::Factor(1.0)),
        stroke: f64::MAX,
    };
    let played = motion::process(record, &options).map_err(|error| QualificationError::Record {
        record: record.origin.clone(),
        reason: error.to_string(),
    })?;
    let samples = played.len();
    let length = padded(samples, dt);
    let series = Series {
        lines: spectrum(&played.acceleration, length),
        length,
        samples,
        dt,
        edge: TAPER,
    };
    let name = format!("{} on {}", rule.name, record.name);
    Ok(series.matched(rule, name, format!("phases of {}", record.origin)))
}

/// Frequencies that a motion holds, Hz.
fn content(rule: &Rule) -> [f64; 2] {
    [0.75 * rule.band_hz[0], 1.25 * rule.band_hz[1]]
}

/// A series of accelerations and its envelope.
struct Series {
    lines: Vec<Complex64>,
    length: usize,
    samples: usize,
    dt: f64,
    /// Length of rise and decay, s.
    edge: f64,
}

impl Series {
    fn matched(&self, rule: &Rule, name: String, note: String) -> Matched {
        let dt = self.dt;
        let mut histories = self.shaped(rule);
        let start = histories[2].clone();
        let aim = Aim::of(rule, CENTRE, ENOUGH);
        let (rounds, _) = refine(&aim, &start, &mut histories, dt);
        let [displacement, velocity, acceleration] = histories;
        let [low, high] = content(rule);
        let motion = Motion {
            name,
            dt,
            displacement,
            velocity,
            acceleration,
            notes: vec![
                note,
                format!(
                    "frequencies of {low:.3} to {high:.2} Hz, shaped {SHAPING} times as a Fourier series, then \
                     {rounds} rounds of wavelets"
                ),
                "at rest and where it began at both ends; displacement, velocity and acceleration are one \
                 motion"
                    .into(),
            ],
            seed: None,
            across: None,
        };
        Matched {
            ratios: twelfths(rule, &motion.acceleration, dt),
            rounds,
            motion,
        }
    }

    /// The histories with lines shaped until the spectrum is near the required one.
    fn shaped(&self, rule: &Rule) -> Histories {
        let frequencies = grid(rule.band_hz, 12, 0.0);
        let wanted: Vec<f64> = frequencies
            .iter()
            .map(|f| CENTRE * STANDARD_GRAVITY * rule.required(*f))
            .collect();
        let mut gains = vec![1.0; frequencies.len()];
        let mut best: Option<(f64, Histories)> = None;
        for _ in 0..=SHAPING {
            let histories = self.histories(rule, &frequencies, &gains);
            let found = response_spectrum(
                &histories[2],
                self.dt,
                &frequencies,
                rule.damping,
                rule.measure,
            );
            let ratios: Vec<f64> = wanted
                .iter()
                .zip(&found)
                .map(|(wanted, found)| wanted / found.max(f64::MIN_POSITIVE))
                .collect();
            let off = ratios.iter().map(|ratio| ratio.ln().powi(2)).sum::<f64>();
            if best.as_ref().is_none_or(|(before, _)| off < *before) {
                best = Some((off, histories));
            }
            gains
                .iter_mut()
                .zip(&ratios)
                .for_each(|(gain, ratio)| *gain *= ratio);
        }
        best.map_or_else(
            || self.histories(rule, &frequencies, &gains),
            |(_, own)| own,
        )
    }

    fn histories(&self, rule: &Rule, frequencies: &[f64], gains: &[f64]) -> Histories {
        let step = 1.0 / (self.length as f64 * self.dt);
        let [low, high] = content(rule);
        let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(self.length);
        let mut series = [0, 1, 2].map(|_| plan.make_input_vec());
        let ends = self.lines.len().min(series[0].len()) - 1;
        for k in 1..ends {
            let frequency = k as f64 * step;
            let inside = smooth((frequency / low).ln() / (rule.band_hz[0] / low).ln())
                * smooth((high / frequency).ln() / (high / rule.band_hz[1]).ln());
            if inside == 0.0 {
                continue;
            }
            let line = self.lines[k] * (inside * gain_at(frequencies, gains, frequency));
            let rate = Complex64::new(0.0, TAU * frequency);
            series[0][k] = line / (rate * rate);
            series[1][k] = line / rate;
            series[2][k] = line;
        }
        let [x, v, a] = series.map(|mut lines| {
            let mut history = plan.make_output_vec();
            // The lengths come from the plan itself, and the first and last lines are zero.
            let done = plan.process(&mut lines, &mut history);
            debug_assert!(done.is_ok());
            history.truncate(self.samples);
            let scale = 1.0 / self.length as f64;
            history.iter_mut().for_each(|value| *value *= scale);
            history
        });
        windowed([x, v, a], self.edge, self.dt)
    }
}

/// The displacement times an envelope that rises and falls within `edge` seconds, with its derivatives.
fn windowed([mut x, mut v, mut a]: Histories, edge: f64, dt: f64) -> Histories {
    let last = x.len().saturating_sub(1);
    for n in 0..x.len() {
        let [up, dup, ddup] = motion::smooth_step((n as f64 * dt / edge).min(1.0));
        let [down, ddown, dddown] = motion::smooth_step(((last - n) as f64 * dt / edge).min(1.0));
        let w = up * down;
        let dw = (dup * down - up * ddown) / edge;
        let ddw = (ddup * down - 2.0 * dup * ddown + up * dddown) / (edge * edge);
        a[n] = ddw * x[n] + 2.0 * dw * v[n] + w * a[n];
        v[n] = dw * x[n] + w * v[n];
        x[n] *= w;
    }
    [x, v, a]
}

/// 0 below 0, 1 above 1.
fn smooth(part: f64) -> f64 {
    motion::smooth_step(part.clamp(0.0, 1.0))[0]
}

/// The gain at a frequency, straight over its logarithm between those of a grid.
fn gain_at(frequencies: &[f64], gains: &[f64], frequency: f64) -> f64 {
    let after = frequencies.partition_point(|own| *own <= frequency);
    if after == 0 {
        return gains[0];
    }
    if after == frequencies.len() {
        return gains[after - 1];
    }
    let [low, high] = [frequencies[after - 1], frequencies[after]];
    let part = (frequency / low).ln() / (high / low).ln();
    gains[after - 1] + part * (gains[after] - gains[after - 1])
}

fn padded(samples: usize, dt: f64) -> usize {
    (samples + (QUIET / dt) as usize).next_multiple_of(1000)
}

/// Correlation coefficient (its size) of two accelerations and their largest coherence within a band.
#[must_use]
pub fn together(one: &[f64], other: &[f64], dt: f64, band: [f64; 2]) -> [f64; 2] {
    let product: f64 = one.iter().zip(other).map(|(a, b)| a * b).sum();
    let size = one.len() as f64 * rms(one) * rms(other);
    let correlation = if size > 0.0 {
        (product / size).abs()
    } else {
        0.0
    };
    let coherence =
        Spectra::new(&[one, other], dt, (SEGMENT / dt) as usize).map_or(0.0, |spectra| {
            let lines = spectra.frequency.iter().enumerate();
            let inside = lines.filter(|(_, f)| (band[0]..=band[1]).contains(*f));
            inside
                .map(|(k, _)| spectra.coherence(0, 1, k))
                .fold(0.0, f64::max)
        });
    [correlation, coherence]
}

/// Motions for all axes of a rule, each of other phases; later seeds replace an axis that is too much like an
/// earlier one. Of a record, only the first axis.
///
/// # Errors
/// A record that cannot be resampled.
pub fn axes(
    rule: &Rule,
    record: Option<&Record>,
    seed: u64,
    dt: f64,
) -> Result<Vec<Matched>, QualificationError> {
    let mut all = vec![match record {
        Some(record) => from_record(rule, record, dt)?,
        None => from_noise(rule, seed, dt),
    }];
    let mut next = all[0].motion.seed.unwrap_or(seed) + SEEDS;
    let mut tries = 0;
    let duration_s = (all[0].motion.len() - 1) as f64 * dt;
    let own = Rule {
        duration_s,
        strong_s: (rule.strong_s).min(0.8 * duration_s),
        ..rule.clone()
    };
    while all.len() < rule.axes {
        let found = from_noise(&own, next, dt);
        next += SEEDS;
        tries += 1;
        let apart = all.iter().all(|other| {
            let [correlation, coherence] = together(
                &other.motion.acceleration,
                &found.motion.acceleration,
                dt,
                rule.band_hz,
            );
            correlation <= rule.correlation && coherence <= rule.coherence
        });
        if apart {
            all.push(found);
        } else if tries > 20 {
            return Err(QualificationError::Rule {
                rule: rule.name.clone(),
                reason: format!(
                    "no {} axes were found with a correlation of at most {} and a coherence of at most {}; \
                     expected larger bounds or a longer duration",
                    rule.axes, rule.correlation, rule.coherence
                ),
            });
        }
    }
    Ok(all)
}

/// Time between which a motion first and last exceeds a quarter of its peak, s.
#[must_use]
pub fn strong_motion(acceleration: &[f64], dt: f64) -> f64 {
    let limit = 0.25 * peak(acceleration);
    let is_strong = |a: &f64| a.abs() >= limit;
    let first = acceleration.iter().position(is_strong).unwrap_or(0);
    let last = acceleration.iter().rposition(is_strong).unwrap_or(0);
    last.saturating_sub(first) as f64 * dt
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(rule: &Rule, found: &Matched) -> String {
        let m = &found.motion;
        let [low, high] = found.ratios;
        let line = format!(
            "{}: {low:.3} to {high:.3}, {} rounds, {:.2} g, {:.3} m/s, {:.1} mm, strong {:.1} s",
            m.name,
            found.rounds,
            m.peak_acceleration() / STANDARD_GRAVITY,
            m.peak_velocity(),
            1e3 * m.peak_displacement(),
            strong_motion(&m.acceleration, m.dt),
        );
        println!("{line}");
        // Integrated by the trapezoidal rule from the acceleration alone, it comes to rest.
        let (mut v, mut x, mut most) = (0.0, 0.0, [0.0f64; 2]);
        for pair in m.acceleration.windows(2) {
            let next = v + 0.5 * m.dt * (pair[0] + pair[1]);
            x += 0.5 * m.dt * (v + next);
            v = next;
            most = [most[0].max(x.abs()), most[1].max(v.abs())];
        }
        assert!(
            x.abs() < 1e-3 * most[0] && v.abs() < 1e-3 * most[1],
            "{line}"
        );
        for history in [&m.displacement, &m.velocity, &m.acceleration] {
            assert!(
                history[0].abs() + history[m.len() - 1].abs() < 1e-12,
                "{line}"
            );
        }
        assert!(low >= 1.0 && high <= 1.15, "{line}");
        assert!(
            strong_motion(&m.acceleration, m.dt) >= 0.95 * rule.strong_s,
            "{line}"
        );
        line
    }

    #[test]
    fn a_motion_fits_ac156_and_its_seed_repeats_it() {
        let rule = Rule::ac156(1.0, 0.0, false);
        let found = from_noise(&rule, 1, 0.002);
        judge(&rule, &found);
        assert_eq!(found.motion, from_noise(&rule, 1, 0.002).motion);
    }

    #[test]
    #[ignore = "half a minute: all cases of the book"]
    fn every_case_is_matched_on_twelfths_of_an_octave() {
        let mut misses = Vec::new();
        let mut cases: Vec<Rule> = Vec::new();
        for s_ds in [0.2, 0.5, 1.0, 1.5] {
            for z_h in [0.0, 0.25, 0.5, 0.75, 1.0] {
                cases.push(Rule::ac156(s_ds, z_h, false));
            }
        }
        for damping in [2.0, 5.0] {
            cases.push(Rule::ieee693("high", 1.0, damping));
        }
        let mut random = ChaCha8Rng::seed_from_u64(11);
        for n in 0..10 {
            let mut own = Rule::ac156(1.0, 0.0, false);
            own.name = format!("drawn {n}");
            own.damping = [0.02, 0.03, 0.05, 0.07][n % 4];
            let flexible: f64 = random.random_range(0.3..2.5);
            let rigid = flexible * random.random_range(0.35..0.8);
            let levels = [
                0.3 * flexible,
                flexible,
                flexible * random.random_range(0.7..1.2),
                rigid,
            ];
            let corners = [
                0.1,
                random.random_range(1.5..4.0),
                random.random_range(6.0..12.0),
                33.0,
            ];
            own.points = corners
                .iter()
                .zip(levels)
                .map(|(&frequency, level)| crate::Point {
                    frequency,
                    level,
                    next: crate::Interpolation::LogLog,
                })
                .collect();
            cases.push(own);
        }
        let start = std::time::Instant::now();
        for rule in &cases {
            let found = from_noise(rule, 1, 0.002);
            let line = std::panic::catch_unwind(|| judge(rule, &found));
            misses.extend(line.err().map(|_| rule.name.clone()));
        }
        println!(
            "{:.2} s each",
            start.elapsed().as_secs_f64() / cases.len() as f64
        );
        assert!(misses.is_empty(), "{misses:?}");
    }

    #[test]
    fn a_record_is_matched_with_its_phases() {
        let record = motion::CloughPenzien::default().record(3);
        let rule = Rule {
            duration_s: 25.0,
            strong_s: 8.0,
            ..Rule::ac156(0.6, 0.5, false)
        };
        let found = from_record(&rule, &record, 0.002).unwrap();
        let [low, high] = found.ratios;
        assert!(low >= 1.0 && high <= 1.15, "{low} {high}");
    }

    /// Lines of 1 Hz and 20 Hz are in the middle of the tapers over the logarithm of the frequency.
    #[test]
    fn histories_are_those_of_lines_that_fade_at_the_ends_of_the_band() {
        let (length, dt) = (2000, 0.005);
        let rule = Rule {
            band_hz: [1.0 / 0.75_f64.sqrt(), 20.0 / 1.25_f64.sqrt()],
            ..Rule::ac156(1.0, 0.0, false)
        };
        for (line, part) in [(8, 0.0), (10, 0.5), (30, 1.0), (200, 0.5), (230, 0.0)] {
            let mut lines = vec![Complex64::default(); length / 2 + 1];
            lines[line] = Complex64::new(0.5 * length as f64, 0.0);
            let series = Series {
                lines,
                length,
                samples: 1001,
                dt,
                edge: 1.0,
            };
            let [x, v, a] = series.histories(&rule, &[5.0], &[2.0]);
            // Lines are 0.1 Hz apart; the envelope is 1 from 1 s to 4 s.
            let omega = TAU * 0.1 * line as f64;
            for n in [200, 333, 500, 800] {
                let (sin, cos) = (omega * dt * n as f64).sin_cos();
                let of = [-cos / (omega * omega), sin / omega, cos];
                for (found, wanted) in [x[n], v[n], a[n]].iter().zip(of) {
                    assert!(
                        (found - 2.0 * part * wanted).abs() < 1e-9,
                        "line {line}, sample {n}: {found}"
                    );
                }
            }
        }
    }

    #[test]
    fn axes_are_not_alike() {
        let rule = Rule {
            axes: 2,
            ..Rule::ac156(1.0, 0.5, false)
        };
        let all = axes(&rule, None, 3, 0.002).unwrap();
        let [one, other] = [&all[0].motion.acceleration, &all[1].motion.acceleration];
        let [correlation, coherence] = together(one, other, 0.002, rule.band_hz);
        assert!(
            correlation <= 0.3 && coherence <= 0.5,
            "{correlation} {coherence}"
        );
        assert!(together(one, one, 0.002, rule.band_hz)[0] > 0.999);
    }
}
