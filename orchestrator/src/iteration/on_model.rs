//! The drive with which a rig follows a motion, found on a model of it: the model, nonlinear effects and
//! all, is played along the motion, linearised there, and what is left of the error taken off.

use identification::diagnosis::case::ControlLaw;
use plant::ModelError;
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState, SampledRig};
use serde::{Deserialize, Serialize};

use super::correction::{Inverse, Measured};
use crate::error::Error;
use crate::metrics::{self, Tracking, rms};
use crate::motion::{self, Motion, Scaling, peak};

/// Runge-Kutta steps a sample, and of a rig with an effect that needs finer ones.
const SUBSTEPS: [usize; 2] = [4, 8];
/// Seed of the small motion that linearises the model.
const PROBE_SEED: u64 = 17;
/// Its peak acceleration over that of the motion: small beside it, large beside a dead band's edge.
const PROBE_SHARE: f64 = 0.1;
/// Displacement counts below, acceleration above, Hz: nothing that a model shows is noisy.
const CROSSOVER: f64 = 0.5;
/// A correction that brings less than this share is none.
const STALLED: f64 = 0.99;
/// How often the model is linearised again and the correction halved before it is given up.
const SETBACKS: usize = 4;

/// A rig as a model has it, under the law of its laboratory.
#[derive(Debug, Clone, Copy)]
pub struct ModelledRig {
    rig: SampledRig,
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

/// A drive with what it makes of a model.
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
    /// Most corrections.
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
    pub fn tracking(&self, wanted: &Motion, drive: &Motion) -> Result<(Tracking, f64), Error> {
        let followed = self.follow(&drive.displacement);
        let table = &followed.table;
        let tracking = metrics::tracking(wanted, &table.displacement, &table.acceleration)
            .map_err(|error| not_followed(&error.to_string()))?;
        Ok((tracking, followed.peak_command))
    }

    /// The drive with which this rig follows `wanted`: the motion itself, corrected by the inverse of
    /// the model linearised along the drive so far, until a correction brings nothing.
    ///
    /// # Errors
    /// A model that runs away under the motion itself.
    pub fn drive(&self, wanted: &Motion, search: &Search) -> Result<FoundDrive, Error> {
        let mut drive = wanted.clone();
        let (mut tracking, mut peak_command) = self.tracking(wanted, &drive)?;
        let mut errors = vec![tracking.time_domain_percent];
        let mut table = self.follow(&drive.displacement).table;
        let (mut gain, mut setbacks, mut inverse) = (1.0, 0, None);
        for _ in 0..search.corrections {
            let linear = match &inverse {
                Some(linear) => linear,
                None => inverse.insert(self.linearised(&drive, search.band)?),
            };
            let error = linear.error(wanted, &table);
            let mut corrected = drive.clone();
            linear.correct(&mut corrected, &error, gain);
            let after = self.follow(&corrected.displacement);
            let left = rms(&linear.error(wanted, &after.table));
            if left.is_finite() && left < STALLED * rms(&error) {
                (drive, table) = (corrected, after.table);
                (tracking, peak_command) = self.tracking(wanted, &drive)?;
                errors.push(tracking.time_domain_percent);
                continue;
            }
            setbacks += 1;
            if setbacks == SETBACKS {
                break;
            }
            gain *= 0.5;
            inverse = None;
        }
        Ok(FoundDrive {
            drive,
            tracking,
            peak_command,
            errors,
        })
    }

    /// The transfer function from drive to table for small changes of `drive`.
    fn linearised(&self, drive: &Motion, band: [f64; 2]) -> Result<Inverse, Error> {
        let share = PROBE_SHARE * peak(&drive.acceleration);
        let options = motion::Options {
            sample_time: self.period,
            scaling: Some(Scaling::PeakAcceleration(share)),
            ..motion::Options::default()
        };
        let probe = motion::built_in(PROBE_SEED, &options)?;
        let samples = drive.len().max(probe.len());
        let mut along = drive.displacement.clone();
        along.resize(samples, 0.0);
        let beside: Vec<f64> = along
            .iter()
            .enumerate()
            .map(|(k, x)| x + probe.displacement.get(k).copied().unwrap_or(0.0))
            .collect();
        let (without, with) = (self.follow(&along).table, self.follow(&beside).table);
        let less = |with: &[f64], without: &[f64]| -> Vec<f64> {
            let both = with.iter().zip(without).take(probe.len());
            both.map(|(with, without)| with - without).collect()
        };
        let answer = Measured {
            displacement: less(&with.displacement, &without.displacement),
            acceleration: less(&with.acceleration, &without.acceleration),
        };
        Inverse::new(&probe, &answer, CROSSOVER, band)
            .filter(|inverse| inverse.coherence().is_finite())
            .ok_or_else(|| not_followed("its answer to a small motion is not finite"))
    }
}

fn not_followed(reason: &str) -> Error {
    Error::Option {
        option: "--model",
        reason: format!("the model does not follow the motion under the case's law: {reason}"),
    }
}
