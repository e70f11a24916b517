//! Writing a system as an SSP archive, which holds its components and what plays its motion.

mod connections;
mod definitions;
mod elements;
mod text;
mod values;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use super::ANNOTATION;
use super::STRUCTURE;
use super::error::SspError;
use elements::Connector;
use fmi_import::{BaseUnit, Causality, FmiVersion, Item, Kind, Variable};
use fmi_system::{Component, Origin, Quantity, Source, System, Value};
use text::{connector_name, escape, tap};
use values::{array, typed};

/// The component that plays the motion.
const MOTION: &str = "reference";

/// The FMU that plays the motion: its outputs are those of `reference` in a system file.
#[derive(Debug, Clone)]
pub struct Player {
    /// Its name, without `.fmu`.
    pub name: String,
    /// Its file.
    pub fmu: Vec<u8>,
    /// Samples ahead that it has as outputs; negative: before.
    pub ahead: RangeInclusive<isize>,
}

/// A parameter and the value that an FMU shall start with, SI; of an enumeration the number of the
/// choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The parameter's name.
    pub name: String,
    /// Its value.
    pub value: f64,
}

/// Makes what goes into an archive beside the system.
pub trait Supply {
    /// The FMU that plays the motion; none for a system without one.
    ///
    /// # Errors
    /// It cannot be made.
    fn player(&self) -> Result<Option<Player>, Box<dyn std::error::Error + Send + Sync>>;

    /// The bytes of the FMU `file` with other start values.
    ///
    /// # Errors
    /// They cannot be made.
    fn starting_with(
        &self,
        file: &Path,
        starts: &[Start],
    ) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>>;

    /// The FMU of a component with a file that it needs; none where it needs none.
    ///
    /// # Errors
    /// The file cannot be read.
    fn carrying(
        &self,
        component: &Component,
    ) -> Result<Option<Carrying>, Box<dyn std::error::Error + Send + Sync>> {
        let _ = component;
        Ok(None)
    }
}

/// An FMU that carries a file which a parameter names otherwise.
#[derive(Debug, Clone)]
pub struct Carrying {
    /// The FMU with the file in it.
    pub fmu: Vec<u8>,
    /// Position of the parameter, which stays out of the archive.
    pub parameter: usize,
    /// A note for people.
    pub note: String,
}

/// What an archive holds, by name, and what the user should know.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    /// The files.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Notes for people.
    pub notes: Vec<String>,
}

/// What goes into an archive beside the system.
#[derive(Clone)]
pub struct Experiment<'a> {
    /// Makes what is needed.
    pub supply: &'a dyn Supply,
    /// Time between samples of the motion, s; none for a system without one.
    pub sampling: Option<f64>,
    /// Coupling step, s.
    pub step: f64,
    /// How long it runs, s.
    pub duration: f64,
    /// The order of calls that the parameters are for.
    pub algorithm: String,
    /// Version of FMI of the component that plays the motion.
    pub fmi: FmiVersion,
}

/// What the archive `path` of `system` holds.
///
/// # Errors
/// What the format does not hold, an FMU that cannot be read.
pub fn contents(
    system: &System,
    experiment: &Experiment,
    path: &Path,
) -> Result<Contents, SspError> {
    let mut writer = Writer {
        system,
        units: BTreeMap::new(),
        enumerations: Vec::new(),
        fmus: BTreeMap::new(),
        supply: experiment.supply,
        notes: Vec::new(),
        path,
    };
    let text = writer.structure(experiment)?;
    let mut files = BTreeMap::from([(STRUCTURE.to_string(), text.into_bytes())]);
    for (name, content) in std::mem::take(&mut writer.fmus) {
        files.insert(format!("resources/{name}"), content.bytes);
    }
    Ok(Contents {
        files,
        notes: writer.notes,
    })
}

struct Writer<'a> {
    system: &'a System,
    units: BTreeMap<String, BaseUnit>,
    enumerations: Vec<(String, Vec<Item>)>,
    /// Files in `resources` by name.
    fmus: BTreeMap<String, Content>,
    supply: &'a dyn Supply,
    notes: Vec<String>,
    path: &'a Path,
}

struct Content {
    /// The FMU's checksum.
    sum: String,
    bytes: Vec<u8>,
}

