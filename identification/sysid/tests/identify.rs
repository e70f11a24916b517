//! Identification of systems that are known: what goes in comes out.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sysid::input_matrices::{Form, refit};
use sysid::instrumental_variables::{
    Signal, Signals, poles, refine_open_loop, regress, simulate, stabilised,
};
use sysid::least_squares::{Triangular, reduce};
use sysid::state_variable_filter::Between;
use sysid::subspace::{Options, SubspaceModel, identify};
use sysid::transfer_function::{self, Structure};

const PERIOD: f64 = 0.002;

fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    generator.random_range(-1.0..1.0)
}

/// A system of two states, two inputs and two outputs.
struct Known {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

fn known(through: f64) -> Known {
    Known {
        a: DMatrix::from_row_slice(2, 2, &[0.9, 0.2, -0.3, 0.7]),
        b: DMatrix::from_row_slice(2, 2, &[0.5, -0.2, 1.0, 0.3]),
        c: DMatrix::from_row_slice(2, 2, &[1.0, 0.4, -0.5, 0.8]),
        d: DMatrix::from_row_slice(2, 2, &[0.3, -0.1, 0.2, 0.6]) * through,
    }
}

/// Inputs about 3 and -2, outputs about 5 and 7 with a little noise.
fn data(system: &Known, samples: usize, seed: u64) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut state = DVector::zeros(2);
    let (mut inputs, mut outputs) = (vec![Vec::new(); 2], vec![Vec::new(); 2]);
    for _ in 0..samples {
        let u = DVector::from_fn(2, |_, _| uniform(&mut generator));
        let y = &system.c * &state + &system.d * &u;
        state = &system.a * &state + &system.b * &u;
        for (channel, (level, size)) in [(3.0, 1.0), (-2.0, 1.0)].into_iter().enumerate() {
            inputs[channel].push(level + size * u[channel]);
        }
        for (channel, level) in [5.0, 7.0].into_iter().enumerate() {
            outputs[channel].push(level + y[channel] + 1e-3 * uniform(&mut generator));
        }
    }
    (inputs, outputs)
}

/// The largest error of the response to an impulse, over 30 samples.
fn impulse_error(found: &SubspaceModel, system: &Known) -> f64 {
    let own = &found.system;
    let mut worst = (&own.d - &system.d).amax();
    let (mut one, mut other) = (own.b.clone(), system.b.clone());
    for _ in 0..30 {
        worst = worst.max((&own.c * &one - &system.c * &other).amax());
        one = &own.a * one;
        other = &system.a * other;
    }
    worst
}

fn slices(channels: &[Vec<f64>]) -> Vec<&[f64]> {
    channels.iter().map(Vec::as_slice).collect()
}

#[test]
fn the_subspace_method_finds_order_impulse_response_and_levels() {
    for through in [0.0, 1.0] {
        let system = known(through);
        let (inputs, outputs) = data(&system, 6000, 5);
        let options = Options {
            feedthrough: through > 0.0,
            ..Options::default()
        };
        let (u, y) = (slices(&inputs), slices(&outputs));
        let found = identify(&u, &y, PERIOD, options).unwrap();
        assert_eq!(found.system.a.nrows(), 2);
        assert!(found.singular_values[1] > 20.0 * found.singular_values[2]);
        let error = impulse_error(&found, &system);
        assert!(error < 2e-3, "{error}");
        for (mean, channel) in found.means.1.iter().zip(&outputs) {
            let own = channel.iter().sum::<f64>() / channel.len() as f64;
            assert!((mean - own).abs() < 1e-9);
        }
        // A sample ahead, only the noise is left: 1e-3 at most on each side.
        let past = options.past;
        for (predicted, measured) in found.predictions.iter().zip(&outputs) {
            assert_eq!(predicted.len(), measured.len());
            assert_eq!(predicted[..past], measured[..past]);
            let pairs = predicted.iter().zip(measured).skip(past);
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 5e-3, "{worst}");
        }
    }
    let (inputs, outputs) = data(&known(0.0), 100, 5);
    let refused = identify(
        &slices(&inputs),
        &slices(&outputs),
        PERIOD,
        Options::default(),
    );
    let said = refused.unwrap_err().to_string();
    // 12 of the past, and four times its 48 values.
    assert!(
        said.contains("100 samples are too short to fit 48 parameters"),
        "{said}"
    );
    assert!(said.contains("204 samples (0.4 s)"), "{said}");
}

