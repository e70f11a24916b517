//! Rows as they come: a file that grows one line per run, so that nothing is lost when a study is
//! killed, and several processes share a study.

use pack::Installation;
use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::table::{Cell, Column, Row};
use laboratory::error::Error;

/// The folder of journals in that of a study.
pub const FOLDER: &str = "journal";

/// The first line of a journal: which identifies rows of one table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// Version of the program.
    pub shakebench: String,
    /// Operating system and processor: the last bits of a result are theirs.
    pub platform: String,
    /// Checksums of the project's own FMUs that are there, by name and version of FMI.
    pub components: BTreeMap<String, String>,
    /// Columns of the rows, in the order of their cells.
    pub columns: Vec<Column>,
}

/// A line of a journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Line {
    run: String,
    cells: Vec<Cell>,
}

impl Head {
    /// The head of what this program computes for a study with these columns.
    ///
    /// # Errors
    /// Components that cannot be found.
    pub fn new(columns: Vec<Column>, installation: &Installation) -> Result<Self, Error> {
        let mut components = BTreeMap::new();
        for fmu in installation.fmus()? {
            let bytes = fs::read(&fmu.path).map_err(|error| Error::File {
                path: fmu.path.clone(),
                reason: error.to_string(),
            })?;
            components.insert(
                format!("{} {}", fmu.name, fmu.version),
                fmi_import::digest(&bytes),
            );
        }
        Ok(Self::of(components, columns))
    }

    /// The head of rows that these components compute, by name and checksum.
    #[must_use]
    pub fn of(components: BTreeMap<String, String>, columns: Vec<Column>) -> Self {
        Self {
            shakebench: env!("CARGO_PKG_VERSION").to_string(),
            platform: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            components,
            columns,
        }
    }

    /// Why rows under the other head cannot be in a table with rows under this one.
    fn difference(&self, other: &Self) -> Option<String> {
        let differs = |what: &str, then: &str, now: &str| {
            (then != now).then(|| format!("{what} {then} then, {now} now"))
        };
        differs(
            "was made by shakebench",
            &other.shakebench,
            &self.shakebench,
        )
        .or_else(|| differs("was computed on", &other.platform, &self.platform))
        .or_else(|| {
            let changed = self
                .components
                .iter()
                .find(|(name, sum)| other.components.get(*name).is_some_and(|then| then != *sum));
            changed.map(|(name, _)| format!("was computed with another {name}"))
        })
    }
}

/// A journal that is added to.
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal `name` of the study in `folder`, or begins it. What was cut off in the middle of
    /// a line is dropped.
    ///
    /// # Errors
    /// A folder that cannot be written, a journal that another process adds to.
    pub fn open(folder: &Path, name: &str, head: &Head) -> Result<Self, Error> {
        let folder = folder.join(FOLDER);
        let path = folder.join(format!("{name}.jsonl"));
        let fault = |path: &Path, error: io::Error| Error::File {
            path: path.to_path_buf(),
            reason: format!("cannot be written: {error}"),
        };
        fs::create_dir_all(&folder).map_err(|error| fault(&folder, error))?;
        let mut file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(|error| fault(&path, error))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Error::File {
                path,
                reason: "another process is running this study; wait for it, or choose another \
                    folder for --out, or --shard"
                    .to_string(),
            });
        }
        let whole = whole_length(&mut file).map_err(|error| fault(&path, error))?;
        file.set_len(whole).map_err(|error| fault(&path, error))?;
        let mut journal = Self { path, file };
        let is_like = read_head(&journal.path)?.is_some_and(|old| old.columns == head.columns);
        if !is_like {
            // Another head in the middle: the rows behind it have its columns.
            journal.append(&line(head)?)?;
        }
        Ok(journal)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// A disk that is full, and the like.
    pub fn add(&mut self, row: &Row) -> Result<(), Error> {
        self.append(&row_line(row)?)
    }

    fn append(&mut self, line: &[u8]) -> Result<(), Error> {
        let written = self.file.write_all(line);
        written.map_err(|error| {
            // Whatever of it was written is no whole line.
            let _ = self.file.flush();
            Error::File {
                path: self.path.clone(),
                reason: format!("cannot be written: {error}; the results so far are kept"),
            }
        })
    }
}

/// The line of a row.
///
/// # Errors
/// None that is known.
pub(super) fn row_line(row: &Row) -> Result<Vec<u8>, Error> {
    line(&Line {
        run: row.run.clone(),
        cells: row.cells.clone(),
    })
}

