//! The C interface of FMI 3.0; [`export!`](crate::export) gives the functions their names.
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

mod derivatives;

use std::ffi::{c_char, c_void};

pub use derivatives::{
    adjoint_derivative, dependencies, directional_derivative, list_dependencies,
};

pub use crate::log::Fmi3Logger;
use crate::{
    component::Component,
    fault::{Fault, Outcome, Status},
    guard::entry,
    instance::Instance,
    log::Sink,
    model::ValueReference,
    phase::{Kind, Phase},
    pointers::{load, loaded, store, target, texts},
    resources::Location,
    start::{make, text},
};

pub use crate::fmi2::{
    Handle, call, enter_continuous_time_mode, exit_initialization, free_instance, reset, terminate,
};

/// The value reference of the time.
const TIME: ValueReference = 0;

pub unsafe fn instantiate<C: Component>(
    kind: Kind,
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    logging_on: bool,
    event_mode_used: bool,
    environment: *mut c_void,
    logger: Option<Fmi3Logger>,
) -> Handle {
    let function = match kind {
        Kind::CoSimulation => "fmi3InstantiateCoSimulation",
        Kind::ModelExchange => "fmi3InstantiateModelExchange",
    };
    let sink = logger.map_or(Sink::None, |logger| Sink::Fmi3(logger, environment));
    unsafe {
        let path = text(resources).and_then(|path| path.to_str().ok());
        let location = path.map_or(Location::Unknown, Location::Path);
        let handle = make::<C>(function, name, kind, token, location, sink, logging_on);
        if event_mode_used && kind == Kind::CoSimulation {
            entry::<C>(handle, function, |instance| {
                instance.event_mode_used = true;
                Err(Fault::warning(
                    "event mode was asked for, but is not offered: no event occurs",
                ))
            });
        }
        handle
    }
}

pub unsafe fn refuse_scheduled_execution<C: Component>(
    name: *const c_char,
    environment: *mut c_void,
    logger: Option<Fmi3Logger>,
) -> Handle {
    if let Some(logger) = logger {
        let name = unsafe { text(name) }.unwrap_or_default();
        let log = crate::log::Log::new(Sink::Fmi3(logger, environment), name, false);
        let problem = "fmi3InstantiateScheduledExecution: scheduled execution is not offered";
        log.fault(Status::Error, &format!("{} {problem}", C::NAME));
    }
    std::ptr::null_mut()
}

pub unsafe fn set_debug_logging<C: Component>(
    handle: Handle,
    on: bool,
    count: usize,
    categories: *const *const c_char,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3SetDebugLogging", |instance| {
            let categories = texts(categories, count, "categories")?;
            instance
                .log
                .set_debug(on, &categories)
                .map_err(|unknown| Fault::error(unknown.to_string()))
        })
    }
}

pub unsafe fn enter_initialization_mode<C: Component>(
    handle: Handle,
    start_time: f64,
    stop_time_defined: bool,
    stop_time: f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3EnterInitializationMode", |instance| {
            instance.set_up(start_time, stop_time_defined.then_some(stop_time))?;
            instance.enter_initialization()
        })
    }
}

/// Event mode in co-simulation is not offered; an importer that uses it regardless finds that
/// nothing happens there.
pub fn enter_event_mode<C: Component>(instance: &mut Instance<C>) -> Outcome {
    if instance.event_mode_used {
        instance.require(&[Phase::Step])
    } else {
        instance.enter_event_mode()
    }
}

pub fn enter_step_mode<C: Component>(instance: &mut Instance<C>) -> Outcome {
    instance.require(&[Phase::Step])
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
            value_count: usize,
        ) -> Status {
            unsafe {
                entry::<C>(handle, $get_name, |instance| {
                    load(instance, references, count, values, value_count, $read)
                })
            }
        }

        #[inline]
        pub unsafe fn $set<C: Component>(
            handle: Handle,
            references: *const ValueReference,
            count: usize,
            values: *const $type,
            value_count: usize,
        ) -> Status {
            unsafe {
                entry::<C>(handle, $set_name, |instance| {
                    store(instance, references, count, values, value_count, $check, $write)
                })
            }
        }
    )*};
}

