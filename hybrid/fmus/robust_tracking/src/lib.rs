#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by loop shaping as an FMU.

use hybrid::laws::robust_tracking::RobustTracking as Law;
use hybrid::vrths::{PERIOD, TransferSystemParameters};
use units::vocabulary;

hybrid::tracking_component! {
    /// Tracking control by synthesised loop shaping.
    RobustTracking, "Tracking control by synthesised loop shaping", Law;
    {
        crossover: f64 = 60.0,
        zero: f64 = 50.0,
        lead: f64 = 1.5,
    }
    |s| {
        let plant = TransferSystemParameters::default();
        Law::synthesise(&plant, s.crossover, s.zero, s.lead, PERIOD)?
    }
    parameter("crossover", s.crossover, "Crossover of the weight's integrator", "rad/s");
    parameter("zero", s.zero, "Zero of the weight", "rad/s");
    parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement, samples");
}
