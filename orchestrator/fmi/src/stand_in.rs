//! An FMU whose instances the host computes itself, such as a function of a scripting language in
//! place of a controller. To the master it is an FMU like any other.

use std::collections::HashMap;
use std::error::Error;
use std::fmt;
use std::sync::Arc;

use super::call::{Call, Endpoint, Function, Lost, Scalar, Stepped, Values};
use super::error::InstanceError;
use super::{Causality, FmiVersion, Fmu, Kind, Variable, convert};

/// Why a [`Behaviour`] cannot do what was asked: any error, whose message is a clause that follows the
/// name of the instance's call.
pub type BehaviourError = Box<dyn Error + Send + Sync>;

/// What computes one instance.
pub trait Behaviour: Send {
    /// From the inputs to the outputs, both in the order of the description: of a sampled component
    /// at `time`, s, of a continuous one over `[time, time + step]`.
    ///
    /// # Errors
    /// Why it cannot.
    fn step(
        &mut self,
        time: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError>;

    /// Its own state as bytes.
    ///
    /// # Errors
    /// Why it has none that can be saved.
    fn save(&mut self) -> Result<Vec<u8>, BehaviourError>;

    /// Goes back to a state that [`Behaviour::save`] gave.
    ///
    /// # Errors
    /// Why it cannot.
    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError>;
}

/// Makes what computes the instance of that name.
pub type Begin = dyn Fn(&str) -> Result<Box<dyn Behaviour>, BehaviourError> + Send + Sync;

/// How the instances of an FMU are computed in place of its library.
#[derive(Clone)]
pub(super) struct StandIn(Arc<Begin>);

impl fmt::Debug for StandIn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("StandIn")
    }
}

impl Fmu {
    /// The same FMU, computed by what `begin` makes in place of its library, with further inputs
    /// (Float64, without units). Its parameters have no effect then. A component that is not sampled
    /// gives its outputs at the end of a step, so that none depends directly on an input.
    #[must_use]
    pub fn computed_by(&self, inputs: &[String], is_sampled: bool, begin: Arc<Begin>) -> Self {
        let mut fmu = match is_sampled {
            true => self.clone(),
            false => self.without_feedthrough(),
        };
        fmu.stand_in = Some(StandIn(begin));
        fmu.is_own = true;
        let description = &mut fmu.description;
        description.saves_state = true;
        description.writes_state = true;
        description.directional_derivatives = false;
        description.adjoint_derivatives = false;
        description.only_one_per_process = false;
        for name in inputs {
            description.add_input(name);
        }
        if is_sampled {
            let all: Arc<[usize]> = description.of(Causality::Input).collect();
            let outputs = |v: &&mut Variable| v.causality == Causality::Output;
            for output in description.variables.iter_mut().filter(outputs) {
                output.dependencies = all.clone();
            }
        }
        fmu
    }
}

/// An instance that is computed here.
pub(super) struct Computed {
    behaviour: Box<dyn Behaviour>,
    version: FmiVersion,
    /// Where the values of a reference are: the first, and how many.
    slots: HashMap<(Scalar, u32), Slot>,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
    saved: HashMap<u64, Vec<u8>>,
    handles: u64,
}

/// Where values are.
#[derive(Debug, Clone, Copy)]
struct Slot {
    is_output: bool,
    first: usize,
    count: usize,
}

impl Computed {
    /// The instance `name` of an FMU.
    ///
    /// # Errors
    /// What is computed cannot begin.
    pub(super) fn new(stand_in: &StandIn, fmu: &Fmu, name: &str) -> Result<Self, InstanceError> {
        let description = &fmu.description;
        let mut computed = Self {
            behaviour: (stand_in.0)(name).map_err(InstanceError::StandIn)?,
            version: description.version,
            slots: HashMap::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            saved: HashMap::new(),
            handles: 0,
        };
        for variable in &description.variables {
            let is_output = match variable.causality {
                Causality::Input => false,
                Causality::Output => true,
                Causality::Parameter | Causality::Local => continue,
            };
            let start = variable.start.as_deref().and_then(|text| text.parse().ok());
            let values = match is_output {
                true => &mut computed.outputs,
                false => &mut computed.inputs,
            };
            let key = (
                Scalar::of(&variable.kind, computed.version),
                variable.reference,
            );
            let new = Slot {
                is_output,
                first: values.len(),
                count: 0,
            };
            computed.slots.entry(key).or_insert(new).count += 1;
            values.push(start.unwrap_or(0.0));
        }
        Ok(computed)
    }

