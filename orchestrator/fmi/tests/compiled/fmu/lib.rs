//! A minimal FMU: FMI 2.0 and 3.0, co-simulation and model exchange, in one library.
//!
//! `y = gain * u`. `x' = -x` from 1; where `x` falls to `floor` an event sets it to 1 again, so that
//! `x = exp(-(t mod ln(1 / floor)))`. Every `period` s a time event counts. Each function checks that it is
//! called in a mode in which the standard allows it, and `answer` is the status of the next steps.

#![allow(non_snake_case, reason = "functions are named by the standard")]
#![allow(clippy::missing_safety_doc, reason = "the standard is their contract")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use model::*;

type References = *const u32;
type Texts = *const *const c_char;

unsafe fn own<'a>(c: *mut c_void) -> &'a mut Instance {
    unsafe { &mut *c.cast() }
}

unsafe fn list<'a, T>(first: *const T, count: usize) -> &'a [T] {
    if count == 0 {
        &[]
    } else {
        unsafe { std::slice::from_raw_parts(first, count) }
    }
}

unsafe fn places<'a, T>(first: *mut T, count: usize) -> &'a mut [T] {
    if count == 0 {
        &mut []
    } else {
        unsafe { std::slice::from_raw_parts_mut(first, count) }
    }
}

unsafe fn text(text: *const c_char) -> String {
    unsafe { CStr::from_ptr(text) }
        .to_string_lossy()
        .into_owned()
}

/// Functions that the versions have alike but for their names.
macro_rules! shared {
    ($($name:expr => $function:ident($c:ident $(, $argument:ident: $kind:ty)*) $body:block)*) => {
        $(#[unsafe(export_name = $name)]
        unsafe extern "C" fn $function($c: *mut c_void $(, $argument: $kind)*) -> c_int {
            let $c = unsafe { own($c) };
            $body
        })*
    };
}

mod model;
mod states;
mod values;

/// What an FMU with this token answers at its beginning: `minimal`, or `minimal 3` for the status 3.
fn answer(token: &str) -> Option<c_int> {
    match token.strip_prefix("minimal")? {
        "" => Some(OK),
        rest => rest.trim().parse().ok(),
    }
}

/// Whether an FMU of this name is made: those that are called `refused` are not.
fn is_welcome(name: &str, token: &str, log: &dyn Fn(c_int, &str)) -> bool {
    if name == "refused" {
        log(ERROR, "no instance has this name");
    }
    name != "refused" && answer(token).is_some()
}

macro_rules! both {
    ($($name:ident($c:ident $(, $argument:ident: $kind:ty)*) $body:block)*) => {
        mod two {
            use super::*;
            shared! { $(concat!("fmi2", stringify!($name)) => $name($c $(, $argument: $kind)*) $body)* }
        }
        mod three {
            use super::*;
            shared! { $(concat!("fmi3", stringify!($name)) => $name($c $(, $argument: $kind)*) $body)* }
        }
    };
}

both! {
    Terminate(c) { c.goes("Terminate", &[Stepping, Continuous, Event], Terminated) }
    Reset(c) { c.goes("Reset", &[Stepping, Continuous, Event, Terminated], Instantiated) }
    ExitInitializationMode(c) { c.leave_initialization() }
    EnterEventMode(c) { c.goes("EnterEventMode", &[Stepping, Continuous], Event) }
    EnterContinuousTimeMode(c) { c.goes("EnterContinuousTimeMode", &[Event], Continuous) }
    SetTime(c, time: f64) {
        c.now.time = time;
        OK
    }
    SetContinuousStates(c, values: *const f64, count: usize) {
        let [x] = (unsafe { list(values, count) }) else { return ERROR };
        c.now.x = *x;
        if c.mode == Continuous { OK } else { ERROR }
    }
    GetContinuousStates(c, values: *mut f64, count: usize) {
        c.get_reals(&[X], unsafe { places(values, count) })
    }
    GetEventIndicators(c, values: *mut f64, count: usize) {
        let [z] = (unsafe { places(values, count) }) else { return ERROR };
        *z = c.now.x - c.now.floor;
        OK
    }
    GetNominalsOfContinuousStates(_c, values: *mut f64, count: usize) {
        unsafe { places(values, count) }.fill(1.0);
        OK
    }
}

