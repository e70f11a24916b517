//! The process model of Eq 5-5, written out for itself, against its printed digits and the prediction.

use nalgebra::DMatrix;
use plant::identified::actuator::PublishedActuator;
use plant::identified::coupled::Rig;
use plant::linear::StateSpace;
use units::constants::SAMPLING_PERIOD as H;

use super::parameters::prediction_plant;
use super::*;
use crate::three_variable::ThreeVariableGains;

/// The bare table under three-variable control with the law running continuously: the process
/// model of Eq 5-5 before sampling.
///
/// `actuator` has inputs valve command and velocity and output force; `table` is
/// `[1/m, c/m, k/m]`; all in one consistent set of units. States: the actuator's, displacement,
/// velocity, integral; inputs `[rd, rv, ra]`; outputs displacement, velocity, acceleration.
fn continuous_process_model(
    actuator: &StateSpace,
    table: [f64; 3],
    gains: &ThreeVariableGains,
) -> StateSpace {
    let n = actuator.order();
    let (x, v, xi) = (n, n + 1, n + 2);
    let [per_mass, damping, stiffness] = table;
    let mut acceleration = DMatrix::zeros(1, n + 3);
    acceleration
        .view_mut((0, 0), (1, n))
        .copy_from(&(&actuator.c * per_mass));
    acceleration[(0, x)] = -stiffness;
    acceleration[(0, v)] = -damping;

    let (k, l) = gains.reference_and_feedback();
    let mut command = &acceleration * -l[2];
    command[(0, x)] -= l[0];
    command[(0, v)] -= l[1];
    command[(0, xi)] += 1.0;

    let valve = actuator.b.column(0);
    let mut a = DMatrix::zeros(n + 3, n + 3);
    a.view_mut((0, 0), (n, n)).copy_from(&actuator.a);
    a.view_mut((0, v), (n, 1)).copy_from(&actuator.b.column(1));
    let mut actuator_rows = a.rows_mut(0, n);
    actuator_rows += valve * &command;
    a[(x, v)] = 1.0;
    a.row_mut(v).copy_from(&acceleration.row(0));
    a[(xi, x)] = -gains.integral;

    let mut b = DMatrix::zeros(n + 3, 3);
    b.view_mut((0, 0), (n, 3))
        .copy_from(&(valve * nalgebra::RowVector3::from(k)));
    b[(xi, 0)] = gains.integral;

    let mut c = DMatrix::zeros(3, n + 3);
    c[(0, x)] = 1.0;
    c[(1, v)] = 1.0;
    c.row_mut(2).copy_from(&acceleration.row(0));
    StateSpace {
        a,
        b,
        c,
        d: DMatrix::zeros(3, 3),
    }
}

/// Eq 5-5 as printed, with half a unit of the last digit of each entry.
const A_P: [[(f64, f64); 6]; 6] = [
    [
        (1.003, 5e-4),
        (-0.004202, 5e-7),
        (-0.0008308, 5e-8),
        (-0.02242, 5e-6),
        (0.000558, 5e-7),
        (0.003639, 5e-7),
    ],
    [
        (0.1082, 5e-5),
        (0.9194, 5e-5),
        (0.2344, 5e-5),
        (-0.3925, 5e-5),
        (0.01388, 5e-6),
        (0.0636, 5e-5),
    ],
    [
        (0.1198, 5e-5),
        (-0.1882, 5e-5),
        (0.9239, 5e-5),
        (-1.01, 5e-3),
        (0.02332, 5e-6),
        (0.164, 5e-4),
    ],
    [
        (0.03097, 5e-6),
        (-0.0001058, 5e-8),
        (-2.024e-5, 5e-9),
        (0.9994, 5e-5),
        (0.002001, 5e-7),
        (3.673e-5, 5e-9),
    ],
    [
        (30.96, 5e-3),
        (-0.1263, 5e-5),
        (-0.0269, 5e-5),
        (-0.7197, 5e-5),
        (1.004, 5e-4),
        (0.05459, 5e-6),
    ],
    [
        (-3.325e-6, 5e-10),
        (1.024e-8, 5e-12),
        (1.841e-9, 5e-13),
        (-0.0003219, 5e-8),
        (-3.22e-7, 5e-10),
        (1.0, 5e-7),
    ],
];
const B_P: [[(f64, f64); 3]; 6] = [
    [(0.02311, 5e-6), (0.0004731, 5e-8), (3.639e-7, 5e-11)],
    [(0.4039, 5e-5), (0.008268, 5e-7), (6.36e-6, 5e-9)],
    [(1.041, 5e-4), (0.02132, 5e-6), (1.64e-5, 5e-8)],
    [(0.0002333, 5e-8), (4.775e-6, 5e-10), (3.673e-9, 5e-13)],
    [(0.3466, 5e-5), (0.007097, 5e-7), (5.459e-6, 5e-10)],
    [(0.000322, 5e-7), (-3.865e-10, 5e-14), (-2.973e-13, 5e-17)],
];

