//! What order of calls an FMU bears. Between the outputs at a communication point and the step from
//! there stands, for direct feedthrough, a Set followed by a Get. FMI 2.0 forbids that (section
//! 4.2.4), most FMUs allow it, a few refuse it, and some answer with what their last step computed.
//! An instance that is thrown away is asked before the run.

use std::collections::HashSet;
use std::sync::Arc;

use super::start;
use fmi_import::{Causality, FmiVersion, Instance, Kind, Options, Processes};
use fmi_system::{Component, System};

/// What an FMU does with a Get after a Set.
#[derive(Debug, Clone, PartialEq)]
enum Answer {
    /// The newest inputs count, or nothing was found out.
    Newest,
    /// It refuses.
    Refuses,
    /// These outputs count from the next step on only, although they are declared to depend
    /// directly on inputs.
    Late(Vec<usize>),
}

/// The system as its FMUs bear it, and a message for each that is called in an order different from
/// its dependencies.
pub(super) fn bearable(
    system: &System,
    step: f64,
    stop: f64,
    options: &Options,
) -> (System, Vec<String>) {
    let mut system = system.clone();
    let mut notes = Vec::new();
    for index in 0..system.components.len() {
        let driven: HashSet<usize> = system
            .connections
            .iter()
            .filter(|connection| connection.component == index)
            .map(|connection| connection.input)
            .collect();
        let part = &system.components[index];
        if part.fmu.is_own || part.period.is_some() || part.fmu.description.needs_execution_tool {
            continue;
        }
        let answer = ask(part, &driven, step, stop, options).unwrap_or(Answer::Newest);
        let name = part.name.clone();
        match answer {
            Answer::Newest => {}
            Answer::Refuses => {
                let fmu = part.fmu.without_feedthrough();
                system.components[index].fmu = Arc::new(fmu);
                notes.push(format!(
                    "`{name}` refuses to give outputs once inputs are set (FMI 2.0, section \
                     4.2.4), so its outputs are read before: they follow its inputs one step \
                     ({} ms) later",
                    1e3 * step
                ));
            }
            Answer::Late(outputs) => {
                let variables = &part.fmu.description.variables;
                let outputs: Vec<&str> = outputs
                    .iter()
                    .map(|&output| variables[output].name.as_str())
                    .collect();
                notes.push(format!(
                    "`{name}` is declared to give `{}` directly from its inputs, but computes {} \
                     only in its steps: a delay of {} ms is added. If it is a sampled component \
                     (a controller), give it its `period` to call it without delay",
                    outputs.join("`, `"),
                    if outputs.len() == 1 { "it" } else { "them" },
                    1e3 * step
                ));
            }
        }
    }
    (system, notes)
}

/// Asks instances that are thrown away; nothing where that does not go well.
fn ask(
    part: &Component,
    driven: &HashSet<usize>,
    step: f64,
    stop: f64,
    options: &Options,
) -> Option<Answer> {
    let description = &part.fmu.description;
    let variables = &description.variables;
    let direct = |output: &usize| {
        variables[*output].kind == Kind::Float64
            && variables[*output].element.1 == 1
            && variables[*output]
                .dependencies
                .iter()
                .any(|input| driven.contains(input))
    };
    let outputs: Vec<usize> = description.of(Causality::Output).filter(direct).collect();
    let scalar = |input: &&usize| {
        variables[**input].kind == Kind::Float64 && variables[**input].element.1 == 1
    };
    let inputs: Vec<usize> = driven.iter().filter(scalar).copied().collect();
    if outputs.is_empty() || inputs.is_empty() {
        return None;
    }
    let references = |positions: &[usize]| -> Vec<u32> {
        positions
            .iter()
            .map(|&position| variables[position].reference)
            .collect()
    };
    let (inputs_at, outputs_at) = (references(&inputs), references(&outputs));
    let given = part.given();
    let starts = inputs
        .iter()
        .map(|&input| part.start_value(&given, input).number());
    let starts: Vec<f64> = starts.collect();
    let moved: Vec<f64> = starts
        .iter()
        .map(|start| start + 1e-3 * start.abs().max(1.0))
        .collect();
    // Nobody wants to read twice what it logs.
    let quiet = Options {
        trace: None,
        log_categories: None,
        ..options.clone()
    };
    let begin = || {
        let mut processes = Processes::new(&quiet);
        let mut instance = Instance::within(&part.fmu, &part.name, &mut processes, true).ok()?;
        start::prepare(&mut instance, part).ok()?;
        instance.enter_initialization(0.0, stop).ok()?;
        instance.exit_initialization().ok()?;
        instance.set(&Kind::Float64, &inputs_at, &starts).ok()?;
        instance.do_step(0.0, step).ok()?;
        Some((processes.diverted(), instance))
    };
    let (_diverted, mut asked) = begin()?;
    let mut before = vec![0.0; outputs.len()];
    let mut after = before.clone();
    asked.get(&Kind::Float64, &outputs_at, &mut before).ok()?;
    asked.set(&Kind::Float64, &inputs_at, &moved).ok()?;
    if asked.get(&Kind::Float64, &outputs_at, &mut after).is_err() {
        // Settings of an FMU in another process travel with the Get: which of them was refused?
        let (_diverted, mut other) = begin()?;
        other.set(&Kind::Float64, &inputs_at, &moved).ok()?;
        other.do_step(step, step).ok()?;
        let refuses = description.version == FmiVersion::V2;
        return refuses.then_some(Answer::Refuses);
    }
    let still: Vec<usize> = (0..outputs.len())
        .filter(|&at| before[at] == after[at])
        .collect();
    if still.is_empty() {
        return Some(Answer::Newest);
    }
    // Does the change show after the step?
    let (_diverted, mut other) = begin()?;
    let mut without = before.clone();
    asked.do_step(step, step).ok()?;
    asked.get(&Kind::Float64, &outputs_at, &mut after).ok()?;
    other.do_step(step, step).ok()?;
    other.get(&Kind::Float64, &outputs_at, &mut without).ok()?;
    let late: Vec<usize> = still
        .into_iter()
        .filter(|&at| after[at] != without[at])
        .map(|at| outputs[at])
        .collect();
    Some(if late.is_empty() {
        Answer::Newest
    } else {
        Answer::Late(late)
    })
}
