//! Models that came as FMUs, ours and others', diagnosed from records that hide something at their
//! borders, in their parameters, or inside.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use acceptance::shared;
use fmi_import::{FmiVersion, Isolation};
use fmi_master::Algorithm;
use identification::diagnosis::DiagnosisReport;
use identification::diagnosis::engine::{Observer, Verdict};
use laboratory::diagnosis::foreign::{diagnose, template};
use laboratory::diagnosis::model::{self, Asked};
use laboratory::results::Out;
use laboratory::run::experiment::{Request, prepare};
use pack::Installation;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Writes columns under `header`, with white noise of that share of its variation on the last `noisy`.
fn write(path: &Path, header: &str, columns: &[Vec<f64>], noisy: usize, noise: f64) {
    let mut random = ChaCha8Rng::seed_from_u64(15);
    let deviation = |values: &[f64]| identification::data::mean_and_deviation(values).1;
    let sizes: Vec<f64> = columns.iter().map(|own| noise * deviation(own)).collect();
    let mut text = format!("{header}\n");
    for k in 0..columns[0].len() {
        for (i, own) in columns.iter().enumerate() {
            let is_noisy = i + noisy >= columns.len();
            let draw: f64 = StandardNormal.sample(&mut random);
            let value = own[k] + if is_noisy { sizes[i] * draw } else { 0.0 };
            _ = write!(text, "{}{value:.9e}", if i == 0 { "" } else { "," });
        }
        text.push('\n');
    }
    fs::write(path, text).unwrap();
}

fn names(report: &DiagnosisReport) -> Vec<(&str, f64)> {
    let effects = report.effects.iter().map(|effect| {
        let value = effect.parameters.values().next().unwrap().value;
        (effect.effect.as_str(), value)
    });
    effects.collect()
}

/// Diagnoses one file with one map in a folder of its own.
fn found(folder: &Path, fmu: &Path, map: &str) -> DiagnosisReport {
    let place = folder.join("map.toml");
    fs::write(&place, map).unwrap();
    let out = Out::new(folder.join("out"));
    diagnose(
        fmu,
        &place,
        &[folder.join("data.csv")],
        &out,
        (Some(Isolation::None), &Installation::default()),
        Observer::none(),
    )
    .unwrap()
}

fn reference_fmu(version: &str, name: &str) -> PathBuf {
    shared::folder().join(format!("foreign-fmus/{version}/{name}.fmu"))
}

/// The equation of Van der Pol (Reference-FMUs' read-me) by Euler's method as that FMU takes it, a
/// sample every `every` steps.
fn van_der_pol(mu: f64, samples: usize, every: usize) -> [Vec<f64>; 2] {
    let (mut x, mut v) = (2.0, 0.0);
    let mut out = [Vec::new(), Vec::new()];
    for _ in 0..samples {
        out[0].push(x);
        out[1].push(v);
        for _ in 0..every {
            (x, v) = (x + 0.01 * v, v + 0.01 * (mu * (1.0 - x * x) * v - x));
        }
    }
    out
}

/// A drift and a wrong calibration in a model without inputs, and the same model with nothing wrong.
#[needs::shared("foreign-fmus")]
#[test]
fn van_der_pol_with_another_damping_and_a_wrong_gain() {
    for version in ["fmi2", "fmi3"] {
        let fmu = reference_fmu(version, "VanDerPol");
        let map = "outputs = { x0 = 'position', x1 = 'speed' }\nparameters = { mu = {} }\n";
        for hides in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            let [x, mut v] = van_der_pol(if hides { 1.25 } else { 1.0 }, 1500, 2);
            if hides {
                v.iter_mut().for_each(|v| *v *= 1.1);
            }
            let time = (0..x.len()).map(|k| 0.02 * k as f64).collect();
            let data = folder.path().join("data.csv");
            write(&data, "time [s],position,speed", &[time, x, v], 2, 0.01);
            let report = found(folder.path(), &fmu, map);
            if hides {
                assert_eq!(report.verdict, Verdict::Named, "{}", report.sentence);
                let mut all = names(&report);
                all.sort_by(|a, b| a.0.cmp(b.0));
                let [(drift, mu), (gain, factor)] = all[..] else {
                    panic!("{}", report.sentence);
                };
                assert_eq!((drift, gain), ("mu.drift", "x1.gain"));
                assert!((mu - 0.25).abs() < 0.01 && (factor - 0.1).abs() < 0.01);
            } else {
                assert_eq!(report.verdict, Verdict::Adequate, "{}", report.sentence);
            }
        }
    }
}

