//! Least squares for models whose errors are those of a simulation.
//!
//! Minimised is `N ln Σe² + priors`: the scale of the errors is part of the fit, so that it settles
//! together with the fit, and the priors count little against `N` samples (Levenberg 1944,
//! Marquardt 1963; the profile of the scale as in Seber and Wild, Nonlinear Regression, 1989,
//! section 2.2). What is known of a nominal parameter keeps directions that the data do not see
//! from running away; it does not hold back what they do see.

use nalgebra::{DMatrix, DVector};
use sysid::levenberg_marquardt::{Problem, Quadratic, Search, Taken, minimise};

use super::model::{Candidate, Point, Scale};
use super::resampling::{correlation_time, dot, scattered};

/// A prior counts as if it were this many times as wide as stated.
pub const WEAK: f64 = 10.0;
/// Steps of difference quotients, in internal units: nominal parameters, sizes of effects, and what is
/// counted by its logarithm, of which a period may repeat a hundred times in a record.
const DIFFERENCE: (f64, f64, f64) = (4e-3, 1e-3, 1e-4);
/// A nominal parameter moves at most by this many of its stated standard deviations in a step.
const LONGEST_STEP: f64 = 6.0;
/// Gain in twice the logarithm of the likelihood below which a fit has settled.
const STILL: f64 = 0.3;
/// Most steps with derivatives to both sides.
const POLISHING: usize = 8;
/// Correlated samples that count as one in it, at most.
const LARGEST_TIME: f64 = 20.0;
/// Share of the squared change of the errors up to which derivatives may miss it and are still learned from it.
const MISSED: f64 = 0.25;
/// Share of what the errors tell of a coordinate that keeps those that compensate each other wholly from rounding.
const RIDGE: f64 = 1e-10;

/// A model that simulates records which consist of blocks (a file each); errors are in the output's
/// unit.
pub trait SimulatedModel: Sync {
    /// Number of coordinates that do not belong to an effect: nominal parameters and what differs
    /// from file to file.
    fn nuisance(&self) -> usize;

    /// The catalogue.
    fn candidates(&self) -> &[Candidate];

    /// `point` with `step` added to its coordinates, kept in bounds.
    fn moved(&self, point: &Point, step: &[f64]) -> Point {
        point.moved(step, self.candidates())
    }

    /// Number of blocks.
    fn blocks(&self) -> usize;

    /// The only block that nuisance coordinate `i` acts on, if it is one.
    fn block_of(&self, i: usize) -> Option<usize>;

    /// Whether a fit to record `fitted` tells nuisance coordinate `i` of a block for `tested` as well.
    fn tells(&self, fitted: usize, i: usize, _tested: usize) -> bool {
        self.block_of(i)
            .is_none_or(|block| self.samples(fitted, block) > 0)
    }

    /// Number of samples of `block` in `record`.
    fn samples(&self, record: usize, block: usize) -> usize;

    /// Errors at `point` on the samples of `block` in `record`.
    fn errors(&self, point: &Point, record: usize, block: usize) -> Vec<f64>;

    /// The first `count` of them.
    fn first_errors(&self, point: &Point, record: usize, block: usize, count: usize) -> Vec<f64> {
        let mut errors = self.errors(point, record, block);
        errors.truncate(count);
        errors
    }

    /// The two records that are the halves of `record`.
    fn folds(&self, record: usize) -> [usize; 2];

    /// A record that stands for `record` where many candidates are looked at.
    fn screen(&self, record: usize) -> usize;

    /// Whether a simulation costs so little that more may be tried.
    fn is_cheap(&self) -> bool {
        true
    }

    /// How much wider than stated the priors of the nominal parameters count.
    fn prior_width(&self) -> f64 {
        WEAK
    }

    /// How many times the squared error of the effect that was taken a rival of it leaves at most; more
    /// than little where even a right model leaves errors of its own.
    fn rivals_leave(&self) -> f64 {
        1.5
    }

    /// The same model with its nominal parameters held near what was stated.
    #[must_use]
    fn held(&self) -> Self
    where
        Self: Sized;

    /// The name of a record.
    fn record_name(&self, record: usize) -> &str;

