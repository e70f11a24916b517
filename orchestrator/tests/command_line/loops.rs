//! Loops of direct feedthrough between foreign FMUs: solved where repeating runs away, with the FMUs'
//! own derivatives where they give them, and explained where there is nothing to find.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::Command;

use zip::{ZipWriter, write::SimpleFileOptions};

use crate::{shakebench, stderr};

/// What an FMU of `tests/importers/loop/loop.c` gives.
#[derive(Clone, Copy)]
pub(crate) struct Offer {
    pub is_fmi3: bool,
    /// As the source numbers them.
    pub derivatives: usize,
}

const NONE: Offer = Offer {
    is_fmi3: false,
    derivatives: 0,
};

pub(crate) fn pack(folder: &Path, name: &str, offer: Offer) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/importers/loop/loop.c");
    let library = folder.join(format!("{name}.so"));
    let mut compiler = Command::new("cc");
    compiler
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .arg(&library);
    compiler.arg(format!("-DDERIVATIVES={}", offer.derivatives));
    if offer.is_fmi3 {
        compiler.arg("-DFMI3");
    }
    let done = compiler.arg(source).output().expect("a C compiler");
    assert!(done.status.success(), "{}", stderr(&done));
    let (platform, description) = match offer.is_fmi3 {
        false => ("linux64", fmi2(offer.derivatives)),
        true => ("x86_64-linux", fmi3(offer.derivatives)),
    };
    let mut archive = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
    for (name, content) in [
        ("modelDescription.xml".to_string(), description.into_bytes()),
        (
            format!("binaries/{platform}/ring.so"),
            fs::read(library).unwrap(),
        ),
    ] {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
}

const PARAMETERS: [(&str, usize, f64); 3] =
    [("gain", 2, 1.0), ("bend", 3, 0.0), ("offset", 4, 0.0)];

fn fmi2(derivatives: usize) -> String {
    let parameters = PARAMETERS.map(|(name, reference, start)| {
        format!(
            r#"<ScalarVariable name="{name}" valueReference="{reference}" causality="parameter" variability="fixed"><Real start="{start}"/></ScalarVariable>"#
        )
    });
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="ring" guid="{{1}}">
<CoSimulation modelIdentifier="ring" canHandleVariableCommunicationStepSize="true" providesDirectionalDerivative="{}"/>
<ModelVariables>
<ScalarVariable name="y" valueReference="0" causality="output" variability="continuous" initial="calculated"><Real/></ScalarVariable>
<ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
{}
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1" dependencies="2"/></Outputs>
<InitialUnknowns><Unknown index="1"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"#,
        derivatives != 0,
        parameters.join("\n")
    )
}

fn fmi3(derivatives: usize) -> String {
    let parameters = PARAMETERS.map(|(name, reference, start)| {
        format!(
            r#"<Float64 name="{name}" valueReference="{reference}" causality="parameter" variability="fixed" start="{start}"/>"#
        )
    });
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="ring" instantiationToken="1">
<CoSimulation modelIdentifier="ring" canHandleVariableCommunicationStepSize="true" providesDirectionalDerivatives="{}" providesAdjointDerivatives="{}"/>
<ModelVariables>
<Float64 name="y" valueReference="0" causality="output" variability="continuous" initial="calculated"/>
<Float64 name="u" valueReference="1" causality="input" variability="continuous" start="0"/>
{}
</ModelVariables>
<ModelStructure><Output valueReference="0" dependencies="1"/>
<InitialUnknown valueReference="0" dependencies="1"/></ModelStructure>
</fmiModelDescription>"#,
        derivatives == 1,
        derivatives == 2,
        parameters.join("\n")
    )
}

struct Ring<'a> {
    offers: [Offer; 2],
    /// Parameters of `a` and `b`.
    parameters: [&'a str; 2],
    algorithm: &'a str,
    more: &'a [&'a str],
}

struct Run {
    status: Option<i32>,
    said: String,
    /// The last values of `a.y` and `b.y`.
    last: Option<[f64; 2]>,
    trace: String,
}

/// Runs two FMUs in a ring, `a.y -> b.u` and `b.y -> a.u`, for ten steps.
fn run(ring: &Ring) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pack(folder, "a", ring.offers[0]);
    pack(folder, "b", ring.offers[1]);
    let [a, b] = ring.parameters;
    let system = format!(
        "connections = [\"a.y -> b.u\", \"b.y -> a.u\"]\n\
         [components.a]\nfmu = \"a.fmu\"\nparameters = {{ {a} }}\n\
         [components.b]\nfmu = \"b.fmu\"\nparameters = {{ {b} }}\n"
    );
    fs::write(folder.join("ring.toml"), system).unwrap();
    let mut arguments = vec![
        "run",
        "ring.toml",
        "--out",
        "out",
        "--step",
        "1 ms",
        "--duration",
        "10 ms",
    ];
    arguments.extend(["--algorithm", ring.algorithm, "--trace", "trace"]);
    arguments.extend(ring.more);
    let output = shakebench(folder, &arguments);
    let results = fs::read_to_string(folder.join("out/results.csv")).unwrap_or_default();
    let mut lines = results
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let last = lines.next().and_then(|names| {
        let row = lines.next_back()?;
        let value = |name: &str| {
            row[names.iter().position(|known| *known == name)?]
                .parse()
                .ok()
        };
        Some([value("a.y")?, value("b.y")?])
    });
    Run {
        status: output.status.code(),
        said: stderr(&output),
        last,
        trace: fs::read_to_string(folder.join("trace")).unwrap_or_default(),
    }
}

