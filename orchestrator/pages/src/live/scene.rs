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

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;
    use std::path::Path;
    use std::sync::Arc;

    use fmi_import::Fmu;
    use fmi_master::{Panel, Tunable};
    use fmi_system::{Component, Value};
    use zip::{ZipWriter, write::SimpleFileOptions};

    use super::super::tuning::Tuning;
    use super::*;

    fn component(folder: &Path, name: &str, variables: &str) -> Component {
        let text = format!(
            r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
            <CoSimulation modelIdentifier="{name}"/>
            <UnitDefinitions><Unit name="V/m"><BaseUnit kg="1" m="1" s="-3" A="-1"/>
            <DisplayUnit name="V/in" factor="0.0254"/></Unit></UnitDefinitions>
            <TypeDefinitions><EnumerationType name="Cause"><Item name="none" value="0"/>
            <Item name="stroke" value="3" description="the table left its stroke"/></EnumerationType></TypeDefinitions>
            <ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"#
        );
        let path = folder.join(format!("{name}.fmu"));
        let mut archive = ZipWriter::new(File::create(&path).unwrap());
        archive
            .start_file("modelDescription.xml", SimpleFileOptions::default())
            .unwrap();
        archive.write_all(text.as_bytes()).unwrap();
        archive.finish().unwrap();
        Component {
            name: name.into(),
            fmu: Fmu::open(&path).unwrap(),
            period: None,
            parameters: Vec::new(),
            inputs: Vec::new(),
            aliases: Vec::new(),
        }
    }

    /// A control and an interlock with limits.
    fn system(folder: &Path) -> System {
        let parameter = |reference: u32, name: &str, start: &str| {
            format!(
                r#"<Float64 name="{name}" valueReference="{reference}" causality="parameter" variability="tunable"
                start="{start}" unit="V/m" displayUnit="V/in" description="about {name}"/>"#
            )
        };
        let control = parameter(1, "gain", "2") + &parameter(2, vocabulary::VALVE_LIMIT, "10");
        let mut control = component(folder, "control", &control);
        let gain = control.fmu.description.position("gain").unwrap();
        control.parameters.push((gain, Value::Number(3.0)));
        let interlock = parameter(1, "displacement_limit", "0.127")
            + r#"<Enumeration name="trip_cause" declaredType="Cause" valueReference="2" causality="output"
            variability="discrete"/>"#;
        System {
            name: "bench".into(),
            description: String::new(),
            components: vec![control, component(folder, "interlock", &interlock)],
            connections: Vec::new(),
            tables: Vec::new(),
            start: 0.0,
            end: None,
            notes: Vec::new(),
            stop: None,
        }
    }

    #[test]
    fn plots_show_the_signals_that_there_are_with_the_limits_of_their_components() {
        let folder = tempfile::tempdir().unwrap();
        let system = system(folder.path());
        let names = [
            "interlock.trip_cause",
            "table.displacement",
            "other",
            "control.valve_command",
            "reference.displacement",
            "interlock.tripped",
        ]
        .map(str::to_string);
        let run = Run {
            system: &system,
            motion: "step",
            duration: 2.5,
        };
        let (scene, places) = Scene::new(run, &names, UnitSystem::Si);
        assert_eq!(places, [4, 1, 3, 5, 0]);
        assert_eq!(
            serde_json::json!(scene),
            serde_json::json!({
                "title": "bench on step", "duration": 2.5, "step": null, "tripped": 4,
                "cause": [5, [[0, "none"], [3, "the table left its stroke"]]],
                "plots": [
                    {"title": "Displacement", "unit": ["mm", 0.001], "limit": 0.127,
                     "signals": [["reference.displacement", 1], ["table.displacement", 2]]},
                    {"title": "Valve command", "unit": ["V", 1.0], "limit": 10.0,
                     "signals": [["control.valve_command", 3]]},
                ],
            })
        );
        // The value that the system gives has precedence over the start value.
        assert_eq!(parameter(&system, "control", "gain"), Some(3.0));
        assert_eq!(parameter(&system, "control", "other"), None);
        assert_eq!(parameter(&system, "interlock", "gain"), None);
    }

    #[test]
    fn controls_of_parameters_are_in_the_units_of_their_reader() {
        let folder = tempfile::tempdir().unwrap();
        let system = system(folder.path());
        let tunable = |variable: &str| Tunable {
            variable: variable.into(),
            start: 2.0,
            low: 1.0,
            high: 4.0,
        };
        let knobs = |reader, may_change| -> serde_json::Value {
            let panel = Panel::new(vec![tunable("control.gain"), tunable("control.none")], 500);
            let tuning = Tuning::new(&system, Arc::new(panel), 0.5, reader);
            serde_json::from_str(&tuning.controls(may_change)).unwrap()
        };
        let knob = |variable: &str, about: &str, unit: &str, factor: f64| {
            serde_json::json!({
                "variable": variable, "about": about, "unit": [unit, factor], "low": 1.0, "high": 4.0, "start": 2.0,
            })
        };
        let other = knob("control.none", "", "", 1.0);
        assert_eq!(
            knobs(UnitSystem::Si, false),
            serde_json::json!({"may_change": false, "seconds": 0.5, "knobs": [
                knob("control.gain", "about gain", "V/mm", 1000.0), other]})
        );
        let us = knobs(UnitSystem::Us, true);
        assert_eq!((&us["may_change"], &us["knobs"][1]), (&true.into(), &other));
        let (gain, unit) = (&us["knobs"][0], &us["knobs"][0]["unit"]);
        assert_eq!((&gain["start"], &unit[0]), (&2.0.into(), &"V/in".into()));
        assert!((unit[1].as_f64().unwrap() - 1.0 / 0.0254).abs() < 1e-9);
    }
}
