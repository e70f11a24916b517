//! Functions for an FMU's state, which are the same in FMI 2.0 and 3.0 but for their names.

use std::ffi::{c_int, c_void};

use super::super::FmiVersion;
use super::super::call::{Call, Function, Lost};
use super::library::Functions;
use super::{Handle, missing, pointer};

type Get = unsafe extern "C" fn(*mut c_void, *mut *mut c_void) -> c_int;
type Set = unsafe extern "C" fn(*mut c_void, *mut c_void) -> c_int;
type Size = unsafe extern "C" fn(*mut c_void, *mut c_void, *mut usize) -> c_int;
type Write = unsafe extern "C" fn(*mut c_void, *mut c_void, *mut c_void, usize) -> c_int;
type Read = unsafe extern "C" fn(*mut c_void, *mut c_void, usize, *mut *mut c_void) -> c_int;

/// The functions; few FMUs have all of them.
pub(super) struct StateFunctions {
    get: Option<Get>,
    set: Option<Set>,
    free: Option<Get>,
    size: Option<Size>,
    write: Option<Write>,
    read: Option<Read>,
}

impl StateFunctions {
    /// Those of the library.
    pub(super) fn of(functions: &Functions, version: FmiVersion) -> Self {
        let name = |function: Function| {
            let name = function.name(version);
            name[version.folder().len()..].to_string()
        };
        // SAFETY: the types are those of the standard's headers.
        unsafe {
            Self {
                get: functions.optional(&name(Function::GetState)),
                set: functions.optional(&name(Function::SetState)),
                free: functions.optional(&name(Function::FreeState)),
                size: functions.optional(&name(Function::SizeOfState)),
                write: functions.optional(&name(Function::WriteState)),
                read: functions.optional(&name(Function::ReadState)),
            }
        }
    }

    /// Carries out a call that concerns the state of an instance; none where it is another call.
    ///
    /// # Safety
    /// The instance lives, its state in the call is one of its own, and the values are as long as the
    /// call says.
    pub(super) unsafe fn carry_out(
        &self,
        call: &mut Call,
        instance: &Handle,
    ) -> Option<Result<i32, Lost>> {
        let c = instance.0;
        let mut state = call.handle as usize as *mut c_void;
        // SAFETY: the caller's.
        let status = unsafe {
            match call.function {
                Function::GetState => self.get.map(|get| get(c, &raw mut state)),
                Function::SetState => self.set.map(|set| set(c, state)),
                Function::FreeState => self.free.map(|free| {
                    let status = free(c, &raw mut state);
                    state = std::ptr::null_mut();
                    status
                }),
                Function::SizeOfState => self.size.map(|size_of| {
                    let mut size = 0;
                    let status = size_of(c, state, &raw mut size);
                    call.handle = size as u64;
                    status
                }),
                Function::WriteState => self
                    .write
                    .map(|write| write(c, state, pointer(&mut call.values), call.count)),
                Function::ReadState => self.read.map(|read| {
                    state = std::ptr::null_mut();
                    read(c, pointer(&mut call.values), call.count, &raw mut state)
                }),
                _ => return None,
            }
        };
        if matches!(
            call.function,
            Function::GetState | Function::FreeState | Function::ReadState
        ) {
            call.handle = state as usize as u64;
        }
        Some(status.ok_or_else(missing))
    }
}
