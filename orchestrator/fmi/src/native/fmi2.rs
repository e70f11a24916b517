//! FMI 2.0.

use std::ffi::{c_char, c_int, c_void};
use std::path::Path;
use std::sync::Arc;

use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};

use super::super::FmiVersion;
use super::super::call::{Call, Endpoint, Function, Lost, Scalar, Stepped, Values};
use super::super::error::InstanceError;
use super::callbacks::{Callbacks, Environment};
use super::library::Functions;
use super::state::StateFunctions;
use super::{
    DISCARD, FATAL, Handle, Kept, Mode, Setup, Sink, copy_strings, derivative, enter, leave,
    missing, pointer, text_for_c, unknown, with_strings,
};

type Instantiate = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> *mut c_void;
type Simple = unsafe extern "C" fn(*mut c_void) -> c_int;
type SetupExperiment = unsafe extern "C" fn(*mut c_void, c_int, f64, f64, c_int, f64) -> c_int;
type Access = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut c_void) -> c_int;
type DoStep = unsafe extern "C" fn(*mut c_void, f64, f64, c_int) -> c_int;
type Logging = unsafe extern "C" fn(*mut c_void, c_int, usize, *const *const c_char) -> c_int;
type BooleanStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut c_int) -> c_int;
type RealStatus = unsafe extern "C" fn(*mut c_void, c_int, *mut f64) -> c_int;
type SetTime = unsafe extern "C" fn(*mut c_void, f64) -> c_int;
type Reals = unsafe extern "C" fn(*mut c_void, *mut c_void, usize) -> c_int;
type Discrete = unsafe extern "C" fn(*mut c_void, *mut EventInfo) -> c_int;
type Derivative = unsafe extern "C" fn(
    *mut c_void,
    *const u32,
    usize,
    *const u32,
    usize,
    *const f64,
    *mut f64,
) -> c_int;
type Completed = unsafe extern "C" fn(*mut c_void, c_int, *mut c_int, *mut c_int) -> c_int;

/// `fmi2EventInfo`.
#[repr(C)]
#[derive(Default)]
struct EventInfo {
    again: c_int,
    terminate: c_int,
    nominals_changed: c_int,
    states_changed: c_int,
    next_defined: c_int,
    next: f64,
}

/// The functions; those that few FMUs have or need may be missing.
struct Table {
    setup_experiment: SetupExperiment,
    enter_initialization: Simple,
    exit_initialization: Simple,
    free_instance: unsafe extern "C" fn(*mut c_void),
    terminate: Option<Simple>,
    reset: Option<Simple>,
    do_step: Option<DoStep>,
    get: [Option<Access>; 4],
    set: [Option<Access>; 4],
    state: StateFunctions,
    logging: Option<Logging>,
    boolean_status: Option<BooleanStatus>,
    real_status: Option<RealStatus>,
    enter_event_mode: Option<Simple>,
    enter_continuous_time_mode: Option<Simple>,
    new_discrete_states: Option<Discrete>,
    completed: Option<Completed>,
    set_time: Option<SetTime>,
    set_states: Option<Reals>,
    get_states: Option<Reals>,
    derivatives: Option<Reals>,
    indicators: Option<Reals>,
    nominals: Option<Reals>,
    directional: Option<Derivative>,
}

/// An instance of an FMI 2.0 FMU.
pub(super) struct Fmi2 {
    table: Table,
    instance: Handle,
    kept: Option<Kept>,
    is_dead: bool,
}

