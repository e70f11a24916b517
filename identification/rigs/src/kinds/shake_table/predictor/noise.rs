//! What disturbs a rig and its sensors, as the predictor assumes it.
//!
//! Every source is a sum of independent parts: a white one, slow ones below a corner, resonances. Slow parts
//! with spread corners make 1/f, and a sharp resonance makes a line.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Complex;

/// A part of a coloured noise: `w(k+1) = lag₁ w(k) + lag₂ w(k-1) + drive e(k)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Standard deviation: V for the unseen voltage, SI for a sensor.
    pub sigma: f64,
    /// Weights of the last two samples; the second is zero below a corner.
    pub lag: [f64; 2],
}

impl Disturbance {
    /// What a servo valve adds to a command recorded with `command_noise` (V), as long as the
    /// records have not told: eight times that noise, with a corner at 30 Hz.
    pub fn beside_command(command_noise: f64, period: f64) -> Self {
        Self::below(8.0 * command_noise.max(1e-5), 30.0, period)
    }

    /// One of standard deviation `sigma` with a `corner` (Hz).
    pub fn below(sigma: f64, corner: f64, period: f64) -> Self {
        let pole = (-std::f64::consts::TAU * corner * period).exp();
        Self {
            sigma,
            lag: [pole, 0.0],
        }
    }

    /// One of standard deviation `sigma` about a `frequency` (Hz) with a `damping` ratio below 1.
    pub fn around(sigma: f64, frequency: f64, damping: f64, period: f64) -> Self {
        let turn = std::f64::consts::TAU * frequency * period;
        let radius = (-damping * turn).exp();
        let angle = turn * (1.0 - damping * damping).max(0.0).sqrt();
        Self {
            sigma,
            lag: [2.0 * radius * angle.cos(), -radius * radius],
        }
    }

    /// Samples of the past that the next one depends on.
    pub fn order(&self) -> usize {
        if self.lag[1] == 0.0 { 1 } else { 2 }
    }

    /// Frequency of a resonance, Hz; none below a corner.
    pub fn frequency(&self, period: f64) -> Option<f64> {
        self.resonance(period).map(|(frequency, _)| frequency)
    }

    /// Frequency of a resonance (Hz) and its damping ratio; none below a corner.
    pub fn resonance(&self, period: f64) -> Option<(f64, f64)> {
        let radius = (-self.lag[1]).sqrt();
        let resonates = self.order() == 2 && self.lag[0].abs() < 2.0 * radius;
        resonates.then(|| {
            let angle = (self.lag[0] / (2.0 * radius)).acos();
            let turn = angle.hypot(radius.ln());
            (turn / (std::f64::consts::TAU * period), -radius.ln() / turn)
        })
    }

    /// The corner below which it lies, Hz; that of the envelope for a resonance.
    pub fn corner(&self, period: f64) -> f64 {
        let radius = match self.order() {
            1 => self.lag[0],
            _ => (-self.lag[1]).sqrt(),
        };
        -radius.ln() / (std::f64::consts::TAU * period)
    }

    /// Share of its power above `lowest` (Hz), 0 to 1.
    pub fn share_above(&self, lowest: f64, period: f64) -> f64 {
        match self.frequency(period) {
            Some(frequency) => f64::from(u8::from(frequency > lowest)),
            None => 1.0 - (lowest / self.corner(period)).atan() / FRAC_PI_2,
        }
    }

    /// Standard deviation of what is new in a sample.
    pub fn drive(&self) -> f64 {
        let [first, second] = self.lag;
        let share = (1.0 + second) * ((1.0 - second).powi(2) - first * first) / (1.0 - second);
        self.sigma * share.max(0.0).sqrt()
    }

    /// Spectral density at `cycles` per sample; its mean over one cycle is the variance.
    pub fn density(&self, cycles: f64) -> f64 {
        self.density_at(Self::back(cycles))
    }

