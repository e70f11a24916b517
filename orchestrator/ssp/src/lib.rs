//! System Structure and Parameterization (SSP 1.0 and 2.0): systems in an archive with their
//! components, read as a [`SystemFile`](fmi_system::SystemFile) and written from a checked
//! [`System`](fmi_system::System).

mod error;
pub mod export;
mod flatten;
mod package;
mod parameters;
mod structure;
mod wiring;
mod xml;

pub use error::SspError;
pub use flatten::read;
pub use package::Package;
pub use structure::Structure;

/// The file at the top of an archive.
pub const STRUCTURE: &str = "SystemStructure.ssd";

/// Type of our annotations.
pub(crate) const ANNOTATION: &str = "org.shakebench.experiment";
/// What outputs of the component that plays the motion end with that are one sample late.
const BEFORE: &str = "_before";

/// Whether a system is named by an SSP archive or a system structure description; the name of one
/// of several descriptions in an archive may follow behind `#`.
#[must_use]
pub fn is_ssp(system: &str) -> bool {
    let (file, _) = split(system);
    let lower = file.to_lowercase();
    lower.ends_with(".ssp") || lower.ends_with(".ssd")
}

/// A file's name and, behind `#`, the name of a description in it.
pub(crate) fn split(system: &str) -> (&str, Option<&str>) {
    match system.split_once('#') {
        Some((file, variant)) => (file, Some(variant)),
        None => (system, None),
    }
}
