//! Values of parameter sets, and what the archive holds of choices and arrays.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use fmi_import::FmiVersion;
use fmi_ssp::export::{Experiment, Player, Start, Supply, contents};
use fmi_system::{Files, Setting, SystemFile, assemble};
use zip::{ZipWriter, write::SimpleFileOptions};

/// The value of a parameter set with this one parameter, or why it is refused.
fn value(folder: &Path, parameter: &str) -> Result<Setting, String> {
    let path = folder.join("SystemStructure.ssd");
    let text = format!(
        r#"<ssd:SystemStructureDescription version="2.0" name="one"
        xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
        xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
        xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"><ssd:System name="root"><ssd:Elements>
        <ssd:Component name="a" source="a.fmu"><ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
        <ssv:ParameterSet version="2.0" name="set"><ssv:Parameters><ssv:Parameter name="p">{parameter}</ssv:Parameter>
        </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
        </ssd:Component></ssd:Elements></ssd:System></ssd:SystemStructureDescription>"#
    );
    std::fs::write(&path, text).unwrap();
    let read = fmi_ssp::read(&path.to_string_lossy()).map_err(|error| error.to_string())?;
    Ok(plain(&read.components["a"].parameters["p"]))
}

/// Without units and what is done on the way.
fn plain(setting: &Setting) -> Setting {
    match setting {
        Setting::Declared(declared) => plain(&declared.value),
        Setting::List(all) => Setting::List(all.iter().map(plain).collect()),
        other => other.clone(),
    }
}

