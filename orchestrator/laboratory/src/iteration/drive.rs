//! Drive files: the motion that the controller is given so that the table makes the one wanted.

use std::path::Path;

use crate::error::Error;
use motion::{self, Motion, Options};

/// A drive as CSV, as a reference is read.
#[must_use]
pub fn text(drive: &Motion) -> String {
    let mut text = String::from("time [s],displacement [m],velocity [m/s],acceleration [m/s^2]\n");
    for n in 0..drive.len() {
        text += &format!(
            "{},{},{},{}\n",
            n as f64 * drive.dt,
            drive.displacement[n],
            drive.velocity[n],
            drive.acceleration[n]
        );
    }
    text
}

/// Reads the drive of an earlier iteration towards `wanted`.
///
/// # Errors
/// A file that is not a reference, or one of another length.
pub fn read(path: &Path, wanted: &Motion) -> Result<Motion, Error> {
    let options = Options {
        sample_time: wanted.dt,
        ..Options::default()
    };
    let drive = motion::load_reference(path, &options)?;
    if drive.len() == wanted.len() {
        return Ok(drive);
    }
    Err(Error::File {
        path: path.to_path_buf(),
        reason: format!(
            "a drive of {} samples; expected {} as {} has",
            drive.len(),
            wanted.len(),
            wanted.name
        ),
    })
}
