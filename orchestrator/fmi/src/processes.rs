//! Which process an instance lives in.

use std::collections::HashSet;
use std::fmt::Display;
use std::sync::{Arc, Mutex};

use super::error::InstanceError;
use super::isolation::Host;
use super::native::{self, printing::Diverted};
use super::{Fmu, FmuError, Isolation, Options};

/// The processes of the FMUs of a system: this one, one for all FMUs that are kept apart from it,
/// and one each for those that must be alone.
pub struct Processes<'a> {
    options: &'a Options,
    shared: Option<Place>,
    /// FMUs of which a process takes one instance only and that have one, by their checksum: in
    /// this process, and in the shared one.
    taken: [HashSet<String>; 2],
    /// What foreign FMUs in this process print does not go among the results.
    diverted: Option<Diverted>,
}

/// A guest process, or this one.
pub(super) type Place = Arc<Mutex<Host>>;

impl<'a> Processes<'a> {
    /// No process yet but this one.
    pub fn new(options: &'a Options) -> Self {
        Self {
            options,
            shared: None,
            taken: [HashSet::new(), HashSet::new()],
            diverted: None,
        }
    }

    /// How FMUs are run.
    pub(super) fn options(&self) -> &Options {
        self.options
    }

    /// The process for an instance of `fmu`; `alone` where its end must not take others along.
    ///
    /// # Errors
    /// No process can be started.
    pub(super) fn place(&mut self, fmu: &Fmu, alone: bool) -> Result<Option<Place>, InstanceError> {
        let apart = match self.options.isolation {
            Isolation::All => true,
            Isolation::Foreign => !fmu.is_own,
            Isolation::None => false,
        };
        let is_single = fmu.description.only_one_per_process;
        let is_new = !is_single || self.taken[usize::from(apart)].insert(fmu.sha256.clone());
        if !apart && is_new {
            native::report_exits();
            if !fmu.is_own && self.diverted.is_none() {
                self.diverted = Some(Diverted::new());
            }
            return Ok(None);
        }
        if !apart || alone || !is_new {
            return self.start().map(Some);
        }
        if self.shared.is_none() {
            self.shared = Some(self.start()?);
        }
        Ok(self.shared.clone())
    }

    /// To be kept for as long as the instances live.
    pub fn diverted(self) -> Option<Diverted> {
        self.diverted
    }

    fn start(&self) -> Result<Place, InstanceError> {
        let Some(program) = &self.options.guest else {
            return Err(InstanceError::NoGuest);
        };
        let host = Host::start(program, self.options.call_limit)?;
        Ok(Arc::new(Mutex::new(host)))
    }
}

/// What to do where a library takes Python's functions from whoever loads it, as PythonFMU's does.
const PYTHON: &str = "it runs Python, whose library must be loaded before it: set LD_PRELOAD to \
    the file that `python3 -c \"import sysconfig as s; \
                      print(s.get_config_var('LIBDIR') + '/' + s.get_config_var('INSTSONAME'))\"` prints";

/// Whether a library could not be loaded for want of Python's.
fn lacks_python(reason: &str) -> bool {
    ["undefined symbol: Py", "undefined symbol: _Py"]
        .iter()
        .any(|symbol| reason.contains(symbol))
}

/// Wraps the reason why an instance cannot be made.
pub(super) fn refused(fmu: &Fmu, instance: &str, reason: impl Display) -> FmuError {
    let mut reason = reason.to_string();
    let description = &fmu.description;
    if lacks_python(&reason) {
        reason += &format!("; {PYTHON}");
    } else if description.needs_execution_tool {
        reason += &format!(
            "; it needs its tool installed ({})",
            description.generation_tool
        );
    }
    FmuError::Instantiation {
        fmu: fmu.path.clone(),
        instance: instance.to_string(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_lacks_python_is_told_from_others() {
        for (reason, lacks) in [
            ("own.so: undefined symbol: PyFloat_Type", true),
            ("own.so: undefined symbol: _Py_NoneStruct", true),
            ("own.so: undefined symbol: sqrt", false),
        ] {
            assert_eq!(lacks_python(reason), lacks);
        }
    }
}
