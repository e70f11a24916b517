//! One instance of an FMU, the same for FMI 2.0 and 3.0.

use std::sync::Arc;

use super::call::{Call, Endpoint, Function, Lost, Scalar, Texts, Values};
use super::isolation::Remote;
use super::messages::{Messages, STATUS, TELLING};
use super::native::{self, FATAL, Mode, Setup, Sink};
use super::processes::{Processes, refused};
use super::{
    CallError, Datum, FmiVersion, Fmu, FmuError, Interface, Kind, Message, Options, Trace, archive,
    convert,
};

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
    messages: Arc<Messages>,
    trace: Option<Arc<Trace>>,
    time: f64,
    phase: Phase,
    /// Whether its events are handled from outside.
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

/// A state that an instance was asked to keep; it is given back with [`Instance::free_state`].
#[derive(Debug, Default)]
pub struct State(u64);

/// How often events may follow each other at one moment.
const MOST_EVENT_ITERATIONS: usize = 1000;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// At its end.
    Whole,
    /// The FMU asked to end the run at that time, s.
    Ended(f64),
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
        // Clocks tick in events only; without them an FMU handles its events itself.
        let has_clocks = description.variables.iter().any(|v| v.kind == Kind::Clock);
        let has_events = description.has_event_mode && has_clocks;
        let mode = match description.interface {
            Interface::CoSimulation => Mode::CoSimulation {
                event_mode: has_events,
            },
            Interface::ModelExchange => Mode::ModelExchange {
                states: description.states,
                indicators: description.event_indicators,
            },
            Interface::ScheduledExecution => {
                let reason = "it offers scheduled execution only: its parts have to be called by a \
                              scheduler in real time, which a co-simulation has not";
                return Err(refused(fmu, name, reason.to_string()));
            }
        };
        let place = processes.place(fmu, alone);
        let place = place.map_err(|reason| refused(fmu, name, reason))?;
        let options = processes.options();
        let directory = fmu.unpacked.path();
        let identifier = &description.model_identifier;
        let version = description.version;
        let library = archive::binary(&fmu.path, directory, version, identifier)?;
        let told: Vec<&str> = match &options.log_categories {
            Some(categories) => categories.iter().map(String::as_str).collect(),
            None => TELLING
                .into_iter()
                .filter(|name| description.log_categories.iter().any(|c| c == name))
                .collect(),
        };
        let is_terse = options.log_categories.is_none() && !told.is_empty();
        let messages = Arc::new(Messages::new(is_terse));
        let setup = Setup {
            version,
            library,
            resources: directory.join("resources"),
            name: name.to_string(),
            token: description.token.clone(),
            mode,
            logging: options.log_categories.is_some() || !told.is_empty(),
        };
        if let Some(trace) = &options.trace {
            trace.begin(name, version, &Call::plain(Function::Instantiate));
        }
        let made = match &place {
            None => native::instantiate(&setup, messages.clone()),
            Some(host) => Remote::new(host, &setup, messages.clone(), options.trace.is_some())
                .map(|remote| Box::new(remote) as Box<dyn Endpoint>),
        };
        if let Some(trace) = &options.trace {
            let outcome = match &made {
                Ok(_) => Ok(0),
                Err(reason) => Err(Lost(reason.clone())),
            };
            trace.end(version, &Call::plain(Function::Instantiate), &outcome);
        }
        let endpoint = made.map_err(|mut reason| {
            for message in messages.take() {
                reason += &format!("; it says: {}", message.text);
            }
            refused(fmu, name, reason)
        })?;
        let mut instance = Self {
            name: name.to_string(),
            fmu: fmu.clone(),
            endpoint,
            messages,
            trace: options.trace.clone(),
            time: 0.0,
            phase: Phase::Instantiated,
            has_events,
            scratch: Vec::new(),
        };
        if setup.logging {
            instance.log_categories(&told);
        }
        Ok(instance)
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
        call.numbers = [start, stop, 0.0];
        call.flags[0] = true;
        if self.version() == FmiVersion::V2 {
            call.function = Function::SetupExperiment;
            self.call(&mut call)?;
            call.function = Function::EnterInitializationMode;
        }
        self.call(&mut call)?;
        self.phase = Phase::Initializing;
        Ok(())
    }

    /// Ends initialization; steps may follow.
    ///
    /// # Errors
    /// The FMU's refusal, for instance of a parameter.
    pub fn exit_initialization(&mut self) -> Outcome {
        self.plain(Function::ExitInitializationMode)?;
        if self.has_events {
            self.update_discrete_states()?;
            self.plain(Function::EnterStepMode)?;
        }
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// Steps from `time` to `time + step`, s.
    ///
    /// # Errors
    /// A step that was not completed.
    #[inline]
    pub fn do_step(&mut self, time: f64, step: f64) -> Outcome<Progress> {
        self.time = time;
        if self.has_events {
            return self.step_with_events(time, step);
        }
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [time, step, 0.0];
        let done = self.carry_out(&mut call);
        let [_, end, early, ..] = call.flags;
        let last = call.numbers[0];
        match done {
            Ok(0 | 1) if end => Ok(Progress::Ended(last)),
            Ok(0 | 1) if !early => Ok(Progress::Whole),
            Ok(0 | 1) => {
                let outcome = format!("returned early at {last} s, which it was not allowed to");
                Err(self.failure(Function::DoStep, &[], outcome))
            }
            Ok(2) => self.discarded(end, last),
            outcome => self.judge(outcome, &call).map(|()| Progress::Whole),
        }
    }

    /// As [`Instance::do_step`], handling the events on the way.
    #[cold]
    fn step_with_events(&mut self, time: f64, step: f64) -> Outcome<Progress> {
        let (end_time, mut now) = (time + step, time);
        let mut standing = 0;
        loop {
            let mut call = Call::plain(Function::DoStep);
            call.numbers = [now, end_time - now, 0.0];
            self.time = now;
            let done = self.carry_out(&mut call);
            let [event, end, early, ..] = call.flags;
            let last = if early { call.numbers[0] } else { end_time };
            match done {
                Ok(0 | 1) if end => return Ok(Progress::Ended(call.numbers[0])),
                Ok(0 | 1) => {}
                Ok(2) => return self.discarded(end, last),
                outcome => self.judge(outcome, &call)?,
            }
            if event || early {
                self.plain(Function::EnterEventMode)?;
                if self.update_discrete_states()? {
                    return Ok(Progress::Ended(last));
                }
                self.plain(Function::EnterStepMode)?;
            }
            if end_time - last <= 1e-9 * step {
                return Ok(Progress::Whole);
            }
            standing = if last > now { 0 } else { standing + 1 };
            if standing > MOST_EVENT_ITERATIONS {
                let outcome = format!("returned early again and again at {last} s");
                return Err(self.failure(Function::DoStep, &[], outcome));
            }
            now = last;
        }
    }

    /// After a step that the FMU discarded: a regular end, or an error that says how far it came.
    #[cold]
    fn discarded(&mut self, end: bool, last: f64) -> Outcome<Progress> {
        let (mut end, mut last) = (end, Some(last));
        if self.version() == FmiVersion::V2 {
            let mut terminated = Call::plain(Function::GetTerminated);
            end = matches!(self.carry_out(&mut terminated), Ok(0 | 1)) && terminated.flags[0];
            let mut reached = Call::plain(Function::GetLastSuccessfulTime);
            last = matches!(self.carry_out(&mut reached), Ok(0 | 1)).then_some(reached.numbers[0]);
        }
        if end {
            return Ok(Progress::Ended(last.unwrap_or(self.time)));
        }
        let reached = last.map_or(String::new(), |last| format!(" (it came to {last} s)"));
        let outcome = format!("returned discard{reached}");
        Err(self.failure(Function::DoStep, &[], outcome))
    }

    /// Reads the variables `references`, all of type `kind`, into `values`.
    ///
    /// # Errors
    /// The FMU's refusal, or a value that is not finite.
    #[inline]
    pub fn get(&mut self, kind: &Kind, references: &[u32], values: &mut [f64]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Get(scalar));
        call.references = references;
        call.count = values.len();
        if scalar == Scalar::Float64 {
            call.values = Values::Out(bytemuck::cast_slice_mut(values));
            self.call(&mut call)?;
        } else {
            let size = scalar.size(self.version());
            let mut scratch = std::mem::take(&mut self.scratch);
            scratch.resize(values.len(), 0);
            call.values = Values::Out(bytemuck::cast_slice_mut(&mut scratch));
            let done = self.call(&mut call);
            convert::unpack(scalar, bytemuck::cast_slice(&scratch), values, size);
            self.scratch = scratch;
            done?;
        }
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(at) => {
                let outcome = format!("gave {}", values[at]);
                let one = match values.len() == references.len() {
                    true => &references[at..=at],
                    false => references,
                };
                Err(self.failure(Function::Get(scalar), one, outcome))
            }
        }
    }

    /// Sets the variables `references`, all of type `kind`.
    ///
    /// # Errors
    /// The FMU's refusal.
    #[inline]
    pub fn set(&mut self, kind: &Kind, references: &[u32], values: &[f64]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Set(scalar));
        call.references = references;
        call.count = values.len();
        if scalar == Scalar::Float64 {
            call.values = Values::In(bytemuck::cast_slice(values));
            return self.call(&mut call);
        }
        let size = scalar.size(self.version());
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.resize(values.len(), 0);
        convert::pack(scalar, values, bytemuck::cast_slice_mut(&mut scratch), size);
        call.values = Values::In(bytemuck::cast_slice(&scratch));
        let done = self.call(&mut call);
        self.scratch = scratch;
        done
    }

    /// Reads variables of a type that an `f64` does not hold ([`Kind::is_exact`]).
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn get_exact(&mut self, kind: &Kind, references: &[u32], data: &mut [Datum]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Get(scalar));
        call.references = references;
        call.count = data.len();
        if matches!(scalar, Scalar::String | Scalar::Binary) {
            let mut texts = Texts::new();
            call.values = Values::TextsOut(&mut texts);
            self.call(&mut call)?;
            for (datum, text) in data.iter_mut().zip(texts) {
                *datum = match scalar {
                    Scalar::String => Datum::Text(text),
                    _ => Datum::Bytes(text),
                };
            }
            return Ok(());
        }
        let mut scratch = vec![0_u64; data.len()];
        call.values = Values::Out(bytemuck::cast_slice_mut(&mut scratch));
        self.call(&mut call)?;
        for (datum, bits) in data.iter_mut().zip(scratch) {
            *datum = match scalar {
                Scalar::UInt64 => Datum::Unsigned(bits),
                _ => Datum::Signed(bits.cast_signed()),
            };
        }
        Ok(())
    }

    /// Sets variables of a type that an `f64` does not hold.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn set_exact(&mut self, kind: &Kind, references: &[u32], data: &[Datum]) -> Outcome {
        let scalar = self.scalar(kind);
        let mut call = Call::plain(Function::Set(scalar));
        call.references = references;
        call.count = data.len();
        if matches!(scalar, Scalar::String | Scalar::Binary) {
            let texts = data.iter().map(|datum| match datum {
                Datum::Text(bytes) | Datum::Bytes(bytes) => bytes.clone(),
                number => number.to_string().into_bytes(),
            });
            let texts = texts.collect();
            call.values = Values::TextsIn(&texts);
            return self.call(&mut call);
        }
        let numbers = data.iter().map(|datum| match datum {
            Datum::Signed(value) => value.cast_unsigned(),
            Datum::Unsigned(value) => *value,
            Datum::Number(value) => *value as i64 as u64,
            Datum::Text(_) | Datum::Bytes(_) => 0,
        });
        let numbers: Vec<u64> = numbers.collect();
        call.values = Values::In(bytemuck::cast_slice(&numbers));
        self.call(&mut call)
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

    /// Lets an instance whose events are handled from outside take in what was set, as an event at
    /// the present time; nothing for others.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn begin_event(&mut self) -> Outcome {
        if !self.has_events || self.phase != Phase::Stepping {
            return Ok(());
        }
        self.plain(Function::EnterEventMode)
    }

    /// Ends what [`Instance::begin_event`] began; gives whether the FMU asked to end the run.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn end_event(&mut self) -> Outcome<bool> {
        if !self.has_events || self.phase != Phase::Stepping {
            return Ok(false);
        }
        let end = self.update_discrete_states()?;
        if !end {
            self.plain(Function::EnterStepMode)?;
        }
        Ok(end)
    }

    /// Until nothing changes any more; gives whether the FMU asked to end the run.
    fn update_discrete_states(&mut self) -> Outcome<bool> {
        for _ in 0..MOST_EVENT_ITERATIONS {
            let mut call = Call::plain(Function::UpdateDiscreteStates);
            self.call(&mut call)?;
            let [again, end, ..] = call.flags;
            if end || !again {
                return Ok(end);
            }
        }
        let outcome = format!("wants to go on after {MOST_EVENT_ITERATIONS} repetitions");
        Err(self.failure(Function::UpdateDiscreteStates, &[], outcome))
    }

    /// Keeps the present state in `state`, in place of what was kept there.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn save_state(&mut self, state: &mut State) -> Outcome {
        let mut call = Call::plain(Function::GetState);
        call.handle = state.0;
        self.call(&mut call)?;
        state.0 = call.handle;
        Ok(())
    }

    /// Goes back to a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn restore_state(&mut self, state: &State) -> Outcome {
        let mut call = Call::plain(Function::SetState);
        call.handle = state.0;
        self.call(&mut call)
    }

    /// Lets go of a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn free_state(&mut self, state: State) -> Outcome {
        if state.0 == 0 || self.phase == Phase::Over {
            return Ok(());
        }
        let mut call = Call::plain(Function::FreeState);
        call.handle = state.0;
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

    fn version(&self) -> FmiVersion {
        self.fmu.description.version
    }

    #[inline]
    fn scalar(&self, kind: &Kind) -> Scalar {
        match kind {
            Kind::Float64 => Scalar::Float64,
            Kind::Float32 => Scalar::Float32,
            Kind::Int8 => Scalar::Int8,
            Kind::UInt8 => Scalar::UInt8,
            Kind::Int16 => Scalar::Int16,
            Kind::UInt16 => Scalar::UInt16,
            Kind::Int32 => Scalar::Int32,
            Kind::UInt32 => Scalar::UInt32,
            Kind::Int64 => Scalar::Int64,
            Kind::UInt64 => Scalar::UInt64,
            Kind::Boolean => Scalar::Boolean,
            Kind::String => Scalar::String,
            Kind::Binary => Scalar::Binary,
            Kind::Clock => Scalar::Clock,
            Kind::Enumeration(_) => match self.version() {
                FmiVersion::V2 => Scalar::Int32,
                FmiVersion::V3 => Scalar::Int64,
            },
        }
    }

    fn plain(&mut self, function: Function) -> Outcome {
        self.call(&mut Call::plain(function))
    }

    #[inline]
    fn call(&mut self, call: &mut Call) -> Outcome {
        let outcome = self.carry_out(call);
        match outcome {
            // 0 is OK, 1 a warning: its message is kept and the run goes on.
            Ok(0 | 1) => Ok(()),
            outcome => self.judge(outcome, call),
        }
    }

    #[inline]
    fn carry_out(&mut self, call: &mut Call) -> Result<i32, Lost> {
        if self.trace.is_some() {
            return self.traced(call);
        }
        self.endpoint.call(call)
    }

    #[cold]
    fn traced(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let version = self.version();
        if let Some(trace) = &self.trace {
            trace.begin(&self.name, version, call);
        }
        let outcome = self.endpoint.call(call);
        if let Some(trace) = &self.trace {
            trace.end(version, call, &outcome);
        }
        outcome
    }

    /// An outcome that is neither OK nor a warning.
    #[cold]
    fn judge(&mut self, outcome: Result<i32, Lost>, call: &Call) -> Outcome {
        let outcome = match outcome {
            Ok(0 | 1) => return Ok(()),
            Ok(status) => {
                if status >= 3 {
                    self.phase = Phase::Over;
                }
                words(status)
            }
            Err(Lost(reason)) => {
                self.phase = Phase::Over;
                reason
            }
        };
        Err(match &call.culprit {
            Some(earlier) => self.failure(earlier.function, &earlier.references, outcome),
            None => self.failure(call.function, call.references, outcome),
        })
    }

    #[cold]
    fn failure(&self, function: Function, references: &[u32], outcome: String) -> Box<CallError> {
        let variables = &self.fmu.description.variables;
        let scalar = match function {
            Function::Get(scalar) | Function::Set(scalar) => Some(scalar),
            _ => None,
        };
        // References are counted for each type in FMI 2.0.
        let name = |reference: &u32| {
            let mut alike = variables.iter().filter(|v| v.reference == *reference);
            let found = alike.find(|v| Some(self.scalar(&v.kind)) == scalar);
            found.map_or_else(|| format!("#{reference}"), |v| v.name.clone())
        };
        let messages = self.messages.take();
        Box::new(CallError {
            instance: self.name.clone(),
            fmu: self.fmu.path.clone(),
            time: self.time,
            call: function.name(self.version()),
            variables: references.iter().map(name).collect(),
            outcome,
            messages: messages.into_iter().map(|message| message.text).collect(),
        })
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

/// A status as a clause.
fn words(status: i32) -> String {
    let known = usize::try_from(status).ok();
    match known.and_then(|status| STATUS.get(status)) {
        Some(name) => format!("returned {name}"),
        None => format!("returned {status}, which is no status of the standard"),
    }
}

const _: () = assert!(FATAL == 4, "the fifth of `STATUS`");
