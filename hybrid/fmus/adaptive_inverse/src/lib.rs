#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by an adaptive inverse as an FMU.

use hybrid::laws::adaptive_inverse::AdaptiveInverse as Law;
use hybrid::laws::extrapolation::{Extrapolation, WINDOW_SAMPLES};
use hybrid::vrths::{Deviation, PERIOD, TransferSystemParameters};
use units::vocabulary;

hybrid::tracking_component! {
    /// Tracking control by an inverse that is estimated during the test.
    AdaptiveInverse, "Tracking control by an inverse that is estimated during the test", Law;
    {
        lead: f64 = Law::LEAD,
        deviation: Deviation = Deviation {
            specimen_stiffness: Law::STIFFNESS_DEVIATION,
            ..Deviation::default()
        },
        corner: f64 = Law::CORNER,
        error_variance: f64 = Law::ERROR_VARIANCE,
        window: i32 = 16,
    }
    |s| {
        let nominal = TransferSystemParameters::default();
        let mut law = Law::for_family(&nominal, &s.deviation, PERIOD, s.lead)?;
        law.corner = s.corner;
        law.error_variance = s.error_variance;
        let window = usize::try_from(s.window).unwrap_or_default();
        law.desired = Extrapolation::new(5, window, s.lead)?;
        law
    }
    parameter(vocabulary::LEAD_SAMPLES, s.lead, "Lead of the desired displacement, samples");
    parameter("stiffness_deviation", s.deviation.specimen_stiffness, "Standard deviation of the specimen's stiffness at the start", "N/m").min(0.0);
    parameter("beta1_deviation", s.deviation.valve_beta1, "Standard deviation of the valve's beta1 at the start", "1/s").min(0.0);
    parameter("beta2_deviation", s.deviation.valve_beta2, "Standard deviation of the valve's beta2 at the start", "1/s2").min(0.0);
    parameter("a3_deviation", s.deviation.actuator_a3, "Standard deviation of the actuator's a3 at the start", "1/s").min(0.0);
    parameter("corner", s.corner, "Corner of each lag of the estimation's filter", "rad/s");
    parameter("error_variance", s.error_variance, "Variance of the filtered equation's error times its correlation in samples", "m2");
    parameter(WINDOW_SAMPLES, s.window, "Samples that the derivatives of the desired displacement are fitted to").min(6.0).max(32.0);
}
