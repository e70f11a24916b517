//! The files of a command, written as a whole or not at all.

pub mod parquet_file;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::ops::Deref;
use std::path::{Path, PathBuf};

use pages::report::{self, Panel, Report, UnitSystem};
use serde::Serialize;

use crate::error::Error;

/// A folder or file that results go to, and the units of its pages. What is there already stays if it differs, unless
/// [`Out::replacing`] says otherwise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Out {
    path: PathBuf,
    replaces: bool,
    units: Option<UnitSystem>,
}

impl Out {
    /// The folder or file at `path`, of which nothing is lost.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            replaces: false,
            units: None,
        }
    }

    /// The same, with files that differ replaced if `replaces` (`--force`).
    #[must_use]
    pub fn replacing(self, replaces: bool) -> Self {
        Self { replaces, ..self }
    }

    /// Whether files that differ are replaced.
    #[must_use]
    pub fn replaces(&self) -> bool {
        self.replaces
    }

    /// The same, with pages and pictures in these units; none: a page has buttons to switch.
    #[must_use]
    pub fn in_units(self, units: Option<UnitSystem>) -> Self {
        Self { units, ..self }
    }

    /// Units of sentences and pictures.
    #[must_use]
    pub fn units(&self) -> UnitSystem {
        self.units.unwrap_or_default()
    }

    /// Another place, where the same holds.
    #[must_use]
    pub fn at(&self, path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            ..self.clone()
        }
    }

    /// The folder of this file.
    #[must_use]
    pub fn folder(&self) -> Self {
        let parent = self.path.parent();
        let parent = parent.filter(|parent| !parent.as_os_str().is_empty());
        self.at(parent.unwrap_or(Path::new(".")))
    }
}

impl Deref for Out {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

impl AsRef<Path> for Out {
    fn as_ref(&self) -> &Path {
        &self.path
    }
}

/// A folder for results without a given name: the first of `folder`, `folder-2`, `folder-3` and so
/// on that does not exist yet or, by `is_same`, holds the results of the same command.
pub fn unused(folder: &Out, is_same: impl Fn(&Path) -> bool) -> Out {
    let is_free = |place: &Path| folder.replaces || !place.exists() || is_same(place);
    if is_free(folder) {
        return folder.clone();
    }
    let numbered = (2..).map(|number| {
        let mut name = folder.as_os_str().to_os_string();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    });
    let mut free = numbered.filter(|place| is_free(place));
    // The numbers do not end.
    free.next()
        .map_or_else(|| folder.clone(), |place| folder.at(&place))
}

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
    /// The disk is full, or a limit of the size of files is reached.
    #[error(
        "{}: cannot be written: {source}; {}. Free some space, or choose another --out",
        file.display(),
        kept(saved, file)
    )]
    Full {
        /// The file.
        file: PathBuf,
        /// The operating system's word.
        source: io::Error,
        /// Files that are complete, or hold the first part of `file`.
        saved: Vec<PathBuf>,
    },
    /// There is a file of that name with other content.
    #[error(
        "{}: already exists with different content; choose a new name or folder for --out, or \
         --force",
        file.display()
    )]
    Exists {
        /// The file.
        file: PathBuf,
    },
}

impl ResultsError {
    /// Whether the input is not at fault: what was computed had no place.
    pub fn is_for_lack_of_space(&self) -> bool {
        matches!(self, Self::Full { .. })
    }
}

/// What there is of results that had no place, as a clause.
fn kept(saved: &[PathBuf], file: &Path) -> String {
    let complete: Vec<String> = saved
        .iter()
        .filter(|path| path.extension().is_none_or(|e| e != PART))
        .map(|path| format!("`{}`", path.display()))
        .collect();
    let part = saved
        .iter()
        .find(|path| path.extension().is_some_and(|e| e == PART));
    let complete = match &complete[..] {
        [] => "no file is complete".to_string(),
        files => format!(
            "{} complete: {}",
            if files.len() == 1 {
                "one file is"
            } else {
                "these files are"
            },
            files.join(", ")
        ),
    };
    let rows = match part {
        Some(part) => format!(
            "; `{}` holds the first lines of `{}`",
            part.display(),
            file.file_name().unwrap_or_default().to_string_lossy()
        ),
        None => String::new(),
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let resumed = match crate::run::checkpoint::is_there(folder) {
        true => format!(
            "; `shakebench run --resume {}` continues from the last checkpoint",
            folder.display()
        ),
        false => String::new(),
    };
    format!("{complete}{rows}{resumed}")
}

/// The extension of a file of which only the first part is there.
const PART: &str = "part";

/// Whether an error says that there is no more room.
fn is_full(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    let wrapped = error.get_ref().and_then(|error| error.downcast_ref());
    let kind = match wrapped.map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(inner)) => inner.kind(),
        _ => error.kind(),
    };
    matches!(kind, StorageFull | QuotaExceeded | FileTooLarge)
}

