//! Table and specimen as one model: the monolithic truth that the co-simulation is compared with.

use nalgebra::{DMatrix, SMatrix};
use units::vocabulary;

use crate::identified::shake_table::ShakeTable;
use crate::linear::StateSpace;
use crate::specimens::linear::LinearSpecimen;

/// The rig without co-simulation: actuator, table and specimen in one system (Eq A-3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rig {
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
}

/// Outputs of [`Rig::state_space`], in order.
pub const RIG_OUTPUTS: [&str; 7] = [
    "displacement",
    "velocity",
    "acceleration",
    vocabulary::ACTUATOR_FORCE,
    "drift",
    vocabulary::DRIFT_VELOCITY,
    vocabulary::SPECIMEN_ACCELERATION,
];

impl Rig {
    /// Input valve command (V); states: the actuator's three, displacement, velocity, drift and
    /// drift velocity; outputs as in [`RIG_OUTPUTS`], SI. Without a specimen the last two states
    /// and three outputs stay zero.
    pub fn state_space(&self) -> StateSpace {
        let (table, input) = self.shake_table.dynamics();
        let mut a = SMatrix::<f64, 7, 7>::zeros();
        a.fixed_view_mut::<5, 5>(0, 0).copy_from(&table);
        let mut c = DMatrix::zeros(RIG_OUTPUTS.len(), 7);
        if let Some(LinearSpecimen {
            mass,
            damping,
            stiffness,
        }) = self.specimen
        {
            let per_table_mass = input[(4, 1)];
            a[(4, 5)] = stiffness * per_table_mass;
            a[(4, 6)] = damping * per_table_mass;
            a[(5, 6)] = 1.0;
            for j in 0..7 {
                a[(6, j)] = -a[(4, j)];
            }
            a[(6, 5)] -= stiffness / mass;
            a[(6, 6)] -= damping / mass;
            c[(6, 5)] = -stiffness / mass;
            c[(6, 6)] = -damping / mass;
        }
        for (output, state) in [(0, 3), (1, 4), (3, 0), (4, 5), (5, 6)] {
            c[(output, state)] = 1.0;
        }
        for j in 0..7 {
            c[(2, j)] = a[(4, j)];
        }
        let mut b = DMatrix::zeros(7, 1);
        for i in 0..5 {
            b[(i, 0)] = input[(i, 0)];
        }
        StateSpace {
            a: DMatrix::from_fn(7, 7, |i, j| a[(i, j)]),
            b,
            c,
            d: DMatrix::zeros(RIG_OUTPUTS.len(), 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_models_coupled_with_small_steps_approach_the_monolithic_one() {
        let rig = Rig {
            specimen: Some(LinearSpecimen::appendix_a()),
            ..Rig::default()
        };
        let duration = 0.2;
        let truth = rig.state_space().sample(0.001);
        let mut x = nalgebra::DVector::zeros(7);
        for _ in 0..200 {
            x = truth.advance(&x, &nalgebra::dvector![0.5]);
        }
        let error = |steps: u32| {
            let h = duration / f64::from(steps);
            let specimen = rig.specimen.unwrap();
            let (table, sampled) = (rig.shake_table.sample(h), specimen.sample(h));
            let (mut t, mut s) = Default::default();
            for _ in 0..steps {
                let force = specimen.force(&s);
                let acceleration = rig.shake_table.acceleration(&t, force);
                t = table.advance(&t, 0.5, force);
                s = sampled.advance(&s, acceleration);
            }
            (t.displacement - x[3]).abs()
        };
        let (coarse, fine) = (error(200), error(400));
        assert!(fine < 0.01 * x[3].abs(), "{fine:e} of {:e}", x[3]);
        assert!(
            (coarse / fine - 2.0).abs() < 0.1,
            "first order: {coarse:e} {fine:e}"
        );
    }
}
