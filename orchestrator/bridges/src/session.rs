//! One client from its sizes to its end.

use std::time::{Duration, Instant};

use thiserror::Error;

use crate::element::{Element, ElementError, Measured, Trial};
use crate::link::{Link, LinkError};
use crate::protocol::{Action, Matrix, ProtocolError, Quantities, Sizes};
use crate::round_trips::RoundTrips;
use crate::scale::Scale;

/// How long a client that is dismissed may be silent.
const PATIENCE: Duration = Duration::from_secs(2);
/// How long it is answered.
const FAREWELL: Duration = Duration::from_secs(10);

/// Why a client was sent away.
#[derive(Debug, Error)]
pub enum SessionError {
    /// It does not speak the protocol.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// It is gone or silent.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The element cannot answer.
    #[error(transparent)]
    Element(#[from] ElementError),
    /// A matrix that nobody has said.
    #[error(
        "the client asks for the {0} of the element, which is not known; give it in the client's \
         units, such as --stiffness 2.8"
    )]
    NoMatrix(Matrix),
}

/// A step that a client has committed.
#[derive(Debug, Clone, Copy)]
pub struct Step<'a> {
    /// From 1.
    pub number: usize,
    /// The trial that was committed, SI.
    pub trial: &'a Trial,
    /// What was measured, SI.
    pub measured: &'a Measured,
    /// Trials since the step before.
    pub trials: usize,
    /// From the last trial to the answer of its force.
    pub answer: Duration,
}

/// What came of a client.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Served {
    /// Steps committed.
    pub steps: usize,
    /// Trials.
    pub trials: usize,
    /// Vectors sent back.
    pub replies: usize,
    /// Messages that came.
    pub requests: usize,
    /// From a trial to the answer of its force.
    pub answers: RoundTrips,
    /// From an answer to the next request that has one: the client's time and the wire.
    pub pauses: RoundTrips,
    /// From the first message after the setup to the last.
    pub wall: Duration,
}

/// Receives the sizes and checks that they fit `element`.
pub(crate) fn set_up(link: &mut Link, degrees_of_freedom: usize) -> Result<Sizes, SessionError> {
    let mut bytes = [0; Sizes::BYTES];
    // What another protocol says first may be shorter than the sizes.
    if let Err(error) = link.receive(&mut bytes) {
        if matches!(error, LinkError::Silent { .. } | LinkError::Half { .. })
            && let Err(known @ (ProtocolError::Http | ProtocolError::Tls)) = Sizes::read(&bytes)
        {
            return Err(known.into());
        }
        return Err(error.into());
    }
    let sizes = Sizes::read(&bytes)?;
    check(&sizes.trial, degrees_of_freedom)?;
    check(&sizes.wanted, degrees_of_freedom)?;
    Ok(sizes)
}

/// All quantities that are there at all have as many components as the element.
fn check(quantities: &Quantities, expected: usize) -> Result<(), ProtocolError> {
    let moving = quantities
        .named()
        .into_iter()
        .filter(|(name, _)| *name != "time");
    for (quantity, given) in moving {
        if given != 0 && given != expected {
            return Err(ProtocolError::Components {
                quantity,
                given,
                expected,
            });
        }
    }
    Ok(())
}

/// A client that is served.
pub(crate) struct Session<'a> {
    pub link: Link,
    pub sizes: Sizes,
    pub scale: &'a Scale,
    pub element: &'a mut dyn Element,
    pub tell: &'a mut dyn FnMut(Step<'_>),
    /// Whether the client waits for an answer.
    pub is_asked: bool,
}

