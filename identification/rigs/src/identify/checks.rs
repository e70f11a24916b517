//! Recordings from which no rig can be identified, reported before any fit.

use recordings::IdentificationError;
use recordings::{Channel, Recording, mean_and_deviation};
use sysid::frequency_response::excited_band;
use sysid::least_squares::reduce;

/// Parameters of an experiment at most: nine of the actuator, three of the table, three of the
/// specimen, offsets, initial state and noise.
const PARAMETERS: usize = 33;
/// Samples needed for each.
const SAMPLES_A_PARAMETER: usize = 40;
/// A command that its past and the outputs explain to this part of its size is pure feedback.
const FEEDBACK: f64 = 1e-4;

/// What must have been measured on any rig.
const OUTPUTS: [Channel; 3] = [
    Channel::Displacement,
    Channel::Acceleration,
    Channel::ActuatorForce,
];

/// Checks one recording; returns warnings.
///
/// # Errors
/// Too short, no excitation, too few frequencies, pure feedback.
pub(crate) fn check(
    recording: &Recording,
    fit_part: f64,
) -> Result<Vec<String>, IdentificationError> {
    const NEEDED: &str = "valve_command, displacement, acceleration and actuator_force";
    let name = &recording.name;
    let needed = (SAMPLES_A_PARAMETER * PARAMETERS) as f64 / fit_part;
    if (recording.len() as f64) < needed {
        return Err(IdentificationError::TooShort {
            recording: name.clone(),
            samples: recording.len(),
            parameters: PARAMETERS,
            needed: needed.ceil() as usize,
            seconds: needed * recording.period(),
        });
    }
    let command =
        recording
            .require(Channel::ValveCommand, NEEDED)
            .map_err(|error| match error {
                IdentificationError::ConstantChannel { value, .. } => {
                    IdentificationError::NoExcitation {
                        recording: name.clone(),
                        what: format!("valve_command is constant at {value:.4} V"),
                    }
                }
                other => other,
            })?;
    for channel in OUTPUTS {
        let values = recording.require(channel, NEEDED)?;
        let noise = high_frequency_noise(values);
        let (_, size) = mean_and_deviation(values);
        if noise > 0.5 * size {
            return Err(IdentificationError::NoExcitation {
                recording: name.clone(),
                what: format!(
                    "`{}` is mostly noise (root mean square {size:.3e}, white noise \
                     {noise:.3e}, SI)",
                    channel.name()
                ),
            });
        }
    }
    motion(recording)?;
    feedback(recording, command)?;
    excitation(recording, command)
}

/// Standard deviation of white noise under a smooth signal, by third differences.
fn high_frequency_noise(values: &[f64]) -> f64 {
    let square: f64 = values
        .windows(4)
        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2))
        .sum();
    (square / (20.0 * values.len().max(1) as f64)).sqrt()
}

/// Corner of the low-pass behind which channels of one motion are compared, rad/s.
const CORNER: f64 = 2.0 * std::f64::consts::PI * 3.0;
/// Correlation from which two channels belong together, whatever their scale.
const RELATED: f64 = 0.8;

/// `values`, sampled every `period` s, behind the low-pass, and the second derivative of that.
fn low_passed(values: &[f64], period: f64) -> [Vec<f64>; 2] {
    let mut state = (values.first().copied().unwrap_or(0.0), 0.0);
    let mut both = [Vec::new(), Vec::new()];
    for &value in values {
        let second = CORNER * (CORNER * (value - state.0) - 1.4 * state.1);
        both[0].push(state.0);
        both[1].push(second);
        state.1 += period * second;
        state.0 += period * state.1;
    }
    both
}

/// Correlation of two series and the second over the first by least squares.
fn related(first: &[f64], second: &[f64]) -> (f64, f64) {
    let (mean, size) = mean_and_deviation(first);
    let (other_mean, other_size) = mean_and_deviation(second);
    let products = first
        .iter()
        .zip(second)
        .map(|(a, b)| (a - mean) * (b - other_mean));
    let together = products.sum::<f64>() / first.len().max(1) as f64;
    (together / (size * other_size), together / (size * size))
}

