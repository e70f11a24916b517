//! Units as people write them: `"1.5 in"`, `displacement [in]`, `lbf*s^2/in`, `V s/in`,
//! `in^3/s/V/sqrt(psi)`.
//!
//! A unit is a factor to SI and a dimension. Names are joined by `*`, `.`, `·` or a space, divided
//! by `/` (left to right: `a/b/c` is `a/(b c)`), raised with `^2`, `^-1`, `^(1/2)`, `^0.5` or a
//! digit (`m/s2`, `m.s-1`), grouped by brackets, and rooted by `sqrt( )`. `1`, `-` and an empty
//! text are the unit of a plain number; `%` is a hundredth.
//!
//! `g` is standard gravity, 9.80665 m/s^2; grams are not offered (write `kg`). An angle counts as
//! a dimension of its own: `Hz` is 2 pi rad/s, so `"60 Hz"` fits `rad/s` and does not fit `1/s`.

pub mod constants;
mod grammar;
mod names;

use std::fmt;

use thiserror::Error;

pub use constants::{G as STANDARD_GRAVITY, INCH, LBF as POUND_FORCE};
use grammar::Parser;
pub use names::nearest;

/// What is wrong with a unit, or with a number that carries one.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnitError {
    /// A name that is no unit.
    #[error("unknown unit \"{name}\" in \"{text}\"{hint}")]
    Unknown {
        /// The name that was not recognised.
        name: String,
        /// The whole text.
        text: String,
        /// The nearest known names, as a clause, or nothing.
        hint: String,
    },
    /// The text does not follow the grammar.
    #[error("cannot read the unit \"{text}\" at character {at}: expected {expected}")]
    Syntax {
        /// The whole text.
        text: String,
        /// Where, counted in characters from 1.
        at: usize,
        /// What should have stood there.
        expected: &'static str,
    },
    /// Two units of different dimension.
    #[error("unit \"{from}\" ({from_dimension}) does not fit \"{to}\" ({to_dimension})")]
    Misfit {
        /// The unit that was given.
        from: String,
        /// Its dimension.
        from_dimension: Dimension,
        /// The unit that was expected.
        to: String,
        /// Its dimension.
        to_dimension: Dimension,
    },
    /// A quantity that does not begin with a number.
    #[error("cannot read \"{text}\" as a number with a unit, as in \"1.5 in\"")]
    NotANumber {
        /// The whole text.
        text: String,
    },
}

/// Exponents of kg, m, s, A and rad, in halves (so that `sqrt(psi)` has a dimension).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension {
    halves: [i16; 5],
}

const BASE: [&str; 5] = ["kg", "m", "s", "A", "rad"];

impl Dimension {
    const fn of(kg: i16, m: i16, s: i16, ampere: i16, rad: i16) -> Self {
        Self {
            halves: [2 * kg, 2 * m, 2 * s, 2 * ampere, 2 * rad],
        }
    }

    fn combine(self, other: Self, sign: i16) -> Self {
        let mut halves = self.halves;
        for (mine, theirs) in halves.iter_mut().zip(other.halves) {
            *mine = mine.saturating_add(theirs.saturating_mul(sign));
        }
        Self { halves }
    }

    /// Raised to `halves_of_power`/2; none when an exponent is no longer a multiple of one half.
    fn power(self, halves_of_power: i16) -> Option<Self> {
        let mut halves = self.halves;
        for exponent in &mut halves {
            let doubled = exponent.checked_mul(halves_of_power)?;
            if doubled % 2 != 0 {
                return None;
            }
            *exponent = doubled / 2;
        }
        Some(Self { halves })
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut words = Vec::new();
        for (name, &halves) in BASE.iter().zip(&self.halves) {
            match halves {
                0 => {}
                2 => words.push((*name).to_string()),
                even if even % 2 == 0 => words.push(format!("{name}^{}", even / 2)),
                odd => words.push(format!("{name}^({odd}/2)")),
            }
        }
        if words.is_empty() {
            f.write_str("no dimension")
        } else {
            f.write_str(&words.join(" "))
        }
    }
}

/// A unit: its text, its factor to SI and its dimension.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// The text as written, without surrounding blanks.
    pub text: String,
    /// SI value of one of this unit (SI: kg, m, s, A, rad).
    pub factor: f64,
    /// Exponents of the base units.
    pub dimension: Dimension,
}

impl Unit {
    /// Reads a unit, for example `lbf*s^2/in`.
    ///
    /// # Errors
    /// An unknown name (with the nearest known one) or a text off the grammar (with the place).
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let text = text.trim();
        let (factor, dimension) = match text {
            "" | "-" | "1" => (1.0, Dimension::default()),
            _ => Parser::new(text).whole()?,
        };
        Ok(Self {
            text: text.to_string(),
            factor,
            dimension,
        })
    }

    /// The factor by which a value in this unit becomes one in `other`.
    ///
    /// # Errors
    /// [`UnitError::Misfit`] when the dimensions differ.
    pub fn factor_to(&self, other: &Unit) -> Result<f64, UnitError> {
        if self.dimension == other.dimension {
            return Ok(self.factor / other.factor);
        }
        Err(UnitError::Misfit {
            from: self.text.clone(),
            from_dimension: self.dimension,
            to: other.text.clone(),
            to_dimension: other.dimension,
        })
    }
}

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

/// Splits a header cell `displacement [in]` into its name and the text of its unit, if any.
#[must_use]
pub fn split_header(cell: &str) -> (&str, Option<&str>) {
    let cell = cell.trim();
    let inside = cell
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['));
    match inside {
        Some((name, unit)) => (name.trim(), Some(unit.trim())),
        None => (cell, None),
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

#[cfg(test)]
mod tests;
