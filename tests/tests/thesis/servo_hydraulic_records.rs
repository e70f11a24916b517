//! The eight records on the physical rig with the yielding specimen, sensor noise and one sample
//! of delay, under three-variable control and behind the interlock.

use acceptance::native_rig::{NativeRig, PERIOD};
use controllers::interlock::Trip;
use controllers::three_variable::ThreeVariableGains;
use laboratory::systems::control_model::ControlModel;
use motion::metrics;
use motion::{self, Motion, Options, Scaling};
use rayon::prelude::*;
use units::constants::{INCH, STROKE};

fn records(options: &Options) -> Vec<Motion> {
    let files = acceptance::shared::records();
    files
        .iter()
        .map(|path| motion::load(path, options).unwrap())
        .collect()
}

#[needs::shared("records")]
#[test]
fn no_record_diverges_or_trips_and_the_specimen_yields() {
    let records = records(&Options::default());
    let rows: Vec<_> = records
        .par_iter()
        .map(|motion| (motion, NativeRig::laboratory(7).play(motion)))
        .collect();
    for (motion, run) in rows {
        let tracking = metrics::tracking(motion, &run.displacement, &run.acceleration).unwrap();
        let drift = run.drift.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        println!(
            "{:32} {:5.1} % of peak acceleration, peak {:.2} in, drift {:.2} in",
            motion.name,
            tracking.time_domain_percent,
            run.peak_displacement() / INCH,
            drift / INCH
        );
        assert_eq!(run.interlock.memory.trip, Trip::None, "{}", motion.name);
        assert!(tracking.time_domain_percent < 20.0, "{}", motion.name);
        assert!(
            tracking.peak_displacement_error < 0.3 * INCH,
            "{}",
            motion.name
        );
        assert!(
            drift > 2.0 * 0.147 * INCH,
            "{} yields the specimen",
            motion.name
        );
    }
}

#[needs::shared("records")]
#[test]
fn gains_tuned_on_a_model_of_the_rig_follow_better_in_the_median() {
    let records = records(&Options::default());
    let printed = NativeRig::laboratory(7);
    let model = ControlModel::commissioned().unwrap();
    let tuned = NativeRig {
        gains: ThreeVariableGains::damped(&model.rig, model.late, PERIOD).unwrap(),
        ..printed
    };
    let errors = |rig: &NativeRig| {
        let mut errors: Vec<f64> = records
            .par_iter()
            .map(|motion| {
                let run = rig.play(motion);
                assert_eq!(run.interlock.memory.trip, Trip::None, "{}", motion.name);
                metrics::tracking(motion, &run.displacement, &run.acceleration)
                    .unwrap()
                    .time_domain_percent
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    let (printed, tuned) = (errors(&printed), errors(&tuned));
    println!("printed gains {printed:.1?} %, tuned {tuned:.1?} %");
    assert!(tuned[3] + tuned[4] < printed[3] + printed[4]);
}

#[needs::shared("records")]
#[test]
fn runs_that_leave_the_stroke_are_stopped_before_the_stop() {
    let options = Options {
        scaling: Some(Scaling::PeakDisplacement(2.5 * INCH)),
        stroke: 3.0 * INCH,
        ..Options::default()
    };
    let records = records(&options);
    // Also much faster than any of them: sines that run into the stop at up to 35 in/s.
    let sines = [0.5, 1.0, 2.0, 3.0].map(|frequency| sine(2.0 * INCH, frequency));
    let results: Vec<_> = records
        .par_iter()
        .chain(&sines)
        .map(|motion| {
            let rig = NativeRig::laboratory(11);
            let guarded = rig.play(motion);
            let unguarded = NativeRig {
                interlock: controllers::interlock::Interlock {
                    displacement_limit: 1.0,
                    tracking_limit: 1.0,
                    velocity_limit: 10.0,
                    acceleration_limit: 1e6,
                    force_limit: 1e6,
                    activity_limit: 1e9,
                    saturation_time: 1e3,
                    ..rig.interlock
                },
                ..rig
            };
            (motion, guarded, unguarded.play(motion))
        })
        .collect();
    for (motion, guarded, unguarded) in results {
        let m = guarded.interlock.memory;
        println!(
            "{:32} {:?} at {:.2} s, farthest {:.3} in (without interlock {:.3} in)",
            motion.name,
            m.trip,
            m.trip_time,
            guarded.peak_displacement() / INCH,
            unguarded.peak_displacement() / INCH
        );
        assert!(
            unguarded.peak_displacement() >= STROKE,
            "{} hits the stop",
            motion.name
        );
        assert_ne!(m.trip, Trip::None);
        assert!(guarded.peak_displacement() < STROKE, "{}", motion.name);
    }
}

/// A sine that grows to `amplitude` (m) over four periods.
fn sine(amplitude: f64, frequency: f64) -> Motion {
    let omega = std::f64::consts::TAU * frequency;
    let at = |t: f64| amplitude * (t * frequency / 4.0).min(1.0) * (omega * t).sin();
    let time = |k: usize| 0.002 * k as f64;
    let e = 1e-4;
    let count = (6.0 / frequency / 0.002) as usize + 500;
    Motion {
        name: format!("sine {frequency} Hz"),
        dt: 0.002,
        displacement: (0..count).map(|k| at(time(k))).collect(),
        velocity: (0..count)
            .map(|k| (at(time(k) + e) - at(time(k) - e)) / (2.0 * e))
            .collect(),
        acceleration: (0..count)
            .map(|k| (at(time(k) + e) - 2.0 * at(time(k)) + at(time(k) - e)) / (e * e))
            .collect(),
        notes: Vec::new(),
        seed: None,
        across: None,
    }
}
