//! Numbers with units, as options.

use std::path::PathBuf;

use laboratory::error::Error;
use pack::UnknownPlatform;

/// A value on the command line that is not of the expected form; the name of the option precedes it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// What was expected instead.
    #[error("expected {0}")]
    Expected(&'static str),
    /// A text that is not a whole number.
    #[error("expected a whole number from 0 to {}", u64::MAX)]
    NotWhole,
    /// A folder that does not exist.
    #[error("{}: no such folder", .0.display())]
    NoFolder(PathBuf),
    /// A platform without a name in FMI.
    #[error(transparent)]
    Platform(#[from] UnknownPlatform),
}

/// A positive quantity; a number alone is in `unit`.
///
/// # Errors
/// Another thing.
pub fn positive(option: &'static str, text: &str, unit: &'static str) -> Result<f64, Error> {
    let fault = |reason: String| Error::Option { option, reason };
    let value = units::value_in(text, unit).map_err(|error| match error {
        units::UnitError::NotANumber { .. } => fault(format!(
            "cannot read `{text}`; expected a number with a unit, such as `{}`",
            example(unit)
        )),
        error => fault(error.to_string()),
    })?;
    if value <= 0.0 || !value.is_finite() {
        return Err(fault(format!("`{text}` is not positive")));
    }
    Ok(value)
}

/// What is usual in a unit.
fn example(unit: &str) -> &'static str {
    match unit {
        "s" => "10 s",
        "g" => "0.3 g",
        "m" => "30 mm",
        _ => "1.5 in",
    }
}

/// The positive quantity, where one is given.
///
/// # Errors
/// Another thing.
pub fn if_given(
    option: &'static str,
    text: &Option<String>,
    unit: &'static str,
) -> Result<Option<f64>, Error> {
    text.as_deref()
        .map(|text| positive(option, text, unit))
        .transpose()
}

/// A positive share, per cent.
///
/// # Errors
/// Another thing.
pub fn percent(option: &'static str, text: &str) -> Result<f64, Error> {
    fmi_system::percent(text).map_err(|error| Error::Option {
        option,
        reason: error.to_string(),
    })
}

/// Lowest and highest frequency of `--band`, Hz.
///
/// # Errors
/// No band below 100 Hz.
pub fn band(given: &[f64]) -> Result<[f64; 2], Error> {
    let [low, high] = [0, 1].map(|i| given.get(i).copied().unwrap_or(f64::NAN));
    if low > 0.0 && high > low && high <= 100.0 {
        return Ok([low, high]);
    }
    Err(Error::Option {
        option: "--band",
        reason: format!("{low} to {high} Hz; expected 0 < LOW < HIGH <= 100"),
    })
}

/// A whole number, such as a seed.
///
/// # Errors
/// Another thing.
pub fn whole<T: std::str::FromStr>(text: &str) -> Result<T, ValueError> {
    text.parse().map_err(|_| ValueError::NotWhole)
}

/// A whole number above 0.
///
/// # Errors
/// Another thing.
pub fn at_least_one(text: &str) -> Result<usize, ValueError> {
    let number = text.parse().ok().filter(|number| *number > 0);
    number.ok_or(ValueError::Expected("a whole number from 1"))
}
