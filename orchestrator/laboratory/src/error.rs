//! Whatever a command can fail with.

use std::path::PathBuf;

use fmi_check::CheckError;
use fmi_import::FmuError;
use fmi_master::MasterError;
use fmi_ssp::SspError;
use fmi_system::SystemError;
use motion::MotionError;
use pack::PackError;
use pages::report::PageError;
use thiserror::Error;

use crate::results::ResultsError;

/// Why a command did not do what it was asked for; nothing has been written then, unless
/// [`Error::is_early_end`].
#[derive(Debug, Error)]
pub enum Error {
    /// A system is at fault.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A motion is at fault.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// An FMU is at fault.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// An SSP archive is at fault.
    #[error(transparent)]
    Ssp(#[from] SspError),
    /// A run cannot begin.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// A file cannot be checked.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// A page cannot be made.
    #[error(transparent)]
    Page(#[from] PageError),
    /// The components cannot be built.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// Results cannot be written.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A file of measured data is at fault.
    #[error(transparent)]
    Data(#[from] identification::data::DataError),
    /// A rule, or what is to fit it, is at fault.
    #[error(transparent)]
    Qualification(#[from] qualification::QualificationError),
    /// Measured data give no model.
    #[error(transparent)]
    Identification(#[from] identification::IdentificationError),
    /// An option is at fault.
    #[error("{option}: {reason}")]
    Option {
        /// The option.
        option: &'static str,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A file is at fault.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what was expected.
        reason: String,
    },
}

impl Error {
    /// Whether the command did what it was asked for until it met something that the input is not
    /// to blame for, such as a full disk.
    pub fn is_early_end(&self) -> bool {
        matches!(self, Self::Results(error) if error.is_for_lack_of_space())
    }
}

/// A line in which numbers of more than 40 digits, such as 1e308 written out, are cut short.
fn short_numbers(line: &str) -> String {
    const LONGEST: usize = 40;
    let mut short = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(begin) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = &rest[begin..];
        let end = digits.find(|c: char| !c.is_ascii_digit());
        let end = end.unwrap_or(digits.len());
        short += &rest[..begin];
        match end > LONGEST {
            true => short += &format!("{}... ({end} digits)", &digits[..6]),
            false => short += &digits[..end],
        }
        rest = &digits[end..];
    }
    short + rest
}

/// A message without the middle of lines that are longer than anyone reads: those that quote a file
/// whose lines do not end, or a number of hundreds of digits.
#[must_use]
pub fn clipped(message: &str) -> String {
    const LONGEST: usize = 600;
    let lines = message.lines().map(|line| {
        let characters: Vec<char> = short_numbers(line).chars().collect();
        if characters.len() <= LONGEST {
            return characters.into_iter().collect();
        }
        let part = |of: &[char]| of.iter().collect::<String>();
        let left_out = characters.len() - LONGEST;
        let (begin, end) = (
            &characters[..LONGEST / 2],
            &characters[characters.len() - LONGEST / 2..],
        );
        format!("{} [{left_out} characters] {}", part(begin), part(end))
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_lose_the_middle_of_endless_lines() {
        let short = "file.toml: line 1\nexpected a number";
        assert_eq!(clipped(short), short);
        let long = clipped(&format!("file.toml\n{}end", "x".repeat(100_000)));
        assert!(long.len() < 700 && long.starts_with("file.toml\nxxx") && long.ends_with("xend"));
        assert!(long.contains("[99403 characters]"), "{long}");
        let number = clipped(&format!("runs = {:.1}; expected at most 12345", 1e308));
        assert_eq!(
            number,
            "runs = 100000... (309 digits).0; expected at most 12345"
        );
    }
}
