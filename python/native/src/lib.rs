//! Simulations inside of another process, through a C interface without dependencies: it needs neither
//! headers nor a certain version of the language that calls it.
//!
//! A handle is made by [`sb_open`] and freed by [`sb_free`]. A function that can fail gives a negative
//! [`Status`], and [`sb_message`] says why. Texts and memory that are given belong to the handle; texts
//! are valid until its next call. A handle must not be used by two threads at once. A panic becomes
//! [`Status::Internal`], and the handle refuses every further call.
#![allow(unsafe_code, reason = "a C interface takes pointers")]

mod callback;
mod handle;
mod spec;

use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use callback::Callbacks;
use handle::{Fault, Handle};

/// What a call came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done; of a step: the simulation has ended.
    Done = 0,
    /// Another step may follow.
    More = 1,
    /// The input is at fault.
    Input = -1,
    /// It cannot be done.
    Failed = -2,
    /// A callback failed.
    Callback = -3,
    /// A fault of this library.
    Internal = -4,
}

/// A simulation with what is given back of it.
pub struct Session {
    handle: Option<Handle>,
    text: CString,
    bytes: Vec<u8>,
}

impl Session {
    fn say(&mut self, text: &str) -> *const c_char {
        self.text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        self.text.as_ptr()
    }
}

/// Carries out a call, with its panic caught.
///
/// # Safety
/// `session` is null or from [`sb_open`].
unsafe fn enter(
    session: *mut Session,
    call: impl FnOnce(&mut Handle) -> Result<Status, Fault>,
) -> c_int {
    // SAFETY: the caller gives a pointer from `sb_open` that nobody else uses now.
    let Some(session) = (unsafe { session.as_mut() }) else {
        return Status::Internal as c_int;
    };
    let Some(handle) = &mut session.handle else {
        return Status::Internal as c_int;
    };
    match catch_unwind(AssertUnwindSafe(|| call(handle))) {
        Ok(Ok(status)) => status as c_int,
        Ok(Err(fault)) => {
            session.say(&fault.reason);
            fault.status as c_int
        }
        Err(_) => {
            session.handle = None;
            session.say("a fault of this library; the simulation cannot be used any more");
            Status::Internal as c_int
        }
    }
}

/// A text of the caller's.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn read(text: *const c_char) -> Result<String, Fault> {
    if text.is_null() {
        return Err(Fault::input("no text is given"));
    }
    // SAFETY: as the caller promises.
    let text = unsafe { CStr::from_ptr(text) }.to_str();
    let text = text.map_err(|error| Fault::input(&error.to_string()))?;
    Ok(text.to_string())
}

/// Makes an empty handle; never null.
#[unsafe(no_mangle)]
pub extern "C" fn sb_open(callbacks: Callbacks) -> *mut Session {
    Box::into_raw(Box::new(Session {
        handle: Some(Handle::new(callbacks)),
        text: CString::default(),
        bytes: Vec::new(),
    }))
}

/// Frees a handle with all memory that was given of it.
///
/// # Safety
/// `session` is null or from [`sb_open`], and not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_free(session: *mut Session) {
    if !session.is_null() {
        // SAFETY: as the caller promises.
        let session = unsafe { Box::from_raw(session) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(session)));
    }
}

/// Why the last call failed.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_message(session: *mut Session) -> *const c_char {
    // SAFETY: as the caller promises.
    unsafe { session.as_ref() }.map_or(ptr::null(), |session| session.text.as_ptr())
}

/// Reads and checks a system (JSON).
///
/// # Safety
/// As [`sb_free`]; `spec` ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_prepare(session: *mut Session, spec: *const c_char) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, |handle| handle.prepare(&read(spec)?)) }
}

/// Loads and initializes it; the values at time 0 are known then.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_begin(session: *mut Session) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, Handle::begin) }
}

/// Steps so many times.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_step(session: *mut Session, steps: u64) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, |handle| handle.step(steps)) }
}

