//! Actuator and table joined through velocity (Fig 2-2): the control-structure interaction.

use nalgebra::{SMatrix, SVector};

use crate::ModelError;
use crate::identified::actuator::{IdentifiedActuator, PublishedActuator};
use crate::identified::table::Table;
use crate::linear::{StateSpace, TransferFunction, zero_order_hold};

/// The identified shake table: actuator (Eq 2-13, 2-14) and table (Eq 2-28).
///
/// Inputs are the valve command (V) and the specimen's force on the table (N); states are the
/// actuator's three, displacement and velocity.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct ShakeTable {
    /// The actuator.
    #[parameters]
    pub actuator: IdentifiedActuator,
    /// The table.
    #[parameters]
    pub table: Table,
}

/// State of [`ShakeTable`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct ShakeTableState {
    /// The actuator's states in observer canonical form; the first is the force in N.
    pub actuator: [f64; 3],
    /// Displacement in m.
    pub displacement: f64,
    /// Velocity in m/s.
    pub velocity: f64,
}

impl Default for ShakeTable {
    fn default() -> Self {
        Self {
            actuator: PublishedActuator::Equation2_13.transfer_functions(),
            table: Table::equation_2_28(),
        }
    }
}

impl ShakeTable {
    /// The de-rounded set in full digits.
    pub fn derounded() -> Self {
        Self {
            actuator: PublishedActuator::Derounded.transfer_functions(),
            table: Table::derounded(),
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first of actuator or table that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.actuator.validate()?;
        self.table.validate()
    }

    /// `(A, B)` with inputs valve command (V) and specimen force (N).
    pub fn dynamics(&self) -> (SMatrix<f64, 5, 5>, SMatrix<f64, 5, 2>) {
        let (actuator, input) = self.actuator.dynamics();
        let Table {
            mass,
            damping,
            stiffness,
        } = self.table;
        let mut a = SMatrix::<f64, 5, 5>::zeros();
        let mut b = SMatrix::<f64, 5, 2>::zeros();
        a.fixed_view_mut::<3, 3>(0, 0).copy_from(&actuator);
        a.fixed_view_mut::<3, 1>(0, 4).copy_from(&input.column(1));
        b.fixed_view_mut::<3, 1>(0, 0).copy_from(&input.column(0));
        a[(3, 4)] = 1.0;
        a[(4, 0)] = 1.0 / mass;
        a[(4, 3)] = -stiffness / mass;
        a[(4, 4)] = -damping / mass;
        b[(4, 1)] = 1.0 / mass;
        (a, b)
    }

    /// Valve command (V) and specimen force (N) to displacement, velocity, acceleration and
    /// actuator force.
    pub fn state_space(&self) -> StateSpace {
        let (a, b) = self.dynamics();
        let mut c = nalgebra::DMatrix::zeros(4, 5);
        let mut d = nalgebra::DMatrix::zeros(4, 2);
        c[(0, 3)] = 1.0;
        c[(1, 4)] = 1.0;
        c[(3, 0)] = 1.0;
        for j in 0..5 {
            c[(2, j)] = a[(4, j)];
        }
        d[(2, 1)] = b[(4, 1)];
        StateSpace {
            a: nalgebra::DMatrix::from_fn(5, 5, |i, j| a[(i, j)]),
            b: nalgebra::DMatrix::from_fn(5, 2, |i, j| b[(i, j)]),
            c,
            d,
        }
    }

    /// `G_ux`, valve command (V) to displacement (m), without a specimen (Eq 3-5 multiplied out).
    pub fn voltage_to_displacement(&self) -> TransferFunction {
        let g2 = self.actuator.g2();
        let Table {
            mass,
            damping,
            stiffness,
        } = self.table;
        let [e2, e1, e0] = self.actuator.velocity_to_force;
        // (s³ + a2 s² + a1 s + a0) (m s² + c s + k) - (e2 s² + e1 s + e0) s.
        let mut denominator = vec![0.0; 6];
        for (i, a) in g2.denominator.iter().enumerate() {
            for (j, b) in [mass, damping, stiffness].iter().enumerate() {
                denominator[i + j] += a * b;
            }
        }
        for (place, e) in denominator[2..5].iter_mut().zip([e2, e1, e0]) {
            *place -= e;
        }
        TransferFunction {
            numerator: self.actuator.voltage_to_force.to_vec(),
            denominator,
        }
    }

    /// Acceleration of the table in m/s² under `specimen_force` (N).
    pub fn acceleration(&self, state: &ShakeTableState, specimen_force: f64) -> f64 {
        let Table {
            mass,
            damping,
            stiffness,
        } = self.table;
        (state.actuator[0] + specimen_force
            - damping * state.velocity
            - stiffness * state.displacement)
            / mass
    }

    /// Transition over `step` seconds with both inputs held.
    pub fn sample(&self, step: f64) -> SampledShakeTable {
        let (a, b) = self.dynamics();
        let (transition, input) = zero_order_hold(&a, &b, step);
        SampledShakeTable {
            step,
            transition,
            input,
        }
    }
}

/// The table's exact transition over one step with held inputs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampledShakeTable {
    step: f64,
    transition: SMatrix<f64, 5, 5>,
    input: SMatrix<f64, 5, 2>,
}

impl SampledShakeTable {
    /// The step it was made for, s.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The state one step later under `valve_command` (V) and `specimen_force` (N).
    pub fn advance(
        &self,
        state: &ShakeTableState,
        valve_command: f64,
        specimen_force: f64,
    ) -> ShakeTableState {
        let [z1, z2, z3] = state.actuator;
        let x = SVector::<f64, 5>::new(z1, z2, z3, state.displacement, state.velocity);
        let next = self.transition * x
            + self.input.column(0) * valve_command
            + self.input.column(1) * specimen_force;
        ShakeTableState {
            actuator: [next[0], next[1], next[2]],
            displacement: next[3],
            velocity: next[4],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn closed_loop_over_velocity_matches_equation_3_5() {
        let rig = ShakeTable::default();
        let system = rig.state_space();
        for omega in [0.5, 3.0, 40.0, 300.0] {
            let s = Complex::new(0.0, omega);
            let (g1, g2) = (rig.actuator.g1().evaluate(s), rig.actuator.g2().evaluate(s));
            let g3 = rig.table.transfer_function().evaluate(s);
            let g_ux = g1 * g3 / (1.0 - g2 * g3 * s);
            let got = system.evaluate(s).unwrap()[(0, 0)];
            assert!(
                (got - g_ux).norm() < 1e-12 * g_ux.norm(),
                "at {omega} rad/s"
            );
            let multiplied_out = rig.voltage_to_displacement().evaluate(s);
            assert!(
                (multiplied_out - g_ux).norm() < 1e-12 * g_ux.norm(),
                "at {omega} rad/s"
            );
        }
    }

    #[test]
    fn uncontrolled_table_has_the_slightly_unstable_pair() {
        let poles = ShakeTable::derounded().state_space().poles();
        let unstable: Vec<_> = poles.iter().filter(|pole| pole.re > 0.0).collect();
        assert_eq!(unstable.len(), 2);
        assert!((unstable[0].re - 0.13).abs() < 0.01, "{unstable:?}");
        assert!((unstable[0].im.abs() - 0.77).abs() < 0.01, "{unstable:?}");
    }
}
