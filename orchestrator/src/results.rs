//! The files of a run, written as a whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::Error;
use crate::fmu::Datum;
use crate::master::Record;

/// Why results cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// The folder cannot be made or written.
    #[error("{}: results cannot be written here: {source}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The operating system's word.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The operating system's word.
        source: io::Error,
    },
}

/// Files on their way into a folder: they appear there together, when all of them are complete.
pub struct Results {
    folder: PathBuf,
    staging: tempfile::TempDir,
    names: Vec<String>,
}

impl Results {
    /// Makes a place for the files of `folder`, which need not exist yet.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn begin(folder: &Path) -> Result<Self, ResultsError> {
        let failed = |source| ResultsError::Folder {
            folder: folder.to_path_buf(),
            source,
        };
        if folder.exists() && !folder.is_dir() {
            return Err(failed(io::Error::other("it is a file, not a folder")));
        }
        let absolute = std::path::absolute(folder).map_err(failed)?;
        // On the same file system, so that files can be moved.
        let place = absolute.ancestors().find(|place| place.is_dir());
        let staging = tempfile::Builder::new()
            .prefix(".shakebench-")
            .tempdir_in(place.unwrap_or(Path::new(".")))
            // Without the name of the temporary folder.
            .map_err(|error| failed(error.kind().into()))?;
        Ok(Self {
            folder: folder.to_path_buf(),
            staging,
            names: Vec::new(),
        })
    }

    /// Whether `folder` could be written, without leaving anything there.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn check(folder: &Path) -> Result<(), ResultsError> {
        Self::begin(folder).map(drop)
    }

    /// Writes a file; `name` may have folders in it.
    ///
    /// # Errors
    /// A disk that is full, and the like.
    pub fn write(
        &mut self,
        name: &str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), ResultsError> {
        let written = || {
            let place = self.staging.path().join(name);
            fs::create_dir_all(place.parent().unwrap_or(&place))?;
            let mut file = BufWriter::new(File::create(place)?);
            content(&mut file)?;
            file.flush()
        };
        written().map_err(|source| ResultsError::File {
            file: self.folder.join(name),
            source,
        })?;
        self.names.push(name.to_string());
        Ok(())
    }

    /// Writes a text.
    ///
    /// # Errors
    /// As [`Results::write`].
    pub fn write_text(&mut self, name: &str, text: &str) -> Result<(), ResultsError> {
        self.write(name, |file| file.write_all(text.as_bytes()))
    }

    /// Where files lie until [`Results::finish`]; one that is made there is told by
    /// [`Results::adopt`].
    #[must_use]
    pub fn staging(&self) -> &Path {
        self.staging.path()
    }

    /// Takes the file `name` that was made in [`Results::staging`] along.
    pub fn adopt(&mut self, name: &str) {
        self.names.push(name.to_string());
    }

    /// Moves the files into their folder; files of the same name are replaced, others stay.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn finish(self) -> Result<Vec<PathBuf>, ResultsError> {
        fs::create_dir_all(&self.folder).map_err(|source| ResultsError::Folder {
            folder: self.folder.clone(),
            source,
        })?;
        let mut files = Vec::new();
        for name in &self.names {
            let file = self.folder.join(name);
            let below = file.parent().unwrap_or(&self.folder);
            fs::create_dir_all(below).map_err(|source| ResultsError::Folder {
                folder: below.to_path_buf(),
                source,
            })?;
            fs::rename(self.staging.path().join(name), &file).map_err(|source| {
                ResultsError::File {
                    file: file.clone(),
                    source,
                }
            })?;
            files.push(file);
        }
        Ok(files)
    }
}

/// Writes a record as CSV: a line of names, then a line a sample; every number reads back to the
/// same bits.
///
/// # Errors
/// A disk that is full, and the like.
pub fn write_csv(record: &Record, file: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(file);
    if record.exact_columns.is_empty() {
        csv.write_record(&record.columns)?;
        for row in record.rows() {
            csv.serialize(row).map_err(io::Error::other)?;
        }
        return csv.flush();
    }
    csv.write_record(record.columns.iter().chain(&record.exact_columns))?;
    for (number, row) in record.rows().enumerate() {
        let exact: Vec<String> = record.exact(number).iter().map(Datum::to_string).collect();
        csv.serialize((row, exact)).map_err(io::Error::other)?;
    }
    csv.flush()
}

/// Reads a record that [`write_csv`] wrote.
///
/// # Errors
/// A file that cannot be read or holds anything but a line of names, `time` first, and numbers, with
/// the line.
pub fn read_csv(path: &Path) -> Result<Record, Error> {
    let fault = |reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let file = File::open(path).map_err(|error| fault(error.to_string()))?;
    let mut csv = csv::Reader::from_reader(file);
    let names = csv.headers().map_err(|error| fault(error.to_string()))?;
    let names: Vec<String> = names.iter().map(String::from).collect();
    let Some(("time", names)) = names
        .split_first()
        .map(|(time, rest)| (time.as_str(), rest))
    else {
        return Err(fault("the first column is not `time`".into()));
    };
    let mut record = Record::with_capacity(names, 0);
    for (row, line) in csv.records().zip(2..) {
        let row = row.map_err(|error| fault(error.to_string()))?;
        let number = |cell: &str| {
            let wrong = |_| fault(format!("line {line}: `{cell}` is no number"));
            cell.trim().parse::<f64>().map_err(wrong)
        };
        let values: Vec<f64> = row.iter().map(number).collect::<Result<_, _>>()?;
        // Every row is as long as the line of names, the reader sees to it.
        if let Some((time, signals)) = values.split_first() {
            record.push(*time, signals, &[]);
        }
    }
    Ok(record)
}
