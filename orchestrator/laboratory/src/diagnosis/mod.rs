//! Diagnosis of a case or of a rig: from files to a report with its pictures, the extended model and,
//! of a shake table, its FMUs.

mod case;
pub mod co_simulation;
pub mod foreign;
pub mod model;
mod page;
mod pictures;
mod rig;
pub mod text;

use std::path::{Path, PathBuf};
use std::time::Instant;

use identification::diagnosis::case::{CaseError, template as case_template};
use identification::diagnosis::engine::Observer;
use identification::diagnosis::rigs::foreign::KIND;
use identification::diagnosis::rigs::guess::{Guess, guess};
use identification::diagnosis::rigs::{
    DescriptionError, KINDS, Rig, like, template as rig_template,
};
use identification::diagnosis::{
    self as library, Diagnosis, DiagnosisError, DiagnosisReport, Evidence, Subject,
};

use crate::error::Error;
use crate::json;
use crate::results::{Out, Results};
use pack::Installation;
use pages::report::{self, Report, UnitSystem};

/// File with the extended model, in the folder of `--out`.
pub const EXTENDED_MODEL: &str = "extended_model.toml";
/// File with the motion that would tell rivals apart, in the folder of `--out`.
pub const SEPARATING_MOTION: &str = "separating_motion.csv";
/// File with the description that was guessed, in the folder of `--out`.
pub const DESCRIPTION: &str = "description.toml";
/// File with the JSON object, in the folder of `--out`.
pub const DIAGNOSIS: &str = "diagnosis.json";

/// Diagnoses the case in folder `subject`, or the rig that the description `subject` (`.toml`)
/// tells of, on `data` in place of its own files if there are any. Writes the extended model, its
/// FMUs, the JSON object, the report and, of a rig, curves and pictures into `folder`, all or
/// nothing. The file `columns` may name the columns otherwise. `observer` receives each attempt.
///
/// # Errors
/// What cannot be read, records that would mislead, a folder that cannot be written.
pub fn diagnose(
    subject: &Path,
    data: &[PathBuf],
    columns: Option<&Path>,
    folder: &Out,
    observer: Observer<'_>,
) -> Result<DiagnosisReport, Error> {
    let installation = &Installation::default();
    diagnose_with(subject, data, columns, None, folder, installation, observer)
}

/// As [`diagnose`], with the effects of the file `effects` beside those of the kind and the components of an
/// `installation`.
///
/// # Errors
/// As [`diagnose`]; effects that do not fit the kind, by line.
pub fn diagnose_with(
    subject: &Path,
    data: &[PathBuf],
    columns: Option<&Path>,
    effects: Option<&Path>,
    folder: &Out,
    installation: &Installation,
    observer: Observer<'_>,
) -> Result<DiagnosisReport, Error> {
    let begun = Instant::now();
    Results::check(folder)?;
    let read = Subject::read(subject, data, columns).map_err(|error| fault(subject, error))?;
    let read = with_effects(read, effects, subject)?;
    of_subject(subject, &read, None, folder, installation, observer, begun)
}

fn with_effects(subject: Subject, effects: Option<&Path>, path: &Path) -> Result<Subject, Error> {
    match effects {
        Some(effects) => subject
            .with_effects(effects)
            .map_err(|error| fault(path, error)),
        None => Ok(subject),
    }
}

/// As [`diagnose_with`], of `files` without a description: what is guessed of them is handed to `tell` and written as
/// [`DESCRIPTION`].
///
/// # Errors
/// As [`diagnose`]; columns that belong to no kind, with a question.
pub fn diagnose_files(
    files: &[PathBuf],
    columns: Option<&Path>,
    effects: Option<&Path>,
    folder: &Out,
    tell: &dyn Fn(&Guess),
    observer: Observer<'_>,
) -> Result<DiagnosisReport, Error> {
    let begun = Instant::now();
    Results::check(folder)?;
    let first = files.first().map_or(Path::new(""), PathBuf::as_path);
    let guess = guess(files, columns).map_err(|error| fault(first, error.into()))?;
    tell(&guess);
    let subject = Subject::Rig(Box::new((guess.description, guess.measurement)));
    let subject = with_effects(subject, effects, first)?;
    let (text, own) = (Some(&*guess.text), Installation::default());
    of_subject(first, &subject, text, folder, &own, observer, begun)
}

