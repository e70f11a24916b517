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

#[cfg(test)]
mod tests {
    use super::super::table::{Kind, Role};
    use super::*;

    fn column(name: &str, role: Role) -> Column {
        Column {
            name: name.to_string(),
            unit: None,
            role,
            kind: Kind::Number,
        }
    }

    fn head(results: &[&str]) -> Head {
        let mut columns = vec![column("number", Role::Run), column("run", Role::Run)];
        columns.extend(results.iter().map(|name| column(name, Role::Result)));
        let components = [("ShakeTable 3.0".to_string(), "ab".to_string())];
        Head::of(components.into(), columns)
    }

    fn row(run: &str, cells: &[f64]) -> Row {
        Row {
            run: run.into(),
            cells: cells.iter().map(|cell| Cell::from(*cell)).collect(),
        }
    }

    fn path(folder: &Path) -> PathBuf {
        folder.join(FOLDER).join("all.jsonl")
    }

    #[test]
    fn rows_are_read_as_they_were_added_in_the_columns_that_are_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert!(!is_there(folder) && read(folder, &head(&["a"])).unwrap().is_empty());
        let mut journal = Journal::open(folder, "all", &head(&["a", "b"])).unwrap();
        journal.add(&row("x", &[1.0, 2.0])).unwrap();
        journal.add(&row("y", &[3.0, f64::NAN])).unwrap();
        // One process at a time adds to it.
        let error = Journal::open(folder, "all", &head(&["a"])).err().unwrap();
        assert!(error.to_string().contains("another process"), "{error}");
        drop(journal);
        let rows = read(folder, &head(&["b", "a"])).unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows["x"], [Cell::Number(2.0), Cell::Number(1.0)]);
        assert_eq!(rows["y"], [Cell::Missing, Cell::Number(3.0)]);
        // A column that they lack is that of another study.
        assert!(read(folder, &head(&["a", "c"])).unwrap().is_empty());
        // Other files in the folder are passed over.
        fs::write(folder.join(FOLDER).join("notes.txt"), "no journal").unwrap();
        assert_eq!(
            read(folder, &head(&["a"])).unwrap()["x"],
            [Cell::Number(1.0)]
        );
        assert!(is_there(folder));
        remove(folder);
        assert!(!is_there(folder));
    }

    #[test]
    fn a_line_that_was_cut_off_is_dropped_and_the_head_is_written_once() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let add = |own: &Head, run: &str, cells: &[f64]| {
            let mut journal = Journal::open(folder, "all", own).unwrap();
            journal.add(&row(run, cells)).unwrap();
        };
        let one = head(&["a"]);
        add(&one, "x", &[1.0]);
        let whole = fs::read(path(folder)).unwrap();
        let cut = [&whole[..], b"{\"run\":\"y\",\"cel"].concat();
        fs::write(path(folder), cut).unwrap();
        assert_eq!(read(folder, &one).unwrap().len(), 1);
        add(&one, "y", &[2.0]);
        let text = fs::read_to_string(path(folder)).unwrap();
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(text.starts_with(std::str::from_utf8(&whole).unwrap()));
        // Rows behind another head have its columns.
        add(&head(&["b", "a"]), "z", &[4.0, 3.0]);
        let rows = read(folder, &one).unwrap();
        assert_eq!(
            ["x", "y", "z"].map(|run| rows[run].clone()),
            [1.0, 2.0, 3.0].map(|own| vec![Cell::Number(own)])
        );
    }

    #[test]
    fn the_last_whole_line_is_found_in_blocks_from_the_end() {
        let length = |bytes: &[u8]| {
            let mut file = tempfile::tempfile().unwrap();
            file.write_all(bytes).unwrap();
            whole_length(&mut file).unwrap()
        };
        assert_eq!(length(b""), 0);
        assert_eq!(length(b"no end"), 0);
        assert_eq!(length(b"a\nbc"), 2);
        let long = [b"ab\n".to_vec(), vec![b'x'; 200_000]].concat();
        assert_eq!(length(&long), 3);
        let ended = [long, b"\n".to_vec()].concat();
        assert_eq!(length(&ended), ended.len() as u64);
    }

    #[test]
    fn a_damaged_line_is_named_and_rows_of_other_programs_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let own = head(&["a"]);
        let mut journal = Journal::open(folder, "all", &own).unwrap();
        journal.add(&row("x", &[1.0])).unwrap();
        drop(journal);
        let whole = fs::read_to_string(path(folder)).unwrap();
        let told = |text: String| {
            fs::write(path(folder), text).unwrap();
            read(folder, &own).unwrap_err().to_string()
        };
        let damaged = told(format!("{whole}nonsense\n"));
        assert!(
            damaged.contains("all.jsonl") && damaged.contains("line 3 is not a journal entry"),
            "{damaged}"
        );
        let missing = told(format!("{whole}{{\"run\":\"y\",\"cells\":[]}}\n"));
        assert!(
            missing.contains("line 3: a row with missing cells"),
            "{missing}"
        );
        let version = told(whole.replace(env!("CARGO_PKG_VERSION"), "0.0.1"));
        let expected = format!(
            "line 1: was made by shakebench 0.0.1 then, {} now",
            env!("CARGO_PKG_VERSION")
        );
        assert!(version.contains(&expected), "{version}");
        let platform = told(whole.replace(&own.platform, "abacus-sand"));
        assert!(
            platform.contains("was computed on abacus-sand then"),
            "{platform}"
        );
        let component = told(whole.replace("\"ab\"", "\"cd\""));
        assert!(
            component.contains("was computed with another ShakeTable 3.0"),
            "{component}"
        );
        // A component that only one of them has makes no difference.
        fs::write(
            path(folder),
            whole.replace("ShakeTable 3.0", "Specimen 3.0"),
        )
        .unwrap();
        assert_eq!(read(folder, &own).unwrap().len(), 1);
    }
}
