//! The hidden-effect suite: fresh cases, the diagnosis of each, and what came of them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::UNIX_EPOCH;

use hidden_effects::score::{Estimate, NamedEffect, names, outcome, parameter_errors, wilson};
use hidden_effects::{Case, Kind, Outcome, Settings, Truth, Verdict, World};
use identification::diagnosis::case::Case as Laboratory;
use identification::diagnosis::engine::{self, Observer};
use identification::diagnosis::rigs::shake_table::{Diagnosis, diagnose};
use serde::{Deserialize, Serialize};
use shakebench::campaign::table::{Cell, Column, Kind as ColumnKind, Role};
use shakebench::campaign::{self, Head, Progress, Row, Runs, Shard, carry_out};
use shakebench::error::Error;
use shakebench::master::Ending;

/// How many cases of each kind, and from which seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// First seed; every case takes the next one.
    pub seed: u64,
    /// Cases with one effect.
    pub one: usize,
    /// Which effect that is; one of the exchange format's, drawn, where none is named.
    pub effect: Option<&'static str>,
    /// Cases with two.
    pub two: usize,
    /// Cases with none.
    pub nothing: usize,
    /// Cases with something outside the catalogue.
    pub outside: usize,
    /// Relative standard deviations of the plant's parameters, which the cases take in turn.
    pub mismatch: Vec<f64>,
    /// Factors on the sensors' noise, which the cases take in turn.
    pub noise: Vec<f64>,
    /// What disturbs the rigs and their sensors.
    pub world: World,
    /// Prints each search's steps and what is left over to standard error.
    pub verbose: bool,
}

/// One case with its outcome.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scored {
    /// The seed it came from.
    pub seed: u64,
    /// `one`, `two`, `nothing` or `outside`.
    pub kind: String,
    /// What was hidden.
    pub truth: Truth,
    /// What was said.
    pub verdict: Verdict,
    /// Right, wrong or silent.
    pub outcome: Outcome,
    /// Relative error of each parameter and whether its 95 % interval holds the truth.
    pub errors: Vec<(f64, bool)>,
    /// Seconds of one core that the diagnosis took.
    pub seconds: f64,
    /// The diagnosis's sentence, or why it refused.
    pub sentence: String,
}

/// Draws a case, writes it down, reads it as a laboratory's and diagnoses it.
///
/// # Panics
/// When the case cannot be written or read back: the suite itself is at fault then.
pub fn run(seed: u64, kind: &'static str, settings: &Settings, verbose: bool) -> Scored {
    let case = Case::draw(seed, settings);
    let folder = tempfile::tempdir().expect("a temporary folder");
    case.write(folder.path())
        .expect("a case that can be written");
    let laboratory = Laboratory::read(folder.path()).expect("a case that can be read");
    let begin = core_seconds();
    let told = |event: &engine::Progress| eprintln!("{event}");
    let observer = if verbose {
        Observer::new(&told)
    } else {
        Observer::none()
    };
    let diagnosis = diagnose(&laboratory, observer);
    let seconds = core_seconds() - begin;
    if verbose && let Ok(diagnosis) = &diagnosis {
        eprintln!("truth: {:?}\n{}", case.truth, diagnosis.sentence);
        for test in &diagnosis.remaining {
            eprintln!("    {:.1}: {}", test.deviate, test.what);
        }
    }
    let (verdict, sentence) = match diagnosis {
        Ok(diagnosis) => (as_scored(&diagnosis), diagnosis.sentence),
        Err(error) => (Verdict::default(), error.to_string()),
    };
    Scored {
        seed,
        kind: kind.to_string(),
        outcome: outcome(&case.truth, &verdict),
        errors: parameter_errors(&case.truth, &verdict, |value, from, to| {
            shakebench::units::convert(value, from, to).ok()
        }),
        truth: case.truth,
        verdict,
        seconds,
        sentence,
    }
}

/// Seconds that this thread has had a core, where the system tells; else the clock's, which on a
/// busy machine are more.
fn core_seconds() -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(
        || UNIX_EPOCH.elapsed().map_or(0.0, |now| now.as_secs_f64()),
        |nanoseconds| 1e-9 * nanoseconds,
    )
}

