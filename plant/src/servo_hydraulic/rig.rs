//! The physical table and a yielding specimen in one system: the truth that a co-simulation of the
//! two is compared with.

use super::{STATES, ServoHydraulicInput, ServoHydraulicState, ServoHydraulicTable};
use crate::integration::{self, Dynamics};
use crate::specimens::{YieldingSpecimen, YieldingState};

/// Table and specimen, coupled without delay.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ServoHydraulicRig {
    /// The table.
    pub table: ServoHydraulicTable,
    /// The specimen.
    pub specimen: YieldingSpecimen,
}

/// State of [`ServoHydraulicRig`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ServoHydraulicRigState {
    /// The table's.
    pub table: ServoHydraulicState,
    /// The specimen's.
    pub specimen: YieldingState,
}

const ALL: usize = STATES + 4;

impl From<[f64; ALL]> for ServoHydraulicRigState {
    fn from(x: [f64; ALL]) -> Self {
        let (mut table, mut specimen) = ([0.0; STATES], [0.0; 4]);
        table.copy_from_slice(&x[..STATES]);
        specimen.copy_from_slice(&x[STATES..]);
        Self {
            table: table.into(),
            specimen: specimen.into(),
        }
    }
}

impl From<ServoHydraulicRigState> for [f64; ALL] {
    fn from(state: ServoHydraulicRigState) -> Self {
        let mut x = [0.0; ALL];
        x[..STATES].copy_from_slice(&<[f64; STATES]>::from(state.table));
        x[STATES..].copy_from_slice(&<[f64; 4]>::from(state.specimen));
        x
    }
}

impl ServoHydraulicRig {
    /// The rig at rest.
    pub fn rest(&self) -> ServoHydraulicRigState {
        ServoHydraulicRigState {
            table: self.table.rest(),
            specimen: YieldingState::default(),
        }
    }

    /// Time derivative of the state under `valve_command` (V).
    pub fn derivatives(
        &self,
        state: &ServoHydraulicRigState,
        valve_command: f64,
    ) -> ServoHydraulicRigState {
        let input = ServoHydraulicInput {
            valve_command,
            specimen_force: self.specimen.force(&state.specimen),
            supply_lost: false,
        };
        let table = self.table.derivatives(&state.table, &input);
        ServoHydraulicRigState {
            table,
            specimen: self.specimen.derivatives(&state.specimen, table.velocity),
        }
    }

    /// The state `duration` seconds later with `valve_command` (V) held, in inner steps no longer
    /// than `inner_step` seconds.
    pub fn advance(
        &self,
        state: &ServoHydraulicRigState,
        valve_command: f64,
        duration: f64,
        inner_step: f64,
    ) -> ServoHydraulicRigState {
        let driven = Driven {
            rig: self,
            valve_command,
        };
        integration::advance(&driven, &(*state).into(), duration, inner_step).into()
    }
}

struct Driven<'a> {
    rig: &'a ServoHydraulicRig,
    valve_command: f64,
}

impl Dynamics<ALL> for Driven<'_> {
    fn derivatives(&self, x: &[f64; ALL]) -> [f64; ALL] {
        self.rig
            .derivatives(&(*x).into(), self.valve_command)
            .into()
    }

    fn stiff_diagonal(&self, x: &[f64; ALL]) -> [f64; ALL] {
        let mut diagonal = [0.0; ALL];
        diagonal[6] = self.rig.table.friction.rate_slope(x[6], x[5]);
        diagonal
    }
}
