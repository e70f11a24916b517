//! What clients that speak the protocol are answered.

use std::io::Write;
use std::time::Duration;

use bridges::element::{Ideal, Interval, Matrices, Moves, Shape};
use bridges::protocol::{Action, Matrix, Quantities, Sizes};
use bridges::{Admission, Client};
use proptest::prelude::*;

use super::*;

const LIMIT: Duration = Duration::from_secs(10);

/// A step of the analysis, s.
const DT: f64 = 0.01;

fn client(served: &Served) -> Client {
    Client::connect(served.address, sizes(), LIMIT).unwrap()
}

/// A trial with one displacement as OpenSees sends it, and the force.
fn force(client: &mut Client, displacement: f64, time: f64) -> f64 {
    client
        .send(Action::SetTrial, &[displacement, 0.0, 0.0, time])
        .unwrap();
    client.ask(Action::GetForce).unwrap()[0]
}

/// The calls of a compiled client: a trial, its force, a commit, over and over.
#[test]
fn a_thousand_steps_with_trials_taken_back_are_those_of_the_spring_alone() {
    let yields_at = 50.0;
    let served = Served::by(
        move || {
            let springs = Springs::new(1, yields_at);
            Ideal::new(springs, Interval::default(), Shape::Ramp, matrices()).unwrap()
        },
        quick(),
    );
    let mut client = client(&served);
    for action in [Action::Open, Action::SetUp] {
        client.send(action, &[]).unwrap();
    }
    assert_eq!(force(&mut client, 0.0, 0.0), 0.0);
    let stiffness = client.ask(Action::GetMatrix(Matrix::InitialStiffness));
    assert_eq!(stiffness.unwrap()[0], STIFFNESS);
    assert_eq!(client.ask(Action::GetMatrix(Matrix::Mass)).unwrap()[0], 0.0);
    let mut plastic = 0.0;
    let (mut worst, mut yielded): (f64, f64) = (0.0, 0.0);
    for k in 1..=1000 {
        let time = DT * f64::from(k);
        let wanted = 0.04 * (3.0 * time).sin();
        // Trials that overshoot far into yielding must leave no trace.
        for trial in [wanted + 0.3, wanted - 0.3, 0.0] {
            let expected = Springs::force(trial, &mut plastic.clone(), yields_at);
            worst = worst.max((force(&mut client, trial, time) - expected).abs());
        }
        let answer = force(&mut client, wanted, time);
        worst = worst.max((answer - Springs::force(wanted, &mut plastic, yields_at)).abs());
        client.send(Action::Commit, &[]).unwrap();
        yielded = yielded.max(plastic.abs());
    }
    client.send(Action::End, &[]).unwrap();
    let ending = served.ending();
    assert!(ending.error.is_none(), "{:?}", ending.error);
    assert_eq!(ending.served.steps, 1000);
    assert_eq!(ending.served.trials, 4001);
    assert!(yielded > 0.01, "{yielded}");
    assert!(worst < 1e-12 * yields_at, "{worst}");
}

#[test]
fn a_laboratory_controller_makes_a_step_of_every_command() {
    let every = Quantities {
        displacement: 2,
        velocity: 2,
        acceleration: 2,
        force: 2,
        time: 1,
    };
    let sizes = Sizes {
        trial: Quantities {
            displacement: 2,
            ..Quantities::default()
        },
        wanted: every,
        length: 64,
    };
    let served = Served::by(
        || {
            let interval = Interval {
                fixed: Some(DT),
                scale: 1.0,
            };
            let springs = Springs::new(2, 1e9);
            let moves = Moves::AtTrials { iterations: 1 };
            Stepwise::new(springs, interval, Shape::Ramp, moves, Matrices::default())
        },
        quick(),
    );
    let mut client = Client::connect(served.address, sizes, LIMIT).unwrap();
    for k in 1..=50 {
        let x = 1e-3 * f64::from(k);
        client.send(Action::SetTrial, &[x, -x]).unwrap();
        let measured = client.ask(Action::GetMeasured).unwrap();
        assert_eq!(measured[..2], [x, -x]);
        assert_eq!(measured[6..8], [STIFFNESS * x, -STIFFNESS * x]);
        assert!((measured[8] - DT * f64::from(k)).abs() < 1e-12);
        // Asking again changes nothing.
        let again = client.ask(Action::GetMeasured).unwrap();
        assert_eq!(again[0], x);
    }
    client.send(Action::End, &[]).unwrap();
    let ending = served.ending();
    assert!(ending.error.is_none());
    assert_eq!(ending.served.steps, 50);
}

#[test]
fn a_rig_moves_once_a_step_and_refuses_to_move_back() {
    let served = Served::by(|| stepwise(Moves::AtTrials { iterations: 1 }), quick());
    let mut client = client(&served);
    // Where the model is; then a step that begins where the last ended, as `Newmark` does.
    assert_eq!(force(&mut client, 0.0, 0.0), 0.0);
    assert_eq!(force(&mut client, 0.0, DT), 0.0);
    assert_eq!(force(&mut client, 0.001, DT), 0.001 * STIFFNESS);
    assert_eq!(force(&mut client, 0.001, DT), 0.001 * STIFFNESS);
    client.send(Action::Commit, &[]).unwrap();
    assert_eq!(force(&mut client, 0.003, 2.0 * DT), 0.003 * STIFFNESS);
    client
        .send(Action::SetTrial, &[0.0031, 0.0, 0.0, 2.0 * DT])
        .unwrap();
    is_dismissed(client, Action::GetForce);
    let ending = served.ending();
    let said = ending.error.unwrap().to_string();
    assert!(
        said.contains("in step 2") && said.contains("from 0.003 m to 0.0031 m"),
        "{said}"
    );
    for suits in [
        "AlphaOS",
        "NewmarkHSFixedNumIter",
        "--iterations",
        "--mode ideal",
    ] {
        assert!(said.contains(suits), "{said}");
    }
    assert_eq!(ending.served.steps, 1);
}

