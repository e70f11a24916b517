//! A study from its file to its table: runs that are missing are carried out on all cores.

use pack::Installation;
use std::collections::{HashMap, HashSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use super::bench::Bench;
use super::journal::{self, Head, IDENTITY, Journal};
use super::runs::Runs;
use super::study::Study;
use super::table::{Cell, INVALID, Table};
use fmi_master::Ending;
use laboratory::error::Error;
use laboratory::results::Out;

/// A part of a study: every `of`-th run from the `part`-th on, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which part.
    pub part: u64,
    /// Of how many.
    pub of: u64,
}

/// A text that is not a share of a study's runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected I/N with 1 <= I <= N, such as 1/4")]
pub struct NotAShard;

impl FromStr for Shard {
    type Err = NotAShard;

    /// Reads `I/N`.
    fn from_str(text: &str) -> Result<Self, NotAShard> {
        let (part, of) = text.split_once('/').ok_or(NotAShard)?;
        let part = part.trim().parse().map_err(|_| NotAShard)?;
        let of = of.trim().parse().map_err(|_| NotAShard)?;
        let shard = (1..=of).contains(&part).then_some(Self { part, of });
        shard.ok_or(NotAShard)
    }
}

impl Shard {
    fn holds(self, number: u64) -> bool {
        number % self.of == self.part - 1
    }
}

/// How a study is carried out.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The folder for journals and results.
    pub folder: Out,
    /// The part to carry out; none: all.
    pub shard: Option<Shard>,
    /// Runs at a time; none: one a core.
    pub jobs: Option<usize>,
}

/// How far it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Runs that are done.
    pub done: u64,
    /// All runs of this process, those that were done before among them.
    pub of: u64,
}

/// What `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Rows.
    pub runs: u64,
    /// Played to their end.
    pub complete: u64,
    /// Stopped by an interlock.
    pub interlock: u64,
    /// Failed, with a reason in their row.
    pub failed: u64,
    /// Could not begin, with a reason in their row.
    pub invalid: u64,
    /// Rows that were there already.
    pub from_before: u64,
    /// Time that it took.
    pub wall_s: f64,
    /// Whether runs are missing: it was interrupted, or other shards have them.
    pub missing: u64,
}

/// What came of a study.
pub struct Carried {
    /// The rows that are there, by number.
    pub table: Table,
    /// In figures.
    pub summary: Summary,
}

/// Bytes that a run needs on the disk: its line in the journal and its rows in the results.
const BYTES_A_RUN: u64 = 1200;
/// Bytes that the page and what is found need at most.
const BYTES_OF_PAGES: u64 = 3 << 20;

/// Carries out the runs of a study that no journal in its folder has; `tell` hears how far it is, and
/// `interrupt` ends it after the runs that are under way.
///
/// # Errors
/// Whatever is wrong with the study, before its first run; a folder that cannot be written. A run that
/// fails is a row.
pub fn carry_out(
    runs: &dyn Runs,
    plan: &Plan,
    interrupt: &AtomicBool,
    tell: &(dyn Fn(Progress) + Sync),
) -> Result<Carried, Error> {
    let begun = Instant::now();
    runs.check()?;
    let head = runs.head()?;
    if plan.folder.replaces() {
        journal::remove(&plan.folder);
    }
    let mut rows = journal::read(&plan.folder, &head)?;
    let mine = |number: &u64| plan.shard.is_none_or(|shard| shard.holds(*number));
    let all = (0..runs.count()).filter(mine);
    let all: Vec<(u64, String)> = all.map(|number| (number, runs.name(number))).collect();
    let missing = all.iter().filter(|(_, name)| !rows.contains_key(name));
    let missing: Vec<u64> = missing.map(|(number, _)| *number).collect();
    let before = (all.len() - missing.len()) as u64;
    let progress = |done| {
        tell(Progress {
            done: before + done,
            of: all.len() as u64,
        });
    };
    progress(0);
    if !missing.is_empty() {
        room(
            &plan.folder,
            BYTES_OF_PAGES + missing.len() as u64 * BYTES_A_RUN,
        )?;
        let name = match plan.shard {
            None => "all".to_string(),
            Some(Shard { part, of }) => format!("{part}-of-{of}"),
        };
        let journal = Mutex::new(Journal::open(&plan.folder, &name, &head)?);
        let done = AtomicU64::new(0);
        let carry = || -> Result<(), Error> {
            missing
                .par_iter()
                .with_max_len(1)
                .try_for_each(|&number| -> Result<(), Error> {
                    if interrupt.load(Ordering::Relaxed) {
                        return Ok(());
                    }
                    let row = runs.run(number);
                    journal
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .add(&row)?;
                    progress(1 + done.fetch_add(1, Ordering::Relaxed));
                    Ok(())
                })
        };
        pool(plan.jobs)?.install(carry)?;
        rows = journal::read(&plan.folder, &head)?;
    }
    let mut table = Table {
        columns: head.columns,
        rows: Vec::new(),
    };
    let mut known = HashSet::new();
    let mut there = 0;
    for (number, name) in &all {
        let Some(cells) = rows.get(name) else {
            continue;
        };
        there += 1;
        // Two points of lists alone may be the same run.
        if known.insert(name) {
            let mut row = Vec::with_capacity(IDENTITY + cells.len());
            row.push(Cell::Number(*number as f64));
            row.push(name.as_str().into());
            row.extend_from_slice(cells);
            table.rows.push(row);
        }
    }
    let ended = table.texts("ended");
    let of = |word: &str| ended.iter().filter(|own| **own == word).count() as u64;
    let count = |ending: Ending| of(ending.word());
    let rows_there = table.rows.len() as u64;
    let summary = Summary {
        runs: rows_there,
        complete: count(Ending::Complete) + count(Ending::Terminated),
        interlock: count(Ending::Interlock),
        failed: count(Ending::Failed),
        invalid: of(INVALID),
        from_before: before,
        wall_s: begun.elapsed().as_secs_f64(),
        missing: runs.count() - there,
    };
    Ok(Carried { table, summary })
}

