//! Disturbance observer (K. Ohnishi, 1987; T. Umeno and Y. Hori, IEEE Transactions on Industrial Electronics 38, 1991).

use super::lag::Lag;
use super::rig::{KnownRig, MAXIMUM_DELAY};
use super::specimen_force::LAG_DAMPING;
use crate::{ModelError, Motion};

/// `u = u_c - d`, `d = Q(s) [P⁻¹ y - V u]`: what the measured motion needs of the valve, by the inverse of
/// the model, less what the valve gave, `V` its spool and the measurements' lateness.
///
/// With the measured acceleration the inverse takes one derivative: the oil's force is
/// `P = m a + (c + c_p) v + k x`, and the opening `(dP/dt + p P + K v)/g`. `Q` is a lag of second order,
/// which gives that rate.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DisturbanceObserver {
    /// Corner of `Q`, rad/s.
    pub corner: f64,
    /// What the law remembers.
    pub memory: ObserverMemory,
}

/// Memory of [`DisturbanceObserver`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ObserverMemory {
    /// The oil's force through `Q`, N.
    force: Lag,
    /// Opening against the piston's velocity less what the valve gave, through `Q`, V.
    flow: Lag,
    /// The spool as it should be, V.
    spool: Lag,
    /// Openings of the spool, the latest first, V.
    openings: [f64; MAXIMUM_DELAY + 1],
}

impl Default for DisturbanceObserver {
    fn default() -> Self {
        Self {
            corner: 20.0,
            memory: ObserverMemory::default(),
        }
    }
}

impl DisturbanceObserver {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A corner that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("observer_corner", self.corner)
    }

    /// Takes in the measured motion; gives what is added to the valve command of this sample, V.
    pub fn step(&mut self, measured: &Motion, rig: &KnownRig, period: f64) -> f64 {
        let (own, table) = (&rig.hydraulics, &rig.table);
        let memory = &mut self.memory;
        let force = table.mass * measured.acceleration
            + (table.damping + own.seal_damping) * measured.velocity
            + table.stiffness * measured.displacement;
        memory.force.step(force, self.corner, LAG_DAMPING, period);
        let flow = own.oil_stiffness * measured.velocity / own.force_rate;
        let given = memory.openings[rig.delay.min(MAXIMUM_DELAY)];
        memory
            .flow
            .step(flow - given, self.corner, LAG_DAMPING, period);
        -rig.opening(memory.force.value, memory.force.rate) - memory.flow.value
    }

    /// Takes note of the command (V) that was sent for the motion alone.
    pub fn sent(&mut self, command: f64, rig: &KnownRig, period: f64) {
        let own = &rig.hydraulics;
        let omega = own.spool_inertia.sqrt().recip();
        let damping = 0.5 * own.spool_lag * omega;
        let memory = &mut self.memory;
        memory.spool.step(command, omega, damping, period);
        memory.openings.rotate_right(1);
        memory.openings[0] = memory.spool.value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    /// On the rig that it knows it adds nothing to a motion of its own, and finds the opening that a
    /// force on the table takes: `p f/g` when it is constant.
    #[test]
    fn only_what_the_model_does_not_explain_is_opposed() {
        let known = KnownRig {
            delay: 1,
            ..KnownRig::default()
        };
        let period = 0.002;
        let model = known.model().sample(period);
        let run = |force: f64, size: f64| {
            let mut law = DisturbanceObserver::default();
            let mut x = SVector::<f64, 5>::zeros();
            let mut before = Motion::default();
            let (mut most, mut last) = (0.0_f64, 0.0);
            for k in 0..3000 {
                let y = model.c * x + model.d * force;
                let added = law.step(&before, &known, period);
                let command = size * (15.0 * period * f64::from(k)).sin();
                law.sent(command, &known, period);
                x = model.advance(&x, command, [force, force]);
                before = Motion {
                    displacement: y[0],
                    velocity: y[1],
                    acceleration: y[2],
                };
                if k > 500 {
                    most = most.max(added.abs());
                }
                last = added;
            }
            (most, last)
        };
        let (most, _) = run(0.0, 1.0);
        assert!(most < 0.02, "{most} V against a command of 1 V");
        let (_, last) = run(50.0, 0.0);
        let expected = -known.opening(50.0, 0.0);
        assert!((last / expected - 1.0).abs() < 0.01, "{last} {expected}");
    }
}
