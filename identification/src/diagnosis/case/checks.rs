//! What makes a record unfit for a diagnosis, said by name.

use super::nominal::Nominal;
use super::record::{CHANNELS, Record};

/// Shortest record that is looked at, samples.
const SHORTEST: usize = 500;
/// Standard deviations of the sensor's noise that the displacement must exceed.
const LEAST_EXCITATION: f64 = 8.0;
/// Equal readings in a row, at the channel's extreme, that betray a clipped sensor.
const CLIPPED_RUN: usize = 4;
/// Samples that may repeat the one before in every channel by chance (converters have steps).
const MOST_REPEATED: usize = 5;
/// Equal readings in a row that betray a frozen one.
const FROZEN_RUN: usize = 50;

/// Everything wrong with `record`, a sentence each; empty when it can be used.
pub fn problems(record: &Record, nominal: &Nominal) -> Vec<String> {
    let name = &record.name;
    let mut found = Vec::new();
    let n = record.len();
    for (what, column) in [
        ("time", &record.time),
        ("valve_command", &record.valve_command),
    ] {
        if column.is_empty() {
            found.push(format!(
                "{name}: column `{what}` is missing, nothing can be told without it"
            ));
        }
    }
    if record
        .channels
        .iter()
        .filter(|channel| !channel.is_empty())
        .count()
        < 2
    {
        found.push(format!(
            "{name}: at least two of {} are needed",
            CHANNELS.join(", ")
        ));
    }
    if !found.is_empty() {
        return found;
    }
    if n < SHORTEST {
        found.push(format!(
            "{name}: {n} samples are too few, at least {SHORTEST} are needed"
        ));
        return found;
    }
    found.extend(timing(record, nominal));
    for (channel, values) in CHANNELS.iter().zip(&record.channels) {
        found.extend(readings(name, channel, values, f64::INFINITY));
    }
    let limit = nominal.controller.map_or(f64::INFINITY, |law| law.limit);
    found.extend(readings(
        name,
        "valve_command",
        &record.valve_command,
        limit,
    ));
    if found.is_empty() {
        found.extend(held(record));
    }
    if let Some(limit) = nominal.controller.map(|law| law.limit) {
        let at_limit = record
            .valve_command
            .iter()
            .filter(|u| u.abs() > 0.999 * limit)
            .count();
        if at_limit > n / 4 {
            found.push(format!(
                "{name}: the valve command stands at its limit in {at_limit} of {n} samples, the \
                 rig was not under control"
            ));
        }
    }
    found
}

/// That `record` moves too little to tell anything, if it does. A low level is no fault of a record
/// that is there to show what happens at it: a table that sticks says something.
pub fn too_little_excitation(record: &Record, nominal: &Nominal) -> Option<String> {
    let displacement = &record.channels[0];
    let excitation = deviation(displacement) / nominal.noise[0];
    (!displacement.is_empty() && excitation < LEAST_EXCITATION).then(|| {
        format!(
            "{}: too little excitation, the displacement varies by {excitation:.1} standard \
             deviations of its noise, at least {LEAST_EXCITATION} are needed",
            record.name
        )
    })
}

fn timing(record: &Record, nominal: &Nominal) -> Option<String> {
    let name = &record.name;
    let period = 1.0 / nominal.sample_rate;
    let mut steps: Vec<f64> = record
        .time
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .collect();
    let irregular = steps
        .iter()
        .position(|step| !step.is_finite() || (step - period).abs() > 0.1 * period);
    steps.retain(|step| step.is_finite());
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN);
    if median.is_nan() || (median - period).abs() > 0.01 * period {
        return Some(format!(
            "{name}: sampled at {:.4} Hz, the nominal model says {} Hz",
            1.0 / median,
            nominal.sample_rate
        ));
    }
    let at = irregular?;
    let gap = record.time[at + 1] - record.time[at];
    Some(if gap > period {
        format!(
            "{name}: a gap after {:.4} s, about {:.0} samples were dropped",
            record.time[at],
            gap / period - 1.0
        )
    } else {
        format!(
            "{name}: time is no steady clock after {:.4} s (step {gap:.3e} s)",
            record.time[at]
        )
    })
}

/// What is wrong with the readings of a channel, which may well stand at `limit`.
fn readings(name: &str, channel: &str, values: &[f64], limit: f64) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(row) = values.iter().position(|value| !value.is_finite()) {
        let count = values.iter().filter(|value| !value.is_finite()).count();
        found.push(format!(
            "{name}: `{channel}` has {count} empty or non-finite readings, the first in sample {row}"
        ));
        return found;
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (mut run, mut start) = (1, 0);
    let mut clipped = 0;
    for k in 1..=values.len() {
        if k < values.len() && values[k] == values[k - 1] {
            run += 1;
            continue;
        }
        let value = values[k - 1];
        let is_extreme = (value == low || value == high) && high > low;
        if value.abs() >= limit {
            run = 1;
        }
        if run >= FROZEN_RUN && !is_extreme {
            found.push(format!(
                "{name}: `{channel}` is frozen at {value:.4e} for {run} samples from sample {start}"
            ));
            return found;
        }
        if run >= CLIPPED_RUN && is_extreme {
            clipped += run;
        }
        (run, start) = (1, k);
    }
    if clipped > 2 * CLIPPED_RUN && high > low {
        found.push(format!(
            "{name}: `{channel}` is clipped, {clipped} readings stand at its extremes {low:.4e} \
             and {high:.4e}"
        ));
    }
    found
}

/// Samples that repeat the one before in every channel: dropped ones that the acquisition filled.
fn held(record: &Record) -> Option<String> {
    let channels: Vec<&Vec<f64>> = record.channels.iter().filter(|c| !c.is_empty()).collect();
    let repeats = |k: &usize| {
        channels
            .iter()
            .all(|channel| channel[*k] == channel[*k - 1])
    };
    let repeated: Vec<usize> = (1..record.len()).filter(repeats).collect();
    let first = *repeated.first()?;
    (repeated.len() > MOST_REPEATED).then(|| {
        format!(
            "{}: {} samples repeat the one before in all channels, the first after {:.4} s: \
             dropped samples that were filled",
            record.name,
            repeated.len(),
            record.time[first]
        )
    })
}

/// How much louder than stated the noise of each channel is, from differences that leave next to
/// nothing of the motion; none where the channel is missing.
pub fn noise_ratios(record: &Record, nominal: &Nominal) -> [Option<f64>; 4] {
    std::array::from_fn(|i| {
        let channel = &record.channels[i];
        let n = channel.len().checked_sub(4).filter(|n| *n > 0)?;
        let sum: f64 = channel
            .windows(5)
            .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).powi(2))
            .sum();
        // Fourth differences of white noise have 70 times its variance.
        Some((sum / (70.0 * n as f64)).sqrt() / nominal.noise[i])
    })
}

/// Standard deviation.
pub fn deviation(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// What a missing channel takes away.
pub fn blind_spot(channel: usize) -> &'static str {
    match channel {
        0 => {
            "without displacement its sensor cannot be judged, slow drifts stay unseen and the \
             controller's law cannot be checked"
        }
        1 => {
            "without acceleration its sensor cannot be judged, and payload and friction are told \
             from the force alone"
        }
        2 => {
            "without actuator force the load cell cannot be judged, and what the valve does is \
             hard to tell from what the table does"
        }
        _ => {
            "without specimen acceleration the specimen is seen through its force on the table only"
        }
    }
}
