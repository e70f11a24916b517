//! What is run: a system on a motion, from what was asked for to what has been checked.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::fmu::{FmiVersion, Options};
use crate::library::FmuLibrary;
use crate::master::{Algorithm, MasterError, Outcome, Pace, Simulation};
use crate::motion::{self, Motion, Scaling};
use crate::system::tuning::{Tuning, Wanted};
use crate::system::{self, System, SystemFile, built_in};

/// What a run is asked to be; a manifest keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Built-in system or path of a file.
    pub system: String,
    /// Plant of a built-in system.
    pub plant: String,
    /// Specimen of a built-in system.
    pub specimen: String,
    /// Computed structure under the specimen of a built-in system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// Parameters of a built-in system's controllers; absent: by its plant.
    #[serde(default)]
    pub tuning: Option<Tuning>,
    /// Model file on which the controllers of a built-in system are tuned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control_model: Option<PathBuf>,
    /// Record to play.
    pub record: Option<PathBuf>,
    /// Reference to play.
    pub reference: Option<PathBuf>,
    /// Seed of the built-in motion.
    pub seed: u64,
    /// How large it is played.
    pub scaling: Option<Scale>,
    /// Parameters.
    pub set: Vec<String>,
    /// Version of FMI of the project's own components.
    pub fmi: FmiVersion,
    /// Order of calls.
    pub algorithm: Algorithm,
    /// Coupling step, s.
    pub step_s: Option<f64>,
    /// Length played, s.
    pub duration_s: Option<f64>,
}

/// How large a motion is played.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// A factor.
    Factor(f64),
    /// Peak acceleration, m/s².
    PeakAcceleration(f64),
    /// Peak displacement, m.
    PeakDisplacement(f64),
}

/// A request with everything it needs, checked.
pub struct Prepared {
    /// The system.
    pub system: System,
    /// The motion.
    pub motion: Motion,
    /// Coupling step, s.
    pub step: f64,
    /// Samples to play.
    pub samples: usize,
    /// How FMUs are run.
    pub options: Options,
}

impl Request {
    /// A built-in system with its usual rig on the built-in motion.
    pub fn built_in(system: &str) -> Self {
        Self {
            system: system.to_string(),
            plant: built_in::DEFAULT_PLANT.to_string(),
            specimen: built_in::DEFAULT_SPECIMEN.to_string(),
            structure: None,
            tuning: None,
            control_model: None,
            record: None,
            reference: None,
            seed: motion::DEFAULT_SEED,
            scaling: None,
            set: Vec::new(),
            fmi: FmiVersion::V3,
            algorithm: Algorithm::default(),
            step_s: None,
            duration_s: None,
        }
    }
}

impl Prepared {
    /// Loads and initializes the system.
    ///
    /// # Errors
    /// An FMU that cannot be loaded or refuses its parameters, a step that does not fit, a loop.
    pub fn simulation(&self, algorithm: Algorithm) -> Result<Simulation, MasterError> {
        let stop = self.samples as f64 * self.motion.dt;
        let plan = (self.step, stop);
        Simulation::with(&self.system, &self.motion, algorithm, plan, &self.options)
    }

    /// Runs it as fast as it goes.
    ///
    /// # Errors
    /// As [`Prepared::simulation`]; a run that ends early is no error.
    pub fn run(&self, algorithm: Algorithm) -> Result<Outcome, MasterError> {
        Ok(self
            .simulation(algorithm)?
            .run(self.samples, Pace::Fastest, &mut |_| {}))
    }
}

/// Reads and checks everything that a request names.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare(request: &Request) -> Result<Prepared, Error> {
    let mut file = if is_file(&request.system) {
        SystemFile::read(Path::new(&request.system))?
    } else {
        built_in::system(
            &request.system,
            &request.plant,
            &request.specimen,
            Wanted {
                tuning: request.tuning,
                model: request.control_model.as_deref(),
                rules: None,
            },
        )?
    };
    if let Some(structure) = &request.structure {
        built_in::add_structure(&mut file, structure, &request.plant)?;
    }
    prepare_file(request, &file)
}

/// As [`prepare`], of a system that has been read or put together.
///
/// # Errors
/// Whatever is at fault.
pub fn prepare_file(request: &Request, file: &SystemFile) -> Result<Prepared, Error> {
    let motion = motion(request, file)?;
    let mut library = FmuLibrary::new(request.fmi, file.directory.as_deref());
    let system = system::assemble(file, &request.set, &mut |name| library.find(name))?;
    let step = request.step_s.or(file.step()?).unwrap_or(motion.dt);
    let mut samples = motion.len();
    if let Some(duration) = request.duration_s.or(file.duration()?) {
        if !(duration >= motion.dt && duration.is_finite()) {
            let reason = format!("{duration} s is shorter than a sample of {} s", motion.dt);
            return Err(Error::Option {
                option: "--duration",
                reason,
            });
        }
        samples = samples.min((duration / motion.dt).round() as usize);
    }
    Ok(Prepared {
        system,
        motion,
        step,
        samples,
        options: Options::default(),
    })
}

fn motion(request: &Request, file: &SystemFile) -> Result<Motion, Error> {
    let usual = motion::Options::default();
    let options = motion::Options {
        sample_time: file.sampling()?.unwrap_or(usual.sample_time),
        scaling: request.scaling.map(|scale| match scale {
            Scale::Factor(factor) => Scaling::Factor(factor),
            Scale::PeakAcceleration(peak) => Scaling::PeakAcceleration(peak),
            Scale::PeakDisplacement(peak) => Scaling::PeakDisplacement(peak),
        }),
        ..usual
    };
    let beside = |path: &String| {
        file.directory
            .as_deref()
            .unwrap_or(Path::new(""))
            .join(path)
    };
    let own = request.record.is_none() && request.reference.is_none();
    let record = request.record.clone();
    let record = record.or(file.experiment.record.as_ref().filter(|_| own).map(beside));
    let reference = request.reference.clone();
    let reference = reference.or(file
        .experiment
        .reference
        .as_ref()
        .filter(|_| own)
        .map(beside));
    Ok(match (record, reference) {
        (_, Some(path)) => motion::load_reference(&path, &options)?,
        (Some(path), None) => motion::load(&path, &options)?,
        (None, None) => motion::built_in(request.seed, &options)?,
    })
}

/// Whether a system is named by a file.
pub fn is_file(system: &str) -> bool {
    system.ends_with(".toml") || system.contains(['/', '\\'])
}
