//! What both versions of descriptions have in common: arrays, aliases, units, dependencies.

use std::collections::HashMap;
use std::sync::Arc;

use roxmltree::Node;

use super::attribute::{Remarks, at, child, children};
use super::{Causality, Description, Variable};

/// Why a description cannot be used.
#[derive(Debug, thiserror::Error)]
pub(super) enum DescriptionError {
    /// Not text in its encoding.
    #[error("cannot be read as UTF-8 text ({0})")]
    Encoding(#[from] std::string::FromUtf8Error),
    /// Not XML.
    #[error(transparent)]
    Xml(#[from] roxmltree::Error),
    /// An element that is not as expected.
    #[error("line {line}: {element}: {reason}")]
    At {
        /// Its line, from 1.
        line: u32,
        /// The element, with its name or its parent's.
        element: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// No interface of FMI 2.0.
    #[error("neither <CoSimulation> nor <ModelExchange>")]
    NoInterface2,
    /// No interface of FMI 3.0.
    #[error("none of <CoSimulation>, <ModelExchange> and <ScheduledExecution>")]
    NoInterface3,
    /// Arrays that nobody could hold.
    #[error("the arrays have more than {MOST_ELEMENTS} elements together")]
    Elements,
    /// Two variables of one name.
    #[error("the variable `{name}` occurs twice (as number {first} and {second})")]
    Twice {
        /// The name.
        name: String,
        /// The first one's number, from 1.
        first: usize,
        /// The second one's.
        second: usize,
    },
    /// An alias that is another variable's name.
    #[error("the alias `{0}` is also a variable")]
    Alias(String),
}

/// A unit in SI: `value_si = factor value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Exponents of kg, m, s, A, K, mol, cd.
    pub exponents: [i32; 7],
    /// Factor to SI.
    pub factor: f64,
    /// Offset in SI.
    pub offset: f64,
}

/// An attribute of a `<BaseUnit>` that is not the number it must be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}=\"{text}\" is not a {expected} number")]
pub struct NotANumber {
    /// The attribute.
    pub name: &'static str,
    /// What it is.
    pub text: String,
    /// `whole` or `finite`.
    pub expected: &'static str,
}

impl BaseUnit {
    /// Attributes of a `<BaseUnit>`, of a description or an SSP. A radian is a number here, so that `rpm` fits
    /// `rad/s` whether or not it is declared as an angle.
    ///
    /// # Errors
    /// An attribute that is not a number.
    pub fn read(base: Node) -> Result<Self, NotANumber> {
        let not = |name, text: &str, expected| NotANumber {
            name,
            text: text.to_string(),
            expected,
        };
        let mut exponents = [0; 7];
        for (exponent, name) in exponents
            .iter_mut()
            .zip(["kg", "m", "s", "A", "K", "mol", "cd"])
        {
            if let Some(text) = base.attribute(name) {
                let whole = text.trim().parse();
                *exponent = whole.map_err(|_| not(name, text, "whole"))?;
            }
        }
        let number = |name, absent| match base.attribute(name) {
            Some(text) => {
                let number = text.trim().parse().ok();
                let finite = number.filter(|value: &f64| value.is_finite());
                finite.ok_or_else(|| not(name, text, "finite"))
            }
            None => Ok(absent),
        };
        Ok(Self {
            exponents,
            factor: number("factor", 1.0)?,
            offset: number("offset", 0.0)?,
        })
    }

    /// The unit of a variable; differences of a quantity have no offset.
    pub(super) fn of_variable(self, is_relative: bool) -> Self {
        let offset = if is_relative { 0.0 } else { self.offset };
        Self { offset, ..self }
    }
}

/// Units that a description of either version defines in terms of SI.
pub(super) fn units<'a>(root: Node<'a, 'a>, remarks: &mut Remarks) -> HashMap<&'a str, BaseUnit> {
    let all = children(child(root, "UnitDefinitions"), "Unit");
    all.filter_map(|unit| {
        let base = child(unit, "BaseUnit")?;
        match BaseUnit::read(base) {
            Ok(read) => Some((unit.attribute("name")?, read)),
            Err(error) => {
                remarks.note(|| at(base, error.to_string()));
                None
            }
        }
    })
    .collect()
}

/// The largest number of elements that the arrays of an FMU may have together.
pub(super) const MOST_ELEMENTS: usize = 4_000_000;

/// The names of an array's elements: `u[1]`, `u[2]` or `A[1,1]`, `A[1,2]`, the last index first to
/// change.
pub(super) fn element_names(name: &str, dimensions: &[usize]) -> Vec<String> {
    let count: usize = dimensions.iter().product();
    (0..count)
        .map(|element| {
            let mut rest = element;
            let mut indices: Vec<String> = dimensions
                .iter()
                .rev()
                .map(|&size| {
                    let index = rest % size;
                    rest /= size;
                    (index + 1).to_string()
                })
                .collect();
            indices.reverse();
            format!("{name}[{}]", indices.join(","))
        })
        .collect()
}

/// Lists of dependencies, each kept once.
#[derive(Default)]
pub(super) struct Dependencies {
    known: HashMap<Vec<usize>, Arc<[usize]>>,
    all: Option<Arc<[usize]>>,
}

impl Dependencies {
    /// Notes the inputs among `known` (all inputs, by default) as dependencies of the variable at
    /// `output`.
    pub(super) fn note(
        &mut self,
        variables: &mut [Variable],
        output: usize,
        known: Option<Vec<usize>>,
    ) {
        let is_input = |index: &usize| {
            variables
                .get(*index)
                .is_some_and(|variable| variable.causality == Causality::Input)
        };
        let dependencies = match known {
            Some(mut known) => {
                known.retain(is_input);
                known.sort_unstable();
                known.dedup();
                let shared = self.known.entry(known);
                let shared = shared.or_insert_with_key(|known| known.as_slice().into());
                shared.clone()
            }
            None => {
                let all = self.all.get_or_insert_with(|| {
                    (0..variables.len())
                        .filter(|index| is_input(index))
                        .collect()
                });
                all.clone()
            }
        };
        variables[output].dependencies = dependencies;
    }
}

/// Notes where each name stands: variables, arrays and aliases.
///
/// # Errors
/// A name that occurs twice.
pub(super) fn name(
    description: &mut Description,
    root: roxmltree::Node,
) -> Result<(), DescriptionError> {
    for (index, variable) in description.variables.iter().enumerate() {
        let (element, size) = variable.element;
        if let Some((array, _)) = variable.name.rsplit_once('[')
            && variable.name.ends_with(']')
            && element == 0
            && variable.is_element
        {
            description
                .arrays
                .insert(array.to_string(), index..index + size);
        }
        if let Some(first) = description.positions.insert(variable.name.clone(), index) {
            return Err(DescriptionError::Twice {
                name: variable.name.clone(),
                first: first + 1,
                second: index + 1,
            });
        }
    }
    let aliases = root
        .children()
        .filter(|node| node.has_tag_name("ModelVariables"))
        .flat_map(|node| node.children())
        .flat_map(|variable| {
            variable
                .children()
                .filter(|node| node.has_tag_name("Alias"))
                .map(move |alias| (variable.attribute("name"), alias.attribute("name")))
        });
    for (variable, alias) in aliases {
        let (Some(variable), Some(alias)) = (variable, alias) else {
            continue;
        };
        if let Some(elements) = description.arrays.get(variable).cloned() {
            for index in elements.clone() {
                let name = &description.variables[index].name[variable.len()..];
                let name = format!("{alias}{name}");
                description.positions.entry(name).or_insert(index);
            }
            description
                .arrays
                .entry(alias.to_string())
                .or_insert(elements);
        } else if let Some(&index) = description.positions.get(variable) {
            let first = description.positions.insert(alias.to_string(), index);
            if first.is_some_and(|first| first != index) {
                return Err(DescriptionError::Alias(alias.to_string()));
            }
        }
    }
    Ok(())
}

/// The text of a description in UTF-8, or in ISO-8859-1 where it says so.
///
/// # Errors
/// Another encoding, or bytes that do not fit it.
pub(super) fn decode(bytes: Vec<u8>) -> Result<String, DescriptionError> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_lowercase();
    let declared = head.split_once("?>").map_or("", |(head, _)| head);
    if declared.contains("iso-8859-1") || declared.contains("us-ascii") {
        return Ok(bytes.iter().map(|&byte| char::from(byte)).collect());
    }
    Ok(String::from_utf8(bytes)?)
}
