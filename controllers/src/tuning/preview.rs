//! Feedback of preview control from a model of the rig, by a stated rule.

use units::constants::LBF;

use crate::ModelError;
use crate::preview::{Parameters, PreviewControl};

/// Weights of the command that are tried, 1/V: lighter, the feedback follows the sensors' noise.
const COMMAND_WEIGHTS: [f64; 5] = [6.0, 12.0, 24.0, 48.0, 96.0];
/// Largest step of the unknown force a sample that is tried, N.
const FORCE_STEP: f64 = 0.1 * LBF;
/// How often it may be halved.
const HALVINGS: usize = 8;

impl Parameters {
    /// The same with a feedback that keeps a gain margin of 6 dB either way and bears measurements one
    /// sample later than the model has it: of the steps of the unknown force, halved from 0.1 lbf on, the
    /// largest with which some weight of the command from 6 to 96 1/V does, and of those the lightest.
    ///
    /// # Errors
    /// What [`PreviewControl::new`] refuses; a model that no such feedback holds.
    pub fn tuned(self) -> Result<Self, ModelError> {
        let mut tried = self;
        tried.uncertainty.force_step = FORCE_STEP;
        for _ in 0..=HALVINGS {
            for weight in COMMAND_WEIGHTS {
                tried.command_weight = weight;
                let control = PreviewControl::new(tried)?;
                if control.feedback().is_robust(control.rig()) {
                    return Ok(tried);
                }
            }
            tried.uncertainty.force_step *= 0.5;
        }
        Err(ModelError::NoSolution {
            equation: "the rule for preview control's feedback",
            reason: "no weight of its command leaves a margin of 6 dB".into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_met_on_the_model_and_not_far_from_it() {
        for delay in 0..3 {
            let tuned = Parameters {
                delay,
                ..Parameters::default()
            }
            .tuned()
            .unwrap();
            let control = PreviewControl::new(tuned).unwrap();
            let holds = |gain, late| control.feedback().holds(control.rig(), gain, late);
            assert!(holds(0.5, delay) && holds(2.0, delay) && holds(1.0, delay + 1));
            let own = (tuned.command_weight, tuned.uncertainty.force_step);
            println!("{delay} samples late: {own:?}");
            // A loop that held whatever was done to it would be none.
            assert!(!holds(100.0, delay), "{delay}");
        }
    }
}
