//! Systems in TOML, assembled with FMUs that have no library: values, units, tables, order, refusals.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs::File;
use std::io::Write;
use std::path::Path;

use fmi_import::BaseUnit;
use fmi_system::{
    Declared, DeclaredUnit, Files, Hop, InputTable, Operation, Setting, Source, System,
    SystemError, SystemFile, Transformation, Value, Way, assemble,
};
use zip::{ZipWriter, write::SimpleFileOptions};

/// An FMU of FMI 3.0 without a library.
fn pack(folder: &Path, name: &str, variables: &str, outputs: &str) {
    let description = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
        <CoSimulation modelIdentifier="{name}"/>
        <UnitDefinitions>
        <Unit name="in"><BaseUnit m="1" factor="0.0254"/></Unit>
        <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
        <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
        <Unit name="degF"><BaseUnit K="1" factor="0.5555555555555556" offset="255.3722222222222"/></Unit>
        <Unit name="K"><BaseUnit K="1"/></Unit>
        </UnitDefinitions>
        <TypeDefinitions><EnumerationType name="Mode"><Item name="Slow" value="1"/><Item name="Fast" value="4"/>
        </EnumerationType></TypeDefinitions>
        <ModelVariables>{variables}</ModelVariables><ModelStructure>{outputs}</ModelStructure>
        </fmiModelDescription>"#
    );
    let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
    let options = SimpleFileOptions::default();
    archive.start_file("modelDescription.xml", options).unwrap();
    archive.write_all(description.as_bytes()).unwrap();
    archive.finish().unwrap();
}

/// A body that gives its position in mm and a truth value; the outputs depend directly on no input.
fn body(folder: &Path) {
    pack(
        folder,
        "Body",
        r#"<Float64 name="push" valueReference="1" causality="input" start="0"/>
        <Float64 name="place" valueReference="2" causality="output" unit="mm" initial="calculated"/>
        <Boolean name="far" valueReference="3" causality="output" variability="discrete" initial="calculated"/>
        <Enumeration name="why" declaredType="Mode" valueReference="4" causality="output" variability="discrete"
            initial="calculated"/>
        <Float64 name="gap" valueReference="5" causality="parameter" variability="fixed" unit="mm" start="1"/>
        <Float64 name="warmth" valueReference="6" causality="parameter" variability="fixed" unit="degC" start="20"/>
        <Int32 name="count" valueReference="7" causality="parameter" variability="fixed" start="3"/>
        <Boolean name="on" valueReference="8" causality="parameter" variability="fixed" start="true"/>
        <Enumeration name="mode" declaredType="Mode" valueReference="9" causality="parameter" variability="fixed"
            start="1"/>
        <Float64 name="row" valueReference="10" causality="parameter" variability="fixed" start="1 2 3">
        <Dimension start="3"/></Float64>
        <String name="label" valueReference="11" causality="parameter" variability="fixed"><Start value="a"/></String>
        <Boolean name="halt" valueReference="12" causality="input" variability="discrete" start="false"/>"#,
        r#"<Output valueReference="2" dependencies=""/><Output valueReference="3" dependencies=""/>
        <Output valueReference="4" dependencies=""/>"#,
    );
}

/// A gain whose output depends directly on its input in inches.
fn gain(folder: &Path) {
    pack(
        folder,
        "Gain",
        r#"<Float64 name="in" valueReference="1" causality="input" unit="in" start="0"/>
        <Float64 name="out" valueReference="2" causality="output" unit="in" initial="calculated"/>"#,
        r#"<Output valueReference="2" dependencies="1"/>"#,
    );
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    body(folder.path());
    gain(folder.path());
    folder
}

fn file(folder: &Path, text: &str) -> Result<SystemFile, SystemError> {
    std::fs::write(folder.join("rig.toml"), text).unwrap();
    SystemFile::read(&folder.join("rig.toml"))
}

