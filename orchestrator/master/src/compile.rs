//! From a checked system to a simulation: loads the FMUs and prepares every exchange of values.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::time::Duration;

use super::action::Action;
use super::algebraic::AlgebraicLoop;
use super::foresee::foresee;
use super::iterative::Coupling;
use super::reference::Reference;
use super::samples::Samples;
use super::signals::{Place, Signals};
use super::transfer::{Drive, Inputs, Outputs};
use super::variable::{self, StepControl, VariableStep};
use super::{Algorithm, EndSignals, MasterError, Part, Simulation, order, start, together};
use fmi_import::{Causality, Datum, Instance, Kind, Options, Processes, State, Variability};
use fmi_system::{Between, Connection, Operation, Quantity, Source, System};

/// How a system is stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Order of calls.
    pub algorithm: Algorithm,
    /// Coupling step, s; the greatest one where it varies.
    pub step: f64,
    /// Length of the run, s.
    pub stop: f64,
    /// How the step varies, if it does.
    pub variable: Option<VariableStep>,
}

impl Plan {
    /// Equal steps in the order of dependencies, s.
    #[must_use]
    pub fn fixed(step: f64, stop: f64) -> Self {
        Self {
            algorithm: Algorithm::default(),
            step,
            stop,
            variable: None,
        }
    }
}

impl Simulation {
    /// Loads and initializes `system` under the samples of `motion`, with a coupling step of `step` seconds.
    ///
    /// # Errors
    /// A step that does not divide the sampling periods, a loop, an FMU that cannot be loaded or
    /// refuses its parameters.
    pub fn new(
        system: &System,
        motion: &Samples,
        algorithm: Algorithm,
        step: f64,
    ) -> Result<Self, MasterError> {
        let stop = motion.len() as f64 * motion.period;
        Self::with(system, motion, algorithm, (step, stop), &Options::default())
    }