impl Writer<'_> {
    fn fault(&self, reason: String) -> SspError {
        SspError::Export {
            path: self.path.to_path_buf(),
            reason,
        }
    }

    fn structure(&mut self, experiment: &Experiment) -> Result<String, SspError> {
        let connections = self.connections()?;
        let mut elements = String::new();
        let mut from_motion: Vec<(Quantity, isize)> = Vec::new();
        for connection in &self.system.connections {
            if let Source::Reference { quantity, ahead } = connection.source
                && !from_motion.contains(&(quantity, ahead))
            {
                from_motion.push((quantity, ahead));
            }
        }
        if !from_motion.is_empty() {
            elements += &self.motion(&from_motion)?;
        }
        let mut tables: Vec<String> = Vec::new();
        for connection in &self.system.connections {
            if matches!(connection.source, Source::Table { .. }) {
                let name = self.system.origin(connection.source).to_string();
                if !tables.contains(&name) {
                    tables.push(name);
                }
            }
        }
        for index in 0..self.system.components.len() {
            elements += &self.component(index)?;
        }
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let version = match experiment.fmi {
            FmiVersion::V2 => "1.0",
            FmiVersion::V3 => "2.0",
        };
        let _ = writeln!(
            text,
            "<ssd:SystemStructureDescription \
             xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
             xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" \
             xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
             xmlns:shakebench=\"{ANNOTATION}\" version=\"{version}\" name=\"{}\" \
             description=\"{}\" generationTool=\"shakebench {}\">",
            escape(&self.system.name),
            escape(&self.system.description),
            env!("CARGO_PKG_VERSION"),
        );
        let _ = writeln!(
            text,
            "  <ssd:System name=\"{}\">",
            escape(&self.system.name)
        );
        if !tables.is_empty() {
            text += "    <ssd:Connectors>\n";
            for name in &tables {
                let _ = writeln!(
                    text,
                    "      <ssd:Connector name=\"{}\" kind=\"input\"><ssc:Real/></ssd:Connector>",
                    escape(name)
                );
            }
            text += "    </ssd:Connectors>\n";
            self.notes.push(format!(
                "input tables are not exported: the system has the inputs `{}`",
                tables.join("`, `")
            ));
        }
        let _ = write!(text, "    <ssd:Elements>\n{elements}    </ssd:Elements>\n");
        if !connections.is_empty() {
            let _ = write!(
                text,
                "    <ssd:Connections>\n{connections}    </ssd:Connections>\n"
            );
        }
        text += "  </ssd:System>\n";
        text += &self.definitions();
        let start = self.system.start;
        let _ = writeln!(
            text,
            "  <ssd:DefaultExperiment startTime=\"{start}\" stopTime=\"{}\"/>",
            start + experiment.duration
        );
        text += &self.annotation(experiment);
        text += "</ssd:SystemStructureDescription>\n";
        Ok(text)
    }

    /// The component that plays the motion.
    fn motion(&mut self, taps: &[(Quantity, isize)]) -> Result<String, SspError> {
        let Some(player) = self.supply.player().map_err(SspError::Supply)? else {
            return Err(self.fault("the system needs a motion, and there is none".to_string()));
        };
        let second = taps.iter().find(|(quantity, _)| quantity.is_second());
        if let Some(&(quantity, ahead)) = second {
            let origin = Origin::Reference { quantity, ahead };
            return Err(self.fault(format!(
                "`{origin}` cannot be written: the component that plays the motion has a single axis"
            )));
        }
        let beyond = taps.iter().find(|(_, ahead)| !player.ahead.contains(ahead));
        if let Some(&(quantity, ahead)) = beyond {
            let origin = Origin::Reference { quantity, ahead };
            let (least, most) = (-player.ahead.start(), player.ahead.end());
            return Err(self.fault(format!(
                "`{origin}` cannot be written: the component that plays the motion knows it from \
                 {least} before to {most} samples ahead"
            )));
        }
        let name = format!("{}.fmu", player.name);
        let (sum, bytes) = (String::new(), player.fmu);
        self.fmus.insert(name.clone(), Content { sum, bytes });
        let connectors = taps.iter().map(|&(quantity, ahead)| Connector {
            name: tap(quantity, ahead),
            kind: "output",
            variable: None,
            unit: Some((quantity.unit(), quantity.base_unit())),
        });
        let connectors: Vec<_> = connectors.collect();
        Ok(self.element(MOTION, &name, &connectors, "", None))
    }

    fn component(&mut self, index: usize) -> Result<String, SspError> {
        let part = &self.system.components[index];
        let carried = self.supply.carrying(part).map_err(SspError::Supply)?;
        let parameter = carried.as_ref().map(|carried| carried.parameter);
        let choices = match carried {
            Some(_) => Vec::new(),
            None => choices(part),
        };
        let file = self.fmu(part, &choices, carried)?;
        let variables = &part.fmu.description.variables;
        let mut connectors: Vec<Connector> = Vec::new();
        let mut add = |position: usize, kind: &'static str| {
            let variable: &Variable = &variables[position];
            let name = connector_name(part, position);
            if !connectors.iter().any(|known| known.name == name) {
                connectors.push(Connector {
                    name,
                    kind,
                    variable: Some(variable),
                    unit: None,
                });
            }
        };
        // Inputs and outputs that other systems may want, connected or not.
        for position in part.fmu.description.of(Causality::Input) {
            if variables[position].kind.has_values() {
                add(position, "input");
            }
        }
        // Not every reader bears a connector of an enumeration.
        let is_connected = |position: usize| {
            let wanted = Source::Output {
                component: index,
                variable: position,
            };
            let mut all = self.system.connections.iter();
            all.any(|connection| connection.source == wanted)
        };
        for position in part.fmu.description.of(Causality::Output) {
            let kind = &variables[position].kind;
            let is_choice = matches!(kind, Kind::Enumeration(_));
            if kind.has_values() && (!is_choice || is_connected(position)) {
                add(position, "output");
            }
        }
        let given = part.parameters.iter().chain(&part.inputs);
        let mut values = String::new();
        let mut arrays: Vec<usize> = Vec::new();
        for (position, value) in given {
            let first = position - variables[*position].element.0;
            if variables[*position].is_element {
                if !arrays.contains(&first) {
                    arrays.push(first);
                }
                continue;
            }
            let is_in_the_fmu = choices
                .iter()
                .any(|start| start.name == variables[*position].name);
            if is_in_the_fmu || parameter == Some(*position) {
                continue;
            }
            // Without a unit, it is in the variable's.
            let _ = writeln!(
                values,
                "              <ssv:Parameter name=\"{}\">{}</ssv:Parameter>",
                escape(&variables[*position].name),
                typed(&variables[*position].kind, value)
            );
        }
        for first in arrays {
            values += &array(part, first);
        }
        Ok(self.element(&part.name, &file, &connectors, &values, part.period))
    }

    /// The file of a component's FMU in the archive, with these start values.
    fn fmu(
        &mut self,
        part: &Component,
        starts: &[Start],
        carried: Option<Carrying>,
    ) -> Result<String, SspError> {
        let mut sum = part.fmu.sha256.clone();
        if let Some(carried) = &carried {
            let _ = write!(sum, ",{}", fmi_import::digest(&carried.fmu));
        }
        for start in starts {
            let _ = write!(sum, ",{}={}", start.name, start.value);
        }
        let known = self.fmus.iter().find(|(_, content)| content.sum == sum);
        if let Some((name, _)) = known {
            return Ok(name.clone());
        }
        let stem = part.fmu.path.file_stem().map_or_else(
            || part.fmu.description.model_identifier.clone(),
            |stem| stem.to_string_lossy().into_owned(),
        );
        let mut name = format!("{stem}.fmu");
        let mut number = 2;
        while self.fmus.contains_key(&name) {
            name = format!("{stem}-{number}.fmu");
            number += 1;
        }
        let file: &PathBuf = part.fmu.file();
        let bytes = match (starts, carried) {
            (_, Some(carried)) => {
                self.notes.push(carried.note);
                carried.fmu
            }
            ([], None) => fs::read(file).map_err(|error| SspError::Unreadable {
                path: file.clone(),
                reason: error.to_string(),
            })?,
            (starts, None) => {
                let made = self.supply.starting_with(file, starts);
                made.map_err(SspError::Supply)?
            }
        };
        self.fmus.insert(name.clone(), Content { sum, bytes });
        Ok(name)
    }
}

/// The choices that a component of this project is given, which its FMU starts with in the archive: not
/// every reader sets an enumeration.
fn choices(part: &Component) -> Vec<Start> {
    let variables = &part.fmu.description.variables;
    let is_choice = |position: usize| {
        let variable = &variables[position];
        matches!(variable.kind, Kind::Enumeration(_))
            && variable.causality == Causality::Parameter
            && !variable.is_element
    };
    let given = part.parameters.iter();
    let chosen = given.filter_map(|(position, value)| match value {
        Value::Number(value) if part.fmu.is_own && is_choice(*position) => Some(Start {
            name: variables[*position].name.clone(),
            value: *value,
        }),
        _ => None,
    });
    chosen.collect()
}
