//! The TOML of a system, as people write it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use super::{SystemError, value};

/// A system file.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SystemFile {
    /// Name of the system; for a file its stem when not given.
    #[serde(default)]
    pub name: String,
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// `"component.output -> component.input"`, in any order.
    #[serde(default)]
    pub connections: Vec<Spanned<String>>,
    /// The components by name.
    #[serde(default)]
    pub components: BTreeMap<String, ComponentFile>,
    /// In a plant: what controllers are connected to in place of `table.` and `specimen.`
    /// variables, such as the sensors' readings.
    #[serde(default)]
    pub instead: BTreeMap<String, String>,
    /// What is done with it.
    #[serde(default)]
    pub experiment: ExperimentFile,
    /// Where the text came from: a file's name, or the name of a built-in system.
    #[serde(skip)]
    pub origin: String,
    /// Lines of the connections, in their order.
    #[serde(skip)]
    pub lines: Vec<usize>,
    /// The file's directory, from which paths in it count.
    #[serde(skip)]
    pub directory: Option<PathBuf>,
}

/// A component in a system file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentFile {
    /// Name of a component of this project (`"ShakeTable"`), or a path to an `.fmu` file, relative
    /// to the system file.
    pub fmu: String,
    /// A set of parameters: `"equation-2-13"`, `"derounded"`, or a path to a `MODEL.toml`
    /// as `shakebench identify` writes it.
    #[serde(default)]
    pub model: Option<String>,
    /// Sampling period; it makes the component a sampled one.
    #[serde(default)]
    pub period: Option<toml::Value>,
    /// Parameters, as SI numbers or texts with units.
    #[serde(default)]
    pub parameters: BTreeMap<String, toml::Value>,
    /// Values of inputs that no connection drives.
    #[serde(default)]
    pub inputs: BTreeMap<String, toml::Value>,
}

/// The experiment in a system file; the command line goes before it.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentFile {
    /// Coupling step, such as `"2 ms"`.
    #[serde(default)]
    pub step: Option<toml::Value>,
    /// How much of the motion is played, such as `"20 s"`.
    #[serde(default)]
    pub duration: Option<toml::Value>,
    /// A record, relative to the system file.
    #[serde(default)]
    pub record: Option<String>,
    /// A reference, relative to the system file.
    #[serde(default)]
    pub reference: Option<String>,
    /// A Boolean output that ends the run when it becomes true, such as `"interlock.tripped"`.
    #[serde(default)]
    pub end_when: Option<String>,
    /// How long the run goes on after that, such as `"0.5 s"`.
    #[serde(default)]
    pub end_after: Option<toml::Value>,
    /// A Boolean input that is set when a sampled component fails, such as `"interlock.stop"`; the
    /// run then goes on, with the failed component's last outputs, until `end_when` ends it.
    #[serde(default)]
    pub stop: Option<String>,
}

impl SystemFile {
    /// Reads a system from its text.
    ///
    /// # Errors
    /// Text that is no TOML or has unknown keys, with line and column.
    pub fn parse(origin: &str, text: &str) -> Result<Self, SystemError> {
        let mut file: Self = toml::from_str(text).map_err(|error| SystemError::Syntax {
            origin: origin.to_string(),
            reason: error.to_string().trim_end().to_string(),
        })?;
        file.origin = origin.to_string();
        file.lines = file
            .connections
            .iter()
            .map(|connection| 1 + text[..connection.span().start].matches('\n').count())
            .collect();
        Ok(file)
    }

    /// Reads a system file.
    ///
    /// # Errors
    /// A file that cannot be read, or what [`SystemFile::parse`] finds.
    pub fn read(path: &Path) -> Result<Self, SystemError> {
        let text = std::fs::read_to_string(path).map_err(|error| SystemError::Unreadable {
            path: path.to_path_buf(),
            reason: error.to_string(),
        })?;
        let mut file = Self::parse(&path.display().to_string(), &text)?;
        file.directory = path.parent().map(Path::to_path_buf);
        if file.name.is_empty() {
            file.name = path
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        }
        Ok(file)
    }

    /// `step` or `duration` of the experiment, s.
    ///
    /// # Errors
    /// What stands there is no time.
    pub fn time(&self, name: &str) -> Result<Option<f64>, SystemError> {
        let written = match name {
            "step" => &self.experiment.step,
            _ => &self.experiment.duration,
        };
        let time = written.as_ref().map(value::time).transpose();
        time.map_err(|reason| SystemError::Place {
            origin: self.origin.clone(),
            place: format!("experiment.{name}"),
            reason,
        })
    }

    /// Takes out the connections that come from the component `name`.
    pub fn disconnect(&mut self, name: &str) {
        let from_it = |text: &str| {
            text.trim_start()
                .strip_prefix(name)
                .is_some_and(|rest| rest.starts_with('.'))
        };
        let kept = self
            .connections
            .iter()
            .zip(&self.lines)
            .filter(|(text, _)| !from_it(text.get_ref()));
        (self.connections, self.lines) = kept.map(|(text, line)| (text.clone(), *line)).unzip();
    }

    /// Connects to what `instead` names in place of its keys, on either side.
    pub fn redirect(&mut self, instead: &BTreeMap<String, String>) {
        for connection in &mut self.connections {
            let text = connection.get_mut();
            if let Some((from, to)) = text.split_once("->") {
                let end = |end: &str| {
                    let end = end.trim();
                    instead.get(end).map_or(end, String::as_str).to_string()
                };
                *text = format!("{} -> {}", end(from), end(to));
            }
        }
    }

    /// Adds the components, connections and experiment of `part`; what `part` says goes before.
    pub fn extend(&mut self, part: Self) {
        self.connections.extend(part.connections);
        self.lines.extend(part.lines);
        self.components.extend(part.components);
        let (own, other) = (&mut self.experiment, part.experiment);
        own.step = other.step.or(own.step.take());
        own.duration = other.duration.or(own.duration.take());
        own.record = other.record.or(own.record.take());
        own.reference = other.reference.or(own.reference.take());
        own.end_when = other.end_when.or(own.end_when.take());
        own.stop = other.stop.or(own.stop.take());
        own.end_after = other.end_after.or(own.end_after.take());
    }
}