#[test]
fn values_are_of_the_types_of_the_standard() {
    let folder = tempfile::tempdir().unwrap();
    let text = |text: &str| Setting::Text(text.to_string());
    let two = r#"<ssc:Dimension size="2"/>"#;
    for (parameter, expected) in [
        (r#"<ssv:Real value="-2.5e-3"/>"#, Setting::Number(-0.0025)),
        (r#"<ssv:Float32 value="4"/>"#, Setting::Number(4.0)),
        (r#"<ssv:Integer value="-7"/>"#, Setting::Integer(-7)),
        (
            r#"<ssv:UInt64 value="18446744073709551615"/>"#,
            text("18446744073709551615"),
        ),
        (r#"<ssv:Boolean value="true"/>"#, Setting::Boolean(true)),
        (r#"<ssv:Boolean value="0"/>"#, Setting::Boolean(false)),
        (r#"<ssv:String value="two words"/>"#, text("two words")),
        (r#"<ssv:Enumeration value="Fast"/>"#, text("Fast")),
        (
            &format!(r#"{two}<ssv:Real value="1 2"/>"#),
            Setting::List(vec![Setting::Number(1.0), Setting::Number(2.0)]),
        ),
        // Texts of an array are elements of their own.
        (
            &format!(
                r#"<ssv:String><ssv:Value value="a b"/><ssv:Value value="c"/></ssv:String>{two}"#
            ),
            Setting::List(vec![text("a b"), text("c")]),
        ),
        // One element is an array too, where a dimension says so.
        (
            r#"<ssv:Integer value="5"/><ssc:Dimension size="1"/>"#,
            Setting::List(vec![Setting::Integer(5)]),
        ),
    ] {
        assert_eq!(value(folder.path(), parameter), Ok(expected), "{parameter}");
    }
}

#[test]
fn values_that_cannot_be_read_are_named_with_their_parameter() {
    let folder = tempfile::tempdir().unwrap();
    for (parameter, expected) in [
        (
            r#"<ssv:Real value="NaN"/>"#,
            "`p`: `NaN` is no finite number",
        ),
        (
            r#"<ssv:Integer value="1.5"/>"#,
            "`p`: `1.5` is no whole number",
        ),
        (
            r#"<ssv:Integer value="18446744073709551616"/>"#,
            "`p`: `18446744073709551616` is no whole number",
        ),
        (
            r#"<ssv:Boolean value="yes"/>"#,
            "`p`: `yes` is neither true nor false",
        ),
        (
            r#"<ssv:Complex value="1"/>"#,
            "`p` has the unknown type <Complex>",
        ),
        (r#"<ssv:Real value=""/>"#, "the parameter `p` has no value"),
        ("", "the parameter `p` has no value"),
        (
            r#"<ssc:Dimension size="1"/>"#,
            "the parameter `p` has no value",
        ),
    ] {
        let told = value(folder.path(), parameter).unwrap_err();
        assert!(told.ends_with(expected), "{told}");
        // The line of the parameter.
        assert!(told.contains("SystemStructure.ssd:6: "), "{told}");
    }
}

/// Nothing beside the system.
struct Nothing;

impl Supply for Nothing {
    fn player(&self) -> Result<Option<Player>, Box<dyn Error + Send + Sync>> {
        Ok(None)
    }

    fn starting_with(
        &self,
        file: &Path,
        _: &[Start],
    ) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
        Ok(std::fs::read(file)?)
    }
}

/// An FMU of these variables, without a library.
fn fmu(folder: &Path, name: &str, variables: &str) {
    let description = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
        <CoSimulation modelIdentifier="{name}"/><TypeDefinitions>
        <EnumerationType name="Mode"><Item name="Slow &amp; safe" value="1"/><Item name="Fast" value="4"/>
        </EnumerationType><EnumerationType name="Side"><Item name="Left" value="-1"/><Item name="Right" value="1"/>
        </EnumerationType></TypeDefinitions><ModelVariables>{variables}</ModelVariables><ModelStructure/>
        </fmiModelDescription>"#
    );
    let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
    archive
        .start_file("modelDescription.xml", SimpleFileOptions::default())
        .unwrap();
    archive.write_all(description.as_bytes()).unwrap();
    archive.finish().unwrap();
}

/// The description in the archive of a system, or why there is none.
fn exported(folder: &Path, system: &str) -> Result<String, String> {
    let path = folder.join("pair.toml");
    std::fs::write(&path, system).unwrap();
    let file = SystemFile::read(&path).unwrap();
    let system = assemble(&file, &[], &mut Files::of(&file)).unwrap();
    let experiment = Experiment {
        supply: &Nothing,
        sampling: None,
        step: 0.01,
        duration: 1.0,
        algorithm: "in-order".to_string(),
        fmi: FmiVersion::V3,
    };
    let written = contents(&system, &experiment, &folder.join("pair.ssp"));
    let mut written = written.map_err(|error| error.to_string())?;
    let text = written.files.remove("SystemStructure.ssd").unwrap();
    Ok(String::from_utf8(text).unwrap())
}

/// Lines with a word, without what is around them.
fn lines<'a>(text: &'a str, word: &str) -> Vec<&'a str> {
    let lines = text.lines().filter(|line| line.contains(word));
    lines.map(str::trim).collect()
}

#[test]
fn choices_are_declared_once_and_connected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let variable = |name: &str, own: &str, reference: u32, causality: &str| {
        let start = if causality == "input" {
            r#"start="1""#
        } else {
            ""
        };
        format!(
            r#"<Enumeration name="{name}" declaredType="{own}" valueReference="{reference}" causality="{causality}"
            variability="discrete" {start}/>"#
        )
    };
    let from = [
        variable("mode", "Mode", 1, "output"),
        variable("unread", "Mode", 2, "output"),
        variable("side", "Side", 3, "input"),
    ];
    fmu(folder.path(), "From", &from.concat());
    fmu(folder.path(), "To", &variable("mode", "Mode", 1, "input"));
    let text = exported(
        folder.path(),
        "connections = [\"a.mode -> b.mode\"]\n[components.a]\nfmu = \"From.fmu\"\n\
         [components.b]\nfmu = \"To.fmu\"\n",
    )
    .unwrap();
    assert_eq!(
        lines(&text, "Enumeration"),
        [
            // An output that nobody reads has no connector: not every reader has this type.
            r#"<ssd:Connector name="side" kind="input"><ssc:Enumeration name="Choices1"/></ssd:Connector>"#,
            r#"<ssd:Connector name="mode" kind="output"><ssc:Enumeration name="Choices2"/></ssd:Connector>"#,
            r#"<ssd:Connector name="mode" kind="input"><ssc:Enumeration name="Choices2"/></ssd:Connector>"#,
            "<ssd:Enumerations>",
            r#"<ssc:Enumeration name="Choices1"><ssc:Item name="Left" value="-1"/><ssc:Item name="Right" value="1"/></ssc:Enumeration>"#,
            r#"<ssc:Enumeration name="Choices2"><ssc:Item name="Slow &amp; safe" value="1"/><ssc:Item name="Fast" value="4"/></ssc:Enumeration>"#,
            "</ssd:Enumerations>",
        ]
    );
}

#[test]
fn arrays_are_connected_as_a_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let array = |name: &str, reference: u32, causality: &str| {
        let start = if causality == "input" {
            r#"start="0 0 0""#
        } else {
            ""
        };
        format!(
            r#"<Float64 name="{name}" valueReference="{reference}" causality="{causality}" {start}>
            <Dimension start="3"/></Float64>"#
        )
    };
    // Behind another variable, so that no place is 0.
    let first = r#"<Float64 name="first" valueReference="9" causality="input" start="0"/>"#;
    let from = [first, &array("x", 1, "output"), &array("y", 2, "output")].concat();
    let to = [first, &array("u", 1, "input"), &array("v", 2, "input")].concat();
    fmu(folder.path(), "From", &from);
    fmu(folder.path(), "To", &to);
    let system = |pairs: &[(&str, &str)]| {
        let links: Vec<String> = pairs
            .iter()
            .map(|(from, to)| format!("\"a.{from} -> b.{to}\""))
            .collect();
        let text = format!(
            "connections = [{}]\n[components.a]\nfmu = \"From.fmu\"\n[components.b]\nfmu = \"To.fmu\"\n",
            links.join(", ")
        );
        let text = exported(folder.path(), &text)?;
        Ok::<_, String>(
            lines(&text, "<ssd:Connection ")
                .into_iter()
                .map(str::to_string)
                .collect::<Vec<_>>(),
        )
    };
    let whole = [("y[1]", "u[1]"), ("y[2]", "u[2]"), ("y[3]", "u[3]")];
    let link = |from: &str, to: &str| {
        format!(
            r#"<ssd:Connection startElement="a" startConnector="{from}" endElement="b" endConnector="{to}"/>"#
        )
    };
    assert_eq!(system(&whole), Ok(vec![link("y", "u")]));
    let both = [
        whole.as_slice(),
        &[("x[1]", "v[1]"), ("x[2]", "v[2]"), ("x[3]", "v[3]")],
    ]
    .concat();
    assert_eq!(system(&both), Ok(vec![link("y", "u"), link("x", "v")]));
    for others in [
        &whole[..2],
        &[("y[1]", "u[1]"), ("y[3]", "u[2]"), ("y[2]", "u[3]")],
        &[("y[1]", "u[1]"), ("x[2]", "u[2]"), ("y[3]", "u[3]")],
    ] {
        let told = system(others).unwrap_err();
        assert!(
            told.ends_with(
                "`b.u` is an array whose elements are connected individually, which the format does not support"
            ),
            "{told}"
        );
    }
}

#[test]
fn values_of_arrays_are_written_as_a_whole() {
    let folder = tempfile::tempdir().unwrap();
    let array = |kind: &str, name: &str, reference: u32, start: &str, inner: &str| {
        format!(
            r#"<{kind} name="{name}" valueReference="{reference}" causality="parameter" variability="fixed" {start}>
            <Dimension start="2"/>{inner}</{kind}>"#
        )
    };
    let texts = r#"<Start value="one"/><Start value="two"/>"#;
    let variables = [
        array("Float64", "x", 1, r#"start="0 0""#, ""),
        array("Int32", "k", 2, r#"start="7 8""#, ""),
        array("Boolean", "on", 3, r#"start="true true""#, ""),
        array("String", "s", 4, "", texts),
        array("Float64", "unset", 5, r#"start="1 2""#, ""),
    ];
    fmu(folder.path(), "Own", &variables.concat());
    let text = exported(
        folder.path(),
        "[components.a]\nfmu = \"Own.fmu\"\n[components.a.parameters]\nx = [1.5, -2.0]\nk = [3, 4]\n\
         on = [true, false]\ns = [\"a b\", \"<c>\"]\n",
    )
    .unwrap();
    let dimension = r#"<ssc:Dimension size="2"/></ssv:Parameter>"#;
    let mut found = lines(&text, "<ssv:Parameter ");
    found.sort_unstable();
    let expected = [
        r#"<ssv:Parameter name="k"><ssv:Integer value="3 4"/>"#,
        r#"<ssv:Parameter name="on"><ssv:Boolean value="true false"/>"#,
        r#"<ssv:Parameter name="s"><ssv:String><ssv:Value value="a b"/><ssv:Value value="&lt;c&gt;"/></ssv:String>"#,
        r#"<ssv:Parameter name="x"><ssv:Real value="1.5 -2"/>"#,
    ]
    .map(|front| format!("{front}{dimension}"));
    assert_eq!(found, expected);
}