impl Fmi2 {
    pub(super) fn new(setup: &Setup, sink: Arc<dyn Sink>) -> Result<Self, InstanceError> {
        let mut f = Functions::load(&setup.library, "fmi2")?;
        // SAFETY: the types are those of the standard's headers.
        let (instantiate, table) = unsafe {
            let instantiate = f.needed::<Instantiate>("Instantiate");
            let needed = (
                f.needed("SetupExperiment"),
                f.needed("EnterInitializationMode"),
                f.needed("ExitInitializationMode"),
                f.needed("FreeInstance"),
            );
            let do_step = match setup.mode {
                Mode::CoSimulation { .. } => f.needed("DoStep"),
                Mode::ModelExchange { .. } => None,
            };
            let names = ["Real", "Integer", "Boolean", "String"];
            let (Some(setup_experiment), Some(enter), Some(exit), Some(free)) = needed else {
                f.finish()?;
                return Err(InstanceError::Lacking(Vec::new()));
            };
            let table = Table {
                setup_experiment,
                enter_initialization: enter,
                exit_initialization: exit,
                free_instance: free,
                do_step,
                terminate: f.optional("Terminate"),
                reset: f.optional("Reset"),
                get: names.map(|name| f.optional(&format!("Get{name}"))),
                set: names.map(|name| f.optional(&format!("Set{name}"))),
                state: StateFunctions::of(&f, FmiVersion::V2),
                logging: f.optional("SetDebugLogging"),
                boolean_status: f.optional("GetBooleanStatus"),
                real_status: f.optional("GetRealStatus"),
                enter_event_mode: f.optional("EnterEventMode"),
                enter_continuous_time_mode: f.optional("EnterContinuousTimeMode"),
                new_discrete_states: f.optional("NewDiscreteStates"),
                completed: f.optional("CompletedIntegratorStep"),
                set_time: f.optional("SetTime"),
                set_states: f.optional("SetContinuousStates"),
                get_states: f.optional("GetContinuousStates"),
                derivatives: f.optional("GetDerivatives"),
                indicators: f.optional("GetEventIndicators"),
                nominals: f.optional("GetNominalsOfContinuousStates"),
                directional: f.optional("GetDirectionalDerivative"),
            };
            (instantiate, table)
        };
        let library = f.finish()?;
        let Some(instantiate) = instantiate else {
            return Err(InstanceError::Lacking(Vec::new()));
        };
        let environment = Environment::new(sink);
        let callbacks = Callbacks::new(&environment);
        let (name, token) = (text_for_c(&setup.name)?, text_for_c(&setup.token)?);
        let resources = text_for_c(&uri(&setup.resources))?;
        let kind = match setup.mode {
            Mode::ModelExchange { .. } => 0,
            Mode::CoSimulation { .. } => 1,
        };
        // SAFETY: all pointers live; the callbacks do until the instance is freed.
        let instance = unsafe {
            instantiate(
                name.as_ptr(),
                kind,
                token.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                0,
                c_int::from(setup.logging),
            )
        };
        if instance.is_null() {
            return Err(InstanceError::Refused);
        }
        Ok(Self {
            table,
            instance: Handle(instance),
            kept: Some(Kept {
                _callbacks: Some(callbacks),
                environment,
                _library: library,
            }),
            is_dead: false,
        })
    }

