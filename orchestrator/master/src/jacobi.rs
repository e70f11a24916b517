//! All components step from the same values; every connection delays by a step. Masters without an
//! order of calls work in this way.

use super::{MasterError, Simulation};

/// All components over `[t_k, t_k + h]` from the outputs at `t_k`.
pub(super) fn advance(simulation: &mut Simulation) -> Result<(), MasterError> {
    let (tick, time, step) = (simulation.tick, simulation.time(), simulation.step);
    let parts = &mut simulation.parts;
    for part in parts
        .iter_mut()
        .filter(|part| part.is_due(tick) && part.failure.is_none())
    {
        part.inputs
            .transfer(&simulation.signals, &mut part.instance)?;
    }
    for part in parts.iter_mut().filter(|part| part.is_due(tick)) {
        let ticks = part.every.unwrap_or(1);
        part.begin_step(time, ticks as f64 * step)?;
    }
    for part in parts.iter_mut() {
        part.finish_step()?;
    }
    // A sampled component's outputs are seen by the others at the next tick.
    for part in parts.iter_mut().filter(|part| part.failure.is_none()) {
        part.read(&mut simulation.signals)?;
    }
    Ok(())
}
