//! The reader, on texts of a few lines.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use super::*;

const V2: FmiVersion = FmiVersion::V2;
const V3: FmiVersion = FmiVersion::V3;
const STEPS: &str = r#"<CoSimulation modelIdentifier="m"/>"#;

/// A description: the root on line 1, `head` (interfaces, units, types) from line 2, the variables and
/// the structure each from a line of its own.
fn text(version: FmiVersion, head: &str, variables: &str, structure: &str) -> String {
    let token = match version {
        V2 => "guid",
        V3 => "instantiationToken",
    };
    format!(
        "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"m\" {token}=\"t\">\n{head}\n\
         <ModelVariables>{variables}</ModelVariables>\n<ModelStructure>{structure}</ModelStructure>\n\
         </fmiModelDescription>"
    )
}

fn read_for(
    version: FmiVersion,
    text: &str,
    exchange: bool,
) -> Result<Description, DescriptionError> {
    let document = roxmltree::Document::parse(text).unwrap();
    reader::read(document.root_element(), version, &HashMap::new(), exchange)
}

fn read(version: FmiVersion, text: &str) -> Result<Description, DescriptionError> {
    read_for(version, text, false)
}

/// The description with these variables.
fn of(version: FmiVersion, variables: &str) -> Result<Description, DescriptionError> {
    read(version, &text(version, STEPS, variables, ""))
}

#[test]
fn every_declared_type_and_unit_of_fmi_2_is_read() {
    let head = r#"<CoSimulation modelIdentifier="m"/>
        <UnitDefinitions>
          <Unit name="m"><BaseUnit m="1"/></Unit>
          <Unit name="km"><BaseUnit m="1" factor="1000"/></Unit>
          <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
        </UnitDefinitions>
        <TypeDefinitions>
          <SimpleType name="Length"><Real unit="m" displayUnit="mm" relativeQuantity="true" min="-1"/></SimpleType>
          <SimpleType name="Gear"><Enumeration>
            <Item name="low" value="1" description="slow"/><Item name="high" value=" 2 "/>
          </Enumeration></SimpleType>
          <SimpleType name="Stroke"><Real unit="km"/></SimpleType>
        </TypeDefinitions>"#;
    let variables = r#"
        <ScalarVariable name="gear" valueReference="0"><Enumeration declaredType="Gear" start="1"/></ScalarVariable>
        <ScalarVariable name="stroke" valueReference="1"><Real declaredType="Stroke" min="2" max="3"/></ScalarVariable>
        <ScalarVariable name="length" valueReference="2"><Real declaredType="Length" max="5"/></ScalarVariable>
        <ScalarVariable name="oil" valueReference="3"><Real unit="degC"/></ScalarVariable>
        <ScalarVariable name="rise" valueReference="4"><Real unit="degC" relativeQuantity="1"/></ScalarVariable>"#;
    let description = read(V2, &text(V2, head, variables, "")).unwrap();
    assert_eq!(description.remarks, [""; 0]);
    let [gear, stroke, length, oil, rise] = &description.variables[..] else {
        panic!("{:?}", description.variables);
    };
    let Kind::Enumeration(items) = &gear.kind else {
        panic!("{:?}", gear.kind);
    };
    let items: Vec<(&str, i64, &str)> = items
        .iter()
        .map(|item| (&*item.name, item.value, &*item.description))
        .collect();
    assert_eq!(items, [("low", 1, "slow"), ("high", 2, "")]);
    assert_eq!(stroke.unit.as_deref(), Some("km"));
    assert_eq!(stroke.bounds, [Some(2.0), Some(3.0)]);
    assert_eq!(length.unit.as_deref(), Some("m"));
    assert_eq!(length.display_unit.as_deref(), Some("mm"));
    assert_eq!(length.bounds, [Some(-1.0), Some(5.0)]);
    let base = |variable: &Variable| {
        let unit = variable.base_unit.unwrap();
        let [_, metre, _, _, kelvin, ..] = unit.exponents;
        (metre, kelvin, unit.factor, unit.offset)
    };
    assert_eq!(base(stroke), (1, 0, 1000.0, 0.0));
    assert_eq!(base(oil), (0, 1, 1.0, 273.15));
    assert_eq!(base(rise), (0, 1, 1.0, 0.0));
}