#[test]
fn input_matrices_are_found_again_from_the_outputs() {
    for (through, form) in [
        (0.0, Form::Simulated),
        (1.0, Form::Simulated),
        (1.0, Form::Predicted),
    ] {
        let system = known(through);
        let (inputs, outputs) = data(&system, 4000, 11);
        let (u, y) = (slices(&inputs), slices(&outputs));
        let options = Options {
            order: Some(2),
            feedthrough: through > 0.0,
            ..Options::default()
        };
        let mut found = identify(&u, &y, PERIOD, options).unwrap();
        found.system.b *= 3.0;
        found.system.d *= -2.0;
        found.means.1[0] += 0.5;
        let refitted = refit(&found, &u, &y, through > 0.0, form).unwrap();
        let error = impulse_error(&refitted, &system);
        assert!(error < 2e-3, "{error}");
        // Inputs about their means give outputs about these levels.
        let gain =
            &system.c * (DMatrix::identity(2, 2) - &system.a).try_inverse().unwrap() * &system.b
                + &system.d;
        let off = DVector::from_vec(vec![refitted.means.0[0] - 3.0, refitted.means.0[1] + 2.0]);
        let expected = DVector::from_vec(vec![5.0, 7.0]) + gain * off;
        for (mean, level) in refitted.means.1.iter().zip(expected.iter()) {
            assert!((mean - level).abs() < 2e-3, "{mean} {level}");
        }
    }
}

/// `(b1 s + b0) / (s² + a1 s + a0)` from rest under a held input, by Runge and Kutta in small steps.
fn continuous([b1, b0]: [f64; 2], [a1, a0]: [f64; 2], input: &[f64], period: f64) -> Vec<f64> {
    let steps = 40;
    let h = period / f64::from(steps);
    let mut x = [0.0, 0.0];
    let mut output = Vec::new();
    for &u in input {
        output.push(b0 * x[0] + b1 * x[1]);
        let slope = |x: [f64; 2]| [x[1], u - a1 * x[1] - a0 * x[0]];
        for _ in 0..steps {
            let along = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + h * k[0], x[1] + h * k[1]];
            let k1 = slope(x);
            let k2 = slope(along(x, k1, 0.5 * h));
            let k3 = slope(along(x, k2, 0.5 * h));
            let k4 = slope(along(x, k3, h));
            for i in 0..2 {
                x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
    }
    output
}

/// A random input that is held over twenty samples each.
fn levels(samples: usize, seed: u64) -> Vec<f64> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let values: Vec<f64> = (0..=samples / 20)
        .map(|_| uniform(&mut generator))
        .collect();
    (0..samples).map(|k| values[k / 20]).collect()
}

#[test]
fn instrumental_variables_find_a_transfer_function_through_noise() {
    let (numerator, denominator) = ([3.0, 100.0], [4.0, 100.0]);
    let input = levels(20_000, 3);
    let clean = continuous(numerator, denominator, &input, PERIOD);
    let mut generator = ChaCha8Rng::seed_from_u64(8);
    let size = clean
        .iter()
        .fold(0.0_f64, |most, value| most.max(value.abs()));
    let noisy: Vec<f64> = clean
        .iter()
        .map(|value| value + 0.05 * size * uniform(&mut generator))
        .collect();
    let found = refine_open_loop(&input, &noisy, PERIOD, 2, 1, 30.0, Between::Held).unwrap();
    assert_eq!(found.denominator[0], 1.0);
    for (value, expected) in [
        (found.denominator[1], 4.0),
        (found.denominator[2], 100.0),
        (found.numerators[0][0], 3.0),
        (found.numerators[0][1], 100.0),
    ] {
        assert!((value / expected - 1.0).abs() < 0.03, "{found:?}");
    }
    let signals = Signals {
        output: Signal::exact(&noisy, Between::Straight),
        inputs: vec![Signal::exact(&input, Between::Held)],
    };
    let filter = [1.0, 60.0, 900.0];
    // What is known is not fitted.
    let given = regress(&[signals], &[vec![1, 0]], PERIOD, &filter, &[(0, 100.0)]).unwrap();
    assert_eq!(given.denominator[2], 100.0);
    // The model's own output is that of the other integration.
    let simulated = simulate(
        &numerator,
        &[1.0, 4.0, 100.0],
        &input,
        PERIOD,
        Between::Held,
    );
    let moved: Vec<f64> = input.iter().map(|value| value - input[0]).collect();
    let expected = continuous(numerator, denominator, &moved, PERIOD);
    for (a, b) in simulated.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-6 * size, "{a} {b}");
    }
    let short = regress(
        &[Signals {
            output: Signal::exact(&noisy[..40], Between::Straight),
            inputs: vec![Signal::exact(&input[..40], Between::Held)],
        }],
        &[vec![1, 0]],
        PERIOD,
        &filter,
        &[],
    );
    // 5 unknowns need 50 rows behind the quarter in which the filter settles.
    let said = short.unwrap_err().to_string();
    assert!(
        said.contains("40 samples are too short to fit 5 parameters"),
        "{said}"
    );
    assert!(said.contains("at least 60 samples (0.1 s)"), "{said}");
}

