#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by the inverse of a model as an FMU.

use hybrid::laws::extrapolation::Extrapolation;
use hybrid::laws::model_inverse::ModelInverse as Law;
use hybrid::vrths::TransferSystemParameters;
use units::vocabulary;

hybrid::tracking_component! {
    /// Tracking control by the inverse of a model, with PI.
    ModelInverse, "Tracking control by the inverse of a model, with PI", Law;
    {
        proportional: f64 = 0.0,
        integral: f64 = 0.0,
        lead: f64 = 0.0,
        plant: TransferSystemParameters = TransferSystemParameters::default(),
    }
    |s| {
        s.plant.validate()?;
        Law {
            proportional: s.proportional,
            integral: s.integral,
            // The held command is late by half a sample.
            desired: Extrapolation::new(5, 16, s.lead + 0.5)?,
            ..Law::of(&s.plant, 5)?
        }
    }
    parameter(vocabulary::PROPORTIONAL_GAIN, s.proportional, "Proportional gain");
    parameter(vocabulary::INTEGRAL_GAIN, s.integral, "Integral gain", "1/s");
    parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement beside that of the held command, samples");
    parameter(vocabulary::VALVE_BETA1, s.plant.valve_beta1, "beta1 of the model's valve", "1/s");
    parameter(vocabulary::VALVE_BETA2, s.plant.valve_beta2, "beta2 of the model's valve", "1/s2");
    parameter(vocabulary::ACTUATOR_A3, s.plant.actuator_a3, "a3 of the model's actuator", "1/s");
    parameter(vocabulary::SPECIMEN_MASS, s.plant.specimen_mass, "Mass of the model's specimen", "kg");
    parameter(vocabulary::SPECIMEN_STIFFNESS, s.plant.specimen_stiffness, "Stiffness of the model's specimen", "N/m");
}
