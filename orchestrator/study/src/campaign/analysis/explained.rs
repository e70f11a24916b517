//! Share of the variance that one factor explains alone: the correlation ratio of groups.
//!
//! `ε² = 1 - (1 - η²)(n - 1)/(n - g)` with `η²` the variance between `g` groups over all (Kelley, PNAS
//! 21, 1935): 0 on average for a factor without effect, and set to 0 if shuffled values explain as
//! much. Its band is that of resampled runs, moved by the bias that resampling adds.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::percentile::percentile;
use super::sobol_indices::Banded;

/// Shuffles; a share that one of them reaches is chance.
const SHUFFLES: usize = 100;
/// Draws of the bootstrap.
const DRAWS: usize = 400;
/// Values that are drawn in all, about: of a million runs, whose bands are narrow, fewer draws do.
const MOST_DRAWN: usize = 20_000_000;
/// Bins of a number, at most.
const MOST_BINS: usize = 20;

/// Groups of equal counts of a number; equal numbers share one. About half the root of the count, so
/// that a bin has enough runs and a curve enough bins.
pub(super) fn bins(numbers: &[f64]) -> Vec<usize> {
    let wanted = ((numbers.len() as f64).sqrt() / 2.0) as usize;
    let wanted = wanted.clamp(3, MOST_BINS);
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
    let mut groups = vec![0; numbers.len()];
    let mut before: Option<usize> = None;
    for (rank, &run) in order.iter().enumerate() {
        groups[run] = match before {
            Some(last) if numbers[last] == numbers[run] => groups[last],
            _ => rank * wanted / numbers.len(),
        };
        before = Some(run);
    }
    groups
}

/// The share of the variance of `values` between `groups`; none where nothing varies, or the groups
/// are nearly as many as the values.
pub(super) fn share(values: &[f64], groups: &[usize], seed: u64) -> Option<Banded> {
    let count = groups.iter().max()? + 1;
    let every: Vec<usize> = (0..values.len()).collect();
    let value = epsilon_squared(values, groups, count, &every)?;
    let few = |most: usize| most.min((MOST_DRAWN / values.len()).max(20));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut shuffled = groups.to_vec();
    let by_chance = (0..few(SHUFFLES)).any(|_| {
        shuffled.shuffle(&mut random);
        epsilon_squared(values, &shuffled, count, &every).is_none_or(|own| own >= value)
    });
    if by_chance {
        return Some(Banded {
            value: 0.0,
            band: [0.0; 2],
        });
    }
    let mut drawn: Vec<f64> = (0..few(DRAWS))
        .filter_map(|_| {
            let picked: Vec<usize> = every
                .iter()
                .map(|_| random.random_range(0..values.len()))
                .collect();
            epsilon_squared(values, groups, count, &picked)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let bias = drawn.iter().sum::<f64>() / drawn.len().max(1) as f64 - value;
    let end = |part| (percentile(&drawn, part) - bias).clamp(0.0, 1.0);
    Some(Banded {
        value,
        band: [end(0.025), end(0.975)],
    })
}

fn epsilon_squared(
    values: &[f64],
    groups: &[usize],
    count: usize,
    picked: &[usize],
) -> Option<f64> {
    let n = picked.len() as f64;
    let mean = picked.iter().map(|&run| values[run]).sum::<f64>() / n;
    let mut sums = vec![(0.0, 0.0); count];
    let mut whole = 0.0;
    for &run in picked {
        let own = values[run] - mean;
        whole += own * own;
        sums[groups[run]].0 += own;
        sums[groups[run]].1 += 1.0;
    }
    let filled = || sums.iter().filter(|(_, runs)| *runs > 0.0);
    let between: f64 = filled().map(|(sum, runs)| sum * sum / runs).sum();
    let g = filled().count() as f64;
    let share = 1.0 - (1.0 - between / whole) * (n - 1.0) / (n - g);
    (whole > 0.0 && n > 1.5 * g).then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y = 3 a + 2 b + c b` with the factors uniform over ±1: variances 9, 4 and 1/3 thirds.
    fn drawn(runs: usize, seed: u64) -> [Vec<f64>; 5] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut even = || -> Vec<f64> {
            (0..runs)
                .map(|_| 2.0 * random.random::<f64>() - 1.0)
                .collect()
        };
        let [a, b, c, d] = [(); 4].map(|()| even());
        let y = (0..runs).map(|n| 3.0 * a[n] + 2.0 * b[n] + c[n] * b[n]);
        let y = y.collect();
        [a, b, c, d, y]
    }

    #[test]
    fn shares_are_those_of_the_closed_form() {
        let [a, b, c, d, y] = drawn(4000, 1);
        let whole = 9.0 + 4.0 + 1.0 / 3.0;
        for (factor, expected) in [(a, 9.0 / whole), (b, 4.0 / whole), (c, 0.0), (d, 0.0)] {
            let found = share(&y, &bins(&factor), 3).unwrap();
            assert!(
                (found.value - expected).abs() < 0.03,
                "{found:?} {expected}"
            );
            assert!(found.band[0] <= found.value && found.value <= found.band[1]);
        }
    }

    #[test]
    fn a_factor_that_does_nothing_reads_0() {
        let nothing = (0..100).filter(|&seed| {
            let [_, _, _, d, y] = drawn(60, seed);
            share(&y, &bins(&d), seed).unwrap().value == 0.0
        });
        assert!(nothing.count() >= 96);
    }

    #[test]
    fn groups_as_many_as_runs_say_nothing() {
        let values = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(share(&values, &[0, 1, 2, 3], 1), None);
        assert_eq!(share(&[1.0; 6], &[0, 0, 0, 1, 1, 1], 1), None);
    }

    #[test]
    fn bins_have_equal_counts_and_keep_equal_numbers_together() {
        let numbers: Vec<f64> = (0..400).map(|n| f64::from((n * 7) % 400)).collect();
        let groups = bins(&numbers);
        for bin in 0..10 {
            assert_eq!(groups.iter().filter(|own| **own == bin).count(), 40);
        }
        let groups = bins(&[1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0]);
        assert!(groups[..5].iter().all(|own| *own == groups[0]));
        assert!(groups[6] > groups[0]);
    }
}