#[test]
fn equation_5_5_is_met_within_half_a_unit_of_every_printed_digit() {
    let table = [8.24826748953721, 2.0335133699351586, 192.353521018731];
    let model = continuous_process_model(
        &PublishedActuator::Derounded
            .state_space_in_thesis_units()
            .unwrap(),
        table,
        &ThreeVariableGains::TABLE_3_2_IN_THESIS_UNITS,
    )
    .sample(0.002);
    for i in 0..6 {
        for j in 0..6 {
            let (printed, half) = A_P[i][j];
            let got = model.a[(i, j)];
            assert!(
                (got - printed).abs() <= half * (1.0 + 1e-9),
                "A[{i}][{j}] = {got}"
            );
        }
        for j in 0..3 {
            let (printed, half) = B_P[i][j];
            let got = model.b[(i, j)];
            assert!(
                (got - printed).abs() <= half * (1.0 + 1e-9),
                "B[{i}][{j}] = {got:e}"
            );
        }
    }
    let acceleration = [1.551e4, -31.82, -4.683, -192.4, -2.034, 0.0];
    let half = [5.0, 5e-3, 5e-4, 0.05, 5e-4, 0.0];
    for j in 0..6 {
        assert!(
            (model.c[(2, j)] - acceleration[j]).abs() <= half[j],
            "C[3][{j}]"
        );
    }
}

#[test]
fn printed_state_space_is_unstable_in_the_loop_and_the_derounded_one_stable() {
    let table = [8.248, 2.034, 192.4];
    let gains = ThreeVariableGains::TABLE_3_2_IN_THESIS_UNITS;
    let fastest = |actuator: PublishedActuator| {
        let actuator = actuator.state_space_in_thesis_units().unwrap();
        let model = continuous_process_model(&actuator, table, &gains);
        model
            .poles()
            .iter()
            .map(|pole| pole.re)
            .fold(f64::MIN, f64::max)
    };
    assert!((fastest(PublishedActuator::Equation2_11) - 0.75).abs() < 0.01);
    assert!(fastest(PublishedActuator::Derounded) < 0.0);
}

#[test]
fn continuous_prediction_is_equation_5_5() {
    let parameters = Parameters {
        plant: prediction_plant(&Rig {
            shake_table: plant::identified::shake_table::ShakeTable::derounded(),
            specimen: None,
        }),
        law: LowLevelLaw::Continuous,
        ..Parameters::default()
    };
    let table = plant::identified::shake_table::ShakeTable::derounded().table;
    // The process model that is checked against the printed digits.
    let printed = continuous_process_model(
        &plant::identified::actuator::PublishedActuator::Derounded
            .transfer_functions()
            .state_space(),
        [
            1.0 / table.mass,
            table.damping / table.mass,
            table.stiffness / table.mass,
        ],
        &parameters.low_level.gains,
    )
    .sample(H);
    let control = ModelPredictiveControl::new(parameters).unwrap();
    let model = control.model();
    let near = |got: nalgebra::DMatrixView<f64>, want: &DMatrix<f64>| {
        got.iter()
            .zip(want.iter())
            .all(|(g, w)| (g - w).abs() <= 1e-10 * w.abs() + 1e-13)
    };
    assert!(near(model.a.view((0, 0), (6, 6)), &printed.a));
    assert!(near(model.b.view((0, 0), (6, 3)), &printed.b));
    assert!(near(model.c.view((0, 0), (3, 6)), &printed.c));
}
