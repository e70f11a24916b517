//! Probit regression of a yes or no on one number, by maximum likelihood.
//!
//! `P(yes | x) = Φ(a + b (x - m))` with `m` the mean of the `x`, by Fisher's scoring (McCullagh and
//! Nelder, Generalized Linear Models, 2nd ed., section 4.4). The maximum exists where the two kinds
//! overlap, which the caller has seen to.

use nalgebra::{Matrix2, Vector2};
use statrs::distribution::{Continuous, ContinuousCDF, Normal, StudentsT};

/// Steps of the iteration; it takes about eight.
const STEPS: usize = 100;
/// Beyond this many deviations the distribution function is not a number.
const FARTHEST: f64 = 37.0;

/// A fit with what is known of its certainty.
#[derive(Debug, Clone)]
pub(super) struct Probit {
    /// Mean of the numbers.
    pub middle: f64,
    /// `a` and `b`.
    pub coefficients: Vector2<f64>,
    /// Their covariance.
    pub covariance: Matrix2<f64>,
    /// Deviations from the estimate to the ends of a 95 % interval.
    pub reach: f64,
    /// Twice the logarithm of the likelihood's gain over `b = 0`.
    pub gain: f64,
}

impl Probit {
    /// The fit of `yes` on `x`. With `cluster`, which numbers clusters from 0, observations are
    /// independent between clusters alone: covariance of Liang and Zeger (Biometrika 73, 1986) times
    /// `G / (G - 1)`, and Student's distribution with `G - 1` degrees of freedom. None without a
    /// maximum.
    pub fn fit(x: &[f64], yes: &[bool], cluster: Option<(&[usize], usize)>) -> Option<Self> {
        let normal = Normal::standard();
        let middle = x.iter().sum::<f64>() / x.len() as f64;
        let places: Vec<f64> = x.iter().map(|x| x - middle).collect();
        let likelihood = |at: Vector2<f64>| -> f64 {
            let terms = places.iter().zip(yes).map(|(x, yes)| {
                let eta = (at[0] + at[1] * x).clamp(-FARTHEST, FARTHEST);
                normal.cdf(if *yes { eta } else { -eta }).ln()
            });
            terms.sum()
        };
        // Score and information of one observation, without its regressors.
        let parts = |at: Vector2<f64>, x: f64, yes: bool| {
            let eta = (at[0] + at[1] * x).clamp(-FARTHEST, FARTHEST);
            let [below, above] = [normal.cdf(eta), normal.cdf(-eta)];
            let density = normal.pdf(eta);
            let score = if yes {
                density / below
            } else {
                -density / above
            };
            (score, density / below * (density / above))
        };
        let share = yes.iter().filter(|yes| **yes).count() as f64 / yes.len() as f64;
        let flat = Vector2::new(normal.inverse_cdf(share), 0.0);
        let mut at = flat;
        let mut best = likelihood(at);
        let mut information = Matrix2::zeros();
        let mut converged = false;
        for _ in 0..STEPS {
            let mut score = Vector2::zeros();
            information = Matrix2::zeros();
            for (&x, &yes) in places.iter().zip(yes) {
                let (own, weight) = parts(at, x, yes);
                score += own * Vector2::new(1.0, x);
                information += weight * Matrix2::new(1.0, x, x, x * x);
            }
            let mut step = information.cholesky()?.solve(&score);
            let rise = score.dot(&step);
            // The last digits of the likelihood say nothing: a small step is taken as it is.
            while rise > 1e-9 && likelihood(at + step) < best && step.norm() > 1e-12 {
                step *= 0.5;
            }
            at += step;
            best = likelihood(at);
            if rise < 1e-18 * (1.0 + best.abs()) {
                converged = true;
                break;
            }
        }
        let model = information.try_inverse()?;
        let (covariance, reach) = match cluster {
            None => (model, normal.inverse_cdf(0.975)),
            Some((clusters, count)) => {
                let mut scores = vec![Vector2::zeros(); count];
                for ((&x, &yes), &own) in places.iter().zip(yes).zip(clusters) {
                    scores[own] += parts(at, x, yes).0 * Vector2::new(1.0, x);
                }
                let spread: Matrix2<f64> = scores.iter().map(|s| s * s.transpose()).sum();
                let free = count as f64 - 1.0;
                let student = StudentsT::new(0.0, 1.0, free).ok()?;
                let covariance = model * spread * model * (count as f64 / free);
                (covariance, student.inverse_cdf(0.975))
            }
        };
        let is_sound = converged && at.iter().chain(covariance.iter()).all(|v| v.is_finite());
        is_sound.then(|| Self {
            middle,
            coefficients: at,
            covariance,
            reach,
            gain: 2.0 * (best - likelihood(flat)),
        })
    }

