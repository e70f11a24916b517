//! A system structure description (SSD) as it stands: elements, connectors, connections, bindings.

use roxmltree::Node;

use super::ANNOTATION;
use super::error::Fault;
use super::parameters::{
    self, Mapping, Parameters, Units, expect, read_mapping, read_set, transformation, unit,
};
use super::xml::{self, child, children, fault, required};
use fmi_system::{DeclaredUnit, Transformation};

/// A system structure description.
#[derive(Debug, Clone)]
pub struct Structure {
    /// Its name.
    pub name: String,
    /// Version of the format.
    pub version: String,
    /// One line for people.
    pub description: String,
    /// The tool that made it.
    pub tool: String,
    /// The system.
    pub(super) system: System,
    /// Default start and stop time, s.
    pub experiment: (Option<f64>, Option<f64>),
    /// What this program wrote beside the standard.
    pub(super) own: Own,
}

/// What this program writes beside the standard, so that it reads its own systems as they were.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Own {
    /// Coupling step, s.
    pub step: Option<f64>,
    /// Sample time of the motion, s.
    pub sampling: Option<f64>,
    /// The order of calls that the parameters are for.
    pub algorithm: Option<String>,
    /// What ends a run, why, and how long it goes on.
    pub end_when: Option<String>,
    pub end_cause: Option<String>,
    pub end_after: Option<f64>,
    /// What is set when a component fails.
    pub stop: Option<String>,
}

/// A system.
#[derive(Debug, Clone)]
pub(super) struct System {
    pub name: String,
    pub id: Option<String>,
    pub connectors: Vec<Connector>,
    pub bindings: Vec<Binding>,
    pub elements: Vec<Element>,
    pub connections: Vec<Connection>,
    /// Names of its signal dictionaries.
    pub dictionaries: Vec<String>,
}

/// An element of a system.
#[derive(Debug, Clone)]
pub(super) enum Element {
    Component(Component),
    System(System),
    /// A place where signals of a dictionary are reached.
    Signals(Signals),
}

/// A component.
#[derive(Debug, Clone)]
pub(super) struct Component {
    pub name: String,
    pub line: u32,
    pub connectors: Vec<Connector>,
    pub bindings: Vec<Binding>,
    /// Its MIME type.
    pub kind: String,
    pub source: Option<String>,
    pub implementation: String,
    /// Sampling period that this program wrote, s.
    pub period: Option<f64>,
}

/// A reference to a signal dictionary.
#[derive(Debug, Clone)]
pub(super) struct Signals {
    pub name: String,
    pub line: u32,
    pub connectors: Vec<Connector>,
    pub dictionary: String,
}

/// A connector.
#[derive(Debug, Clone)]
pub(super) struct Connector {
    pub name: String,
    pub kind: Kind,
    pub unit: Option<DeclaredUnit>,
}

/// What a connector is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Values go in: an input or a parameter.
    In,
    /// Values come out: an output, local, constant or calculated parameter.
    Out,
    /// Either.
    Any,
}

/// A connection; its ends are not in the direction of the value.
#[derive(Debug, Clone)]
pub(super) struct Connection {
    pub line: u32,
    pub start: (Option<String>, String),
    pub end: (Option<String>, String),
    pub suppresses_units: bool,
    pub transformation: Transformation,
}

/// Where the values of parameters come from.
#[derive(Debug, Clone)]
pub(super) struct Binding {
    pub line: u32,
    pub prefix: String,
    pub values: Values,
    pub mapping: Option<Names>,
}

#[derive(Debug, Clone)]
pub(super) enum Values {
    Inline(Parameters),
    File(File),
}

#[derive(Debug, Clone)]
pub(super) enum Names {
    Inline(Vec<Mapping>),
    File(File),
}

/// A file by its URI.
#[derive(Debug, Clone)]
pub(super) struct File {
    pub uri: String,
    /// It lies in the component and not beside the description.
    pub in_component: bool,
}

/// Reads a description.
///
/// # Errors
/// Another element, or parts that cannot be read.
pub(super) fn read(text: &str) -> Result<Structure, Fault> {
    let document = xml::parse(text)?;
    let root = document.root_element();
    expect(root, "SystemStructureDescription")?;
    let version = parameters::version(root)?.to_string();
    let units = parameters::units(root)?;
    let Some(system) = child(root, "System") else {
        return Err(fault(root, "there is no <System>"));
    };
    let system_read = read_system(system, &units)?;
    let time = |node: Node, name: &str| -> Result<Option<f64>, Fault> {
        let given = node.attribute(name).map(|_| xml::number(node, name, 0.0));
        given.transpose()
    };
    let experiment = match child(root, "DefaultExperiment") {
        None => (None, None),
        Some(node) => (time(node, "startTime")?, time(node, "stopTime")?),
    };
    Ok(Structure {
        name: required(root, "name")?.to_string(),
        version,
        description: root
            .attribute("description")
            .unwrap_or_default()
            .to_string(),
        tool: root
            .attribute("generationTool")
            .unwrap_or_default()
            .to_string(),
        system: system_read,
        experiment,
        own: own(root)?,
    })
}

