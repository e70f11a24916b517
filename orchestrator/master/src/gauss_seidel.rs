//! Components called in dependency order, each with the newest values.

use super::action::Moment;
use super::{MasterError, Simulation};

/// Outputs at `t_k`, from the plant up to the sensors and from the reference down to the valve.
pub(super) fn observe(simulation: &mut Simulation) -> Result<(), MasterError> {
    let at = Moment {
        tick: simulation.tick,
        time: simulation.time(),
        step: simulation.step,
        calls: true,
    };
    simulation.perform(at)
}

/// Continuous components over `[t_k, t_k + h]` with their inputs held: commands at their value of
/// `t_k`, what another continuous component gives at its value extrapolated to the middle of the
/// step, `(3 y_k - y_(k-1)) / 2` (Adams-Bashforth). That couples them with second order, where
/// `y_k` would be half a step late and of first.
pub(super) fn advance(simulation: &mut Simulation) -> Result<(), MasterError> {
    if simulation.tick == 0 {
        simulation.keep_as_last();
    }
    step(simulation, 1, 1.0)?;
    simulation.keep_as_last();
    Ok(())
}

/// The step alone, over so many ticks; the step before it was shorter by `ratio`.
#[inline]
pub(super) fn step(
    simulation: &mut Simulation,
    ticks: usize,
    ratio: f64,
) -> Result<(), MasterError> {
    let (time, length) = (simulation.time(), ticks as f64 * simulation.step);
    let (now, last) = (&simulation.signals, &simulation.last_signals);
    for part in simulation
        .parts
        .iter_mut()
        .filter(|part| part.every.is_none())
    {
        part.inputs
            .transfer_between(now, last, -0.5 * ratio, &mut part.instance)?;
        part.begin_step(time, length)?;
    }
    for part in &mut simulation.parts {
        part.finish_step()?;
    }
    Ok(())
}