    /// The probability at `x` with its 95 % interval, made where the probit is normal.
    pub fn at(&self, x: f64) -> [f64; 3] {
        let row = Vector2::new(1.0, x - self.middle);
        let eta = row.dot(&self.coefficients);
        let reach = self.reach * (row.dot(&(self.covariance * row))).max(0.0).sqrt();
        [eta, eta - reach, eta + reach].map(|eta| Normal::standard().cdf(eta))
    }

    /// The `x` at which half say yes, and its 95 % interval (delta method).
    pub fn half(&self) -> [f64; 3] {
        let [a, b] = [self.coefficients[0], self.coefficients[1]];
        let gradient = Vector2::new(-1.0 / b, a / (b * b));
        let reach = self.reach * gradient.dot(&(self.covariance * gradient)).max(0.0).sqrt();
        let middle = self.middle - a / b;
        [middle, middle - reach, middle + reach]
    }

    /// The deviation `1 / b`, and its 95 % interval (delta method on its logarithm).
    pub fn deviation(&self) -> [f64; 3] {
        let b = self.coefficients[1];
        let reach = (self.reach * self.covariance[(1, 1)].max(0.0).sqrt() / b).exp();
        [1.0 / b, 1.0 / (b * reach), reach / b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const YES: [u8; 20] = [0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 1, 0, 1, 1, 1, 1, 1];

    fn twenty() -> (Vec<f64>, Vec<bool>) {
        let x = (0..20).map(|n| (0.1 + 0.05 * f64::from(n)).ln()).collect();
        (x, YES.map(|yes| yes == 1).to_vec())
    }

    fn near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
    }

    /// statsmodels 0.15.0: `GLM(y, add_constant(log(im)), Binomial(Probit())).fit(tol=1e-14)`, with
    /// `params`, `llf`, `llnull` and `cov_params()`; intervals by `scipy.stats.norm`.
    #[test]
    fn as_statsmodels_fits_it() {
        let (x, yes) = twenty();
        let fit = Probit::fit(&x, &yes, None).unwrap();
        let half = fit.half().map(f64::exp);
        near(half[0], 0.516_585_687_697_172_3);
        near(half[1], 0.354_021_478_096_597_8);
        near(half[2], 0.753_798_255_880_806);
        near(fit.deviation()[0], 0.570_566_879_931_278_1);
        near(
            fit.gain,
            2.0 * (13.862_943_611_198_906 - 9.483_372_732_170_704),
        );
        let found = fit.at(0.4_f64.ln());
        near(found[0], 0.326_973_727_851_520_85);
        near(found[1], 0.102_402_660_696_732_93);
        near(found[2], 0.644_833_601_275_556_7);
    }

    /// statsmodels 0.15.0: `GEE(y, X, groups=arange(20) % 5, family=Binomial(Probit()),
    /// cov_struct=Independence()).fit(cov_type='robust')`; its covariance times 5/4, with
    /// `scipy.stats.t.ppf(0.975, 4)`.
    #[test]
    fn clusters_as_statsmodels_takes_them() {
        let (x, yes) = twenty();
        let clusters: Vec<usize> = (0..20).map(|n| n % 5).collect();
        let fit = Probit::fit(&x, &yes, Some((&clusters, 5))).unwrap();
        let found = fit.at(0.4_f64.ln());
        near(found[1], 0.070_652_020_531_261_07);
        near(found[2], 0.717_145_341_518_483_9);
    }

    /// With two places the model holds as many numbers as the data: the shares are met.
    #[test]
    fn two_places_are_met() {
        let x: Vec<f64> = (0..20).map(|n| f64::from(n / 10)).collect();
        let yes: Vec<bool> = (0..20).map(|n| n < 2 || (10..17).contains(&n)).collect();
        let fit = Probit::fit(&x, &yes, None).unwrap();
        near(fit.at(0.0)[0], 0.2);
        near(fit.at(1.0)[0], 0.7);
    }
}