    /// Further values (SI) from which fits of a candidate begin, as the errors that `base` leaves
    /// on `record` suggest them.
    fn starts(&self, _base: &Point, _record: usize) -> Vec<(usize, Vec<f64>)> {
        Vec::new()
    }

    /// The nominal model by an equation that is solved without a simulation, from which fits to `record` begin as
    /// well.
    fn estimated(&self, _record: usize) -> Option<Point> {
        None
    }

    /// Whole models with one effect at most from which fits to `record` begin as well, where `base` loses the
    /// motion.
    fn begun(&self, _base: &Point, _record: usize) -> Vec<Point> {
        Vec::new()
    }
}

/// Errors on all blocks of `record`, one after another.
pub fn all_errors<M: SimulatedModel>(model: &M, point: &Point, record: usize) -> Vec<f64> {
    (0..model.blocks())
        .filter(|&block| model.samples(record, block) > 0)
        .flat_map(|block| model.errors(point, record, block))
        .collect()
}

/// A model at a point with its errors on a record.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Where.
    pub point: Point,
    /// Errors, the blocks after one another.
    pub errors: Vec<f64>,
    /// `N ln Σe²` and priors.
    pub cost: f64,
}

/// Derivatives of the errors by the first coordinates of a point.
pub struct Columns {
    columns: Vec<Vec<f64>>,
}

/// Sum of the squares of `errors`.
pub fn squares(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e * e).sum()
}

fn prior<M: SimulatedModel>(model: &M, point: &Point) -> f64 {
    let nuisance = point.nuisance.iter().enumerate();
    let nuisance: f64 = nuisance.map(|(i, p)| (p / width(model, i)).powi(2)).sum();
    let shapes = point.prior_rows(model.candidates());
    nuisance
        + shapes
            .iter()
            .map(|(_, off, spread)| (off / spread).powi(2))
            .sum::<f64>()
}

/// Width of the prior of a nuisance coordinate; what belongs to a file is as free as ever.
fn width<M: SimulatedModel>(model: &M, i: usize) -> f64 {
    if model.block_of(i).is_some() {
        WEAK
    } else {
        model.prior_width()
    }
}

/// Errors and cost at `point`; none where they are not finite.
pub fn solution<M: SimulatedModel>(model: &M, point: &Point, record: usize) -> Option<Solution> {
    let errors = all_errors(model, point, record);
    let sum = squares(&errors);
    let cost = errors.len() as f64 * sum.max(f64::MIN_POSITIVE).ln() + prior(model, point);
    (sum.is_finite() && cost.is_finite()).then(|| Solution {
        point: point.clone(),
        errors,
        cost,
    })
}

fn coordinates(point: &Point) -> usize {
    point.nuisance.len() + point.effect_coordinates()
}

/// The derivative by one coordinate, zero where nothing depends on it; none where it is not finite.
fn column<M: SimulatedModel>(
    model: &M,
    at: &Solution,
    record: usize,
    coordinate: usize,
    central: bool,
) -> Option<Vec<f64>> {
    let is_nuisance = coordinate < at.point.nuisance.len();
    let size = if is_nuisance {
        DIFFERENCE.0
    } else if is_logarithmic(&at.point, coordinate, model.candidates()) {
        DIFFERENCE.2
    } else {
        DIFFERENCE.1
    };
    let only = is_nuisance.then(|| model.block_of(coordinate)).flatten();
    if only.is_some_and(|block| model.samples(record, block) == 0) {
        return Some(vec![0.0; at.errors.len()]);
    }
    let moved = |size: f64| {
        let mut step = vec![0.0; coordinates(&at.point)];
        step[coordinate] = size;
        let moved = model.moved(&at.point, &step);
        (moved != at.point).then_some(moved)
    };
    let errors = |point: &Point| match only {
        None => all_errors(model, point, record),
        Some(only) => {
            let before: usize = (0..only).map(|b| model.samples(record, b)).sum();
            let mut errors = at.errors.clone();
            let own = model.errors(point, record, only);
            errors[before..before + own.len()].copy_from_slice(&own);
            errors
        }
    };
    let (up, down) = (moved(size), moved(-size));
    let (mut column, other, width) = match (&up, &down) {
        (Some(up), Some(down)) if central => (errors(up), errors(down), 2.0 * size),
        (Some(up), _) => (errors(up), at.errors.clone(), size),
        (None, Some(down)) => (at.errors.clone(), errors(down), size),
        (None, None) => return Some(vec![0.0; at.errors.len()]),
    };
    for (c, o) in column.iter_mut().zip(&other) {
        *c = (*c - o) / width;
    }
    column.iter().all(|c| c.is_finite()).then_some(column)
}

