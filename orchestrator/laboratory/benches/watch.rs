//! What `run --watch` costs the steps: the physical rig under three-variable control, alone, with the signals
//! of the page kept, and with a page that asks for them as ours does, by turns. The least and
//! the median time of a step over the runs, and what watching adds to each.
//! `cargo bench -p laboratory --bench watch`

#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a benchmark that cannot go on has failed"
)]

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fmi_master::{Algorithm, Pace};
use laboratory::run::experiment::{Prepared, Request, prepare};
use pages::live::{Scene, Server, Tap};
use pages::report::UnitSystem;

const SECONDS: f64 = 10.0;
const RUNS: usize = 31;
/// The run goes some hundred times faster than real time, and so is asked: the page asks ten times a second.
const POLL: Duration = Duration::from_millis(1);

#[derive(Clone, Copy, PartialEq)]
enum Watched {
    No,
    Kept,
    Read,
}

/// Asks for the rows that are new until it is asked to stop; returns how often it asked.
fn reader(address: &str, token: &str, stop: &AtomicBool) -> usize {
    let (mut from, mut asked) = (0, 0);
    while !stop.load(Ordering::Relaxed) {
        let mut stream = TcpStream::connect(address).unwrap();
        let request = format!("GET /{token}/rows?from={from} HTTP/1.1\r\nHost: {address}\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        // A bracket a row, and one for all.
        from += answer.matches('[').count().saturating_sub(1);
        asked += 1;
        std::thread::sleep(POLL);
    }
    asked
}

/// Time of a step, s.
fn run(prepared: &Prepared, watched: Watched) -> f64 {
    let mut simulation = prepared.simulation(Algorithm::GaussSeidel).unwrap();
    let mut server = None;
    if watched != Watched::No {
        let (scene, places) = Scene::new(prepared.shown(), simulation.names(), UnitSystem::Us);
        let tap = Arc::new(Tap::new(places, prepared.samples));
        simulation.watch(tap.clone());
        if watched == Watched::Read {
            server = Some(Server::start(&scene, tap, None, 0).unwrap());
        }
    }
    let url = server.as_ref().map(Server::url);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let asking = url.as_deref().map(|url| {
            let place = url.trim_start_matches("http://").trim_end_matches('/');
            let (address, token) = place.split_once('/').unwrap();
            let stop = &stop;
            scope.spawn(move || reader(address, token, stop))
        });
        let begun = Instant::now();
        simulation.run(prepared.samples, Pace::Fastest, &mut |_| {});
        let elapsed = begun.elapsed().as_secs_f64();
        stop.store(true, Ordering::Relaxed);
        if let Some(asking) = asking {
            assert!(asking.join().unwrap() > 0);
        }
        elapsed / prepared.samples as f64
    })
}

fn main() {
    let prepared = prepare(&Request {
        plant: "servohydraulic".into(),
        specimen: "yielding".into(),
        duration_s: Some(SECONDS),
        ..Request::built_in("three-variable")
    })
    .unwrap();
    let ways = [
        ("not watched", Watched::No),
        ("signals kept", Watched::Kept),
        ("page that asks", Watched::Read),
    ];
    let mut times: [Vec<f64>; 3] = Default::default();
    for _ in 0..RUNS {
        for ((_, watched), own) in ways.iter().zip(&mut times) {
            own.push(run(&prepared, *watched));
        }
    }
    times.iter_mut().for_each(|own| own.sort_by(f64::total_cmp));
    println!("a step of 2 ms takes, in us (least, median of {RUNS} runs of {SECONDS} s):");
    for ((name, _), own) in ways.iter().zip(&times) {
        let [least, median] = [0, RUNS / 2].map(|n| 1e6 * own[n]);
        let [more, usual] = [0, RUNS / 2].map(|n| 1e6 * (own[n] - times[0][n]));
        println!("{name:<16}{least:8.3}{median:8.3}   watching adds {more:+.3}{usual:+8.3}");
    }
}
