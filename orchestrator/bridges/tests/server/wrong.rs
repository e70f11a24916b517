//! What clients that do it wrong are told, and that nobody waits for ever.

use std::io::Write;
use std::time::{Duration, Instant};

use bridges::element::Moves;
use bridges::protocol::{Action, Matrix};
use bridges::{Admission, Client};

use super::*;

const LIMIT: Duration = Duration::from_secs(10);

/// A client with a step behind it, of which whatever follows must leave the count.
fn with_a_step(served: &Served) -> Client {
    let mut client = Client::connect(served.address, sizes(), LIMIT).unwrap();
    client
        .send(Action::SetTrial, &[0.001, 0.0, 0.0, 0.01])
        .unwrap();
    assert!(client.ask(Action::GetForce).unwrap()[0] > 0.0);
    client.send(Action::Commit, &[]).unwrap();
    client
}

fn raw_with_sizes(served: &Served) -> TcpStream {
    let mut stream = served.raw();
    stream.write_all(&sizes().bytes()).unwrap();
    stream
}

fn wait_for(served: &Served, word: &str) {
    let limit = Instant::now() + LIMIT;
    while Instant::now() < limit {
        match served.said.recv_timeout(Duration::from_millis(100)) {
            Ok(line) if line.contains(word) => return,
            _ => {}
        }
    }
    panic!("`{word}` was not said");
}

#[test]
fn what_is_no_client_is_told_why_and_the_next_is_served() {
    let served = Served::ideal();
    let mut browser = served.raw();
    browser
        .write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: text/html\r\n\r\n")
        .unwrap();
    assert!(read_all(browser).contains("HTTP request"));
    wait_for(&served, "HTTP request");
    // Shorter than the sizes, and then silent.
    let mut short = served.raw();
    short.write_all(b"GET / HTTP/1.0\r\n\r\n").unwrap();
    assert!(read_all(short).contains("HTTP request"));
    let mut trial_first = served.raw();
    trial_first.write_all(&3_f64.to_le_bytes()).unwrap();
    trial_first.write_all(&[0; 2040]).unwrap();
    assert!(read_all(trial_first).contains("before the setup"));
    let mut two = sizes();
    two.trial.displacement = 2;
    let mut other = served.raw();
    other.write_all(&two.bytes()).unwrap();
    assert!(read_all(other).contains("has 2 of displacement, but the system served has 1"));
    drop(served.raw());
    let silent = served.raw();
    assert!(read_all(silent).contains("silent for 0.4 s"));
    with_a_step(&served).send(Action::End, &[]).unwrap();
    let ending = served.ending();
    assert!(ending.error.is_none(), "{:?}", ending.error);
    assert_eq!(ending.served.steps, 1);
}

#[test]
fn a_second_client_is_told_and_the_first_is_not_disturbed() {
    let served = Served::ideal();
    let mut first = with_a_step(&served);
    assert!(read_all(served.raw()).contains("one at a time"));
    first
        .send(Action::SetTrial, &[0.002, 0.0, 0.0, 0.02])
        .unwrap();
    assert_eq!(first.ask(Action::GetForce).unwrap()[0], 0.002 * STIFFNESS);
    first.send(Action::End, &[]).unwrap();
    assert!(served.ending().error.is_none());
}

#[test]
fn a_thousand_connections_end_and_the_client_is_served() {
    let served = Served::ideal();
    let mut client = with_a_step(&served);
    let mut told = 0;
    for _ in 0..10 {
        let all: Vec<TcpStream> = (0..100).map(|_| served.raw()).collect();
        told += all
            .into_iter()
            .map(read_all)
            .filter(|word| word.contains("one at a time"))
            .count();
        client
            .send(Action::SetTrial, &[0.002, 0.0, 0.0, 0.02])
            .unwrap();
        assert!(client.ask(Action::GetForce).unwrap()[0] > 0.0);
    }
    assert_eq!(told, 1000);
    client.send(Action::End, &[]).unwrap();
    assert!(served.ending().error.is_none());
}

