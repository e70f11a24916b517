//! FMUs around the library that is compiled from `fmu`, once in each program of tests.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, Mutex, OnceLock};

use fmi_import::{FmiVersion, Fmu, Instance, Kind, Options};
use zip::{ZipWriter, write::SimpleFileOptions};

/// Value references of the FMU's Float64.
pub const U: u32 = 1;
pub const GAIN: u32 = 2;
pub const Y: u32 = 3;
pub const X: u32 = 4;
pub const SLOPE: u32 = 5;
pub const PAIR: u32 = 6;
pub const FLOOR: u32 = 7;
pub const PERIOD: u32 = 8;
pub const FAILS: u32 = 11;

/// Value references of its Int32: the status of the next steps, and how many events there were.
pub const ANSWER: u32 = 70;
pub const COUNT: u32 = 71;
/// How often its clock has ticked.
pub const TICKS: u32 = 72;

/// Value references of its Boolean: steps return early; it asks to end the run.
pub const EARLY: u32 = 120;
pub const OVER: u32 = 121;

pub const BOTH: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

const VARIABLES_2: &str = r#"
<ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="gain" valueReference="2" causality="parameter" variability="tunable"><Real start="2"/></ScalarVariable>
<ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="x" valueReference="4" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="slope" valueReference="5"><Real derivative="4"/></ScalarVariable>
<ScalarVariable name="answer" valueReference="70" causality="parameter" variability="tunable"><Integer start="0"/></ScalarVariable>
<ScalarVariable name="over" valueReference="121" causality="parameter" variability="tunable"><Boolean start="false"/></ScalarVariable>
"#;

const VARIABLES_3: &str = r#"
<Float64 name="u" valueReference="1" causality="input" start="0"/>
<Float64 name="gain" valueReference="2" causality="parameter" variability="tunable" start="2"/>
<Float64 name="y" valueReference="3" causality="output"/>
<Float64 name="x" valueReference="4" causality="output"/>
<Float64 name="slope" valueReference="5" derivative="4"/>
<Float64 name="pair" valueReference="6" causality="input" start="0 0"><Dimension start="2"/></Float64>
<Int32 name="answer" valueReference="70" causality="parameter" variability="tunable" start="0"/>
<Boolean name="over" valueReference="121" causality="parameter" variability="tunable" start="false"/>
"#;

/// The description, with `attributes` of each of its interfaces and `more` variables (FMI 3.0).
pub fn description(version: FmiVersion, interfaces: [Option<&str>; 2], more: &str) -> String {
    let names = ["CoSimulation", "ModelExchange"]
        .into_iter()
        .zip(interfaces);
    let interfaces: String = names
        .filter_map(|(name, own)| Some((name, own?)))
        .map(|(name, own)| format!(r#"<{name} modelIdentifier="minimal" {own}/>"#))
        .collect();
    match version {
        FmiVersion::V2 => format!(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="minimal" guid="minimal" numberOfEventIndicators="1">
            {interfaces}<LogCategories><Category name="calls"/></LogCategories><ModelVariables>{VARIABLES_2}</ModelVariables>
            <ModelStructure><Outputs><Unknown index="3"/><Unknown index="4"/></Outputs><Derivatives><Unknown index="5"/>
            </Derivatives></ModelStructure></fmiModelDescription>"#
        ),
        FmiVersion::V3 => format!(
            r#"<fmiModelDescription fmiVersion="3.0" modelName="minimal" instantiationToken="minimal">{interfaces}
            <LogCategories><Category name="calls"/></LogCategories><ModelVariables>{VARIABLES_3}{more}</ModelVariables>
            <ModelStructure><Output valueReference="3"/><Output valueReference="4"/>
            <ContinuousStateDerivative valueReference="5"/></ModelStructure></fmiModelDescription>"#
        ),
    }
}

/// Compiles a library.
pub fn compile(source: &Path) -> Vec<u8> {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let library = folder.path().join("library");
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut command = Command::new(rustc);
    command.args([
        "--edition=2024",
        "--crate-type=cdylib",
        "--crate-name=minimal",
    ]);
    command.args([
        "-Cpanic=abort",
        "-Copt-level=0",
        "-Cdebuginfo=0",
        "-Cstrip=symbols",
        "-o",
    ]);
    let status = command.arg(&library).arg(source).status().unwrap();
    assert!(status.success(), "{status}");
    std::fs::read(library).unwrap()
}

/// The folder of the FMU's source.
pub fn source() -> &'static Path {
    Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../fmi/tests/compiled/fmu"
    ))
}

