//! Recordings as scaled experiments, and the parameters that they share with starts and bounds.

use crate::IdentificationError;
use crate::data::{Channel, OUTPUT_NAMES, Recording, mean_and_deviation};
use crate::estimation::prediction::Parameter;
use crate::identify::model::{
    DELAY, Experiment, MASS, NUISANCE, OUTPUTS, PHYSICAL, PHYSICAL_NAMES, RigModel, SPECIMEN,
    STATES,
};
use crate::identify::start;

/// The same experiments to their end, with the scales of the fitted part.
pub(crate) fn whole_recordings(
    recordings: &[Recording],
    model: &RigModel,
) -> Result<RigModel, IdentificationError> {
    let mut experiments = Vec::new();
    for (recording, data) in recordings.iter().zip(&model.experiments) {
        let mut whole = scaled_experiment(recording, &recording.cut(0, data.command.len()))?;
        whole.scale = data.scale;
        whole.command_scale = data.command_scale;
        whole.specimen = data.specimen;
        experiments.push(whole);
    }
    Ok(RigModel { experiments })
}

/// One recording's fit part, scaled.
pub(crate) fn experiment(
    recording: &Recording,
    fit_part: f64,
) -> Result<Experiment, IdentificationError> {
    let fitted = recording.cut(0, (recording.len() as f64 * fit_part) as usize);
    scaled_experiment(&fitted, &fitted)
}

/// `recording` with the scales of `fitted`.
pub(crate) fn scaled_experiment(
    recording: &Recording,
    fitted: &Recording,
) -> Result<Experiment, IdentificationError> {
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
    Ok(Experiment {
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
    let s = &start.physical;
    let specimen = model.experiments.iter().any(|e| e.specimen);
    // What each coefficient is worth beside its neighbour at 0.01 to 5 rad/s.
    let natural = [
        s[0].abs().max(0.5 * s[1].abs().sqrt()),
        s[1].abs(),
        s[2].abs().max(0.01 * s[1].abs()),
        s[3].abs(),
        s[4].abs(),
        s[5].abs().max(0.01 * s[4].abs()),
        s[6].abs(),
        s[7].abs().max(5.0 * s[6].abs()),
        s[8].abs(),
        s[MASS],
        s[MASS + 1]
            .abs()
            .max(0.02 * (s[MASS] * s[MASS + 2].abs()).sqrt()),
        s[MASS + 2].abs(),
        s[SPECIMEN].abs(),
        s[SPECIMEN + 1]
            .abs()
            .max(0.01 * (s[SPECIMEN] * s[SPECIMEN + 2].abs()).sqrt()),
        s[SPECIMEN + 2].abs(),
        model.experiments[0].period,
    ];
    let mut parameters: Vec<Parameter> = (0..PHYSICAL)
        .map(|i| {
            let mut parameter = Parameter::new(PHYSICAL_NAMES[i], s[i], 0.1 * natural[i]);
            parameter.largest_step = natural[i].max(f64::MIN_POSITIVE);
            if (SPECIMEN..DELAY).contains(&i) {
                parameter.free = specimen && !specimen_known;
            }
            parameter
        })
        .collect();
    parameters[MASS].bounds = (1e-3 * s[MASS], 1e3 * s[MASS]);
    parameters[SPECIMEN].bounds = (1e-4 * s[MASS], 1e4 * s[MASS]);
    parameters[DELAY].free = delay;
    parameters[DELAY].largest_step = model.experiments[0].period;
    parameters[DELAY].bounds = (0.0, 0.1);
    for (index, data) in model.experiments.iter().enumerate() {
        let own = |name: &str, start: f64, scale: f64| {
            let mut parameter = Parameter::new(name, start, scale);
            parameter.experiment = Some(index);
            parameter
        };
        let earlier =
            (0..index).any(|before| recordings[before].source == recordings[index].source);
        let mut payload = own("payload", start.mass[index] - s[MASS], 0.1 * s[MASS]);
        payload.free = index > 0 && !earlier;
        if !payload.free {
            payload.start = 0.0;
        }
        payload.bounds = (-0.9 * s[MASS], 1e3 * s[MASS]);
        parameters.push(payload);
        for i in 0..OUTPUTS {
            let mut offset = own(&format!("{} offset", OUTPUT_NAMES[i]), 0.0, 1.0);
            offset.free = data.measured[i];
            parameters.push(offset);
        }
        for i in 0..STATES {
            let mut state = own("initial state", 0.0, 1.0);
            state.free = i < 5 || data.specimen;
            parameters.push(state);
        }
        for i in 0..OUTPUTS + 2 {
            let (start, low) = match i {
                0..OUTPUTS => {
                    let predicted = start.noise[index][i].clamp(1e-5, 0.3);
                    (predicted.ln(), (0.03 * predicted).max(1e-6).ln())
                }
                _ => (0.005f64.ln(), 1e-4f64.ln()),
            };
            let mut noise = own("logarithm of noise", start, 1.0);
            noise.free = i >= OUTPUTS || data.measured[i];
            noise.bounds = (low, 1f64.ln());
            noise.largest_step = 1.5;
            parameters.push(noise);
        }
        debug_assert_eq!(parameters.len(), PHYSICAL + (index + 1) * NUISANCE);
    }
    parameters
}
