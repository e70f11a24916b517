//! Units as people write them: `"1.5 in"`, `displacement [in]`, `lbf*s^2/in`, `V s/in`,
//! `in^3/s/V/sqrt(psi)`.
//!
//! A unit is a factor to SI and a dimension. Names are joined by `*`, `.`, `·` or a space, and
//! divided by `/` (left to right: `a/b/c` is `a/(b c)`). They are raised with `^2`, `^-1`,
//! `^(1/2)`, `^0.5` or a digit (`m/s2`, `m.s-1`), grouped by brackets, and rooted by `sqrt( )`.
//! `1`, `-` and an empty text are the unit of a plain number; `%` is a hundredth.
//!
//! `g` is standard gravity, 9.80665 m/s^2; grams are not offered (write `kg`). An angle counts as
//! a dimension of its own: `Hz` is 2 pi rad/s, so `"60 Hz"` fits `rad/s` and does not fit `1/s`.
//! FMI's base units have no cycle; there `Hz` is `1/s` ([`Unit::base_unit`]).

// The derive writes paths that begin with the crate's name.
extern crate self as units;

pub mod constants;
mod dimension;
mod error;
mod grammar;
mod names;
mod parameters;
mod quantity;
mod suggestion;
mod unit;
pub mod vocabulary;

pub use constants::{G as STANDARD_GRAVITY, INCH, LBF as POUND_FORCE};
pub use dimension::Dimension;
pub use error::UnitError;
pub use parameters::{OutOfRange, Parameter, Parameters, Range, Slot};
pub use quantity::{Quantity, convert, factor_meant, value_in};
pub use suggestion::{hint, nearest};
pub use unit::{BaseUnit, Unit};
pub use units_derive::Parameters;

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

#[cfg(test)]
mod tests;
