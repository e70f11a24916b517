//! A unit with its factor and dimension.

use super::UnitError;
use super::dimension::{Dimension, Scaled};
use super::grammar::Parser;

/// A unit: its text, its factor to SI and its dimension.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// The text as written, without surrounding blanks.
    pub text: String,
    /// SI value of one of this unit (SI: kg, m, s, A, rad).
    pub factor: f64,
    /// Exponents of the base units.
    pub dimension: Dimension,
    counted: Scaled,
}

/// A unit as FMI describes it: in base units of the SI, where a hertz is one in a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseUnit {
    /// Exponents of [`BaseUnit::NAMES`].
    pub exponents: [i32; 8],
    /// The value in base units of one of this unit.
    pub factor: f64,
}

impl BaseUnit {
    /// The base units of FMI, in its order.
    pub const NAMES: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];
}

impl Unit {
    /// Reads a unit, for example `lbf*s^2/in`.
    ///
    /// # Errors
    /// An unknown name (with the nearest known one) or a text off the grammar (with the place).
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let text = text.trim();
        let counted = match text {
            "" | "-" | "1" => Scaled::new(1.0, Dimension::default()),
            _ => Parser::new(text).whole()?,
        };
        let (factor, dimension) = counted.in_radians();
        Ok(Self {
            text: text.to_string(),
            factor,
            dimension,
            counted,
        })
    }

    /// The unit as FMI describes it; none if an exponent is not an integer.
    pub fn base_unit(&self) -> Option<BaseUnit> {
        let [kg, m, s, a, rad] = self.counted.dimension.whole()?;
        (self.counted.cycles % 2 == 0).then_some(BaseUnit {
            exponents: [kg, m, s, a, 0, 0, 0, rad],
            factor: self.counted.factor,
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
