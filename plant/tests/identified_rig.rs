//! The identified rig with its effects against exact sampling, conserved energy and closed forms.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use plant::identified::coupled::Rig;
use plant::identified::effects::{Effects, FoundationEffects, SpecimenEffects, ValveEffects};
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::linear::StateSpace;
use plant::specimens::linear::LinearSpecimen;
use units::constants::{G, INCH};

const PERIOD: f64 = 0.002;

fn rig() -> IdentifiedRig {
    IdentifiedRig {
        specimen: Some(LinearSpecimen::appendix_a()),
        ..Default::default()
    }
}

fn command(k: usize) -> f64 {
    0.4 * (0.031 * k as f64).sin() + 0.2 * (0.17 * k as f64).cos()
}

fn run(rig: &IdentifiedRig, samples: usize) -> Vec<[f64; 4]> {
    let sampled = rig.sample(PERIOD, 1).unwrap();
    let mut state = IdentifiedRigState::default();
    (0..samples)
        .map(|k| {
            let shown = sampled.measure(&mut state, k as f64 * PERIOD);
            sampled.step(&mut state, command(k));
            shown
        })
        .collect()
}

fn exact(system: &StateSpace, samples: usize, input: impl Fn(usize) -> f64) -> Vec<[f64; 4]> {
    let sampled = system.sample(PERIOD);
    let mut x = nalgebra::DVector::zeros(7);
    (0..samples)
        .map(|k| {
            let u = nalgebra::dvector![input(k)];
            let y = sampled.output(&x, &u);
            x = sampled.advance(&x, &u);
            [y[0], y[2], y[3], y[6]]
        })
        .collect()
}

fn linear() -> StateSpace {
    let IdentifiedRig {
        shake_table,
        specimen,
        ..
    } = rig();
    Rig {
        shake_table,
        specimen,
    }
    .state_space()
}

fn largest_difference(a: &[[f64; 4]], b: &[[f64; 4]], channel: usize) -> f64 {
    let size = b.iter().map(|y| y[channel].abs()).fold(0.0, f64::max);
    let pairs = a.iter().zip(b);
    pairs
        .map(|(y, z)| (y[channel] - z[channel]).abs())
        .fold(0.0, f64::max)
        / size
}

#[test]
fn without_effects_it_is_the_exactly_sampled_linear_rig() {
    let (got, want) = (run(&rig(), 1500), exact(&linear(), 1500, command));
    for channel in 0..4 {
        let error = largest_difference(&got, &want, channel);
        assert!(error < 1e-4, "channel {channel}: {error:e}");
    }
}

#[test]
fn halving_the_inner_step_shows_the_fourth_order() {
    let want = exact(&linear(), 500, command);
    let error = |substeps: usize| {
        let sampled = rig().sample(PERIOD, substeps).unwrap();
        let mut state = IdentifiedRigState::default();
        let rows: Vec<[f64; 4]> = (0..500)
            .map(|k| {
                let shown = sampled.measure(&mut state, k as f64 * PERIOD);
                sampled.step(&mut state, command(k));
                shown
            })
            .collect();
        largest_difference(&rows, &want, 1)
    };
    let ratio = error(1) / error(2);
    assert!((10.0..24.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_delay_of_whole_samples_is_the_command_of_then() {
    let mut late = rig();
    late.effects.valve.command_delay = 3.0 * PERIOD;
    let want = exact(&linear(), 800, |k| if k < 3 { 0.0 } else { command(k - 3) });
    assert!(largest_difference(&run(&late, 800), &want, 0) < 2e-5);
}

#[test]
fn a_delay_of_half_a_sample_switches_in_the_middle() {
    let mut late = rig();
    late.effects.valve.command_delay = 2.5 * PERIOD;
    let fine = linear().sample(0.5 * PERIOD);
    let mut x = nalgebra::DVector::zeros(7);
    let mut want = Vec::new();
    for half in 0..1600usize {
        let u = half.checked_sub(5).map_or(0.0, |since| command(since / 2));
        let u = nalgebra::dvector![u];
        let y = fine.output(&x, &u);
        if half % 2 == 0 {
            want.push([y[0], y[2], y[3], y[6]]);
        }
        x = fine.advance(&x, &u);
    }
    assert!(largest_difference(&run(&late, 800), &want, 0) < 1e-5);
}

#[test]
fn fast_spool_and_stiff_foundation_and_wide_yielding_vanish() {
    let mut nearly = rig();
    nearly.effects = Effects {
        valve: ValveEffects {
            spool_limit: 100.0,
            ..Default::default()
        },
        foundation: FoundationEffects {
            frequency: 100.0,
            mass_ratio: 1e9,
            ..Default::default()
        },
        specimen: SpecimenEffects {
            yield_displacement: 10.0,
            uplift_displacement: 10.0,
            ..Default::default()
        },
        ..Default::default()
    };
    let (got, want) = (run(&nearly, 1000), run(&rig(), 1000));
    for channel in 0..4 {
        let error = largest_difference(&got, &want, channel);
        assert!(error < 1e-6, "channel {channel}: {error:e}");
    }
}

#[test]
fn sensors_show_what_their_errors_make_of_the_truth() {
    let mut tilted = rig();
    tilted.sensors.acceleration.bias = 0.1;
    tilted.sensors.accelerometer_tilt = 0.5;
    tilted.sensors.displacement.scale_error = 0.1;
    tilted.sensors.actuator_force.scale_error = -0.2;
    tilted.sensors.actuator_force.bias = 3.0;
    let (got, want) = (run(&tilted, 300), run(&rig(), 300));
    for (y, z) in got.iter().zip(&want) {
        assert!((y[0] - 1.1 * z[0]).abs() < 1e-15);
        assert!((y[1] - (z[1] + 0.1 + G * 0.5 * z[0])).abs() < 1e-12);
        assert!((y[2] - (0.8 * z[2] + 3.0)).abs() < 1e-12);
        assert_eq!(y[3], z[3]);
    }
}

#[test]
fn yielding_dissipates_the_area_of_its_loop() {
    let specimen = SpecimenEffects {
        yield_displacement: 0.5 * INCH,
        yield_post_ratio: 0.0,
        yield_exponent: 40.0,
        ..Default::default()
    };
    // Nearly elastic and perfectly plastic: the loop of amplitude D is 4 d_y (D - d_y) per unit
    // of stiffness.
    let (amplitude, steps) = (2.0 * INCH, 400_000);
    let (mut z, mut area) = (0.0, 0.0);
    for cycle in 0..2 {
        for k in 0..steps {
            let phase = std::f64::consts::TAU * f64::from(k) / f64::from(steps);
            let step = amplitude * phase.cos() * std::f64::consts::TAU / f64::from(steps);
            z += specimen.hysteretic_rate(z, step);
            if cycle == 1 {
                area += z * step;
            }
        }
    }
    let expected = 4.0 * 0.5 * INCH * 1.5 * INCH;
    assert!((area / expected - 1.0).abs() < 0.02, "{}", area / expected);
}

#[test]
fn parameters_without_meaning_are_refused_by_name() {
    let mut wrong = rig();
    wrong.effects.valve.dead_band = -0.1;
    let error = wrong.sample(PERIOD, 1).unwrap_err().to_string();
    assert!(error.contains("dead_band"), "{error}");
    let mut wrong = rig();
    wrong.sensors.acceleration.delay = 1.0;
    let error = wrong.sample(PERIOD, 1).unwrap_err().to_string();
    assert!(error.contains("accelerometer_delay"), "{error}");
}
