//! What an effect is worth, by hand: the rig itself with the effect and without, either with its plant fitted again to
//! the records that the program fits, and one sample of the validation record predicted from those before.
//!
//! Nothing is taken from the program: the rig that made the record is simulated from the recorded command. What it
//! leaves is predicted by a vector autoregression, which is that of the rig with the effect for both.

use std::thread;

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

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

type Row = SVector<f64, CHANNELS>;

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
                .map(|row| Row::from_column_slice(&row[2..]))
                .collect(),
            rate: case.truth.world.as_ref()?.rate,
        })
    }

    /// Standard deviations of the channels.
    fn deviations(&self) -> Row {
        let n = self.shown.len() as f64;
        let mean = self.shown.iter().sum::<Row>() / n;
        let squares = self.shown.iter().map(|row| (row - mean).map(|e| e * e));
        (squares.sum::<Row>() / n).map(f64::sqrt)
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
                shown - Row::from(simulated)
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
        let errors = |off: &[f64; PLANT]| -> DVector<f64> {
            let own = records.iter();
            let rows = own.flat_map(|record| noise.whitened(&self.leaves(off, record)));
            let all: Vec<f64> = rows.flat_map(|row| row.data.0[0]).collect();
            DVector::from_vec(all)
        };
        let cost = |off: &[f64; PLANT], errors: &DVector<f64>| {
            errors.norm_squared() + off.iter().map(|z| z * z).sum::<f64>()
        };
        let mut off = from;
        let mut now = errors(&off);
        for _ in 0..STEPS {
            let slopes: Vec<DVector<f64>> = thread::scope(|scope| {
                let each = (0..PLANT).map(|p| {
                    let (mut moved, now) = (off, &now);
                    moved[p] += STEP;
                    scope.spawn(move || (errors(&moved) - now) / STEP)
                });
                let all: Vec<_> = each.collect();
                all.into_iter()
                    .map(|one| one.join().ok())
                    .collect::<Option<_>>()
            })?;
            let slopes = DMatrix::from_columns(&slopes);
            let normal = slopes.tr_mul(&slopes) + DMatrix::identity(PLANT, PLANT);
            let right = -slopes.tr_mul(&now) - DVector::from_column_slice(&off);
            let step = normal.cholesky()?.solve(&right);
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
    /// Of each channel in a column, over those of the samples before, the last one first.
    coefficients: SMatrix<f64, SEEN, CHANNELS>,
    /// Lower triangle by which what it does not predict is white of variance one.
    whitening: SMatrix<f64, CHANNELS, CHANNELS>,
}

impl Noise {
    /// By least squares on what is `left` of each record.
    fn of(left: &[Vec<Row>]) -> Option<Self> {
        let places = left.iter();
        let places = places.flat_map(|record| (ORDER..record.len()).map(move |k| (record, k)));
        let mut normal = DMatrix::zeros(SEEN, SEEN);
        let mut right = DMatrix::zeros(SEEN, CHANNELS);
        for (record, k) in places {
            let seen = seen(record, k);
            normal.syger(1.0, &seen, &seen, 1.0);
            right.ger(1.0, &seen, &record[k], 1.0);
        }
        for own in 0..SEEN {
            normal[(own, own)] *= 1.0 + 1e-9;
        }
        let solved = normal.cholesky()?.solve(&right);
        let mut noise = Self {
            coefficients: SMatrix::from_column_slice(solved.as_slice()),
            whitening: SMatrix::identity(),
        };
        let unpredicted: Vec<Row> = left.iter().flat_map(|own| noise.unpredicted(own)).collect();
        let covariance: SMatrix<f64, CHANNELS, CHANNELS> =
            unpredicted.iter().map(|row| row * row.transpose()).sum();
        let root = (covariance / unpredicted.len() as f64).cholesky()?.l();
        noise.whitening = root.solve_lower_triangular(&SMatrix::identity())?;
        Some(noise)
    }

    /// What the samples before do not predict of each.
    fn unpredicted(&self, left: &[Row]) -> Vec<Row> {
        let all = ORDER..left.len();
        all.map(|k| left[k] - self.coefficients.tr_mul(&seen(left, k)))
            .collect()
    }

    fn whitened(&self, left: &[Row]) -> Vec<Row> {
        let rows = self.unpredicted(left).into_iter();
        rows.map(|row| self.whitening * row).collect()
    }
}

/// The samples before `k`, the last one first.
fn seen(rows: &[Row], k: usize) -> SVector<f64, SEEN> {
    SVector::from_fn(|place, _| rows[k - 1 - place / CHANNELS][place % CHANNELS])
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
    let noise_at = |plant: &[f64; PLANT]| {
        let left = fitted.each_ref().map(|record| with.leaves(plant, record));
        Noise::of(&left)
    };
    let near = with.fitted([0.0; PLANT], &fitted, &noise_at(&[0.0; PLANT])?)?;
    let noise = noise_at(&near)?;
    let plant = with.fitted(near, &fitted, &noise)?;
    let other = without.fitted([0.0; PLANT], &fitted, &noise)?;
    let scale = tested.deviations();
    let error = |model: &Model<'_>, plant: &[f64; PLANT]| {
        let rows = noise.unpredicted(&model.leaves(plant, &tested));
        let squares = rows
            .iter()
            .map(|row| row.component_div(&scale).norm_squared());
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
                Row::from_fn(|i, _| (1.0 + i as f64) * (swing + 0.2 * dice.gauss()))
            })
            .collect();
        let noise = Noise::of(&[rows[..3000].to_vec()]).unwrap();
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
}
