//! What the program prints: nothing panics when nobody reads it.

use std::io::{self, ErrorKind, Write};
use std::path::PathBuf;

/// Prints the one object, or what people read and the files that were written.
///
/// # Errors
/// Standard output that cannot be written, unless nobody reads it any more.
pub fn print(
    json: bool,
    object: &serde_json::Value,
    text: &str,
    files: &[PathBuf],
) -> io::Result<()> {
    let mut all = if json {
        format!("{object}\n")
    } else {
        text.to_string()
    };
    if !json && !files.is_empty() {
        all += "\nwritten:\n";
        for file in files {
            all += &format!("  {}\n", file.display());
        }
    }
    let mut out = io::stdout().lock();
    match out.write_all(all.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Writes a line to standard error.
pub fn complain(text: &str) {
    // Nobody could be told.
    let _ = writeln!(io::stderr().lock(), "{text}");
}
