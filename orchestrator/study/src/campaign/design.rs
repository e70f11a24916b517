//! Designs: where in the space of the factors the runs lie.

use clap::ValueEnum;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// How a study fills the space of its factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Design {
    /// Every combination of the lists.
    Full,
    /// Every factor's range in as many equal parts as there are runs, one run in each.
    LatinHypercube,
    /// Owen-scrambled Sobol' sequence (Burley 2020): more runs go on where fewer ended.
    Sobol,
    /// Independent draws: more runs go on where fewer ended.
    Random,
    /// Pairs of Sobol' points with one factor exchanged at a time, for Sobol' indices
    /// (Saltelli et al. 2010): N (k + 2) runs for k factors.
    Saltelli,
}

/// Longest Sobol' sequence of the library.
const LONGEST_SOBOL: u64 = 1 << 16;
/// Most dimensions of the library's sequence.
const MOST_DIMENSIONS: usize = 256;

/// Most runs of a study.
const MOST_RUNS: u64 = 1_000_000_000;

/// Why a design does not fit the factors of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DesignError {
    /// Every combination of what is drawn.
    #[error(
        "`full` takes every combination of lists; expected design = \"sobol\" with `runs`, or {{ range = [..], \
         steps = N }} instead of a distribution"
    )]
    NotLists,
    /// A number of runs for every combination.
    #[error("`runs` belongs to the sampled designs; `full` takes every combination")]
    RunsOfFull,
    /// No number of runs.
    #[error("`runs` is missing, such as runs = 64")]
    NoRuns,
    /// No runs.
    #[error("runs = 0; expected 1 or more")]
    Zero,
    /// Too many runs.
    #[error("{0} runs; expected at most {MOST_RUNS}")]
    TooMany(u64),
    /// More than the sequence has.
    #[error(
        "{points} points in {dimensions} dimensions; this sequence has at most {LONGEST_SOBOL} in \
         {MOST_DIMENSIONS}; expected design = \"latin-hypercube\" or \"random\""
    )]
    Sequence {
        /// Points that are needed.
        points: u64,
        /// Dimensions that are needed.
        dimensions: usize,
    },
}

/// The points of a design.
#[derive(Debug, Clone)]
pub struct Points {
    design: Design,
    /// Values of each factor where it is a list.
    counts: Vec<Option<usize>>,
    runs: u64,
    seed: u64,
    /// Of a Latin hypercube, the coordinates of each factor.
    drawn: Vec<Vec<f64>>,
}

impl Points {
    /// The points for factors of which each is a list of so many values or drawn; `runs` as the study
    /// gives them.
    ///
    /// # Errors
    /// A design that does not fit the factors, or runs that are missing or too many.
    pub fn new(
        design: Design,
        counts: Vec<Option<usize>>,
        runs: Option<u64>,
        seed: u64,
    ) -> Result<Self, DesignError> {
        let runs = match (design, runs) {
            (Design::Full, None) => counts
                .iter()
                .try_fold(1_u64, |all, count| all.checked_mul((*count)? as u64))
                .ok_or(DesignError::NotLists)?,
            (Design::Full, Some(_)) => return Err(DesignError::RunsOfFull),
            (_, None) => return Err(DesignError::NoRuns),
            (_, Some(0)) => return Err(DesignError::Zero),
            (Design::Saltelli, Some(runs)) => runs.saturating_mul(counts.len() as u64 + 2),
            (_, Some(runs)) => runs,
        };
        if runs > MOST_RUNS {
            return Err(DesignError::TooMany(runs));
        }
        let dimensions = match design {
            Design::Saltelli => 2 * counts.len(),
            _ => counts.len(),
        };
        if matches!(design, Design::Sobol | Design::Saltelli) {
            let points = match design {
                Design::Saltelli => runs / (counts.len() as u64 + 2),
                _ => runs,
            };
            if points > LONGEST_SOBOL || dimensions > MOST_DIMENSIONS {
                return Err(DesignError::Sequence { points, dimensions });
            }
        }
        let mut drawn = Vec::new();
        if design == Design::LatinHypercube {
            drawn = (0..counts.len())
                .map(|factor| stratified(runs, seed, factor))
                .collect();
        }
        Ok(Self {
            design,
            counts,
            runs,
            seed,
            drawn,
        })
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.runs
    }

