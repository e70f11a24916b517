//! Noise of any spectrum, made in the frequency domain, and what a recorder does to a signal.

use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use serde::{Deserialize, Serialize};

use crate::dice::Dice;

/// A part of a power spectral density.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// The same at all frequencies.
    White,
    /// `1/f^exponent`, down to the length of the record.
    OneOverF {
        /// 1 for flicker noise, 2 for a random walk.
        exponent: f64,
    },
    /// A lightly damped resonance.
    Resonance {
        /// Natural frequency, Hz.
        frequency: f64,
        /// Damping ratio.
        damping: f64,
    },
    /// Even between two frequencies (Hz) and nothing beyond.
    Band {
        /// Lower edge, Hz.
        low: f64,
        /// Upper edge, Hz.
        high: f64,
    },
}

impl Shape {
    fn density(self, f: f64) -> f64 {
        match self {
            Self::White => 1.0,
            Self::OneOverF { exponent } => f.powf(-exponent),
            Self::Resonance { frequency, damping } => {
                let ratio = f / frequency;
                let damped = (2.0 * damping * ratio).powi(2);
                damped / ((1.0 - ratio * ratio).powi(2) + damped)
            }
            Self::Band { low, high } => f64::from(u8::from((low..high).contains(&f))),
        }
    }
}

/// A power spectral density: parts with their shares of the power.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Spectrum(pub Vec<(f64, Shape)>);

impl Spectrum {
    /// White.
    pub fn white() -> Self {
        Self(vec![(1.0, Shape::White)])
    }

    /// `n` samples at `rate` (Hz) of zero mean and of the standard deviation `rms` on average over seeds.
    pub fn draw(&self, n: usize, rate: f64, rms: f64, dice: &mut Dice) -> Vec<f64> {
        // Half of a period twice as long, so that the ends do not meet.
        let length = 2 * n;
        let lowest = rate / n as f64;
        let frequencies: Vec<f64> = (1..n).map(|k| k as f64 * rate / length as f64).collect();
        let mut density = vec![0.0; n - 1];
        for (share, shape) in &self.0 {
            let part: Vec<f64> = frequencies
                .iter()
                .map(|f| if *f < lowest { 0.0 } else { shape.density(*f) })
                .collect();
            let power: f64 = part.iter().sum();
            for (sum, value) in density.iter_mut().zip(&part) {
                *sum += share * value / power;
            }
        }
        let mut bins = vec![Complex::new(0.0, 0.0); n + 1];
        for (bin, power) in bins[1..n].iter_mut().zip(&density) {
            let size = rms * (power / 4.0).sqrt();
            *bin = Complex::new(size * dice.gauss(), size * dice.gauss());
        }
        let mut signal = inverse(bins, length);
        signal.truncate(n);
        let mean = signal.iter().sum::<f64>() / n as f64;
        signal.iter_mut().for_each(|value| *value -= mean);
        signal
    }
}

/// The signal of `length` samples whose one-sided Fourier sums are `bins`, without a factor.
pub(crate) fn inverse(mut bins: Vec<Complex<f64>>, length: usize) -> Vec<f64> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_inverse(length);
    let mut signal = vec![0.0; length];
    bins[0].im = 0.0;
    if let Some(last) = bins.last_mut() {
        last.im = 0.0;
    }
    plan.process(&mut bins, &mut signal)
        .expect("buffers of the plan's lengths");
    signal
}

/// The one-sided Fourier sums of a signal.
pub(crate) fn forward(signal: &[f64]) -> Vec<Complex<f64>> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(signal.len());
    let mut bins = plan.make_output_vec();
    plan.process(&mut signal.to_vec(), &mut bins)
        .expect("buffers of the plan's lengths");
    bins
}

/// What is added to a channel, and how it is recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Standard deviation of the noise.
    pub rms: f64,
    /// Its spectrum.
    pub spectrum: Spectrum,
    /// Amplitude of the mains' lines, in `rms`: fundamental and two harmonics.
    pub lines: [f64; 3],
    /// Bursts a minute in which the noise is five times as loud.
    pub bursts: f64,
    /// Drift of the zero over a record, in `rms`.
    pub drift: f64,
    /// Range to either side; readings are clipped there.
    pub range: f64,
    /// Bits of the converter; 0 is none.
    pub bits: u32,
}

