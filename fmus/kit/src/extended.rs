//! What FMI 3.0 offers beyond scalars and steps: binaries, arrays sized by structural parameters, clocks,
//! events with early return, updates within a step. [`export_extended!`](crate::export_extended) gives a
//! component these functions; those of other components refuse.
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

mod values;

use std::ffi::{c_char, c_void};

pub use values::{
    get_binary, get_clock, get_float64, get_interval, get_uint64, set_binary, set_clock,
    set_float64, set_uint64,
};

use crate::{
    component::{Component, ComponentResult},
    description,
    fault::{Fault, Outcome, Status},
    fmi2::{Handle, call, exit_initialization},
    fmi3,
    guard::{catch, entry},
    instance::Instance,
    log::{Fmi3Logger, c_text},
    model::{Model, ValueReference},
    native,
    phase::{Kind, Phase},
    pointers::target,
    variable::{Causality, Variability},
};

/// The importer's `fmi3IntermediateUpdateCallback`.
pub type Update =
    unsafe extern "C" fn(*mut c_void, f64, bool, bool, bool, bool, *mut bool, *mut f64);

/// What the importer offers in co-simulation.
#[derive(Clone, Copy, Default)]
pub struct Importer {
    /// It handles events.
    pub event_mode: bool,
    /// Steps may be returned from early.
    pub early_return: bool,
    update: Option<(Update, *mut c_void)>,
}

impl Importer {
    /// Reports `time`, s, within a step; gives whether the importer asks to return there, and none where
    /// it has no callback.
    pub fn update(&self, time: f64, may_return: bool) -> Option<bool> {
        let (update, environment) = self.update?;
        // What the importer does not write would count as a request.
        let (mut early, mut until) = (true, f64::NAN);
        // SAFETY: the importer's function with its own environment; both places live.
        unsafe {
            let (early, until) = (&raw mut early, &raw mut until);
            update(
                environment,
                time,
                false,
                true,
                false,
                may_return,
                early,
                until,
            );
        }
        Some(early)
    }
}

/// A variable of a type that the table of a component has not.
pub enum Place<'a> {
    Binary(&'a mut Vec<u8>),
    /// Whether the clock ticks in the present event.
    Clock(&'a mut bool),
    /// A Float64 or an array of them.
    Reals(&'a mut Vec<f64>),
    /// A structural parameter, UInt64.
    Size(&'a mut u64),
}

/// What came of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advance {
    /// Where it ended, s: before its end where an event waits for the importer.
    pub time: f64,
    /// An event waits.
    pub event: bool,
}

/// What came of one pass over an event.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pass {
    /// Another pass is needed.
    pub again: bool,
    /// The next time event, s.
    pub next: Option<f64>,
}

/// A component with variables and events that [`Component`] has not. They are described by elements of
/// `modelDescription.xml`; their value references lie behind those of the table.
pub trait Extended: Component {
    /// Attributes of the element `CoSimulation`.
    const ABILITIES: &'static str;
    /// Elements at the end of `ModelVariables`.
    const VARIABLES: &'static str;
    /// Elements at the beginning and at the end of `ModelStructure`.
    const STRUCTURE: [&'static str; 2];

    /// The variable of a value reference, with its causality and variability.
    fn place(&mut self, reference: ValueReference) -> Option<(Place<'_>, Causality, Variability)>;

    /// Structural parameters have changed.
    fn resize(&mut self);

    /// The interval of a clock, s, and the standard's qualifier.
    fn interval(&mut self, reference: ValueReference) -> Option<(f64, i32)>;

    /// Steps from `time` by `step`, s; events are left to an importer with event mode.
    fn advance(
        &mut self,
        time: f64,
        step: f64,
        importer: &Importer,
    ) -> Result<Advance, Box<dyn std::error::Error>>;

    /// One pass over an event at `time`, s, in which the clocks that tick are set.
    fn pass(&mut self, time: f64) -> Result<Pass, Box<dyn std::error::Error>>;

    /// Steps where nobody asks for more.
    fn step_alone(&mut self, time: f64, step: f64) -> ComponentResult {
        self.advance(time, step, &Importer::default()).map(|_| ())
    }
}

/// As [`native::describe`], with the elements of the extended component.
pub fn describe<C: Extended>(what: i32) -> *mut c_char {
    if what != native::FMI3 {
        return native::describe::<C>(what);
    }
    let text = catch(|| {
        let text = Model::<C>::get().map(description::fmi3);
        let text = match text {
            Err(error) => return format!("error: {error}"),
            Ok(text) => text,
        };
        let [first, last] = C::STRUCTURE;
        let parts = [
            ("<CoSimulation ", format!("<CoSimulation {} ", C::ABILITIES)),
            (
                "</ModelVariables>",
                format!("{}</ModelVariables>", C::VARIABLES),
            ),
            ("<ModelStructure>", format!("<ModelStructure>{first}")),
            ("</ModelStructure>", format!("{last}</ModelStructure>")),
        ];
        let all = parts.iter();
        all.fold(text, |text, (from, to)| text.replacen(from, to, 1))
    });
    c_text(&text.unwrap_or_else(|problem| format!("error: {problem}"))).into_raw()
}

pub unsafe fn instantiate<C: Extended>(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    logging_on: bool,
    event_mode: bool,
    early_return: bool,
    environment: *mut c_void,
    logger: Option<Fmi3Logger>,
    update: Option<Update>,
) -> Handle {
    unsafe {
        let kind = Kind::CoSimulation;
        let handle = fmi3::instantiate::<C>(
            kind,
            name,
            token,
            resources,
            logging_on,
            false,
            environment,
            logger,
        );
        entry::<C>(handle, "fmi3InstantiateCoSimulation", |instance| {
            instance.importer = Importer {
                event_mode,
                early_return,
                update: update.map(|update| (update, environment)),
            };
            Ok(())
        });
        handle
    }
}

fn exit<C: Extended>(instance: &mut Instance<C>) -> Outcome {
    exit_initialization(instance)?;
    if instance.importer.event_mode {
        instance.enter(Phase::Event);
    }
    Ok(())
}

pub unsafe fn exit_initialization_mode<C: Extended>(handle: Handle) -> Status {
    unsafe { call::<C>(handle, "fmi3ExitInitializationMode", exit) }
}

pub unsafe fn enter_event_mode<C: Extended>(handle: Handle) -> Status {
    unsafe { change::<C>(handle, "fmi3EnterEventMode", Phase::Step, Phase::Event) }
}

pub unsafe fn enter_step_mode<C: Extended>(handle: Handle) -> Status {
    unsafe { change::<C>(handle, "fmi3EnterStepMode", Phase::Event, Phase::Step) }
}

unsafe fn change<C: Extended>(
    handle: Handle,
    function: &'static str,
    from: Phase,
    to: Phase,
) -> Status {
    unsafe {
        entry::<C>(handle, function, |instance| {
            instance.require(&[from])?;
            if !instance.importer.event_mode {
                return Err(Fault::error("the importer has not asked for event mode"));
            }
            instance.enter(to);
            Ok(())
        })
    }
}

pub unsafe fn enter_configuration_mode<C: Extended>(handle: Handle) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3EnterConfigurationMode", |instance| {
            instance.require(&[Phase::Instantiated])?;
            instance.enter(Phase::Configuration);
            Ok(())
        })
    }
}

