//! Solvers of the constrained step, behind one trait.

mod clarabel;
mod kwik;
mod metric;

pub use self::clarabel::Clarabel;
pub use self::kwik::Kwik;

use nalgebra::DVector;

/// Finds the optimum of a strictly convex quadratic program whose Hessian and constraint matrix
/// were given once: the point nearest to `target` in the Hessian's metric,
/// `min (x - target)' H (x - target)` subject to `A x >= bound`.
pub trait Solver: Send {
    /// Writes the optimum to `solution`; leaves it unspecified unless [`Outcome::Solved`].
    fn nearest(
        &mut self,
        target: &DVector<f64>,
        bound: &DVector<f64>,
        solution: &mut DVector<f64>,
    ) -> Outcome;
}

/// How a solver ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The optimum was found.
    Solved {
        /// Iterations it took.
        iterations: usize,
    },
    /// The limit on iterations or time was reached first.
    OutOfTime,
    /// There is no feasible point, or the numbers are not finite.
    Failed,
}

#[cfg(test)]
mod tests;
