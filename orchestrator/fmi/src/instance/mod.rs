//! One instance of an FMU, the same for FMI 2.0 and 3.0.

mod calling;
mod derivatives;
mod events;
mod stepping;
mod values;

use std::sync::Arc;

use super::call::{Call, Endpoint, Function, Lost, Values};
use super::error::InstanceError;
use super::isolation::Remote;
use super::messages::{Messages, TELLING};
use super::native::{self, Events, Mode, Setup, Sink, WithEvents};
use super::processes::{Processes, refused};
use super::stand_in::Computed;
use super::trace::Traced;
use super::{
    CURE, CallError, Causality, FmiVersion, Fmu, FmuError, Interface, Kind, Message, Options,
    archive,
};
use calling::words;

pub use stepping::Progress;

type Outcome<T = ()> = Result<T, Box<CallError>>;

/// A loaded and instantiated FMU for co-simulation.
///
/// Values are passed as `f64` whatever their type (integers are exact, `false` is 0 and `true` 1);
/// nothing allocates where a call goes well.
pub struct Instance {
    /// The instance's name.
    pub name: String,
    /// What it is an instance of.
    pub fmu: Arc<Fmu>,
    endpoint: Box<dyn Endpoint>,
    is_apart: bool,
    /// Which other process it is in, if it is.
    process: Option<usize>,
    messages: Arc<Messages>,
    time: f64,
    phase: Phase,
    /// Whether its events are handled outside of it.
    has_events: bool,
    /// Values on their way, aligned for every type.
    scratch: Vec<u64>,
}

/// How far an instance is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Instantiated,
    Initializing,
    Stepping,
    /// Terminated or failed: only freeing is allowed.
    Over,
}

/// No state has more bytes.
const MOST_STATE: usize = 1 << 30;

/// A state that an instance was asked to keep; it is given back with [`Instance::free_state`].
#[derive(Debug, Default)]
pub struct State {
    handle: u64,
}

impl Instance {
    /// Loads the FMU's library and makes an instance of that name.
    ///
    /// # Errors
    /// No library for this platform, a library that cannot be loaded or lacks a function, or an
    /// FMU that refuses.
    pub fn new(fmu: &Arc<Fmu>, name: &str, options: &Options) -> Result<Self, FmuError> {
        Self::within(fmu, name, &mut Processes::new(options), false)
    }

