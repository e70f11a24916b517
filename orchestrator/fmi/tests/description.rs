//! What is read of a description, field by field.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs::File;
use std::io::Write;
use std::sync::Arc;

use fmi_import::{Causality, FmiVersion, Fmu, Interface, Kind, Ticks, Variability};
use zip::{ZipWriter, write::SimpleFileOptions};

fn opened(description: &str) -> Result<Arc<Fmu>, String> {
    opened_with(description, &[])
}

/// As [`opened`], with further files.
fn opened_with(description: &str, more: &[(&str, &str)]) -> Result<Arc<Fmu>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Own.fmu");
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    let options = SimpleFileOptions::default();
    archive.start_file("modelDescription.xml", options).unwrap();
    archive.write_all(description.as_bytes()).unwrap();
    for (name, text) in more {
        archive.start_file(*name, options).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap();
    Fmu::open(&path).map_err(|error| error.to_string())
}

/// A description of FMI 3.0 with these interfaces, variables and structure.
fn third(interfaces: &str, variables: &str, structure: &str) -> String {
    format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="Own model" instantiationToken="t-1" description="about"
        generationTool="hand">{interfaces}<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
        </UnitDefinitions><TypeDefinitions><Float64Type name="Length" unit="mm" displayUnit="in" min="-5" max="7"/>
        <EnumerationType name="Mode"><Item name="slow" value="-1" description="as it goes"/><Item name="fast" value="4"/>
        </EnumerationType></TypeDefinitions><LogCategories><Category name="logStatusError"/><Category name="own"/>
        </LogCategories><DefaultExperiment startTime="0" stopTime="2.5" stepSize="0.125"/>
        <ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"#
    )
}

const STEPS: &str = r#"<CoSimulation modelIdentifier="Own"/>"#;

#[test]
fn abilities_are_those_of_the_interface_that_is_used() {
    let exchange = r#"<ModelExchange modelIdentifier="Other" canGetAndSetFMUState="true"
        providesAdjointDerivatives="true"/>"#;
    let steps = r#"<CoSimulation modelIdentifier="Own" hasEventMode="true" canBeInstantiatedOnlyOncePerProcess="true"
        needsExecutionTool="true" canSerializeFMUState="true" canGetAndSetFMUState="true"
        providesDirectionalDerivatives="true" canHandleVariableCommunicationStepSize="true"
        fixedInternalStepSize="0.05"/>"#;
    let fmu = opened(&third(&format!("{exchange}{steps}"), "", "")).unwrap();
    let own = &fmu.description;
    assert_eq!(own.version, FmiVersion::V3);
    assert_eq!(own.interface, Interface::CoSimulation);
    let texts = [
        &own.model_name,
        &own.model_identifier,
        &own.token,
        &own.about,
        &own.generation_tool,
    ];
    assert_eq!(texts, ["Own model", "Own", "t-1", "about", "hand"]);
    assert_eq!(own.log_categories, ["logStatusError", "own"]);
    assert_eq!(
        (own.preferred_step, own.default_stop, own.internal_step),
        (Some(0.125), Some(2.5), Some(0.05))
    );
    assert!(own.has_event_mode && own.only_one_per_process && own.needs_execution_tool);
    assert!(own.saves_state && own.writes_state && own.variable_step);
    assert!(own.directional_derivatives && !own.adjoint_derivatives);
    assert!(own.offers_model_exchange);

    let fmu = opened(&third(exchange, "", "")).unwrap();
    let own = &fmu.description;
    assert_eq!(own.interface, Interface::ModelExchange);
    assert_eq!(own.model_identifier, "Other");
    assert!(own.saves_state && !own.writes_state && own.adjoint_derivatives);
    assert!(own.variable_step && own.internal_step.is_none());
    assert!(!own.has_event_mode && !own.only_one_per_process && !own.needs_execution_tool);

    let fmu = opened(&third(STEPS, "", "")).unwrap();
    let own = &fmu.description;
    assert!(!own.variable_step && !own.offers_model_exchange && !own.saves_state);
    let scheduled = r#"<ScheduledExecution modelIdentifier="Own"/>"#;
    let fmu = opened(&third(scheduled, "", "")).unwrap();
    assert_eq!(fmu.description.interface, Interface::ScheduledExecution);
}

