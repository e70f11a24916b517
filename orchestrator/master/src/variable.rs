//! Coupling steps of different lengths, as the estimated error of the coupling asks for.
//!
//! Time is counted in the least step; a step consists of several, and none crosses the end of a
//! longest step. The samples of the motion and the periods of sampled components are multiples of
//! the longest step. Values between continuous components are held over a step at an estimate of
//! their mean. Its difference from the mean of both ends gives the error (Milne's device; Busch and
//! Schweizer, *An explicit approach for controlling the macro-step size of co-simulation methods*,
//! ENOC 2011), which is of second order. A step that errs too much is repeated with a shorter one
//! where all components can go back; otherwise the next is shorter. The length follows a
//! proportional and integral controller (Gustafsson; Hairer and Wanner, *Solving Ordinary
//! Differential Equations II*, IV.2).

use serde::{Deserialize, Serialize};

use super::action::Moment;
use super::signals::Signals;
use super::{Algorithm, MasterError, Part, Simulation, gauss_seidel, iterative};
use fmi_system::System;

/// Without a least step, the greatest is divided into so many.
const DIVISIONS: f64 = 1024.0;
/// A step may be divided into no more.
const MOST_DIVISIONS: f64 = 1e9;
/// A value counts as at least so large: what is smaller is rounding.
const SMALLEST: f64 = 1e-9;
/// Part of the length that would do exactly which is taken.
const SAFETY: f64 = 0.9;
/// A length is not changed by less: the same length again spares components that prepare themselves
/// for one.
const WORTH: std::ops::Range<f64> = 0.9..1.25;

/// What the steps are chosen for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VariableStep {
    /// Largest error of a value that one component gives another, held over a step, over the largest
    /// size that the value has had.
    pub tolerance: f64,
    /// Least step, s; absent: a 1024th of the greatest, or what the components' own steps allow.
    pub least: Option<f64>,
}

/// How the steps of a run were.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepsTaken {
    /// Error that was allowed, per cent of the largest size that a value has had.
    pub tolerance_percent: f64,
    /// Least step that was allowed, s.
    pub least_s: f64,
    /// Greatest step that was allowed, s.
    pub greatest_s: f64,
    /// Shortest step that was made, s.
    pub shortest_s: f64,
    /// Longest step that was made, s.
    pub longest_s: f64,
    /// Steps that were made again with a shorter one.
    pub repeated: usize,
    /// Steps that were kept though their error was estimated to be larger than allowed.
    pub over: usize,
    /// The largest estimated error of a step that was kept, per cent.
    pub worst_percent: f64,
    /// The signal that it was found in; absent where nothing is coupled.
    pub worst_signal: Option<String>,
}

/// Chooses steps.
#[derive(Debug)]
pub(super) struct StepControl {
    tolerance: f64,
    /// Greatest step, in least steps.
    greatest: usize,
    /// Whether all components that step with it can go back.
    can_repeat: bool,
    /// Signals whose error counts, and the largest size of each.
    watched: Vec<usize>,
    pub(super) progress: Progress,
}

/// What the choice of the next step depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Progress {
    peaks: Vec<f64>,
    /// Length of the step that is wanted, in least steps.
    wanted: f64,
    /// Length of the last step, in least steps; 0 before the first.
    pub last: usize,
    /// Error of the last step over the tolerance.
    last_error: f64,
    /// Steps made.
    pub made: usize,
    shortest: usize,
    longest: usize,
    repeated: usize,
    over: usize,
    worst: f64,
    worst_signal: Option<usize>,
}

/// Into how many least steps the greatest, `step` seconds, is divided.
///
/// # Errors
/// An order of calls or a component that steps of different lengths do not suit; a least step that
/// does not divide the greatest.
pub(super) fn divisions(
    system: &System,
    algorithm: Algorithm,
    step: f64,
    wanted: &VariableStep,
) -> Result<usize, MasterError> {
    let fault = |reason: String| Err(MasterError::VariableStep(reason));
    if algorithm == Algorithm::Jacobi {
        return fault(
            "with --algorithm jacobi every connection delays by a step, so the system would \
             change with each step length; use gauss-seidel or iterative"
                .to_string(),
        );
    }
    let continuous = || system.components.iter().filter(|one| one.period.is_none());
    if let Some(part) = continuous().find(|part| !part.fmu.description.variable_step) {
        return fault(format!(
            "`{}` needs steps of equal length (canHandleVariableCommunicationStepSize of its FMU \
             is false); give it a `period`, or run without a variable step",
            part.name
        ));
    }
    let own = continuous().filter_map(|part| {
        let step = part.fmu.description.internal_step?;
        Some((step, part.name.as_str()))
    });
    let longest = own.clone().max_by(|one, other| one.0.total_cmp(&other.0));
    let least = wanted.least.or(longest.map(|(own, _)| own));
    let least = least.unwrap_or(step / DIVISIONS);
    let count = (step / least).round();
    let divides = |part: f64, whole: f64| {
        let count = (whole / part).round();
        count >= 1.0 && (count * part / whole - 1.0).abs() < 1e-9
    };
    if !divides(least, step) || count > MOST_DIVISIONS {
        let whose = match (wanted.least, longest) {
            (None, Some((_, name))) => format!(", the fixedInternalStepSize of `{name}`,"),
            _ => String::new(),
        };
        return fault(format!(
            "a shortest step of {least} s{whose} does not divide the longest, {step} s; choose \
             --step and --least-step so that it does"
        ));
    }
    if let Some((own, name)) = own.into_iter().find(|(own, _)| !divides(*own, least)) {
        return fault(format!(
            "`{name}` has an internal step of {own} s (fixedInternalStepSize), so the shortest \
             step, {least} s, must be a multiple of it; set --least-step"
        ));
    }
    Ok(count as usize)
}

