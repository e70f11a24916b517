//! A function of the caller's in place of a component.

use std::ffi::c_int;

use fmi_import::{Behaviour, BehaviourError};

/// Functions of the caller's. Each takes the number of a component and gives 0 where it went well.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Callbacks {
    /// Time, step, inputs, outputs.
    pub step: extern "C" fn(u32, f64, f64, *const f64, *mut f64) -> c_int,
    /// Gives the number of bytes of the state, or a negative number; then
    /// [`Callbacks::write`] is called with room for them.
    pub save: extern "C" fn(u32) -> i64,
    /// Writes the state that was saved.
    pub write: extern "C" fn(u32, *mut u8) -> c_int,
    /// Takes a state of so many bytes.
    pub restore: extern "C" fn(u32, *const u8, u64) -> c_int,
}

/// The component of that number.
pub struct Callback {
    pub number: u32,
    pub callbacks: Callbacks,
}

/// The caller keeps the reason.
const RAISED: &str = "raised an exception";

fn done(status: c_int) -> Result<(), BehaviourError> {
    match status {
        0 => Ok(()),
        _ => Err(RAISED.into()),
    }
}

impl Behaviour for Callback {
    fn step(
        &mut self,
        time: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        let (inputs, outputs) = (inputs.as_ptr(), outputs.as_mut_ptr());
        done((self.callbacks.step)(
            self.number,
            time,
            step,
            inputs,
            outputs,
        ))
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        let count = (self.callbacks.save)(self.number);
        let count = usize::try_from(count).map_err(|_| RAISED)?;
        let mut state = vec![0; count];
        done((self.callbacks.write)(self.number, state.as_mut_ptr()))?;
        Ok(state)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        let (bytes, count) = (state.as_ptr(), state.len() as u64);
        done((self.callbacks.restore)(self.number, bytes, count))
    }
}