fn read(folder: &Path, text: &str, set: &[&str]) -> Result<System, SystemError> {
    let file = file(folder, text)?;
    let set: Vec<String> = set.iter().map(|one| (*one).to_string()).collect();
    assemble(&file, &set, &mut Files::of(&file))
}

/// The message, less the folder.
fn refusal(folder: &Path, text: &str, set: &[&str]) -> String {
    let Err(error) = read(folder, text, set) else {
        panic!("accepted: {text} {set:?}");
    };
    let text = error.to_string();
    text.replace(&format!("{}/", folder.display()), "")
}

const ONE: &str = "[components.body]\nfmu = \"Body.fmu\"\n";
const TWO: &str = "[components.body]\nfmu = \"Body.fmu\"\n[components.gain]\nfmu = \"Gain.fmu\"\n";

/// The value that is given to a variable of the only component.
fn given(system: &System, name: &str) -> Option<Value> {
    let part = &system.components[0];
    let position = part.fmu.description.position(name).unwrap();
    part.given().get(&position).map(|value| (*value).clone())
}

#[test]
fn values_are_read_by_type_and_unit_from_the_file_and_the_command_line() {
    let folder = folder();
    let values = "[components.body.parameters]\ngap = \"2 in\"\ncount = 7\non = false\nmode = \"fast\"\n\
                  row = [4.0, 5.0, 6.0]\nlabel = \"b\"\n";
    let system = read(folder.path(), &format!("{ONE}{values}"), &[]).unwrap();
    let Some(Value::Number(gap)) = given(&system, "gap") else {
        panic!("a number");
    };
    assert!((gap - 50.8).abs() < 1e-12, "{gap}");
    assert_eq!(given(&system, "count"), Some(Value::Number(7.0)));
    assert_eq!(given(&system, "on"), Some(Value::Number(0.0)));
    assert_eq!(given(&system, "mode"), Some(Value::Number(4.0)));
    assert_eq!(given(&system, "row[3]"), Some(Value::Number(6.0)));
    assert_eq!(given(&system, "label"), Some(Value::Text("b".into())));
    assert_eq!(given(&system, "push"), None);

    // The command line goes before the file; one value stands for all of an array; zero needs no unit.
    let set = ["body.gap=0", "body.row=9", "body.push=1.5", "body.mode=4"];
    let system = read(folder.path(), &format!("{ONE}{values}"), &set).unwrap();
    assert_eq!(given(&system, "gap"), Some(Value::Number(0.0)));
    for element in ["row[1]", "row[3]"] {
        assert_eq!(given(&system, element), Some(Value::Number(9.0)));
    }
    assert_eq!(given(&system, "push"), Some(Value::Number(1.5)));
    assert_eq!(given(&system, "mode"), Some(Value::Number(4.0)));
    let system = read(folder.path(), ONE, &["body.row=7 8 9"]).unwrap();
    assert_eq!(given(&system, "row[2]"), Some(Value::Number(8.0)));
}

