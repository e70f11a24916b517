//! The ideal mode: any trial is answered from the state at the last commit.

use super::{
    Command, Element, ElementError, Interval, Measured, Path, Rig, RigError, Shape, Trial,
};
use crate::protocol::Matrix;

/// An element that takes every trial back.
pub struct Ideal<R> {
    rig: R,
    interval: Interval,
    shape: Shape,
    path: Path,
    matrices: Matrices,
    trial: Trial,
    /// What was measured at [`Ideal::answered`].
    measured: Measured,
    /// The trial that was answered last since the commit.
    answered: Option<Trial>,
    /// Time of the analysis at the last commit, s.
    since: Option<f64>,
    /// Whether any trial has come.
    begun: bool,
    step: usize,
    command: Command,
}

/// Matrices that are known, SI, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Matrices {
    /// N/m.
    pub stiffness: Option<Vec<f64>>,
    /// N.s/m.
    pub damping: Option<Vec<f64>>,
    /// kg.
    pub mass: Option<Vec<f64>>,
}

impl Matrices {
    pub(super) fn get(&self, matrix: Matrix) -> Option<&[f64]> {
        match matrix {
            Matrix::InitialStiffness | Matrix::TangentStiffness => self.stiffness.as_deref(),
            Matrix::Damping => self.damping.as_deref(),
            Matrix::Mass => self.mass.as_deref(),
        }
    }
}

impl<R: Rig> Ideal<R> {
    /// On a rig at rest, whose state is kept now.
    ///
    /// # Errors
    /// A rig that cannot save its state.
    pub fn new(
        mut rig: R,
        interval: Interval,
        shape: Shape,
        matrices: Matrices,
    ) -> Result<Self, RigError> {
        rig.save()?;
        let n = rig.degrees_of_freedom();
        let mut measured = Measured::zeros(n);
        rig.measure(&mut measured);
        Ok(Self {
            rig,
            interval,
            shape,
            path: Path::at_rest(n),
            matrices,
            trial: Trial {
                displacement: vec![0.0; n],
                ..Trial::default()
            },
            measured,
            answered: None,
            since: None,
            begun: false,
            step: 1,
            command: Command::default(),
        })
    }

    /// The rig.
    pub fn rig(&self) -> &R {
        &self.rig
    }

    /// The rig, when the client is done.
    pub fn into_rig(self) -> R {
        self.rig
    }

    fn answer(&mut self) -> Result<(), ElementError> {
        if self.answered.as_ref() == Some(&self.trial) {
            return Ok(());
        }
        let own = self.rig.step();
        let steps = self
            .interval
            .steps(self.step, &self.trial, self.since, own)?;
        self.rig.restore()?;
        if steps == 0 {
            self.path
                .command(self.shape, &self.trial, (1.0, 0.0), &mut self.command);
            self.rig.place(&self.command)?;
        }
        let length = steps as f64 * own;
        for step in 1..=steps {
            let at = step as f64 / steps as f64;
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
        self.rig.measure(&mut self.measured);
        self.answered = Some(self.trial.clone());
        Ok(())
    }
}

impl<R: Rig> Element for Ideal<R> {
    fn degrees_of_freedom(&self) -> usize {
        self.rig.degrees_of_freedom()
    }

    fn set_trial(&mut self, trial: &Trial) {
        if !self.begun {
            self.begun = true;
            self.since = Some(super::stepwise::beginning(trial));
        }
        self.trial.clone_from(trial);
    }

    fn measure(&mut self) -> Result<&Measured, ElementError> {
        self.answer()?;
        Ok(&self.measured)
    }

    fn commit(&mut self) -> Result<(), ElementError> {
        self.answer()?;
        self.rig.save()?;
        self.path.arrive(&self.command);
        self.answered = None;
        self.since = self.trial.time.or(self.since);
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
