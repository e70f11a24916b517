//! Adds a known effect to real records and asks whether the program says it.
//!
//! `cargo run --release -p strangers --example judge_records -- --shared DIR [--rigs DIR] [--cases N] [--seed S]
//! [--shard I/N] [--program FILE] [--limit SECONDS] [--out DIR]`
//!
//! Each rig is diagnosed once as it is. What is said of it with the effect, less what was said without, is the
//! effect; what was named before and is no longer is lost. A record's own delay or zero may be too small to be said
//! without an effect and is part of what is said with one: it is what is said of another addition, less that.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::Value;
use strangers::dice::Dice;
use strangers::judge::{Judge, share};
use strangers::options::Options;
use strangers::records::{Added, changed};

/// What may be added.
#[derive(Clone, Copy)]
enum Kind {
    Delay,
    Gain,
    Zero,
    Play,
    Asymmetry,
    DeadBand,
}

/// A rig with its files, the column that is changed, its unit, the largest value there, and the sampling step.
struct Measured {
    rig: &'static str,
    folder: &'static str,
    files: &'static [&'static str],
    column: &'static str,
    unit: &'static str,
    largest: f64,
    step: f64,
    /// Those that its description leaves to be told: a gain of the force is none where its friction is known to a
    /// quarter, a law of friction has its own asymmetry, and a zero of 100 N is stated.
    may_be: &'static [Kind],
}

const MEASURED: [Measured; 5] = [
    Measured {
        rig: "friction_damper",
        folder: "measured/friction_damper",
        files: &[
            "ds2_0.5Hz_36lb_1in.csv",
            "ds2_1Hz_36lb_0.5in.csv",
            "ds2_1Hz_36lb_1in.csv",
        ],
        column: "F_friction_N",
        unit: "N",
        largest: 18e3,
        step: 1.0 / 1024.0,
        may_be: &[Kind::Delay, Kind::Zero],
    },
    Measured {
        rig: "steel_coupon",
        folder: "measured/steel_coupon",
        files: &["example_1.csv"],
        column: "Sigma_true",
        unit: "MPa",
        largest: 500.0,
        step: 1.0,
        may_be: &[Kind::Zero],
    },
    Measured {
        rig: "mr_damper",
        folder: "benchmarks/mr_damper",
        files: &["train_random.csv"],
        column: "force_N",
        unit: "N",
        largest: 1.5e3,
        step: 0.332_800_85e-3,
        may_be: &[Kind::Delay],
    },
    Measured {
        rig: "positioning_drive",
        folder: "measured/positioning_drive",
        files: &["DATA_EMPS.csv"],
        column: "q_meas_m",
        unit: "m",
        largest: 0.24,
        step: 1e-3,
        may_be: &[Kind::Zero],
    },
    Measured {
        rig: "servohydraulic_press",
        folder: "measured/servohydraulic_press",
        files: &["chirp_0A.csv"],
        column: "x_meas_mm",
        unit: "mm",
        largest: 2.0,
        step: 1e-3,
        may_be: &[
            Kind::Delay,
            Kind::Gain,
            Kind::Zero,
            Kind::Play,
            Kind::Asymmetry,
            Kind::DeadBand,
        ],
    },
];

impl Measured {
    fn draw(&self, dice: &mut Dice) -> Added {
        let (sign, size) = (dice.sign(), self.largest);
        match dice.pick(self.may_be) {
            // Of whole samples: what lies between them smooths the noise.
            Kind::Delay => {
                let samples = (dice.between(4.0, 16.0) * 1e-3 / self.step).round();
                Added::Delay(samples * self.step)
            }
            Kind::Gain => Added::Gain(sign * dice.between(0.04, 0.15)),
            Kind::Zero => Added::Zero(sign * dice.between(0.02, 0.08) * size),
            Kind::Play => Added::Play(dice.between(0.01, 0.05) * size),
            Kind::Asymmetry => Added::Asymmetry(sign * dice.between(0.04, 0.15)),
            Kind::DeadBand => Added::DeadBand(dice.between(0.02, 0.08) * size),
        }
    }
}