#[test]
fn values_that_do_not_fit_are_refused_with_their_place() {
    let folder = folder();
    for (set, expected) in [
        (
            "body.gap=2",
            "`2` has no unit, and `gap` is in mm; expected a number with its unit, such as gap=\"2 mm\"",
        ),
        (
            "gap",
            "expected component.variable=VALUE, such as control.valve_limit=\"5 V\"",
        ),
        (
            "bodi.gap=1 mm",
            "there is no component `bodi`; did you mean `body`?",
        ),
        (
            "body.gab=1 mm",
            "Body (Body.fmu) has no parameter `gab`; did you mean `gap`?",
        ),
        (
            "body.place=1 mm",
            "`place` is an output, expected parameter: its FMU computes it",
        ),
        (
            "body.mode=2",
            "`2` is not a value for a Enumeration; expected one of 1 (Slow), 4 (Fast)",
        ),
        (
            "body.mode=slo",
            "`slo` is not a choice; did you mean `Slow`?",
        ),
        (
            "body.on=1",
            "`1` is not a value for a Boolean; expected true or false",
        ),
        ("body.row=1 2", "2 values for an array of 3 elements"),
        (
            "body.model=derounded",
            "`derounded`: no set of parameters is known here",
        ),
        (
            "body.interface=x",
            "`x`: expected `co-simulation` or `model-exchange`",
        ),
        (
            "body.tolerance=0.5",
            "0.5: expected a number between 1e-12 and 0.01",
        ),
    ] {
        let said = refusal(folder.path(), ONE, &[set]);
        assert!(said.ends_with(expected), "{set}: {said}");
    }
    for (more, expected) in [
        (
            "[components.body.parameters]\ncount = 1.5\n",
            "rig.toml: components.body.parameters.count: `1.5` is not a value for a Int32; expected a whole \
             number from -2147483648 to 2147483647",
        ),
        (
            "[components.body.inputs]\nplace = 1\n",
            "rig.toml: components.body.inputs.place: `place` is an output, expected input",
        ),
        (
            "[components.body.units]\ncount = \"m\"\n",
            "rig.toml: components.body.units.count: a Int32 has no unit",
        ),
        (
            "[components.body.aliases]\ngap = \"place\"\n",
            "rig.toml: components.body.aliases.gap: `gap` is a variable of it",
        ),
        (
            "[experiment]\nend_when = \"body.place\"\n",
            "rig.toml: experiment.end_when: `body.place` is not Boolean",
        ),
        (
            "[experiment]\nend_when = \"body.far\"\nend_cause = \"body.place\"\n",
            "rig.toml: experiment.end_cause: `body.place` is not an enumeration",
        ),
    ] {
        assert_eq!(
            refusal(folder.path(), &format!("{ONE}{more}"), &[]),
            expected
        );
    }
}

#[test]
fn connections_convert_units_and_scale_as_the_file_says() {
    let folder = folder();
    let text = format!(
        "connections = [\n\"body.place -> gain.in\",\n{{ connect = \"gain.out -> body.push\", offset = 2.0 }},\n]\n{TWO}"
    );
    let system = read(folder.path(), &text, &[]).unwrap();
    let [place, push] = system.connections.as_slice() else {
        panic!("two connections");
    };
    // mm to in.
    assert!((place.passage.of(254.0) - 10.0).abs() < 1e-12);
    // The factor is 1 where none is given.
    assert_eq!((push.passage.factor, push.passage.offset), (1.0, 2.0));
    assert_eq!(push.passage.of(3.0), 5.0);
    assert!(matches!(place.source, Source::Output { component: 0, .. }));
    for (connection, expected) in [
        (
            "\"body.place\"",
            "rig.toml: connection `body.place` (line 2): expected \"component.output -> component.input\"",
        ),
        (
            "\"body.far -> gain.in\"",
            "rig.toml: connection `body.far -> gain.in` (line 2): `body.far` is a Boolean and cannot drive the \
             Float64 `gain.in`",
        ),
        (
            "\"reference.velocity -> gain.in\"",
            "rig.toml: connection `reference.velocity -> gain.in` (line 2): `reference.velocity` does not fit \
             `gain.in`: `m/s` is 1 m s^-1 and `in` is 0.0254 m",
        ),
        (
            "\"body.place -> gain.in\", \"gain.out -> gain.in\"",
            "rig.toml: connection `gain.out -> gain.in` (line 2): `gain.in` is already driven by `body.place`",
        ),
        (
            "\"reference.place -> gain.in\"",
            "rig.toml: connection `reference.place -> gain.in` (line 2): the reference has no `place`; there is \
             `displacement`, `velocity`, `acceleration`, `displacement_y`, `velocity_y`, `acceleration_y` (or \
             `displacement[3]`, three samples ahead)",
        ),
        (
            "\"body.row[1..2] -> gain.in\"",
            "rig.toml: connection `body.row[1..2] -> gain.in` (line 2): 2 values on the left and 1 on the right",
        ),
    ] {
        let text = format!("connections = [\n{connection}]\n{TWO}");
        assert_eq!(refusal(folder.path(), &text, &[]), expected);
    }
}

