//! Draws `docs/coupling.svg`: the error of the co-simulated rig against the same rig as one model
//! over the coupling step, the controller sampled at 2 ms throughout; then tells how small a step
//! specimens of a tenth of the table's mass to ten times it need.
//!
//! `cargo run --release -p acceptance --example coupling_convergence`

use std::path::Path;

use acceptance::monolithic::{table_acceleration, table_acceleration_under, worst_error};
use fmi_master::Algorithm;
use laboratory::run::experiment::{Request, prepare};
use laboratory::run::refinement::refine;
use pages::report::{Abscissa, Axis, Panel, Series, UnitSystem, Units, svg};
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    draw()?;
    masses()
}

/// Errors at 2 ms and with the step halved until they are estimated to be 0.05 %, over the mass of the
/// specimen; its period and damping are those of Appendix A.
fn masses() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "\n{:>14}{:>16}{:>14}{:>12}{:>14}{:>14}",
        "mass of table", "algorithm", "at 2 ms, %", "step, ms", "estimated, %", "error, %"
    );
    for ratio in [0.1, 0.3, 1.0, 3.0, 10.0] {
        let mass = ratio * ShakeTable::default().table.mass;
        let specimen = LinearSpecimen::from_period(mass, 1.0, 0.05);
        let request = Request {
            set: vec![
                format!("specimen.mass={} kg", specimen.mass),
                format!("specimen.damping={} N s/m", specimen.damping),
                format!("specimen.stiffness={} N/m", specimen.stiffness),
            ],
            ..Request::built_in("three-variable")
        };
        for algorithm in [Algorithm::GaussSeidel, Algorithm::Iterative] {
            let mut prepared = prepare(&request)?;
            prepared.algorithm = algorithm;
            let truth = table_acceleration_under(&prepared.motion, Some(specimen));
            let record = prepared.run(algorithm)?.record;
            let coarse = record.column("table.acceleration").unwrap_or_default();
            let estimated = refine(&mut prepared, 0.05)?;
            let record = prepared.run(algorithm)?.record;
            let fine = record.column("table.acceleration").unwrap_or_default();
            println!(
                "{ratio:>14}{:>16}{:>14.4}{:>12}{:>14.4}{:>14.4}",
                algorithm.to_string(),
                100.0 * worst_error(&truth, &coarse),
                1e3 * prepared.step,
                estimated.percent,
                100.0 * worst_error(&truth, &fine)
            );
        }
    }
    Ok(())
}

/// The error over the coupling step, with a specimen of twice the table's mass.
fn draw() -> Result<(), Box<dyn std::error::Error>> {
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
    std::fs::write(&file, svg(&panel, UnitSystem::Us))?;
    println!("written: {}", file.display());
    Ok(())
}
