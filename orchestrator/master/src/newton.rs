//! Values that travel round a loop and must come back as they were sent: by substitution while that
//! settles quickly, by a damped Newton method otherwise (Kelley, *Solving Nonlinear Equations with
//! Newton's Method*, SIAM 2003, chapters 1 and 2).

use nalgebra::linalg::FullPivLU;
use nalgebra::{DMatrix, DVector, Dyn};

use super::MasterError;

/// Values that change by less than this part of their size, or by this amount in their unit, have
/// settled.
const EXACTLY: (f64, f64) = (1e-12, f64::MIN_POSITIVE);
/// The same of values that rounding moves to and fro.
const ROUNDED: (f64, f64) = (1e-12, 1e-12);
/// The same where nothing comes closer: some FMUs compute with a tolerance of their own.
const ATTAINABLE: (f64, f64) = (1e-9, 1e-12);
/// Substitution continues as long as two passes bring the values closer by this factor: where two
/// components take what the other gave in the pass before, every other pass may bring nothing.
const SETTLING: f64 = 0.5;
/// A derivative serves as long as its steps bring the values so much closer.
const QUICKLY: f64 = 0.1;
/// Newton steps at most.
const MOST_STEPS: usize = 50;
/// Halvings of a Newton step at most.
const MOST_HALVINGS: u32 = 10;
/// Passes of substitution at most, where there is nothing to differentiate.
const MOST_PASSES: usize = 100;
/// Size of a finite difference, relative to the value.
const DIFFERENCE: f64 = 1e-6;
/// A loop gives back what it is given where its gain is so close to one.
const UNIT_GAIN: f64 = 1e-6;

/// What sends values round a loop.
pub(super) trait Round {
    /// Sends the values round, and gives what comes back.
    ///
    /// # Errors
    /// A call that an FMU did not complete.
    fn send(&mut self, values: &[f64], back: &mut [f64]) -> Result<(), MasterError>;

    /// What comes back changes by, per change of the value at `place`, as the FMUs themselves say;
    /// none where they do not, and a difference is taken. The values are those that were sent last.
    ///
    /// # Errors
    /// As [`Round::send`].
    fn derivative(
        &mut self,
        _place: usize,
        _values: &[f64],
        _change: &mut [f64],
    ) -> Result<bool, MasterError> {
        Ok(false)
    }
}

/// Why the values of a loop were not found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unsolved {
    /// How often values were sent round.
    pub passes: usize,
    /// The value that is furthest from what comes back.
    pub place: usize,
    /// The closest that was found of it.
    pub value: f64,
    /// What comes back.
    pub back: f64,
    /// How much larger a change of the values comes back (the real eigenvalue of the derivative that
    /// is closest to one); none where it is not known.
    pub gain: Option<f64>,
}

impl Unsolved {
    /// Whether a change comes back as large as it was, so that no value fits, or any.
    pub(super) fn is_singular(&self) -> bool {
        self.gain
            .is_some_and(|gain| (gain - 1.0).abs() < 1e3 * UNIT_GAIN)
    }
}

impl Unsolved {
    /// Why there are none, as far as it is known, and what to do.
    pub(super) fn reason(&self) -> String {
        let why = match self.gain {
            _ if self.is_singular() => "a change of the values returns at its full size (the loop \
                gain is 1), so either no value or any value is a solution"
                .to_string(),
            Some(gain) => format!(
                "a change of the values returns {gain:.4} times as large, and Newton's method \
                 does not converge further"
            ),
            None => format!("after {} iterations they still change", self.passes),
        };
        format!(
            "{why}: check the equations and parameters of the components, or break the loop with one \
             that has no direct feedthrough or a `period`"
        )
    }
}

/// Room for seeking the values of a loop, made once, so that substitution allocates nothing.
#[derive(Debug, Default)]
pub(super) struct Solver {
    /// Places of the values that may take any value.
    free: Vec<usize>,
    /// Places of the others.
    switched: Vec<usize>,
    back: Vec<f64>,
    begun: Vec<f64>,
    sizes: Vec<f64>,
}

/// The values of a loop while they are sought.
struct Search<'a, R> {
    round: &'a mut R,
    /// Places of the smooth ones.
    free: &'a [usize],
    back: &'a mut Vec<f64>,
    passes: usize,
}

impl Solver {
    /// For values of which these are smooth: they may take any value, for they are not whole numbers.
    pub(super) fn new(smooth: &[bool]) -> Self {
        let places = |wanted: bool| (0..smooth.len()).filter(move |&at| smooth[at] == wanted);
        let room = vec![0.0; smooth.len()];
        Self {
            free: places(true).collect(),
            switched: places(false).collect(),
            back: room.clone(),
            begun: room.clone(),
            sizes: room,
        }
    }
}