#[test]
fn times_of_the_experiment_are_read_with_their_units() {
    let folder = folder();
    let text = format!(
        "{ONE}[experiment]\nsampling = \"1 ms\"\nstep = \"2 ms\"\nduration = 20\nleast_step = \"1 us\"\n\
         variable_step = \"0.1 %\"\nend_when = \"body.far\"\nend_cause = \"body.why\"\nend_after = \"0.5 s\"\n\
         stop = \"body.halt\"\n"
    );
    let file = file(folder.path(), &text).unwrap();
    let near = |found: Option<f64>, expected: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{found:?}");
    };
    near(file.sampling().unwrap(), 1e-3);
    near(file.step().unwrap(), 2e-3);
    near(file.duration().unwrap(), 20.0);
    near(file.least_step().unwrap(), 1e-6);
    near(file.variable_step().unwrap(), 0.1);
    let system = assemble(&file, &[], &mut Files::of(&file)).unwrap();
    let at = |name| system.components[0].fmu.description.position(name).unwrap();
    let end = system.end.unwrap();
    assert_eq!(end.when, (0, at("far")));
    assert_eq!(end.cause, Some((0, at("why"))));
    assert_eq!(end.after, 0.5);
    assert_eq!(system.stop, Some((0, at("halt"))));
    for (line, expected) in [
        (
            "step = 0",
            "0 s is not a valid time, expected more than 0 s",
        ),
        ("step = true", "`true` is not a time, expected \"2 ms\""),
        (
            "variable_step = -1",
            "`-1` is not a share; expected a number above 0, such as \"0.05 %\"",
        ),
    ] {
        let file = self::file(folder.path(), &format!("{ONE}[experiment]\n{line}\n")).unwrap();
        let said = file
            .step()
            .and(file.variable_step())
            .unwrap_err()
            .to_string();
        assert!(said.ends_with(expected), "{said}");
    }
}

#[test]
fn tables_are_read_between_their_rows() {
    let folder = folder();
    let table = "time [ms],push [kN],row[2]\n0,1,5\n1000,3,6\n1000,7,6\n2000,9,8\n";
    std::fs::write(folder.path().join("load.csv"), table).unwrap();
    let text = |between: &str| {
        format!(
            "connections = [\"load.push -> body.push\"]\n{ONE}[tables.load]\nfile = \"load.csv\"\n\
             between = \"{between}\"\n"
        )
    };
    let system = read(folder.path(), &text("linear"), &[]).unwrap();
    let table: &InputTable = &system.tables[0];
    assert_eq!(table.columns, ["push", "row[2]"]);
    assert_eq!(table.units, [Some("kN".to_string()), None]);
    assert_eq!(table.end(), 2.0);
    let source = system.connections[0].source;
    assert_eq!(
        source,
        Source::Table {
            table: 0,
            column: 0
        }
    );
    // Of two rows at one time, the later one counts from then on.
    let times = [
        (-1.0, 1.0),
        (0.25, 1.5),
        (1.0, 7.0),
        (1.5, 8.0),
        (2.0, 9.0),
        (5.0, 9.0),
    ];
    for (time, value) in times {
        let mut row = 0;
        assert!(
            (table.at(0, time, &mut row) - value).abs() < 1e-9,
            "at {time} s"
        );
    }
    // A place that was kept does not matter, even after the time.
    let mut row = 3;
    assert_eq!(table.at(0, 0.5, &mut row), 2.0);
    assert_eq!(row, 0);
    let system = read(folder.path(), &text("hold"), &[]).unwrap();
    for (time, value) in [(0.99, 1.0), (1.0, 7.0), (1.99, 7.0), (2.0, 9.0)] {
        assert_eq!(system.tables[0].at(0, time, &mut 0), value, "at {time} s");
    }
    let missing = text("hold").replace("load.push", "load.pull");
    let said = refusal(folder.path(), &missing, &[]);
    assert!(
        said.ends_with("the table `load` has no column `pull`; did you mean `push`?"),
        "{said}"
    );
}

