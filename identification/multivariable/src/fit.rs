//! Poles and delays by Gauss and Newton's method; residues, free motion and offsets follow by least squares.

use nalgebra::{Complex, DMatrix, DVector};
use sysid::levenberg_marquardt::{Problem, Quadratic, Search, Taken, minimise};

use crate::Recording;
use crate::model::{delayed, filtered};

/// Poles and delays.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shape {
    /// rad/s; a pair of complex ones is one with a positive imaginary part.
    pub poles: Vec<Complex<f64>>,
    /// Samples.
    pub delays: Vec<f64>,
}

/// A shape with what follows from it.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub shape: Shape,
    /// By column of the regression (see [`columns`]) and stroke.
    pub linear: DMatrix<f64>,
    /// Mean square of each stroke's residual.
    pub square: Vec<f64>,
    /// Covariance of the shape's parameters and, for each stroke, of its linear ones.
    pub covariance: Option<DMatrix<f64>>,
}

/// Step of differences, relative for poles, in samples for delays.
const STEP: f64 = 1e-5;
const SLOWEST: f64 = 1e-3;
/// Information of a number, over the largest, below which it is at its bound.
const AT_BOUND: f64 = 1e-9;
/// Longest delay, samples.
const LONGEST: f64 = 200.0;

impl Shape {
    /// Numbers that are searched: logarithms of decays, imaginary parts over decays, delays.
    fn numbers(&self) -> Vec<f64> {
        let mut numbers = Vec::new();
        for pole in &self.poles {
            numbers.push((-pole.re).ln());
            if pole.im > 0.0 {
                numbers.push((pole.im / -pole.re).ln());
            }
        }
        numbers.extend(&self.delays);
        numbers
    }

    fn with(&self, numbers: &[f64], period: f64) -> Self {
        let mut at = numbers.iter().copied();
        let mut next = || at.next().unwrap_or(0.0);
        let poles = self.poles.iter().map(|pole| {
            let decay = next().exp().clamp(SLOWEST, 3.0 / period);
            match pole.im > 0.0 {
                true => Complex::new(
                    -decay,
                    (decay * next().exp()).clamp(1e-3 * decay, 3.0 / period),
                ),
                false => Complex::new(-decay, 0.0),
            }
        });
        let poles = poles.collect();
        let delays = self
            .delays
            .iter()
            .map(|_| next().clamp(0.0, LONGEST))
            .collect();
        Self { poles, delays }
    }

    /// Number of columns of a pole.
    fn width(pole: Complex<f64>) -> usize {
        if pole.im > 0.0 { 2 } else { 1 }
    }

    /// Number of states of a model of one command.
    pub fn order(&self) -> usize {
        self.poles.iter().map(|pole| Self::width(*pole)).sum()
    }
}