#[test]
fn unstable_roots_are_mirrored() {
    // (s - 1)(s + 2), and (s - 1)² + 4.
    for (given, expected) in [
        ([1.0, 1.0, -2.0], [1.0, 3.0, 2.0]),
        ([1.0, -2.0, 5.0], [1.0, 2.0, 5.0]),
        ([1.0, 3.0, 2.0], [1.0, 3.0, 2.0]),
    ] {
        for (a, b) in stabilised(&given).iter().zip(expected) {
            assert!((a - b).abs() < 1e-9, "{given:?}");
        }
    }
    let mut found: Vec<f64> = poles(&[1.0, 1.0, -2.0])
        .iter()
        .map(|pole| pole.re)
        .collect();
    found.sort_by(f64::total_cmp);
    assert!((found[0] + 2.0).abs() < 1e-9 && (found[1] - 1.0).abs() < 1e-9);
}

#[test]
fn tall_problems_have_the_solution_of_their_normal_equations() {
    // More rows than a block has.
    let (rows, n) = (1300, 4);
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let mut x = DMatrix::from_fn(rows, n, |_, _| uniform(&mut generator));
    let y = DMatrix::from_fn(rows, 2, |_, _| uniform(&mut generator));
    let fill = |x: &DMatrix<f64>, k: usize, row: &mut [f64]| {
        for j in 0..n {
            row[j] = x[(k, j)];
        }
        row[n] = y[(k, 0)];
        row[n + 1] = y[(k, 1)];
    };
    let triangular = reduce(rows, n, 2, |k, row| fill(&x, k, row));
    let (found, lost) = triangular.solve(1e-12).unwrap();
    let expected = (x.transpose() * &x)
        .lu()
        .solve(&(x.transpose() * &y))
        .unwrap();
    assert_eq!(lost, 0);
    assert!((&found - &expected).amax() < 1e-12);
    // All columns but the last one, which is the second target: the residual of both on that one.
    let wide = DMatrix::from_fn(
        rows,
        n + 1,
        |k, j| if j < n { x[(k, j)] } else { y[(k, 0)] },
    );
    let target = y.column(1);
    let fitted = (wide.transpose() * &wide)
        .lu()
        .solve(&(wide.transpose() * target))
        .unwrap();
    let residual = (&wide * fitted - target).norm_squared();
    assert!((triangular.left(n + 1) / residual - 1.0).abs() < 1e-10);

    let all = DMatrix::from_fn(
        rows,
        n + 2,
        |k, j| if j < n { x[(k, j)] } else { y[(k, j - n)] },
    );
    let products = Triangular::from_products(all.transpose() * &all, n).unwrap();
    assert!((products.solve_directly().unwrap() - &expected).amax() < 1e-12);
    // A column that nearly is another one: squaring would cost too many digits.
    for k in 0..rows {
        x[(k, 3)] = x[(k, 2)] + 1e-6 * x[(k, 3)];
    }
    let near = DMatrix::from_fn(
        rows,
        n + 2,
        |k, j| if j < n { x[(k, j)] } else { y[(k, j - n)] },
    );
    assert!(Triangular::from_products(near.transpose() * &near, n).is_none());
    // One that is another one is left out, and both share what it had.
    let same = x.column(2).into_owned();
    x.set_column(3, &same);
    let (found, lost) = reduce(rows, n, 2, |k, row| fill(&x, k, row))
        .solve(1e-9)
        .unwrap();
    assert_eq!(lost, 1);
    let three = x.columns(0, 3).into_owned();
    let expected = (three.transpose() * &three)
        .lu()
        .solve(&(three.transpose() * &y))
        .unwrap();
    for target in 0..2 {
        assert!((found[(2, target)] - found[(3, target)]).abs() < 1e-9);
        assert!((2.0 * found[(2, target)] - expected[(2, target)]).abs() < 1e-9);
    }
}

