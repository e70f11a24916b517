//! What a run is asked to be.

use pack::Installation;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::systems::built_in;
use crate::systems::tuning::Tuning;
use fmi_import::FmiVersion;
use fmi_master::Algorithm;
use motion::{self, Scaling};

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
    /// Record to play along a second axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record_y: Option<PathBuf>,
    /// Reference to play.
    pub reference: Option<PathBuf>,
    /// Reference to play along a second axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_y: Option<PathBuf>,
    /// Seed of the built-in motion.
    pub seed: u64,
    /// How large it is played.
    pub scaling: Option<Scaling>,
    /// Parameters.
    pub set: Vec<String>,
    /// Version of FMI of the project's own components.
    pub fmi: FmiVersion,
    /// Order of calls; absent: what the system says, otherwise in the order of dependencies.
    #[serde(default)]
    pub algorithm: Option<Algorithm>,
    /// Coupling step, s.
    pub step_s: Option<f64>,
    /// Error by which the steps are chosen, where they vary, per cent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variable_step_percent: Option<f64>,
    /// Least step where they vary, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least_step_s: Option<f64>,
    /// Length played, s.
    pub duration_s: Option<f64>,
    /// Input tables, whose columns are named as the inputs that they drive.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<PathBuf>,
    /// Where the project's own components come from; not part of what is repeated.
    #[serde(skip)]
    pub installation: Installation,
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
            record_y: None,
            reference: None,
            reference_y: None,
            seed: motion::DEFAULT_SEED,
            scaling: None,
            set: Vec::new(),
            fmi: FmiVersion::V3,
            algorithm: None,
            step_s: None,
            variable_step_percent: None,
            least_step_s: None,
            duration_s: None,
            inputs: Vec::new(),
            installation: Installation::default(),
        }
    }
}