impl StepControl {
    /// Of steps of up to `greatest` least steps, by the errors of the `watched` signals.
    pub(super) fn new(
        wanted: &VariableStep,
        greatest: usize,
        watched: Vec<usize>,
        parts: &[Part],
    ) -> Self {
        let mut continuous = parts.iter().filter(|part| part.every.is_none());
        Self {
            tolerance: wanted.tolerance,
            greatest,
            can_repeat: continuous.all(|part| part.instance.fmu.description.saves_state),
            progress: Progress {
                peaks: vec![SMALLEST; watched.len()],
                wanted: if watched.is_empty() {
                    greatest as f64
                } else {
                    1.0
                },
                last: 0,
                last_error: 1.0,
                made: 0,
                shortest: usize::MAX,
                longest: 0,
                repeated: 0,
                over: 0,
                worst: 0.0,
                worst_signal: None,
            },
            watched,
        }
    }

    /// What the user should know before the run.
    pub(super) fn notes(&self, parts: &[Part]) -> Vec<String> {
        if self.greatest == 1 {
            return vec![
                "the shortest step is as long as the longest, so there is no choice; use a \
                 longer \
                 --step or a shorter --least-step"
                    .to_string(),
            ];
        }
        if self.watched.is_empty() {
            return vec![
                "no continuous value passes between components or from an input table, so there \
                 is no coupling error: every step is the longest"
                    .to_string(),
            ];
        }
        let stuck = parts
            .iter()
            .find(|part| part.every.is_none() && !part.instance.fmu.description.saves_state);
        let line = stuck.map(|part| {
            format!(
                "`{}` cannot save its state (its FMU does not offer it), so no step is repeated: \
                 after a step with too large an error, the next is shorter",
                part.instance.name
            )
        });
        line.into_iter().collect()
    }

    /// Length of the step from `tick`: what is wanted, so that equal steps end with the greatest step.
    fn length(&self, tick: usize) -> usize {
        let left = self.greatest - tick % self.greatest;
        let wanted = (self.progress.wanted as usize).clamp(1, left);
        left.div_ceil(left.div_ceil(wanted))
    }

    /// How far the last guess over the tolerance is, at worst, and of which signal.
    fn error(
        &self,
        length: usize,
        algorithm: Algorithm,
        [last, now, next]: [&Signals; 3],
    ) -> (f64, Option<usize>) {
        let before = self.progress.last as f64;
        let length = length as f64;
        // Of the mean of a parabola over the step, the guess along the straight line through two values
        // errs by (3 before + 2 length) / (3 (before + length)) of the difference, the mean of both ends
        // by length / (3 (before + length)). Holding it over the step counts as much as the latter again.
        let part = match algorithm {
            Algorithm::Iterative if before > 0.0 => 2.0 * length / (3.0 * (before + length)),
            _ => 1.0,
        };
        let ratio = match self.progress.last {
            0 => 0.0,
            _ => length / before,
        };
        let mut worst = (0.0, None);
        for (place, &signal) in self.watched.iter().enumerate() {
            let [last, now, next] = [last, now, next].map(|signals| signals.numbers[signal]);
            let guess = 0.5 * ratio * (now - last);
            let mean = 0.5 * (next - now);
            let size = self.progress.peaks[place].max(now.abs()).max(next.abs());
            let error = part * (guess - mean).abs() / (self.tolerance * size);
            // What is not a number is no step to be kept.
            if error.is_nan() || error > worst.0 {
                worst = (
                    if error.is_nan() { f64::INFINITY } else { error },
                    Some(signal),
                );
            }
        }
        worst
    }

