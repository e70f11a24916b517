//! Where a rig leaves over what its model does not explain, and the motion that goes there most.
//!
//! A non-negative regression predicts the squared innovations above the noise in each second of the
//! records. Its regressors are the time in each range of a quantity (speed, displacement,
//! acceleration, command), or the power of the acceleration in each frequency band. The quantity
//! that tells them best on seconds to which it was not fitted says where the cause acts, and which
//! of the motions that the rig can play shows most of it.

use plant::identified::rig::IdentifiedRig;
use realfft::RealFftPlanner;
use units::constants::INCH;

use super::experiment::{self, Motion};
use super::predictor::Samples;
use crate::case::ControlLaw;

/// s; what happens within is one observation.
const BLOCK: f64 = 1.0;
/// Ranges of a quantity.
const RANGES: usize = 5;
/// Samples to either side of the difference that gives the speed, s.
const ASIDE: f64 = 8e-3;
/// Edges of the bands, Hz.
const BANDS: [f64; 6] = [0.5, 2.0, 5.0, 10.0, 20.0, 40.0];
/// Power in a band counts up to so many times what the records hold: nothing tells what is beyond.
const BEYOND: f64 = 4.0;
/// Share of the variation of the residual, on held-out seconds, that a quantity must predict.
const TOLD: f64 = 0.2;
/// Quantities that tell up to so much less than the best are asked along with it.
const AS_GOOD: f64 = 0.1;
/// Rounds of coordinate descent.
const ROUNDS: usize = 300;

/// A record with what its model leaves over: whitened innovations, four a sample, zero where a channel is
/// missing.
#[derive(Debug, Clone, Copy)]
pub struct Residual<'a> {
    /// What acted and what was measured.
    pub samples: &'a Samples,
    /// Innovations.
    pub whitened: &'a [f64],
}

/// A quantity that says where the rig is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Displacement,
    Speed,
    Acceleration,
    Command,
    Frequency,
}

impl Quantity {
    const ALL: [Self; 5] = [
        Self::Displacement,
        Self::Speed,
        Self::Acceleration,
        Self::Command,
        Self::Frequency,
    ];

    /// Its sizes, SI.
    fn sizes(self, samples: &Samples, period: f64) -> Vec<f64> {
        let n = samples.len();
        let channel = |i: usize, k: usize| samples.channels[k][i];
        let aside = (ASIDE / period).round().max(1.0) as usize;
        let size = |k: usize| match self {
            Self::Displacement => channel(0, k),
            Self::Speed => {
                let (from, to) = (k.saturating_sub(aside), (k + aside).min(n - 1));
                (channel(0, to) - channel(0, from)) / ((to - from) as f64 * period)
            }
            Self::Acceleration | Self::Frequency => channel(1, k),
            Self::Command => samples.command[k],
        };
        (0..n).map(|k| size(k).abs()).collect()
    }

    /// A size of it for people.
    fn told(self, size: f64) -> String {
        match self {
            Self::Displacement => format!("{:.2} in ({:.1} mm)", size / INCH, 1e3 * size),
            Self::Speed => format!("{:.2} in/s ({:.0} mm/s)", size / INCH, 1e3 * size),
            Self::Acceleration => format!("{size:.2} m/s²"),
            Self::Command => format!("{size:.2} V"),
            Self::Frequency => format!("{size} Hz"),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacements",
            Self::Speed => "speeds",
            Self::Acceleration => "accelerations",
            Self::Command => "commands",
            Self::Frequency => "frequencies",
        }
    }
}

/// What a second of a record shows of a quantity.
struct Look {
    quantity: Quantity,
    period: f64,
    /// Lower edges of the ranges.
    edges: Vec<f64>,
    /// Largest values of the features in the records.
    largest: Vec<f64>,
}

