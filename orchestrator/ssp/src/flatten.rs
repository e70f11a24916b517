//! From systems within systems to one list of components, connections and values.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::error::{Fault, SspError};
use super::package::{Package, resolve};
use super::parameters::{Parameters, mapped, read_mapping, read_set};
use super::structure::{self, Binding, Component, Element, File, Names, Structure, System, Values};
use super::wiring::{Port, Wiring};
use super::{BEFORE, STRUCTURE, split, xml};
use fmi_system::{ComponentFile, ExperimentFile, Link, Origin, Setting, SystemFile, VariableName};

/// Systems within systems deeper than this are loops.
const DEEPEST: usize = 32;
/// More components are mistakes or attacks.
const MOST_COMPONENTS: usize = 100_000;

/// Reads the system of an SSP archive; `name` may end in `#VARIANT.ssd`.
///
/// # Errors
/// An archive at fault, with file and line.
pub fn read(name: &str) -> Result<SystemFile, SspError> {
    let (path, variant) = split(name);
    let path = Path::new(path);
    let package = Package::open(path)?;
    let is_open = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("ssd"));
    let own = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let file = match (is_open, own) {
        (true, Some(own)) => own,
        _ => variant.unwrap_or(STRUCTURE).to_string(),
    };
    let structure = open(&package, &file)?;
    let mut flat = Flat {
        package: &package,
        components: BTreeMap::new(),
        wiring: Wiring::default(),
        values: Vec::new(),
        notes: Vec::new(),
        count: 0,
    };
    let place = Place {
        file: file.clone(),
        path: Vec::new(),
        dictionaries: Vec::new(),
        depth: 0,
    };
    flat.system(&structure, &structure.system, &place, &[])?;
    flat.finish(structure, &file, path)
        .map(|file| SystemFile {
            origin: name.to_string(),
            ..file
        })
        .map(|file| SystemFile {
            directory: Some(package.folder().to_path_buf()),
            package: Some(Arc::new(package)),
            ..file
        })
}

/// Reads a description in the archive.
fn open(package: &Package, file: &str) -> Result<Structure, SspError> {
    let read = package.text(file).and_then(|text| structure::read(&text));
    read.map_err(|fault| at(package, file, fault))
}

fn at(package: &Package, file: &str, fault: Fault) -> SspError {
    SspError::File {
        path: package.path.clone(),
        file: file.to_string(),
        line: fault.line,
        reason: fault.reason,
    }
}

/// Where a system stands.
#[derive(Debug, Clone)]
struct Place {
    /// The description that contains it.
    file: String,
    /// Names of the elements from the top.
    path: Vec<String>,
    /// Signal dictionaries that can be seen: their names, and the path of the system that has them.
    dictionaries: Vec<(String, Vec<String>)>,
    depth: usize,
}

/// What has been found so far.
struct Flat<'a> {
    package: &'a Package,
    components: BTreeMap<Vec<String>, ComponentFile>,
    wiring: Wiring,
    /// Values for ports, later ones before earlier ones.
    values: Vec<(Port, Setting)>,
    notes: Vec<String>,
    count: usize,
}