#[test]
fn variables_have_their_own_and_their_types_properties() {
    let variables = r#"
        <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
        <Float64 name="u" valueReference="1" causality="input" declaredType="Length" max="3" start="2"/>
        <Float64 name="y" valueReference="2" causality="output" unit="mm"/>
        <Int32 name="n" valueReference="3" causality="parameter" variability="tunable" start="5"/>
        <Enumeration name="mode" valueReference="4" declaredType="Mode" causality="parameter" variability="fixed"
            start="4"/>
        <Boolean name="on" valueReference="5" variability="discrete" initial="exact" start="true"/>
        <Float32 name="g" valueReference="6" variability="constant" start="9.5"/>"#;
    let fmu = opened(&third(
        STEPS,
        variables,
        r#"<Output valueReference="2" dependencies="1"/>"#,
    ));
    let fmu = fmu.unwrap();
    let own = |name: &str| fmu.description.variable(name).unwrap();
    assert_eq!(fmu.description.variables.len(), 7);
    let u = own("u");
    assert_eq!((u.reference, u.causality), (1, Causality::Input));
    assert_eq!(u.unit.as_deref(), Some("mm"));
    assert_eq!(u.display_unit.as_deref(), Some("in"));
    // Its own limit counts before its type's.
    assert_eq!(u.bounds, [Some(-5.0), Some(3.0)]);
    assert_eq!(u.start.as_deref(), Some("2"));
    assert_eq!(u.base_unit.unwrap().factor, 0.001);
    assert_eq!(u.variability, Variability::Continuous);
    let at = fmu.description.position("u").unwrap();
    assert_eq!(*own("y").dependencies, [at]);
    assert_eq!((&own("y").unit, own("y").bounds), (&u.unit, [None; 2]));
    assert_eq!(own("n").variability, Variability::Tunable);
    assert_eq!(own("n").kind, Kind::Int32);
    let Kind::Enumeration(items) = &own("mode").kind else {
        panic!("{:?}", own("mode"));
    };
    let items: Vec<_> = items
        .iter()
        .map(|item| (&*item.name, item.value, &*item.description))
        .collect();
    assert_eq!(items, [("slow", -1, "as it goes"), ("fast", 4, "")]);
    // What can be set before a run: inputs, and what starts with a value that is not constant.
    let settable: Vec<&str> = fmu
        .description
        .variables
        .iter()
        .filter(|variable| variable.is_settable)
        .map(|variable| &*variable.name)
        .collect();
    assert_eq!(settable, ["u", "n", "mode", "on"]);
}

#[test]
fn arrays_have_an_element_for_each_index_and_sizes_that_can_change() {
    let variables = r#"
        <UInt64 name="size" valueReference="1" causality="structuralParameter" variability="fixed" start="2"/>
        <Float64 name="a" valueReference="2" causality="input" start="1 2 3 4 5 6"><Dimension valueReference="1"/>
            <Dimension start="3"/></Float64>
        <Float64 name="b" valueReference="3" causality="output"><Dimension valueReference="1"/></Float64>
        <Float64 name="c" valueReference="4" causality="input" start="7"><Dimension start="2"/></Float64>"#;
    let structure = r#"<Output valueReference="3" dependencies="2 4"/>"#;
    let fmu = opened(&third(STEPS, variables, structure)).unwrap();
    let own = &fmu.description;
    let named: Vec<(&str, Option<&str>)> = own
        .variables
        .iter()
        .map(|variable| (&*variable.name, variable.start.as_deref()))
        .collect();
    assert_eq!(
        named,
        [
            ("size", Some("2")),
            ("a[1,1]", Some("1")),
            ("a[1,2]", Some("2")),
            ("a[1,3]", Some("3")),
            ("a[2,1]", Some("4")),
            ("a[2,2]", Some("5")),
            ("a[2,3]", Some("6")),
            ("b[1]", None),
            ("b[2]", None),
            // One start value stands for all.
            ("c[1]", Some("7")),
            ("c[2]", Some("7")),
        ]
    );
    let elements: Vec<(usize, usize)> = own.variables[1..].iter().map(|own| own.element).collect();
    let expected: Vec<(usize, usize)> = [6, 2, 2]
        .into_iter()
        .flat_map(|count| (0..count).map(move |at| (at, count)))
        .collect();
    assert_eq!(elements, expected);
    assert!(own.variables[1..].iter().all(|own| own.is_element));
    assert!(!own.variables[0].is_element && own.variables[0].is_structural);
    assert_eq!(own.array("b"), Some(7..9));
    let all: Vec<usize> = (1..7).chain(9..11).collect();
    assert_eq!(*own.variables[7].dependencies, all);
    // Three rows instead of two: the start values no longer fit.
    let other = fmu.resized(&[(0, 3)]).unwrap();
    let own = &other.description;
    assert_eq!(own.variables.len(), 1 + 9 + 3 + 2);
    assert_eq!(own.array("a"), Some(1..10));
    assert_eq!(own.variables[1].start, None);
}

