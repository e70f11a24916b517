//! A rig identified from recordings: figures, model file and report.

mod columns;
mod hydraulic;
mod one_input;
mod page;
mod parameters;
mod poles;
mod residuals;
mod responses;
mod summary;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::time::Instant;

use identification::IdentificationError;
use identification::data::{Channel, Recording};
use identification::diagnosis::rigs::guess::{SLOWEST, slow};
use identification::identify::identified::RigIdentification;
use identification::identify::instrument::bias;
use identification::identify::model_file::ModelFile;
use identification::identify::rig::{self, Options};
use identification::identify::specimen_file;

pub use hydraulic::{EQUATION_COLUMNS, HydraulicIdentification};
pub use one_input::{ONE_INPUT_COLUMNS, OneInputIdentification};
pub use parameters::{PARAMETER_COLUMNS, Parameter, parameter_table, parameters};
pub use summary::Summary;

use crate::error::Error;
use crate::results::{Out, Results};
use pages::report::Report;

/// What is identified from what.
#[derive(Debug, Clone)]
pub struct Request {
    /// Recordings of one rig.
    pub data: Vec<PathBuf>,
    /// Where the model goes.
    pub model: PathBuf,
    /// Part of each recording that is fitted; the rest validates the model.
    pub fit_part: f64,
    /// File of a known specimen.
    pub specimen: Option<PathBuf>,
    /// Whether a hydraulic rig is tried before the general form.
    pub hydraulic_first: bool,
    /// What the files call their columns, where they call them otherwise: a file of
    /// `channel = { column = "header", unit = "mm" }`.
    pub columns: Option<PathBuf>,
    /// Whether command and displacement alone are looked at.
    pub one_input: bool,
}

/// What kind of rig explains the recordings.
pub enum Form {
    /// That of Eq 2-4 with linear table and specimen.
    General(Box<RigIdentification>),
    /// A hydraulic one with friction and late sensors.
    Hydraulic(Box<HydraulicIdentification>),
}

/// An identified rig, with what it was identified from.
pub struct Identified {
    /// The rig.
    pub form: Form,
    /// Its figures.
    pub summary: Summary,
    recordings: Vec<Recording>,
}

/// What came of recordings.
pub enum Outcome {
    /// A rig with its forces.
    Rig(Box<Identified>),
    /// Command to displacement.
    OneInput(Box<OneInputIdentified>),
}

/// Command to displacement, with what it was identified from.
pub struct OneInputIdentified {
    /// What was found.
    pub own: OneInputIdentification,
    /// Its figures.
    pub summary: Summary,
}

impl Outcome {
    /// The figures.
    pub fn summary(&self) -> &Summary {
        match self {
            Self::Rig(own) => &own.summary,
            Self::OneInput(own) => &own.summary,
        }
    }

    /// Writes the model to `out` and its report next to it, both or none.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, out: &Out) -> Result<(), Error> {
        match self {
            Self::Rig(own) => own.write(out),
            Self::OneInput(own) => {
                let page = own.own.report(&own.summary);
                write(&own.own.text, &page, out)
            }
        }
    }
}

/// Identifies a rig: with its forces where they were recorded, else from command to displacement.
///
/// # Errors
/// Data at fault.
pub fn identify(request: &Request) -> Result<Outcome, Error> {
    let started = Instant::now();
    let mut recordings = Vec::new();
    let mut warnings = Vec::new();
    for path in &request.data {
        let measured = columns::read(path, request.columns.as_deref())?;
        let (pieces, findings) = measured.on_even_base()?;
        let mut rates = pieces.iter().map(|piece| 1.0 / piece.period());
        if let Some(rate) = rates.find(|rate| *rate < SLOWEST) {
            return Err(Error::File {
                path: path.clone(),
                reason: slow(rate),
            });
        }
        warnings.extend(findings.iter().map(ToString::to_string));
        recordings.extend(long_enough(pieces, &mut warnings));
    }
    // Without force or acceleration the table's mass cannot be found; the displacement can.
    let lacks = |recording: &Recording| {
        [Channel::Acceleration, Channel::ActuatorForce]
            .iter()
            .any(|channel| recording.channel(*channel).is_none())
    };
    let has_way = |recording: &Recording| recording.channel(Channel::Displacement).is_some();
    let is_one_input = request.specimen.is_none()
        && recordings.iter().any(lacks)
        && recordings.iter().all(has_way);
    if request.one_input || is_one_input {
        let named = match request.data.first() {
            Some(path) => columns::named(path, request.columns.as_deref())?,
            None => Vec::new(),
        };
        let own =
            OneInputIdentification::new(&recordings, request.fit_part, &request.data, &named)?;
        let wall = started.elapsed().as_secs_f64();
        let mut summary = own.summary(&request.model, Vec::new(), wall);
        summary.warnings.extend(warnings);
        return Ok(Outcome::OneInput(Box::new(OneInputIdentified {
            own,
            summary,
        })));
    }
    let mut identified = from_recordings(recordings, request)?;
    identified.summary.warnings.extend(warnings);
    Ok(Outcome::Rig(Box::new(identified)))
}

