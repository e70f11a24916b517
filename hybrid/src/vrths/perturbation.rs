//! Plants beside the nominal one.

use plant::sensors::channel::Noise;

use super::TransferSystemParameters;

/// Standard deviations of what is uncertain; everything else of the plant is known.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Deviation {
    /// Of `beta1`, 1/s.
    pub valve_beta1: f64,
    /// Of `beta2`, 1/s².
    pub valve_beta2: f64,
    /// Of `a3`, 1/s.
    pub actuator_a3: f64,
    /// Of `k_e`, N/m.
    pub specimen_stiffness: f64,
}

impl Default for Deviation {
    /// The benchmark's standard deviations.
    fn default() -> Self {
        Self {
            valve_beta1: 3.3,
            valve_beta2: 3.3e3,
            actuator_a3: 1.3,
            specimen_stiffness: 5.0e4,
        }
    }
}

/// Numbers the streams of draws apart from those of the sensors.
const STREAM: u64 = 0x00D1_57F0;

impl Deviation {
    /// `nominal` moved by so many standard deviations of `[beta1, beta2, a3, k_e]`.
    pub fn moved(
        &self,
        nominal: &TransferSystemParameters,
        by: [f64; 4],
    ) -> TransferSystemParameters {
        TransferSystemParameters {
            valve_beta1: nominal.valve_beta1 + by[0] * self.valve_beta1,
            valve_beta2: nominal.valve_beta2 + by[1] * self.valve_beta2,
            actuator_a3: nominal.actuator_a3 + by[2] * self.actuator_a3,
            specimen_stiffness: nominal.specimen_stiffness + by[3] * self.specimen_stiffness,
            ..*nominal
        }
    }

    /// The plant `number` of those that `seed` stands for: independent normal draws.
    pub fn draw(
        &self,
        nominal: &TransferSystemParameters,
        seed: u64,
        number: u64,
    ) -> TransferSystemParameters {
        self.moved(nominal, normal(seed, number))
    }
}

/// Four standard normal numbers.
fn normal(seed: u64, number: u64) -> [f64; 4] {
    std::array::from_fn(|i| {
        Noise {
            seed,
            channel: STREAM + i as u64,
            sample: number,
        }
        .gaussian()
    })
}

/// The sixteen corners of the box of ± `by` standard deviations, as factors for
/// [`Deviation::moved`].
pub fn corners(by: f64) -> impl Iterator<Item = [f64; 4]> {
    (0..16u32).map(move |n| std::array::from_fn(|i| if n >> i & 1 == 1 { by } else { -by }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_the_stated_spread_and_repeat() {
        let nominal = TransferSystemParameters::default();
        let deviation = Deviation::default();
        let n = 20_000;
        let draws: Vec<f64> = (0..n)
            .map(|i| deviation.draw(&nominal, 5, i).specimen_stiffness)
            .collect();
        let mean = draws.iter().sum::<f64>() / n as f64;
        let variance = draws.iter().map(|k| (k - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 1.19e6).abs() < 1.5e3, "{mean}");
        assert!((variance.sqrt() - 5e4).abs() < 1e3);
        assert_eq!(
            deviation.draw(&nominal, 5, 3),
            deviation.draw(&nominal, 5, 3)
        );
        assert_ne!(
            deviation.draw(&nominal, 5, 3),
            deviation.draw(&nominal, 6, 3)
        );
    }

    #[test]
    fn corners_are_sixteen_and_differ() {
        let all: Vec<_> = corners(3.0).collect();
        assert_eq!(all.len(), 16);
        assert_eq!(all[0], [-3.0; 4]);
        assert_eq!(all[15], [3.0; 4]);
    }
}
