//! The program `shakebench-hybrid`: what `shakebench benchmark` starts.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use hybrid_benchmark::{console, marths, vrths};
use laboratory::error;
use laboratory::results::Out;
use pages::report::UnitSystem;

/// Run a published benchmark and score controllers by its rules
#[derive(Debug, Parser)]
#[command(name = "shakebench benchmark", version)]
struct Cli {
    #[command(subcommand)]
    benchmark: Benchmark,
    /// Units of printed output and pages: us (in, lbf) or si (mm, kN)
    #[arg(
        long,
        value_enum,
        global = true,
        value_name = "SYSTEM",
        hide_possible_values = true
    )]
    units: Option<UnitSystem>,
    /// Replace existing result files that differ
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Benchmark {
    /// Virtual real-time hybrid simulation: an actuator between a computed frame and a specimen
    Vrths(vrths::command::Vrths),
    /// Multi-axial hybrid simulation: two actuators hold one joint of a computed frame
    Marths(marths::command::Marths),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let results = Out::new(".").replacing(cli.force).in_units(cli.units);
    let done = match cli.benchmark {
        Benchmark::Vrths(arguments) => vrths::command::execute(&arguments, &results),
        Benchmark::Marths(arguments) => marths::command::execute(&arguments, &results),
    };
    done.unwrap_or_else(|error| {
        console::complain(&format!("error: {}", error::clipped(&error.to_string())));
        ExitCode::from(2)
    })
}