    /// As [`Simulation::new`], for a run of `stop` seconds, with FMUs run as `options` say.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn with(
        system: &System,
        motion: &Samples,
        algorithm: Algorithm,
        (step, stop): (f64, f64),
        options: &Options,
    ) -> Result<Self, MasterError> {
        let plan = Plan {
            algorithm,
            step,
            stop,
            variable: None,
        };
        Self::planned(system, motion, &plan, options)
    }

    /// As [`Simulation::new`], of the run that `plan` says, with FMUs run as `options` say.
    ///
    /// # Errors
    /// As [`Simulation::new`]; a variable step that does not suit the components.
    pub fn planned(
        system: &System,
        motion: &Samples,
        plan: &Plan,
        options: &Options,
    ) -> Result<Self, MasterError> {
        let Plan {
            algorithm,
            step: greatest,
            stop,
            variable,
        } = *plan;
        let divisions = match &variable {
            Some(wanted) => variable::divisions(system, algorithm, greatest, wanted)?,
            None => 1,
        };
        let step = greatest / divisions as f64;
        // A Jacobi master sets, steps and reads: every FMU bears that.
        let (system, mut notes) = match algorithm {
            Algorithm::Jacobi => (system.clone(), Vec::new()),
            _ => order::bearable(system, step, stop, options),
        };
        let system = &system;
        let ticks_per_row =
            divisions * ticks(motion.period, greatest, "the sample time of the motion")?;
        // A Jacobi master meets loops of direct feedthrough at the beginning only.
        let schedule = system.schedule(algorithm != Algorithm::GaussSeidel)?;
        let repeats_calls = |component: usize| {
            schedule.operations.iter().any(|operation| match operation {
                Operation::Iterate { operations, .. } => {
                    operations.contains(&Operation::Call { component })
                }
                _ => false,
            })
        };
        let mut reference = Reference::new(motion, &system.tables);
        // A system without a motion has no columns of one.
        for quantity in Quantity::ALL
            .into_iter()
            .take(motion.columns.len())
            .filter(|_| !motion.is_empty())
        {
            reference.tap(quantity, 0);
        }
        for connection in &system.connections {
            match connection.source {
                Source::Reference { quantity, ahead } => {
                    reference.tap(quantity, ahead);
                }
                Source::Table { table, column } => {
                    reference.tap_table(table, column);
                }
                Source::Output { .. } => {}
            }
        }
        let mut plan = Places::new(system, &mut reference, &schedule.operations);
        plan.tables_are_smooth = variable.is_some();
        let mut processes = Processes::new(options);
        let mut parts = Vec::with_capacity(system.components.len());
        for (index, component) in system.components.iter().enumerate() {
            let saves_state = component.fmu.description.saves_state;
            if algorithm == Algorithm::Iterative && repeats_calls(index) && !saves_state {
                return Err(MasterError::NoState(component.name.clone()));
            }
            let may_fail =
                component.period.is_some() && system.stop.is_some_and(|(guard, _)| guard != index);
            let (fmu, name) = (&component.fmu, &component.name);
            let mut instance = Instance::within(fmu, name, &mut processes, may_fail)?;
            start::prepare(&mut instance, component)?;
            let every = component
                .period
                .map(|period| {
                    ticks(
                        period,
                        greatest,
                        &format!("the period of `{}`", component.name),
                    )
                })
                .transpose()?;
            parts.push(Part {
                is_apart: instance.is_apart(),
                is_requested: false,
                instance,
                every: every.map(|steps| divisions * steps),
                inputs: plan.inputs(&mut reference, index, |_| true),
                outputs: std::mem::take(&mut plan.outputs[index]),
                state: State::default(),
                may_fail,
                failure: None,
                ended: None,
                steps: 0,
                spent: Duration::ZERO,
            });
        }
        let actions = schedule.operations.iter();
        let actions = actions.map(|operation| plan.action(&mut reference, operation, &parts));
        let mut actions: Vec<Action> = actions.collect();
        let mut together = Vec::new();
        if algorithm == Algorithm::GaussSeidel {
            if variable.is_none() {
                together = together::plan(&mut actions, &parts);
            }
            foresee(&mut parts, &actions);
        }
        // What ends a run is Boolean, and its cause an enumeration: both are numbers.
        let number = |place: &(usize, usize)| match plan.places.get(place) {
            Some(Place::Number(signal)) => Some(*signal),
            _ => None,
        };
        let end = system.end.and_then(|end| {
            let cause = end.cause.and_then(|(component, variable)| {
                let variables = &system.components[component].fmu.description.variables;
                let items = match &variables[variable].kind {
                    Kind::Enumeration(items) => items.clone(),
                    _ => Vec::new(),
                };
                Some((number(&(component, variable))?, items))
            });
            Some(EndSignals {
                when: number(&end.when)?,
                cause,
                after: end.after,
            })
        });
        let guard = system.stop.map(|(part, variable)| {
            let variables = &system.components[part].fmu.description.variables;
            (part, variables[variable].reference)
        });
        let aliases = system.components.iter().enumerate();
        let aliases = aliases.flat_map(|(index, part)| {
            part.all_aliases()
                .map(move |(alias, output)| (index, format!("{}.{alias}", part.name), output))
        });
        let mut alias_signals = Vec::new();
        let mut alias_names = Vec::new();
        for (index, name, output) in aliases {
            if let Some(Place::Number(signal)) = plan.places.get(&(index, output)) {
                alias_signals.push(*signal);
                alias_names.push(name);
            }
        }
        let mut kept: Vec<Range<usize>> = Vec::new();
        for signal in (0..plan.names.len()).filter(|&signal| !reference.is_shifted(signal)) {
            match kept.last_mut() {
                Some(last) if last.end == signal => last.end += 1,
                _ => kept.push(signal..signal + 1),
            }
        }
        let (exact_names, exact) = plan.exact.into_iter().unzip();
        let signals = Signals {
            numbers: vec![0.0; plan.names.len()],
            exact,
        };
        let coupling = Coupling::new(&parts, reference.len());
        if algorithm == Algorithm::Iterative {
            notes.extend(coupling.explicit(&parts).into_iter().map(|at| {
                format!(
                    "`{}` cannot save its state (its FMU does not offer it), so its steps are not \
                     repeated: its inputs are extrapolated over each, as with --algorithm gauss-seidel",
                    parts[at].instance.name
                )
            }));
        }
        let control = variable.map(|wanted| {
            let control =
                StepControl::new(&wanted, divisions, coupling.signals().collect(), &parts);
            notes.extend(control.notes(&parts));
            control
        });
        let mut simulation = Self {
            algorithm,
            variable: control,
            coupling,
            begin: system.start,
            step,
            tick: 0,
            ticks_per_row,
            next_signals: signals.clone(),
            last_signals: signals.clone(),
            signals,
            observer: None,
            tuning: super::tuning::Tuning::default(),
            tripped: None,
            keeper: None,
            resumed: None,
            first_tick: 0,
            names: plan.names,
            exact_names,
            reference,
            parts,
            diverted: processes.diverted(),
            actions,
            together,
            notes,
            interrupt: None,
            keep_every: 1,
            kept,
            alias_signals,
            alias_names,
            clock: None,
            end,
            stop: guard,
            is_stopped: false,
        };
        start::initialize(&mut simulation, system.start + stop)?;
        Ok(simulation)
    }
}

