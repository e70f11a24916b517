//! What the channels show instead of the truth, as parameters of the [`Instrumentation`].
//!
//! [`Instrumentation`]: crate::sensors::instrumentation::Instrumentation

use super::quantity::{ACCELERATION, ANGLE, FORCE, FREQUENCY, RATIO, TILT, TIME_CONSTANT};
use super::{Component, Effect, Parameter, Reporting};
use units::constants::{INCH, LBF};
use units::vocabulary;

const fn effect(name: &'static str) -> Effect {
    Effect {
        is_linear: true,
        ..Effect::new(name, Component::Instrumentation)
    }
}

/// The effects on the sensors; their parameters on a channel are described by the FMU's channels.
pub const EFFECTS: &[Effect] = &[
    Effect {
        equation: "y = a + b",
        sentence: "the table's accelerometer has an offset of {}",
        parameters: &[Parameter::new("offset", ACCELERATION, "offset")
            .signed(1.5 * INCH, 15.0 * INCH)
            .on_sensors(|s| &mut s.acceleration.bias)],
        starts: &[&[0.0]],
        is_linear: false,
        ..effect("accelerometer_bias")
    },
    Effect {
        equation: "y = (1 + p) a",
        sentence: "the scale of the table's accelerometer is off by {}",
        parameters: &[
            Parameter::new("relative_change", RATIO, "relative error of the scale")
                .relative(0.03, 0.2)
                .on_sensors(|s| &mut s.acceleration.scale_error),
        ],
        starts: &[&[0.0]],
        ..effect("accelerometer_scale")
    },
    Effect {
        equation: "y = a + g tilt x",
        sentence: "the table pitches as it moves, by {}",
        parameters: &[
            Parameter::new("tilt", TILT, "Pitch of the table per displacement")
                .signed(0.004 / INCH, 0.05 / INCH)
                .on_sensors(|s| &mut s.accelerometer_tilt),
        ],
        starts: &[&[0.0]],
        ..effect("accelerometer_tilt")
    },
    Effect {
        equation: "y(t) = a(t - T)",
        sentence: "the channel of the table's accelerometer is {} late",
        parameters: &[Parameter::new("delay", TIME_CONSTANT, "lateness")
            .delay()
            .on_sensors(|s| &mut s.acceleration.delay)],
        starts: &[&[0.005], &[0.013]],
        ..effect("accelerometer_delay")
    },
    Effect {
        equation: "y = (1 + p) x",
        sentence: "the scale of the displacement sensor is off by {}",
        parameters: &[
            Parameter::new("relative_change", RATIO, "relative error of the scale")
                .relative(0.03, 0.15)
                .on_sensors(|s| &mut s.displacement.scale_error),
        ],
        starts: &[&[0.0]],
        ..effect(vocabulary::DISPLACEMENT_SCALE)
    },
    Effect {
        equation: "y' = 2 pi f (x - y)",
        sentence: "the displacement sensor lags, with a corner at {}",
        parameters: &[
            Parameter::new("frequency", FREQUENCY, "corner of the first-order lag")
                .inverse(40.0, 6.0)
                .on_sensors(|s| &mut s.displacement.corner),
        ],
        starts: &[&[25.0], &[10.0]],
        ..effect("displacement_lag")
    },
    Effect {
        equation: "y = (1 + p) F",
        sentence: "the scale of the load cell is off by {}",
        parameters: &[
            Parameter::new("relative_change", RATIO, "relative error of the scale")
                .relative(0.03, 0.2)
                .on_sensors(|s| &mut s.actuator_force.scale_error),
        ],
        starts: &[&[0.0]],
        ..effect("load_cell_scale")
    },
    Effect {
        equation: "y = F + b",
        sentence: "the load cell has an offset of {}",
        parameters: &[Parameter::new("offset", FORCE, "offset")
            .signed(0.3 * LBF, 4.0 * LBF)
            .on_sensors(|s| &mut s.actuator_force.bias)],
        starts: &[&[0.0]],
        is_linear: false,
        ..effect("load_cell_bias")
    },
    Effect {
        equation: "y = a + A sin(2 pi f t + phi)",
        sentence: "the table's accelerometer picks up the mains with {}",
        parameters: &[
            // Linear in what is estimated, unlike amplitude and phase.
            Parameter::new("in_phase", ACCELERATION, "A cos(phi)")
                .signed(1.5 * INCH, 15.0 * INCH)
                .without_variable(),
            Parameter::new("quadrature", ACCELERATION, "A sin(phi)")
                .signed(1.5 * INCH, 15.0 * INCH)
                .without_variable(),
            Parameter::new("amplitude", ACCELERATION, "amplitude of the mains")
                .on_sensors(|s| &mut s.acceleration.hum_amplitude)
                .switch(),
            Parameter::new("frequency", FREQUENCY, "frequency of the mains")
                .on_sensors(|s| &mut s.acceleration.hum_frequency),
            Parameter::new("phase", ANGLE, "phase of the mains at time zero")
                .on_sensors(|s| &mut s.acceleration.hum_phase),
        ],
        starts: &[&[0.0, 0.0]],
        is_linear: false,
        settle: |_, sensors, values| {
            if let [in_phase, quadrature] = *values {
                sensors.acceleration.hum_amplitude = in_phase.hypot(quadrature);
                sensors.acceleration.hum_phase = quadrature.atan2(in_phase);
            }
        },
        reporting: Reporting::AmplitudeAndPhase,
        ..effect("mains_hum")
    },
];
