//! Numbers with units.

use super::{Unit, UnitError};

/// A number with its unit, as written by a person.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// The number as written.
    pub value: f64,
    /// Its unit.
    pub unit: Unit,
}

impl Quantity {
    /// Reads `"1.5 in"`, `"3 lbf"`, `"0.05"`, `"5 %"`.
    ///
    /// # Errors
    /// No finite number in front, or a unit that cannot be read.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let trimmed = text.trim();
        let end = number_length(trimmed);
        let value = trimmed[..end].parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(value) = value else {
            return Err(UnitError::NotANumber {
                text: text.to_string(),
            });
        };
        Ok(Self {
            value,
            unit: Unit::parse(&trimmed[end..])?,
        })
    }

    /// The value in SI base units (an angle in rad, a frequency in rad/s).
    #[must_use]
    pub fn si(&self) -> f64 {
        self.value * self.unit.factor
    }

    /// The value in the unit `unit`, for example `"Hz"`.
    ///
    /// # Errors
    /// A unit that cannot be read, or one of another dimension.
    pub fn to(&self, unit: &str) -> Result<f64, UnitError> {
        Ok(self.value * self.unit.factor_to(&Unit::parse(unit)?)?)
    }
}

/// Converts `value` from one unit to another.
///
/// # Errors
/// A unit that cannot be read, or two of different dimension.
pub fn convert(value: f64, from: &str, to: &str) -> Result<f64, UnitError> {
    Ok(value * Unit::parse(from)?.factor_to(&Unit::parse(to)?)?)
}

/// The factor from `unit` to `meant`. Where an acceleration is meant, `gal` is the galileo of
/// seismology (1 cm/s²), not the gallon.
///
/// # Errors
/// A unit that cannot be read, or two of different dimension.
pub fn factor_meant(unit: &str, meant: &str) -> Result<f64, UnitError> {
    let (unit, meant) = (Unit::parse(unit)?, Unit::parse(meant)?);
    let galileo = Unit::parse("Gal")?;
    if unit.text.eq_ignore_ascii_case("gal") && meant.dimension == galileo.dimension {
        return galileo.factor_to(&meant);
    }
    unit.factor_to(&meant)
}

/// Reads a value meant to be in `unit`, as `--set`, `--pga` and `--peak` take it: a number alone
/// is in that unit already, a number with a unit is converted to it.
///
/// # Errors
/// Text that cannot be read, or a unit of another dimension.
pub fn value_in(text: &str, unit: &str) -> Result<f64, UnitError> {
    let quantity = Quantity::parse(text)?;
    if quantity.unit.text.is_empty() {
        Ok(quantity.value)
    } else {
        quantity.to(unit)
    }
}

/// Length in bytes of the number at the beginning of `text`.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |mut at: usize| {
        while bytes.get(at).is_some_and(u8::is_ascii_digit) {
            at += 1;
        }
        at
    };
    let sign = |at: usize| at + usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let mut end = digits(sign(0));
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent = sign(end + 1);
        if digits(exponent) > exponent {
            end = digits(exponent);
        }
    }
    end
}
