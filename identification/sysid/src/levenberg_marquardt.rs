//! Levenberg's and Marquardt's method: the one loop with which models are fitted.
//!
//! A [`Problem`] expands its cost at a place to second order: information `H` and downhill gradient `g`. A step
//! solves `(H + damping diag H) s = g` over the coordinates that may move. The damping is a trust region: it rises
//! until a step lowers the cost, and falls after that (Levenberg, Quarterly of Applied Mathematics 2, 1944;
//! Marquardt, SIAM Journal 11, 1963). Derivatives may be carried from one place to the next instead of computed
//! again (Broyden, Mathematics of Computation 19, 1965); a fit is over only where derivatives of the place itself
//! agree.

use std::time::Instant;

use nalgebra::{DMatrix, DVector};

/// A cost to second order about a place.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// Second derivatives of the cost, about.
    pub information: DMatrix<f64>,
    /// The negative gradient.
    pub downhill: DVector<f64>,
    /// Coordinates that may move; those at a bound that want beyond are not among them.
    pub active: Vec<usize>,
}

impl Quadratic {
    /// One in which every coordinate may move.
    pub fn new(information: DMatrix<f64>, downhill: DVector<f64>) -> Self {
        Self {
            active: (0..downhill.len()).collect(),
            information,
            downhill,
        }
    }

    /// The damped step, with `ridge` added to the diagonal; none where the information is not positive definite.
    pub fn step(&self, damping: f64, ridge: f64) -> Option<DVector<f64>> {
        let rows = self.information.select_rows(&self.active);
        let mut own = rows.select_columns(&self.active);
        for i in 0..self.active.len() {
            own[(i, i)] *= 1.0 + damping;
            own[(i, i)] += ridge;
        }
        let solved = own
            .cholesky()?
            .solve(&self.downhill.select_rows(&self.active));
        let mut step = DVector::zeros(self.downhill.len());
        for (&i, value) in self.active.iter().zip(solved.iter()) {
            step[i] = *value;
        }
        step.iter().all(|s| s.is_finite()).then_some(step)
    }
}

/// Whether a bound keeps a coordinate at `value` from going `downhill`.
pub fn is_held(value: f64, (low, high): (f64, f64), downhill: f64) -> bool {
    (value <= low && downhill < 0.0) || (value >= high && downhill > 0.0)
}

/// A step that was taken.
pub struct Taken<'a, P> {
    /// Where it ended.
    pub place: &'a P,
    /// By how much it lowered the cost.
    pub gain: f64,
    /// `g' s`: twice what an undamped step would gain of a quadratic cost.
    pub promise: f64,
}

/// What is minimised.
pub trait Problem {
    /// Values of the parameters with all that is computed there.
    type Place;
    /// Why a cost cannot be expanded.
    type Error;

    /// The cost at a place.
    fn cost(&self, place: &Self::Place) -> f64;

    /// The cost to second order about `place`, with the derivatives that were carried there if `is_carried`.
    ///
    /// # Errors
    /// A place from which a small change leads to no model, so that there are no derivatives.
    fn expand(&mut self, place: &Self::Place, is_carried: bool) -> Result<Quadratic, Self::Error>;

    /// The damped step, within what the problem allows.
    fn step(&self, quadratic: &Quadratic, damping: f64) -> Option<DVector<f64>> {
        quadratic.step(damping, 0.0)
    }

    /// Coordinates that `step` would move and a bound keeps in place: the step is computed again without them.
    fn stuck(&self, _place: &Self::Place, _step: &DVector<f64>) -> Vec<usize> {
        Vec::new()
    }

    /// `place` moved by `step`, within bounds; none where there is no model.
    fn moved(&mut self, place: &Self::Place, step: &DVector<f64>) -> Option<Self::Place>;

    /// Whether a step that was taken is so small that the next ones do not matter.
    fn has_settled(&self, taken: &Taken<'_, Self::Place>) -> bool;

    /// Carries derivatives over a step that was taken; false where they are better computed again.
    fn carry(
        &mut self,
        _quadratic: &Quadratic,
        _from: &Self::Place,
        _taken: &Taken<'_, Self::Place>,
    ) -> bool {
        false
    }
}

/// How steps are damped, and when to give up.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Damping of the first step.
    pub first: f64,
    /// The damping after a step was taken.
    pub lowered: fn(f64) -> f64,
    /// The damping after one was refused.
    pub raised: fn(f64) -> f64,
    /// Damping at which nothing more is tried.
    pub most: f64,
    /// Steps that are tried with fresh derivatives, and with carried ones.
    pub tries: [usize; 2],
    /// A step that promises less than this is not shortened.
    pub pointless: f64,
    /// Whether a fit may end with carried derivatives.
    pub trusts_carried: bool,
    /// Share of an iteration for which one with carried derivatives counts.
    pub carried_counts: f64,
    /// Most iterations.
    pub iterations: usize,
    /// Time at which the search ends where it is.
    pub until: Option<Instant>,
}

