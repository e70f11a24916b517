//! `shakebench validate`

use super::out::installation;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use fmi_check::{Severity, validate};
use laboratory::error::Error;

/// Options of `shakebench validate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    shakebench validate Theirs.fmu\n  \
    shakebench validate system.ssp --json\n\n\
    Exit status: 0 no errors; 2 errors.")]
pub struct Arguments {
    /// An .fmu or .ssp file
    #[arg(value_name = "FMU|SSP")]
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints the faults of an FMU or an SSP archive.
///
/// # Errors
/// A file that cannot be read, or is neither.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let found = validate(&arguments.file, installation().guest().as_deref())?;
    let (errors, warnings, notes) = (
        found.count(Severity::Error),
        found.count(Severity::Warning),
        found.count(Severity::Note),
    );
    if arguments.json {
        let mut json = serde_json::json!(found);
        json["errors"] = errors.into();
        json["warnings"] = warnings.into();
        json["notes"] = notes.into();
        println!("{json}");
    } else {
        let version = found.version.as_ref();
        let version = version.map_or(String::new(), |version| format!(", FMI {version}"));
        println!("{} ({}{version})\n", found.file, found.kind.to_uppercase());
        for finding in &found.findings {
            println!(
                "{}: {}: {}",
                finding.severity, finding.place, finding.message
            );
        }
        if !found.findings.is_empty() {
            println!();
        }
        println!("checked:");
        for line in &found.checked {
            println!("  {line}");
        }
        println!("\n{errors} errors, {warnings} warnings, {notes} notes");
    }
    Ok(ExitCode::from(if errors > 0 { 2 } else { 0 }))
}
