//! Initialization: parameters are set, and values travel along the connections until they
//! converge.

use super::action::{Moment, converged};
use super::{MasterError, Simulation};
use crate::fmu::{Instance, Kind};
use crate::system::{Component, Value};

/// Sets what the system gives a component before it is initialized.
pub(super) fn prepare(instance: &Instance, component: &Component) -> Result<(), MasterError> {
    for (position, value) in component.parameters.iter().chain(&component.inputs) {
        let variable = &component.fmu.description.variables[*position];
        match value {
            Value::Text(text) => instance.set_text(variable.reference, text)?,
            Value::Number(number) => set(instance, &variable.kind, variable.reference, *number)?,
        }
    }
    Ok(())
}

fn set(instance: &Instance, kind: &Kind, reference: u32, number: f64) -> Result<(), MasterError> {
    Ok(instance.set(kind, &[reference], &[number])?)
}

/// Initializes all components together.
pub(super) fn initialize(simulation: &mut Simulation, stop: f64) -> Result<(), MasterError> {
    for part in &mut simulation.parts {
        part.instance.enter_initialization(0.0, stop)?;
    }
    simulation.reference.sample(0, &mut simulation.signals);
    let at = Moment {
        tick: 0,
        time: 0.0,
        step: simulation.step,
        calls: false,
    };
    let mut last = simulation.signals.clone();
    for pass in 1.. {
        last.copy_from_slice(&simulation.signals);
        simulation.perform(at)?;
        for part in &mut simulation.parts {
            part.inputs.transfer(&simulation.signals, &part.instance)?;
        }
        // The first pass only replaces zeros.
        if pass > 1 && converged(0.0, pass, &last, &simulation.signals, &simulation.names)? {
            break;
        }
    }
    for part in &simulation.parts {
        part.instance.exit_initialization()?;
    }
    Ok(())
}
