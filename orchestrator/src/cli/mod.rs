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
/// A line on standard error, unless `--quiet` was given.
macro_rules! note {
    ($($text:tt)*) => {
        if !$crate::cli::progress::is_quiet() {
            $crate::cli::terminal::err(format_args!($($text)*));
        }
    };
}

pub mod benchmark;
pub mod build;
pub mod campaign;
pub mod commission;
pub mod compare;
pub mod design;
pub mod diagnose;
pub mod doctor;
pub mod export;
pub mod figures;
pub mod identify;
pub mod info;
mod interrupt;
pub mod iterate;
mod motion;
mod multivariable;
mod negative;
mod out;
mod progress;
pub mod qualify;
mod quantity;
pub mod report;
mod rig;
pub mod run;
pub mod serve;
mod settings;
mod terminal;
pub mod trs;
pub mod tune;
pub mod validate;
mod watch;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use fmi_import::{FmiVersion, isolation};
use laboratory::error;
use pages::report::UnitSystem;
use progress::Detail;
use quantity::ValueError;

/// Hydraulic shake tables as FMI components, co-simulated.
///
/// Without a command, the built-in system runs on the built-in motion.
#[derive(Debug, Parser)]
#[command(
    name = "shakebench",
    version,
    after_help = "Exit status: 0 done; 1 the run ended early (the results so far are saved); 2 \
        the input is wrong (nothing is written)."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Units of printed output and pages: us (in, lbf) or si (mm, kN); accelerations in g. Data
    /// files are always SI [default: us; pages have buttons to switch]. For `serve`: units of length
    /// and force of the client, such as in,kip
    #[arg(long, value_parser = GivenUnits::read, global = true, value_name = "SYSTEM")]
    units: Option<GivenUnits>,
    /// Replace existing result files that differ
    #[arg(long, global = true)]
    force: bool,
    /// No progress and no notes on standard error
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Each step of the progress as a line on standard error
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Folder of the components' FMUs [default: the program's folder, or built from the workspace]
    #[arg(long, global = true, value_name = "DIR")]
    fmus: Option<PathBuf>,
}

/// What `--units` says.
#[derive(Debug, Clone, PartialEq)]
enum GivenUnits {
    /// Those of what is printed.
    System(UnitSystem),
    /// A client's length and force.
    Client(String),
}

impl GivenUnits {
    fn read(text: &str) -> Result<Self, ValueError> {
        if text.contains(',') {
            return Ok(Self::Client(text.to_string()));
        }
        let known = UnitSystem::from_str(text, true);
        let expected = "us or si; of `serve` a length and a force, such as in,kip";
        known
            .map(Self::System)
            .map_err(|_| ValueError::Expected(expected))
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a published benchmark and score controllers by its rules
    Benchmark(benchmark::Arguments),
    /// Build all components and pack them as FMUs
    Build(build::Arguments),
    /// Run a parameter study
    Campaign(campaign::Arguments),
    /// Record, identify and validate a rig, and design its controllers
    Commission(commission::Arguments),
    /// Compare systems on motions, or finished runs
    #[command(alias = "compare-runs")]
    Compare(Box<compare::Arguments>),
    /// Generate shell completions
    #[command(
        after_help = "Example:\n  shakebench completions bash > ~/.local/share/bash-completion/completions/shakebench"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print margins and plot frequency responses of the loops
    Design(design::Arguments),
    /// Find what a model gets wrong, from records of the rig
    Diagnose(diagnose::Arguments),
    /// Draw the figures of the thesis
    #[command(hide = true)]
    Figures(figures::Arguments),
    /// Check the installation
    Doctor(doctor::Arguments),
    /// Export a system with its components as an SSP archive
    Export(export::Arguments),
    /// Identify a rig's parameters from measured data
    Identify(identify::Arguments),
    /// Show the content of an FMU, a system or a motion file
    Info(info::Arguments),
    /// Correct the drive from run to run, or on a model, until the table follows the motion
    #[command(alias = "drive")]
    Iterate(Box<iterate::Arguments>),
    /// Make a motion for a required response spectrum, run it, and search resonances
    Qualify(Box<qualify::Arguments>),
    /// Recreate the HTML report of a run, a comparison or a diagnosis
    Report(report::Arguments),
    /// Call FMUs for another process of this program
    #[command(name = isolation::COMMAND, hide = true)]
    FmuProcess {
        /// File through which the calls arrive
        file: PathBuf,
    },
    /// Run a system on a motion
    Run(Box<run::Arguments>),
    /// Answer another program as an experimental element, over OpenFresco's protocol
    Serve(Box<serve::Arguments>),
    /// Compare a record's response spectrum with a required one
    Trs(trs::Arguments),
    /// Optimise a controller's parameters over a study, within stability margins
    Tune(tune::Arguments),
    /// Check an FMU or an SSP archive
    Validate(validate::Arguments),
}

/// The commands as the help shows them.
const GROUPS: [(&str, &[&str]); 6] = [
    (
        "Run a test",
        &["run", "compare", "iterate", "qualify", "trs", "report"],
    ),
    (
        "Know your rig",
        &["identify", "diagnose", "commission", "serve"],
    ),
    ("Design", &["design"]),
    ("Studies", &["campaign", "tune", "benchmark"]),
    ("FMUs", &["build", "info", "export", "validate"]),
    ("The installation", &["doctor", "completions", "help"]),
];

/// The command line, with its commands in groups.
fn program() -> clap::Command {
    let mut program = Cli::command();
    program.build();
    let mut groups = String::new();
    for (heading, names) in GROUPS {
        groups += &format!("{heading}:\n");
        for command in names
            .iter()
            .filter_map(|name| program.find_subcommand(name))
        {
            let about = command.get_about().map(ToString::to_string);
            groups += &format!(
                "  {:<12} {}\n",
                command.get_name(),
                about.unwrap_or_default()
            );
        }
        groups.push('\n');
    }
    Cli::command().help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}Options:\n{{options}}{{after-help}}"
    ))
}