/// Diagnoses a rig on its files, with an effect or without.
fn ask(
    judge: &Judge,
    rig: &Measured,
    added: Option<Added>,
    folder: &Path,
    options: &Options,
) -> Result<Value, String> {
    let failed = |path: &Path| {
        let path = path.display().to_string();
        move |error: std::io::Error| format!("{path}: {error}")
    };
    let kept = folder.join("answer.json");
    if let Some(json) = fs::read(&kept)
        .ok()
        .and_then(|bytes| serde_json::from_slice(&bytes).ok())
    {
        return Ok(json);
    }
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let shared = options
        .path("shared")
        .ok_or("--shared: the folder that has `measured` is needed")?;
    let rigs = options
        .path("rigs")
        .unwrap_or(std::path::absolute("identification/rigs").unwrap_or_default());
    let description = rigs.join(format!("{}.toml", rig.rig));
    let mut arguments = vec![
        "diagnose".to_string(),
        description.to_string_lossy().into_owned(),
    ];
    for file in rig.files {
        let path = shared.join(rig.folder).join(file);
        let text = fs::read_to_string(&path).map_err(failed(&path))?;
        let text = changed(&text, rig.column, |y| {
            added.map_or_else(|| y.to_vec(), |added| added.to(y, rig.step))
        })
        .ok_or_else(|| format!("{}: no column `{}` of numbers", path.display(), rig.column))?;
        let copy: PathBuf = folder.join(file);
        fs::write(&copy, text).map_err(failed(&copy))?;
        arguments.extend(["--data".into(), copy.to_string_lossy().into_owned()]);
    }
    let out = folder.join("diagnosis").to_string_lossy().into_owned();
    arguments.extend(["--out".into(), out, "--json".into()]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let answer = judge.ask(&arguments, folder).map_err(failed(folder))?;
    let mut json = answer
        .json
        .unwrap_or_else(|| serde_json::json!({"sentence": answer.complaint}));
    json["core_seconds"] = answer.seconds.into();
    fs::write(&kept, json.to_string()).map_err(failed(&kept))?;
    Ok(json)
}

fn has_word(added: Added, name: &str) -> bool {
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    has(added.words()) && !has(added.others())
}

/// The number of a parameter under `key`, in `unit`.
fn number(parameter: &Value, key: &str, unit: &str) -> Option<f64> {
    units::convert(parameter[key].as_f64()?, parameter["unit"].as_str()?, unit).ok()
}

/// The value of a parameter with its standard error, in `unit`.
fn estimate(parameter: &Value, unit: &str) -> Option<(f64, f64)> {
    let number = |key: &str| number(parameter, key, unit);
    Some((number("value")?, number("standard_error")?))
}

/// Every value of an effect or a found parameter whose name says it, with its standard error, in `unit`.
fn said(json: &Value, added: Added, unit: &str) -> Vec<(f64, f64)> {
    let has_word = |name: &Value| has_word(added, name.as_str().unwrap_or_default());
    let effects = json["effects"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|e| has_word(&e["effect"]));
    let parameters = effects
        .filter_map(|e| e["parameters"].as_object())
        .flat_map(|p| p.values());
    let values = parameters.filter_map(|p| estimate(p, unit));
    let findings = json["findings"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|f| has_word(&f["parameter"]));
    let found = findings.filter_map(|f| {
        let number = |key: &str| number(f, key, unit);
        let off = number("found")? - number("stated")?;
        Some((off, number("standard_error")?))
    });
    values.chain(found).collect()
}

/// Every value among the candidates that are ranked, with its standard error, in `unit`.
fn ranked(json: &Value, added: Added, unit: &str) -> Vec<(f64, f64)> {
    let candidates = json["candidates"].as_array().into_iter().flatten();
    let parameters = candidates.filter_map(|candidate| candidate["parameters"].as_object());
    parameters
        .flatten()
        .filter(|(name, _)| has_word(added, name))
        .filter_map(|(_, p)| estimate(p, unit))
        .collect()
}

/// What the rig's record has of its own, with its standard error, of the kind of `added`: what is said of it `before`, or
/// else what is said of another addition, less that.
fn own(
    rig: &Measured,
    before: &Value,
    (added, unit): (Added, &str),
    dice: &mut Dice,
    ask: impl Fn(Added) -> Result<Value, String>,
) -> Result<(f64, f64), String> {
    if let Some(own) = said(before, added, unit).first() {
        return Ok(*own);
    }
    let other = loop {
        let other = rig.draw(dice);
        if other.words() == added.words() {
            break other;
        }
    };
    let said = said(&ask(other)?, other, unit);
    let own = said.first().map(|own| (own.0 - other.size().0, own.1));
    Ok(own.unwrap_or_default())
}

fn names(json: &Value) -> BTreeSet<String> {
    let effects = json["effects"].as_array().into_iter().flatten();
    effects
        .filter_map(|e| e["effect"].as_str())
        .map(String::from)
        .collect()
}

fn run() -> Result<(), String> {
    let options = Options::read(&[
        "shared", "rigs", "cases", "seed", "shard", "program", "limit", "out",
    ])?;
    let judge = options.judge(300)?;
    let (cases, seed) = (options.number("cases", 50)?, options.number("seed", 1)?);
    let is_mine = options.shard()?;
    let scratch = options.scratch();
    println!("seed {seed}");
    let mut plain: BTreeMap<&str, Value> = BTreeMap::new();
    let mut owned: BTreeMap<(&str, &str), (f64, f64)> = BTreeMap::new();
    let (mut right, mut hinted, mut held, mut lost, mut all) = (0, 0, 0, 0, 0);
    for number in (seed..seed + cases).filter(|number| is_mine(*number)) {
        let dice = &mut Dice::new(number, 80);
        let rig = &MEASURED[(number % MEASURED.len() as u64) as usize];
        let added = rig.draw(dice);
        let folder = |name: String| scratch.join(rig.rig).join(name);
        if !plain.contains_key(rig.rig) {
            plain.insert(
                rig.rig,
                ask(&judge, rig, None, &folder("plain".into()), &options)?,
            );
        }
        let (before, after) = (
            &plain[rig.rig],
            ask(
                &judge,
                rig,
                Some(added),
                &folder(format!("{number}")),
                &options,
            )?,
        );
        let (size, unit) = added.size();
        let unit = unit.unwrap_or(rig.unit);
        let kind = added.words()[0];
        let already = match owned.entry((rig.rig, kind)) {
            Entry::Occupied(own) => *own.get(),
            Entry::Vacant(place) => {
                let ask = |added| {
                    let place = folder(format!("{kind}-{seed}"));
                    ask(&judge, rig, Some(added), &place, &options)
                };
                let own = own(rig, before, (added, unit), &mut Dice::new(seed, 81), ask)?;
                println!("{} has {:.2e} {unit} of {kind} of its own", rig.rig, own.0);
                *place.insert(own)
            }
        };
        let (later, perhaps) = (said(&after, added, unit), ranked(&after, added, unit));
        let is_said = later.iter().any(|value| *value != already);
        let is_held = |values: &[(f64, f64)]| {
            let off = |(value, error): &(f64, f64)| {
                (value - already.0 - size).abs() <= 1.96 * error.hypot(already.1)
            };
            values.iter().any(off)
        };
        let is_hinted = is_said || is_held(&perhaps);
        let is_held = is_held(&later);
        let missing: Vec<String> = names(before).difference(&names(&after)).cloned().collect();
        all += 1;
        right += usize::from(is_said);
        hinted += usize::from(is_hinted);
        held += usize::from(is_held);
        lost += usize::from(!missing.is_empty());
        println!(
            "{} {number} {added:?}: {}, {}, lost {missing:?}, {:.0} s: {} {:?} {}",
            rig.rig,
            match (is_said, is_hinted) {
                (true, _) => "said",
                (_, true) => "ranked",
                _ => "not said",
            },
            if is_held { "held" } else { "not held" },
            after["core_seconds"].as_f64().unwrap_or_default(),
            after["verdict"].as_str().unwrap_or("refused"),
            later,
            after["sentence"].as_str().unwrap_or_default()
        );
    }
    println!("\ncause said (aim 90 %)          {}", share(right, all));
    println!("or ranked with its size        {}", share(hinted, all));
    println!("size in its interval (aim 90 %) {}", share(held, all));
    println!("trials that lost a cause (aim 0) {}", share(lost, all));
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
