//! Values as people write them, for variables with types and units.

use std::fmt;
use units::hint;

use serde::{Deserialize, Serialize};

use super::passage::{End, Way, WayError};
use fmi_import::{Datum, Kind, Variable};

/// Why what was written is not a value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// Not a number with a unit, or of another quantity.
    #[error(transparent)]
    Unit(#[from] units::UnitError),
    /// It cannot be converted to the variable.
    #[error(transparent)]
    Way(#[from] WayError),
    /// Not a share.
    #[error(transparent)]
    Share(#[from] NotAShare),
    /// Something else than a number.
    #[error("`{written}` is not a number in {unit}")]
    NotANumber {
        /// What was written.
        written: String,
        /// The unit.
        unit: String,
    },
    /// A value of another type.
    #[error("`{written}` is not a value for a {kind}; expected {expected}")]
    Type {
        /// What was written.
        written: String,
        /// The variable's type.
        kind: &'static str,
        /// What was expected.
        expected: String,
    },
    /// A name that is not among the choices.
    #[error("`{name}` is not a choice{hint}")]
    NotAChoice {
        /// What was written.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// Several values for one variable.
    #[error("`{0}` is not a single value")]
    Several(String),
    /// Another number of values than an array has elements.
    #[error("{given} values for an array of {elements} elements")]
    Count {
        /// The values.
        given: usize,
        /// The elements.
        elements: usize,
    },
    /// Not a time.
    #[error("`{0}` is not a time, expected \"2 ms\"")]
    NotATime(String),
    /// A time that is not positive.
    #[error("{0} s is not a valid time, expected more than 0 s")]
    Time(f64),
}

/// A value for a variable, in the variable's own unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    pub fn datum(&self, kind: &Kind) -> Datum {
        match self {
            Self::Number(number) => Datum::Number(*number),
            Self::Signed(number) => Datum::Signed(*number),
            Self::Unsigned(number) => Datum::Unsigned(*number),
            Self::Text(text) => Datum::read(kind, text).unwrap_or_else(|| Datum::empty(kind)),
        }
    }
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
    /// Values of an array's elements, row after row.
    List(Vec<Self>),
    /// A value in a unit that a file declares, with what is done to it on its way.
    #[serde(skip)]
    Declared(Box<Declared>),
}

/// A value of a parameter set as written, and its conversion to the variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// The value.
    pub value: Setting,
    /// Its unit and what is done to it.
    pub way: Way,
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
            Self::List(list) => {
                let all: Vec<String> = list.iter().map(Self::to_string).collect();
                write!(f, "[{}]", all.join(", "))
            }
            Self::Declared(declared) => match &declared.way.start {
                Some(unit) => write!(f, "{} {}", declared.value, unit.name),
                None => declared.value.fmt(f),
            },
        }
    }
}

impl Setting {
    /// As a number in `unit`.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub(super) fn number(&self, unit: &str) -> Result<f64, ValueError> {
        match self {
            Self::Number(number) => Ok(*number),
            Self::Integer(number) => Ok(*number as f64),
            Self::Text(text) => Ok(units::value_in(text, unit)?),
            Self::Boolean(_) | Self::List(_) | Self::Declared(_) => Err(ValueError::NotANumber {
                written: self.to_string(),
                unit: unit.to_string(),
            }),
        }
    }
}

/// Reads what was written for `variable`.
///
/// # Errors
/// What is wrong and what was expected.
pub(super) fn read(variable: &Variable, written: &Setting) -> Result<Value, ValueError> {
    let misfit = |expected: &str| {
        Err(ValueError::Type {
            written: written.to_string(),
            kind: variable.kind.name(),
            expected: expected.to_string(),
        })
    };
    match (&variable.kind, written) {
        (_, Setting::Declared(declared)) => read_declared(variable, declared),
        (Kind::Float64 | Kind::Float32, Setting::Number(number)) if number.is_finite() => {
            Ok(Value::Number(*number))
        }
        (Kind::Float64 | Kind::Float32, Setting::Integer(number)) => {
            Ok(Value::Number(*number as f64))
        }
        (Kind::Float64 | Kind::Float32, Setting::Text(text)) => {
            number(variable, text).map(Value::Number)
        }
        (Kind::Float64 | Kind::Float32, _) => {
            misfit("a finite number, or a text with a unit such as \"1.5 in\"")
        }
        (kind, _) if kind.whole_range().is_some() => {
            let (least, most) = kind.whole_range().unwrap_or_default();
            let whole = match written {
                Setting::Integer(number) => Some(i128::from(*number)),
                Setting::Text(digits) if !kind.is_numeric() => digits.trim().parse().ok(),
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
                    ValueError::NotAChoice {
                        name: name.clone(),
                        hint: hint(name, known),
                    }
                })
        }
        (Kind::Enumeration(_), _) => misfit("the name of a choice"),
        (Kind::String, Setting::Text(text)) => Ok(Value::Text(text.clone())),
        (Kind::String, _) => misfit("a text"),
        (Kind::Binary, Setting::Text(text)) if Datum::read(&Kind::Binary, text).is_some() => {
            Ok(Value::Text(text.clone()))
        }
        (Kind::Binary, _) => misfit("bytes in hexadecimal, such as \"00ff\""),
        (_, _) => misfit("no value: clocks cannot be set"),
    }
}

