//! From a checked system to a simulation: loads the FMUs and prepares every exchange of values.

use std::collections::HashMap;

use super::action::Action;
use super::reference::Reference;
use super::transfer::{Inputs, Outputs};
use super::{Algorithm, EndSignals, MasterError, Part, Simulation, start};
use crate::fmu::{Causality, Instance, Kind, State, Variability};
use crate::motion::Motion;
use crate::system::{Operation, Quantity, Source, System};

impl Simulation {
    /// Loads and initializes `system` under `motion`, with a coupling step of `step` seconds.
    ///
    /// # Errors
    /// A step that does not divide the sampling periods, a loop, an FMU that cannot be loaded or
    /// refuses its parameters.
    pub fn new(
        system: &System,
        motion: &Motion,
        algorithm: Algorithm,
        step: f64,
    ) -> Result<Self, MasterError> {
        let ticks_per_row = ticks(motion.dt, step, "the sample time of the motion")?;
        let schedule = system.schedule(algorithm == Algorithm::Iterative)?;
        let mut reference = Reference::new(motion);
        for quantity in Quantity::ALL {
            reference.tap(quantity, 0);
        }
        for connection in &system.connections {
            if let Source::Reference { quantity, ahead } = connection.source {
                reference.tap(quantity, ahead);
            }
        }
        let mut plan = Plan::new(system, &mut reference, &schedule.operations);
        let mut parts = Vec::with_capacity(system.components.len());
        for (index, component) in system.components.iter().enumerate() {
            if algorithm == Algorithm::Iterative && !component.fmu.description.saves_state {
                return Err(MasterError::NoState(component.name.clone()));
            }
            let instance = Instance::new(&component.fmu, &component.name)?;
            start::prepare(&instance, component)?;
            let every = component
                .period
                .map(|period| ticks(period, step, &format!("the period of `{}`", component.name)));
            parts.push(Part {
                instance,
                every: every.transpose()?,
                inputs: plan.inputs(&mut reference, index, |_| true),
                outputs: std::mem::take(&mut plan.outputs[index]),
                state: State::default(),
                may_fail: component.period.is_some()
                    && system.stop.is_some_and(|(guard, _)| guard != index),
                failure: None,
            });
        }
        let actions = schedule
            .operations
            .iter()
            .map(|operation| plan.action(&mut reference, operation))
            .collect();
        let end = system.end.map(|end| EndSignals {
            when: plan.places[&end.when],
            cause: end.cause.map(|(component, variable)| {
                let variables = &system.components[component].fmu.description.variables;
                let items = match &variables[variable].kind {
                    Kind::Enumeration(items) => items.clone(),
                    _ => Vec::new(),
                };
                (plan.places[&(component, variable)], items)
            }),
            after: end.after,
        });
        let stop = system.stop.map(|(part, variable)| {
            let variables = &system.components[part].fmu.description.variables;
            (part, variables[variable].reference)
        });
        let signals = vec![0.0; plan.names.len()];
        let mut simulation = Self {
            algorithm,
            step,
            tick: 0,
            ticks_per_row,
            next_signals: signals.clone(),
            last_signals: signals.clone(),
            signals,
            names: plan.names,
            reference,
            parts,
            actions,
            end,
            stop,
        };
        start::initialize(&mut simulation, motion.len() as f64 * motion.dt)?;
        Ok(simulation)
    }
}

/// How many steps make a period.
fn ticks(period: f64, step: f64, what: &str) -> Result<usize, MasterError> {
    let count = (period / step).round();
    if !step.is_finite() || step <= 0.0 || count < 1.0 || (count * step / period - 1.0).abs() > 1e-9
    {
        return Err(MasterError::Step(format!(
            "--step: a coupling step of {} ms does not divide {what}, {} ms; \
             take 2 ms, 1 ms, 0.5 ms, 0.25 ms...",
            1e3 * step,
            1e3 * period
        )));
    }
    Ok(count as usize)
}

/// Where each signal stands.
struct Plan<'a> {
    system: &'a System,
    places: HashMap<(usize, usize), usize>,
    names: Vec<String>,
    /// The outputs of each component.
    outputs: Vec<Outputs>,
    /// The outputs of each operation, by component and first output.
    groups: HashMap<(usize, usize), Outputs>,
}