    /// As [`Instance::new`], in the process that `processes` has for it; `alone` where its end must
    /// not take others along.
    ///
    /// # Errors
    /// As [`Instance::new`], or no process can be started.
    pub fn within(
        fmu: &Arc<Fmu>,
        name: &str,
        processes: &mut Processes,
        alone: bool,
    ) -> Result<Self, FmuError> {
        let description = &fmu.description;
        let is_exchange = match description.interface {
            Interface::CoSimulation => false,
            Interface::ModelExchange => true,
            Interface::ScheduledExecution => {
                return Err(refused(fmu, name, InstanceError::Scheduled));
            }
        };
        let events = events::of(description);
        let mut events = events.map_err(|reason| refused(fmu, name, reason))?;
        let is_traced = processes.options().trace.is_some();
        let mode = match is_exchange {
            false => Mode::CoSimulation {
                events: events.clone(),
                elsewhere: is_traced,
            },
            true => Mode::ModelExchange {
                states: description.states,
                indicators: description.event_indicators,
                pairs: match description.directional_derivatives {
                    true => description.state_pairs.clone(),
                    false => Vec::new(),
                },
            },
        };
        if let Some(stand_in) = &fmu.stand_in {
            let computed = Computed::new(stand_in, fmu, name);
            let computed = computed.map_err(|reason| refused(fmu, name, reason))?;
            let messages = Arc::new(Messages::new(true));
            let endpoint = Box::new(computed);
            return Ok(Self::around(fmu, name, endpoint, messages));
        }
        let place = processes.place(fmu, alone);
        let place = place.map_err(|reason| refused(fmu, name, reason))?;
        let options = processes.options();
        let directory = fmu.unpacked.path();
        let identifier = &description.model_identifier;
        let version = description.version;
        let library = archive::binary(&fmu.path, directory, version, identifier);
        let library = library.map_err(|error| match error {
            FmuError::Binary { fmu: path, reason } if fmu.is_own => FmuError::Binary {
                fmu: path,
                reason: format!("{reason}; {CURE}"),
            },
            other => other,
        })?;
        let told: Vec<&str> = match &options.log_categories {
            Some(categories) => categories.iter().map(String::as_str).collect(),
            None => TELLING
                .into_iter()
                .filter(|name| description.log_categories.iter().any(|c| c == name))
                .collect(),
        };
        let is_terse = options.log_categories.is_none() && !told.is_empty();
        let messages = Arc::new(Messages::new(is_terse));
        let mut setup = Setup {
            version,
            library,
            resources: directory.join("resources"),
            name: name.to_string(),
            token: description.token.clone(),
            mode,
            logging: options.log_categories.is_some() || !told.is_empty(),
        };
        let make = |setup: &Setup| {
            if let Some(trace) = &options.trace {
                trace.begin(name, version, &Call::plain(Function::Instantiate));
            }
            let made = match &place {
                None => native::instantiate(setup, messages.clone()),
                Some(host) => Remote::new(host, setup, messages.clone(), is_traced)
                    .map(|remote| Box::new(remote) as Box<dyn Endpoint>),
            };
            if let Some(trace) = &options.trace {
                let outcome = match &made {
                    Ok(_) => Ok(0),
                    Err(error) => Err(Lost(error.to_string())),
                };
                trace.end(version, &Call::plain(Function::Instantiate), &outcome);
            }
            made
        };
        let mut made = make(&setup);
        // Some FMUs declare event mode and refuse it; without clocks they can do without.
        if made.is_err() && events.as_ref().is_some_and(Events::has_no_clocks) {
            setup.mode = Mode::CoSimulation {
                events: None,
                elsewhere: is_traced,
            };
            if let Ok(endpoint) = make(&setup) {
                (made, events) = (Ok(endpoint), None);
                let text = "it declares event mode and refuses it, so it handles its events itself";
                messages.message(1, "", text);
            }
        }
        let has_events = events.is_some();
        let endpoint = made.map_err(|error| {
            let mut reason = error.to_string();
            for message in messages.take() {
                reason += &format!("; it says: {}", message.text);
            }
            refused(fmu, name, reason)
        })?;
        let endpoint = match &options.trace {
            None => endpoint,
            Some(trace) => {
                let traced: Box<dyn Endpoint> = Box::new(Traced {
                    instance: name.to_string(),
                    version,
                    endpoint,
                    trace: trace.clone(),
                });
                match events {
                    None => traced,
                    Some(events) => Box::new(WithEvents::new(traced, events, messages.clone())),
                }
            }
        };
        let mut instance = Self::around(fmu, name, endpoint, messages);
        instance.has_events = has_events;
        if !has_events {
            let outputs = description.of(Causality::Output);
            let mut outputs = outputs.map(|at| &description.variables[at]);
            if let Some(clock) = outputs.find(|variable| variable.kind == Kind::Clock) {
                let text = format!(
                    "its output clock `{}` is not read, which is possible in co-simulation with \
                     hasEventMode=\"true\" only",
                    clock.name
                );
                instance.messages.message(1, "", &text);
            }
        }
        instance.is_apart = place.is_some();
        instance.process = place.as_ref().map(|host| Arc::as_ptr(host).addr());
        if setup.logging {
            instance.log_categories(&told);
        }
        Ok(instance)
    }

    /// An instance whose calls `endpoint` carries out.
    fn around(
        fmu: &Arc<Fmu>,
        name: &str,
        endpoint: Box<dyn Endpoint>,
        messages: Arc<Messages>,
    ) -> Self {
        Self {
            name: name.to_string(),
            fmu: fmu.clone(),
            endpoint,
            is_apart: false,
            process: None,
            messages,
            time: 0.0,
            phase: Phase::Instantiated,
            has_events: false,
            scratch: Vec::new(),
        }
    }

    /// Asks for messages of these categories; an FMU that refuses logs what it likes.
    fn log_categories(&mut self, categories: &[&str]) {
        let texts = categories.iter().map(|name| name.as_bytes().to_vec());
        let texts = texts.collect();
        let mut call = Call::plain(Function::SetDebugLogging);
        call.flags[0] = true;
        call.values = Values::TextsIn(&texts);
        let refused = match self.carry_out(&mut call) {
            Ok(0 | 1) => return,
            Ok(status) => words(status),
            Err(Lost(reason)) => reason,
        };
        let text = format!("the log categories were not accepted: the call {refused}");
        self.messages.message(1, "", &text);
    }

    /// Whether another process carries out its calls.
    pub fn is_apart(&self) -> bool {
        self.is_apart
    }

    /// The other process that carries out its calls, as a number that its FMUs share.
    pub fn process(&self) -> Option<usize> {
        self.process
    }

    /// How often calls have travelled to that process and back, those of its other FMUs among them.
    pub fn exchanges(&self) -> u64 {
        self.endpoint.exchanges()
    }

    /// What the FMU logged since this was last asked.
    pub fn take_messages(&self) -> Vec<Message> {
        self.messages.take()
    }

