//! FMUs that others wrote, run alone, among each other and with ours, beside fmpy.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use acceptance::{python, shared};
use fmi_import::{Datum, FmiVersion, Options};
use fmi_master::{Algorithm, Checkpoint, Ended, Outcome, Pace, Record, Simulation};
use fmi_system::{SystemFile, assemble};
use laboratory::run::experiment::samples as played;
use motion::Motion;
use pack::library::FmuLibrary;
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

/// A motion at rest.
fn rest(step: f64, samples: usize) -> Motion {
    Motion {
        name: "rest".to_string(),
        dt: step,
        displacement: vec![0.0; samples],
        velocity: vec![0.0; samples],
        acceleration: vec![0.0; samples],
        notes: Vec::new(),
        seed: None,
        across: None,
    }
}

fn run(system: &str, settings: &[&str], step: f64, samples: usize) -> Outcome {
    let file = SystemFile::parse("test", system).unwrap();
    let settings: Vec<String> = settings.iter().map(|text| text.to_string()).collect();
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let system = assemble(&file, &settings, &mut library).unwrap();
    let motion = rest(step, samples);
    let plan = (step, samples as f64 * step);
    let options = Options::default();
    Simulation::with(
        &system,
        &played(&motion),
        Algorithm::GaussSeidel,
        plan,
        &options,
    )
    .unwrap()
    .run(samples, Pace::Fastest, &mut |_| {})
}

fn alone(fmu: &Path) -> String {
    format!("[components.it]\nfmu = \"{}\"\n", fmu.display())
}

/// What fmpy computes: names and rows.
fn fmpy(
    fmu: &Path,
    step: f64,
    stop: f64,
    kind: &str,
    values: &[&str],
) -> (Vec<String>, Vec<Vec<f64>>) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("fmpy.csv");
    let (step, stop) = (step.to_string(), stop.to_string());
    let mut arguments: Vec<String> = vec![
        fmu.display().to_string(),
        out.display().to_string(),
        step,
        stop,
        kind.to_string(),
    ];
    arguments.extend(values.iter().map(|value| value.to_string()));
    python::run_script("fmpy_reference.py", &arguments);
    let text = fs::read_to_string(out).unwrap();
    let mut lines = text.lines().map(|line| line.split(','));
    let names = lines.next().unwrap().map(str::to_string).collect();
    let rows = lines.map(|line| line.map(|cell| cell.parse().unwrap()).collect());
    (names, rows.collect())
}

/// A Reference-FMU; not each of them is there in both versions.
fn foreign(version: &str, name: &str) -> Option<PathBuf> {
    let path = shared::folder().join(format!("foreign-fmus/{version}/{name}.fmu"));
    path.is_file().then_some(path)
}

/// A column of a run, also of whole numbers of 64 bits.
fn column(outcome: &Outcome, name: &str) -> Vec<f64> {
    let record = &outcome.record;
    if let Some(values) = record.column(name) {
        return values;
    }
    let place = record
        .exact_columns
        .iter()
        .position(|column| column == name);
    let place = place.unwrap_or_else(|| panic!("no column {name}"));
    (0..record.len())
        .map(|row| match &record.exact(row)[place] {
            Datum::Signed(value) => *value as f64,
            Datum::Unsigned(value) => *value as f64,
            other => panic!("{name} is {other:?}"),
        })
        .collect()
}

/// The largest difference to fmpy over all outputs.
fn difference(fmu: &Path, step: f64, stop: f64, kind: &str) -> f64 {
    let samples = (stop / step).round() as usize + 1;
    let (names, rows) = fmpy(fmu, step, stop, kind, &[]);
    let ours = run(&alone(fmu), &[], step, samples);
    assert!(
        ours.ended.is_regular(),
        "{}: {}",
        fmu.display(),
        ours.ended.message()
    );
    assert_eq!(ours.record.len(), rows.len(), "{}", fmu.display());
    let mut largest: f64 = 0.0;
    for (place, name) in names.iter().enumerate().skip(1) {
        if name == "h_ft" {
            // An alias: a name of `h`, not a result of its own.
            continue;
        }
        let values = column(&ours, &format!("it.{name}"));
        for (value, row) in values.iter().zip(&rows) {
            largest = largest.max((value - row[place]).abs());
        }
    }
    largest
}