impl Session<'_> {
    /// Answers until the client says its end.
    ///
    /// # Errors
    /// Why it ended otherwise; `served` holds what came until then.
    pub(crate) fn run(&mut self, served: &mut Served) -> Result<(), SessionError> {
        let begun = Instant::now();
        let ended = self.converse(served);
        served.wall = begun.elapsed();
        if ended.is_err() {
            self.dismiss();
        }
        ended
    }

    /// Answers with what is not a number until the client gives up. OpenSees reads a connection that was
    /// closed again and again; a force that is not a number ends its analysis.
    fn dismiss(&mut self) {
        let begun = Instant::now();
        // The interrupt that ended the service does not end its farewell.
        self.link.heed(None);
        let mut message = vec![0; 8 * self.sizes.length];
        let nothing = vec![f64::NAN; self.sizes.length];
        if self.link.limit(PATIENCE).is_err() {
            return;
        }
        while begun.elapsed() < FAREWELL {
            if self.is_asked && self.reply(&nothing, &mut message).is_err() {
                return;
            }
            if self.link.receive(&mut message).is_err() {
                return;
            }
            let mut own = [0; 8];
            own.copy_from_slice(&message[..8]);
            match Action::numbered(f64::from_le_bytes(own)) {
                Ok(Action::End) | Err(_) => return,
                Ok(action) => self.is_asked = action.has_reply(),
            }
        }
    }

    fn converse(&mut self, served: &mut Served) -> Result<(), SessionError> {
        let length = self.sizes.length;
        let mut message = vec![0; 8 * length];
        let mut vector = vec![0.0; length];
        let mut trial = Trial::default();
        let mut trials = 0;
        let mut answer = Duration::ZERO;
        let mut set_at = Instant::now();
        let mut replied_at: Option<Instant> = None;
        // Of a laboratory's controller every command is a step; there are no commits.
        let mut commanded = false;
        loop {
            self.link.receive(&mut message)?;
            served.requests += 1;
            let now = Instant::now();
            for (value, eight) in vector.iter_mut().zip(message.chunks_exact(8)) {
                let mut own = [0; 8];
                own.copy_from_slice(eight);
                *value = f64::from_le_bytes(own);
            }
            let action = Action::numbered(vector[0])?;
            self.is_asked = action.has_reply();
            if self.is_asked
                && let Some(replied) = replied_at.take()
            {
                served.pauses.add(now - replied);
            }
            match action {
                Action::Open | Action::SetUp | Action::Execute => {}
                Action::SetTrial => {
                    self.read_trial(&vector, &mut trial)?;
                    self.element.set_trial(&trial);
                    served.trials += 1;
                    trials += 1;
                    set_at = now;
                    commanded = true;
                }
                Action::Commit => {
                    self.element.commit()?;
                    served.steps += 1;
                    self.note(served.steps, &trial, trials, answer);
                    trials = 0;
                    commanded = false;
                }
                Action::End => return Ok(()),
                Action::GetMatrix(matrix) => {
                    self.write_matrix(matrix, &mut vector)?;
                    self.reply(&vector, &mut message)?;
                    served.replies += 1;
                    replied_at = Some(Instant::now());
                }
                _ => {
                    let is_control = action == Action::GetMeasured;
                    self.element.measure()?;
                    if is_control && commanded {
                        self.element.commit()?;
                    }
                    self.write(action, &mut vector);
                    self.reply(&vector, &mut message)?;
                    let replied = Instant::now();
                    if trials > 0 && commanded {
                        answer = replied - set_at;
                        served.answers.add(answer);
                    }
                    served.replies += 1;
                    replied_at = Some(replied);
                    if is_control && commanded {
                        served.steps += 1;
                        self.note(served.steps, &trial, trials, answer);
                        trials = 0;
                    }
                    commanded &= !is_control;
                }
            }
        }
    }

    fn note(&mut self, number: usize, trial: &Trial, trials: usize, answer: Duration) {
        (self.tell)(Step {
            number,
            trial,
            measured: self.element.last(),
            trials,
            answer,
        });
    }

    fn read_trial(&self, vector: &[f64], trial: &mut Trial) -> Result<(), ProtocolError> {
        let sizes = &self.sizes.trial;
        let length = self.scale.length;
        let mut rest = &vector[1..];
        let mut take = |quantity, count: usize, factor: f64, into: &mut Vec<f64>| {
            let (own, others) = rest.split_at(count);
            rest = others;
            into.clear();
            for &value in own {
                if !value.is_finite() {
                    return Err(ProtocolError::NotFinite { quantity, value });
                }
                into.push(value * factor);
            }
            Ok(())
        };
        let (mut forces, mut times) = (Vec::new(), Vec::new());
        let n = sizes;
        take(
            "displacement",
            n.displacement,
            length,
            &mut trial.displacement,
        )?;
        take("velocity", n.velocity, length, &mut trial.velocity)?;
        take(
            "acceleration",
            n.acceleration,
            length,
            &mut trial.acceleration,
        )?;
        take("force", n.force, self.scale.force, &mut forces)?;
        take("time", n.time, 1.0, &mut times)?;
        trial.time = times.first().copied();
        Ok(())
    }

    /// Puts what `action` asks for into the vector, in the client's units.
    fn write(&self, action: Action, vector: &mut [f64]) {
        vector.fill(0.0);
        let measured = self.element.last();
        let (length, force) = (1.0 / self.scale.length, 1.0 / self.scale.force);
        let mut at = 0;
        let mut put = |values: &[f64], factor: f64| {
            for value in values {
                if let Some(place) = vector.get_mut(at) {
                    *place = value * factor;
                }
                at += 1;
            }
        };
        let wanted = &self.sizes.wanted;
        let every = action == Action::GetMeasured;
        if action == Action::GetDisplacement || every && wanted.displacement > 0 {
            put(&measured.displacement, length);
        }
        if action == Action::GetVelocity || every && wanted.velocity > 0 {
            put(&measured.velocity, length);
        }
        if action == Action::GetAcceleration || every && wanted.acceleration > 0 {
            put(&measured.acceleration, length);
        }
        if action == Action::GetForce || every && wanted.force > 0 {
            put(&measured.force, force);
        }
        if action == Action::GetTime || every && wanted.time > 0 {
            put(&[measured.time], 1.0);
        }
    }

    fn write_matrix(&self, matrix: Matrix, vector: &mut [f64]) -> Result<(), SessionError> {
        let n = self.element.degrees_of_freedom();
        let entries = n * n;
        vector.fill(0.0);
        let Some(places) = vector.get_mut(..entries) else {
            return Err(ProtocolError::MatrixSize {
                entries,
                length: self.sizes.length,
            }
            .into());
        };
        match self.element.matrix(matrix) {
            Some(known) => {
                let factor = 1.0 / self.scale.stiffness();
                for (place, value) in places.iter_mut().zip(known) {
                    *place = value * factor;
                }
            }
            // Whatever damping and inertia the specimen has is in the force that is measured.
            None if matches!(matrix, Matrix::Damping | Matrix::Mass) => {}
            None => return Err(SessionError::NoMatrix(matrix)),
        }
        Ok(())
    }

    fn reply(&mut self, vector: &[f64], message: &mut [u8]) -> Result<(), LinkError> {
        for (eight, value) in message.chunks_exact_mut(8).zip(vector) {
            eight.copy_from_slice(&value.to_le_bytes());
        }
        self.link.send(message)?;
        self.is_asked = false;
        Ok(())
    }
}
