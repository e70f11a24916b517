//! A minute of four measured channels at 500 Hz (displacement, acceleration, force, acceleration of
//! the specimen) and the command, from arrays to the rig with standard errors. Reading the file and
//! writing the report are not timed.

#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark that cannot go on has failed"
)]

#[path = "../../tests/tests/identify_data/mod.rs"]
mod identify_data;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use identification::identify::rig::{Options, identify};
use identify_data::Test;

fn a_minute(criterion: &mut Criterion) {
    let recordings = [Test::default().record()];
    assert_eq!(recordings[0].len(), 30_000);
    let mut group = criterion.benchmark_group("identify");
    group.sample_size(10);
    group.bench_function("a minute of four channels at 500 Hz", |bencher| {
        bencher.iter(|| identify(black_box(&recordings), Options::default()).unwrap());
    });
    group.finish();
}

criterion_group!(benches, a_minute);
criterion_main!(benches);