#[test]
fn a_fixed_number_of_iterations_shares_the_interval_out() {
    let served = Served::by(|| stepwise(Moves::AtTrials { iterations: 5 }), quick());
    let mut wanting_time = sizes();
    wanting_time.wanted.time = 1;
    let mut client = Client::connect(served.address, wanting_time, LIMIT).unwrap();
    force(&mut client, 0.0, 0.0);
    for k in 1..=20 {
        let (last, next) = (1e-3 * f64::from(k - 1), 1e-3 * f64::from(k));
        for part in 1..=5 {
            let trial = last + (next - last) * f64::from(part) / 5.0;
            assert_eq!(
                force(&mut client, trial, DT * f64::from(k)),
                STIFFNESS * trial
            );
            let time = client.ask(Action::GetTime).unwrap()[0];
            let expected = DT * (f64::from(k - 1) + f64::from(part) / 5.0);
            assert!((time - expected).abs() < 1e-12, "{time} {expected}");
        }
        client.send(Action::Commit, &[]).unwrap();
    }
    client.send(Action::End, &[]).unwrap();
    assert!(served.ending().error.is_none());
}

#[test]
fn a_rig_that_moves_at_the_commit_answers_with_the_last_force() {
    let served = Served::by(|| stepwise(Moves::AtCommit), quick());
    let mut client = client(&served);
    force(&mut client, 0.0, 0.0);
    for k in 1..=10 {
        let last = STIFFNESS * (1e-3 * f64::from(k - 1));
        // However often it changes its mind.
        assert_eq!(force(&mut client, 5.0, DT * f64::from(k)), last);
        assert_eq!(
            force(&mut client, 1e-3 * f64::from(k), DT * f64::from(k)),
            last
        );
        client.send(Action::Commit, &[]).unwrap();
    }
    client.send(Action::End, &[]).unwrap();
    let ending = served.ending();
    assert!(ending.error.is_none());
    assert_eq!(ending.served.steps, 10);
}

#[test]
fn the_same_over_udp() {
    let served = Served::ideal();
    let mut client = Client::connect_udp(served.address, sizes(), LIMIT).unwrap();
    force(&mut client, 0.0, 0.0);
    for k in 1..=100 {
        let x = 1e-4 * f64::from(k);
        let answer = force(&mut client, x, DT * f64::from(k));
        assert!((answer - STIFFNESS * x).abs() < 1e-12);
        client.send(Action::Commit, &[]).unwrap();
    }
    client.send(Action::End, &[]).unwrap();
    let ending = served.ending();
    assert!(ending.error.is_none(), "{:?}", ending.error);
    assert_eq!(ending.served.steps, 100);
}

/// A vector as it goes over the wire.
fn vector(values: &[f64]) -> Vec<u8> {
    let mut all = vec![0.0; 256];
    all[..values.len()].copy_from_slice(values);
    all.iter().flat_map(|value| value.to_le_bytes()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the pieces and the pauses between them, the answers are the same.
    #[test]
    fn pieces_make_the_same_conversation(cuts in prop::collection::vec(1_usize..3000, 1..12), pause in 0_u64..3) {
        let served = Served::by(ideal, Admission::default());
        let mut wire = sizes().bytes().to_vec();
        let trials = [0.001, -0.02, 0.5];
        for (k, x) in trials.iter().enumerate() {
            wire.extend(vector(&[3.0, *x, 0.0, 0.0, DT * (k + 1) as f64]));
            wire.extend(vector(&[10.0]));
            wire.extend(vector(&[5.0]));
        }
        wire.extend(vector(&[99.0]));
        let mut stream = served.raw();
        let reader = stream.try_clone().unwrap();
        let answers = std::thread::spawn(move || {
            let mut reader = reader;
            let mut bytes = Vec::new();
            let _ = reader.read_to_end(&mut bytes);
            bytes
        });
        let mut rest = &wire[..];
        for cut in cuts.iter().cycle() {
            let (piece, others) = rest.split_at((*cut).min(rest.len()));
            stream.write_all(piece).unwrap();
            rest = others;
            if rest.is_empty() {
                break;
            }
            std::thread::sleep(Duration::from_millis(pause));
        }
        let bytes = answers.join().unwrap();
        prop_assert_eq!(bytes.len(), trials.len() * 256 * 8);
        for (reply, x) in bytes.chunks_exact(256 * 8).zip(trials) {
            let mut first = [0; 8];
            first.copy_from_slice(&reply[..8]);
            prop_assert!((f64::from_le_bytes(first) - STIFFNESS * x).abs() < 1e-9);
        }
        let ending = served.ending();
        prop_assert!(ending.error.is_none());
        prop_assert_eq!(ending.served.steps, trials.len());
    }
}
