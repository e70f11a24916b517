//! Hides effects in fresh cases, diagnoses them and prints what came of it. With `--out` the cases are
//! kept as those of a study: the same command goes on where it was stopped, and `--shard I/N` carries out
//! a part. Of several worlds each has a folder there and begins 1,000 seeds after the one before; they are shown
//! beside each other, and `--picture` draws how often what is stated is true. `--carry-on 0` shows what is there
//! of a study that was stopped.
//!
//! `cargo run --release -p acceptance --example hidden_effects_suite -- [--one N] [--effect NAME]
//! [--two N] [--nothing N] [--outside N] [--noise F,...] [--mismatch F,...] [--seed S] [--verbose 1]
//! [--world plain,open,noisy] [--out DIR] [--shard I/N] [--picture FILE.svg] [--carry-on 0]`

use std::env;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use acceptance::hidden_suite::{Plan, beside_each_other, picture, run_all, table};
use hidden_effects::World;
use hidden_effects::catalogue::entry;
use pages::report::{UnitSystem, svg};
use study::campaign::{Progress, Shard};

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
    let mut worlds = vec![World::Plain];
    let (mut out, mut shard, mut drawn, mut carry_on) = (None, None, None, true);
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
            let named: Result<Vec<World>, _> = text.split(',').map(str::parse).collect();
            worlds = match named {
                Ok(named) => named,
                Err(reason) => {
                    eprintln!("--world: {reason}");
                    return ExitCode::from(2);
                }
            };
            continue;
        }
        if option == "--out" {
            out = Some(PathBuf::from(text));
            continue;
        }
        if option == "--picture" {
            drawn = Some(PathBuf::from(text));
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
            "--carry-on" => carry_on = value != 0.0,
            _ => {
                eprintln!(
                    "{option} is unknown; expected --one, --effect, --two, --nothing, --outside, --noise, \
                     --mismatch, --seed, --world, --out, --shard, --carry-on, --picture or --verbose"
                );
                return ExitCode::from(2);
            }
        }
    }
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = out.unwrap_or_else(|| temporary.path().to_path_buf());
    let mut results = Vec::new();
    for (number, world) in worlds.iter().enumerate() {
        let plan = Plan {
            seed: plan.seed + 1000 * number as u64,
            ..plan.clone()
        }
        .set_in(*world);
        println!("{plan:?}");
        let own = if worlds.len() > 1 {
            folder.join(world.to_string())
        } else {
            folder.clone()
        };
        let tell = |Progress { done, of }: Progress| eprintln!("{world}: {done} of {of} cases");
        match run_all(&plan, &own, shard, carry_on, &tell) {
            Ok(scored) => {
                println!("{}", table(&scored));
                results.push((world.to_string(), scored));
            }
            Err(error) => {
                eprintln!("error: {error}");
                return ExitCode::from(2);
            }
        }
    }
    println!("{}", beside_each_other(&results));
    if let Some(file) = drawn
        && let Err(error) = fs::write(&file, svg(&picture(&results), UnitSystem::Us))
    {
        eprintln!("{}: {error}", file.display());
        return ExitCode::from(2);
    }
    ExitCode::SUCCESS
}