/// What is left of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Left {
    /// Under what its rows are made here; those from elsewhere have to be made under the same.
    pub head: Head,
    /// Numbers of the runs that no journal has, as ranges: from the first to before the second.
    pub missing: Vec<[u64; 2]>,
}

impl Left {
    /// What the journals in `folder` lack; without a folder, or where its files are replaced, all runs.
    ///
    /// # Errors
    /// A study at fault; a journal that is damaged, or was made by another version.
    pub fn new(runs: &dyn Runs, folder: Option<&Out>) -> Result<Self, Error> {
        let head = runs.head()?;
        let rows = match folder {
            Some(folder) if !folder.replaces() => journal::read(folder, &head)?,
            _ => HashMap::new(),
        };
        let mut missing: Vec<[u64; 2]> = Vec::new();
        for number in 0..runs.count() {
            if rows.contains_key(&runs.name(number)) {
                continue;
            }
            match missing.last_mut() {
                Some([_, end]) if *end == number => *end += 1,
                _ => missing.push([number, number + 1]),
            }
        }
        Ok(Self { head, missing })
    }
}

/// Carries out the runs of these numbers on this thread and writes them as a journal.
///
/// # Errors
/// Whatever is wrong with the study; an output that cannot be written.
pub fn rows(
    study: &Study,
    numbers: std::ops::Range<u64>,
    installation: &Installation,
    output: &mut dyn Write,
) -> Result<(), Error> {
    let bench = Bench::new(study, installation);
    let mut write = |line: Vec<u8>| {
        output.write_all(&line).map_err(|error| Error::File {
            path: PathBuf::from("standard output"),
            reason: error.to_string(),
        })
    };
    write(journal::line(&bench.head()?)?)?;
    for number in numbers {
        write(journal::row_line(&bench.run(number))?)?;
    }
    Ok(())
}

fn pool(jobs: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0));
    builder.build().map_err(|error| Error::Option {
        option: "--jobs",
        reason: error.to_string(),
    })
}

/// Whether so many bytes can be written to the disk of `folder`.
fn room(folder: &Path, bytes: u64) -> Result<(), Error> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    let place = absolute.ancestors().find(|place| place.is_dir());
    let free = place.and_then(free_bytes);
    match free {
        Some(free) if free < bytes => Err(Error::File {
            path: folder.to_path_buf(),
            reason: format!(
                "the study needs about {} MB in this folder, and {} MB are free",
                bytes.div_ceil(1 << 20),
                free >> 20
            ),
        }),
        _ => Ok(()),
    }
}

/// Bytes that are free for this user; none where the system does not say.
#[cfg(unix)]
#[allow(unsafe_code, reason = "the system is asked")]
fn free_bytes(place: &Path) -> Option<u64> {
    use std::os::unix::ffi::OsStrExt;
    let place = std::ffi::CString::new(place.as_os_str().as_bytes()).ok()?;
    // SAFETY: the structure is plain data, and the path ends with a zero.
    unsafe {
        let mut found: libc::statvfs = std::mem::zeroed();
        let status = libc::statvfs(place.as_ptr(), &raw mut found);
        #[allow(clippy::unnecessary_cast, reason = "its width differs between systems")]
        (status == 0).then(|| (found.f_bavail as u64).saturating_mul(found.f_frsize as u64))
    }
}

