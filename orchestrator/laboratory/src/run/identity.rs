//! What a run was, in words for people: rig, controllers, motion, and what differs from defaults.

use super::experiment::is_file;
use super::manifest::Manifest;
use super::request::Request;
use super::summary::{MotionSummary, Summary};
use super::tuning::in_words;
use crate::systems::built_in;
use crate::systems::tuning::Tuning;
use pages::report::identity::entry;
use pages::report::{Cell, Changed, UnitSystem, Units};
use units::STANDARD_GRAVITY;

/// The entries of a page.
pub fn of_run(manifest: &Manifest, summary: &Summary, units: UnitSystem) -> Vec<(String, Cell)> {
    let request = &manifest.request;
    let mut entries = vec![entry("System", request.system.as_str())];
    if !is_file(&request.system) {
        entries.push(entry("Plant", request.plant.as_str()));
        entries.push(entry("Specimen", request.specimen.as_str()));
        entries.push(entry("Tuning", tuning(request)));
    }
    entries.push(entry(
        "Set",
        match request.set.as_slice() {
            [] => "nothing".to_string(),
            all => all.join(", "),
        },
    ));
    let mut played = |along: &str, motion: &MotionSummary| {
        let peak = motion.pga_g * STANDARD_GRAVITY;
        entries.push(entry(&format!("Motion{along}"), motion.name.as_str()));
        entries.push(entry(
            &format!("Peak{along}"),
            Cell::Quantity(peak, Units::ACCELERATION, 3),
        ));
    };
    if summary.axes.is_empty() {
        played("", &summary.motion);
    }
    for axis in &summary.axes {
        played(&format!(" along {}", axis.axis), &axis.motion);
    }
    if !manifest.changes.is_empty() {
        let changes = manifest.changes.iter().map(|change| {
            let parameter = change
                .variable
                .split_once('.')
                .and_then(|(name, variable)| {
                    manifest.components.get(name)?.parameters.get(variable)
                });
            let unit = parameter.and_then(|(_, unit)| unit.as_deref());
            in_words(change, unit.unwrap_or_default(), units)
        });
        let changes: Vec<String> = changes.collect();
        entries.push(entry("Changed during the run", changes.join("; ")));
    }
    entries.push(entry(
        "Stepped by",
        match manifest.request.variable_step_percent {
            Some(_) => format!("{}, up to {} ms", manifest.algorithm, 1e3 * manifest.step_s),
            None => format!("{}, {} ms", manifest.algorithm, 1e3 * manifest.step_s),
        },
    ));
    entries.push(entry(
        "Version",
        format!(
            "shakebench {} on {}",
            manifest.shakebench, manifest.platform
        ),
    ));
    entries
}

/// Where the controllers' parameters come from.
pub fn tuning(request: &Request) -> String {
    let commissioned = built_in::is_commissioned(&request.plant);
    match (request.tuning, &request.control_model) {
        (_, Some(model)) => format!("by rule on {}", model.display()),
        (Some(Tuning::Printed), None) => "as printed".into(),
        (Some(Tuning::Tuned), None) => "by rule on the commissioned model".into(),
        (None, None) if commissioned => "by rule on the commissioned model".into(),
        (None, None) => "as printed".into(),
    }
}

/// Parameters that differ from their component's default, in the order of the components.
pub fn changed(manifest: &Manifest) -> Vec<Changed> {
    let mut rows = Vec::new();
    for (name, component) in &manifest.components {
        for (parameter, default) in &component.defaults {
            let Some((value, unit)) = component.parameters.get(parameter) else {
                continue;
            };
            let units = Units::of(unit.as_deref().unwrap_or_default());
            rows.push(Changed {
                name: format!("{name}.{parameter}"),
                value: cell(value, &units),
                default: cell(default, &units),
            });
        }
    }
    rows
}

/// Significant digits that a number needs, at most six.
fn needed(number: f64) -> usize {
    let close = |digits: &usize| {
        let text = format!("{number:.*e}", digits - 1);
        let read: f64 = text.parse().unwrap_or(f64::NAN);
        (read - number).abs() <= 1e-7 * number.abs()
    };
    (1..6).find(close).unwrap_or(6)
}

/// A parameter's value with its unit.
pub fn cell(value: &serde_json::Value, units: &Units) -> Cell {
    match value {
        serde_json::Value::Number(number) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            // A seed or a count.
            let is_whole = number.fract() == 0.0 && number.abs() < 1e15;
            if is_whole && units.si.is_empty() {
                return format!("{number}").into();
            }
            let digits = [UnitSystem::Us, UnitSystem::Si].map(|system| {
                let (shown, _) = units.shown(number, system);
                needed(shown)
            });
            // Enough for the system in which the number is the shorter.
            Cell::Quantity(number, units.clone(), digits[0].min(digits[1]).max(3))
        }
        serde_json::Value::String(text) => text.as_str().into(),
        other => other.to_string().into(),
    }
}
