//! Diagnoses a rig by the library alone: `diagnose_rig RIG.toml [DATA...] [--validate FILE...]`
//! prints what each part of the data says, the named model, and its errors on further files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use identification::diagnosis::engine::{Observer, Progress};
use identification::diagnosis::rigs::{Description, ExtendedRig, PartReport, diagnose};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let description = arguments.first().ok_or("RIG.toml is missing")?;
    let mut lists = arguments[1..].split(|argument| argument == "--validate");
    let mut list = || -> Vec<PathBuf> {
        let own = lists.next().unwrap_or_default();
        own.iter().map(PathBuf::from).collect()
    };
    let (data, validated) = (list(), list());
    let description = Description::read(Path::new(description))?;
    let measurement = description.measurement(&data)?;
    let begun = Instant::now();
    let tell = |event: &Progress| eprintln!("{:7.1} {event}", begun.elapsed().as_secs_f64());
    let found = diagnose(&description, &measurement, Observer::new(&tell))?;
    println!("{}", found.sentence());
    for note in found.notes() {
        println!("  {note}");
    }
    let part = |name: &str, part: &PartReport| {
        println!(
            "{name}: nominal {:.2} %, refitted {:.2} %, extended {:.2} %",
            100.0 * part.nominal_error,
            100.0 * part.refitted_error,
            100.0 * part.extended_error
        );
        for effect in &part.effects {
            println!(
                "  {} {:.3} {:?}",
                effect.effect, effect.share, effect.objection
            );
        }
    };
    part("as described", &found.as_described);
    part("parts swapped", &found.swapped);
    let confirmed = &found.confirmed;
    println!(
        "named effects only: {:.3} %, swapped {:.3} %, all data {:.3} %",
        100.0 * confirmed.error,
        100.0 * confirmed.swapped_error,
        100.0 * confirmed.fitted_error
    );
    let model = ExtendedRig::new(&description, &measurement, &found)?;
    println!(
        "{}\n{:.1} s",
        model.to_toml()?,
        begun.elapsed().as_secs_f64()
    );
    for file in model.validate(&validated)? {
        println!("{file:?}");
    }
    Ok(())
}
