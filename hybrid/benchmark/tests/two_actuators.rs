//! The two-actuator benchmark as FMUs: the same strokes as the run without FMI, through the project's master and in
//! fmpy's own loop.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs;
use std::path::{Path, PathBuf};

use acceptance::python;
use fmi_import::FmiVersion;
use fmi_master::Ended;
use hybrid::marths::laws::{Class, DecentralisedAdaptive, Law, Predictive, PredictiveDesign};
use hybrid::marths::run::{Histories, Setting, run};
use hybrid::marths::{Deviation, PlantParameters, independent_noise};
use laboratory::run::experiment::{Request, prepare};
use motion::Scaling;

fn native(ground: &[f64], plant: u64, law: &mut dyn Law) -> Histories {
    let nominal = PlantParameters::default();
    let plant = match plant {
        0 => nominal,
        number => Deviation::default().draw(&nominal, 7, number),
    };
    let noise = independent_noise(1, 0, ground.len());
    let setting = Setting {
        plant: &plant,
        ground,
        noise: &noise,
    };
    run(&setting, law).unwrap()
}

/// Within what the adaptive law makes of rounding: kinematics and force are written otherwise natively.
const ROUNDING: f64 = 1e-7;

fn near(name: &str, through: &[f64], native: &[f64]) {
    let size = native.iter().fold(0.0f64, |a, x| a.max(x.abs()));
    assert!(size > 0.0 && through.len() == native.len(), "{name}");
    for (k, (a, b)) in through.iter().zip(native).enumerate() {
        assert!((a - b).abs() <= ROUNDING * size, "{name} {k}: {a} {b}");
    }
}

/// The predictive law, the sample law on a perturbed plant, and estimated strokes.
#[test]
fn the_loop_through_the_master_is_the_run_without_fmi() {
    let estimating = PredictiveDesign {
        class: Class::Estimate,
        order: 3,
        ..PredictiveDesign::default()
    };
    let perturbed = [
        "plant.drawn_plant=3",
        "plant.seed=7",
        "control.law=decentralised_adaptive",
    ];
    type Case<'a> = (&'a str, FmiVersion, &'a [&'a str], u64, Box<dyn Law>);
    let cases: [Case<'_>; 3] = [
        (
            "two-actuators",
            FmiVersion::V3,
            &[],
            0,
            Box::new(Predictive::new(PredictiveDesign::default()).unwrap()),
        ),
        (
            "two-actuators",
            FmiVersion::V2,
            &perturbed,
            3,
            Box::new(DecentralisedAdaptive::default()),
        ),
        (
            "two-actuators-estimate",
            FmiVersion::V3,
            &[],
            0,
            Box::new(Predictive::new(estimating).unwrap()),
        ),
    ];
    for (system, fmi, set, plant, mut law) in cases {
        let file = format!("../systems/{system}.toml");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        let request = Request {
            fmi,
            set: set.iter().map(|text| (*text).to_string()).collect(),
            duration_s: Some(8.0),
            ..Request::built_in(path.to_str().unwrap())
        };
        let prepared = prepare(&request).unwrap();
        let outcome = prepared.run(prepared.algorithm).unwrap();
        assert!(
            matches!(outcome.ended, Ended::Complete),
            "{}",
            outcome.ended.message()
        );
        let n = outcome.record.len();
        let native = native(&prepared.motion.acceleration[..n], plant, law.as_mut());
        for (name, native) in [
            ("plant.stroke[1]", &native.stroke[0]),
            ("plant.stroke[2]", &native.stroke[1]),
            ("sensors.measured_stroke[2]", &native.measured[1]),
            ("ahead.stroke[1]", &native.target[0]),
            ("back.found_rotation[3]", &native.fed[1]),
            ("frame.storey_3_translation", &native.motions[4]),
        ] {
            near(
                &format!("{system} {name}"),
                &outcome.record.column(name).unwrap(),
                native,
            );
        }
    }
}

