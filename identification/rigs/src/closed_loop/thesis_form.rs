//! The hydraulic rig in the form of Eq 2-4, `F = G1 u + G2 v` of third order.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, Matrix3, Vector3};
use plant::identified::actuator::IdentifiedActuator;
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::linear::log_space;

use super::equations::{HydraulicRig, PARAMETERS};

/// Number of [`coefficients`].
pub const COEFFICIENTS: usize = 12;

impl HydraulicRig {
    /// Actuator and table without dry friction. G1 is exact; the seals' damping makes G2 pass
    /// velocity directly, for which the form has no place: its numerator is fitted to the relative
    /// error over 0.1 to 30 Hz by least squares. `None` where the fit is singular.
    pub fn shake_table(&self) -> Option<ShakeTable> {
        let (square, pole) = (1.0 / self.spool_inertia, self.leakage_rate);
        let double = self.spool_lag * square;
        let denominator = [double + pole, square + double * pole, square * pole];
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for f in log_space(0.1, 30.0, 200) {
            let s = Complex::new(0.0, TAU * f);
            let exact = -self.compliance_path(s) / s;
            let [a2, a1, a0] = denominator;
            let common = ((s + a2) * s + a1) * s + a0;
            let row = [s * s, s, Complex::new(1.0, 0.0)].map(|power| power / (common * exact));
            for part in [|c: Complex<f64>| c.re, |c: Complex<f64>| c.im] {
                let row = Vector3::from(row.map(part));
                normal += row * row.transpose();
                right += row * part(Complex::new(1.0, 0.0));
            }
        }
        // Powers of s differ by orders of magnitude: scale before solving.
        let scale = Vector3::from_fn(|i, _| 1.0 / f64::sqrt(normal[(i, i)]));
        let scaled = Matrix3::from_diagonal(&scale) * normal * Matrix3::from_diagonal(&scale);
        let right = right.component_mul(&scale);
        let solution = scaled.lu().solve(&right)?.component_mul(&scale);
        Some(ShakeTable {
            actuator: IdentifiedActuator {
                denominator,
                voltage_to_force: [0.0, 0.0, self.force_rate * square],
                velocity_to_force: solution.into(),
            },
            table: Table {
                mass: self.mass,
                damping: self.damping,
                stiffness: self.stiffness,
            },
        })
    }
}

/// Denominator, numerators and table as one list.
pub fn coefficients(rig: &HydraulicRig) -> Option<[f64; COEFFICIENTS]> {
    let ShakeTable { actuator, table } = rig.shake_table()?;
    let mut all = [0.0; COEFFICIENTS];
    all[..3].copy_from_slice(&actuator.denominator);
    all[3..6].copy_from_slice(&actuator.voltage_to_force);
    all[6..9].copy_from_slice(&actuator.velocity_to_force);
    all[9..].copy_from_slice(&[table.mass, table.damping, table.stiffness]);
    Some(all)
}

/// Standard errors of [`coefficients`] from the covariance of the rig's parameters.
pub fn standard_errors(
    rig: &HydraulicRig,
    covariance: &DMatrix<f64>,
) -> Option<[f64; COEFFICIENTS]> {
    let values: [f64; PARAMETERS] = (*rig).into();
    let base = coefficients(rig)?;
    let mut slopes = DMatrix::zeros(COEFFICIENTS, PARAMETERS);
    for j in 0..PARAMETERS {
        let change = 1e-4 * values[j].abs().max(1e-9);
        let mut moved = values;
        moved[j] += change;
        let there = coefficients(&HydraulicRig::from(moved))?;
        for i in 0..COEFFICIENTS {
            slopes[(i, j)] = (there[i] - base[i]) / change;
        }
    }
    let own = &slopes * covariance * slopes.transpose();
    Some(std::array::from_fn(|i| own[(i, i)].max(0.0).sqrt()))
}
