//! Sensors of the benchmark and its converters.

use super::RATE;

/// White noise of the two sensors, one draw a sample, one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SensorNoise {
    /// Of the displacement, m.
    pub displacement: f64,
    /// Of the force, N.
    pub force: f64,
}

impl Default for SensorNoise {
    /// Powers 6.25e-14 m²/Hz and 1.16e-3 N²/Hz at the benchmark's rate.
    fn default() -> Self {
        Self {
            displacement: (6.25e-14 * RATE).sqrt(),
            force: (1.16e-3 * RATE).sqrt(),
        }
    }
}

/// A converter of the benchmark: it rounds to a quantum and limits, numbers being metres.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Converter {
    /// Step, m; zero for none.
    pub quantum: f64,
    /// Largest magnitude, m; zero for none.
    pub limit: f64,
}

impl Default for Converter {
    /// 2^-18 m and 3.8 m: one volt stands for one metre in the published program.
    fn default() -> Self {
        Self {
            quantum: 1.0 / 262_144.0,
            limit: 3.8,
        }
    }
}

impl Converter {
    /// From the world into the computer: limit, then quantise.
    #[inline]
    pub fn read(&self, value: f64) -> f64 {
        self.quantise(self.limited(value))
    }

    /// From the computer into the world: quantise, then limit.
    #[inline]
    pub fn write(&self, value: f64) -> f64 {
        self.limited(self.quantise(value))
    }

    #[inline]
    fn limited(&self, value: f64) -> f64 {
        // Not `clamp`: a command that is not a number must stay one that is seen.
        if self.limit > 0.0 && value.abs() > self.limit {
            return self.limit.copysign(value);
        }
        value
    }

    #[inline]
    fn quantise(&self, value: f64) -> f64 {
        if self.quantum > 0.0 {
            return (value / self.quantum).round_ties_even() * self.quantum;
        }
        value
    }
}

/// The sequence that both sensors of a fresh session of the published program draw: uniform
/// numbers of Park and Miller's generator (Communications of the ACM 31, 1988) made normal by
/// Marsaglia's polar method. It settles the peaks of the published table.
#[derive(Debug, Clone)]
pub struct PublishedNoise {
    state: u64,
}

impl Default for PublishedNoise {
    fn default() -> Self {
        Self {
            state: 1_144_108_930,
        }
    }
}

impl PublishedNoise {
    /// From another state of the generator.
    #[must_use]
    pub fn starting_at(state: u64) -> Self {
        Self { state }
    }

    fn symmetric(&mut self) -> f64 {
        self.state = 16_807 * self.state % 2_147_483_647;
        2.0 * self.state as f64 * 4.656_612_875_245_797e-10 - 1.0
    }
}

impl Iterator for PublishedNoise {
    type Item = f64;

    fn next(&mut self) -> Option<f64> {
        loop {
            let (a, b) = (self.symmetric(), self.symmetric());
            let s = a * a + b * b;
            if s <= 1.0 {
                return Some(a * (-2.0 * s.ln() / s).sqrt());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_sequence_starts_as_published() {
        let start = [
            1.164_953_51,
            0.626_839_08,
            0.075_080_15,
            0.351_606_9,
            -0.696_512_54,
        ];
        for (got, wanted) in PublishedNoise::default().zip(start) {
            assert!((got - wanted).abs() < 1e-8, "{got} {wanted}");
        }
    }

    #[test]
    fn noise_is_as_large_as_stated() {
        let noise = SensorNoise::default();
        assert!((noise.displacement - 1.6e-5).abs() < 1e-12);
        assert!((noise.force - 2.1798).abs() < 1e-4);
    }

    #[test]
    fn converters_round_and_limit() {
        let converter = Converter::default();
        assert_eq!(
            converter.read(5.0),
            3.8f64.mul_add(262_144.0, 0.0).round() / 262_144.0
        );
        assert_eq!(converter.write(-5.0), -3.8);
        assert_eq!(converter.read(1.9e-6), 0.0);
        assert_eq!(converter.read(2.0e-6), 1.0 / 262_144.0);
        assert!(converter.write(f64::NAN).is_nan());
    }
}
