//! A system by names: read from TOML as people write it, or put together in code.
//!
//! ```
//! use fmi_system::{ComponentFile, Origin, Quantity, SystemFile, VariableName};
//!
//! let mut system = SystemFile::new("bare table");
//! system.add("table", ComponentFile::new("ShakeTable").input("specimen_force", 0.0));
//! system.add(
//!     "control",
//!     ComponentFile::new("DisplacementPid").period("2 ms"),
//! );
//! system.connect(
//!     Origin::reference(Quantity::Displacement),
//!     VariableName::new("control", "reference_displacement"),
//! );
//! system.connect(
//!     Origin::output("table", "displacement"),
//!     VariableName::new("control", "measured_displacement"),
//! );
//! system.connect(
//!     Origin::output("control", "valve_command"),
//!     VariableName::new("table", "valve_command"),
//! );
//! assert_eq!(system.components.len(), 2);
//! ```

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use toml::Spanned;

use super::error::{Misfit, SystemError};
use super::library::Archive;
use super::link::{self, Link, Origin, VariableName};
use super::passage::{Hop, Transformation, Way};
use super::table::{InputTable, TableFile};
use super::value::{self, Setting};

/// A system by names, before they are looked up in its FMUs.
#[derive(Debug, Clone, Default)]
pub struct SystemFile {
    /// Name of the system; for a file its stem when not given.
    pub name: String,
    /// One line for people.
    pub description: String,
    /// The connections, in any order.
    pub connections: Vec<Link>,
    /// The components by name.
    pub components: BTreeMap<String, ComponentFile>,
    /// Input tables by name; connections come from their columns.
    pub tables: BTreeMap<String, TableFile>,
    /// Input tables that are not files.
    pub own_tables: Vec<InputTable>,
    /// In a plant: what controllers are connected to in place of `table.` and `specimen.`
    /// variables, such as the sensors' readings.
    pub instead: BTreeMap<VariableName, VariableName>,
    /// In a part of a system: parameters of a component of another part, where there is one.
    pub adjust: BTreeMap<String, BTreeMap<String, Setting>>,
    /// Whether this is a plant whose commissioning left a model to tune controllers on.
    pub commissioned: bool,
    /// What is done with it.
    pub experiment: ExperimentFile,
    /// How it answers other programs as an experimental element.
    pub openfresco: ElementFile,
    /// Where it came from: a file's name, or the name of a built-in system.
    pub origin: String,
    /// The file's directory, from which paths in it count.
    pub directory: Option<PathBuf>,
    /// The archive that it came from, with its components.
    pub package: Option<Arc<dyn Archive>>,
    /// What the user should know of the file.
    pub notes: Vec<String>,
    /// Inputs of the whole system by name, with the inputs of components that they lead to.
    pub open_inputs: Vec<(String, VariableName)>,
    /// Whether parameters that a component has not are passed over with a note, as sets of
    /// parameters for many components want it.
    pub is_lenient: bool,
}

/// The TOML of a system.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    name: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    connections: Vec<Spanned<WrittenLink>>,
    #[serde(default)]
    components: BTreeMap<String, ComponentFile>,
    #[serde(default)]
    tables: BTreeMap<String, TableFile>,
    #[serde(default)]
    instead: BTreeMap<VariableName, VariableName>,
    #[serde(default)]
    adjust: BTreeMap<String, BTreeMap<String, Setting>>,
    #[serde(default)]
    commissioned: bool,
    #[serde(default)]
    experiment: ExperimentFile,
    #[serde(default)]
    openfresco: ElementFile,
}

/// How a system answers other programs as an experimental element.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElementFile {
    /// Units of the client: a length and a force, such as `in,kip`.
    pub units: Option<String>,
    /// What a trial moves: `reference`, or inputs as `component.input`, one for each degree of freedom.
    #[serde(default)]
    pub command: Vec<String>,
    /// What is measured of it: `component.output`, one for each degree of freedom.
    #[serde(default)]
    pub displacement: Vec<String>,
    /// The resisting force: `component.output` or `-component.output`, one for each degree of freedom.
    #[serde(default)]
    pub force: Vec<String>,
    /// Stiffness, row by row, in the units of the client.
    #[serde(default)]
    pub stiffness: Vec<f64>,
}