/// As [`identify`], from recordings on an even base; of `request` the data are not read.
///
/// # Errors
/// Recordings that give no model.
pub fn from_recordings(recordings: Vec<Recording>, request: &Request) -> Result<Identified, Error> {
    let started = Instant::now();
    let mut warnings = Vec::new();
    let specimen = match &request.specimen {
        Some(path) => Some(specimen_file::read(path)?),
        None => None,
    };
    let options = Options {
        fit_part: request.fit_part,
        specimen,
        ..Options::default()
    };
    let form = form(&recordings, options, request.hydraulic_first)?;
    let wall = started.elapsed().as_secs_f64();
    let summary = match &form {
        Form::General(found) => {
            warnings.extend(found.warnings.iter().cloned());
            Summary::new(&request.model, found, warnings, wall)
        }
        Form::Hydraulic(own) => own.summary(&request.model, warnings, wall),
    };
    Ok(Identified {
        form,
        summary,
        recordings,
    })
}

/// The general form where it explains the recordings, else a hydraulic rig where that does; with
/// `hydraulic_first` the other way about.
fn form(
    recordings: &[Recording],
    options: Options,
    hydraulic_first: bool,
) -> Result<Form, IdentificationError> {
    let hydraulic = || HydraulicIdentification::new(recordings, options.fit_part);
    let mut first = hydraulic_first.then(hydraulic);
    if let Some(Ok(own)) = first.take_if(|own| own.as_ref().is_ok_and(|own| own.holds())) {
        return Ok(Form::Hydraulic(Box::new(own)));
    }
    let general = match rig::identify(recordings, options) {
        Ok(found)
            if found.residuals.iter().all(|(_, _, test)| test.is_white())
                && bias(&found, recordings).is_none() =>
        {
            return Ok(Form::General(Box::new(found)));
        }
        // Nothing is to be had from channels that contradict each other.
        Err(error @ IdentificationError::Contradiction { .. }) => return Err(error),
        // A specimen that is given is one of the general form.
        other if options.specimen.is_some() => {
            return other.map(|found| Form::General(Box::new(found)));
        }
        other => other,
    };
    match (first.unwrap_or_else(hydraulic), general) {
        // Where a hydraulic rig is expected its predictions say whether it is good enough, not noise.
        (Ok(own), general) if hydraulic_first || own.holds() || general.is_err() => {
            Ok(Form::Hydraulic(Box::new(own)))
        }
        (_, Ok(found)) => Ok(Form::General(Box::new(found))),
        // The hydraulic form's fault says more than a search that came to no end.
        (Err(own), Err(IdentificationError::NotConverged { .. })) => Err(own),
        (_, Err(general)) => Err(general),
    }
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
            "{}: ignored, {:.2} s are too short",
            piece.name,
            piece.duration()
        ));
    }
    kept
}

impl Identified {
    /// The model file.
    ///
    /// # Errors
    /// A rig that a model file cannot hold.
    pub fn model_file(&self) -> Result<ModelFile, IdentificationError> {
        Ok(match &self.form {
            Form::General(found) => ModelFile::from_identification(found),
            Form::Hydraulic(own) => own.file.clone(),
        })
    }

    /// Writes the model to `out` and its report next to it, both or none.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, out: &Out) -> Result<(), Error> {
        let page = match &self.form {
            Form::General(found) => page::report(found, &self.recordings, &self.summary),
            Form::Hydraulic(own) => own.report(&self.summary),
        };
        write(&self.model_file()?.to_toml()?, &page, out)
    }
}

/// Writes a model and its report next to each other, both or none.
fn write(model: &str, page: &Report, out: &Out) -> Result<(), Error> {
    let name = |file: &Path| {
        file.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let mut results = Results::begin(&out.folder())?;
    results.write_text(&name(out), model)?;
    results.write_page(&name(&out.with_extension("html")), page)?;
    results.finish()?;
    Ok(())
}
