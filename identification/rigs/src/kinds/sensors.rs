//! Whether two sensors of one motion agree: the accelerometer against the displacement's second derivative.

use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

use super::RigRecording;
use super::named_value::NamedValue;
use recordings::Channel;

/// Frequencies that are looked at, Hz, the upper one also as a share of the sampling rate.
const BAND: (f64, f64) = (0.4, 15.0);
const HIGHEST: f64 = 0.3;
/// Bands into which they are cut, by equal ratios, and lines that each must hold.
const BANDS: usize = 24;
const FEWEST: usize = 6;
/// Coherence with the command from which on a band counts, and bands that must count.
const COHERENT: f64 = 0.5;
const COUNTED: usize = 5;
/// Share of the power beside the shared motion below which bands count alike.
const EXACT: f64 = 1e-3;
/// Share by which the sensors' ratio turns, or differs from band to band, beyond which they see more than one motion.
const ONE: f64 = 0.02;
/// Least power of the commanded acceleration in a band over that in the strongest.
const STIRRED: f64 = 1e-3;

/// The accelerometer's scale from the response of both sensors to the command, which has none of their
/// noise (an instrument; Söderström and Stoica, System Identification, 1989, chapter 8); the weighted mean
/// over frequencies with its standard error. None where a recording lacks it or is too short, and where the sensors
/// see more than one motion.
pub(super) fn accelerometer_scale(
    recordings: &[RigRecording],
    command: Channel,
) -> Option<NamedValue> {
    let mut lines: Vec<Line> = Vec::new();
    for one in recordings {
        lines.extend(responses(one, command)?);
    }
    if lines.len() < COUNTED {
        return None;
    }
    // Sensors and their filters differ in delay.
    let sum = |own: &dyn Fn(&Line) -> f64| lines.iter().map(own).sum::<f64>();
    let delay = sum(&|l| l.weight * l.omega * l.ratio.arg()) / sum(&|l| l.weight * l.omega.powi(2));
    let turned = |l: &Line| l.ratio * Complex::new(0.0, -l.omega * delay).exp();
    let aligned = |l: &Line| turned(l).re;
    let weight = sum(&|l| l.weight);
    let scale = sum(&|l| l.weight * aligned(l)) / weight;
    let variance = sum(&|l| l.weight * (aligned(l) - scale).powi(2)) / weight;
    let count = weight * weight / sum(&|l| l.weight.powi(2));
    // Where both sensors see one motion, what differs from band to band and from record to record is no noise
    // that more bands would lessen: without a filter before its converter an accelerometer shows what happens
    // between samples as slow motion, late by a part of a sample. What it shows beside the motion, such as the
    // shocks of a loop that chatters, may be off as much in the part that follows the command.
    let late = sum(&|l| l.weight * turned(l).im.powi(2)) / weight;
    if variance.max(late).sqrt() > ONE * scale.abs() {
        return None;
    }
    let beside = sum(&|l| l.weight * l.beside.sqrt()) / weight;
    let noise = variance / (count - 1.0).max(1.0);
    Some(NamedValue {
        name: "accelerometer_scale".into(),
        value: scale,
        unit: "1".into(),
        standard_error: (noise + variance + late + beside * beside).sqrt(),
    })
}

/// What both sensors show in a band.
struct Line {
    /// Angular frequency, rad/s.
    omega: f64,
    /// Acceleration over the displacement's second derivative.
    ratio: Complex<f64>,
    weight: f64,
    /// Share of the acceleration's power that does not belong to that derivative.
    beside: f64,
}

/// Acceleration over the displacement's second derivative by angular frequency, with a weight. Every line of
/// a band is differentiated at its own frequency, so that the response of the rig may turn inside it.
fn responses(one: &RigRecording, command: Channel) -> Option<Vec<Line>> {
    let channels = [
        one.input(command),
        one.output(),
        one.input(Channel::Acceleration),
    ];
    let length = one.len();
    if length < 2 || channels.iter().any(|own| own.len() != length) {
        return None;
    }
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let spectra = channels.map(|values| {
        let mean = values.iter().sum::<f64>() / length as f64;
        let tapered = values.iter().enumerate().map(|(k, value)| {
            let taper = 0.5 - 0.5 * (TAU * k as f64 / length as f64).cos();
            (value - mean) * taper
        });
        let mut tapered: Vec<f64> = tapered.collect();
        let mut out = plan.make_output_vec();
        plan.process(&mut tapered, &mut out).map(|()| out)
    });
    let [Ok(c), Ok(x), Ok(a)] = spectra else {
        return None;
    };
    let rate = 1.0 / one.period();
    let highest = BAND.1.min(HIGHEST * rate);
    let edge = |band: usize| BAND.0 * (highest / BAND.0).powf(band as f64 / BANDS as f64);
    let line = |frequency: f64| (frequency * length as f64 / rate).ceil() as usize;
    let within = |band: usize| line(edge(band))..line(edge(band + 1)).min(c.len());
    // Where the command moves nothing, what leaks from elsewhere is coherent and has another frequency.
    let stirred = |band: usize| {
        let lines = within(band);
        let count = lines.len().max(1) as f64;
        let power = lines.map(|k| c[k].norm_sqr() * (k as f64).powi(4));
        power.sum::<f64>() / count
    };
    let most = (0..BANDS).map(stirred).fold(0.0, f64::max);
    let bands = (0..BANDS).filter_map(|band| {
        let lines = within(band);
        if lines.len() < FEWEST || stirred(band) < STIRRED * most {
            return None;
        }
        let mut powers = [0.0; 3];
        let mut with_command = [Complex::new(0.0, 0.0); 2];
        let mut with_each_other = Complex::new(0.0, 0.0);
        for k in lines {
            let omega = TAU * k as f64 * rate / length as f64;
            let both = [x[k] * -(omega * omega), a[k]];
            powers[0] += c[k].norm_sqr();
            for (i, own) in both.into_iter().enumerate() {
                powers[i + 1] += own.norm_sqr();
                with_command[i] += c[k].conj() * own;
            }
            with_each_other += both[0].conj() * both[1];
        }
        let coherence = |i: usize| {
            with_command[i].norm_sqr() / (powers[0] * powers[i + 1]).max(f64::MIN_POSITIVE)
        };
        let both = [coherence(0), coherence(1)];
        if !both.iter().all(|own| *own > COHERENT) {
            return None;
        }
        let shared = with_each_other.norm_sqr() / (powers[1] * powers[2]).max(f64::MIN_POSITIVE);
        let beside = (1.0 - shared).max(0.0);
        Some(Line {
            omega: TAU * (edge(band) * edge(band + 1)).sqrt(),
            ratio: with_command[1] / with_command[0],
            weight: both[0].min(both[1]) / (beside + EXACT).powi(2),
            beside,
        })
    });
    Some(bands.collect())
}