/// Columns of the regression: for each command and pole its state (real, then negative imaginary part), then the free motion
/// of each pole, then one.
fn columns(recording: &Recording, shape: &Shape) -> Vec<Vec<f64>> {
    let n = recording.len();
    let mut all = Vec::new();
    let mut push = |states: &[Complex<f64>], pole: Complex<f64>| {
        all.push(states.iter().map(|x| x.re).collect::<Vec<f64>>());
        if pole.im > 0.0 {
            all.push(states.iter().map(|x| -x.im).collect());
        }
    };
    for (command, delay) in recording.commands.iter().zip(&shape.delays) {
        let input = delayed(command, *delay);
        for pole in &shape.poles {
            push(&filtered(&input, *pole, recording.period), *pole);
        }
    }
    for pole in &shape.poles {
        let by = (*pole * recording.period).exp();
        let mut state = Complex::new(1.0, 0.0);
        let free: Vec<Complex<f64>> = (0..n)
            .map(|_| {
                let now = state;
                state *= by;
                now
            })
            .collect();
        push(&free, *pole);
    }
    all.push(vec![1.0; n]);
    all
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Sum of squares over which a column counts as none.
const NOTHING: f64 = 1e-300;

/// Least squares of the strokes on the columns: coefficients and residuals.
fn regress(columns: &[Vec<f64>], strokes: &[Vec<f64>]) -> Option<(DMatrix<f64>, Vec<Vec<f64>>)> {
    let count = columns.len();
    let size: Vec<f64> = columns
        .iter()
        .map(|own| dot(own, own).max(NOTHING).sqrt())
        .collect();
    let mut normal = DMatrix::<f64>::zeros(count, count);
    let mut right = DMatrix::<f64>::zeros(count, strokes.len());
    for i in 0..count {
        for j in 0..=i {
            normal[(i, j)] = dot(&columns[i], &columns[j]) / (size[i] * size[j]);
            normal[(j, i)] = normal[(i, j)];
        }
        normal[(i, i)] += 1e-11;
        for (j, stroke) in strokes.iter().enumerate() {
            right[(i, j)] = dot(&columns[i], stroke) / size[i];
        }
    }
    let mut linear = normal.cholesky()?.solve(&right);
    for (mut row, size) in linear.row_iter_mut().zip(&size) {
        row /= *size;
    }
    let residuals = strokes.iter().enumerate().map(|(j, stroke)| {
        let mut left = stroke.clone();
        for (column, coefficient) in columns.iter().zip(linear.column(j).iter()) {
            for (left, value) in left.iter_mut().zip(column) {
                *left -= coefficient * value;
            }
        }
        left
    });
    let residuals = residuals.collect();
    Some((linear, residuals))
}

/// What columns leave of a signal by least squares; the signal where they explain nothing.
pub(crate) fn left_over(columns: &[Vec<f64>], signal: &[f64]) -> Vec<f64> {
    let signals = [signal.to_vec()];
    let left = regress(columns, &signals).and_then(|(_, residuals)| residuals.into_iter().next());
    left.unwrap_or_else(|| signal.to_vec())
}

fn mean_square(values: &[f64]) -> f64 {
    dot(values, values) / values.len().max(1) as f64
}

/// Logarithm of the product of the strokes' mean squares: what is made least.
fn cost(square: &[f64]) -> f64 {
    square.iter().map(|square| square.max(1e-60).ln()).sum()
}

/// What `recording` leaves of a shape: coefficients and residuals.
fn evaluate(recording: &Recording, shape: Shape) -> Option<Evaluated> {
    let (linear, residuals) = regress(&columns(recording, &shape), &recording.strokes)?;
    let square: Vec<f64> = residuals.iter().map(|own| mean_square(own)).collect();
    square
        .iter()
        .all(|value| value.is_finite())
        .then_some(Evaluated {
            shape,
            linear,
            residuals,
            square,
        })
}

/// A shape with its coefficients, residuals and their mean squares.
struct Evaluated {
    shape: Shape,
    linear: DMatrix<f64>,
    residuals: Vec<Vec<f64>>,
    square: Vec<f64>,
}

/// Changes of the residuals by each number, with the coefficients as they are.
fn slopes(
    recording: &Recording,
    shape: &Shape,
    linear: &DMatrix<f64>,
    base: &[Vec<f64>],
) -> Vec<Vec<Vec<f64>>> {
    let numbers = shape.numbers();
    let of = |numbers: &[f64]| -> Vec<Vec<f64>> {
        let moved = columns(recording, &shape.with(numbers, recording.period));
        let strokes = recording.strokes.iter().enumerate();
        let left = strokes.map(|(j, stroke)| {
            let mut left = stroke.clone();
            for (column, coefficient) in moved.iter().zip(linear.column(j).iter()) {
                for (left, value) in left.iter_mut().zip(column) {
                    *left -= coefficient * value;
                }
            }
            left
        });
        left.collect()
    };
    (0..numbers.len())
        .map(|i| {
            let mut moved = numbers.clone();
            moved[i] += STEP;
            of(&moved)
                .iter()
                .zip(base)
                .map(|(there, here)| {
                    there
                        .iter()
                        .zip(here)
                        .map(|(a, b)| (a - b) / STEP)
                        .collect()
                })
                .collect()
        })
        .collect()
}

/// The part of `values` that the columns do not explain.
fn without(columns: &[Vec<f64>], values: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    Some(regress(columns, values)?.1)
}

/// Improves a shape by at most `iterations` steps.
pub(crate) fn improve(recording: &Recording, start: &Shape, iterations: usize) -> Option<Fitted> {
    let start = start.with(&start.numbers(), recording.period);
    let start = evaluate(recording, start)?;
    let search = Search {
        raised: |damping| 10.0 * damping,
        most: 1e6,
        tries: [16, 0],
        iterations,
        ..Search::default()
    };
    let found = minimise(&mut Improved { recording }, start, &search).ok()?;
    let Evaluated {
        shape,
        linear,
        square,
        ..
    } = found.place;
    Some(Fitted {
        shape,
        linear,
        square,
        covariance: None,
    })
}

struct Improved<'a> {
    recording: &'a Recording,
}

