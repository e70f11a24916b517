//! What makes a recording unfit for a diagnosis, said by name.

use super::nominal::Nominal;
use recordings::clipping::{Clipped, RUN};
use recordings::{Channel, OUTPUT_NAMES, Recording, RoundedStamps, TimeBase, mean_and_deviation};

/// Shortest recording that is looked at, samples.
const SHORTEST: usize = 500;
/// Standard deviations of the sensor's noise that the displacement must exceed.
const LEAST_EXCITATION: f64 = 8.0;
/// Samples that may repeat the one before in every channel without being looked at.
const MOST_REPEATED: usize = 5;
/// Samples over which a channel repeats itself about equally often.
const REPEATS_EVENLY: usize = 250;
/// Steps of a coarse converter at either end whose readings are compared with the extreme ones.
const STEPS_BESIDE: usize = 3;
/// Equal readings in a row that betray a frozen one.
const FROZEN_RUN: usize = 50;
/// Steps of a converter that a channel changes by when it was frozen while the motion went on.
const LEAP: f64 = 2.5;

/// Everything wrong with `recording`, a sentence each; empty when it can be used.
pub fn problems(recording: &Recording, nominal: &Nominal) -> Vec<String> {
    let name = &recording.name;
    let mut found = Vec::new();
    let n = recording.len();
    for (channel, is_missing) in [
        (Channel::Time, recording.time == TimeBase::Unknown),
        (
            Channel::ValveCommand,
            recording.channel(Channel::ValveCommand).is_none(),
        ),
    ] {
        if is_missing {
            found.push(format!(
                "{name}: column `{}` is missing and is required",
                channel.name()
            ));
        }
    }
    let there = |channel: &&Channel| recording.channel(**channel).is_some();
    if Channel::OUTPUTS.iter().filter(there).count() < 2 {
        found.push(format!(
            "{name}: at least two of {} are needed",
            OUTPUT_NAMES.join(", ")
        ));
    }
    if !found.is_empty() {
        if !recording.left_alone.is_empty() {
            found.push(format!(
                "{name}: {} are not names of channels and are ignored; name their channels with \
                 `--columns MAP.toml`",
                recording.left_alone.join(", ")
            ));
        }
        return found;
    }
    if n < SHORTEST {
        found.push(format!(
            "{name}: {n} samples are too few, at least {SHORTEST} are needed"
        ));
        return found;
    }
    found.extend(timing(recording, nominal));
    let rail = rail(recording, nominal);
    for channel in Channel::OUTPUTS.into_iter().chain([Channel::ValveCommand]) {
        let limit = match channel {
            Channel::ValveCommand => rail,
            _ => f64::INFINITY,
        };
        let values = recording.samples(channel);
        found.extend(readings(name, channel.name(), values, limit));
    }
    if found.is_empty() {
        found.extend(held(recording));
    }
    let at_rail = at_rail(recording, rail);
    if at_rail > n / 4 {
        found.push(format!(
            "{name}: the valve command is at its limit in {at_rail} of {n} samples, so the \
             rig was not under control"
        ));
    }
    found
}

/// Where the drive's output ends, V: as stated, or the largest command recorded.
fn rail(recording: &Recording, nominal: &Nominal) -> f64 {
    let commands = recording.samples(Channel::ValveCommand).iter();
    let largest = || commands.fold(0.0, |most: f64, u| most.max(u.abs()));
    nominal.controller.map_or_else(largest, |law| law.limit)
}

fn at_rail(recording: &Recording, rail: f64) -> usize {
    let commands = recording.samples(Channel::ValveCommand).iter();
    commands.filter(|u| u.abs() > 0.999 * rail).count()
}

/// That the command dwells at a rail that nobody stated, if it does.
pub fn unstated_rail(recording: &Recording, nominal: &Nominal) -> Option<String> {
    let rail = rail(recording, nominal);
    let count = at_rail(recording, rail);
    (nominal.controller.is_none() && count > 2 * RUN).then(|| {
        format!(
            "{}: the valve command is at {rail:.4} V in {count} samples, which is taken for the end of the \
             drive's output; if it is that of the recorder's range, record with a larger one",
            recording.name
        )
    })
}

