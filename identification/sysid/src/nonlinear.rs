//! Least squares of whitened residuals, with bounds, priors and derivatives by differences.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::levenberg_marquardt::{self, Problem, Quadratic, Search, Taken, is_held};

/// Residuals of unit variance as a function of the parameters; `None` where there is no model.
pub trait Residuals: Sync {
    /// The residuals at `values`.
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>>;

    /// What is known beforehand, as residuals of unit variance: each parameter's difference from what is expected of
    /// it over its standard deviation.
    fn priors(&self, _values: &[f64]) -> Vec<f64> {
        Vec::new()
    }

    /// Whether a step is computed as if there were no bounds and ends at them. If not, parameters that a bound holds
    /// are left out of it, and the others go to their best values beside them.
    fn ignores_bounds(&self) -> bool {
        false
    }
}

/// One parameter of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Where the search starts.
    pub start: f64,
    /// A change that is small and shows.
    pub scale: f64,
    /// Whether it is fitted.
    pub free: bool,
    /// Least and largest value.
    pub bounds: (f64, f64),
}

/// Where a fit ended.
#[derive(Debug, Clone)]
pub struct Optimum {
    /// All parameters.
    pub values: Vec<f64>,
    /// Covariance of all parameters for residuals of unit variance; zero rows for held ones.
    pub covariance: DMatrix<f64>,
    /// Half the sum of squares.
    pub cost: f64,
    /// Number of residuals.
    pub residuals: usize,
    /// Whether further steps would move it by less than a tenth of the standard errors.
    pub converged: bool,
}

/// Largest number of iterations.
const ITERATIONS: usize = 60;

fn cost(residuals: &[f64]) -> f64 {
    0.5 * residuals.iter().map(|r| r * r).sum::<f64>()
}

/// How much work a fit takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Most iterations.
    pub iterations: usize,
    /// It ends with an iteration that lowers the cost by less than this part of it.
    pub part: f64,
    /// Where its derivatives come from.
    pub derivatives: Derivatives,
}

/// Where the derivatives of an iteration come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Derivatives {
    /// They are taken in each.
    Taken,
    /// They are carried from the one before by what the residuals did (Broyden, Mathematics of Computation 19,
    /// 1965), as long as steps keep most of their promises. A fit does not end with carried ones.
    Carried,
    /// The same, and it may end with them.
    Trusted,
}

/// The best there is.
pub const WHOLE: Effort = Effort {
    iterations: ITERATIONS,
    part: 0.0,
    derivatives: Derivatives::Taken,
};

/// Gain of a step, in the logarithm of the likelihood, below which a fit is over.
const STILL: f64 = 0.005;
/// Share of the promised gain below which a step says that derivatives are too old.
const KEPT: f64 = 0.5;

/// Parameters with their residuals and half the sum of their squares.
struct Place {
    values: Vec<f64>,
    residuals: Vec<f64>,
    cost: f64,
}

/// A fit with its derivatives in units of the coordinates' scales.
struct Fit<'a, M> {
    model: &'a M,
    coordinates: &'a [Coordinate],
    free: Vec<usize>,
    effort: Effort,
    jacobian: DMatrix<f64>,
    information: DMatrix<f64>,
}

impl<M: Residuals> Fit<'_, M> {
    fn all(&self, values: &[f64]) -> Option<Vec<f64>> {
        let mut all = self.model.residuals(values)?;
        all.extend(self.model.priors(values));
        Some(all)
    }

    fn at(&self, values: Vec<f64>) -> Option<Place> {
        let residuals = self.all(&values)?;
        Some(Place {
            cost: cost(&residuals),
            values,
            residuals,
        })
    }

    fn jacobian(&self, at: &Place) -> Option<DMatrix<f64>> {
        const CHANGE: f64 = 1e-5;
        let columns: Option<Vec<Vec<f64>>> = self
            .free
            .par_iter()
            .map(|&i| {
                let coordinate = &self.coordinates[i];
                let sign = if at.values[i] + CHANGE * coordinate.scale > coordinate.bounds.1 {
                    -1.0
                } else {
                    1.0
                };
                let mut moved = at.values.clone();
                moved[i] += sign * CHANGE * coordinate.scale;
                let there = self.all(&moved)?;
                let slope = sign / CHANGE;
                Some(
                    there
                        .iter()
                        .zip(&at.residuals)
                        .map(|(a, b)| (a - b) * slope)
                        .collect(),
                )
            })
            .collect();
        let columns = columns?;
        Some(DMatrix::from_fn(
            at.residuals.len(),
            self.free.len(),
            |i, j| columns[j][i],
        ))
    }

    /// Covariance of all coordinates from the information about the free ones.
    fn covariance(&self, information: DMatrix<f64>) -> DMatrix<f64> {
        let count = self.coordinates.len();
        let mut covariance = DMatrix::zeros(count, count);
        let eigen = information.symmetric_eigen();
        let floor = 1e-14 * eigen.eigenvalues.max();
        for (k, &value) in eigen.eigenvalues.iter().enumerate() {
            let vector = eigen.eigenvectors.column(k);
            for (row, &i) in self.free.iter().enumerate() {
                for (column, &j) in self.free.iter().enumerate() {
                    covariance[(i, j)] += vector[row] * vector[column] / value.max(floor)
                        * self.coordinates[i].scale
                        * self.coordinates[j].scale;
                }
            }
        }
        covariance
    }
}

