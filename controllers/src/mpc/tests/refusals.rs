//! What no controller is built from.

use nalgebra::DMatrix;
use plant::linear::StateSpace;

use super::*;

#[test]
fn bad_parameters_are_refused_by_name() {
    type Spoil = fn(&mut Parameters);
    let cases: [(&str, Spoil); 18] = [
        ("displacement_weight", |p| p.weights.output[0] = 0.0),
        ("acceleration_weight", |p| p.weights.output[2] = f64::NAN),
        ("velocity_rate_weight", |p| p.weights.rate[1] = -0.1),
        ("violation_weight", |p| p.weights.violation = 0.0),
        ("acceleration_scale", |p| p.weights.scale[2] = 0.0),
        ("prediction_horizon", |p| p.horizon = 0),
        ("prediction_horizon", |p| p.horizon = 21),
        ("minimum_displacement", |p| p.limits.minimum[0] = 0.1),
        ("minimum_velocity", |p| {
            (p.limits.minimum[1], p.limits.maximum[1]) = (1.0, 1.0);
        }),
        ("loop_delay_samples", |p| p.loop_delay_samples = 5),
        ("command_delay_samples", |p| p.command_delay_samples = 9),
        ("loop_delay_samples", |p| {
            (p.law, p.loop_delay_samples) = (LowLevelLaw::Continuous, 1);
        }),
        ("velocity_measurement_noise", |p| {
            p.noise.measurement[1] = 0.0
        }),
        ("disturbance_input_gain", |p| p.disturbance.input[0] = 0.0),
        ("valve_limit", |p| p.low_level.limit = -1.0),
        ("time_limit", |p| p.time_limit = 0.0),
        ("period", |p| p.period = 0.0),
        ("plant", |p| p.plant.a = DMatrix::identity(1, 1)),
    ];
    for (name, spoil) in cases {
        let mut parameters = Parameters::default();
        spoil(&mut parameters);
        let error = match ModelPredictiveControl::new(parameters) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{name} was taken"),
        };
        let named = error.contains(&format!("`{name}`"));
        // Matrices that don't fit each other are named by their letter.
        assert!(
            named || (name == "plant" && error.starts_with("B:")),
            "{name}: {error}"
        );
    }

    let wrong_order = Parameters {
        plant: StateSpace::new(
            DMatrix::identity(1, 1),
            DMatrix::zeros(1, 2),
            DMatrix::zeros(3, 1),
            DMatrix::zeros(3, 2),
        )
        .unwrap(),
        ..Parameters::default()
    };
    let error = wrong_order.validate().unwrap_err().to_string();
    assert!(
        error.contains("`plant`") && error.contains("order 1"),
        "{error}"
    );

    // A state on the border of stability that the sensors don't see.
    let mut blind = Parameters::default();
    let n = blind.plant.order();
    let mut a = DMatrix::zeros(n + 1, n + 1);
    a.view_mut((0, 0), (n, n)).copy_from(&blind.plant.a);
    a[(n, n)] = 1.0;
    blind.plant.a = a;
    blind.plant.b = blind.plant.b.clone().insert_row(n, 0.0);
    blind.plant.c = blind.plant.c.clone().insert_column(n, 0.0);
    let error = match ModelPredictiveControl::new(blind) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("an unseen unstable state was taken"),
    };
    assert!(
        error.contains("no stabilising solution") && error.contains("`process_noise`"),
        "{error}"
    );

    let error = ModelPredictiveInput::window(&[], 0, Motion::default()).unwrap_err();
    assert!(error.to_string().contains("`reference`"), "{error}");
}