    /// The coordinates of a point, one a factor, from 0 on and below 1.
    #[must_use]
    pub fn at(&self, number: u64) -> Vec<f64> {
        let factors = self.counts.len();
        match self.design {
            Design::Full => {
                // The last factor changes first.
                let mut rest = number;
                let mut point = vec![0.0; factors];
                for (at, count) in point.iter_mut().zip(&self.counts).rev() {
                    let count = count.unwrap_or(1) as u64;
                    *at = ((rest % count) as f64 + 0.5) / count as f64;
                    rest /= count;
                }
                point
            }
            Design::LatinHypercube => self.drawn.iter().map(|own| own[number as usize]).collect(),
            Design::Sobol => (0..factors)
                .map(|factor| self.sobol(number, factor))
                .collect(),
            Design::Random => (0..factors)
                .map(|factor| {
                    let mut random = stream(self.seed, factor);
                    random.set_word_pos(2 * u128::from(number));
                    random.random::<f64>()
                })
                .collect(),
            Design::Saltelli => {
                let block = factors as u64 + 2;
                let (sample, place) = (number / block, (number % block) as usize);
                // A, then A with each factor of B in turn, then B.
                (0..factors)
                    .map(|factor| {
                        let of_second = place == factors + 1 || place == factor + 1;
                        self.sobol(sample, factor + if of_second { factors } else { 0 })
                    })
                    .collect()
            }
        }
    }

    fn sobol(&self, number: u64, dimension: usize) -> f64 {
        let seed = (self.seed ^ (self.seed >> 32)) as u32;
        f64::from(sobol_burley::sample(number as u32, dimension as u32, seed))
    }
}

/// A factor's coordinates of a Latin hypercube: one in each of `runs` equal parts, in a random order
/// (McKay, Beckman and Conover 1979).
fn stratified(runs: u64, seed: u64, factor: usize) -> Vec<f64> {
    let mut random = stream(seed, factor);
    let mut parts: Vec<f64> = (0..runs)
        .map(|part| (part as f64 + random.random::<f64>()) / runs as f64)
        .collect();
    parts.shuffle(&mut random);
    parts
}

/// Random numbers of a factor.
fn stream(seed: u64, factor: usize) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(factor as u64);
    random
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(design: Design, counts: Vec<Option<usize>>, runs: Option<u64>) -> Vec<Vec<f64>> {
        let points = Points::new(design, counts, runs, 7).unwrap();
        (0..points.count()).map(|n| points.at(n)).collect()
    }

    #[test]
    fn full_has_every_combination_once() {
        let all = points(Design::Full, vec![Some(2), Some(3)], None);
        let places: Vec<(usize, usize)> = all
            .iter()
            .map(|p| ((p[0] * 2.0) as usize, (p[1] * 3.0) as usize))
            .collect();
        assert_eq!(places, [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]);
    }

    #[test]
    fn a_latin_hypercube_has_one_run_in_each_part_of_each_factor() {
        let all = points(Design::LatinHypercube, vec![None; 3], Some(50));
        for factor in 0..3 {
            let mut parts: Vec<usize> = all.iter().map(|p| (p[factor] * 50.0) as usize).collect();
            assert_ne!(parts, (0..50).collect::<Vec<_>>());
            parts.sort_unstable();
            assert_eq!(parts, (0..50).collect::<Vec<_>>());
        }
    }

    /// The product of `|4 x - 2|` over three factors has the integral 1: the error of a Sobol' sequence
    /// of 4096 points is far below that of independent draws, `sqrt((4/3)^3 - 1) / 64 = 0.018`.
    #[test]
    fn sobol_points_integrate_better_than_chance() {
        let mean = |design| {
            let all = points(design, vec![None; 3], Some(4096));
            let sum: f64 = all
                .iter()
                .map(|p| p.iter().map(|x| (4.0 * x - 2.0).abs()).product::<f64>())
                .sum();
            sum / 4096.0 - 1.0
        };
        assert!(mean(Design::Sobol).abs() < 1e-3);
        assert!(mean(Design::Random).abs() < 0.06);
    }

    #[test]
    fn more_points_go_on_where_fewer_ended() {
        for design in [Design::Sobol, Design::Random, Design::Saltelli] {
            let few = points(design, vec![None; 4], Some(20));
            let many = points(design, vec![None; 4], Some(40));
            assert_eq!(few, many[..few.len()], "{design:?}");
        }
    }

    #[test]
    fn pairs_for_indices_exchange_one_factor_at_a_time() {
        let all = points(Design::Saltelli, vec![None; 3], Some(8));
        assert_eq!(all.len(), 40);
        for block in all.chunks(5) {
            for factor in 0..3 {
                for other in 0..3 {
                    let from = if factor == other { 4 } else { 0 };
                    assert_eq!(block[factor + 1][other], block[from][other]);
                }
            }
            assert_ne!(block[0], block[4]);
        }
    }

    #[test]
    fn designs_that_do_not_fit_are_refused() {
        let error = |design, counts: &[Option<usize>], runs| {
            Points::new(design, counts.to_vec(), runs, 1)
                .unwrap_err()
                .to_string()
        };
        assert!(error(Design::Full, &[Some(2), None], None).contains("steps"));
        assert!(error(Design::Full, &[Some(2)], Some(5)).contains("sampled designs"));
        assert!(error(Design::Sobol, &[None], None).contains("runs = 64"));
        assert!(error(Design::Sobol, &[None], Some(0)).contains("1 or more"));
        assert!(error(Design::Sobol, &[None], Some(100_000)).contains("latin-hypercube"));
    }
}
