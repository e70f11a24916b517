//! Real measurements: a servo-hydraulic press and a positioning drive, where they are present.

use std::ops::Range;

use identification::data::{Sheet, Wanted, fit_percent};
use identification::estimation::state_variable_filter::{Between, equal_lags, filter};
use identification::estimation::transfer_function::{Structure, identify};

/// Columns of a file under `measured`.
fn measured(file: &str) -> Vec<Vec<f64>> {
    let path = acceptance::shared::folder().join("measured").join(file);
    let wanted = Wanted {
        is_column: &|cell| cell.parse::<f64>().is_err(),
        header: "names of columns",
    };
    let sheet = Sheet::read(&path, wanted).unwrap();
    let column = |(place, head): (usize, &String)| sheet.full_column(place, head).unwrap();
    sheet.heads().iter().enumerate().map(column).collect()
}

#[needs::shared("measured")]
#[test]
fn the_press_is_one_pole_and_a_delay_of_four_milliseconds() {
    let columns = measured("servohydraulic_press/chirp_0A.csv");
    let (command, position) = (&columns[1], &columns[2]);
    let structure = Structure {
        order: 1,
        zeros: 0,
        longest_delay: Some(0.02),
        corner: 60.0,
        between: Between::Straight,
    };
    let found = identify(command, position, 0.001, structure).unwrap();
    println!(
        "pole {:.2} 1/s, gain {:.4}, delay {:.2} ms: error {:.2} %",
        -found.denominator[1],
        found.numerator[0] / found.denominator[1],
        1e3 * found.delay,
        100.0 * found.normalised_error
    );
    assert!(found.normalised_error < 0.0445);
    assert!((found.delay - 0.0045).abs() < 0.001);

    // Fitted to the first two thirds of the sweep, judged on the last, where it is fastest.
    let part = 2 * command.len() / 3;
    let unseen = |structure: Structure| {
        let found = identify(&command[..part], &position[..part], 0.001, structure).unwrap();
        let model = found.simulate(command, 0.001, structure.between);
        let unseen = 1.0 - 0.01 * fit_percent(&position[part..], &model[part..]);
        println!(
            "first two thirds: error {:.2} %; last third, not fitted: {:.2} %",
            100.0 * found.normalised_error,
            100.0 * unseen
        );
        unseen
    };
    let one_unseen = unseen(structure);

    let two = Structure {
        order: 2,
        longest_delay: None,
        ..structure
    };
    let found = identify(command, position, 0.001, two).unwrap();
    println!(
        "two poles {:?}: error {:.2} %",
        found.denominator,
        100.0 * found.normalised_error
    );
    assert!(found.normalised_error < 0.052);
    let two_unseen = unseen(two);
    assert!(
        one_unseen < 0.10 && two_unseen < 0.15,
        "{one_unseen} {two_unseen}"
    );
}

#[needs::shared("measured")]
#[test]
fn the_drive_s_force_follows_from_its_motion() {
    let columns = measured("positioning_drive/DATA_EMPS.csv");
    const NEWTON_PER_VOLT: f64 = 35.15065;
    let lag = equal_lags(200.0, 4);
    let position = filter(&columns[2], 0.001, &lag, Between::Straight);
    let force: Vec<f64> = columns[3].iter().map(|u| u * NEWTON_PER_VOLT).collect();
    let force = &filter(&force, 0.001, &lag, Between::Held)[0];
    // The sign is taken of the measured velocity and then filtered like the force.
    let count = force.len();
    let velocity: Vec<f64> = (0..count)
        .map(|k| {
            let (before, after) = (k.saturating_sub(4), (k + 4).min(count - 1));
            columns[2][after] - columns[2][before]
        })
        .collect();
    let sign = |wanted: f64| -> Vec<f64> {
        let of = |v: &f64| if v * wanted > 2e-6 { wanted } else { 0.0 };
        let raw: Vec<f64> = velocity.iter().map(of).collect();
        filter(&raw, 0.001, &lag, Between::Held)[0].clone()
    };
    let (forward, backward) = (sign(1.0), sign(-1.0));
    let both: Vec<f64> = forward.iter().zip(&backward).map(|(a, b)| a + b).collect();
    let one = vec![1.0; count];
    // Parameters fitted to some samples, and the relative error of the force on others.
    let fit = |columns: &[&Vec<f64>], fitted: Range<usize>, judged: Range<usize>| {
        let n = columns.len();
        let normal = nalgebra::DMatrix::from_fn(n, n, |i, j| {
            fitted
                .clone()
                .map(|k| columns[i][k] * columns[j][k])
                .sum::<f64>()
        });
        let right = nalgebra::DVector::from_fn(n, |i, _| {
            fitted
                .clone()
                .map(|k| columns[i][k] * force[k])
                .sum::<f64>()
        });
        let theta = normal.lu().solve(&right).unwrap();
        let model = |k: usize| (0..n).map(|i| theta[i] * columns[i][k]).sum::<f64>();
        let error: f64 = judged.clone().map(|k| (force[k] - model(k)).powi(2)).sum();
        let size: f64 = judged.map(|k| force[k].powi(2)).sum();
        (theta.as_slice().to_vec(), 100.0 * (error / size).sqrt())
    };
    let (all, half) = (200..count, count / 2);
    let columns = [&position[2], &position[1], &both, &one];
    let (symmetric, error) = fit(&columns, all.clone(), all.clone());
    println!(
        "symmetric: mass {:.2} kg, viscous {:.1} N s/m, Coulomb {:.2} N, offset {:.2} N: error {error:.2} %",
        symmetric[0], symmetric[1], symmetric[2], symmetric[3]
    );
    assert!(error < 4.08, "{error}");
    assert!((symmetric[0] - 95.0).abs() < 3.0);
    let turning: Vec<f64> = position[1].iter().map(|v| v.max(0.0)).collect();
    let (_, symmetric_unseen) = fit(&columns, 200..half, half..count);
    let columns = [&position[2], &position[1], &turning, &forward, &backward];
    let (_, error) = fit(&columns, all.clone(), all);
    let (_, unseen) = fit(&columns, 200..half, half..count);
    println!("asymmetric: error {error:.2} %");
    println!(
        "second half by the first: symmetric {symmetric_unseen:.2} %, asymmetric {unseen:.2} %"
    );
    assert!(error < 3.11, "{error}");
    assert!(symmetric_unseen < 4.08, "{symmetric_unseen}");
    assert!(unseen < 3.11, "{unseen}");
}