/// A connection in a system file.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"component.output -> component.input\", or { connect = \"...\", \
                 factor = 1.0, offset = 0.0, convert_units = true }"
)]
enum WrittenLink {
    /// `"component.output -> component.input"`.
    Plain(String),
    /// With what is done to the value.
    With(LinkWith),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkWith {
    connect: String,
    #[serde(default = "one")]
    factor: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default = "yes")]
    convert_units: bool,
}

fn one() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

impl WrittenLink {
    fn parts(&self) -> (&str, Way) {
        match self {
            Self::Plain(text) => (text, Way::default()),
            Self::With(with) => {
                let is_linear = with.factor != 1.0 || with.offset != 0.0;
                let hop = Hop {
                    end: None,
                    suppresses_units: !with.convert_units,
                    transformation: match is_linear {
                        true => Transformation::Linear {
                            factor: with.factor,
                            offset: with.offset,
                        },
                        false => Transformation::None,
                    },
                };
                let way = Way {
                    start: None,
                    hops: vec![hop],
                };
                (&with.connect, way)
            }
        }
    }
}

/// How an FMU that offers both is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stepping {
    /// By itself.
    CoSimulation,
    /// By the program's solver.
    ModelExchange,
}

/// A component in a system file.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentFile {
    /// Name of a component of this project (`"ShakeTable"`), or a path to an `.fmu` file, relative
    /// to the system file.
    pub fmu: String,
    /// A set of parameters: `"equation-2-13"`, `"derounded"`, or a path to a `MODEL.toml`
    /// as `shakebench identify` writes it.
    #[serde(default)]
    pub model: Option<String>,
    /// Name of the rule by which its parameters are made, for programs that have such rules.
    #[serde(default)]
    pub tuning: Option<String>,
    /// How it is stepped, where the FMU offers both: by itself (the default) or by the program's solver.
    #[serde(default)]
    pub interface: Option<Stepping>,
    /// Relative error of its steps that it, or the solver, is asked for.
    #[serde(default)]
    pub tolerance: Option<f64>,
    /// Sampling period; it makes the component a sampled one.
    #[serde(default)]
    pub period: Option<Setting>,
    /// Parameters, as SI numbers or texts with units.
    #[serde(default)]
    pub parameters: BTreeMap<String, Setting>,
    /// Values of inputs that no connection drives.
    #[serde(default)]
    pub inputs: BTreeMap<String, Setting>,
    /// Units of variables, in place of what the FMU says.
    #[serde(default)]
    pub units: BTreeMap<String, String>,
    /// Further names of outputs in the results, by name: `speed = "shaft.w"`.
    #[serde(default)]
    pub aliases: BTreeMap<String, String>,
}

/// The experiment in a system file; the command line goes before it.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentFile {
    /// Time between samples of the motion, such as `"1 ms"`; absent: 2 ms.
    #[serde(default)]
    pub sampling: Option<Setting>,
    /// Coupling step, such as `"2 ms"`.
    #[serde(default)]
    pub step: Option<Setting>,
    /// Error by which the coupling step is chosen, such as `"0.1 %"`; `step` is then the greatest.
    #[serde(default)]
    pub variable_step: Option<Setting>,
    /// Least coupling step where it varies, such as `"1 us"`.
    #[serde(default)]
    pub least_step: Option<Setting>,
    /// How much of the motion is played, such as `"20 s"`.
    #[serde(default)]
    pub duration: Option<Setting>,
    /// Time at which it begins, s.
    #[serde(default)]
    pub start: Option<f64>,
    /// The order of calls that its parameters are for.
    #[serde(default)]
    pub algorithm: Option<String>,
    /// A record, relative to the system file.
    #[serde(default)]
    pub record: Option<String>,
    /// A reference, relative to the system file.
    #[serde(default)]
    pub reference: Option<String>,
    /// A Boolean output that ends the run when it becomes true, such as `"interlock.tripped"`.
    #[serde(default)]
    pub end_when: Option<VariableName>,
    /// An enumeration output that says why, such as `"interlock.trip_cause"`.
    #[serde(default)]
    pub end_cause: Option<VariableName>,
    /// How long the run goes on after that, such as `"0.5 s"`.
    #[serde(default)]
    pub end_after: Option<Setting>,
    /// A Boolean input that is set when a sampled component fails, such as `"interlock.stop"`; the
    /// run then goes on, with the failed component's last outputs, until `end_when` ends it.
    #[serde(default)]
    pub stop: Option<VariableName>,
}

