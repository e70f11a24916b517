//! A call on its way to the FMU, and what its status means.

use super::super::call::{Call, Function, Lost, Scalar};
use super::super::messages::STATUS;
use super::super::native::FATAL;
use super::super::{CallError, FmiVersion, Kind};
use super::{Instance, Outcome, Phase};

impl Instance {
    pub(super) fn version(&self) -> FmiVersion {
        self.fmu.description.version
    }

    #[inline]
    pub(super) fn scalar(&self, kind: &Kind) -> Scalar {
        Scalar::of(kind, self.version())
    }

    pub(super) fn plain(&mut self, function: Function) -> Outcome {
        self.call(&mut Call::plain(function))
    }

    #[inline]
    pub(super) fn call(&mut self, call: &mut Call) -> Outcome {
        let outcome = self.carry_out(call);
        match outcome {
            // 0 is OK, 1 a warning: its message is kept and the run goes on.
            Ok(0 | 1) => Ok(()),
            outcome => self.judge(outcome, call),
        }
    }

    #[inline]
    pub(super) fn carry_out(&mut self, call: &mut Call) -> Result<i32, Lost> {
        self.endpoint.call(call)
    }

    /// An outcome that is neither OK nor a warning.
    #[cold]
    pub(super) fn judge(&mut self, outcome: Result<i32, Lost>, call: &Call) -> Outcome {
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
    pub(super) fn failure(
        &self,
        function: Function,
        references: &[u32],
        outcome: String,
    ) -> Box<CallError> {
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
            may_be_of_the_step: false,
            messages: messages.into_iter().map(|message| message.text).collect(),
        })
    }
}

/// A status as a clause.
pub(super) fn words(status: i32) -> String {
    let known = usize::try_from(status).ok();
    match known.and_then(|status| STATUS.get(status)) {
        Some(name) => format!("returned {name}"),
        None => format!("returned {status}, which is not a status of the standard"),
    }
}

const _: () = assert!(FATAL == 4, "the fifth of `STATUS`");