impl Flat<'_> {
    fn fault(&self, place: &Place, line: u32, reason: String) -> SspError {
        let fault = Fault {
            line: Some(line),
            reason,
        };
        at(self.package, &place.file, fault)
    }

    /// Takes in a system; `more` are bindings of the component that refers to it.
    fn system(
        &mut self,
        structure: &Structure,
        system: &System,
        place: &Place,
        more: &[(Binding, Place)],
    ) -> Result<(), SspError> {
        if place.depth > DEEPEST {
            let reason = format!(
                "systems are nested deeper than {DEEPEST}; check for a loop of \
                references"
            );
            return Err(self.fault(place, 1, reason));
        }
        let mut inside = place.clone();
        inside.depth += 1;
        let own = system.dictionaries.iter();
        inside
            .dictionaries
            .extend(own.map(|name| (name.clone(), place.path.clone())));
        // Values of a higher system come later and go before those of a lower one.
        for element in &system.elements {
            let mut below = inside.clone();
            below.path.push(element.name().to_string());
            match element {
                Element::Component(component) => self.component(structure, component, &below)?,
                Element::System(system) => self.system(structure, system, &below, &[])?,
                Element::Signals(signals) => {
                    let mut known = inside.dictionaries.iter().rev();
                    let found = known.find(|(name, _)| *name == signals.dictionary);
                    let Some((name, path)) = found else {
                        let name = &signals.dictionary;
                        let reason = format!("there is no signal dictionary `{name}`");
                        return Err(self.fault(place, signals.line, reason));
                    };
                    let owner = [path.as_slice(), std::slice::from_ref(name)].concat();
                    self.wiring.share(below.path.clone(), owner);
                }
            }
        }
        for connection in &system.connections {
            let done = self.wiring.connect(&place.path, system, connection);
            done.map_err(|error| self.fault(place, connection.line, error.to_string()))?;
        }
        for connector in &system.connectors {
            let port = (place.path.clone(), connector.name.clone());
            self.wiring.declare(port, connector.unit.clone());
        }
        for binding in &system.bindings {
            self.bind(binding, place, Some(system), None)?;
        }
        // In the description that refers to the system, at the same path.
        for (binding, place_of_binding) in more {
            self.bind(binding, place_of_binding, Some(system), None)?;
        }
        Ok(())
    }

    fn component(
        &mut self,
        structure: &Structure,
        component: &Component,
        place: &Place,
    ) -> Result<(), SspError> {
        let wrong = |reason: String| {
            let fault = Fault {
                line: Some(component.line),
                reason: format!("`{}`: {reason}", component.name),
            };
            at(self.package, &place.file, fault)
        };
        self.count += 1;
        if self.count > MOST_COMPONENTS {
            return Err(wrong(format!("more than {MOST_COMPONENTS} components")));
        }
        let Some(source) = &component.source else {
            return Err(wrong(
                "it has no source, so there is nothing to run".to_string(),
            ));
        };
        let (uri, part) = split(source);
        let base = place.file.rsplit_once('/').map_or("", |(folder, _)| folder);
        let kind = component.kind.split(';').next().unwrap_or_default().trim();
        let bindings: Vec<(Binding, Place)> = component
            .bindings
            .iter()
            .map(|binding| (binding.clone(), place.clone()))
            .collect();
        if let Some(id) = part.filter(|_| uri.is_empty()) {
            let found = structure.system.with_id(id);
            let system =
                found.ok_or_else(|| wrong(format!("there is no system with the id `{id}`")))?;
            return self.system(structure, &system.clone(), place, &bindings);
        }
        let file = resolve(base, uri, !self.package.is_unpacked())
            .map_err(|error| wrong(error.to_string()))?;
        match kind {
            "application/x-fmu-sharedlibrary" => {}
            "application/x-ssp-definition" => {
                let other = open(self.package, &file)?;
                let place = Place {
                    file,
                    ..place.clone()
                };
                return self.system(&other, &other.system, &place, &bindings);
            }
            "application/x-ssp-package" => {
                return Err(wrong(format!(
                    "`{file}` is an archive within the archive, which is not supported; unpack \
                     it and refer to its description (application/x-ssp-definition)"
                )));
            }
            other => {
                return Err(wrong(format!(
                    "its type is `{other}`; only FMUs (application/x-fmu-sharedlibrary) and \
                     descriptions (application/x-ssp-definition) can be run"
                )));
            }
        }
        if component.implementation == "ScheduledExecution" {
            return Err(wrong("scheduled execution is not supported".to_string()));
        }
        for connector in &component.connectors {
            let port = (place.path.clone(), connector.name.clone());
            self.wiring.declare(port, connector.unit.clone());
        }
        let part = ComponentFile {
            fmu: file.clone(),
            period: component.period.map(Setting::from),
            ..ComponentFile::default()
        };
        self.components.insert(place.path.clone(), part);
        for (binding, place) in &bindings {
            self.bind(binding, place, None, Some(&file))?;
        }
        Ok(())
    }

    /// Takes in the values of a binding of a system or a component.
    fn bind(
        &mut self,
        binding: &Binding,
        place: &Place,
        system: Option<&System>,
        fmu: Option<&str>,
    ) -> Result<(), SspError> {
        let parameters = match &binding.values {
            Values::Inline(parameters) => prefixed(parameters, &binding.prefix),
            Values::File(file) => {
                let read = |text: &str| read_set(xml::parse(text)?.root_element(), &binding.prefix);
                self.file(file, place, fmu, binding.line, read)?
            }
        };
        let parameters = match &binding.mapping {
            None => parameters,
            Some(names) => {
                let mapping = match names {
                    Names::Inline(mapping) => mapping.clone(),
                    Names::File(file) => {
                        let read = |text: &str| read_mapping(xml::parse(text)?.root_element());
                        self.file(file, place, fmu, binding.line, read)?
                    }
                };
                let done = mapped(&parameters, &mapping);
                let (parameters, notes) =
                    done.map_err(|fault| self.fault(place, binding.line, fault.reason))?;
                self.notes.extend(notes);
                parameters
            }
        };
        for (name, value) in parameters {
            let ports = match system {
                None => vec![(place.path.clone(), name.clone())],
                Some(system) => targets(system, &place.path, &name),
            };
            if ports.is_empty() {
                self.notes.push(format!(
                    "no element has the parameter `{name}`: it is ignored"
                ));
            }
            for port in ports {
                self.values.push((port, value.clone()));
            }
        }
        Ok(())
    }

    /// Reads a file that a binding names.
    fn file<T>(
        &self,
        file: &File,
        place: &Place,
        fmu: Option<&str>,
        line: u32,
        read: impl Fn(&str) -> Result<T, Fault>,
    ) -> Result<T, SspError> {
        let base = place.file.rsplit_once('/').map_or("", |(folder, _)| folder);
        let wrong = |reason: String| self.fault(place, line, reason);
        if file.in_component {
            let fmu = fmu.ok_or_else(|| wrong("a system has no FMU to look in".to_string()))?;
            let inside = resolve("", &file.uri, false).map_err(|error| wrong(error.to_string()))?;
            let text = self.package.text_within(fmu, &inside);
            let read = text.and_then(|text| read(&text));
            return read.map_err(|fault| at(self.package, &format!("{fmu}/{inside}"), fault));
        }
        let name = resolve(base, &file.uri, !self.package.is_unpacked())
            .map_err(|error| wrong(error.to_string()))?;
        let text = self.package.text(&name).and_then(|text| read(&text));
        text.map_err(|fault| at(self.package, &name, fault))
    }

    /// The system as from a file.
    fn finish(
        mut self,
        structure: Structure,
        file: &str,
        path: &Path,
    ) -> Result<SystemFile, SspError> {
        let wrong = |package: &Package, reason: String| at(package, file, Fault::new(reason));
        let mut out = SystemFile::new(&structure.name);
        if out.name.is_empty() {
            out.name = path
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        }
        out.description = structure.description;
        out.is_lenient = true;
        let root_inputs = self
            .wiring
            .resolve(self.components.keys())
            .map_err(|error| wrong(self.package, error.to_string()))?;
        for wire in &root_inputs.wires {
            let (from, to) = (name(&wire.from), name(&wire.to));
            out.connections.push(Link {
                from: Origin::Output(from),
                to,
                way: wire.way.clone(),
                line: None,
            });
        }
        let assigned: BTreeMap<Port, Setting> = self.values.drain(..).collect();
        // A value of a connector of a system goes to what the connector leads to.
        let mut own: BTreeMap<Port, Setting> = BTreeMap::new();
        for (port, value) in &assigned {
            if self.components.contains_key(&port.0) {
                own.insert(port.clone(), value.clone());
            }
        }
        for feed in &root_inputs.feeds {
            let held = feed.along.iter().find_map(|(port, hops)| {
                let value = assigned.get(port)?;
                let value = hops.iter().fold(value.clone(), |value, hop| {
                    super::parameters::along(&value, hop)
                });
                Some(value)
            });
            if let Some(value) = held {
                own.insert(feed.to.clone(), value);
            }
        }
        for ((path, variable), value) in own {
            if let Some(component) = self.components.get_mut(&path) {
                component.parameters.insert(variable, value);
            }
        }
        let motion = self.motion(&mut out)?;
        for (path, component) in self.components {
            if motion && path == [MOTION] {
                continue;
            }
            if out.components.insert(path.join("."), component).is_some() {
                let name = path.join(".");
                let reason = format!("two components are called `{name}`");
                return Err(wrong(self.package, reason));
            }
        }
        for (input, to) in root_inputs.open {
            out.open_inputs.push((input, name(&to)));
        }
        let own = &structure.own;
        let variable = |text: &Option<String>| text.as_ref().and_then(|text| text.parse().ok());
        out.experiment = ExperimentFile {
            step: own.step.map(Setting::from),
            sampling: own.sampling.map(Setting::from),
            reference: motion.then(|| MOTION_TABLE.to_string()),
            start: structure.experiment.0,
            end_when: variable(&own.end_when),
            end_cause: variable(&own.end_cause),
            end_after: own.end_after.map(Setting::from),
            stop: variable(&own.stop),
            algorithm: own.algorithm.clone(),
            ..ExperimentFile::default()
        };
        if let (start, Some(stop)) = structure.experiment {
            let length = stop - start.unwrap_or(0.0);
            if !(length.is_finite() && length > 0.0) {
                let reason = format!(
                    "the default experiment stops at {stop} s, not after its start at {} s",
                    start.unwrap_or(0.0)
                );
                return Err(wrong(self.package, reason));
            }
            out.experiment.duration = Some(Setting::from(length));
        }
        out.notes = self.notes;
        Ok(out)
    }
}

