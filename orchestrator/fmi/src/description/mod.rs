//! What an FMU says of itself, the same for FMI 2.0 and 3.0.

mod attribute;
mod clock;
mod kind;
mod reader;
#[cfg(feature = "fmi-rs")]
mod second_reader;
mod structure;
mod terminal;
#[cfg(test)]
mod tests;
mod variables;

use std::collections::HashMap;
use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

pub use clock::{InputClock, Ticks};
pub use kind::{Item, Kind};
use structure::DescriptionError;
pub use structure::{BaseUnit, NotANumber};
pub use terminal::{Flow, MatchingRule, Member, Terminal};

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

    /// This machine's folder in `binaries` of an FMU: `linux64` in FMI 2.0, `x86_64-linux` in FMI 3.0.
    pub fn platform(self) -> String {
        use std::env::consts::{ARCH, OS};
        let old = match (OS, ARCH) {
            ("linux", "x86_64") => Some("linux64"),
            ("linux", "x86") => Some("linux32"),
            ("windows", "x86_64") => Some("win64"),
            ("windows", "x86") => Some("win32"),
            ("macos", "x86_64") => Some("darwin64"),
            _ => None,
        };
        match old.filter(|_| self == Self::V2) {
            Some(old) => old.to_string(),
            None => format!("{ARCH}-{}", if OS == "macos" { "darwin" } else { OS }),
        }
    }

    /// The folder inside an FMU that holds the library for this machine.
    pub fn binaries(self) -> String {
        format!("binaries/{}", self.platform())
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

/// One variable, or one element of an array: `A[2,1]` is the element in row 2 and column 1 of `A`.
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
    /// What the unit is in SI, where the description says so.
    pub base_unit: Option<BaseUnit>,
    /// Unit in which people want to see it.
    pub display_unit: Option<String>,
    /// Smallest and largest value that it accepts, where the description says so.
    pub bounds: [Option<f64>; 2],
    /// Start value as written.
    pub start: Option<String>,
    /// Whether a start value can be set before the run.
    pub is_settable: bool,
    /// Whether it is a parameter that sizes arrays.
    pub is_structural: bool,
    /// The clocks that it belongs to, by value reference.
    pub clocks: Vec<u32>,
    /// Place in its array, counted from 0, and number of elements; 0 of 1 where it is not an array.
    pub element: (usize, usize),
    /// Whether it is an element of an array, perhaps of one element.
    pub is_element: bool,
    /// One line for people.
    pub description: String,
    /// For outputs: positions of the inputs that it depends on directly.
    pub dependencies: Arc<[usize]>,
}

impl Variable {
    /// Whether it is a parameter that the standard lets be changed between steps.
    #[must_use]
    pub fn is_tunable(&self) -> bool {
        self.causality == Causality::Parameter && self.variability == Variability::Tunable
    }

    /// Whether it is a real number of its own, not an element of an array.
    #[must_use]
    pub fn is_real_number(&self) -> bool {
        matches!(self.kind, Kind::Float64 | Kind::Float32) && !self.is_element
    }
}

/// How an FMU can be run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interface {
    /// It steps itself.
    CoSimulation,
    /// It gives derivatives; a solver steps it.
    ModelExchange,
    /// Its parts are called by a scheduler, which this program has not.
    ScheduledExecution,
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
    /// How it is run.
    pub interface: Interface,
    /// Whether its events can be handled from outside.
    pub has_event_mode: bool,
    /// Whether a process takes one instance of it only.
    pub only_one_per_process: bool,
    /// Whether it needs the tool that made it.
    pub needs_execution_tool: bool,
    /// Categories of messages that it can be asked for.
    pub log_categories: Vec<String>,
    /// Whether its state can be saved and restored.
    pub saves_state: bool,
    /// Whether a saved state can be written to a file and read again.
    pub writes_state: bool,
    /// Whether it gives derivatives of outputs along changes of inputs.
    pub directional_derivatives: bool,
    /// Whether it gives derivatives of weighted outputs by inputs.
    pub adjoint_derivatives: bool,
    /// Whether it offers model exchange, too.
    pub offers_model_exchange: bool,
    /// Continuous states, as far as the description tells (arrays count once).
    pub states: usize,
    /// Value references of each scalar state and its derivative; empty where the description does not
    /// tell them all.
    pub state_pairs: Vec<(u32, u32)>,
    /// Event indicators, as far as the description tells.
    pub event_indicators: usize,
    /// Step size that it would like, s.
    pub preferred_step: Option<f64>,
    /// Length of its default experiment, s.
    pub default_stop: Option<f64>,
    /// Whether the step size may differ from call to call.
    pub variable_step: bool,
    /// Step by which it computes inside, s, where it says so.
    pub internal_step: Option<f64>,
    /// The variables, in the order of the file.
    pub variables: Vec<Variable>,
    /// Groups of variables that are connected as a whole.
    pub terminals: Vec<Terminal>,
    /// Clocks that the master has to tick (FMI 3.0), those of the highest priority first.
    pub input_clocks: Vec<InputClock>,
    /// What the file does against the standard without being unusable.
    pub remarks: Vec<String>,
    positions: HashMap<String, usize>,
    /// Elements of arrays, by the array's name.
    arrays: HashMap<String, Range<usize>>,
}

impl Description {
    /// Positions of the elements of an array.
    pub fn array(&self, name: &str) -> Option<Range<usize>> {
        self.arrays.get(name).cloned()
    }

    /// The terminal of that name.
    pub fn terminal(&self, name: &str) -> Option<&Terminal> {
        self.terminals.iter().find(|terminal| terminal.name == name)
    }

