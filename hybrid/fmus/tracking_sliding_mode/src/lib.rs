#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by sliding mode as an FMU.

use hybrid::laws::sliding_mode::TrackingSlidingMode as Law;

hybrid::tracking_component! {
    /// Tracking control by sliding mode.
    TrackingSlidingMode, "Tracking control by sliding mode", Law;
    {
        rate: f64 = 150.0,
        reaching: f64 = 0.1,
        boundary_layer: f64 = 5e-3,
        damping_uncertainty: f64 = 0.36,
        stiffness_uncertainty: f64 = 0.1,
    }
    |s| {
        Law {
            rate: s.rate,
            reaching: s.reaching,
            boundary_layer: s.boundary_layer,
            damping_uncertainty: s.damping_uncertainty,
            stiffness_uncertainty: s.stiffness_uncertainty,
            ..Law::published()?
        }
    }
    parameter("rate", s.rate, "lambda", "1/s");
    parameter("reaching", s.reaching, "eta", "m/s2");
    parameter("boundary_layer", s.boundary_layer, "phi", "m/s");
    parameter("damping_uncertainty", s.damping_uncertainty, "beta_b").min(0.0);
    parameter("stiffness_uncertainty", s.stiffness_uncertainty, "beta_c").min(0.0);
}
