//! What an effect is worth, by hand: the rig itself with the effect and without, either with its plant fitted again to
//! the records that the program fits, and one sample of the validation record predicted from those before.
//!
//! Nothing is taken from the program: the rig that made the record is simulated from the recorded command, what it
//! leaves is predicted by a vector autoregression, and that of the rig with the effect serves both, so that the noise
//! is one.

use std::thread;

use crate::table::case::Case;
use crate::table::hidden::Hidden;
use crate::table::rig::{NOMINAL, Plant, Rig};

/// Channels: displacement, acceleration, force, specimen acceleration.
const CHANNELS: usize = 4;
/// Samples from which the next one is predicted.
const ORDER: usize = 30;
const SEEN: usize = CHANNELS * ORDER;
/// Parameters of a plant.
const PLANT: usize = 15;
/// Steps of a fit.
const STEPS: usize = 4;
/// Step of a difference quotient, in stated deviations.
const STEP: f64 = 0.2;

type Row = [f64; CHANNELS];

/// A record: the command and what the sensors showed.
struct Record {
    command: Vec<f64>,
    shown: Vec<Row>,
    rate: f64,
}

impl Record {
    fn of(case: &Case, name: &str) -> Option<Self> {
        let (_, text) = case.records.iter().find(|(file, _)| file == name)?;
        let rows = text.lines().skip(1).map(|line| -> Option<[f64; 6]> {
            let cells = line.split(',').map(|cell| cell.parse().ok());
            let cells: Vec<f64> = cells.collect::<Option<_>>()?;
            cells.get(..6)?.try_into().ok()
        });
        let rows: Vec<[f64; 6]> = rows.collect::<Option<_>>()?;
        Some(Self {
            command: rows.iter().map(|row| row[1]).collect(),
            shown: rows
                .iter()
                .map(|row| [row[2], row[3], row[4], row[5]])
                .collect(),
            rate: case.truth.world.as_ref()?.rate,
        })
    }

    /// Standard deviations of the channels.
    fn deviations(&self) -> Row {
        let n = self.shown.len() as f64;
        std::array::from_fn(|i| {
            let mean = self.shown.iter().map(|row| row[i]).sum::<f64>() / n;
            let squares = self.shown.iter().map(|row| (row[i] - mean).powi(2));
            (squares.sum::<f64>() / n).sqrt()
        })
    }
}

/// A rig whose plant is fitted.
struct Model<'a> {
    hidden: &'a Hidden,
    case: &'a Case,
    mismatch: f64,
}

impl Model<'_> {
    /// What the rig with a plant `off` by so many stated deviations leaves of a record.
    fn leaves(&self, off: &[f64; PLANT], record: &Record) -> Vec<Row> {
        let plant = plant(off, self.mismatch);
        let mut rig = Rig::new(plant, self.hidden.clone(), self.case.laws);
        let samples = record.command.iter().zip(&record.shown);
        samples
            .map(|(command, shown)| {
                let simulated = rig.sample(0.0);
                rig.advance(*command, 1.0 / record.rate, (0.0, 0.0));
                std::array::from_fn(|i| shown[i] - simulated[i])
            })
            .collect()
    }

    /// The plant, in stated deviations from what is believed, that predicts `records` best under a `noise`.
    fn fitted(
        &self,
        from: [f64; PLANT],
        records: &[Record],
        noise: &Noise,
    ) -> Option<[f64; PLANT]> {
        let errors = |off: &[f64; PLANT]| -> Vec<Row> {
            let own = records.iter();
            own.flat_map(|record| noise.whitened(&self.leaves(off, record)))
                .collect()
        };
        let cost = |off: &[f64; PLANT], errors: &[Row]| {
            let data: f64 = errors.iter().flatten().map(|e| e * e).sum();
            data + off.iter().map(|z| z * z).sum::<f64>()
        };
        let mut off = from;
        let mut now = errors(&off);
        for _ in 0..STEPS {
            let slopes: Vec<Vec<Row>> = thread::scope(|scope| {
                let each = (0..PLANT).map(|p| {
                    let mut moved = off;
                    moved[p] += STEP;
                    scope.spawn(move || errors(&moved))
                });
                let all: Vec<_> = each.collect();
                all.into_iter()
                    .map(|one| one.join().ok())
                    .collect::<Option<_>>()
            })?;
            let dot = |a: &[Row], b: &[Row]| -> f64 {
                let pairs = a.iter().flatten().zip(b.iter().flatten());
                pairs.map(|(a, b)| a * b).sum()
            };
            let slopes: Vec<Vec<Row>> = slopes
                .iter()
                .map(|moved| {
                    let pairs = moved.iter().zip(&now);
                    pairs
                        .map(|(m, n)| std::array::from_fn(|i| (m[i] - n[i]) / STEP))
                        .collect()
                })
                .collect();
            let mut normal = vec![vec![0.0; PLANT]; PLANT];
            let mut right = vec![0.0; PLANT];
            for p in 0..PLANT {
                for q in 0..PLANT {
                    normal[p][q] = dot(&slopes[p], &slopes[q]) + f64::from(u8::from(p == q));
                }
                right[p] = -dot(&slopes[p], &now) - off[p];
            }
            let step = solved(normal, right)?;
            let before = cost(&off, &now);
            let mut share = 1.0;
            let better = loop {
                let trial: [f64; PLANT] = std::array::from_fn(|p| off[p] + share * step[p]);
                let there = errors(&trial);
                if cost(&trial, &there) < before {
                    break Some((trial, there));
                }
                share *= 0.4;
                if share < 0.05 {
                    break None;
                }
            };
            let Some((next, there)) = better else { break };
            (off, now) = (next, there);
        }
        Some(off)
    }
}

