//! What a client asks for.

use std::fmt;

use super::ProtocolError;

/// A matrix of the element, sent row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Matrix {
    /// Stiffness at the beginning.
    InitialStiffness,
    /// Stiffness now.
    TangentStiffness,
    /// Damping.
    Damping,
    /// Mass.
    Mass,
}

impl fmt::Display for Matrix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::InitialStiffness => "initial stiffness",
            Self::TangentStiffness => "tangent stiffness",
            Self::Damping => "damping",
            Self::Mass => "mass",
        })
    }
}

/// The first entry of a client's vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Begin: open.
    Open,
    /// Begin: set up.
    SetUp,
    /// A trial follows.
    SetTrial,
    /// Carry the trial out.
    Execute,
    /// The last trial is the step's.
    Commit,
    /// Everything measured that the client wants.
    GetMeasured,
    /// The displacement.
    GetDisplacement,
    /// The velocity.
    GetVelocity,
    /// The acceleration.
    GetAcceleration,
    /// The force.
    GetForce,
    /// The time.
    GetTime,
    /// A matrix.
    GetMatrix(Matrix),
    /// The end.
    End,
}

impl Action {
    const ALL: [(u8, Self); 16] = [
        (1, Self::Open),
        (2, Self::SetUp),
        (3, Self::SetTrial),
        (4, Self::Execute),
        (5, Self::Commit),
        (6, Self::GetMeasured),
        (7, Self::GetDisplacement),
        (8, Self::GetVelocity),
        (9, Self::GetAcceleration),
        (10, Self::GetForce),
        (11, Self::GetTime),
        (12, Self::GetMatrix(Matrix::InitialStiffness)),
        (13, Self::GetMatrix(Matrix::TangentStiffness)),
        (14, Self::GetMatrix(Matrix::Damping)),
        (15, Self::GetMatrix(Matrix::Mass)),
        (99, Self::End),
    ];

    /// The action of a vector's first entry.
    ///
    /// # Errors
    /// No action has that number.
    pub fn numbered(number: f64) -> Result<Self, ProtocolError> {
        let known = Self::ALL.iter().find(|(own, _)| f64::from(*own) == number);
        known
            .map(|(_, action)| *action)
            .ok_or(ProtocolError::Action(number))
    }

    /// The first entry of a vector with it.
    #[must_use]
    pub fn number(self) -> f64 {
        let known = Self::ALL.iter().find(|(_, action)| *action == self);
        known.map_or(f64::NAN, |(number, _)| f64::from(*number))
    }

    /// Whether a vector comes back.
    #[must_use]
    pub fn has_reply(self) -> bool {
        !matches!(
            self,
            Self::Open | Self::SetUp | Self::SetTrial | Self::Execute | Self::Commit | Self::End
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_actions_belong_together() {
        for (number, action) in Action::ALL {
            assert_eq!(Action::numbered(f64::from(number)), Ok(action));
            assert_eq!(action.number(), f64::from(number));
            assert_eq!(action.has_reply(), (6..=15).contains(&number));
        }
        for wrong in [0.0, 16.0, 98.0, 3.5, -3.0, f64::INFINITY] {
            assert_eq!(Action::numbered(wrong), Err(ProtocolError::Action(wrong)));
        }
        assert!(Action::numbered(f64::NAN).is_err());
    }
}