    /// The position of the variable of that name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.positions.get(name).copied()
    }

    /// The variable of that name.
    pub fn variable(&self, name: &str) -> Option<&Variable> {
        self.position(name).map(|index| &self.variables[index])
    }

    /// Aliases of outputs, in alphabetical order, with their positions.
    pub fn output_aliases(&self) -> impl Iterator<Item = (String, usize)> + '_ {
        let mut all: Vec<(String, usize)> = self
            .positions
            .iter()
            .filter(|(name, index)| {
                let variable = &self.variables[**index];
                variable.causality == Causality::Output && variable.name != **name
            })
            .map(|(name, index)| (name.clone(), *index))
            .collect();
        all.sort();
        all.into_iter()
    }

    /// Adds an input of type Float64 without a unit that the FMU itself has not.
    pub(super) fn add_input(&mut self, name: &str) {
        let references = self.variables.iter().map(|variable| variable.reference);
        let reference = references.max().map_or(0, |most| most.wrapping_add(1));
        let position = self.variables.len();
        self.positions.insert(name.to_string(), position);
        self.variables.push(Variable {
            name: name.to_string(),
            reference,
            kind: Kind::Float64,
            causality: Causality::Input,
            variability: Variability::Continuous,
            unit: None,
            base_unit: None,
            display_unit: None,
            bounds: [None; 2],
            start: Some("0".to_string()),
            is_settable: true,
            is_structural: false,
            clocks: Vec::new(),
            element: (0, 1),
            is_element: false,
            description: String::new(),
            dependencies: [].into(),
        });
    }

    /// Positions of the variables of one causality.
    pub fn of(&self, causality: Causality) -> impl Iterator<Item = usize> + '_ {
        (0..self.variables.len()).filter(move |&index| self.variables[index].causality == causality)
    }

    /// When the input clock at a position ticks; none where there is none.
    pub fn ticks(&self, position: usize) -> Option<Ticks> {
        let variable = self.variables.get(position)?;
        let is_clock = variable.kind == Kind::Clock && variable.causality == Causality::Input;
        let mut clocks = self.input_clocks.iter().filter(|_| is_clock);
        let found = clocks.find(|clock| clock.reference == variable.reference);
        found.map(|clock| clock.ticks)
    }

    /// Whether its clocks can be ticked and read.
    pub fn has_stepped_events(&self) -> bool {
        self.has_event_mode && self.interface == Interface::CoSimulation
    }
}

/// Characters of a remark at most.
const LONGEST_REMARK: usize = 500;

/// Values of structural parameters by value reference, in place of their start values.
pub(super) type Sizes = HashMap<u32, u64>;

/// Reads `modelDescription.xml` in the unpacked FMU, with arrays of the given sizes.
/// Where `exchange` is true and it offers model exchange, it is described as an FMU for that.
pub(super) fn read(
    fmu: &Path,
    unpacked: &Path,
    sizes: &Sizes,
    exchange: bool,
) -> Result<Description, FmuError> {
    let wrong = |reason: String| FmuError::Description {
        fmu: fmu.to_path_buf(),
        reason,
    };
    let refused = |error: DescriptionError| wrong(error.to_string());
    let bytes = fs::read(unpacked.join("modelDescription.xml"))
        .map_err(|error| wrong(format!("cannot be read ({error})")))?;
    let text = structure::decode(bytes).map_err(refused)?;
    super::archive::check_attributes(&text).map_err(|doubt| wrong(doubt.to_string()))?;
    let xml = roxmltree::Document::parse(&text)
        .map_err(|error| wrong(format!("not well-formed XML: {error}")))?;
    let root = xml.root_element();
    if root.tag_name().name() != "fmiModelDescription" {
        return Err(wrong(format!(
            "the root element is <{}>, expected <fmiModelDescription>",
            root.tag_name().name()
        )));
    }
    let version = match root.attribute("fmiVersion") {
        None => {
            return Err(wrong(
                "the attribute fmiVersion is missing; expected \"2.0\" or \"3.0\"".to_string(),
            ));
        }
        Some("2.0") => FmiVersion::V2,
        Some(version) if version.starts_with("3.") => FmiVersion::V3,
        Some("1.0") => {
            let tool = root.attribute("generationTool");
            return Err(wrong(format!(
                "FMI 1.0 is not supported; export the model again for FMI 2.0 or 3.0 from {}, or convert \
                 it: PythonFMU builds an FMI 2.0 FMU from a script that steps this one by fmpy",
                tool.map_or("its tool".to_string(), |tool| format!("`{tool}`"))
            )));
        }
        Some(version) => {
            return Err(wrong(format!(
                "fmiVersion is \"{version}\", expected \"2.0\" or \"3.0\""
            )));
        }
    };
    let mut description = reader::read(root, version, sizes, exchange).map_err(refused)?;
    #[cfg(feature = "fmi-rs")]
    description
        .remarks
        .extend(second_reader::remarks(version, &text));
    let name = &description.model_identifier;
    let mut letters = name.bytes();
    let starts_well = letters
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || c == b'_');
    if !starts_well || !letters.all(|c| c.is_ascii_alphanumeric() || c == b'_') {
        return Err(wrong(format!(
            "the modelIdentifier `{name}` is not a C identifier (letters, digits and `_`), so it \
             cannot name a library"
        )));
    }
    match terminal::read(unpacked) {
        Ok(terminals) => description.terminals = terminals,
        Err(reason) => {
            let remark = format!("terminalsAndIcons.xml cannot be read: {reason}");
            description.remarks.push(remark);
        }
    }
    for remark in &mut description.remarks {
        // Some list all of very many variables.
        if let Some((end, _)) = remark.char_indices().nth(LONGEST_REMARK) {
            remark.truncate(end);
            remark.push_str(" ...");
        }
    }
    structure::name(&mut description, root).map_err(refused)?;
    Ok(description)
}
