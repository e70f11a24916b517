//! One measuring channel: sensor, cable and converter.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::delay_line::{DelayLine, require_delay};

/// What a channel does to a signal, in this order: lag, delay, scale and offset, mains and noise,
/// range, resolution. Zero switches each of them off.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Channel {
    /// Corner of the sensor's first-order lag, Hz.
    pub corner: f64,
    /// Delay, s.
    pub delay: f64,
    /// Relative error of the scale.
    pub scale_error: f64,
    /// Offset, in the channel's unit.
    pub bias: f64,
    /// Amplitude of the mains, in the channel's unit.
    pub hum_amplitude: f64,
    /// Frequency of the mains, Hz.
    pub hum_frequency: f64,
    /// Phase of the mains at time zero, rad.
    pub hum_phase: f64,
    /// White noise, one standard deviation, in the channel's unit.
    pub noise: f64,
    /// Largest magnitude that is read, in the channel's unit.
    pub range: f64,
    /// Step of the converter, in the channel's unit.
    pub resolution: f64,
}

impl Default for Channel {
    fn default() -> Self {
        Self {
            corner: 0.0,
            delay: 0.0,
            scale_error: 0.0,
            bias: 0.0,
            hum_amplitude: 0.0,
            hum_frequency: 60.0,
            hum_phase: 0.0,
            noise: 0.0,
            range: 0.0,
            resolution: 0.0,
        }
    }
}

/// What a channel remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ChannelState {
    past: DelayLine,
    started: bool,
    input: f64,
    lagged: f64,
}

/// A draw of noise, known from seed, channel and sample alone: it needs no memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    /// Seed of the run.
    pub seed: u64,
    /// Number of the channel.
    pub channel: u64,
    /// Number of the sample.
    pub sample: u64,
}

impl Noise {
    /// A value of the standard normal distribution: Box and Muller's method on two outputs of
    /// SplitMix64 (Steele, Lea and Flood 2014).
    pub fn gaussian(&self) -> f64 {
        let counter = self.sample.wrapping_mul(2);
        let (radius, angle) = (self.drawn(counter), self.drawn(counter.wrapping_add(1)));
        (-2.0 * radius.ln()).sqrt() * (TAU * angle).cos()
    }

    /// A value between 0 and 1, all equally likely.
    pub fn uniform(&self) -> f64 {
        self.drawn(self.sample.wrapping_mul(2))
    }

