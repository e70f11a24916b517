//! Recordings scaled for the model, and the parameters that they share with starts and bounds.

use crate::identify::model::{RigModel, SPECIMEN_STATES, ScaledRecording};
use crate::identify::parameters::{NoiseOn, OUTPUTS, Own, Physical};
use crate::identify::start;
use recordings::IdentificationError;
use recordings::{Channel, OUTPUT_NAMES, Recording, mean_and_deviation};
use sysid::prediction::Parameter;

/// The same experiments to their end, with the scales of the fitted part.
pub(crate) fn whole_recordings(
    recordings: &[Recording],
    model: &RigModel,
) -> Result<RigModel, IdentificationError> {
    let mut experiments = Vec::new();
    for (recording, data) in recordings.iter().zip(&model.experiments) {
        let mut whole = scaled(recording, &recording.cut(0, data.command.len()))?;
        whole.scale = data.scale;
        whole.command_scale = data.command_scale;
        whole.specimen = data.specimen;
        experiments.push(whole);
    }
    Ok(RigModel { experiments })
}

/// One recording's fit part, scaled.
pub(crate) fn fit_part(
    recording: &Recording,
    part: f64,
) -> Result<ScaledRecording, IdentificationError> {
    let fitted = recording.cut(0, (recording.len() as f64 * part) as usize);
    scaled(&fitted, &fitted)
}

/// `recording` with the scales of `fitted`.
pub(crate) fn scaled(
    recording: &Recording,
    fitted: &Recording,
) -> Result<ScaledRecording, IdentificationError> {
    const NEEDED: &str = "valve_command, displacement, acceleration, actuator_force and, with a specimen, \
         specimen_acceleration";
    let command = fitted.require(Channel::ValveCommand, NEEDED)?;
    let command_scale = mean_and_deviation(command).1;
    let mut scale = [1.0; OUTPUTS];
    let mut measured = [true; OUTPUTS];
    for (i, channel) in Channel::OUTPUTS.into_iter().enumerate() {
        let optional = channel == Channel::SpecimenAcceleration;
        if optional && fitted.channel(channel).is_none() {
            measured[i] = false;
        } else {
            scale[i] = mean_and_deviation(fitted.require(channel, NEEDED)?).1;
        }
    }
    let specimen = measured[OUTPUTS - 1];
    let channels = Channel::OUTPUTS.map(|channel| recording.samples(channel));
    let outputs = (0..recording.len())
        .map(|k| {
            nalgebra::SVector::from_fn(|i, _| {
                channels[i].get(k).map_or(0.0, |value| value / scale[i])
            })
        })
        .collect();
    Ok(ScaledRecording {
        name: recording.name.clone(),
        period: recording.period(),
        command: recording.samples(Channel::ValveCommand).to_vec(),
        outputs,
        scale,
        command_scale,
        measured,
        specimen,
    })
}

/// All parameters with start, scale and bounds; those of a known specimen are held.
pub(crate) fn parameters(
    model: &RigModel,
    start: &start::Start,
    recordings: &[Recording],
    specimen_known: bool,
    delay: bool,
) -> Vec<Parameter> {
    use Physical::*;
    let s = &start.physical;
    let specimen = model.experiments.iter().any(|e| e.specimen);
    let period = model.experiments[0].period;
    let critical = |mass: Physical, stiffness: Physical| (s[mass] * s[stiffness].abs()).sqrt();
    // What each coefficient is worth beside its neighbour at 0.01 to 5 rad/s.
    let natural = |parameter: Physical| match parameter {
        A2 => s[A2].abs().max(0.5 * s[A1].abs().sqrt()),
        A0 => s[A0].abs().max(0.01 * s[A1].abs()),
        B0 => s[B0].abs().max(0.01 * s[B1].abs()),
        E1 => s[E1].abs().max(5.0 * s[E2].abs()),
        TableMass => s[TableMass],
        TableDamping => s[TableDamping]
            .abs()
            .max(0.02 * critical(TableMass, TableStiffness)),
        SpecimenDamping => s[SpecimenDamping]
            .abs()
            .max(0.01 * critical(SpecimenMass, SpecimenStiffness)),
        CommandDelay => period,
        A1 | B2 | B1 | E2 | E0 | TableStiffness | SpecimenMass | SpecimenStiffness => {
            s[parameter].abs()
        }
    };
    let physical = |name: &Physical| {
        let natural = natural(*name);
        let mut parameter = Parameter::new(name.name(), s[*name], 0.1 * natural);
        parameter.largest_step = natural.max(f64::MIN_POSITIVE);
        if Physical::SPECIMEN.contains(name) {
            parameter.free = specimen && !specimen_known;
        }
        match name {
            TableMass => parameter.bounds = (1e-3 * s[TableMass], 1e3 * s[TableMass]),
            SpecimenMass => parameter.bounds = (1e-4 * s[TableMass], 1e4 * s[TableMass]),
            CommandDelay => {
                parameter.free = delay;
                parameter.largest_step = period;
                parameter.bounds = (0.0, 0.1);
            }
            _ => {}
        }
        parameter
    };
    let mut parameters: Vec<Parameter> = Physical::ALL.iter().map(physical).collect();
    for (index, data) in model.experiments.iter().enumerate() {
        let earlier =
            (0..index).any(|before| recordings[before].source == recordings[index].source);
        let own = Own::all().map(|own| {
            let mut parameter = match own {
                Own::Payload => payload(start, index, index > 0 && !earlier),
                Own::Offset(output) => {
                    let name = format!("{} offset", OUTPUT_NAMES[output]);
                    let mut offset = Parameter::new(&name, 0.0, 1.0);
                    offset.free = data.measured[output];
                    offset
                }
                Own::InitialState(state) => {
                    let mut initial = Parameter::new("initial state", 0.0, 1.0);
                    initial.free = state < SPECIMEN_STATES || data.specimen;
                    initial
                }
                Own::LogNoise(on) => log_noise(on, &start.noise[index], data),
            };
            parameter.experiment = Some(index);
            parameter
        });
        parameters.extend(own);
    }
    parameters
}

fn payload(start: &start::Start, experiment: usize, free: bool) -> Parameter {
    let mass = start.physical[Physical::TableMass];
    let carried = start.mass[experiment] - mass;
    let mut payload = Parameter::new("payload", if free { carried } else { 0.0 }, 0.1 * mass);
    payload.free = free;
    payload.bounds = (-0.9 * mass, 1e3 * mass);
    payload
}

fn log_noise(on: NoiseOn, predicted: &[f64; OUTPUTS], data: &ScaledRecording) -> Parameter {
    let (free, start, low) = match on {
        NoiseOn::Output(output) => {
            let predicted = predicted[output].clamp(1e-5, 0.3);
            (
                data.measured[output],
                predicted,
                (0.03 * predicted).max(1e-6),
            )
        }
        NoiseOn::Command | NoiseOn::Table => (true, 0.005, 1e-4),
    };
    let mut noise = Parameter::new("logarithm of noise", start.ln(), 1.0);
    noise.free = free;
    noise.bounds = (low.ln(), 1f64.ln());
    noise.largest_step = 1.5;
    noise
}
