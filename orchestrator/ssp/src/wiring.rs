//! Connections across systems within systems: from the input of a component back to the output of
//! another.

use std::collections::{HashMap, HashSet};

use super::structure::{Connection, Element, Kind, System};
use fmi_system::{DeclaredUnit, Hop, Way};
use units::hint;

/// Why connections do not hold.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(super) enum WireError {
    /// Two ends that do the same.
    #[error("`{start}` and `{end}` both {what} values")]
    SameWay {
        /// Where it begins.
        start: String,
        /// Where it ends.
        end: String,
        /// `give` or `take`.
        what: &'static str,
    },
    /// A connector with two sources.
    #[error("`{connector}` is already driven by `{first}`")]
    DrivenTwice {
        /// The connector.
        connector: String,
        /// What the first connection takes its value from.
        first: String,
    },
    /// A connector or element that a system does not have.
    #[error("{owner} has no {what} `{name}`{hint}")]
    Unknown {
        /// The system or element.
        owner: String,
        /// `connector` or `element`.
        what: &'static str,
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// Connectors that drive each other.
    #[error("`{0}` drives itself through connectors")]
    Circle(String),
}

/// A connector: the path of its element, and its name.
pub(super) type Port = (Vec<String>, String);

/// All connections, in the direction of their values.
#[derive(Debug, Default)]
pub(super) struct Wiring {
    /// To each port the one that drives it, and what is done between them.
    drivers: HashMap<Port, (Port, Hop)>,
    units: HashMap<Port, DeclaredUnit>,
    /// The elements that stand for a signal dictionary, by path.
    shared: HashMap<Vec<String>, Vec<String>>,
}

/// A connection between two components.
#[derive(Debug)]
pub(super) struct Wire {
    pub from: Port,
    pub to: Port,
    pub way: Way,
}

/// An input that no component drives.
#[derive(Debug)]
pub(super) struct Feed {
    pub to: Port,
    /// Connectors on the way back, the farthest first, with what is done from there on.
    pub along: Vec<(Port, Vec<Hop>)>,
}

/// What all connections come to.
#[derive(Debug, Default)]
pub(super) struct Wires {
    pub wires: Vec<Wire>,
    pub feeds: Vec<Feed>,
    /// Inputs of the whole system by name, with what they drive.
    pub open: Vec<(String, Port)>,
}

impl Wiring {
    /// Notes what unit a connector declares.
    pub(super) fn declare(&mut self, port: Port, unit: Option<DeclaredUnit>) {
        if let Some(unit) = unit {
            self.units.insert(port, unit);
        }
    }

    /// Notes that the element at `path` stands for the signal dictionary at `owner`.
    pub(super) fn share(&mut self, path: Vec<String>, owner: Vec<String>) {
        self.shared.insert(path, owner);
    }

    /// The port itself, or the signal of a dictionary that it stands for.
    fn port(&self, path: Vec<String>, name: &str) -> (Port, bool) {
        match self.shared.get(&path) {
            // No element has an empty name.
            Some(owner) => {
                let mut owner = owner.clone();
                owner.push(String::new());
                ((owner, name.to_string()), true)
            }
            None => ((path, name.to_string()), false),
        }
    }

    /// Takes in a connection of the system at `path`.
    ///
    /// # Errors
    /// Connectors that are not there, two connectors that take or give values both, a connector
    /// that is driven twice.
    pub(super) fn connect(
        &mut self,
        path: &[String],
        system: &System,
        connection: &Connection,
    ) -> Result<(), WireError> {
        let start = self.end(path, system, &connection.start)?;
        let end = self.end(path, system, &connection.end)?;
        let hop = Hop {
            end: None,
            suppresses_units: connection.suppresses_units,
            transformation: connection.transformation.clone(),
        };
        let same = |what| WireError::SameWay {
            start: start.label.clone(),
            end: end.label.clone(),
            what,
        };
        let forwards = match (start.gives, end.gives) {
            (Some(true), Some(true)) => {
                return Err(same("give"));
            }
            (Some(false), Some(false)) => {
                return Err(same("take"));
            }
            (Some(true), _) | (_, Some(false)) => true,
            (Some(false), _) | (_, Some(true)) => false,
            (None, None) => {
                // Nothing tells: as it is written.
                true
            }
        };
        let (from, to) = if forwards { (start, end) } else { (end, start) };
        let hop = Hop {
            end: to.unit.clone(),
            ..hop
        };
        if let Some(unit) = from.unit {
            self.units.entry(from.port.clone()).or_insert(unit);
        }
        if let Some((first, _)) = self.drivers.get(&to.port) {
            return Err(WireError::DrivenTwice {
                connector: to.label,
                first: label(first),
            });
        }
        self.drivers.insert(to.port, (from.port, hop));
        Ok(())
    }