    fn carry_out(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let (table, c) = (&self.table, self.instance.0);
        let simple = |function: Option<Simple>| {
            // SAFETY: the instance lives.
            Ok(unsafe { function.ok_or_else(missing)?(c) })
        };
        // SAFETY: the instance lives, and arrays are as long as they are said to be.
        unsafe {
            match call.function {
                Function::Get(scalar) | Function::Set(scalar) => self.access(call, scalar),
                Function::DoStep => {
                    let (time, step) = (call.numbers[0], call.numbers[1]);
                    let do_step = table.do_step.ok_or_else(missing)?;
                    let status = do_step(c, time, step, c_int::from(call.flags[0]));
                    call.numbers[0] = time + step;
                    call.flags = [false; 5];
                    Ok(status)
                }
                Function::SetupExperiment => {
                    let [start, stop, tolerance] = call.numbers;
                    let [stop_defined, tolerance_defined, ..] = call.flags.map(c_int::from);
                    let setup = table.setup_experiment;
                    Ok(setup(
                        c,
                        tolerance_defined,
                        tolerance,
                        start,
                        stop_defined,
                        stop,
                    ))
                }
                Function::EnterInitializationMode => Ok((table.enter_initialization)(c)),
                Function::ExitInitializationMode => Ok((table.exit_initialization)(c)),
                Function::Terminate => simple(table.terminate),
                Function::Reset => simple(table.reset),
                Function::EnterEventMode => simple(table.enter_event_mode),
                Function::EnterContinuousTimeMode => simple(table.enter_continuous_time_mode),
                Function::UpdateDiscreteStates => {
                    let mut info = EventInfo::default();
                    let update = table.new_discrete_states.ok_or_else(missing)?;
                    let status = update(c, &raw mut info);
                    call.flags = [
                        info.again,
                        info.terminate,
                        info.nominals_changed,
                        info.states_changed,
                        info.next_defined,
                    ]
                    .map(|flag| flag != 0);
                    call.numbers[0] = info.next;
                    Ok(status)
                }
                Function::CompletedIntegratorStep => {
                    let (mut event, mut terminate) = (0, 0);
                    let completed = table.completed.ok_or_else(missing)?;
                    let no_state = c_int::from(call.flags[0]);
                    let status = completed(c, no_state, &raw mut event, &raw mut terminate);
                    call.flags = [event != 0, terminate != 0, false, false, false];
                    Ok(status)
                }
                Function::SetDebugLogging => {
                    let logging = table.logging.ok_or_else(missing)?;
                    let on = c_int::from(call.flags[0]);
                    let none = Vec::new();
                    let categories = match &call.values {
                        Values::TextsIn(texts) => texts,
                        _ => &none,
                    };
                    with_strings(categories, |all| logging(c, on, all.len(), all.as_ptr()))
                }
                Function::GetTerminated => {
                    let mut terminated = 0;
                    let status = table.boolean_status.ok_or_else(missing)?;
                    let status = status(c, 3, &raw mut terminated);
                    call.flags[0] = terminated != 0;
                    Ok(status)
                }
                Function::GetLastSuccessfulTime => {
                    let status = table.real_status.ok_or_else(missing)?;
                    Ok(status(c, 2, &raw mut call.numbers[0]))
                }
                Function::SetTime => Ok(table.set_time.ok_or_else(missing)?(c, call.numbers[0])),
                Function::SetContinuousStates
                | Function::GetContinuousStates
                | Function::GetDerivatives
                | Function::GetEventIndicators
                | Function::GetNominals => {
                    let function = match call.function {
                        Function::SetContinuousStates => table.set_states,
                        Function::GetContinuousStates => table.get_states,
                        Function::GetDerivatives => table.derivatives,
                        Function::GetEventIndicators => table.indicators,
                        _ => table.nominals,
                    };
                    let function = function.ok_or_else(missing)?;
                    Ok(function(c, pointer(&mut call.values), call.count))
                }
                Function::GetDirectionalDerivative => {
                    let (unknowns, knowns) = call.references.split_at(call.unknowns());
                    let (n, count) = (unknowns.len(), knowns.len());
                    let (Some(derivative), Some(values)) =
                        (table.directional, derivative(call, count, n))
                    else {
                        return Ok(DISCARD);
                    };
                    let (seed, sensitivity) = values;
                    let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
                    Ok(derivative(c, unknowns, n, knowns, count, seed, sensitivity))
                }
                _ => match table.state.carry_out(call, &self.instance) {
                    Some(outcome) => outcome,
                    None => Err(unknown(call, FmiVersion::V2)),
                },
            }
        }
    }

