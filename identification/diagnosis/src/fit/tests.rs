use super::*;
use crate::model::{Candidate, EffectParameter, Lesson, Role, Scale};
use nalgebra::{dmatrix, dvector};

const SAMPLES: usize = 203;

/// Records of a sine and a cosine of uncertain amplitudes, with a decay as the effect.
struct Waves {
    candidates: Vec<Candidate>,
    measured: Vec<Vec<f64>>,
    /// Share of its way that the sine's amplitude goes while the gain is held.
    share: f64,
}

fn parameter(name: &'static str, role: Role, bounds: (f64, f64)) -> EffectParameter {
    EffectParameter {
        name,
        unit: "1",
        scale: Scale::Linear(1.0),
        role,
        bounds,
    }
}

fn time(k: usize) -> f64 {
    0.05 * k as f64
}

impl Waves {
    /// Records of the given amplitudes and decay (size, rate), with a disturbance that no model has.
    fn of(amplitudes: [f64; 2], decay: [f64; 2], records: usize) -> Self {
        let role = Role::Size { weak: 0.1 };
        let rate = Role::Shape {
            typical: 1.0,
            spread: 0.5,
        };
        let candidates = vec![Candidate::new(
            "decay",
            vec![
                parameter("size", role, (-10.0, 10.0)),
                parameter("rate", rate, (0.1, 3.0)),
            ],
            Vec::new(),
        )];
        let other = |k: usize| (1.7 * k as f64).sin() + 0.3 * (0.9 * k as f64).cos();
        let measured = (0..records)
            .map(|record| {
                let sample = |k| Self::simulated(&amplitudes, &decay, k) + other(k + 31 * record);
                (0..SAMPLES).map(sample).collect()
            })
            .collect();
        Self {
            candidates,
            measured,
            share: 1.0,
        }
    }

    fn simulated(amplitudes: &[f64], decay: &[f64], k: usize) -> f64 {
        let t = time(k);
        let decaying = decay
            .first()
            .map_or(0.0, |size| size * (-decay[1] * t).exp());
        amplitudes[0] * t.sin() + amplitudes[1] * (2.0 * t).cos() + decaying
    }
}

impl ExtensibleModel for Waves {
    /// The sine's amplitude that it was designed for.
    type Predictor = f64;