    /// Takes a shorter length after one whose error is too large.
    fn shorten(&mut self, length: usize, error: f64) {
        let factor = match error.is_finite() {
            true => (SAFETY / error.sqrt()).clamp(0.1, 0.8),
            false => 0.1,
        };
        self.progress.wanted = (length as f64 * factor).max(1.0);
        self.progress.repeated += 1;
    }

    /// Takes note of a step that is kept.
    fn keep(&mut self, length: usize, (error, signal): (f64, Option<usize>), was_repeated: bool) {
        let it = &mut self.progress;
        it.made += 1;
        it.shortest = it.shortest.min(length);
        it.longest = it.longest.max(length);
        it.over += usize::from(error > 1.0);
        if error > it.worst {
            (it.worst, it.worst_signal) = (error, signal);
        }
        let (now, before) = (error.max(1e-6), it.last_error.max(1e-6));
        let mut factor = SAFETY * now.powf(-0.35) * before.powf(0.2);
        factor = factor.clamp(0.2, if was_repeated { 1.0 } else { 2.0 });
        let mut next = length as f64 * factor;
        if WORTH.contains(&factor) {
            next = length as f64;
        }
        // Shortened to end with the greatest step, it says nothing against the length that was wanted.
        if error <= 1.0 && !was_repeated {
            next = next.max(it.wanted * factor.min(1.0));
        }
        it.wanted = next.clamp(1.0, self.greatest as f64);
        it.last_error = error.clamp(1e-4, 1e4);
        it.last = length;
    }

    /// How the steps were, with a least step of so many seconds.
    pub(super) fn taken(&self, least: f64, names: &[String]) -> StepsTaken {
        let it = &self.progress;
        StepsTaken {
            tolerance_percent: 100.0 * self.tolerance,
            least_s: least,
            greatest_s: self.greatest as f64 * least,
            shortest_s: it.shortest.min(it.longest) as f64 * least,
            longest_s: it.longest as f64 * least,
            repeated: it.repeated,
            over: it.over,
            worst_percent: (100.0 * self.tolerance * it.worst).min(f64::MAX),
            worst_signal: it
                .worst_signal
                .and_then(|signal| names.get(signal).cloned()),
        }
    }
}

/// Steps as far as the error allows, and gives how many least steps that is.
pub(super) fn advance(
    simulation: &mut Simulation,
    control: &mut StepControl,
) -> Result<usize, MasterError> {
    if control.progress.last == 0 {
        simulation.keep_as_last();
    }
    let mut was_repeated = false;
    loop {
        let length = control.length(simulation.tick);
        let can_repeat = control.can_repeat && length > 1;
        if can_repeat {
            save(simulation)?;
        }
        let error = match attempt(simulation, control, length) {
            Ok(error) => error,
            // A shorter step may be one that the components bear.
            Err(error) if can_repeat && error.is_of_the_step() => (f64::INFINITY, None),
            Err(error) => return Err(error),
        };
        let ends = simulation.parts.iter().any(|part| part.ended.is_some());
        if can_repeat && error.0 > 1.0 && !ends {
            for part in &mut simulation.parts {
                if part.every.is_none() {
                    part.go_back()?;
                }
            }
            control.shorten(length, error.0);
            was_repeated = true;
            continue;
        }
        control.keep(length, error, was_repeated);
        simulation.keep_as_last();
        for (peak, &signal) in control.progress.peaks.iter_mut().zip(&control.watched) {
            let size = simulation.next_signals.numbers[signal].abs();
            *peak = peak.max(size).max(simulation.signals.numbers[signal].abs());
        }
        return Ok(length);
    }
}

/// Keeps the states of the components that step.
fn save(simulation: &mut Simulation) -> Result<(), MasterError> {
    for part in &mut simulation.parts {
        if part.every.is_none() && part.failure.is_none() {
            part.instance.save_state(&mut part.state)?;
        }
    }
    Ok(())
}