/// Our annotation below a node.
fn annotation<'a, 'd: 'a>(node: Node<'a, 'd>) -> Option<Node<'a, 'd>> {
    let annotations = child(node, "Annotations")?;
    let mut all = children(annotations, "Annotation");
    let ours = all.find(|one| one.attribute("type") == Some(ANNOTATION))?;
    ours.first_element_child()
}

fn own(root: Node) -> Result<Own, Fault> {
    let Some(node) = annotation(root) else {
        return Ok(Own::default());
    };
    let positive = |name: &str| -> Result<Option<f64>, Fault> {
        match node.attribute(name) {
            None => Ok(None),
            Some(_) => Some(xml::number(node, name, 0.0))
                .transpose()
                .map(|value| value.filter(|value| *value > 0.0)),
        }
    };
    let text = |name: &str| node.attribute(name).map(str::to_string);
    Ok(Own {
        step: positive("step")?,
        sampling: positive("sampling")?,
        algorithm: text("algorithm"),
        end_when: text("endWhen"),
        end_cause: text("endCause"),
        end_after: positive("endAfter")?,
        stop: text("stop"),
    })
}

fn read_system(node: Node, units: &Units) -> Result<System, Fault> {
    let mut elements: Vec<Element> = Vec::new();
    let inside = child(node, "Elements");
    for element in inside.into_iter().flat_map(|inside| inside.children()) {
        if !element.is_element() {
            continue;
        }
        let read = match element.tag_name().name() {
            "Component" => Element::Component(component(element, units)?),
            "System" => Element::System(read_system(element, units)?),
            "SignalDictionaryReference" => Element::Signals(Signals {
                name: name(element)?,
                line: xml::line(element),
                connectors: connectors(element, units)?,
                dictionary: required(element, "dictionary")?.to_string(),
            }),
            other => {
                return Err(fault(
                    element,
                    format!("<{other}> is not a component, system or signal dictionary reference"),
                ));
            }
        };
        let taken = elements.iter().any(|known| known.name() == read.name());
        if taken {
            let name = read.name();
            return Err(fault(element, format!("two elements are called `{name}`")));
        }
        elements.push(read);
    }
    let all = child(node, "Connections").into_iter();
    let all = all.flat_map(|all| children(all, "Connection"));
    let connections = all.map(connection).collect::<Result<Vec<_>, _>>()?;
    let dictionaries = child(node, "SignalDictionaries").into_iter();
    let dictionaries = dictionaries.flat_map(|all| children(all, "SignalDictionary"));
    let dictionaries = dictionaries
        .map(|dictionary| Ok(required(dictionary, "name")?.to_string()))
        .collect::<Result<Vec<_>, Fault>>()?;
    Ok(System {
        name: name(node)?,
        id: node.attribute("id").map(str::to_string),
        connectors: connectors(node, units)?,
        bindings: bindings(node)?,
        elements,
        connections,
        dictionaries,
    })
}

/// The name of an element, which has at least a letter.
fn name(node: Node) -> Result<String, Fault> {
    let name = required(node, "name")?;
    if name.trim().is_empty() {
        return Err(fault(node, "the name is empty"));
    }
    Ok(name.to_string())
}

fn component(node: Node, units: &Units) -> Result<Component, Fault> {
    let own = annotation(node);
    let period = own.filter(|own| own.attribute("period").is_some());
    let period = period
        .map(|own| xml::number(own, "period", 0.0))
        .transpose()?;
    Ok(Component {
        name: name(node)?,
        line: xml::line(node),
        connectors: connectors(node, units)?,
        bindings: bindings(node)?,
        kind: node
            .attribute("type")
            .unwrap_or("application/x-fmu-sharedlibrary")
            .to_string(),
        source: node.attribute("source").map(str::to_string),
        implementation: node
            .attribute("implementation")
            .unwrap_or("any")
            .to_string(),
        period: period.filter(|period| *period > 0.0),
    })
}

