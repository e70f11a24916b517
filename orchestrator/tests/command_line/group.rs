//! FMUs of one process whose values flow there: what comes of a system is that of FMUs in this process, to
//! the bit, and a step takes few ways to the other process.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::Command;

use fmi_import::{Isolation, Options};
use fmi_master::{Algorithm, Samples, Simulation};
use fmi_system::{Files, SystemFile, assemble};
use zip::{ZipWriter, write::SimpleFileOptions};

use crate::stderr;

/// Packs `tests/importers/group/group.c`; the output follows the input at once if `follows`. The output is
/// in metres and the input in inches; a Boolean says whether the output is above 20.
fn pack(folder: &Path, name: &str, follows: bool) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/importers/group/group.c");
    let library = folder.join(format!("{name}.so"));
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]);
    let done = compiler.arg(&library).arg(source).output();
    let done = done.expect("a C compiler");
    assert!(done.status.success(), "{}", stderr(&done));
    let dependencies = if follows { "3" } else { "" };
    let description = format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="group" guid="{{1}}">
<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit><Unit name="in"><BaseUnit m="1" factor="0.0254"/></Unit></UnitDefinitions>
<ModelVariables>
<ScalarVariable name="y" valueReference="0" causality="output" variability="continuous" initial="exact"><Real start="1" unit="m"/></ScalarVariable>
<ScalarVariable name="high" valueReference="0" causality="output" variability="discrete" initial="calculated"><Boolean/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0" unit="in"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies="{dependencies}"/><Unknown index="2" dependencies="{dependencies}"/></Outputs>
<InitialUnknowns><Unknown index="2"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"#
    );
    let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
    let library = fs::read(library).unwrap();
    let entry = format!("binaries/linux64/{name}.so");
    for (name, content) in [
        ("modelDescription.xml", description.into_bytes()),
        (&entry, library),
    ] {
        let options = SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
}

const STEP: f64 = 1e-3;
const STEPS: usize = 200;

/// `a -> b -> c -> d` with so many steps from one call to the next, none for continuous components: the
/// bits of all signals at all ticks, and how often a step went to the other process and back.
fn run(folder: &Path, periods: [usize; 4], isolation: Isolation) -> (Vec<u64>, f64) {
    let mut text = "connections = [\"a.y -> b.u\", \"b.y -> c.u\", \"c.y -> d.u\"]\n".to_string();
    for (name, period) in ["a", "b", "c", "d"].iter().zip(periods) {
        let fmu = folder.join(if *name == "a" {
            "source.fmu"
        } else {
            "follower.fmu"
        });
        text += &format!("[components.{name}]\nfmu = \"{}\"\n", fmu.display());
        if period > 0 {
            text += &format!("period = \"{period} ms\"\n");
        }
    }
    let file = SystemFile::parse("chain", &text).unwrap();
    let system = assemble(&file, &[], &mut Files::of(&file)).unwrap();
    let options = Options {
        isolation,
        guest: Some(env!("CARGO_BIN_EXE_shakebench").into()),
        ..Options::default()
    };
    let samples = Samples::none(STEP);
    let stop = STEPS as f64 * STEP;
    let simulation = Simulation::with(
        &system,
        &samples,
        Algorithm::GaussSeidel,
        (STEP, stop),
        &options,
    );
    let mut simulation = simulation.unwrap();
    let (mut bits, mut before) = (Vec::new(), 0);
    for step in 0..STEPS {
        // What follows the first steps is learned.
        if step == STEPS / 2 {
            before = simulation.exchanges();
        }
        simulation.observe().unwrap();
        bits.extend(simulation.signals().iter().map(|value| value.to_bits()));
        simulation.advance().unwrap();
    }
    let ways = (simulation.exchanges() - before) as f64;
    (bits, ways / (STEPS - STEPS / 2) as f64)
}

#[test]
fn values_flow_converted_among_fmus_of_a_process_to_the_same_bits_on_few_ways() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, "source", false);
    pack(folder, "follower", true);
    for (periods, most) in [
        ([0, 0, 0, 0], 1.0),
        ([1, 1, 1, 1], 1.0),
        ([0, 1, 1, 1], 2.0),
        // Where the last is not due its output stays.
        ([0, 1, 1, 2], 2.0),
        ([2, 1, 4, 1], 1.0),
        // What is continuous and follows a sampled one is set and read by itself, each type of it.
        ([1, 0, 1, 0], 7.0),
    ] {
        let (here, none) = run(folder, periods, Isolation::None);
        let (apart, ways) = run(folder, periods, Isolation::All);
        assert_eq!(none, 0.0);
        assert!(here == apart, "{periods:?}");
        assert!(here.iter().any(|bits| f64::from_bits(*bits) > 10.0));
        assert!(ways > 0.0 && ways <= most, "{periods:?}: {ways}");
        println!("{periods:?}: {ways} ways a step");
    }
}
