//! The identified shake table under a specimen, shaken by a valve command, without control:
//! `cargo run --release -p plant --example table_and_specimen`

use std::f64::consts::TAU;

use plant::ModelError;
use plant::identified::shake_table::{ShakeTable, ShakeTableState};
use plant::specimens::linear::{LinearSpecimen, SpecimenState};
use units::constants::{G, INCH, SAMPLING_PERIOD};

fn main() -> Result<(), ModelError> {
    // The thesis's rig, but with a specimen of one ton at 2 Hz and 3 % of critical damping.
    let table = ShakeTable::default();
    let specimen = LinearSpecimen::from_period(1000.0, 0.5, 0.03);
    table.validate()?;
    specimen.validate()?;

    // Exact transitions over 2 ms with the inputs held.
    let sampled_table = table.sample(SAMPLING_PERIOD);
    let sampled_specimen = specimen.sample(SAMPLING_PERIOD);
    let (mut t, mut s) = (ShakeTableState::default(), SpecimenState::default());

    println!("time [s]  displacement [in]  acceleration [g]  drift [in]");
    for k in 0..1000 {
        let time = SAMPLING_PERIOD * f64::from(k);
        let valve_command = 0.2 * (TAU * 2.0 * time).sin();
        let force = specimen.force(&s);
        let acceleration = table.acceleration(&t, force);
        if k % 100 == 0 {
            println!(
                "{time:8.1}  {:17.4}  {:16.4}  {:10.4}",
                t.displacement / INCH,
                acceleration / G,
                s.drift / INCH
            );
        }
        t = sampled_table.advance(&t, valve_command, force);
        s = sampled_specimen.advance(&s, acceleration);
    }
    Ok(())
}
