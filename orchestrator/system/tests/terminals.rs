//! Terminals of FMUs connected in one line.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs::File;
use std::io::Write;
use std::path::Path;

use fmi_import::Interface;
use fmi_system::{Files, System, SystemFile, assemble};
use zip::{ZipWriter, write::SimpleFileOptions};

/// An FMU without a library: inputs and outputs, and the text of its terminals.
fn pack(folder: &Path, name: &str, inputs: &[&str], outputs: &[&str], terminals: &str) {
    let causalities = inputs.iter().map(|name| (*name, "input", "start=\"0\""));
    let outputs_too = outputs
        .iter()
        .map(|name| (*name, "output", "initial=\"calculated\""));
    let (mut variables, mut structure) = (String::new(), String::new());
    for (at, (name, causality, more)) in causalities.chain(outputs_too).enumerate() {
        variables += &format!(
            "<Float64 name=\"{name}\" valueReference=\"{at}\" causality=\"{causality}\" {more}/>"
        );
        if causality == "output" {
            structure += &format!("<Output valueReference=\"{at}\" dependencies=\"\"/>");
        }
    }
    let description = format!(
        "<fmiModelDescription fmiVersion=\"3.0\" modelName=\"{name}\" instantiationToken=\"1\">\
         <ModelExchange modelIdentifier=\"{name}\"/><CoSimulation modelIdentifier=\"{name}\"/>\
         <ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>\
         </fmiModelDescription>"
    );
    let terminals = format!(
        "<fmiTerminalsAndIcons fmiVersion=\"3.0\"><Terminals>{terminals}</Terminals></fmiTerminalsAndIcons>"
    );
    let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
    for (name, content) in [
        ("modelDescription.xml", description),
        ("terminalsAndIcons/terminalsAndIcons.xml", terminals),
    ] {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(content.as_bytes()).unwrap();
    }
    archive.finish().unwrap();
}

fn shaft(rule: &str, kind: &str, members: &[(&str, &str, &str)]) -> String {
    let members: String = members
        .iter()
        .map(|(member, variable, kind)| {
            format!(
                "<TerminalMemberVariable variableName=\"{variable}\" memberName=\"{member}\" variableKind=\"{kind}\"/>"
            )
        })
        .collect();
    format!(
        "<Terminal name=\"shaft\" matchingRule=\"{rule}\" terminalKind=\"{kind}\">{members}</Terminal>"
    )
}

/// A motor that gives a torque and takes a speed, and a load that does the other way round.
fn motor_and_load(folder: &Path, rule: &str, kinds: [&str; 2], load: &[(&str, &str, &str)]) {
    let motor = [("speed", "w", "signal"), ("torque", "tau", "inflow")];
    pack(
        folder,
        "Motor",
        &["w"],
        &["tau"],
        &shaft(rule, kinds[0], &motor),
    );
    let inputs = ["load torque", "extra"];
    pack(
        folder,
        "Load",
        &inputs,
        &["speed"],
        &shaft(rule, kinds[1], load),
    );
}

const LOAD: [(&str, &str, &str); 2] = [
    ("torque", "load torque", "inflow"),
    ("speed", "speed", "signal"),
];

fn read(folder: &Path, connection: &str, more: &str) -> Result<System, String> {
    let text = format!(
        "connections = [\"{connection}\"]\n[components.motor]\nfmu = \"Motor.fmu\"\n{more}\n\
         [components.load]\nfmu = \"Load.fmu\"\n"
    );
    std::fs::write(folder.join("drive.toml"), text).unwrap();
    let file = SystemFile::read(&folder.join("drive.toml")).map_err(|error| error.to_string())?;
    assemble(&file, &[], &mut Files::of(&file)).map_err(|error| error.to_string())
}

