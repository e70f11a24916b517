//! What the two methods have in common: where a step begins and what comes of it.

use super::explicit::Slopes;
use super::implicit::Collocation;

/// Where a step begins.
pub(super) struct Start<'a> {
    /// s.
    pub time: f64,
    pub states: &'a [f64],
    /// Their derivatives there.
    pub slope: &'a [f64],
}

/// What came of trying a step.
// Moved once per step; a box would allocate in each.
#[allow(clippy::large_enum_variant)]
pub(super) enum Trial {
    Taken(Taken),
    /// Too large; one of this size may do.
    Refused(f64),
}

/// A step that is accurate enough.
pub(super) struct Taken {
    /// The states at its end.
    pub next: Vec<f64>,
    /// Their derivatives, where they are known already.
    pub slope: Option<Vec<f64>>,
    /// Size for the next step, s.
    pub proposed: f64,
    /// Whether the other method would do better.
    pub is_limited: bool,
    pub way: Way,
}

/// The states within a step.
pub(super) enum Way {
    Explicit(Slopes),
    Implicit(Collocation),
}

impl Way {
    /// States at the share `theta` of a step of this size from `state`.
    pub(super) fn between(&self, state: &[f64], size: f64, theta: f64) -> Vec<f64> {
        match self {
            Self::Explicit(slopes) => slopes.between(state, size, theta),
            Self::Implicit(polynomial) => polynomial.between(state, theta),
        }
    }
}