#[needs::shared("foreign-fmus")]
#[test]
fn reference_fmus_give_the_bits_of_fmpy() {
    let mut tried = 0;
    for (name, step, stop) in [
        ("BouncingBall", 0.01, 3.0),
        ("Dahlquist", 0.1, 10.0),
        ("Feedthrough", 0.1, 2.0),
        ("Resource", 0.5, 1.0),
        ("Stair", 0.2, 10.0),
        ("StateSpace", 1.0, 10.0),
        ("VanDerPol", 0.01, 20.0),
    ] {
        for version in ["fmi2", "fmi3"] {
            let Some(fmu) = foreign(version, name) else {
                continue;
            };
            let largest = difference(&fmu, step, stop, "CoSimulation");
            println!("{version} {name}: differs from fmpy by {largest:e}");
            assert!(largest == 0.0, "{version} {name}: {largest:e}");
            tried += 1;
        }
    }
    assert_eq!(tried, 13);
}

/// The FMU without its co-simulation, in a folder of the test.
fn exchange_only(fmu: &Path, folder: &Path) -> PathBuf {
    let path = folder.join(fmu.file_name().unwrap());
    let mut from = ZipArchive::new(File::open(fmu).unwrap()).unwrap();
    let mut to = ZipWriter::new(File::create(&path).unwrap());
    for index in 0..from.len() {
        let mut entry = from.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        if name.ends_with('/') {
            continue;
        }
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        if name == "modelDescription.xml" {
            let text = String::from_utf8(content).unwrap();
            let (before, rest) = text.split_once("<CoSimulation").unwrap();
            let end = match rest.find("</CoSimulation>") {
                Some(at) => at + "</CoSimulation>".len(),
                None => rest.find("/>").unwrap() + 2,
            };
            content = format!("{before}{}", &rest[end..]).into_bytes();
        }
        to.start_file(name, SimpleFileOptions::default()).unwrap();
        to.write_all(&content).unwrap();
    }
    to.finish().unwrap();
    path
}

#[needs::shared("foreign-fmus")]
#[test]
fn model_exchange_agrees_with_cvode() {
    let folder = tempfile::tempdir().unwrap();
    for (name, step, stop, within) in [
        ("BouncingBall", 0.01, 2.5, 1e-6),
        ("Stair", 0.2, 8.0, 0.0),
        ("VanDerPol", 0.01, 20.0, 1e-6),
        ("Dahlquist", 0.1, 10.0, 1e-8),
    ] {
        for version in ["fmi2", "fmi3"] {
            let Some(fmu) = foreign(version, name) else {
                continue;
            };
            let fmu = exchange_only(&fmu, folder.path());
            let largest = difference(&fmu, step, stop, "ModelExchange");
            println!("{version} {name}: differs from CVode by {largest:e}");
            assert!(largest <= within, "{version} {name}: {largest:e}");
        }
    }
}

/// Runs an FMU that steps itself, too, by the solver; the values of an output.
fn by_the_solver(name: &str, output: &str, settings: &[&str], step: f64, rows: usize) -> Vec<f64> {
    let fmu = foreign("fmi3", name).unwrap();
    let system = format!("{}interface = \"model-exchange\"\n", alone(&fmu));
    let begun = std::time::Instant::now();
    let outcome = run(&system, settings, step, rows);
    println!("{name}: {:?}", begun.elapsed());
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    outcome.record.column(&format!("it.{output}")).unwrap()
}