fn connectors(node: Node, units: &Units) -> Result<Vec<Connector>, Fault> {
    let mut connectors: Vec<Connector> = Vec::new();
    let all = child(node, "Connectors").into_iter();
    for connector in all.flat_map(|all| children(all, "Connector")) {
        let name = required(connector, "name")?;
        let kind = match required(connector, "kind")? {
            "input" | "parameter" | "structuralParameter" => Kind::In,
            "output" | "calculatedParameter" | "constant" | "local" => Kind::Out,
            "inout" | "unspecified" => Kind::Any,
            other => {
                return Err(fault(
                    connector,
                    format!("kind=\"{other}\" of `{name}` is unknown, expected input or output"),
                ));
            }
        };
        if connectors.iter().any(|known| known.name == name) {
            return Err(fault(
                connector,
                format!("two connectors are called `{name}`"),
            ));
        }
        let typed = connector
            .children()
            .find(|child| child.has_attribute("unit"));
        let declared = typed.and_then(|typed| typed.attribute("unit"));
        connectors.push(Connector {
            name: name.to_string(),
            kind,
            unit: declared.and_then(|name| unit(name, units)),
        });
    }
    Ok(connectors)
}

fn connection(node: Node) -> Result<Connection, Fault> {
    if node.has_attribute("startIndices") || node.has_attribute("endIndices") {
        return Err(fault(
            node,
            "connections of single elements of arrays (startIndices, endIndices) are not \
             supported, because the standard does not define their first index; connect the \
             elements by their names",
        ));
    }
    // Some tools write the system itself as an empty name.
    let element = |name: &str| {
        let name = node.attribute(name).filter(|name| !name.is_empty());
        name.map(str::to_string)
    };
    Ok(Connection {
        line: xml::line(node),
        start: (
            element("startElement"),
            required(node, "startConnector")?.to_string(),
        ),
        end: (
            element("endElement"),
            required(node, "endConnector")?.to_string(),
        ),
        suppresses_units: xml::flag(node, "suppressUnitConversion")?,
        transformation: transformation(node)?,
    })
}

fn bindings(node: Node) -> Result<Vec<Binding>, Fault> {
    let all = child(node, "ParameterBindings").into_iter();
    let all = all.flat_map(|all| children(all, "ParameterBinding"));
    all.map(|binding| {
        let prefix = binding.attribute("prefix").unwrap_or_default().to_string();
        let kind = binding.attribute("type");
        if let Some(other) = kind.filter(|kind| *kind != "application/x-ssp-parameter-set") {
            let reason = format!("parameters of the type `{other}` cannot be read");
            return Err(fault(binding, reason));
        }
        let inline = child(binding, "ParameterValues");
        let values = match (binding.attribute("source"), inline) {
            (Some(_), Some(_)) => {
                let reason = "it has a source and values of its own; only one may be";
                return Err(fault(binding, reason));
            }
            (Some(uri), None) => Values::File(file(binding, uri)),
            (None, Some(inline)) => {
                let set = inline.first_element_child();
                let set = set.ok_or_else(|| fault(inline, "<ParameterValues> is empty"))?;
                Values::Inline(read_set(set, "")?)
            }
            (None, None) => {
                return Err(fault(
                    binding,
                    "it has neither a source nor <ParameterValues>",
                ));
            }
        };
        let mapping = child(binding, "ParameterMapping").map(|mapping| {
            match (mapping.attribute("source"), mapping.first_element_child()) {
                (Some(uri), _) => Ok(Names::File(file(mapping, uri))),
                (None, Some(inline)) => Ok(Names::Inline(read_mapping(inline)?)),
                (None, None) => Err(fault(mapping, "<ParameterMapping> is empty")),
            }
        });
        Ok(Binding {
            line: xml::line(binding),
            prefix,
            values,
            mapping: mapping.transpose()?,
        })
    })
    .collect()
}

fn file(node: Node, uri: &str) -> File {
    File {
        uri: uri.to_string(),
        in_component: node.attribute("sourceBase") == Some("component"),
    }
}

impl Element {
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Component(component) => &component.name,
            Self::System(system) => &system.name,
            Self::Signals(signals) => &signals.name,
        }
    }

    pub(super) fn connectors(&self) -> &[Connector] {
        match self {
            Self::Component(component) => &component.connectors,
            Self::System(system) => &system.connectors,
            Self::Signals(signals) => &signals.connectors,
        }
    }
}

impl System {
    /// The system with that id, itself or within.
    pub(super) fn with_id(&self, id: &str) -> Option<&Self> {
        if self.id.as_deref() == Some(id) {
            return Some(self);
        }
        self.elements.iter().find_map(|element| match element {
            Element::System(system) => system.with_id(id),
            _ => None,
        })
    }
}