impl Default for Search {
    fn default() -> Self {
        Self {
            first: 1e-3,
            lowered: |damping| (0.1 * damping).max(1e-9),
            raised: |damping| (10.0 * damping).max(1e-6),
            most: f64::INFINITY,
            tries: [10, 1],
            pointless: 0.0,
            trusts_carried: false,
            carried_counts: 1.0,
            iterations: 60,
            until: None,
        }
    }
}

/// Where a search ended.
#[derive(Debug, Clone)]
pub struct Minimum<P> {
    /// The place of the lowest cost.
    pub place: P,
    /// The information of the last iteration; none without one.
    pub information: Option<DMatrix<f64>>,
    /// Iterations used.
    pub iterations: usize,
    /// Whether further steps do not matter.
    pub has_converged: bool,
}

/// Goes downhill from `start`.
///
/// # Errors
/// The error of [`Problem::expand`] at a place that the search reaches.
pub fn minimise<P: Problem>(
    problem: &mut P,
    start: P::Place,
    search: &Search,
) -> Result<Minimum<P::Place>, P::Error> {
    let mut found = Minimum {
        place: start,
        information: None,
        iterations: 0,
        has_converged: false,
    };
    let mut damping = search.first;
    let mut is_carried = false;
    let mut left = search.iterations as f64;
    while left > 0.0
        && !found.has_converged
        && search.until.is_none_or(|until| Instant::now() < until)
    {
        let mut quadratic = problem.expand(&found.place, is_carried)?;
        found.iterations += 1;
        left -= if is_carried {
            search.carried_counts
        } else {
            1.0
        };
        let (cost, kept) = (problem.cost(&found.place), damping);
        let mut taken = None;
        for _ in 0..search.tries[usize::from(is_carried)] {
            if damping >= search.most {
                break;
            }
            let Some(step) = problem.step(&quadratic, damping) else {
                damping = (search.raised)(damping);
                continue;
            };
            let (count, stuck) = (quadratic.active.len(), problem.stuck(&found.place, &step));
            quadratic.active.retain(|i| !stuck.contains(i));
            if quadratic.active.len() < count {
                continue;
            }
            let promise = quadratic.downhill.dot(&step);
            let next = problem.moved(&found.place, &step);
            if let Some(next) = next.filter(|next| problem.cost(next) <= cost) {
                taken = Some((next, promise));
                break;
            }
            if promise.abs() < search.pointless {
                break;
            }
            damping = (search.raised)(damping);
        }
        if let Some((next, promise)) = taken {
            damping = (search.lowered)(damping);
            let step = Taken {
                gain: cost - problem.cost(&next),
                promise,
                place: &next,
            };
            let has_settled = problem.has_settled(&step);
            found.has_converged = has_settled && (!is_carried || search.trusts_carried);
            is_carried = !has_settled && problem.carry(&quadratic, &found.place, &step);
            found.place = next;
        } else {
            // No step lowers the cost: an optimum to rounding, if the derivatives are right. Those that were carried
            // say nothing of the damping.
            found.has_converged = !is_carried;
            (damping, is_carried) = (kept, false);
        }
        found.information = Some(quadratic.information);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// `x^4 / 4` from right of zero: Newton's steps leave two thirds of the distance, and nothing is exact.
    struct Flat {
        expanded: usize,
    }

    impl Problem for Flat {
        type Place = f64;
        type Error = ();

        fn cost(&self, x: &f64) -> f64 {
            x.powi(4) / 4.0
        }

        fn expand(&mut self, x: &f64, _: bool) -> Result<Quadratic, ()> {
            self.expanded += 1;
            let information = DMatrix::from_element(1, 1, 3.0 * x * x);
            Ok(Quadratic::new(
                information,
                DVector::from_element(1, -x.powi(3)),
            ))
        }

        fn moved(&mut self, x: &f64, step: &DVector<f64>) -> Option<f64> {
            Some(x + step[0])
        }

        fn has_settled(&self, taken: &Taken<'_, f64>) -> bool {
            taken.gain < 1e-12
        }
    }

    #[test]
    fn undamped_steps_are_newtons() {
        let search = Search {
            first: 0.0,
            lowered: |_| 0.0,
            iterations: 5,
            ..Search::default()
        };
        let mut flat = Flat { expanded: 0 };
        let found = minimise(&mut flat, 1.0, &search).unwrap();
        assert!((found.place - (2.0_f64 / 3.0).powi(5)).abs() < 1e-12);
        assert!(!found.has_converged && found.iterations == 5);
        let found = minimise(&mut flat, 1.0, &Search::default()).unwrap();
        assert!(found.has_converged && found.place.abs() < 1e-2);
    }

    #[test]
    fn a_search_ends_where_it_is_when_its_time_is_over() {
        let now = Instant::now();
        let within = |until| Search {
            until: Some(until),
            ..Search::default()
        };
        let mut flat = Flat { expanded: 0 };
        let found = minimise(&mut flat, 1.0, &within(now)).unwrap();
        assert_eq!((found.place, found.iterations, flat.expanded), (1.0, 0, 0));
        assert!(!found.has_converged);
        let later = now + Duration::from_secs(3600);
        let found = minimise(&mut flat, 1.0, &within(later)).unwrap();
        assert!(found.has_converged);
    }
}
