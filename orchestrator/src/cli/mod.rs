//! The command line: one file a command, which parses, calls and prints.

/// As those of the standard library, but through [`terminal`].
macro_rules! println {
    () => { $crate::cli::terminal::out(format_args!(""), "\n") };
    ($($text:tt)*) => { $crate::cli::terminal::out(format_args!($($text)*), "\n") };
}
macro_rules! print {
    ($($text:tt)*) => { $crate::cli::terminal::out(format_args!($($text)*), "") };
}
macro_rules! eprintln {
    () => { $crate::cli::terminal::err(format_args!("")) };
    ($($text:tt)*) => { $crate::cli::terminal::err(format_args!($($text)*)) };
}

pub mod benchmark;
pub mod build;
pub mod campaign;
pub mod commission;
pub mod compare;
pub mod compare_runs;
pub mod design;
pub mod diagnose;
pub mod doctor;
pub mod drive;
pub mod export;
pub mod figures;
pub mod identify;
pub mod info;
mod interrupt;
pub mod iterate;
mod motion;
mod progress;
mod quantity;
pub mod report;
mod rig;
pub mod run;
mod terminal;
pub mod tune;
pub mod validate;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand, ValueEnum};

use crate::error;
use crate::fmu::{FmiVersion, isolation};
use crate::pack::supply;
use crate::report::UnitSystem;
use crate::results;

/// Hydraulic shake tables as FMI components, co-simulated.
///
/// Without a command, the built-in system is run on the built-in motion.
#[derive(Debug, Parser)]
#[command(
    name = "shakebench",
    version,
    after_help = "Exit status: 0 done; 1 the run ended early \
    (what was computed is saved); 2 the input is at fault (nothing is written)."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Units of what is printed and drawn: us (in, lbf) or si (mm, kN); accelerations in g. Files of
    /// numbers are SI always [default: us, and the reader of a page chooses]
    #[arg(
        long,
        value_enum,
        global = true,
        value_name = "SYSTEM",
        hide_possible_values = true
    )]
    units: Option<UnitSystem>,
    /// Replace files of results that are there already and differ
    #[arg(long, global = true)]
    force: bool,
    /// Folder of the components' FMUs [default: beside the program, or built from the workspace]
    #[arg(long, global = true, value_name = "DIR")]
    fmus: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a benchmark of others and score controllers by its rules
    Benchmark(benchmark::Arguments),
    /// Build the components and pack them as FMUs
    Build(build::Arguments),
    /// Carry out a study of many runs and say what they show
    Campaign(campaign::Arguments),
    /// Record, identify and validate a rig, and design all controllers on the result
    Commission(commission::Arguments),
    /// Run controllers on records and print the thesis's tables beside the results
    Compare(compare::Arguments),
    /// Lay any runs over each other and say what differs between them
    CompareRuns(compare_runs::Arguments),
    /// Print what makes a shell complete commands and options
    #[command(
        after_help = "Example:\n  shakebench completions bash > ~/.local/share/bash-completion/completions/shakebench"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print margins of the loops and draw their frequency responses
    Design(design::Arguments),
    /// Name what a model gets wrong, from records of the rig
    Diagnose(diagnose::Arguments),
    /// Draw the thesis's figures with what this program computes
    Figures(figures::Arguments),
    /// Say what is here, what is missing, and the cure
    Doctor(doctor::Arguments),
    /// Find the drive with which a diagnosed rig follows a motion, on its extended model
    Drive(drive::Arguments),
    /// Write a system with its components as an SSP archive
    Export(export::Arguments),
    /// Find a rig's parameters from measured data
    Identify(identify::Arguments),
    /// Show what an .fmu, system or motion file holds
    Info(info::Arguments),
    /// Correct the drive from run to run until the table follows
    Iterate(Box<iterate::Arguments>),
    /// Write the HTML report of a run, a comparison or a diagnosis again
    Report(report::Arguments),
    /// Carry out calls of FMUs for another process of this program
    #[command(name = isolation::COMMAND, hide = true)]
    FmuProcess {
        /// File that the calls come through
        file: PathBuf,
    },
    /// Run a system on a motion
    Run(Box<run::Arguments>),
    /// Search a controller's parameters over a study, within stability margins
    Tune(tune::Arguments),
    /// Say what is wrong with an FMU or an SSP archive
    Validate(validate::Arguments),
}

