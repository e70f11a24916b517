//! Chapter 2 as a tool: the rig's parameters from noisy data taken in closed loop.

use acceptance::recordings::Test;
use identification::data::Channel;
use identification::identify::identified::RigIdentification;
use identification::identify::parameters::Physical;
use identification::identify::rig::{Options, identify};
use nalgebra::Complex;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;

fn truth() -> Vec<f64> {
    let ShakeTable { actuator, table } = ShakeTable::default();
    let specimen = LinearSpecimen::appendix_a();
    let mut all = Vec::new();
    all.extend(actuator.denominator);
    all.extend(actuator.voltage_to_force);
    all.extend(actuator.velocity_to_force);
    all.extend([table.mass, table.damping, table.stiffness]);
    all.extend([specimen.mass, specimen.damping, specimen.stiffness]);
    all
}

/// Largest relative distance between two sets of poles, each to its nearest.
fn pole_error(got: &[Complex<f64>], want: &[Complex<f64>]) -> f64 {
    want.iter()
        .map(|pole| {
            let nearest = got
                .iter()
                .map(|g| (g - pole).norm())
                .fold(f64::MAX, f64::min);
            nearest / pole.norm()
        })
        .fold(0.0, f64::max)
}

/// Largest relative error of the responses of G1 and G2 between two frequencies.
fn response_error(found: &RigIdentification, low: f64, high: f64) -> f64 {
    let (got, want) = (
        found.rig().shake_table.actuator,
        ShakeTable::default().actuator,
    );
    (0..100)
        .map(|k| {
            let f = low * (high / low).powf(f64::from(k) / 99.0);
            let s = Complex::new(0.0, std::f64::consts::TAU * f);
            let g1 = (got.g1().evaluate(s) / want.g1().evaluate(s) - 1.0).norm();
            let g2 = (got.g2().evaluate(s) / want.g2().evaluate(s) - 1.0).norm();
            g1.max(g2)
        })
        .fold(0.0, f64::max)
}

fn seeds() -> u64 {
    let asked = std::env::var("SHAKEBENCH_SEEDS").ok();
    asked.and_then(|text| text.parse().ok()).unwrap_or(24)
}

/// Poles and responses are within 2 % of the true rig's, and what was simulated fits.
fn is_within_two_percent(found: &RigIdentification) {
    let rig = ShakeTable::default();
    let actuator = pole_error(&found.actuator_poles(), &rig.actuator.g1().poles());
    let table = pole_error(&found.table_poles(), &rig.table.transfer_function().poles());
    let response = response_error(found, 0.1, 30.0);
    println!("poles {actuator:.1e} {table:.1e}, responses {response:.1e}");
    assert!(actuator < 0.02 && table < 0.02 && response < 0.02);
    for fit in &found.fits {
        assert!(fit.simulated > 98.5, "{} {}", fit.channel, fit.simulated);
    }
}

