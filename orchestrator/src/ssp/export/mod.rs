//! Writing a system as an SSP archive, which holds its components and its motion.

mod connections;
mod definitions;
mod elements;
mod text;
mod values;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::ANNOTATION;
use super::STRUCTURE;
use crate::error::Error;
use crate::fmu::{BaseUnit, Causality, FmiVersion, Item, Kind, Variable};
use crate::motion::Motion;
use crate::pack::{self, StartValue};
use crate::system::{Component, Quantity, Source, System, Value};
use elements::Connector;
use text::{connector_name, escape, tap};
use values::{array, typed};

/// The component that plays the motion.
const MOTION: &str = "reference";
/// Its FMU.
const MOTION_FMU: &str = "ReferenceMotion";
/// Samples ahead that it has as outputs.
const AHEAD: isize = 20;

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
}

/// Writes `system` to the archive `path` and gives what the user should know.
///
/// # Errors
/// What the format does not hold, an FMU that cannot be read, a file that cannot be written.
pub fn write(system: &System, experiment: &Experiment, path: &Path) -> Result<Vec<String>, Error> {
    let mut writer = Writer {
        system,
        units: BTreeMap::new(),
        enumerations: Vec::new(),
        fmus: BTreeMap::new(),
        notes: Vec::new(),
        path,
    };
    let text = writer.structure(experiment)?;
    let mut entries = BTreeMap::from([(STRUCTURE.to_string(), text.into_bytes())]);
    for (name, content) in std::mem::take(&mut writer.fmus) {
        entries.insert(format!("resources/{name}"), content.bytes);
    }
    pack::write_archive(path, &entries, None)?;
    Ok(writer.notes)
}

struct Writer<'a> {
    system: &'a System,
    units: BTreeMap<String, BaseUnit>,
    enumerations: Vec<(String, Vec<Item>)>,
    /// Files in `resources` by name.
    fmus: BTreeMap<String, Content>,
    notes: Vec<String>,
    path: &'a Path,
}

struct Content {
    /// The FMU's checksum.
    sum: String,
    bytes: Vec<u8>,
}

impl Writer<'_> {
    fn fault(&self, reason: String) -> Error {
        Error::File {
            path: self.path.to_path_buf(),
            reason,
        }
    }

    fn structure(&mut self, experiment: &Experiment) -> Result<String, Error> {
        let connections = self.connections()?;
        let mut elements = String::new();
        let mut from_motion: Vec<(Quantity, isize)> = Vec::new();
        for connection in &self.system.connections {
            if let Source::Reference { quantity, ahead } = connection.source
                && !from_motion.contains(&(quantity, ahead))
            {
                if !(-1..=AHEAD).contains(&ahead) {
                    let origin = self.system.origin(connection.source);
                    return Err(self.fault(format!(
                        "`{origin}` cannot be written: the component that plays the motion knows \
                         it from one sample before to {AHEAD} samples ahead"
                    )));
                }
                from_motion.push((quantity, ahead));
            }
        }
        if !from_motion.is_empty() {
            elements += &self.motion(experiment, &from_motion)?;
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
                "input tables do not go along: the system has the inputs `{}`",
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
    fn motion(
        &mut self,
        experiment: &Experiment,
        taps: &[(Quantity, isize)],
    ) -> Result<String, Error> {
        let Some(motion) = experiment.motion else {
            return Err(self.fault("the system follows a motion, and there is none".to_string()));
        };
        let all = pack::all_fmus()?;
        let found = all
            .iter()
            .find(|fmu| fmu.name == MOTION_FMU && fmu.version == experiment.fmi);
        let found = found.ok_or_else(|| self.fault(format!("`{MOTION_FMU}` is not built")))?;
        let mut table = String::from("time,displacement,velocity,acceleration\n");
        let rows = motion
            .displacement
            .iter()
            .zip(&motion.velocity)
            .zip(&motion.acceleration);
        for (sample, ((x, v), a)) in rows.enumerate() {
            let _ = writeln!(table, "{},{x},{v},{a}", sample as f64 * motion.dt);
        }
        let bytes = pack::with_resource(&found.path, "motion.csv", table.into_bytes())?;
        let name = format!("{MOTION_FMU}.fmu");
        let sum = String::new();
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

    fn component(&mut self, index: usize) -> Result<String, Error> {
        let part = &self.system.components[index];
        let choices = choices(part);
        let file = self.fmu(part, &choices)?;
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
            if variables[position].kind.travels() {
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
            if kind.travels() && (!is_choice || is_connected(position)) {
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
            if choices
                .iter()
                .any(|start| start.name == variables[*position].name)
            {
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
    fn fmu(&mut self, part: &Component, starts: &[StartValue]) -> Result<String, Error> {
        let mut sum = part.fmu.sha256.clone();
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
        let bytes = match starts {
            [] => fs::read(file).map_err(|error| Error::File {
                path: file.clone(),
                reason: error.to_string(),
            })?,
            starts => pack::variant_bytes(file, starts)?,
        };
        self.fmus.insert(name.clone(), Content { sum, bytes });
        Ok(name)
    }
}

/// The choices that a component of this project is given, which its FMU starts with in the archive: not
/// every reader sets an enumeration.
fn choices(part: &Component) -> Vec<StartValue> {
    let variables = &part.fmu.description.variables;
    let is_choice = |position: usize| {
        let variable = &variables[position];
        matches!(variable.kind, Kind::Enumeration(_))
            && variable.causality == Causality::Parameter
            && !variable.is_element
    };
    let given = part.parameters.iter();
    let chosen = given.filter_map(|(position, value)| match value {
        Value::Number(value) if part.fmu.is_own && is_choice(*position) => Some(StartValue {
            name: variables[*position].name.clone(),
            value: *value,
            note: String::new(),
        }),
        _ => None,
    });
    chosen.collect()
}
