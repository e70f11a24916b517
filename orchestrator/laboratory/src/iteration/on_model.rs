//! The drive with which a rig follows a motion, computed on its model. The model with all nonlinear
//! effects plays the motion, and the inverse of its linear part converts the remaining error to a
//! correction.

use identification::diagnosis::case::ControlLaw;
use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState, SampledRig};
use serde::{Deserialize, Serialize};

use super::correction::{Inverse, Measured};
use crate::error::Error;
use motion::Motion;
use motion::metrics::{self, Tracking};

/// Runge-Kutta steps a sample, and of a rig with an effect that needs finer ones.
const SUBSTEPS: [usize; 2] = [4, 8];
/// Height (m) and width (s) of the pulse that the linear part answers, and how long it is left to come to
/// rest (s).
const PULSE: f64 = 1e-4;
const PULSE_WIDTH: f64 = 0.008;
const PULSE_REST: f64 = 40.0;
/// Displacement counts below, acceleration above, Hz: nothing that a model shows is noisy.
const CROSSOVER: f64 = 0.5;
/// A correction that brings less than this share is none.
const STALLED: f64 = 0.99;
/// How often a correction is halved before it is given up.
const SETBACKS: usize = 4;

/// A rig as a model has it, under the law of its laboratory.
#[derive(Debug, Clone, Copy)]
pub struct ModelledRig {
    rig: SampledRig,
    /// Without what is not linear about rest.
    linear: SampledRig,
    law: ControlLaw,
    period: f64,
}

/// What a modelled rig does.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// The table's true motion, which its sensors need not show.
    pub table: Measured,
    /// Largest command, V.
    pub peak_command: f64,
}

/// A drive with the response of a model.
#[derive(Debug, Clone)]
pub struct FoundDrive {
    /// The drive; only its displacement counts for a law of this form.
    pub drive: Motion,
    /// How the model follows the motion with it.
    pub tracking: Tracking,
    /// Largest command on the model, V.
    pub peak_command: f64,
    /// RMS acceleration errors, %, of the motion itself as drive and after each correction that helped.
    pub errors: Vec<f64>,
}

/// How to look for a drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Search {
    /// Largest number of corrections.
    pub corrections: usize,
    /// Frequencies between which errors are corrected, Hz.
    pub band: [f64; 2],
}

impl Default for Search {
    fn default() -> Self {
        Self {
            corrections: 20,
            band: [0.1, 30.0],
        }
    }
}

impl ModelledRig {
    /// `rig` under `law`, sampled every `period` s.
    ///
    /// # Errors
    /// A rig that cannot be simulated.
    pub fn new(rig: &IdentifiedRig, law: &ControlLaw, period: f64) -> Result<Self, ModelError> {
        Ok(Self {
            rig: rig.sample(period, SUBSTEPS[usize::from(rig.is_fast())])?,
            linear: rig.linear_part().sample(period, SUBSTEPS[0])?,
            law: *law,
            period,
        })
    }

    /// What the rig does when its law is given `drive` (m), from rest, without noise.
    #[must_use]
    pub fn follow(&self, drive: &[f64]) -> Followed {
        let mut state = IdentifiedRigState::default();
        let mut law = self.law.start(self.period);
        let (mut displacement, mut acceleration) = (Vec::new(), Vec::new());
        let mut peak_command = 0.0f64;
        for k in 0..drive.len() {
            let [x, a, ..] = self.rig.measure(&mut state, self.period * k as f64);
            let motion = self.rig.motion(&state);
            displacement.push(motion.displacement);
            acceleration.push(motion.acceleration);
            let command = law.command(drive, k, x, a);
            peak_command = peak_command.max(command.abs());
            self.rig.step(&mut state, command);
        }
        Followed {
            table: Measured {
                displacement,
                acceleration,
            },
            peak_command,
        }
    }

    /// How the rig follows `wanted` when its law is given `drive`.
    ///
    /// # Errors
    /// A rig that runs away.
    pub fn tracking(&self, wanted: &Motion, drive: &Motion) -> Result<(Tracking, Followed), Error> {
        let followed = self.follow(&drive.displacement);
        let table = &followed.table;
        let tracking = metrics::tracking(wanted, &table.displacement, &table.acceleration)
            .map_err(|error| not_followed(&error.to_string()))?;
        Ok((tracking, followed))
    }