/// Prints one JSON object, with the folder of the files that were written.
fn print_json(mut json: serde_json::Value, folder: &Path) {
    json["folder"] = folder.display().to_string().into();
    println!("{json}");
}

/// Prints where files were written.
fn print_files(files: &[PathBuf]) {
    println!("written:");
    for file in files {
        println!("  {}", file.display());
    }
}

/// Reads the command line, does what it says and gives the exit status.
pub fn main() -> ExitCode {
    interrupt::survive_full_disks();
    let words = program().get_matches_from(negative::joined(std::env::args_os()));
    let cli = Cli::from_arg_matches(&words).unwrap_or_else(|error| error.exit());
    if let Err(twice) = settings::agree(&words) {
        eprintln!("error: {twice}");
        return ExitCode::from(2);
    }
    progress::choose(match (cli.quiet, cli.verbose) {
        (true, _) => Detail::Quiet,
        (_, true) => Detail::Verbose,
        _ => Detail::Usual,
    });
    let is_service = matches!(cli.command, Some(Command::Serve(_)));
    let (units, client_units) = match cli.units {
        Some(GivenUnits::Client(units)) if is_service => (None, Some(units)),
        Some(GivenUnits::Client(units)) => {
            eprintln!("error: --units: `{units}` is for `serve` only; expected us or si");
            return ExitCode::from(2);
        }
        Some(GivenUnits::System(units)) => {
            out::choose(units);
            (Some(units), None)
        }
        None => (None, None),
    };
    if cli.force {
        out::force();
    }
    out::install(cli.fmus.clone());
    let done = match cli.command {
        None => run::execute(&run::Arguments::default()),
        Some(Command::Benchmark(arguments)) => benchmark::execute(&arguments, units, cli.force),
        Some(Command::Build(arguments)) => build::execute(&arguments),
        Some(Command::Campaign(arguments)) => campaign::execute(&arguments),
        Some(Command::Commission(arguments)) => commission::execute(&arguments),
        Some(Command::Compare(arguments)) => compare::execute(&arguments),
        Some(Command::Completions { shell }) => {
            let mut words = program();
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut words, "shakebench", &mut script);
            print!("{}", String::from_utf8_lossy(&script));
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
        Some(Command::Qualify(arguments)) => qualify::execute(&arguments),
        Some(Command::Report(arguments)) => report::execute(&arguments),
        Some(Command::FmuProcess { file }) => Ok(isolation::guest(&file)),
        Some(Command::Run(arguments)) => run::execute(&arguments),
        Some(Command::Serve(arguments)) => serve::execute(&arguments, client_units.as_deref()),
        Some(Command::Trs(arguments)) => trs::execute(&arguments),
        Some(Command::Tune(arguments)) => tune::execute(&arguments),
        Some(Command::Validate(arguments)) => validate::execute(&arguments),
    };
    let status = done.unwrap_or_else(|error| {
        eprintln!("error: {}", error::clipped(&error.to_string()));
        ExitCode::from(if error.is_early_end() { 1 } else { 2 })
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
    fn every_command_is_in_one_group_of_the_help() {
        let mut program = program();
        program.build();
        let shown = program.get_subcommands().filter(|one| !one.is_hide_set());
        for name in shown.map(clap::Command::get_name) {
            let groups = GROUPS.iter().filter(|(_, names)| names.contains(&name));
            assert_eq!(groups.count(), 1, "groups that hold `{name}`");
        }
        let listed: usize = GROUPS.iter().map(|(_, names)| names.len()).sum();
        let shown = program.get_subcommands().filter(|one| !one.is_hide_set());
        assert_eq!(
            listed,
            shown.count(),
            "a group lists a command that does not exist"
        );
    }

    #[test]
    fn every_option_stands_in_the_book() {
        let page = include_str!("../../../docs/settings.md");
        let elsewhere = ["help", "version", "json"];
        let mut missing = Vec::new();
        let program = program();
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
