//! `shakebench benchmark`: starts the program that holds the benchmarks.

use std::ffi::OsString;
use std::process::{Command, ExitCode};

use clap::{Args, ValueEnum};
use laboratory::error::Error;
use pages::report::UnitSystem;

/// The program that holds the benchmarks, and the package it is built from.
const PROGRAM: &str = "shakebench-hybrid";
const PACKAGE: &str = "hybrid-benchmark";

/// Options of `shakebench benchmark`.
#[derive(Debug, Args)]
#[command(
    disable_help_flag = true,
    after_help = "Example:\n  shakebench benchmark vrths --case 1 --motion el-centro --perturbed 0"
)]
pub struct Arguments {
    /// The benchmark and its options; `--help` lists them
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "NAME"
    )]
    arguments: Vec<OsString>,
}

/// Runs a benchmark with the options before its name.
///
/// # Errors
/// The program is neither beside this one nor can be built.
pub fn execute(
    arguments: &Arguments,
    units: Option<UnitSystem>,
    force: bool,
) -> Result<ExitCode, Error> {
    if pack::beside(PROGRAM).is_none() {
        note!("note: building {PROGRAM}, the program of the benchmarks");
    }
    let program = pack::companion(PROGRAM, PACKAGE)?;
    let mut command = Command::new(&program);
    if let Some(units) = units.and_then(|units| units.to_possible_value()) {
        command.args(["--units", units.get_name()]);
    }
    if force {
        command.arg("--force");
    }
    let status = command
        .args(&arguments.arguments)
        .status()
        .map_err(|error| Error::File {
            path: program,
            reason: error.to_string(),
        })?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    // Without a code, a signal ended it.
    Ok(ExitCode::from(code.unwrap_or(1)))
}
