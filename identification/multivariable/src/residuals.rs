//! What a model with faults leaves of the recordings, over their noise.

use crate::description::Pins;
use crate::fault::played;
use crate::identify::without_free_motion;
use crate::recording::Joint;
use crate::{Fault, Model, Recording};

/// Recordings of a rig beside the model of its healthy state.
pub(crate) struct Case<'a> {
    pub(crate) model: &'a Model,
    pub(crate) pins: &'a Pins,
    pub(crate) recordings: &'a [Recording],
    /// Noise of each channel, m.
    pub(crate) noise: Vec<f64>,
}

/// Faults with their parameters.
pub(crate) type Faults = Vec<(Fault, f64)>;

impl Case<'_> {
    pub(crate) fn has_joint(&self) -> bool {
        !self.pins.is_empty() && self.recordings.iter().all(|own| own.joint.is_some())
    }

    pub(crate) fn channels(&self) -> Vec<String> {
        let n = self.model.actuators();
        let strokes = (1..=n).map(|i| format!("stroke {i}"));
        let joint = (1..=n)
            .filter(|_| self.has_joint())
            .map(|i| format!("stroke {i} against the joint"));
        strokes.chain(joint).collect()
    }

    /// Noise of each channel, m: the model's residual, and what changes from sample to sample of the joint's.
    pub(crate) fn noise(&self) -> Vec<f64> {
        let mut noise: Vec<f64> = self
            .model
            .residual_m
            .iter()
            .map(|own| own.max(1e-12))
            .collect();
        if self.has_joint() {
            let mut square = vec![0.0; self.model.actuators()];
            for recording in self.recordings {
                for (square, own) in square
                    .iter_mut()
                    .zip(self.joint_residuals(recording, &Faults::new()))
                {
                    // Third differences leave nothing of a slow signal and 20 times the variance of white noise.
                    let third = own
                        .windows(4)
                        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2));
                    let mean = third.sum::<f64>() / own.len().max(4) as f64 / 20.0;
                    *square += mean / self.recordings.len() as f64;
                }
            }
            noise.extend(square.iter().map(|square| square.sqrt().max(1e-12)));
        }
        noise
    }

    fn stroke_residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let mut commands = recording.commands.clone();
        let mut model = self.model.clone();
        for (fault, value) in faults {
            match *fault {
                Fault::CommandsSwapped(a, b) => commands.swap(a, b),
                Fault::Delay(i) => model.delay_s[i] = (model.delay_s[i] + value).max(0.0),
                _ => {}
            }
        }
        for (fault, value) in faults {
            if let Fault::Gain(i) = *fault {
                commands[i].iter_mut().for_each(|u| *u *= 1.0 + value);
            }
        }
        let mut strokes = model.strokes(&commands, recording.period);
        for (fault, value) in faults {
            if let Fault::Play(i) = *fault {
                strokes[i] = played(&strokes[i], *value);
            }
        }
        for (fault, value) in faults {
            if let Fault::SensorGain(i) = *fault {
                strokes[i].iter_mut().for_each(|y| *y *= 1.0 + value);
            }
        }
        for (fault, _) in faults {
            if let Fault::SensorsSwapped(a, b) = *fault {
                strokes.swap(a, b);
            }
        }
        let both = recording.strokes.iter().zip(&strokes);
        both.map(|(measured, own)| without_free_motion(self.model, measured, own))
            .collect()
    }

    fn joint_residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let Some(Joint {
            translation,
            rotation,
        }) = &recording.joint
        else {
            return Vec::new();
        };
        let mut strokes = recording.strokes.clone();
        let mut pins = self.pins.clone();
        for (fault, value) in faults {
            match *fault {
                Fault::SensorsSwapped(a, b) => strokes.swap(a, b),
                Fault::Lever(i) => pins[i][1] += value,
                _ => {}
            }
        }
        for (fault, value) in faults {
            match *fault {
                Fault::SensorGain(i) => strokes[i].iter_mut().for_each(|y| *y /= 1.0 + value),
                Fault::PinPlay(i) => strokes[i] = played(&strokes[i], *value),
                _ => {}
            }
        }
        let of = |(stroke, [along, across]): (&Vec<f64>, &[f64; 2])| {
            let motion = translation.iter().zip(rotation);
            let mut left: Vec<f64> = motion
                .zip(stroke)
                .map(|((x, turn), y)| x + along * (turn.cos() - 1.0) - across * turn.sin() - y)
                .collect();
            let mean = left.iter().sum::<f64>() / left.len().max(1) as f64;
            left.iter_mut().for_each(|value| *value -= mean);
            left
        };
        strokes.iter().zip(&pins).map(of).collect()
    }

    pub(crate) fn residuals(&self, recording: &Recording, faults: &Faults) -> Vec<Vec<f64>> {
        let mut all = self.stroke_residuals(recording, faults);
        if self.has_joint() {
            all.extend(self.joint_residuals(recording, faults));
        }
        all
    }

    /// Mean square over noise, by channel.
    pub(crate) fn squares(&self, faults: &Faults) -> Vec<f64> {
        let mut sums = vec![0.0; self.noise.len()];
        let samples: usize = self.recordings.iter().map(Recording::len).sum();
        for recording in self.recordings {
            for ((sum, own), noise) in sums
                .iter_mut()
                .zip(self.residuals(recording, faults))
                .zip(&self.noise)
            {
                *sum +=
                    own.iter().map(|e| (e / noise).powi(2)).sum::<f64>() / samples.max(1) as f64;
            }
        }
        sums
    }

    pub(crate) fn total(&self, faults: &Faults) -> f64 {
        let sum: f64 = self.squares(faults).iter().sum();
        if sum.is_finite() { sum } else { f64::MAX }
    }
}
