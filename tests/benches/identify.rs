//! A minute of four measured channels at 500 Hz (displacement, acceleration, force, acceleration of
//! the specimen) and the command, from arrays to the rig with standard errors. Reading the file and
//! writing the report are not timed. `cargo bench -p acceptance --bench identify`

use std::hint::black_box;
use std::time::Instant;

use acceptance::recordings::Test;
use identification::identify::rig::{Options, identify};

const RUNS: usize = 11;

fn main() {
    let recordings = [Test::default().record()];
    assert_eq!(recordings[0].len(), 30_000);
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let start = Instant::now();
            black_box(identify(black_box(&recordings), Options::default()).unwrap());
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!(
        "a minute of four channels at 500 Hz: {:.3} s (median of {RUNS}, {:.3} to {:.3} s)",
        times[RUNS / 2],
        times[0],
        times[RUNS - 1]
    );
}