impl ComponentFile {
    /// A component without parameters; `fmu` as in [`ComponentFile::fmu`].
    #[must_use]
    pub fn new(fmu: &str) -> Self {
        Self {
            fmu: fmu.to_string(),
            ..Self::default()
        }
    }

    /// The same, sampled with a period in s or with a unit.
    #[must_use]
    pub fn period(mut self, period: impl Into<Setting>) -> Self {
        self.period = Some(period.into());
        self
    }

    /// The same with a parameter.
    #[must_use]
    pub fn parameter(mut self, name: &str, value: impl Into<Setting>) -> Self {
        self.set(name, value);
        self
    }

    /// The same with a value for an input that nothing drives.
    #[must_use]
    pub fn input(mut self, name: &str, value: impl Into<Setting>) -> Self {
        self.inputs.insert(name.to_string(), value.into());
        self
    }

    /// Gives it a parameter.
    pub fn set(&mut self, name: &str, value: impl Into<Setting>) {
        self.parameters.insert(name.to_string(), value.into());
    }
}

impl SystemFile {
    /// The files that it refers to.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        let folder = self.directory.as_deref().unwrap_or(Path::new(""));
        let fmus = self.components.values().map(|part| &part.fmu);
        let fmus = fmus.filter(|fmu| fmu.ends_with(".fmu"));
        let models = self
            .components
            .values()
            .filter_map(|part| part.model.as_ref());
        let models = models.filter(|model| model.ends_with(".toml"));
        let tables = self.tables.values().map(|table| &table.file);
        let motions = self
            .experiment
            .record
            .iter()
            .chain(&self.experiment.reference);
        let all = fmus.chain(models).chain(tables).chain(motions);
        all.map(|file| folder.join(file)).collect()
    }

    /// A system without components.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_string(),
            origin: name.to_string(),
            ..Self::default()
        }
    }

    /// A system of a single FMU.
    #[must_use]
    pub fn of_fmu(path: &Path) -> Self {
        let stem = path
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let mut file = Self::new(&stem);
        file.origin = path.display().to_string();
        // A name that a connection can be written with.
        let letters = stem.chars().map(|c| match c {
            c if c.is_alphanumeric() || c == '_' || c == '-' => c,
            _ => '_',
        });
        let mut name: String = letters.collect();
        if name.is_empty() || name == "reference" {
            name = "model".to_string();
        }
        file.add(&name, ComponentFile::new(&path.display().to_string()));
        file
    }

    /// An error at a place in this file.
    #[must_use]
    pub fn at_fault(
        &self,
        place: &str,
        reason: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> SystemError {
        self.fault(place, reason.into())
    }

    /// Adds a component, in place of one of the same name.
    pub fn add(&mut self, name: &str, component: ComponentFile) {
        self.components.insert(name.to_string(), component);
    }

    /// Adds a connection.
    pub fn connect(&mut self, from: Origin, to: VariableName) {
        self.connections.push(Link {
            from,
            to,
            way: Way::default(),
            line: None,
        });
    }

    /// Reads a system from its text.
    ///
    /// # Errors
    /// Text that is not TOML, has unknown keys, or connections that cannot be read, with the line.
    pub fn parse(origin: &str, text: &str) -> Result<Self, SystemError> {
        let written: Written = toml::from_str(text).map_err(|error| SystemError::Syntax {
            origin: origin.to_string(),
            reason: error.to_string().trim_end().to_string(),
        })?;
        let mut connections = Vec::new();
        for connection in &written.connections {
            let line = 1 + text[..connection.span().start].matches('\n').count();
            let (connection, way) = connection.get_ref().parts();
            let links = link::parse(connection, line);
            let links = links.map_err(|reason| SystemError::Place {
                origin: origin.to_string(),
                place: format!("connection `{connection}` (line {line})"),
                reason: Box::new(reason.into()),
            })?;
            connections.extend(links.into_iter().map(|link| Link {
                way: way.clone(),
                ..link
            }));
        }
        Ok(Self {
            name: written.name,
            description: written.description,
            connections,
            components: written.components,
            tables: written.tables,
            instead: written.instead,
            adjust: written.adjust,
            commissioned: written.commissioned,
            experiment: written.experiment,
            openfresco: written.openfresco,
            origin: origin.to_string(),
            ..Self::default()
        })
    }

    /// Reads a system file.
    ///
    /// # Errors
    /// A file that cannot be read, or what [`SystemFile::parse`] finds.
    pub fn read(path: &Path) -> Result<Self, SystemError> {
        let text = recordings::read_written(path).map_err(|error| SystemError::Unreadable {
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

    /// Time between samples of the motion, s.
    ///
    /// # Errors
    /// The value is not a time.
    pub fn sampling(&self) -> Result<Option<f64>, SystemError> {
        self.time("sampling", self.experiment.sampling.as_ref())
    }

    /// Coupling step of the experiment, s.
    ///
    /// # Errors
    /// The value is not a time.
    pub fn step(&self) -> Result<Option<f64>, SystemError> {
        self.time("step", self.experiment.step.as_ref())
    }

    /// Error by which the coupling step is chosen, per cent.
    ///
    /// # Errors
    /// The value is not a positive share.
    pub fn variable_step(&self) -> Result<Option<f64>, SystemError> {
        let written = self.experiment.variable_step.as_ref();
        let share = written.map(value::share).transpose();
        share.map_err(|reason| self.fault("experiment.variable_step", reason))
    }

    /// Least coupling step where it varies, s.
    ///
    /// # Errors
    /// The value is not a time.
    pub fn least_step(&self) -> Result<Option<f64>, SystemError> {
        self.time("least_step", self.experiment.least_step.as_ref())
    }

    /// How much of the motion is played, s.
    ///
    /// # Errors
    /// The value is not a time.
    pub fn duration(&self) -> Result<Option<f64>, SystemError> {
        self.time("duration", self.experiment.duration.as_ref())
    }

    fn time(&self, name: &str, written: Option<&Setting>) -> Result<Option<f64>, SystemError> {
        let time = written.map(value::time).transpose();
        time.map_err(|reason| self.fault(&format!("experiment.{name}"), reason))
    }

    /// What does not hold at a place in this file.
    pub(super) fn fault(&self, place: &str, reason: impl Into<Misfit>) -> SystemError {
        SystemError::Place {
            origin: self.origin.clone(),
            place: place.to_string(),
            reason: Box::new(reason.into()),
        }
    }

    /// Takes out the connections that come from the component `name`.
    pub fn disconnect(&mut self, name: &str) {
        self.connections.retain(
            |link| !matches!(&link.from, Origin::Output(output) if output.component == name),
        );
    }

    /// Connects to what `instead` names in place of its keys, on either side.
    pub fn redirect(&mut self, instead: &BTreeMap<VariableName, VariableName>) {
        let change = |name: &mut VariableName| {
            if let Some(other) = instead.get(name) {
                name.clone_from(other);
            }
        };
        for link in &mut self.connections {
            if let Origin::Output(name) = &mut link.from {
                change(name);
            }
            change(&mut link.to);
        }
    }

    /// Connects whatever takes the present reference to the motion that the component `structure` asks
    /// a table for. What takes the reference ahead of time is left open: a structure that reacts to
    /// what stands on it cannot tell.
    pub fn follow(&mut self, structure: &str) {
        self.connections.retain_mut(|link| {
            if let Origin::Reference { quantity, ahead } = link.from {
                link.from = Origin::output(structure, &format!("table_{}", quantity.name()));
                return ahead == 0;
            }
            true
        });
    }

    /// Adds the components, connections and experiment of `part`; what `part` says goes before.
    pub fn extend(&mut self, part: Self) {
        self.connections.extend(part.connections);
        self.components.extend(part.components);
        self.tables.extend(part.tables);
        for (name, parameters) in part.adjust {
            if let Some(component) = self.components.get_mut(&name) {
                component.parameters.extend(parameters);
            }
        }
        let (own, other) = (&mut self.experiment, part.experiment);
        own.sampling = other.sampling.or(own.sampling.take());
        own.step = other.step.or(own.step.take());
        own.variable_step = other.variable_step.or(own.variable_step.take());
        own.least_step = other.least_step.or(own.least_step.take());
        own.start = other.start.or(own.start.take());
        own.algorithm = other.algorithm.or(own.algorithm.take());
        own.duration = other.duration.or(own.duration.take());
        own.record = other.record.or(own.record.take());
        own.reference = other.reference.or(own.reference.take());
        own.end_when = other.end_when.or(own.end_when.take());
        own.end_cause = other.end_cause.or(own.end_cause.take());
        own.stop = other.stop.or(own.stop.take());
        own.end_after = other.end_after.or(own.end_after.take());
    }
}