/// That `recording` moves too little to tell anything, if it does. A low level is no fault of one
/// that is there to show what happens at it: a table that sticks says something.
pub fn too_little_excitation(recording: &Recording, nominal: &Nominal) -> Option<String> {
    let displacement = recording.samples(Channel::Displacement);
    let (_, deviation) = mean_and_deviation(displacement);
    let excitation = deviation / nominal.noise[0];
    (!displacement.is_empty() && excitation < LEAST_EXCITATION).then(|| {
        format!(
            "{}: too little excitation, the displacement varies by {excitation:.1} standard \
             deviations of its noise, at least {LEAST_EXCITATION} are needed",
            recording.name
        )
    })
}

/// What is wrong with the clock, if anything. Stamps may be rounded, as long as the nominal rate
/// explains them.
fn timing(recording: &Recording, nominal: &Nominal) -> Option<String> {
    let name = &recording.name;
    let period = 1.0 / nominal.sample_rate;
    let time: Vec<f64> = (0..recording.len()).map(|k| recording.time_at(k)).collect();
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let irregular = steps
        .iter()
        .position(|step| !step.is_finite() || (step - period).abs() > 0.1 * period);
    let rounded = irregular.and_then(|_| RoundedStamps::of(&time, Some(period)));
    if rounded.is_some_and(|rounded| rounded.period == Some(period)) {
        return None;
    }
    let repeats = steps.contains(&0.0);
    steps.retain(|step| step.is_finite());
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN);
    let sampled = match rounded {
        Some(RoundedStamps { step, period: None }) if repeats => {
            return Some(format!(
                "{name}: time stamps repeat: they are rounded to {step} s, and {} Hz from the \
                 nominal model does not explain them all; samples are missing, or the rate differs",
                nominal.sample_rate
            ));
        }
        Some(RoundedStamps {
            period: Some(even), ..
        }) if repeats => even,
        _ => median,
    };
    if sampled.is_nan() || (sampled - period).abs() > 0.01 * period {
        return Some(if sampled > 0.0 {
            format!(
                "{name}: sampled at {:.4} Hz, but the nominal model has {} Hz",
                1.0 / sampled,
                nominal.sample_rate
            )
        } else {
            format!("{name}: time does not increase, expected stamps every {period} s")
        });
    }
    let at = irregular?;
    let gap = time[at + 1] - time[at];
    Some(if gap > period {
        format!(
            "{name}: a gap after {:.4} s, about {:.0} samples were dropped",
            time[at],
            gap / period - 1.0
        )
    } else if gap < 0.0 {
        format!(
            "{name}: time goes back by {:.4} s after {:.4} s: expected one recording per file",
            -gap, time[at]
        )
    } else {
        format!(
            "{name}: time stamps are irregular after {:.4} s (step {gap:.3e} s)",
            time[at]
        )
    })
}

