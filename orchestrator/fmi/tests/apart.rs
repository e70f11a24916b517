//! Instances in another process, which is this program again.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[allow(dead_code, reason = "the other tests need more")]
#[path = "compiled/made.rs"]
mod made;

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use fmi_import::{
    CallError, Datum, Diverted, FmiVersion, Fmu, Instance, Isolation, Kind, Linear, Options,
    Processes, Progress, State, Wire, isolation,
};
use made::{
    BOTH, COUNT, EARLY, FLOOR, GAIN, PAIR, SLOPE, U, X, Y, answer, begin, exchanged, one, set,
    stepped, texts, value,
};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [isolation::COMMAND, frame] = *arguments.iter().map(String::as_str).collect::<Vec<_>>() {
        return isolation::guest(Path::new(frame));
    }
    if let ["print"] = *arguments.iter().map(String::as_str).collect::<Vec<_>>() {
        return print();
    }
    for (name, test) in [
        ("values_and_steps", values_and_steps as fn()),
        ("model_exchange_and_events", model_exchange_and_events),
        (
            "settings_travel_with_the_next_call",
            settings_travel_with_the_next_call,
        ),
        ("steps_travel_together", steps_travel_together),
        (
            "what_is_foreseen_travels_along",
            what_is_foreseen_travels_along,
        ),
        ("wires_lead_from_step_to_step", wires_lead_from_step_to_step),
        (
            "a_step_among_others_that_fails_is_that_of_its_instance",
            a_step_among_others_that_fails_is_that_of_its_instance,
        ),
        (
            "what_an_fmu_prints_is_its_message",
            what_an_fmu_prints_is_its_message,
        ),
        (
            "refusals_are_those_of_their_calls",
            refusals_are_those_of_their_calls,
        ),
        (
            "what_is_printed_meanwhile_goes_to_the_standard_error",
            what_is_printed_meanwhile_goes_to_the_standard_error,
        ),
        (
            "the_end_of_the_process_is_an_error",
            the_end_of_the_process_is_an_error,
        ),
    ] {
        println!("test {name}");
        test();
    }
    ExitCode::SUCCESS
}

/// How FMUs are run in another process.
fn options() -> Options {
    Options {
        isolation: Isolation::All,
        guest: Some(std::env::current_exe().unwrap()),
        ..made::logged()
    }
}

/// Instances in one other process, which are initialized.
fn together<const N: usize>(fmu: &Arc<Fmu>) -> [Instance; N] {
    let options = options();
    let mut processes = Processes::new(&options);
    std::array::from_fn(|number| {
        let name = format!("part_{number}");
        let mut own = Instance::within(fmu, &name, &mut processes, false).unwrap();
        begin(&mut own, &[]);
        own
    })
}

fn apart(fmu: &Arc<Fmu>) -> Instance {
    let [own] = together(fmu);
    own
}

fn values_and_steps() {
    let mut own = apart(&stepped(
        FmiVersion::V3,
        r#"providesDirectionalDerivatives="true" canSerializeFMUState="true""#,
        "",
    ));
    assert!(own.is_apart() && own.process().is_some());
    own.set(&Kind::Float64, &[U, PAIR], &[1.5, 7.0, -8.0])
        .unwrap();
    let mut all = [0.0; 3];
    own.get(&Kind::Float64, &[PAIR, Y], &mut all).unwrap();
    assert_eq!(all, [7.0, -8.0, 3.0]);
    for (kind, reference, value) in [
        (Kind::Int8, 20, -128.0),
        (Kind::UInt16, 51, 65535.0),
        (Kind::Float32, 10, -1.5),
        (Kind::Boolean, 120, 1.0),
        (Kind::Boolean, 120, 0.0),
    ] {
        own.set(&kind, &[reference], &[value]).unwrap();
        assert_eq!(one(&mut own, &kind, reference), value);
    }
    for (kind, reference, datum) in [
        (Kind::UInt64, 90, Datum::Unsigned(u64::MAX)),
        (Kind::String, 100, Datum::Text("\u{e9}".into())),
        (Kind::Binary, 110, Datum::Bytes(vec![0, 255])),
    ] {
        let mut read = [Datum::Number(0.0)];
        own.set_exact(&kind, &[reference], std::slice::from_ref(&datum))
            .unwrap();
        own.get_exact(&kind, &[reference], &mut read).unwrap();
        assert_eq!(read, [datum]);
    }
    let three = ["first", "", "the third"].map(|text| Datum::Text(text.into()));
    own.set_exact(&Kind::String, &[101, 100, 101], &three)
        .unwrap();
    let mut read = three.clone();
    own.get_exact(&Kind::String, &[100, 101, 100], &mut read)
        .unwrap();
    assert_eq!(read, [1, 2, 1].map(|at| three[at].clone()));
    let mut changes = [0.0; 2];
    let given = own.derivative((&[Y, SLOPE], &mut changes), (&[U, X], &[3.0, 5.0]));
    assert!(given.unwrap());
    assert_eq!(changes, [6.0, -5.0]);

    assert_eq!(own.do_step(0.0, 0.5).unwrap(), Progress::Whole);
    let mut state = State::default();
    own.save_state(&mut state).unwrap();
    own.do_step(0.5, 0.5).unwrap();
    assert!((value(&mut own, X) - (-1.0_f64).exp()).abs() < 1e-15);
    own.restore_state(&state).unwrap();
    assert_eq!(value(&mut own, X), (-0.5_f64).exp());
    let bytes = own.state_as_bytes(&state).unwrap();
    let read = own.state_of_bytes(&bytes).unwrap();
    own.do_step(0.5, 0.5).unwrap();
    own.restore_state(&read).unwrap();
    assert_eq!(value(&mut own, X), (-0.5_f64).exp());
    own.free_state(state).unwrap();
    own.take_messages();
    own.close();
    assert_eq!(texts(&own), ["Terminate", "FreeInstance"]);
}