#[test]
fn wrong_messages_end_the_session_with_a_reason_and_keep_the_count() {
    /// What a client sends, and what is said of it.
    type Case = (&'static [f64], &'static str);
    let cases: [Case; 5] = [
        (
            &[3.0, f64::NAN, 0.0, 0.0, 0.02],
            "displacement of a trial is NaN",
        ),
        (
            &[3.0, 0.1, f64::INFINITY, 0.0, 0.02],
            "velocity of a trial is inf",
        ),
        (&[17.0], "17, which is not an action"),
        (&[3.5, 0.1], "3.5, which is not an action"),
        (&[f64::NAN], "NaN, which is not an action"),
    ];
    for (wrong, said) in cases {
        let served = Served::ideal();
        drop(with_vector(&served, wrong));
        let ending = served.ending();
        let error = ending.error.unwrap().to_string();
        assert!(error.contains(said), "{error}");
        assert_eq!(ending.served.steps, 1);
    }
}

/// Leaves a raw vector behind a good step.
fn with_vector(served: &Served, values: &[f64]) -> TcpStream {
    let mut stream = raw_with_sizes(served);
    let mut send = |values: &[f64]| {
        let mut all = vec![0.0; 256];
        all[..values.len()].copy_from_slice(values);
        let bytes: Vec<u8> = all.iter().flat_map(|value| value.to_le_bytes()).collect();
        stream.write_all(&bytes).unwrap();
    };
    send(&[3.0, 0.001, 0.0, 0.0, 0.01]);
    send(&[5.0]);
    send(values);
    stream
}

#[test]
fn half_a_vector_and_a_peer_that_goes_are_told_apart() {
    let served = Served::ideal();
    let mut stream = with_vector(&served, &[1.0]);
    stream.write_all(&[0; 1000]).unwrap();
    drop(stream);
    let ending = served.ending();
    let said = ending.error.unwrap().to_string();
    assert!(said.contains("1000 of 2048 bytes"), "{said}");
    assert_eq!(ending.served.steps, 1);

    let served = Served::ideal();
    drop(with_vector(&served, &[1.0]));
    let said = served.error();
    assert!(said.contains("the peer closed the connection"), "{said}");
}

#[test]
fn a_silent_peer_is_left_after_the_time_limit() {
    for half in [0, 7] {
        let served = Served::ideal();
        let mut stream = with_vector(&served, &[1.0]);
        stream.write_all(&vec![0; half]).unwrap();
        let begun = Instant::now();
        let said = served.error();
        assert!(said.contains("silent for 0.4 s"), "{said}");
        assert!(said.contains(&format!("({half} of 2048")), "{said}");
        assert!(begun.elapsed() < Duration::from_secs(5));
        drop(stream);
    }
}

#[test]
fn a_matrix_that_nobody_knows_is_asked_for_by_name() {
    let served = Served::by(
        || {
            let springs = Springs::new(1, 1e9);
            Ideal::new(
                springs,
                Interval::default(),
                Shape::Ramp,
                Matrices::default(),
            )
            .unwrap()
        },
        quick(),
    );
    let client = with_a_step(&served);
    is_dismissed(client, Action::GetMatrix(Matrix::InitialStiffness));
    let said = served.error();
    assert!(
        said.contains("initial stiffness") && said.contains("--stiffness"),
        "{said}"
    );
}

#[test]
fn steps_that_the_rig_has_no_time_for_are_refused() {
    let served = Served::by(|| stepwise(Moves::AtTrials { iterations: 1 }), quick());
    let mut client = Client::connect(served.address, sizes(), LIMIT).unwrap();
    client
        .send(Action::SetTrial, &[0.001, 0.0, 0.0, 0.0031])
        .unwrap();
    is_dismissed(client, Action::GetForce);
    let said = served.error();
    assert!(
        said.contains("0.0031 s") && said.contains("a whole number"),
        "{said}"
    );

    let served = Served::by(|| stepwise(Moves::AtTrials { iterations: 1 }), quick());
    let mut no_time = sizes();
    no_time.trial.time = 0;
    let mut client = Client::connect(served.address, no_time, LIMIT).unwrap();
    client.send(Action::SetTrial, &[0.001]).unwrap();
    is_dismissed(client, Action::GetForce);
    let said = served.error();
    assert!(
        said.contains("the client sends no time") && said.contains("--interval"),
        "{said}"
    );
}

#[test]
fn a_port_in_use_and_an_open_one_are_refused() {
    let taken = Server::bind(([127, 0, 0, 1], 0).into(), Admission::default()).unwrap();
    let again = Server::bind(taken.address(), Admission::default());
    let said = again.err().unwrap().to_string();
    assert!(said.contains(&taken.address().to_string()), "{said}");
    let open = Server::bind(([0, 0, 0, 0], 0).into(), Admission::default());
    let said = open.err().unwrap().to_string();
    assert!(said.contains("--allow"), "{said}");
}