impl Problem for Improved<'_> {
    type Place = Evaluated;
    type Error = ();

    fn cost(&self, place: &Evaluated) -> f64 {
        cost(&place.square)
    }

    fn expand(&mut self, at: &Evaluated, _: bool) -> Result<Quadratic, ()> {
        let slopes = slopes(self.recording, &at.shape, &at.linear, &at.residuals);
        let own = columns(self.recording, &at.shape);
        let count = slopes.len();
        let mut normal = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::<f64>::zeros(count);
        for (stroke, square) in at.square.iter().enumerate() {
            let of: Vec<Vec<f64>> = slopes.iter().map(|by| by[stroke].clone()).collect();
            let of = without(&own, &of).ok_or(())?;
            for i in 0..count {
                right[i] -= dot(&of[i], &at.residuals[stroke]) / square;
                for j in 0..count {
                    normal[(i, j)] += dot(&of[i], &of[j]) / square;
                }
            }
        }
        Ok(Quadratic::new(normal, right))
    }

    fn step(&self, quadratic: &Quadratic, damping: f64) -> Option<DVector<f64>> {
        let ridge = 1e-12 * quadratic.information[(0, 0)].abs() + f64::MIN_POSITIVE;
        let step = quadratic.step(damping, ridge)?;
        Some(step.map(|value| value.clamp(-1.0, 1.0)))
    }

    fn moved(&mut self, at: &Evaluated, step: &DVector<f64>) -> Option<Evaluated> {
        let numbers = at.shape.numbers();
        let numbers: Vec<f64> = numbers
            .iter()
            .zip(step.iter())
            .map(|(a, b)| a + b)
            .collect();
        evaluate(
            self.recording,
            at.shape.with(&numbers, self.recording.period),
        )
    }

    fn has_settled(&self, taken: &Taken<'_, Evaluated>) -> bool {
        taken.gain < 1e-7
    }
}

/// The same with covariances: residuals that are correlated in time count as fewer samples.
pub(crate) fn with_covariance(recording: &Recording, mut fitted: Fitted) -> Option<Fitted> {
    let shape = &fitted.shape;
    let own = columns(recording, shape);
    let residuals = evaluate(recording, shape.clone())?.residuals;
    let slopes = slopes(recording, shape, &fitted.linear, &residuals);
    let (count, width, strokes) = (slopes.len(), own.len(), residuals.len());
    let mut information = DMatrix::<f64>::zeros(count + strokes * width, count + strokes * width);
    for stroke in 0..strokes {
        let variance: f64 = fitted.square[stroke] * repeats(&residuals[stroke]);
        let weight = 1.0 / variance.max(1e-60);
        let signals: Vec<&[f64]> = slopes
            .iter()
            .map(|by| by[stroke].as_slice())
            .chain(own.iter().map(Vec::as_slice))
            .collect();
        let place = |i: usize| if i < count { i } else { i + stroke * width };
        for i in 0..signals.len() {
            for j in 0..=i {
                // A slope is a change of the residual, a column one of the output.
                let sign = if (i < count) == (j < count) {
                    1.0
                } else {
                    -1.0
                };
                let product = weight * sign * dot(signals[i], signals[j]);
                information[(place(i), place(j))] += product;
                if place(i) != place(j) {
                    information[(place(j), place(i))] += product;
                }
            }
        }
    }
    // A number at its bound changes nothing but rounding: it is held, with no variance.
    let most = (0..count).map(|i| information[(i, i)]).fold(0.0, f64::max);
    let held: Vec<bool> = (0..information.nrows())
        .map(|i| {
            let least = if i < count { AT_BOUND * most } else { 0.0 };
            information[(i, i)].partial_cmp(&least) != Some(std::cmp::Ordering::Greater)
        })
        .collect();
    let size = information
        .diagonal()
        .map(|value| value.max(NOTHING).sqrt());
    let scaled = DMatrix::from_fn(size.len(), size.len(), |i, j| {
        match (i == j, held[i] || held[j]) {
            (true, _) => 1.0 + 1e-10,
            (false, true) => 0.0,
            (false, false) => information[(i, j)] / (size[i] * size[j]),
        }
    });
    let inverse = scaled.cholesky()?.inverse();
    fitted.covariance = Some(DMatrix::from_fn(size.len(), size.len(), |i, j| {
        if held[i] || held[j] {
            0.0
        } else {
            inverse[(i, j)] / (size[i] * size[j])
        }
    }));
    Some(fitted)
}

/// Samples for which one counts, by the residual's autocorrelation.
pub(crate) fn repeats(residual: &[f64]) -> f64 {
    let square = dot(residual, residual).max(NOTHING);
    let lags = (residual.len() / 8).min(64);
    let sum: f64 = (1..=lags)
        .map(|lag| dot(&residual[lag..], &residual[..residual.len() - lag]) / square)
        .sum();
    (1.0 + 2.0 * sum).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `e[k] = r e[k - 1] + n[k]`: one of `(1 + r)/(1 - r)` counts.
    #[test]
    fn residuals_with_memory_count_as_fewer() {
        let of = |memory: f64| {
            let (mut state, mut own) = (1_u32, 0.0);
            let mut next = |_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                own = memory * own + f64::from(state >> 8) / f64::from(1 << 23) - 1.0;
                own
            };
            repeats(&(0..100_000).map(&mut next).collect::<Vec<_>>())
        };
        assert!((of(0.5) / 3.0 - 1.0).abs() < 0.1, "{}", of(0.5));
        assert!((of(0.0) - 1.0).abs() < 0.1, "{}", of(0.0));
        // What swings counts no more than once.
        assert_eq!(of(-0.5), 1.0);
    }
}
