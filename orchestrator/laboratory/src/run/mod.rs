//! A run of a system on a motion: what is asked for, what is played, what is kept.

pub mod axes;
pub mod checkpoint;
pub mod experiment;
pub mod identity;
pub mod manifest;
mod motions;
pub mod page;
pub mod refinement;
mod request;
pub mod signals;
pub mod summary;
pub mod table;
pub mod text;
pub mod tuning;
mod warned;

use std::path::PathBuf;

use crate::error::Error;
use crate::results::Out;

/// Runs a system as fast as it goes and writes the files of the run into `folder`; says where.
///
/// # Errors
/// Whatever is at fault in the request, or a folder that cannot be written. A run that ends early is not an error:
/// its summary says so.
pub fn perform(request: &experiment::Request, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let prepared = experiment::prepare(request)?;
    let outcome = prepared.run(prepared.algorithm)?;
    let plan = (prepared.algorithm, prepared.step, prepared.samples);
    let mut manifest = manifest::Manifest::new(request, &prepared.system, &prepared.motion, plan);
    let summary = summary::Summary::new(&prepared, &outcome, &manifest);
    page::write(folder, &prepared, &outcome, &summary, &mut manifest, false)
}
