//! Checkpoints of a run in its folder, and going on from one.
//!
//! `DIR/checkpoint/run.json` is the manifest of the run, `rows` what was recorded, added to at each
//! checkpoint, and `state` the moment itself and how much of `rows` belongs to it. `state` is replaced
//! as a whole: a process that is killed leaves the checkpoint before.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::manifest::Manifest;
use crate::error::Error;
use crate::results::Out;
use fmi_import::Datum;
use fmi_master::{Checkpoint, Record};

/// The folder of checkpoints in that of a run.
const FOLDER: &str = "checkpoint";
/// The run's manifest.
const RUN: &str = "run.json";
/// What was recorded.
const ROWS: &str = "rows";
/// The moment.
const STATE: &str = "state";
/// What the name of a file ends with until it is complete.
const NEW: &str = ".new";
/// First bytes of `state`.
const MAGIC: &[u8; 16] = b"shakebench state";
/// Version of the layout behind them.
const FORMAT: u32 = 3;

/// What `state` holds behind its first bytes and its checksum.
#[derive(Debug, Serialize, Deserialize)]
struct Saved {
    format: u32,
    /// Bytes of `rows` that belong to it, and their checksum.
    length: u64,
    sum: [u8; 32],
    columns: Vec<String>,
    exact_columns: Vec<String>,
    /// One row was kept of so many.
    record_every: usize,
    /// Samples from one checkpoint to the next.
    every: usize,
    checkpoint: Checkpoint,
}

/// Rows that were recorded between two checkpoints.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Block {
    values: Vec<f64>,
    exact: Vec<Datum>,
}

/// Why a checkpoint is not kept.
#[derive(Debug, thiserror::Error)]
pub enum KeepError {
    /// A moment that has no binary form.
    #[error(transparent)]
    Encoding(#[from] postcard::Error),
    /// The files cannot be written, such as on a disk that is full.
    #[error("{}: {source}", folder.display())]
    Write {
        /// The folder of the checkpoints.
        folder: PathBuf,
        /// The operating system's word.
        source: io::Error,
    },
}

/// A run that can go on.
#[derive(Debug)]
pub struct Unfinished {
    /// What was asked for, and what it was made of.
    pub manifest: Manifest,
    /// What was recorded.
    pub record: Record,
    /// One row was kept of so many.
    pub record_every: usize,
    /// Samples from one checkpoint to the next.
    pub every: usize,
    /// The moment.
    pub checkpoint: Checkpoint,
    length: u64,
    sum: Sha256,
}

/// Keeps checkpoints of a run that goes on.
pub struct Checkpoints {
    folder: PathBuf,
    rows: File,
    length: u64,
    sum: Sha256,
    /// Rows of the record that are in the file.
    kept: usize,
    record_every: usize,
    every: usize,
}

fn fault(path: &Path, reason: impl ToString) -> Error {
    Error::File {
        path: path.to_path_buf(),
        reason: reason.to_string(),
    }
}

/// Refuses to begin another run in a folder where one has not been finished, unless files may be
/// overwritten; then its checkpoint goes.
///
/// # Errors
/// There is a checkpoint.
pub fn refuse_unfinished(folder: &Out) -> Result<(), Error> {
    let place = folder.join(FOLDER);
    if !is_there(folder) {
        return Ok(());
    }
    if folder.replaces() {
        remove(folder);
        return Ok(());
    }
    let reason = format!(
        "a run in {0} has not been finished; expected `shakebench run --resume {0}`, another folder for \
         --out, or --force",
        folder.display()
    );
    Err(fault(&place, reason))
}

/// Whether there is a checkpoint of the run in `folder`.
#[must_use]
pub fn is_there(folder: &Path) -> bool {
    folder.join(FOLDER).join(STATE).exists()
}

/// Takes the checkpoint of a finished run away.
pub fn remove(folder: &Path) {
    let folder = folder.join(FOLDER);
    // The moment first, so that never half a checkpoint is found.
    for file in [STATE, ROWS, RUN] {
        let _ = fs::remove_file(folder.join(file));
        let _ = fs::remove_file(folder.join(format!("{file}{NEW}")));
    }
    let _ = fs::remove_dir(&folder);
}

/// Reads the checkpoint of the run in `folder`.
///
/// # Errors
/// There is none, or it is damaged.
pub fn read(folder: &Path) -> Result<Unfinished, Error> {
    let place = folder.join(FOLDER);
    let path = place.join(STATE);
    let bytes = fs::read(&path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => fault(
            folder,
            "holds no checkpoint: its run was finished, was ended before the first one, or was made \
             without --checkpoint-every",
        ),
        _ => fault(&path, error),
    })?;
    let saved = decode(&bytes).map_err(|reason| fault(&path, reason))?;
    let path = place.join(ROWS);
    let mut rows = Vec::new();
    let file = File::open(&path).and_then(|file| file.take(saved.length).read_to_end(&mut rows));
    file.map_err(|error| fault(&path, error))?;
    let sum = Sha256::new_with_prefix(&rows);
    if rows.len() as u64 != saved.length || sum.clone().finalize().as_slice() != saved.sum {
        return Err(fault(&path, "is damaged: its content has changed"));
    }
    let record = record(&rows, &saved).ok_or_else(|| {
        fault(
            &path,
            "is damaged: rows are \
        incomplete",
        )
    })?;
    Ok(Unfinished {
        manifest: Manifest::read(&place.join(RUN))?,
        record,
        record_every: saved.record_every,
        every: saved.every,
        checkpoint: saved.checkpoint,
        length: saved.length,
        sum,
    })
}

