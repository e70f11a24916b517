//! Identifies the physical rig from the nine kinds of recordings, and says how well.
//!
//! `cargo run --release -p acceptance --example physical_identification [-- KIND... | model FILE]`; the
//! latter writes the model that controllers of the physical rig are tuned on.

use acceptance::physical_recordings::{
    PhysicalTest, nine_kinds, other_motions, prediction, repetition,
};
use identification::closed_loop::{Settings, equations::NAMES, identify};

/// Commissions the default rig, one sample late and bare, and writes its model.
fn commission(path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let test = PhysicalTest {
        name: "commissioning".into(),
        level: 0.3,
        delay: 0.002,
        seed: 2026,
        ..PhysicalTest::default()
    };
    let found = identify(&[test.record()?], Settings::default())?;
    let note = "# The physical rig as its recordings show it, bare, 0.3 g, a minute under Eq 3-6, \
                seed 2026:\n\
                # cargo run --release -p acceptance --example physical_identification -- model FILE\n";
    std::fs::write(path, format!("{note}{}", found.model_file()?.to_toml()?))?;
    println!("written: {path} (seed {})", test.seed);
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [what, path] = arguments.as_slice()
        && what == "model"
    {
        return commission(path);
    }
    let asked: Vec<usize> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    for (number, (name, tests)) in (1..).zip(nine_kinds()) {
        if !asked.is_empty() && !asked.contains(&number) {
            continue;
        }
        let recordings = tests
            .iter()
            .map(PhysicalTest::record)
            .collect::<Result<Vec<_>, _>>()?;
        println!("{number} {name}");
        let begun = std::time::Instant::now();
        let found = match identify(&recordings, Settings::default()) {
            Err(error) => {
                println!("   {error}");
                continue;
            }
            Ok(found) => found,
        };
        println!("   identified in {:.1?}", begun.elapsed());
        let values: [f64; NAMES.len()] = found.rig.into();
        for ((name, value), error) in NAMES.iter().zip(values).zip(found.standard_error) {
            println!("   {name:20} {value:12.5} +- {error:.2e}");
        }
        println!("   {:?}", found.shape);
        println!("   payloads {:.2?} kg", found.payloads);
        if let Some(own) = &found.specimen {
            println!("   {:?}", own.specimen);
        }
        println!("   left over noise {:.2?}", found.mean_squares);
        for warning in &found.warnings {
            println!("   {warning}");
        }
        for (index, test) in tests.iter().enumerate() {
            let payload = index
                .checked_sub(1)
                .map_or(0.0, |before| found.payloads[before]);
            for other in other_motions(test) {
                let made = prediction(&found, payload, &other)?;
                println!(
                    "   other motion: peak {:.2} m/s2, error {:.1} % of it at most, {:.1} % rms",
                    made.peak,
                    100.0 * made.largest,
                    100.0 * made.root_mean_square
                );
                let twice = repetition(&other)?;
                println!(
                    "   the rig itself, played twice: {:.1} % at most, {:.1} % rms",
                    100.0 * twice.largest,
                    100.0 * twice.root_mean_square
                );
            }
        }
    }
    Ok(())
}