/// The component that plays the motion in archives of this program.
const MOTION: &str = "reference";
/// The motion in its FMU, and where it is put beside the description.
const MOTION_TABLE: &str = "shakebench-motion.csv";

impl Flat<'_> {
    /// Takes the motion out of a component that this program wrote to play it, and connects to the
    /// motion itself in its place, so that another can be played; gives whether there was one.
    fn motion(&mut self, out: &mut SystemFile) -> Result<bool, SspError> {
        let Some(component) = self.components.get(&vec![MOTION.to_string()]) else {
            return Ok(false);
        };
        let fmu = component.fmu.clone();
        let is_ours = self
            .package
            .text_within(&fmu, "modelDescription.xml")
            .is_ok_and(|text| text.contains("modelName=\"ReferenceMotion\""));
        let table = self.package.text_within(&fmu, "resources/motion.csv");
        let wired: Vec<(usize, Origin)> = out
            .connections
            .iter()
            .enumerate()
            .filter_map(|(at, link)| match &link.from {
                Origin::Output(name) if name.component == MOTION => {
                    let text = link.from.to_string();
                    let text = match text.strip_suffix(BEFORE) {
                        Some(own) => format!("{own}[-1]"),
                        None => text,
                    };
                    Some((at, text.parse().ok()?))
                }
                _ => None,
            })
            .collect();
        let from_it =
            |link: &&Link| matches!(&link.from, Origin::Output(name) if name.component == MOTION);
        let all = out.connections.iter().filter(from_it).count();
        let into_it = out
            .connections
            .iter()
            .any(|link| link.to.component == MOTION);
        if let (true, Ok(table), false) = (is_ours && wired.len() == all, table, into_it) {
            let lines = table.split_once('\n').map_or("", |(_, lines)| lines);
            let head = "time [s],displacement [m],velocity [m/s],acceleration [m/s2]";
            let place = self.package.folder().join(MOTION_TABLE);
            let is_temporary = self.package.is_unpacked();
            if is_temporary && std::fs::write(place, format!("{head}\n{lines}")).is_ok() {
                for (at, origin) in wired {
                    out.connections[at].from = origin;
                }
                return Ok(true);
            }
        }
        // The name belongs to the motion.
        let name = "reference_".to_string();
        self.notes.push(format!(
            "the component `{MOTION}` is renamed `{name}`, because `{MOTION}` is the motion"
        ));
        if let Some(component) = self.components.remove(&vec![MOTION.to_string()]) {
            self.components.insert(vec![name.clone()], component);
        }
        for link in &mut out.connections {
            if link.to.component == MOTION {
                link.to.component.clone_from(&name);
            }
            if let Origin::Output(from) = &mut link.from
                && from.component == MOTION
            {
                from.component.clone_from(&name);
            }
        }
        Ok(false)
    }
}

