//! The hidden-effect suite: fresh cases, the diagnosis of each, and what came of them.

mod calibration;
mod tables;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::UNIX_EPOCH;

pub use calibration::{beside_each_other, picture};
use fmi_master::Ending;
use hidden_effects::score::{Estimate, NamedEffect, ParameterError, outcome, parameter_errors};
use hidden_effects::{Case, Kind, Outcome, Settings, Truth, Verdict, World};
use identification::diagnosis::case::Case as Laboratory;
use identification::diagnosis::engine::{self, Observer};
use identification::diagnosis::rigs::shake_table::{Diagnosis, diagnose};
use laboratory::error::Error;
use serde::{Deserialize, Serialize};
use study::campaign::table::{Cell, Column, Kind as ColumnKind, Role};
use study::campaign::{self, Head, Progress, Row, Runs, Shard, carry_out};
pub use tables::{line, rates, table};

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
    /// Of each parameter that was hidden and named.
    pub errors: Vec<ParameterError>,
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
            units::convert(value, from, to).ok()
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
    /// The kinds of cases, in words and by name.
    pub const KINDS: [(&str, &str); 4] = [
        ("one effect", "one"),
        ("two effects", "two"),
        ("nothing hidden", "nothing"),
        ("outside the catalogue", "outside"),
    ];

    /// The same plan in a world, with that world's noise and mismatch.
    #[must_use]
    pub fn set_in(self, world: World) -> Self {
        if world == World::Noisy {
            return Self {
                world,
                noise: vec![3.0],
                mismatch: vec![0.02],
                ..self
            };
        }
        Self { world, ..self }
    }

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
        let [one, two, nothing, outside] = Self::KINDS.map(|(_, name)| name);
        [
            (one, self.effect.map_or(Kind::One, Kind::This), self.one),
            (two, Kind::Two, self.two),
            (nothing, Kind::Nothing, self.nothing),
            (outside, Kind::Outside, self.outside),
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
        let program = program.map(|bytes| fmi_import::digest(&bytes));
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

/// All cases of a plan, on all cores; those that `folder` has are not diagnosed again. The other ones are only
/// where `carry_on`.
///
/// # Errors
/// A folder that cannot be written or holds other cases.
pub fn run_all(
    plan: &Plan,
    folder: &Path,
    shard: Option<Shard>,
    carry_on: bool,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<Scored>, Error> {
    let how = campaign::Plan {
        folder: laboratory::results::Out::new(folder),
        shard,
        jobs: None,
    };
    let carried = carry_out(plan, &how, &AtomicBool::new(!carry_on), tell)?;
    let scored = carried.table.texts("scored");
    Ok(scored
        .iter()
        .map(|text| serde_json::from_str(text).expect("what was written"))
        .collect())
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
