//! Hybrid simulation on the shake table: two computed storeys and one that stands on the table, beside
//! the same three storeys as one model.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use fmi_import::FmiVersion;
use fmi_master::Ended;
use hybrid::vrths::{Frame, ReferenceFrame};
use laboratory::run::experiment::{Request, prepare};
use laboratory::run::summary::asked;
use motion::Scaling;
use nalgebra::{DMatrix, DVector};
use plant::specimens::linear::LinearSpecimen;

const PERIOD: f64 = 0.002;

/// Storeys of 60 kg on 56 kN/m and 180 N s/m, the specimen on top.
fn whole() -> Frame {
    let specimen = LinearSpecimen::appendix_a();
    let chain = |each: f64, top: f64| {
        DMatrix::from_row_slice(
            3,
            3,
            &[
                2.0 * each,
                -each,
                0.0,
                -each,
                each + top,
                -top,
                0.0,
                -top,
                top,
            ],
        )
    };
    Frame {
        mass: DMatrix::from_diagonal(&DVector::from_vec(vec![60.0, 60.0, specimen.mass])),
        damping: chain(180.0, specimen.damping),
        stiffness: chain(56e3, specimen.stiffness),
    }
}

struct Errors {
    /// Upper computed storey and drift of the specimen, beside the whole structure: rms error over
    /// rms.
    storey: f64,
    drift: f64,
    /// Without what the specimen gives back.
    storey_alone: f64,
}

fn errors(controller: &str, plant: &str, fmi: FmiVersion, set: &[String]) -> Errors {
    let request = Request {
        structure: Some("two-storeys".to_string()),
        plant: plant.to_string(),
        duration_s: Some(20.0),
        set: set.to_vec(),
        scaling: Some(Scaling::PeakAcceleration(1.0)),
        fmi,
        ..Request::built_in(controller)
    };
    let prepared = prepare(&request).unwrap();
    let outcome = prepared.run(prepared.algorithm).unwrap();
    assert!(
        matches!(outcome.ended, Ended::Complete),
        "{}",
        outcome.ended.message()
    );
    let record = &outcome.record;
    let column = |name: &str| record.column(name).unwrap();
    let (upper, drift) = (
        column("structure.displacement[2]"),
        column("specimen.drift"),
    );
    let wanted = asked(record, &prepared.motion).unwrap();
    let ground = column("reference.displacement");
    if set.is_empty() {
        for (k, displacement) in wanted.displacement.iter().enumerate() {
            assert!((displacement - ground[k] - upper[k]).abs() < 1e-12);
        }
    }

    let frame = whole();
    let lower = |matrix: &DMatrix<f64>| matrix.view((0, 0), (2, 2)).into_owned();
    let alone = Frame {
        mass: lower(&frame.mass),
        damping: DMatrix::from_row_slice(2, 2, &[360.0, -180.0, -180.0, 180.0]),
        stiffness: DMatrix::from_row_slice(2, 2, &[112e3, -56e3, -56e3, 56e3]),
    };
    let mut whole = ReferenceFrame::new(&frame, PERIOD).unwrap();
    let mut alone = ReferenceFrame::new(&alone, PERIOD).unwrap();
    let acceleration = column("reference.acceleration");
    let (mut sums, mut sizes) = ([0.0; 3], [0.0; 2]);
    for k in 0..record.len() {
        let (storey, top) = (
            whole.displacement(1),
            whole.displacement(2) - whole.displacement(1),
        );
        sums[0] += (upper[k] - storey).powi(2);
        sums[1] += (drift[k] - top).powi(2);
        sums[2] += (alone.displacement(1) - storey).powi(2);
        sizes[0] += storey * storey;
        sizes[1] += top * top;
        if k + 1 < record.len() {
            whole.step(acceleration[k], acceleration[k + 1]);
            alone.step(acceleration[k], acceleration[k + 1]);
        }
    }
    Errors {
        storey: (sums[0] / sizes[0]).sqrt(),
        drift: (sums[1] / sizes[1]).sqrt(),
        storey_alone: (sums[2] / sizes[0]).sqrt(),
    }
}

#[test]
fn the_storeys_on_and_under_the_table_move_as_the_whole_structure() {
    let mpc = errors("mpc", "identified", FmiVersion::V3, &[]);
    println!("mpc: {} {}", mpc.storey, mpc.drift);
    println!("without the specimen's force: {}", mpc.storey_alone);
    assert!(mpc.storey_alone > 0.5);
    assert!(mpc.storey < 0.03 && mpc.drift < 0.06);
    let again = errors("mpc", "identified", FmiVersion::V2, &[]);
    assert_eq!(mpc.storey, again.storey);
    // What the table misses is missing in the structure, too.
    let plain = errors("displacement-pid", "identified", FmiVersion::V3, &[]);
    println!("displacement-pid: {} {}", plain.storey, plain.drift);
    assert!(plain.drift > 3.0 * mpc.drift);
}

#[test]
fn on_the_physical_rig_the_sensors_give_the_force_and_a_lead_makes_up_for_their_lag() {
    let [at_once, led] = ["0 ms", "10 ms"].map(|lead| {
        let set = [format!("structure.lead={lead}")];
        let sliding = errors("sliding-mode", "servohydraulic", FmiVersion::V3, &set);
        println!(
            "sliding-mode, servohydraulic, lead {lead}: {} {}",
            sliding.storey, sliding.drift
        );
        sliding
    });
    assert!(at_once.storey < 0.5 * at_once.storey_alone);
    assert!(led.storey < 0.1 && led.drift < 0.06);
    assert!(led.storey < 0.6 * at_once.storey);
}
