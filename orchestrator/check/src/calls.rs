//! The library, called in a process of its own: in the order of the standard, from a saved state,
//! twice in parallel, and out of order.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::{Findings, derivatives};
use fmi_import::{
    CallError, Datum, Fmu, FmuError, Instance, Interface, Isolation, Kind, Options, Processes,
    Progress, State, Variable,
};
use fmi_master::MasterError;
use fmi_system::SystemError;

/// Steps that are made.
const STEPS: usize = 20;
/// A call may take so long.
const LIMIT: Duration = Duration::from_secs(20);
/// Steps where the description names none.
const PARTS: f64 = 100.0;

/// What is read of an instance after each step.
type Rows = Vec<Vec<Datum>>;

/// Calls the library.
pub(super) fn check(findings: &mut Findings, fmu: &Arc<Fmu>, guest: Option<&Path>) {
    let options = Options {
        isolation: Isolation::All,
        guest: guest.map(Path::to_path_buf),
        call_limit: LIMIT,
        ..Options::default()
    };
    let Some(first) = in_order(findings, fmu, &options) else {
        return;
    };
    if let Ok(second) = run(&mut Findings::default(), fmu, &options)
        && second != first
    {
        findings.warning(
            "library",
            "a second run gives different results from the first",
        );
    }
    two_at_once(findings, fmu, &options, &first);
    from_a_state(findings, fmu, &options);
    out_of_order(findings, fmu, &options);
    derivatives::check(findings, fmu, &options);
}

/// Step size and, where it is known, the end, s.
pub(super) fn plan(fmu: &Fmu) -> (f64, f64) {
    steps(fmu.description.preferred_step, fmu.description.default_stop)
}

/// Step size and end of a run whose description names them or not, s.
fn steps(step: Option<f64>, stop: Option<f64>) -> (f64, f64) {
    match (step, stop) {
        (Some(step), Some(stop)) => (step, stop),
        (Some(step), None) => (step, step * STEPS as f64),
        (None, Some(stop)) => (stop / PARTS, stop),
        (None, None) => (1e-3, 1e-3 * STEPS as f64),
    }
}