    /// The drive with which this rig follows `wanted`: the motion itself, corrected by the inverse of
    /// the model's linear part, until a correction brings nothing.
    ///
    /// # Errors
    /// A model that runs away under the motion itself.
    pub fn drive(&self, wanted: &Motion, search: &Search) -> Result<FoundDrive, Error> {
        let inverse = self.inverse(search.band);
        let mut drive = wanted.clone();
        let (mut tracking, mut followed) = self.tracking(wanted, &drive)?;
        let mut errors = vec![tracking.time_domain_percent];
        let (mut gain, mut setbacks) = (1.0, 0);
        for _ in 0..search.corrections {
            let error = inverse.error(wanted, &followed.table);
            let mut corrected = drive.clone();
            inverse.correct(&mut corrected, &error, gain);
            // What runs away is no better.
            let better = self.tracking(wanted, &corrected).ok().filter(|(after, _)| {
                after.time_domain_percent < STALLED * tracking.time_domain_percent
            });
            if let Some(better) = better {
                drive = corrected;
                (tracking, followed) = better;
                errors.push(tracking.time_domain_percent);
                continue;
            }
            setbacks += 1;
            if setbacks == SETBACKS {
                break;
            }
            gain *= 0.5;
        }
        Ok(FoundDrive {
            drive,
            tracking,
            peak_command: followed.peak_command,
            errors,
        })
    }

    /// The inverse of the rig's linear part under its law, from its answer to a pulse.
    fn inverse(&self, band: [f64; 2]) -> Inverse {
        let samples = (PULSE_REST / self.period) as usize;
        let at = |k: usize| (k as f64 * self.period - 8.0 * PULSE_WIDTH) / PULSE_WIDTH;
        let bell = |k: usize| PULSE * (-0.5 * at(k).powi(2)).exp();
        let pulse = Motion {
            name: "pulse".into(),
            dt: self.period,
            displacement: (0..samples).map(bell).collect(),
            velocity: (0..samples)
                .map(|k| -at(k) * bell(k) / PULSE_WIDTH)
                .collect(),
            acceleration: (0..samples)
                .map(|k| (at(k).powi(2) - 1.0) * bell(k) / PULSE_WIDTH.powi(2))
                .collect(),
            notes: Vec::new(),
            seed: None,
            across: None,
        };
        let linear = Self {
            rig: self.linear,
            ..*self
        };
        let answer = linear.follow(&pulse.displacement).table;
        Inverse::exact(&pulse, &answer, CROSSOVER, band)
    }
}

fn not_followed(reason: &str) -> Error {
    Error::Option {
        option: "--model",
        reason: format!("the model does not follow the motion under the case's law: {reason}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 0.002;
    const BAND: [f64; 2] = [0.1, 30.0];

    /// A rig with so much dry friction (N) under displacement control.
    fn rig(friction: f64) -> ModelledRig {
        let law = ControlLaw {
            proportional: 118.0,
            integral: 0.0,
            velocity_feedforward: 0.0,
            acceleration_feedforward: 0.0,
            velocity_feedback: 0.0,
            acceleration_feedback: 0.0,
            velocity_filter: 0.5,
            limit: 10.0,
        };
        let mut rig = IdentifiedRig::default();
        rig.effects.friction.coulomb_force = friction;
        ModelledRig::new(&rig, &law, PERIOD).unwrap()
    }

    #[test]
    fn a_linear_rig_follows_after_one_correction_and_its_inverse_is_that_of_its_linear_part() {
        let wanted = motion::built_in(3, &motion::Options::default()).unwrap();
        let search = Search {
            corrections: 1,
            band: BAND,
        };
        let (smooth, rough) = (rig(0.0), rig(40.0));
        let found = smooth.drive(&wanted, &search).unwrap();
        assert_eq!(found.errors.len(), 2);
        assert!(
            found.errors[1] < 0.15 * found.errors[0],
            "{:?}",
            found.errors
        );
        assert_eq!(found.errors[1], found.tracking.time_domain_percent);
        let again = smooth.follow(&found.drive.displacement);
        assert_eq!(again.peak_command, found.peak_command);
        // What friction does is not part of it.
        assert!(rough.follow(&wanted.displacement) != smooth.follow(&wanted.displacement));
        let corrected = |own: &ModelledRig| {
            let mut drive = wanted.clone();
            own.inverse(BAND)
                .correct(&mut drive, &wanted.acceleration, 1.0);
            drive.displacement
        };
        let (one, other) = (corrected(&smooth), corrected(&rough));
        let off = one
            .iter()
            .zip(&other)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-9, "{off} m");
    }
}
