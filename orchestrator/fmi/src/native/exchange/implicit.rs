//! Radau IIA of order 5 with simplified Newton iterations and a continuous output of order 3, for stiff
//! systems (Hairer, Wanner, *Solving Ordinary Differential Equations II*, IV.8). It is a one-step method:
//! unlike a multistep method, it keeps its order after events and after inputs that jump. Between two steps it
//! needs only a step size and a Jacobian, which a saved state holds.

use nalgebra::{Complex, DMatrix, DVector, Dyn, LU};

use super::model::{Done, Model};
use super::step::{Start, Taken, Trial, Way};

/// Newton iterations at most.
const MOST_ITERATIONS: u32 = 7;
/// Below this product of step and Jacobian the explicit method does as well.
const MILD: f64 = 0.5;

type Complexes = DVector<Complex<f64>>;

/// The polynomial through a step's stages: a row for each power of the share of the step.
pub(super) struct Collocation([Vec<f64>; 3]);

impl Collocation {
    fn of(stages: &[DVector<f64>; 3]) -> Self {
        let n = stages[0].len();
        Self(std::array::from_fn(|power| {
            let term = |i| (0..3).map(|j| stages[j][i] * P[j][power]).sum();
            (0..n).map(term).collect()
        }))
    }

    /// States at the share `theta` of the step, which may be beyond its end.
    pub(super) fn between(&self, state: &[f64], theta: f64) -> Vec<f64> {
        let [first, second, third] = &self.0;
        let term = |i: usize| theta * (first[i] + theta * (second[i] + theta * third[i]));
        (0..state.len()).map(|i| state[i] + term(i)).collect()
    }
}

/// The two matrices of an iteration, factored.
struct Factors {
    /// The step that they are for, s.
    size: f64,
    real: LU<f64, Dyn, Dyn>,
    complex: LU<Complex<f64>, Dyn, Dyn>,
}

/// What lives from step to step without being part of a state: it follows from the Jacobian.
#[derive(Default)]
pub(super) struct Newton {
    factors: Option<Factors>,
    /// Whether the Jacobian is of where the next step begins.
    is_fresh: bool,
}

/// An iteration that converged.
struct Converged {
    stages: [DVector<f64>; 3],
    iterations: u32,
    rate: f64,
}

impl Newton {
    /// Forgets what may be of another moment; the Jacobian stays.
    pub(super) fn begin(&mut self) {
        self.is_fresh = false;
    }