impl Look {
    fn at(quantity: Quantity, records: &[Residual<'_>], period: f64) -> Self {
        let edges = if quantity == Quantity::Frequency {
            BANDS[..RANGES].to_vec()
        } else {
            let all = records
                .iter()
                .flat_map(|r| quantity.sizes(r.samples, period));
            let largest = all.fold(f64::MIN_POSITIVE, f64::max);
            (0..RANGES)
                .map(|i| largest * i as f64 / RANGES as f64)
                .collect()
        };
        let mut look = Self {
            quantity,
            period,
            edges,
            largest: Vec::new(),
        };
        let rows: Vec<Vec<f64>> = records
            .iter()
            .flat_map(|record| look.rows(record.samples))
            .collect();
        look.largest = (0..look.width())
            .map(|i| rows.iter().map(|row| row[i]).fold(0.0, f64::max))
            .collect();
        look
    }

    fn width(&self) -> usize {
        // Power in no band: what is left over of a rig at rest.
        RANGES + usize::from(self.quantity == Quantity::Frequency)
    }

    /// A row of features for every whole second: shares of the time in each range, or power in each band.
    fn rows(&self, samples: &Samples) -> Vec<Vec<f64>> {
        let block = (BLOCK / self.period).round().max(8.0) as usize;
        if self.quantity == Quantity::Frequency {
            return self.powers(samples, block);
        }
        let sizes = self.quantity.sizes(samples, self.period);
        sizes
            .chunks_exact(block)
            .map(|sizes| {
                let mut row = vec![0.0; RANGES];
                for size in sizes {
                    row[self.range(*size)] += 1.0 / block as f64;
                }
                row
            })
            .collect()
    }

    fn range(&self, size: f64) -> usize {
        self.edges.iter().rposition(|low| size >= *low).unwrap_or(0)
    }

    fn powers(&self, samples: &Samples, block: usize) -> Vec<Vec<f64>> {
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(block);
        let one = |channels: &[[f64; 4]]| {
            let mut series: Vec<f64> = channels.iter().map(|row| row[1]).collect();
            let mut spectrum = transform.make_output_vec();
            let mut row = vec![0.0; RANGES];
            row.push(1.0);
            if transform.process(&mut series, &mut spectrum).is_err() {
                return row;
            }
            for (line, value) in spectrum.iter().enumerate() {
                let frequency = line as f64 / (block as f64 * self.period);
                if (BANDS[0]..BANDS[RANGES]).contains(&frequency) {
                    row[self.range(frequency)] += 2.0 * value.norm_sqr() / (block as f64).powi(2);
                }
            }
            row
        };
        samples.channels.chunks_exact(block).map(one).collect()
    }

    /// What `coefficients` expect to be left over on a motion, one value per sample.
    fn expected(&self, coefficients: &[f64], samples: &Samples) -> f64 {
        let rows = self.rows(samples);
        let count = rows.len().max(1) as f64;
        let is_power = self.quantity == Quantity::Frequency;
        let row = |row: &Vec<f64>| -> f64 {
            let all = coefficients.iter().zip(row).zip(&self.largest);
            all.map(|((c, value), largest)| match is_power {
                true => c * value.min(BEYOND * largest),
                false => c * value,
            })
            .sum()
        };
        rows.iter().map(row).sum::<f64>() / count
    }

    /// The range in words.
    fn told(&self, range: usize) -> String {
        let low = self.quantity.told(self.edges[range]);
        let name = self.quantity.name();
        let is_band = self.quantity == Quantity::Frequency;
        match (self.edges.get(range + 1), is_band) {
            (Some(high), _) => format!("{name} from {low} to {}", self.quantity.told(*high)),
            (None, true) => format!("{name} from {low} to {} Hz", BANDS[RANGES]),
            (None, false) => format!("{name} above {low}"),
        }
    }
}

/// Coefficients, none negative, that tell `values` from `rows` with the least squared error.
fn not_negative(rows: &[&[f64]], values: &[f64]) -> Vec<f64> {
    let width = rows.first().map_or(0, |row| row.len());
    let product = |i: usize, j: usize| -> f64 { rows.iter().map(|row| row[i] * row[j]).sum() };
    let gram: Vec<Vec<f64>> = (0..width)
        .map(|i| (0..width).map(|j| product(i, j)).collect())
        .collect();
    let pull: Vec<f64> = (0..width)
        .map(|i| rows.iter().zip(values).map(|(row, y)| row[i] * y).sum())
        .collect();
    let mut found = vec![0.0; width];
    for _ in 0..ROUNDS {
        for i in 0..width {
            if gram[i][i] > 0.0 {
                let others: f64 = (0..width)
                    .filter(|j| *j != i)
                    .map(|j| gram[i][j] * found[j])
                    .sum();
                found[i] = ((pull[i] - others) / gram[i][i]).max(0.0);
            }
        }
    }
    found
}

/// Squared innovations beyond the noise, a sample of all channels, as a mean over every whole second.
pub fn left_over(record: &Residual<'_>, period: f64) -> Vec<f64> {
    let block = 4 * (BLOCK / period).round().max(8.0) as usize;
    let excess = |block: &[f64]| {
        let there = (0..4).filter(|i| block.iter().skip(*i).step_by(4).any(|r| *r != 0.0));
        let squares: f64 = block.iter().map(|r| r * r).sum();
        4.0 * squares / block.len() as f64 - there.count() as f64
    };
    record.whitened.chunks_exact(block).map(excess).collect()
}

/// Share of the variation of `values` that `rows` tell on every second one, fitted to the others.
fn told_left_out(rows: &[Vec<f64>], values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (mut missed, mut all) = (0.0, 0.0);
    for out in [0, 1] {
        let kept = (0..values.len()).filter(|k| k % 2 != out);
        let (own, fitted): (Vec<&[f64]>, Vec<f64>) =
            kept.map(|k| (rows[k].as_slice(), values[k])).unzip();
        let found = not_negative(&own, &fitted);
        for k in (out..values.len()).step_by(2) {
            let expected: f64 = found.iter().zip(&rows[k]).map(|(c, x)| c * x).sum();
            missed += (values[k] - expected).powi(2);
            all += (values[k] - mean).powi(2);
        }
    }
    1.0 - missed / all.max(f64::MIN_POSITIVE)
}

/// A look with what it expects.
struct Told {
    look: Look,
    coefficients: Vec<f64>,
    /// Share that it tells of the variation on seconds left out.
    share: f64,
}

impl Told {
    fn by(quantity: Quantity, records: &[Residual<'_>], values: &[f64], period: f64) -> Self {
        let look = Look::at(quantity, records, period);
        let all = records.iter().flat_map(|record| look.rows(record.samples));
        let rows: Vec<Vec<f64>> = all.take(values.len()).collect();
        let whole: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        Self {
            coefficients: not_negative(&whole, values),
            share: told_left_out(&rows, values),
            look,
        }
    }

    /// The range in which most is left over, in words.
    fn place(&self) -> Option<String> {
        let weight = |i: usize| match self.look.quantity {
            Quantity::Frequency => self.coefficients[i] * self.look.largest[i],
            _ => self.coefficients[i],
        };
        let ranges = (0..RANGES).filter(|i| self.look.largest[*i] > 0.0);
        let range = ranges.max_by(|a, b| weight(*a).total_cmp(&weight(*b)))?;
        Some(self.look.told(range))
    }
}

/// The motion on which most of what `rig` leaves over in `records` is to be expected: the mean of what
/// the quantities expect that tell it nearly as well as the best. None where it does not follow from where
/// the rig is, or where no motion that `law` can play is expected to show more of it than a record did.
pub fn probe(
    rig: &IdentifiedRig,
    law: &ControlLaw,
    records: &[Residual<'_>],
    period: f64,
) -> Option<experiment::SeparatingExperiment> {
    let values: Vec<f64> = records
        .iter()
        .flat_map(|record| left_over(record, period))
        .collect();
    let mut looks = Quantity::ALL.map(|quantity| Told::by(quantity, records, &values, period));
    looks.sort_by(|a, b| b.share.total_cmp(&a.share));
    let [best, ..] = &looks;
    if best.share < TOLD {
        return None;
    }
    let as_good = looks
        .iter()
        .filter(|look| look.share > best.share - AS_GOOD);
    let as_good: Vec<&Told> = as_good.collect();
    let expected = |samples: &Samples| {
        let all = as_good
            .iter()
            .map(|own| own.look.expected(&own.coefficients, samples));
        all.sum::<f64>() / as_good.len() as f64
    };
    let recorded = records.iter().map(|record| expected(record.samples));
    let recorded = recorded.fold(f64::MIN_POSITIVE, f64::max);
    let played = experiment::motions(period).filter_map(|motion| {
        let expected = expected(&play(rig, law, &motion, period)?);
        expected.is_finite().then_some((expected, motion))
    });
    let (expected, motion) = played.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let place = best.place()?;
    (expected > recorded).then(|| experiment::SeparatingExperiment {
        kind: motion.kind,
        peak: motion.peak,
        aim: experiment::Aim::LeftOver {
            place,
            times: expected / recorded,
        },
        period,
        reference: motion.reference,
    })
}

/// What `rig` does on a motion; none where the law would be driven to its limit.
pub fn play(
    rig: &IdentifiedRig,
    law: &ControlLaw,
    motion: &Motion,
    period: f64,
) -> Option<Samples> {
    let channels = experiment::play(rig, law, &motion.reference, period).ok()?;
    let command = experiment::commands(law, &motion.reference, &channels, period);
    experiment::is_playable(law, &command).then_some(Samples { command, channels })
}
