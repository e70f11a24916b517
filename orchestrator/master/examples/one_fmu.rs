//! Runs one FMU and prints its outputs as CSV:
//!
//! ```sh
//! cargo run --release -p fmi-master --example one_fmu -- BouncingBall.fmu 3
//! ```

use std::error::Error;
use std::path::Path;

use fmi_master::{Outcome, Pace, Plan, Samples, Simulation};
use fmi_system::{Files, SystemFile, assemble};

/// Seconds between two rows.
const STEP: f64 = 0.01;

/// Steps the FMU to `stop`, s.
///
/// # Errors
/// An FMU that cannot be read or simulated.
pub fn run(fmu: &Path, stop: f64) -> Result<Outcome, Box<dyn Error>> {
    let file = SystemFile::of_fmu(fmu);
    let system = assemble(&file, &[], &mut Files::of(&file))?;
    // A row at `stop`, too.
    let rows = (stop / STEP).round() as usize + 1;
    let plan = Plan::fixed(STEP, rows as f64 * STEP);
    let simulation =
        Simulation::planned(&system, &Samples::none(STEP), &plan, &Default::default())?;
    Ok(simulation.run(rows, Pace::Fastest, &mut |_| {}))
}

#[allow(dead_code, reason = "a test uses `run` alone")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, fmu, stop] = &arguments[..] else {
        return Err("expected MODEL.fmu SECONDS".into());
    };
    let outcome = run(Path::new(fmu), stop.parse()?)?;
    println!("{}", outcome.record.columns.join(","));
    for row in outcome.record.rows() {
        println!(
            "{}",
            row.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
        );
    }
    println!("{}", outcome.ended.message());
    Ok(())
}
