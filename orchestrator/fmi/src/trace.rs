//! Every call of every FMU in a text file, for finding out who is to blame.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use super::FmiVersion;
use super::call::{Call, Endpoint, Function, Lost, Scalar, Values};

/// A file that calls are written to, a line each.
#[derive(Debug)]
pub struct Trace(Mutex<BufWriter<File>>);

impl Trace {
    /// Makes the file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(Self(Mutex::new(BufWriter::new(File::create(path)?))))
    }

    /// What goes in; it is on the disk before the call is made, since the call may be the last.
    pub(super) fn begin(&self, instance: &str, version: FmiVersion, call: &Call) {
        let name = call.function.name(version);
        let mut line = format!("{instance} {name}(");
        line += &arguments(call, version);
        line += ")";
        self.write(&line, true);
    }

    /// What comes out.
    pub(super) fn end(&self, version: FmiVersion, call: &Call, outcome: &Result<i32, Lost>) {
        let mut line = match outcome {
            Ok(status) => format!(" -> {status}"),
            Err(Lost(reason)) => format!(" -> {reason}"),
        };
        if outcome.is_ok() {
            line += &given(call, version);
        }
        self.write(&(line + "\n"), false);
    }

    fn write(&self, text: &str, flush: bool) {
        let mut file = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A trace that cannot be written does not end a run.
        let _ = file.write_all(text.as_bytes());
        if flush {
            let _ = file.flush();
        }
    }
}

/// An instance whose calls are written down.
pub(super) struct Traced {
    pub instance: String,
    pub version: FmiVersion,
    pub endpoint: Box<dyn Endpoint>,
    pub trace: Arc<Trace>,
}

impl Endpoint for Traced {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        self.trace.begin(&self.instance, self.version, call);
        let outcome = self.endpoint.call(call);
        self.trace.end(self.version, call, &outcome);
        outcome
    }
}

fn arguments(call: &Call, version: FmiVersion) -> String {
    let [a, b, tolerance] = call.numbers;
    match call.function {
        Function::Get(_) => list(call.references),
        Function::Set(scalar) => {
            format!(
                "{}, {}",
                list(call.references),
                values(call, scalar, version)
            )
        }
        Function::SetupExperiment | Function::EnterInitializationMode => {
            let stop = if call.flags[0] {
                b.to_string()
            } else {
                "none".into()
            };
            let tolerance = if call.flags[1] {
                tolerance.to_string()
            } else {
                "none".into()
            };
            format!("start {a}, stop {stop}, tolerance {tolerance}")
        }
        Function::DoStep => format!("{a}, {b}"),
        Function::GetDirectionalDerivative | Function::GetAdjointDerivative => {
            let (unknowns, knowns) = call.references.split_at(call.unknowns());
            let seed = values(call, Scalar::Float64, version);
            format!("{}, {}, {seed}", list(unknowns), list(knowns))
        }
        Function::SetTime => a.to_string(),
        Function::SetContinuousStates => values(call, Scalar::Float64, version),
        Function::SetState | Function::FreeState | Function::SizeOfState | Function::WriteState => {
            format!("{:#x}", call.handle)
        }
        Function::ReadState => format!("{} bytes", call.count),
        Function::SetDebugLogging => {
            format!(
                "{}, {}",
                call.flags[0],
                values(call, Scalar::String, version)
            )
        }
        _ => String::new(),
    }
}

fn given(call: &Call, version: FmiVersion) -> String {
    let [a, ..] = call.numbers;
    match call.function {
        Function::Get(scalar) => format!(" {}", values(call, scalar, version)),
        Function::GetContinuousStates
        | Function::GetDerivatives
        | Function::GetEventIndicators
        | Function::GetNominals
        | Function::GetIntervalDecimal
        | Function::GetShiftDecimal => format!(" {}", values(call, Scalar::Float64, version)),
        Function::DoStep if version == FmiVersion::V3 => {
            let [event, terminate, early, ..] = call.flags;
            format!(" event {event}, terminate {terminate}, early {early}, last {a}")
        }
        Function::UpdateDiscreteStates => {
            let [again, terminate, nominals, states, defined] = call.flags;
            let next = if defined {
                a.to_string()
            } else {
                "none".to_string()
            };
            format!(
                " again {again}, terminate {terminate}, nominals changed {nominals}, \
                 states changed {states}, next event {next}"
            )
        }
        Function::CompletedIntegratorStep => {
            format!(" event {}, terminate {}", call.flags[0], call.flags[1])
        }
        Function::GetDirectionalDerivative | Function::GetAdjointDerivative => {
            format!(" {}", sensitivities(call))
        }
        Function::GetState | Function::ReadState => format!(" {:#x}", call.handle),
        Function::SizeOfState => format!(" {} bytes", call.handle),
        Function::GetTerminated => format!(" {}", call.flags[0]),
        Function::GetLastSuccessfulTime => format!(" {a}"),
        Function::GetNumberOfContinuousStates | Function::GetNumberOfEventIndicators => {
            format!(" {}", call.handle)
        }
        _ => String::new(),
    }
}

fn list(references: &[u32]) -> String {
    let all: Vec<String> = references.iter().map(u32::to_string).collect();
    format!("[{}]", all.join(" "))
}

fn values(call: &Call, scalar: Scalar, version: FmiVersion) -> String {
    let bytes: &[u8] = match &call.values {
        Values::In(bytes) => bytes,
        Values::Out(bytes) | Values::Both(bytes) => bytes,
        Values::TextsIn(texts) => return shown(texts),
        Values::TextsOut(texts) => return shown(texts),
        Values::None => return String::new(),
    };
    let size = scalar.size(version).max(1);
    let all: Vec<String> = bytes
        .chunks_exact(size)
        .take(call.count)
        .map(|bytes| super::convert::text(scalar, bytes))
        .collect();
    format!("[{}]", all.join(" "))
}

/// What comes out behind what goes in.
fn sensitivities(call: &Call) -> String {
    let Values::Both(bytes) = &call.values else {
        return String::new();
    };
    let all: Vec<String> = bytes
        .chunks_exact(8)
        .skip(call.count)
        .map(|bytes| super::convert::text(Scalar::Float64, bytes))
        .collect();
    format!("[{}]", all.join(" "))
}

fn shown(texts: &[Vec<u8>]) -> String {
    let all: Vec<String> = texts
        .iter()
        .map(|text| format!("\"{}\"", text.escape_ascii()))
        .collect();
    format!("[{}]", all.join(" "))
}
