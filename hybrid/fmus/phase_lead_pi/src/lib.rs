#![allow(non_snake_case, reason = "an FMU is named in camel case")]
//! PI with phase lead as an FMU.

use hybrid::laws::phase_lead_pi::PhaseLeadPi as Law;
use units::vocabulary;

hybrid::tracking_component! {
    /// Tracking control by PI with phase lead.
    PhaseLeadPi, "Tracking control by PI with phase lead", Law;
    {
        start: Law = Law::default(),
    }
    |s| { s.start }
    parameter(vocabulary::PROPORTIONAL_GAIN, s.start.proportional, "Proportional gain");
    parameter(vocabulary::INTEGRAL_GAIN, s.start.integral, "Integral gain", "1/s");
    parameter("lead_gain", s.start.lead_gain, "Gain of the lead at high frequency");
    parameter("lead_numerator", s.start.lead_numerator, "Constant of the lead's numerator", "1/s");
    parameter("lead_pole", s.start.lead_pole, "Pole of the lead", "1/s");
    parameter(vocabulary::CONVERTER_QUANTUM, s.start.converter.quantum, "Step of the converters, 0 for none", "m").min(0.0);
    parameter(vocabulary::CONVERTER_LIMIT, s.start.converter.limit, "Limit of the converters, 0 for none", "m").min(0.0);
}
