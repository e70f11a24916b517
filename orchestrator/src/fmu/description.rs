//! What an FMU says of itself, the same for FMI 2.0 and 3.0.

use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::path::Path;

use fmi_rs::model_description::{fmi2, fmi3};

use super::FmuError;

/// The version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum FmiVersion {
    /// FMI 2.0.
    #[serde(rename = "2.0")]
    V2,
    /// FMI 3.0.
    #[serde(rename = "3.0")]
    V3,
}

impl fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        })
    }
}

/// The type of a variable, named as in FMI 3.0.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// FMI 2.0 Real.
    Float64,
    /// FMI 2.0 Integer.
    Int32,
    /// A choice: names and values.
    Enumeration(Vec<(String, i64)>),
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
        Some("2.0") => from_fmi2(&text).map_err(wrong)?,
        Some(version) if version.starts_with("3.") => from_fmi3(&text).map_err(wrong)?,
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

fn from_fmi2(text: &str) -> Result<Description, String> {
    let file = fmi2::ModelDescription::from_string(text).map_err(|error| error.to_string())?;
    let Some(interface) = &file.coSimulation else {
        return Err("no <CoSimulation>: the FMU offers model exchange only".to_string());
    };
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    for variable in &file.modelVariables {
        use fmi2::{Causality as C, Variability as V, VariableType as T};
        let items = |declared: &str| match file.get_type_definition(declared) {
            Some(fmi2::SimpleType::Enumeration { items, .. }) => items
                .iter()
                .map(|item| (item.name.clone(), i64::from(item.value)))
                .collect(),
            _ => Vec::new(),
        };
        let display_unit = match &variable.variableType {
            T::Real { displayUnit, .. } => displayUnit.clone(),
            _ => None,
        };
        variables.push(Variable {
            name: variable.name.clone(),
            reference: variable.valueReference,
            kind: match &variable.variableType {
                T::Real { .. } => Kind::Float64,
                T::Integer { .. } => Kind::Int32,
                T::Boolean { .. } => Kind::Boolean,
                T::String { .. } => Kind::String,
                T::Enumeration { declaredType, .. } => Kind::Enumeration(items(declaredType)),
            },
            causality: match variable.causality {
                C::Parameter => Causality::Parameter,
                C::Input => Causality::Input,
                C::Output => Causality::Output,
                _ => Causality::Local,
            },
            variability: match variable.variability {
                V::Constant | V::Fixed => Variability::Fixed,
                V::Tunable => Variability::Tunable,
                V::Discrete => Variability::Discrete,
                V::Continuous => Variability::Continuous,
            },
            unit: file.get_unit(variable).map(str::to_string),
            display_unit,
            start: variable.variableType.start().clone(),
            description: variable.description.clone().unwrap_or_default(),
            dependencies: Vec::new(),
        });
    }
    for output in &file.outputs {
        // Counted from 1 by position.
        let known = output.dependencies.as_ref();
        let known = known.map(|all| all.iter().map(|&index| index.wrapping_sub(1) as usize));
        depend(&mut variables, output.index.wrapping_sub(1) as usize, known)?;
    }
    let remarks = file.validate().into_iter().map(|problem| problem.message);
    Ok(Description {
        version: FmiVersion::V2,
        model_identifier: interface.modelIdentifier.clone(),
        saves_state: interface.canGetAndSetFMUstate,
        variable_step: interface.canHandleVariableCommunicationStepSize,
        offers_model_exchange: file.modelExchange.is_some(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        remarks: remarks.collect(),
        model_name: file.modelName,
        token: file.guid,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
    })
}

fn from_fmi3(text: &str) -> Result<Description, String> {
    let file = fmi3::ModelDescription::from_string(text).map_err(|error| error.to_string())?;
    let Some(interface) = &file.coSimulation else {
        return Err("no <CoSimulation>: the FMU does not offer co-simulation".to_string());
    };
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    for variable in &file.modelVariables {
        use fmi3::{Causality as C, Variability as V, VariableType as T};
        let items = |declared: &str| match file.get_type_definition(declared) {
            Some(fmi3::TypeDefinition::Enumeration { items, .. }) => items
                .iter()
                .map(|item| (item.name.clone(), item.value))
                .collect(),
            _ => Vec::new(),
        };
        let display_unit = match &variable.variableType {
            T::Float64 { displayUnit, .. } => displayUnit.clone(),
            _ => None,
        };
        variables.push(Variable {
            name: variable.name.clone(),
            reference: variable.valueReference,
            kind: match &variable.variableType {
                other if !variable.dimensions.is_empty() => {
                    Kind::Other(format!("array of {}", other.name()))
                }
                T::Float64 { .. } => Kind::Float64,
                T::Int32 { .. } => Kind::Int32,
                T::Boolean { .. } => Kind::Boolean,
                T::String { .. } => Kind::String,
                T::Enumeration { declaredType, .. } => Kind::Enumeration(items(declaredType)),
                other => Kind::Other(other.name().to_string()),
            },
            causality: match variable.causality {
                C::Parameter | C::StructuralParameter => Causality::Parameter,
                C::Input => Causality::Input,
                C::Output => Causality::Output,
                _ => Causality::Local,
            },
            variability: match variable.variability {
                V::Constant | V::Fixed => Variability::Fixed,
                V::Tunable => Variability::Tunable,
                V::Discrete => Variability::Discrete,
                V::Continuous => Variability::Continuous,
            },
            unit: file.get_unit(variable).map(str::to_string),
            display_unit,
            start: variable.variableType.start().map(|all| all.join(" ")),
            description: variable.description.clone().unwrap_or_default(),
            dependencies: Vec::new(),
        });
    }
    let positions: HashMap<u32, usize> = (0..variables.len())
        .map(|index| (variables[index].reference, index))
        .collect();
    let position = |reference: u32| positions.get(&reference).copied().unwrap_or(usize::MAX);
    for output in &file.outputs {
        let known = output.dependencies.as_ref();
        let known = known.map(|all| all.iter().map(|&reference| position(reference)));
        depend(&mut variables, position(output.valueReference), known)?;
    }
    let remarks = file.validate().into_iter().map(|problem| problem.message);
    Ok(Description {
        version: FmiVersion::V3,
        model_identifier: interface.modelIdentifier.clone(),
        saves_state: interface.canGetAndSetFMUState,
        variable_step: interface.canHandleVariableCommunicationStepSize,
        offers_model_exchange: file.modelExchange.is_some(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        remarks: remarks.collect(),
        model_name: file.modelName,
        token: file.instantiationToken,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
    })
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
