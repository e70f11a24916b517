//! Sobol' indices from a design of base and mixed samples.
//!
//! First order: `S_i = mean(f_B (f_ABi - f_A)) / V` (Saltelli et al., Computer Physics
//! Communications 181, 2010, table 2 b); total: `T_i = mean((f_A - f_ABi)^2) / 2V` (Jansen, ibid. 117,
//! 1999). `V` is the variance over `A` and `B`; values are taken from their mean, which changes
//! no expectation and steadies the first.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::percentile::percentile;

/// Draws of the bootstrap.
const DRAWS: usize = 1000;

/// An estimate with the middle 95 % of the bootstrap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Banded {
    pub value: f64,
    pub band: [f64; 2],
}

/// First-order and total indices of `factors` factors from a row of `factors + 2` values a base
/// sample: `A`, `AB_1` to `AB_k`, `B`. A value that is not finite leaves out what needs it. None
/// where nothing varies. Base samples are resampled, 95 % bands.
pub(super) fn indices(
    rows: &[Vec<f64>],
    factors: usize,
    seed: u64,
) -> Option<Vec<(Banded, Banded)>> {
    let finite = || rows.iter().flatten().filter(|own| own.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    let centred: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| row.iter().map(|own| own - mean).collect())
        .collect();
    let every: Vec<usize> = (0..rows.len()).collect();
    let found = estimate(&centred, factors, &every)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut drawn: Vec<Vec<f64>> = vec![Vec::with_capacity(DRAWS); 2 * factors];
    for _ in 0..DRAWS {
        let picked: Vec<usize> = every
            .iter()
            .map(|_| random.random_range(0..rows.len()))
            .collect();
        for (n, own) in estimate(&centred, factors, &picked)
            .into_iter()
            .flatten()
            .enumerate()
        {
            drawn[2 * n].push(own[0]);
            drawn[2 * n + 1].push(own[1]);
        }
    }
    for own in &mut drawn {
        own.retain(|value| value.is_finite());
        own.sort_by(f64::total_cmp);
    }
    let band = |place: usize| [0.025, 0.975].map(|part| percentile(&drawn[place], part));
    let banded = found.into_iter().enumerate().map(|(n, own)| {
        let one = |order: usize| Banded {
            value: own[order],
            band: band(2 * n + order),
        };
        (one(0), one(1))
    });
    Some(banded.collect())
}

/// First-order and total index of each factor over the picked base samples.
fn estimate(rows: &[Vec<f64>], factors: usize, picked: &[usize]) -> Option<Vec<[f64; 2]>> {
    let ends = picked
        .iter()
        .flat_map(|&j| [rows[j][0], rows[j][factors + 1]]);
    let ends: Vec<f64> = ends.filter(|own| own.is_finite()).collect();
    let count = ends.len() as f64;
    let mean = ends.iter().sum::<f64>() / count;
    let variance = ends.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / count;
    if variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let of = |factor: usize| {
        let (mut first, mut total, mut count) = (0.0, 0.0, 0.0);
        for &j in picked {
            let [a, mixed, b] = [0, factor + 1, factors + 1].map(|place| rows[j][place]);
            if (a + mixed + b).is_finite() {
                first += b * (mixed - a);
                total += 0.5 * (a - mixed).powi(2);
                count += 1.0;
            }
        }
        [first, total].map(|sum| sum / count / variance)
    };
    Some((0..factors).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// SALib 1.6.0, `sobol.analyze(..., calc_second_order=False)`, on the same 32 rows.
    #[test]
    fn as_salib_computes_them() {
        const STEPS: [f64; 4] = [0.754_877_666, 0.569_840_291, 0.362, 0.819_172_513_4];
        let f = |x: f64, y: f64| x + 2.0 * x * y;
        let rows: Vec<Vec<f64>> = (1..=8)
            .map(|j| {
                let [a, b, c, d] = STEPS.map(|step| (f64::from(j) * step) % 1.0);
                vec![f(a, b), f(c, b), f(a, d), f(c, d)]
            })
            .collect();
        let found = indices(&rows, 2, 1).unwrap();
        let expected = [[0.886_830_99, 0.961_080_23], [0.049_604_99, 0.349_925_58]];
        for ((first, total), expected) in found.iter().zip(expected) {
            assert!((first.value - expected[0]).abs() < 1e-8, "{first:?}");
            assert!((total.value - expected[1]).abs() < 1e-8, "{total:?}");
        }
    }

    /// `sin x1 + 7 sin² x2 + 0.1 x3⁴ sin x1` over ±π (Ishigami and Homma, 1990): a function whose
    /// indices are known in closed form. The bands of samples drawn anew hold them as often as
    /// they say.
    #[test]
    fn the_indices_of_ishigami_lie_in_their_bands() {
        let f =
            |x: [f64; 3]| x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin();
        let v = [
            0.5 * (1.0 + 0.1 * PI.powi(4) / 5.0).powi(2),
            49.0 / 8.0,
            0.0,
        ];
        let v13 = 0.01 * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0);
        let whole = v[0] + v[1] + v13;
        let first = v.map(|own| own / whole);
        let total = [(v[0] + v13) / whole, v[1] / whole, v13 / whole];
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let (mut held, mut asked) = (0, 0);
        for round in 0..40 {
            let rows: Vec<Vec<f64>> = (0..512)
                .map(|_| {
                    let mut draw = || [(); 3].map(|()| PI * (2.0 * random.random::<f64>() - 1.0));
                    let (a, b) = (draw(), draw());
                    let mut row = vec![f(a)];
                    for i in 0..3 {
                        let mut mixed = a;
                        mixed[i] = b[i];
                        row.push(f(mixed));
                    }
                    row.push(f(b));
                    row
                })
                .collect();
            for (i, (one, all)) in indices(&rows, 3, round).unwrap().iter().enumerate() {
                for (found, expected) in [(one, first[i]), (all, total[i])] {
                    assert!((found.value - expected).abs() < 0.2, "{found:?} {expected}");
                    asked += 1;
                    held += usize::from(found.band[0] <= expected && expected <= found.band[1]);
                }
            }
        }
        let share = f64::from(held as u32) / f64::from(asked);
        println!("the bands hold {share:.3} of {asked}");
        assert!((0.9..=0.99).contains(&share), "{share}");
    }
}