/// Whether acceleration and displacement are of one motion (the one the other's second derivative,
/// within a factor of two), and the displacement goes where the reference asks it to.
fn motion(recording: &Recording) -> Result<(), IdentificationError> {
    let period = recording.period();
    let [x, a, reference] = [
        Channel::Displacement,
        Channel::Acceleration,
        Channel::Reference,
    ]
    .map(|channel| low_passed(recording.channel(channel).unwrap_or_default(), period));
    let (correlation, ratio) = related(&x[1], &a[0]);
    let what = if correlation < -RELATED && (0.5..2.0).contains(&-ratio) {
        "`acceleration` and `displacement` have opposite signs: one is the second derivative of \
         the other with the wrong sign"
            .into()
    } else if correlation.abs() > RELATED && !(0.5..2.0).contains(&ratio) {
        format!(
            "`acceleration` is {ratio:.3e} times the second derivative of `displacement` instead \
             of once"
        )
    } else if related(&x[0], &reference[0]).0 < -RELATED {
        "`displacement` has the opposite sign of `reference`".into()
    } else {
        return Ok(());
    };
    Err(IdentificationError::Contradiction {
        recording: recording.name.clone(),
        what,
    })
}

/// Whether the command is a fixed function of its own past and of the outputs.
fn feedback(recording: &Recording, command: &[f64]) -> Result<(), IdentificationError> {
    let outputs: Vec<&[f64]> = OUTPUTS
        .into_iter()
        .filter_map(|channel| recording.channel(channel))
        .collect();
    let count = 3 + 2 * outputs.len();
    let all = reduce(command.len() - 2, count, 1, |k, row| {
        let k = k + 2;
        row[0] = command[k - 1];
        row[1] = command[k - 2];
        row[2] = 1.0;
        for (i, output) in outputs.iter().enumerate() {
            row[3 + 2 * i] = output[k];
            row[4 + 2 * i] = output[k - 1];
        }
        row[count] = command[k];
    });
    let (law, _) = all.solve(1e-12)?;
    let square: f64 = (2..command.len())
        .map(|k| {
            let mut rest = command[k] - law[0] * command[k - 1] - law[1] * command[k - 2] - law[2];
            for (i, output) in outputs.iter().enumerate() {
                rest -= law[3 + 2 * i] * output[k] + law[4 + 2 * i] * output[k - 1];
            }
            rest * rest
        })
        .sum();
    let residual = (square / command.len() as f64).sqrt() / mean_and_deviation(command).1;
    if residual < FEEDBACK {
        return Err(IdentificationError::FeedbackOnly {
            recording: recording.name.clone(),
            residual,
        });
    }
    Ok(())
}

/// Frequencies that the command holds.
fn excitation(recording: &Recording, command: &[f64]) -> Result<Vec<String>, IdentificationError> {
    let segment = (command.len() / 4).clamp(64, 8192);
    let (low, high, lines) = excited_band(command, recording.period(), segment, 1e-6)?;
    let width = 1.0 / (segment as f64 * recording.period());
    // A Hann window spreads one line over some ten at this depth.
    if lines <= 24 {
        return Err(IdentificationError::RankDeficient {
            what: format!(
                "{}: the command has {lines} lines of {width:.3} Hz between {low:.2} and \
                 {high:.2} Hz, too few frequencies for fifteen parameters",
                recording.name
            ),
            remedy: "excite with band-limited noise, a sweep or an earthquake instead of a sine"
                .into(),
        });
    }
    let mut warnings = Vec::new();
    if high < 20.0 {
        warnings.push(format!(
            "{}: the excitation ends at {high:.1} Hz; the oil column (near 18 Hz on the thesis's \
             rig) is only partly excited",
            recording.name
        ));
    }
    Ok(warnings)
}
