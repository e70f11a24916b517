//! Plants beside the nominal one.

use plant::sensors::channel::Noise;

use super::PlantParameters;

/// What a perturbed plant differs in, in the order of the draws.
pub const PERTURBED: [&str; 9] = [
    "first zero of column 1",
    "second zero of column 1",
    "first pole of column 1",
    "second pole of column 1",
    "shared complex pair",
    "zero of entry 1,2",
    "first pole of column 2",
    "second pole of column 2",
    "zero of entry 2,2",
];

/// Relative standard deviations of [`PERTURBED`]; static gains stay.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Deviation(pub [f64; 9]);

impl Default for Deviation {
    /// The benchmark's.
    fn default() -> Self {
        Self([0.055, 0.055, 0.06, 0.06, 0.05, 0.03, 0.03, 0.03, 0.03])
    }
}

/// Numbers the streams of draws apart from those of the sensors.
const STREAM: u64 = 0x00D2_57F0;

impl Deviation {
    /// `nominal` with each value moved by so many standard deviations.
    #[must_use]
    pub fn moved(&self, nominal: &PlantParameters, by: [f64; 9]) -> PlantParameters {
        let factor: [f64; 9] = std::array::from_fn(|i| 1.0 + self.0[i] * by[i]);
        let mut moved = *nominal;
        moved.first_zeros[0] *= factor[0];
        moved.first_zeros[1] *= factor[1];
        moved.columns[0].poles[0] *= factor[2];
        moved.columns[0].poles[1] *= factor[3];
        for column in &mut moved.columns {
            column.decay *= factor[4];
            column.frequency *= factor[4];
        }
        moved.second_zeros[0] *= factor[5];
        moved.columns[1].poles[0] *= factor[6];
        moved.columns[1].poles[1] *= factor[7];
        moved.second_zeros[1] *= factor[8];
        moved
    }

    /// The plant `number` of those that `seed` gives: independent normal draws.
    #[must_use]
    pub fn draw(&self, nominal: &PlantParameters, seed: u64, number: u64) -> PlantParameters {
        let normal = std::array::from_fn(|i| {
            let draw = Noise {
                seed,
                channel: STREAM + i as u64,
                sample: number,
            };
            draw.gaussian()
        });
        self.moved(nominal, normal)
    }
}

/// The corners of the box of so many standard deviations to either side, as factors for
/// [`Deviation::moved`].
pub fn corners(by: f64) -> impl Iterator<Item = [f64; 9]> {
    (0..512u32).map(move |n| std::array::from_fn(|i| if n >> i & 1 == 1 { by } else { -by }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_repeat_and_have_the_stated_spread() {
        let nominal = PlantParameters::default();
        let deviation = Deviation::default();
        let first = |number| {
            let drawn = deviation.draw(&nominal, 3, number);
            drawn.columns[0].poles[0] / nominal.columns[0].poles[0] - 1.0
        };
        assert_eq!(first(7), first(7));
        let draws: Vec<f64> = (0..4000).map(first).collect();
        let square = draws.iter().map(|z| z * z).sum::<f64>() / 4000.0;
        assert!((square.sqrt() - 0.06).abs() < 0.003);
        assert_eq!(corners(3.0).count(), 512);
    }

    #[test]
    fn each_deviation_moves_its_own_value() {
        let nominal = PlantParameters::default();
        for i in 0..9 {
            let mut by = [0.0; 9];
            by[i] = 1.0;
            let moved = Deviation::default().moved(&nominal, by);
            let values = |p: &PlantParameters| {
                [
                    p.first_zeros[0],
                    p.first_zeros[1],
                    p.columns[0].poles[0],
                    p.columns[0].poles[1],
                    p.columns[0].decay,
                    p.second_zeros[0],
                    p.columns[1].poles[0],
                    p.columns[1].poles[1],
                    p.second_zeros[1],
                ]
            };
            for (j, (a, b)) in values(&moved).iter().zip(values(&nominal)).enumerate() {
                let wanted = if i == j {
                    Deviation::default().0[i]
                } else {
                    0.0
                };
                assert!((a / b - 1.0 - wanted).abs() < 1e-12, "{i} {j}");
            }
            assert_eq!(moved.static_gain, nominal.static_gain);
        }
    }
}
