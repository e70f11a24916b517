//! The importer's log, as either standard offers it.
#![allow(unsafe_code, reason = "the importer gives its logger as a C function")]

use std::ffi::{CStr, CString, c_char, c_void};

use crate::fault::Status;

/// The logger of FMI 2.0; the text after `message` is formatted as by `printf`.
pub type Fmi2Logger = unsafe extern "C" fn(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: i32,
    category: *const c_char,
    message: *const c_char,
    ...
);

/// The logger of FMI 3.0.
pub type Fmi3Logger = unsafe extern "C" fn(
    environment: *mut c_void,
    status: i32,
    category: *const c_char,
    message: *const c_char,
);

/// Where messages go.
#[derive(Clone, Copy)]
pub enum Sink {
    /// The importer gave no logger.
    None,
    /// An importer of FMI 2.0.
    Fmi2(Fmi2Logger, *mut c_void),
    /// An importer of FMI 3.0.
    Fmi3(Fmi3Logger, *mut c_void),
}

/// The log categories, as both model descriptions list them.
pub const CATEGORIES: [(&CStr, &str); 3] = [
    (
        c"logStatusError",
        "Calls that were refused or failed, always on",
    ),
    (
        c"logStatusWarning",
        "Calls that were carried out but deserve a word, always on",
    ),
    (c"logEvents", "Changes of phase, when debug logging is on"),
];

/// A log category that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a log category")]
pub struct UnknownCategory(pub String);

/// An instance's log.
pub struct Log {
    sink: Sink,
    instance_name: CString,
    events: bool,
}

impl Log {
    /// A log that speaks in the name of an instance.
    pub fn new(sink: Sink, instance_name: &CStr, debug: bool) -> Self {
        Self {
            sink,
            instance_name: instance_name.into(),
            events: debug,
        }
    }

    /// Switches debug logging of some categories (all if none is named) on or off.
    ///
    /// # Errors
    /// Names a category that does not exist.
    pub fn set_debug(&mut self, on: bool, categories: &[&CStr]) -> Result<(), UnknownCategory> {
        let events = CATEGORIES[2].0;
        for category in categories {
            if *category != c"logAll" && !CATEGORIES.iter().any(|(name, _)| name == category) {
                return Err(UnknownCategory(category.to_string_lossy().into_owned()));
            }
        }
        let named = categories.iter().any(|c| *c == events || *c == c"logAll");
        if categories.is_empty() || named {
            self.events = on;
        }
        Ok(())
    }

    /// Logs a change of phase if debug logging is on.
    pub fn event(&self, message: &str) {
        if self.events {
            self.send(Status::Ok, CATEGORIES[2].0, message);
        }
    }

    /// Logs a refusal, failure or warning.
    pub fn fault(&self, status: Status, message: &str) {
        let category = if status == Status::Warning {
            CATEGORIES[1].0
        } else {
            CATEGORIES[0].0
        };
        self.send(status, category, message);
    }

    fn send(&self, status: Status, category: &CStr, message: &str) {
        match self.sink {
            Sink::None => {}
            Sink::Fmi2(logger, environment) => {
                let text = c_text(&message.replace('%', "%%"));
                // SAFETY: the importer's logger and environment, given at instantiation, are
                // valid while the instance lives; the strings outlive the call, and the message
                // holds no conversion, so no further argument is read.
                unsafe {
                    logger(
                        environment,
                        self.instance_name.as_ptr(),
                        status as i32,
                        category.as_ptr(),
                        text.as_ptr(),
                    );
                }
            }
            Sink::Fmi3(logger, environment) => {
                let text = c_text(message);
                // SAFETY: as above.
                unsafe { logger(environment, status as i32, category.as_ptr(), text.as_ptr()) }
            }
        }
    }
}

/// A C string of the text; bytes that it cannot hold are left out.
pub fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    type Lines = Mutex<Vec<(i32, String, String)>>;

    unsafe extern "C" fn note(
        environment: *mut c_void,
        status: i32,
        category: *const c_char,
        message: *const c_char,
    ) {
        // SAFETY: the environment of `log` and two C strings.
        let (lines, category, message) = unsafe {
            (
                &*environment.cast::<Lines>(),
                CStr::from_ptr(category),
                CStr::from_ptr(message),
            )
        };
        let line = |text: &CStr| text.to_str().unwrap().to_string();
        lines
            .lock()
            .unwrap()
            .push((status, line(category), line(message)));
    }

    fn log(lines: &Lines, debug: bool) -> Log {
        let environment = std::ptr::from_ref(lines).cast_mut().cast();
        Log::new(Sink::Fmi3(note, environment), c"it", debug)
    }

    #[test]
    fn faults_are_always_logged_and_events_when_asked_for() {
        let lines = Lines::default();
        let mut log = log(&lines, false);
        log.event("unheard");
        log.fault(Status::Warning, "a 100 % word");
        log.fault(Status::Error, "refused");
        log.set_debug(true, &[]).unwrap();
        log.event("one");
        log.set_debug(false, &[c"logEvents"]).unwrap();
        log.event("unheard");
        log.set_debug(true, &[c"logAll"]).unwrap();
        log.event("two");
        // Another category leaves the events as they are.
        log.set_debug(false, &[c"logStatusError"]).unwrap();
        log.event("three");
        let line = |status: Status, category: &str, message: &str| {
            (status as i32, category.to_string(), message.to_string())
        };
        assert_eq!(
            *lines.lock().unwrap(),
            [
                line(Status::Warning, "logStatusWarning", "a 100 % word"),
                line(Status::Error, "logStatusError", "refused"),
                line(Status::Ok, "logEvents", "one"),
                line(Status::Ok, "logEvents", "two"),
                line(Status::Ok, "logEvents", "three"),
            ]
        );
    }

    #[test]
    fn an_unknown_category_is_refused_by_name_and_changes_nothing() {
        let lines = Lines::default();
        let mut log = log(&lines, true);
        let error = log.set_debug(false, &[c"logEvents", c"logNothing"]);
        let told = error.unwrap_err().to_string();
        assert_eq!(told, "`logNothing` is not a log category");
        log.event("still");
        assert_eq!(lines.lock().unwrap().len(), 1);
    }
}
