//! Minimal control synthesis from a model of the rig, by a stated rule.

use plant::identified::shake_table::ShakeTable;

use super::suite::Measurements;
use crate::ModelError;
use crate::minimal_control_synthesis::MinimalControlSynthesis;
use crate::robustness::LateRig;
use crate::three_variable::ThreeVariableGains;

impl MinimalControlSynthesis {
    /// Starts from half the displacement gain of [`ThreeVariableGains::tuned`], a quarter of that at which
    /// the loop oscillates, so that the gains may double. Its bandwidth is that gain times the table's
    /// velocity per volt at 1 Hz; the rates of adaptation are those of [`Self::around`].
    ///
    /// # Errors
    /// A rig that no displacement gain holds.
    pub fn tuned(rig: &ShakeTable, measurements: &Measurements) -> Result<Self, ModelError> {
        let period = measurements.period;
        let gains = ThreeVariableGains::tuned(rig, measurements.delay(), period)?;
        let gain = 0.5 * gains.proportional;
        let omega = std::f64::consts::TAU;
        let late = LateRig::new(&rig.state_space(), measurements.late, period)?;
        let velocity = late.responses(omega)[0].norm() * omega;
        Ok(Self::around(gain, gain * velocity))
    }
}