/// What is wrong with the readings of a channel, which may be at `limit`.
fn readings(name: &str, channel: &str, values: &[f64], limit: f64) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(row) = values.iter().position(|value| !value.is_finite()) {
        let count = values.iter().filter(|value| !value.is_finite()).count();
        found.push(format!(
            "{name}: `{channel}` has {count} empty or non-finite readings, the first in sample {row}"
        ));
        return found;
    }
    let clipped = Clipped::of(values, limit);
    let [low, high] = clipped.extremes;
    // Where a converter's steps are coarse, readings repeat wherever the motion turns or rests, as often
    // a few steps below the extremes.
    let mut levels = values.to_vec();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let ends = levels.len().saturating_sub(1).min(STEPS_BESIDE);
    let next_to_low = levels.get(ends).copied().unwrap_or(high);
    let next_to_high = levels
        .len()
        .checked_sub(1 + ends)
        .map_or(low, |place| levels[place]);
    let (mut run, mut start) = (1, 0usize);
    let mut beside = 0;
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
        // A coarse converter repeats itself while the motion rests, and then goes on by a step.
        let leaps = || {
            let neighbours = [start.checked_sub(1), Some(k)].into_iter().flatten();
            let mut neighbours = neighbours.filter_map(|place| values.get(place));
            neighbours.any(|neighbour| (neighbour - value).abs() > LEAP * clipped.step)
        };
        if run >= FROZEN_RUN && !is_extreme && leaps() {
            found.push(format!(
                "{name}: `{channel}` is frozen at {value:.4e} for {run} samples from sample {start}"
            ));
            return found;
        }
        if run >= RUN && !is_extreme && (value >= next_to_high || value <= next_to_low) {
            beside += run;
        }
        (run, start) = (1, k);
    }
    if clipped.samples > 2 * (RUN + beside) {
        found.push(format!(
            "{name}: `{channel}` is clipped, {} readings are at its extremes {low:.4e} and \
             {high:.4e} (SI): record a smaller motion, or with a larger range of the channel",
            clipped.samples
        ));
    }
    found
}

/// Samples that repeat the one before in every channel: dropped ones that the acquisition filled.
fn held(recording: &Recording) -> Option<String> {
    let channels: Vec<&[f64]> = Channel::OUTPUTS
        .into_iter()
        .filter_map(|channel| recording.channel(channel))
        .collect();
    let same = |channel: &&[f64], k: usize| channel[k] == channel[k - 1];
    let all: Vec<usize> = (1..recording.len()).collect();
    let repeats = |k: &&usize| channels.iter().all(|channel| same(channel, **k));
    let repeated: Vec<usize> = all.iter().filter(repeats).copied().collect();
    let first = *repeated.first()?;
    // A converter with steps as coarse as the noise repeats readings too, each channel by itself.
    let by_chance = |block: &[usize]| -> f64 {
        let n = block.len() as f64;
        let shares = channels.iter().map(|channel| {
            let count = block.iter().filter(|k| same(channel, **k)).count();
            count as f64 / n
        });
        n * shares.product::<f64>()
    };
    let by_chance: f64 = all.chunks(REPEATS_EVENLY).map(by_chance).sum();
    (repeated.len() as f64 > MOST_REPEATED as f64 + 3.0 * by_chance).then(|| {
        format!(
            "{}: {} samples repeat the one before in all channels, the first after {:.4} s: \
             dropped samples that were filled",
            recording.name,
            repeated.len(),
            recording.time_at(first)
        )
    })
}

/// How much louder than stated the noise of each channel is, from differences that leave next to
/// nothing of the motion; none where the channel is missing.
pub fn noise_ratios(recording: &Recording, nominal: &Nominal) -> [Option<f64>; 4] {
    std::array::from_fn(|i| {
        let channel = recording.samples(Channel::OUTPUTS[i]);
        let n = channel.len().checked_sub(4).filter(|n| *n > 0)?;
        let sum: f64 = channel
            .windows(5)
            .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).powi(2))
            .sum();
        // Fourth differences of white noise have 70 times its variance.
        Some((sum / (70.0 * n as f64)).sqrt() / nominal.noise[i])
    })
}

/// What a missing channel takes away.
pub fn blind_spot(channel: Channel) -> &'static str {
    match channel {
        Channel::Displacement => {
            "without displacement its sensor cannot be checked, slow drifts are not visible and \
             the controller's law cannot be checked"
        }
        Channel::Acceleration => {
            "without acceleration its sensor cannot be checked, and payload and friction follow \
             from the force only"
        }
        Channel::ActuatorForce => {
            "without actuator force the load cell cannot be checked, and effects of the valve and \
             of the table are hard to separate"
        }
        _ => {
            "without specimen acceleration the specimen is visible only through its force on the \
             table"
        }
    }
}
