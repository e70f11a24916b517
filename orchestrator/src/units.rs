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

use std::f64::consts::PI;
use std::fmt;

use thiserror::Error;

/// Standard gravity, m/s^2.
pub const STANDARD_GRAVITY: f64 = 9.80665;
/// One inch, m.
pub const INCH: f64 = 0.0254;
/// One pound-force, N.
pub const POUND_FORCE: f64 = 4.448_221_615_260_5;

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

type Scaled = (f64, Dimension);

struct Parser<'a> {
    text: &'a str,
    characters: Vec<char>,
    at: usize,
    depth: usize,
}

/// Brackets within brackets that are still read; no real unit comes near.
const DEEPEST: usize = 16;

impl<'a> Parser<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text,
            characters: text.chars().collect(),
            at: 0,
            depth: 0,
        }
    }

    fn peek(&self) -> Option<char> {
        self.characters.get(self.at).copied()
    }

    fn error<T>(&self, expected: &'static str) -> Result<T, UnitError> {
        Err(UnitError::Syntax {
            text: self.text.to_string(),
            at: self.at + 1,
            expected,
        })
    }

    fn blanks(&mut self) -> bool {
        let start = self.at;
        while self.peek().is_some_and(char::is_whitespace) {
            self.at += 1;
        }
        self.at > start
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    fn whole(mut self) -> Result<Scaled, UnitError> {
        let unit = self.product()?;
        if self.at < self.characters.len() {
            self.error("the end of the unit")
        } else {
            Ok(unit)
        }
    }

    fn product(&mut self) -> Result<Scaled, UnitError> {
        self.blanks();
        let (mut factor, mut dimension) = self.power()?;
        let mut divided = false;
        loop {
            let blank = self.blanks();
            let sign = match self.peek() {
                Some('*' | '.' | '·') => {
                    self.at += 1;
                    1
                }
                Some('/') => {
                    self.at += 1;
                    divided = true;
                    -1
                }
                None | Some(')') => return Ok((factor, dimension)),
                Some(_) if blank && divided => {
                    return self.error("brackets or `*`: a blank after `/` can be read two ways");
                }
                Some(_) if blank => 1,
                Some(_) => return self.error("`*`, `/`, `^` or a blank"),
            };
            self.blanks();
            let (next, of) = self.power()?;
            factor = if sign > 0 {
                factor * next
            } else {
                factor / next
            };
            dimension = dimension.combine(of, sign);
        }
    }

    fn power(&mut self) -> Result<Scaled, UnitError> {
        let (factor, dimension) = self.atom()?;
        let halves = match self.peek() {
            Some('^') => {
                self.at += 1;
                self.exponent()?
            }
            Some('²') => {
                self.at += 1;
                4
            }
            Some('³') => {
                self.at += 1;
                6
            }
            Some(c) if c.is_ascii_digit() => 2 * self.integer()?,
            Some('-') => 2 * self.integer()?,
            _ => 2,
        };
        match dimension.power(halves) {
            Some(dimension) => Ok((factor.powf(f64::from(halves) / 2.0), dimension)),
            None => self.error("a power that leaves whole or half exponents"),
        }
    }

    /// An exponent after `^`, in halves: `2`, `-1`, `0.5`, `(1/2)`, `(-3)`.
    fn exponent(&mut self) -> Result<i16, UnitError> {
        let bracket = self.take('(');
        let whole = self.integer()?;
        let halves = if bracket && self.take('/') {
            if !self.take('2') {
                return self.error("a half, as in ^(1/2)");
            }
            whole
        } else if self.peek() == Some('.')
            && self
                .characters
                .get(self.at + 1)
                .is_some_and(char::is_ascii_digit)
        {
            self.at += 1;
            let negative = self.characters[..self.at].iter().rev().nth(2) == Some(&'-');
            match self.integer()? {
                0 => 2 * whole,
                5 => 2 * whole + if whole < 0 || negative { -1 } else { 1 },
                _ => return self.error("a whole or half power"),
            }
        } else {
            2 * whole
        };
        if bracket && !self.take(')') {
            return self.error("`)`");
        }
        Ok(halves)
    }

    fn integer(&mut self) -> Result<i16, UnitError> {
        let start = self.at;
        self.at += usize::from(matches!(self.peek(), Some('-' | '+')));
        while self.peek().is_some_and(|c| c.is_ascii_digit()) {
            self.at += 1;
        }
        let digits: String = self.characters[start..self.at].iter().collect();
        match digits.parse::<i16>() {
            Ok(value) if value.abs() <= 99 => Ok(value),
            _ => {
                self.at = start;
                self.error("a small whole number")
            }
        }
    }

    fn atom(&mut self) -> Result<Scaled, UnitError> {
        match self.peek() {
            Some('(') => self.bracket(),
            Some('%') => {
                self.at += 1;
                Ok((0.01, Dimension::default()))
            }
            Some('1') => {
                self.at += 1;
                Ok((1.0, Dimension::default()))
            }
            Some(c) if c.is_alphabetic() || c == '°' => {
                let start = self.at;
                while self
                    .peek()
                    .is_some_and(|c| c.is_alphabetic() || c == '°' || c == '_')
                {
                    self.at += 1;
                }
                let name: String = self.characters[start..self.at].iter().collect();
                if name == "sqrt" && self.peek() == Some('(') {
                    let (factor, dimension) = self.bracket()?;
                    return match dimension.power(1) {
                        Some(dimension) => Ok((factor.sqrt(), dimension)),
                        None => self.error("a root that leaves whole or half exponents"),
                    };
                }
                lookup(&name).ok_or_else(|| self.unknown(name))
            }
            _ => self.error("the name of a unit"),
        }
    }

    fn bracket(&mut self) -> Result<Scaled, UnitError> {
        self.at += 1;
        self.depth += 1;
        if self.depth > DEEPEST {
            return self.error("fewer brackets");
        }
        let unit = self.product()?;
        self.depth -= 1;
        if self.take(')') {
            Ok(unit)
        } else {
            self.error("`)`")
        }
    }

    fn unknown(&self, name: String) -> UnitError {
        let hint = if name == "lb" || name == "lbs" {
            "; write lbf (force) or lbm (mass)".to_string()
        } else {
            nearest(&name, NAMED.iter().map(|named| named.0))
                .map(|near| format!("; did you mean \"{near}\"?"))
                .unwrap_or_default()
        };
        UnitError::Unknown {
            name,
            text: self.text.to_string(),
            hint,
        }
    }
}