impl<M: Residuals> Problem for Fit<'_, M> {
    type Place = Place;
    type Error = ();

    fn cost(&self, place: &Place) -> f64 {
        place.cost
    }

    fn expand(&mut self, place: &Place, is_carried: bool) -> Result<Quadratic, ()> {
        if !is_carried {
            self.jacobian = self.jacobian(place).ok_or(())?;
            self.information = self.jacobian.tr_mul(&self.jacobian);
        }
        let uphill = self
            .jacobian
            .tr_mul(&DVector::from_column_slice(&place.residuals));
        let mut quadratic = Quadratic::new(self.information.clone(), -uphill);
        let downhill = &quadratic.downhill;
        quadratic.active.retain(|&row| {
            let i = self.free[row];
            let bounds = self.coordinates[i].bounds;
            self.model.ignores_bounds() || !is_held(place.values[i], bounds, downhill[row])
        });
        Ok(quadratic)
    }

    fn step(&self, quadratic: &Quadratic, damping: f64) -> Option<DVector<f64>> {
        quadratic.step(damping, 1e-12)
    }

    fn moved(&mut self, place: &Place, step: &DVector<f64>) -> Option<Place> {
        let mut values = place.values.clone();
        for (&i, by) in self.free.iter().zip(step.iter()) {
            let Coordinate { scale, bounds, .. } = self.coordinates[i];
            values[i] = (values[i] + by * scale).clamp(bounds.0, bounds.1);
        }
        self.at(values)
    }

    fn has_settled(&self, taken: &Taken<'_, Place>) -> bool {
        taken.gain < (self.effort.part * taken.place.cost).max(STILL)
    }

    fn carry(&mut self, quadratic: &Quadratic, from: &Place, taken: &Taken<'_, Place>) -> bool {
        if self.effort.derivatives == Derivatives::Taken {
            return false;
        }
        let to = taken.place;
        let by = |&i: &usize| (to.values[i] - from.values[i]) / self.coordinates[i].scale;
        let step = DVector::from_iterator(self.free.len(), self.free.iter().map(by));
        let promised = quadratic.downhill.dot(&step) - 0.5 * (&self.information * &step).dot(&step);
        let square = step.norm_squared();
        if taken.gain <= KEPT * promised {
            return false;
        }
        if square > 0.0 {
            let mut missed = DVector::from_column_slice(&to.residuals)
                - DVector::from_column_slice(&from.residuals);
            missed.gemv(-1.0, &self.jacobian, &step, 1.0);
            missed /= square;
            let along = self.jacobian.tr_mul(&missed);
            self.information += &along * step.transpose() + &step * along.transpose();
            self.information += &step * step.transpose() * missed.norm_squared();
            self.jacobian.ger(1.0, &missed, &step, 1.0);
        }
        true
    }
}

/// Minimises half the sum of squares over the free coordinates; `None` where the start value gives
/// no model.
pub fn minimise(model: &impl Residuals, coordinates: &[Coordinate]) -> Option<Optimum> {
    minimise_with(model, coordinates, WHOLE)
}

