//! What goes to standard output and standard error: nothing panics when nobody reads it, and nothing
//! that a file or an FMU says steers the terminal.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether something could not be written for another reason than that nobody reads it.
static FAILED: AtomicBool = AtomicBool::new(false);

/// Whether standard output could not be written.
pub(super) fn has_failed() -> bool {
    FAILED.load(Ordering::Relaxed)
}

/// Writes a text to standard output.
pub(super) fn out(text: Arguments, end: &str) {
    if let Err(error) = io::stdout().lock().write_all(shown(text, end).as_bytes())
        && error.kind() != ErrorKind::BrokenPipe
        && !FAILED.swap(true, Ordering::Relaxed)
    {
        err(format_args!(
            "error: standard output cannot be written: {error}"
        ));
    }
}

/// Writes a line to standard error.
pub(super) fn err(text: Arguments) {
    // Nobody could be told.
    let _ = io::stderr().lock().write_all(shown(text, "\n").as_bytes());
}

/// The text with control characters written out.
fn shown(text: Arguments, end: &str) -> String {
    let text = text.to_string();
    let is_control = |character: char| character.is_control() && !"\n\t".contains(character);
    // JSON has escaped its own.
    if text.starts_with('{') || !text.chars().any(is_control) {
        return text + end;
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match is_control(character) {
            true => shown.extend(character.escape_default()),
            false => shown.push(character),
        }
    }
    shown + end
}

/// What is still on its way goes out.
pub(super) fn flush() {
    if let Err(error) = io::stdout().lock().flush()
        && error.kind() != ErrorKind::BrokenPipe
    {
        FAILED.store(true, Ordering::Relaxed);
    }
}