#[cfg(test)]
mod tests {
    use super::super::Equations;
    use super::super::closed_loop_actuator::ClosedLoopActuator;
    use super::*;
    use recordings::Recording;

    const COMMAND: Channel = Channel::Other {
        name: "command",
        unit: "m",
    };

    /// A sum of sines, known in closed form, with noise on both sensors; the accelerometer shows `scale` by frequency.
    fn recording(scale: impl Fn(f64) -> f64, noisy: f64) -> RigRecording {
        let (rate, n) = (200.0, 12_000);
        let sum = |k: usize, factor: &dyn Fn(f64) -> f64| -> f64 {
            (0..60)
                .map(|i| {
                    let (frequency, phase) = (0.4 + 0.13 * f64::from(i), 1.7 * f64::from(i));
                    let omega = TAU * frequency;
                    let size = 1e-3 / (1.0 + frequency);
                    size * factor(frequency) * (omega * k as f64 / rate + phase).sin()
                })
                .sum()
        };
        let noise = |k: usize, seed: f64| ((k as f64 * seed).sin() * 43_758.545_3).fract();
        let all = |value: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(value).collect() };
        let second = |frequency: f64| -(TAU * frequency).powi(2) * scale(frequency);
        let channels = vec![
            (COMMAND, all(&|k| sum(k, &|_| 1.0))),
            (
                Channel::Displacement,
                all(&|k| sum(k, &|_| 1.0) + 2e-6 * noise(k, 91.7)),
            ),
            (
                Channel::Acceleration,
                all(&|k| sum(k, &second) + noisy * noise(k, 57.3)),
            ),
        ];
        let recording = Recording::new("two", 1.0 / rate, channels).unwrap();
        RigRecording::new(recording, &[COMMAND], Channel::Displacement)
    }

    #[test]
    fn an_accelerometer_that_reads_too_much_is_told_from_its_displacement() {
        let found = accelerometer_scale(&[recording(|_| 1.08, 0.01)], COMMAND).unwrap();
        assert!((found.value - 1.08).abs() < 4e-3, "{found:?}");
        assert!(found.standard_error < 15e-3, "{found:?}");
    }

    #[test]
    fn a_scale_is_a_cause_if_it_is_clear_and_otherwise_a_suspicion() {
        let said = |scale: f64| {
            let all = [recording(|_| scale, 0.05)];
            let causes = Equations::contradictions(&ClosedLoopActuator, &all);
            let causes = causes.iter().map(|own| (own.found.value, own.is_clear()));
            causes.collect::<Vec<_>>()
        };
        assert!(matches!(said(0.92)[..], [(value, true)] if (value - 0.92).abs() < 4e-3));
        assert!(matches!(said(0.97)[..], [(value, false)] if (value - 0.97).abs() < 4e-3));
        assert_eq!(said(0.99), []);
    }

    #[test]
    fn a_noisy_record_hides_nothing_that_a_clean_one_tells() {
        let all = [0.01, 0.7, 0.7].map(|noisy| recording(|_| 1.08, noisy));
        let found = accelerometer_scale(&all, COMMAND).unwrap();
        assert!((found.value - 1.08).abs() < 2e-3, "{found:?}");
        assert!(found.standard_error < 2e-2, "{found:?}");
    }

    #[test]
    fn of_an_accelerometer_that_shows_another_motion_besides_nothing_is_said() {
        let other = |frequency: f64| 0.9 + 0.02 * (frequency - 4.0);
        assert!(accelerometer_scale(&[recording(other, 0.01)], COMMAND).is_none());
    }
}
