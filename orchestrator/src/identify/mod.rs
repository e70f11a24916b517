//! A rig identified from recordings: figures, model file and report.

mod page;
mod parameters;
mod responses;
mod summary;

use std::path::{Path, PathBuf};
use std::time::Instant;

use identification::data::Recording;
use identification::identify::model_file::ModelFile;
use identification::identify::rig::{self, Options, RigIdentification};
use identification::identify::specimen_file;

pub use parameters::parameters;
pub use summary::Summary;

use crate::error::Error;
use crate::report;
use crate::results::Results;

/// What is identified from what.
#[derive(Debug, Clone)]
pub struct Request {
    /// Recordings of one rig.
    pub data: Vec<PathBuf>,
    /// Where the model goes.
    pub model: PathBuf,
    /// Part of each recording that is fitted before the rest validates it.
    pub fit_part: f64,
    /// File of a known specimen.
    pub specimen: Option<PathBuf>,
}

/// An identified rig, with what it was identified from.
pub struct Identified {
    /// The rig.
    pub found: RigIdentification,
    /// Its figures.
    pub summary: Summary,
    recordings: Vec<Recording>,
}

/// Identifies a rig.
///
/// # Errors
/// Data at fault.
pub fn identify(request: &Request) -> Result<Identified, Error> {
    let started = Instant::now();
    let mut recordings = Vec::new();
    let mut warnings = Vec::new();
    for path in &request.data {
        let measured = Recording::read(path, &path.display().to_string())?;
        let (pieces, findings) = measured.on_even_base()?;
        warnings.extend(findings.iter().map(ToString::to_string));
        recordings.extend(long_enough(pieces, &mut warnings));
    }
    let specimen = match &request.specimen {
        Some(path) => Some(specimen_file::read(path)?),
        None => None,
    };
    let options = Options {
        fit_part: request.fit_part,
        specimen,
        ..Options::default()
    };
    let found = rig::identify(&recordings, options)?;
    warnings.extend(found.warnings.iter().cloned());
    let wall = started.elapsed().as_secs_f64();
    Ok(Identified {
        summary: Summary::new(&request.model, &found, warnings, wall),
        found,
        recordings,
    })
}

/// Leaves out pieces between gaps that are too short to fit, where longer ones remain.
fn long_enough(pieces: Vec<Recording>, warnings: &mut Vec<String>) -> Vec<Recording> {
    const SHORTEST: f64 = 5.0;
    let longest = pieces.iter().map(Recording::duration).fold(0.0, f64::max);
    let (kept, dropped): (Vec<_>, Vec<_>) = pieces
        .into_iter()
        .partition(|piece| piece.duration() >= SHORTEST.min(longest));
    for piece in dropped {
        warnings.push(format!(
            "{}: left out, {:.2} s are too short",
            piece.name,
            piece.duration()
        ));
    }
    kept
}

impl Identified {
    /// Writes model and report beside each other, both or none.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self) -> Result<(), Error> {
        let path = &self.summary.model;
        let beside = path.with_extension("html");
        let page = page::report(&self.found, &self.recordings, &self.summary);
        let page = report::html(&page).map_err(|error| Error::File {
            path: beside.clone(),
            reason: error.to_string(),
        })?;
        let model = ModelFile::from_identification(&self.found).to_toml()?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut results = Results::begin(folder)?;
        for (file, text) in [(path, &model), (&beside, &page)] {
            let name = file.file_name().unwrap_or_default();
            results.write_text(&name.to_string_lossy(), text)?;
        }
        results.finish()?;
        Ok(())
    }
}