    /// Forgets all: the Jacobian is another one.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Tries a step with the Jacobian at hand, or a new one where there is none or where that one does not converge.
    /// `before` is the size of the last step and its polynomial, from which the stages are foretold.
    pub(super) fn attempt(
        &mut self,
        model: &mut Model,
        jacobian: &mut Vec<f64>,
        start: &Start,
        size: f64,
        before: Option<(f64, &[f64], &Way)>,
    ) -> Done<Trial> {
        let n = start.states.len();
        // The error estimate is of order 3, the method of order 5 where a system is not very stiff: RADAU5
        // takes this power, too, with a factor that is ten times larger.
        let tolerance = 0.01 * model.tolerance.powf(2.0 / 3.0);
        let scales = start.states.iter().enumerate();
        let scales = scales.map(|(i, &state)| tolerance * model.size(i, state, state));
        let scales: Vec<f64> = scales.collect();
        let converged = loop {
            if jacobian.is_empty() && n > 0 {
                *jacobian = model.jacobian(start.time, start.states, start.slope)?;
                (self.is_fresh, self.factors) = (true, None);
            }
            if self.factors.as_ref().is_none_or(|known| known.size != size) {
                self.factors = Some(Factors::of(jacobian, n, size));
            }
            let Some(factors) = &self.factors else {
                return Ok(Trial::Refused(0.5 * size));
            };
            let guess = guess(start.states, size, before);
            let limit = (10.0 * f64::EPSILON / tolerance).max(tolerance.sqrt().min(0.03));
            match iterate(model, factors, start, guess, (&scales, limit))? {
                Some(converged) => break converged,
                None if !self.is_fresh => jacobian.clear(),
                // Directional derivatives that lead nowhere are not believed.
                None if !model.pairs.is_empty() => {
                    model.pairs.clear();
                    jacobian.clear();
                }
                None => return Ok(Trial::Refused(0.5 * size)),
            }
        };
        let Some(factors) = &self.factors else {
            return Ok(Trial::Refused(0.5 * size));
        };
        let next: Vec<f64> = (0..n)
            .map(|i| start.states[i] + converged.stages[2][i])
            .collect();
        let sizes: Vec<f64> = (0..n)
            .map(|i| model.size(i, start.states[i], next[i]))
            .collect();
        let weigh = |error: &DVector<f64>| largest(error, |i| tolerance * sizes[i]);
        let bent: DVector<f64> = DVector::from_fn(n, |i, _| {
            (0..3).map(|j| converged.stages[j][i] * E[j]).sum::<f64>() / size
        });
        let estimate = |slope: &[f64]| {
            let mut error = DVector::from_fn(n, |i, _| slope[i] + bent[i]);
            factors.real.solve_mut(&mut error);
            error
        };
        let mut error = estimate(start.slope);
        let mut share = weigh(&error);
        if share > 1.0 && share.is_finite() {
            // A second estimate, which is bounded for very stiff parts.
            let moved: Vec<f64> = (0..n).map(|i| start.states[i] + error[i]).collect();
            let mut slope = vec![0.0; n];
            model.derivatives(start.time, &moved, &mut slope)?;
            error = estimate(&slope);
            share = weigh(&error);
        }
        if !share.is_finite() {
            return Ok(Trial::Refused(0.2 * size));
        }
        let most = f64::from(2 * MOST_ITERATIONS + 1);
        let safety = 0.9 * most / (most - 1.0 + f64::from(converged.iterations));
        let factor = safety * share.max(1e-10).powf(-0.25);
        if share > 1.0 {
            return Ok(Trial::Refused(size * factor.clamp(0.2, 0.9)));
        }
        let strength = size * norm(jacobian, &sizes);
        let is_slow = converged.iterations > 2 && converged.rate > 1e-3;
        if is_slow {
            jacobian.clear();
        }
        self.is_fresh = false;
        // Small changes of the step do not pay for new factors.
        let grow = match factor.clamp(0.2, 8.0) {
            factor if !is_slow && (1.0..1.2).contains(&factor) => 1.0,
            factor => factor,
        };
        Ok(Trial::Taken(Taken {
            next,
            slope: None,
            proposed: size * grow,
            is_limited: strength < MILD,
            way: Way::Implicit(Collocation::of(&converged.stages)),
        }))
    }
}

/// The largest of values relative to their scales; infinite where one is not a number.
fn largest(values: &DVector<f64>, scale: impl Fn(usize) -> f64) -> f64 {
    values
        .iter()
        .enumerate()
        .fold(0.0, |most: f64, (i, value)| {
            let share = (value / scale(i)).abs();
            if share.is_finite() {
                most.max(share)
            } else {
                f64::INFINITY
            }
        })
}

/// The largest sum of a row of the Jacobian, states measured by their sizes, 1/s.
fn norm(jacobian: &[f64], sizes: &[f64]) -> f64 {
    let n = sizes.len();
    let row = |i: usize| {
        let terms = (0..n).map(|j| jacobian[j * n + i].abs() * sizes[j]);
        terms.sum::<f64>() / sizes[i]
    };
    (0..n).map(row).fold(0.0, f64::max)
}

impl Factors {
    fn of(jacobian: &[f64], n: usize, size: f64) -> Self {
        let matrix = DMatrix::from_column_slice(n, n, jacobian);
        let (real, complex) = eigenvalues();
        let shifted = DMatrix::from_diagonal_element(n, n, real / size) - &matrix;
        let turned = matrix.map(|value| Complex::new(-value, 0.0));
        let turned = turned + DMatrix::from_diagonal_element(n, n, complex / size);
        Self {
            size,
            real: shifted.lu(),
            complex: turned.lu(),
        }
    }
}

