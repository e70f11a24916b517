//! Gives the recordings of invented laboratories to the program and prints what it answers.
//!
//! `cargo run --release -p strangers --example judge_laboratories -- [--cases N] [--seed S] [--shard I/N]
//! [--program FILE] [--limit SECONDS] [--out DIR] [--keep DIR]`
//!
//! The program gets the files and nothing else: `diagnose A.csv B.csv --json`. `--keep` writes the
//! laboratories there (`laboratories/NAME` as their people have them, `truth/NAME.json`) and asks nothing.

use std::collections::BTreeMap;
use std::fs;
use std::process::ExitCode;

use strangers::laboratory::Laboratory;
use strangers::laboratory::score::{Worth, worth};
use strangers::options::Options;

fn run() -> Result<(), String> {
    let options = Options::read(&["cases", "seed", "shard", "program", "limit", "out", "keep"])?;
    let judge = options.judge(60)?;
    let (cases, seed) = (options.number("cases", 20)?, options.number("seed", 1)?);
    let is_mine = options.shard()?;
    let scratch = options.path("keep").unwrap_or(options.scratch());
    println!("seed {seed}");
    let mut count: BTreeMap<Worth, usize> = BTreeMap::new();
    let mut seconds: Vec<f64> = Vec::new();
    for number in (seed..seed + cases).filter(|number| is_mine(*number)) {
        let laboratory = Laboratory::draw(number);
        let name = &laboratory.truth.laboratory;
        let folder = scratch.join("laboratories").join(name);
        let truth = scratch.join("truth");
        let text =
            serde_json::to_string_pretty(&laboratory.truth).map_err(|error| error.to_string())?;
        laboratory
            .write(&folder)
            .and_then(|()| fs::create_dir_all(&truth))
            .and_then(|()| fs::write(truth.join(format!("{name}.json")), text))
            .map_err(|error| format!("{}: {error}", scratch.display()))?;
        if options.text("keep").is_some() {
            continue;
        }
        let paths = laboratory
            .recordings
            .iter()
            .map(|(file, _)| folder.join(file));
        let paths: Vec<String> = paths
            .map(|path| path.to_string_lossy().into_owned())
            .collect();
        let own = scratch.join("answers").join(name);
        let out = own.join("diagnosis").to_string_lossy().into_owned();
        let mut arguments = vec!["diagnose"];
        arguments.extend(paths.iter().map(String::as_str));
        arguments.extend(["--out", &out, "--json"]);
        let answer = judge
            .ask(&arguments, &own)
            .map_err(|error| format!("{}: {error}", judge.program.display()))?;
        let worth = worth(&laboratory.truth, &answer);
        *count.entry(worth).or_default() += 1;
        seconds.push(answer.seconds);
        let faults = laboratory.truth.faults.iter().map(|fault| {
            let (size, unit) = &fault.sizes[0];
            format!("{} ({size:.4} {unit})", fault.cause)
        });
        let said = answer
            .json
            .as_ref()
            .and_then(|json| json["sentence"].as_str())
            .unwrap_or(&answer.complaint);
        println!(
            "{worth:?} {name}, {}: {}; said in {:.0} s: {said}",
            laboratory.truth.drive,
            faults.collect::<Vec<_>>().join(" and "),
            answer.seconds
        );
    }
    let all: usize = count.values().sum();
    let of = |worth: Worth| count.get(&worth).copied().unwrap_or(0);
    seconds.sort_by(f64::total_cmp);
    println!(
        "\n{} of {all} name every fault, {} rank candidates (aim 18 of 20 together), {} name what is not there \
         (aim 0), {} partial, {} refused; seconds of a core: median {:.0}, longest {:.0} (aim 60)",
        of(Worth::Named),
        of(Worth::Ranked),
        of(Worth::False),
        of(Worth::Partial),
        of(Worth::Refused),
        seconds.get(seconds.len() / 2).unwrap_or(&0.0),
        seconds.last().unwrap_or(&0.0)
    );
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("error: {reason}");
            ExitCode::from(2)
        }
    }
}
