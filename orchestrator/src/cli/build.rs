//! `shakebench build`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};

use crate::error::Error;
use crate::pack;

/// Options of `shakebench build`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  shakebench build --fmi 2 --out fmus")]
pub struct Arguments {
    /// Version of FMI
    #[arg(long, value_enum, default_value = "all")]
    fmi: Versions,
    /// Folder for fmi2/NAME.fmu and fmi3/NAME.fmu [default: target/fmus]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Versions {
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
    All,
}

/// Packs every component and prints where.
///
/// # Errors
/// Components that do not build, or a folder that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => pack::default_folder()?,
    };
    let versions: &[pack::FmiVersion] = match arguments.fmi {
        Versions::Two => &[pack::FmiVersion::V2],
        Versions::Three => &[pack::FmiVersion::V3],
        Versions::All => &pack::FmiVersion::ALL,
    };
    eprintln!("building the components (the first time takes a minute)...");
    for fmu in pack::build_fmus(&out, versions)? {
        println!("{}", fmu.path.display());
    }
    Ok(ExitCode::SUCCESS)
}
