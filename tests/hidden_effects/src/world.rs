//! What disturbs a rig and its sensors beside the hidden effect.

use std::fmt;
use std::str::FromStr;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::rig::RATE;

/// Where a case is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum World {
    /// The unseen voltage of the practice records, white noise on the sensors, the usual forms of
    /// effects in four cases of five.
    #[default]
    Plain,
    /// Drawn in every case, outside what a diagnosis may have been made for: an unseen voltage of 1 to
    /// 30 mV below 2 to 60 Hz, coloured noise and quantisation on the sensors, other forms of effects and other laws of
    /// friction, yielding and droop.
    Open,
    /// As the plain one with three times the noise and 2 % mismatch.
    Noisy,
}

impl World {
    /// All of them with their names.
    const NAMES: [(&str, World); 3] = [
        ("plain", World::Plain),
        ("open", World::Open),
        ("noisy", World::Noisy),
    ];
}

impl fmt::Display for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = Self::NAMES.iter().find(|(_, world)| world == self);
        f.write_str(named.map_or("", |(name, _)| name))
    }
}

impl FromStr for World {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = Self::NAMES.iter().find(|(name, _)| *name == text);
        named.map(|(_, world)| *world).ok_or_else(|| {
            let names = Self::NAMES.map(|(name, _)| name);
            format!("`{text}` is unknown; expected {}", names.join(", "))
        })
    }
}

/// Standard deviations of displacement, acceleration, force, specimen acceleration, voltage.
pub const NOISE: [f64; 5] = [0.0005, 1.5, 0.3, 1.0, 0.0005];
/// Unseen voltage beside the command in standard deviations of the recorder's noise, and its
/// corner in Hz, as the practice records have them.
const DISTURBANCE: f64 = 8.0;
const DISTURBANCE_CORNER: f64 = 30.0;

/// Noises of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Noises {
    /// Standard deviations as the laboratory states them, as [`NOISE`].
    pub stated: [f64; 5],
    /// Standard deviation of the unseen voltage beside the command, V, and its corner, Hz.
    pub disturbance: (f64, f64),
    /// Corner of the slow part of each sensor's noise, Hz, and its share of the power.
    pub slow: (f64, f64),
    /// Step of each reading in stated standard deviations of its noise; zero is none.
    pub step: f64,
}

impl Noises {
    /// Those of a case in `world`, with `factor` on the sensors' noise.
    pub fn draw(world: World, factor: f64, seed: u64) -> Self {
        let stated = NOISE.map(|n| n * factor);
        if world != World::Open {
            return Self {
                stated,
                disturbance: (DISTURBANCE * stated[4], DISTURBANCE_CORNER),
                slow: (1.0, 0.0),
                step: 0.0,
            };
        }
        use rand::SeedableRng;
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0123_4567_89ab_cdef);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.random_range(0.0..1.0));
        Self {
            stated,
            disturbance: (between(1e-3, 30e-3), between(2.0, 60.0)),
            slow: (between(2.0, 60.0), between(0.1, 0.7)),
            step: between(0.1, 2.0),
        }
    }

    /// The noises at rest.
    pub fn start(&self) -> Noise<'_> {
        Noise {
            of: self,
            slow: [0.0; 5],
            disturbance: 0.0,
        }
    }

    /// None at all.
    pub fn none() -> Self {
        Self {
            stated: [0.0; 5],
            disturbance: (0.0, DISTURBANCE_CORNER),
            slow: (1.0, 0.0),
            step: 0.0,
        }
    }
}

/// Noises that run.
pub struct Noise<'a> {
    of: &'a Noises,
    slow: [f64; 5],
    disturbance: f64,
}

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn keep(corner: f64) -> f64 {
    (-std::f64::consts::TAU * corner / RATE).exp()
}

impl Noise<'_> {
    /// What reading `i` shows of `value`.
    pub fn reading(&mut self, i: usize, value: f64, rng: &mut ChaCha8Rng) -> f64 {
        let size = self.of.stated[i];
        let (corner, share) = self.of.slow;
        let mut noise = gauss(rng);
        if share > 0.0 {
            let keep = keep(corner);
            self.slow[i] = keep * self.slow[i] + (1.0 - keep * keep).sqrt() * gauss(rng);
            noise = (1.0 - share).sqrt() * noise + share.sqrt() * self.slow[i];
        }
        let shown = value + size * noise;
        let step = self.of.step * size;
        if step > 0.0 {
            (shown / step).round() * step
        } else {
            shown
        }
    }

    /// The unseen voltage of the next sample.
    pub fn disturbance(&mut self, rng: &mut ChaCha8Rng) -> f64 {
        let (size, corner) = self.of.disturbance;
        let keep = keep(corner);
        self.disturbance = keep * self.disturbance + size * (1.0 - keep * keep).sqrt() * gauss(rng);
        self.disturbance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_open_world_is_as_loud_as_it_says() {
        for seed in 0..5 {
            let noises = Noises::draw(World::Open, 1.0, seed);
            let (size, corner) = noises.disturbance;
            assert!((1e-3..30e-3).contains(&size) && (2.0..60.0).contains(&corner));
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut noise = noises.start();
            let n = 100_000;
            let (mut unseen, mut shown) = (0.0, 0.0);
            for _ in 0..n {
                unseen += noise.disturbance(&mut rng).powi(2);
                shown += noise.reading(1, 0.0, &mut rng).powi(2);
            }
            let unseen = (unseen / f64::from(n)).sqrt();
            assert!((unseen / size - 1.0).abs() < 0.1, "{unseen} {size}");
            // A step adds a twelfth of its square.
            let expected = NOISE[1] * (1.0 + noises.step.powi(2) / 12.0).sqrt();
            let shown = (shown / f64::from(n)).sqrt();
            assert!((shown / expected - 1.0).abs() < 0.1, "{shown} {expected}");
        }
    }
}
