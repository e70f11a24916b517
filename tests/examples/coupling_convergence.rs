//! Draws `docs/coupling.svg`: the error of the co-simulated rig against the same rig as one model
//! over the coupling step, the controller sampled at 2 ms throughout.
//!
//! `cargo run --release -p acceptance --example coupling_convergence`

use std::path::Path;

use acceptance::monolithic::{table_acceleration, worst_error};
use shakebench::master::Algorithm;
use shakebench::report::{Abscissa, Axis, Panel, Series, Units, svg};
use shakebench::run::experiment::{Request, prepare};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let steps = [0.002, 0.001, 0.0005, 0.00025];
    let mut series = Vec::new();
    println!(
        "{:<14}{:>10}{:>12}{:>8}",
        "algorithm", "step, ms", "error, %", "order"
    );
    for algorithm in [
        Algorithm::Jacobi,
        Algorithm::GaussSeidel,
        Algorithm::Iterative,
    ] {
        let mut errors: Vec<f64> = Vec::new();
        for step in steps {
            let prepared = prepare(&Request {
                step_s: Some(step),
                ..Request::built_in("three-variable")
            })?;
            let record = prepared.run(algorithm)?.record;
            let table = record.column("table.acceleration").unwrap_or_default();
            let truth = table_acceleration(&prepared.motion, true);
            let error = 100.0 * worst_error(&truth, &table);
            let order = errors.last().map_or(String::new(), |last| {
                format!("{:.3}", (last / error).log2())
            });
            println!(
                "{:<14}{:>10}{error:>12.4}{order:>8}",
                algorithm.to_string(),
                1e3 * step
            );
            errors.push(error);
        }
        let place = Abscissa::At(steps.map(|step| 1e3 * step).into());
        series.push(Series::line(&algorithm.to_string(), place, errors));
    }
    let panel = Panel {
        title: "Coupling of table and specimen".to_string(),
        x: Axis::logarithmic("Coupling step", Units::same("ms")),
        y: Axis::logarithmic(
            "Worst error of table acceleration over its peak",
            Units::PERCENT,
        ),
        series,
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/coupling.svg");
    std::fs::write(&file, svg(&panel))?;
    println!("written: {}", file.display());
    Ok(())
}