/// Writes the page of a report alone into `folder`; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write_report(report: &Report, folder: &Out) -> Result<PathBuf, Error> {
    let mut results = Results::begin(folder)?;
    results.write_page(report::FILE, report)?;
    results.finish()?;
    Ok(folder.join(report::FILE))
}

/// Files that tell how long something took, draw what others hold or pack it: they may differ from one
/// time to the next without saying anything else.
const VOLATILE: [&str; 4] = ["html", "json", "svg", "fmu"];

/// Files on their way into a folder: they appear there together, when all of them are complete.
pub struct Results {
    folder: Out,
    staging: tempfile::TempDir,
    names: Vec<String>,
    /// Files of an earlier run that do not stay.
    replaced: Vec<String>,
    /// Whether files that differ are replaced: what they were made of is kept elsewhere.
    supersedes: bool,
}

impl Results {
    /// Makes a place for the files of `folder`, which need not exist yet.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn begin(folder: &Out) -> Result<Self, ResultsError> {
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
            folder: folder.clone(),
            staging,
            names: Vec::new(),
            replaced: Vec::new(),
            supersedes: false,
        })
    }

    /// Whether `folder` could be written, without leaving anything there.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn check(folder: &Path) -> Result<(), ResultsError> {
        Self::begin(&Out::new(folder)).map(drop)
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
        if let Err(source) = written() {
            let file = self.folder.join(name);
            return Err(match is_full(&source) {
                true => {
                    let saved = self.rescue(name);
                    ResultsError::Full {
                        file,
                        source,
                        saved,
                    }
                }
                false => ResultsError::File { file, source },
            });
        }
        self.names.push(name.to_string());
        Ok(())
    }

    /// Moves the files that are complete into their folder, and the whole lines that there are of the
    /// file `name`, for which there was no room; gives those that arrived.
    fn rescue(&mut self, name: &str) -> Vec<PathBuf> {
        let place = self.staging.path().join(name);
        let part = format!("{name}.{PART}");
        if let Ok(text) = fs::read(&place)
            && let Some(end) = text.iter().rposition(|byte| *byte == b'\n')
            && let Ok(file) = File::options().write(true).open(&place)
            && file.set_len(end as u64 + 1).is_ok()
            && fs::rename(&place, self.staging.path().join(&part)).is_ok()
        {
            self.names.push(part);
        } else {
            // What is of no use gives room to the rest.
            let _ = fs::remove_file(&place);
        }
        let mut saved = Vec::new();
        if fs::create_dir_all(&self.folder).is_err() {
            return saved;
        }
        for name in std::mem::take(&mut self.names) {
            let to = self.folder.join(&name);
            let is_new = self.folder.replaces || self.supersedes || !to.exists();
            if is_new && fs::rename(self.staging.path().join(&name), &to).is_ok() {
                saved.push(to);
            }
        }
        saved
    }

    /// Writes a text.
    ///
    /// # Errors
    /// As [`Results::write`].
    pub fn write_text(&mut self, name: &str, text: &str) -> Result<(), ResultsError> {
        self.write(name, |file| file.write_all(text.as_bytes()))
    }

    /// Writes the page of a report.
    ///
    /// # Errors
    /// As [`Results::write`]; a fault of the template.
    pub fn write_page(&mut self, name: &str, report: &Report) -> Result<(), Error> {
        let page = report::render(report, self.folder.units, &self.folder.join(name))?;
        Ok(self.write_text(name, &page)?)
    }

    /// Writes a plot as SVG.
    ///
    /// # Errors
    /// As [`Results::write`].
    pub fn write_picture(&mut self, name: &str, panel: &Panel) -> Result<(), ResultsError> {
        self.write_text(name, &report::svg(panel, self.folder.units()))
    }

    /// Writes a value as JSON for people, one line per field.
    ///
    /// # Errors
    /// As [`Results::write`].
    pub fn write_json(&mut self, name: &str, value: &impl Serialize) -> Result<(), ResultsError> {
        self.write(name, |file| {
            serde_json::to_writer_pretty(&mut *file, value)?;
            file.write_all(b"\n")
        })
    }

    /// Folder of the files until [`Results::finish`]; [`Results::adopt`] registers a file that is
    /// made there.
    #[must_use]
    pub fn staging(&self) -> &Path {
        self.staging.path()
    }

    /// Takes the file `name` that was made in [`Results::staging`] along.
    pub fn adopt(&mut self, name: &str) {
        self.names.push(name.to_string());
    }

    /// Files of these names are taken away where this result has none of them, so that they are not
    /// mistaken for its own.
    pub fn replaces(&mut self, names: &[&str]) {
        self.replaced
            .extend(names.iter().map(|name| name.to_string()));
    }

    /// These files replace those of the same names: what the others were made of is kept elsewhere.
    pub fn supersede(&mut self) {
        self.supersedes = true;
    }

    /// Whether a file of data that has been written so far would change one that is there; pages, pictures
    /// and summaries follow the data. To be asked before what takes long.
    ///
    /// # Errors
    /// Such a file, unless [`Out::replaces`].
    pub fn check_existing(&self) -> Result<(), ResultsError> {
        if self.supersedes || self.folder.replaces {
            return Ok(());
        }
        let is_volatile = |name: &&String| {
            let extension = Path::new(name.as_str()).extension();
            VOLATILE
                .iter()
                .any(|own| extension.is_some_and(|e| e == *own))
        };
        let data = self.names.iter().filter(|name| !is_volatile(name));
        for name in data {
            let file = self.folder.join(name);
            let Ok(before) = fs::read(&file) else {
                continue;
            };
            let now = fs::read(self.staging.path().join(name));
            if now.is_ok_and(|now| now != before) {
                return Err(ResultsError::Exists { file });
            }
        }
        Ok(())
    }

    /// Moves the files into their folder; others stay. Of two that do so at once, one waits for the
    /// other.
    ///
    /// # Errors
    /// A folder that cannot be made; a file of data that is there and would change, unless
    /// [`Out::replaces`].
    pub fn finish(self) -> Result<Vec<PathBuf>, ResultsError> {
        self.check_existing()?;
        fs::create_dir_all(&self.folder).map_err(|source| ResultsError::Folder {
            folder: self.folder.to_path_buf(),
            source,
        })?;
        // Where folders cannot be locked, nothing waits.
        let lock = File::open(&self.folder);
        let _held = lock.as_ref().map(File::lock);
        for name in self
            .replaced
            .iter()
            .filter(|name| !self.names.contains(name))
        {
            // Mostly there is none.
            let _ = fs::remove_file(self.folder.join(name));
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_had_room_before_the_disk_was_full_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        fs::create_dir_all(out.join("checkpoint")).unwrap();
        fs::write(out.join("checkpoint/state"), "").unwrap();
        let mut results = Results::begin(&Out::new(&out)).unwrap();
        results.write_text("first.csv", "time\n0\n").unwrap();
        let error = results
            .write("second.csv", |file| {
                file.write_all(b"time\n0\n1\n2.34")?;
                Err(io::ErrorKind::StorageFull.into())
            })
            .unwrap_err();
        assert!(error.is_for_lack_of_space());
        let said = error.to_string();
        for word in [
            "second.csv",
            "first.csv",
            "second.csv.part",
            "run --resume",
            "Free some space",
        ] {
            assert!(said.contains(word), "`{word}` is not in {said}");
        }
        drop(results);
        let read = |name| fs::read_to_string(out.join(name)).unwrap();
        assert_eq!(read("first.csv"), "time\n0\n");
        assert_eq!(read("second.csv.part"), "time\n0\n1\n");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// Writes `table.csv` and `page.html` with this content.
    fn written(out: &Out, content: &str) -> Result<Vec<PathBuf>, ResultsError> {
        let mut results = Results::begin(out)?;
        results.write_text("table.csv", content)?;
        results.write_text("page.html", content)?;
        results.finish()
    }

    #[test]
    fn data_that_differ_stay_where_they_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("out"));
        let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
        written(&out, "1\n").unwrap();
        // The same again is no loss.
        written(&out, "1\n").unwrap();
        let error = written(&out, "2\n").unwrap_err();
        assert!(matches!(error, ResultsError::Exists { file } if file == out.join("table.csv")));
        assert_eq!(
            (read("table.csv"), read("page.html")),
            ("1\n".into(), "1\n".into())
        );
        written(&out.clone().replacing(true), "2\n").unwrap();
        assert_eq!(
            (read("table.csv"), read("page.html")),
            ("2\n".into(), "2\n".into())
        );
        // Nothing is left of what was on its way.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_taken_gets_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let out = Out::new(folder.path().join("run"));
        let never = |_: &Path| false;
        assert_eq!(unused(&out, never), out);
        for name in ["run", "run-2"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        assert_eq!(*unused(&out, never), *folder.path().join("run-3"));
        let is_second = |place: &Path| place.ends_with("run-2");
        assert_eq!(*unused(&out, is_second), *folder.path().join("run-2"));
        let forced = out.clone().replacing(true);
        assert_eq!(unused(&forced, never), forced);
    }

    #[test]
    fn a_file_belongs_to_its_folder() {
        let out = Out::new("models/rig.toml").replacing(true);
        assert_eq!(
            (&*out.folder(), out.folder().replaces()),
            (Path::new("models"), true)
        );
        assert_eq!(&*Out::new("rig.toml").folder(), Path::new("."));
        let metric = out.in_units(Some(UnitSystem::Si)).folder();
        assert_eq!((metric.units(), metric.replaces()), (UnitSystem::Si, true));
    }

    #[test]
    fn an_unused_folder_has_the_first_free_number() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        let out = Out::new(place("run"));
        let never = |_: &Path| false;
        assert_eq!(&*unused(&out, never), place("run"));
        for name in ["run", "run-2", "run-4"] {
            fs::create_dir(place(name)).unwrap();
        }
        assert_eq!(&*unused(&out, never), place("run-3"));
        // One that holds the results of the same command is used again.
        assert_eq!(&*unused(&out, |own| own.ends_with("run-2")), place("run-2"));
        assert_eq!(&*unused(&out.clone().replacing(true), never), place("run"));
        assert_eq!(&*Out::new("model.toml").folder(), Path::new("."));
        assert_eq!(&*Out::new("a/model.toml").folder(), Path::new("a"));
    }

    #[test]
    fn what_was_kept_of_results_without_room_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("results.csv");
        let saved = |names: &[&str]| -> Vec<PathBuf> { names.iter().map(PathBuf::from).collect() };
        assert_eq!(kept(&[], &file), "no file is complete");
        assert_eq!(
            kept(&saved(&["a.csv"]), &file),
            "one file is complete: `a.csv`"
        );
        assert_eq!(
            kept(&saved(&["a.csv", "b", "results.csv.part"]), &file),
            "these files are complete: `a.csv`, `b`; `results.csv.part` holds the first lines of `results.csv`"
        );
        let full = |kind: io::ErrorKind| is_full(&io::Error::from(kind));
        assert!(full(io::ErrorKind::StorageFull) && full(io::ErrorKind::QuotaExceeded));
        assert!(!full(io::ErrorKind::NotFound));
        let wrapped = csv::Error::from(io::Error::from(io::ErrorKind::StorageFull));
        assert!(is_full(&io::Error::other(wrapped)));
    }

    #[test]
    fn files_of_an_earlier_run_do_not_stay_and_data_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        let out = Out::new(folder.path());
        fs::write(place("old.html"), "").unwrap();
        fs::write(place("data.csv"), "1").unwrap();
        let begin = |text: &str, out: &Out| {
            let mut results = Results::begin(out).unwrap();
            results.write_text("data.csv", text).unwrap();
            results.write_text("page.html", text).unwrap();
            results.replaces(&["old.html", "page.html"]);
            results
        };
        let told = begin("2", &out).finish().unwrap_err().to_string();
        assert!(
            told.contains("data.csv: already exists with different content"),
            "{told}"
        );
        assert!(place("old.html").exists());
        begin("1", &out).finish().unwrap();
        assert!(!place("old.html").exists() && place("page.html").exists());
        let mut other = begin("2", &out);
        other.supersede();
        other.finish().unwrap();
        assert_eq!(fs::read_to_string(place("data.csv")).unwrap(), "2");
        begin("3", &out.clone().replacing(true)).finish().unwrap();
        assert_eq!(fs::read_to_string(place("data.csv")).unwrap(), "3");
    }
}
