//! One instance of an FMU, the same for FMI 2.0 and 3.0.

use std::cell::Cell;
use std::ffi::c_void;
use std::ptr::null_mut;
use std::sync::Arc;

use fmi_rs::fmi2::{CS, FMU2};
use fmi_rs::fmi3::native::NativeLibrary;
use fmi_rs::fmi3::{FMU3, Implementation};

use super::messages::{Messages, STATUS};
use super::{CallError, FmiVersion, Fmu, FmuError, Kind, Message, archive};

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
    interface: Interface,
    messages: Arc<Messages>,
    time: f64,
    /// The standard forbids every further call after a fatal one.
    is_dead: Cell<bool>,
}

enum Interface {
    Fmi2(Arc<FMU2<CS>>),
    Fmi3(Arc<FMU3>),
}

/// A state that an instance was asked to keep; it is given back with [`Instance::free_state`].
#[derive(Debug)]
pub struct State(*mut c_void);

impl Default for State {
    fn default() -> Self {
        Self(null_mut())
    }
}

/// The same call in both versions; the status is numbered alike.
macro_rules! call {
    ($self:ident, $fmi2:ident ( $($a:expr),* ), $fmi3:ident ( $($b:expr),* )) => {
        match &$self.interface {
            Interface::Fmi2(fmu) => (fmu.$fmi2($($a),*) as i32, concat!("fmi2 ", stringify!($fmi2))),
            Interface::Fmi3(fmu) => (fmu.$fmi3($($b),*) as i32, concat!("fmi3 ", stringify!($fmi3))),
        }
    };
}

impl Instance {
    /// Loads the FMU's library and makes an instance of that name.
    ///
    /// # Errors
    /// No library for this platform, a library that lacks a function, or an FMU that refuses.
    pub fn new(fmu: &Arc<Fmu>, name: &str) -> Result<Self, FmuError> {
        let description = &fmu.description;
        let directory = fmu.unpacked.path();
        let identifier = &description.model_identifier;
        let library = archive::binary(&fmu.path, directory, description.version, identifier)?;
        let messages = Arc::new(Messages::default());
        let refused = |error: fmi_rs::sim::SimulationError| {
            let mut reason = match error {
                fmi_rs::sim::SimulationError::FMICall => "the FMU refused".to_string(),
                error => error.to_string(),
            };
            for message in messages.take() {
                reason += &format!("; it says: {}", message.text);
            }
            FmuError::Instantiation {
                fmu: fmu.path.clone(),
                instance: name.to_string(),
                reason,
            }
        };
        let interface = match description.version {
            FmiVersion::V2 => Interface::Fmi2(
                FMU2::<CS>::new(
                    directory,
                    identifier,
                    name,
                    &description.token,
                    false,
                    false,
                    false,
                    messages.clone(),
                    true,
                )
                .map_err(refused)?,
            ),
            FmiVersion::V3 => {
                let library: Box<dyn Implementation> =
                    Box::new(NativeLibrary::load(library).map_err(refused)?);
                let resources = directory.join("resources");
                Interface::Fmi3(
                    FMU3::instantiateCoSimulation(
                        library,
                        Some(&resources),
                        name,
                        &description.token,
                        false,
                        false,
                        false,
                        false,
                        messages.clone(),
                        false,
                        None,
                    )
                    .map_err(refused)?,
                )
            }
        };
        Ok(Self {
            name: name.to_string(),
            fmu: fmu.clone(),
            interface,
            messages,
            time: 0.0,
            is_dead: Cell::new(false),
        })
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
        if let Interface::Fmi2(fmu) = &self.interface {
            let status = fmu.setupExperiment(None, start, Some(stop)) as i32;
            self.check((status, "fmi2 setupExperiment"), &[])?;
        }
        let done = call!(
            self,
            enterInitializationMode(),
            enterInitializationMode(None, start, Some(stop))
        );
        self.check(done, &[])
    }

    /// Ends initialization; steps may follow.
    ///
    /// # Errors
    /// The FMU's refusal, for instance of a parameter.
    pub fn exit_initialization(&self) -> Outcome {
        let done = call!(self, exitInitializationMode(), exitInitializationMode());
        self.check(done, &[])
    }

    /// Steps from `time` to `time + step`, s.
    ///
    /// # Errors
    /// A step that was not completed.
    #[inline]
    pub fn do_step(&mut self, time: f64, step: f64) -> Outcome {
        self.time = time;
        match &self.interface {
            Interface::Fmi2(fmu) => {
                let status = fmu.doStep(time, step, 0) as i32;
                self.check((status, "fmi2 doStep"), &[])
            }
            Interface::Fmi3(fmu) => {
                let (mut event, mut end, mut early) = (false, false, false);
                let mut last = time + step;
                let status = fmu.doStep(
                    time, step, false, &mut event, &mut end, &mut early, &mut last,
                ) as i32;
                self.check((status, "fmi3 doStep"), &[])?;
                if end || early {
                    let what = if end {
                        "asked to end the run"
                    } else {
                        "returned early"
                    };
                    return Err(self.failure("fmi3 doStep", &[], format!("{what} at {last} s")));
                }
                Ok(())
            }
        }
    }

    /// Reads the variables `references`, all of type `kind`, into `values`.
    ///
    /// # Errors
    /// The FMU's refusal, or a value that is not finite.
    #[inline]
    pub fn get(&self, kind: &Kind, references: &[u32], values: &mut [f64]) -> Outcome {
        match kind {
            Kind::Float64 => {
                let done = call!(
                    self,
                    getReal(references, values),
                    getFloat64(references, values)
                );
                self.check(done, references)?;
                match values.iter().position(|value| !value.is_finite()) {
                    None => Ok(()),
                    Some(at) => {
                        let outcome = format!("gave {}", values[at]);
                        Err(self.failure(done.1, &references[at..=at], outcome))
                    }
                }
            }
            _ => {
                for (value, &reference) in values.iter_mut().zip(references) {
                    *value = self.get_one(kind, reference)?;
                }
                Ok(())
            }
        }
    }

