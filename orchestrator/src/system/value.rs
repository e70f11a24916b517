//! Values as people write them, for variables with types and units.

use crate::fmu::{Datum, Kind, Variable};
use crate::units;

use super::hint;

/// A value for a variable, in the variable's own unit.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; an integer, a choice or a truth value as a number too.
    Number(f64),
    /// A whole number of 64 bits.
    Signed(i64),
    /// A whole number of 64 bits, not negative.
    Unsigned(u64),
    /// A text; a binary in hexadecimal.
    Text(String),
}

impl Value {
    /// As the FMU takes it.
    pub(crate) fn datum(&self, kind: &Kind) -> Datum {
        match self {
            Self::Number(number) => Datum::Number(*number),
            Self::Signed(number) => Datum::Signed(*number),
            Self::Unsigned(number) => Datum::Unsigned(*number),
            Self::Text(text) => Datum::read(kind, text).unwrap_or_else(|| Datum::empty(kind)),
        }
    }
}

/// Reads what was written for `variable`.
///
/// # Errors
/// What is wrong and what was expected.
pub(super) fn read(variable: &Variable, written: &toml::Value) -> Result<Value, String> {
    use toml::Value as Toml;
    let misfit = |expected: &str| {
        Err(format!(
            "`{}` is no value for a {}; expected {expected}",
            shown(written),
            variable.kind.name()
        ))
    };
    match (&variable.kind, written) {
        (Kind::Float64 | Kind::Float32, Toml::Float(number)) if number.is_finite() => {
            Ok(Value::Number(*number))
        }
        (Kind::Float64 | Kind::Float32, Toml::Integer(number)) => Ok(Value::Number(*number as f64)),
        (Kind::Float64 | Kind::Float32, Toml::String(text)) => {
            number(variable, text).map(Value::Number)
        }
        (Kind::Float64 | Kind::Float32, _) => {
            misfit("a finite number, or a text with a unit such as \"1.5 in\"")
        }
        (kind, _) if kind.whole_range().is_some() => {
            let (least, most) = kind.whole_range().unwrap_or_default();
            let whole = match written {
                Toml::Integer(number) => Some(i128::from(*number)),
                Toml::String(digits) if !kind.is_numeric() => digits.trim().parse().ok(),
                _ => None,
            };
            let whole = whole.filter(|number| (least..=most).contains(number));
            let Some(whole) = whole else {
                return misfit(&format!("a whole number from {least} to {most}"));
            };
            Ok(match kind {
                Kind::Int64 => Value::Signed(whole as i64),
                Kind::UInt64 => Value::Unsigned(whole as u64),
                _ => Value::Number(whole as f64),
            })
        }
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
        (Kind::Binary, Toml::String(text)) if Datum::read(&Kind::Binary, text).is_some() => {
            Ok(Value::Text(text.clone()))
        }
        (Kind::Binary, _) => misfit("bytes in hexadecimal, such as \"00ff\""),
        (_, _) => misfit("nothing: clocks tick by themselves"),
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
        toml::Value::String(text) => {
            units::value_in(text, "s").map_err(|error| error.to_string())?
        }
        other => return Err(format!("`{}` is no time, expected \"2 ms\"", shown(other))),
    };
    if seconds.is_finite() && seconds > 0.0 {
        return Ok(seconds);
    }
    Err(format!("{seconds} s is no time, expected more than 0 s"))
}

/// A number in the variable's unit, which may stand behind it.
fn number(variable: &Variable, text: &str) -> Result<f64, String> {
    let unit = variable.unit.as_deref().unwrap_or("");
    // Units that only the FMU knows may be written as it writes them.
    if let Some(alone) = text.trim().strip_suffix(unit)
        && let Ok(number) = alone.trim().parse::<f64>()
        && number.is_finite()
    {
        return Ok(number);
    }
    units::value_in(text, unit).map_err(|error| error.to_string())
}

fn shown(written: &toml::Value) -> String {
    match written {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
