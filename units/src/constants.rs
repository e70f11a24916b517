//! Thesis units in SI.

/// One inch in metres.
pub const INCH: f64 = 0.0254;
/// One pound-force in newtons.
pub const LBF: f64 = 4.448_221_615_260_5;
/// Standard gravity in m/s².
pub const G: f64 = 9.806_65;
/// One lbf s²/in in kilograms.
pub const LBF_S2_PER_INCH: f64 = LBF / INCH;
/// One lbf/in in N/m.
pub const LBF_PER_INCH: f64 = LBF / INCH;
/// One lbf s/in in N s/m.
pub const LBF_S_PER_INCH: f64 = LBF / INCH;
/// One pound per square inch in pascals.
pub const PSI: f64 = LBF / (INCH * INCH);
/// Stroke of the thesis's actuator (Section 2.3.1: MTS 402.08, ±1.5 in), in metres.
pub const STROKE: f64 = 1.5 * INCH;
/// Sampling period of the laboratory's controller (Section 5.3.1: 500 Hz), in seconds.
pub const SAMPLING_PERIOD: f64 = 0.002;