fn is_logarithmic(point: &Point, coordinate: usize, candidates: &[Candidate]) -> bool {
    let mut scales = point
        .effects
        .iter()
        .flat_map(|(i, _)| candidates[*i].parameters.iter().map(|p| p.scale));
    scales.nth(coordinate - point.nuisance.len()) == Some(Scale::Logarithmic)
}

impl Columns {
    /// Derivatives by all coordinates of `at`.
    pub fn at<M: SimulatedModel>(model: &M, at: &Solution, record: usize) -> Option<Self> {
        Self::of(model, at, record, 0, false)
    }

    fn of<M: SimulatedModel>(
        model: &M,
        at: &Solution,
        record: usize,
        first: usize,
        central: bool,
    ) -> Option<Self> {
        let all = first..coordinates(&at.point);
        let columns = all.map(|i| column(model, at, record, i, central));
        Some(Self {
            columns: columns.collect::<Option<_>>()?,
        })
    }
}

/// What a fit may move.
pub enum Free<'a> {
    /// Everything.
    All,
    /// Everything; the derivatives by the first coordinates are these throughout.
    Frozen(&'a Columns),
    /// Coordinates for which this is true.
    Chosen(&'a dyn Fn(usize) -> bool),
}

/// Fits `start` to `record` in at most `iterations` steps.
pub fn least_squares<M: SimulatedModel>(
    model: &M,
    start: &Point,
    record: usize,
    free: &Free<'_>,
    iterations: usize,
) -> Option<Solution> {
    let start = solution(model, start, record)?;
    let search = Search {
        first: 1e-4,
        tries: [8, 2],
        carried_counts: 0.5,
        iterations,
        ..Search::default()
    };
    let mut fit = Fit::new(model, record, free, false);
    let found = minimise(&mut fit, start, &search).ok()?;
    Some(found.place)
}

/// Fits `start` to `record` to the end, also along a valley, in which difference quotients to one side are as large as
/// the slope.
pub fn polished<M: SimulatedModel>(
    model: &M,
    start: &Point,
    record: usize,
    iterations: usize,
) -> Option<Solution> {
    let near = least_squares(model, start, record, &Free::All, iterations)?;
    let search = Search {
        first: 1e-6,
        tries: [8, 2],
        iterations: POLISHING,
        ..Search::default()
    };
    let mut fit = Fit::new(model, record, &Free::All, true);
    let found = minimise(&mut fit, near, &search).ok()?;
    Some(found.place)
}

/// A fit to a record.
struct Fit<'a, M> {
    model: &'a M,
    record: usize,
    free: &'a Free<'a>,
    /// Derivatives that are not held.
    own: Vec<Vec<f64>>,
    /// Whether differences are to both sides.
    is_central: bool,
}

impl<'a, M: SimulatedModel> Fit<'a, M> {
    fn new(model: &'a M, record: usize, free: &'a Free<'a>, is_central: bool) -> Self {
        Self {
            model,
            record,
            free,
            own: Vec::new(),
            is_central,
        }
    }

    fn held(&self) -> &[Vec<f64>] {
        match self.free {
            Free::Frozen(columns) => &columns.columns,
            Free::All | Free::Chosen(_) => &[],
        }
    }

    fn fresh(&self, at: &Solution) -> Option<Vec<Vec<f64>>> {
        let own = (self.held().len()..coordinates(&at.point)).map(|i| match self.free {
            Free::Chosen(chosen) if !chosen(i) => Some(vec![0.0; at.errors.len()]),
            _ => column(self.model, at, self.record, i, self.is_central),
        });
        own.collect()
    }
}

