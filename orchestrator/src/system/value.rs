//! Values as people write them, for variables with types and units.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::hint;
use crate::fmu::{Kind, Variable};
use crate::units;

/// A value for a variable, in the variable's own unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; an integer, a choice or a truth value as a number too.
    Number(f64),
    /// A text.
    Text(String),
}

/// A value as given to a variable of a system, before its type and unit are known.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, true, false, or a text such as \"1.5 in\""
)]
pub enum Setting {
    /// A truth value.
    Boolean(bool),
    /// A whole number; for a variable with a unit, in that unit.
    Integer(i64),
    /// A number in the variable's unit.
    Number(f64),
    /// A number with a unit, the name of a choice, or a text.
    Text(String),
}

impl From<bool> for Setting {
    fn from(truth: bool) -> Self {
        Self::Boolean(truth)
    }
}

impl From<f64> for Setting {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<i64> for Setting {
    fn from(number: i64) -> Self {
        Self::Integer(number)
    }
}

impl From<&str> for Setting {
    fn from(text: &str) -> Self {
        Self::Text(text.to_string())
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Boolean(truth) => truth.fmt(f),
            Self::Integer(number) => number.fmt(f),
            // With its point, as it was written.
            Self::Number(number) => write!(f, "{number:?}"),
            Self::Text(text) => text.fmt(f),
        }
    }
}

impl Setting {
    /// As a number in `unit`.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub(super) fn number(&self, unit: &str) -> Result<f64, String> {
        match self {
            Self::Number(number) => Ok(*number),
            Self::Integer(number) => Ok(*number as f64),
            Self::Text(text) => number(text, Some(unit)),
            Self::Boolean(truth) => Err(format!("`{truth}` is no number in {unit}")),
        }
    }
}

/// Reads what was written for `variable`.
///
/// # Errors
/// What is wrong and what was expected.
pub(super) fn read(variable: &Variable, written: &Setting) -> Result<Value, String> {
    let unit = variable.unit.as_deref();
    let misfit = |expected: &str| {
        Err(format!(
            "`{written}` is no value for a {}; expected {expected}",
            variable.kind.name()
        ))
    };
    match (&variable.kind, written) {
        (Kind::Float64, Setting::Number(number)) if number.is_finite() => {
            Ok(Value::Number(*number))
        }
        (Kind::Float64, Setting::Integer(number)) => Ok(Value::Number(*number as f64)),
        (Kind::Float64, Setting::Text(text)) => number(text, unit).map(Value::Number),
        (Kind::Float64, _) => misfit("a finite number, or a text with a unit such as \"1.5 in\""),
        (Kind::Int32, Setting::Integer(number)) if i32::try_from(*number).is_ok() => {
            Ok(Value::Number(*number as f64))
        }
        (Kind::Int32, _) => misfit("a whole number"),
        (Kind::Boolean, Setting::Boolean(truth)) => Ok(Value::Number(f64::from(u8::from(*truth)))),
        (Kind::Boolean, _) => misfit("true or false"),
        (Kind::Enumeration(items), Setting::Integer(number)) => {
            if items.iter().any(|item| item.value == *number) {
                return Ok(Value::Number(*number as f64));
            }
            let names: Vec<String> = items
                .iter()
                .map(|item| format!("{} ({})", item.value, item.name))
                .collect();
            misfit(&format!("one of {}", names.join(", ")))
        }
        (Kind::Enumeration(items), Setting::Text(name)) => {
            let found = items
                .iter()
                .find(|item| item.name.eq_ignore_ascii_case(name));
            found
                .map(|item| Value::Number(item.value as f64))
                .ok_or_else(|| {
                    let known = items.iter().map(|item| item.name.as_str());
                    format!("`{name}` is no choice{}", hint(name, known))
                })
        }
        (Kind::Enumeration(_), _) => misfit("the name of a choice"),
        (Kind::String, Setting::Text(text)) => Ok(Value::Text(text.clone())),
        (Kind::String, _) => misfit("a text"),
        (Kind::Other(_), _) => misfit("nothing: variables of this type cannot be set"),
    }
}

/// A time in a system file: a number in s, or a text with a unit.
///
/// # Errors
/// What was expected.
pub(super) fn time(written: &Setting) -> Result<f64, String> {
    let seconds = match written {
        Setting::Boolean(_) => return Err(format!("`{written}` is no time, expected \"2 ms\"")),
        _ => written.number("s")?,
    };
    if seconds.is_finite() && seconds > 0.0 {
        return Ok(seconds);
    }
    Err(format!("{seconds} s is no time, expected more than 0 s"))
}

/// A number in `unit`, which may stand behind it.
fn number(text: &str, unit: Option<&str>) -> Result<f64, String> {
    units::value_in(text, unit.unwrap_or("")).map_err(|error| error.to_string())
}
