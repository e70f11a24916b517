//! What FMUs in this process print: it goes where messages go, since the standard output is for
//! results.

use std::io::Write;
use std::sync::{Mutex, PoisonError};

/// While there is one, the standard output of this process is its standard error.
#[derive(Debug)]
pub struct Diverted(());

/// How many there are, and the true standard output.
static DIVERTED: Mutex<(usize, i32)> = Mutex::new((0, -1));

impl Diverted {
    /// Diverts the standard output.
    #[expect(clippy::new_without_default, reason = "it does something")]
    pub fn new() -> Self {
        let mut state = DIVERTED.lock().unwrap_or_else(PoisonError::into_inner);
        if state.0 == 0 {
            let _ = std::io::stdout().flush();
            state.1 = divert();
        }
        state.0 += 1;
        Self(())
    }
}

impl Drop for Diverted {
    fn drop(&mut self) {
        let mut state = DIVERTED.lock().unwrap_or_else(PoisonError::into_inner);
        state.0 -= 1;
        if state.0 == 0 {
            let _ = std::io::stdout().flush();
            restore(state.1);
        }
    }
}

#[cfg(unix)]
fn divert() -> i32 {
    // SAFETY: descriptors of this process.
    unsafe {
        let saved = libc::fcntl(1, libc::F_DUPFD_CLOEXEC, 3);
        if saved >= 0 {
            libc::dup2(2, 1);
        }
        saved
    }
}

#[cfg(unix)]
fn restore(saved: i32) {
    if saved < 0 {
        return;
    }
    // SAFETY: descriptors of this process; what C still keeps of the FMUs' output is written first.
    unsafe {
        libc::fflush(std::ptr::null_mut());
        libc::dup2(saved, 1);
        libc::close(saved);
    }
}

#[cfg(not(unix))]
fn divert() -> i32 {
    -1
}

#[cfg(not(unix))]
fn restore(_saved: i32) {}
