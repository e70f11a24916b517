//! The parameters of an identified rig as a table.

use identification::identify::identified::RigIdentification;
use identification::identify::model_file::{ModelFile, StandardErrors};

use crate::report::number::significant;

/// Rows of name, value, standard error and unit, in inch and pound-force.
pub fn parameters(found: &RigIdentification) -> Vec<[String; 4]> {
    let file = ModelFile::from_identification(found);
    let Some(errors) = file.standard_errors.clone() else {
        return Vec::new();
    };
    let mut rows = Vec::new();
    let mut row = |name: &str, value: f64, error: f64, unit: &str| {
        rows.push([
            name.to_string(),
            significant(value, 6),
            match error {
                0.0 if name.starts_with("specimen") => "given".to_string(),
                0.0 => "held".to_string(),
                _ => significant(error, 2),
            },
            unit.to_string(),
        ]);
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
