//! The C interface of FMI 2.0; [`export!`](crate::export) gives the functions their names.
//!
//! # Safety
//! All functions: pointers are as the standard prescribes; lengths belong to their arrays.
#![allow(
    unsafe_code,
    missing_docs,
    reason = "the signatures and their meaning are the standard's"
)]
#![allow(
    clippy::missing_errors_doc,
    clippy::missing_safety_doc,
    clippy::too_many_arguments
)]

use std::ffi::{c_char, c_void};

pub use crate::log::Fmi2Logger;
use crate::{
    component::Component,
    fault::{Fault, Outcome, Status},
    guard::{catch, entry},
    instance::Instance,
    log::Sink,
    model::ValueReference,
    phase::{Kind, Phase},
    pointers::{load, loaded, slice, slice_mut, store, target, texts},
    resources::Location,
    start::{make, text},
};

pub type Handle = *mut c_void;

#[repr(C)]
#[derive(Clone, Copy)]
pub struct Callbacks {
    pub logger: Option<Fmi2Logger>,
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, i32)>,
    pub environment: *mut c_void,
}

#[repr(C)]
pub struct EventInfo {
    pub new_discrete_states_needed: i32,
    pub terminate_simulation: i32,
    pub nominals_of_continuous_states_changed: i32,
    pub values_of_continuous_states_changed: i32,
    pub next_event_time_defined: i32,
    pub next_event_time: f64,
}

pub unsafe fn instantiate<C: Component>(
    name: *const c_char,
    kind: i32,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    logging_on: i32,
) -> Handle {
    unsafe {
        let sink = match callbacks.as_ref() {
            Some(Callbacks {
                logger: Some(logger),
                environment,
                ..
            }) => Sink::Fmi2(*logger, *environment),
            _ => Sink::None,
        };
        let kind = if kind == 0 {
            Kind::ModelExchange
        } else {
            Kind::CoSimulation
        };
        let uri = text(resources).and_then(|uri| uri.to_str().ok());
        let location = uri.map_or(Location::Unknown, Location::Uri);
        make::<C>(
            "fmi2Instantiate",
            name,
            kind,
            guid,
            location,
            sink,
            logging_on != 0,
        )
    }
}

pub unsafe fn free_instance<C: Component>(handle: Handle) {
    if !handle.is_null() {
        let _ = catch(|| drop(unsafe { Box::from_raw(handle.cast::<Instance<C>>()) }));
    }
}

pub unsafe fn set_debug_logging<C: Component>(
    handle: Handle,
    on: i32,
    count: usize,
    categories: *const *const c_char,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2SetDebugLogging", |instance| {
            let categories = texts(categories, count, "categories")?;
            instance
                .log
                .set_debug(on != 0, &categories)
                .map_err(|unknown| Fault::error(unknown.to_string()))
        })
    }
}

pub unsafe fn setup_experiment<C: Component>(
    handle: Handle,
    start_time: f64,
    stop_time_defined: i32,
    stop_time: f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2SetupExperiment", |instance| {
            instance.set_up(start_time, (stop_time_defined != 0).then_some(stop_time))
        })
    }
}

pub unsafe fn enter_initialization_mode<C: Component>(handle: Handle) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2EnterInitializationMode", |instance| {
            if instance.now.phase == Phase::Instantiated && !instance.now.set_up {
                let problem = "wrong order of calls: fmi2SetupExperiment must come before";
                return Err(Fault::error(problem));
            }
            instance.enter_initialization()
        })
    }
}

pub unsafe fn call<C: Component>(
    handle: Handle,
    function: &'static str,
    body: fn(&mut Instance<C>) -> Outcome,
) -> Status {
    unsafe { entry::<C>(handle, function, body) }
}

macro_rules! getters_and_setters {
    ($($get:ident $get_name:literal $set:ident $set_name:literal $type:ty:
        $read:expr, $check:expr, $write:expr;)*) => {$(
        #[inline]
        pub unsafe fn $get<C: Component>(
            handle: Handle,
            references: *const ValueReference,
            count: usize,
            values: *mut $type,
        ) -> Status {
            unsafe {
                entry::<C>(handle, $get_name, |instance| {
                    load(instance, references, count, values, count, $read)
                })
            }
        }

        #[inline]
        pub unsafe fn $set<C: Component>(
            handle: Handle,
            references: *const ValueReference,
            count: usize,
            values: *const $type,
        ) -> Status {
            unsafe {
                entry::<C>(handle, $set_name, |instance| {
                    store(instance, references, count, values, count, $check, $write)
                })
            }
        }
    )*};
}