/// The believed plant with every parameter `off` by so many deviations of `mismatch` of it.
fn plant(off: &[f64; PLANT], mismatch: f64) -> Plant {
    let mut values = off.iter();
    NOMINAL.perturbed(|| values.next().copied().unwrap_or_default(), mismatch)
}

/// What is left of a rig as a vector autoregression, whitened.
struct Noise {
    /// Of each channel, over those of the samples before, the last one first.
    coefficients: [Vec<f64>; CHANNELS],
    /// Lower triangle by which what it does not predict is white of variance one.
    whitening: [[f64; CHANNELS]; CHANNELS],
}

impl Noise {
    /// Of channels that are white, with these deviations.
    fn white(deviations: Row) -> Self {
        let mut whitening = [[0.0; CHANNELS]; CHANNELS];
        for i in 0..CHANNELS {
            whitening[i][i] = 1.0 / deviations[i];
        }
        Self {
            coefficients: std::array::from_fn(|_| vec![0.0; SEEN]),
            whitening,
        }
    }

    /// By least squares on what is `left` of each record, of channels with these deviations.
    fn of(left: &[Vec<Row>], deviations: Row) -> Option<Self> {
        let scaled: Vec<Vec<Row>> = left
            .iter()
            .map(|record| {
                let rows = record.iter();
                rows.map(|row| std::array::from_fn(|i| row[i] / deviations[i]))
                    .collect()
            })
            .collect();
        let mut normal = vec![vec![0.0; SEEN]; SEEN];
        let mut right: [Vec<f64>; CHANNELS] = std::array::from_fn(|_| vec![0.0; SEEN]);
        let places = scaled.iter();
        for (record, k) in places.flat_map(|record| (ORDER..record.len()).map(move |k| (record, k)))
        {
            let seen = seen(record, k);
            for (a, own) in seen.iter().enumerate() {
                for (sum, other) in normal[a].iter_mut().zip(&seen[..=a]) {
                    *sum += own * other;
                }
                for (sums, value) in right.iter_mut().zip(record[k]) {
                    sums[a] += own * value;
                }
            }
        }
        for a in 0..SEEN {
            normal[a][a] *= 1.0 + 1e-9;
            for b in 0..a {
                normal[b][a] = normal[a][b];
            }
        }
        let mut noise = Self::white([1.0; CHANNELS]);
        for (own, right) in noise.coefficients.iter_mut().zip(right) {
            *own = solved(normal.clone(), right)?;
        }
        let unpredicted = scaled.iter().flat_map(|record| noise.unpredicted(record));
        let unpredicted: Vec<Row> = unpredicted.collect();
        let n = unpredicted.len() as f64;
        let mut covariance = [[0.0; CHANNELS]; CHANNELS];
        for row in &unpredicted {
            for i in 0..CHANNELS {
                for j in 0..CHANNELS {
                    covariance[i][j] += row[i] * row[j] / n;
                }
            }
        }
        let root = cholesky(covariance)?;
        // Rows of the inverse of the root, then back to the channels' own units.
        for i in 0..CHANNELS {
            for j in 0..=i {
                let sum: f64 = (j..i).map(|m| root[i][m] * noise.whitening[m][j]).sum();
                let own = f64::from(u8::from(i == j));
                noise.whitening[i][j] = (own - sum) / root[i][i];
            }
        }
        for row in &mut noise.whitening {
            for (value, deviation) in row.iter_mut().zip(deviations) {
                *value /= deviation;
            }
        }
        for (i, own) in noise.coefficients.iter_mut().enumerate() {
            for (place, value) in own.iter_mut().enumerate() {
                *value *= deviations[i] / deviations[place % CHANNELS];
            }
        }
        Some(noise)
    }

    /// What the samples before do not predict of each.
    fn unpredicted(&self, left: &[Row]) -> Vec<Row> {
        let all = ORDER..left.len();
        all.map(|k| {
            let seen = seen(left, k);
            std::array::from_fn(|i| {
                let pairs = self.coefficients[i].iter().zip(&seen);
                left[k][i] - pairs.map(|(a, b)| a * b).sum::<f64>()
            })
        })
        .collect()
    }