/// Seeks values that come back as they were sent, beginning with those given; on success they are the
/// last that were sent.
///
/// # Errors
/// A call that an FMU did not complete. The result within says why there are none.
pub(super) fn solve(
    solver: &mut Solver,
    round: &mut impl Round,
    values: &mut [f64],
) -> Result<Result<(), Unsolved>, MasterError> {
    let Solver {
        free,
        switched,
        back,
        begun,
        sizes,
    } = solver;
    let mut search = Search {
        round,
        free,
        back,
        passes: 0,
    };
    search.send(values)?;
    if search.substitute(values, begun, sizes)? {
        return Ok(Ok(()));
    }
    if search.free.is_empty() {
        return Ok(Err(search.unsolved(values, None)));
    }
    for _ in 0..MOST_PASSES {
        let mut solved = search.newton(values, true)?;
        // An FMU whose derivatives are wrong is not believed twice.
        if let Err((_, true)) = solved {
            solved = search.newton(values, false)?;
        }
        if let Err((unsolved, _)) = solved {
            return Ok(Err(unsolved));
        }
        // What is not smooth stood still meanwhile.
        if switched.iter().all(|&at| values[at] == search.back[at]) {
            return Ok(Ok(()));
        }
        for &at in switched.iter() {
            values[at] = search.back[at];
        }
        search.send(values)?;
    }
    Ok(Err(search.unsolved(values, None)))
}

