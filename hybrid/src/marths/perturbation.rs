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

/// Number of [`covering_corners`].
pub const COVERING: usize = 32;

/// Corners of the perturbations that cover the box: the nine values so many standard deviations to either side, each of the
/// four static gains `off` (relative) to either side, and every command a sample late. They are a fraction of the 8192
/// corners in which any three of the thirteen have all eight combinations of signs equally often. Each sign is the product
/// of an odd number of five basic ones (G. E. P. Box and J. S. Hunter, Technometrics 3, 1961).
#[must_use]
pub fn covering_corners(
    nominal: &PlantParameters,
    by: f64,
    off: f64,
) -> [PlantParameters; COVERING] {
    let odd: Vec<u32> = (1..32u32)
        .filter(|word| word.count_ones() % 2 == 1)
        .collect();
    std::array::from_fn(|run| {
        let sign = |factor: usize| match (odd[factor] & run as u32).count_ones() % 2 {
            0 => 1.0,
            _ => -1.0,
        };
        let mut plant = Deviation::default().moved(nominal, std::array::from_fn(|i| by * sign(i)));
        for (i, gain) in plant.static_gain.iter_mut().flatten().enumerate() {
            *gain *= 1.0 + off * sign(9 + i);
        }
        plant.delay = plant.delay.map(|samples| samples + 1);
        plant
    })
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
    fn covering_corners_have_every_three_signs_equally_often() {
        let nominal = PlantParameters::default();
        let corners = covering_corners(&nominal, 3.0, 0.05);
        let signs = |plant: &PlantParameters| -> Vec<bool> {
            let (p, n) = (plant, &nominal);
            let of = [
                (p.first_zeros[0], n.first_zeros[0]),
                (p.first_zeros[1], n.first_zeros[1]),
                (p.columns[0].poles[0], n.columns[0].poles[0]),
                (p.columns[0].poles[1], n.columns[0].poles[1]),
                (p.columns[0].decay, n.columns[0].decay),
                (p.second_zeros[0], n.second_zeros[0]),
                (p.columns[1].poles[0], n.columns[1].poles[0]),
                (p.columns[1].poles[1], n.columns[1].poles[1]),
                (p.second_zeros[1], n.second_zeros[1]),
                (p.static_gain[0][0], n.static_gain[0][0]),
                (p.static_gain[0][1], n.static_gain[0][1]),
                (p.static_gain[1][0], n.static_gain[1][0]),
                (p.static_gain[1][1], n.static_gain[1][1]),
            ];
            of.iter().map(|(moved, nominal)| moved > nominal).collect()
        };
        let rows: Vec<Vec<bool>> = corners.iter().map(signs).collect();
        for (a, b, c) in
            (0..13).flat_map(|a| (0..a).flat_map(move |b| (0..b).map(move |c| (a, b, c))))
        {
            for word in 0..8u8 {
                let wanted = [word & 1 > 0, word & 2 > 0, word & 4 > 0];
                let count = rows
                    .iter()
                    .filter(|row| [row[a], row[b], row[c]] == wanted)
                    .count();
                assert_eq!(count, COVERING / 8, "{a} {b} {c}");
            }
        }
        assert!(
            corners
                .iter()
                .all(|plant| plant.delay == [1; 2] && plant.validate().is_ok())
        );
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