    fn get_one(&self, kind: &Kind, reference: u32) -> Outcome<f64> {
        let reference = [reference];
        let (done, value) = match (kind, &self.interface) {
            (Kind::Boolean, Interface::Fmi2(fmu)) => {
                let mut value = [0];
                let status = fmu.getBoolean(&reference, &mut value) as i32;
                (
                    (status, "fmi2 getBoolean"),
                    f64::from(u8::from(value[0] != 0)),
                )
            }
            (Kind::Boolean, Interface::Fmi3(fmu)) => {
                let mut value = [false];
                let status = fmu.getBoolean(&reference, &mut value) as i32;
                ((status, "fmi3 getBoolean"), f64::from(u8::from(value[0])))
            }
            (Kind::Enumeration(_), Interface::Fmi3(fmu)) => {
                let mut value = [0];
                let status = fmu.getInt64(&reference, &mut value) as i32;
                ((status, "fmi3 getInt64"), value[0] as f64)
            }
            (_, Interface::Fmi2(fmu)) => {
                let mut value = [0];
                let status = fmu.getInteger(&reference, &mut value) as i32;
                ((status, "fmi2 getInteger"), f64::from(value[0]))
            }
            (_, Interface::Fmi3(fmu)) => {
                let mut value = [0];
                let status = fmu.getInt32(&reference, &mut value) as i32;
                ((status, "fmi3 getInt32"), f64::from(value[0]))
            }
        };
        self.check(done, &reference)?;
        Ok(value)
    }

    /// Sets the variables `references`, all of type `kind`.
    ///
    /// # Errors
    /// The FMU's refusal.
    #[inline]
    pub fn set(&self, kind: &Kind, references: &[u32], values: &[f64]) -> Outcome {
        match kind {
            Kind::Float64 => {
                let done = call!(
                    self,
                    setReal(references, values),
                    setFloat64(references, values)
                );
                self.check(done, references)
            }
            _ => (0..references.len())
                .try_for_each(|at| self.set_one(kind, references[at], values[at])),
        }
    }

    fn set_one(&self, kind: &Kind, reference: u32, value: f64) -> Outcome {
        let reference = [reference];
        let (integer, truth) = (value as i32, value != 0.0);
        let done = match kind {
            Kind::Boolean => call!(
                self,
                setBoolean(&reference, &[i32::from(truth)]),
                setBoolean(&reference, &[truth])
            ),
            Kind::Enumeration(_) => call!(
                self,
                setInteger(&reference, &[integer]),
                setInt64(&reference, &[value as i64])
            ),
            _ => call!(
                self,
                setInteger(&reference, &[integer]),
                setInt32(&reference, &[integer])
            ),
        };
        self.check(done, &reference)
    }

    /// Sets a text.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn set_text(&self, reference: u32, text: &str) -> Outcome {
        let done = call!(
            self,
            setString(&[reference], &[text]),
            setString(&[reference], &[text])
        );
        self.check(done, &[reference])
    }

    /// Keeps the present state in `state`, in place of what was kept there.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn save_state(&self, state: &mut State) -> Outcome {
        let done = call!(self, getFMUstate(&mut state.0), getFMUState(&mut state.0));
        self.check(done, &[])
    }

    /// Goes back to a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn restore_state(&mut self, state: &State) -> Outcome {
        let done = call!(self, setFMUstate(state.0), setFMUState(state.0));
        self.check(done, &[])
    }

    /// Lets go of a kept state.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn free_state(&self, mut state: State) -> Outcome {
        if state.0.is_null() || self.is_dead.get() {
            return Ok(());
        }
        let done = call!(self, freeFMUstate(&mut state.0), freeFMUState(&mut state.0));
        self.check(done, &[])
    }

    #[inline]
    fn check(&self, (status, call): (i32, &'static str), references: &[u32]) -> Outcome {
        // 0 is OK, 1 a warning: its message is kept and the run goes on.
        if status <= 1 {
            return Ok(());
        }
        let name = STATUS
            .get(status as usize)
            .copied()
            .unwrap_or("an unknown status");
        let error = self.failure(call, references, format!("returned {name}"));
        if name == "fatal" {
            self.is_dead.set(true);
            // Not even freeing it is allowed.
            match &self.interface {
                Interface::Fmi2(fmu) => std::mem::forget(fmu.clone()),
                Interface::Fmi3(fmu) => std::mem::forget(fmu.clone()),
            }
        }
        Err(error)
    }

    #[cold]
    fn failure(&self, call: &'static str, references: &[u32], outcome: String) -> Box<CallError> {
        let variables = &self.fmu.description.variables;
        let name = |reference: &u32| {
            let found = variables.iter().find(|v| v.reference == *reference);
            found.map_or_else(|| format!("#{reference}"), |v| v.name.clone())
        };
        let messages = self.messages.take();
        let (version, function) = call.split_once(' ').unwrap_or_default();
        let (first, rest) = function.split_at(1.min(function.len()));
        Box::new(CallError {
            instance: self.name.clone(),
            fmu: self.fmu.path.clone(),
            time: self.time,
            call: format!("{version}{}{rest}", first.to_uppercase()),
            variables: references.iter().map(name).collect(),
            outcome,
            messages: messages.into_iter().map(|message| message.text).collect(),
        })
    }
}