/// A loop gain of -12, which repeating never bears: a = 3 + 4 b, b = 2 - 3 a.
const STEEP: [&str; 2] = ["gain = 4, offset = 3", "gain = -3, offset = 2"];

/// a = 5 - b^2, b = a.
const CURVED: [&str; 2] = ["gain = 0, bend = -1, offset = 5", "gain = 1"];

#[test]
fn a_loop_that_repeating_blows_up_is_solved() {
    let run = run(&Ring {
        offers: [NONE, NONE],
        parameters: STEEP,
        algorithm: "iterative",
        more: &[],
    });
    assert_eq!(run.status, Some(0), "{}", run.said);
    let [a, b] = run.last.unwrap();
    assert!((a - 11.0 / 13.0).abs() < 1e-12, "{a}");
    assert!((b + 7.0 / 13.0).abs() < 1e-12, "{b}");
}

#[test]
fn derivatives_that_fmus_give_are_used_in_both_versions_and_across_processes() {
    let directional = [false, true].map(|is_fmi3| Offer {
        is_fmi3,
        derivatives: 1,
    });
    let adjoint = Offer {
        is_fmi3: true,
        derivatives: 2,
    };
    for (offers, calls) in [
        (
            directional,
            [
                "a fmi2GetDirectionalDerivative([0], [1], [1",
                "b fmi3GetDirectionalDerivative([0], [1], [",
            ],
        ),
        (
            [directional[1], adjoint],
            [
                "a fmi3GetDirectionalDerivative([0], [1], [1",
                "b fmi3GetAdjointDerivative([0], [1], [1",
            ],
        ),
    ] {
        for isolate in ["none", "all"] {
            let run = run(&Ring {
                offers,
                parameters: CURVED,
                algorithm: "iterative",
                more: &["--isolate", isolate],
            });
            assert_eq!(run.status, Some(0), "{}", run.said);
            let [a, b] = run.last.unwrap();
            let exact = (21_f64.sqrt() - 1.0) / 2.0;
            assert!(
                (a - exact).abs() < 1e-12 && (b - exact).abs() < 1e-12,
                "{a}"
            );
            for call in calls {
                assert!(run.trace.contains(call), "{isolate}: {call}: {}", run.trace);
            }
        }
    }
}

#[test]
fn with_one_fmu_that_gives_none_differences_are_taken() {
    let gives = Offer {
        derivatives: 1,
        ..NONE
    };
    let run = run(&Ring {
        offers: [gives, NONE],
        parameters: CURVED,
        algorithm: "iterative",
        more: &[],
    });
    assert_eq!(run.status, Some(0), "{}", run.said);
    let [a, ..] = run.last.unwrap();
    assert!((a - (21_f64.sqrt() - 1.0) / 2.0).abs() < 1e-12, "{a}");
    assert!(!run.trace.contains("Derivative("), "{}", run.trace);
}

#[test]
fn derivatives_of_the_wrong_sign_are_found_out() {
    let wrong = Offer {
        derivatives: 3,
        ..NONE
    };
    let run = run(&Ring {
        offers: [wrong, wrong],
        parameters: STEEP,
        algorithm: "iterative",
        more: &[],
    });
    assert_eq!(run.status, Some(0), "{}", run.said);
    let [a, ..] = run.last.unwrap();
    assert!((a - 11.0 / 13.0).abs() < 1e-12, "{a}");
}

#[test]
fn a_loop_without_a_solution_is_explained() {
    let explained = |parameters: [&str; 2], words: &[&str]| {
        let run = run(&Ring {
            offers: [NONE, NONE],
            parameters,
            algorithm: "iterative",
            more: &[],
        });
        assert_ne!(run.status, Some(0), "{}", run.said);
        assert!(run.said.contains("has no solution"), "{}", run.said);
        for name in ["a.y", "b.u", "b.y", "a.u"] {
            assert!(run.said.contains(name), "{name}: {}", run.said);
        }
        for word in words {
            assert!(run.said.contains(word), "{word}: {}", run.said);
        }
    };
    // a = b + 1, b = a.
    explained(["offset = 1", "gain = 1"], &["loop gain is 1"]);
    // a = b^2 + 1, b = a: both come closest at 1/2.
    explained(
        ["gain = 0, bend = 1, offset = 1", "gain = 1"],
        &["0.5", "1.25"],
    );
}

#[test]
fn a_master_of_jacobi_s_order_delays_where_the_others_solve() {
    let run = run(&Ring {
        offers: [NONE, NONE],
        parameters: ["gain = 0.5, offset = 1", "gain = 0.5"],
        algorithm: "jacobi",
        more: &[],
    });
    assert_eq!(run.status, Some(0), "{}", run.said);
    let [a, ..] = run.last.unwrap();
    assert!((a - 4.0 / 3.0).abs() < 1e-9, "{a}");
}

#[test]
fn a_false_claim_of_derivatives_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let said = |derivatives| {
        let offer = Offer {
            derivatives,
            ..NONE
        };
        pack(folder.path(), "ring", offer);
        let validated = shakebench(folder.path(), &["validate", "ring.fmu"]);
        crate::stdout(&validated)
    };
    let text = said(3);
    let words = "the derivative of `y` by `u` is given as -1.000000, and differences of its values are 1.000000";
    assert!(text.contains(words), "{text}");
    let text = said(1);
    assert!(text.contains("derivatives against differences"), "{text}");
    assert!(!text.contains("is given as"), "{text}");
}