/// A diagnosis in the words of the exchange format.
pub fn as_scored(diagnosis: &Diagnosis) -> Verdict {
    let effects = diagnosis.effects.iter().map(|effect| NamedEffect {
        effect: effect.effect.into(),
        confidence: effect.confidence,
        parameters: effect
            .parameters
            .iter()
            .map(|p| {
                let estimate = Estimate {
                    value: p.value,
                    unit: p.unit.into(),
                    standard_error: p.standard_error,
                };
                (p.name.clone(), estimate)
            })
            .collect(),
    });
    Verdict {
        verdict: diagnosis.verdict.to_string(),
        effects: effects.collect(),
        alternatives: diagnosis
            .alternatives
            .iter()
            .map(|set| set.iter().map(|name| (*name).into()).collect())
            .collect(),
    }
}

impl Plan {
    /// Kind and settings of the case of a number.
    fn case(&self, number: u64) -> Option<(&'static str, Settings)> {
        let number = usize::try_from(number).ok()?;
        let mut first = 0;
        let (name, kind) = self.kinds().into_iter().find_map(|(name, kind, count)| {
            first += count;
            (number < first).then_some((name, kind))
        })?;
        let plain = Settings::new(kind);
        let in_turn = |values: &[f64], turn: usize, otherwise: f64| {
            let place = turn.checked_rem(values.len());
            place.map_or(otherwise, |place| values[place])
        };
        let settings = Settings {
            mismatch: in_turn(
                &self.mismatch,
                number / self.noise.len().max(1),
                plain.mismatch,
            ),
            noise: in_turn(&self.noise, number, plain.noise),
            world: self.world,
            ..plain
        };
        Some((name, settings))
    }

    fn kinds(&self) -> [(&'static str, Kind, usize); 4] {
        [
            ("one", self.effect.map_or(Kind::One, Kind::This), self.one),
            ("two", Kind::Two, self.two),
            ("nothing", Kind::Nothing, self.nothing),
            ("outside", Kind::Outside, self.outside),
        ]
    }
}

/// The cases as the runs of a study: with its journal, shards and table.
impl Runs for Plan {
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    fn head(&self) -> Result<Head, Error> {
        let column = |name: &str, role, kind| Column {
            name: name.to_string(),
            unit: None,
            role,
            kind,
        };
        // What another program diagnosed is diagnosed again.
        let program = std::env::current_exe().and_then(std::fs::read);
        let program = program.map(|bytes| shakebench::fmu::digest(&bytes));
        Ok(Head::of(
            BTreeMap::from([("diagnosis".to_string(), program.unwrap_or_default())]),
            vec![
                column("number", Role::Run, ColumnKind::Number),
                column("run", Role::Run, ColumnKind::Text),
                column("kind", Role::Factor, ColumnKind::Text),
                column("mismatch", Role::Factor, ColumnKind::Number),
                column("noise", Role::Factor, ColumnKind::Number),
                column("hidden", Role::Factor, ColumnKind::Text),
                column("outcome", Role::Result, ColumnKind::Text),
                column("seconds", Role::Result, ColumnKind::Number),
                column("scored", Role::Result, ColumnKind::Text),
                column("ended", Role::Ending, ColumnKind::Text),
                column("ended_s", Role::Ending, ColumnKind::Number),
                column("reason", Role::Ending, ColumnKind::Text),
            ],
        ))
    }

    fn count(&self) -> u64 {
        self.kinds().iter().map(|(.., count)| *count as u64).sum()
    }

    fn name(&self, number: u64) -> String {
        format!("{} {:?}", self.seed + number, self.case(number))
    }

