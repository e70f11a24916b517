//! The catalogue's effects on sensors and specimen.

use plant::identified::rig::IdentifiedRig;
use units::constants::{INCH, LBF};

use super::entry::{Apply, candidate, delay, inverse, positive, relative, shape, signed, size};
use crate::diagnosis::engine::{Candidate, Scale};

/// Entries with what they do to the rig; `period` is the sampling period in s.
pub(super) fn entries(period: f64) -> Vec<(Candidate, Apply)> {
    vec![
        (
            candidate(
                "accelerometer_bias",
                vec![signed("offset", "m/s^2", 1.5 * INCH, 15.0 * INCH)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_bias = p[0],
        ),
        (
            candidate("accelerometer_scale", vec![relative(0.03, 0.2)], &[&[0.0]]),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_scale = p[0],
        ),
        (
            candidate(
                "accelerometer_tilt",
                vec![signed("tilt", "rad/m", 0.004 / INCH, 0.05 / INCH)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_tilt = p[0],
        ),
        (
            candidate(
                "accelerometer_delay",
                vec![delay(period)],
                &[&[0.005], &[0.013]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.accelerometer_delay = p[0],
        ),
        (
            candidate("displacement_scale", vec![relative(0.03, 0.15)], &[&[0.0]]),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.displacement_scale = p[0],
        ),
        (
            candidate(
                "displacement_lag",
                vec![inverse("frequency", "Hz", 40.0, 6.0)],
                &[&[25.0], &[10.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.displacement_lag = p[0],
        ),
        (
            candidate("load_cell_scale", vec![relative(0.03, 0.2)], &[&[0.0]]),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.load_cell_scale = p[0],
        ),
        (
            candidate(
                "load_cell_bias",
                vec![signed("offset", "N", 0.3 * LBF, 4.0 * LBF)],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.sensors.load_cell_bias = p[0],
        ),
        (
            candidate(
                "mains_hum",
                vec![
                    signed("in_phase", "m/s^2", 1.5 * INCH, 15.0 * INCH),
                    signed("quadrature", "m/s^2", 1.5 * INCH, 15.0 * INCH),
                ],
                &[&[0.0, 0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.sensors.hum_amplitude = p[0].hypot(p[1]);
                rig.sensors.hum_phase = p[1].atan2(p[0]);
            },
        ),
        (
            candidate(
                "specimen_yielding",
                vec![
                    size(
                        "yield_displacement",
                        "m",
                        Scale::Logarithmic,
                        1.2 * INCH,
                        (0.1 * INCH, 4.0 * INCH),
                    ),
                    shape(
                        "post_yield_ratio",
                        "1",
                        Scale::Linear(0.01),
                        0.05,
                        4.0,
                        (-0.1, 0.5),
                    ),
                    shape("exponent", "1", Scale::Logarithmic, 3.0, 0.35, (0.8, 12.0)),
                ],
                &[
                    &[0.4 * INCH, 0.05, 3.0],
                    &[0.65 * INCH, 0.05, 3.0],
                    &[1.05 * INCH, 0.05, 3.0],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.yield_displacement = p[0];
                rig.effects.specimen.yield_post_ratio = p[1];
                rig.effects.specimen.yield_exponent = p[2];
            },
        ),
        (
            candidate(
                "specimen_stiffness",
                vec![relative(0.06, 0.35)],
                &[&[0.0], &[0.25], &[-0.25]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.specimen.stiffness_change = p[0],
        ),
        (
            candidate(
                "specimen_damping",
                vec![size(
                    "relative_change",
                    "1",
                    Scale::Factor(0.5),
                    0.5,
                    (-0.95, 12.0),
                )],
                &[&[0.0], &[1.0], &[2.5]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| rig.effects.specimen.damping_change = p[0],
        ),
        (
            candidate(
                "specimen_second_mode",
                vec![
                    size("frequency", "Hz", Scale::Logarithmic, 12.0, (2.0, 25.0)),
                    shape(
                        "damping_ratio",
                        "1",
                        Scale::Logarithmic,
                        0.03,
                        0.4,
                        (0.005, 0.2),
                    ),
                ],
                // A lightly damped mode is found from nearby only.
                &[4.2, 4.8, 5.5, 6.3, 7.2, 8.2, 9.4, 10.7, 12.0]
                    .map(|frequency| [frequency, 0.03])
                    .each_ref()
                    .map(<[f64; 2]>::as_slice),
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.second_mode_frequency = p[0];
                rig.effects.specimen.second_mode_damping_ratio = p[1];
            },
        ),
        (
            candidate(
                "specimen_degradation",
                vec![
                    positive("loss", "1", 0.1, 0.24),
                    shape(
                        "degradation_drift",
                        "m",
                        Scale::Logarithmic,
                        1.0 * INCH,
                        1.0,
                        (0.05 * INCH, 20.0 * INCH),
                    ),
                    shape("form", "1", Scale::Linear(1.0), 0.0, 1.0, (-2.0, 3.0)),
                ],
                &[
                    &[0.15, 0.8 * INCH, 0.0],
                    &[0.3, 0.8 * INCH, 0.0],
                    &[0.3, 0.8 * INCH, -1.0],
                    &[0.3, 0.8 * INCH, 1.0],
                ],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.degradation_loss = p[0];
                rig.effects.specimen.degradation_drift = p[1];
                rig.effects.specimen.degradation_form = if p[2].abs() < 1e-6 { 0.0 } else { p[2] };
            },
        ),
        (
            candidate(
                "specimen_uplift",
                vec![
                    size(
                        "uplift_displacement",
                        "m",
                        Scale::Logarithmic,
                        1.0 * INCH,
                        (0.08 * INCH, 3.0 * INCH),
                    ),
                    shape(
                        "post_uplift_ratio",
                        "1",
                        Scale::Linear(1.0),
                        0.3,
                        0.3,
                        (-0.1, 0.95),
                    ),
                ],
                &[&[0.3 * INCH, 0.3], &[0.55 * INCH, 0.3], &[0.9 * INCH, 0.3]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.uplift_displacement = p[0];
                rig.effects.specimen.uplift_post_ratio = p[1];
            },
        ),
        (
            candidate(
                "specimen_absent",
                vec![shape(
                    "sensor_share",
                    "1",
                    Scale::Linear(1.0),
                    0.0,
                    2.0,
                    (-0.5, 1.5),
                )],
                &[&[0.0]],
            ),
            |rig: &mut IdentifiedRig, p: &[f64]| {
                rig.effects.specimen.absent = true;
                rig.effects.specimen.absent_sensor_share = p[0];
            },
        ),
    ]
}