/// What only passes through: every place is as good as the other, and the report says so.
#[needs::shared("foreign-fmus")]
#[test]
fn a_delay_through_an_fmu_that_does_nothing() {
    let fmu = reference_fmu("fmi3", "Feedthrough");
    let folder = tempfile::tempdir().unwrap();
    let at = |k: usize| {
        let t = 0.01 * k as f64;
        (2.0 * t).sin() + 0.6 * (5.3 * t + 1.0).sin() + 0.3 * (11.7 * t).cos()
    };
    let input: Vec<f64> = (0..3000).map(at).collect();
    // Seven samples late, and a zero that is off.
    let output = (0..3000)
        .map(|k: usize| at(k.saturating_sub(7)) + 0.4)
        .collect();
    let time = (0..3000).map(|k| 10.0 * k as f64).collect();
    let data = folder.path().join("data.csv");
    write(
        &data,
        "t [ms],force in [kN],out",
        &[time, input, output],
        1,
        0.02,
    );
    let map = "inputs = { Float64_continuous_input = 'force in' }\n\
               outputs = { Float64_continuous_output = 'out' }\n";
    let report = found(folder.path(), &fmu, map);
    assert_eq!(report.verdict, Verdict::Named, "{}", report.sentence);
    let all = names(&report);
    let value = |kind: &str| {
        all.iter()
            .find(|(name, _)| name.ends_with(kind))
            .map(|(_, v)| *v)
    };
    assert!((value(".delay").unwrap() - 0.07).abs() < 1e-3, "{all:?}");
    assert!((value(".offset").unwrap() - 0.4).abs() < 0.02, "{all:?}");
    assert_eq!(all.len(), 2);
    assert_eq!(report.alternatives.len(), 2, "{:?}", report.alternatives);
}

