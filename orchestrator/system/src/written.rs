//! A system as a file: what `SystemFile::read` reads.

use toml::{Table, Value};

use super::file::{ComponentFile, Stepping, SystemFile};
use super::link::Link;
use super::passage::Transformation;
use super::value::Setting;

impl Setting {
    /// What was written on a command line: a truth value, a number, or a text.
    pub fn read(text: &str) -> Self {
        match text {
            "true" => return Self::Boolean(true),
            "false" => return Self::Boolean(false),
            _ => {}
        }
        if let Ok(whole) = text.parse::<i64>() {
            return Self::Integer(whole);
        }
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Self::Number(number),
            _ => Self::Text(text.to_string()),
        }
    }

    fn to_toml(&self) -> Value {
        match self {
            Self::Boolean(truth) => Value::Boolean(*truth),
            Self::Integer(number) => Value::Integer(*number),
            Self::Number(number) => Value::Float(*number),
            Self::Text(text) => Value::String(text.clone()),
            Self::List(list) => Value::Array(list.iter().map(Self::to_toml).collect()),
            // Its unit goes along as text where it has one.
            Self::Declared(declared) => match &declared.way.start {
                Some(_) => Value::String(self.to_string()),
                None => declared.value.to_toml(),
            },
        }
    }
}

impl SystemFile {
    /// The system as TOML. The rule by which a component was tuned is not written: its parameters
    /// are.
    pub fn to_toml(&self) -> String {
        let mut all = Table::new();
        let text = |table: &mut Table, key: &str, value: &str| {
            if !value.is_empty() {
                table.insert(key.to_string(), Value::String(value.to_string()));
            }
        };
        text(&mut all, "name", &self.name);
        text(&mut all, "description", &self.description);
        let links = self.connections.iter().map(connection).collect();
        all.insert("connections".into(), Value::Array(links));
        let components = self.components.iter();
        let components: Table = components
            .map(|(name, component)| (name.clone(), Value::Table(written(component))))
            .collect();
        all.insert("components".into(), Value::Table(components));
        let own = &self.experiment;
        let mut experiment = Table::new();
        for (key, setting) in [
            ("sampling", &own.sampling),
            ("step", &own.step),
            ("duration", &own.duration),
            ("end_after", &own.end_after),
        ] {
            if let Some(setting) = setting {
                experiment.insert(key.into(), setting.to_toml());
            }
        }
        for (key, file) in [("record", &own.record), ("reference", &own.reference)] {
            text(&mut experiment, key, file.as_deref().unwrap_or_default());
        }
        for (key, name) in [
            ("end_when", &own.end_when),
            ("end_cause", &own.end_cause),
            ("stop", &own.stop),
        ] {
            let name = name.as_ref().map(ToString::to_string);
            text(&mut experiment, key, &name.unwrap_or_default());
        }
        if !experiment.is_empty() {
            all.insert("experiment".into(), Value::Table(experiment));
        }
        // Tables of texts and finite numbers alone are always TOML.
        toml::to_string_pretty(&all).unwrap_or_default()
    }
}

/// A connection, with what a system file can do to its value.
fn connection(link: &Link) -> Value {
    let plain = || Value::String(link.to_string());
    let [hop] = link.way.hops.as_slice() else {
        return plain();
    };
    let mut own = Table::new();
    if let Transformation::Linear { factor, offset } = hop.transformation {
        own.insert("factor".into(), Value::Float(factor));
        own.insert("offset".into(), Value::Float(offset));
    }
    if hop.suppresses_units {
        own.insert("convert_units".into(), Value::Boolean(false));
    }
    if own.is_empty() {
        return plain();
    }
    own.insert("connect".into(), plain());
    Value::Table(own)
}

fn written(component: &ComponentFile) -> Table {
    let mut own = Table::new();
    own.insert("fmu".into(), Value::String(component.fmu.clone()));
    if let Some(model) = &component.model {
        own.insert("model".into(), Value::String(model.clone()));
    }
    if let Some(interface) = component.interface {
        let name = match interface {
            Stepping::CoSimulation => "co-simulation",
            Stepping::ModelExchange => "model-exchange",
        };
        own.insert("interface".into(), Value::String(name.to_string()));
    }
    if let Some(tolerance) = component.tolerance {
        own.insert("tolerance".into(), Value::Float(tolerance));
    }
    if let Some(period) = &component.period {
        own.insert("period".into(), period.to_toml());
    }
    for (key, settings) in [
        ("parameters", &component.parameters),
        ("inputs", &component.inputs),
    ] {
        if !settings.is_empty() {
            let table: Table = settings
                .iter()
                .map(|(name, setting)| (name.clone(), setting.to_toml()))
                .collect();
            own.insert(key.into(), Value::Table(table));
        }
    }
    for (key, names) in [("units", &component.units), ("aliases", &component.aliases)] {
        if !names.is_empty() {
            let table: Table = names
                .iter()
                .map(|(name, other)| (name.clone(), Value::String(other.clone())))
                .collect();
            own.insert(key.into(), Value::Table(table));
        }
    }
    own
}
