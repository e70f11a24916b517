//! Frequency responses of the identified rig, beside those measured with their coherence.

use std::f64::consts::TAU;

use identification::data::{Channel, Recording};
use identification::estimation::frequency_response::{
    FrequencyResponseEstimate, direct, joint_input_output,
};
use identification::identify::identified::RigIdentification;
use plant::linear::{FrequencyResponse, TransferFunction, log_space};

use pages::report::{Abscissa, Axis, Panel, Section, Series, Style, Units};

/// Measured lines below this coherence are left out.
const LEAST_COHERENCE: f64 = 0.5;
/// Segments (before overlap) into which a recording is cut for averaging.
const SEGMENTS: usize = 6;
/// Frequencies shown, Hz.
const SHOWN: (f64, f64) = (0.02, 50.0);

/// Channel, row of the rig's outputs.
const CHANNELS: [(Channel, usize); 3] = [
    (Channel::Displacement, 0),
    (Channel::Acceleration, 2),
    (Channel::ActuatorForce, 3),
];

/// From the command to each channel of the longest recording, and G1 and G2 where they are
/// determined.
pub(super) fn section(found: &RigIdentification, recordings: &[Recording]) -> Section {
    let mut panels = Vec::new();
    let mut text = Vec::new();
    let longest = (0..recordings.len()).max_by_key(|&index| recordings[index].len());
    if let Some(index) = longest {
        let recording = &recordings[index];
        text.push(format!(
            "{}: from the command to each channel. Measured by averaged spectra, {}; lines with a \
             coherence below {LEAST_COHERENCE} are omitted.",
            recording.name,
            if recording.channel(Channel::Reference).is_some() {
                "with the reference as instrument (joint input-output), which feedback does not bias"
            } else {
                "directly: without a recorded `reference`, feedback biases them where noise dominates"
            }
        ));
        panels = measured(found, recording, index);
    }
    if found.identifiable {
        let actuator = found.rig().shake_table.actuator;
        panels.push(path("G1, command to force", &actuator.g1()));
        panels.push(path("G2, velocity to force", &actuator.g2()));
    }
    Section {
        heading: "Frequency responses".into(),
        text,
        panels,
        ..Section::default()
    }
}

fn measured(found: &RigIdentification, recording: &Recording, index: usize) -> Vec<Panel> {
    let payload = found.payload.get(index).map_or(0.0, |payload| payload.0);
    let specimen = found
        .model
        .experiments
        .get(index)
        .is_some_and(|experiment| experiment.specimen);
    let system = found
        .physical
        .rig(payload, specimen)
        .state_space()
        .sample(recording.period());
    let highest = SHOWN.1.min(0.5 / recording.period());
    let omega = log_space(TAU * SHOWN.0, TAU * highest, 400);
    let mut panels = Vec::new();
    let mut coherences = Vec::new();
    for (channel, row) in CHANNELS {
        let Some(estimate) = estimate(recording, channel) else {
            continue;
        };
        let model = FrequencyResponse::sampled(&omega, recording.period(), |z| {
            let value = system.evaluate(z).map(|matrix| matrix[(row, 0)]);
            value.unwrap_or(nalgebra::Complex::new(f64::NAN, f64::NAN))
        });
        let lines: Vec<usize> = (0..estimate.frequency.len())
            .filter(|&line| estimate.frequency[line] <= highest)
            .collect();
        let places: Vec<f64> = lines.iter().map(|&line| estimate.frequency[line]).collect();
        let gains = lines.iter().map(|&line| {
            if estimate.coherence[line] >= LEAST_COHERENCE {
                20.0 * estimate.response[line].norm().log10()
            } else {
                f64::NAN
            }
        });
        let at = || Abscissa::At(places.clone().into());
        let gains: Vec<f64> = gains.collect();
        // Two standard errors of the averaged spectra.
        let [low, high] = [-2.0, 2.0].map(|sign| -> Vec<f64> {
            let pairs = gains.iter().zip(&lines);
            pairs
                .map(|(gain, &line)| {
                    let factor = 1.0 + sign * estimate.relative_error[line];
                    gain + 20.0 * factor.max(0.05).log10()
                })
                .collect()
        });
        panels.push(gain_panel(
            &format!("valve_command to {}, gain", channel.name()),
            vec![
                Series::line("measured, 95 %", at(), low)
                    .styled(Style::Band(high))
                    .coloured(0),
                Series::line("measured", at(), gains)
                    .styled(Style::Points)
                    .coloured(0),
                Series::line("model", hertz(&omega), model.gain_db()).coloured(2),
            ],
        ));
        let phases = lines.iter().map(|&line| {
            if estimate.coherence[line] >= LEAST_COHERENCE {
                estimate.response[line].arg().to_degrees()
            } else {
                f64::NAN
            }
        });
        let of_model = model.value.iter().map(|value| value.arg().to_degrees());
        panels.push(Panel {
            title: format!("valve_command to {}, phase", channel.name()),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::linear("phase", Units::DEGREE).between(-185.0, 185.0),
            series: vec![
                Series::line("measured", at(), phases.collect())
                    .styled(Style::Points)
                    .coloured(0),
                Series::line("model", hertz(&omega), of_model.collect())
                    .styled(Style::Points)
                    .coloured(2),
            ],
        });
        coherences.push(Series::line(
            channel.name(),
            Abscissa::At(places.into()),
            lines.iter().map(|&line| estimate.coherence[line]).collect(),
        ));
    }
    if !coherences.is_empty() {
        panels.push(Panel {
            title: "Coherence".into(),
            x: Axis::logarithmic("frequency", Units::FREQUENCY),
            y: Axis::linear("coherence", Units::NONE).between(0.0, 1.05),
            series: coherences,
        });
    }
    panels
}

/// None where the recording is too short to average.
fn estimate(recording: &Recording, channel: Channel) -> Option<FrequencyResponseEstimate> {
    let segment = (recording.len() / SEGMENTS).max(1);
    let segment = 1 << segment.ilog2();
    let command = recording.channel(Channel::ValveCommand)?;
    let output = recording.channel(channel)?;
    match recording.channel(Channel::Reference) {
        Some(reference) => {
            joint_input_output(reference, command, output, recording.period(), segment).ok()
        }
        None => direct(command, output, recording.period(), segment).ok(),
    }
}

fn path(title: &str, path: &TransferFunction) -> Panel {
    let omega = log_space(TAU * SHOWN.0, TAU * SHOWN.1, 300);
    let response = FrequencyResponse::continuous(&omega, |s| path.evaluate(s));
    gain_panel(
        title,
        vec![Series::line("model", hertz(&omega), response.gain_db()).coloured(2)],
    )
}

fn gain_panel(title: &str, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        x: Axis::logarithmic("frequency", Units::FREQUENCY),
        y: Axis::linear("gain (SI)", Units::DECIBEL),
        series,
    }
}

fn hertz(omega: &[f64]) -> Abscissa {
    Abscissa::At(omega.iter().map(|w| w / TAU).collect())
}
