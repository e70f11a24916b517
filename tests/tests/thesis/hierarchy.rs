//! The hierarchy of Fig 4-3 on the identified rig, stepped without FMI: what the law claims about
//! tracking, delay, bias and stability.

use crate::native::{
    Hierarchy, Law, PERIOD, Sensors, ThreeVariableLaw, band_limited, loop_shaping, run, run_biased,
};
use controllers::Motion;
use controllers::allocation::ControlAllocation;
use controllers::hierarchy::DISPLACEMENT_INTEGRAL_LEAK;
use controllers::loops::{Controlled, LinearLaw, Loop, Time};
use controllers::pid::Pid;
use controllers::prediction_over_delay::PredictionOverDelay;
use controllers::sliding_mode::{IDENTIFIED_RATE, SlidingMode};
use controllers::tuning::sliding_mode::rate_by_rule;
use nalgebra::Complex;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;
use units::constants::LBF;

fn rigs() -> [(&'static str, Rig); 2] {
    let specimen = Some(LinearSpecimen::appendix_a());
    let with_specimen = Rig {
        specimen,
        ..Rig::default()
    };
    [("bare", Rig::default()), ("specimen", with_specimen)]
}

fn predicting(delay: usize) -> Hierarchy {
    let prediction =
        PredictionOverDelay::new(&ShakeTable::default(), PERIOD, delay, 0).expect("a model");
    Hierarchy {
        sliding: SlidingMode {
            prediction: Some(prediction),
            ..SlidingMode::default()
        },
        ..Hierarchy::default()
    }
}

fn leaking_loop() -> Pid {
    Pid {
        integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
        ..Pid::equation_3_6()
    }
}

fn sampled_poles(rig: &Rig, displacement: &Pid) -> Vec<Complex<f64>> {
    let law = LinearLaw::hierarchy(
        &SlidingMode::default(),
        displacement,
        &Pid::equation_3_7(),
        &ControlAllocation::default(),
        PERIOD,
    )
    .unwrap();
    let poles = Loop::new(rig, law).closed_loop_poles(Time::Sampled);
    poles.iter().copied().collect()
}

#[test]
fn the_rule_gives_the_rate_that_is_set() {
    let rate = rate_by_rule(&Rig::default(), &Pid::equation_3_7(), 0.5, PERIOD).unwrap();
    assert!((rate / IDENTIFIED_RATE - 1.0).abs() < 1e-3, "{rate}");
}

#[test]
fn sliding_mode_beats_three_variable_control_and_that_beats_loop_shaping() {
    for (name, rig) in rigs() {
        for seed in [1, 2, 3] {
            let motion = band_limited(seed);
            let sliding = run(&rig, &motion, 0, &mut Hierarchy::default());
            let three = run(&rig, &motion, 0, &mut ThreeVariableLaw::default());
            let shaping = run(&rig, &motion, 0, &mut loop_shaping());
            let [sliding, three, shaping] =
                [sliding, three, shaping].map(|run| run.time_domain_percent(&motion));
            println!(
                "{name}, seed {seed}: sliding mode {sliding:.3} %, three-variable {three:.2} %, \
                 loop shaping {shaping:.2} %"
            );
            assert!(sliding < 0.15 * three && three < shaping);
        }
    }
}

#[test]
fn a_sample_of_delay_destroys_the_law_unless_it_is_predicted() {
    for (name, rig) in rigs() {
        let motion = band_limited(4);
        let error =
            |delay, law: &mut dyn Law| run(&rig, &motion, delay, law).time_domain_percent(&motion);
        let three = error(1, &mut ThreeVariableLaw::default());
        let unpredicted = error(1, &mut Hierarchy::default());
        assert!(unpredicted > 100.0, "{unpredicted}");
        let without = error(0, &mut Hierarchy::default());
        for delay in [1, 2, 3] {
            let predicted = error(delay, &mut predicting(delay));
            println!(
                "{name}, {delay} samples: {predicted:.3} %, without delay {without:.3} %, three-variable {three:.2} %"
            );
            assert!(three - predicted > 2.0 / 3.0 * (three - without));
        }
    }
}

#[test]
fn one_unpredicted_sample_puts_the_poles_outside_the_unit_circle() {
    // Errata: |z| 1.10 to 1.17 for one unmodelled sample of delay (lambda and K not stated there;
    // here 20 to 40 1/s).
    let motion: Vec<Motion> = vec![Motion::default(); 400];
    let mut kick = motion.clone();
    kick[0].acceleration = 1e-6;
    for rate in [20.0, 40.0] {
        let mut law = Hierarchy::default();
        law.sliding.surface_rate = rate;
        law.sliding.reaching_rate = rate;
        let response = run(&Rig::default(), &kick, 1, &mut law);
        let size = |range: std::ops::Range<usize>| {
            let squares: f64 = response.command[range].iter().map(|u| u * u).sum();
            squares.sqrt()
        };
        let growth = (size(80..120) / size(40..80)).powf(1.0 / 40.0);
        println!("lambda = K = {rate}: |z| {growth:.4}");
        assert!((1.10..1.17).contains(&growth), "{growth}");
    }
}

#[test]
fn the_leak_moves_the_structural_pole_into_the_unit_circle() {
    for (name, rig) in rigs() {
        let nearest_one = |displacement: &Pid| {
            sampled_poles(&rig, displacement)
                .iter()
                .map(|z| (z - 1.0).norm())
                .fold(f64::INFINITY, f64::min)
        };
        let printed = nearest_one(&Pid::equation_3_6());
        let leaking = nearest_one(&leaking_loop());
        println!("{name}: |z - 1| is {printed:.1e} as printed, {leaking:.1e} with the leak");
        assert!(printed < 1e-9);
        // What remains is the slow zero of G1 at -0.0104 1/s, seen from the valve alone.
        assert!((leaking / (0.010_458 * PERIOD) - 1.0).abs() < 0.01);
        let largest = sampled_poles(&rig, &leaking_loop())
            .iter()
            .map(|z| z.norm())
            .fold(0.0, f64::max);
        assert!(largest < 1.0);
    }
}

#[test]
fn biased_sensors_offset_the_table_and_nothing_drifts() {
    let motion = vec![Motion::default(); 300 * 500];
    let bias = Sensors {
        force: 2.0 * LBF,
        ..Sensors::default()
    };
    for (law, drifts) in [
        (Hierarchy::default(), false),
        (predicting(1), false),
        (
            Hierarchy {
                displacement: Pid::equation_3_6(),
                ..Hierarchy::default()
            },
            true,
        ),
    ] {
        let mut law = law;
        let delay = law.sliding.prediction.map_or(0, |p| p.loop_delay_samples);
        let run = run_biased(&Rig::default(), &motion, delay, &bias, &mut law);
        let integral = law.displacement.memory.integral.abs();
        assert_eq!(integral > 1.0, drifts, "displacement integral {integral} V");
        if !drifts {
            let end = run.motion.last().unwrap().displacement;
            let [restoring, ..] = law.sliding.error_gains();
            println!(
                "offset {:.2e} m, bound {:.2e} m",
                end,
                bias.force / restoring
            );
            assert!(end.abs() <= 1.01 * bias.force / restoring);
            assert!(run.command.last().unwrap().abs() < 1.0);
        }
    }
}

#[test]
fn a_boundary_layer_tightens_the_tracking_and_stays_stable() {
    let motion = band_limited(5);
    let with = |switching_gain| {
        let mut law = Hierarchy::default();
        law.sliding.switching_gain = switching_gain;
        law.sliding.boundary_layer = 0.02;
        run(&Rig::default(), &motion, 0, &mut law).time_domain_percent(&motion)
    };
    let (printed, switching) = (with(0.0), with(1.0));
    println!("{printed:.3} % as printed, {switching:.3} % with the switching term");
    assert!(switching < printed);
}

#[test]
fn the_force_loop_is_stable_at_half_its_gain_only() {
    let stable = |share: f64, time| {
        let force = Pid {
            proportional: share * Pid::equation_3_7().proportional,
            integral: share * Pid::equation_3_7().integral,
            ..Pid::equation_3_7()
        };
        let law = LinearLaw::pid(&force, Controlled::Force, PERIOD).unwrap();
        let force_loop = Loop::new(&Rig::default(), law);
        let poles = force_loop.closed_loop_poles(time);
        println!("share {share}, {time:?}: {poles:.4}");
        force_loop.is_stable(time)
    };
    assert!(stable(1.0, Time::Continuous));
    assert!(!stable(1.0, Time::Sampled));
    assert!(stable(0.5, Time::Sampled));
}
