//! Averaged spectra over windows that overlap by half (Welch, IEEE Transactions on Audio and
//! Electroacoustics 15, 1967).

use std::f64::consts::TAU;

use nalgebra::Complex;
use realfft::RealFftPlanner;

use recordings::IdentificationError;

/// Fewest samples of a segment.
const SHORTEST: usize = 16;

/// Spectra of several channels, segment by segment: Hann windows, the mean of each segment taken away.
#[derive(Debug, Clone)]
pub struct Spectra {
    /// Frequencies, Hz: `0` to half the sampling rate.
    pub frequency: Vec<f64>,
    /// `lines[segment][channel][line]`.
    lines: Vec<Vec<Vec<Complex<f64>>>>,
}

impl Spectra {
    /// Of channels with a sample every `period` s, in segments of `segment` samples; what one of them
    /// has more than the shortest is left away.
    ///
    /// # Errors
    /// Too short for two segments that overlap, or segments of fewer than 16 samples.
    pub fn new(
        channels: &[&[f64]],
        period: f64,
        segment: usize,
    ) -> Result<Self, IdentificationError> {
        let samples = channels.iter().map(|c| c.len()).min().unwrap_or(0);
        let needed = segment + segment / 2;
        if segment < SHORTEST || samples < needed {
            return Err(too_short(samples, segment, needed, period));
        }
        let window: Vec<f64> = (0..segment)
            .map(|k| 0.5 - 0.5 * (TAU * k as f64 / segment as f64).cos())
            .collect();
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(segment);
        let spectrum = |channel: &[f64]| {
            let mean = channel.iter().sum::<f64>() / segment as f64;
            let windowed = channel.iter().zip(&window).map(|(x, w)| (x - mean) * w);
            let mut input: Vec<f64> = windowed.collect();
            let mut output = transform.make_output_vec();
            let done = transform.process(&mut input, &mut output);
            done.map_err(|error| IdentificationError::NotConverged {
                method: "the Fourier transform",
                reason: error.to_string(),
            })?;
            Ok(output)
        };
        let starts = (0..=samples - segment).step_by(segment / 2);
        let lines: Result<_, IdentificationError> = starts
            .map(|start| {
                let pieces = channels.iter().map(|own| &own[start..start + segment]);
                pieces.map(spectrum).collect()
            })
            .collect();
        Ok(Self {
            frequency: (0..=segment / 2)
                .map(|k| k as f64 / (segment as f64 * period))
                .collect(),
            lines: lines?,
        })
    }

    /// As [`Spectra::new`], of two whole segments at least.
    ///
    /// # Errors
    /// Fewer samples than that.
    pub(crate) fn of_two(
        channels: &[&[f64]],
        period: f64,
        segment: usize,
    ) -> Result<Self, IdentificationError> {
        let samples = channels.iter().map(|c| c.len()).min().unwrap_or(0);
        if samples < 2 * segment {
            return Err(too_short(samples, segment, 2 * segment, period));
        }
        Self::new(channels, period, segment)
    }

    /// Segments averaged.
    #[must_use]
    pub fn segments(&self) -> usize {
        self.lines.len()
    }

    /// Power of a channel at a line, summed over the segments.
    #[must_use]
    pub fn power(&self, channel: usize, line: usize) -> f64 {
        self.lines
            .iter()
            .map(|own| own[channel][line].norm_sqr())
            .sum()
    }

    /// Channel `a` times the conjugate of channel `b` at a line, summed over the segments.
    #[must_use]
    pub fn cross(&self, a: usize, b: usize, line: usize) -> Complex<f64> {
        let products = self
            .lines
            .iter()
            .map(|own| own[a][line] * own[b][line].conj());
        products.sum()
    }

    /// Transfer function from channel `input` to channel `output` at a line; 0 where there is no input.
    #[must_use]
    pub fn gain(&self, input: usize, output: usize, line: usize) -> Complex<f64> {
        self.cross(output, input, line) / self.power(input, line).max(f64::MIN_POSITIVE)
    }

    /// Coherence of two channels at a line, 0 to 1.
    #[must_use]
    pub fn coherence(&self, a: usize, b: usize, line: usize) -> f64 {
        let product = self.power(a, line) * self.power(b, line);
        if product > 0.0 {
            (self.cross(a, b, line).norm_sqr() / product).min(1.0)
        } else {
            0.0
        }
    }
}

fn too_short(samples: usize, segment: usize, needed: usize, period: f64) -> IdentificationError {
    let needed = needed.max(2 * SHORTEST);
    IdentificationError::TooShort {
        recording: "frequency response".into(),
        samples,
        parameters: segment,
        needed,
        seconds: needed as f64 * period,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine on a line of the transform, in closed form: the Hann window's mean is a half.
    #[test]
    fn a_sine_has_its_power_gain_and_coherence() {
        let (period, segment) = (0.01, 200);
        let sine = |t: usize, amplitude: f64, phase: f64| {
            2.0 + amplitude * (TAU * 5.0 * t as f64 * period + phase).sin()
        };
        let input: Vec<f64> = (0..1000).map(|t| sine(t, 3.0, 0.0)).collect();
        let output: Vec<f64> = (0..1000).map(|t| sine(t, 6.0, -0.4)).collect();
        let spectra = Spectra::new(&[&input, &output], period, segment).unwrap();
        let line = 10;
        assert!((spectra.frequency[line] - 5.0).abs() < 1e-12);
        assert_eq!(spectra.segments(), 9);
        let each = (3.0 * 200.0 / 4.0_f64).powi(2);
        assert!((spectra.power(0, line) / (9.0 * each) - 1.0).abs() < 1e-9);
        let gain = spectra.gain(0, 1, line);
        assert!((gain.norm() - 2.0).abs() < 1e-9 && (gain.arg() + 0.4).abs() < 1e-9);
        assert!((spectra.coherence(0, 1, line) - 1.0).abs() < 1e-12);
        // The mean is taken away.
        assert!(spectra.power(0, 0) < 1e-20 * each);
        assert!(Spectra::new(&[&input[..299]], period, segment).is_err());
        assert!(Spectra::new(&[&input[..300]], period, segment).is_ok());
        assert!(Spectra::of_two(&[&input[..399]], period, segment).is_err());
    }
}