/// Steps to the end; `progress` is called with the time, s, about twenty times a second, and stops the
/// simulation where it does not give 0.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_play(
    session: *mut Session,
    progress: Option<extern "C" fn(f64) -> c_int>,
) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, |handle| handle.play(progress)) }
}

/// Ends the simulation and measures it.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_finish(session: *mut Session) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, Handle::finish) }
}

/// Writes the files of a run that has been finished into a folder.
///
/// # Safety
/// As [`sb_free`]; `folder` ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_write(session: *mut Session, folder: *const c_char) -> c_int {
    // SAFETY: as the caller promises.
    unsafe { enter(session, |handle| handle.write(&read(folder)?)) }
}

/// Time, s; not a number where there is no simulation.
///
/// # Safety
/// As [`sb_free`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_time(session: *mut Session) -> f64 {
    // SAFETY: as the caller promises.
    let session = unsafe { session.as_ref() };
    session
        .and_then(|session| session.handle.as_ref()?.time())
        .unwrap_or(f64::NAN)
}

/// A description (JSON): `functions`, `signals`, `ending`, `columns` or `summary`.
///
/// # Safety
/// As [`sb_free`]; `what` ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_describe(session: *mut Session, what: *const c_char) -> *const c_char {
    let mut text = String::new();
    // SAFETY: as the caller promises.
    let status = unsafe {
        enter(session, |handle| {
            text = handle.describe(&read(what)?)?;
            Ok(Status::Done)
        })
    };
    // SAFETY: as the caller promises.
    match unsafe { session.as_mut() } {
        Some(session) if status == Status::Done as c_int => session.say(&text),
        _ => ptr::null(),
    }
}

/// The present values, and their number: memory that each step rewrites.
///
/// # Safety
/// As [`sb_free`]; `count` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_signals(session: *mut Session, count: *mut usize) -> *const f64 {
    // SAFETY: as the caller promises.
    let session = unsafe { session.as_ref() };
    let Some(values) = session.and_then(|session| Some(session.handle.as_ref()?.signals())) else {
        return ptr::null();
    };
    // SAFETY: as the caller promises.
    unsafe { *count = values.len() };
    values.as_ptr()
}

/// The record of a run that has been finished, row by row, and its number of values: memory that does
/// not change until the handle is freed.
///
/// # Safety
/// As [`sb_free`]; `count` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_record(session: *mut Session, count: *mut usize) -> *const f64 {
    // SAFETY: as the caller promises.
    let session = unsafe { session.as_ref() };
    let Some(values) = session.and_then(|session| session.handle.as_ref()?.record()) else {
        return ptr::null();
    };
    // SAFETY: as the caller promises.
    unsafe { *count = values.len() };
    values.as_ptr()
}

/// The present state and its number of bytes; null where it cannot be saved.
///
/// # Safety
/// As [`sb_free`]; `count` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_save(session: *mut Session, count: *mut usize) -> *const u8 {
    let mut bytes = Vec::new();
    // SAFETY: as the caller promises.
    let status = unsafe {
        enter(session, |handle| {
            bytes = handle.save()?;
            Ok(Status::Done)
        })
    };
    // SAFETY: as the caller promises.
    let session = unsafe { session.as_mut() }.filter(|_| status == Status::Done as c_int);
    let Some(session) = session else {
        return ptr::null();
    };
    session.bytes = bytes;
    // SAFETY: as the caller promises.
    unsafe { *count = session.bytes.len() };
    session.bytes.as_ptr()
}

/// Goes to a saved state.
///
/// # Safety
/// As [`sb_free`]; `state` has `count` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn sb_restore(
    session: *mut Session,
    state: *const u8,
    count: usize,
) -> c_int {
    if state.is_null() {
        return Status::Internal as c_int;
    }
    // SAFETY: as the caller promises.
    let bytes = unsafe { std::slice::from_raw_parts(state, count) };
    // SAFETY: as the caller promises.
    unsafe { enter(session, |handle| handle.restore(bytes)) }
}