    #[inline]
    fn access(&self, call: &mut Call, scalar: Scalar) -> Result<i32, Lost> {
        let place = match scalar {
            Scalar::Float64 => 0,
            Scalar::Int32 => 1,
            Scalar::Boolean => 2,
            Scalar::String => 3,
            _ => return Err(unknown(call, FmiVersion::V2)),
        };
        let is_get = matches!(call.function, Function::Get(_));
        let table = if is_get {
            &self.table.get
        } else {
            &self.table.set
        };
        let access = table[place].ok_or_else(missing)?;
        let (c, references) = (self.instance.0, call.references);
        // SAFETY: there are as many values as references.
        unsafe {
            match &mut call.values {
                Values::TextsIn(texts) => with_strings(texts, |all| {
                    let values = all.as_ptr().cast_mut().cast();
                    access(c, references.as_ptr(), references.len(), values)
                }),
                Values::TextsOut(texts) => {
                    let mut all = vec![std::ptr::null::<c_char>(); references.len()];
                    let values = all.as_mut_ptr().cast();
                    let status = access(c, references.as_ptr(), references.len(), values);
                    if (0..=1).contains(&status) {
                        copy_strings(&all, texts);
                    }
                    Ok(status)
                }
                values => {
                    let values = pointer(values);
                    Ok(access(c, references.as_ptr(), references.len(), values))
                }
            }
        }
    }
}

impl Endpoint for Fmi2 {
    #[inline]
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        if self.is_dead {
            return Err(Lost("cannot follow a fatal error".to_string()));
        }
        enter(self.kept.as_ref());
        let outcome = self.carry_out(call);
        leave();
        let status = outcome?;
        self.is_dead = status == FATAL;
        Ok(status)
    }

    #[inline]
    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Option<i32> {
        let get =
            self.table.get[0].filter(|_| !self.is_dead && references.len() == values.len())?;
        let (n, values) = (references.len(), values.as_mut_ptr().cast());
        enter(self.kept.as_ref());
        // SAFETY: the instance lives, and there are as many values as references.
        let status = unsafe { get(self.instance.0, references.as_ptr(), n, values) };
        leave();
        self.is_dead = status == FATAL;
        Some(status)
    }

    #[inline]
    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Option<i32> {
        let set =
            self.table.set[0].filter(|_| !self.is_dead && references.len() == values.len())?;
        let (n, values) = (references.len(), values.as_ptr().cast_mut().cast());
        enter(self.kept.as_ref());
        // SAFETY: as for reading; what is set is only read.
        let status = unsafe { set(self.instance.0, references.as_ptr(), n, values) };
        leave();
        self.is_dead = status == FATAL;
        Some(status)
    }

    #[inline]
    fn step(&mut self, time: f64, step: f64) -> Option<Stepped> {
        let do_step = self.table.do_step.filter(|_| !self.is_dead)?;
        enter(self.kept.as_ref());
        // SAFETY: the instance lives.
        let status = unsafe { do_step(self.instance.0, time, step, 0) };
        leave();
        self.is_dead = status == FATAL;
        Some(Stepped {
            status,
            end: false,
            early: false,
            last: time + step,
        })
    }
}

impl Drop for Fmi2 {
    fn drop(&mut self) {
        if self.is_dead {
            // The standard forbids every further call, so all of it stays as it is.
            std::mem::forget(self.kept.take());
            return;
        }
        enter(self.kept.as_ref());
        // SAFETY: the instance lives and is not used afterwards.
        unsafe { (self.table.free_instance)(self.instance.0) }
        leave();
    }
}

/// A folder as FMI 2.0 names it: a `file:` URI with everything encoded that is not allowed in one.
fn uri(folder: &Path) -> String {
    const KEPT: &AsciiSet = &CONTROLS
        .add(b' ')
        .add(b'"')
        .add(b'#')
        .add(b'%')
        .add(b'<')
        .add(b'>')
        .add(b'?')
        .add(b'[')
        .add(b']')
        .add(b'^')
        .add(b'`')
        .add(b'{')
        .add(b'|')
        .add(b'}');
    let path = folder.to_string_lossy().replace('\\', "/");
    let path = utf8_percent_encode(&path, KEPT);
    // Two slashes for the absent host, a third before a drive letter.
    format!("file://{}{path}", if cfg!(windows) { "/" } else { "" })
}
