//! The grammar of units: products, quotients, powers, roots and brackets.

use super::dimension::{Dimension, Scaled};
use super::error::UnitError;
use super::names::{known, lookup};
use super::suggestion::nearest;

pub(super) struct Parser<'a> {
    text: &'a str,
    characters: Vec<char>,
    at: usize,
    depth: usize,
}

/// Brackets within brackets that are still read; no real unit comes near.
const DEEPEST: usize = 16;

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str) -> Self {
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

    pub(super) fn whole(mut self) -> Result<Scaled, UnitError> {
        let unit = self.product()?;
        if self.at < self.characters.len() {
            self.error("the end of the unit")
        } else {
            Ok(unit)
        }
    }

    fn product(&mut self) -> Result<Scaled, UnitError> {
        self.blanks();
        let mut unit = self.power()?;
        let mut divided = false;
        loop {
            let blank = self.blanks();
            let halves = match self.peek() {
                Some('*' | '.' | '·') => {
                    self.at += 1;
                    2
                }
                Some('/') => {
                    self.at += 1;
                    divided = true;
                    -2
                }
                None | Some(')') => return Ok(unit),
                Some(_) if blank && divided => {
                    return self.error("brackets or `*`: a blank after `/` is ambiguous");
                }
                Some(_) if blank => 2,
                Some(_) => return self.error("`*`, `/`, `^` or a blank"),
            };
            self.blanks();
            let next = self.power()?;
            unit = match next.power(halves) {
                Some(next) => unit.times(next),
                None => return self.error("smaller exponents"),
            };
        }
    }

    fn power(&mut self) -> Result<Scaled, UnitError> {
        let atom = self.atom()?;
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
        match atom.power(halves) {
            Some(unit) => Ok(unit),
            None => self.error("a power that gives whole or half exponents"),
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
                Ok(Scaled::new(0.01, Dimension::default()))
            }
            Some('1') => {
                self.at += 1;
                Ok(Scaled::new(1.0, Dimension::default()))
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
                    return match self.bracket()?.power(1) {
                        Some(unit) => Ok(unit),
                        None => self.error("a root that gives whole or half exponents"),
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
            nearest(&name, known())
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
