//! Hides effects in fresh cases, diagnoses them and prints what came of it.
//!
//! `cargo run --release -p acceptance --example hidden_effects_suite -- [--one N] [--two N]
//! [--nothing N] [--outside N] [--noise F] [--mismatch F] [--seed S]`

use std::env;
use std::process::ExitCode;

use acceptance::hidden_suite::{Plan, line, run_all, table};
use hidden_effects::Outcome;

fn main() -> ExitCode {
    let mut plan = Plan {
        seed: rand::random_range(1..1_000_000_000),
        one: 100,
        two: 50,
        nothing: 30,
        outside: 40,
        mismatch: 0.01,
        noise: 1.0,
    };
    let mut arguments = env::args().skip(1);
    while let Some(option) = arguments.next() {
        let Some(value) = arguments.next().and_then(|text| text.parse::<f64>().ok()) else {
            eprintln!("{option}: expected a number after it");
            return ExitCode::from(2);
        };
        match option.as_str() {
            "--one" => plan.one = value as usize,
            "--two" => plan.two = value as usize,
            "--nothing" => plan.nothing = value as usize,
            "--outside" => plan.outside = value as usize,
            "--noise" => plan.noise = value,
            "--mismatch" => plan.mismatch = value,
            "--seed" => plan.seed = value as u64,
            _ => {
                eprintln!(
                    "{option} is unknown; expected --one, --two, --nothing, --outside, --noise, \
                     --mismatch or --seed"
                );
                return ExitCode::from(2);
            }
        }
    }
    println!("{plan:?}");
    let results = run_all(&plan, |scored| {
        if scored.outcome != Outcome::Right {
            eprintln!("{}", line(scored));
        }
    });
    println!("{}", table(&results));
    ExitCode::SUCCESS
}
