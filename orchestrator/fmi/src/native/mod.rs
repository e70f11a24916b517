//! FMUs' libraries in this process: the C interfaces of FMI 2.0 and 3.0 on `libloading`.
//!
//! Statuses are plain integers here, whatever an FMU returns; texts may be null; what an FMU is
//! given to keep (callbacks, environment) lives on the heap until the instance is freed.
#![allow(unsafe_code, reason = "functions of a library are called")]

mod callbacks;
mod events;
mod exchange;
mod floating;
mod fmi2;
mod fmi3;
mod kept_states;
mod library;
pub(super) mod printing;
mod state;

use std::ffi::{CString, c_char, c_void};
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::FmiVersion;
use super::call::{Call, Endpoint, Lost, Texts, Values};
use super::error::InstanceError;

pub(super) use events::{Events, WithEvents};

/// Where an instance's messages go.
pub(super) trait Sink: Send + Sync {
    /// An FMU logged a text with a status, whatever number it is.
    fn message(&self, status: i32, category: &str, text: &str);
}

/// What an instance is made as.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum Mode {
    /// It steps itself.
    CoSimulation {
        /// FMI 3.0: its events are handled outside of it, if it has event mode.
        events: Option<Events>,
        /// They are handled on the other side, which shall see every call.
        elsewhere: bool,
    },
    /// It gives derivatives and is stepped by a solver.
    ModelExchange {
        /// Continuous states (FMI 2.0).
        states: usize,
        /// Event indicators (FMI 2.0).
        indicators: usize,
        /// Value references of states and their derivatives, where it gives directional derivatives.
        pairs: Vec<(u32, u32)>,
    },
}

/// What is needed to make an instance.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Setup {
    pub version: FmiVersion,
    pub library: PathBuf,
    /// The unpacked FMU's `resources`.
    pub resources: PathBuf,
    pub name: String,
    /// GUID or instantiation token.
    pub token: String,
    pub mode: Mode,
    pub logging: bool,
}

/// Status codes that are treated apart; the numbers are the same in both versions.
pub(super) const FATAL: i32 = 4;
pub(super) const DISCARD: i32 = 2;

/// Loads the library and makes an instance.
///
/// # Errors
/// The loader's reason, functions that are missing, or an FMU that refuses.
pub(super) fn instantiate(
    setup: &Setup,
    sink: Arc<dyn Sink>,
) -> Result<Box<dyn Endpoint>, InstanceError> {
    let events_sink = sink.clone();
    let endpoint = match setup.version {
        FmiVersion::V2 => {
            fmi2::Fmi2::new(setup, sink).map(|fmu| Box::new(fmu) as Box<dyn Endpoint>)
        }
        FmiVersion::V3 => {
            fmi3::Fmi3::new(setup, sink).map(|fmu| Box::new(fmu) as Box<dyn Endpoint>)
        }
    };
    leave();
    let endpoint = endpoint?;
    Ok(match &setup.mode {
        Mode::CoSimulation {
            events: Some(events),
            elsewhere: false,
        } => Box::new(WithEvents::new(endpoint, events.clone(), events_sink)),
        Mode::CoSimulation { .. } => endpoint,
        Mode::ModelExchange {
            states,
            indicators,
            pairs,
        } => {
            let counts = setup.version == FmiVersion::V3;
            let sizes = (*states, *indicators);
            Box::new(exchange::Stepped::new(endpoint, counts, sizes, pairs))
        }
    })
}

/// Loads a library and does nothing with it; none where it cannot be loaded, which an instance will say.
pub(super) fn hold(path: &std::path::Path) -> Option<libloading::Library> {
    library::Functions::load(path, "").ok()?.finish().ok()
}

/// What an instance must not outlive.
struct Kept {
    // It goes first: its end may log.
    _library: libloading::Library,
    _callbacks: Option<Box<callbacks::Callbacks>>,
    environment: callbacks::Environment,
}

/// Before a call of an FMU.
#[inline]
fn enter(kept: Option<&Kept>) {
    if let Some(kept) = kept {
        kept.environment.enter();
    }
}

/// After a call of an FMU: what it did to this thread is undone.
#[inline]
fn leave() {
    floating::restore();
    callbacks::leave();
}

/// A handle of C that moves between threads, one call at a time.
struct Handle(*mut c_void);

// SAFETY: the standard lets an instance be called from any thread as long as calls do not overlap,
// and a handle is reached through `&mut` only.
unsafe impl Send for Handle {}
// SAFETY: callbacks and environment are not changed while an instance lives.
unsafe impl Send for Kept {}

/// An FMU that ends this process ends it with a status that is not 0.
pub(super) fn report_exits() {
    callbacks::report_exits();
}

/// Lets what FMUs print through C come out line by line.
pub(super) fn print_by_the_line() {
    // SAFETY: it only sets how the standard output is buffered.
    unsafe { callbacks::shakebench_print_by_the_line() }
}

fn text_for_c(text: &str) -> Result<CString, InstanceError> {
    CString::new(text).map_err(|_| InstanceError::Zero(text.to_string()))
}

/// The first of the values, in the layout of C.
fn pointer(values: &mut Values) -> *mut c_void {
    match values {
        Values::Out(bytes) | Values::Both(bytes) => bytes.as_mut_ptr().cast(),
        Values::In(bytes) => bytes.as_ptr().cast_mut().cast(),
        _ => std::ptr::null_mut(),
    }
}

/// Where `given` numbers go into a derivative, and where the `sought` ones behind them come out; none
/// where the call has other values.
fn derivative(call: &mut Call, given: usize, sought: usize) -> Option<(*const f64, *mut f64)> {
    let Values::Both(bytes) = &mut call.values else {
        return None;
    };
    let numbers: &mut [f64] = bytemuck::try_cast_slice_mut(bytes).ok()?;
    let (seed, sensitivity) = numbers.split_at_mut_checked(given)?;
    (sensitivity.len() == sought).then_some((seed.as_ptr(), sensitivity.as_mut_ptr()))
}

fn missing() -> Lost {
    Lost("is not in the library".to_string())
}

/// Carries out a call with texts as C has them.
fn with_strings(texts: &Texts, call: impl FnOnce(&[*const c_char]) -> i32) -> Result<i32, Lost> {
    let owned = texts.iter().map(|text| CString::new(text.as_slice()));
    let owned: Result<Vec<CString>, _> = owned.collect();
    let owned = owned.map_err(|_| Lost("cannot take a text with a zero in it".to_string()))?;
    let pointers: Vec<_> = owned.iter().map(|text| text.as_ptr()).collect();
    Ok(call(&pointers))
}

/// Copies texts that an FMU gave; a null is an empty one.
///
/// # Safety
/// Each is null or ends with a zero.
unsafe fn copy_strings(pointers: &[*const c_char], texts: &mut Texts) {
    texts.clear();
    texts.extend(pointers.iter().map(|&text| {
        if text.is_null() {
            return Vec::new();
        }
        // SAFETY: the caller's.
        unsafe { std::ffi::CStr::from_ptr(text) }
            .to_bytes()
            .to_vec()
    }));
}

/// The function of a call is none of this version.
fn unknown(call: &Call, version: FmiVersion) -> Lost {
    Lost(format!(
        "({:?}) is no function of FMI {version}",
        call.function
    ))
}