    fn drawn(&self, counter: u64) -> f64 {
        let key = mix(mix(self.seed) ^ mix(self.channel.wrapping_add(0x5EED)));
        let bits = mix(key.wrapping_add(counter.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
}

fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl ChannelState {
    /// Takes `value` and gives the one of `samples` ago, linearly between samples.
    pub fn delayed(&mut self, value: f64, samples: f64) -> f64 {
        if !self.started {
            self.past = DelayLine::filled(value);
            self.started = true;
        }
        self.past.push(value);
        self.past.behind(samples)
    }

    /// Takes `value` and gives it behind a lag of corner frequency `corner` (Hz), exact for inputs
    /// that run straight between samples.
    fn lag(&mut self, value: f64, corner: f64, period: f64) -> f64 {
        if !self.started {
            (self.input, self.lagged) = (value, value);
        }
        let decay = TAU * corner * period;
        let kept = (-decay).exp();
        let slope = (value - self.input) / decay;
        self.lagged = value - slope + kept * (self.lagged - self.input + slope);
        self.input = value;
        self.lagged
    }
}

impl Channel {
    /// Checks the values.
    ///
    /// # Errors
    /// Names the first without meaning.
    pub fn validate(&self) -> Result<(), ModelError> {
        for (name, value) in [
            ("corner", self.corner),
            ("delay", self.delay),
            ("hum_frequency", self.hum_frequency),
            ("noise", self.noise),
            ("range", self.range),
            ("resolution", self.resolution),
        ] {
            ModelError::require_non_negative(name, value)?;
        }
        ModelError::require_finite("scale_error", self.scale_error)?;
        ModelError::require_finite("bias", self.bias)?;
        ModelError::require_finite("hum_amplitude", self.hum_amplitude)?;
        ModelError::require_finite("hum_phase", self.hum_phase)
    }

    /// Checks the delay, with a `common` one (s), at the sampling `period` (s).
    ///
    /// # Errors
    /// A delay that is longer than the memory.
    pub fn validate_delay(&self, common: f64, period: f64) -> Result<(), ModelError> {
        require_delay("delay", self.delay + common, period)
    }

    /// `(1 + scale_error) y + bias`.
    #[inline]
    pub fn scaled(&self, y: f64) -> f64 {
        (1.0 + self.scale_error) * y + self.bias
    }

    /// What the mains add at `time` (s).
    #[inline]
    pub fn hum(&self, time: f64) -> f64 {
        if self.hum_amplitude == 0.0 {
            return 0.0;
        }
        self.hum_amplitude * (TAU * self.hum_frequency * time + self.hum_phase).sin()
    }

    /// The reading of `value`, with `delay` (s) besides the channel's own.
    pub fn sample(
        &self,
        state: &mut ChannelState,
        value: f64,
        delay: f64,
        period: f64,
        time: f64,
        noise: &Noise,
    ) -> f64 {
        let mut y = value;
        if self.corner > 0.0 {
            y = state.lag(y, self.corner, period);
        }
        y = state.delayed(y, (self.delay + delay) / period);
        y = self.scaled(y) + self.hum(time);
        if self.noise > 0.0 {
            y += self.noise * noise.gaussian();
        }
        if self.range > 0.0 {
            y = y.clamp(-self.range, self.range);
        }
        if self.resolution > 0.0 {
            y = (y / self.resolution).round() * self.resolution;
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 0.002;

    fn noise(sample: u64) -> Noise {
        Noise {
            seed: 7,
            channel: 2,
            sample,
        }
    }

    fn run(channel: &Channel, signal: impl Fn(f64) -> f64, samples: u64) -> Vec<f64> {
        let mut state = ChannelState::default();
        (0..samples)
            .map(|k| {
                let t = H * k as f64;
                channel.sample(&mut state, signal(t), 0.0, H, t, &noise(k))
            })
            .collect()
    }

    #[test]
    fn a_lag_behind_a_ramp_is_its_closed_form() {
        let channel = Channel {
            corner: 10.0,
            ..Channel::default()
        };
        let tau = 1.0 / (TAU * 10.0);
        for (k, y) in run(&channel, |t| 3.0 * t, 200).into_iter().enumerate() {
            let t = H * k as f64;
            let expected = 3.0 * (t - tau * (1.0 - (-t / tau).exp()));
            assert!((y - expected).abs() < 1e-13, "{k}: {y} {expected}");
        }
    }

    #[test]
    fn a_delay_between_samples_is_interpolated() {
        let channel = Channel {
            delay: 2.5 * H,
            ..Channel::default()
        };
        for (k, y) in run(&channel, |t| t, 100).into_iter().enumerate().skip(4) {
            assert!((y - (k as f64 - 2.5) * H).abs() < 1e-14);
        }
        let long = Channel {
            delay: 0.1,
            ..Channel::default()
        };
        assert!(long.validate_delay(0.0, H).is_err());
    }

    #[test]
    fn range_and_resolution_bound_the_reading() {
        let channel = Channel {
            range: 1.0,
            resolution: 0.25,
            scale_error: 0.5,
            bias: -0.1,
            ..Channel::default()
        };
        for (value, reading) in [(0.0, 0.0), (0.4, 0.5), (2.0, 1.0), (-3.0, -1.0)] {
            assert_eq!(run(&channel, |_| value, 1), [reading], "{value}");
        }
    }

    #[test]
    fn noise_is_white_gaussian_and_repeatable() {
        let n = 200_000;
        let draws: Vec<f64> = (0..n).map(|k| noise(k).gaussian()).collect();
        let mean = |f: &dyn Fn(usize) -> f64| (0..n as usize - 1).map(f).sum::<f64>() / n as f64;
        assert!(mean(&|i| draws[i]).abs() < 0.01);
        assert!((mean(&|i| draws[i].powi(2)) - 1.0).abs() < 0.02);
        assert!((mean(&|i| draws[i].powi(4)) - 3.0).abs() < 0.15);
        assert!(mean(&|i| draws[i] * draws[i + 1]).abs() < 0.01);
        assert_eq!(draws[17], noise(17).gaussian());
        let other = Noise {
            channel: 3,
            ..noise(17)
        };
        assert!((draws[17] - other.gaussian()).abs() > 1e-6);
    }
}