/// A port of a component as a variable.
fn name((path, variable): &Port) -> VariableName {
    VariableName::new(&path.join("."), variable)
}

fn prefixed(parameters: &Parameters, prefix: &str) -> Parameters {
    let all = parameters.iter();
    all.map(|(name, value)| (format!("{prefix}{name}"), value.clone()))
        .collect()
}

/// The ports that a hierarchical name means in a system, all of them.
fn targets(system: &System, path: &[String], name: &str) -> Vec<Port> {
    let mut ports = Vec::new();
    if system.connectors.iter().any(|own| own.name == name) {
        ports.push((path.to_vec(), name.to_string()));
    }
    for element in &system.elements {
        let rest = name.strip_prefix(element.name());
        let Some(rest) = rest.and_then(|rest| rest.strip_prefix('.')) else {
            continue;
        };
        let below = [path, &[element.name().to_string()]].concat();
        match element {
            Element::Component(_) => ports.push((below, rest.to_string())),
            Element::System(system) => ports.extend(targets(system, &below, rest)),
            Element::Signals(_) => {}
        }
    }
    ports
}

#[cfg(test)]
mod tests {
    use super::*;

    const SYSTEM: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="written by others"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
<ssd:System name="root">
 <ssd:Connectors><ssd:Connector name="in" kind="input"><ssc:Real unit=""/></ssd:Connector></ssd:Connectors>
 <ssd:Elements>
  <ssd:Component name="a" type="application/x-fmu-sharedlibrary" source="../models/a.fmu">
   <ssd:Connectors>
    <ssd:Connector name="u" kind="input"><ssc:Real unit="m"/></ssd:Connector>
    <ssd:Connector name="y" kind="output"><ssc:Real unit=""/></ssd:Connector>
   </ssd:Connectors>
   <ssd:ParameterBindings>
    <ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>
     <ssv:Parameter name="k"><ssv:Real value="1"/></ssv:Parameter>
     <ssv:Parameter name="k"><ssv:Real value="2"/></ssv:Parameter>
     <ssv:Parameter name="c"><ssv:Real value="3"/></ssv:Parameter>
    </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>
    <ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>
     <ssv:Parameter name="c"><ssv:Real value="4"/></ssv:Parameter>
    </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding>
   </ssd:ParameterBindings>
  </ssd:Component>
  <ssd:Component name="b" type="application/x-fmu-sharedlibrary" source="b.fmu">
   <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real unit="mm"/></ssd:Connector></ssd:Connectors>
  </ssd:Component>
 </ssd:Elements>
 <ssd:Connections>
  <ssd:Connection startElement="" startConnector="in" endElement="a" endConnector="u"/>
  <ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"/>
 </ssd:Connections>
</ssd:System>
</ssd:SystemStructureDescription>"#;

