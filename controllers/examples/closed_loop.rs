//! Three-variable control of the identified shake table, sampled at 500 Hz: how well it follows a
//! sine. `cargo run --release -p controllers --example closed_loop`

use std::f64::consts::TAU;

use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, ModelError, Motion};
use plant::identified::shake_table::{ShakeTable, ShakeTableState};
use units::constants::{INCH, SAMPLING_PERIOD};

/// Half an inch at a frequency in Hz.
fn reference(time: f64, frequency: f64) -> Motion {
    let (omega, amplitude) = (TAU * frequency, 0.5 * INCH);
    let (sine, cosine) = (omega * time).sin_cos();
    Motion {
        displacement: amplitude * (1.0 - cosine),
        velocity: amplitude * omega * sine,
        acceleration: amplitude * omega * omega * cosine,
    }
}

fn main() -> Result<(), ModelError> {
    let table = ShakeTable::default();
    let sampled = table.sample(SAMPLING_PERIOD);
    for frequency in [0.5, 1.0, 2.0, 4.0] {
        let mut law = ThreeVariableControl::table_3_2();
        law.validate()?;
        let mut state = ShakeTableState::default();
        let mut largest: f64 = 0.0;
        for k in 0..2500 {
            let reference = reference(SAMPLING_PERIOD * f64::from(k), frequency);
            let measured = Motion {
                displacement: state.displacement,
                velocity: state.velocity,
                acceleration: table.acceleration(&state, 0.0),
            };
            largest = largest.max((reference.displacement - measured.displacement).abs());
            let input = ThreeVariableInput {
                reference,
                measured,
            };
            let valve_command = law.step(&input, SAMPLING_PERIOD);
            state = sampled.advance(&state, valve_command, 0.0);
        }
        println!("{frequency:3.1} Hz: largest error {:.3} in", largest / INCH);
    }
    Ok(())
}
