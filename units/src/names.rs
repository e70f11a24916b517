//! The units that are known by name, and their SI prefixes.

use std::f64::consts::PI;

use super::constants::{G as STANDARD_GRAVITY, INCH, LBF as POUND_FORCE};
use super::dimension::{Dimension, Scaled};

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

/// The name of the unit that counts cycles.
const HERTZ: &str = "Hz";

/// All names without prefixes.
pub(super) fn known() -> impl Iterator<Item = &'static str> {
    NAMED.iter().map(|named| named.0).chain([HERTZ])
}

/// The unit of that name, with or without a prefix.
pub(super) fn lookup(name: &str) -> Option<Scaled> {
    let named = |name: &str, prefixed: bool| {
        if name == HERTZ {
            return Some(Scaled::hertz());
        }
        let own = NAMED.iter().find(|own| own.0 == name)?;
        (own.3 || !prefixed).then(|| Scaled::new(own.1, own.2))
    };
    let with_prefix = |(prefix, scale): &(&str, f64)| {
        let rest = named(name.strip_prefix(prefix)?, true)?;
        Some(Scaled {
            factor: scale * rest.factor,
            ..rest
        })
    };
    named(name, false).or_else(|| PREFIXES.iter().find_map(with_prefix))
}
