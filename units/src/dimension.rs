//! Dimensions: exponents of the base units.

use std::f64::consts::TAU;
use std::fmt;

/// Exponents of kg, m, s, A and rad, in halves (so that `sqrt(psi)` has a dimension).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dimension {
    halves: [i16; BASE.len()],
}

const BASE: [&str; 5] = ["kg", "m", "s", "A", "rad"];
/// Place of the radian in [`BASE`].
const RADIAN: usize = 4;

impl Dimension {
    pub(super) const fn of(kg: i16, m: i16, s: i16, ampere: i16, rad: i16) -> Self {
        Self {
            halves: [2 * kg, 2 * m, 2 * s, 2 * ampere, 2 * rad],
        }
    }

    pub(super) fn combine(self, other: Self, sign: i16) -> Self {
        let mut halves = self.halves;
        for (mine, theirs) in halves.iter_mut().zip(other.halves) {
            *mine = mine.saturating_add(theirs.saturating_mul(sign));
        }
        Self { halves }
    }

    /// Raised to `halves_of_power`/2; none when an exponent is no longer a multiple of one half.
    pub(super) fn power(self, halves_of_power: i16) -> Option<Self> {
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

    /// Whole exponents of kg, m, s, A and rad; none where one is a half.
    pub(super) fn whole(self) -> Option<[i32; BASE.len()]> {
        let is_whole = self.halves.iter().all(|half| half % 2 == 0);
        is_whole.then(|| self.halves.map(|half| i32::from(half / 2)))
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

/// A factor to SI with its dimension, cycles counted apart: a hertz is a cycle in a second, and
/// only its reader says whether a cycle is 2 pi rad or one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scaled {
    /// SI value, a cycle being one.
    pub factor: f64,
    /// Exponents of the base units, a cycle being none.
    pub dimension: Dimension,
    /// Exponent of the cycle, in halves.
    pub cycles: i16,
}

impl Scaled {
    pub fn new(factor: f64, dimension: Dimension) -> Self {
        Self {
            factor,
            dimension,
            cycles: 0,
        }
    }

    /// One cycle in a second.
    pub fn hertz() -> Self {
        Self {
            cycles: 2,
            ..Self::new(1.0, Dimension::of(0, 0, -1, 0, 0))
        }
    }

    pub fn times(self, other: Self) -> Self {
        Self {
            factor: self.factor * other.factor,
            dimension: self.dimension.combine(other.dimension, 1),
            cycles: self.cycles.saturating_add(other.cycles),
        }
    }

    /// Raised to `halves`/2; none when an exponent is no longer a multiple of one half.
    pub fn power(self, halves: i16) -> Option<Self> {
        Some(Self {
            factor: match halves {
                1 => self.factor.sqrt(),
                -2 => 1.0 / self.factor,
                _ => self.factor.powf(f64::from(halves) / 2.0),
            },
            dimension: self.dimension.power(halves)?,
            cycles: self.cycles.checked_mul(halves).filter(|c| c % 2 == 0)? / 2,
        })
    }

    /// With 2 pi rad for every cycle.
    pub fn in_radians(self) -> (f64, Dimension) {
        let mut dimension = self.dimension;
        dimension.halves[RADIAN] = dimension.halves[RADIAN].saturating_add(self.cycles);
        let factor = match self.cycles {
            0 => self.factor,
            halves => self.factor * TAU.powf(f64::from(halves) / 2.0),
        };
        (factor, dimension)
    }
}
