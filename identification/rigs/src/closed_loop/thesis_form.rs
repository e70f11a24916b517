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

#[cfg(test)]
mod tests {
    use super::*;

    /// A rig of the size of the thesis's: spool of 80 Hz, oil column at 30 Hz.
    fn rig() -> HydraulicRig {
        HydraulicRig {
            spool_lag: 3e-3,
            spool_inertia: 4e-6,
            force_rate: 2e6,
            oil_stiffness: 1e6,
            leakage_rate: 4.0,
            seal_damping: 300.0,
            seal_friction: 0.0,
            mass: 25.0,
            damping: 60.0,
            stiffness: 500.0,
            specimen_mass: 0.0,
            command_delay: 2e-3,
            accelerometer_delay: 0.0,
            load_cell_delay: 0.0,
            accelerometer_scale: 1.0,
        }
    }

    #[test]
    fn the_form_has_the_paths_of_command_and_velocity_to_the_force() {
        let own = rig();
        let form = own.shake_table().unwrap();
        for f in [0.1, 0.5, 2.0, 10.0, 30.0] {
            let s = Complex::new(0.0, TAU * f);
            // g / ((1 + l s + j s²) (s + p)), without the delay.
            let spool = (own.spool_inertia * s + own.spool_lag) * s + 1.0;
            let exact = own.force_rate / (spool * (s + own.leakage_rate));
            let found = form.actuator.g1().evaluate(s);
            assert!(
                (found / exact - 1.0).norm() < 1e-9,
                "{f} Hz: {found} {exact}"
            );
            // Minus K / (s + p) + c_p, as nearly as the form allows.
            let exact = -(own.oil_stiffness / (s + own.leakage_rate) + own.seal_damping);
            let found = form.actuator.g2().evaluate(s);
            assert!(
                (found / exact - 1.0).norm() < 0.05,
                "{f} Hz: {found} {exact}"
            );
        }
        let table = form.table;
        assert_eq!(
            [table.mass, table.damping, table.stiffness],
            [25.0, 60.0, 500.0]
        );
    }

    /// To the first order errors go through the coefficients' slopes, which are known for these.
    #[test]
    fn errors_of_parameters_become_those_of_the_coefficients_that_they_are_in() {
        let own = rig();
        let errors = |place: usize, relative: f64| {
            let values: [f64; PARAMETERS] = own.into();
            let mut covariance = DMatrix::zeros(PARAMETERS, PARAMETERS);
            covariance[(place, place)] = (relative * values[place]).powi(2);
            standard_errors(&own, &covariance).unwrap()
        };
        let all = coefficients(&own).unwrap();
        let moved = |errors: [f64; COEFFICIENTS]| -> Vec<usize> {
            (0..COEFFICIENTS)
                .filter(|i| errors[*i] > 1e-6 * all[*i].abs())
                .collect()
        };
        // Force rate and masses are in one coefficient each.
        for (place, coefficient) in [(2, 5), (7, 9), (8, 10), (9, 11)] {
            let found = errors(place, 0.01);
            assert_eq!(moved(found), [coefficient]);
            let relative = found[coefficient] / all[coefficient];
            assert!((relative - 0.01).abs() < 1e-5, "{place}: {relative}");
        }
        // The leakage rate: a2 = 2 D w + p, a1 = w² + 2 D w p, a0 = w² p.
        let found = errors(4, 0.01);
        let (square, pole) = (1.0 / own.spool_inertia, own.leakage_rate);
        for (i, slope) in [1.0, own.spool_lag * square, square]
            .into_iter()
            .enumerate()
        {
            assert!((found[i] / (0.01 * pole * slope) - 1.0).abs() < 1e-4, "{i}");
        }
        assert_eq!(found[9..], [0.0; 3]);
    }
}
