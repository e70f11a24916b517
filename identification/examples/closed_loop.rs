//! Identifies the physical rig from the nine kinds of recordings, and says how well.
//!
//! `cargo run --release -p identification --example closed_loop [-- KIND...]`

#[path = "../../tests/src/physical_recordings.rs"]
mod physical_recordings;

use controllers::Controller;
use controllers::pid::PidInput;
#[allow(unused_imports)]
use identification::closed_loop::simulation::Simulation;
use physical_recordings::{PhysicalTest, controller, nine_kinds};
use identification::closed_loop::{Settings, equations::NAMES, identify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let asked: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    for (number, (name, tests)) in nine_kinds().into_iter().enumerate() {
        if !asked.is_empty() && !asked.contains(&(number + 1)) {
            continue;
        }
        let recordings = tests.iter().map(|t| t.record()).collect::<Result<Vec<_>, _>>()?;
        println!("{} {name}", number + 1);
        let begun = std::time::Instant::now();
        match identify(&recordings, Settings::default()) {
            Err(error) => println!("   {error}"),
            Ok(found) => {
                let values: [f64; 15] = found.rig.into();
                for ((name, value), error) in NAMES.iter().zip(values).zip(found.standard_error) {
                    println!("   {name:22} {value:12.5} +- {error:.2e} ({:.2} %)", 100.0 * error / value.abs());
                }
                if let Some(s) = &found.specimen {
                    println!("   specimen {:?} misfit {:.3}", s.specimen, s.misfit);
                }
                for (index, test) in tests.iter().enumerate() {
                    let payload = if index == 0 { 0.0 } else { found.payloads[index - 1] };
                    for other in [
                        PhysicalTest { noise: 0.0, seed: test.seed + 100, duration: 20.0, ..test.clone() },
                        PhysicalTest { noise: 0.0, seed: test.seed + 200, duration: 20.0, lines: Some(60), band: (2.0, 20.0), ..test.clone() },
                    ] {
                        let wanted = other.reference()?;
                        let played = other.play(&wanted)?;
                        let mut model = Simulation::new(found.rig, found.shape, payload, found.specimen.as_ref().map(|s| s.specimen), other.period);
                        let mut law = controller();
                        let (mut worst, mut square, mut peak) = (0.0f64, 0.0, 0.0f64);
                        for (k, r) in wanted.iter().enumerate() {
                            let shown = model.shown();
                            let u = law.step(&PidInput { reference: *r, measured: shown.displacement }, other.period);
                            let error = shown.acceleration - played.measured[1][k];
                            worst = worst.max(error.abs());
                            square += error * error;
                            peak = peak.max(played.measured[1][k].abs());
                            model.step(u);
                        }
                        println!("   other motion: peak {:.2} m/s2, error {:.1} % of it at most, {:.1} % rms", peak, 100.0 * worst / peak, 100.0 * (square / wanted.len() as f64).sqrt() / peak);
                    }
                }
                println!("   payloads {:?} {:?} squares {:.2?} converged {} in {:.1?}", found.payloads, found.shape, found.mean_squares, found.converged, begun.elapsed());
            }
        }
    }
    Ok(())
}
