//! A system with its components and its motion as an SSP archive.

use std::error::Error as StdError;
use std::fmt::Write as _;
use std::path::Path;

use fmi_import::FmiVersion;
use fmi_ssp::export::{self, Carrying, Player, Start, Supply};
use fmi_system::{Component, System};
use motion::Motion;
use pack::{Installation, StartValue};

use crate::error::Error;
use crate::results::Out;
use crate::systems::opensees;

/// The component that plays the motion.
const PLAYER: &str = "ReferenceMotion";
/// Samples before and ahead that it has as outputs.
const AHEAD: std::ops::RangeInclusive<isize> = -1..=20;

/// What goes into an archive beside the system.
#[derive(Debug, Clone)]
pub struct Experiment<'a> {
    /// The motion; none for a system without one.
    pub motion: Option<&'a Motion>,
    /// Coupling step, s.
    pub step: f64,
    /// How long it runs, s.
    pub duration: f64,
    /// The order of calls that the parameters are for.
    pub algorithm: String,
    /// Version of FMI of the component that plays the motion.
    pub fmi: FmiVersion,
    /// Where it comes from.
    pub installation: Installation,
}

impl Supply for Experiment<'_> {
    fn player(&self) -> Result<Option<Player>, Box<dyn StdError + Send + Sync>> {
        let Some(motion) = self.motion else {
            return Ok(None);
        };
        let all = self.installation.fmus()?;
        let found = all
            .iter()
            .find(|fmu| fmu.name == PLAYER && fmu.version == self.fmi);
        let found = found.ok_or_else(|| format!("`{PLAYER}` is not built"))?;
        let mut table = String::from("time,displacement,velocity,acceleration\n");
        let rows = motion
            .displacement
            .iter()
            .zip(&motion.velocity)
            .zip(&motion.acceleration);
        for (sample, ((x, v), a)) in rows.enumerate() {
            let _ = writeln!(table, "{},{x},{v},{a}", sample as f64 * motion.dt);
        }
        Ok(Some(Player {
            name: PLAYER.to_string(),
            fmu: pack::with_resource(&found.path, "motion.csv", table.into_bytes())?,
            ahead: AHEAD,
        }))
    }

    fn starting_with(
        &self,
        file: &Path,
        starts: &[Start],
    ) -> Result<Vec<u8>, Box<dyn StdError + Send + Sync>> {
        let starts = starts.iter().map(|start| StartValue {
            name: start.name.clone(),
            value: start.value,
            note: String::new(),
        });
        let starts: Vec<StartValue> = starts.collect();
        Ok(pack::variant_bytes(file, &starts)?)
    }

    fn carrying(
        &self,
        component: &Component,
    ) -> Result<Option<Carrying>, Box<dyn StdError + Send + Sync>> {
        opensees::carrying(component)
    }
}

/// Writes the FMU `out` that runs a model in OpenSees and contains it.
///
/// # Errors
/// A model that cannot be read, or a file that exists.
pub fn write_model(
    model: &Path,
    version: FmiVersion,
    installation: &Installation,
    out: &Out,
) -> Result<(), Error> {
    let fault = |path: &Path, reason: String| Error::File {
        path: path.to_path_buf(),
        reason,
    };
    let bytes = opensees::fmu_of(model, version, installation);
    let bytes = bytes.map_err(|error| fault(model, error.to_string()))?;
    if out.exists() && !out.replaces() {
        let reason = "exists already; name another file, or add --force".to_string();
        return Err(fault(out, reason));
    }
    std::fs::write(out, bytes).map_err(|error| fault(out, error.to_string()))
}

/// Writes `system` to the archive `path` and gives what the user should know.
///
/// # Errors
/// What the format does not hold, an FMU that cannot be read, a file that cannot be written.
pub fn write(system: &System, experiment: &Experiment, path: &Path) -> Result<Vec<String>, Error> {
    let asked = export::Experiment {
        supply: experiment,
        sampling: experiment.motion.map(|motion| motion.dt),
        step: experiment.step,
        duration: experiment.duration,
        algorithm: experiment.algorithm.clone(),
        fmi: experiment.fmi,
    };
    let contents = export::contents(system, &asked, path)?;
    pack::write_archive(path, &contents.files, None)?;
    Ok(contents.notes)
}
