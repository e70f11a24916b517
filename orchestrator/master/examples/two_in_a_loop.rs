//! Two integrators in a loop, which are an oscillator: both are the Reference FMU `StateSpace`, whose
//! outputs may depend directly on its inputs, so that the master solves the loop at each step.
//!
//! ```sh
//! cargo run --release -p fmi-master --example two_in_a_loop -- fmi3/StateSpace.fmu
//! ```

use std::error::Error;
use std::path::Path;

use fmi_master::{Algorithm, Pace, Plan, Record, Samples, Simulation};
use fmi_system::{Files, SystemFile, assemble};

/// Of three inputs, states and outputs the first is used: x' = u, y = x. What pushes the first integrator is half of its
/// second input, which starts at 2, so that x'' = -x with x'(0) = 1.
const SYSTEM: &str = r#"
connections = ["first.y[1] -> second.u[1]", "second.y[1] -> first.u[1]"]
[components.first]
fmu = "FMU"
parameters = { "A[1,1]" = 0, "B[1,2]" = 0.5, "C[1,1]" = -1, "D[1,1]" = 0 }
[components.second]
fmu = "FMU"
parameters = { "A[1,1]" = 0, "D[1,1]" = 0 }
"#;

/// The signals up to `stop`, s, with a coupling step of `step`, s.
///
/// # Errors
/// An FMU that cannot be read or simulated.
pub fn run(fmu: &Path, step: f64, stop: f64) -> Result<Record, Box<dyn Error>> {
    let text = SYSTEM.replace("FMU", &fmu.display().to_string());
    let file = SystemFile::parse("oscillator", &text)?;
    let system = assemble(&file, &[], &mut Files::of(&file))?;
    let rows = (stop / step).round() as usize + 1;
    let plan = Plan {
        algorithm: Algorithm::Iterative,
        ..Plan::fixed(step, rows as f64 * step)
    };
    let simulation =
        Simulation::planned(&system, &Samples::none(step), &plan, &Default::default())?;
    let outcome = simulation.run(rows, Pace::Fastest, &mut |_| {});
    Ok(outcome.record)
}

#[allow(dead_code, reason = "a test uses `run` alone")]
fn main() -> Result<(), Box<dyn Error>> {
    let fmu = std::env::args().nth(1).ok_or("expected StateSpace.fmu")?;
    let record = run(Path::new(&fmu), 0.1, 6.0)?;
    let x = record
        .column("first.y[1]")
        .ok_or("no output `first.y[1]`")?;
    for (n, x) in x.iter().enumerate().step_by(10) {
        let time = 0.1 * n as f64;
        println!("{time:4.1} s  {:8.4}  exact {:8.4}", -x, time.sin());
    }
    Ok(())
}