#[test]
fn what_cannot_be_used_is_refused_with_its_line() {
    let number = "a whole number from 0 to 4294967295";
    let causalities = "parameter, calculatedParameter, input, output, local, independent";
    for (variable, expected) in [
        (
            r#"<Float64 name="x" valueReference="-1"/>"#,
            format!(r#"<Float64 name="x">: valueReference="-1" is not {number}"#),
        ),
        (
            r#"<Float64 name="x" valueReference="4294967296"/>"#,
            format!(r#"<Float64 name="x">: valueReference="4294967296" is not {number}"#),
        ),
        (
            r#"<Float64 name="x"/>"#,
            format!(r#"<Float64 name="x">: the attribute valueReference is missing; expected {number}"#),
        ),
        (
            r#"<Int8 valueReference="1"/>"#,
            "<Int8>: the attribute name is missing; expected a text".to_string(),
        ),
        (
            r#"<Real name="x" valueReference="1"/>"#,
            r#"<Real name="x">: no known type; expected a type such as <Float64>"#.to_string(),
        ),
        (
            r#"<Int8 name="x" valueReference="1" causality="in"/>"#,
            format!(r#"<Int8 name="x">: causality="in" is not one of structuralParameter, {causalities}"#),
        ),
        (
            r#"<Int8 name="x" valueReference="1" variability="never"/>"#,
            r#"<Int8 name="x">: variability="never" is not one of constant, fixed, tunable, discrete, continuous"#
                .to_string(),
        ),
        (
            r#"<Int8 name="x" valueReference="1" initial="zero"/>"#,
            r#"<Int8 name="x">: initial="zero" is not one of exact, approx, calculated"#.to_string(),
        ),
        (
            r#"<Int8 name="x" valueReference="1" causality="input" variability="fixed"/>"#,
            r#"<Int8 name="x">: causality input with variability fixed is not possible"#.to_string(),
        ),
        (
            r#"<Enumeration name="x" valueReference="1"/>"#,
            r#"<Enumeration name="x">: the attribute declaredType is missing; expected a text"#.to_string(),
        ),
        (
            r#"<Float64 name="x" valueReference="1" derivative="y"/>"#,
            format!(r#"<Float64 name="x">: derivative="y" is not {number}"#),
        ),
        (
            r#"<Float64 name="x" valueReference="1" clocks="1 y"/>"#,
            r#"<Float64 name="x">: clocks="1 y" is not a list of whole numbers from 0 to 4294967295"#.to_string(),
        ),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension/></Float64>"#,
            format!(
                r#"<Dimension> of <Float64 name="x">: the attribute valueReference is missing; expected {number}"#
            ),
        ),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension start="-2"/></Float64>"#,
            r#"<Dimension> of <Float64 name="x">: start="-2" is not a whole number from 0 to 18446744073709551615"#
                .to_string(),
        ),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension valueReference="1"/></Float64>"#,
            r#"<Dimension> of <Float64 name="x">: the size of `x` is not a structural parameter"#.to_string(),
        ),
        (
            r#"<String name="x" valueReference="1"><Start/></String>"#,
            r#"<Start> of <String name="x">: the attribute value is missing; expected a text"#.to_string(),
        ),
        (
            r#"<Clock name="x" valueReference="1"/>"#,
            r#"<Clock name="x">: the attribute intervalVariability is missing; expected one of constant, fixed, tunable, changing, countdown, triggered"#
                .to_string(),
        ),
    ] {
        let refused = of(V3, &format!("\n\n{variable}")).unwrap_err().to_string();
        assert_eq!(refused, format!("line 5: {expected}"));
    }
    let sized = |start: &str| {
        of(
            V3,
            &format!(
                r#"<UInt64 name="n" valueReference="1" causality="structuralParameter" {start}/>
            <Float64 name="x" valueReference="2"><Dimension valueReference="1"/></Float64>"#
            ),
        )
    };
    for start in ["", r#"start="""#, r#"start="many""#] {
        let refused = sized(start).unwrap_err().to_string();
        let reason = "the size of `x` is a parameter whose start value is not a whole number";
        assert_eq!(
            refused,
            format!(r#"line 4: <Dimension> of <Float64 name="x">: {reason}"#)
        );
    }
    assert_eq!(sized(r#"start=" 3 ""#).unwrap().variables.len(), 4);
    for (variable, expected) in [
        (
            r#"<ScalarVariable name="x" valueReference="1"/>"#,
            "no known type; expected in it <Real>, <Integer>, <Boolean>, <String> or <Enumeration>"
                .to_string(),
        ),
        (
            r#"<ScalarVariable name="x" valueReference="1"><Float64/></ScalarVariable>"#,
            "no known type; expected in it <Real>, <Integer>, <Boolean>, <String> or <Enumeration>"
                .to_string(),
        ),
        (
            r#"<ScalarVariable name="x" valueReference="1" causality="structuralParameter"><Real/></ScalarVariable>"#,
            format!(r#"causality="structuralParameter" is not one of {causalities}"#),
        ),
        (
            r#"<ScalarVariable name="x" valueReference="1" causality="parameter"><Real/></ScalarVariable>"#,
            "causality parameter with variability continuous is not possible".to_string(),
        ),
    ] {
        let refused = of(V2, &format!("\n{variable}")).unwrap_err().to_string();
        assert_eq!(
            refused,
            format!(r#"line 4: <ScalarVariable name="x">: {expected}"#)
        );
    }
    let real =
        r#"<ScalarVariable name="x" valueReference="1"><Real derivative="-"/></ScalarVariable>"#;
    assert_eq!(
        of(V2, real).unwrap_err().to_string(),
        format!(r#"line 3: <Real> of <ScalarVariable name="x">: derivative="-" is not {number}"#)
    );
}

#[test]
fn a_description_needs_its_lists_its_names_and_an_interface() {
    let whole = |version| text(version, STEPS, "", "");
    for version in [V2, V3] {
        assert!(read(version, &whole(version)).is_ok());
        let without = |part: &str| {
            let whole = whole(version);
            assert!(whole.contains(part));
            read(version, &whole.replace(part, ""))
                .unwrap_err()
                .to_string()
        };
        let root = "line 1: <fmiModelDescription>: ";
        let list = "<ModelVariables></ModelVariables>";
        assert_eq!(without(list), format!("{root}<ModelVariables> is missing"));
        assert!(without(r#"modelName="m""#).contains("attribute modelName is missing"));
        let identifier = without(r#"modelIdentifier="m""#);
        assert!(identifier.starts_with("line 2: <CoSimulation>: the attribute modelIdentifier"));
        let token = match version {
            V2 => "guid",
            V3 => "instantiationToken",
        };
        assert!(without(&format!(r#"{token}="t""#)).contains(token));
    }
    let structure = "<ModelStructure></ModelStructure>";
    assert!(read(V2, &whole(V2).replace(structure, "")).is_ok());
    assert!(read(V3, &whole(V3).replace(structure, "")).is_err());
    let scheduled = r#"<ScheduledExecution modelIdentifier="m"/>"#;
    let refused = read(V2, &text(V2, scheduled, "", ""))
        .unwrap_err()
        .to_string();
    assert_eq!(refused, "neither <CoSimulation> nor <ModelExchange>");
    let refused = read(V3, &text(V3, "", "", "")).unwrap_err().to_string();
    assert!(refused.starts_with("none of <CoSimulation>"), "{refused}");
    let refused = read(
        V2,
        &text(
            V2,
            r#"<CoSimulation modelIdentifier="m" needsExecutionTool="yes"/>"#,
            "",
            "",
        ),
    );
    assert_eq!(
        refused.unwrap_err().to_string(),
        r#"line 2: <CoSimulation>: needsExecutionTool="yes" is not true or false"#
    );
}

#[test]
fn model_exchange_goes_first_where_it_is_asked_for() {
    let steps = r#"<CoSimulation modelIdentifier="c" canHandleVariableCommunicationStepSize="0"/>"#;
    let exchange = r#"<ModelExchange modelIdentifier="e" canGetAndSetFMUstate="1" canSerializeFMUstate="1"
        providesDirectionalDerivative="1" hasEventMode="1" providesAdjointDerivatives="1"
        canBeInstantiatedOnlyOncePerProcess="1" needsExecutionTool="1"/>"#;
    let both = text(V2, &format!("{steps}{exchange}"), "", "");
    let own = read_for(V2, &both, false).unwrap();
    assert_eq!(
        (own.interface, &*own.model_identifier),
        (Interface::CoSimulation, "c")
    );
    assert!(own.offers_model_exchange && !own.variable_step && !own.saves_state);
    let own = read_for(V2, &both, true).unwrap();
    assert_eq!(
        (own.interface, &*own.model_identifier),
        (Interface::ModelExchange, "e")
    );
    assert!(own.saves_state && own.writes_state && own.directional_derivatives);
    assert!(own.only_one_per_process && own.needs_execution_tool && own.variable_step);
    // Attributes of FMI 3.0.
    assert!(!own.has_event_mode && !own.adjoint_derivatives);
    let own = read_for(V2, &text(V2, steps, "", ""), true).unwrap();
    assert_eq!(own.interface, Interface::CoSimulation);
    assert!(!own.offers_model_exchange);
}

/// FMI 2.0, section 2.2.7; FMI 3.0, section 2.4.7.
#[test]
fn what_is_not_written_follows_from_type_and_causality() {
    use Variability::{Continuous, Discrete, Fixed};
    for (version, written, variability, is_settable) in [
        (V3, r#"Float64 causality="input""#, Continuous, true),
        (V3, r#"Float32 causality="input""#, Continuous, true),
        (V3, r#"Int8 causality="input""#, Discrete, true),
        (V3, r#"Float64 causality="parameter""#, Fixed, true),
        (V3, r#"UInt64 causality="structuralParameter""#, Fixed, true),
        (
            V3,
            r#"Float64 causality="calculatedParameter""#,
            Fixed,
            false,
        ),
        (V3, "Float64", Continuous, false),
        (V3, "Boolean", Discrete, false),
        (V3, r#"Int8 causality="output" start="1""#, Discrete, false),
        (
            V3,
            r#"Int8 causality="output" initial="exact""#,
            Discrete,
            true,
        ),
        (V3, r#"Int8 initial="approx""#, Discrete, true),
        (V3, r#"Float64 initial="calculated""#, Continuous, false),
        (
            V3,
            r#"Float64 causality="output" variability="constant""#,
            Fixed,
            false,
        ),
        (V3, r#"Float64 variability="fixed""#, Fixed, false),
        (
            V3,
            r#"Float64 causality="independent" start="0""#,
            Continuous,
            false,
        ),
        (
            V3,
            r#"Float64 causality="independent" initial="exact""#,
            Continuous,
            false,
        ),
        (
            V3,
            r#"Float64 causality="input" initial="calculated""#,
            Continuous,
            true,
        ),
        (V2, r#"Integer causality="input""#, Continuous, true),
        (
            V2,
            r#"Real causality="parameter" variability="fixed""#,
            Fixed,
            true,
        ),
        (
            V2,
            r#"Real variability="fixed" initial="approx""#,
            Fixed,
            true,
        ),
        (
            V2,
            r#"Boolean causality="output" variability="discrete""#,
            Discrete,
            false,
        ),
    ] {
        let (kind, attributes) = written.split_once(' ').unwrap_or((written, ""));
        let variable = match version {
            V2 => format!(
                r#"<ScalarVariable name="x" valueReference="1" {attributes}><{kind}/></ScalarVariable>"#
            ),
            V3 => format!(r#"<{kind} name="x" valueReference="1" {attributes}/>"#),
        };
        let own = of(version, &variable).unwrap_or_else(|refused| panic!("{refused}"));
        let own = &own.variables[0];
        assert_eq!(
            (own.variability, own.is_settable),
            (variability, is_settable),
            "{written}"
        );
    }
}

#[test]
fn fmi_2_counts_variables_from_1() {
    let variables = r#"
        <ScalarVariable name="u" valueReference="10" causality="input"><Real start=" 2 "/></ScalarVariable>
        <ScalarVariable name="x" valueReference="11" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="rate" valueReference="12"><Real derivative="2"/></ScalarVariable>
        <ScalarVariable name="y" valueReference="13" causality="output"><Integer/></ScalarVariable>
        <ScalarVariable name="v" valueReference="14" causality="input"><Boolean start="true"/></ScalarVariable>"#;
    let read = |structure: &str| {
        let text = text(V2, STEPS, variables, structure);
        let text = text.replace("modelName", r#"numberOfEventIndicators="3" modelName"#);
        read(V2, &text)
    };
    let own = read(
        r#"<Outputs><Unknown index="2" dependencies=""/><Unknown index="4" dependencies="5 1 1 3 9 0"/></Outputs>
        <Derivatives><Unknown index="3"/></Derivatives><InitialUnknowns><Unknown index="none"/></InitialUnknowns>"#,
    );
    let own = own.unwrap();
    assert!(own.variables[1].dependencies.is_empty());
    assert_eq!(*own.variables[3].dependencies, [0, 4]);
    assert_eq!((own.states, own.event_indicators), (1, 3));
    assert_eq!(own.state_pairs, [(11, 12)]);
    assert_eq!(own.variables[0].start.as_deref(), Some(" 2 "));
    // Without a list it depends on all inputs.
    let own = read(r#"<Outputs><Unknown index="4"/></Outputs>"#).unwrap();
    assert_eq!(*own.variables[3].dependencies, [0, 4]);
    // A derivative of nothing leaves all of them without pairs.
    let own =
        read(r#"<Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>"#).unwrap();
    assert_eq!((own.states, own.state_pairs), (2, vec![]));
    for index in ["0", "6"] {
        let refused = read(&format!(r#"<Outputs><Unknown index="{index}"/></Outputs>"#));
        let reason = "<ModelStructure> lists an output that is not among the variables";
        assert_eq!(
            refused.unwrap_err().to_string(),
            format!("line 9: <Unknown>: {reason}")
        );
    }
    let refused = read(r#"<Outputs><Unknown index="2" dependencies="1,2"/></Outputs>"#);
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains(r#"dependencies="1,2" is not a list"#)
    );
}

#[test]
fn derivatives_of_fmi_3_are_named_by_value_reference() {
    let read = |kind: &str| {
        let variables = format!(
            r#"<Float64 name="x" valueReference="7"/><{kind} name="rate" valueReference="5" derivative="7"/>"#
        );
        let structure = r#"<ContinuousStateDerivative valueReference="5"/>"#;
        read(V3, &text(V3, STEPS, &variables, structure))
            .unwrap()
            .state_pairs
    };
    assert_eq!(read("Float64"), [(7, 5)]);
    assert_eq!(read("Float32"), []);
}

#[test]
fn every_type_of_fmi_3_is_read_by_its_name() {
    let all = [
        Kind::Float64,
        Kind::Float32,
        Kind::Int8,
        Kind::UInt8,
        Kind::Int16,
        Kind::UInt16,
        Kind::Int32,
        Kind::UInt32,
        Kind::Int64,
        Kind::UInt64,
        Kind::Boolean,
        Kind::String,
        Kind::Binary,
        Kind::Clock,
        Kind::Enumeration(Vec::new()),
    ];
    for kind in all {
        let name = kind.name();
        let more = r#"declaredType="none" intervalVariability="triggered""#;
        let own = of(
            V3,
            &format!(r#"<{name} name="x" valueReference="1" {more}/>"#),
        );
        assert_eq!(own.unwrap().variables[0].kind, kind);
    }
}

#[test]
fn a_type_gives_its_quantity_to_floating_point_variables_alone() {
    let head = r#"<ModelExchange modelIdentifier="m" fixedInternalStepSize="1"/>
        <UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
        <TypeDefinitions><Float64Type name="Rise" unit="degC" relativeQuantity="true" max="9"/></TypeDefinitions>"#;
    let variables = r#"<Float64 name="x" valueReference="1" declaredType="Rise"/>
        <Int32 name="n" valueReference="2" declaredType="Rise" min="1"/>"#;
    let own = read(V3, &text(V3, head, variables, "")).unwrap();
    let [x, n] = &own.variables[..] else {
        panic!("{:?}", own.variables);
    };
    assert_eq!(
        (x.unit.as_deref(), x.bounds),
        (Some("degC"), [None, Some(9.0)])
    );
    assert_eq!(x.base_unit.unwrap().offset, 0.0);
    assert_eq!((&n.unit, n.bounds), (&None, [None; 2]));
    // It steps nothing.
    assert_eq!(own.internal_step, None);
}

#[test]
fn what_can_be_done_without_is_a_remark() {
    let head = r#"<CoSimulation modelIdentifier="m" fixedInternalStepSize="short"/>
        <UnitDefinitions><Unit name="u"><BaseUnit m="1.5"/></Unit><Unit name="v"><BaseUnit m=" 1 "/></Unit></UnitDefinitions>
        <TypeDefinitions><EnumerationType name="E"><Item name="a" value="x"/><Item name="b" value="2"/></EnumerationType>
        <ClockType name="C"/></TypeDefinitions><DefaultExperiment startTime=" 1 " stopTime=" 3 " stepSize="fast"/>"#;
    let variables = r#"<Float64 name="x" valueReference=" 1 " min="low" max=" 4 " unit="u" relativeQuantity="no"/>
        <Float64 name="y" valueReference="2" unit="v"/><Enumeration name="e" valueReference="3" declaredType="E"/>
        <Float32 name="z" valueReference="4" min="0.1" max="1e60"/>"#;
    let own = read(V3, &text(V3, head, variables, "")).unwrap();
    assert_eq!(
        own.remarks,
        [
            r#"line 4: <Item name="a">: value="x" is not a whole number"#,
            r#"line 3: <BaseUnit> of <Unit name="u">: m="1.5" is not a whole number"#,
            r#"line 6: <Float64 name="x">: min="low" is not a number"#,
            r#"line 6: <Float64 name="x">: relativeQuantity="no" is not true or false"#,
            r#"line 2: <CoSimulation>: fixedInternalStepSize="short" is not a number"#,
            r#"line 5: <DefaultExperiment>: stepSize="fast" is not a number"#,
        ]
    );
    let [x, y, e, z] = &own.variables[..] else {
        panic!("{:?}", own.variables);
    };
    assert_eq!((x.reference, x.bounds), (1, [None, Some(4.0)]));
    assert!(x.base_unit.is_none() && y.base_unit.is_some());
    let Kind::Enumeration(items) = &e.kind else {
        panic!("{:?}", e.kind);
    };
    assert_eq!(items.len(), 1);
    assert_eq!(z.bounds, [Some(f64::from(0.1_f32)), Some(f64::INFINITY)]);
    assert_eq!(own.default_stop, Some(2.0));
    assert_eq!((own.preferred_step, own.internal_step), (None, None));
    // As many as are worth a look.
    let many = r#"<Float64 name="x" valueReference="1" min="low"/>"#.repeat(200);
    assert_eq!(of(V3, &many).unwrap().remarks.len(), 100);
    // Neither is a long value shown as a whole.
    let long = format!(
        r#"<Float64 name="x" valueReference="1" min="{}"/>"#,
        "9,".repeat(500)
    );
    let shown = format!(r#"min="{}..." is not a number"#, "9,".repeat(30));
    assert!(of(V3, &long).unwrap().remarks[0].ends_with(&shown));
}

#[test]
fn starts_are_lists_of_values_or_elements() {
    let starts = |variable: &str| {
        let own = of(V3, variable).unwrap();
        own.variables
            .into_iter()
            .map(|own| own.start)
            .collect::<Vec<_>>()
    };
    let some = |text: &str| Some(text.to_string());
    let texts = r#"<Start value="a b"/><Start value=""/>"#;
    assert_eq!(
        starts(&format!(
            r#"<String name="s" valueReference="1"><Dimension start="2"/>{texts}</String>"#
        )),
        [some("a b"), some("")]
    );
    // Too many for one.
    assert_eq!(
        starts(&format!(
            r#"<Binary name="b" valueReference="1">{texts}</Binary>"#
        )),
        [None]
    );
    assert_eq!(
        starts(r#"<Int8 name="i" valueReference="1" start="1 2"/>"#),
        [None]
    );
    assert_eq!(
        starts(r#"<Int8 name="i" valueReference="1" start=" 1 "/>"#),
        [some("1")]
    );
    assert_eq!(
        starts(r#"<Int8 name="i" valueReference="1" start=""/>"#),
        [None]
    );
    let array = r#"<Int8 name="i" valueReference="1" start="1 2"><Dimension start="3"/></Int8>"#;
    assert_eq!(starts(array), [None, None, None]);
    let empty = r#"<Int8 name="i" valueReference="1" start="1 2"><Dimension start="0"/></Int8>"#;
    assert_eq!(starts(empty), []);
    let clock = r#"<Clock name="c" valueReference="1" intervalVariability="triggered" start="1"/>"#;
    assert_eq!(starts(clock), [None]);
}

#[test]
fn arrays_that_nobody_could_hold_are_refused() {
    let sized = |sizes: &[u64]| {
        let sizes = sizes
            .iter()
            .map(|size| format!(r#"<Dimension start="{size}"/>"#));
        let array = sizes.collect::<String>();
        of(
            V3,
            &format!(
                r#"<Int8 name="i" valueReference="1"/><Int8 name="a" valueReference="2">{array}</Int8>"#
            ),
        )
    };
    for sizes in [
        &[u64::MAX][..],
        &[u64::MAX, 2],
        &[1 << 32, 1 << 32],
        &[4_000_000],
    ] {
        let refused = sized(sizes).unwrap_err().to_string();
        assert_eq!(
            refused,
            "the arrays have more than 4000000 elements together"
        );
    }
    assert_eq!(sized(&[2, 3]).unwrap().variables.len(), 7);
}

#[test]
fn clocks_without_a_priority_come_last_and_in_their_order() {
    let clock = |name: &str, more: &str| {
        format!(
            r#"<Clock name="{name}" valueReference="1" causality="input" intervalVariability="fixed" {more}/>"#
        )
    };
    let variables = [
        clock(
            "c",
            r#"intervalCounter="3" resolution="4" shiftCounter="1" shiftDecimal="9""#,
        ),
        clock("b", r#"shiftCounter="0" shiftDecimal="0.5" resolution="4""#),
        clock(
            "a",
            r#"priority="0" intervalDecimal="2" intervalCounter="3" resolution="4""#,
        ),
        clock(
            "d",
            r#"intervalCounter="3" shiftCounter="1" shiftDecimal="0.25""#,
        ),
    ];
    let own = of(V3, &variables.concat()).unwrap();
    let clocks = own.input_clocks.iter();
    let clocks: Vec<_> = clocks
        .map(|own| (&*own.name, own.ticks, own.shift))
        .collect();
    assert_eq!(
        clocks,
        [
            ("a", Ticks::Periodic(Some(2.0)), 0.0),
            ("c", Ticks::Periodic(Some(0.75)), 0.25),
            ("b", Ticks::Periodic(None), 0.5),
            ("d", Ticks::Periodic(None), 0.25),
        ]
    );
    let refused = of(V3, &clock("c", r#"priority="-1""#))
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains(r#"priority="-1" is not a whole number"#),
        "{refused}"
    );
}

#[test]
fn folders_of_binaries_are_those_of_the_standard() {
    if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        assert_eq!(V2.platform(), "linux64");
        assert_eq!(V3.platform(), "x86_64-linux");
    }
    assert_eq!(V2.binaries(), format!("binaries/{}", V2.platform()));
}
