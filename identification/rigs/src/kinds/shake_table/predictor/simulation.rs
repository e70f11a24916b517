//! The model as it goes on by itself where nothing was measured.

use plant::identified::rig::{IdentifiedRigState, SampledRig};

use super::{Predictor, STATES, dot};

impl Predictor {
    /// What the sensors of `rig` show, sample by sample, SI. What was `measured` (not a number where a
    /// cell is empty) corrects the model as in [`Self::innovations`]; `command` (V) makes the command
    /// that acts from sample `k` on of its number and the readings there, predicted ones where they
    /// were not measured.
    pub fn simulate(
        &self,
        rig: &SampledRig,
        measured: &[[f64; 4]],
        mut command: impl FnMut(usize, &[f64; 4]) -> f64,
    ) -> Vec<[f64; 4]> {
        let mut state = IdentifiedRigState::default();
        let mut coloured = vec![[0.0; 2]; self.followers.len()];
        let mut slow = [0.0; 4];
        let mut shown = Vec::with_capacity(measured.len());
        for (k, measured) in measured.iter().enumerate() {
            let mut predicted = rig.measure(&mut state, k as f64 * self.period);
            let mut innovation = [0.0; 4];
            let mut readings = *measured;
            for i in 0..4 {
                predicted[i] += slow[i];
                if measured[i].is_nan() {
                    readings[i] = predicted[i];
                } else {
                    innovation[i] = measured[i] - predicted[i];
                }
            }
            for (place, gain) in &self.gain {
                state.continuous[*place % STATES] += dot(gain, &innovation);
            }
            for (age, gain) in self.past_gain.iter().enumerate() {
                rig.correct_past(&mut state, age, dot(gain, &innovation));
            }
            let disturbance = self.follow(&mut coloured, &innovation, &mut slow);
            rig.step_disturbed(&mut state, command(k, &readings), disturbance);
            shown.push(predicted);
        }
        shown
    }
}
