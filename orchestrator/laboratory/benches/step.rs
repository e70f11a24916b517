//! Three-variable control of the table with its specimen: through the FMUs of either version, and
//! the same three components without FMI; then the physical rig with yielding specimen, sensors and
//! interlock under each controller. 20 s of motion over the time of a run is the factor over real time.
//! Loading and initializing the FMUs is not timed, nor is reading the motion.
//! `cargo bench -p laboratory --bench step`

#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark that cannot go on has failed"
)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion as Sample};
use fmi_import::FmiVersion;
use fmi_master::{Algorithm, Pace};
use laboratory::run::experiment::{Prepared, Request, prepare};
use motion::Motion;
use pages::live::{Scene, Tap};
use pages::report::UnitSystem;
use plant::identified::shake_table::{ShakeTable, ShakeTableState};
use plant::specimens::linear::{LinearSpecimen, SpecimenState};

const SECONDS: f64 = 20.0;

/// Prints the median of several runs, each on something prepared outside the timing.
fn report<T, R>(name: &str, runs: usize, mut prepare: impl FnMut() -> T, run: impl Fn(T) -> R) {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let prepared = prepare();
            let start = Instant::now();
            black_box(run(black_box(prepared)));
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let (least, median, most) = (times[0], times[runs / 2], times[runs - 1]);
    println!(
        "{name}: {:.0} times real time, {:.2} ms (median of {runs}, {:.2} to {:.2} ms)",
        SECONDS / median,
        1e3 * median,
        1e3 * least,
        1e3 * most
    );
}

/// 20 s of the built-in motion.
fn prepared(fmi: FmiVersion) -> Prepared {
    let request = Request {
        fmi,
        duration_s: Some(SECONDS),
        ..Request::built_in("three-variable")
    };
    prepare(&request).unwrap()
}

/// The same components called directly; returns the last displacement, m.
fn native(motion: &Motion, samples: usize) -> f64 {
    let (table, specimen) = (ShakeTable::default(), LinearSpecimen::appendix_a());
    let (sampled_table, sampled_specimen) = (table.sample(motion.dt), specimen.sample(motion.dt));
    let mut law = ThreeVariableControl::table_3_2();
    let mut table_state = ShakeTableState::default();
    let mut specimen_state = SpecimenState::default();
    let mut last = (0.0, 0.0);
    for k in 0..samples {
        let force = specimen.force(&specimen_state);
        let acceleration = table.acceleration(&table_state, force);
        let command = law.step(
            &ThreeVariableInput {
                reference: Sample {
                    displacement: motion.displacement[k],
                    velocity: motion.velocity[k],
                    acceleration: motion.acceleration[k],
                },
                measured: Sample {
                    displacement: table_state.displacement,
                    velocity: table_state.velocity,
                    acceleration,
                },
            },
            motion.dt,
        );
        let ahead = |now: f64, last: f64| now - 0.5 * (last - now);
        table_state = sampled_table.advance(&table_state, command, ahead(force, last.0));
        specimen_state = sampled_specimen.advance(&specimen_state, ahead(acceleration, last.1));
        last = (force, acceleration);
    }
    table_state.displacement
}

fn through_fmus(name: &str, runs: usize, prepared: &Prepared) {
    report(
        name,
        runs,
        || prepared.simulation(Algorithm::GaussSeidel).unwrap(),
        |simulation| simulation.run(prepared.samples, Pace::Fastest, &mut |_| {}),
    );
}

fn main() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let prepared = prepared(fmi);
        assert_eq!(prepared.samples, 10_000);
        through_fmus(
            &format!("three-variable with specimen, FMI {fmi}"),
            21,
            &prepared,
        );
    }
    let watched = prepared(FmiVersion::V3);
    report(
        "the same, watched (FMI 3.0)",
        21,
        || {
            let mut simulation = watched.simulation(Algorithm::GaussSeidel).unwrap();
            let (_, places) = Scene::new(watched.shown(), simulation.names(), UnitSystem::Us);
            simulation.watch(Arc::new(Tap::new(places, watched.samples)));
            simulation
        },
        |simulation| simulation.run(watched.samples, Pace::Fastest, &mut |_| {}),
    );
    let Prepared {
        motion, samples, ..
    } = prepared(FmiVersion::V3);
    report(
        "three-variable with specimen, without FMI",
        21,
        || (),
        |()| native(black_box(&motion), samples),
    );
    for system in ["three-variable", "sliding-mode", "mpc"] {
        let request = Request {
            plant: "servohydraulic".into(),
            specimen: "yielding".into(),
            duration_s: Some(SECONDS),
            ..Request::built_in(system)
        };
        let name = format!("physical rig with yielding specimen, {system}");
        through_fmus(&name, 11, &prepare(&request).unwrap());
    }
}