impl<M: SimulatedModel> Problem for Fit<'_, M> {
    type Place = Solution;
    type Error = ();

    fn cost(&self, place: &Solution) -> f64 {
        place.cost
    }

    fn expand(&mut self, place: &Solution, is_carried: bool) -> Result<Quadratic, ()> {
        if !is_carried {
            self.own = self.fresh(place).ok_or(())?;
        }
        let columns: Vec<&Vec<f64>> = self.held().iter().chain(&self.own).collect();
        let variance = squares(&place.errors) / place.errors.len() as f64;
        let variance = variance.max(f64::MIN_POSITIVE);
        let (information, downhill) =
            normal(self.model, &place.point, &columns, &place.errors, variance);
        let mut quadratic = Quadratic::new(information, downhill);
        let information = &quadratic.information;
        quadratic.active.retain(|&i| information[(i, i)] > 0.0);
        Ok(quadratic)
    }

    fn step(&self, quadratic: &Quadratic, damping: f64) -> Option<DVector<f64>> {
        let step = quadratic.step(damping, 0.0)?;
        let nuisance = self.model.nuisance();
        let longest = step
            .rows(0, nuisance)
            .iter()
            .fold(0.0f64, |m, s| m.max(s.abs()));
        Some(if longest > LONGEST_STEP {
            step * (LONGEST_STEP / longest)
        } else {
            step
        })
    }

    fn stuck(&self, place: &Solution, step: &DVector<f64>) -> Vec<usize> {
        let moved = self.model.moved(&place.point, step.as_slice());
        let (before, after) = (flat(&place.point), flat(&moved));
        (0..step.len())
            .filter(|&i| step[i] != 0.0 && before[i] == after[i])
            .collect()
    }

    fn moved(&mut self, place: &Solution, step: &DVector<f64>) -> Option<Solution> {
        let moved = self.model.moved(&place.point, step.as_slice());
        solution(self.model, &moved, self.record)
    }

    fn has_settled(&self, taken: &Taken<'_, Solution>) -> bool {
        let still = match taken.gain < STILL * LARGEST_TIME {
            true => STILL * correlation_time(&taken.place.errors).clamp(1.0, LARGEST_TIME),
            false => STILL,
        };
        taken.gain < still
    }

    fn carry(
        &mut self,
        quadratic: &Quadratic,
        from: &Solution,
        taken: &Taken<'_, Solution>,
    ) -> bool {
        // Beside derivatives that are held, those that are not are few.
        let learns = self.held().is_empty() && !self.is_central;
        learns && learn(&mut self.own, &quadratic.information, from, taken.place)
    }
}

/// Changes derivatives of the errors so that they give the change from `before` to `after`, along that step and not
/// across it, each coordinate weighed by what the errors tell of it (Broyden, Mathematics of Computation 19, 1965).
/// False where the errors changed so differently that the derivatives are better computed again.
fn learn(
    columns: &mut [Vec<f64>],
    hessian: &DMatrix<f64>,
    before: &Solution,
    after: &Solution,
) -> bool {
    let ends = flat(&after.point).into_iter().zip(flat(&before.point));
    let step: Vec<f64> = ends.map(|(after, before)| after - before).collect();
    let weighed = step.iter().enumerate().map(|(i, s)| hessian[(i, i)] * s);
    let weighed: Vec<f64> = weighed.collect();
    let size = dot(&weighed, &step);
    if size.is_nan() || size <= 0.0 {
        return false;
    }
    let change = after.errors.iter().zip(&before.errors);
    let mut missed: Vec<f64> = change.map(|(after, before)| after - before).collect();
    let changed = squares(&missed);
    for (column, s) in columns.iter().zip(&step).filter(|(_, s)| **s != 0.0) {
        for (m, c) in missed.iter_mut().zip(column) {
            *m -= s * c;
        }
    }
    if squares(&missed) > MISSED * changed {
        return false;
    }
    for (column, weight) in columns.iter_mut().zip(weighed).filter(|(_, w)| *w != 0.0) {
        for (c, m) in column.iter_mut().zip(&missed) {
            *c += weight / size * m;
        }
    }
    true
}