#[needs::shared("foreign-fmus")]
#[test]
fn stiff_models_agree_with_scipy_s_radau() {
    // Robertson's reaction over 10,000 s.
    let script = "from scipy.integrate import solve_ivp\n\
        def f(t, y):\n  \
          slow = -0.04*y[0] + 1e4*y[1]*(1 - y[0] - y[1])\n  \
          return [slow, -slow - 3e7*y[1]**2]\n\
        times = [10.0 * k for k in range(1, 1000)]\n\
        got = solve_ivp(f, [0, 1e4], [1, 0], method='Radau', rtol=1e-9, atol=1e-14, t_eval=times)\n\
        for value in got.y[0]: print(repr(float(value)))\n";
    let output = python::python().args(["-c", script]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let text = String::from_utf8_lossy(&output.stdout);
    let reference: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
    let values = by_the_solver("Roberts", "y1", &[], 10.0, 1000);
    assert_eq!(values.len(), 1 + reference.len());
    let pairs = values[1..].iter().zip(&reference);
    let largest = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("Roberts: {largest:e}");
    assert!(largest < 1e-6, "{largest:e}");
    // Van der Pol's oscillator, which jumps at 807,000 s; by SciPy's Radau with rtol 1e-11 and atol 1e-14.
    let values = by_the_solver("VanDerPol", "x0", &["it.mu=1e6"], 2e4, 82);
    for (row, expected) in [
        (20, 1.693209005119728),
        (40, 1.083892946675993),
        (50, -1.8633839229607099),
        (60, -1.6994006675043591),
        (80, -1.119268647778863),
    ] {
        let error = (values[row] - expected).abs();
        println!("VanDerPol: {error:e}");
        assert!(error < 1e-6, "row {row}: {error:e}");
    }
}

#[needs::shared("foreign-fmus")]
#[test]
fn model_exchange_goes_on_from_a_checkpoint_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    for (name, step, samples) in [
        ("BouncingBall", 0.01, 250),
        ("Stair", 0.2, 40),
        ("VanDerPol", 0.01, 400),
    ] {
        for version in ["fmi2", "fmi3"] {
            let Some(fmu) = foreign(version, name) else {
                continue;
            };
            let fmu = exchange_only(&fmu, folder.path());
            let file = SystemFile::parse("test", &alone(&fmu)).unwrap();
            let mut library = FmuLibrary::new(FmiVersion::V3, None);
            let system = assemble(&file, &[], &mut library).unwrap();
            let begin = || {
                let motion = rest(step, samples);
                let plan = (step, samples as f64 * step);
                let algorithm = Algorithm::GaussSeidel;
                Simulation::with(
                    &system,
                    &played(&motion),
                    algorithm,
                    plan,
                    &Options::default(),
                )
                .unwrap()
            };
            let kept: Arc<Mutex<Vec<(Checkpoint, Record)>>> = Arc::default();
            let keep = kept.clone();
            let mut first = begin();
            let keeper = move |checkpoint: &Checkpoint, record: &Record| {
                keep.lock()
                    .unwrap()
                    .push((checkpoint.clone(), record.clone()));
                Ok(())
            };
            first
                .keep_checkpoints(samples / 5, Box::new(keeper))
                .unwrap();
            let whole = first.run(samples, Pace::Fastest, &mut |_| {});
            let kept = kept.lock().unwrap();
            assert_eq!(kept.len(), 4, "{version} {name}");
            for (checkpoint, record) in kept.iter() {
                let mut second = begin();
                second.resume(checkpoint, record.clone()).unwrap();
                let rest = second.run(samples, Pace::Fastest, &mut |_| {});
                assert!(rest.ended.is_regular(), "{}", rest.ended.message());
                assert!(
                    rest.record == whole.record,
                    "{version} {name} from {} s",
                    checkpoint.time
                );
            }
        }
    }
}

