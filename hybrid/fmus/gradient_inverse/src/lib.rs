#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! Tracking by a gradient-adapted inverse as an FMU.

use hybrid::laws::gradient_inverse::GradientInverse as Law;

hybrid::tracking_component! {
    /// Tracking control by the adaptive inverse of Galmez and Fermandois.
    GradientInverse, "Tracking control by the adaptive inverse of Galmez and Fermandois", Law;
    {
        start: Law = Law::default(),
    }
    |s| { s.start }
    parameter("initial_coefficient[1]", s.start.initial[0], "Coefficient 0 at the start, s^0");
    parameter("initial_coefficient[2]", s.start.initial[1], "Coefficient 1 at the start, s^1");
    parameter("initial_coefficient[3]", s.start.initial[2], "Coefficient 2 at the start, s^2");
    parameter("initial_coefficient[4]", s.start.initial[3], "Coefficient 3 at the start, s^3");
    parameter("adaptation_gain[1]", s.start.gains[0], "Gain of the adaptation of coefficient 0").min(0.0);
    parameter("adaptation_gain[2]", s.start.gains[1], "Gain of the adaptation of coefficient 1").min(0.0);
    parameter("adaptation_gain[3]", s.start.gains[2], "Gain of the adaptation of coefficient 2").min(0.0);
    parameter("adaptation_gain[4]", s.start.gains[3], "Gain of the adaptation of coefficient 3").min(0.0);
    parameter("corner", s.start.corner, "Corner of the filter of Butterworth", "Hz");
}
