//! What is done at a tick, prepared for doing it many times.

use super::algebraic::AlgebraicLoop;
use super::signals::Signals;
use super::transfer::{Inputs, Outputs};
use super::{MasterError, Part, comes};

/// The largest number of passes of a fixed-point iteration.
const MOST_PASSES: usize = 100;
/// Values that change by less than this part of their size have converged.
const TOLERANCE: f64 = 1e-12;

/// An [`fmi_system::Operation`] with its value references.
pub(super) enum Action {
    /// Set some inputs of a continuous component, then read outputs.
    Read {
        part: usize,
        inputs: Inputs,
        outputs: Outputs,
    },
    /// Set the inputs of a sampled component, step it over its period, read its outputs.
    Call { part: usize },
    /// Find values that agree with each other.
    Solve(AlgebraicLoop),
}

/// When and how actions are carried out.
#[derive(Clone, Copy)]
pub(super) struct Moment {
    /// The tick.
    pub tick: usize,
    /// Its time, s.
    pub time: f64,
    /// Coupling step, s.
    pub step: f64,
    /// Sampled components are stepped; otherwise only their outputs are read.
    pub calls: bool,
}

impl Action {
    /// Carries it out.
    pub(super) fn perform(
        &mut self,
        at: Moment,
        parts: &mut [Part],
        signals: &mut Signals,
        names: &[String],
    ) -> Result<(), MasterError> {
        match self {
            Self::Read {
                part,
                inputs,
                outputs,
            } => {
                let instance = &mut parts[*part].instance;
                inputs.transfer(signals, instance)?;
                outputs.read(signals, instance)?;
            }
            Self::Call { part } => {
                let part = &mut parts[*part];
                let Some(every) = part.every.filter(|every| comes(at.tick, *every)) else {
                    return Ok(());
                };
                if part.failure.is_some() {
                    return Ok(());
                }
                part.inputs.transfer(signals, &mut part.instance)?;
                if !at.calls {
                    return Ok(part.outputs.read(signals, &mut part.instance)?);
                }
                match part.is_requested {
                    true => part.finish_step()?,
                    false => part.step(at.time, every as f64 * at.step)?,
                }
                if part.failure.is_none() {
                    part.read(signals)?;
                }
            }
            Self::Solve(of_loop) => of_loop.solve(at, parts, signals, names)?,
        }
        Ok(())
    }
}

impl Action {
    /// Whether it reads continuous components only.
    pub(super) fn is_continuous(&self) -> bool {
        match self {
            Self::Read { .. } => true,
            Self::Call { .. } => false,
            Self::Solve(of_loop) => of_loop.is_continuous(),
        }
    }
}

/// Whether the fixed-point iteration has converged; an error when it has not after too many passes.
pub(super) fn converged(
    time: f64,
    passes: usize,
    last: &[f64],
    now: &[f64],
    names: &[String],
) -> Result<bool, MasterError> {
    let excess = |(before, after): (&f64, &f64)| {
        (after - before).abs() - TOLERANCE * before.abs().max(after.abs())
    };
    let moving = |pair: &(&f64, &f64)| excess(*pair) > f64::MIN_POSITIVE;
    if !last.iter().zip(now).any(|pair| moving(&pair)) {
        return Ok(true);
    }
    if passes < MOST_PASSES {
        return Ok(false);
    }
    let pairs = last.iter().zip(now).enumerate();
    let most = pairs.max_by(|(_, a), (_, b)| excess(*a).total_cmp(&excess(*b)));
    let (place, (before, after)) = most.unwrap_or((0, (&0.0, &0.0)));
    Err(MasterError::NotConverged {
        time,
        passes,
        variable: names.get(place).cloned().unwrap_or_default(),
        change: (after - before).abs(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_converged_where_none_changes_by_more_than_rounding() {
        let names = ["a", "b"].map(String::from);
        let of =
            |passes, last: [f64; 2], now: [f64; 2]| converged(0.5, passes, &last, &now, &names);
        let close = [1.0, 1e6 * (1.0 + 0.9 * TOLERANCE)];
        assert!(of(3, [1.0, 1e6], close).unwrap());
        assert!(of(MOST_PASSES, [0.0, 0.0], [0.0, 0.0]).unwrap());
        let far = [1.0, 1e6 * (1.0 + 3.0 * TOLERANCE)];
        assert!(!of(MOST_PASSES - 1, [1.0, 1e6], far).unwrap());
        assert!(!of(3, [0.0, 0.0], [1e-200, 0.0]).unwrap());
        // The one that changes most is named.
        let error = of(MOST_PASSES, [1.0, 2.0], [1.5, 3.0]).unwrap_err();
        let MasterError::NotConverged {
            time,
            passes,
            variable,
            change,
        } = error
        else {
            panic!("{error}");
        };
        assert_eq!(
            (time, passes, &*variable, change),
            (0.5, MOST_PASSES, "b", 1.0)
        );
    }
}
