//! The motion that a request plays, made once for all that play the same.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::request::Request;
use crate::error::Error;
use fmi_system::SystemFile;
use motion::{self, Motion, Unscaled};

/// Records that have been made playable but for their scale, for requests that play the same.
#[derive(Debug, Default)]
pub struct Motions(Mutex<HashMap<String, Arc<Unscaled>>>);

impl Motions {
    /// More are not kept.
    const MOST: usize = 256;

    /// What the request plays.
    ///
    /// # Errors
    /// A record, a reference or options at fault.
    pub(super) fn find(&self, request: &Request, file: &SystemFile) -> Result<Motion, Error> {
        let usual = motion::Options::default();
        let options = motion::Options {
            sample_time: file.sampling()?.unwrap_or(usual.sample_time),
            scaling: request.scaling,
            ..usual
        };
        let record = match source(request, file)? {
            Source::Reference(path) => return Ok(motion::load_reference(&path, &options)?),
            Source::Record(path) => Some(path),
            Source::Seed => None,
        };
        let key = format!("{record:?} {} {}", request.seed, options.sample_time);
        let open = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = open().get(&key).cloned();
        if let Some(unscaled) = known {
            return Ok(unscaled.scaled(&options)?);
        }
        let unscaled = Arc::new(match &record {
            Some(path) => motion::load_unscaled(path, &options)?,
            None => motion::built_in_unscaled(request.seed, &options)?,
        });
        let mut known = open();
        if known.len() >= Self::MOST {
            known.clear();
        }
        known.insert(key, unscaled.clone());
        drop(known);
        Ok(unscaled.scaled(&options)?)
    }
}

/// What is played.
enum Source {
    Record(PathBuf),
    Reference(PathBuf),
    /// The built-in motion.
    Seed,
}

/// What a request plays: what it names, or what its system does.
fn source(request: &Request, file: &SystemFile) -> Result<Source, Error> {
    let beside = |path: &String| {
        file.directory
            .as_deref()
            .unwrap_or(Path::new(""))
            .join(path)
    };
    let experiment = &file.experiment;
    let own = request.record.is_none() && request.reference.is_none();
    if own && experiment.record.is_some() && experiment.reference.is_some() {
        let reason = "record and reference are both given; expected one of them".to_string();
        return Err(file.at_fault("experiment", reason).into());
    }
    let record = request.record.clone();
    let record = record.or(experiment.record.as_ref().filter(|_| own).map(beside));
    let reference = request.reference.clone();
    let reference = reference.or(experiment.reference.as_ref().filter(|_| own).map(beside));
    Ok(match (record, reference) {
        (_, Some(path)) => Source::Reference(path),
        (Some(path), None) => Source::Record(path),
        (None, None) => Source::Seed,
    })
}