/// Held inputs come six samples later; an offset and noise are added.
#[test]
fn a_transfer_function_is_found_with_its_delay_offset_and_errors() {
    let (numerator, denominator) = ([3.0, 100.0], [4.0, 100.0]);
    let delay = 6;
    let input = levels(2500, 4);
    let late: Vec<f64> = (0..input.len())
        .map(|k| input[k.saturating_sub(delay)])
        .collect();
    let from_rest: Vec<f64> = late.iter().map(|value| value - late[0]).collect();
    let clean = continuous(numerator, denominator, &from_rest, PERIOD);
    let mut generator = ChaCha8Rng::seed_from_u64(9);
    let noise = 0.02;
    let output: Vec<f64> = clean
        .iter()
        .map(|value| 0.7 + value + noise * uniform(&mut generator))
        .collect();
    let structure = Structure {
        order: 2,
        zeros: 1,
        longest_delay: Some(0.04),
        corner: 30.0,
        between: Between::Held,
    };
    let found = transfer_function::identify(&input, &output, PERIOD, structure).unwrap();
    assert_eq!((found.numerator.len(), found.denominator.len()), (2, 3));
    assert_eq!(found.denominator[0], 1.0);
    let own = [
        found.numerator[0],
        found.numerator[1],
        found.denominator[1],
        found.denominator[2],
        found.delay,
    ];
    let truth = [3.0, 100.0, 4.0, 100.0, PERIOD * delay as f64];
    assert_eq!(found.standard_error.len(), 5);
    for ((own, truth), error) in own.iter().zip(truth).zip(&found.standard_error) {
        assert!((own - truth).abs() < 5.0 * error, "{own} {truth} {error}");
        assert!(*error > 0.0 && *error < 0.02 * truth, "{own}: {error}");
    }
    assert!((found.offset - 0.7).abs() < 2e-3, "{}", found.offset);
    // What is left is the noise, uniform over 2 `noise`.
    let mean = output.iter().sum::<f64>() / output.len() as f64;
    let spread = output.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    let size = (spread / output.len() as f64).sqrt();
    let expected = noise / 3.0_f64.sqrt() / size;
    assert!(
        (found.normalised_error / expected - 1.0).abs() < 0.05,
        "{}",
        found.normalised_error
    );
    let again = found.simulate(&input, PERIOD, Between::Held);
    for (k, (value, clean)) in again.iter().zip(&clean).enumerate() {
        let expected = 0.7 + clean;
        assert!((value - expected).abs() < 0.02, "{k}: {value} {expected}");
        assert!((found.simulated[k] - expected).abs() < 0.02, "{k}");
    }
    // Without a delay, the shift is not found.
    let none = Structure {
        longest_delay: None,
        ..structure
    };
    let without = transfer_function::identify(&input, &output, PERIOD, none).unwrap();
    assert_eq!(without.delay, 0.0);
    assert!(
        without.normalised_error > 1.1 * found.normalised_error,
        "{} {}",
        without.normalised_error,
        found.normalised_error
    );
    for (input, output, what) in [
        (vec![2.0; 100], levels(100, 1), "the input is constant"),
        (levels(100, 1), vec![2.0; 100], "the output is constant"),
    ] {
        let refused = transfer_function::identify(&input, &output, PERIOD, structure);
        assert!(refused.unwrap_err().to_string().contains(what));
    }
}

#[test]
fn two_experiments_give_one_transfer_function_and_an_offset_each() {
    let (numerator, denominator) = ([3.0, 100.0], [4.0, 100.0]);
    let data = [(5, 0.5), (6, -2.0)].map(|(seed, offset)| {
        let input = levels(4000, seed);
        let output = continuous(numerator, denominator, &input, PERIOD);
        let output: Vec<f64> = output.iter().map(|value| value + offset).collect();
        (input, output)
    });
    let signals: Vec<Signals> = data
        .iter()
        .map(|(input, output)| Signals {
            output: Signal::exact(output, Between::Straight),
            inputs: vec![Signal::exact(input, Between::Held)],
        })
        .collect();
    let filter = [1.0, 60.0, 900.0];
    let found = regress(&signals, &[vec![1, 0]], PERIOD, &filter, &[]).unwrap();
    for (value, expected) in [
        (found.denominator[1], 4.0),
        (found.denominator[2], 100.0),
        (found.numerators[0][0], 3.0),
        (found.numerators[0][1], 100.0),
    ] {
        let error: f64 = value / expected - 1.0;
        assert!(error.abs() < 0.01, "{found:?}");
    }
    // What is known is taken from both before the rest is fitted.
    for (power, value) in [(0, 100.0), (1, 4.0)] {
        let given = regress(&signals, &[vec![1, 0]], PERIOD, &filter, &[(power, value)]).unwrap();
        assert_eq!(given.denominator[2 - power], value);
        let rest = given.denominator[1 + power] / [4.0, 100.0][power] - 1.0;
        let gain = given.numerators[0][1] / 100.0 - 1.0;
        assert!(rest.abs() < 0.01 && gain.abs() < 0.01, "{given:?}");
    }
}