#[needs::shared("foreign-fmus")]
#[test]
fn every_type_goes_through_parameters_and_connections() {
    let fmu = foreign("fmi3", "Feedthrough").unwrap();
    let types = [
        ("Float32_continuous", "0.1"),
        ("Float64_continuous", "-1.5"),
        ("Int8", "-128"),
        ("UInt8", "255"),
        ("Int16", "-32768"),
        ("UInt16", "65535"),
        ("Int32", "-2147483648"),
        ("UInt32", "4294967295"),
        ("Int64", "-9223372036854775808"),
        ("UInt64", "18446744073709551615"),
        ("Boolean", "true"),
        ("String", "a \"text\", with commas"),
        ("Binary", "00ff10"),
        ("Enumeration", "Option 2"),
    ];
    let connections: Vec<String> = types
        .iter()
        .map(|(name, _)| format!("\"first.{name}_output -> second.{name}_input\""))
        .collect();
    let system = format!(
        "connections = [{}]\n[components.first]\nfmu = \"{1}\"\n[components.second]\nfmu = \"{1}\"\n",
        connections.join(", "),
        fmu.display()
    );
    let settings: Vec<String> = types
        .iter()
        .map(|(name, value)| format!("first.{name}_input={value}"))
        .collect();
    let settings: Vec<&str> = settings.iter().map(String::as_str).collect();
    let outcome = run(&system, &settings, 0.1, 3);
    assert!(
        matches!(outcome.ended, Ended::Complete),
        "{}",
        outcome.ended.message()
    );
    let record = &outcome.record;
    for (name, written) in types {
        let name = format!("second.{name}_output");
        let Some(place) = record
            .exact_columns
            .iter()
            .position(|column| *column == name)
        else {
            let expected = match written {
                "true" => 1.0,
                "Option 2" => 2.0,
                "0.1" => f64::from(0.1_f32),
                number => number.parse().unwrap(),
            };
            assert_eq!(record.column(&name).unwrap(), [expected; 3], "{name}");
            continue;
        };
        assert_eq!(record.exact(2)[place].to_string(), written, "{name}");
    }
}

#[needs::shared("foreign-fmus")]
#[test]
fn arrays_are_set_as_a_whole_and_connected_by_their_names() {
    let fmu = foreign("fmi3", "StateSpace").unwrap();
    // y = D u without states, once and once more.
    let system = format!(
        "connections = [\"a.y -> b.u\"]\n[components.a]\nfmu = \"{0}\"\n\
         [components.b]\nfmu = \"{0}\"\nparameters = {{ D = [[0, 0, 1], [0, 1, 0], [1, 0, 0]] }}\n",
        fmu.display()
    );
    let settings = [
        "a.D=1 2 3 4 5 6 7 8 9",
        "a.u=1 10 100",
        "a.B=0",
        "b.B=0",
        "a.A[2,1]=3",
    ];
    let outcome = run(&system, &settings, 1.0, 3);
    assert!(
        matches!(outcome.ended, Ended::Complete),
        "{}",
        outcome.ended.message()
    );
    for (name, expected) in [
        ("a.y[1]", 321.0),
        ("a.y[2]", 654.0),
        ("a.y[3]", 987.0),
        ("b.y[1]", 987.0),
        ("b.y[3]", 321.0),
    ] {
        let values = outcome.record.column(name).unwrap();
        assert_eq!(values, [expected; 3], "{name}");
    }
}

/// The published StateSpace refuses every setting of its structural parameters, from fmpy as well:
/// the sizes are checked before the run.
#[needs::shared("foreign-fmus")]
#[test]
fn arrays_follow_structural_parameters() {
    let fmu = foreign("fmi3", "StateSpace").unwrap();
    let file = SystemFile::parse("test", &alone(&fmu)).unwrap();
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let settings = ["it.m=2", "it.n=1", "it.r=3"].map(str::to_string);
    let system = assemble(&file, &settings, &mut library).unwrap();
    let description = &system.components[0].fmu.description;
    let size = |name: &str| description.array(name).map(|elements| elements.len());
    for (name, elements) in [("A", 1), ("B", 2), ("C", 3), ("D", 6), ("u", 2), ("y", 3)] {
        assert_eq!(size(name), Some(elements), "{name}");
    }
    assert!(description.position("D[3,2]").is_some());
    assert!(description.position("D[2,3]").is_none());
}

