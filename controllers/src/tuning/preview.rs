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
/// Largest step of the unknown force a sample that is tried, N, and over the Coulomb force where that is more: what is
/// not known of friction grows with it.
const FORCE_STEP: f64 = 0.1 * LBF;
const FRICTION_SHARE: f64 = 1.0 / 30.0;
/// How often it may be halved.
const HALVINGS: usize = 8;
/// How often it may be doubled behind a compensated valve: what the inverse of a curve leaves at the valve is a force that
/// changes quickly.
const DOUBLINGS: usize = 3;

/// Gain margin that is kept, and the least one under an identified specimen.
const MARGIN: f64 = 2.0;
const LEAST_MARGIN: f64 = 1.41;

/// Stiffness that a specimen may have, over that which is known: a fifth either way.
const STIFFNESSES: [f64; 3] = [0.8, 1.0, 1.25];

/// What is known of a rig beside its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Known {
    /// Its specimen was identified together with it.
    pub identified_specimen: bool,
    /// Its valve is not an ideal one, and the inverse of its curve is applied to the command.
    pub compensated_valve: bool,
}

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
    /// off either way: of the steps of the unknown force, halved from 0.1 lbf or a thirtieth of the Coulomb force on, the
    /// largest with which some weight of the command from 6 to 96 1/V does, and of those the lightest.
    ///
    /// # Errors
    /// What [`Parameters::validate`] and [`Feedback::new`] refuse; a model that no such feedback holds.
    pub fn tuned(self) -> Result<Self, ModelError> {
        self.tuned_for(Known::default())
    }

    /// As [`Self::tuned`] for a rig of which more is known. Of an identified specimen: where no feedback keeps 6 dB, one
    /// that keeps 3 dB will do, as for the other controllers on an identified rig, whose gain is known to some percent.
    /// Behind a compensated valve: the step of the unknown force is up to eight times as large if a weight of 6 1/V
    /// keeps the margin with it.
    ///
    /// # Errors
    /// As [`Self::tuned`].
    pub fn tuned_for(self, known: Known) -> Result<Self, ModelError> {
        let tuned = self.holding(MARGIN, known.compensated_valve);
        if known.identified_specimen {
            return tuned.or_else(|_| self.holding(LEAST_MARGIN, known.compensated_valve));
        }
        tuned
    }

    /// The same with a feedback that keeps a gain margin, as a factor.
    fn holding(self, margin: f64, quick: bool) -> Result<Self, ModelError> {
        self.validate()?;
        let rig = self.rig.sample(self.period);
        let plants = self.plants(&rig);
        let weights = self.feedback_weights.into();
        let usual = FORCE_STEP.max(FRICTION_SHARE * self.load.friction);
        let doublings = if quick { DOUBLINGS } else { 0 };
        let quicker = (1..=doublings).rev();
        let quicker = quicker.map(|n| (2f64.powi(n as i32), &COMMAND_WEIGHTS[..1]));
        let slower = (0..=HALVINGS).map(|n| (0.5f64.powi(n as i32), &COMMAND_WEIGHTS[..]));
        let mut tried = self;
        for (factor, lightest) in quicker.chain(slower) {
            tried.uncertainty.force_step = factor * usual;
            for weight in lightest {
                tried.command_weight = *weight;
                let feedback =
                    Feedback::new(&rig, &weights, *weight, &tried.uncertainty, tried.delay)?;
                if plants
                    .iter()
                    .all(|plant| feedback.is_robust(&rig, plant, margin))
                {
                    return Ok(tried);
                }
            }
        }
        Err(ModelError::NoSolution {
            equation: "the rule for preview control's feedback",
            reason: format!(
                "no weight of its command keeps a margin of {:.0} dB, bare and with the specimen",
                20.0 * margin.log10()
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::PreviewControl;
    use crate::preview::model::Hydraulics;
    use nalgebra::DMatrix;
    use plant::identified::coupled::Rig;
    use plant::linear::StateSpace;

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

    /// A heavy specimen of 5.8 Hz leaves no feedback 6 dB, but 3 dB; a heavier one leaves none.
    #[test]
    fn an_identified_specimen_is_held_with_three_decibels_where_none_has_six() {
        let heavy = |mass: f64, hertz: f64| {
            let omega = std::f64::consts::TAU * hertz;
            LinearSpecimen {
                mass,
                damping: 0.06 * omega * mass,
                stiffness: omega * omega * mass,
            }
        };
        let mut known = Parameters {
            delay: 3,
            ..Parameters::default()
        };
        known.rig.hydraulics = Some(Hydraulics::default());
        known.load.specimen = Some(heavy(21.0, 5.0).into());
        let identified = Known {
            identified_specimen: true,
            ..Known::default()
        };
        assert!(known.tuned_for(identified).is_err());
        let specimen = heavy(14.0, 5.8);
        known.load.specimen = Some(specimen.into());
        assert!(known.tuned().is_err());
        let own = known.tuned_for(identified).unwrap();
        // The monolithic equations of table, valve and specimen, not those of the rule.
        let control = PreviewControl::new(own).unwrap();
        let (a, b) = monolithic(&own, &specimen);
        let outputs = DMatrix::from_fn(3, a.ncols(), |i, j| match i {
            0 => f64::from(u8::from(j == 3)),
            1 => f64::from(u8::from(j == 4)),
            _ => a[(4, j)],
        });
        let d = DMatrix::zeros(3, 1);
        let plant = StateSpace {
            a,
            b,
            c: outputs,
            d,
        };
        let plant = plant.sample(own.period);
        let slowest = |gain, late| {
            let feedback = control.feedback();
            feedback.slowest_pole(control.rig(), &plant, gain, late)
        };
        for (gain, late) in [(0.71, 3), (1.0, 3), (1.41, 3), (1.0, 4)] {
            let slowest = slowest(gain, late);
            assert!(slowest < 1.0, "{gain} {late}: {slowest}");
        }
        assert!(slowest(4.0, 3) > 1.0);
    }

    /// Spool, its rate, force of the oil, displacement, velocity of the table, displacement and velocity of the
    /// specimen, absolute.
    fn monolithic(own: &Parameters, specimen: &LinearSpecimen) -> (DMatrix<f64>, DMatrix<f64>) {
        let (oil, table) = (own.rig.hydraulics.unwrap(), own.rig.shake_table.table);
        let (k, c) = (specimen.stiffness, specimen.damping);
        let (m, s) = (table.mass, specimen.mass);
        let rows = [
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [
                -1.0 / oil.spool_inertia,
                -oil.spool_lag / oil.spool_inertia,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            ],
            [
                oil.force_rate,
                0.0,
                -oil.leakage_rate,
                0.0,
                -oil.oil_stiffness,
                0.0,
                0.0,
            ],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [
                0.0,
                0.0,
                1.0 / m,
                -(table.stiffness + k) / m,
                -(table.damping + oil.seal_damping + c) / m,
                k / m,
                c / m,
            ],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, k / s, c / s, -k / s, -c / s],
        ];
        let mut b = DMatrix::zeros(7, 1);
        b[(1, 0)] = 1.0 / oil.spool_inertia;
        (DMatrix::from_fn(7, 7, |i, j| rows[i][j]), b)
    }

    #[test]
    fn a_thirtieth_of_much_friction_is_the_step_of_the_unknown_force() {
        let step = |friction: f64| {
            let mut own = Parameters::default();
            own.load.friction = friction;
            own.rig.hydraulics = Some(Hydraulics::default());
            own.tuned().unwrap().uncertainty.force_step
        };
        assert_eq!(step(13.0), FORCE_STEP);
        assert!((step(40.0) - 40.0 / 30.0).abs() < 1e-12);
    }

    /// Behind a compensated valve the estimate is quicker, and the margins are those of the rule.
    #[test]
    fn the_unknown_force_is_quicker_behind_a_compensated_valve() {
        let mut own = Parameters {
            delay: 2,
            ..Parameters::default()
        };
        own.load.friction = 13.0;
        own.rig.hydraulics = Some(Hydraulics::default());
        let known = Known {
            compensated_valve: true,
            ..Known::default()
        };
        let quick = own.tuned_for(known).unwrap();
        assert!(quick.uncertainty.force_step >= 2.0 * FORCE_STEP);
        assert_eq!(quick.command_weight, COMMAND_WEIGHTS[0]);
        let control = PreviewControl::new(quick).unwrap();
        let plant = control.rig().driven(quick.period);
        for (gain, late) in [(0.5, 2), (1.0, 2), (2.0, 2), (1.0, 3)] {
            let feedback = control.feedback();
            let slowest = feedback.slowest_pole(control.rig(), &plant, gain, late);
            assert!(slowest < 1.0, "{gain} {late}: {slowest}");
        }
        // Under a specimen that leaves no room the rule is that of the ideal valve.
        let specimen = LinearSpecimen::appendix_a();
        own.load.specimen = Some(specimen.into());
        let (held, quick) = (own.tuned().unwrap(), own.tuned_for(known).unwrap());
        assert!(quick.uncertainty.force_step >= held.uncertainty.force_step);
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
