//! Connections, with what happens to a value on its way.

use std::collections::HashSet;
use std::fmt::Write as _;

use super::super::SspError;
use super::text::{connector_name, escape, tap};
use super::{MOTION, Writer};
use fmi_import::Kind;
use fmi_system::{Connection, Source};

impl Writer<'_> {
    pub(super) fn connections(&self) -> Result<String, SspError> {
        let mut text = String::new();
        let mut arrays: HashSet<(usize, usize)> = HashSet::new();
        for connection in &self.system.connections {
            let part = &self.system.components[connection.component];
            let target = &part.fmu.description.variables[connection.input];
            if target.is_element {
                // An array is connected as a whole, once.
                let first = connection.input - target.element.0;
                if !arrays.insert((connection.component, first)) {
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
    fn whole(&self, connection: &Connection, first: usize) -> Result<(), SspError> {
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
            "`{}.{}` is an array whose elements are connected individually, which the format does \
             not support",
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
}
