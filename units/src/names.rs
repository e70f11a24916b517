//! The units that are known by name, and their SI prefixes.

use std::f64::consts::PI;

use super::grammar::Scaled;
use super::{Dimension, INCH, POUND_FORCE, STANDARD_GRAVITY};

/// The name nearest to `name`, when one is near enough to be worth suggesting.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
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
pub(super) const NAMED: &[(&str, f64, Dimension, bool)] = &[
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

/// The unit of that name, with or without a prefix.
pub(super) fn lookup(name: &str) -> Option<Scaled> {
    if let Some(&(_, factor, dimension, _)) = NAMED.iter().find(|named| named.0 == name) {
        return Some((factor, dimension));
    }
    PREFIXES.iter().find_map(|&(prefix, scale)| {
        let rest = name.strip_prefix(prefix)?;
        let &(_, factor, dimension, _) = NAMED.iter().find(|named| named.3 && named.0 == rest)?;
        Some((scale * factor, dimension))
    })
}