#[test]
fn states_are_paired_with_their_derivatives_where_all_are_scalar() {
    let variables = |more: &str| {
        format!(
            r#"<Float64 name="x" valueReference="11" causality="output"/>
            <Float64 name="v" valueReference="12"/>
            <Float64 name="der_x" valueReference="21" derivative="11"/>
            <Float64 name="der_v" valueReference="22" derivative="12"/>{more}"#
        )
    };
    let structure = |more: &str| {
        format!(
            r#"<Output valueReference="11"/><ContinuousStateDerivative valueReference="21"/>
            <ContinuousStateDerivative valueReference="22"/>{more}<EventIndicator valueReference="12"/>"#
        )
    };
    let exchange = r#"<ModelExchange modelIdentifier="Own"/>"#;
    let fmu = opened(&third(exchange, &variables(""), &structure(""))).unwrap();
    let own = &fmu.description;
    assert_eq!(own.state_pairs, [(11, 21), (12, 22)]);
    assert_eq!((own.states, own.event_indicators), (2, 1));
    // An array counts once, and has no pair.
    let array = r#"<Float64 name="z" valueReference="13"><Dimension start="2"/></Float64>
        <Float64 name="der_z" valueReference="23" derivative="13"><Dimension start="2"/></Float64>"#;
    let more = r#"<ContinuousStateDerivative valueReference="23"/>"#;
    let fmu = opened(&third(exchange, &variables(array), &structure(more))).unwrap();
    assert_eq!(fmu.description.state_pairs, []);
    assert_eq!(fmu.description.states, 3);
}