    #[test]
    fn what_other_tools_write_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("system");
        std::fs::create_dir(&inner).unwrap();
        let path = inner.join("SystemStructure.ssd");
        std::fs::write(&path, SYSTEM).unwrap();
        let file = read(&path.to_string_lossy()).unwrap();
        // An empty name of an element is the system itself.
        assert_eq!(file.open_inputs.len(), 1);
        assert_eq!(file.open_inputs[0].0, "in");
        let a = &file.components["a"];
        // A description on the disk may refer to files beside its folder.
        assert_eq!(a.fmu, "../models/a.fmu");
        // The last entry of a set counts, and the last binding.
        let value = |name: &str| match &a.parameters[name] {
            Setting::Declared(declared) => declared.value.clone(),
            other => other.clone(),
        };
        assert_eq!(value("k"), Setting::Number(2.0));
        assert_eq!(value("c"), Setting::Number(4.0));
        // An empty unit states none.
        let link = &file.connections[0];
        assert!(link.way.start.is_none());
    }

    #[test]
    fn nothing_outside_of_an_archive_is_reached() {
        assert!(resolve("", "../a.fmu", false).is_err());
        assert!(resolve("resources", "../../a.fmu", false).is_err());
        assert_eq!(resolve("resources", "../a.fmu", false).unwrap(), "a.fmu");
        assert_eq!(resolve("x", "../../a.fmu", true).unwrap(), "../a.fmu");
        assert!(resolve("", "..", true).is_err());
    }
}