/// A value of a parameter set: its unit is converted, then it is transformed as the file says.
fn read_declared(variable: &Variable, declared: &Declared) -> Result<Value, ValueError> {
    let Declared { value, way } = declared;
    let end = End {
        kind: &variable.kind,
        unit: variable.unit.as_deref(),
        base: variable.base_unit,
    };
    // Without a unit of its own, it is in the variable's.
    let start = if way.start.is_some() {
        End {
            unit: None,
            base: None,
            ..end
        }
    } else {
        end
    };
    let passage = way.between(start, end)?;
    let is_plain = passage.factor == 1.0 && passage.offset == 0.0 && passage.map.is_empty();
    if is_plain {
        return read(variable, value);
    }
    match value {
        Setting::Number(number) => read(variable, &Setting::Number(passage.of(*number))),
        Setting::Integer(number) if passage.map.is_empty() => {
            read(variable, &Setting::Number(passage.of(*number as f64)))
        }
        Setting::Integer(number) => {
            let mapped = passage.of(*number as f64);
            read(variable, &Setting::Integer(mapped as i64))
        }
        Setting::Boolean(truth) => {
            let mapped = passage.of(f64::from(u8::from(*truth)));
            read(variable, &Setting::Boolean(mapped != 0.0))
        }
        Setting::Text(_) => match read(variable, value)? {
            Value::Number(number) => Ok(Value::Number(passage.of(number))),
            other => Ok(other),
        },
        Setting::List(_) | Setting::Declared(_) => Err(ValueError::Several(value.to_string())),
    }
}

/// A time in a system file: a number in s, or a text with a unit.
///
/// # Errors
/// What was expected.
pub(super) fn time(written: &Setting) -> Result<f64, ValueError> {
    let seconds = match written {
        Setting::Boolean(_) | Setting::List(_) => {
            return Err(ValueError::NotATime(written.to_string()));
        }
        _ => written.number("s")?,
    };
    if seconds.is_finite() && seconds > 0.0 {
        return Ok(seconds);
    }
    Err(ValueError::Time(seconds))
}

/// A positive share in a system file, per cent: a number, or a text such as `"0.1 %"`.
///
/// # Errors
/// What was expected.
pub(super) fn share(written: &Setting) -> Result<f64, ValueError> {
    Ok(percent(&written.to_string())?)
}

/// A text that is not a positive share.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a share; expected a number above 0, such as \"0.05 %\"")]
pub struct NotAShare(pub String);

/// A positive share, per cent; `%` may follow it.
///
/// # Errors
/// What was expected.
pub fn percent(text: &str) -> Result<f64, NotAShare> {
    let number = text.trim().trim_end_matches('%').trim_end().parse::<f64>();
    let number = number.ok();
    let positive = number.filter(|value| *value > 0.0 && value.is_finite());
    positive.ok_or_else(|| NotAShare(text.to_string()))
}

/// A number in the variable's unit, which may follow it.
fn number(variable: &Variable, text: &str) -> Result<f64, ValueError> {
    let unit = variable.unit.as_deref().unwrap_or("");
    // Units that only the FMU knows may be written as it writes them.
    if let Some(alone) = text.trim().strip_suffix(unit)
        && let Ok(number) = alone.trim().parse::<f64>()
        && number.is_finite()
    {
        return Ok(number);
    }
    Ok(units::value_in(text, unit)?)
}