pub unsafe fn exit_configuration_mode<C: Extended>(handle: Handle) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3ExitConfigurationMode", |instance| {
            instance.require(&[Phase::Configuration])?;
            instance.now.component.resize();
            instance.enter(Phase::Instantiated);
            Ok(())
        })
    }
}

pub unsafe fn update_discrete_states<C: Extended>(
    handle: Handle,
    again: *mut bool,
    terminate: *mut bool,
    nominals_changed: *mut bool,
    states_changed: *mut bool,
    next_defined: *mut bool,
    next: *mut f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3UpdateDiscreteStates", |instance| {
            instance.require(&[Phase::Event])?;
            let time = instance.now.time;
            let pass = instance.now.component.pass(time);
            let pass = pass.map_err(|problem| Fault::error(problem.to_string()))?;
            instance.now.stale = true;
            *target(again, "discreteStatesNeedUpdate")? = pass.again;
            *target(terminate, "terminateSimulation")? = false;
            *target(nominals_changed, "nominalsOfContinuousStatesChanged")? = false;
            *target(states_changed, "valuesOfContinuousStatesChanged")? = false;
            *target(next_defined, "nextEventTimeDefined")? = pass.next.is_some();
            *target(next, "nextEventTime")? = pass.next.unwrap_or(0.0);
            Ok(())
        })
    }
}

pub unsafe fn do_step<C: Extended>(
    handle: Handle,
    time: f64,
    step: f64,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    last: *mut f64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3DoStep", |instance| {
            instance.require(&[Phase::Step])?;
            let slack = 1e-6 * step.abs() + 1e-12 * time.abs();
            if (time - instance.now.time).abs() > slack || step.is_nan() || step <= 0.0 {
                let now = instance.now.time;
                let problem = format!("a step from {time} s by {step} s, but it is at {now} s");
                return Err(Fault::error(problem));
            }
            let importer = instance.importer;
            let advance = instance.now.component.advance(time, step, &importer);
            let advance = advance.map_err(|problem| Fault::error(problem.to_string()))?;
            let end = time + step;
            instance.now.time = advance.time;
            instance.now.stale = true;
            *target(event, "eventHandlingNeeded")? = advance.event;
            *target(terminate, "terminateSimulation")? = false;
            *target(early, "earlyReturn")? = advance.time < end - slack;
            *target(last, "lastSuccessfulTime")? = advance.time;
            Ok(())
        })
    }
}
