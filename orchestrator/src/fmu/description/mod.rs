//! What an FMU says of itself, the same for FMI 2.0 and 3.0.

mod fmi2;
mod fmi3;

use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::path::Path;

use super::FmuError;

/// The version of the standard.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
pub enum FmiVersion {
    /// FMI 2.0.
    #[serde(rename = "2.0")]
    V2,
    /// FMI 3.0.
    #[serde(rename = "3.0")]
    V3,
}

impl FmiVersion {
    /// Both versions.
    pub const ALL: [Self; 2] = [Self::V2, Self::V3];

    /// The folder of this version: `fmi2` or `fmi3`.
    pub fn folder(self) -> &'static str {
        match self {
            Self::V2 => "fmi2",
            Self::V3 => "fmi3",
        }
    }

    /// The folder inside an FMU that holds the library for this machine.
    pub fn binaries(self) -> String {
        let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
        match (self, os, arch) {
            (Self::V2, "linux", "x86_64") => "binaries/linux64".into(),
            (Self::V2, "windows", "x86_64") => "binaries/win64".into(),
            (Self::V2, "macos", "x86_64") => "binaries/darwin64".into(),
            (_, "macos", arch) => format!("binaries/{arch}-darwin"),
            (_, os, arch) => format!("binaries/{arch}-{os}"),
        }
    }
}

impl fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        })
    }
}

/// One of the choices of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
    /// What it means; may be empty.
    pub description: String,
}

/// The type of a variable, named as in FMI 3.0.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// FMI 2.0 Real.
    Float64,
    /// FMI 2.0 Integer.
    Int32,
    /// A choice.
    Enumeration(Vec<Item>),
    /// True or false.
    Boolean,
    /// Text.
    String,
    /// A type that this program neither sets nor reads.
    Other(String),
}

impl Kind {
    /// The type's name.
    pub fn name(&self) -> &str {
        match self {
            Self::Float64 => "Float64",
            Self::Int32 => "Int32",
            Self::Enumeration(_) => "Enumeration",
            Self::Boolean => "Boolean",
            Self::String => "String",
            Self::Other(name) => name,
        }
    }

    /// Whether a value of it can travel along a connection.
    pub fn is_numeric(&self) -> bool {
        !matches!(self, Self::String | Self::Other(_))
    }
}

/// What a variable is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Set before the run.
    Parameter,
    /// Set at communication points.
    Input,
    /// Computed by the FMU for others.
    Output,
    /// Computed by the FMU for itself, or the time.
    Local,
}

/// When a variable changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variability {
    /// Never, or not after initialization.
    Fixed,
    /// When it is set.
    Tunable,
    /// At steps and events.
    Discrete,
    /// At any time.
    Continuous,
}

/// One variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Value reference.
    pub reference: u32,
    /// Type.
    pub kind: Kind,
    /// What it is for.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// Unit, as the description writes it.
    pub unit: Option<String>,
    /// Unit in which people want to see it.
    pub display_unit: Option<String>,
    /// Start value as written.
    pub start: Option<String>,
    /// One line for people.
    pub description: String,
    /// For outputs: positions of the inputs that it depends on directly.
    pub dependencies: Vec<usize>,
}

/// What the master needs of a `modelDescription.xml`.
#[derive(Debug, Clone)]
pub struct Description {
    /// Version of the standard.
    pub version: FmiVersion,
    /// Name of the model.
    pub model_name: String,
    /// Name of the library, a C identifier.
    pub model_identifier: String,
    /// GUID (2.0) or instantiation token (3.0).
    pub token: String,
    /// One line for people.
    pub about: String,
    /// The tool that made it.
    pub generation_tool: String,
    /// Whether its state can be saved and restored.
    pub saves_state: bool,
    /// Whether it offers model exchange, too.
    pub offers_model_exchange: bool,
    /// Step size that it would like, s.
    pub preferred_step: Option<f64>,
    /// Whether the step size may differ from call to call.
    pub variable_step: bool,
    /// The variables, in the order of the file.
    pub variables: Vec<Variable>,
    /// What the file does against the standard without being unusable.
    pub remarks: Vec<String>,
    positions: HashMap<String, usize>,
}

impl Description {
    /// The position of the variable of that name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.positions.get(name).copied()
    }

    /// The variable of that name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.position(name).map(|index| &self.variables[index])
    }

    /// Positions of the variables of one causality.
    pub fn of(&self, causality: Causality) -> impl Iterator<Item = usize> + '_ {
        (0..self.variables.len()).filter(move |&index| self.variables[index].causality == causality)
    }
}

/// Reads `modelDescription.xml` in the unpacked FMU.
pub(super) fn read(fmu: &Path, unpacked: &Path) -> Result<Description, FmuError> {
    let wrong = |reason: String| FmuError::Description {
        fmu: fmu.to_path_buf(),
        reason,
    };
    let text = fs::read_to_string(unpacked.join("modelDescription.xml"))
        .map_err(|error| wrong(format!("cannot be read as UTF-8 text ({error})")))?;
    let xml = roxmltree::Document::parse(&text)
        .map_err(|error| wrong(format!("not well-formed XML: {error}")))?;
    let root = xml.root_element();
    if root.tag_name().name() != "fmiModelDescription" {
        return Err(wrong(format!(
            "the root element is <{}>, expected <fmiModelDescription>",
            root.tag_name().name()
        )));
    }
    let mut description = match root.attribute("fmiVersion") {
        None => {
            return Err(wrong(
                "the attribute fmiVersion is missing, expected \"2.0\" or \"3.0\"".to_string(),
            ));
        }
        Some("2.0") => fmi2::read(&text).map_err(wrong)?,
        Some(version) if version.starts_with("3.") => fmi3::read(&text).map_err(wrong)?,
        Some(version) => {
            return Err(wrong(format!(
                "fmiVersion is \"{version}\", expected \"2.0\" or \"3.0\""
            )));
        }
    };
    let name = &description.model_identifier;
    let mut letters = name.bytes();
    let starts_well = letters
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || c == b'_');
    if !starts_well || !letters.all(|c| c.is_ascii_alphanumeric() || c == b'_') {
        return Err(wrong(format!(
            "the modelIdentifier `{name}` is no C identifier (letters, digits and `_`), \
             so it cannot name a library"
        )));
    }
    for (index, variable) in description.variables.iter().enumerate() {
        if let Some(first) = description.positions.insert(variable.name.clone(), index) {
            return Err(wrong(format!(
                "the variable `{}` stands there twice (as number {} and {})",
                variable.name,
                first + 1,
                index + 1
            )));
        }
    }
    Ok(description)
}

fn preferred_step(
    experiment: Option<&fmi_rs::model_description::DefaultExperiment>,
) -> Option<f64> {
    let step = experiment?.stepSize.as_ref()?.parse().ok()?;
    (step > 0.0).then_some(step)
}

/// Notes the inputs among `known` (all inputs, where nothing is said) as dependencies of an output.
fn depend(
    variables: &mut [Variable],
    output: usize,
    known: Option<impl Iterator<Item = usize>>,
) -> Result<(), String> {
    let is_input = |index: &usize| {
        variables
            .get(*index)
            .is_some_and(|variable| variable.causality == Causality::Input)
    };
    let dependencies = match known {
        Some(known) => known.filter(is_input).collect(),
        None => (0..variables.len()).filter(is_input).collect(),
    };
    let output = variables.get_mut(output).ok_or_else(|| {
        "<ModelStructure> lists an output that is not among the variables".to_string()
    })?;
    output.dependencies = dependencies;
    Ok(())
}