impl Channel {
    /// White noise and no converter.
    pub fn plain(rms: f64) -> Self {
        Self {
            rms,
            spectrum: Spectrum::white(),
            lines: [0.0; 3],
            bursts: 0.0,
            drift: 0.0,
            range: f64::MAX,
            bits: 0,
        }
    }

    /// The noise of a record, `mains` in Hz.
    pub fn noise(&self, n: usize, rate: f64, mains: f64, dice: &mut Dice) -> Vec<f64> {
        let mut noise = self.spectrum.draw(n, rate, self.rms, dice);
        let seconds = n as f64 / rate;
        let count = (self.bursts * seconds / 60.0 + dice.even(0.0, 1.0)).floor() as usize;
        for _ in 0..count {
            let begin = (dice.even(0.0, seconds) * rate) as usize;
            let length = (dice.between(0.03, 0.3) * rate) as usize;
            let end = (begin + length).min(n);
            noise[begin.min(n)..end]
                .iter_mut()
                .for_each(|value| *value *= 5.0);
        }
        // The mains is never at its nominal frequency.
        let frequency = mains + 0.05 * dice.gauss();
        for (harmonic, amplitude) in self.lines.iter().enumerate() {
            let f = frequency * (harmonic + 1) as f64;
            let phase = dice.even(0.0, TAU);
            if *amplitude > 0.0 && f < 0.49 * rate {
                for (k, value) in noise.iter_mut().enumerate() {
                    *value += self.rms * amplitude * (TAU * f * k as f64 / rate + phase).sin();
                }
            }
        }
        let (rise, bow) = (dice.even(-1.0, 1.0), dice.even(-0.5, 0.5));
        for (k, value) in noise.iter_mut().enumerate() {
            let t = 2.0 * k as f64 / n as f64 - 1.0;
            *value += self.drift * self.rms * (rise * t + bow * (1.0 - 1.5 * t * t)) / 2.0;
        }
        noise
    }

    /// Standard deviation of noise and converter together.
    pub fn level(&self) -> f64 {
        self.rms.hypot(self.step() / 12f64.sqrt())
    }

    fn step(&self) -> f64 {
        if self.bits == 0 {
            return 0.0;
        }
        2.0 * self.range / 2f64.powi(self.bits as i32)
    }

    /// What the converter makes of a value.
    pub fn convert(&self, value: f64) -> f64 {
        let value = value.clamp(-self.range, self.range);
        let step = self.step();
        if step > 0.0 {
            (value / step).round() * step
        } else {
            value
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_holds_its_share_of_the_power_at_its_frequency() {
        let spectrum = Spectrum(vec![
            (
                0.6,
                Shape::Resonance {
                    frequency: 17.0,
                    damping: 0.02,
                },
            ),
            (0.4, Shape::OneOverF { exponent: 1.0 }),
        ]);
        let (n, rate) = (1 << 16, 500.0);
        let signal = spectrum.draw(n, rate, 4e-3, &mut Dice::new(1, 0));
        let power: Vec<f64> = forward(&signal).iter().map(|bin| bin.norm_sqr()).collect();
        let within = |low: f64, high: f64| -> f64 {
            let at = |f: f64| (f * n as f64 / rate) as usize;
            power[at(low)..at(high)].iter().sum::<f64>() / power.iter().sum::<f64>()
        };
        assert!((within(14.0, 20.0) - 0.55).abs() < 0.1);
        assert!((within(0.0, 1.0) - 0.4 * 0.5).abs() < 0.1);
        let rms = (signal.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        assert!((rms / 4e-3 - 1.0).abs() < 0.15, "{rms}");
    }

    #[test]
    fn a_converter_has_as_many_steps_as_bits_allow() {
        let channel = Channel {
            range: 10.0,
            bits: 10,
            ..Channel::plain(0.0)
        };
        assert_eq!(channel.convert(0.0146), 0.019_531_25);
        assert_eq!(channel.convert(12.0), 10.0);
    }
}
