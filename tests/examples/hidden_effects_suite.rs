//! Hides effects in fresh cases, diagnoses them and prints what came of it. With `--out` the cases are
//! kept as those of a study: the same command goes on where it was stopped, and `--shard I/N` carries out
//! a part.
//!
//! `cargo run --release -p acceptance --example hidden_effects_suite -- [--one N] [--effect NAME]
//! [--two N] [--nothing N] [--outside N] [--noise F,...] [--mismatch F,...] [--seed S] [--verbose 1]
//! [--world plain|open|noisy] [--out DIR] [--shard I/N]`

use std::env;
use std::path::PathBuf;
use std::process::ExitCode;

use acceptance::hidden_suite::{Plan, run_all, table};
use hidden_effects::World;
use hidden_effects::catalogue::entry;
use shakebench::campaign::{Progress, Shard};

fn main() -> ExitCode {
    let mut plan = Plan {
        seed: rand::random_range(1..1_000_000_000),
        one: 100,
        effect: None,
        two: 50,
        nothing: 30,
        outside: 40,
        mismatch: vec![0.01],
        noise: vec![1.0],
        world: World::Plain,
        verbose: false,
    };
    let (mut out, mut shard) = (None, None);
    let mut arguments = env::args().skip(1);
    while let Some(option) = arguments.next() {
        let text = arguments.next().unwrap_or_default();
        if option == "--effect" {
            let Some(entry) = entry(&text) else {
                eprintln!("--effect: `{text}` is not in the catalogue");
                return ExitCode::from(2);
            };
            plan.effect = Some(entry.name);
            continue;
        }
        if option == "--world" {
            plan.world = match text.as_str() {
                "plain" => World::Plain,
                "open" => World::Open,
                "noisy" => World::Noisy,
                _ => {
                    eprintln!("--world: `{text}` is unknown; expected plain, open or noisy");
                    return ExitCode::from(2);
                }
            };
            if plan.world == World::Noisy {
                (plan.noise, plan.mismatch) = (vec![3.0], vec![0.02]);
            }
            continue;
        }
        if option == "--out" {
            out = Some(PathBuf::from(text));
            continue;
        }
        if option == "--shard" {
            match text.parse::<Shard>() {
                Ok(part) => shard = Some(part),
                Err(reason) => {
                    eprintln!("--shard: {reason}");
                    return ExitCode::from(2);
                }
            }
            continue;
        }
        let list: Result<Vec<f64>, _> = text.split(',').map(str::parse::<f64>).collect();
        let Some((value, list)) = list.ok().and_then(|list| Some((*list.first()?, list))) else {
            eprintln!("{option}: expected a number after it (of noise and mismatch several: 1,3)");
            return ExitCode::from(2);
        };
        match option.as_str() {
            "--one" => plan.one = value as usize,
            "--two" => plan.two = value as usize,
            "--nothing" => plan.nothing = value as usize,
            "--outside" => plan.outside = value as usize,
            "--noise" => plan.noise = list,
            "--mismatch" => plan.mismatch = list,
            "--seed" => plan.seed = value as u64,
            "--verbose" => plan.verbose = value != 0.0,
            _ => {
                eprintln!(
                    "{option} is unknown; expected --one, --effect, --two, --nothing, --outside, --noise, \
                     --mismatch, --seed, --world, --out, --shard or --verbose"
                );
                return ExitCode::from(2);
            }
        }
    }
    println!("{plan:?}");
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = out.unwrap_or_else(|| temporary.path().to_path_buf());
    let results = run_all(&plan, &folder, shard, &|Progress { done, of }| {
        eprintln!("{done} of {of} cases");
    });
    match results {
        Ok(results) => {
            println!("{}", table(&results));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
