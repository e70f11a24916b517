//! What passes between sliding mode and the displacement and force loops below it (Fig 4-3), and those
//! loops.
//!
//! # Two integrators, one valve
//! Displacement and force loop both integrate (Eq 3-6, 3-7) and act through one valve, so that their
//! difference is seen by nothing: a pole at z = 1, and a bias of any sensor makes the two integrals
//! drift apart without end. Here the displacement loop's integral leaks at the lower edge of the
//! band of the motions ([`DISPLACEMENT_INTEGRAL_LEAK`]); the force loop's, which is eight times
//! as strong, stays whole and takes the valve's null shift. In steady state the force error is then
//! zero: a bias `b` of the force cell offsets the table by `b / (m lambda K)`, and nothing drifts.
//!
//! # Limits
//! A low-level loop that stops at the valve's 10 V reaches, through its share of one half, 5 V of the
//! valve: too little for a strong motion under a specimen. The loops' limits are therefore the
//! valve's over their shares, and the allocation limits the sum.

use std::f64::consts::TAU;

use crate::Motion;
use crate::allocation::ControlAllocation;
use crate::pid::Pid;

/// Leak of the displacement loop's integral under sliding mode, 1/s: the lower edge of the band
/// of the motions, 0.25 Hz.
pub const DISPLACEMENT_INTEGRAL_LEAK: f64 = TAU * 0.25;

/// What sliding mode is told.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct SlidingModeInput {
    /// Wanted motion.
    pub reference: Motion,
    /// Measured motion; the law needs no measured acceleration.
    pub measured: Motion,
    /// Measured force of the actuator, N; used by the prediction alone.
    pub measured_force: f64,
    /// Absolute acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
}

/// What sliding mode asks of the low-level loops.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LowLevelReferences {
    /// Reference of the displacement loop, m.
    pub displacement: f64,
    /// Reference of the force loop, N.
    pub force: f64,
}

/// Displacement control of Eq 3-6 as it runs under sliding mode: its integral leaks, and its limit
/// leaves the limiting of the valve to the allocation.
pub fn displacement_loop(allocation: &ControlAllocation) -> Pid {
    Pid {
        integral_leak: DISPLACEMENT_INTEGRAL_LEAK,
        limit: allocation.limit / allocation.displacement_share,
        ..Pid::equation_3_6()
    }
}

/// Force control of Eq 3-7 as it runs under sliding mode: its limit leaves the limiting of the
/// valve to the allocation.
pub fn force_loop(allocation: &ControlAllocation) -> Pid {
    Pid {
        limit: allocation.limit / allocation.force_share,
        ..Pid::equation_3_7()
    }
}
