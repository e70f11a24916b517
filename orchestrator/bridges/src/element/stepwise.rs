//! The rig mode: a rig moves once a step and takes nothing back.

use super::ideal::Matrices;
use super::{Command, Element, ElementError, Interval, Measured, Path, Rig, Shape, Trial};
use crate::protocol::Matrix;

/// When a rig moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moves {
    /// When the force at a new displacement is asked for, so many times a step: 1 for explicit
    /// integrators, as many as there are for a fixed number of iterations. Else at the commit.
    AtTrials {
        /// How often in a step.
        iterations: usize,
    },
    /// At the commit only; until then the force is that of the step before.
    AtCommit,
}

/// An element that moves forward only.
pub struct Stepwise<R> {
    rig: R,
    interval: Interval,
    shape: Shape,
    moves: Moves,
    path: Path,
    matrices: Matrices,
    trial: Trial,
    measured: Measured,
    /// Where the rig has been asked to be.
    moved: Vec<f64>,
    /// Moves in this step.
    count: usize,
    /// The rig's steps in this step of the analysis.
    spent: usize,
    /// Time of the analysis at the last commit, s.
    since: Option<f64>,
    begun: bool,
    step: usize,
    command: Command,
}

/// When the first step of the analysis begins, s: at the first trial, where that is at rest (it only
/// says where the model is), else at 0.
pub(super) fn beginning(first: &Trial) -> f64 {
    let rests = first.displacement.iter().all(|d| *d == 0.0);
    first.time.filter(|_| rests).unwrap_or(0.0)
}

impl<R: Rig> Stepwise<R> {
    /// On a rig at rest.
    pub fn new(rig: R, interval: Interval, shape: Shape, moves: Moves, matrices: Matrices) -> Self {
        let n = rig.degrees_of_freedom();
        let mut measured = Measured::zeros(n);
        rig.measure(&mut measured);
        Self {
            rig,
            interval,
            shape,
            moves,
            path: Path::at_rest(n),
            matrices,
            trial: Trial {
                displacement: vec![0.0; n],
                ..Trial::default()
            },
            measured,
            moved: vec![0.0; n],
            count: 0,
            spent: 0,
            since: None,
            begun: false,
            step: 1,
            command: Command::default(),
        }
    }

    /// The rig.
    pub fn rig(&self) -> &R {
        &self.rig
    }

    /// The rig, when the client is done.
    pub fn into_rig(self) -> R {
        self.rig
    }

    /// Where the trial differs from where the rig has been asked to be, if it does.
    fn change(&self) -> Option<(f64, f64)> {
        let pairs = self.moved.iter().zip(&self.trial.displacement);
        let mut pairs = pairs.map(|(moved, trial)| (*moved, *trial));
        pairs.find(|(moved, trial)| {
            (moved - trial).abs() > 1e-12 * moved.abs().max(trial.abs()).max(1e-9)
        })
    }

    /// Moves to the trial over the share of the interval that is its own, or to its end.
    fn go(&mut self, to_the_end: bool) -> Result<(), ElementError> {
        let own = self.rig.step();
        let steps = self
            .interval
            .steps(self.step, &self.trial, self.since, own)?;
        if steps == 0
            && let Some((_, trial_m)) = self.change()
        {
            let time = match self.trial.time {
                Some(time) => format!("the time {time} s, at which the last step ended"),
                None => "no time".to_string(),
            };
            return Err(ElementError::NoTime {
                step: self.step,
                trial_m,
                time,
            });
        }
        let parts = match self.moves {
            Moves::AtTrials { iterations } if !to_the_end => iterations.max(1),
            _ => 1,
        };
        let end = match parts {
            1 => steps,
            parts => steps * (self.count + 1) / parts,
        };
        let part = end.saturating_sub(self.spent);
        let length = part as f64 * own;
        for step in 1..=part {
            let at = step as f64 / part as f64;
            let step = (at, length);
            self.path
                .command(self.shape, &self.trial, step, &mut self.command);
            self.rig.advance(&self.command)?;
        }
        if let Shape::Hold { settle } = self.shape {
            self.command.velocity.fill(0.0);
            for _ in 0..(settle / own).round() as usize {
                self.rig.advance(&self.command)?;
            }
        }
        if part > 0 {
            self.path.arrive(&self.command);
        }
        self.spent += part;
        self.count += 1;
        self.moved.clone_from(&self.trial.displacement);
        self.rig.measure(&mut self.measured);
        Ok(())
    }
}

impl<R: Rig> Element for Stepwise<R> {
    fn degrees_of_freedom(&self) -> usize {
        self.rig.degrees_of_freedom()
    }

    fn set_trial(&mut self, trial: &Trial) {
        if !self.begun {
            self.begun = true;
            self.since = Some(beginning(trial));
        }
        self.trial.clone_from(trial);
    }

    fn measure(&mut self) -> Result<&Measured, ElementError> {
        let Moves::AtTrials { iterations } = self.moves else {
            return Ok(&self.measured);
        };
        // A trial where the rig is already: the force is known.
        if let Some((moved_m, trial_m)) = self.change() {
            if self.count >= iterations {
                return Err(ElementError::Iterates {
                    step: self.step,
                    moved_m,
                    trial_m,
                });
            }
            self.go(false)?;
        }
        Ok(&self.measured)
    }

    fn commit(&mut self) -> Result<(), ElementError> {
        if let (Some((moved_m, trial_m)), Moves::AtTrials { iterations }) =
            (self.change(), self.moves)
            && self.count >= iterations
            && iterations == 1
        {
            return Err(ElementError::Iterates {
                step: self.step,
                moved_m,
                trial_m,
            });
        }
        // What is left of the interval passes in any case.
        self.go(true)?;
        self.since = self.trial.time.or(self.since);
        self.count = 0;
        self.spent = 0;
        self.step += 1;
        Ok(())
    }

    fn last(&self) -> &Measured {
        &self.measured
    }

    fn matrix(&self, matrix: Matrix) -> Option<&[f64]> {
        self.matrices.get(matrix)
    }
}