mod derivatives {
    use super::*;
    shared! {
        "fmi2GetDerivatives" => two(c, values: *mut f64, count: usize) {
            c.get_reals(&[SLOPE], unsafe { places(values, count) })
        }
        "fmi3GetContinuousStateDerivatives" => three(c, values: *mut f64, count: usize) {
            c.get_reals(&[SLOPE], unsafe { places(values, count) })
        }
    }
}

/// `fmi2CallbackFunctions` as far as it is used.
#[repr(C)]
struct Callbacks {
    logger:
        unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    finished: *const c_void,
    environment: *mut c_void,
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    token: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    logs: c_int,
) -> *mut Instance {
    let (logger, environment) = unsafe { ((*callbacks).logger, (*callbacks).environment) };
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let caller = CString::new(name.clone()).unwrap_or_default();
    let log = move |status: c_int, said: &str| {
        if logs == 1 {
            let said = CString::new(said).unwrap_or_default();
            unsafe {
                logger(
                    environment,
                    caller.as_ptr(),
                    status,
                    c"calls".as_ptr(),
                    c"%s".as_ptr(),
                    said.as_ptr(),
                )
            }
        }
    };
    log(OK, &format!("{name} with {resources}"));
    if !is_welcome(&name, &token, &log) {
        return std::ptr::null_mut();
    }
    let running = if kind == 0 { Continuous } else { Stepping };
    Instance::new(answer(&token), false, running, Box::new(log))
}

type LogMessage = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