/// The specimen of this project, made by its equation here: softer, and read through a sensor with a
/// lag. What is written around it is played by `run` and gives the same.
#[test]
fn our_own_specimen_and_the_system_around_it() {
    let installation = Installation::default();
    let fmu = &installation
        .component("Specimen", FmiVersion::V3)
        .unwrap()
        .path;
    let folder = tempfile::tempdir().unwrap();
    let text = template(fmu, &installation).unwrap();
    assert!(
        text.contains("\"table_acceleration\" = \"table_acceleration\""),
        "{text}"
    );
    let start = |name: &str| -> f64 {
        let fmu = fmi_import::Fmu::open(fmu).unwrap();
        let variable = fmu.description.variable(name).unwrap();
        variable.start.as_deref().unwrap().parse().unwrap()
    };
    let [mass, damping, stiffness] = ["mass", "damping", "stiffness"].map(start);
    let softer = 0.85 * stiffness;
    const LAG: f64 = 0.03;
    // m (x'' + a) = -c x' - k x, the acceleration held over a sample of `step` s; seen through the lag.
    let recorded = |name: &str, header: &str, step: f64, ground: &dyn Fn(f64) -> f64| {
        let fine = 20;
        let (mut x, mut v, mut read) = (0.0, 0.0, 0.0_f64);
        let (mut input, mut force) = (Vec::new(), Vec::new());
        for k in 0..5000 {
            let a = ground(step * f64::from(k));
            input.push(a);
            let h = step / f64::from(fine);
            for part in 0..fine {
                let pull: f64 = damping * v + softer * x;
                if k == 0 && part == 0 {
                    read = pull;
                }
                v += h * (-pull / mass - a);
                x += h * v;
                if part == 0 {
                    force.push(read);
                }
                read += h / LAG * (pull - read);
            }
        }
        let time = (0..5000).map(|k| step * k as f64).collect();
        let path = folder.path().join(name);
        write(&path, header, &[time, input, force], 1, 0.01);
        path
    };
    recorded("data.csv", "time [s],a [m/s2],F [N]", 0.002, &|t| {
        2.0 * (9.0 * t).sin() + 1.5 * (23.0 * t + 0.4).sin() + (5.1 * t).cos()
    });
    let map = "inputs = { table_acceleration = 'a' }\noutputs = { force = 'F' }\n\
               parameters = { stiffness = {}, mass = {}, damping = {} }\n";
    let report = found(folder.path(), fmu, map);
    assert_eq!(
        report.verdict,
        Verdict::Named,
        "{} {:?}",
        report.sentence,
        report.notes
    );
    let mut all = names(&report);
    all.sort_by(|a, b| a.0.cmp(b.0));
    let [(lag, time), (drift, change)] = all[..] else {
        panic!("{}", report.sentence);
    };
    assert_eq!((lag, drift), ("force.lag", "stiffness.drift"));
    assert!((time / LAG - 1.0).abs() < 0.02, "{time}");
    assert!((change + 0.15).abs() < 0.002, "{change}");
    let system = report.extended_model.as_ref().unwrap();
    let request = Request::built_in(&system.display().to_string());
    let prepared = prepare(&request).unwrap();
    let outcome = prepared.run(Algorithm::GaussSeidel).unwrap();
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    let traces = fs::read_to_string(folder.path().join("out/traces.csv")).unwrap();
    let extended: Vec<f64> = traces
        .lines()
        .skip(1)
        .map(|row| row.split(',').nth(5).unwrap().parse().unwrap())
        .collect();
    let columns = &outcome.record.columns;
    let name = columns
        .iter()
        .find(|name| name.ends_with("_path.y"))
        .map_or("Specimen.force", |n| n);
    let played = outcome.record.column(name).unwrap();
    assert_eq!(played.len(), extended.len());
    let worst = played
        .iter()
        .zip(&extended)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    let size = identification::data::mean_and_deviation(&extended).1;
    assert!(worst < 1e-9 * size, "{worst} of {size} in {name}");

    // A later record, sampled otherwise and in other units, without a fit.
    let later = recorded("later.csv", "time [s],a [m/s2],F [N]", 0.001, &|t| {
        3.0 * (6.0 * t).sin() + 1.2 * (31.0 * t).cos()
    });
    let asked = Asked {
        model: system,
        columns: None,
        fmu: None,
        map: None,
        isolate: Some(Isolation::None),
        installation: &Installation::default(),
    };
    let found = model::validate(&asked, std::slice::from_ref(&later)).unwrap();
    let [of_later] = &found.records[..] else {
        panic!("{found:?}");
    };
    assert!(of_later.described_percent > 15.0, "{of_later:?}");
    assert!(of_later.extended_percent < 1.5, "{of_later:?}");
    assert_eq!(
        (of_later.channel.as_str(), of_later.unit.as_str()),
        ("force", "N")
    );

    // And predicted, its force unknown but for its unit, which is the prediction's.
    let text = fs::read_to_string(&later).unwrap();
    let measured: Vec<f64> = text
        .lines()
        .skip(1)
        .map(|row| row.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    let unknown: String = text
        .lines()
        .enumerate()
        .map(|(row, line)| match row {
            0 => "time [s],a [m/s2],F [kN]\n".to_owned(),
            _ => format!("{},\n", line.rsplit_once(',').unwrap().0),
        })
        .collect();
    let input = folder.path().join("input.csv");
    fs::write(&input, unknown).unwrap();
    let out = Out::new(folder.path().join("prediction.csv"));
    let told = model::predict(&asked, &input, false, &out).unwrap();
    assert_eq!((told.unit.as_str(), told.rows, told.given), ("kN", 5000, 0));
    let predicted: Vec<f64> = fs::read_to_string(&out)
        .unwrap()
        .lines()
        .skip(1)
        .map(|row| 1e3 * row.split(',').next().unwrap().parse::<f64>().unwrap())
        .collect();
    let missed: Vec<f64> = measured
        .iter()
        .zip(&predicted)
        .map(|(a, b)| a - b)
        .collect();
    let [missed, size] =
        [&missed, &measured].map(|all| identification::data::mean_and_deviation(all).1);
    assert!(missed < 0.015 * size, "{missed} {size}");

    // Nothing is known of a motion that repeats, and an FMU that has moved is asked for.
    let error = model::predict(&asked, &input, true, &out).unwrap_err();
    assert!(error.to_string().contains("--periodic"), "{error}");
    let moved = Asked {
        fmu: Some(Path::new("Gone.fmu")),
        ..asked
    };
    let error = model::validate(&moved, &[later]).unwrap_err();
    assert!(error.to_string().contains("Gone.fmu"), "{error}");
}

#[test]
fn bad_maps_are_refused_by_place_and_cure() {
    let installation = Installation::default();
    let fmu = &installation
        .component("Specimen", FmiVersion::V3)
        .unwrap()
        .path;
    let folder = tempfile::tempdir().unwrap();
    let columns = [
        (0..400).map(|k| 0.01 * k as f64).collect(),
        vec![1.0; 400],
        vec![2.0; 400],
    ];
    write(
        &folder.path().join("data.csv"),
        "time [s],a [m/s2],F [N]",
        &columns,
        2,
        0.1,
    );
    let good = "inputs = { table_acceleration = 'a' }\noutputs = { force = 'F' }\n";
    for (map, told) in [
        ("inputs = { table_acceleration = 'a' }\n", "outputs"),
        ("outputs = {}\n", "at least one output"),
        ("outputs = { forces = 'F' }\n", "`force`"),
        ("outputs = { force = 'G' }\n", "no column `G`"),
        (
            "outputs = { force = { column = 'F', unit = 'mm' } }\n",
            "column `F",
        ),
        (
            &format!("{good}parameters = {{ stifness = {{}} }}\n"),
            "`stiffness`",
        ),
        (
            &format!("{good}parameters = {{ stiffness = {{ plus_minus = -1.0 }} }}\n"),
            "plus_minus",
        ),
        (
            &format!("{good}step = {{ value = 3.0, unit = 'ms' }}\n"),
            "whole number",
        ),
        (
            &format!("{good}left_out = {{ files = ['b.csv'] }}\n"),
            "b.csv",
        ),
        (&format!("{good}colour = 1\n"), "unknown field `colour`"),
    ] {
        let place = folder.path().join("map.toml");
        fs::write(&place, map).unwrap();
        let out = Out::new(folder.path().join("out"));
        let data = [folder.path().join("data.csv")];
        let error = diagnose(
            fmu,
            &place,
            &data,
            &out,
            (Some(Isolation::None), &Installation::default()),
            Observer::none(),
        )
        .unwrap_err();
        let text = error.to_string();
        assert!(text.contains(told), "{text} does not tell of {told}");
        assert!(!out.exists());
    }
}