fn of_subject(
    subject: &Path,
    read: &Subject,
    description: Option<&str>,
    folder: &Out,
    installation: &Installation,
    observer: Observer<'_>,
    begun: Instant,
) -> Result<DiagnosisReport, Error> {
    let found = library::diagnose(read, observer).map_err(|error| fault(subject, error))?;
    let mut report = found.report();
    if observer.has_cut() {
        report.time_limit_reached = true;
        report.notes.push(
            "the search reached its time limit; candidates beyond those listed were not tried \
             (--time-limit)"
                .into(),
        );
    }
    report.extended_model = Some(folder.join(EXTENDED_MODEL));
    let mut results = Results::begin(folder)?;
    if let Some(text) = description {
        results.write_text(DESCRIPTION, text)?;
    }
    let page = match &found {
        Diagnosis::Case { case, found } => {
            let extended = case::extend(
                case,
                found,
                &mut report,
                &mut results,
                (folder, installation),
            )?;
            report.wall_s = begun.elapsed().as_secs_f64();
            page::of_case(subject, &report, case, found, &extended, folder.units())
        }
        Diagnosis::Rig {
            description,
            measurement,
            found,
        } => {
            let curves = rig::extend(description, measurement, found, &mut results, folder)?;
            report.wall_s = begun.elapsed().as_secs_f64();
            page::of_rig(&found.name, subject, &report, &curves, folder.units())
        }
    };
    results.write_page(report::FILE, &page)?;
    results.write_text(DIAGNOSIS, &format!("{:#}\n", serde_json::json!(report)))?;
    results.finish()?;
    Ok(report)
}

/// The files of `report`, which lie in `folder`, for people.
pub fn files(report: &DiagnosisReport, folder: &Path) -> Vec<PathBuf> {
    let mut files = [report::FILE, DIAGNOSIS, EXTENDED_MODEL]
        .map(|name| folder.join(name))
        .to_vec();
    if let Evidence::Rig(evidence) = &report.evidence {
        let own = match evidence.rig.kind.as_str() {
            KIND => &foreign::FILES[..],
            _ => &rig::FILES[..],
        };
        let own = own.iter().map(|name| folder.join(name));
        let own = own.chain([folder.join(DESCRIPTION)]);
        files.extend(own.filter(|file| file.is_file()));
    }
    files.extend(report.separating_motion.iter().cloned());
    files.extend(report.extended_fmus.iter().cloned());
    files
}

/// A commented description of a rig of the kind that `word` names, or the `nominal.toml` of a table.
///
/// # Errors
/// A word that names no kind, with those that there are.
pub fn template(word: &str) -> Result<String, Error> {
    if word.eq_ignore_ascii_case("table") || word.eq_ignore_ascii_case("shake_table") {
        return Ok(case_template());
    }
    like(word).map(rig_template).ok_or_else(|| {
        let kinds: Vec<&str> = KINDS.into_iter().map(Rig::kind).collect();
        Error::Option {
            option: "--template",
            reason: format!(
                "unknown kind `{word}`: expected table, {}{}",
                kinds.join(", "),
                units::hint(word, kinds.iter().copied())
            ),
        }
    })
}

fn file_fault(path: &Path, error: impl std::fmt::Display) -> Error {
    Error::File {
        path: path.into(),
        reason: error.to_string(),
    }
}

/// The error by the file that is at fault, which is `subject` where none is named.
fn fault(subject: &Path, error: DiagnosisError) -> Error {
    match error {
        DiagnosisError::Case(CaseError::File { file, reason }) => file_fault(&file, reason),
        DiagnosisError::Rig(DescriptionError::Read { path, source }) => file_fault(&path, source),
        DiagnosisError::Rig(DescriptionError::Description { path, what }) => {
            file_fault(&path, what)
        }
        DiagnosisError::Rig(DescriptionError::Data(error))
        | DiagnosisError::Case(CaseError::Data(error)) => error.into(),
        DiagnosisError::EffectsOfACase => Error::Option {
            option: "--effects",
            reason: error.to_string(),
        },
        DiagnosisError::DataOfACase => Error::Option {
            option: "--data",
            reason: error.to_string(),
        },
        DiagnosisError::Channel { .. } => Error::Option {
            option: "--columns",
            reason: error.to_string(),
        },
        other @ DiagnosisError::Case(_) => file_fault(subject, other),
    }
}

/// The report of the diagnosis whose `diagnosis.json` lies in `folder`: of a rig with its pictures,
/// where its curves are still there, of a case without them, since they need the records.
///
/// # Errors
/// A file that cannot be read or is none of a diagnosis; a report with pictures that would be lost.
pub fn page_again(folder: &Path, units: UnitSystem) -> Result<Report, Error> {
    let path = folder.join(DIAGNOSIS);
    let found: DiagnosisReport = json::read(&path, "the JSON of a diagnosis")?;
    let curves = match &found.evidence {
        Evidence::Rig(_) => rig::curves_again(folder)?,
        Evidence::ShakeTable(_) => None,
    };
    if curves.is_none() && folder.join(report::FILE).is_file() {
        return Err(file_fault(
            folder,
            "its report.html has plots that diagnosis.json does not contain; move it to get one \
             without them, or run `shakebench diagnose` again",
        ));
    }
    Ok(page::again(folder, &found, curves.as_deref(), units))
}
