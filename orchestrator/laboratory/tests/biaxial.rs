//! The physical rig along two axes: what couples them, and what a run says of each.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use laboratory::run::experiment::{Request, prepare};
use laboratory::run::manifest::Manifest;
use laboratory::run::page;
use laboratory::run::summary::Summary;
use motion::Scaling;
use pages::report::UnitSystem;

const SECONDS: f64 = 6.0;

fn request(plant: &str, set: &[&str]) -> Request {
    Request {
        plant: plant.into(),
        set: set.iter().map(ToString::to_string).collect(),
        duration_s: Some(SECONDS),
        scaling: Some(Scaling::Factor(0.5)),
        ..Request::built_in("three-variable")
    }
}

/// A reference of the built-in motion, so that the other axis rests.
fn reference(folder: &std::path::Path) -> std::path::PathBuf {
    let motion = motion::built_in(1, &motion::Options::default()).unwrap();
    let mut text = "time [s],displacement [m],velocity [m/s],acceleration [m/s2]\n".to_string();
    for k in 0..motion.len() {
        let t = k as f64 * motion.dt;
        let [x, v, a] = [&motion.displacement, &motion.velocity, &motion.acceleration];
        text += &format!("{t},{},{},{}\n", x[k], v[k], a[k]);
    }
    let path = folder.join("reference.csv");
    std::fs::write(&path, text).unwrap();
    path
}

fn summary(request: &Request) -> Summary {
    let prepared = prepare(request).unwrap();
    let outcome = prepared.run(prepared.algorithm).unwrap();
    let plan = (prepared.algorithm, prepared.step, prepared.samples);
    let manifest = Manifest::new(request, &prepared.system, &prepared.motion, plan);
    Summary::new(&prepared, &outcome, &manifest)
}

/// With a centred payload the first axis is the single-axis rig, whose specimen is stepped by another method; the
/// second one has another motion and noise of its own.
#[test]
fn without_eccentricity_the_first_axis_is_the_single_axis_rig() {
    let alone = summary(&request("servohydraulic", &[])).tracking.unwrap();
    let both = summary(&request("biaxial", &[]));
    let [x, y] = &both.axes[..] else {
        panic!("{:?}", both.axes)
    };
    assert_eq!((x.axis.as_str(), y.axis.as_str()), ("x", "y"));
    assert_eq!(
        [&x.motion.name, &y.motion.name],
        ["synthetic-1", "synthetic-101"]
    );
    let own = x.tracking.unwrap();
    assert_eq!(both.tracking, Some(own));
    for (both, alone) in [
        (own.displacement_percent, alone.displacement_percent),
        (own.time_domain_percent, alone.time_domain_percent),
        (own.peak_displacement, alone.peak_displacement),
    ] {
        assert!((both / alone - 1.0).abs() < 1e-3, "{both} {alone}");
    }
    let other = y.tracking.unwrap();
    assert!((other.displacement_percent / own.displacement_percent - 1.0).abs() > 1e-3);
    assert!(
        other.displacement_percent < 5.0,
        "{}",
        other.displacement_percent
    );
}

/// The cross motion of an axis at rest grows with the eccentricity of the payload, beyond what sensors' noise moves.
#[test]
fn an_axis_at_rest_is_moved_by_the_eccentricity() {
    let place = tempfile::tempdir().unwrap();
    let at_rest = |set: &[&str]| {
        let request = Request {
            reference: Some(reference(place.path())),
            ..request("biaxial", set)
        };
        let [x, y] = &summary(&request).axes[..] else {
            panic!("two axes")
        };
        assert!(x.tracking.is_some() && x.at_rest.is_none());
        assert!(y.tracking.is_none() && y.motion.name == "rest");
        y.at_rest.unwrap().displacement_percent
    };
    let centred = at_rest(&[]);
    let eccentric = at_rest(&[
        "specimen.eccentricity_x=8 in",
        "specimen.eccentricity_y=8 in",
    ]);
    assert!(eccentric > 1.5 * centred, "{centred} {eccentric}");
}

/// A page made again from the files draws what the first one drew.
#[test]
fn the_page_has_both_axes_and_can_be_made_again() {
    let place = tempfile::tempdir().unwrap();
    let request = Request {
        duration_s: Some(3.0),
        ..request("biaxial", &[])
    };
    laboratory::run::perform(&request, &laboratory::results::Out::new(place.path())).unwrap();
    let page = page::page_again(place.path(), UnitSystem::Us).unwrap();
    let headings: Vec<&str> = page
        .sections
        .iter()
        .map(|own| own.heading.as_str())
        .collect();
    assert_eq!(
        headings,
        [
            "Both axes",
            "Along x: time histories",
            "Along x: in frequency",
            "Along x: the valve",
            "Along y: time histories",
            "Along y: in frequency",
            "Along y: the valve",
            "The motions",
            "The run",
        ]
    );
    assert!(
        page.title.ends_with("on synthetic-1 and synthetic-101"),
        "{}",
        page.title
    );
    let written = std::fs::read_to_string(place.path().join("report.html")).unwrap();
    assert!(written.contains("Along y: in frequency"));
}

#[test]
fn a_second_motion_needs_a_second_axis() {
    let request = Request {
        record: Some("x.AT2".into()),
        record_y: Some("y.AT2".into()),
        ..request("servohydraulic", &[])
    };
    let message = prepare(&request).err().unwrap().to_string();
    assert!(
        message.contains("--record-y") && message.contains("--plant biaxial"),
        "{message}"
    );
    let request = Request {
        structure: Some("two-storeys".into()),
        ..Request {
            plant: "biaxial".into(),
            ..Request::built_in("three-variable")
        }
    };
    let message = prepare(&request).err().unwrap().to_string();
    assert!(
        message.contains("a computed structure has a single axis"),
        "{message}"
    );
}
