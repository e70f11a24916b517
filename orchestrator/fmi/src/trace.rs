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

#[cfg(test)]
mod tests {
    use super::*;

    /// What a call is answered with.
    type Answer = fn(&mut Call) -> Result<i32, Lost>;

    struct Answers(Answer);

    impl Endpoint for Answers {
        fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
            (self.0)(call)
        }
    }

    fn answer(call: &mut Call) -> Result<i32, Lost> {
        (call.numbers, call.handle) = ([0.5, 0.0, 0.0], 255);
        call.flags = [true, false, true, false, true];
        if let Values::Out(bytes) | Values::Both(bytes) = &mut call.values {
            let last = bytes.len() - 8;
            bytes[last..].copy_from_slice(&2.5_f64.to_ne_bytes());
        }
        Ok(1)
    }

    /// The line of a call.
    fn line(version: FmiVersion, call: &mut Call, answer: Answer) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.txt");
        let trace = Arc::new(Trace::create(&path).unwrap());
        let mut traced = Traced {
            instance: "one".to_string(),
            version,
            endpoint: Box::new(Answers(answer)),
            trace,
        };
        let _ = traced.call(call);
        drop(traced);
        std::fs::read_to_string(&path).unwrap()
    }

    #[test]
    fn a_call_is_a_line_with_what_goes_in_and_what_comes_out() {
        use FmiVersion::{V2, V3};
        use Function as F;
        for (version, function, expected) in [
            (
                V2,
                F::SetupExperiment,
                "fmi2SetupExperiment(start 3, stop 4, tolerance none) -> 1",
            ),
            (
                V3,
                F::EnterInitializationMode,
                "fmi3EnterInitializationMode(start 3, stop 4, tolerance none) -> 1",
            ),
            (V2, F::DoStep, "fmi2DoStep(3, 4) -> 1"),
            (
                V3,
                F::DoStep,
                "fmi3DoStep(3, 4) -> 1 event true, terminate false, early true, last 0.5",
            ),
            (V2, F::SetTime, "fmi2SetTime(3) -> 1"),
            (
                V3,
                F::UpdateDiscreteStates,
                "fmi3UpdateDiscreteStates() -> 1 again true, terminate false, nominals changed true, \
                 states changed false, next event 0.5",
            ),
            (
                V2,
                F::CompletedIntegratorStep,
                "fmi2CompletedIntegratorStep() -> 1 event true, terminate false",
            ),
            (V3, F::GetState, "fmi3GetFMUState() -> 1 0xff"),
            (V2, F::SetState, "fmi2SetFMUstate(0x10) -> 1"),
            (V2, F::FreeState, "fmi2FreeFMUstate(0x10) -> 1"),
            (
                V3,
                F::SizeOfState,
                "fmi3SerializedFMUStateSize(0x10) -> 1 255 bytes",
            ),
            (
                V3,
                F::ReadState,
                "fmi3DeserializeFMUState(7 bytes) -> 1 0xff",
            ),
            (V2, F::GetTerminated, "fmi2GetBooleanStatus() -> 1 true"),
            (V2, F::GetLastSuccessfulTime, "fmi2GetRealStatus() -> 1 0.5"),
            (
                V3,
                F::GetNumberOfContinuousStates,
                "fmi3GetNumberOfContinuousStates() -> 1 255",
            ),
            (V3, F::Terminate, "fmi3Terminate() -> 1"),
        ] {
            let mut call = Call::plain(function);
            (call.numbers, call.handle, call.count) = ([3.0, 4.0, 1e-3], 16, 7);
            call.flags[0] = true;
            let found = line(version, &mut call, answer);
            assert_eq!(found, format!("one {expected}\n"));
        }
        let mut call = Call::plain(F::EnterInitializationMode);
        (call.numbers, call.flags[1]) = ([0.0, 4.0, 1e-3], true);
        let found = line(V3, &mut call, |_| Err(Lost("is gone".to_string())));
        let expected =
            "one fmi3EnterInitializationMode(start 0, stop none, tolerance 0.001) -> is gone\n";
        assert_eq!(found, expected);
    }

    #[test]
    fn values_of_a_call_are_written_by_their_type() {
        use FmiVersion::{V2, V3};
        let numbers = [1.5_f64, -2.0, 0.0];
        let bytes = bytemuck::cast_slice(&numbers);
        let texts = vec![b"a\"b".to_vec(), Vec::new()];
        let whole = [1_u32, 0];
        for (version, function, values, count, expected) in [
            (
                V2,
                Function::Set(Scalar::Float64),
                Values::In(&bytes[..16]),
                2,
                "fmi2SetReal([4 9], [1.5 -2]) -> 1",
            ),
            (
                V3,
                Function::SetContinuousStates,
                Values::In(&bytes[..8]),
                1,
                "fmi3SetContinuousStates([1.5]) -> 1",
            ),
            (
                V2,
                Function::Set(Scalar::Boolean),
                Values::In(bytemuck::cast_slice(&whole)),
                2,
                "fmi2SetBoolean([4 9], [1 0]) -> 1",
            ),
            (
                V3,
                Function::Set(Scalar::String),
                Values::TextsIn(&texts),
                2,
                "fmi3SetString([4 9], [\"a\\\"b\" \"\"]) -> 1",
            ),
            (
                V3,
                Function::SetDebugLogging,
                Values::TextsIn(&texts[1..].to_vec()),
                1,
                "fmi3SetDebugLogging(false, [\"\"]) -> 1",
            ),
        ] {
            let mut call = Call::plain(function);
            (call.references, call.values, call.count) = (&[4, 9], values, count);
            assert_eq!(
                line(version, &mut call, answer),
                format!("one {expected}\n")
            );
        }
        for (function, count, expected) in [
            (
                Function::Get(Scalar::Float64),
                2,
                "fmi3GetFloat64([4 9]) -> 1 [1.5 2.5]",
            ),
            (
                Function::GetDerivatives,
                2,
                "fmi3GetContinuousStateDerivatives() -> 1 [1.5 2.5]",
            ),
            (
                Function::GetIntervalDecimal,
                2,
                "fmi3GetIntervalDecimal() -> 1 [1.5 2.5]",
            ),
        ] {
            let mut own = numbers;
            let mut call = Call::plain(function);
            (call.references, call.count) = (&[4, 9], count);
            call.values = Values::Out(bytemuck::cast_slice_mut(&mut own[..2]));
            assert_eq!(line(V3, &mut call, answer), format!("one {expected}\n"));
        }
        let mut own = numbers;
        let mut call = Call::plain(Function::GetDirectionalDerivative);
        (call.references, call.count, call.handle) = (&[4, 9, 6], 2, 1);
        call.values = Values::Both(bytemuck::cast_slice_mut(&mut own));
        let expected = "one fmi3GetDirectionalDerivative([4], [9 6], [1.5 -2]) -> 1 [2.5]\n";
        assert_eq!(line(V3, &mut call, answer), expected);
    }
}
