//! Which signals of a run are watched, in which plots, with which limits.

use serde::Serialize;
use units::vocabulary;

use crate::report::{UnitSystem, Units};
use fmi_import::Kind;
use fmi_system::System;

/// What the page draws.
#[derive(Debug, Clone, Serialize)]
pub struct Scene {
    /// Heading.
    pub title: String,
    /// Length of the run, s; none where nobody knows it.
    pub duration: Option<f64>,
    /// Plots, top to bottom.
    pub plots: Vec<Plot>,
    /// Column of the number of steps that a client committed, where one is served.
    pub step: Option<usize>,
    /// Column of the interlock's state, counted with the time as column 0.
    pub tripped: Option<usize>,
    /// Column of its cause, with the words by number.
    pub cause: Option<(usize, Vec<(i64, String)>)>,
}

/// A plot over time.
#[derive(Debug, Clone, Serialize)]
pub struct Plot {
    /// What it shows.
    pub title: String,
    /// Unit shown and what one of it is in SI.
    pub unit: (String, f64),
    /// Name and column of each signal.
    pub signals: Vec<(String, usize)>,
    /// A limit to either side, SI.
    pub limit: Option<f64>,
}

/// What is looked for: title, units, signals, and component and parameter of the limit.
type Wanted = (
    &'static str,
    Units,
    &'static [&'static str],
    &'static [(&'static str, &'static str)],
);

const WANTED: [Wanted; 4] = [
    (
        "Displacement",
        Units::DISPLACEMENT,
        &["reference.displacement", "table.displacement"],
        &[("interlock", "displacement_limit")],
    ),
    (
        "Acceleration",
        Units::ACCELERATION,
        &["reference.acceleration", "table.acceleration"],
        &[("interlock", "acceleration_limit")],
    ),
    (
        "Valve command",
        Units::VOLTAGE,
        &[
            "control.valve_command",
            "allocation.valve_command",
            "interlock.valve_command",
        ],
        &[
            ("control", vocabulary::VALVE_LIMIT),
            ("allocation", vocabulary::VALVE_LIMIT),
        ],
    ),
    (
        "Drift of the specimen",
        Units::DISPLACEMENT,
        &["specimen.drift"],
        &[],
    ),
];

/// A run that is shown.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Its system.
    pub system: &'a System,
    /// Name of its motion.
    pub motion: &'a str,
    /// Length, s.
    pub duration: f64,
}

impl Scene {
    /// Of a run whose simulation has the signals `names`; also their places among them, in the
    /// order of the columns after the time. Plots are in the units of `system`.
    #[must_use]
    pub fn new(run: Run<'_>, names: &[String], system: UnitSystem) -> (Self, Vec<usize>) {
        let mut places = Vec::new();
        let mut column = |name: &str| {
            let place = names.iter().position(|own| own == name)?;
            places.push(place);
            Some(places.len())
        };
        let mut plots = Vec::new();
        for (title, units, signals, limits) in WANTED {
            let signals: Vec<(String, usize)> = signals
                .iter()
                .filter_map(|name| Some(((*name).to_string(), column(name)?)))
                .collect();
            if signals.is_empty() {
                continue;
            }
            let (factor, unit) = units.unit(system);
            let mut limits = limits.iter();
            plots.push(Plot {
                title: title.to_string(),
                unit: (unit.to_string(), factor),
                signals,
                limit: limits.find_map(|(part, name)| parameter(run.system, part, name)),
            });
        }
        let tripped = column("interlock.tripped");
        let cause = column("interlock.trip_cause").zip(causes(run.system));
        let scene = Self {
            title: format!("{} on {}", run.system.name, run.motion),
            duration: Some(run.duration),
            plots,
            step: None,
            tripped,
            cause,
        };
        (scene, places)
    }
}

/// A numeric parameter of a component, as it was given or its default.
fn parameter(system: &System, component: &str, name: &str) -> Option<f64> {
    let mut components = system.components.iter();
    let found = components.find(|own| own.name == component)?;
    let variables = &found.fmu.description.variables;
    let position = variables.iter().position(|own| own.name == name)?;
    let given = found.parameters.iter().find(|(own, _)| *own == position);
    match given {
        Some((_, value)) => serde_json::json!(value).as_f64(),
        None => variables[position].start.as_deref()?.parse().ok(),
    }
}

/// What the numbers of `interlock.trip_cause` mean.
fn causes(system: &System) -> Option<Vec<(i64, String)>> {
    let mut components = system.components.iter();
    let found = components.find(|own| own.name == "interlock")?;
    let mut variables = found.fmu.description.variables.iter();
    let variable = variables.find(|own| own.name == "trip_cause")?;
    let Kind::Enumeration(items) = &variable.kind else {
        return None;
    };
    let words = items.iter().map(|item| {
        let words = if item.description.is_empty() {
            &item.name
        } else {
            &item.description
        };
        (item.value, words.clone())
    });
    Some(words.collect())
}