/// Where an iteration begins: on the polynomial of the last step.
fn guess(states: &[f64], size: f64, before: Option<(f64, &[f64], &Way)>) -> [DVector<f64>; 3] {
    let n = states.len();
    let Some((last, from, way @ Way::Implicit(_))) = before else {
        return std::array::from_fn(|_| DVector::zeros(n));
    };
    places().map(|place| {
        let there = way.between(from, last, 1.0 + place * size / last);
        DVector::from_fn(n, |i, _| there[i] - states[i])
    })
}

/// Newton's iterations for the stages; none where they do not converge.
fn iterate(
    model: &mut Model,
    factors: &Factors,
    start: &Start,
    mut stages: [DVector<f64>; 3],
    (scales, limit): (&[f64], f64),
) -> Done<Option<Converged>> {
    let n = start.states.len();
    let size = factors.size;
    let (real, complex) = eigenvalues();
    let mix = |rows: &[[f64; 3]; 3], of: &[DVector<f64>; 3], row: usize| {
        &of[0] * rows[row][0] + &of[1] * rows[row][1] + &of[2] * rows[row][2]
    };
    let mut turned: [DVector<f64>; 3] = std::array::from_fn(|row| mix(&TI, &stages, row));
    let mut slopes: [DVector<f64>; 3] = std::array::from_fn(|_| DVector::zeros(n));
    let (mut last, mut rate): (Option<f64>, f64) = (None, 0.0);
    let mut at = vec![0.0; n];
    for k in 0..MOST_ITERATIONS {
        for (stage, place) in places().into_iter().enumerate() {
            for i in 0..n {
                at[i] = start.states[i] + stages[stage][i];
            }
            let into = slopes[stage].as_mut_slice();
            model.derivatives(start.time + place * size, &at, into)?;
            if !into.iter().all(|value| value.is_finite()) {
                return Ok(None);
            }
        }
        let mut first = mix(&TI, &slopes, 0) - &turned[0] * (real / size);
        let (one, two) = (mix(&TI, &slopes, 1), mix(&TI, &slopes, 2));
        let mut pair = Complexes::from_fn(n, |i, _| {
            let present = Complex::new(turned[1][i], turned[2][i]);
            Complex::new(one[i], two[i]) - complex / size * present
        });
        if !factors.real.solve_mut(&mut first) || !factors.complex.solve_mut(&mut pair) {
            return Ok(None);
        }
        let changes = [
            first,
            pair.map(|value| value.re),
            pair.map(|value| value.im),
        ];
        let change = changes
            .iter()
            .map(|change| largest(change, |i| scales[i]))
            .fold(0.0, f64::max);
        if !change.is_finite() {
            return Ok(None);
        }
        if let Some(last) = last {
            rate = change / last;
            let left = i32::try_from(MOST_ITERATIONS - k).unwrap_or(1);
            if rate >= 1.0 || rate.powi(left) / (1.0 - rate) * change > limit {
                return Ok(None);
            }
        }
        for (turned, change) in turned.iter_mut().zip(&changes) {
            *turned += change;
        }
        stages = std::array::from_fn(|row| mix(&T, &turned, row));
        if change == 0.0 || (last.is_some() && rate / (1.0 - rate) * change < limit) {
            let iterations = k + 1;
            return Ok(Some(Converged {
                stages,
                iterations,
                rate,
            }));
        }
        last = Some(change);
    }
    Ok(None)
}

/// Places of the stages.
fn places() -> [f64; 3] {
    [(4.0 - S6) / 10.0, (4.0 + S6) / 10.0, 1.0]
}

