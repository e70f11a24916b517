//! What a page says of what was run, in few words.

use super::Cell;

/// An entry of [`super::Report::identity`].
#[must_use]
pub fn entry(name: &str, value: impl Into<Cell>) -> (String, Cell) {
    (name.to_string(), value.into())
}

/// Version of the program and the machine it runs on.
#[must_use]
pub fn version() -> (String, Cell) {
    entry(
        "Version",
        format!(
            "shakebench {} on {}-{}",
            env!("CARGO_PKG_VERSION"),
            std::env::consts::ARCH,
            std::env::consts::OS
        ),
    )
}
