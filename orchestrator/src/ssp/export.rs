//! Writing a system as an SSP archive, which holds its components and its motion.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::ANNOTATION;
use super::STRUCTURE;
use crate::error::Error;
use crate::fmu::{BaseUnit, Causality, Datum, FmiVersion, Item, Kind, Variable};
use crate::motion::Motion;
use crate::pack;
use crate::system::{Component, Connection, Quantity, Source, System, Value};

/// The component that plays the motion.
const MOTION: &str = "reference";
/// Its FMU.
const MOTION_FMU: &str = "ReferenceMotion";
/// The name of every component's set of parameters: readers may ask for one by its name.
const SET: &str = "parameters";
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

/// A connector to be written: its name, whether values go in, and its variable.
struct Connector<'a> {
    name: String,
    kind: &'static str,
    variable: Option<&'a Variable>,
    unit: Option<(&'static str, BaseUnit)>,
}

impl<'a> Writer<'a> {
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
                if !(0..=AHEAD).contains(&ahead) {
                    let origin = self.system.origin(connection.source);
                    return Err(self.fault(format!(
                        "`{origin}` cannot be written: the component that plays the motion knows \
                         it up to {AHEAD} samples ahead"
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
        let file = self.fmu(part)?;
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
        for position in part.fmu.description.of(Causality::Output) {
            if variables[position].kind.travels() {
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

    /// An element of the system.
    fn element(
        &mut self,
        name: &str,
        file: &str,
        connectors: &[Connector],
        values: &str,
        period: Option<f64>,
    ) -> String {
        let mut text = format!(
            "      <ssd:Component name=\"{}\" type=\"application/x-fmu-sharedlibrary\" \
             source=\"resources/{}\">\n",
            escape(name),
            escape(&uri(file))
        );
        if !connectors.is_empty() {
            text += "        <ssd:Connectors>\n";
            for connector in connectors {
                let kind = self.connector_type(connector);
                let _ = writeln!(
                    text,
                    "          <ssd:Connector name=\"{}\" kind=\"{}\">{kind}</ssd:Connector>",
                    escape(&connector.name),
                    connector.kind
                );
            }
            text += "        </ssd:Connectors>\n";
        }
        if !values.is_empty() {
            let _ = write!(
                text,
                "        <ssd:ParameterBindings>\n          <ssd:ParameterBinding>\n            \
                 <ssd:ParameterValues>\n            <ssv:ParameterSet version=\"1.0\" \
                 name=\"{SET}\">\n            <ssv:Parameters>\n{values}            \
                 </ssv:Parameters>\n            </ssv:ParameterSet>\n            \
                 </ssd:ParameterValues>\n          </ssd:ParameterBinding>\n        \
                 </ssd:ParameterBindings>\n"
            );
        }
        if let Some(period) = period {
            let _ = writeln!(
                text,
                "        <ssd:Annotations><ssc:Annotation type=\"{ANNOTATION}\">\
                 <shakebench:Component period=\"{period}\"/></ssc:Annotation></ssd:Annotations>"
            );
        }
        text += "      </ssd:Component>\n";
        text
    }

    fn connector_type(&mut self, connector: &Connector) -> String {
        let kind = connector
            .variable
            .map_or(&Kind::Float64, |variable| &variable.kind);
        let unit = match (connector.variable, connector.unit) {
            (_, Some((name, base))) => Some((name.to_string(), base)),
            (Some(variable), _) => variable.unit.clone().zip(variable.base_unit),
            _ => None,
        };
        match kind {
            // The names of FMI 2.0, which readers of both versions know.
            Kind::Float64 | Kind::Float32 => match unit {
                None => "<ssc:Real/>".to_string(),
                Some((name, base)) => {
                    let text = format!("<ssc:Real unit=\"{}\"/>", escape(&name));
                    self.units.insert(name, base);
                    text
                }
            },
            Kind::Boolean => "<ssc:Boolean/>".to_string(),
            Kind::String => "<ssc:String/>".to_string(),
            Kind::Binary => "<ssc:Binary/>".to_string(),
            Kind::Enumeration(items) => {
                let known = self.enumerations.iter().find(|(_, known)| known == items);
                let name = match known {
                    Some((name, _)) => name.clone(),
                    None => {
                        let name = format!("Choices{}", self.enumerations.len() + 1);
                        self.enumerations.push((name.clone(), items.clone()));
                        name
                    }
                };
                format!("<ssc:Enumeration name=\"{name}\"/>")
            }
            _ => "<ssc:Integer/>".to_string(),
        }
    }

    /// The file of a component's FMU in the archive.
    fn fmu(&mut self, part: &Component) -> Result<String, Error> {
        let sum = &part.fmu.sha256;
        let known = self.fmus.iter().find(|(_, content)| content.sum == *sum);
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
        let bytes = fs::read(file).map_err(|error| Error::File {
            path: file.clone(),
            reason: error.to_string(),
        })?;
        let content = Content {
            sum: sum.clone(),
            bytes,
        };
        self.fmus.insert(name.clone(), content);
        Ok(name)
    }

    fn connections(&self) -> Result<String, Error> {
        let mut text = String::new();
        let mut arrays: HashMap<(usize, usize), ()> = HashMap::new();
        for connection in &self.system.connections {
            let part = &self.system.components[connection.component];
            let target = &part.fmu.description.variables[connection.input];
            if target.is_element {
                // An array is connected as a whole, once.
                let first = connection.input - target.element.0;
                if arrays.insert((connection.component, first), ()).is_some() {
                    continue;
                }
                self.whole(connection, first)?;
            }
            let (element, start) = self.start(connection);
            let element = element.map_or(String::new(), |name| {
                format!("startElement=\"{}\" ", escape(&name))
            });
            let passage = &connection.passage;
            let transformed = if !passage.map.is_empty() {
                let entries = passage.map.iter().map(|(from, to)| {
                    if target.kind == Kind::Boolean {
                        let (from, to) = (*from != 0.0, *to != 0.0);
                        format!("<ssc:MapEntry source=\"{from}\" target=\"{to}\"/>")
                    } else {
                        format!("<ssc:MapEntry source=\"{from}\" target=\"{to}\"/>")
                    }
                });
                let kind = match target.kind {
                    Kind::Boolean => "BooleanMappingTransformation",
                    _ => "IntegerMappingTransformation",
                };
                let entries: String = entries.collect();
                Some(format!("<ssc:{kind}>{entries}</ssc:{kind}>"))
            } else if passage.factor != 1.0 || passage.offset != 0.0 {
                // Not every reader converts units: what it would do is written out.
                Some(format!(
                    "<ssc:LinearTransformation factor=\"{}\" offset=\"{}\"/>",
                    passage.factor, passage.offset
                ))
            } else {
                None
            };
            let _ = write!(
                text,
                "      <ssd:Connection {element}startConnector=\"{}\" endElement=\"{}\" \
                 endConnector=\"{}\"",
                escape(&start),
                escape(&part.name),
                escape(&connector_name(part, connection.input)),
            );
            text += &match transformed {
                None => "/>\n".to_string(),
                Some(inner) => {
                    format!(" suppressUnitConversion=\"true\">{inner}</ssd:Connection>\n")
                }
            };
        }
        Ok(text)
    }

    /// Whether all elements of an input's array are driven by those of one output's array.
    fn whole(&self, connection: &Connection, first: usize) -> Result<(), Error> {
        let part = &self.system.components[connection.component];
        let size = part.fmu.description.variables[first].element.1;
        let all = self.system.connections.iter().filter(|other| {
            other.component == connection.component && (first..first + size).contains(&other.input)
        });
        let mut count = 0;
        let mut alike = true;
        let mut array = None;
        for other in all {
            count += 1;
            let Source::Output {
                component,
                variable,
            } = other.source
            else {
                alike = false;
                break;
            };
            let output = &self.system.components[component].fmu.description.variables[variable];
            let base = (component, variable - output.element.0);
            alike &= *array.get_or_insert(base) == base
                && output.element.0 == other.input - first
                && other.passage == connection.passage;
        }
        if alike && count == size {
            return Ok(());
        }
        Err(self.fault(format!(
            "`{}.{}` is an array whose elements are driven one by one, which the format does not \
             hold",
            part.name,
            connector_name(part, connection.input)
        )))
    }

    /// The element and connector that a connection begins at.
    fn start(&self, connection: &Connection) -> (Option<String>, String) {
        match connection.source {
            Source::Reference { quantity, ahead } => {
                (Some(MOTION.to_string()), tap(quantity, ahead))
            }
            Source::Output {
                component,
                variable,
            } => {
                let part = &self.system.components[component];
                (Some(part.name.clone()), connector_name(part, variable))
            }
            Source::Table { .. } => (None, self.system.origin(connection.source).to_string()),
        }
    }

    /// Enumerations and units.
    fn definitions(&self) -> String {
        let mut text = String::new();
        if !self.enumerations.is_empty() {
            text += "  <ssd:Enumerations>\n";
            for (name, items) in &self.enumerations {
                let _ = write!(text, "    <ssc:Enumeration name=\"{name}\">");
                for item in items {
                    let _ = write!(
                        text,
                        "<ssc:Item name=\"{}\" value=\"{}\"/>",
                        escape(&item.name),
                        item.value
                    );
                }
                text += "</ssc:Enumeration>\n";
            }
            text += "  </ssd:Enumerations>\n";
        }
        if !self.units.is_empty() {
            text += "  <ssd:Units>\n";
            for (name, base) in &self.units {
                let _ = write!(
                    text,
                    "    <ssc:Unit name=\"{}\"><ssc:BaseUnit",
                    escape(name)
                );
                let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
                for (name, exponent) in names.iter().zip(base.exponents) {
                    if exponent != 0 {
                        let _ = write!(text, " {name}=\"{exponent}\"");
                    }
                }
                if base.factor != 1.0 {
                    let _ = write!(text, " factor=\"{}\"", base.factor);
                }
                if base.offset != 0.0 {
                    let _ = write!(text, " offset=\"{}\"", base.offset);
                }
                text += "/></ssc:Unit>\n";
            }
            text += "  </ssd:Units>\n";
        }
        text
    }

    /// What the standard has no place for.
    fn annotation(&self, experiment: &Experiment) -> String {
        let mut more = String::new();
        let name = |&(component, variable): &(usize, usize)| {
            escape(&self.system.variable_name(component, variable).to_string())
        };
        if let Some(end) = &self.system.end {
            let _ = write!(more, " endWhen=\"{}\"", name(&end.when));
            if let Some(cause) = &end.cause {
                let _ = write!(more, " endCause=\"{}\"", name(cause));
            }
            let _ = write!(more, " endAfter=\"{}\"", end.after);
        }
        if let Some(stop) = &self.system.stop {
            let _ = write!(more, " stop=\"{}\"", name(stop));
        }
        if let Some(motion) = experiment.motion {
            let _ = write!(more, " sampling=\"{}\"", motion.dt);
        }
        format!(
            "  <ssd:Annotations><ssc:Annotation type=\"{ANNOTATION}\"><shakebench:Experiment \
             step=\"{}\" algorithm=\"{}\"{more}/></ssc:Annotation></ssd:Annotations>\n",
            experiment.step,
            escape(&experiment.algorithm),
        )
    }
}

/// The output of the motion's component for a tap.
fn tap(quantity: Quantity, ahead: isize) -> String {
    match ahead {
        0 => quantity.name().to_string(),
        ahead => format!("{}[{ahead}]", quantity.name()),
    }
}

/// The name of a variable, or of the array that it is an element of.
fn connector_name(part: &Component, position: usize) -> String {
    let variable = &part.fmu.description.variables[position];
    match variable.name.rsplit_once('[') {
        Some((array, _)) if variable.is_element => array.to_string(),
        _ => variable.name.clone(),
    }
}

/// A value as an element of a parameter set.
fn typed(kind: &Kind, value: &Value) -> String {
    match (kind, value) {
        (Kind::Boolean, Value::Number(number)) => {
            format!("<ssv:Boolean value=\"{}\"/>", *number != 0.0)
        }
        // By its number: not every reader knows the names of choices.
        (Kind::Enumeration(_), Value::Number(number)) => {
            format!("<ssv:Integer value=\"{number}\"/>")
        }
        (Kind::Float64 | Kind::Float32, Value::Number(number)) => {
            format!("<ssv:Real value=\"{number}\"/>")
        }
        (_, Value::Number(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (_, Value::Signed(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (_, Value::Unsigned(number)) => format!("<ssv:Integer value=\"{number}\"/>"),
        (Kind::Binary, Value::Text(text)) => format!("<ssv:Binary value=\"{text}\"/>"),
        (_, Value::Text(text)) => format!("<ssv:String value=\"{}\"/>", escape(text)),
    }
}

/// An array's values, as of SSP 2.0.
fn array(part: &Component, first: usize) -> String {
    let variables = &part.fmu.description.variables;
    let variable = &variables[first];
    let size = variable.element.1;
    let given = part.given();
    let data: Vec<Datum> = (first..first + size)
        .map(|position| part.start_value(&given, position))
        .collect();
    let kind = match variable.kind {
        Kind::Boolean => "Boolean",
        Kind::Float64 | Kind::Float32 => "Real",
        Kind::String => "String",
        Kind::Binary => "Binary",
        _ => "Integer",
    };
    let inner = match variable.kind {
        Kind::String | Kind::Binary => {
            let all = data
                .iter()
                .map(|datum| format!("<ssv:Value value=\"{}\"/>", escape(&datum.to_string())));
            format!("<ssv:{kind}>{}</ssv:{kind}>", all.collect::<String>())
        }
        _ => {
            let all: Vec<String> = data
                .iter()
                .map(|datum| match variable.kind {
                    Kind::Boolean => (datum.number() != 0.0).to_string(),
                    _ => datum.to_string(),
                })
                .collect();
            format!("<ssv:{kind} value=\"{}\"/>", all.join(" "))
        }
    };
    format!(
        "              <ssv:Parameter name=\"{}\">{inner}<ssc:Dimension size=\"{size}\"/>\
         </ssv:Parameter>\n",
        escape(&connector_name(part, first))
    )
}

/// A file's name as part of a URI.
fn uri(name: &str) -> String {
    const KEPT: &percent_encoding::AsciiSet = &percent_encoding::NON_ALPHANUMERIC
        .remove(b'-')
        .remove(b'_')
        .remove(b'.')
        .remove(b'~');
    percent_encoding::utf8_percent_encode(name, KEPT).to_string()
}

/// A text in an attribute.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\n' => out += "&#10;",
            '\r' => out += "&#13;",
            '\t' => out += "&#9;",
            // XML has no place for these.
            character if character.is_control() => out.push('\u{fffd}'),
            character => out.push(character),
        }
    }
    out
}