/// Shorter coupling steps are mistakes, s.
const SHORTEST_STEP: f64 = 1e-9;

/// How many steps make a period.
fn ticks(period: f64, step: f64, what: &str) -> Result<usize, MasterError> {
    if step.is_finite() && step < SHORTEST_STEP {
        return Err(MasterError::Step(format!(
            "--step: a coupling step of {step:e} s is shorter than a nanosecond"
        )));
    }
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
struct Places<'a> {
    system: &'a System,
    /// Whether what a table holds on straight lines changes between samples.
    tables_are_smooth: bool,
    places: HashMap<(usize, usize), Place>,
    names: Vec<String>,
    /// Names and empty values of signals that numbers do not hold.
    exact: Vec<(String, Datum)>,
    /// The outputs of each component.
    outputs: Vec<Outputs>,
    /// The outputs of each operation, by component and first output.
    groups: HashMap<(usize, usize), Outputs>,
    /// Connections to each component, in their order.
    incoming: Vec<Vec<&'a Connection>>,
}

impl<'a> Places<'a> {
    fn new(system: &'a System, reference: &mut Reference, operations: &[Operation]) -> Self {
        let mut names = vec![String::new(); reference.len()];
        // Those of the motion come first, in this order; the others follow as they are connected.
        for (name, quantity) in names.iter_mut().zip(Quantity::ALL) {
            let source = Source::Reference { quantity, ahead: 0 };
            *name = system.origin(source).to_string();
        }
        let mut incoming = vec![Vec::new(); system.components.len()];
        for connection in &system.connections {
            let tap = match connection.source {
                Source::Reference { quantity, ahead } => Some(reference.tap(quantity, ahead)),
                Source::Table { table, column } => Some(reference.tap_table(table, column)),
                Source::Output { .. } => None,
            };
            if let Some(tap) = tap {
                names[tap] = system.origin(connection.source).to_string();
            }
            incoming[connection.component].push(connection);
        }
        let mut plan = Self {
            system,
            tables_are_smooth: false,
            places: HashMap::new(),
            names,
            exact: Vec::new(),
            outputs: vec![Outputs::default(); system.components.len()],
            groups: HashMap::new(),
            incoming,
        };
        for operation in operations {
            plan.place(operation);
        }
        plan
    }