#[test]
fn clocks_are_in_the_order_of_their_priority_with_periods_in_seconds() {
    let clock = |name: &str, reference: u32, more: &str| {
        format!(r#"<Clock name="{name}" valueReference="{reference}" causality="input" {more}/>"#)
    };
    let variables = [
        clock("last", 1, r#"intervalVariability="triggered""#),
        clock(
            "second",
            2,
            r#"intervalVariability="fixed" priority="5" intervalDecimal="0.25" shiftDecimal="0.125""#,
        ),
        clock(
            "first",
            3,
            r#"intervalVariability="constant" priority="2" resolution="1000" intervalCounter="20" shiftCounter="5""#,
        ),
        clock("third", 4, r#"intervalVariability="tunable" priority="6" intervalDecimal="0.5""#),
        clock("fourth", 5, r#"intervalVariability="changing" priority="7""#),
        clock("fifth", 6, r#"intervalVariability="countdown" priority="8""#),
        r#"<Clock name="out" valueReference="7" causality="output" intervalVariability="triggered"/>"#.to_string(),
    ];
    let steps = r#"<CoSimulation modelIdentifier="Own" hasEventMode="true"/>"#;
    let fmu = opened(&third(
        steps,
        &variables.concat(),
        r#"<Output valueReference="7"/>"#,
    ));
    let fmu = fmu.unwrap();
    let own = &fmu.description;
    let clocks: Vec<(&str, u32, Ticks, f64)> = own
        .input_clocks
        .iter()
        .map(|clock| (&*clock.name, clock.reference, clock.ticks, clock.shift))
        .collect();
    assert_eq!(
        clocks,
        [
            ("first", 3, Ticks::Periodic(Some(0.02)), 0.005),
            ("second", 2, Ticks::Periodic(Some(0.25)), 0.125),
            // What can be tuned is asked of the FMU.
            ("third", 4, Ticks::Periodic(None), 0.0),
            ("fourth", 5, Ticks::Changing, 0.0),
            ("fifth", 6, Ticks::Countdown, 0.0),
            ("last", 1, Ticks::Triggered, 0.0),
        ]
    );
    let ticks = |name: &str| own.ticks(own.position(name).unwrap());
    assert_eq!(ticks("fourth"), Some(Ticks::Changing));
    assert_eq!(ticks("out"), None);
}

#[test]
fn descriptions_that_cannot_be_used_are_refused() {
    let sized = |more: &str| {
        let array =
            r#"<Float64 name="a" valueReference="2"><Dimension valueReference="1"/></Float64>"#;
        opened(&third(STEPS, &format!("{more}{array}"), "")).err()
    };
    let size = |more: &str| {
        sized(&format!(
            r#"<UInt64 name="size" valueReference="1" causality="structuralParameter" variability="fixed" {more}/>"#
        ))
    };
    assert_eq!(size(r#"start="2""#), None);
    assert!(sized("").unwrap().contains("`a`"));
    assert!(
        sized(r#"<UInt64 name="n" valueReference="1" causality="parameter" start="2"/>"#).is_some()
    );
    let many = size(r#"start="9000000000""#).unwrap();
    assert!(many.contains("elements"), "{many}");
    assert!(opened(&third("", "", "")).is_err());
}

#[test]
fn names_of_outputs_are_known_with_their_aliases_and_only_tunable_parameters_can_be_tuned() {
    let variables = r#"
        <Float64 name="u" valueReference="1" causality="input" start="2"><Alias name="in"/></Float64>
        <Float64 name="y" valueReference="2" causality="output"><Alias name="z"/><Alias name="out"/></Float64>
        <Float64 name="a" valueReference="3" causality="output"><Dimension start="2"/><Alias name="b"/></Float64>
        <Float64 name="p" valueReference="4" causality="parameter" variability="tunable" start="1"/>
        <Float64 name="q" valueReference="5" causality="parameter" variability="fixed" start="1"/>
        <Int32 name="n" valueReference="6" causality="parameter" variability="tunable" start="1"/>
        <Float64 name="r" valueReference="7" causality="parameter" variability="tunable" start="1 2">
            <Dimension start="2"/></Float64>"#;
    let fmu = opened(&third(STEPS, variables, "")).unwrap();
    let own = &fmu.description;
    let aliases: Vec<(String, usize)> = own.output_aliases().collect();
    let named = |name: &str, at| (name.to_string(), at);
    assert_eq!(
        aliases,
        [
            named("b[1]", 2),
            named("b[2]", 3),
            named("out", 1),
            named("z", 1)
        ]
    );
    assert_eq!((own.position("in"), own.array("b")), (Some(0), Some(2..4)));
    let those = |is: fn(&fmi_import::Variable) -> bool| -> Vec<&str> {
        let all = own.variables.iter().filter(|variable| is(variable));
        all.map(|variable| &*variable.name).collect()
    };
    assert_eq!(
        those(fmi_import::Variable::is_tunable),
        ["p", "n", "r[1]", "r[2]"]
    );
    let numbers = ["u", "y", "p", "q"];
    assert_eq!(those(fmi_import::Variable::is_real_number), numbers);
}

#[test]
fn names_that_occur_twice_are_refused_with_their_places() {
    let twice = r#"<Float64 name="y" valueReference="1"/><Float64 name="z" valueReference="2"/>
        <Float64 name="y" valueReference="3"/>"#;
    let refused = opened(&third(STEPS, twice, "")).unwrap_err();
    assert!(
        refused.contains("`y` occurs twice (as number 1 and 3)"),
        "{refused}"
    );
    let alias = r#"<Float64 name="y" valueReference="1"/>
        <Float64 name="z" valueReference="2"><Alias name="y"/></Float64>"#;
    let refused = opened(&third(STEPS, alias, "")).unwrap_err();
    assert!(
        refused.contains("the alias `y` is also a variable"),
        "{refused}"
    );
    let output = r#"<Output valueReference="7"/>"#;
    let refused = opened(&third(STEPS, "", output)).unwrap_err();
    assert!(
        refused.contains("lists an output that is not among the variables"),
        "{refused}"
    );
}

#[test]
fn limits_of_short_numbers_are_read_as_those_of_long_ones() {
    let variables = r#"
        <Float32 name="a" valueReference="1" causality="input" start="0" min="-0.5" max="0.25"/>
        <Float32 name="b" valueReference="2" causality="input" start="0" declaredType="Short" max="1"/>
        <Int32 name="n" valueReference="3" causality="input" start="0" min="1" max="2"/>"#;
    let text = third(STEPS, variables, "").replace(
        "<TypeDefinitions>",
        r#"<TypeDefinitions><Float32Type name="Short" unit="mm" min="-2" max="3"/>"#,
    );
    let fmu = opened(&text).unwrap();
    let bounds = |name: &str| fmu.description.variable(name).unwrap().bounds;
    assert_eq!(bounds("a"), [Some(-0.5), Some(0.25)]);
    assert_eq!(bounds("b"), [Some(-2.0), Some(1.0)]);
    assert_eq!(bounds("n"), [None; 2]);
    let unit = fmu.description.variable("b").unwrap().unit.as_deref();
    assert_eq!(unit, Some("mm"));
}

#[test]
fn terminals_are_found_by_name_and_broken_ones_are_a_remark() {
    let path = "terminalsAndIcons/terminalsAndIcons.xml";
    let terminals = r#"<fmiTerminalsAndIcons><Terminals><Terminal name="a" matchingRule="bus"/>
        <Terminal name="b" matchingRule="plug"/></Terminals></fmiTerminalsAndIcons>"#;
    let fmu = opened_with(&third(STEPS, "", ""), &[(path, terminals)]).unwrap();
    let rule = |name: &str| fmu.description.terminal(name).map(|own| own.rule.clone());
    assert_eq!(rule("b"), Some(fmi_import::MatchingRule::Plug));
    assert_eq!(
        (rule("a"), rule("c")),
        (Some(fmi_import::MatchingRule::Bus), None)
    );
    let fmu = opened_with(&third(STEPS, "", ""), &[(path, "<")]).unwrap();
    let remark = "terminalsAndIcons.xml cannot be read";
    assert!(fmu.description.terminals.is_empty());
    assert!(
        fmu.description
            .remarks
            .iter()
            .any(|own| own.starts_with(remark))
    );
}

#[test]
fn versions_and_names_of_libraries_that_cannot_be_are_refused() {
    let named = |name: &str| {
        let steps = format!(r#"<CoSimulation modelIdentifier="{name}"/>"#);
        opened(&third(&steps, "", "")).err()
    };
    for name in ["Own", "_own", "o", "Own_2"] {
        assert_eq!(named(name), None);
    }
    for name in ["", "2Own", "Own-2", "../Own", "\u{e9}"] {
        let refused = named(name).unwrap();
        assert!(refused.contains("is not a C identifier"), "{refused}");
    }
    let of = |version: &str| {
        let text = third(STEPS, "", "");
        opened(&text.replace(r#"fmiVersion="3.0""#, version)).err()
    };
    assert_eq!(of(r#"fmiVersion="3.0.1""#), None);
    let refused = of(r#"fmiVersion="4.0""#).unwrap();
    assert!(refused.contains(r#"fmiVersion is "4.0""#), "{refused}");
}

#[test]
fn a_run_is_as_long_as_from_its_start_to_its_stop() {
    let of = |experiment: &str| {
        let text = third(STEPS, "", "");
        let known = r#"<DefaultExperiment startTime="0" stopTime="2.5" stepSize="0.125"/>"#;
        let fmu = opened(&text.replace(known, experiment)).unwrap();
        (fmu.description.default_stop, fmu.description.preferred_step)
    };
    assert_eq!(of(""), (None, None));
    assert_eq!(
        of(r#"<DefaultExperiment startTime="1" stopTime="3"/>"#),
        (Some(2.0), None)
    );
    assert_eq!(
        of(r#"<DefaultExperiment stopTime="3" stepSize="0"/>"#),
        (Some(3.0), None)
    );
    assert_eq!(
        of(r#"<DefaultExperiment startTime="3" stopTime="3"/>"#),
        (None, None)
    );
}

#[test]
fn locals_become_outputs_with_their_whole_arrays() {
    let variables = r#"<Float64 name="u" valueReference="1" causality="input" start="0"/>
        <Float64 name="l" valueReference="2"/>
        <Float64 name="a" valueReference="3"><Dimension start="3"/></Float64>
        <Float64 name="m" valueReference="4"/>"#;
    let fmu = opened(&third(STEPS, variables, "")).unwrap();
    let outputs = |locals: &[usize]| -> Vec<usize> {
        let own = fmu.with_outputs(locals);
        let all: Vec<usize> = own.description.of(Causality::Output).collect();
        let depends = all
            .iter()
            .all(|&at| *own.description.variables[at].dependencies == [0]);
        assert!(depends);
        all
    };
    // The second of three elements stands for all.
    assert_eq!(outputs(&[3]), [2, 3, 4]);
    assert_eq!(outputs(&[1, 5]), [1, 5]);
}

#[cfg(feature = "fmi-rs")]
#[test]
fn what_fmi_rs_finds_or_refuses_is_a_remark() {
    let remarks = |variables: &str| {
        let fmu = opened(&third(STEPS, variables, "")).unwrap();
        fmu.description.remarks.clone()
    };
    assert_eq!(
        remarks(r#"<Float64 name="x" valueReference="1"/>"#),
        [""; 0]
    );
    let found = remarks(r#"<Float64 name="y" valueReference="1" causality="output"/>"#);
    assert!(
        found[0].contains("outputs do not match the expected set"),
        "{found:?}"
    );
    let refused = remarks(r#"<Float64 name="x" valueReference="1" nominal="one"/>"#);
    assert!(
        refused[0].starts_with("fmi-rs cannot read it"),
        "{refused:?}"
    );
}
