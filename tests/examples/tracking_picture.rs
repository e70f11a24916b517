//! Draws `docs/tracking.svg`: what two controllers make of the built-in motion.
//!
//! `cargo run --release -p acceptance --example tracking_picture`

use std::path::Path;

use fmi_master::Algorithm;
use laboratory::run::experiment::{Request, prepare};
use pages::report::{Abscissa, Axis, Panel, Series, UnitSystem, Units, svg};

/// Seconds shown.
const WINDOW: [f64; 2] = [7.0, 9.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut series = Vec::new();
    for system in ["three-variable", "mpc"] {
        let prepared = prepare(&Request::built_in(system))?;
        let record = prepared.run(Algorithm::GaussSeidel)?.record;
        let table = record.column("table.acceleration").unwrap_or_default();
        let dt = prepared.motion.dt;
        let [from, to] = WINDOW.map(|time| (time / dt).round() as usize);
        let place = Abscissa::Even {
            start: WINDOW[0],
            step: dt,
        };
        if series.is_empty() {
            let reference = prepared.motion.acceleration[from..=to].to_vec();
            series.push(Series::line("reference", place.clone(), reference).coloured(0));
        }
        let colour = series.len();
        let part = table[from..=to].to_vec();
        series.push(Series::line(system, place, part).coloured(colour));
    }
    let panel = Panel {
        title: "Table acceleration".to_string(),
        x: Axis::linear("time", Units::TIME),
        y: Axis::linear("acceleration", Units::ACCELERATION),
        series,
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/tracking.svg");
    std::fs::write(&file, svg(&panel, UnitSystem::Us))?;
    println!("written: {}", file.display());
    Ok(())
}