impl<'a> Plan<'a> {
    fn new(system: &'a System, reference: &mut Reference, operations: &[Operation]) -> Self {
        let mut names = vec![String::new(); reference.len()];
        for quantity in Quantity::ALL {
            let source = Source::Reference { quantity, ahead: 0 };
            names[reference.tap(quantity, 0)] = system.origin(source).to_string();
        }
        for connection in &system.connections {
            if let Source::Reference { quantity, ahead } = connection.source {
                names[reference.tap(quantity, ahead)] =
                    system.origin(connection.source).to_string();
            }
        }
        let mut plan = Self {
            system,
            places: HashMap::new(),
            names,
            outputs: vec![Outputs::default(); system.components.len()],
            groups: HashMap::new(),
        };
        for operation in operations {
            plan.place(operation);
        }
        plan
    }

    /// Gives the outputs of an operation their signals, those of one type side by side.
    fn place(&mut self, operation: &Operation) {
        let (component, outputs) = match operation {
            Operation::Iterate(parts) => {
                parts.iter().for_each(|part| self.place(part));
                return;
            }
            Operation::Read { component, outputs } => (*component, outputs.clone()),
            Operation::Call { component } => {
                let description = &self.system.components[*component].fmu.description;
                let outputs = description.of(Causality::Output);
                let numeric = outputs.filter(|&v| description.variables[v].kind.is_numeric());
                (*component, numeric.collect())
            }
        };
        let variables = &self.system.components[component].fmu.description.variables;
        let mut kinds: Vec<&Kind> = Vec::new();
        for &output in &outputs {
            if !kinds.contains(&&variables[output].kind) {
                kinds.push(&variables[output].kind);
            }
        }
        let mut group = Outputs::default();
        for kind in kinds {
            let first = self.names.len();
            let alike = outputs
                .iter()
                .copied()
                .filter(|&v| variables[v].kind == *kind);
            let alike: Vec<usize> = alike.collect();
            for &output in &alike {
                self.places.insert((component, output), self.names.len());
                self.names
                    .push(self.system.variable_name(component, output).to_string());
            }
            group.add(
                kind,
                alike.iter().map(|&v| variables[v].reference).collect(),
                first,
            );
        }
        self.outputs[component].extend(&group);
        self.groups
            .insert((component, outputs.first().copied().unwrap_or(0)), group);
    }

    fn signal(&self, reference: &mut Reference, source: Source) -> usize {
        match source {
            Source::Reference { quantity, ahead } => reference.tap(quantity, ahead),
            Source::Output {
                component,
                variable,
            } => self.places[&(component, variable)],
        }
    }

    /// Whether the source changes between samples.
    fn is_smooth(&self, source: Source) -> bool {
        match source {
            Source::Reference { .. } => false,
            Source::Output {
                component,
                variable,
            } => {
                let component = &self.system.components[component];
                let variable = &component.fmu.description.variables[variable];
                component.period.is_none() && variable.variability == Variability::Continuous
            }
        }
    }

    fn inputs(
        &self,
        reference: &mut Reference,
        component: usize,
        chosen: impl Fn(usize) -> bool,
    ) -> Inputs {
        let variables = &self.system.components[component].fmu.description.variables;
        let mut inputs = Inputs::default();
        for connection in &self.system.connections {
            if connection.component == component && chosen(connection.input) {
                let signal = self.signal(reference, connection.source);
                let input = &variables[connection.input];
                let is_smooth = self.is_smooth(connection.source)
                    && input.kind == Kind::Float64
                    && input.variability == Variability::Continuous;
                inputs.add(input, signal, connection.factor, is_smooth);
            }
        }
        inputs
    }

    fn action(&self, reference: &mut Reference, operation: &Operation) -> Action {
        match operation {
            Operation::Call { component } => Action::Call { part: *component },
            Operation::Read { component, outputs } => {
                let variables = &self.system.components[*component].fmu.description.variables;
                let needed = |input| {
                    outputs
                        .iter()
                        .any(|&v| variables[v].dependencies.contains(&input))
                };
                let group = (*component, outputs.first().copied().unwrap_or(0));
                Action::Read {
                    part: *component,
                    inputs: self.inputs(reference, *component, needed),
                    outputs: self.groups.get(&group).cloned().unwrap_or_default(),
                }
            }
            Operation::Iterate(parts) => {
                let called = parts.iter().filter_map(|part| match part {
                    Operation::Call { component } => Some(*component),
                    _ => None,
                });
                Action::Iterate {
                    called: called.collect(),
                    actions: parts
                        .iter()
                        .map(|part| self.action(reference, part))
                        .collect(),
                    last: vec![0.0; self.names.len()],
                }
            }
        }
    }
}
