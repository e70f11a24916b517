//! Faults of an FMU or an SSP archive: its files, its description, and the behaviour of its library
//! when called in order and out of order. It also checks whether the library computes the reference
//! result of the archive.

mod archive;
mod calls;
mod derivatives;
mod reference;
mod rules;
mod schema;
mod ssp;
mod structure;
#[cfg(test)]
mod tests;

use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use fmi_import::{Fmu, Interface};

/// Why a file cannot be checked.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's word.
        source: std::io::Error,
    },
    /// It is neither.
    #[error("{}: expected an .fmu or an .ssp file", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
    },
}

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
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
    /// The findings, so that none is there twice.
    #[serde(skip)]
    known: HashSet<(Severity, String, String)>,
    /// Findings of each severity that are kept.
    #[serde(skip)]
    kept: [usize; 3],
    /// Findings of each severity that are counted only.
    #[serde(skip)]
    more: [usize; 3],
    /// Where the lines of the description begin.
    #[serde(skip)]
    lines: Vec<usize>,
}

impl Findings {
    /// Findings of one severity that are kept.
    const MOST: usize = 1000;

    fn add(&mut self, severity: Severity, place: &str, message: impl Into<String>) {
        let message = message.into();
        if self.kept[severity as usize] >= Self::MOST {
            self.more[severity as usize] += 1;
            return;
        }
        if self
            .known
            .insert((severity, place.to_string(), message.clone()))
        {
            self.kept[severity as usize] += 1;
            self.findings.push(Finding {
                severity,
                place: place.to_string(),
                message,
            });
        }
    }

    /// Notes the lines of a text, for [`Findings::place`].
    fn count_lines(&mut self, text: &str) {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        self.lines = std::iter::once(0)
            .chain(ends.map(|(at, _)| at + 1))
            .collect();
    }

    /// The line of the description in which an element begins.
    fn place(&self, node: roxmltree::Node) -> String {
        let at = node.range().start;
        format!(
            "{DESCRIPTION}:{}",
            self.lines.partition_point(|begin| *begin <= at)
        )
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
        let kept = alike.filter(|finding| finding.severity == severity).count();
        kept + self.more[severity as usize]
    }
}

/// Checks an FMU or an SSP archive; its library is called in the process of `guest` (as
/// [`Options::guest`](fmi_import::Options::guest)).
///
/// # Errors
/// A file that cannot be read at all, or is neither.
pub fn validate(path: &Path, guest: Option<&Path>) -> Result<Findings, CheckError> {
    let name = path.display().to_string();
    let mut findings = Findings {
        file: name.clone(),
        ..Findings::default()
    };
    std::fs::metadata(path).map_err(|source| CheckError::Unreadable {
        path: path.to_path_buf(),
        source,
    })?;
    if fmi_ssp::is_ssp(&name) {
        findings.kind = "ssp";
        ssp::check(&mut findings, path, guest);
    } else if name.to_lowercase().ends_with(".fmu") {
        findings.kind = "fmu";
        fmu(&mut findings, path, guest);
    } else {
        return Err(CheckError::Kind {
            path: path.to_path_buf(),
        });
    }
    for (severity, word) in [
        (Severity::Error, "errors"),
        (Severity::Warning, "warnings"),
        (Severity::Note, "notes"),
    ] {
        let more = std::mem::take(&mut findings.more[severity as usize]);
        if more > 0 {
            findings.findings.push(Finding {
                severity,
                place: name.clone(),
                message: format!("{more} more {word} are not listed"),
            });
        }
    }
    findings.findings.sort_by_key(|finding| finding.severity);
    Ok(findings)
}

/// Checks an FMU.
fn fmu(findings: &mut Findings, path: &Path, guest: Option<&Path>) {
    let Some(description) = archive::check(findings, path) else {
        return;
    };
    findings.count_lines(&description);
    if let Err(doubt) = fmi_import::archive::check_attributes(&description) {
        findings.error(DESCRIPTION, doubt.to_string());
        return;
    }
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
    calls::check(findings, &fmu, guest);
    reference::check(findings, &fmu, path, guest);
}

/// The description of an FMU.
const DESCRIPTION: &str = "modelDescription.xml";

/// A message without the leading file name, which is given elsewhere.
fn plain(message: &str, path: &Path) -> String {
    let front = format!("{}: ", path.display());
    let message = message.strip_prefix(&front).unwrap_or(message);
    let front = format!("{DESCRIPTION}: ");
    message.strip_prefix(&front).unwrap_or(message).to_string()
}
