//! The command that acted, from a record of it.

use recordings::{Channel, Recording};
use sysid::least_squares;
use sysid::rounding::{self, Coarse};

use crate::case::{ControlLaw, Nominal};

/// R5 fires, and the recorded command is used, where it misses the law by more than this many
/// standard deviations of its noise.
const LAW_HOLDS_WITHIN: f64 = 4.0;
/// Error of a law that was found from the record, in those of the converter, up to which it made the command.
const SHOWN_WITHIN: f64 = 1.5;
/// Shares of the newest difference in a filtered velocity among which that of a law is looked for.
const FILTERS: [f64; 8] = [0.05, 0.1, 0.17, 0.25, 0.35, 0.5, 0.7, 1.0];
/// Samples of a fit to every parameter of a law at least.
const A_PARAMETER: usize = 40;

const NOTHING: ControlLaw = ControlLaw {
    proportional: 0.0,
    integral: 0.0,
    velocity_feedforward: 0.0,
    acceleration_feedforward: 0.0,
    velocity_feedback: 0.0,
    acceleration_feedback: 0.0,
    velocity_filter: 1.0,
    limit: f64::INFINITY,
};

/// The command that the stated law made (V), where it explains the recorded one.
pub fn by_stated_law(
    recording: &Recording,
    nominal: &Nominal,
    notes: &mut Vec<String>,
) -> Option<Vec<f64>> {
    let recorded = recording.samples(Channel::ValveCommand);
    let commands = of_law(&nominal.controller?, recording, 1.0 / nominal.sample_rate)?;
    let miss = missed(&commands, recorded);
    if miss > LAW_HOLDS_WITHIN * nominal.command_noise {
        notes.push(format!(
            "{}: the stated controller's law does not reproduce the recorded command (R5, {:.1} \
             times \
             its noise); the recorded one is used",
            recording.name,
            miss / nominal.command_noise
        ));
        return None;
    }
    Some(commands)
}

/// The command that the record shows (V), a sample every `period` s. Where a coarse converter has rounded it, that is what a law of the readings
/// makes, if one fits to a half more than the rounding; else the best estimate from the rounded command alone.
pub fn shown(recording: &Recording, period: f64) -> Vec<f64> {
    let recorded = recording.samples(Channel::ValveCommand);
    match Coarse::of(recorded) {
        None => recorded.to_vec(),
        Some(coarse) => by_found_law(recording, period, coarse)
            .unwrap_or_else(|| rounding::estimated(recorded, period, coarse)),
    }
}

/// The commands of `law` for the readings of `recording` (V); none where a channel is missing.
fn of_law(law: &ControlLaw, recording: &Recording, period: f64) -> Option<Vec<f64>> {
    let [recorded, reference, x, a] = [
        Channel::ValveCommand,
        Channel::Reference,
        Channel::Displacement,
        Channel::Acceleration,
    ]
    .map(|channel| recording.samples(channel));
    let mut commands = law.commands(reference, x, a, period);
    if commands.len() != recorded.len() || commands.len() < 3 {
        return None;
    }
    let last = commands.len() - 1;
    // The record's ends lack a neighbour of the reference.
    commands[0] = recorded[0];
    commands[last] = recorded[last];
    Some(commands)
}

/// Root mean square difference.
fn missed(commands: &[f64], recorded: &[f64]) -> f64 {
    let pairs = commands.iter().zip(recorded);
    let square: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
    (square / recorded.len().max(1) as f64).sqrt()
}

