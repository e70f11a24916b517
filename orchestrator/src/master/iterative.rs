//! The coupling over a step by fixed-point iteration: inputs from continuous components are held
//! at the mean of their values at both ends of the step (the trapezoidal rule), so that nothing is
//! extrapolated; of second order.

use super::action::{Moment, converged};
use super::{MasterError, Simulation};

/// Continuous components over `[t_k, t_k + h]`, repeated until the values at the end converge.
pub(super) fn advance(simulation: &mut Simulation) -> Result<(), MasterError> {
    let (time, step) = (simulation.time(), simulation.step);
    // Between two calls of a sampled component nothing of it changes.
    let end = Moment {
        tick: simulation.tick,
        time: time + step,
        step,
        calls: false,
    };
    let Simulation {
        parts,
        actions,
        signals,
        next_signals: next,
        last_signals: last,
        names,
        ..
    } = simulation;
    for part in parts.iter_mut().filter(|part| part.every.is_none()) {
        part.instance.save_state(&mut part.state)?;
    }
    next.copy_from(signals);
    for pass in 1.. {
        last.copy_from(next);
        for part in parts.iter_mut().filter(|part| part.every.is_none()) {
            part.inputs
                .transfer_between(signals, next, 0.5, &mut part.instance)?;
            part.step(time, step)?;
        }
        for action in actions.iter_mut().filter(|action| action.is_continuous()) {
            action.perform(end, parts, next, names)?;
        }
        if converged(time, pass, &last.numbers, &next.numbers, names)? {
            return Ok(());
        }
        for part in parts.iter_mut().filter(|part| part.every.is_none()) {
            part.instance.restore_state(&part.state)?;
        }
    }
    Ok(())
}