fn decode(bytes: &[u8]) -> Result<Saved, &'static str> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("is not a checkpoint")?;
    let (sum, content) = rest.split_at_checked(32).ok_or("is cut off")?;
    if Sha256::digest(content).as_slice() != sum {
        return Err("is damaged: its checksum differs");
    }
    let saved: Saved = postcard::from_bytes(content).map_err(|_| "is from another version")?;
    match saved.format {
        FORMAT => Ok(saved),
        _ => Err("is from another version"),
    }
}

fn record(mut rows: &[u8], saved: &Saved) -> Option<Record> {
    let mut all = Block::default();
    while !rows.is_empty() {
        let (block, rest) = postcard::take_from_bytes::<Block>(rows).ok()?;
        all.values.extend(block.values);
        all.exact.extend(block.exact);
        rows = rest;
    }
    let (columns, exact_columns) = (saved.columns.clone(), saved.exact_columns.clone());
    Record::of(columns, all.values, exact_columns, all.exact)
}

impl Checkpoints {
    /// Prepares the folder of a run for checkpoints every so many samples; `from` is where it goes on.
    ///
    /// # Errors
    /// A folder that cannot be written, or in which another process keeps checkpoints.
    pub fn begin(
        folder: &Path,
        manifest: &Manifest,
        (record_every, every): (usize, usize),
        from: Option<&Unfinished>,
    ) -> Result<Self, Error> {
        let folder = folder.join(FOLDER);
        fs::create_dir_all(&folder).map_err(|error| fault(&folder, error))?;
        let path = folder.join(ROWS);
        let mut options = OpenOptions::new();
        let opened = options.create(true).write(true).truncate(false).open(&path);
        let mut rows = opened.map_err(|error| fault(&path, error))?;
        if let Err(fs::TryLockError::WouldBlock) = rows.try_lock() {
            return Err(fault(&folder, "another run saves its checkpoints here now"));
        }
        let (length, sum, kept) = match from {
            Some(from) => (from.length, from.sum.clone(), from.record.len()),
            None => (0, Sha256::new(), 0),
        };
        if from.is_none() {
            let text = serde_json::to_string_pretty(manifest).unwrap_or_default() + "\n";
            replace(&folder, RUN, text.as_bytes()).map_err(|error| fault(&folder, error))?;
        }
        // What was written behind the checkpoint is computed again.
        let cut = rows.set_len(length);
        let cut = cut.and_then(|()| rows.seek(SeekFrom::Start(length)));
        cut.map_err(|error| fault(&path, error))?;
        Ok(Self {
            folder,
            rows,
            length,
            sum,
            kept,
            record_every,
            every,
        })
    }

    /// Keeps a moment and what was recorded until then.
    ///
    /// # Errors
    /// A disk that is full, and the like.
    pub fn keep(&mut self, checkpoint: &Checkpoint, record: &Record) -> Result<(), KeepError> {
        let (values, exact) = record.rows_from(self.kept);
        let block = Block {
            values: values.to_vec(),
            exact: exact.to_vec(),
        };
        let bytes = postcard::to_allocvec(&block)?;
        let sum = self.sum.clone().chain_update(&bytes);
        let length = self.length + bytes.len() as u64;
        let saved = Saved {
            format: FORMAT,
            length,
            sum: sum.clone().finalize().into(),
            columns: record.columns.clone(),
            exact_columns: record.exact_columns.clone(),
            record_every: self.record_every,
            every: self.every,
            checkpoint: checkpoint.clone(),
        };
        let content = postcard::to_allocvec(&saved)?;
        let mut state = MAGIC.to_vec();
        state.extend(Sha256::digest(&content).as_slice());
        state.extend(content);
        let mut written = || {
            self.rows.write_all(&bytes)?;
            // The rows are there before the moment that counts on them.
            self.rows.sync_data()?;
            replace(&self.folder, STATE, &state)
        };
        let written = written();
        written.map_err(|source| KeepError::Write {
            folder: self.folder.clone(),
            source,
        })?;
        (self.length, self.sum, self.kept) = (length, sum, record.len());
        Ok(())
    }
}

