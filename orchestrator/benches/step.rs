//! Three-variable control of the table with its specimen: through the FMUs of either version, and
//! the same three components without FMI; then the physical rig with yielding specimen, sensors and
//! interlock under each controller. 20 s of motion over the time of a run is the factor over real time.
//! Loading and initializing the FMUs is not timed, nor is reading the motion.

#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark that cannot go on has failed"
)]

use std::hint::black_box;

use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion as Sample};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use plant::identified::shake_table::{ShakeTable, ShakeTableState};
use plant::specimens::linear::{LinearSpecimen, SpecimenState};
use shakebench::fmu::FmiVersion;
use shakebench::master::{Algorithm, Pace};
use shakebench::motion::Motion;
use shakebench::run::experiment::{Prepared, Request, prepare};

/// 20 s of the built-in motion.
fn prepared(fmi: FmiVersion) -> Prepared {
    let request = Request {
        fmi,
        duration_s: Some(20.0),
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

fn three_variable(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("three-variable with specimen, 20 s");
    group.sample_size(20);
    group.throughput(Throughput::Elements(10_000));
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let prepared = prepared(fmi);
        assert_eq!(prepared.samples, 10_000);
        group.bench_function(format!("FMI {fmi}"), |bencher| {
            bencher.iter_batched(
                || prepared.simulation(Algorithm::GaussSeidel).unwrap(),
                |simulation| simulation.run(prepared.samples, Pace::Fastest, &mut |_| {}),
                BatchSize::PerIteration,
            );
        });
    }
    let Prepared {
        motion, samples, ..
    } = prepared(FmiVersion::V3);
    group.bench_function("without FMI", |bencher| {
        bencher.iter(|| native(black_box(&motion), samples));
    });
    group.finish();
}

fn physical_rig(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("physical rig with yielding specimen, 20 s");
    group.sample_size(10);
    group.throughput(Throughput::Elements(10_000));
    for system in ["three-variable", "sliding-mode", "mpc"] {
        let request = Request {
            plant: "servohydraulic".into(),
            specimen: "yielding".into(),
            duration_s: Some(20.0),
            ..Request::built_in(system)
        };
        let prepared = prepare(&request).unwrap();
        group.bench_function(system, |bencher| {
            bencher.iter_batched(
                || prepared.simulation(Algorithm::GaussSeidel).unwrap(),
                |simulation| simulation.run(prepared.samples, Pace::Fastest, &mut |_| {}),
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, three_variable, physical_rig);
criterion_main!(benches);