#[test]
fn outputs_come_after_what_they_depend_on_and_loops_are_named() {
    let folder = folder();
    let parts = "[components.a]\nfmu = \"Gain.fmu\"\n[components.b]\nfmu = \"Gain.fmu\"\n\
                 [components.c]\nfmu = \"Gain.fmu\"\n";
    let chain = format!("connections = [\"c.out -> a.in\", \"a.out -> b.in\"]\n{parts}");
    let system = read(folder.path(), &chain, &[]).unwrap();
    let order: Vec<usize> = system
        .schedule(false)
        .unwrap()
        .operations
        .iter()
        .map(|operation| match operation {
            Operation::Read { component, outputs } => {
                assert_eq!(outputs, &[1]);
                *component
            }
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(order, [2, 0, 1]);

    let ring = format!("connections = [\"a.out -> b.in\", \"b.out -> a.in\"]\n{parts}");
    let system = read(folder.path(), &ring, &[]).unwrap();
    let Err(SystemError::Cycle { variables, .. }) = system.schedule(false) else {
        panic!("a loop");
    };
    assert_eq!(variables.first(), variables.last());
    for name in ["a.out", "b.out"] {
        assert!(variables.iter().any(|own| own == name), "{variables:?}");
    }
    assert!(
        !variables.iter().any(|own| own.starts_with("c.")),
        "{variables:?}"
    );
    let schedule = system.schedule(true).unwrap();
    let loops = schedule
        .operations
        .iter()
        .filter_map(|operation| match operation {
            Operation::Iterate { operations, .. } => Some(operations.len()),
            _ => None,
        });
    assert_eq!(loops.collect::<Vec<_>>(), [2]);
}

#[test]
fn values_in_units_of_a_parameter_set_are_converted_before_they_are_read() {
    let folder = folder();
    let kelvin = |factor, offset| BaseUnit {
        exponents: [0, 0, 0, 0, 1, 0, 0],
        factor,
        offset,
    };
    let declared = |value, name: &str, base, transformation| {
        let start = Some(DeclaredUnit {
            name: name.to_string(),
            base: Some(base),
        });
        let hops = vec![Hop {
            transformation,
            ..Hop::default()
        }];
        let way = Way { start, hops };
        Setting::Declared(Box::new(Declared { value, way }))
    };
    let doubled = Transformation::Linear {
        factor: 2.0,
        offset: 1.0,
    };
    let fahrenheit = kelvin(5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0);
    for (written, expected) in [
        // An offset alone, a factor alone, both; then what the file does besides.
        (
            declared(
                Setting::Number(293.15),
                "K",
                kelvin(1.0, 0.0),
                Transformation::None,
            ),
            20.0,
        ),
        (
            declared(
                Setting::Integer(68),
                "degF",
                fahrenheit,
                Transformation::None,
            ),
            20.0,
        ),
        (
            declared(Setting::Number(10.0), "degC", kelvin(1.0, 273.15), doubled),
            21.0,
        ),
    ] {
        let mut file = file(folder.path(), ONE).unwrap();
        let body = file.components.get_mut("body").unwrap();
        body.parameters
            .insert("warmth".to_string(), written.clone());
        let system = assemble(&file, &[], &mut Files::of(&file)).unwrap();
        let Some(Value::Number(found)) = given(&system, "warmth") else {
            panic!("a number");
        };
        assert!((found - expected).abs() < 1e-9, "{written}: {found}");
    }
}

#[test]
fn whole_numbers_of_every_size_and_inputs_are_read_to_their_limits() {
    let folder = folder();
    let kinds = [
        ("Int8", "-128", "127", "128"),
        ("UInt16", "0", "65535", "65536"),
        (
            "Int64",
            "-9223372036854775808",
            "9223372036854775807",
            "9223372036854775808",
        ),
        ("UInt64", "0", "18446744073709551615", "-1"),
    ];
    let variables = kinds.iter().zip(1..).map(|((kind, ..), n)| {
        format!(
            r#"<{kind} name="p{n}" valueReference="{n}" causality="parameter" variability="fixed" start="1"/>
            <{kind} name="u{n}" valueReference="{n}0" causality="input" variability="discrete" start="1"/>"#
        )
    });
    pack(folder.path(), "Whole", &variables.collect::<String>(), "");
    let whole = "[components.body]\nfmu = \"Whole.fmu\"\n";
    for ((kind, least, most, beyond), n) in kinds.iter().zip(1..) {
        // Larger than TOML's own whole numbers, as a text.
        let written = |value: &str| match *kind {
            "Int64" | "UInt64" => format!("\"{value}\""),
            _ => value.to_string(),
        };
        for value in [least, most] {
            let text = format!(
                "{whole}[components.body.parameters]\np{n} = {0}\n[components.body.inputs]\nu{n} = {0}\n",
                written(value)
            );
            let system = read(folder.path(), &text, &[]).unwrap();
            let expected = match *kind {
                "Int64" => Value::Signed(value.parse().unwrap()),
                "UInt64" => Value::Unsigned(value.parse().unwrap()),
                _ => Value::Number(value.parse().unwrap()),
            };
            assert_eq!(given(&system, &format!("p{n}")), Some(expected.clone()));
            assert_eq!(given(&system, &format!("u{n}")), Some(expected));
        }
        let text = format!(
            "{whole}[components.body.parameters]\np{n} = {}\n",
            written(beyond)
        );
        let refused = refusal(folder.path(), &text, &[]);
        assert!(
            refused.contains(&format!("a whole number from {least} to {most}")),
            "{refused}"
        );
    }
}

#[test]
fn names_that_mean_something_else_are_refused_for_components() {
    let folder = folder();
    for name in ["reference", "\"\"", "\"a.b\""] {
        let text = ONE.replace("body", name);
        let refused = refusal(folder.path(), &text, &[]);
        let place = format!("rig.toml: components.{}: ", name.trim_matches('"'));
        assert!(refused.starts_with(&place), "{refused}");
    }
    assert!(read(folder.path(), &ONE.replace("body", "Reference"), &[]).is_ok());
}

#[test]
fn units_with_offsets_and_factors_are_converted_on_the_way() {
    let folder = folder();
    let units = [("warm", "degC"), ("hot", "degF"), ("cold", "K")];
    let variables = |causality: &str, more: &str| -> String {
        let all = units.iter().zip(1..).map(|((name, unit), n)| {
            format!(r#"<Float64 name="{name}" valueReference="{n}" causality="{causality}" unit="{unit}" {more}/>"#)
        });
        all.collect()
    };
    let outputs = (1..4).map(|n| format!(r#"<Output valueReference="{n}" dependencies=""/>"#));
    let outputs: String = outputs.collect();
    pack(
        folder.path(),
        "Source",
        &variables("output", r#"initial="calculated""#),
        &outputs,
    );
    pack(
        folder.path(),
        "Sink",
        &variables("input", r#"start="0""#),
        "",
    );
    for (from, to, value, expected) in [
        ("warm", "hot", 25.0, 77.0),
        ("hot", "warm", 77.0, 25.0),
        ("warm", "cold", 25.0, 298.15),
        ("cold", "hot", 273.15, 32.0),
        ("hot", "hot", 77.0, 77.0),
    ] {
        let text = format!(
            "connections = [\"a.{from} -> b.{to}\"]\n[components.a]\nfmu = \"Source.fmu\"\n[components.b]\n\
             fmu = \"Sink.fmu\"\n"
        );
        let system = read(folder.path(), &text, &[]).unwrap();
        let found = system.connections[0].passage.of(value);
        assert!((found - expected).abs() < 1e-9, "{from} -> {to}: {found}");
    }
}
