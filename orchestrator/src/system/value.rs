//! Values as people write them, for variables with types and units.

use crate::fmu::{Kind, Variable};
use crate::units;

use crate::units::hint;

/// A value for a variable, in the variable's own unit.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; an integer, a choice or a truth value as a number too.
    Number(f64),
    /// A text.
    Text(String),
}

/// Reads what was written for `variable`.
///
/// # Errors
/// What is wrong and what was expected.
pub(super) fn read(variable: &Variable, written: &toml::Value) -> Result<Value, String> {
    use toml::Value as Toml;
    let unit = variable.unit.as_deref();
    let misfit = |expected: &str| {
        Err(format!(
            "`{}` is no value for a {}; expected {expected}",
            shown(written),
            variable.kind.name()
        ))
    };
    match (&variable.kind, written) {
        (Kind::Float64, Toml::Float(number)) if number.is_finite() => Ok(Value::Number(*number)),
        (Kind::Float64, Toml::Integer(number)) => Ok(Value::Number(*number as f64)),
        (Kind::Float64, Toml::String(text)) => number(text, unit).map(Value::Number),
        (Kind::Float64, _) => misfit("a finite number, or a text with a unit such as \"1.5 in\""),
        (Kind::Int32, Toml::Integer(number)) if i32::try_from(*number).is_ok() => {
            Ok(Value::Number(*number as f64))
        }
        (Kind::Int32, _) => misfit("a whole number"),
        (Kind::Boolean, Toml::Boolean(truth)) => Ok(Value::Number(f64::from(u8::from(*truth)))),
        (Kind::Boolean, _) => misfit("true or false"),
        (Kind::Enumeration(items), Toml::Integer(number)) => {
            if items.iter().any(|(_, value)| value == number) {
                return Ok(Value::Number(*number as f64));
            }
            let names: Vec<String> = items.iter().map(|(n, v)| format!("{v} ({n})")).collect();
            misfit(&format!("one of {}", names.join(", ")))
        }
        (Kind::Enumeration(items), Toml::String(name)) => {
            let found = items
                .iter()
                .find(|(item, _)| item.eq_ignore_ascii_case(name));
            found
                .map(|(_, value)| Value::Number(*value as f64))
                .ok_or_else(|| {
                    let known = items.iter().map(|(item, _)| item.as_str());
                    format!("`{name}` is no choice{}", hint(name, known))
                })
        }
        (Kind::Enumeration(_), _) => misfit("the name of a choice"),
        (Kind::String, Toml::String(text)) => Ok(Value::Text(text.clone())),
        (Kind::String, _) => misfit("a text"),
        (Kind::Other(_), _) => misfit("nothing: variables of this type cannot be set"),
    }
}

/// A time in a system file: a number in s, or a text with a unit.
///
/// # Errors
/// What was expected.
pub(super) fn time(written: &toml::Value) -> Result<f64, String> {
    let seconds = match written {
        toml::Value::Float(number) => *number,
        toml::Value::Integer(number) => *number as f64,
        toml::Value::String(text) => number(text, Some("s"))?,
        other => return Err(format!("`{}` is no time, expected \"2 ms\"", shown(other))),
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

fn shown(written: &toml::Value) -> String {
    match written {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