    fn run(&self, number: u64) -> Row {
        let (kind, settings) = self.case(number).expect("a number below the count");
        let scored = run(self.seed + number, kind, &settings, self.verbose);
        let whole = serde_json::to_string(&scored).expect("plain data");
        Row {
            run: self.name(number),
            cells: vec![
                kind.into(),
                settings.mismatch.into(),
                settings.noise.into(),
                hidden(&scored.truth).into(),
                format!("{:?}", scored.outcome).into(),
                scored.seconds.into(),
                whole.into(),
                Ending::Complete.word().into(),
                Cell::Missing,
                Cell::Missing,
            ],
        }
    }
}

/// All cases of a plan, on all cores; those that `folder` has are not diagnosed again.
///
/// # Errors
/// A folder that cannot be written or holds other cases.
pub fn run_all(
    plan: &Plan,
    folder: &Path,
    shard: Option<Shard>,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<Scored>, Error> {
    let how = campaign::Plan {
        folder: folder.to_path_buf(),
        shard,
        jobs: None,
    };
    let carried = carry_out(plan, &how, &AtomicBool::new(false), tell)?;
    let scored = carried.table.texts("scored");
    Ok(scored
        .iter()
        .map(|text| serde_json::from_str(text).expect("what was written"))
        .collect())
}

/// Rates with Wilson intervals by kind, strength and excitation, parameter errors, coverage, time
/// and every case that is not right.
pub fn table(results: &[Scored]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<34}{:>6}{:>7}{:>7}{:>8}   right, 95 % interval",
        "cases", "all", "right", "wrong", "silent"
    );
    let mut row = |name: &str, filter: &dyn Fn(&Scored) -> bool| {
        let chosen: Vec<&Scored> = results.iter().filter(|r| filter(r)).collect();
        if chosen.is_empty() {
            return;
        }
        let count = |o: Outcome| chosen.iter().filter(|r| r.outcome == o).count();
        let (right, wrong) = (count(Outcome::Right), count(Outcome::Wrong));
        let (low, high) = wilson(right, chosen.len());
        let _ = writeln!(
            text,
            "{name:<34}{:>6}{right:>7}{wrong:>7}{:>8}   {:.1} to {:.1} %",
            chosen.len(),
            count(Outcome::Silent),
            100.0 * low,
            100.0 * high
        );
    };
    row("all", &|_| true);
    for kind in ["one", "two", "nothing", "outside"] {
        row(kind, &|r| r.kind == kind);
    }
    for (name, low, high) in [
        ("weak (lower third)", 0.0, 0.33),
        ("middling", 0.33, 0.67),
        ("strong", 0.67, 1.01),
    ] {
        row(&format!("strength: {name}"), &|r| {
            r.truth.strength.is_some_and(|s| (low..high).contains(&s))
        });
    }
    for excitation in hidden_effects::excitation::EXCITATIONS {
        row(&format!("identified on: {excitation:?}"), &|r| {
            r.truth.excitation.first() == Some(&excitation)
        });
    }
    for usual in [true, false] {
        let name = if usual { "the usual" } else { "others" };
        row(&format!("forms of the effects: {name}"), &|r| {
            r.truth.usual_form == usual && matches!(r.kind.as_str(), "one" | "two")
        });
    }
    let distinct = |value: fn(&Truth) -> f64| {
        let mut values: Vec<f64> = results.iter().map(|r| value(&r.truth)).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    for noise in distinct(|truth| truth.noise) {
        row(&format!("noise: {noise} times"), &|r| {
            r.truth.noise == noise
        });
    }
    for mismatch in distinct(|truth| truth.mismatch) {
        row(&format!("mismatch: {} %", 100.0 * mismatch), &|r| {
            r.truth.mismatch == mismatch
        });
    }
    let outside: BTreeSet<&str> = results
        .iter()
        .filter_map(|r| r.truth.outside.as_deref())
        .collect();
    for kind in outside {
        row(&format!("outside: {kind}"), &|r| {
            r.truth.outside.as_deref() == Some(kind)
        });
    }
    let mut by_effect: BTreeMap<&str, Vec<&Scored>> = BTreeMap::new();
    for scored in results.iter().filter(|r| r.kind == "one") {
        for effect in &scored.truth.effects {
            by_effect.entry(&effect.effect).or_default().push(scored);
        }
    }
    for effect in by_effect.keys() {
        row(effect, &|r| {
            r.kind == "one" && r.truth.effects[0].effect == *effect
        });
    }

    let mut errors: Vec<f64> = results
        .iter()
        .flat_map(|r| &r.errors)
        .map(|e| e.0)
        .collect();
    errors.sort_by(f64::total_cmp);
    let mut seconds: Vec<f64> = results.iter().map(|r| r.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    if !errors.is_empty() {
        let held = results
            .iter()
            .flat_map(|r| &r.errors)
            .filter(|e| e.1)
            .count();
        let (low, high) = wilson(held, errors.len());
        let _ = writeln!(
            text,
            "\nparameter error: median {:.2} %, 90th percentile {:.1} % ({} parameters)\n\
             95 % intervals that hold the truth: {:.1} % ({:.1} to {:.1})",
            100.0 * quantile(&errors, 0.5),
            100.0 * quantile(&errors, 0.9),
            errors.len(),
            100.0 * held as f64 / errors.len() as f64,
            100.0 * low,
            100.0 * high
        );
    }
    if !seconds.is_empty() {
        let _ = writeln!(
            text,
            "seconds of one core a case: median {:.1}, longest {:.1}",
            quantile(&seconds, 0.5),
            quantile(&seconds, 1.0)
        );
    }
    text.push_str(&reliability(results));
    text.push_str(&confusions(results));
    for scored in results.iter().filter(|r| r.outcome != Outcome::Right) {
        let _ = writeln!(text, "{}", line(scored));
    }
    text
}

/// Bounds of the confidences that are counted together.
const SURE: [f64; 6] = [0.0, 0.5, 0.9, 0.99, 0.999, 1.0];

/// Of the effects named with a confidence, how many are there.
fn reliability(results: &[Scored]) -> String {
    let all: Vec<(f64, bool)> = results
        .iter()
        .flat_map(|scored| names(&scored.truth, &scored.verdict))
        .collect();
    let mut text = String::from("\nconfidence -> named, there, 95 % interval\n");
    for bounds in SURE.windows(2) {
        let last = bounds[1] == 1.0;
        let within = |sure: f64| bounds[0] <= sure && (sure < bounds[1] || last);
        let own: Vec<&(f64, bool)> = all.iter().filter(|(sure, _)| within(*sure)).collect();
        if own.is_empty() {
            continue;
        }
        let there = own.iter().filter(|(_, there)| *there).count();
        let mean = own.iter().map(|(sure, _)| sure).sum::<f64>() / own.len() as f64;
        let (low, high) = wilson(there, own.len());
        let _ = writeln!(
            text,
            "{} to {} (mean {mean:.4}) -> {}, {there}, {:.1} to {:.1} %",
            bounds[0],
            bounds[1],
            own.len(),
            100.0 * low,
            100.0 * high
        );
    }
    text
}

/// The confusion matrix without its zeros: what was hidden, what was said, how often.
fn confusions(results: &[Scored]) -> String {
    let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
    for scored in results {
        let mut said: Vec<&str> = scored
            .verdict
            .effects
            .iter()
            .map(|e| e.effect.as_str())
            .collect();
        said.sort_unstable();
        let said = match scored.verdict.verdict.as_str() {
            "named" => said.join(" + "),
            "ambiguous" => format!("one of several, such as {}", said.join(" + ")),
            "" => "refused".into(),
            other => other.to_string(),
        };
        *counts.entry((hidden(&scored.truth), said)).or_default() += 1;
    }
    let mut text = String::from("\nhidden -> said: cases\n");
    for ((hidden, said), count) in counts {
        let _ = writeln!(text, "{hidden} -> {said}: {count}");
    }
    text
}

/// Names of what was hidden.
fn hidden(truth: &Truth) -> String {
    let mut names: Vec<&str> = truth.effects.iter().map(|e| e.effect.as_str()).collect();
    names.sort_unstable();
    if names.is_empty() {
        "nothing".into()
    } else {
        names.join(" + ")
    }
}

/// One case in one line: what was hidden and what was said.
pub fn line(scored: &Scored) -> String {
    let named: Vec<&str> = scored
        .verdict
        .effects
        .iter()
        .map(|e| e.effect.as_str())
        .collect();
    format!(
        "seed {} {:?}: hidden {} {}(strength {:.2}, {:?}{}), said {} {named:?} {:?}",
        scored.seed,
        scored.outcome,
        hidden(&scored.truth),
        scored
            .truth
            .outside
            .as_ref()
            .map(|o| format!("[{o}] "))
            .unwrap_or_default(),
        scored.truth.strength.unwrap_or(0.0),
        scored.truth.excitation,
        if scored.truth.usual_form {
            ""
        } else {
            ", another form"
        },
        if scored.verdict.verdict.is_empty() {
            &scored.sentence
        } else {
            &scored.verdict.verdict
        },
        scored.verdict.alternatives,
    )
}

/// The outcome rates of a kind: right and wrong as fractions.
pub fn rates(results: &[Scored], kind: &str) -> (f64, f64) {
    let chosen: Vec<&Scored> = results.iter().filter(|r| r.kind == kind).collect();
    let share = |o: Outcome| {
        chosen.iter().filter(|r| r.outcome == o).count() as f64 / chosen.len().max(1) as f64
    };
    (share(Outcome::Right), share(Outcome::Wrong))
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len() - 1;
    sorted[((last as f64 * share).round() as usize).min(last)]
}
