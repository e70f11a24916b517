//! Initialization: parameters are set, and values travel along the connections until they
//! converge.

use std::collections::HashSet;

use super::action::{Moment, converged};
use super::{MasterError, Simulation};
use fmi_import::{Datum, Instance};
use fmi_system::Component;

/// Sets what the system gives a component before it is initialized.
pub(super) fn prepare(instance: &mut Instance, component: &Component) -> Result<(), MasterError> {
    let variables = &component.fmu.description.variables;
    let given = component.given();
    // An array is set as a whole, by its first element.
    let mut firsts: Vec<usize> = Vec::new();
    let mut known = HashSet::new();
    for (position, _) in component.parameters.iter().chain(&component.inputs) {
        let first = position - variables[*position].element.0;
        if known.insert(first) {
            firsts.push(first);
        }
    }
    let (structural, others): (Vec<usize>, Vec<usize>) = firsts
        .into_iter()
        .partition(|&first| variables[first].is_structural);
    let set = |instance: &mut Instance, first: usize| -> Result<(), MasterError> {
        let variable = &variables[first];
        let all = (first..first + variable.element.1).map(|at| component.start_value(&given, at));
        let reference = [variable.reference];
        if variable.kind.is_exact() {
            let all: Vec<Datum> = all.collect();
            return Ok(instance.set_exact(&variable.kind, &reference, &all)?);
        }
        let all: Vec<f64> = all.map(|value| value.number()).collect();
        Ok(instance.set(&variable.kind, &reference, &all)?)
    };
    if !structural.is_empty() {
        instance.enter_configuration()?;
        for first in structural {
            set(instance, first)?;
        }
        instance.exit_configuration()?;
    }
    for first in others {
        set(instance, first)?;
    }
    Ok(())
}

/// Initializes all components together.
pub(super) fn initialize(simulation: &mut Simulation, stop: f64) -> Result<(), MasterError> {
    for part in &mut simulation.parts {
        part.instance.enter_initialization(simulation.begin, stop)?;
    }
    let now = simulation.time();
    simulation
        .reference
        .sample(0, now, &mut simulation.signals.numbers);
    let at = Moment {
        tick: 0,
        time: now,
        step: simulation.step,
        calls: false,
    };
    let mut last = simulation.signals.numbers.clone();
    for pass in 1.. {
        last.copy_from_slice(&simulation.signals.numbers);
        simulation.perform(at)?;
        for part in &mut simulation.parts {
            part.inputs
                .transfer(&simulation.signals, &mut part.instance)?;
        }
        // The first pass only replaces zeros.
        if pass > 1
            && converged(
                0.0,
                pass,
                &last,
                &simulation.signals.numbers,
                &simulation.names,
            )?
        {
            break;
        }
    }
    for part in &mut simulation.parts {
        part.instance.exit_initialization()?;
        // Ticks at the start come after initialization.
        if part.instance.has_events() {
            part.outputs
                .read(&mut simulation.signals, &mut part.instance)?;
        }
    }
    Ok(())
}