/// A value as a line of JSON.
///
/// # Errors
/// A value that is none.
pub(super) fn line(value: &impl Serialize) -> Result<Vec<u8>, Error> {
    let mut bytes = serde_json::to_vec(value).map_err(|error| Error::File {
        path: PathBuf::from(FOLDER),
        reason: error.to_string(),
    })?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Bytes up to the end of the last whole line.
fn whole_length(file: &mut File) -> io::Result<u64> {
    const BLOCK: u64 = 1 << 16;
    let mut end = file.seek(SeekFrom::End(0))?;
    while end > 0 {
        let begin = end.saturating_sub(BLOCK);
        let mut bytes = vec![0; (end - begin) as usize];
        file.seek(SeekFrom::Start(begin))?;
        file.read_exact(&mut bytes)?;
        if let Some(last) = bytes.iter().rposition(|&byte| byte == b'\n') {
            return Ok(begin + last as u64 + 1);
        }
        end = begin;
    }
    Ok(0)
}

/// The last head in a journal.
fn read_head(path: &Path) -> Result<Option<Head>, Error> {
    let mut last = None;
    each_line(path, &mut |entry| {
        if let Entry::Head(head) = entry {
            last = Some(head);
        }
        Ok(())
    })?;
    Ok(last)
}

enum Entry {
    Head(Head),
    Row(Line),
}

/// Calls `take` with each whole line of a journal.
fn each_line(path: &Path, take: &mut dyn FnMut(Entry) -> Result<(), String>) -> Result<(), Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let file = File::open(path).map_err(|error| fault(error.to_string()))?;
    let mut lines = BufReader::new(file);
    let mut line = Vec::new();
    for number in 1.. {
        line.clear();
        let read = lines.read_until(b'\n', &mut line);
        read.map_err(|error| fault(error.to_string()))?;
        if line.last() != Some(&b'\n') {
            // The end, or cut off in the middle.
            break;
        }
        let damaged = || {
            fault(format!(
                "line {number} is not a journal entry; delete the file to compute its runs again"
            ))
        };
        let entry = if line.starts_with(b"{\"run\"") {
            serde_json::from_slice(&line).map(Entry::Row)
        } else {
            serde_json::from_slice(&line).map(Entry::Head)
        };
        take(entry.map_err(|_| damaged())?)
            .map_err(|reason| fault(format!("line {number}: {reason}")))?;
    }
    Ok(())
}

/// The rows of all journals in the folder of a study, by the runs' names, with cells in the order of
/// `head`'s columns; rows of other studies are passed over.
///
/// # Errors
/// A journal that is damaged, or was made by another version.
pub fn read(folder: &Path, head: &Head) -> Result<HashMap<String, Vec<Cell>>, Error> {
    let folder = folder.join(FOLDER);
    let mut rows = HashMap::new();
    let Ok(entries) = fs::read_dir(&folder) else {
        return Ok(rows);
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "jsonl"));
    files.sort();
    for path in files {
        let mut places: Option<Vec<usize>> = None;
        let mut width = 0;
        each_line(&path, &mut |entry| match entry {
            Entry::Head(own) => {
                if let Some(difference) = head.difference(&own) {
                    return Err(format!(
                        "{difference}; its rows cannot be added to the same table: choose another \
                         folder for --out, or --force to compute all runs again"
                    ));
                }
                width = own.columns.len() - IDENTITY;
                // A study that was extended may have other columns.
                let found = head.columns[IDENTITY..].iter().map(|column| {
                    let mut columns = own.columns[IDENTITY..].iter();
                    columns.position(|known| known == column)
                });
                places = found.collect();
                Ok(())
            }
            Entry::Row(Line { run, cells }) => {
                if cells.len() != width {
                    return Err("a row with missing cells".to_string());
                }
                if let Some(places) = &places {
                    let cells = places.iter().map(|&place| cells[place].clone());
                    rows.insert(run, cells.collect());
                }
                Ok(())
            }
        })?;
    }
    Ok(rows)
}

/// Columns before the cells of a row: number and name.
pub(crate) const IDENTITY: usize = 2;

/// Takes the journals of a folder away.
pub fn remove(folder: &Path) {
    let _ = fs::remove_dir_all(folder.join(FOLDER));
}

/// Whether there is a journal in the folder.
#[must_use]
pub fn is_there(folder: &Path) -> bool {
    folder.join(FOLDER).is_dir()
}