/// As [`minimise`], with no more than an effort.
pub fn minimise_with(
    model: &impl Residuals,
    coordinates: &[Coordinate],
    effort: Effort,
) -> Option<Optimum> {
    let places = 0..coordinates.len();
    let mut fit = Fit {
        model,
        coordinates,
        free: places.filter(|&i| coordinates[i].free).collect(),
        effort,
        jacobian: DMatrix::zeros(0, 0),
        information: DMatrix::zeros(0, 0),
    };
    let start = fit.at(coordinates.iter().map(|c| c.start).collect())?;
    let search = Search {
        lowered: |damping| (0.2 * damping).max(1e-9),
        raised: |damping| (5.0 * damping).max(1e-6),
        trusts_carried: effort.derivatives == Derivatives::Trusted,
        iterations: effort.iterations,
        ..Search::default()
    };
    let found = levenberg_marquardt::minimise(&mut fit, start, &search).ok()?;
    let none = || DMatrix::zeros(fit.free.len(), fit.free.len());
    Some(Optimum {
        covariance: fit.covariance(found.information.unwrap_or_else(none)),
        residuals: found.place.residuals.len(),
        cost: found.place.cost,
        converged: found.has_converged,
        values: found.place.values,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Of<F>(F, Option<(f64, f64)>);

    impl<F: Fn(&[f64]) -> Vec<f64> + Sync> Residuals for Of<F> {
        fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
            Some((self.0)(values))
        }

        /// An expected value of the first parameter with its deviation.
        fn priors(&self, values: &[f64]) -> Vec<f64> {
            let own = self.1.iter();
            own.map(|(expected, deviation)| (values[0] - expected) / deviation)
                .collect()
        }
    }

    fn free(start: f64) -> Coordinate {
        Coordinate {
            start,
            scale: 1.0,
            free: true,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    fn is_near(value: f64, expected: f64) {
        assert!((value - expected).abs() < 1e-5, "{value} for {expected}");
    }

    #[test]
    fn the_valley_of_rosenbrock_is_followed_to_its_end() {
        let valley = |x: &[f64]| vec![100.0 * (x[1] - x[0] * x[0]), 10.0 * (1.0 - x[0])];
        for derivatives in [Derivatives::Taken, Derivatives::Carried] {
            let effort = Effort {
                derivatives,
                ..WHOLE
            };
            let start = [free(-1.2), free(1.0)];
            let found = minimise_with(&Of(valley, None), &start, effort).unwrap();
            assert!(found.converged && found.cost < 1e-4, "{found:?}");
            let off = (found.values[0] - 1.0, found.values[1] - 1.0);
            assert!(off.0.abs() < 1e-3 && off.1.abs() < 2e-3, "{off:?}");
            // J'J of (100 (y - x^2), 10 (1 - x)) at (1, 1) has the inverse ((1, 2), (2, 4.01)) / 100.
            let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|at| 100.0 * found.covariance[at]);
            assert!((xx - 1.0).abs() < 0.02 && (xy - 2.0).abs() < 0.04 && (yy - 4.01).abs() < 0.08);
        }
    }

    #[test]
    fn the_rest_is_fitted_where_a_bound_holds_a_parameter() {
        // Without the bound (3, 2); with the first at most 2, the second is 5 - 2.
        let plane = |x: &[f64]| vec![100.0 * (x[0] - 3.0), 100.0 * (x[0] + x[1] - 5.0)];
        for start in [-1.0, 2.0] {
            let mut bounded = free(start);
            bounded.bounds.1 = 2.0;
            let found = minimise(&Of(plane, None), &[bounded, free(0.0)]).unwrap();
            assert!(found.converged);
            is_near(found.values[0], 2.0);
            is_near(found.values[1], 3.0);
            is_near(found.cost, 0.5 * 100.0 * 100.0);
        }
        // A bound that only the start is at lets go.
        let mut bounded = free(-1.0);
        bounded.bounds.0 = -1.0;
        let found = minimise(&Of(plane, None), &[bounded, free(0.0)]).unwrap();
        is_near(found.values[0], 3.0);
        is_near(found.values[1], 2.0);
    }

    #[test]
    fn a_prior_pulls_by_its_share_of_the_information() {
        // Measured 5 +- 0.01, expected 1 +- 0.02: the mean by information, four to one.
        let measured = |x: &[f64]| vec![(x[0] - 5.0) / 0.01];
        let found = minimise(&Of(measured, Some((1.0, 0.02))), &[free(0.0)]).unwrap();
        is_near(found.values[0], (4.0 * 5.0 + 1.0) / 5.0);
        is_near(found.covariance[(0, 0)], 1.0 / (1e4 + 2.5e3));
        assert_eq!(found.residuals, 2);
    }

    #[test]
    fn what_only_a_sum_shows_stays_where_it_was_across_it() {
        // Only x + y is measured: the least step from (1, 0) goes along (1, 1).
        let sum = |x: &[f64]| vec![100.0 * (x[0] + x[1] - 4.0), 100.0 * (x[2] - 1.0)];
        let found = minimise(&Of(sum, None), &[free(1.0), free(0.0), free(0.0)]).unwrap();
        is_near(found.values[0] + found.values[1], 4.0);
        is_near(found.values[0] - found.values[1], 1.0);
        is_near(found.values[2], 1.0);
        assert!(found.covariance[(0, 0)] > 1e3 * found.covariance[(2, 2)]);
        // A held parameter keeps its value, and has no variance.
        let held = Coordinate {
            free: false,
            ..free(0.0)
        };
        let found = minimise(&Of(sum, None), &[free(1.0), held, free(0.0)]).unwrap();
        is_near(found.values[0], 4.0);
        assert_eq!((found.values[1], found.covariance[(1, 1)]), (0.0, 0.0));
    }
}
