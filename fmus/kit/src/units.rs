//! Units in the notation of FMI and Modelica: `m/s2`, `N.s/m`, `lbf/(V.s2)`.

use thiserror::Error;

/// A unit in terms of the SI base units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Exponents of kg, m, s, A, K, mol, cd, rad.
    pub exponents: [i32; 8],
    /// The value in base units of one of this unit.
    pub factor: f64,
}

/// The names of the base units in the order of [`Unit::exponents`].
pub const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// A unit that cannot be read.
#[derive(Debug, Error, PartialEq)]
#[error("unit `{unit}`: {problem}")]
pub struct UnitError {
    unit: String,
    problem: String,
}

/// Symbol, exponents of kg, m, s, A, rad, and the value of one in base units.
const SYMBOLS: &[(&str, [i32; 5], f64)] = &[
    ("1", [0, 0, 0, 0, 0], 1.0),
    ("kg", [1, 0, 0, 0, 0], 1.0),
    ("m", [0, 1, 0, 0, 0], 1.0),
    ("s", [0, 0, 1, 0, 0], 1.0),
    ("A", [0, 0, 0, 1, 0], 1.0),
    ("rad", [0, 0, 0, 0, 1], 1.0),
    ("N", [1, 1, -2, 0, 0], 1.0),
    ("Pa", [1, -1, -2, 0, 0], 1.0),
    ("V", [1, 2, -3, -1, 0], 1.0),
    ("Hz", [0, 0, -1, 0, 0], 1.0),
    ("mm", [0, 1, 0, 0, 0], 1e-3),
    ("ms", [0, 0, 1, 0, 0], 1e-3),
    ("kN", [1, 1, -2, 0, 0], 1e3),
    ("in", [0, 1, 0, 0, 0], INCH),
    ("lbf", [1, 1, -2, 0, 0], POUND_FORCE),
    ("g", [0, 1, -2, 0, 0], STANDARD_GRAVITY),
    ("psi", [1, -1, -2, 0, 0], POUND_FORCE / (INCH * INCH)),
    ("deg", [0, 0, 0, 0, 1], std::f64::consts::PI / 180.0),
];

const INCH: f64 = 0.0254;
const POUND_FORCE: f64 = 4.448_221_615_260_5;
const STANDARD_GRAVITY: f64 = 9.806_65;

impl Unit {
    /// Reads a unit: symbols with optional integer exponents, joined by `.`, divided at most once
    /// by a symbol or by a product in parentheses.
    ///
    /// # Errors
    /// When a symbol is unknown or the text has another form.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let fail = |problem: String| UnitError {
            unit: text.into(),
            problem,
        };
        let mut unit = Unit {
            exponents: [0; 8],
            factor: 1.0,
        };
        let (above, below) = match text.split_once('/') {
            Some((above, below)) => (above, Some(below)),
            None => (text, None),
        };
        for symbol in above.split('.') {
            unit.multiply(symbol, 1).map_err(fail)?;
        }
        if let Some(below) = below {
            let inner = below.strip_prefix('(').and_then(|b| b.strip_suffix(')'));
            if inner.is_none() && below.contains('.') {
                return Err(fail(
                    "a product below the line stands in parentheses".into(),
                ));
            }
            for symbol in inner.unwrap_or(below).split('.') {
                unit.multiply(symbol, -1).map_err(fail)?;
            }
        }
        Ok(unit)
    }

    fn multiply(&mut self, text: &str, sign: i32) -> Result<(), String> {
        let digits = text
            .char_indices()
            .skip(1)
            .find(|(_, c)| c.is_ascii_digit() || *c == '-')
            .map_or(text.len(), |(at, _)| at);
        let (symbol, exponent) = text.split_at(digits);
        let power = sign
            * match exponent {
                "" => 1,
                digits => digits
                    .parse::<i32>()
                    .map_err(|_| format!("`{digits}` is no exponent"))?,
            };
        let (_, exponents, factor) = SYMBOLS
            .iter()
            .find(|(name, ..)| *name == symbol)
            .ok_or_else(|| format!("unknown symbol `{symbol}`"))?;
        for (slot, e) in [0, 1, 2, 3, 7].into_iter().zip(exponents) {
            self.exponents[slot] += power * e;
        }
        self.factor *= factor.powi(power);
        Ok(())
    }

    /// The factor by which a value in `self` is multiplied to give it in `other`; `None` if the
    /// two measure different things.
    pub fn factor_to(&self, other: &Unit) -> Option<f64> {
        (self.exponents == other.exponents).then_some(self.factor / other.factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Unit {
        Unit::parse(text).unwrap()
    }

    #[test]
    fn derived_units_have_the_base_units_of_the_si_brochure() {
        assert_eq!(parse("N"), parse("kg.m/s2"));
        assert_eq!(parse("N/(V.s2)").exponents, parse("A.s-1/m").exponents);
        assert_eq!(parse("Pa").exponents, parse("N/m2").exponents);
        assert_eq!(parse("1/s3").exponents[2], -3);
    }

    #[test]
    fn laboratory_units_convert_by_their_legal_definitions() {
        assert_eq!(parse("m").factor_to(&parse("in")), Some(1.0 / 0.0254));
        let mass = parse("kg").factor_to(&parse("lbf.s2/in")).unwrap();
        assert!((1.0 / mass - 175.126_835_246_5).abs() < 1e-9);
        let psi = parse("psi").factor_to(&parse("Pa")).unwrap();
        assert!((psi - 6_894.757_293_168).abs() < 1e-8);
        assert_eq!(parse("m").factor_to(&parse("s")), None);
    }

    #[test]
    fn a_unit_that_cannot_be_read_is_named() {
        let message = Unit::parse("N.furlong").unwrap_err().to_string();
        assert_eq!(message, "unit `N.furlong`: unknown symbol `furlong`");
        assert!(Unit::parse("N/V.s").is_err());
        assert!(Unit::parse("m/s/s").is_err());
        assert!(Unit::parse("").is_err());
        assert!(Unit::parse("mx2").is_err());
    }
}