getters_and_setters! {
    get_float64 "fmi3GetFloat64" set_float64 "fmi3SetFloat64" f64:
        |i, r| if r == TIME { Ok(i.now.time) } else { i.get_real(r) },
        |i, r, v| i.check_real(r, *v),
        |i, r, v| i.set_real(r, *v);
    get_int32 "fmi3GetInt32" set_int32 "fmi3SetInt32" i32:
        |i, r| i.get_integer(r, false),
        |i, r, v| i.check_integer(r, i64::from(*v)),
        |i, r, v| i.set_integer(r, *v, false);
    get_int64 "fmi3GetInt64" set_int64 "fmi3SetInt64" i64:
        |i, r| i.get_choice(r).map(i64::from),
        |i, r, v| i.check_integer(r, *v),
        |i, r, v| i.set_choice(r, *v);
    get_boolean "fmi3GetBoolean" set_boolean "fmi3SetBoolean" u8:
        |i, r| i.get_boolean(r).map(u8::from),
        |i, r, _| i.check_boolean(r),
        |i, r, v| i.set_boolean(r, *v != 0);
    get_string "fmi3GetString" set_string "fmi3SetString" *const c_char:
        |i, r| i.get_text(r),
        |i, r, v| i.check_text(r, loaded(*v)?),
        |i, r, v| i.set_text(r, loaded(*v)?);
}

/// A type that no variable has: an empty list is served, anything else refused.
pub unsafe fn no_such_type<C: Component>(
    handle: Handle,
    function: &'static str,
    count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, function, |_| match count {
            0 => Ok(()),
            _ => Err(Fault::error(format!(
                "{} has no variables of this type",
                C::NAME
            ))),
        })
    }
}

/// A function of the standard for an ability that the component does not have.
pub unsafe fn unsupported<C: Component>(
    handle: Handle,
    function: &'static str,
    ability: &'static str,
) -> Status {
    unsafe {
        entry::<C>(handle, function, |_| {
            Err(Fault::error(format!("{} offers no {ability}", C::NAME)))
        })
    }
}

#[inline]
pub unsafe fn do_step<C: Component>(
    handle: Handle,
    time: f64,
    step_size: f64,
    event_handling_needed: *mut bool,
    terminate_simulation: *mut bool,
    early_return: *mut bool,
    last_successful_time: *mut f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3DoStep", |instance| {
            *target(event_handling_needed, "eventHandlingNeeded")? = false;
            *target(terminate_simulation, "terminateSimulation")? = false;
            *target(early_return, "earlyReturn")? = false;
            let last = target(last_successful_time, "lastSuccessfulTime")?;
            *last = instance.now.time;
            instance.do_step(time, step_size)?;
            *last = instance.now.time;
            Ok(())
        })
    }
}

pub unsafe fn update_discrete_states<C: Component>(
    handle: Handle,
    need_update: *mut bool,
    terminate: *mut bool,
    nominals_changed: *mut bool,
    states_changed: *mut bool,
    next_time_defined: *mut bool,
    next_time: *mut f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3UpdateDiscreteStates", |instance| {
            let event = if instance.event_mode_used {
                instance.require(&[Phase::Step])?;
                crate::component::Event::default()
            } else {
                instance.update_discrete_states()?
            };
            *target(need_update, "discreteStatesNeedUpdate")? = false;
            *target(terminate, "terminateSimulation")? = false;
            *target(nominals_changed, "nominalsOfContinuousStatesChanged")? = false;
            *target(states_changed, "valuesOfContinuousStatesChanged")? = event.states_changed;
            *target(next_time_defined, "nextEventTimeDefined")? = event.next_event_time.is_some();
            *target(next_time, "nextEventTime")? = event.next_event_time.unwrap_or(0.0);
            Ok(())
        })
    }
}

pub unsafe fn completed_integrator_step<C: Component>(
    handle: Handle,
    enter_event_mode: *mut bool,
    terminate_simulation: *mut bool,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3CompletedIntegratorStep", |instance| {
            instance.completed_integrator_step()?;
            *target(enter_event_mode, "enterEventMode")? = false;
            *target(terminate_simulation, "terminateSimulation")? = false;
            Ok(())
        })
    }
}

pub unsafe fn count<C: Component>(
    handle: Handle,
    function: &'static str,
    count: *mut usize,
    of: fn(&Instance<C>) -> usize,
) -> Status {
    unsafe {
        entry::<C>(handle, function, |instance| {
            *target(count, "count")? = of(instance);
            Ok(())
        })
    }
}

pub fn event_indicators<C: Component>(_: &Instance<C>) -> usize {
    C::EVENT_INDICATORS
}

pub fn continuous_states<C: Component>(instance: &Instance<C>) -> usize {
    instance.model.states.len()
}
