//! Ctrl-C and SIGTERM: a run ends where it is and saves what it has. A second one ends the program.
#![allow(unsafe_code, reason = "a handler is given to the system")]

use std::sync::atomic::AtomicBool;

/// Whether the program was asked to end.
static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on, Ctrl-C and SIGTERM are noted here; a second one ends the program at once.
pub(super) fn heed() -> &'static AtomicBool {
    #[cfg(unix)]
    {
        extern "C" fn note(_signal: libc::c_int) {
            ASKED.store(true, std::sync::atomic::Ordering::Relaxed);
        }
        for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
            // SAFETY: the structure is plain data, and the handler does nothing but store a flag.
            unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                action.sa_sigaction = note as extern "C" fn(libc::c_int) as libc::sighandler_t;
                // The first one takes the handler away again; slow calls go on.
                action.sa_flags = libc::SA_RESETHAND | libc::SA_RESTART;
                libc::sigaction(signal, &raw const action, std::ptr::null_mut());
            }
        }
    }
    &ASKED
}

/// A limit of the size of files is an error of the write that exceeds it and does not end the program.
pub(super) fn survive_full_disks() {
    #[cfg(unix)]
    // SAFETY: the signal is ignored; no handler runs.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}