#[cfg(not(unix))]
fn free_bytes(_place: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::super::table::{Column, Kind, Role, Row};
    use super::*;

    /// Runs whose third is stopped, and of which the last two are the same.
    struct Few;

    impl Runs for Few {
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
            let columns = vec![
                column("number", Role::Run, Kind::Number),
                column("run", Role::Run, Kind::Text),
                column("x", Role::Result, Kind::Number),
                column("ended", Role::Ending, Kind::Text),
            ];
            Ok(Head::of(Default::default(), columns))
        }

        fn count(&self) -> u64 {
            7
        }

        fn name(&self, number: u64) -> String {
            format!("run-{}", number.min(5))
        }

        fn run(&self, number: u64) -> Row {
            let words = ["complete", "terminated", "interlock", "failed", INVALID];
            let word = words.get(number as usize).unwrap_or(&"complete");
            Row {
                run: self.name(number),
                cells: vec![Cell::Number(10.0 * number as f64), (*word).into()],
            }
        }
    }

    fn plan(folder: &Path, shard: Option<&str>, replaces: bool) -> Plan {
        Plan {
            folder: Out::new(folder).replacing(replaces),
            shard: shard.map(|text| text.parse().unwrap()),
            jobs: Some(1),
        }
    }

    fn carried(plan: &Plan) -> (Carried, Vec<Progress>) {
        let told = Mutex::new(Vec::new());
        let never = AtomicBool::new(false);
        let tell = |progress| told.lock().unwrap().push(progress);
        let carried = carry_out(&Few, plan, &never, &tell).unwrap();
        (carried, told.into_inner().unwrap())
    }

    #[test]
    fn shares_of_runs_are_read_as_one_of_several() {
        assert_eq!(" 2 / 4".parse(), Ok(Shard { part: 2, of: 4 }));
        assert_eq!("4/4".parse(), Ok(Shard { part: 4, of: 4 }));
        for wrong in ["0/4", "5/4", "1", "1/0", "a/2", "1/b", "-1/2"] {
            assert_eq!(wrong.parse::<Shard>(), Err(NotAShard), "{wrong}");
        }
        let second = Shard { part: 2, of: 3 };
        let held: Vec<u64> = (0..8).filter(|number| second.holds(*number)).collect();
        assert_eq!(held, [1, 4, 7]);
    }

    #[test]
    fn runs_that_are_missing_are_carried_out_and_counted_by_their_ending() {
        let folder = tempfile::tempdir().unwrap();
        let (first, told) = carried(&plan(folder.path(), Some("1/2"), false));
        // Runs 0, 2, 4 and 6 of seven, where the run of 6 is also that of 5.
        assert_eq!(first.table.numbers("number"), [0.0, 2.0, 4.0, 6.0]);
        let Summary {
            runs,
            complete,
            interlock,
            failed,
            invalid,
            from_before,
            missing,
            ..
        } = first.summary;
        assert_eq!(
            [runs, complete, interlock, failed, invalid],
            [4, 2, 1, 0, 1]
        );
        assert_eq!((from_before, missing), (0, 3));
        let progress = |done, of| Progress { done, of };
        assert_eq!(told, [0, 1, 2, 3, 4].map(|done| progress(done, 4)));
        let left = Left::new(&Few, Some(&Out::new(folder.path()))).unwrap();
        assert_eq!(left.missing, [[1, 2], [3, 4]]);
        let all = Left::new(&Few, None).unwrap();
        assert_eq!(all.missing, [[0, 7]]);
        let replaced = Out::new(folder.path()).replacing(true);
        assert_eq!(Left::new(&Few, Some(&replaced)).unwrap().missing, [[0, 7]]);
        let (whole, told) = carried(&plan(folder.path(), None, false));
        assert_eq!(told, [5, 6, 7].map(|done| progress(done, 7)));
        // Two runs that are the same have one row.
        assert_eq!(
            whole.table.texts("run"),
            [0, 1, 2, 3, 4, 5].map(|n| format!("run-{n}"))
        );
        assert_eq!(whole.table.numbers("x")[1..4], [10.0, 20.0, 30.0]);
        let Summary {
            runs,
            complete,
            failed,
            from_before,
            missing,
            ..
        } = whole.summary;
        assert_eq!(
            [runs, complete, failed, from_before, missing],
            [6, 3, 1, 5, 0]
        );
        // Replacing computes all runs again.
        let (_, told) = carried(&plan(folder.path(), None, true));
        assert_eq!((told[0], told.len()), (progress(0, 7), 8));
    }

    #[test]
    fn an_interrupt_leaves_runs_missing() {
        let folder = tempfile::tempdir().unwrap();
        let stop = AtomicBool::new(false);
        let tell = |progress: Progress| stop.store(progress.done == 2, Ordering::Relaxed);
        let plan = plan(folder.path(), None, false);
        let carried = carry_out(&Few, &plan, &stop, &tell).unwrap();
        assert_eq!((carried.summary.runs, carried.summary.missing), (2, 5));
    }

    #[test]
    fn a_full_disk_is_reported_before_the_first_run() {
        let folder = tempfile::tempdir().unwrap();
        assert!(room(folder.path(), 1).is_ok());
        let below = folder.path().join("not/yet/there");
        assert!(room(&below, 1).is_ok());
        let told = room(&below, u64::MAX).unwrap_err().to_string();
        assert!(
            told.contains("needs about 17592186044416 MB in this folder, and "),
            "{told}"
        );
        assert!(!told.contains("and 0 MB are free"), "{told}");
    }
}
