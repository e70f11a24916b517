//! What is wrong with an FMU or an SSP archive: its files, its description, what its library does
//! when it is called in order and out of order, and whether it computes what its archive says.

mod archive;
mod calls;
mod reference;
mod rules;
mod schema;
mod ssp;

use std::fmt;
use std::path::Path;

use serde::Serialize;

use crate::error::Error;
use crate::fmu::{Fmu, Interface};

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Against the standard, or it does not run.
    Error,
    /// It runs, but importers may differ or users be misled.
    Warning,
    /// Worth knowing.
    Note,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        })
    }
}

/// Something found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// Where: a file in the archive, with its line where there is one, or a function.
    pub place: String,
    /// What.
    pub message: String,
}

/// What was found, and what was looked at.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Findings {
    /// The file.
    pub file: String,
    /// `fmu` or `ssp`.
    pub kind: &'static str,
    /// Version of the standard, where it could be read.
    pub version: Option<String>,
    /// What was checked, a line each.
    pub checked: Vec<String>,
    /// What was found, the worst first.
    pub findings: Vec<Finding>,
}

impl Findings {
    fn add(&mut self, severity: Severity, place: &str, message: impl Into<String>) {
        let finding = Finding {
            severity,
            place: place.to_string(),
            message: message.into(),
        };
        if !self.findings.contains(&finding) {
            self.findings.push(finding);
        }
    }

    fn error(&mut self, place: &str, message: impl Into<String>) {
        self.add(Severity::Error, place, message);
    }

    fn warning(&mut self, place: &str, message: impl Into<String>) {
        self.add(Severity::Warning, place, message);
    }

    fn note(&mut self, place: &str, message: impl Into<String>) {
        self.add(Severity::Note, place, message);
    }

    fn check(&mut self, what: impl Into<String>) {
        self.checked.push(what.into());
    }

    /// How many findings there are of a severity.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        let alike = self.findings.iter();
        alike.filter(|finding| finding.severity == severity).count()
    }
}

/// Checks an FMU or an SSP archive.
///
/// # Errors
/// A file that cannot be read at all, or is neither.
pub fn validate(path: &Path) -> Result<Findings, Error> {
    let name = path.display().to_string();
    let mut findings = Findings {
        file: name.clone(),
        ..Findings::default()
    };
    std::fs::metadata(path).map_err(|error| Error::File {
        path: path.to_path_buf(),
        reason: error.to_string(),
    })?;
    if crate::ssp::is_ssp(&name) {
        findings.kind = "ssp";
        ssp::check(&mut findings, path);
    } else if name.to_lowercase().ends_with(".fmu") {
        findings.kind = "fmu";
        fmu(&mut findings, path);
    } else {
        return Err(Error::File {
            path: path.to_path_buf(),
            reason: "expected an .fmu or an .ssp file".to_string(),
        });
    }
    findings.findings.sort_by_key(|finding| finding.severity);
    Ok(findings)
}

/// Checks an FMU.
fn fmu(findings: &mut Findings, path: &Path) {
    let Some(description) = archive::check(findings, path) else {
        return;
    };
    schema::check(findings, &description);
    rules::check(findings, &description);
    let fmu = match Fmu::open(path) {
        Ok(fmu) => fmu,
        Err(error) => {
            findings.error(DESCRIPTION, plain(&error.to_string(), path));
            return;
        }
    };
    findings.version = Some(fmu.description.version.to_string());
    for remark in &fmu.description.remarks {
        findings.warning(DESCRIPTION, remark.clone());
    }
    if fmu.description.interface == Interface::ScheduledExecution {
        findings.note(
            DESCRIPTION,
            "scheduled execution only: its library is not called",
        );
        return;
    }
    calls::check(findings, &fmu);
    reference::check(findings, &fmu, path);
}

/// The description of an FMU.
const DESCRIPTION: &str = "modelDescription.xml";

/// A message without the file's name in front, which stands elsewhere.
fn plain(message: &str, path: &Path) -> String {
    let front = format!("{}: ", path.display());
    let message = message.strip_prefix(&front).unwrap_or(message);
    let front = format!("{DESCRIPTION}: ");
    message.strip_prefix(&front).unwrap_or(message).to_string()
}
