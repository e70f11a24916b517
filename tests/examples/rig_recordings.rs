//! Writes recordings of the identified rig under three-variable control, 1 % noise on every channel,
//! a minute at 500 Hz each: `bare.csv`, `payload.csv` (25 kg on the table) and `specimen.csv`.
//!
//! `cargo run --release -p acceptance --example rig_recordings -- FOLDER`

use std::path::Path;

use acceptance::recordings::{Test, csv};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args()
        .nth(1)
        .ok_or("a folder to write to is missing")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let specimen = Test::default();
    let bare = Test {
        specimen: None,
        seed: 5,
        ..specimen
    };
    let payload = Test {
        payload: 25.0,
        seed: 6,
        ..bare
    };
    for (name, test) in [("bare", bare), ("payload", payload), ("specimen", specimen)] {
        let path = folder.join(format!("{name}.csv"));
        std::fs::write(&path, csv(&test.record()))?;
        println!("written: {} (seed {})", path.display(), test.seed);
    }
    Ok(())
}
