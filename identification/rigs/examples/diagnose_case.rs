//! Diagnoses cases of the shake table: `cargo run --release -p rigs --example diagnose_case -- [--verbose] CASE...`

use std::path::Path;
use std::time::Instant;

use diagnosis::{Observer, Progress};
use rigs::case::Case;
use rigs::kinds::shake_table::diagnose;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (options, folders): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|argument| argument.starts_with("--"));
    let has = |option: &str| options.iter().any(|own| own == option);
    for folder in folders {
        let case = Case::read(Path::new(&folder))?;
        let start = Instant::now();
        let tell = |event: &Progress| {
            if has("--verbose") {
                eprintln!("{:.2} {event}", start.elapsed().as_secs_f64());
            }
        };
        let diagnosis = diagnose(&case, Observer::new(&tell))?;
        println!(
            "{folder}: {:?} in {:.1} s\n  {}",
            diagnosis.verdict,
            start.elapsed().as_secs_f64(),
            diagnosis.sentence
        );
        for effect in &diagnosis.modelled {
            println!("  {} {:.3}", effect.effect, effect.confidence);
            for p in &effect.parameters {
                println!(
                    "    {} = {:.5} ± {:.5} {}",
                    p.name, p.value, p.standard_error, p.unit
                );
            }
        }
        println!("  as described {:.3}", diagnosis.as_described);
        for own in &diagnosis.ablations {
            println!("  {own:?}");
        }
        for own in &diagnosis.candidates {
            let names: Vec<&str> = own.effects.iter().map(|e| e.effect).collect();
            println!(
                "  candidate {}: weight {:.3}, explains {:.3}",
                names.join(" + "),
                own.weight,
                own.explains
            );
        }
        for note in &diagnosis.notes {
            println!("  note: {note}");
        }
        for test in diagnosis.remaining.iter().take(4) {
            println!("  left: {} at {:.1}", test.what, test.deviate);
        }
    }
    Ok(())
}