#[needs::shared("foreign-fmus")]
#[test]
fn foreign_fmus_run_among_each_other_and_with_ours() {
    let [ball, oscillator, through] = [
        foreign("fmi2", "BouncingBall"),
        foreign("fmi3", "VanDerPol"),
        foreign("fmi3", "Feedthrough"),
    ]
    .map(Option::unwrap);
    let system = format!(
        r#"
        connections = [
            "ball.h -> through.Float64_continuous_input",
            "oscillator.x0 -> through.Float32_continuous_input",
            "through.Float64_continuous_output -> specimen.table_acceleration",
        ]
        [components.ball]
        fmu = "{}"
        parameters = {{ h = 2.0 }}
        [components.oscillator]
        fmu = "{}"
        [components.through]
        fmu = "{}"
        [components.specimen]
        fmu = "Specimen"
        "#,
        ball.display(),
        oscillator.display(),
        through.display()
    );
    let outcome = run(&system, &[], 0.002, 500);
    assert!(
        matches!(outcome.ended, Ended::Complete),
        "{}",
        outcome.ended.message()
    );
    let record = &outcome.record;
    let heights = record.column("ball.h").unwrap();
    assert_eq!(heights[0], 2.0, "a start value of an output is set");
    assert_eq!(
        heights,
        record.column("through.Float64_continuous_output").unwrap()
    );
}

/// Each with each, of both versions: what one does in the process does not change the other.
#[needs::shared("foreign-fmus")]
#[test]
fn reference_fmus_in_pairs_are_as_they_are_alone() {
    let folder = shared::folder();
    let mut fmus = Vec::new();
    for version in ["fmi2", "fmi3"] {
        let all = fs::read_dir(folder.join("foreign-fmus").join(version)).unwrap();
        fmus.extend(all.map(|entry| entry.unwrap().path()));
    }
    fmus.retain(|path| path.file_stem().is_some_and(|name| name != "Clocks"));
    fmus.sort();
    let component =
        |name: &str, fmu: &Path| format!("[components.{name}]\nfmu = \"{}\"\n", fmu.display());
    let columns = |outcome: &Outcome, own: &str| -> Vec<Vec<f64>> {
        let names = outcome.record.columns.iter();
        let own = names.filter(|name| name.starts_with(&format!("{own}.")));
        own.map(|name| column(outcome, name)).collect()
    };
    let (step, samples) = (0.01, 101);
    let alone: Vec<_> = fmus
        .iter()
        .map(|fmu| {
            let outcome = run(&component("one", fmu), &[], step, samples);
            assert!(
                outcome.ended.is_regular(),
                "{}: {}",
                fmu.display(),
                outcome.ended.message()
            );
            columns(&outcome, "one")
        })
        .collect();
    for (i, one) in fmus.iter().enumerate() {
        for (k, other) in fmus.iter().enumerate().skip(i) {
            let system = component("one", one) + &component("other", other);
            let outcome = run(&system, &[], step, samples);
            let told = format!("{} with {}", one.display(), other.display());
            assert!(
                outcome.ended.is_regular(),
                "{told}: {}",
                outcome.ended.message()
            );
            assert_eq!(columns(&outcome, "one"), alone[i], "{told}");
            assert_eq!(columns(&outcome, "other"), alone[k], "{told}");
        }
    }
}

#[needs::shared("foreign-fmus")]
#[test]
fn scheduled_execution_is_refused_in_words() {
    let fmu = foreign("fmi3", "Clocks").unwrap();
    let file = SystemFile::parse("test", &alone(&fmu)).unwrap();
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let system = assemble(&file, &[], &mut library).unwrap();
    let plan = (0.1, 1.0);
    let options = Options::default();
    let made = Simulation::with(
        &system,
        &played(&rest(0.1, 3)),
        Algorithm::GaussSeidel,
        plan,
        &options,
    );
    let said = made.err().unwrap().to_string();
    assert!(said.contains("only scheduled execution"), "{said}");
}