/// All coordinates of a point.
fn flat(point: &Point) -> Vec<f64> {
    let effects = point.effects.iter().flat_map(|(_, q)| q.iter().copied());
    point.nuisance.iter().copied().chain(effects).collect()
}

/// Normal equations; rows of coordinates that nothing depends on are zero.
fn normal<M: SimulatedModel>(
    model: &M,
    point: &Point,
    columns: &[&Vec<f64>],
    errors: &[f64],
    variance: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let count = columns.len();
    let mut hessian = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    for i in 0..count {
        gradient[i] = -dot(columns[i], errors) / variance;
        for j in 0..=i {
            let value = dot(columns[i], columns[j]) / variance;
            hessian[(i, j)] = value;
            hessian[(j, i)] = value;
        }
    }
    let sees = |hessian: &DMatrix<f64>, i: usize| hessian[(i, i)] > 0.0;
    for (i, p) in point.nuisance.iter().enumerate() {
        if sees(&hessian, i) {
            let weight = width(model, i).powi(-2);
            hessian[(i, i)] += weight;
            gradient[i] -= p * weight;
        }
    }
    for (place, off, spread) in point.prior_rows(model.candidates()) {
        let i = point.nuisance.len() + place;
        hessian[(i, i)] += spread.powi(-2);
        gradient[i] -= off * spread.powi(-2);
    }
    (hessian, gradient)
}

