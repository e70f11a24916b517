//! System files by themselves: written, put together and changed.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;

use fmi_system::{Hop, Setting, SystemFile, VariableName};

const ALL: &str = r#"
name = "rig"
description = "A \"rig\" for tests"
connections = [
    "reference.displacement -> control.wanted",
    "reference.velocity[3] -> control.ahead",
    "body.place -> control.measured",
    { connect = "control.command -> body.push", factor = -2.5, offset = 0.25 },
    { connect = "body.place -> control.raw", convert_units = false },
    { connect = "body.far -> control.far", factor = 1.0 },
]
[components.body]
fmu = "Body.fmu"
interface = "model-exchange"
tolerance = 1e-6
units = { place = "mm" }
aliases = { spot = "place" }
[components.body.inputs]
push = "3 kN"
[components.body.parameters]
gap = 1.5
count = 7
on = true
label = "seven"
row = [1.0, 2.5]
[components.control]
fmu = "Control"
interface = "co-simulation"
model = "derounded"
period = "2 ms"
[experiment]
sampling = "1 ms"
step = 5e-4
duration = "20 s"
end_after = "0.5 s"
record = "a.csv"
reference = "b.csv"
end_when = "body.far"
end_cause = "body.why"
stop = "body.halt"
"#;

fn parsed(text: &str) -> SystemFile {
    SystemFile::parse("rig", text).unwrap()
}

/// What was read of a file, without the places in it.
fn content(file: &SystemFile) -> String {
    let SystemFile {
        name,
        description,
        components,
        experiment,
        ..
    } = file;
    let links: Vec<_> = file
        .connections
        .iter()
        .map(|link| {
            (
                link.to_string(),
                link.way.hops.iter().filter(|hop| **hop != Hop::default()),
            )
        })
        .map(|(ends, hops)| (ends, hops.collect::<Vec<_>>()))
        .collect();
    format!("{name} {description} {links:#?} {components:#?} {experiment:#?}")
}

#[test]
fn a_system_is_the_same_after_it_was_written() {
    let file = parsed(ALL);
    assert_eq!(content(&parsed(&file.to_toml())), content(&file));
    // What is not given is not written.
    let bare = parsed("[components.body]\nfmu = \"Body.fmu\"\n").to_toml();
    assert_eq!(parsed(&bare).components["body"].fmu, "Body.fmu");
    for key in [
        "description",
        "experiment",
        "parameters",
        "period",
        "interface",
        "aliases",
    ] {
        assert!(!bare.contains(key), "{bare}");
    }
}

#[test]
fn what_is_written_on_a_command_line_has_the_type_that_it_looks_like() {
    for (text, expected) in [
        ("true", Setting::Boolean(true)),
        ("false", Setting::Boolean(false)),
        ("-12", Setting::Integer(-12)),
        ("1e3", Setting::Number(1000.0)),
        ("inf", Setting::Text("inf".to_string())),
        ("1.5 in", Setting::Text("1.5 in".to_string())),
    ] {
        assert_eq!(Setting::read(text), expected);
    }
}

/// The connections, a text each.
fn links(file: &SystemFile) -> Vec<String> {
    file.connections.iter().map(ToString::to_string).collect()
}

#[test]
fn connections_are_taken_out_and_led_elsewhere_by_their_ends() {
    let mut file = parsed(ALL);
    file.disconnect("body");
    let left = links(&file);
    assert_eq!(left.len(), 3);
    assert!(!left.iter().any(|link| link.starts_with("body.")));

    let mut file = parsed(ALL);
    let instead = [
        (("body", "place"), ("sensor", "reading")),
        (("control", "ahead"), ("other", "early")),
        (("control", "nothing"), ("other", "nothing")),
    ];
    let name = |(component, variable): (&str, &str)| VariableName::new(component, variable);
    let instead: BTreeMap<VariableName, VariableName> =
        instead.map(|(from, to)| (name(from), name(to))).into();
    file.redirect(&instead);
    let all = links(&file);
    assert!(all[0].starts_with("reference.displacement -> control.wanted"));
    assert!(all[1].ends_with("-> other.early"), "{all:?}");
    assert!(
        all[2].starts_with("sensor.reading -> control.measured"),
        "{all:?}"
    );
    assert!(
        all[3].starts_with("control.command -> body.push"),
        "{all:?}"
    );
}

#[test]
fn a_structure_that_moves_the_table_takes_the_place_of_the_reference() {
    let mut file = parsed(ALL);
    file.follow("building");
    let all = links(&file);
    // What is wanted ahead of time is left open.
    assert_eq!(all.len(), 5);
    assert!(
        all[0].starts_with("building.table_displacement -> control.wanted"),
        "{all:?}"
    );
    assert!(!all.iter().any(|link| link.contains("control.ahead")));
}

#[test]
fn a_part_of_a_system_goes_before_what_is_there() {
    let mut file = parsed(ALL);
    let part = r#"
connections = ["load.force -> body.pull"]
[components.load]
fmu = "Load.fmu"
[adjust.body]
gap = 9.5
[adjust.nobody]
gap = 1.0
[experiment]
step = 1e-3
start = 2.0
algorithm = "jacobi"
variable_step = "1 %"
least_step = "1 us"
"#;
    file.extend(parsed(part));
    assert_eq!(links(&file).len(), 7);
    let names: Vec<&str> = file.components.keys().map(String::as_str).collect();
    assert_eq!(names, ["body", "control", "load"]);
    let body = &file.components["body"];
    assert_eq!(body.parameters["gap"], Setting::Number(9.5));
    assert_eq!(body.parameters["count"], Setting::Integer(7));
    let own = &file.experiment;
    assert_eq!(
        (own.start, own.algorithm.as_deref()),
        (Some(2.0), Some("jacobi"))
    );
    assert_eq!(own.step, Some(Setting::Number(1e-3)));
    assert_eq!(own.variable_step, Some(Setting::Text("1 %".to_string())));
    assert_eq!(own.least_step, Some(Setting::Text("1 us".to_string())));
    // What the part does not say stays.
    assert_eq!(own.sampling, Some(Setting::Text("1 ms".to_string())));
    assert_eq!(own.duration, Some(Setting::Text("20 s".to_string())));
    assert_eq!(
        (own.record.as_deref(), own.reference.as_deref()),
        (Some("a.csv"), Some("b.csv"))
    );
    let names = [&own.end_when, &own.end_cause, &own.stop];
    let names = names.map(|name| name.as_ref().map(ToString::to_string));
    let expected = ["body.far", "body.why", "body.halt"].map(|name| Some(name.to_string()));
    assert_eq!(names, expected);
    assert_eq!(own.end_after, Some(Setting::Text("0.5 s".to_string())));
}