    /// Enters initialization mode.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn enter_initialization(&mut self, start: f64, stop: f64) -> Outcome {
        self.time = start;
        let mut call = Call::plain(Function::EnterInitializationMode);
        call.numbers = [start, stop, self.fmu.tolerance.unwrap_or(0.0)];
        call.flags[0] = true;
        call.flags[1] = self.fmu.tolerance.is_some();
        if self.version() == FmiVersion::V2 {
            call.function = Function::SetupExperiment;
            self.call(&mut call)?;
            call.function = Function::EnterInitializationMode;
        }
        self.call(&mut call)?;
        self.phase = Phase::Initializing;
        Ok(())
    }

    /// Whether its events are handled outside of it, the first ones at the end of initialization.
    pub fn has_events(&self) -> bool {
        self.has_events
    }

    /// Ends initialization; steps may follow.
    ///
    /// # Errors
    /// The FMU's refusal, for instance of a parameter.
    pub fn exit_initialization(&mut self) -> Outcome {
        self.plain(Function::ExitInitializationMode)?;
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// Enters the mode in which structural parameters are set.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn enter_configuration(&mut self) -> Outcome {
        self.plain(Function::EnterConfigurationMode)
    }

    /// Leaves the mode in which structural parameters are set.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn exit_configuration(&mut self) -> Outcome {
        self.plain(Function::ExitConfigurationMode)
    }

    /// Keeps the present state in `state`, in place of what was kept there.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn save_state(&mut self, state: &mut State) -> Outcome {
        let mut call = Call::plain(Function::GetState);
        call.handle = state.handle;
        self.call(&mut call)?;
        state.handle = call.handle;
        Ok(())
    }

    /// Goes back to a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn restore_state(&mut self, state: &State) -> Outcome {
        let mut call = Call::plain(Function::SetState);
        call.handle = state.handle;
        self.call(&mut call)
    }

    /// A kept state as bytes, which another instance of the same FMU can read.
    ///
    /// # Errors
    /// The FMU's refusal; a state that is too large to be real.
    pub fn state_as_bytes(&mut self, state: &State) -> Outcome<Vec<u8>> {
        let mut call = Call::plain(Function::SizeOfState);
        call.handle = state.handle;
        self.call(&mut call)?;
        let size = usize::try_from(call.handle).unwrap_or(usize::MAX);
        if size > MOST_STATE {
            let outcome = format!("gave a state of {size} bytes");
            return Err(self.failure(Function::SizeOfState, &[], outcome));
        }
        // Aligned for every type.
        let mut words = vec![0_u64; size.div_ceil(8)];
        let bytes = &mut bytemuck::cast_slice_mut(&mut words)[..size];
        let mut call = Call::plain(Function::WriteState);
        call.handle = state.handle;
        call.count = size;
        call.values = Values::Out(bytes);
        self.call(&mut call)?;
        Ok(bytemuck::cast_slice::<u64, u8>(&words)[..size].to_vec())
    }

    /// A state from its bytes.
    ///
    /// # Errors
    /// The FMU's refusal: of bytes that are not a state of it.
    pub fn state_of_bytes(&mut self, bytes: &[u8]) -> Outcome<State> {
        let mut words = vec![0_u64; bytes.len().div_ceil(8)];
        bytemuck::cast_slice_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        let mut call = Call::plain(Function::ReadState);
        call.count = bytes.len();
        call.values = Values::In(&bytemuck::cast_slice(&words)[..bytes.len()]);
        self.call(&mut call)?;
        Ok(State {
            handle: call.handle,
        })
    }

    /// Lets go of a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn free_state(&mut self, state: State) -> Outcome {
        if state.handle == 0 || self.phase == Phase::Over {
            return Ok(());
        }
        let mut call = Call::plain(Function::FreeState);
        call.handle = state.handle;
        self.call(&mut call)
    }

    /// Ends the instance's run; afterwards it can only be dropped. A refusal is logged: the run is
    /// over anyway.
    pub fn terminate(&mut self) {
        if self.phase == Phase::Stepping {
            let done = self.plain(Function::Terminate);
            self.phase = Phase::Over;
            if let Err(error) = done {
                self.messages.message(1, "", &error.to_string());
            }
        }
    }

    /// As [`Instance::terminate`], and frees it: what it logs to the very end can be taken then.
    pub fn close(&mut self) {
        self.terminate();
        self.phase = Phase::Over;
        self.endpoint = Box::new(Closed);
    }
}

/// In place of an instance that has been freed.
struct Closed;

impl Endpoint for Closed {
    fn call(&mut self, _call: &mut Call) -> Result<i32, Lost> {
        Err(Lost("came after the instance was freed".to_string()))
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.terminate();
    }
}