    fn nuisance(&self) -> usize {
        2
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn records(&self) -> usize {
        self.measured.len()
    }

    fn record_name(&self, _: usize) -> &str {
        "record"
    }

    fn channels(&self) -> &[&'static str] {
        &["signal"]
    }

    fn regressors(&self, _: usize) -> Vec<(String, Vec<f64>)> {
        Vec::new()
    }

    fn with_learned_noise(&self, _: &Point, _: &[f64], _: &[usize]) -> Option<Lesson<Self>> {
        None
    }

    fn quiet_records(&self, _: &[usize]) -> Vec<usize> {
        Vec::new()
    }

    fn residual_count(&self, _: usize) -> usize {
        SAMPLES
    }

    fn sample_count(&self, _: usize) -> usize {
        SAMPLES
    }

    fn predictor(&self, point: &Point) -> Option<f64> {
        Some(point.nuisance[0])
    }

    fn log_determinant(&self, _: &f64) -> f64 {
        0.5
    }

    fn residuals(&self, designed: &f64, point: &Point, record: usize, out: &mut [f64]) -> bool {
        let decay = point.effects.first().map_or(&[][..], |(_, q)| q);
        let sine = designed + (point.nuisance[0] - designed) / self.share;
        let amplitudes = [sine, point.nuisance[1]];
        for (k, out) in out.iter_mut().enumerate() {
            *out = self.measured[record][k] - Self::simulated(&amplitudes, decay, k);
        }
        true
    }
}

fn bare() -> Point {
    Point {
        nuisance: vec![0.0, 0.0],
        effects: Vec::new(),
    }
}

fn with_decay(size: f64, rate: f64) -> Point {
    Point {
        effects: vec![(0, vec![size, rate])],
        ..bare()
    }
}

/// Normal equations of the amplitudes alone, their priors of one included, by sums.
fn by_hand(model: &Waves, records: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
    let (mut hessian, mut gradient) = (DMatrix::identity(2, 2), DVector::zeros(2));
    for &record in records {
        for (k, measured) in model.measured[record].iter().enumerate() {
            let row = dvector![time(k).sin(), (2.0 * time(k)).cos()];
            hessian += &row * row.transpose();
            gradient += row * *measured;
        }
    }
    (hessian, gradient)
}

/// Derivative of the cost by each coordinate, by differences of the cost itself.
fn slopes(model: &Waves, point: &Point, records: &[usize]) -> Vec<f64> {
    let count = point.nuisance.len() + point.effect_coordinates();
    let cost = |i: usize, size: f64| {
        let mut step = vec![0.0; count];
        step[i] = size;
        let moved = point.moved(&step, &model.candidates);
        evaluate(model, &moved, records).unwrap().cost
    };
    (0..count)
        .map(|i| (cost(i, 1e-4) - cost(i, -1e-4)) / 2e-4)
        .collect()
}

fn close(a: &[f64], b: &[f64], within: f64) {
    assert_eq!(a.len(), b.len());
    for (x, y) in a.iter().zip(b) {
        assert!((x - y).abs() <= within, "{a:?} {b:?}");
    }
}

#[test]
fn the_cost_is_squares_determinant_and_priors() {
    let model = Waves::of([0.0, 0.0], [0.0, 1.0], 2);
    let mut point = with_decay(0.0, 1.5);
    let noise = |record: usize| squares(&model.measured[record]);
    let fit = evaluate(&model, &point, &[0, 1]).unwrap();
    assert_eq!(fit.residuals.len(), 2 * SAMPLES);
    let samples = 2.0 * SAMPLES as f64;
    // The rate is one standard deviation from its usual value.
    assert!((fit.cost - (noise(0) + noise(1) + 0.5 * samples + 1.0)).abs() < 1e-9);
    point.nuisance[0] = f64::NAN;
    assert!(evaluate(&model, &point, &[0]).is_none());
}

#[test]
fn products_are_those_of_plain_sums() {
    for count in [0, 1, 3, 4, 7, 1025] {
        let a: Vec<f64> = (0..count).map(|k| (0.3 * k as f64).sin()).collect();
        let b: Vec<f64> = (0..count).map(|k| 1.0 / (k as f64 + 2.0)).collect();
        let plain: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
        assert!((dot(&a, &b) - plain).abs() < 1e-12, "{count}");
    }
}

#[test]
fn a_linear_fit_is_the_solution_of_the_normal_equations() {
    let model = Waves::of([2.5, -1.5], [0.0, 1.0], 2);
    let records = [0, 1];
    let (hessian, gradient) = by_hand(&model, &records);
    let inverse = hessian.clone().try_inverse().unwrap();
    let expected = &inverse * &gradient;
    let start = evaluate(&model, &bare(), &records).unwrap();
    let jacobian = Jacobian::at(&model, &start, &records).unwrap();
    let covariance = jacobian.covariance(&model, &start).unwrap();
    close(covariance.as_slice(), inverse.as_slice(), 1e-9);
    for known in [None, Some(jacobian)] {
        let (fit, jacobian) = polish(&model, &start, &records, known, 8, 0.0).unwrap();
        close(&fit.point.nuisance, expected.as_slice(), 1e-6);
        // The scatter between runs of a noise without bursts is that of the whole.
        let deviations = jacobian.deviations(&model, &fit).unwrap();
        for (i, own) in deviations.iter().enumerate() {
            let white = CALIBRATED * inverse[(i, i)].sqrt();
            assert!((0.999..1.5).contains(&(own / white)), "{own} for {white}");
        }
    }
    // One record alone gives other values.
    let (other, _) = polish(
        &model,
        &evaluate(&model, &bare(), &[0]).unwrap(),
        &[0],
        None,
        8,
        0.0,
    )
    .unwrap();
    assert!((other.point.nuisance[0] - expected[0]).abs() > 1e-4);
}

#[test]
fn a_fit_ends_where_the_cost_is_flat() {
    let model = Waves::of([1.0, 0.5], [4.0, 1.4], 1);
    let start = evaluate(&model, &with_decay(1.0, 0.6), &[0]).unwrap();
    let (best, jacobian) = polish(&model, &start, &[0], None, 30, 0.0).unwrap();
    assert!(best.cost < start.cost - 100.0);
    close(&slopes(&model, &best.point, &[0]), &[0.0; 4], 0.05);
    let (_, q) = &best.point.effects[0];
    assert!(
        (q[0] - 4.0).abs() < 1.0 && (q[1] - 1.4).abs() < 0.5,
        "{q:?}"
    );
    // The derivatives that come back are those there.
    let fresh = Jacobian::at(&model, &best, &[0]).unwrap();
    for (own, fresh) in jacobian.columns.iter().zip(&fresh.columns) {
        close(own, fresh, 0.02);
    }
    // The amplitudes' derivatives held, those of the effect computed.
    let bare_start = evaluate(&model, &bare(), &[0]).unwrap();
    let frozen = Jacobian::at(&model, &bare_start, &[0]).unwrap();
    let held = fit(&model, &with_decay(1.0, 0.6), &[0], &frozen, 30).unwrap();
    assert!(
        (held.cost - best.cost).abs() < 0.1,
        "{} {}",
        held.cost,
        best.cost
    );
    // Too few iterations end before, and no fit is worse than its start.
    let short = fit(&model, &with_decay(1.0, 0.6), &[0], &frozen, 1).unwrap();
    assert!(short.cost > held.cost && short.cost < start.cost);
    let again = fit(&model, &best.point, &[0], &frozen, 3).unwrap();
    assert!(again.cost <= best.cost);
}

#[test]
fn a_fit_stops_at_a_bound() {
    let model = Waves::of([1.0, 0.5], [25.0, 1.0], 1);
    let start = evaluate(&model, &with_decay(9.0, 1.0), &[0]).unwrap();
    let (best, _) = polish(&model, &start, &[0], None, 30, 0.0).unwrap();
    assert_eq!(best.point.effects[0].1[0], 10.0);
    // At the bound derivatives are those of the side that is left.
    let inside = Jacobian::at(
        &model,
        &evaluate(&model, &with_decay(2.0, 1.0), &[0]).unwrap(),
        &[0],
    )
    .unwrap();
    let at = evaluate(&model, &with_decay(10.0, 1.0), &[0]).unwrap();
    close(
        &Jacobian::at(&model, &at, &[0]).unwrap().columns[2],
        &inside.columns[2],
        1e-9,
    );
    close(
        &Jacobian::central(&model, &at, &[0]).unwrap().columns[2],
        &inside.columns[2],
        1e-9,
    );
}

#[test]
fn central_derivatives_are_those_of_the_closed_form() {
    let model = Waves::of([1.0, 0.5], [4.0, 1.4], 1);
    let at = evaluate(&model, &with_decay(4.0, 1.4), &[0]).unwrap();
    let central = Jacobian::central(&model, &at, &[0]).unwrap();
    for k in 0..SAMPLES {
        let t = time(k);
        let fade = (-1.4 * t).exp();
        let exact = [-t.sin(), -(2.0 * t).cos(), -fade, 4.0 * t * fade];
        let own: Vec<f64> = central.columns.iter().map(|column| column[k]).collect();
        close(&own, &exact, 1e-5);
    }
    for (i, j) in [(0, 0), (1, 3), (3, 1)] {
        let sum: f64 = central.columns[i]
            .iter()
            .zip(central.columns[j].iter())
            .map(|(a, b)| a * b)
            .sum();
        assert!((central.gram[(i, j)] - sum).abs() < 1e-9);
    }
}

#[test]
fn derivatives_are_added_and_cut_with_their_products() {
    let model = Waves::of([1.0, 0.5], [4.0, 1.4], 1);
    let first = evaluate(&model, &bare(), &[0]).unwrap();
    let bare = Jacobian::at(&model, &first, &[0]).unwrap();
    let whole = evaluate(&model, &with_decay(4.0, 1.4), &[0]).unwrap();
    let all = Jacobian::at(&model, &whole, &[0]).unwrap();
    let extended = bare.extended(&model, &whole, &[0]).unwrap();
    assert_eq!(extended.columns.len(), 4);
    assert!((&extended.gram - &all.gram).amax() < 1e-9 * all.gram.amax());
    let cut = all.begin(50);
    assert!(cut.columns.iter().all(|column| column.len() == 50));
    let products = dot(&all.columns[3][..50], &all.columns[2][..50]);
    assert!((cut.gram[(3, 2)] - products).abs() < 1e-12);
    assert!((cut.gram[(2, 3)] - products).abs() < 1e-12);
}

/// Change of the residuals along `step`.
fn along(jacobian: &Jacobian, step: &[f64]) -> Vec<f64> {
    let columns = || step.iter().zip(&jacobian.columns);
    (0..jacobian.columns[0].len())
        .map(|k| columns().map(|(s, column)| s * column[k]).sum())
        .collect()
}

/// As `jacobian`, its products computed from its columns.
fn computed(jacobian: &Jacobian) -> Jacobian {
    Jacobian::of(jacobian.columns.iter().map(|own| own.to_vec()).collect())
}

#[test]
fn long_columns_learn_in_pieces() {
    let wave = |f: f64| (0..2 * PIECE + 5).map(|k| (f * k as f64).sin()).collect();
    let mut jacobian = Jacobian::of(vec![wave(0.1), wave(0.37), wave(0.02)]);
    let (step, change): (_, Vec<f64>) = (dvector![0.4, 0.0, -1.3], wave(0.2));
    jacobian.learn(&step, &change);
    close(&along(&jacobian, step.as_slice()), &change, 1e-12);
    let again = computed(&jacobian);
    assert!((&jacobian.gram - &again.gram).amax() < 1e-9);
}

#[test]
fn derivatives_learn_along_a_step_and_not_across_it() {
    let columns = vec![vec![1.0, 0.0, 2.0], vec![0.5, 1.0, 0.0]];
    let mut jacobian = Jacobian::of(columns.clone());
    let before = jacobian.clone();
    let step = dvector![0.3, -0.8];
    let change = [1.0, 2.0, -1.0];
    jacobian.learn(&step, &change);
    close(&along(&jacobian, step.as_slice()), &change, 1e-12);
    // Across it in the sense of what the residuals tell: weights 5 and 1.25.
    let across = [1.25 * 0.8, 5.0 * 0.3];
    close(&along(&jacobian, &across), &along(&before, &across), 1e-12);
    assert_eq!(before.columns, Jacobian::of(columns).columns);
    let again = computed(&jacobian);
    assert!((&jacobian.gram - &again.gram).amax() < 1e-12);
    // No step teaches anything, nor does one whose change is rounding.
    jacobian.learn(&dvector![0.0, 0.0], &change);
    jacobian.learn(&dvector![1e-15, 1e-15], &[1e-16, -1e-16, 0.0]);
    assert_eq!(jacobian.columns, again.columns);
}

#[test]
fn a_fit_goes_on_where_the_gain_follows() {
    let mut model = Waves::of([20.0, 1.0], [0.0, 1.0], 1);
    let start = evaluate(&model, &bare(), &[0]).unwrap();
    let (at_once, _) = polish(&model, &start, &[0], None, 8, 0.0).unwrap();
    model.share = 0.05;
    let (best, _) = polish(&model, &start, &[0], None, 8, 0.0).unwrap();
    close(&best.point.nuisance, &at_once.point.nuisance, 0.05);
}

#[test]
fn a_score_is_what_a_refit_with_the_column_gains() {
    let model = Waves::of([2.5, -1.5], [0.0, 1.0], 1);
    let start = evaluate(&model, &bare(), &[0]).unwrap();
    let (best, jacobian) = polish(&model, &start, &[0], None, 8, 0.0).unwrap();
    let scorer = jacobian.scorer(&model, &best).unwrap();
    let column: Vec<f64> = (0..SAMPLES).map(|k| (1.7 * k as f64).sin()).collect();
    let (gain, amplitude) = scorer.score(&column);
    // By hand: three amplitudes, the third without a prior.
    let (two, pull) = by_hand(&model, &[0]);
    let mut hessian = DMatrix::zeros(3, 3);
    hessian.view_mut((0, 0), (2, 2)).copy_from(&two);
    let mut gradient = dvector![pull[0], pull[1], 0.0];
    for (k, value) in column.iter().enumerate() {
        let row = [time(k).sin(), (2.0 * time(k)).cos()];
        for (i, own) in row.iter().enumerate() {
            hessian[(i, 2)] -= own * value;
            hessian[(2, i)] -= own * value;
        }
        hessian[(2, 2)] += value * value;
        gradient[2] -= value * model.measured[0][k];
    }
    let three = hessian.try_inverse().unwrap() * &gradient;
    let without = two.try_inverse().unwrap() * &pull;
    let expected = gradient.dot(&three) - pull.dot(&without);
    assert!(
        (gain - expected).abs() < 1e-6 * expected,
        "{gain} {expected}"
    );
    assert!((amplitude - three[2]).abs() < 1e-6);
    // A column of nothing gains nothing.
    assert_eq!(scorer.score(&[0.0; SAMPLES]), (0.0, 0.0));
}

#[test]
fn the_nuisance_alone_is_held_within_its_longest_step() {
    let hessian = dmatrix![0.01, 0.0; 0.0, 1.0];
    // Held by 1, then 4, then 16.
    let step = bounded_step(hessian.clone(), &dvector![20.0, 7.0], 1).unwrap();
    close(step.as_slice(), &[20.0 / 16.01, 7.0], 1e-12);
    let free = bounded_step(hessian.clone(), &dvector![0.03, 7.0], 1).unwrap();
    close(free.as_slice(), &[3.0, 7.0], 1e-12);
    assert!(bounded_step(-hessian, &dvector![1.0, 1.0], 1).is_none());
}
