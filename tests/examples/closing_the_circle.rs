//! Closes the circle on rigs with a hidden effect: the generator, which shares no code with the models,
//! hides it; it is diagnosed from the records; the drive for a motion that was never recorded is
//! computed on the extended model; the generator's rig plays it, noise and disturbance on. Prints
//! the table of `docs/closing-the-circle.md`.
//!
//! `cargo run --release -p acceptance --example closing_the_circle -- [--seed S] [--record FILE] [--pga G]
//! [--corrections N] [EFFECT...]`

use std::error::Error;
use std::io::Write as _;
use std::path::PathBuf;

use hidden_effects::case::{Case, Kind, Settings};
use hidden_effects::catalogue::entry;
use identification::diagnosis::case::Case as Laboratory;
use identification::diagnosis::engine::Observer;
use identification::diagnosis::rigs::shake_table::diagnose;
use laboratory::iteration::circle::{self, Plan};
use laboratory::iteration::on_model::Search;
use motion::metrics;
use motion::{Motion, Scaling};
use pack::extended_model::ExtendedModel;
use units::constants::{G, INCH};

/// Effects that are hidden when none is named.
const EFFECTS: [&str; 12] = [
    "valve_dead_band",
    "valve_hysteresis",
    "valve_flow_gain",
    "valve_asymmetric_gain",
    "valve_null_bias",
    "command_delay",
    "supply_pressure_droop",
    "coulomb_friction",
    "added_payload",
    "foundation_compliance",
    "specimen_yielding",
    "accelerometer_delay",
];
/// Noise of the runs that are scored.
const NOISE_SEED: u64 = 99;

fn main() -> Result<(), Box<dyn Error>> {
    let mut effects = Vec::new();
    let (mut seed, mut record, mut pga) = (20_261, None, 0.2);
    let mut search = Search::default();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || {
            arguments
                .next()
                .ok_or(format!("{argument}: expected a value"))
        };
        match argument.as_str() {
            "--seed" => seed = value()?.parse()?,
            "--record" => record = Some(PathBuf::from(value()?)),
            "--pga" => pga = value()?.parse()?,
            "--corrections" => search.corrections = value()?.parse()?,
            name => effects.push(
                entry(name)
                    .ok_or(format!("`{name}` is not an effect"))?
                    .name,
            ),
        }
    }
    if effects.is_empty() {
        effects = EFFECTS.to_vec();
    }
    println!("seed {seed}, {pga} g");
    println!("| hidden | diagnosed | motion itself | nominal drive | extended drive | expected |");
    println!("|---|---|---|---|---|---|");
    for (i, effect) in effects.into_iter().enumerate() {
        let case = Case::draw(seed + i as u64, &Settings::new(Kind::This(effect)));
        let folder = tempfile::tempdir()?;
        let place = folder.path().join(effect);
        case.write(&place)?;
        let diagnosis = diagnose(&Laboratory::read(&place)?, Observer::none())?;
        let model = ExtendedModel::new(&diagnosis.extended_model, &diagnosis.modelled);
        let file = folder.path().join("extended_model.toml");
        std::fs::write(&file, model.toml()?)?;
        let found = circle::close(&Plan {
            case: place,
            model: file,
            record: record.clone(),
            reference: None,
            scaling: Some(Scaling::PeakAcceleration(pga * G)),
            seed: 3,
            search,
        })?;
        let [Some(wanted), Some(unaware), Some(drive)] =
            [&found.wanted, &found.unaware, &found.drive]
        else {
            return Err("a circle without its drives".into());
        };
        let on_rig = |drive: &Motion| -> Result<f64, Box<dyn Error>> {
            let reference: Vec<f64> = drive.displacement.iter().map(|x| x / INCH).collect();
            let table = case.follow(&reference, NOISE_SEED);
            let column = |i: usize| -> Vec<f64> { table.iter().map(|row| row[i] * INCH).collect() };
            Ok(metrics::tracking(wanted, &column(0), &column(1))?.time_domain_percent)
        };
        let named: Vec<&str> = diagnosis
            .modelled
            .iter()
            .map(|named| named.effect)
            .collect();
        let hidden = case.truth.effects.first().and_then(|effect| {
            let (name, value) = effect.parameters.first_key_value()?;
            Some(format!("{name} {:.3} {}", value.value, value.unit))
        });
        println!(
            "| {effect}, {} | {:?}: {} | {:.2} % | {:.2} % | {:.2} % | {:.2} % |",
            hidden.unwrap_or_default(),
            diagnosis.verdict,
            named.join(", "),
            on_rig(wanted)?,
            on_rig(unaware)?,
            on_rig(drive)?,
            found.extended_drive.time_domain_percent
        );
        std::io::stdout().flush()?;
    }
    Ok(())
}