    fn whitened(&self, left: &[Row]) -> Vec<Row> {
        let rows = self.unpredicted(left).into_iter();
        rows.map(|row| {
            std::array::from_fn(|i| (0..=i).map(|j| self.whitening[i][j] * row[j]).sum())
        })
        .collect()
    }
}

/// The samples before `k`, the last one first.
fn seen(rows: &[Row], k: usize) -> [f64; SEEN] {
    std::array::from_fn(|place| rows[k - 1 - place / CHANNELS][place % CHANNELS])
}

fn cholesky(m: [[f64; CHANNELS]; CHANNELS]) -> Option<[[f64; CHANNELS]; CHANNELS]> {
    let mut root = [[0.0; CHANNELS]; CHANNELS];
    for i in 0..CHANNELS {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            root[i][j] = if i == j {
                Some((m[i][i] - sum).sqrt()).filter(|own| *own > 0.0)?
            } else {
                (m[i][j] - sum) / root[j][j]
            };
        }
    }
    Some(root)
}

/// By elimination with pivots; none where it is singular.
fn solved(mut m: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let n = right.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs()))?;
        m.swap(k, pivot);
        right.swap(k, pivot);
        let (above, below) = m.split_at_mut(k + 1);
        let own = &above[k];
        if own[k] == 0.0 || !own[k].is_finite() {
            return None;
        }
        for (offset, row) in below.iter_mut().enumerate() {
            let factor = row[k] / own[k];
            for (value, pivot) in row[k..].iter_mut().zip(&own[k..]) {
                *value -= factor * pivot;
            }
            right[k + 1 + offset] -= factor * right[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| m[k][j] * right[j]).sum();
        right[k] = (right[k] - sum) / m[k][k];
    }
    Some(right)
}

/// Error without what is hidden over error with it, on the validation record, relative to the channels' standard
/// deviations as the program prints it; none where a rig runs away.
pub fn by_hand(case: &Case) -> Option<f64> {
    let fitted = [
        Record::of(case, "identification.csv")?,
        Record::of(case, "small.csv")?,
    ];
    let tested = Record::of(case, "validation.csv")?;
    let mismatch = case.truth.world.as_ref()?.mismatch;
    let bare = Hidden::default();
    let [with, without] = [&case.hidden, &bare].map(|hidden| Model {
        hidden,
        case,
        mismatch,
    });
    let deviations = fitted[0].deviations();
    let mut noise = Noise::white(deviations);
    let mut plant = [0.0; PLANT];
    for _ in 0..2 {
        let left = fitted.each_ref().map(|record| with.leaves(&plant, record));
        noise = Noise::of(&left, deviations)?;
        plant = with.fitted(plant, &fitted, &noise)?;
    }
    let other = without.fitted([0.0; PLANT], &fitted, &noise)?;
    let scale = tested.deviations();
    let error = |model: &Model<'_>, plant: &[f64; PLANT]| {
        let rows = noise.unpredicted(&model.leaves(plant, &tested));
        let squares = rows.iter().map(|row| -> f64 {
            let own = row.iter().zip(&scale);
            own.map(|(e, deviation)| (e / deviation).powi(2)).sum()
        });
        squares.sum::<f64>().sqrt()
    };
    let gain = error(&without, &other) / error(&with, &plant);
    gain.is_finite().then_some(gain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_autoregression_leaves_white_noise_of_variance_one() {
        // A swing that all channels share, and noise of each.
        let mut dice = crate::dice::Dice::new(1, 83);
        let (mut swing, mut before) = (0.0f64, 0.0f64);
        let rows: Vec<Row> = (0..6000)
            .map(|_| {
                (swing, before) = (1.9 * swing - 0.95 * before + 0.1 * dice.gauss(), swing);
                std::array::from_fn(|i| (1.0 + i as f64) * (swing + 0.2 * dice.gauss()))
            })
            .collect();
        let noise = Noise::of(&[rows[..3000].to_vec()], [1.0, 2.0, 3.0, 4.0]).unwrap();
        let white = noise.whitened(&rows[3000..]);
        let n = white.len() as f64;
        for i in 0..CHANNELS {
            for j in 0..=i {
                let mean = white.iter().map(|row| row[i] * row[j]).sum::<f64>() / n;
                let expected = f64::from(u8::from(i == j));
                assert!((mean - expected).abs() < 0.15, "{i} {j}: {mean}");
            }
            let next = white.windows(2).map(|w| w[0][i] * w[1][i]).sum::<f64>() / n;
            assert!(next.abs() < 0.1, "{i}: {next}");
        }
    }

    #[test]
    fn equations_are_solved_and_singular_ones_are_not() {
        let m = vec![vec![0.0, 2.0], vec![3.0, 1.0]];
        assert_eq!(solved(m, vec![4.0, 5.0]), Some(vec![1.0, 2.0]));
        assert_eq!(
            solved(vec![vec![1.0, 2.0], vec![2.0, 4.0]], vec![1.0, 1.0]),
            None
        );
    }
}
