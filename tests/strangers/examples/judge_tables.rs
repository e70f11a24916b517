//! Diagnoses tables in worlds of another form and prints what came of it.
//!
//! `cargo run --release -p strangers --example judge_tables -- [--cases N] [--seed S] [--kind
//! nothing|one|two|outside] [--shard I/N] [--program FILE] [--limit SECONDS] [--records DIR] [--from DIR]
//! [--out DIR] [--keep DIR] [--ablate yes]`
//!
//! Of the cases a quarter hide nothing, nine in twenty one effect, a fifth two and a tenth something outside
//! the catalogue. `--from` judges the cases that a folder has (`cases`, `truth`); `--keep` writes the drawn ones
//! there and diagnoses none. `--ablate` compares the printed gain of a single effect with an ablation by hand, which
//! takes minutes a case. With `--out` results are kept, and only cases that are missing are diagnosed.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use strangers::judge::Judge;
use strangers::options::Options;
use strangers::table::ablation::by_hand;
use strangers::table::case::{Case, Kind, Truth};
use strangers::table::score::{Judged, table};

/// A cycle of twenty.
fn kind(number: u64) -> Kind {
    match number % 20 {
        0 | 4 | 8 | 12 | 16 => Kind::Nothing,
        2 | 7 | 11 | 15 => Kind::Two,
        5 | 14 => Kind::Outside,
        _ => Kind::One,
    }
}

fn files(folder: &Path, matches: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| {
            path.file_name()
                .is_some_and(|name| matches(&name.to_string_lossy()))
        })
        .collect();
    found.sort();
    found
}

/// Diagnoses the case in `folder`.
fn diagnose(judge: &Judge, folder: &Path, truth: Truth, scratch: &Path) -> Result<Judged, String> {
    let out = scratch.join(&truth.case);
    let (case, place) = (folder.to_string_lossy(), out.join("diagnosis"));
    let place = place.to_string_lossy();
    let answer = judge
        .ask(&["diagnose", &case, "--out", &place, "--json"], &out)
        .map_err(|error| format!("{}: {error}", judge.program.display()))?;
    let judged = Judged::of(truth, &answer);
    eprintln!(
        "{} {:?}: {:?}, {} {:.1} s",
        judged.truth.case, judged.truth.kind, judged.outcome, judged.verdict, judged.seconds
    );
    Ok(judged)
}

fn run() -> Result<(), String> {
    let options = Options::read(&[
        "cases", "seed", "kind", "shard", "program", "limit", "records", "from", "out", "keep",
        "ablate",
    ])?;
    let judge = options.judge(180)?;
    let (cases, seed) = (options.number("cases", 20)?, options.number("seed", 1)?);
    let is_mine = options.shard()?;
    let only = match options.text("kind") {
        None => None,
        Some("nothing") => Some(Kind::Nothing),
        Some("one") => Some(Kind::One),
        Some("two") => Some(Kind::Two),
        Some("outside") => Some(Kind::Outside),
        Some(other) => {
            return Err(format!(
                "--kind {other}: expected nothing, one, two or outside"
            ));
        }
    };
    let recorded = options.text("records").map_or(Vec::new(), |folder| {
        files(Path::new(folder), |name| {
            name.ends_with(".csv") || name.ends_with(".AT2")
        })
    });
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |error: std::io::Error| format!("{path}: {error}")
    };
    let scratch = options.scratch();
    fs::create_dir_all(&scratch).map_err(failed(&scratch))?;
    let journal = scratch.join("judged.jsonl");
    let read = || -> Vec<Judged> {
        let text = fs::read_to_string(&journal).unwrap_or_default();
        text.lines()
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    };
    let done: BTreeSet<String> = read().into_iter().map(|judged| judged.truth.case).collect();
    let keep = |judged: &Judged| -> Result<(), String> {
        let mut file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&journal)
            .map_err(failed(&journal))?;
        let line = serde_json::to_string(judged).map_err(|error| error.to_string())?;
        writeln!(file, "{line}").map_err(failed(&journal))
    };
    println!("seed {seed}");
    if let Some(from) = options.path("from") {
        for (number, path) in files(&from.join("truth"), |name| name.ends_with(".json"))
            .iter()
            .enumerate()
        {
            let text = fs::read_to_string(path).map_err(failed(path))?;
            let mut value: serde_json::Value = serde_json::from_str(&text)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            if value["kind"].is_null() || value["kind"] == "none" {
                let effects = value["effects"].as_array().map_or(&[][..], Vec::as_slice);
                let is_outside = effects.iter().any(|e| e["effect"] == "outside_catalogue");
                let kind = match effects.len() {
                    _ if is_outside => Kind::Outside,
                    0 => Kind::Nothing,
                    1 => Kind::One,
                    _ => Kind::Two,
                };
                value["kind"] = serde_json::json!(kind);
            }
            let truth: Truth = serde_json::from_value(value)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            if is_mine(number as u64) && !done.contains(&truth.case) {
                let folder = from.join("cases").join(&truth.case);
                keep(&diagnose(&judge, &folder, truth, &scratch)?)?;
            }
        }
    } else {
        for number in (0..cases).filter(|number| is_mine(*number)) {
            if done.contains(&format!("strange-{}", seed + number)) {
                continue;
            }
            let case = Case::draw(
                seed + number,
                only.unwrap_or_else(|| kind(number)),
                &recorded,
            );
            if let Some(folder) = options.path("keep") {
                let place = folder.join("cases").join(&case.truth.case);
                case.write(&place).map_err(failed(&place))?;
                let truth = folder.join("truth");
                fs::create_dir_all(&truth).map_err(failed(&truth))?;
                let text =
                    serde_json::to_string_pretty(&case.truth).map_err(|error| error.to_string())?;
                let file = truth.join(format!("{}.json", case.truth.case));
                fs::write(&file, text).map_err(failed(&file))?;
                continue;
            }
            let folder = scratch.join(&case.truth.case).join("case");
            case.write(&folder).map_err(failed(&folder))?;
            let mut judged = diagnose(&judge, &folder, case.truth.clone(), &scratch)?;
            if options.text("ablate").is_some()
                && let Some(printed) = judged.only_name().map(|name| name.gain)
            {
                judged.by_hand = by_hand(&case);
                eprintln!("    printed {printed:?}, by hand {:?}", judged.by_hand);
            }
            keep(&judged)?;
            fs::remove_dir_all(&folder).map_err(failed(&folder))?;
        }
    }
    println!("{}", table(&read()));
    if options.text("out").is_none() {
        fs::remove_dir_all(&scratch).map_err(failed(&scratch))?;
    }
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