/// Makes a step, and gives its error over the tolerance with the signal that errs most.
/// `next_signals` holds the components' outputs at its end.
fn attempt(
    simulation: &mut Simulation,
    control: &StepControl,
    length: usize,
) -> Result<(f64, Option<usize>), MasterError> {
    let before = control.progress.last;
    let ratio = match before {
        0 => 0.0,
        before => length as f64 / before as f64,
    };
    let end = simulation.begin + (simulation.tick + length) as f64 * simulation.step;
    match simulation.algorithm {
        Algorithm::Iterative => iterative::step(simulation, length, ratio)?,
        _ => {
            gauss_seidel::step(simulation, length, ratio)?;
            if control.watched.is_empty() {
                return Ok((0.0, None));
            }
            // Between two calls of a sampled component nothing of it changes.
            let at = Moment {
                tick: simulation.tick,
                time: end,
                step: simulation.step,
                calls: false,
            };
            let Simulation {
                parts,
                actions,
                signals,
                next_signals: next,
                reference,
                names,
                ..
            } = simulation;
            next.copy_from(signals);
            reference.ahead(end, &mut next.numbers);
            for action in actions.iter_mut().filter(|action| action.is_continuous()) {
                action.perform(at, parts, next, names)?;
            }
        }
    }
    let Simulation {
        signals,
        last_signals,
        next_signals,
        algorithm,
        ..
    } = simulation;
    Ok(control.error(length, *algorithm, [last_signals, signals, next_signals]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of steps up to 16, the last of which was `last` long.
    fn control(last: usize) -> StepControl {
        let wanted = VariableStep {
            tolerance: 0.01,
            least: None,
        };
        let mut control = StepControl::new(&wanted, 16, vec![1], &[]);
        control.progress.last = last;
        control
    }

    fn signals(value: f64) -> Signals {
        Signals {
            numbers: vec![1e9, value],
            exact: Vec::new(),
        }
    }

    /// Of a parabola `t²` from `-before` to `length`, whose mean over the step is `length² / 3`.
    #[test]
    fn the_error_is_that_of_the_guess_of_a_parabola_s_mean() {
        for (before, length) in [(3, 5), (8, 2), (4, 4)] {
            let control = control(before);
            let (b, l) = (before as f64, length as f64);
            let all = [signals(b * b), signals(0.0), signals(l * l)];
            let error = |algorithm| {
                let (error, signal) = control.error(length, algorithm, [&all[0], &all[1], &all[2]]);
                assert_eq!(signal, Some(1));
                // Over the tolerance, of the largest size.
                error * 0.01 * l * l
            };
            // Both ends for the mean, and as much again for holding it.
            let held = 2.0 * (l * l / 2.0 - l * l / 3.0);
            assert!((error(Algorithm::Iterative) - held).abs() < 1e-9);
            // The line through the last two is at -b l / 2 in the middle, the mean of both ends at l² / 2.
            let between = l * (b + l) / 2.0;
            assert!((error(Algorithm::GaussSeidel) - between).abs() < 1e-9);
        }
        let none = control(2).error(2, Algorithm::GaussSeidel, [&signals(1.0); 3]);
        assert_eq!(none, (0.0, None));
        let [now, next] = [signals(1.0), signals(f64::NAN)];
        let bad = control(2).error(2, Algorithm::GaussSeidel, [&now, &now, &next]);
        assert_eq!(bad, (f64::INFINITY, Some(1)));
    }

    #[test]
    fn steps_are_equal_and_end_with_the_greatest() {
        let mut own = control(1);
        for (tick, wanted, expected) in [
            (0, 1.0, 1),
            (0, 16.0, 16),
            (0, 7.9, 6),
            (6, 7.9, 5),
            (12, 100.0, 4),
            (31, 16.0, 1),
            (32, 8.0, 8),
        ] {
            own.progress.wanted = wanted;
            assert_eq!(own.length(tick), expected, "{tick} {wanted}");
        }
    }

    #[test]
    fn a_length_grows_with_small_errors_and_shrinks_with_large_ones() {
        let mut own = control(0);
        own.keep(4, (1e-9, Some(1)), false);
        // Twice at most, and no more than before where it was repeated.
        assert_eq!((own.progress.wanted, own.progress.last), (8.0, 4));
        own.keep(4, (1e-9, Some(1)), true);
        assert_eq!(own.progress.wanted, 4.0);
        own.keep(8, (2.0, Some(0)), false);
        let it = &own.progress;
        assert!(it.wanted < 8.0 && it.over == 1 && it.made == 3);
        assert_eq!((it.shortest, it.longest), (4, 8));
        assert_eq!((it.worst, it.worst_signal), (2.0, Some(0)));
        own.shorten(8, 4.0);
        // 0.9 over the root of the error.
        assert!((own.progress.wanted - 8.0 * 0.45).abs() < 1e-12);
        own.shorten(8, f64::INFINITY);
        assert_eq!((own.progress.wanted, own.progress.repeated), (1.0, 2));
        let names = ["a", "b"].map(String::from);
        let taken = own.taken(0.5, &names);
        assert_eq!((taken.tolerance_percent, taken.worst_percent), (1.0, 2.0));
        assert_eq!((taken.shortest_s, taken.longest_s), (2.0, 4.0));
        assert_eq!((taken.least_s, taken.greatest_s), (0.5, 8.0));
        assert_eq!(taken.worst_signal.as_deref(), Some("a"));
    }
}