fn model_exchange_and_events() {
    let events = r#"hasEventMode="true" canHandleVariableCommunicationStepSize="true""#;
    for fmu in [
        exchanged(FmiVersion::V2, r#"providesDirectionalDerivative="true""#),
        exchanged(FmiVersion::V3, ""),
        stepped(FmiVersion::V3, events, ""),
    ] {
        let mut processes = options();
        processes.log_categories = None;
        let mut own = Instance::new(&fmu, "own", &processes).unwrap();
        begin(&mut own, &[(FLOOR, 0.5)]);
        own.do_step(0.0, 1.0).unwrap();
        let x = (std::f64::consts::LN_2 - 1.0).exp();
        assert!((value(&mut own, X) - x).abs() < 1e-7);
        assert_eq!(one(&mut own, &Kind::Int32, COUNT), 1.0);
    }
}

fn settings_travel_with_the_next_call() {
    let mut own = apart(&stepped(FmiVersion::V3, "", ""));
    let begun = own.exchanges();
    set(&mut own, U, 4.0);
    set(&mut own, GAIN, 0.5);
    assert!(!own.is_settled());
    assert_eq!(own.exchanges(), begun);
    assert_eq!(value(&mut own, Y), 2.0);
    assert!(own.is_settled());
    assert_eq!(own.exchanges(), begun + 1);
    // What is read after a step is read along with the next ones.
    for at in 0..4 {
        let before = own.exchanges();
        own.do_step(f64::from(at), 1.0).unwrap();
        let x = value(&mut own, X);
        assert!((x - (-f64::from(at) - 1.0).exp()).abs() < 1e-12);
        let expected = if at == 0 { 2 } else { 1 };
        assert_eq!(own.exchanges() - before, expected);
    }
}

fn steps_travel_together() {
    let mut all: [Instance; 3] = together(&stepped(FmiVersion::V2, "", ""));
    let process = all[0].process();
    assert!(all.iter().all(|own| own.process() == process));
    for at in 0..3 {
        let (before, time) = (all[0].exchanges(), f64::from(at));
        for (number, own) in all.iter_mut().enumerate() {
            set(own, U, time + number as f64);
            assert!(own.request_step(time, 1.0, number == 1));
            // One at a time.
            assert!(!own.request_step(time, 1.0, false));
        }
        for (number, own) in all.iter_mut().enumerate() {
            let (progress, took) = own.finish_step().unwrap();
            assert_eq!(progress, Progress::Whole);
            assert_eq!(took > 0.0, number == 1, "{took}");
            assert_eq!(value(own, Y), 2.0 * (time + number as f64));
        }
        let expected = if at == 0 { 4 } else { 1 };
        assert_eq!(all[0].exchanges() - before, expected);
    }
    let refused = all[0].finish_step().unwrap_err();
    assert_eq!(refused.outcome, "was not requested");
}

/// From the first value of a reading to the first that is set, doubled and less one.
fn wire(reading: usize) -> Wire {
    let change = Linear {
        factor: 2.0,
        offset: -1.0,
    };
    Wire {
        reading,
        element: 0,
        place: 0,
        change,
    }
}

fn what_is_foreseen_travels_along() {
    let [mut first, mut second] = together(&stepped(FmiVersion::V3, "", ""));
    let read = (&Kind::Float64, &[Y][..], 1);
    let reading = first.foresee((&[], &[], &[]), read).unwrap();
    let foreseen = second.foresee((&[U], &[0.0], &[wire(reading)]), read);
    assert_eq!((reading, foreseen), (0, Some(1)));
    set(&mut first, U, 1.5);
    for at in 0..3 {
        let (before, time) = (first.exchanges(), f64::from(at));
        for own in [&mut first, &mut second] {
            assert!(own.request_step(time, 1.0, false));
        }
        for own in [&mut first, &mut second] {
            assert_eq!(own.finish_step().unwrap().0, Progress::Whole);
        }
        let y = value(&mut first, Y);
        assert_eq!(y, 3.0);
        set(&mut second, U, 2.0 * y - 1.0);
        assert_eq!(value(&mut second, Y), 10.0);
        assert_eq!(first.exchanges() - before, 1);
    }
    // Something else is set: it is called as usual.
    let before = first.exchanges();
    assert!(first.request_step(3.0, 1.0, false) && second.request_step(3.0, 1.0, false));
    first.finish_step().unwrap();
    second.finish_step().unwrap();
    assert_eq!(value(&mut first, Y), 3.0);
    set(&mut second, U, 0.5);
    assert_eq!(value(&mut second, Y), 1.0);
    assert_eq!(first.exchanges() - before, 2);
}

fn wires_lead_from_step_to_step() {
    let [mut first, mut second] = together(&stepped(FmiVersion::V3, "", ""));
    for at in 0..3 {
        let (before, time) = (first.exchanges(), f64::from(at));
        let step = (time, 1.0, false);
        set(&mut first, U, 1.5);
        let reading = first.request_wired_step(step, &[], (&[Y], 1)).unwrap();
        // What is read after a step is learned in the first one.
        let wired = reading.map(|reading| {
            set(&mut second, U, 0.0);
            let wires = [wire(reading)];
            second.request_wired_step(step, &wires, (&[Y], 1)).unwrap();
        });
        assert_eq!(wired.is_some(), at > 0);
        set(&mut first, U, 1.5);
        assert_eq!(first.finish_step().unwrap().0, Progress::Whole);
        let y = value(&mut first, Y);
        assert_eq!(y, 3.0);
        set(&mut second, U, 2.0 * y - 1.0);
        match wired {
            Some(()) => assert_eq!(second.finish_step().unwrap().0, Progress::Whole),
            None => assert_eq!(second.do_step(time, 1.0).unwrap(), Progress::Whole),
        }
        assert_eq!(value(&mut second, Y), 10.0);
        let expected = if at == 0 { 4 } else { 1 };
        assert_eq!(first.exchanges() - before, expected);
    }
}

fn refusals_are_those_of_their_calls() {
    for version in BOTH {
        let fmu = stepped(version, "", "");
        let mut own = apart(&fmu);
        own.take_messages();
        // It is refused when it travels, with the reading.
        set(&mut own, GAIN, -1.0);
        let error = own.get(&Kind::Float64, &[Y], &mut [0.0]).unwrap_err();
        let expected = match version {
            FmiVersion::V2 => "fmi2SetReal",
            FmiVersion::V3 => "fmi3SetFloat64",
        };
        assert_eq!(
            (&*error.call, &error.variables[..]),
            (expected, &["gain".to_string()][..])
        );
        assert_eq!(
            (&*error.outcome, &error.messages[..]),
            ("returned error", &["the gain is negative".to_string()][..])
        );

        let mut own = apart(&fmu);
        answer(&mut own, 2);
        let error = own.do_step(0.0, 0.5).unwrap_err();
        assert_eq!(error.outcome, "returned discard (it came to 0.25 s)");
        let refused = Instance::new(&fmu, "refused", &options());
        let text = refused.err().unwrap().to_string();
        assert!(
            text.ends_with("; it says: no instance has this name"),
            "{text}"
        );
    }
    // An error has the time at which its step began, whatever the FMU says.
    let mut own = apart(&stepped(FmiVersion::V3, "", ""));
    own.do_step(0.0, 0.5).unwrap();
    answer(&mut own, 3);
    let error = own.do_step(0.5, 0.5).unwrap_err();
    assert_eq!((&*error.outcome, error.time), ("returned error", 0.5));
    let mut own = apart(&stepped(FmiVersion::V3, "", ""));
    own.set(&Kind::Boolean, &[EARLY], &[1.0]).unwrap();
    let error = own.do_step(0.0, 0.5).unwrap_err();
    assert_eq!(
        error.outcome,
        "returned early at 0.25 s, which is not allowed"
    );
    let nowhere = Options {
        guest: Some("/nowhere".into()),
        ..options()
    };
    for options in [
        nowhere,
        Options {
            guest: None,
            ..options()
        },
    ] {
        assert!(Instance::new(&stepped(FmiVersion::V3, "", ""), "own", &options).is_err());
    }
}

/// The error of a step in which the FMU does this, in a process with another instance.
fn lost(does: i32, limit: Duration) -> Box<CallError> {
    let options = Options {
        call_limit: limit,
        ..options()
    };
    let fmu = stepped(FmiVersion::V3, "", "");
    let mut processes = Processes::new(&options);
    let [mut own, mut other] = ["own", "other"].map(|name| {
        let mut instance = Instance::within(&fmu, name, &mut processes, false).unwrap();
        begin(&mut instance, &[]);
        instance
    });
    answer(&mut own, does);
    let error = own.do_step(0.0, 0.5).unwrap_err();
    let gone = other.do_step(0.0, 0.5).unwrap_err();
    let (outcome, gone) = (&error.outcome, &gone.outcome);
    assert_eq!(*gone, format!("cannot be made: its process {outcome}"));
    error
}

fn the_end_of_the_process_is_an_error() {
    let long = Options::CALL_LIMIT;
    let error = lost(100, long);
    if cfg!(unix) {
        assert_eq!(error.outcome, "ended its process (abort, signal 6)");
    }
    let words = error
        .messages
        .iter()
        .any(|text| text.contains("the last words"));
    assert!(words, "{:?}", error.messages);
    assert_eq!(lost(101, long).outcome, "ended its process by exit(3)");
    let error = lost(102, Duration::from_millis(300));
    let outcome = "did not return within 0.3 s and was stopped (--call-limit)";
    assert_eq!(error.outcome, outcome);
}

/// Prints before, while the standard output is diverted, and after.
fn print() -> ExitCode {
    println!("before");
    let both = [Diverted::new(), Diverted::new()];
    for own in both {
        println!("meanwhile");
        drop(own);
    }
    println!("after");
    ExitCode::SUCCESS
}

fn what_is_printed_meanwhile_goes_to_the_standard_error() {
    let program = std::env::current_exe().unwrap();
    let output = std::process::Command::new(program).arg("print").output();
    let output = output.unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    if cfg!(unix) {
        assert_eq!(out, "before\nafter\n");
        assert_eq!(error, "meanwhile\nmeanwhile\n");
    }
}

fn a_step_among_others_that_fails_is_that_of_its_instance() {
    for (does, outcome, is_lost) in [
        (3, "returned error", false),
        (2, "returned discard (it came to 0.25 s)", false),
        (101, "ended its process by exit(3)", true),
    ] {
        let mut all: [Instance; 3] = together(&stepped(FmiVersion::V3, "", ""));
        answer(&mut all[1], does);
        for own in &mut all {
            set(own, U, 3.0);
            assert!(own.request_step(0.0, 0.5, false));
        }
        let [first, second, third] = &mut all;
        assert_eq!(first.finish_step().unwrap().0, Progress::Whole);
        let error = second.finish_step().unwrap_err();
        assert_eq!((&*error.instance, &*error.outcome), ("part_1", outcome));
        let last = third.finish_step();
        if is_lost {
            assert!(last.is_err());
            continue;
        }
        assert_eq!(last.unwrap().0, Progress::Whole);
        for own in [first, third] {
            assert_eq!((value(own, X), value(own, Y)), ((-0.5_f64).exp(), 6.0));
        }
    }
    // What is set before a step is refused.
    let mut all: [Instance; 2] = together(&stepped(FmiVersion::V2, "", ""));
    set(&mut all[0], GAIN, -1.0);
    assert!(all.iter_mut().all(|own| own.request_step(0.0, 0.5, false)));
    let error = all[0].finish_step().unwrap_err();
    assert_eq!(
        (&*error.call, &error.variables[..]),
        ("fmi2SetReal", &["gain".to_string()][..])
    );
    assert_eq!(all[1].finish_step().unwrap().0, Progress::Whole);
}

fn what_an_fmu_prints_is_its_message() {
    let mut all: [Instance; 2] = together(&stepped(FmiVersion::V3, "", ""));
    all[1].take_messages();
    answer(&mut all[1], 107);
    all[1].do_step(0.0, 0.5).unwrap();
    let line = "printed on standard output: a line".to_string();
    let begun = std::time::Instant::now();
    while !texts(&all[1]).contains(&line) {
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::yield_now();
    }
    // From then on each is called by itself, so that lines bear the right names.
    assert!(!all[0].request_step(0.0, 0.5, false));
    assert_eq!(all[0].do_step(0.0, 0.5).unwrap(), Progress::Whole);
}