    /// Gives the outputs of an operation their signals, those of one type side by side.
    fn place(&mut self, operation: &Operation) {
        let (component, outputs) = match operation {
            Operation::Iterate { operations, .. } => {
                operations.iter().for_each(|part| self.place(part));
                return;
            }
            Operation::Read { component, outputs } => (*component, outputs.clone()),
            Operation::Call { component } => {
                let description = &self.system.components[*component].fmu.description;
                let outputs = description.of(Causality::Output);
                (*component, outputs.collect())
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
            let first = match kind.is_exact() {
                true => self.exact.len(),
                false => self.names.len(),
            };
            let (mut references, mut count) = (Vec::new(), 0);
            let alike = outputs.iter().filter(|&&v| variables[v].kind == *kind);
            for &output in alike {
                let name = self.system.variable_name(component, output).to_string();
                let place = if kind.is_exact() {
                    self.exact.push((name, Datum::empty(kind)));
                    Place::Exact(first + count)
                } else {
                    self.names.push(name);
                    Place::Number(first + count)
                };
                self.places.insert((component, output), place);
                // The elements of an array stand side by side.
                if variables[output].element.0 == 0 {
                    references.push(variables[output].reference);
                }
                count += 1;
            }
            group.add(kind, references, count, first);
        }
        self.outputs[component].extend(&group);
        self.groups
            .insert((component, outputs.first().copied().unwrap_or(0)), group);
    }

    fn signal(&self, reference: &mut Reference, source: Source) -> Place {
        match source {
            Source::Reference { quantity, ahead } => Place::Number(reference.tap(quantity, ahead)),
            Source::Table { table, column } => Place::Number(reference.tap_table(table, column)),
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
            Source::Table { table, .. } => {
                self.tables_are_smooth && self.system.tables[table].between == Between::Linear
            }
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

    /// The driven inputs of a component among the chosen ones; arrays as a whole.
    fn inputs(
        &self,
        reference: &mut Reference,
        component: usize,
        chosen: impl Fn(usize) -> bool,
    ) -> Inputs {
        let part = &self.system.components[component];
        let variables = &part.fmu.description.variables;
        let mut inputs = Inputs::default();
        // Elements of arrays, by the position of the first.
        let mut arrays: HashMap<usize, Vec<Option<Drive>>> = HashMap::new();
        let mut order = Vec::new();
        for connection in &self.incoming[component] {
            let input = &variables[connection.input];
            let (element, size) = input.element;
            let first = connection.input - element;
            if !(first..first + size).any(&chosen) {
                continue;
            }
            let is_smooth = self.is_smooth(connection.source)
                && input.kind == Kind::Float64
                && input.variability == Variability::Continuous;
            let drive = Drive {
                signal: self.signal(reference, connection.source),
                passage: connection.passage.clone(),
                is_smooth,
            };
            let drives = arrays.entry(first).or_insert_with(|| {
                order.push(first);
                vec![None; size]
            });
            drives[element] = Some(drive);
        }
        let given = part.given();
        for first in order {
            let elements: Vec<_> = arrays[&first]
                .iter()
                .zip(first..)
                .map(|(drive, position)| (drive.clone(), part.start_value(&given, position)))
                .collect();
            inputs.add(&variables[first], &elements);
        }
        inputs
    }

    fn action(&self, reference: &mut Reference, operation: &Operation, parts: &[Part]) -> Action {
        match operation {
            Operation::Call { component } => Action::Call { part: *component },
            Operation::Read { component, outputs } => {
                let variables = &self.system.components[*component].fmu.description.variables;
                // Outputs mostly share their lists of dependencies.
                let mut known = HashSet::new();
                let lists = outputs
                    .iter()
                    .map(|&output| &variables[output].dependencies);
                let lists = lists.filter(|list| known.insert(list.as_ptr()));
                let needed: HashSet<usize> = lists.flat_map(|list| list.iter().copied()).collect();
                let group = (*component, outputs.first().copied().unwrap_or(0));
                Action::Read {
                    part: *component,
                    inputs: self.inputs(reference, *component, |input| needed.contains(&input)),
                    outputs: self.groups.get(&group).cloned().unwrap_or_default(),
                }
            }
            Operation::Iterate { operations, round } => {
                let actions = operations.iter();
                let actions = actions.map(|inner| self.action(reference, inner, parts));
                let actions = actions.collect();
                Action::Solve(AlgebraicLoop::new(actions, parts, round.clone()))
            }
        }
    }
}
