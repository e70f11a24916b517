//! Identifies rigs drawn widely about the physical one, each from one recording of its own: how many
//! make a model, how far mass and friction are off, how many 95 % intervals hold them, and how well
//! the model predicts another motion.
//!
//! `cargo run --release -p acceptance --example random_rigs [-- COUNT [FIRST]]`; rig N is always the
//! same.

use std::fmt::Write as _;

use acceptance::physical_recordings::{OnTable, PhysicalTest, other_motions, prediction};
use identification::closed_loop::{Found, Settings, identify};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Draws of one rig, one after the other.
struct Draws(ChaCha8Rng);

impl Draws {
    /// Even between `low` and `high`.
    fn even(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    /// Even in the logarithm between one over `factor` and `factor`.
    fn about_one(&mut self, factor: f64) -> f64 {
        let power = self.even(-1.0, 1.0);
        factor.powf(power)
    }
}

/// A rig, what stands on it and how it is recorded.
fn draw(number: u64) -> PhysicalTest {
    let mut draws = Draws(ChaCha8Rng::seed_from_u64(7000 + number));
    let mut test = PhysicalTest {
        name: format!("rig {number}"),
        seed: 9000 + number,
        ..PhysicalTest::default()
    };
    let table = &mut test.table;
    table.table.mass *= draws.about_one(2.0);
    table.table.stiffness *= draws.about_one(2.0);
    table.table.damping *= draws.about_one(3.0);
    table.cylinder.bulk_modulus *= draws.about_one(1.6);
    table.cylinder.leakage *= draws.about_one(3.0);
    table.valve.flow_coefficient *= draws.about_one(1.6);
    table.valve.frequency *= draws.about_one(1.6);
    table.valve.damping_ratio *= draws.about_one(1.4);
    table.supply.pressure *= draws.about_one(1.3);
    table.friction.viscous *= draws.about_one(2.0);
    table.friction.stiffness *= draws.about_one(2.0);
    test.friction = draws.even(0.0, 3.0);
    test.noise = draws.about_one(3.0);
    test.delay = draws.even(-0.002, 0.006).max(0.0);
    test.lags = draws.even(0.0, 1.0) < 0.7;
    test.level = 0.2 * draws.about_one(3.0);
    test.duration = 60.0 * draws.about_one(2.0);
    test.period = [0.001, 0.002, 0.004][(draws.even(0.0, 3.0) as usize).min(2)];
    test.payload = draws.even(-0.5, 1.0).max(0.0) * test.table.table.mass;
    test.specimen = match draws.even(0.0, 1.0) {
        x if x < 0.5 => OnTable::Nothing,
        x if x < 0.75 => OnTable::Linear,
        _ => OnTable::Yielding,
    };
    test
}

/// What is known of a rig: place in the parameters, true value.
fn truths(test: &PhysicalTest) -> Vec<(&'static str, usize, f64)> {
    let rig = test.rig();
    vec![
        ("mass", 7, rig.table.mass()),
        ("stiffness", 9, rig.table.table.stiffness),
        ("friction", 6, rig.table.friction.coulomb),
    ]
}

fn row(test: &PhysicalTest, found: &Found) -> String {
    let values: [f64; 15] = found.rig.into();
    let mut text = String::new();
    for (name, index, truth) in truths(test) {
        let off = values[index] - truth;
        let errors = off / found.standard_error[index];
        let _ = write!(
            text,
            " {name} {:+.1} % ({errors:+.1} s.e.)",
            100.0 * off / truth.max(1.0)
        );
    }
    text
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<u64> = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse().ok())
        .collect();
    let (count, first) = (
        arguments.first().copied().unwrap_or(30),
        arguments.get(1).copied().unwrap_or(0),
    );
    let (mut models, mut doubtful, mut held) = (0, 0, [0; 3]);
    let mut errors = Vec::new();
    for number in first..first + count {
        let test = draw(number);
        println!(
            "{number}: {:.0} kg + {:.0}, friction {:.1}, noise {:.1}, {:.2} g, {:.0} s of {:.0} ms, {:.1} ms late, {:?}",
            test.table.table.mass,
            test.payload,
            test.friction,
            test.noise,
            test.level,
            test.duration,
            1e3 * test.period,
            1e3 * test.delay,
            test.specimen
        );
        let recording = match test.record() {
            Ok(recording) => recording,
            Err(error) => {
                println!("   not recorded: {error}");
                continue;
            }
        };
        let found = match identify(&[recording], Settings::default()) {
            Ok(found) => found,
            Err(error) => {
                println!("   NO MODEL: {error}");
                continue;
            }
        };
        models += 1;
        doubtful += u32::from(!found.holds());
        for (slot, (_, index, truth)) in held.iter_mut().zip(truths(&test)) {
            let values: [f64; 15] = found.rig.into();
            *slot += u32::from((values[index] - truth).abs() < 1.96 * found.standard_error[index]);
        }
        let [other, _] = other_motions(&test);
        let made = prediction(&found, 0.0, &other)?;
        errors.push(made.root_mean_square);
        println!(
            "   left {:.1?}{} predicted {:.1} % ({:.2} rms){}",
            found.mean_squares,
            row(&test, &found),
            100.0 * made.largest,
            100.0 * made.root_mean_square,
            if found.converged { "" } else { " STILL MOVING" }
        );
    }
    errors.sort_by(f64::total_cmp);
    println!(
        "{models} of {count} rigs make a model (seeds 7000 + N), {doubtful} of them with a warning; 95 % intervals hold \
         mass {}, stiffness {}, friction {}; predicted to {:.2} % rms in the middle, {:.2} % at most",
        held[0],
        held[1],
        held[2],
        100.0 * errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
        100.0 * errors.last().copied().unwrap_or(f64::NAN)
    );
    Ok(())
}
