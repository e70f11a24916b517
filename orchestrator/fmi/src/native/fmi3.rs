//! FMI 3.0.

use std::ffi::{c_char, c_int, c_void};
use std::sync::Arc;

use super::super::FmiVersion;
use super::super::call::{Call, Endpoint, Function, Lost, Scalar, Stepped, Values};
use super::super::error::InstanceError;
use super::callbacks::{Environment, intermediate_update, log_message};
use super::library::Functions;
use super::state::StateFunctions;
use super::{
    DISCARD, FATAL, Handle, Kept, Mode, Setup, Sink, copy_strings, derivative, enter, leave,
    missing, pointer, text_for_c, unknown, with_strings,
};

type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);
type IntermediateUpdate = unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64);
type InstantiateCoSimulation = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const u32,
    usize,
    *mut c_void,
    LogMessage,
    IntermediateUpdate,
) -> *mut c_void;
type InstantiateModelExchange = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    *mut c_void,
    LogMessage,
) -> *mut c_void;
type Simple = unsafe extern "C" fn(*mut c_void) -> c_int;
type EnterInitialization = unsafe extern "C" fn(*mut c_void, bool, f64, f64, bool, f64) -> c_int;
type Access = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut c_void, usize) -> c_int;
type Binary = unsafe extern "C" fn(
    *mut c_void,
    *const u32,
    usize,
    *mut usize,
    *mut *const u8,
    usize,
) -> c_int;
type Clock = unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut c_void) -> c_int;
// Truth values that an FMU writes are bytes here: any bits may come.
type DoStep =
    unsafe extern "C" fn(*mut c_void, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;
type Logging = unsafe extern "C" fn(*mut c_void, bool, usize, *const *const c_char) -> c_int;
type SetTime = unsafe extern "C" fn(*mut c_void, f64) -> c_int;
type Reals = unsafe extern "C" fn(*mut c_void, *mut c_void, usize) -> c_int;
type Discrete = unsafe extern "C" fn(
    *mut c_void,
    *mut u8,
    *mut u8,
    *mut u8,
    *mut u8,
    *mut u8,
    *mut f64,
) -> c_int;
type Completed = unsafe extern "C" fn(*mut c_void, bool, *mut u8, *mut u8) -> c_int;
type Number = unsafe extern "C" fn(*mut c_void, *mut usize) -> c_int;
type Derivative = unsafe extern "C" fn(
    *mut c_void,
    *const u32,
    usize,
    *const u32,
    usize,
    *const f64,
    usize,
    *mut f64,
    usize,
) -> c_int;
type Interval =
    unsafe extern "C" fn(*mut c_void, *const u32, usize, *mut c_void, *mut c_int) -> c_int;

/// The functions; those that few FMUs have or need may be missing.
struct Table {
    enter_initialization: EnterInitialization,
    exit_initialization: Simple,
    free_instance: unsafe extern "C" fn(*mut c_void),
    do_step: Option<DoStep>,
    terminate: Option<Simple>,
    reset: Option<Simple>,
    get: [Option<Access>; 14],
    set: [Option<Access>; 14],
    get_binary: Option<Binary>,
    set_binary: Option<Binary>,
    get_clock: Option<Clock>,
    set_clock: Option<Clock>,
    interval: Option<Interval>,
    shift: Option<Clock>,
    state: StateFunctions,
    logging: Option<Logging>,
    enter_configuration_mode: Option<Simple>,
    exit_configuration_mode: Option<Simple>,
    enter_event_mode: Option<Simple>,
    enter_step_mode: Option<Simple>,
    enter_continuous_time_mode: Option<Simple>,
    update_discrete_states: Option<Discrete>,
    completed: Option<Completed>,
    set_time: Option<SetTime>,
    set_states: Option<Reals>,
    get_states: Option<Reals>,
    derivatives: Option<Reals>,
    indicators: Option<Reals>,
    nominals: Option<Reals>,
    number_of_states: Option<Number>,
    number_of_indicators: Option<Number>,
    directional: Option<Derivative>,
    adjoint: Option<Derivative>,
}

/// An instance of an FMI 3.0 FMU.
pub(super) struct Fmi3 {
    table: Table,
    instance: Handle,
    kept: Option<Kept>,
    is_dead: bool,
}

impl Fmi3 {
    pub(super) fn new(setup: &Setup, sink: Arc<dyn Sink>) -> Result<Self, InstanceError> {
        let mut f = Functions::load(&setup.library, "fmi3")?;
        // SAFETY: the types are those of the standard's headers.
        let table = unsafe {
            let do_step = match setup.mode {
                Mode::CoSimulation { .. } => f.needed("DoStep"),
                Mode::ModelExchange { .. } => None,
            };
            let needed = (
                f.needed("EnterInitializationMode"),
                f.needed("ExitInitializationMode"),
                f.needed("FreeInstance"),
            );
            let (Some(enter), Some(exit), Some(free)) = needed else {
                f.finish()?;
                return Err(InstanceError::Lacking(Vec::new()));
            };
            Table {
                enter_initialization: enter,
                exit_initialization: exit,
                free_instance: free,
                do_step,
                terminate: f.optional("Terminate"),
                reset: f.optional("Reset"),
                get: Scalar::ALL.map(|scalar| f.optional(&format!("Get{}", scalar.name()))),
                set: Scalar::ALL.map(|scalar| f.optional(&format!("Set{}", scalar.name()))),
                get_binary: f.optional("GetBinary"),
                set_binary: f.optional("SetBinary"),
                get_clock: f.optional("GetClock"),
                set_clock: f.optional("SetClock"),
                interval: f.optional("GetIntervalDecimal"),
                shift: f.optional("GetShiftDecimal"),
                state: StateFunctions::of(&f, FmiVersion::V3),
                logging: f.optional("SetDebugLogging"),
                enter_configuration_mode: f.optional("EnterConfigurationMode"),
                exit_configuration_mode: f.optional("ExitConfigurationMode"),
                enter_event_mode: f.optional("EnterEventMode"),
                enter_step_mode: f.optional("EnterStepMode"),
                enter_continuous_time_mode: f.optional("EnterContinuousTimeMode"),
                update_discrete_states: f.optional("UpdateDiscreteStates"),
                completed: f.optional("CompletedIntegratorStep"),
                set_time: f.optional("SetTime"),
                set_states: f.optional("SetContinuousStates"),
                get_states: f.optional("GetContinuousStates"),
                derivatives: f.optional("GetContinuousStateDerivatives"),
                indicators: f.optional("GetEventIndicators"),
                nominals: f.optional("GetNominalsOfContinuousStates"),
                number_of_states: f.optional("GetNumberOfContinuousStates"),
                number_of_indicators: f.optional("GetNumberOfEventIndicators"),
                directional: f.optional("GetDirectionalDerivative"),
                adjoint: f.optional("GetAdjointDerivative"),
            }
        };
        let environment = Environment::new(sink);
        let (name, token) = (text_for_c(&setup.name)?, text_for_c(&setup.token)?);
        // A path with the separator at its end.
        let resources = setup.resources.join("");
        let resources = text_for_c(&resources.to_string_lossy())?;
        let (log, to) = (log_message as LogMessage, environment.pointer());
        let (name, token, resources) = (name.as_ptr(), token.as_ptr(), resources.as_ptr());
        // SAFETY: all pointers live; the environment does until the instance is freed.
        let (instance, library) = unsafe {
            match setup.mode {
                Mode::CoSimulation { ref events, .. } => {
                    let make = f.needed::<InstantiateCoSimulation>("InstantiateCoSimulation");
                    let library = f.finish()?;
                    let make = make.ok_or(InstanceError::Lacking(Vec::new()))?;
                    // Nothing is asked for between communication points, so that no variables are
                    // required there. A step may be returned from early where events are handled
                    // outside and the rest of the step may be shorter.
                    let (none, callback) = (std::ptr::null(), intermediate_update);
                    let on = setup.logging;
                    let event_mode = events.is_some();
                    let early = events.as_ref().is_some_and(|events| events.variable_step);
                    let instance = make(
                        name, token, resources, false, on, event_mode, early, none, 0, to, log,
                        callback,
                    );
                    (instance, library)
                }
                Mode::ModelExchange { .. } => {
                    let make = f.needed::<InstantiateModelExchange>("InstantiateModelExchange");
                    let library = f.finish()?;
                    let make = make.ok_or(InstanceError::Lacking(Vec::new()))?;
                    (
                        make(name, token, resources, false, setup.logging, to, log),
                        library,
                    )
                }
            }
        };
        if instance.is_null() {
            return Err(InstanceError::Refused);
        }
        Ok(Self {
            table,
            instance: Handle(instance),
            kept: Some(Kept {
                _callbacks: None,
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
        let truth = |flags: [u8; 5]| flags.map(|flag| flag != 0);
        // SAFETY: the instance lives, and arrays are as long as they are said to be.
        unsafe {
            match call.function {
                Function::Get(scalar) | Function::Set(scalar) => self.access(call, scalar),
                Function::DoStep => {
                    let (time, step) = (call.numbers[0], call.numbers[1]);
                    let (mut event, mut terminate, mut early) = (0, 0, 0);
                    let mut last = time + step;
                    let status = table.do_step.ok_or_else(missing)?(
                        c,
                        time,
                        step,
                        call.flags[0],
                        &raw mut event,
                        &raw mut terminate,
                        &raw mut early,
                        &raw mut last,
                    );
                    call.flags = truth([event, terminate, early, 0, 0]);
                    call.numbers[0] = last;
                    Ok(status)
                }
                Function::EnterInitializationMode => {
                    let [start, stop, tolerance] = call.numbers;
                    let [stop_defined, tolerance_defined, ..] = call.flags;
                    let enter = table.enter_initialization;
                    Ok(enter(
                        c,
                        tolerance_defined,
                        tolerance,
                        start,
                        stop_defined,
                        stop,
                    ))
                }
                Function::ExitInitializationMode => Ok((table.exit_initialization)(c)),
                Function::EnterConfigurationMode => simple(table.enter_configuration_mode),
                Function::ExitConfigurationMode => simple(table.exit_configuration_mode),
                Function::EnterEventMode => simple(table.enter_event_mode),
                Function::EnterStepMode => simple(table.enter_step_mode),
                Function::EnterContinuousTimeMode => simple(table.enter_continuous_time_mode),
                Function::Terminate => simple(table.terminate),
                Function::Reset => simple(table.reset),
                Function::UpdateDiscreteStates => {
                    let update = table.update_discrete_states.ok_or_else(missing)?;
                    let mut flags = [0u8; 5];
                    let [again, terminate, nominals, states, defined] = &mut flags;
                    let status = update(
                        c,
                        again,
                        terminate,
                        nominals,
                        states,
                        defined,
                        &raw mut call.numbers[0],
                    );
                    call.flags = truth(flags);
                    Ok(status)
                }
                Function::CompletedIntegratorStep => {
                    let (mut event, mut terminate) = (0, 0);
                    let completed = table.completed.ok_or_else(missing)?;
                    let status = completed(c, call.flags[0], &raw mut event, &raw mut terminate);
                    call.flags = truth([event, terminate, 0, 0, 0]);
                    Ok(status)
                }
                Function::SetDebugLogging => {
                    let logging = table.logging.ok_or_else(missing)?;
                    let on = call.flags[0];
                    let none = Vec::new();
                    let categories = match &call.values {
                        Values::TextsIn(texts) => texts,
                        _ => &none,
                    };
                    with_strings(categories, |all| logging(c, on, all.len(), all.as_ptr()))
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
                Function::GetNumberOfContinuousStates | Function::GetNumberOfEventIndicators => {
                    let function = match call.function {
                        Function::GetNumberOfContinuousStates => table.number_of_states,
                        _ => table.number_of_indicators,
                    };
                    let mut number = 0;
                    let status = function.ok_or_else(missing)?(c, &raw mut number);
                    call.handle = number as u64;
                    Ok(status)
                }
                Function::GetIntervalDecimal => {
                    let interval = table.interval.ok_or_else(missing)?;
                    let mut qualifiers = vec![0; call.references.len()];
                    let values = pointer(&mut call.values);
                    let (references, n) = (call.references.as_ptr(), call.references.len());
                    let status = interval(c, references, n, values, qualifiers.as_mut_ptr());
                    call.handle = qualifiers.first().map_or(0, |&q| q as u64);
                    Ok(status)
                }
                Function::GetShiftDecimal => {
                    let shift = table.shift.ok_or_else(missing)?;
                    let values = pointer(&mut call.values);
                    Ok(shift(
                        c,
                        call.references.as_ptr(),
                        call.references.len(),
                        values,
                    ))
                }
                Function::GetDirectionalDerivative | Function::GetAdjointDerivative => {
                    let (unknowns, knowns) = call.references.split_at(call.unknowns());
                    let function = match call.function {
                        Function::GetDirectionalDerivative => table.directional,
                        _ => table.adjoint,
                    };
                    let given = call.count;
                    let sought = call.values.numbers().saturating_sub(given);
                    let (Some(function), Some((seed, sensitivity))) =
                        (function, derivative(call, given, sought))
                    else {
                        return Ok(DISCARD);
                    };
                    Ok(function(
                        c,
                        unknowns.as_ptr(),
                        unknowns.len(),
                        knowns.as_ptr(),
                        knowns.len(),
                        seed,
                        given,
                        sensitivity,
                        sought,
                    ))
                }
                _ => match table.state.carry_out(call, &self.instance) {
                    Some(outcome) => outcome,
                    None => Err(unknown(call, FmiVersion::V3)),
                },
            }
        }
    }

    #[inline]
    fn access(&self, call: &mut Call, scalar: Scalar) -> Result<i32, Lost> {
        let is_get = matches!(call.function, Function::Get(_));
        let (c, references, n) = (
            self.instance.0,
            call.references.as_ptr(),
            call.references.len(),
        );
        let table = &self.table;
        // SAFETY: there are as many values as `count` says.
        unsafe {
            match scalar {
                Scalar::Binary => return self.binary(call, is_get),
                Scalar::Clock => {
                    let access = if is_get {
                        table.get_clock
                    } else {
                        table.set_clock
                    };
                    let access = access.ok_or_else(missing)?;
                    return Ok(access(c, references, n, pointer(&mut call.values)));
                }
                _ => {}
            }
            let access = if is_get { &table.get } else { &table.set };
            let access = access[scalar as usize].ok_or_else(missing)?;
            match &mut call.values {
                Values::TextsIn(texts) => with_strings(texts, |all| {
                    let values = all.as_ptr().cast_mut().cast();
                    access(c, references, n, values, all.len())
                }),
                Values::TextsOut(texts) => {
                    let mut all = vec![std::ptr::null::<c_char>(); call.count];
                    let status = access(c, references, n, all.as_mut_ptr().cast(), all.len());
                    if (0..=1).contains(&status) {
                        copy_strings(&all, texts);
                    }
                    Ok(status)
                }
                values => Ok(access(c, references, n, pointer(values), call.count)),
            }
        }
    }

    fn binary(&self, call: &mut Call, is_get: bool) -> Result<i32, Lost> {
        let table = &self.table;
        let access = if is_get {
            table.get_binary
        } else {
            table.set_binary
        };
        let access = access.ok_or_else(missing)?;
        let (c, references, n) = (
            self.instance.0,
            call.references.as_ptr(),
            call.references.len(),
        );
        match &mut call.values {
            Values::TextsIn(all) => {
                let mut sizes: Vec<usize> = all.iter().map(Vec::len).collect();
                let mut values: Vec<*const u8> = all.iter().map(|bytes| bytes.as_ptr()).collect();
                // SAFETY: as many sizes and values as `count` says.
                Ok(unsafe {
                    access(
                        c,
                        references,
                        n,
                        sizes.as_mut_ptr(),
                        values.as_mut_ptr(),
                        all.len(),
                    )
                })
            }
            Values::TextsOut(all) => {
                let mut sizes = vec![0; call.count];
                let mut values = vec![std::ptr::null(); call.count];
                // SAFETY: as above; what comes back belongs to the FMU until the next call.
                let status = unsafe {
                    let (sizes, values) = (sizes.as_mut_ptr(), values.as_mut_ptr());
                    access(c, references, n, sizes, values, call.count)
                };
                if (0..=1).contains(&status) {
                    all.clear();
                    all.extend(sizes.iter().zip(&values).map(|(&size, &value)| {
                        if value.is_null() {
                            return Vec::new();
                        }
                        // SAFETY: as large as the FMU says.
                        unsafe { std::slice::from_raw_parts(value, size) }.to_vec()
                    }));
                }
                Ok(status)
            }
            _ => Err(missing()),
        }
    }
}

impl Endpoint for Fmi3 {
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
        let get = self.table.get[Scalar::Float64 as usize].filter(|_| !self.is_dead)?;
        let (n, m, values) = (references.len(), values.len(), values.as_mut_ptr().cast());
        enter(self.kept.as_ref());
        // SAFETY: the instance lives, and there are as many references and values as is said.
        let status = unsafe { get(self.instance.0, references.as_ptr(), n, values, m) };
        leave();
        self.is_dead = status == FATAL;
        Some(status)
    }

    #[inline]
    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Option<i32> {
        let set = self.table.set[Scalar::Float64 as usize].filter(|_| !self.is_dead)?;
        let (n, m) = (references.len(), values.len());
        let values = values.as_ptr().cast_mut().cast();
        enter(self.kept.as_ref());
        // SAFETY: as for reading; what is set is only read.
        let status = unsafe { set(self.instance.0, references.as_ptr(), n, values, m) };
        leave();
        self.is_dead = status == FATAL;
        Some(status)
    }

    #[inline]
    fn step(&mut self, time: f64, step: f64) -> Option<Stepped> {
        let do_step = self.table.do_step.filter(|_| !self.is_dead)?;
        let (mut event, mut end, mut early, mut last) = (0, 0, 0, time + step);
        enter(self.kept.as_ref());
        // SAFETY: the instance lives, and so do the places for what is given.
        let status = unsafe {
            let (event, end) = (&raw mut event, &raw mut end);
            do_step(
                self.instance.0,
                time,
                step,
                false,
                event,
                end,
                &raw mut early,
                &raw mut last,
            )
        };
        leave();
        self.is_dead = status == FATAL;
        Some(Stepped {
            status,
            end: end != 0,
            early: early != 0,
            last,
        })
    }
}

impl Drop for Fmi3 {
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
