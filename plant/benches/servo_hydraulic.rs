//! How many times faster than real time the physical rig with its yielding specimen is, coupled at
//! 500 Hz: the median of several runs. `cargo bench -p plant --bench servo_hydraulic`

use std::hint::black_box;
use std::time::Instant;

use plant::servo_hydraulic::{ServoHydraulicInput, ServoHydraulicTable};
use plant::specimens::{YieldingSpecimen, YieldingState};
use units::constants::SAMPLING_PERIOD;

const STEPS: u32 = 5_000;

fn main() {
    let (table, specimen) = (ServoHydraulicTable::default(), YieldingSpecimen::default());
    let mut factors: Vec<f64> = (0..15)
        .map(|_| {
            let (mut s, mut d) = (table.rest(), YieldingState::default());
            let start = Instant::now();
            for k in 0..STEPS {
                let t = SAMPLING_PERIOD * f64::from(k);
                let input = ServoHydraulicInput {
                    valve_command: (20.0 * t).sin() + (45.0 * t).cos(),
                    specimen_force: specimen.force(&d),
                    supply_lost: false,
                };
                let acceleration = table.acceleration(&s, input.specimen_force);
                s = table.advance(&s, &input, SAMPLING_PERIOD);
                d = specimen.advance(&d, acceleration, SAMPLING_PERIOD);
            }
            black_box((s, d));
            SAMPLING_PERIOD * f64::from(STEPS) / start.elapsed().as_secs_f64()
        })
        .collect();
    factors.sort_by(f64::total_cmp);
    println!(
        "physical rig with yielding specimen: {:.0} times real time (median of {}, {:.0} to {:.0})",
        factors[factors.len() / 2],
        factors.len(),
        factors[0],
        factors[factors.len() - 1]
    );
}