getters_and_setters! {
    get_real "fmi2GetReal" set_real "fmi2SetReal" f64:
        |i, r| i.get_real(r), |i, r, v| i.check_real(r, *v), |i, r, v| i.set_real(r, *v);
    get_integer "fmi2GetInteger" set_integer "fmi2SetInteger" i32:
        |i, r| i.get_integer(r, true),
        |i, r, v| i.check_integer(r, i64::from(*v)),
        |i, r, v| i.set_integer(r, *v, true);
    get_boolean "fmi2GetBoolean" set_boolean "fmi2SetBoolean" i32:
        |i, r| i.get_boolean(r).map(i32::from),
        |i, r, _| i.check_boolean(r),
        |i, r, v| i.set_boolean(r, *v != 0);
    get_string "fmi2GetString" set_string "fmi2SetString" *const c_char:
        |i, r| i.get_text(r),
        |i, r, v| i.check_text(r, loaded(*v)?),
        |i, r, v| i.set_text(r, loaded(*v)?);
}

#[inline]
pub unsafe fn do_step<C: Component>(handle: Handle, time: f64, step_size: f64) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2DoStep", |instance| {
            instance.do_step(time, step_size)
        })
    }
}

pub unsafe fn get_real_status<C: Component>(handle: Handle, kind: i32, value: *mut f64) -> Status {
    const LAST_SUCCESSFUL_TIME: i32 = 2;
    unsafe {
        entry::<C>(handle, "fmi2GetRealStatus", |instance| {
            if kind != LAST_SUCCESSFUL_TIME {
                return Err(Fault::discard(format!(
                    "status kind {kind} has no real value"
                )));
            }
            *target(value, "value")? = instance.now.time;
            Ok(())
        })
    }
}

pub unsafe fn get_boolean_status<C: Component>(
    handle: Handle,
    kind: i32,
    value: *mut i32,
) -> Status {
    const TERMINATED: i32 = 3;
    unsafe {
        entry::<C>(handle, "fmi2GetBooleanStatus", |_| {
            if kind != TERMINATED {
                return Err(Fault::discard(format!(
                    "status kind {kind} has no Boolean value"
                )));
            }
            *target(value, "value")? = 0;
            Ok(())
        })
    }
}

pub unsafe fn no_status<C: Component>(handle: Handle, function: &'static str) -> Status {
    unsafe {
        entry::<C>(handle, function, |_| {
            Err(Fault::discard("steps are never left pending"))
        })
    }
}

pub unsafe fn directional_derivative<C: Component>(
    handle: Handle,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seed: *const f64,
    sensitivity: *mut f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2GetDirectionalDerivative", |instance| {
            instance.directional_derivative(
                slice(unknowns, unknown_count, "vUnknown_ref")?,
                slice(knowns, known_count, "vKnown_ref")?,
                slice(seed, known_count, "dvKnown")?,
                slice_mut(sensitivity, unknown_count, "dvUnknown")?,
            )
        })
    }
}

pub unsafe fn new_discrete_states<C: Component>(handle: Handle, info: *mut EventInfo) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2NewDiscreteStates", |instance| {
            let info = target(info, "eventInfo")?;
            let event = instance.update_discrete_states()?;
            *info = EventInfo {
                new_discrete_states_needed: 0,
                terminate_simulation: 0,
                nominals_of_continuous_states_changed: 0,
                values_of_continuous_states_changed: event.states_changed.into(),
                next_event_time_defined: event.next_event_time.is_some().into(),
                next_event_time: event.next_event_time.unwrap_or(0.0),
            };
            Ok(())
        })
    }
}

pub unsafe fn completed_integrator_step<C: Component>(
    handle: Handle,
    enter_event_mode: *mut i32,
    terminate_simulation: *mut i32,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi2CompletedIntegratorStep", |instance| {
            instance.completed_integrator_step()?;
            *target(enter_event_mode, "enterEventMode")? = 0;
            *target(terminate_simulation, "terminateSimulation")? = 0;
            Ok(())
        })
    }
}

/// Calls without arguments, for [`call`].
pub fn exit_initialization<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.exit_initialization()
}

pub fn terminate<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.terminate()
}

pub fn reset<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.reset();
    Ok(())
}

pub fn enter_event_mode<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.enter_event_mode()
}

pub fn enter_continuous_time_mode<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.enter_continuous_time_mode()
}