/// Reads the command line, does what it says and gives the exit status.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    if let Some(units) = cli.units {
        units.choose();
    }
    if cli.force {
        results::allow_overwriting();
    }
    if let Some(folder) = &cli.fmus {
        supply::take_from(folder);
    }
    let done = match cli.command {
        None => run::execute(&run::Arguments::default()),
        Some(Command::Benchmark(arguments)) => benchmark::execute(&arguments),
        Some(Command::Build(arguments)) => build::execute(&arguments),
        Some(Command::Drive(arguments)) => drive::execute(&arguments),
        Some(Command::Campaign(arguments)) => campaign::execute(&arguments),
        Some(Command::Commission(arguments)) => commission::execute(&arguments),
        Some(Command::Compare(arguments)) => compare::execute(&arguments),
        Some(Command::CompareRuns(arguments)) => compare_runs::execute(&arguments),
        Some(Command::Completions { shell }) => {
            let mut words = Cli::command();
            clap_complete::generate(shell, &mut words, "shakebench", &mut std::io::stdout());
            Ok(ExitCode::SUCCESS)
        }
        Some(Command::Design(arguments)) => design::execute(&arguments),
        Some(Command::Diagnose(arguments)) => diagnose::execute(&arguments),
        Some(Command::Figures(arguments)) => figures::execute(&arguments),
        Some(Command::Doctor(arguments)) => doctor::execute(&arguments),
        Some(Command::Export(arguments)) => export::execute(&arguments),
        Some(Command::Identify(arguments)) => identify::execute(&arguments),
        Some(Command::Info(arguments)) => info::execute(&arguments),
        Some(Command::Iterate(arguments)) => iterate::execute(&arguments),
        Some(Command::Report(arguments)) => report::execute(&arguments),
        Some(Command::FmuProcess { file }) => Ok(isolation::guest(&file)),
        Some(Command::Run(arguments)) => run::execute(&arguments),
        Some(Command::Tune(arguments)) => tune::execute(&arguments),
        Some(Command::Validate(arguments)) => validate::execute(&arguments),
    };
    let status = done.unwrap_or_else(|error| {
        eprintln!("error: {}", error::clipped(&error.to_string()));
        ExitCode::from(2)
    });
    terminal::flush();
    match terminal::has_failed() {
        true => ExitCode::from(1),
        false => status,
    }
}

/// `--fmi` where one version is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum OneVersion {
    /// FMI 2.0
    #[value(name = "2")]
    Two,
    /// FMI 3.0
    #[default]
    #[value(name = "3")]
    Three,
}

impl From<OneVersion> for FmiVersion {
    fn from(version: OneVersion) -> Self {
        match version {
            OneVersion::Two => Self::V2,
            OneVersion::Three => Self::V3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_stands_in_the_book() {
        let page = include_str!("../../../docs/settings.md");
        let elsewhere = ["help", "version", "json"];
        let mut missing = Vec::new();
        let program = Cli::command();
        for command in program.get_subcommands().filter(|one| !one.is_hide_set()) {
            for option in command.get_arguments().filter_map(clap::Arg::get_long) {
                let stands = [format!("--{option}`"), format!("--{option} ")];
                if !elsewhere.contains(&option) && !stands.iter().any(|own| page.contains(own)) {
                    missing.push(format!("{} --{option}", command.get_name()));
                }
            }
        }
        assert!(missing.is_empty(), "docs/settings.md lacks {missing:?}");
    }
}
