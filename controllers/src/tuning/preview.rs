//! Feedback of preview control from a model of the rig, by a stated rule.

use units::constants::LBF;

use crate::ModelError;
use plant::linear::DiscreteStateSpace;
use plant::specimens::linear::LinearSpecimen;

use crate::preview::Parameters;
use crate::preview::feedback::Feedback;
use crate::preview::model::SampledRig;

/// Weights of the command that are tried, 1/V: lighter, the feedback follows the sensors' noise.
const COMMAND_WEIGHTS: [f64; 5] = [6.0, 12.0, 24.0, 48.0, 96.0];
/// Largest step of the unknown force a sample that is tried, N.
const FORCE_STEP: f64 = 0.1 * LBF;
/// How often it may be halved.
const HALVINGS: usize = 8;

/// Stiffness that a specimen may have, over that which is known: a fifth either way.
const STIFFNESSES: [f64; 3] = [0.8, 1.0, 1.25];

impl Parameters {
    /// What its feedback has to hold: the rig bare and, where a specimen is known, under it before it
    /// yields.
    fn plants(&self, rig: &SampledRig) -> Vec<DiscreteStateSpace> {
        let mut plants = vec![rig.driven(self.period)];
        plants.extend(self.load.specimen.iter().flat_map(|specimen| {
            STIFFNESSES.map(|factor| {
                let own = LinearSpecimen {
                    mass: specimen.mass,
                    damping: specimen.damping,
                    stiffness: factor * specimen.columns.stiffness(),
                };
                self.rig.under(&own, self.period)
            })
        }));
        plants
    }

    /// The same with a feedback that keeps a gain margin of 6 dB either way and bears measurements one
    /// sample later than the model has it, bare and under the specimen that is known, its stiffness a fifth
    /// off either way: of the steps of the unknown force, halved from 0.1 lbf on, the
    /// largest with which some weight of the command from 6 to 96 1/V does, and of those the lightest.
    ///
    /// # Errors
    /// What [`Parameters::validate`] and [`Feedback::new`] refuse; a model that no such feedback holds.
    pub fn tuned(self) -> Result<Self, ModelError> {
        self.validate()?;
        let rig = self.rig.sample(self.period);
        let plants = self.plants(&rig);
        let weights = self.feedback_weights.into();
        let mut tried = self;
        tried.uncertainty.force_step = FORCE_STEP;
        for _ in 0..=HALVINGS {
            for weight in COMMAND_WEIGHTS {
                tried.command_weight = weight;
                let feedback =
                    Feedback::new(&rig, &weights, weight, &tried.uncertainty, tried.delay)?;
                if plants.iter().all(|plant| feedback.is_robust(&rig, plant)) {
                    return Ok(tried);
                }
            }
            tried.uncertainty.force_step *= 0.5;
        }
        Err(ModelError::NoSolution {
            equation: "the rule for preview control's feedback",
            reason: "no weight of its command keeps a margin of 6 dB, bare and with the specimen"
                .into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::PreviewControl;
    use plant::identified::coupled::Rig;

    /// A specimen that the feedback's own model lacks takes its estimate of the unknown force for its
    /// own: quick estimates are unstable then, and the rule has to find slower ones.
    #[test]
    fn the_rule_holds_the_identified_rig_under_its_specimen() {
        let bare = Parameters::default().tuned().unwrap();
        let specimen = LinearSpecimen::appendix_a();
        let mut known = Parameters::default();
        known.load.specimen = Some(specimen.into());
        let loaded = known.tuned().unwrap();
        println!("{:?} {:?}", bare.uncertainty, loaded.uncertainty);
        // The monolithic model of table and specimen, not the one that the rule builds.
        let plant = Rig {
            specimen: Some(specimen),
            ..Rig::default()
        };
        let mut plant = plant.state_space();
        plant.c = plant.c.rows(0, 3).into_owned();
        plant.d = plant.d.rows(0, 3).into_owned();
        let plant = plant.sample(loaded.period);
        let slowest = |parameters: Parameters| {
            let control = PreviewControl::new(parameters).unwrap();
            control
                .feedback()
                .slowest_pole(control.rig(), &plant, 1.0, 0)
        };
        assert!(slowest(bare) > 1.0005, "{}", slowest(bare));
        assert!(slowest(loaded) < 1.0, "{}", slowest(loaded));
    }

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
            let plant = control.rig().driven(tuned.period);
            let holds = |gain, late| {
                let feedback = control.feedback();
                feedback.slowest_pole(control.rig(), &plant, gain, late) < 1.0
            };
            assert!(holds(0.5, delay) && holds(2.0, delay) && holds(1.0, delay + 1));
            let own = (tuned.command_weight, tuned.uncertainty.force_step);
            println!("{delay} samples late: {own:?}");
            // A loop that held whatever was done to it would be none.
            assert!(!holds(100.0, delay), "{delay}");
        }
    }
}
