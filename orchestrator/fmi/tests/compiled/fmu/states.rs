//! States that are kept and written.

use std::ffi::{c_int, c_void};

use super::model::*;
use super::own;

macro_rules! states {
    ($get:literal, $set:literal, $free:literal, $size:literal, $write:literal, $read:literal, $module:ident) => {
        mod $module {
            use super::*;
            shared! {
                $get => get(c, state: *mut *mut State) {
                    // What was kept there before is replaced.
                    match unsafe { (*state).as_mut() } {
                        Some(old) => *old = c.now,
                        None => unsafe { *state = Box::into_raw(Box::new(c.now)) },
                    }
                    OK
                }
                $set => set(c, state: *mut State) {
                    c.now = unsafe { *state };
                    OK
                }
                $free => free(c, state: *mut *mut State) {
                    drop(unsafe { Box::from_raw(*state) });
                    unsafe { *state = std::ptr::null_mut() };
                    (c.log)(OK, "FreeState");
                    OK
                }
                $size => size_of(_c, _state: *mut State, size: *mut usize) {
                    unsafe { *size = BYTES };
                    OK
                }
                $write => write(_c, state: *mut State, bytes: *mut u8, count: usize) {
                    if count != BYTES { return ERROR }
                    unsafe { state.cast::<u8>().copy_to(bytes, BYTES) };
                    OK
                }
                $read => read(_c, bytes: *const u8, count: usize, state: *mut *mut State) {
                    if count != BYTES { return ERROR }
                    let read = unsafe { bytes.cast::<State>().read_unaligned() };
                    unsafe { *state = Box::into_raw(Box::new(read)) };
                    OK
                }
            }
        }
    };
}
states!(
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
    "fmi2DeSerializeFMUstate",
    states_of_two
);
states!(
    "fmi3GetFMUState",
    "fmi3SetFMUState",
    "fmi3FreeFMUState",
    "fmi3SerializedFMUStateSize",
    "fmi3SerializeFMUState",
    "fmi3DeserializeFMUState",
    states_of_three
);
