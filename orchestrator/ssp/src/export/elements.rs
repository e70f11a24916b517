//! Elements of the system: components with their connectors and parameters.

use std::fmt::Write as _;

use super::text::{escape, uri};
use super::{ANNOTATION, Writer};
use fmi_import::{BaseUnit, Kind, Variable};

/// The name of every component's set of parameters: readers may ask for one by its name.
const SET: &str = "parameters";

/// A connector to be written: its name, whether values go in, and its variable.
pub(super) struct Connector<'a> {
    pub(super) name: String,
    pub(super) kind: &'static str,
    pub(super) variable: Option<&'a Variable>,
    pub(super) unit: Option<(&'static str, BaseUnit)>,
}

impl Writer<'_> {
    /// An element of the system.
    pub(super) fn element(
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
}
