//! Two controllers on the built-in motion, through the FMUs, from a program of one's own:
//! `cargo run --release -p laboratory --example run_and_compare`

use std::error::Error;

use laboratory::run::experiment::{Request, prepare};
use motion::metrics::tracking;

fn main() -> Result<(), Box<dyn Error>> {
    for system in ["three-variable", "mpc"] {
        let request = Request {
            duration_s: Some(10.0),
            ..Request::built_in(system)
        };
        // Reads and checks what the request names; builds and packs the FMUs when they are stale.
        let prepared = prepare(&request)?;
        let outcome = prepared.run(prepared.algorithm)?;
        let column = |name| {
            let missing = || format!("{system} has no variable `{name}`");
            outcome.record.column(name).ok_or_else(missing)
        };
        let figures = tracking(
            &prepared.motion,
            &column("table.displacement")?,
            &column("table.acceleration")?,
        )?;
        println!(
            "{system}: {:.1} % error in acceleration, {}",
            figures.time_domain_percent,
            outcome.ended.kind().word()
        );
    }
    Ok(())
}