/// Connections as `component.input` and the factor of the value.
fn connections(system: &System) -> Vec<(String, f64)> {
    let mut all: Vec<(String, f64)> = system
        .connections
        .iter()
        .map(|connection| {
            let part = &system.components[connection.component];
            let input = &part.fmu.description.variables[connection.input].name;
            (format!("{}.{input}", part.name), connection.passage.factor)
        })
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[test]
fn two_terminals_are_connected_in_one_line_in_both_directions() {
    let folder = tempfile::tempdir().unwrap();
    motor_and_load(folder.path(), "plug", ["rotation", "rotation"], &LOAD);
    let expected = [
        ("load.load torque".to_string(), -1.0),
        ("motor.w".to_string(), 1.0),
    ];
    for connection in ["motor.shaft -> load.shaft", "load.shaft -> motor.shaft"] {
        let system = read(folder.path(), connection, "").unwrap();
        assert_eq!(connections(&system), expected, "{connection}");
    }
}

#[test]
fn a_bus_connects_what_both_have_and_a_sequence_goes_by_order() {
    let folder = tempfile::tempdir().unwrap();
    let bus = [("speed", "speed", "signal"), ("more", "extra", "signal")];
    motor_and_load(folder.path(), "bus", ["a", "a"], &bus);
    let system = read(folder.path(), "motor.shaft -> load.shaft", "").unwrap();
    assert_eq!(connections(&system), [("motor.w".to_string(), 1.0)]);
    let sequence = [("one", "speed", "signal"), ("two", "extra", "outflow")];
    motor_and_load(folder.path(), "sequence", ["a", "a"], &sequence);
    let system = read(folder.path(), "motor.shaft -> load.shaft", "").unwrap();
    let expected = [
        ("load.extra".to_string(), 1.0),
        ("motor.w".to_string(), 1.0),
    ];
    assert_eq!(connections(&system), expected);
}

#[test]
fn terminals_that_do_not_fit_are_refused_with_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let refused = |connection: &str, words: &[&str]| {
        let Err(reason) = read(folder, connection, "") else {
            panic!("`{connection}` was accepted");
        };
        for word in words {
            assert!(reason.contains(word), "`{word}` is not in {reason}");
        }
    };
    motor_and_load(folder, "plug", ["rotation", "translation"], &LOAD);
    let both = "motor.shaft -> load.shaft";
    refused(both, &["kind `rotation`", "line 1"]);
    motor_and_load(folder, "plug", ["a", "a"], &LOAD[1..]);
    refused(both, &["`load.shaft` has no member `torque`"]);
    motor_and_load(folder, "org.other", ["a", "a"], &LOAD);
    refused(both, &["matching rule `org.other`", "one by one"]);
    let same_side = [
        ("torque", "load torque", "inflow"),
        ("speed", "extra", "signal"),
    ];
    motor_and_load(folder, "plug", ["a", "a"], &same_side);
    refused(both, &["member `speed`", "an output of one"]);
    let dangling = [
        ("torque", "nothing", "inflow"),
        ("speed", "speed", "signal"),
    ];
    motor_and_load(folder, "plug", ["a", "a"], &dangling);
    refused(both, &["variable `nothing`"]);
    refused(
        "motor.shaft -> load.extra",
        &["`motor.shaft` is a terminal"],
    );
}

#[test]
fn a_component_chooses_model_exchange_and_its_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    motor_and_load(folder, "plug", ["a", "a"], &LOAD);
    let both = "motor.shaft -> load.shaft";
    let system = read(
        folder,
        both,
        "interface = \"model-exchange\"\ntolerance = 1e-6",
    )
    .unwrap();
    let motor = system.components.iter().find(|part| part.name == "motor");
    let motor = &motor.unwrap().fmu;
    assert_eq!(motor.description.interface, Interface::ModelExchange);
    assert_eq!(motor.tolerance, Some(1e-6));
    let usual = read(folder, both, "").unwrap();
    let interface = |part: &fmi_system::Component| part.fmu.description.interface;
    assert!(
        usual
            .components
            .iter()
            .all(|part| interface(part) == Interface::CoSimulation)
    );
    for (more, word) in [
        ("tolerance = 2.0", "between 1e-12 and 0.01"),
        ("interface = \"x\"", "co-simulation"),
    ] {
        let reason = read(folder, both, more).unwrap_err();
        assert!(reason.contains(word), "{reason}");
    }
}