    fn end(
        &self,
        path: &[String],
        system: &System,
        (element, connector): &(Option<String>, String),
    ) -> Result<Found, WireError> {
        let Some(element) = element else {
            let own = system.connectors.iter().find(|own| own.name == *connector);
            let own = own.ok_or_else(|| {
                let known = system.connectors.iter().map(|own| own.name.as_str());
                WireError::Unknown {
                    owner: format!("the system `{}`", system.name),
                    what: "connector",
                    name: connector.clone(),
                    hint: hint(connector, known),
                }
            })?;
            return Ok(Found {
                label: connector.clone(),
                port: (path.to_vec(), connector.clone()),
                unit: own.unit.clone(),
                // Seen from within, an input of the system gives values.
                gives: match own.kind {
                    Kind::In => Some(true),
                    Kind::Out => Some(false),
                    Kind::Any => None,
                },
            });
        };
        let found = system.elements.iter().find(|own| own.name() == element);
        let found = found.ok_or_else(|| {
            let known = system.elements.iter().map(|own| own.name());
            WireError::Unknown {
                owner: format!("the system `{}`", system.name),
                what: "element",
                name: element.clone(),
                hint: hint(element, known),
            }
        })?;
        let own = found.connectors().iter().find(|own| own.name == *connector);
        // Some tools list no connectors: the FMU has them.
        let is_listed = !found.connectors().is_empty() || !matches!(found, Element::Component(_));
        if own.is_none() && is_listed {
            let known = found.connectors().iter().map(|own| own.name.as_str());
            return Err(WireError::Unknown {
                owner: format!("`{element}`"),
                what: "connector",
                name: connector.clone(),
                hint: hint(connector, known),
            });
        }
        let below = [path, std::slice::from_ref(element)].concat();
        let (port, is_signal) = self.port(below, connector);
        Ok(Found {
            label: format!("{element}.{connector}"),
            port,
            unit: own.and_then(|own| own.unit.clone()),
            gives: match own.map_or(Kind::Any, |own| own.kind) {
                // A signal of a dictionary goes either way.
                _ if is_signal => None,
                Kind::In => Some(false),
                Kind::Out => Some(true),
                Kind::Any => None,
            },
        })
    }

    /// Follows every driven connector of a component back to where its value comes from.
    ///
    /// # Errors
    /// Connectors of systems that drive each other in a circle.
    pub(super) fn resolve<'a>(
        &self,
        components: impl Iterator<Item = &'a Vec<String>>,
    ) -> Result<Wires, WireError> {
        let components: HashSet<&Vec<String>> = components.collect();
        let mut wires = Wires::default();
        let mut driven: Vec<&Port> = self.drivers.keys().collect();
        driven.sort();
        for to in driven
            .into_iter()
            .filter(|port| components.contains(&port.0))
        {
            let mut hops: Vec<Hop> = Vec::new();
            let mut along: Vec<(Port, Vec<Hop>)> = Vec::new();
            let mut port = to;
            let mut seen = HashSet::new();
            while let Some((from, hop)) = self.drivers.get(port) {
                if !seen.insert(port) {
                    return Err(WireError::Circle(label(to)));
                }
                hops.insert(0, hop.clone());
                port = from;
                if components.contains(&port.0) {
                    break;
                }
                along.insert(0, (port.clone(), hops.clone()));
            }
            if components.contains(&port.0) {
                wires.wires.push(Wire {
                    from: port.clone(),
                    to: to.clone(),
                    way: Way {
                        start: self.units.get(port).cloned(),
                        hops,
                    },
                });
                continue;
            }
            if port.0.is_empty() {
                wires.open.push((port.1.clone(), to.clone()));
            }
            wires.feeds.push(Feed {
                to: to.clone(),
                along,
            });
        }
        Ok(wires)
    }
}

/// An end of a connection.
struct Found {
    label: String,
    port: Port,
    unit: Option<DeclaredUnit>,
    /// Whether values come from it, seen from the connection; not told for some.
    gives: Option<bool>,
}

/// A port for people.
fn label((path, name): &Port) -> String {
    let mut parts: Vec<&str> = path.iter().map(String::as_str).collect();
    parts.retain(|part| !part.is_empty());
    parts.push(name);
    parts.join(".")
}