#[test]
fn a_known_rig_is_found_from_a_minute_with_a_specimen() {
    let started = std::time::Instant::now();
    let recording = Test::default().record();
    let made = started.elapsed();
    let found = identify(&[recording], Options::default()).unwrap();
    println!("identified in {:?}", started.elapsed() - made);
    assert!(found.identifiable);
    is_within_two_percent(&found);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

#[test]
fn two_payloads_without_a_specimen_do_as_well() {
    let recordings: Vec<_> = [(0.0, 5), (25.0, 6)]
        .into_iter()
        .map(|(payload, seed)| {
            Test {
                specimen: None,
                payload,
                seed,
                ..Test::default()
            }
            .record()
        })
        .collect();
    let found = identify(&recordings, Options::default()).unwrap();
    assert!(found.identifiable);
    let rig = ShakeTable::default();
    assert!(pole_error(&found.actuator_poles(), &rig.actuator.g1().poles()) < 0.02);
    assert!(pole_error(&found.table_poles(), &rig.table.transfer_function().poles()) < 0.02);
    assert!(response_error(&found, 0.1, 30.0) < 0.02);
    let (payload, error) = found.payload[1];
    assert!(
        (payload - 25.0).abs() < 4.0 * error && error < 0.25,
        "{payload} {error}"
    );
}

#[test]
fn a_bare_table_is_recognised_as_inseparable() {
    let recording = Test {
        specimen: None,
        ..Test::default()
    }
    .record();
    let found = identify(&[recording], Options::default()).unwrap();
    assert!(!found.identifiable);
    let message = found.warnings.join("\n");
    assert!(
        message.contains("inseparable (a1, e2, e1, e0 move together"),
        "{message}"
    );
    assert!(message.contains("with two payloads"), "{message}");
    // The table itself is determined.
    let table = ShakeTable::default().table;
    assert!(pole_error(&found.table_poles(), &table.transfer_function().poles()) < 0.02);
}

#[test]
fn the_slow_zero_is_claimed_only_where_the_excitation_reaches_it() {
    let relative = |band| {
        let test = Test {
            band,
            ..Test::default()
        };
        let found = identify(&[test.record()], Options::default()).unwrap();
        let told = found
            .warnings
            .iter()
            .any(|w| w.contains("slow pole and zero"));
        let slow = Physical::B0;
        let relative = found.standard_error[slow] / found.physical[slow].abs();
        (relative, told)
    };
    let (reached, told) = relative((0.02, 30.0));
    assert!(reached < 0.1 && !told, "{reached}");
    let (missed, told) = relative((0.5, 30.0));
    assert!(missed > 3.0 * reached, "{missed} {reached}");
    assert_eq!(told, missed > 0.5, "{missed}");
}

#[test]
fn ninety_five_per_cent_intervals_hold_the_truth_in_90_to_99_of_100() {
    let truth = truth();
    let count = seeds();
    let mut held = vec![0u64; truth.len()];
    for seed in 0..count {
        let recording = Test {
            seed: 1000 + seed,
            duration: 40.0,
            ..Test::default()
        }
        .record();
        let found = identify(&[recording], Options::default())
            .unwrap_or_else(|error| panic!("seed {}: {error}", 1000 + seed));
        for ((held, want), &name) in held.iter_mut().zip(&truth).zip(Physical::ALL) {
            let error = (found.physical[name] - want).abs();
            *held += u64::from(error < 1.96 * found.standard_error[name]);
        }
    }
    for (name, held) in Physical::ALL.iter().map(|p| p.name()).zip(&held) {
        println!("{name}: {held} of {count}");
    }
    let all: u64 = held.iter().sum();
    let part = all as f64 / (count * held.len() as u64) as f64;
    assert!((0.90..=0.99).contains(&part), "{part}");
    // A single parameter: within three standard deviations of a binomial count at 95 %.
    let expected = 0.95 * count as f64;
    let slack = 3.0 * (count as f64 * 0.95 * 0.05).sqrt();
    for (name, held) in Physical::ALL.iter().map(|p| p.name()).zip(&held) {
        assert!(*held as f64 > expected - slack, "{name}: {held} of {count}");
    }
}

#[test]
fn a_late_command_is_found_with_its_delay() {
    // Parts of a sample, whole samples and both; the shortest stand beside no delay at all.
    for (delay, seed) in [
        (0.0003, 2),
        (0.001, 3),
        (0.004, 4),
        (0.0053, 5),
        (0.007, 2),
        (0.012, 7),
    ] {
        let recording = Test {
            delay,
            seed,
            duration: 40.0,
            ..Test::default()
        }
        .record();
        let found = identify(&[recording], Options::default()).unwrap();
        let (got, error) = (
            found.physical[Physical::CommandDelay],
            found.standard_error[Physical::CommandDelay],
        );
        let response = response_error(&found, 0.1, 30.0);
        println!("{delay}: {got:.7} s, standard error {error:.1e}, responses {response:.1e}");
        assert!(
            (got - delay).abs() < 5.0 * error && error < 2e-6,
            "{got} {error}"
        );
        // The largest is in the notch of G2 near 3.7 Hz.
        let grid: Vec<f64> = plant::linear::log_space(0.1, 30.0, 100);
        let [g1, g2] = found.response_error(&grid);
        assert!(response < 4.0 * g1.max(g2), "{response} {g1} {g2}");
        assert!(g1 < 0.01 && g2 < 0.04, "{g1} {g2}");
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

#[test]
fn a_punctual_command_has_no_delay() {
    let found = identify(
        &[Test {
            duration: 40.0,
            seed: 8,
            ..Test::default()
        }
        .record()],
        Options::default(),
    )
    .unwrap();
    assert_eq!(
        (
            found.physical[Physical::CommandDelay],
            found.standard_error[Physical::CommandDelay]
        ),
        (0.0, 0.0)
    );
}

#[test]
fn a_known_specimen_stands_for_its_sensor() {
    let recording = Test::default().record();
    let unsensed = recording.clone().without(Channel::SpecimenAcceleration);
    let known = Options {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..Options::default()
    };
    for recording in [unsensed, recording] {
        let found = identify(&[recording], known).unwrap();
        assert!(found.identifiable && found.specimen);
        is_within_two_percent(&found);
        assert_eq!(found.rig().specimen, Some(LinearSpecimen::appendix_a()));
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}