    /// A sample back, at `cycles` per sample.
    pub fn back(cycles: f64) -> Complex<f64> {
        Complex::from_polar(1.0, -std::f64::consts::TAU * cycles)
    }

    /// [`Self::density`] where a sample back is this turn.
    #[inline]
    pub fn density_at(&self, back: Complex<f64>) -> f64 {
        let polynomial = Complex::from(1.0) - back * self.lag[0] - back * back * self.lag[1];
        self.drive().powi(2) / polynomial.norm_sqr().max(f64::MIN_POSITIVE)
    }

    /// The sample after `past` (the last one first) without what is new in it; `past` moves on.
    #[inline]
    pub fn expect(&self, past: &mut [f64; 2]) -> f64 {
        let next = self.lag[0] * past[0] + self.lag[1] * past[1];
        *past = [next, past[0]];
        next
    }
}

/// Noises of a rig with four channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// White part of every channel's, one standard deviation, SI; infinite where it is missing.
    pub white: [f64; 4],
    /// Coloured parts of every channel's.
    pub coloured: [Vec<Disturbance>; 4],
    /// Parts of the unseen voltage beside the command.
    pub unseen: Vec<Disturbance>,
}

impl Noise {
    /// White sensors of `white` (SI, infinite for a channel that is missing) and `unseen` beside the
    /// command.
    pub fn new(white: [f64; 4], unseen: Disturbance) -> Self {
        Self {
            white,
            coloured: Default::default(),
            unseen: vec![unseen],
        }
    }

    /// Standard deviation of a channel's noise without its drift, which is slower than `lowest` (Hz), SI.
    pub fn above(&self, channel: usize, lowest: f64, period: f64) -> f64 {
        let parts = self.coloured[channel].iter();
        let squares = parts.map(|part| part.sigma.powi(2) * part.share_above(lowest, period));
        (self.white[channel].powi(2) + squares.sum::<f64>()).sqrt()
    }

    /// Standard deviation of a channel's noise, SI.
    pub fn of_channel(&self, channel: usize) -> f64 {
        self.white[channel].hypot(total(&self.coloured[channel]))
    }
}

/// Standard deviation of independent parts together.
pub fn total(parts: &[Disturbance]) -> f64 {
    let square: f64 = parts.iter().map(|part| part.sigma * part.sigma).sum();
    square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn a_part_has_its_deviation_and_its_density() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for part in [
            Disturbance::below(2.0, 4.0, 2e-3),
            Disturbance::around(2.0, 17.0, 0.05, 2e-3),
        ] {
            let mut past = [0.0; 2];
            let values: Vec<f64> = (0..400_000)
                .map(|_| {
                    let new: f64 = StandardNormal.sample(&mut random);
                    past[0] = part.expect(&mut past) + part.drive() * new;
                    past[0]
                })
                .collect();
            let mean_square = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
            assert!(
                (mean_square.sqrt() / 2.0 - 1.0).abs() < 0.03,
                "{mean_square}"
            );
            // A quarter of a turn at the corner; nearly all of a resonance above half its frequency.
            let above = part.share_above(part.frequency(2e-3).map_or(4.0, |f| 0.5 * f), 2e-3);
            let expected = if part.order() == 1 { 0.5 } else { 1.0 };
            assert!((above - expected).abs() < 1e-9, "{above}");
            let steps = 20_000;
            let mean: f64 = (0..steps)
                .map(|k| part.density((f64::from(k) + 0.5) / f64::from(steps)))
                .sum::<f64>()
                / f64::from(steps);
            assert!((mean / 4.0 - 1.0).abs() < 1e-3, "{mean}");
        }
        let resonance = Disturbance::around(1.0, 17.0, 0.05, 2e-3);
        let (frequency, damping) = resonance.resonance(2e-3).unwrap();
        assert!((frequency - 17.0).abs() < 1e-9 && (damping - 0.05).abs() < 1e-9);
        assert_eq!(Disturbance::below(1.0, 4.0, 2e-3).frequency(2e-3), None);
    }
}