unsafe fn instantiate3(
    (name, token, resources): (*const c_char, *const c_char, *const c_char),
    logs: bool,
    (environment, logger): (*mut c_void, LogMessage),
    handles_events: bool,
    running: Mode,
) -> *mut Instance {
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let log = move |status: c_int, said: &str| {
        if logs {
            let said = CString::new(said).unwrap_or_default();
            unsafe { logger(environment, status, c"calls".as_ptr(), said.as_ptr()) }
        }
    };
    log(OK, &format!("{name} with {resources}"));
    if !is_welcome(&name, &token, &log) || (name == "stepped" && handles_events) {
        return std::ptr::null_mut();
    }
    Instance::new(answer(&token), handles_events, running, Box::new(log))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    logs: bool,
    handles_events: bool,
    _early: bool,
    _needed: *const u32,
    _count: usize,
    environment: *mut c_void,
    logger: LogMessage,
    _update: *const c_void,
) -> *mut Instance {
    unsafe {
        instantiate3(
            (name, token, resources),
            logs,
            (environment, logger),
            handles_events,
            Stepping,
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateModelExchange(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    logs: bool,
    environment: *mut c_void,
    logger: LogMessage,
) -> *mut Instance {
    unsafe {
        instantiate3(
            (name, token, resources),
            logs,
            (environment, logger),
            false,
            Continuous,
        )
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(instance: *mut Instance) {
    let instance = unsafe { Box::from_raw(instance) };
    (instance.log)(OK, "FreeInstance");
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: *mut Instance) {
    unsafe { fmi2FreeInstance(instance) }
}

/// `fmi2EventInfo`.
#[repr(C)]
struct EventInfo {
    again: c_int,
    over: c_int,
    nominals: c_int,
    states: c_int,
    is_timed: c_int,
    next: f64,
}

fn given<T>(is_given: bool, value: T) -> Option<T> {
    is_given.then_some(value)
}

shared! {
    "fmi2SetDebugLogging" => log2(c, _on: c_int, count: usize, categories: Texts) {
        unsafe { log3(std::ptr::from_mut(c).cast(), true, count, categories) }
    }
    "fmi3SetDebugLogging" => log3(_c, _on: bool, count: usize, categories: Texts) {
        let known = |category: &*const c_char| unsafe { text(*category) } == "calls";
        if unsafe { list(categories, count) }.iter().all(known) { OK } else { ERROR }
    }
    "fmi2SetupExperiment" => setup(
        c, is_tolerant: c_int, tolerance: f64, start: f64, has_stop: c_int, stop: f64
    ) {
        c.initialize(start, given(has_stop == 1, stop), given(is_tolerant == 1, tolerance));
        c.goes("SetupExperiment", &[Instantiated], Instantiated)
    }
    "fmi2EnterInitializationMode" => begin2(c) {
        c.goes("EnterInitializationMode", &[Instantiated], Initializing)
    }
    "fmi3EnterInitializationMode" => begin3(
        c, is_tolerant: bool, tolerance: f64, start: f64, has_stop: bool, stop: f64
    ) {
        c.initialize(start, given(has_stop, stop), given(is_tolerant, tolerance));
        c.goes("EnterInitializationMode", &[Instantiated], Initializing)
    }
    "fmi3EnterConfigurationMode" => configure(c) {
        c.goes("EnterConfigurationMode", &[Instantiated], Configuring)
    }
    "fmi3ExitConfigurationMode" => configured(c) {
        c.goes("ExitConfigurationMode", &[Configuring], Instantiated)
    }
    "fmi3EnterStepMode" => enter_step_mode(c) { c.goes("EnterStepMode", &[Event], Stepping) }
    "fmi2DoStep" => step2(c, time: f64, step: f64, _keeps: c_int) { c.step(time, step).0 }
    "fmi3DoStep" => step3(
        c, time: f64, step: f64, _keeps: bool, event: *mut bool, over: *mut bool, early: *mut bool,
        last: *mut f64
    ) {
        let (status, reached, is_event) = c.step(time, step);
        unsafe { (*event, *over, *early, *last) = (is_event, c.is_over, is_event || c.is_early, reached) };
        status
    }
    "fmi2GetBooleanStatus" => over2(c, kind: c_int, value: *mut c_int) {
        unsafe { *value = c_int::from(c.is_over) };
        // 3: terminated.
        if kind == 3 { OK } else { ERROR }
    }
    "fmi2GetRealStatus" => last2(c, kind: c_int, value: *mut f64) {
        unsafe { *value = c.discarded_at };
        // 2: the last successful time.
        if kind == 2 { OK } else { ERROR }
    }
    "fmi2NewDiscreteStates" => update2(c, info: *mut EventInfo) {
        if c.mode != Event { return ERROR }
        c.update();
        let is_timed = c_int::from(c.now.next.is_finite());
        let (over, states) = (c_int::from(c.is_over), c_int::from(c.is_reset));
        unsafe { *info = EventInfo { again: 0, over, nominals: 0, states, is_timed, next: c.now.next } };
        OK
    }
    "fmi3UpdateDiscreteStates" => update3(
        c, again: *mut bool, over: *mut bool, nominals: *mut bool, states: *mut bool, is_timed: *mut bool,
        next: *mut f64
    ) {
        if c.mode != Event { return ERROR }
        c.update();
        unsafe {
            (*again, *over, *nominals, *states) = (false, c.is_over, false, c.is_reset);
            (*is_timed, *next) = (c.now.next.is_finite(), c.now.next);
        }
        OK
    }
    "fmi2CompletedIntegratorStep" => completed2(c, _keeps: c_int, event: *mut c_int, over: *mut c_int) {
        unsafe { (*event, *over) = (c_int::from(c.is_early), c_int::from(c.is_over)) };
        if c.mode == Continuous { OK } else { ERROR }
    }
    "fmi3CompletedIntegratorStep" => completed3(c, _keeps: bool, event: *mut bool, over: *mut bool) {
        unsafe { (*event, *over) = (c.is_early, c.is_over) };
        if c.mode == Continuous { OK } else { ERROR }
    }
    "fmi3GetNumberOfContinuousStates" => states(_c, count: *mut usize) {
        unsafe { *count = 1 };
        OK
    }
    "fmi3GetNumberOfEventIndicators" => indicators(_c, count: *mut usize) {
        unsafe { *count = 1 };
        OK
    }
    "fmi3SetClock" => set_clock(c, references: References, n: usize, values: *const bool) {
        c.is_ticked = unsafe { list(values, n) }.contains(&true);
        let is_input = unsafe { list(references, n) } == [130];
        if is_input && c.mode == Event { OK } else { ERROR }
    }
    "fmi3GetClock" => get_clock(c, references: References, n: usize, values: *mut bool) {
        // It ticks in the event in which `x` is set to 1.
        unsafe { places(values, n) }.fill(c.now.x <= c.now.floor);
        if unsafe { list(references, n) } == [131] { OK } else { ERROR }
    }
    "fmi3GetIntervalDecimal" => interval(
        _c, references: References, n: usize, values: *mut f64, qualifiers: *mut c_int
    ) {
        unsafe { places(values, n) }.fill(0.25);
        // 1: unchanged.
        unsafe { places(qualifiers, n) }.fill(1);
        if unsafe { list(references, n) } == [130] { OK } else { ERROR }
    }
}
