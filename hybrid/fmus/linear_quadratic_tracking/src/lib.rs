#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Linear quadratic Gaussian tracking as an FMU.

use hybrid::laws::linear_quadratic::{LinearQuadraticDesign, LinearQuadraticTracking as Law};
use hybrid::vrths::{PERIOD, TransferSystemParameters};
use units::vocabulary;

hybrid::tracking_component! {
    /// Linear quadratic Gaussian tracking control.
    LinearQuadraticTracking, "Linear quadratic Gaussian tracking control", Law;
    {
        design: LinearQuadraticDesign = LinearQuadraticDesign::default(),
    }
    |s| {
        Law::design(&TransferSystemParameters::default(), &s.design, PERIOD)?
    }
    parameter(vocabulary::COMMAND_WEIGHT, s.design.command_weight, "Weight of the command against the displacement error");
    parameter("command_noise", s.design.command_noise, "White noise on the command, one standard deviation", "m");
    parameter("disturbance_step", s.design.disturbance_step, "Step of the disturbance at the command a sample, one standard deviation", "m");
    parameter(vocabulary::SENSOR_NOISE, s.design.measurement_noise, "Noise of the measured displacement, one standard deviation", "m");
    parameter(vocabulary::LEAD_SAMPLES, s.design.lead, "Lead of the desired displacement, samples");
}
