//! Checks an SSP archive of any tool, runs it, and prints where its outputs end:
//!
//! ```sh
//! cargo run --release -p fmi-check --example somebodys_ssp -- system.ssp 10
//! ```

use std::error::Error;
use std::path::Path;

use fmi_master::{Algorithm, Pace, Plan, Samples, Simulation};
use fmi_system::{Files, assemble};

/// Seconds between two rows, and of the coupling.
const STEP: f64 = 0.01;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, ssp, stop] = &arguments[..] else {
        return Err("expected SYSTEM.ssp SECONDS".into());
    };
    let stop: f64 = stop.parse()?;
    for finding in fmi_check::validate(Path::new(ssp), None)?.findings {
        println!(
            "{}: {}: {}",
            finding.severity, finding.place, finding.message
        );
    }
    let file = fmi_ssp::read(ssp)?;
    let system = assemble(&file, &[], &mut Files::of(&file))?;
    let algorithm = Algorithm::Iterative;
    let plan = Plan {
        algorithm,
        ..Plan::fixed(STEP, stop)
    };
    let simulation =
        Simulation::planned(&system, &Samples::none(STEP), &plan, &Default::default())?;
    let outcome = simulation.run((stop / STEP) as usize + 1, Pace::Fastest, &mut |_| {});
    let last = outcome.record.rows().last().unwrap_or_default();
    for (name, value) in outcome.record.columns.iter().zip(last) {
        println!("{name:40} {value}");
    }
    println!("{}", outcome.ended.message());
    Ok(())
}
