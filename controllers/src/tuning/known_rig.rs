//! The identified model's form, fitted to a physical rig whose parameters are known: for the rules' own
//! tests. Nothing that runs reads them.

use std::f64::consts::TAU;

use nalgebra::{Complex, Matrix3, Vector3};

use plant::identified::actuator::IdentifiedActuator;
use plant::identified::shake_table::ShakeTable;
use plant::linear::log_space;
use plant::servo_hydraulic::ServoHydraulicTable;

/// The rig in the form of Eq 2-4, `F = G1 u + G2 v` of third order, at rest in the middle with
/// sliding seals.
///
/// The linearised actuator is `G1 = A k_q w²/N`, `G2 = -A²/(V_t/(4 β) s + C) - c` with
/// `N = (s² + 2 D w s + w²)(V_t/(4 β) s + C)`. G1 is kept exactly. The seals' damping `c` makes
/// G2 pass velocity directly, for which the form has no place: its numerator is fitted to the
/// relative error over 0.1 to 30 Hz by least squares.
pub(super) fn fitted(rig: &ServoHydraulicTable) -> ShakeTable {
    let (valve, cylinder) = (&rig.valve, &rig.cylinder);
    let supply = rig.supply.rest_pressure(valve.null_leakage);
    let flow_gain = valve.flow_coefficient * (0.5 * supply).sqrt();
    let compliance = cylinder.volume / (4.0 * cylinder.bulk_modulus);
    let leakage = cylinder.leakage + valve.null_leakage;
    let (omega, double) = (
        TAU * valve.frequency,
        2.0 * valve.damping_ratio * TAU * valve.frequency,
    );
    let pole = leakage / compliance;
    let denominator = [
        double + pole,
        omega * omega + double * pole,
        omega * omega * pole,
    ];
    let gain = cylinder.area * flow_gain * omega * omega / compliance;

    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for f in log_space(0.1, 30.0, 200) {
        let s = Complex::new(0.0, TAU * f);
        let exact = -cylinder.area.powi(2) / (s * compliance + leakage) - rig.friction.viscous;
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
    let solution = scaled
        .lu()
        .solve(&scale.component_mul(&right))
        .unwrap()
        .component_mul(&scale);
    let mut table = rig.table;
    table.mass += rig.added_payload;
    ShakeTable {
        actuator: IdentifiedActuator {
            denominator,
            voltage_to_force: [0.0, 0.0, gain],
            velocity_to_force: solution.into(),
        },
        table,
    }
}
