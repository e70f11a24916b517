//! The rig of a built-in system, as options.

use std::path::PathBuf;

use clap::Args;

use laboratory::error::Error;
use laboratory::systems::built_in;
use laboratory::systems::tuning::Tuning;

/// Options that choose a rig.
#[derive(Debug, Clone, Default, Args)]
pub struct RigArguments {
    /// Plant of a built-in system: identified, servohydraulic, biaxial (the latter along two axes), or a .toml file
    /// [default: identified]
    #[arg(long)]
    pub plant: Option<String>,
    /// Specimen of a built-in system: none, linear, yielding, storeys,
    /// storeys-tuned-mass, storeys-damped, or opensees:MODEL.py [default: linear]
    #[arg(long)]
    pub specimen: Option<String>,
    /// Parameters of the controllers [default: tuned on servohydraulic, otherwise printed]
    #[arg(long, value_enum)]
    pub tuning: Option<Tuning>,
    /// Model from `shakebench identify` for which the controllers are tuned
    #[arg(long, value_name = "MODEL.toml")]
    pub control_model: Option<PathBuf>,
}

impl RigArguments {
    /// The plant, chosen or not.
    pub fn plant(&self) -> String {
        let plant = self.plant.as_deref();
        built_in::plant_path(plant.unwrap_or(built_in::DEFAULT_PLANT))
    }

    /// Refuses what applies to built-in systems only, for a system that is a file.
    ///
    /// # Errors
    /// The first such option.
    pub fn refuse_of_file(&self, file: &str, structure: Option<&String>) -> Result<(), Error> {
        let of_rig = [
            ("--plant", self.plant.is_some()),
            ("--specimen", self.specimen.is_some()),
            ("--structure", structure.is_some()),
        ];
        let of_controllers = [
            ("--tuning", self.tuning.is_some()),
            ("--control-model", self.control_model.is_some()),
        ];
        let first = |options: &[(&'static str, bool)]| {
            let given = options.iter().find(|(_, is_given)| *is_given);
            given.map(|(option, _)| *option)
        };
        let fault = |option, reason| Err(Error::Option { option, reason });
        if let Some(option) = first(&of_rig) {
            let reason =
                format!("{file} is a file with its own plant and specimen; edit it instead");
            return fault(option, reason);
        }
        if let Some(option) = first(&of_controllers) {
            let reason = format!("{file} is a file with its own parameters; edit it instead");
            return fault(option, reason);
        }
        Ok(())
    }

    /// The specimen, chosen or not.
    pub fn specimen(&self) -> String {
        let specimen = self.specimen.as_deref();
        built_in::specimen_path(specimen.unwrap_or(built_in::DEFAULT_SPECIMEN))
    }
}
