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
    let (tick, time, step) = (simulation.tick, simulation.time(), simulation.step);
    let (now, last) = (&simulation.signals, &mut simulation.last_signals);
    let coupling = &simulation.coupling;
    if tick == 0 {
        coupling.copy(now, last);
    }
    for part in simulation
        .parts
        .iter_mut()
        .filter(|part| part.every.is_none())
    {
        part.inputs
            .transfer_between(now, last, -0.5, &mut part.instance)?;
        part.step(time, step)?;
    }
    coupling.copy(now, last);
    Ok(())
}