/// The commands of the law that fits the record best, where it misses them by no more than the converter's steps.
fn by_found_law(recording: &Recording, period: f64, coarse: Coarse) -> Option<Vec<f64>> {
    let recorded = recording.samples(Channel::ValveCommand);
    let fitted = |velocity_filter: f64| {
        let commands = fitted_law(recording, period, velocity_filter)?;
        Some((missed(&commands, recorded), commands))
    };
    let tried = FILTERS.iter().enumerate();
    let (best, at) = tried
        .filter_map(|(i, filter)| Some((fitted(*filter)?, i)))
        .min_by(|((a, _), _), ((b, _), _)| a.total_cmp(b))?;
    // Between the neighbours of the best one: thirds, six times.
    let (mut low, mut high) = (
        FILTERS[at.saturating_sub(1)],
        FILTERS[(at + 1).min(FILTERS.len() - 1)],
    );
    let mut found = best;
    for _ in 0..6 {
        let (left, right) = ((2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0);
        let (of_left, of_right) = (fitted(left)?, fitted(right)?);
        let better = if of_left.0 < of_right.0 {
            high = right;
            of_left
        } else {
            low = left;
            of_right
        };
        if better.0 < found.0 {
            found = better;
        }
    }
    let (miss, commands) = found;
    (miss < SHOWN_WITHIN * coarse.error()).then_some(commands)
}

/// The commands of the law of this filter that fits the recorded ones best: its gains by linear least squares.
fn fitted_law(recording: &Recording, period: f64, velocity_filter: f64) -> Option<Vec<f64>> {
    let unit = |own: ControlLaw| {
        let law = ControlLaw {
            velocity_filter,
            ..own
        };
        of_law(&law, recording, period)
    };
    let columns = [
        unit(ControlLaw {
            proportional: 1.0,
            ..NOTHING
        })?,
        unit(ControlLaw {
            integral: 1.0,
            ..NOTHING
        })?,
        unit(ControlLaw {
            velocity_feedforward: 1.0,
            ..NOTHING
        })?,
        unit(ControlLaw {
            acceleration_feedforward: 1.0,
            ..NOTHING
        })?,
        unit(ControlLaw {
            velocity_feedback: 1.0,
            ..NOTHING
        })?,
        unit(ControlLaw {
            acceleration_feedback: 1.0,
            ..NOTHING
        })?,
    ];
    let recorded = recording.samples(Channel::ValveCommand);
    let n = recorded.len();
    if n < A_PARAMETER * columns.len() {
        return None;
    }
    // The ends hold what was recorded.
    let found = least_squares::reduce(n - 2, columns.len(), 1, |k, row| {
        let all = columns.iter().map(|own| own[k + 1]);
        let all = all.chain([recorded[k + 1]]);
        row.iter_mut().zip(all).for_each(|(cell, own)| *cell = own);
    });
    let gains = found.solve_directly()?;
    let mut commands = recorded.to_vec();
    for (k, command) in commands.iter_mut().enumerate().take(n - 1).skip(1) {
        let parts = columns.iter().zip(gains.iter());
        *command = parts.map(|(own, gain)| gain * own[k]).sum();
    }
    Some(commands)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 256.0;

    /// A record whose command is PID control of an error in closed form, written with another arithmetic than the
    /// law's: readings of a lagging table, rounded to `step`.
    fn record(step: f64, wrong: f64) -> (Recording, Vec<f64>) {
        let n = 4000;
        let sines = [(0.7, 0.4, 0.3), (2.3, 0.2, 1.1), (5.1, 0.05, 2.0)];
        let sum = |t: f64, late: f64| -> f64 {
            let all = sines.iter();
            all.map(|(f, size, phase)| {
                size * (std::f64::consts::TAU * f * (t - late) + phase).sin()
            })
            .sum()
        };
        let at = |k: usize| k as f64 / RATE;
        let reference: Vec<f64> = (0..n).map(|k| sum(at(k), 0.0)).collect();
        let x: Vec<f64> = (0..n).map(|k| 0.97 * sum(at(k), 0.02)).collect();
        let a: Vec<f64> = (0..n).map(|k| (20.0 * sum(at(k), 0.01)).sin()).collect();
        let (mut slow, mut past, mut total) = (0.0, x[0], 0.0);
        let command: Vec<f64> = (0..n)
            .map(|k| {
                slow += 0.3 * ((x[k] - past) * RATE - slow);
                past = x[k];
                total += 0.8 * (reference[k] - x[k]) / RATE;
                let own = 6.0 * (reference[k] - x[k]) + total - 0.01 * slow;
                own + wrong * (reference[k] - x[k]).powi(3)
            })
            .collect();
        let rounded = command.iter().map(|u| (u / step).round() * step);
        let columns = [
            (Channel::ValveCommand, rounded.collect()),
            (Channel::Reference, reference),
            (Channel::Displacement, x),
            (Channel::Acceleration, a),
        ];
        let recording = Recording::new("record", 1.0 / RATE, columns.to_vec()).unwrap();
        (recording, command)
    }

    #[test]
    fn a_rounded_command_is_what_the_law_made_and_another_law_is_not_believed() {
        let step = 0.02;
        let (recording, command) = record(step, 0.0);
        assert!(missed(&shown(&recording, 1.0 / RATE), &command) < 0.05 * step);
        let (recording, command) = record(step, 60.0);
        let rounded = recording.samples(Channel::ValveCommand);
        let found = shown(&recording, 1.0 / RATE);
        let coarse = Coarse::of(rounded).unwrap();
        assert!(by_found_law(&recording, 1.0 / RATE, coarse).is_none());
        assert!(missed(&found, &command) < missed(rounded, &command));
        // Fine steps are left as they are.
        let (recording, _) = record(1e-4, 0.0);
        assert_eq!(
            shown(&recording, 1.0 / RATE),
            recording.samples(Channel::ValveCommand)
        );
    }
}
