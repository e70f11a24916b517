//! The rig as one model under the sampled controller: what a co-simulation is compared with.

use controllers::three_variable::{ThreeVariableControl, ThreeVariableInput};
use controllers::{Controller, Motion as Sample};
use motion::Motion;
use nalgebra::{DVector, dvector};
use plant::identified::coupled::Rig;
use plant::specimens::linear::LinearSpecimen;

/// Acceleration of the table (m/s²) at the samples of `motion` under three-variable control, from
/// the exact solution of table and specimen as one system with the valve command held.
pub fn table_acceleration(motion: &Motion, with_specimen: bool) -> Vec<f64> {
    table_acceleration_under(motion, with_specimen.then(LinearSpecimen::appendix_a))
}

/// As [`table_acceleration`], under any linear specimen.
pub fn table_acceleration_under(motion: &Motion, specimen: Option<LinearSpecimen>) -> Vec<f64> {
    let rig = Rig {
        specimen,
        ..Rig::default()
    };
    let system = rig.state_space().sample(motion.dt);
    let mut law = ThreeVariableControl::table_3_2();
    let mut state = DVector::zeros(7);
    (0..motion.len())
        .map(|k| {
            let output = &system.c * &state;
            let command = law.step(
                &ThreeVariableInput {
                    reference: Sample {
                        displacement: motion.displacement[k],
                        velocity: motion.velocity[k],
                        acceleration: motion.acceleration[k],
                    },
                    measured: Sample {
                        displacement: output[0],
                        velocity: output[1],
                        acceleration: output[2],
                    },
                },
                motion.dt,
            );
            state = system.advance(&state, &dvector![command]);
            output[2]
        })
        .collect()
}

/// Largest difference of two histories over the largest magnitude of the first.
pub fn worst_error(truth: &[f64], other: &[f64]) -> f64 {
    assert_eq!(truth.len(), other.len());
    let peak = truth
        .iter()
        .fold(0.0f64, |peak, value| peak.max(value.abs()));
    let pairs = truth.iter().zip(other);
    pairs.fold(0.0f64, |worst, (a, b)| worst.max((a - b).abs())) / peak
}
