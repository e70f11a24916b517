//! What a run was made of, so that it can be repeated to the bit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::request::Request;
use super::tuning::in_words;
use crate::error::Error;
use crate::json;
use fmi_import::{Causality, hexadecimal};
use fmi_master::{Algorithm, Change};
use fmi_system::{Link, System};
use motion::Motion;
use pages::report::UnitSystem;

/// `manifest.json` of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program.
    pub shakebench: String,
    /// Operating system and processor.
    pub platform: String,
    /// What was asked for.
    pub request: Request,
    /// The order of calls.
    pub algorithm: Algorithm,
    /// Coupling step, s.
    pub step_s: f64,
    /// Number of samples.
    pub samples: usize,
    /// The motion.
    pub motion: MotionEntry,
    /// The components by name.
    pub components: BTreeMap<String, ComponentEntry>,
    /// The connections, as in a system file.
    pub connections: Vec<Link>,
    /// Parameters that were changed during the run, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Change>,
    /// SHA-256 of `results.csv`.
    pub results_sha256: String,
}

/// The motion of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MotionEntry {
    /// Its name.
    pub name: String,
    /// Sample time, s.
    pub dt_s: f64,
    /// Seed of a generated motion.
    pub seed: Option<u64>,
    /// SHA-256 of the samples as played, bit by bit.
    pub sha256: String,
    /// What was done to it.
    pub notes: Vec<String>,
    /// The motion along a second axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub across: Option<Box<MotionEntry>>,
}

impl MotionEntry {
    fn of(motion: &Motion) -> Self {
        let histories = [&motion.displacement, &motion.velocity, &motion.acceleration];
        Self {
            name: motion.name.clone(),
            dt_s: motion.dt,
            seed: motion.seed,
            sha256: digest(histories.into_iter().flatten()),
            notes: motion.notes.clone(),
            across: motion
                .across
                .as_ref()
                .map(|across| Box::new(Self::of(across))),
        }
    }
}

/// A component of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentEntry {
    /// Name of the model.
    pub model: String,
    /// Its file.
    pub fmu: PathBuf,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Version of FMI.
    pub fmi: String,
    /// Sampling period, s.
    pub period_s: Option<f64>,
    /// All parameters: value and unit.
    pub parameters: BTreeMap<String, (serde_json::Value, Option<String>)>,
    /// Defaults of the FMU for those that differ.
    #[serde(default)]
    pub defaults: BTreeMap<String, serde_json::Value>,
}

impl Manifest {
    /// Writes down a run; the checksum of its results is known once they are written.
    pub fn new(
        request: &Request,
        system: &System,
        motion: &Motion,
        (algorithm, step_s, samples): (Algorithm, f64, usize),
    ) -> Self {
        let components = system.components.iter().map(|component| {
            let description = &component.fmu.description;
            let mut defaults = BTreeMap::new();
            let parameters = description.of(Causality::Parameter).map(|position| {
                let variable = &description.variables[position];
                let given = component.parameters.iter().find(|(p, _)| *p == position);
                let default = start(variable.start.as_deref().unwrap_or_default());
                let value = match given {
                    Some((_, value)) => serde_json::json!(value),
                    None => default.clone(),
                };
                if differ(&value, &default) {
                    defaults.insert(variable.name.clone(), default);
                }
                (variable.name.clone(), (value, variable.unit.clone()))
            });
            let parameters = parameters.collect();
            let entry = ComponentEntry {
                model: description.model_name.clone(),
                fmu: component.fmu.path.clone(),
                sha256: component.fmu.sha256.clone(),
                fmi: description.version.to_string(),
                period_s: component.period,
                parameters,
                defaults,
            };
            (component.name.clone(), entry)
        });
        Self {
            shakebench: env!("CARGO_PKG_VERSION").to_string(),
            platform: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            request: request.clone(),
            algorithm,
            step_s,
            samples,
            motion: MotionEntry::of(motion),
            components: components.collect(),
            connections: system.links().collect(),
            changes: Vec::new(),
            results_sha256: String::new(),
        }
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// A file that cannot be read or is none.
    pub fn read(path: &Path) -> Result<Self, Error> {
        json::read(path, "the manifest of a run")
    }

    /// What differs between the run written down here and a repetition of it, a line each.
    pub fn differences(&self, again: &Self) -> Vec<String> {
        let mut lines = Vec::new();
        let mut compare = |what: &str, then: &str, now: &str| {
            if then != now {
                lines.push(format!("{what}: {then} then, {now} now"));
            }
        };
        compare("version", &self.shakebench, &again.shakebench);
        compare("platform", &self.platform, &again.platform);
        compare("motion", &self.motion.sha256, &again.motion.sha256);
        let second = |own: &Self| {
            own.motion
                .across
                .as_ref()
                .map_or("none".to_string(), |own| own.sha256.clone())
        };
        compare("motion along y", &second(self), &second(again));
        for (name, then) in &self.components {
            let Some(now) = again.components.get(name) else {
                compare(&format!("component `{name}`"), "there", "not");
                continue;
            };
            compare(&format!("FMU of `{name}`"), &then.sha256, &now.sha256);
            for (parameter, value) in &then.parameters {
                let other = now.parameters.get(parameter);
                if other != Some(value) {
                    let now = other.map_or("none".to_string(), |(value, _)| value.to_string());
                    compare(&format!("`{name}.{parameter}`"), &value.0.to_string(), &now);
                }
            }
        }
        let changes = |own: &Self| match own.changes.as_slice() {
            [] => "none".to_string(),
            all => {
                let all = all
                    .iter()
                    .map(|change| in_words(change, "", UnitSystem::default()));
                all.collect::<Vec<_>>().join("; ")
            }
        };
        compare("changes during the run", &changes(self), &changes(again));
        let all = |links: &[Link]| {
            let links: Vec<String> = links.iter().map(ToString::to_string).collect();
            links.join(", ")
        };
        let (then, now) = (all(&self.connections), all(&again.connections));
        compare("connections", &then, &now);
        compare("results", &self.results_sha256, &again.results_sha256);
        lines
    }
}

/// Whether two values of a parameter are not the same, whatever they are written as.
fn differ(one: &serde_json::Value, other: &serde_json::Value) -> bool {
    let number = |value: &serde_json::Value| {
        let truth = value.as_bool().map(|truth| f64::from(u8::from(truth)));
        value.as_f64().or(truth)
    };
    match (number(one), number(other)) {
        (Some(one), Some(other)) => one != other,
        _ => one != other,
    }
}

fn start(text: &str) -> serde_json::Value {
    // A number where it is one, else the text.
    serde_json::from_str(text).unwrap_or_else(|_| serde_json::Value::from(text))
}

fn digest<'a>(values: impl Iterator<Item = &'a f64>) -> String {
    let mut sum = Sha256::new();
    values.for_each(|value| sum.update(value.to_bits().to_le_bytes()));
    hexadecimal(&sum.finalize())
}