/// Why an FMU does not run.
#[derive(Debug, thiserror::Error)]
pub(super) enum RunError {
    /// An instance cannot be made.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// A call that it did not complete.
    #[error(transparent)]
    Call(#[from] Box<CallError>),
    /// It is not a system by itself.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The master cannot begin.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// Too few or too many steps.
    #[error("{duration} s are {steps:e} steps of {step} s")]
    Steps {
        /// Time of the run, s.
        duration: f64,
        /// How many.
        steps: f64,
        /// One step, s.
        step: f64,
    },
}

pub(super) fn instance(fmu: &Arc<Fmu>, options: &Options) -> Result<Instance, FmuError> {
    let mut processes = Processes::new(options);
    Instance::within(fmu, "validated", &mut processes, true)
}

fn in_order(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options) -> Option<Rows> {
    match run(findings, fmu, options) {
        Ok(rows) => {
            let (step, _) = plan(fmu);
            findings.check(format!(
                "library: instantiated, initialized, {} steps of {step} s, every variable read, \
                 terminated",
                rows.len().saturating_sub(1)
            ));
            Some(rows)
        }
        Err(reason)
            if fmu.description.interface == Interface::ModelExchange
                && reason.to_string().contains("did not return") =>
        {
            findings.warning(
                "library",
                format!("too stiff or slow for this program's solver: {reason}"),
            );
            None
        }
        Err(reason) => {
            findings.error("library", reason.to_string());
            None
        }
    }
}

/// A run as the standard orders its calls; every variable is read after each step.
fn run(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options) -> Result<Rows, RunError> {
    let (step, stop) = plan(fmu);
    let mut instance = instance(fmu, options)?;
    instance.enter_initialization(0.0, stop)?;
    instance.exit_initialization()?;
    let mut rows = vec![read(findings, &mut instance)?];
    for k in 0..STEPS {
        let time = k as f64 * step;
        if time + step > stop * (1.0 + 1e-9) {
            break;
        }
        let progress = instance.do_step(time, step)?;
        rows.push(read(findings, &mut instance)?);
        if let Progress::Ended(at) = progress {
            findings.note("library", format!("it ended its run by itself at {at} s"));
            break;
        }
    }
    instance.close();
    for message in instance.take_messages() {
        if !["ok", "warning"].contains(&message.status) {
            let text = format!("logged with status {}: {}", message.status, message.text);
            findings.warning("library", text);
        }
    }
    Ok(rows)
}

/// Every variable that can be read.
fn read(findings: &mut Findings, instance: &mut Instance) -> Result<Vec<Datum>, Box<CallError>> {
    let fmu = instance.fmu.clone();
    let mut row = Vec::new();
    let variables = fmu.description.variables.iter();
    let whole = variables.filter(|variable| variable.element.0 == 0 && variable.kind.has_values());
    let whole: Vec<&Variable> = whole.collect();
    // Numbers of one type in one call: one for each would take a while where there are many.
    for alike in whole.chunk_by(|one, other| one.kind == other.kind && !one.kind.is_exact()) {
        let kind = &alike[0].kind;
        let references: Vec<u32> = alike.iter().map(|variable| variable.reference).collect();
        let mut values = vec![0.0; alike.iter().map(|variable| variable.element.1).sum()];
        if alike.len() > 1 && instance.get(kind, &references, &mut values).is_ok() {
            let mut at = 0;
            for variable in alike {
                at += variable.element.1;
                check_choice(findings, variable, values.get(at - 1).copied());
            }
            row.extend(values.into_iter().map(Datum::Number));
            continue;
        }
        for variable in alike {
            read_one(findings, instance, variable, &mut row)?;
        }
    }
    Ok(row)
}

/// Reads one variable, or one array.
fn read_one(
    findings: &mut Findings,
    instance: &mut Instance,
    variable: &Variable,
    row: &mut Vec<Datum>,
) -> Result<(), Box<CallError>> {
    let references = [variable.reference];
    let size = variable.element.1;
    let outcome = if variable.kind.is_exact() {
        let mut data = vec![Datum::empty(&variable.kind); size];
        let read = instance.get_exact(&variable.kind, &references, &mut data);
        read.map(|()| row.extend(data))
    } else {
        let mut values = vec![0.0; size];
        let read = instance.get(&variable.kind, &references, &mut values);
        read.map(|()| row.extend(values.into_iter().map(Datum::Number)))
    };
    if let Err(error) = outcome {
        let is_dead = error.outcome.contains("its process");
        let message = format!("`{}`: {} {}", variable.name, error.call, error.outcome);
        if is_dead {
            return Err(error);
        }
        findings.error("library", message);
    }
    let last = match row.last() {
        Some(Datum::Number(value)) => Some(*value),
        _ => None,
    };
    check_choice(findings, variable, last);
    Ok(())
}

/// The value of an enumeration is one of its choices.
fn check_choice(findings: &mut Findings, variable: &Variable, value: Option<f64>) {
    if let (Kind::Enumeration(items), Some(value)) = (&variable.kind, value)
        && !items.is_empty()
        && !items.iter().any(|item| item.value as f64 == value)
    {
        let message = format!(
            "`{}` is {value}, which is not one of its choices",
            variable.name
        );
        findings.warning("library", message);
    }
}

/// Two instances in parallel give the same results as one alone.
fn two_at_once(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options, alone: &Rows) {
    if fmu.description.only_one_per_process {
        return;
    }
    let both = || -> Result<[Rows; 2], RunError> {
        let mut processes = Processes::new(options);
        let mut make = |name: &str| Instance::within(fmu, name, &mut processes, false);
        let mut all = [make("first")?, make("second")?];
        let (step, stop) = plan(fmu);
        let mut rows = [Rows::new(), Rows::new()];
        for instance in &mut all {
            instance.enter_initialization(0.0, stop)?;
            instance.exit_initialization()?;
        }
        let quiet = &mut Findings::default();
        for (rows, instance) in rows.iter_mut().zip(&mut all) {
            rows.push(read(quiet, instance)?);
        }
        for k in 0..alone.len().saturating_sub(1) {
            for (rows, instance) in rows.iter_mut().zip(&mut all) {
                instance.do_step(k as f64 * step, step)?;
                rows.push(read(quiet, instance)?);
            }
        }
        Ok(rows)
    };
    match both() {
        Err(reason) => findings.error(
            "library",
            format!(
                "two instances in one process: {reason}; canBeInstantiatedOnlyOncePerProcess \
                     is not set"
            ),
        ),
        Ok(rows) if rows.iter().any(|rows| rows != alone) => findings.error(
            "library",
            "two instances in one process give results that differ from those of one",
        ),
        Ok(_) => findings.check("library: two instances in one process"),
    }
}

/// Going on from a saved state gives the same again.
fn from_a_state(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options) {
    if !fmu.description.saves_state {
        findings.note(
            "library",
            "it cannot save its state, so its steps cannot be repeated",
        );
        return;
    }
    let tried = || -> Result<bool, RunError> {
        let (step, stop) = plan(fmu);
        let mut instance = instance(fmu, options)?;
        instance.enter_initialization(0.0, stop)?;
        instance.exit_initialization()?;
        let steps = ((stop / step).round() as usize).clamp(1, STEPS);
        let half = steps / 2;
        for k in 0..half {
            instance.do_step(k as f64 * step, step)?;
        }
        let mut state = State::default();
        instance.save_state(&mut state)?;
        let quiet = &mut Findings::default();
        let mut rows: [Rows; 2] = [Rows::new(), Rows::new()];
        for (pass, rows) in rows.iter_mut().enumerate() {
            if pass > 0 {
                instance.restore_state(&state)?;
            }
            for k in half..steps {
                let progress = instance.do_step(k as f64 * step, step)?;
                rows.push(read(quiet, &mut instance)?);
                if progress != Progress::Whole {
                    break;
                }
            }
        }
        instance.free_state(state)?;
        Ok(rows[0] == rows[1])
    };
    match tried() {
        Ok(true) => {
            findings.check("library: steps repeated from a saved state, the same to the bit")
        }
        Ok(false) => findings.error("library", "steps from a saved state give different values"),
        Err(reason) => findings.error("library", format!("a state saved and restored: {reason}")),
    }
}

/// Calls that the standard forbids where they are made: the library has to refuse them, and must not
/// die of them.
fn out_of_order(findings: &mut Findings, fmu: &Arc<Fmu>, options: &Options) {
    let (step, stop) = plan(fmu);
    let unknown = fmu.description.variables.iter().map(|v| v.reference).max();
    let unknown = unknown.map_or(u32::MAX, |most| most.saturating_add(1_000_003));
    type Step<'a> = &'a dyn Fn(&mut Instance) -> Result<(), Box<fmi_import::CallError>>;
    let ready = |instance: &mut Instance| -> Result<(), Box<fmi_import::CallError>> {
        instance.enter_initialization(0.0, stop)?;
        instance.exit_initialization()
    };
    let early = |instance: &mut Instance| instance.do_step(0.0, step).map(|_| ());
    let uninitialized = |instance: &mut Instance| instance.exit_initialization();
    let backwards = |instance: &mut Instance| instance.do_step(0.0, -step).map(|_| ());
    let elsewhere = |instance: &mut Instance| instance.do_step(1e6 * step, step).map(|_| ());
    let stranger = |instance: &mut Instance| instance.get(&Kind::Float64, &[unknown], &mut [0.0]);
    let not_a_number = |instance: &mut Instance| instance.do_step(f64::NAN, step).map(|_| ());
    let tries: [(&str, bool, Step); 6] = [
        ("doStep before initialization", false, &early),
        (
            "ExitInitializationMode without entering it",
            false,
            &uninitialized,
        ),
        ("doStep by a negative step", true, &backwards),
        (
            "doStep from a time that it has not reached",
            true,
            &elsewhere,
        ),
        ("reading an unknown value reference", true, &stranger),
        (
            "doStep from a time that is not a number",
            true,
            &not_a_number,
        ),
    ];
    for (what, is_ready, forbidden) in tries {
        let made = instance(fmu, options);
        let Ok(mut instance) = made else {
            continue;
        };
        if is_ready && ready(&mut instance).is_err() {
            continue;
        }
        match forbidden(&mut instance) {
            Ok(()) => findings.warning("library", format!("{what} is accepted, not refused")),
            Err(error)
                if ["its process", "did not return"]
                    .iter()
                    .any(|words| error.outcome.contains(words)) =>
            {
                let text = format!("{what}: {}", error.outcome);
                findings.error("library", text);
            }
            Err(_) => {}
        }
    }
    findings.check(format!("library: {} calls out of order", tries.len()));
}

#[cfg(test)]
mod tests;
