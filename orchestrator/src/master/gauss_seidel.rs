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
    for action in &mut simulation.actions {
        action.perform(
            at,
            &mut simulation.parts,
            &mut simulation.signals,
            &simulation.names,
        )?;
    }
    Ok(())
}

/// Continuous components over `[t_k, t_k + h]`, with their inputs held at their values at `t_k`.
pub(super) fn advance(simulation: &mut Simulation) -> Result<(), MasterError> {
    let (time, step) = (simulation.time(), simulation.step);
    for part in simulation
        .parts
        .iter_mut()
        .filter(|part| part.every.is_none())
    {
        part.inputs.transfer(&simulation.signals, &part.instance)?;
        part.instance.do_step(time, step)?;
    }
    Ok(())
}