impl<R: Round> Search<'_, R> {
    fn send(&mut self, values: &[f64]) -> Result<(), MasterError> {
        self.passes += 1;
        self.round.send(values, self.back)
    }

    /// Size of the value at a place.
    fn size(&self, values: &[f64], at: usize) -> f64 {
        values[at].abs().max(self.back[at].abs())
    }

    /// Whether all values are what comes back, so closely.
    fn has_settled(
        &self,
        mut places: impl Iterator<Item = usize>,
        values: &[f64],
        (tolerance, negligible): (f64, f64),
    ) -> bool {
        places.all(|at| {
            let change = (self.back[at] - values[at]).abs();
            change <= tolerance * self.size(values, at) + negligible
        })
    }

    /// How far the values are from what comes back, over these sizes, at most.
    fn distance(&self, values: &[f64], sizes: &[f64]) -> f64 {
        (0..values.len()).fold(0.0, |most: f64, at| {
            let size = sizes[at].max(f64::MIN_POSITIVE);
            most.max((self.back[at] - values[at]).abs() / size)
        })
    }

    /// Sends what came back as long as that settles quickly, or as nothing else can be done; gives
    /// whether it has settled. Where it runs away the values are those at which it began.
    fn substitute(
        &mut self,
        values: &mut [f64],
        begun: &mut [f64],
        sizes: &mut [f64],
    ) -> Result<bool, MasterError> {
        begun.copy_from_slice(values);
        for (at, size) in sizes.iter_mut().enumerate() {
            *size = self.size(values, at);
        }
        let first = self.distance(values, sizes);
        let (mut before, mut earlier) = (f64::INFINITY, f64::INFINITY);
        loop {
            if self.has_settled(0..values.len(), values, EXACTLY) {
                return Ok(true);
            }
            let distance = self.distance(values, sizes);
            // At the end a value that passes through zero changes by much of its size, though all are good.
            let stands = distance >= before.min(earlier);
            if stands && self.has_settled(0..values.len(), values, ROUNDED) {
                return Ok(true);
            }
            let goes_on = match self.free.is_empty() {
                true => self.passes < MOST_PASSES,
                false => distance <= SETTLING * earlier || distance < earlier.min(ATTAINABLE.0),
            };
            if !goes_on {
                if distance > first && !self.free.is_empty() {
                    values.copy_from_slice(begun);
                    self.send(values)?;
                }
                return Ok(false);
            }
            (earlier, before) = (before, distance);
            values.copy_from_slice(self.back);
            self.send(values)?;
        }
    }

    /// Newton's method, with the FMUs' own derivatives where `own` allows them; without a solution
    /// the second is whether they were used.
    #[allow(clippy::type_complexity, reason = "a result within a result")]
    fn newton(
        &mut self,
        values: &mut [f64],
        own: bool,
    ) -> Result<Result<(), (Unsolved, bool)>, MasterError> {
        let (mut matrix, mut used) = self.derivative(values, own)?;
        let mut is_fresh = true;
        for _ in 0..MOST_STEPS {
            let Some(step) = self.step(values, &matrix) else {
                let gain = gain(&matrix);
                return Ok(Err((self.unsolved(values, gain), used)));
            };
            let sizes: Vec<f64> = (0..values.len())
                .map(|at| self.size(values, at).max(step[at].abs()))
                .collect();
            let is_small = |(tolerance, negligible): (f64, f64)| {
                (0..step.len()).all(|at| step[at].abs() <= tolerance * sizes[at] + negligible)
            };
            if is_small(EXACTLY) {
                return Ok(Ok(()));
            }
            match self.descend(values, &step, &sizes)? {
                Some(_) if self.has_settled(self.free.iter().copied(), values, EXACTLY) => {
                    return Ok(Ok(()));
                }
                Some(ratio) if ratio <= QUICKLY => is_fresh = false,
                // An old derivative may be the reason.
                outcome if outcome.is_some() || !is_fresh => {
                    (matrix, used) = self.derivative(values, own)?;
                    is_fresh = true;
                }
                _ if is_small(ATTAINABLE) => return Ok(Ok(())),
                _ => {
                    let gain = gain(&matrix);
                    return Ok(Err((self.unsolved(values, gain), used)));
                }
            }
        }
        let gain = gain(&matrix);
        Ok(Err((self.unsolved(values, gain), used)))
    }

    /// Goes along a step as far as it brings the smooth values closer; gives how much closer, none
    /// where it does not, with the values where they were.
    fn descend(
        &mut self,
        values: &mut [f64],
        step: &[f64],
        sizes: &[f64],
    ) -> Result<Option<f64>, MasterError> {
        let begun = values.to_vec();
        let before = self.merit(values, sizes);
        let mut share = 1.0;
        let mut refused = None;
        for _ in 0..=MOST_HALVINGS {
            for at in 0..values.len() {
                values[at] = begun[at] + share * step[at];
            }
            match self.send(values) {
                Ok(()) => {
                    refused = None;
                    let after = self.merit(values, sizes);
                    if after < (1.0 - 1e-4 * share) * before {
                        return Ok(Some(after / before));
                    }
                }
                // A value outside of what a model is made for.
                Err(error) => refused = Some(error),
            }
            share *= 0.5;
        }
        values.copy_from_slice(&begun);
        match refused {
            Some(error) => Err(error),
            None => {
                self.send(values)?;
                Ok(None)
            }
        }
    }

    /// As [`Search::distance`], of the smooth values.
    fn merit(&self, values: &[f64], sizes: &[f64]) -> f64 {
        self.free.iter().fold(0.0, |most: f64, &at| {
            let size = sizes[at].max(f64::MIN_POSITIVE);
            most.max((self.back[at] - values[at]).abs() / size)
        })
    }

    /// What the Newton step changes; none where the derivative cannot be solved for it.
    fn step(&self, values: &[f64], matrix: &DMatrix<f64>) -> Option<Vec<f64>> {
        let scale = |at: usize| match self.size(values, at) {
            size if size > 0.0 => size,
            _ => 1.0,
        };
        let free = self.free;
        let n = free.len();
        let left = DMatrix::from_fn(n, n, |i, j| {
            let unit = if i == j { 1.0 } else { 0.0 };
            (unit - matrix[(i, j)]) * scale(free[j]) / scale(free[i])
        });
        let right = DVector::from_fn(n, |i, _| {
            let at = free[i];
            (self.back[at] - values[at]) / scale(at)
        });
        let solved: DVector<f64> = FullPivLU::<f64, Dyn, Dyn>::new(left).solve(&right)?;
        if !solved.iter().all(|value| value.is_finite()) {
            return None;
        }
        let mut step = vec![0.0; values.len()];
        for (i, &at) in free.iter().enumerate() {
            step[at] = solved[i] * scale(at);
        }
        Some(step)
    }

    /// The derivative of what comes back, among the smooth values, and whether FMUs gave some of it.
    fn derivative(
        &mut self,
        values: &[f64],
        own: bool,
    ) -> Result<(DMatrix<f64>, bool), MasterError> {
        let n = self.free.len();
        let mut matrix = DMatrix::zeros(n, n);
        let (mut used, mut is_moved) = (false, false);
        let mut column = vec![0.0; values.len()];
        let mut moved = values.to_vec();
        let there = self.back.clone();
        for j in 0..n {
            let at = self.free[j];
            if own && self.round.derivative(at, values, &mut column)? {
                used = true;
            } else {
                let size = self.size(values, at);
                let difference = DIFFERENCE * if size > 0.0 { size } else { 1.0 };
                moved[at] = values[at] + difference;
                let exact = moved[at] - values[at];
                self.passes += 1;
                self.round.send(&moved, &mut column)?;
                moved[at] = values[at];
                is_moved = true;
                for (column, there) in column.iter_mut().zip(&there) {
                    *column = (*column - there) / exact;
                }
            }
            for i in 0..n {
                matrix[(i, j)] = column[self.free[i]];
            }
        }
        if is_moved {
            self.send(values)?;
        }
        Ok((matrix, used))
    }

    fn unsolved(&self, values: &[f64], gain: Option<f64>) -> Unsolved {
        let far = |at: &usize| {
            let size = self.size(values, *at).max(f64::MIN_POSITIVE);
            (self.back[*at] - values[*at]).abs() / size
        };
        let place = (0..values.len()).max_by(|a, b| far(a).total_cmp(&far(b)));
        let place = place.unwrap_or(0);
        Unsolved {
            passes: self.passes,
            place,
            value: values.get(place).copied().unwrap_or(0.0),
            back: self.back.get(place).copied().unwrap_or(0.0),
            gain,
        }
    }
}

/// The real eigenvalue closest to one.
fn gain(matrix: &DMatrix<f64>) -> Option<f64> {
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let all = matrix.complex_eigenvalues();
    let real = all
        .iter()
        .filter(|value| value.im.abs() <= UNIT_GAIN * value.norm().max(1.0));
    let real = real.map(|value| value.re);
    real.min_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs()))
}

#[cfg(test)]
#[path = "newton_tests.rs"]
mod tests;
