//! The two systems of units that results can be read in.

use std::borrow::Cow;

use units::{INCH, POUND_FORCE, STANDARD_GRAVITY};

/// What results are read in. Files of numbers (CSV, JSON) are SI throughout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum UnitSystem {
    /// in, in/s, g, lbf
    #[default]
    Us,
    /// mm, mm/s, g, kN
    Si,
}

impl UnitSystem {
    /// Its name in a page.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Us => "laboratory",
            Self::Si => "si",
        }
    }
}

/// The two units a value can be read in, the laboratory's and SI; the reader of a report chooses.
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    /// Name of the laboratory's unit; empty for none.
    pub laboratory: Cow<'static, str>,
    /// What one of it is in the unit the data are given in.
    pub laboratory_factor: f64,
    /// Name of the SI unit; empty for none.
    pub si: Cow<'static, str>,
    /// What one of it is in the unit the data are given in.
    pub si_factor: f64,
}

/// Pairs of the laboratory's and the metric unit by the SI unit of the data, as FMI variables,
/// models and effects name it.
const PAIRS: [(&str, &str, &str); 15] = [
    ("m", "in", "mm"),
    ("m/s", "in/s", "mm/s"),
    ("m/s2", "g", "g"),
    ("m/s^2", "g", "g"),
    ("N", "lbf", "kN"),
    ("N/m", "lbf/in", "kN/m"),
    ("N*s/m", "lbf*s/in", "kN*s/m"),
    ("N/(m/s)", "lbf*s/in", "kN*s/m"),
    ("V/m", "V/in", "V/mm"),
    ("V*s/m", "V*s/in", "V*s/mm"),
    ("V/(m*s)", "V/(in*s)", "V/(mm*s)"),
    ("V*s2/m", "V*s2/in", "V*s2/mm"),
    ("Pa", "psi", "MPa"),
    ("kg", "lbf*s2/in", "kg"),
    ("J", "lbf*in", "J"),
];

impl Units {
    /// Length, data in m: in, mm.
    pub const DISPLACEMENT: Units = Units::pair("in", INCH, "mm", 1e-3);
    /// Data in m/s: in/s, mm/s.
    pub const VELOCITY: Units = Units::pair("in/s", INCH, "mm/s", 1e-3);
    /// Data in m/s^2: g, which laboratories read in both systems.
    pub const ACCELERATION: Units = Units::pair("g", STANDARD_GRAVITY, "g", STANDARD_GRAVITY);
    /// Data in N: lbf, kN.
    pub const FORCE: Units = Units::pair("lbf", POUND_FORCE, "kN", 1e3);
    /// Data in J: lbf in, J.
    pub const ENERGY: Units = Units::pair("lbf in", POUND_FORCE * INCH, "J", 1.0);
    /// Data in V.
    pub const VOLTAGE: Units = Units::same("V");
    /// Data in s.
    pub const TIME: Units = Units::same("s");
    /// Data in Hz.
    pub const FREQUENCY: Units = Units::same("Hz");
    /// Data in percent.
    pub const PERCENT: Units = Units::same("%");
    /// Data in dB.
    pub const DECIBEL: Units = Units::same("dB");
    /// Data in degrees.
    pub const DEGREE: Units = Units::same("°");
    /// Plain numbers.
    pub const NONE: Units = Units::same("");

    /// Two units and what one of each is in the unit of the data.
    #[must_use]
    pub const fn pair(
        laboratory: &'static str,
        laboratory_factor: f64,
        si: &'static str,
        si_factor: f64,
    ) -> Self {
        Self {
            laboratory: Cow::Borrowed(laboratory),
            laboratory_factor,
            si: Cow::Borrowed(si),
            si_factor,
        }
    }

    /// One unit for both, that of the data.
    #[must_use]
    pub const fn same(unit: &'static str) -> Self {
        Self::pair(unit, 1.0, unit, 1.0)
    }

    /// What data in the unit `si` are read in; that unit itself where there is no other.
    #[must_use]
    pub fn of(si: &str) -> Self {
        let found = PAIRS.iter().find(|(unit, _, _)| *unit == si);
        let factor = |unit: &str| units::convert(1.0, unit, si).ok();
        found
            .and_then(|&(_, laboratory, metric)| {
                Some(Self::pair(
                    laboratory,
                    factor(laboratory)?,
                    metric,
                    factor(metric)?,
                ))
            })
            .unwrap_or_else(|| Self {
                laboratory: si.to_string().into(),
                laboratory_factor: 1.0,
                si: si.to_string().into(),
                si_factor: 1.0,
            })
    }

    /// A value of the data in a system, with the unit's name.
    #[must_use]
    pub fn shown(&self, value: f64, system: UnitSystem) -> (f64, &str) {
        let (factor, unit) = self.unit(system);
        (value / factor, unit)
    }

    /// What one unit of a system is in the unit of the data, and its name.
    #[must_use]
    pub fn unit(&self, system: UnitSystem) -> (f64, &str) {
        match system {
            UnitSystem::Us => (self.laboratory_factor, &self.laboratory),
            UnitSystem::Si => (self.si_factor, &self.si),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_converts() {
        for (si, laboratory, metric) in PAIRS {
            let units = Units::of(si);
            assert_eq!((&*units.laboratory, &*units.si), (laboratory, metric));
        }
        assert_eq!(Units::of("m"), Units::DISPLACEMENT);
        let force = Units::FORCE;
        let (shown, unit) = force.shown(4_448.221_615_260_5, UnitSystem::Us);
        assert!((shown - 1000.0).abs() < 1e-9 && unit == "lbf");
        assert_eq!(force.shown(2500.0, UnitSystem::Si), (2.5, "kN"));
        let other = Units::of("widget");
        assert_eq!(other.shown(2.0, UnitSystem::Si), (2.0, "widget"));
    }
}