/// Writes a file as a whole: it is the old one or the new one.
fn replace(folder: &Path, name: &str, content: &[u8]) -> io::Result<()> {
    let new = folder.join(format!("{name}{NEW}"));
    let mut file = File::create(&new)?;
    file.write_all(content)?;
    file.sync_data()?;
    fs::rename(new, folder.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::run::experiment::Request;

    fn moment(tick: usize) -> Checkpoint {
        let json = serde_json::json!({
            "tick": tick, "time": 0.002 * tick as f64, "numbers": [1.0, 2.0], "exact": [], "last_numbers": [],
            "last_exact": [], "tripped": null, "variable": null, "parts": [], "wall": 0.5, "changes": [],
        });
        serde_json::from_value(json).unwrap()
    }

    fn columns() -> (Vec<String>, Vec<String>) {
        (
            ["time", "a.x"].map(String::from).to_vec(),
            vec!["a.text".into()],
        )
    }

    /// So many rows, each with a number and a text.
    fn rows(count: usize) -> Record {
        let (numbers, texts) = columns();
        let mut record = Record::with_capacity(numbers, count).beside(&texts);
        for n in 0..count {
            let text = Datum::Text(format!("row {n}").into_bytes());
            record.push(n as f64, &[0.1 * n as f64], &[text]);
        }
        record
    }

    #[test]
    fn a_run_goes_on_from_its_last_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, manifest) = (
            folder.path(),
            made::manifest(&Request::built_in("mpc"), &made::wave("wave", 5)),
        );
        assert!(!is_there(folder));
        let none = read(folder).unwrap_err().to_string();
        assert!(none.contains("holds no checkpoint"), "{none}");
        let mut kept = Checkpoints::begin(folder, &manifest, (2, 100), None).unwrap();
        assert!(
            Checkpoints::begin(folder, &manifest, (2, 100), None).is_err(),
            "another run saves here"
        );
        kept.keep(&moment(3), &rows(3)).unwrap();
        kept.keep(&moment(5), &rows(5)).unwrap();
        drop(kept);
        assert!(is_there(folder));
        // What was written behind the last moment is of no use.
        let path = folder.join(FOLDER).join(ROWS);
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        file.write_all(b"more").unwrap();
        let found = read(folder).unwrap();
        assert_eq!(
            (found.checkpoint.tick, found.record_every, found.every),
            (5, 2, 100)
        );
        assert_eq!(found.manifest, manifest);
        assert_eq!(
            (found.record.len(), found.record.column("a.x").unwrap()[4]),
            (5, 0.4)
        );
        assert_eq!(found.record.exact(3), [Datum::Text(b"row 3".to_vec())]);
        let mut kept = Checkpoints::begin(folder, &manifest, (2, 100), Some(&found)).unwrap();
        kept.keep(&moment(9), &rows(9)).unwrap();
        drop(kept);
        let found = read(folder).unwrap();
        assert_eq!((found.checkpoint.tick, found.record.len()), (9, 9));
        assert_eq!(found.record.exact(8), [Datum::Text(b"row 8".to_vec())]);
        remove(folder);
        assert!(!is_there(folder) && !folder.join(FOLDER).exists());
    }

    #[test]
    fn a_damaged_checkpoint_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let manifest = made::manifest(&Request::built_in("mpc"), &made::wave("wave", 5));
        let mut kept = Checkpoints::begin(folder, &manifest, (1, 10), None).unwrap();
        kept.keep(&moment(3), &rows(3)).unwrap();
        drop(kept);
        let [state, path] = [STATE, ROWS].map(|name| folder.join(FOLDER).join(name));
        let (whole, bytes) = (fs::read(&state).unwrap(), fs::read(&path).unwrap());
        let told = |state_now: &[u8], rows_now: &[u8]| {
            fs::write(&state, state_now).unwrap();
            fs::write(&path, rows_now).unwrap();
            read(folder).map(|_| ()).map_err(|error| error.to_string())
        };
        assert_eq!(told(&whole, &bytes), Ok(()));
        let mut changed = whole.clone();
        *changed.last_mut().unwrap() ^= 1;
        let mut other = bytes.clone();
        other[2] ^= 1;
        for (state, rows, expected) in [
            (&b"else"[..], &bytes[..], "is not a checkpoint"),
            (&whole[..20], &bytes, "is cut off"),
            (&changed, &bytes, "its checksum differs"),
            (&whole, &other, "its content has changed"),
            (&whole, &bytes[1..], "its content has changed"),
        ] {
            let error = told(state, rows).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn another_run_does_not_begin_over_one_that_is_not_finished() {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path());
        assert!(refuse_unfinished(&out).is_ok());
        let manifest = made::manifest(&Request::built_in("mpc"), &made::wave("wave", 5));
        let mut kept = Checkpoints::begin(&out, &manifest, (1, 10), None).unwrap();
        kept.keep(&moment(3), &rows(3)).unwrap();
        drop(kept);
        let told = refuse_unfinished(&out).unwrap_err().to_string();
        assert!(
            told.contains("has not been finished; expected `shakebench run --resume"),
            "{told}"
        );
        assert!(refuse_unfinished(&out.clone().replacing(true)).is_ok());
        assert!(!is_there(&out));
    }
}