    fn exchange(&mut self, scalar: Scalar, references: &[u32], values: &mut Values) {
        let size = scalar.size(self.version);
        let mut at = 0;
        for reference in references {
            let slot = self.slots.get(&(scalar, *reference)).copied();
            let count = slot.map_or(1, |slot| slot.count);
            let bytes = at * size..(at + count) * size;
            at += count;
            let Some(Slot {
                is_output, first, ..
            }) = slot
            else {
                continue;
            };
            let own = match is_output {
                true => &mut self.outputs[first..first + count],
                false => &mut self.inputs[first..first + count],
            };
            match values {
                Values::Out(out) => {
                    if let Some(out) = out.get_mut(bytes) {
                        convert::pack(scalar, own, out, size);
                    }
                }
                Values::In(given) => {
                    if let Some(given) = given.get(bytes) {
                        convert::unpack(scalar, given, own, size);
                    }
                }
                _ => {}
            }
        }
    }

    fn run(&mut self, time: f64, step: f64) -> Result<(), Lost> {
        let (inputs, outputs) = (&self.inputs, &mut self.outputs);
        let stepped = self.behaviour.step(time, step, inputs, outputs);
        stepped.map_err(lost)
    }

    /// The values and the own state as bytes.
    fn state(&mut self) -> Result<Vec<u8>, Lost> {
        let values = self.inputs.iter().chain(&self.outputs);
        let mut bytes: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
        bytes.extend(self.behaviour.save().map_err(lost)?);
        Ok(bytes)
    }

    fn take_state(&mut self, bytes: &[u8]) -> Result<(), Lost> {
        let count = self.inputs.len() + self.outputs.len();
        let Some((values, own)) = bytes.split_at_checked(8 * count) else {
            return Err(Lost("is given a state of another component".to_string()));
        };
        self.behaviour.restore(own).map_err(lost)?;
        let places = self.inputs.iter_mut().chain(&mut self.outputs);
        for (place, bytes) in places.zip(values.chunks_exact(8)) {
            let mut value = [0; 8];
            value.copy_from_slice(bytes);
            *place = f64::from_le_bytes(value);
        }
        Ok(())
    }
}

fn lost(error: BehaviourError) -> Lost {
    Lost(error.to_string())
}

impl Endpoint for Computed {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        match call.function {
            Function::Get(scalar) | Function::Set(scalar) if scalar.size(self.version) > 0 => {
                self.exchange(scalar, call.references, &mut call.values);
            }
            Function::DoStep => {
                let [time, step, _] = call.numbers;
                self.run(time, step)?;
                call.flags = [false; 5];
                call.numbers[0] = time + step;
            }
            Function::GetState => {
                let state = self.state()?;
                if call.handle == 0 {
                    self.handles += 1;
                    call.handle = self.handles;
                }
                self.saved.insert(call.handle, state);
            }
            Function::SetState => {
                let state = self.saved.remove(&call.handle).unwrap_or_default();
                let taken = self.take_state(&state);
                self.saved.insert(call.handle, state);
                taken?;
            }
            Function::FreeState => {
                self.saved.remove(&call.handle);
            }
            Function::SizeOfState => {
                let state = self.saved.get(&call.handle);
                call.handle = state.map_or(0, Vec::len) as u64;
            }
            Function::WriteState => {
                if let (Some(state), Values::Out(bytes)) =
                    (self.saved.get(&call.handle), &mut call.values)
                    && bytes.len() == state.len()
                {
                    bytes.copy_from_slice(state);
                }
            }
            Function::ReadState => {
                let Values::In(bytes) = &call.values else {
                    return Err(Lost("is given no state".to_string()));
                };
                self.handles += 1;
                self.saved.insert(self.handles, bytes.to_vec());
                call.handle = self.handles;
            }
            // There are none.
            Function::GetDirectionalDerivative | Function::GetAdjointDerivative => return Ok(2),
            _ => {}
        }
        Ok(0)
    }

    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Option<i32> {
        self.exchange(
            Scalar::Float64,
            references,
            &mut Values::Out(bytemuck::cast_slice_mut(values)),
        );
        Some(0)
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Option<i32> {
        self.exchange(
            Scalar::Float64,
            references,
            &mut Values::In(bytemuck::cast_slice(values)),
        );
        Some(0)
    }

    fn step(&mut self, _time: f64, _step: f64) -> Option<Stepped> {
        // A failure has words, which only a call gives.
        None
    }
}

impl Scalar {
    /// The type in which a value of that kind crosses the C interface.
    pub(super) fn of(kind: &Kind, version: FmiVersion) -> Self {
        match kind {
            Kind::Float64 => Self::Float64,
            Kind::Float32 => Self::Float32,
            Kind::Int8 => Self::Int8,
            Kind::UInt8 => Self::UInt8,
            Kind::Int16 => Self::Int16,
            Kind::UInt16 => Self::UInt16,
            Kind::Int32 => Self::Int32,
            Kind::UInt32 => Self::UInt32,
            Kind::Int64 => Self::Int64,
            Kind::UInt64 => Self::UInt64,
            Kind::Boolean => Self::Boolean,
            Kind::String => Self::String,
            Kind::Binary => Self::Binary,
            Kind::Clock => Self::Clock,
            Kind::Enumeration(_) => match version {
                FmiVersion::V2 => Self::Int32,
                FmiVersion::V3 => Self::Int64,
            },
        }
    }
}