#[test]
fn the_loop_in_fmpy_is_the_run_without_fmi() {
    let ground: Vec<f64> = (0..2048)
        .map(|k| {
            let t = f64::from(k) / 1024.0;
            1.5 * (14.0 * t).sin() * (1.0 - (-t).exp()) + 0.5 * (61.0 * t).sin()
        })
        .collect();
    let mut law = Predictive::new(PredictiveDesign::default()).unwrap();
    let native = native(&ground, 0, &mut law);
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("job.json");
    fs::write(&file, serde_json::json!({ "ground": ground }).to_string()).unwrap();
    let parts = [
        "CoupledActuators",
        "StrokeSensors",
        "PlatformKinematics",
        "FrameSpecimen",
        "FrameSubstructure",
        "CoupledTracking",
    ];
    let packed = pack::all_fmus().unwrap();
    for version in [FmiVersion::V2, FmiVersion::V3] {
        let fmus = packed
            .iter()
            .filter(|fmu| fmu.version == version && parts.contains(&fmu.name.as_str()))
            .map(|fmu| fmu.path.clone());
        let arguments: Vec<PathBuf> = std::iter::once(file.clone()).chain(fmus).collect();
        let printed = python::run_script("fmpy_two_actuators.py", arguments);
        let result = printed
            .lines()
            .find_map(|line| line.strip_prefix("RESULT "))
            .unwrap();
        let through: Vec<Vec<f64>> = serde_json::from_str(result).unwrap();
        near("stroke 1", &through[0], &native.stroke[0]);
        near("stroke 2", &through[1], &native.stroke[1]);
        near("target 2", &through[2], &native.target[1]);
    }
}

/// Normalised error of a displacement, percent.
fn error(wanted: &[f64], got: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
    let left = square(&mut wanted.iter().zip(got).map(|(a, b)| a - b));
    100.0 * (left / square(&mut wanted.iter().copied())).sqrt()
}

/// Without eccentricity each axis has the error of its own run; the eccentric payload changes it.
#[test]
fn the_axes_of_a_biaxial_table_are_coupled_by_the_eccentricity_alone() {
    let played = |request: Request| {
        let request = Request {
            duration_s: Some(15.0),
            scaling: Some(Scaling::Factor(0.45)),
            ..request
        };
        let prepared = prepare(&request).unwrap();
        prepared.run(prepared.algorithm).unwrap().record
    };
    // The second axis has the built-in motion of another seed.
    let alone = [1, 101].map(|seed| {
        let record = played(Request {
            plant: "servohydraulic".into(),
            seed,
            ..Request::built_in("three-variable")
        });
        let column = |name: &str| record.column(name).unwrap();
        error(
            &column("reference.displacement"),
            &column("table.displacement"),
        )
    });
    let system = Path::new(env!("CARGO_MANIFEST_DIR")).join("../systems/biaxial.toml");
    let both = |eccentricity: &str| {
        let record = played(Request {
            set: vec![
                format!("payload.eccentricity_x={eccentricity}"),
                format!("payload.eccentricity_y={eccentricity}"),
            ],
            ..Request::built_in(system.to_str().unwrap())
        });
        let column = |name: &str| record.column(name).unwrap();
        [
            error(
                &column("reference.displacement"),
                &column("table_x.displacement"),
            ),
            error(
                &column("reference.displacement_y"),
                &column("table_y.displacement"),
            ),
        ]
    };
    let (centred, eccentric) = (both("0 in"), both("4 in"));
    for ((alone, together), coupled) in alone.into_iter().zip(centred).zip(eccentric) {
        println!("alone {alone:.3} %, centred {together:.3} %, eccentric {coupled:.3} %");
        assert!((together / alone - 1.0).abs() < 0.1, "{alone} {together}");
        assert!(
            (coupled / together - 1.0).abs() > 1e-3,
            "{together} {coupled}"
        );
    }
}
