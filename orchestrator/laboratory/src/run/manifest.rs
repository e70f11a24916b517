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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use serde_json::json;

    #[test]
    fn a_manifest_holds_values_units_and_defaults_that_differ() {
        let motion = made::wave("wave", 10);
        let own = made::manifest(&Request::built_in("mpc"), &motion);
        let control = &own.components["control"];
        assert_eq!(
            (&*control.model, &*control.fmi, control.period_s),
            ("control", "3.0", Some(0.002))
        );
        let unit = |unit: &str| Some(unit.to_string());
        assert_eq!(
            control.parameters["proportional_gain"],
            (json!(196.85), unit("V/m"))
        );
        assert_eq!(control.parameters["valve_limit"], (json!(10), unit("V")));
        assert_eq!(control.defaults.len(), 1);
        assert_eq!(control.defaults["proportional_gain"], json!(137.8));
        assert!(own.components["table"].defaults.is_empty());
        assert_eq!(
            (own.samples, &*own.motion.name, own.motion.dt_s),
            (10, "wave", 0.002)
        );
        // A single bit of the motion changes its checksum.
        let mut other = motion.clone();
        other.velocity[3] = -other.velocity[3];
        assert_ne!(MotionEntry::of(&other).sha256, own.motion.sha256);
        let both = MotionEntry::of(&motion.clone().along_two_axes(other));
        assert_eq!(both.sha256, own.motion.sha256);
        assert!(
            both.across
                .is_some_and(|across| across.sha256 != own.motion.sha256)
        );
        assert_eq!(
            digest([1.0].iter()),
            fmi_import::digest(&1.0_f64.to_le_bytes())
        );
    }

    #[test]
    fn values_differ_by_what_they_are_not_by_how_they_are_written() {
        for (one, other, expected) in [
            (json!(1), json!(1.0), false),
            (json!(true), json!(1), false),
            (json!(false), json!(0.0), false),
            (json!(1), json!(2), true),
            (json!("a"), json!("a"), false),
            (json!("a"), json!("b"), true),
            (json!("1"), json!(1), true),
        ] {
            assert_eq!(differ(&one, &other), expected, "{one} {other}");
        }
        assert_eq!(
            (start("2.5"), start("true"), start("word")),
            (json!(2.5), json!(true), json!("word"))
        );
    }

    #[test]
    fn a_repetition_that_differs_is_told_in_what() {
        let motion = made::wave("wave", 10);
        let own = made::manifest(&Request::built_in("mpc"), &motion);
        assert!(own.differences(&own).is_empty());
        let mut again = own.clone();
        again.shakebench = "0.0.1".into();
        again.platform = "abacus".into();
        again.motion.sha256 = "other".into();
        again.motion.across = Some(Box::new(again.motion.clone()));
        again.results_sha256 = "results".into();
        again.connections.pop();
        again.components.remove("specimen");
        let control = again.components.get_mut("control").unwrap();
        control.sha256 = "fmu".into();
        control.parameters.remove("valve_limit");
        control.parameters.get_mut("proportional_gain").unwrap().0 = json!(2);
        again.changes.push(Change {
            variable: "control.proportional_gain".into(),
            time_s: 0.5,
            sample: 250,
            samples: 500,
            from: 1.0,
            to: 2.0,
        });
        let found = own.differences(&again);
        let sum = &own.motion.sha256;
        let expected = [
            format!("version: {} then, 0.0.1 now", env!("CARGO_PKG_VERSION")),
            format!("platform: {} then, abacus now", own.platform),
            format!("motion: {sum} then, other now"),
            "motion along y: none then, other now".into(),
            format!("FMU of `control`: {} then, fmu now", own.components["control"].sha256),
            "`control.proportional_gain`: 196.85 then, 2 now".into(),
            "`control.valve_limit`: 10 then, none now".into(),
            "component `specimen`: there then, not now".into(),
            "changes during the run: none then, `control.proportional_gain` from 1.000 to 2.000 at 0.500 s now".into(),
            "connections: reference.displacement -> control.reference_displacement, \
             control.valve_command -> table.valve_command then, \
             reference.displacement -> control.reference_displacement now"
                .into(),
            "results:  then, results now".into(),
        ];
        assert_eq!(found, expected);
    }
}
