//! The parameters of an identified rig as a table.

use identification::identify::identified::RigIdentification;
use identification::identify::model_file::{ModelFile, StandardErrors};

use pages::report::number::significant;
use pages::report::{Cell, Table, UnitSystem, Units};

/// Columns of [`Parameter::text`].
pub const PARAMETER_COLUMNS: [&str; 4] = ["parameter", "value", "standard error", "unit"];

/// Units of parameters, the laboratory's and SI.
const PAIRS: [(&str, &str); 11] = [
    ("in", "m"),
    ("in/s", "m/s"),
    ("lbf", "N"),
    ("lbf/in", "N/m"),
    ("lbf/(in s)", "N/(m s)"),
    ("lbf/(in s^2)", "N/(m s^2)"),
    ("lbf s/in", "N s/m"),
    ("lbf s^2/in", "kg"),
    ("lbf/(V s)", "N/(V s)"),
    ("lbf/(V s^2)", "N/(V s^2)"),
    ("lbf/(V s^3)", "N/(V s^3)"),
];

/// A parameter that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// As it is called.
    pub name: String,
    /// In its unit.
    pub value: f64,
    /// How sure it is.
    pub error: Uncertainty,
    /// Unit of value and error, as in the model file.
    pub unit: &'static str,
}

/// How sure a parameter is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Uncertainty {
    /// One standard error.
    Estimated(f64),
    /// It was not estimated, for this reason.
    Without(&'static str),
}

impl Parameter {
    /// Name, value, standard error and unit, in the units that were asked for, else the model file's.
    #[must_use]
    pub fn text(&self, asked: Option<UnitSystem>) -> [String; 4] {
        let units = self.units();
        let (factor, unit) = match asked {
            Some(system) => units.unit(system),
            None => (1.0, self.unit),
        };
        [
            self.name.clone(),
            significant(self.value / factor, 6),
            match self.error {
                Uncertainty::Estimated(error) => significant(error / factor, 2),
                Uncertainty::Without(reason) => reason.to_string(),
            },
            unit.to_string(),
        ]
    }

    /// Both units of its value.
    fn units(&self) -> Units {
        let of_both = |&(us, si): &(&'static str, &'static str)| {
            let factor = |unit: &str| units::convert(1.0, unit, self.unit).ok();
            Some(Units::pair(us, factor(us)?, si, factor(si)?))
        };
        PAIRS
            .iter()
            .find(|(us, si)| [*us, *si].contains(&self.unit))
            .and_then(of_both)
            .unwrap_or_else(|| match self.unit {
                "1" => Units::NONE,
                unit => Units::same(unit),
            })
    }
}

/// The table of a page.
pub fn parameter_table(caption: &str, rows: &[Parameter]) -> Table {
    let rows = rows.iter().map(|own| {
        [
            own.name.as_str().into(),
            Cell::Quantity(own.value, own.units(), 6),
            match own.error {
                Uncertainty::Estimated(error) => Cell::Quantity(error, own.units(), 2),
                Uncertainty::Without(reason) => reason.into(),
            },
        ]
    });
    Table::of(caption, ["parameter", "value", "standard error"], rows)
}

/// The parameters of actuator, table and specimen, in inch and pound-force.
pub fn parameters(found: &RigIdentification) -> Vec<Parameter> {
    let file = ModelFile::from_identification(found);
    let Some(errors) = file.standard_errors.clone() else {
        return Vec::new();
    };
    let mut rows = Vec::new();
    let mut row = |name: &str, value: f64, error: f64, unit: &'static str| {
        rows.push(Parameter {
            name: name.to_string(),
            value,
            error: match error {
                0.0 if name.starts_with("specimen") => Uncertainty::Without("given"),
                0.0 => Uncertainty::Without("held"),
                _ => Uncertainty::Estimated(error),
            },
            unit,
        });
    };
    if let (
        Some(actuator),
        StandardErrors {
            actuator: Some(own),
            ..
        },
    ) = (&file.actuator, &errors)
    {
        let units = ["1/s", "1/s^2", "1/s^3"];
        for i in 0..3 {
            let name = format!("denominator a{}", 2 - i);
            row(
                &name,
                actuator.denominator[i + 1],
                own.denominator[i + 1],
                units[i],
            );
        }
        let units = ["lbf/(V s)", "lbf/(V s^2)", "lbf/(V s^3)"];
        for i in 0..3 {
            let name = format!("voltage to force b{}", 2 - i);
            row(
                &name,
                actuator.voltage_to_force[i],
                own.voltage_to_force[i],
                units[i],
            );
        }
        let units = ["lbf/in", "lbf/(in s)", "lbf/(in s^2)"];
        for i in 0..3 {
            let name = format!("velocity to force e{}", 2 - i);
            row(
                &name,
                actuator.velocity_to_force[i],
                own.velocity_to_force[i],
                units[i],
            );
        }
    }
    let mut bodies = vec![("table", file.table, errors.table)];
    if let (Some(body), Some(error)) = (file.specimen, errors.specimen) {
        bodies.push(("specimen", body, error));
    }
    for (name, body, error) in bodies {
        row(&format!("{name} mass"), body.mass, error.mass, "lbf s^2/in");
        row(
            &format!("{name} damping"),
            body.damping,
            error.damping,
            "lbf s/in",
        );
        row(
            &format!("{name} stiffness"),
            body.stiffness,
            error.stiffness,
            "lbf/in",
        );
    }
    if let (Some(delay), Some(error)) = (file.command_delay, errors.command_delay) {
        row("command delay", 1e3 * delay, 1e3 * error, "ms");
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_of_units_converts_both_ways() {
        for (us, si) in PAIRS {
            for unit in [us, si] {
                let own = Parameter {
                    name: "a".into(),
                    value: 3.0,
                    error: Uncertainty::Estimated(0.1),
                    unit,
                };
                let units = own.units();
                let (value, _) =
                    units.shown(units::convert(2.0, si, unit).unwrap(), UnitSystem::Si);
                assert!((value - 2.0).abs() < 1e-12, "{us} {si}: {value}");
                assert_eq!(units.unit(UnitSystem::Us).1, us);
            }
        }
    }
}