/// The name nearest to `name`, when one is near enough to be worth suggesting.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = name.to_lowercase();
    known
        .into_iter()
        .map(|candidate| {
            (
                strsim::normalized_damerau_levenshtein(&wanted, &candidate.to_lowercase()),
                candidate,
            )
        })
        .filter(|(likeness, _)| *likeness >= 0.5)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

const PRESSURE: Dimension = Dimension::of(1, -1, -2, 0, 0);
const FORCE: Dimension = Dimension::of(1, 1, -2, 0, 0);
const LENGTH: Dimension = Dimension::of(0, 1, 0, 0, 0);
const TIME: Dimension = Dimension::of(0, 0, 1, 0, 0);
const MASS: Dimension = Dimension::of(1, 0, 0, 0, 0);
const ANGLE: Dimension = Dimension::of(0, 0, 0, 0, 1);
const VOLUME: Dimension = Dimension::of(0, 3, 0, 0, 0);
const ACCELERATION: Dimension = Dimension::of(0, 1, -2, 0, 0);

/// Name, SI factor, dimension, and whether SI prefixes apply.
const NAMED: &[(&str, f64, Dimension, bool)] = &[
    ("m", 1.0, LENGTH, true),
    ("in", INCH, LENGTH, false),
    ("inch", INCH, LENGTH, false),
    ("ft", 12.0 * INCH, LENGTH, false),
    ("s", 1.0, TIME, true),
    ("sec", 1.0, TIME, false),
    ("min", 60.0, TIME, false),
    ("h", 3600.0, TIME, false),
    ("kg", 1.0, MASS, false),
    ("t", 1000.0, MASS, false),
    ("lbm", 0.453_592_37, MASS, false),
    ("g", STANDARD_GRAVITY, ACCELERATION, false),
    ("Gal", 0.01, ACCELERATION, false),
    ("N", 1.0, FORCE, true),
    ("lbf", POUND_FORCE, FORCE, false),
    ("kip", 1000.0 * POUND_FORCE, FORCE, false),
    ("kgf", STANDARD_GRAVITY, FORCE, false),
    ("Pa", 1.0, PRESSURE, true),
    ("bar", 1e5, PRESSURE, false),
    ("psi", POUND_FORCE / (INCH * INCH), PRESSURE, false),
    ("ksi", 1000.0 * POUND_FORCE / (INCH * INCH), PRESSURE, false),
    ("L", 1e-3, VOLUME, false),
    ("l", 1e-3, VOLUME, false),
    ("gal", 3.785_411_784e-3, VOLUME, false),
    (
        "gpm",
        3.785_411_784e-3 / 60.0,
        Dimension::of(0, 3, -1, 0, 0),
        false,
    ),
    ("V", 1.0, Dimension::of(1, 2, -3, -1, 0), true),
    ("A", 1.0, Dimension::of(0, 0, 0, 1, 0), true),
    ("ohm", 1.0, Dimension::of(1, 2, -3, -2, 0), true),
    ("W", 1.0, Dimension::of(1, 2, -3, 0, 0), true),
    ("J", 1.0, Dimension::of(1, 2, -2, 0, 0), true),
    ("Hz", 2.0 * PI, Dimension::of(0, 0, -1, 0, 1), true),
    ("rad", 1.0, ANGLE, true),
    ("deg", PI / 180.0, ANGLE, false),
    ("°", PI / 180.0, ANGLE, false),
];

const PREFIXES: &[(&str, f64)] = &[
    ("n", 1e-9),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("m", 1e-3),
    ("c", 1e-2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
];

fn lookup(name: &str) -> Option<Scaled> {
    if let Some(&(_, factor, dimension, _)) = NAMED.iter().find(|named| named.0 == name) {
        return Some((factor, dimension));
    }
    PREFIXES.iter().find_map(|&(prefix, scale)| {
        let rest = name.strip_prefix(prefix)?;
        let &(_, factor, dimension, _) = NAMED.iter().find(|named| named.3 && named.0 == rest)?;
        Some((scale * factor, dimension))
    })
}

#[cfg(test)]
#[path = "units_tests.rs"]
mod tests;