/// One standard deviation of each coordinate at `at`: the larger of what correlated errors leave
/// (correlated samples counted once) and of the scatter of the gradient between runs of the record. Not a number
/// where the data do not see a coordinate.
pub fn deviations<M: SimulatedModel>(model: &M, at: &Solution, record: usize) -> Option<Vec<f64>> {
    let columns = Columns::of(model, at, record, 0, true)?.columns;
    let all: Vec<&Vec<f64>> = columns.iter().collect();
    let n = at.errors.len();
    let variance = (squares(&at.errors) / n as f64).max(f64::MIN_POSITIVE);
    let (hessian, _) = normal(model, &at.point, &all, &at.errors, variance);
    let places: Vec<usize> = (0..all.len()).filter(|&i| hessian[(i, i)] > 0.0).collect();
    let count = places.len();
    // Coordinates that the errors hardly see stand beside others.
    let size = |i: usize| hessian[(places[i], places[i])].sqrt();
    let reduced = DMatrix::from_fn(count, count, |i, j| {
        hessian[(places[i], places[j])] / (size(i) * size(j)) + if i == j { RIDGE } else { 0.0 }
    });
    let inverse = reduced.try_inverse()?;
    let inverse = DMatrix::from_fn(count, count, |i, j| inverse[(i, j)] / (size(i) * size(j)));
    let seen: Vec<&[f64]> = places.iter().map(|&i| all[i].as_slice()).collect();
    let scattered = scattered(&(&inverse / variance), &seen, &at.errors);
    let correlated = correlation_time(&at.errors);
    let mut deviations = vec![f64::NAN; all.len()];
    for (i, place) in places.iter().enumerate() {
        let variance = (inverse[(i, i)] * correlated).max(scattered[(i, i)]);
        deviations[*place] = variance.max(0.0).sqrt();
    }
    Some(deviations)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EffectParameter, Role};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// `y = a e^{-b t} + z_s`, a zero for each of two blocks; the effect adds `c t`.
    struct Decay {
        candidates: Vec<Candidate>,
        measured: [Vec<f64>; 2],
    }

    const TIMES: usize = 400;

    impl Decay {
        fn new(true_values: [f64; 5], noise: f64) -> Self {
            let mut random = ChaCha8Rng::seed_from_u64(3);
            let [a, b, c, zero, other] = true_values;
            let mut block = |zero: f64| -> Vec<f64> {
                (0..TIMES)
                    .map(|k| {
                        let t = k as f64 / TIMES as f64;
                        a * (-b * t).exp() + c * t + zero + noise * random.random_range(-1.0..1.0)
                    })
                    .collect()
            };
            let measured = [block(zero), block(other)];
            let drift = EffectParameter {
                name: "slope",
                unit: "1",
                scale: Scale::Linear(0.1),
                role: Role::Size { weak: 0.1 },
                bounds: (0.0, 5.0),
            };
            Self {
                candidates: vec![Candidate::new("drift", vec![drift], vec![vec![0.5]])],
                measured,
            }
        }
    }

    impl SimulatedModel for Decay {
        fn nuisance(&self) -> usize {
            4
        }
        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }
        fn blocks(&self) -> usize {
            2
        }
        fn block_of(&self, i: usize) -> Option<usize> {
            i.checked_sub(2)
        }
        fn samples(&self, _: usize, _: usize) -> usize {
            TIMES
        }
        fn errors(&self, point: &Point, _: usize, block: usize) -> Vec<f64> {
            // Stated: a = 1 ± 0.01, b = 1 ± 0.01, zeros 0 ± 0.01.
            let p = &point.nuisance;
            let (a, b) = (1.0 + 0.01 * p[0], 1.0 + 0.01 * p[1]);
            let slope = point.effects.first().map_or(0.0, |(_, q)| 0.1 * q[0]);
            let at = |k: usize| {
                let t = k as f64 / TIMES as f64;
                a * (-b * t).exp() + slope * t + 0.01 * p[2 + block]
            };
            let measured = self.measured[block].iter().enumerate();
            measured.map(|(k, y)| y - at(k)).collect()
        }
        fn folds(&self, _: usize) -> [usize; 2] {
            [0, 0]
        }
        fn screen(&self, record: usize) -> usize {
            record
        }
        fn held(&self) -> Self {
            Self {
                candidates: self.candidates.clone(),
                measured: self.measured.clone(),
            }
        }
        fn record_name(&self, _: usize) -> &'static str {
            "decay"
        }
    }

    fn origin() -> Point {
        Point {
            nuisance: vec![0.0; 4],
            effects: Vec::new(),
        }
    }

    #[test]
    fn parameters_far_outside_what_is_stated_are_found() {
        // A hundred and two hundred stated deviations away.
        let model = Decay::new([2.0, 3.0, 0.0, 0.3, -0.2], 0.01);
        let found = least_squares(&model, &origin(), 0, &Free::All, 200).unwrap();
        let p = &found.point.nuisance;
        assert!((p[0] - 100.0).abs() < 1.0, "{p:?}");
        assert!((p[1] - 200.0).abs() < 2.0, "{p:?}");
        assert!((p[2] - 30.0).abs() < 0.5 && (p[3] + 20.0).abs() < 0.5);
        let errors = deviations(&model, &found, 0).unwrap();
        let off = (p[0] - 100.0) / errors[0];
        assert!(errors[0] < 0.5 && off.abs() < 3.5, "{off} {errors:?}");
    }

    /// Where two steps end, the cost still falls; with differences to both sides it ends where it is flat.
    #[test]
    fn a_fit_that_ends_early_is_followed_to_where_the_cost_is_flat() {
        let model = Decay::new([1.5, 1.2, 0.0, 0.1, -0.1], 0.01);
        let early = least_squares(&model, &origin(), 0, &Free::All, 2).unwrap();
        let found = polished(&model, &origin(), 0, 2).unwrap();
        let steepest = |at: &Solution| {
            let slopes = (0..4).map(|i| {
                let cost = |by: f64| {
                    let mut moved = at.point.clone();
                    moved.nuisance[i] += by;
                    solution(&model, &moved, 0).unwrap().cost
                };
                ((cost(1e-4) - cost(-1e-4)) / 2e-4).abs()
            });
            slopes.fold(0.0, f64::max)
        };
        assert!(steepest(&early) > 1.0, "{}", steepest(&early));
        assert!(steepest(&found) < 0.01, "{}", steepest(&found));
    }

    /// Against the cost itself: it is twice the negative log likelihood where the variance is that of the errors.
    #[test]
    fn the_normal_equations_are_the_slope_and_the_curvature_of_the_cost() {
        let mut model = Decay::new([1.5, 1.2, 0.5, 0.1, -0.1], 0.01);
        // A detail of the form that the errors do not see: only what is stated holds it.
        model.candidates[0].parameters.push(EffectParameter {
            name: "bend",
            unit: "1",
            scale: Scale::Linear(0.5),
            role: Role::Shape {
                typical: 1.0,
                spread: 0.2,
            },
            bounds: (0.0, 5.0),
        });
        let point = Point {
            nuisance: vec![20.0, 10.0, 3.0, -4.0],
            effects: vec![(0, vec![2.0, 1.7])],
        };
        let at = solution(&model, &point, 0).unwrap();
        let columns = Columns::at(&model, &at, 0).unwrap().columns;
        let all: Vec<&Vec<f64>> = columns.iter().collect();
        let variance = squares(&at.errors) / at.errors.len() as f64;
        let (hessian, gradient) = normal(&model, &point, &all, &at.errors, variance);
        let count = 6;
        assert_eq!((hessian.nrows(), gradient.len()), (count, count));
        for i in 0..count {
            let cost = |by: f64| {
                let mut moved = point.clone();
                match i {
                    0..4 => moved.nuisance[i] += by,
                    _ => moved.effects[0].1[i - 4] += by,
                }
                solution(&model, &moved, 0).unwrap().cost
            };
            let step = 1e-4;
            let slope = (cost(step) - cost(-step)) / (2.0 * step);
            let off = (gradient[i] + 0.5 * slope).abs();
            assert!(
                off < 1e-3 * slope.abs().max(1.0),
                "{i}: {} {slope}",
                gradient[i]
            );
            for j in 0..count {
                let products = columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b);
                let mut expected = products.sum::<f64>() / variance;
                if i == j {
                    expected += match i {
                        0 | 1 => model.prior_width().powi(-2),
                        2 | 3 => WEAK.powi(-2),
                        4 => 0.0,
                        _ => 25.0,
                    };
                }
                let off = (hessian[(i, j)] - expected).abs();
                assert!(off <= 1e-9 * expected.abs().max(1.0), "{i} {j}");
            }
        }
    }

    #[test]
    fn derivatives_are_learned_along_a_step_and_stay_across_it() {
        let model = Decay::new([1.5, 1.2, 0.0, 0.0, 0.0], 0.01);
        let before = solution(&model, &origin(), 0).unwrap();
        let mut moved = origin();
        (moved.nuisance[0], moved.nuisance[1]) = (20.0, 15.0);
        let after = solution(&model, &moved, 0).unwrap();
        let mut columns = Columns::at(&model, &before, 0).unwrap().columns;
        let fresh = columns.clone();
        let all: Vec<&Vec<f64>> = columns.iter().collect();
        let (hessian, _) = normal(&model, &before.point, &all, &before.errors, 1.0);
        assert!(learn(&mut columns, &hessian, &before, &after));
        for (k, error) in after.errors.iter().enumerate() {
            let change = 20.0 * columns[0][k] + 15.0 * columns[1][k];
            assert!((change - (error - before.errors[k])).abs() < 1e-12);
        }
        assert_eq!(columns[2..], fresh[2..]);
        // So far away that nothing of them is right.
        moved.nuisance[1] = 1e4;
        let after = solution(&model, &moved, 0).unwrap();
        assert!(!learn(&mut columns, &hessian, &before, &after));
    }

    #[test]
    fn what_stands_at_its_bound_does_not_hold_the_rest() {
        let model = Decay::new([1.5, 1.2, -1.0, 0.0, 0.0], 0.01);
        let mut start = origin();
        start.effects.push((0, vec![0.0]));
        let found = least_squares(&model, &start, 0, &Free::All, 200).unwrap();
        let alone = least_squares(&model, &origin(), 0, &Free::All, 200).unwrap();
        assert_eq!(found.point.effects[0].1, [0.0]);
        assert!((squares(&found.errors) / squares(&alone.errors) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_block_by_itself_leaves_the_rest_alone() {
        let model = Decay::new([1.0, 1.0, 0.0, 0.0, -0.2], 0.001);
        let second = |i: usize| model.block_of(i) == Some(1);
        let free = Free::Chosen(&second);
        let found = least_squares(&model, &origin(), 0, &free, 20).unwrap();
        let p = &found.point.nuisance;
        assert_eq!(&p[..3], &[0.0; 3]);
        assert!((p[3] + 20.0).abs() < 0.1, "{p:?}");
    }
}