/// Eigenvalues of the inverse of the method's matrix: the real one, and one of the pair.
fn eigenvalues() -> (f64, Complex<f64>) {
    let (three, nine) = (3_f64.cbrt(), 9_f64.cbrt());
    let real = 3.0 + nine - three;
    let imaginary = 0.5 * 3_f64.sqrt() * (three + nine);
    (real, Complex::new(3.0 + 0.5 * (three - nine), -imaginary))
}

/// The square root of 6.
const S6: f64 = 2.449489742783178;

/// Weights of the stages in the error.
const E: [f64; 3] = [
    (-13.0 - 7.0 * S6) / 3.0,
    (-13.0 + 7.0 * S6) / 3.0,
    -1.0 / 3.0,
];

/// Weights of the stages in the polynomial's coefficients.
const P: [[f64; 3]; 3] = [
    [
        (13.0 + 7.0 * S6) / 3.0,
        (-23.0 - 22.0 * S6) / 3.0,
        (10.0 + 15.0 * S6) / 3.0,
    ],
    [
        (13.0 - 7.0 * S6) / 3.0,
        (-23.0 + 22.0 * S6) / 3.0,
        (10.0 - 15.0 * S6) / 3.0,
    ],
    [1.0 / 3.0, -8.0 / 3.0, 10.0 / 3.0],
];

/// Brings the inverse of the method's matrix to its real eigenvalue and a block for the pair.
const T: [[f64; 3]; 3] = [
    [
        0.09443876248897524,
        -0.141_255_295_020_954_2,
        0.03002919410514742,
    ],
    [
        0.250_213_122_965_333_3,
        0.20412935229379994,
        -0.382_942_112_757_261_9,
    ],
    [1.0, 1.0, 0.0],
];

/// The inverse of [`T`].
const TI: [[f64; 3]; 3] = [
    [4.178718591551904, 0.3276828207610624, 0.5233764454994495],
    [-4.178718591551904, -0.3276828207610624, 0.4766235545005505],
    [0.5028726349457868, -2.571926949855605, 0.5960392048282249],
];

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| rows[i][j])
    }

    /// The method's matrix integrates 1, t and t² exactly at its places.
    fn method() -> Matrix3<f64> {
        let c = places();
        let powers = Matrix3::from_fn(|i, j| c[i].powi(j as i32));
        let integrals = Matrix3::from_fn(|i, j| c[i].powi(j as i32 + 1) / (j + 1) as f64);
        integrals * powers.try_inverse().unwrap()
    }

    #[test]
    fn the_transformation_brings_the_method_to_its_eigenvalues() {
        let (real, complex) = eigenvalues();
        let (re, im) = (complex.re, complex.im);
        let block = Matrix3::new(real, 0.0, 0.0, 0.0, re, -im, 0.0, im, re);
        let turned = matrix(&TI) * method().try_inverse().unwrap() * matrix(&T);
        assert!((turned - block).amax() < 1e-12, "{turned}");
        assert!((matrix(&TI) * matrix(&T) - Matrix3::identity()).amax() < 1e-14);
    }

    #[test]
    fn the_norm_is_the_largest_row_with_states_measured_by_their_sizes() {
        // Columns of [[1, -2], [3, 4]]; sizes 1 and 10.
        let jacobian = [1.0, 3.0, -2.0, 4.0];
        assert_eq!(norm(&jacobian, &[1.0, 1.0]), 7.0);
        assert_eq!(norm(&jacobian, &[1.0, 10.0]), 1.0 + 20.0);
        assert_eq!(norm(&[], &[]), 0.0);
    }

    #[test]
    fn the_polynomial_passes_through_the_stages() {
        let stages = [0.3, -0.2, 0.7].map(|value| DVector::from_element(1, value));
        let polynomial = Collocation::of(&stages);
        for (place, stage) in places().into_iter().zip(&stages) {
            let there = polynomial.between(&[1.0], place)[0];
            assert!((there - 1.0 - stage[0]).abs() < 1e-14, "{there}");
        }
    }
}
