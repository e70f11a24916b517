//! Frequency responses from data, by averaged [spectra](super::spectra), with coherence.
//!
//! Under feedback the direct estimate `S_yu / S_uu` is biased towards the inverse of the
//! controller where noise dominates. With the reference recorded, the joint input-output estimate
//! `S_yr / S_ur` is not (Ljung 1999, Section 13.5): the reference is independent of the noise.

use nalgebra::Complex;

use super::spectra::Spectra;
use recordings::IdentificationError;

/// A frequency response with its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyResponseEstimate {
    /// Frequencies, Hz.
    pub frequency: Vec<f64>,
    /// Response, output unit over input unit.
    pub response: Vec<Complex<f64>>,
    /// Part of the output's power that is linear in the excitation, 0 to 1.
    pub coherence: Vec<f64>,
    /// Standard error of the response's magnitude, relative.
    pub relative_error: Vec<f64>,
    /// Segments averaged.
    pub segments: usize,
}

/// Response from `input` to `output` in open loop, segments of `segment` samples.
///
/// # Errors
/// Fewer than two segments of data.
pub fn direct(
    input: &[f64],
    output: &[f64],
    period: f64,
    segment: usize,
) -> Result<FrequencyResponseEstimate, IdentificationError> {
    joint_input_output(input, input, output, period, segment)
}

/// Response from `input` to `output` with both caused by `reference` (joint input-output method).
/// Coherence is the smaller of those from the reference to the two.
///
/// # Errors
/// Fewer than two segments of data.
pub fn joint_input_output(
    reference: &[f64],
    input: &[f64],
    output: &[f64],
    period: f64,
    segment: usize,
) -> Result<FrequencyResponseEstimate, IdentificationError> {
    let spectra = Spectra::of_two(&[reference, input, output], period, segment)?;
    let mut estimate = FrequencyResponseEstimate {
        frequency: Vec::new(),
        response: Vec::new(),
        coherence: Vec::new(),
        relative_error: Vec::new(),
        segments: spectra.segments(),
    };
    // Half-overlapping Hann windows are worth about 0.53 segments more each (Welch).
    let independent = 1.0 + 0.53 * (spectra.segments() as f64 - 1.0);
    for line in 1..spectra.frequency.len() {
        let response = spectra.cross(2, 0, line) / spectra.cross(1, 0, line);
        let quality = spectra
            .coherence(1, 0, line)
            .min(spectra.coherence(2, 0, line));
        estimate.frequency.push(spectra.frequency[line]);
        estimate.response.push(response);
        estimate.coherence.push(quality);
        estimate
            .relative_error
            .push(((1.0 - quality) / (2.0 * quality.max(1e-12) * independent)).sqrt());
    }
    Ok(estimate)
}

/// Frequencies between which the power of `signal` exceeds `part` of its largest line, Hz.
///
/// # Errors
/// Fewer than two segments of data.
pub fn excited_band(
    signal: &[f64],
    period: f64,
    segment: usize,
    part: f64,
) -> Result<(f64, f64, usize), IdentificationError> {
    let spectra = Spectra::of_two(&[signal], period, segment)?;
    let power: Vec<f64> = (0..spectra.frequency.len())
        .map(|line| spectra.power(0, line))
        .collect();
    let largest = power[1..].iter().copied().fold(0.0, f64::max);
    let lines: Vec<usize> = (1..power.len())
        .filter(|&line| power[line] > part * largest)
        .collect();
    match (lines.first(), lines.last()) {
        (Some(&first), Some(&last)) => Ok((
            spectra.frequency[first],
            spectra.frequency[last],
            lines.len(),
        )),
        _ => Ok((0.0, 0.0, 0)),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A first-order lag in a loop with noise at its output: `y = g u + n`, `u = k (r - y)`.
    fn loop_data() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let (mut r, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
        let (mut state, mut held) = (0.0, 0.0);
        for k in 0..60_000 {
            if k % 5 == 0 {
                held = random.random_range(-1.0..1.0);
            }
            let measured = state + random.random_range(-0.5..0.5);
            let command = 3.0 * (held - measured);
            r.push(held);
            u.push(command);
            y.push(measured);
            state = 0.9 * state + 0.1 * command;
        }
        (r, u, y)
    }

    #[test]
    fn a_band_is_from_the_first_to_the_last_line_with_power() {
        let (period, segment) = (0.002, 500);
        // Lines are 1 Hz apart; a third tone has a hundredth of the power.
        let tones = [(20.0, 1.0), (60.0, 0.5), (90.0, 0.1)];
        let signal: Vec<f64> = (0..5000)
            .map(|k| {
                let t = period * f64::from(k);
                let all = tones.iter();
                all.map(|(rate, size)| size * (TAU * rate * t).sin()).sum()
            })
            .collect();
        for (part, first, last) in [(0.1, 20.0, 60.0), (0.5, 20.0, 20.0), (1e-3, 20.0, 90.0)] {
            let (from, to, lines) = excited_band(&signal, period, segment, part).unwrap();
            // A window spreads a tone over its neighbours.
            assert!(
                (from - first).abs() < 2.5 && (to - last).abs() < 2.5,
                "{from} {to}"
            );
            let tones = tones
                .iter()
                .filter(|(rate, _)| (first..=last).contains(rate));
            assert!((1..=5).contains(&(lines / tones.count())), "{lines}");
        }
        assert_eq!(
            excited_band(&[0.0; 2000], period, segment, 0.1).unwrap(),
            (0.0, 0.0, 0)
        );
        assert!(excited_band(&signal[..400], period, segment, 0.1).is_err());
    }

    #[test]
    fn the_joint_estimate_is_unbiased_in_closed_loop_and_the_direct_one_is_not() {
        let (r, u, y) = loop_data();
        let truth = |f: f64| {
            let z = Complex::new(0.0, TAU * f * 0.002).exp();
            0.1 / (z - 0.9)
        };
        let joint = joint_input_output(&r, &u, &y, 0.002, 1000).unwrap();
        let direct = direct(&u, &y, 0.002, 1000).unwrap();
        let error = |estimate: &FrequencyResponseEstimate| {
            let lines = 10..80;
            let sum: f64 = lines
                .clone()
                .map(|i| (estimate.response[i] / truth(estimate.frequency[i]) - 1.0).norm_sqr())
                .sum();
            (sum / lines.len() as f64).sqrt()
        };
        assert!(error(&joint) < 0.15, "{}", error(&joint));
        assert!(error(&direct) > 2.0 * error(&joint), "{}", error(&direct));
        let inside = (10..80).filter(|&i| {
            let miss = (joint.response[i].norm() / truth(joint.frequency[i]).norm() - 1.0).abs();
            miss < 2.0 * joint.relative_error[i]
        });
        assert!(inside.count() > 60);
        assert!(joint.coherence[20] > joint.coherence[200]);
    }
}