/// The library.
pub fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compile(&source().join("lib.rs")))
}

/// An FMU of a description and a library.
pub fn packed(description: &str, library: &[u8]) -> Arc<Fmu> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Minimal.fmu");
    pack(&path, description, library, &[]);
    Fmu::open(&path).unwrap()
}

/// Writes an FMU with `more` files.
pub fn pack(path: &Path, description: &str, library: &[u8], more: &[(&str, &str)]) {
    // Folders of both versions.
    let folders = FmiVersion::ALL.map(FmiVersion::binaries);
    let libraries = folders.map(|own| format!("{own}/minimal{}", std::env::consts::DLL_SUFFIX));
    let mut files = vec![("modelDescription.xml", description.as_bytes())];
    files.extend(libraries.iter().map(|name| (name.as_str(), library)));
    files.extend(more.iter().map(|(name, text)| (*name, text.as_bytes())));
    write(path, &files);
}

/// Writes an archive of named files.
pub fn write(path: &Path, files: &[(&str, &[u8])]) {
    let mut archive = ZipWriter::new(File::create(path).unwrap());
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, bytes) in files {
        archive.start_file(*name, options).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
}

/// The FMU of a description, opened once.
fn minimal(description: String) -> Arc<Fmu> {
    static OPENED: Mutex<Option<HashMap<String, Arc<Fmu>>>> = Mutex::new(None);
    let mut opened = OPENED.lock().unwrap();
    let opened = opened.get_or_insert_default().entry(description);
    let new = |description: &String| packed(description, library());
    opened.or_insert_with_key(new).clone()
}

/// The FMU for co-simulation, with these attributes and `more` variables.
pub fn stepped(version: FmiVersion, attributes: &str, more: &str) -> Arc<Fmu> {
    minimal(description(version, [Some(attributes), None], more))
}

/// The FMU for co-simulation and model exchange, with these attributes of the latter.
pub fn exchanged(version: FmiVersion, attributes: &str) -> Arc<Fmu> {
    let both = description(version, [Some(""), Some(attributes)], "");
    minimal(both).for_model_exchange().unwrap()
}

/// The same description, of an FMU that answers so from its beginning.
pub fn answering(description: &str, answer: i32) -> String {
    ["guid", "instantiationToken"]
        .iter()
        .fold(description.to_string(), |text, name| {
            let token = format!(r#"{name}="minimal {answer}""#);
            text.replace(&format!(r#"{name}="minimal""#), &token)
        })
}

/// How an FMU is run whose calls are logged.
pub fn logged() -> Options {
    Options {
        log_categories: Some(vec!["calls".to_string()]),
        ..Options::default()
    }
}

/// An instance whose calls are logged.
pub fn instance(fmu: &Arc<Fmu>) -> Instance {
    Instance::new(fmu, "one", &logged()).unwrap()
}

/// Initializes an instance at 0 s, with these parameters.
pub fn begin(instance: &mut Instance, parameters: &[(u32, f64)]) {
    instance.enter_initialization(0.0, 10.0).unwrap();
    for &(reference, value) in parameters {
        set(instance, reference, value);
    }
    instance.exit_initialization().unwrap();
}

/// An instance that is initialized, with these parameters.
pub fn running(fmu: &Arc<Fmu>, parameters: &[(u32, f64)]) -> Instance {
    let mut instance = instance(fmu);
    begin(&mut instance, parameters);
    instance
}

pub fn set(instance: &mut Instance, reference: u32, value: f64) {
    instance
        .set(&Kind::Float64, &[reference], &[value])
        .unwrap();
}

/// The value of a Float64.
pub fn value(instance: &mut Instance, reference: u32) -> f64 {
    one(instance, &Kind::Float64, reference)
}

/// The value of a variable.
pub fn one(instance: &mut Instance, kind: &Kind, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    instance.get(kind, &[reference], &mut value).unwrap();
    value[0]
}

/// Sets the status of the next steps.
pub fn answer(instance: &mut Instance, status: i32) {
    instance
        .set(&Kind::Int32, &[ANSWER], &[f64::from(status)])
        .unwrap();
}

/// The texts that were logged.
pub fn texts(instance: &Instance) -> Vec<String> {
    let messages = instance.take_messages();
    messages.into_iter().map(|message| message.text).collect()
}
