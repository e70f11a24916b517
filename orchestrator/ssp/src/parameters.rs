//! Parameter sets (SSV) and mappings of their names (SSM).

use std::collections::HashMap;

use roxmltree::Node;

use super::error::Fault;
use super::xml::{self, child, children, fault, required};
use fmi_import::BaseUnit;
use fmi_system::{Declared, DeclaredUnit, Hop, Setting, Transformation, Way};

/// Units that a file defines, by name.
pub(super) type Units = HashMap<String, BaseUnit>;

/// A parameter and its value, in the order of its set.
pub(super) type Parameters = Vec<(String, Setting)>;

/// An entry of a mapping.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mapping {
    pub source: String,
    pub target: String,
    pub suppresses_units: bool,
    pub transformation: Transformation,
}

/// The `<Units>` below a node.
///
/// # Errors
/// A unit without a name, or numbers that cannot be read.
pub(super) fn units(root: Node) -> Result<Units, Fault> {
    let mut units = Units::new();
    let all = child(root, "Units")
        .into_iter()
        .flat_map(|all| children(all, "Unit"));
    for unit in all {
        let name = required(unit, "name")?;
        let Some(base) = child(unit, "BaseUnit") else {
            continue;
        };
        let base_unit = BaseUnit::read(base).map_err(|error| fault(base, error.to_string()))?;
        if base_unit.factor == 0.0 {
            return Err(fault(base, format!("the factor of `{name}` is 0")));
        }
        if units.insert(name.to_string(), base_unit).is_some() {
            return Err(fault(unit, format!("the unit `{name}` is defined twice")));
        }
    }
    Ok(units)
}

/// A unit by its name; an empty one states none.
pub(super) fn unit(name: &str, units: &Units) -> Option<DeclaredUnit> {
    (!name.trim().is_empty()).then(|| DeclaredUnit {
        name: name.to_string(),
        base: units.get(name).copied(),
    })
}

/// Reads a `<ParameterSet>`; `prefix` comes before its names. Of entries for the same parameter the
/// last one counts, as of bindings.
///
/// # Errors
/// Another element, values that cannot be read.
pub(super) fn read_set<'a>(root: Node<'a, '_>, prefix: &str) -> Result<Parameters, Fault> {
    expect(root, "ParameterSet")?;
    version(root)?;
    let units = units(root)?;
    let mut parameters = Parameters::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    let Some(list) = child(root, "Parameters") else {
        return Err(fault(root, "<ParameterSet> has no <Parameters>"));
    };
    for parameter in children(list, "Parameter") {
        let name = required(parameter, "name")?;
        let value = value(parameter, &units)?;
        match places.get(name) {
            Some(&place) => parameters[place].1 = value,
            None => {
                places.insert(name, parameters.len());
                parameters.push((format!("{prefix}{name}"), value));
            }
        }
    }
    Ok(parameters)
}

/// The value of a `<Parameter>`.
fn value(parameter: Node, units: &Units) -> Result<Setting, Fault> {
    let name = parameter.attribute("name").unwrap_or_default();
    let typed = parameter.children().find(|node| {
        let other = ["Dimension", "Annotations"];
        node.is_element() && !other.contains(&node.tag_name().name())
    });
    let Some(typed) = typed else {
        return Err(fault(
            parameter,
            format!("the parameter `{name}` has no value"),
        ));
    };
    let kind = typed.tag_name().name();
    let is_array = child(parameter, "Dimension").is_some();
    // Values of texts may stand in elements of their own.
    let own: Vec<&str> = children(typed, "Value")
        .map(|value| required(value, "value"))
        .collect::<Result<_, _>>()?;
    let texts: Vec<&str> = match kind {
        "String" | "Enumeration" | "Binary" if !own.is_empty() => own,
        "String" | "Enumeration" | "Binary" => vec![required(typed, "value")?],
        _ => required(typed, "value")?.split_whitespace().collect(),
    };
    let way = Way {
        start: typed.attribute("unit").and_then(|name| unit(name, units)),
        hops: Vec::new(),
    };
    let one = |text: &&str| -> Result<Setting, Fault> {
        let wrong = |what: &str| fault(typed, format!("`{name}`: `{text}` is {what}"));
        let value = match kind {
            "Real" | "Float64" | "Float32" => {
                let number = xml::real(text).ok_or_else(|| wrong("no finite number"))?;
                Setting::Number(number)
            }
            "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64"
            | "UInt64" => match text.parse::<i64>() {
                Ok(number) => Setting::Integer(number),
                // The largest whole numbers of 64 bits.
                Err(_) if text.parse::<u64>().is_ok() => Setting::Text((*text).to_string()),
                Err(_) => return Err(wrong("no whole number")),
            },
            "Boolean" => {
                let truth = xml::truth(text).ok_or_else(|| wrong("neither true nor false"))?;
                Setting::Boolean(truth)
            }
            "String" | "Enumeration" | "Binary" => Setting::Text((*text).to_string()),
            kind => {
                return Err(fault(
                    typed,
                    format!("`{name}` has the unknown type <{kind}>"),
                ));
            }
        };
        Ok(Setting::Declared(Box::new(Declared {
            value,
            way: way.clone(),
        })))
    };
    let mut values = texts.iter().map(one).collect::<Result<Vec<_>, _>>()?;
    match values.len() {
        1 if !is_array => Ok(values.remove(0)),
        0 if !is_array => Err(fault(typed, format!("the parameter `{name}` has no value"))),
        _ => Ok(Setting::List(values)),
    }
}

/// Reads a `<ParameterMapping>`.
///
/// # Errors
/// Another element, entries that cannot be read.
pub(super) fn read_mapping(root: Node) -> Result<Vec<Mapping>, Fault> {
    expect(root, "ParameterMapping")?;
    version(root)?;
    children(root, "MappingEntry")
        .map(|entry| {
            Ok(Mapping {
                source: required(entry, "source")?.to_string(),
                target: required(entry, "target")?.to_string(),
                suppresses_units: xml::flag(entry, "suppressUnitConversion")?,
                transformation: transformation(entry)?,
            })
        })
        .collect()
}

/// The parameters under the names that a mapping gives them; others are not applied.
///
/// # Errors
/// Two entries for a target.
pub(super) fn mapped(
    parameters: &Parameters,
    mapping: &[Mapping],
) -> Result<(Parameters, Vec<String>), Fault> {
    let mut out = Parameters::new();
    let mut notes = Vec::new();
    for entry in mapping {
        if out.iter().any(|(target, _)| *target == entry.target) {
            let target = &entry.target;
            return Err(Fault::new(format!(
                "two entries of the mapping lead to `{target}`"
            )));
        }
        let found = parameters.iter().find(|(name, _)| *name == entry.source);
        let Some((_, value)) = found else {
            notes.push(format!(
                "the mapping names the parameter `{}`, which its set lacks",
                entry.source
            ));
            continue;
        };
        let hop = Hop {
            end: None,
            suppresses_units: entry.suppresses_units,
            transformation: entry.transformation.clone(),
        };
        out.push((entry.target.clone(), along(value, &hop)));
    }
    Ok((out, notes))
}

/// A value one hop further.
pub(super) fn along(value: &Setting, hop: &Hop) -> Setting {
    match value {
        Setting::List(all) => Setting::List(all.iter().map(|value| along(value, hop)).collect()),
        Setting::Declared(declared) => {
            let mut declared = declared.clone();
            declared.way.hops.push(hop.clone());
            Setting::Declared(declared)
        }
        other => Setting::Declared(Box::new(Declared {
            value: other.clone(),
            way: Way {
                start: None,
                hops: vec![hop.clone()],
            },
        })),
    }
}

/// The transformation of a connection or of an entry of a mapping.
///
/// # Errors
/// Values that cannot be read.
pub(super) fn transformation(node: Node) -> Result<Transformation, Fault> {
    let found = node
        .children()
        .find(|child| child.is_element() && child.tag_name().name().ends_with("Transformation"));
    let Some(found) = found else {
        return Ok(Transformation::None);
    };
    let entries = children(found, "MapEntry");
    Ok(match found.tag_name().name() {
        "LinearTransformation" => Transformation::Linear {
            factor: xml::number(found, "factor", 1.0)?,
            offset: xml::number(found, "offset", 0.0)?,
        },
        "BooleanMappingTransformation" => {
            let value = |entry: Node, name: &str| -> Result<f64, Fault> {
                let text = required(entry, name)?;
                let truth = xml::truth(text).ok_or_else(|| {
                    fault(
                        entry,
                        format!("{name}=\"{text}\" is neither true nor false"),
                    )
                })?;
                Ok(f64::from(u8::from(truth)))
            };
            Transformation::Numbers(pairs(entries, value)?)
        }
        "IntegerMappingTransformation" => {
            let value = |entry: Node, name: &str| -> Result<f64, Fault> {
                let text = required(entry, name)?;
                let whole: i64 = text.trim().parse().map_err(|_| {
                    fault(entry, format!("{name}=\"{text}\" is not a whole number"))
                })?;
                Ok(whole as f64)
            };
            Transformation::Numbers(pairs(entries, value)?)
        }
        "EnumerationMappingTransformation" => {
            let names = entries.map(|entry| {
                let (source, target) = (required(entry, "source")?, required(entry, "target")?);
                Ok((source.to_string(), target.to_string()))
            });
            Transformation::Names(names.collect::<Result<_, Fault>>()?)
        }
        name => {
            return Err(fault(
                found,
                format!("<{name}> is an unknown transformation"),
            ));
        }
    })
}

fn pairs<'a, 'd: 'a>(
    entries: impl Iterator<Item = Node<'a, 'd>>,
    value: impl Fn(Node<'a, 'd>, &str) -> Result<f64, Fault>,
) -> Result<Vec<(f64, f64)>, Fault> {
    entries
        .map(|entry| Ok((value(entry, "source")?, value(entry, "target")?)))
        .collect()
}

/// Whether an element is what it should be.
///
/// # Errors
/// It is not.
pub(super) fn expect(node: Node, name: &str) -> Result<(), Fault> {
    let found = node.tag_name().name();
    if found == name {
        return Ok(());
    }
    Err(fault(
        node,
        format!("the element is <{found}>, expected <{name}>"),
    ))
}

/// Whether the version is 1 or 2.
///
/// # Errors
/// It is not, or not given.
pub(super) fn version<'a>(node: Node<'a, '_>) -> Result<&'a str, Fault> {
    let version = required(node, "version")?;
    if version.starts_with("1.") || version.starts_with("2.") {
        return Ok(version);
    }
    Err(fault(
        node,
        format!("the version is \"{version}\", expected \"1.0\" or \"2.0\""),
    ))
}
