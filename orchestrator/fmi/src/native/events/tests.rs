//! Events of an FMU whose calls are noted, in place of a library. The sequences follow from the standard (FMI 3.0,
//! chapter 4.2 with its state machine) and from the clocks' periods.

use std::sync::{Arc, Mutex};

use super::super::super::Ticks;
use super::super::super::call::Values;
use super::*;

/// What an FMU does in a run, and what it was asked.
#[derive(Default)]
struct Script {
    /// Time events that it announces, ascending, s.
    announced: Vec<f64>,
    /// It returns early here, s.
    early: Option<f64>,
    /// It discards what is behind this time, s.
    discards: Option<f64>,
    /// It needs an event at the end of each step.
    needs_event: bool,
    /// It asks to end the run in the event at this time or later, s.
    ends: Option<f64>,
    /// How often it wants its event again.
    again: usize,
    /// Its output clock ticks in each event.
    is_ticking: bool,
    /// The status of its updates.
    status: i32,
    /// The interval of its countdown clock, s.
    countdown: Option<f64>,
    calls: Vec<String>,
    messages: Vec<String>,
    time: f64,
}

#[derive(Clone, Default)]
struct Noted(Arc<Mutex<Script>>);

/// Without the rounding of sums.
fn rounded(time: f64) -> f64 {
    (time * 1e6).round() / 1e6
}

impl Endpoint for Noted {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let mut own = self.0.lock().unwrap();
        let own = &mut *own;
        let note = match call.function {
            Function::DoStep => {
                let [from, length, _] = call.numbers;
                let target = from + length;
                let inside = |at: &f64| (from..target).contains(at);
                let early = own.early.filter(inside);
                let discards = own.discards.filter(inside);
                own.time = discards.or(early).unwrap_or(target);
                call.numbers[0] = own.time;
                call.flags = [own.needs_event, false, early.is_some(), false, false];
                own.calls
                    .push(format!("step {} {}", rounded(from), rounded(target)));
                return Ok(if discards.is_some() { DISCARD } else { 0 });
            }
            Function::UpdateDiscreteStates => {
                own.announced.retain(|at| *at > own.time + 1e-9);
                let again = std::mem::take(&mut own.again);
                own.again = again.saturating_sub(1);
                let end = own.ends.is_some_and(|at| own.time >= at);
                call.flags = [again > 0, end, false, false, !own.announced.is_empty()];
                call.numbers[0] = own.announced.first().copied().unwrap_or(0.0);
                own.calls.push("update".to_string());
                return Ok(own.status);
            }
            Function::Set(Scalar::Clock) => format!("tick {:?}", call.references),
            Function::Get(Scalar::Clock) => {
                if let Values::Out(ticks) = &mut call.values {
                    ticks.fill(u8::from(own.is_ticking));
                }
                return Ok(0);
            }
            Function::GetIntervalDecimal => {
                let interval = own.countdown.take();
                call.handle = if interval.is_some() { 2 } else { 0 };
                if let (Values::Out(place), Some(interval)) = (&mut call.values, interval) {
                    place.copy_from_slice(&interval.to_ne_bytes());
                }
                return Ok(0);
            }
            Function::EnterEventMode => format!("event {}", rounded(own.time)),
            Function::EnterStepMode => return Ok(0),
            Function::Get(_) => "get".to_string(),
            other => format!("{other:?}"),
        };
        own.calls.push(note);
        Ok(0)
    }

    fn get_reals(&mut self, _: &[u32], values: &mut [f64]) -> Option<i32> {
        values.fill(7.0);
        Some(0)
    }
}

impl Sink for Noted {
    fn message(&self, status: i32, _: &str, text: &str) {
        let message = format!("{status}: {text}");
        self.0.lock().unwrap().messages.push(message);
    }
}

/// A clock of that period and shift, s.
fn periodic(reference: u32, period: f64, shift: f64) -> InputClock {
    InputClock {
        name: format!("clock{reference}"),
        reference,
        ticks: Ticks::Periodic(Some(period)),
        shift,
    }
}

/// An FMU that has left its initialization at 0 s, with calls from then on.
fn begun(script: Script, inputs: Vec<InputClock>, variable_step: bool) -> (WithEvents, Noted) {
    let noted = Noted(Arc::new(Mutex::new(script)));
    let events = Events {
        inputs,
        outputs: vec![("pulse".to_string(), 9)],
        variable_step,
    };
    let sink = Arc::new(noted.clone());
    let mut own = WithEvents::new(Box::new(noted.clone()), events, sink);
    for function in [
        Function::EnterInitializationMode,
        Function::ExitInitializationMode,
    ] {
        assert_eq!(own.call(&mut Call::plain(function)), Ok(0));
    }
    noted.0.lock().unwrap().calls.clear();
    (own, noted)
}

/// Status, time reached and whether the run shall end, of a step.
fn step(own: &mut WithEvents, time: f64, length: f64) -> (Result<i32, Lost>, f64, bool) {
    let mut call = Call::plain(Function::DoStep);
    call.numbers = [time, length, 0.0];
    let status = own.call(&mut call);
    (status, rounded(call.numbers[0]), call.flags[1])
}

fn calls(noted: &Noted) -> Vec<String> {
    std::mem::take(&mut noted.0.lock().unwrap().calls)
}

#[test]
fn a_step_ends_at_each_tick_and_the_tick_at_its_end_waits() {
    let clocks = vec![periodic(1, 0.2, 0.1), periodic(2, 0.4, 0.3)];
    let (mut own, noted) = begun(Script::default(), clocks, true);
    assert_eq!(step(&mut own, 0.0, 0.5), (Ok(0), 0.5, false));
    let expected = [
        "step 0 0.1",
        "event 0.1",
        "tick [1]",
        "update",
        "step 0.1 0.3",
        "event 0.3",
        "tick [1, 2]",
        "update",
        "step 0.3 0.5",
    ];
    assert_eq!(calls(&noted), expected);
    // Numbers that would be of before the tick are not read past it; one reading ticks, once.
    let mut values = [0.0];
    assert_eq!(own.get_reals(&[4], &mut values), None);
    let mut ahead = Call::plain(Function::Get(Scalar::Float64));
    ahead.flags[AHEAD] = true;
    assert_eq!(own.call(&mut ahead), Ok(DISCARD));
    assert_eq!(calls(&noted), [""; 0]);
    let mut get = Call::plain(Function::Get(Scalar::Float64));
    assert_eq!(own.call(&mut get), Ok(0));
    assert_eq!(calls(&noted), ["event 0.5", "tick [1]", "update", "get"]);
    assert_eq!(own.get_reals(&[4], &mut values), Some(0));
    assert_eq!(values, [7.0]);
    // Where nobody reads, it ticks at the beginning of the next step.
    assert_eq!(step(&mut own, 0.5, 0.2), (Ok(0), 0.7, false));
    assert_eq!(calls(&noted), ["step 0.5 0.7"]);
    assert_eq!(step(&mut own, 0.7, 0.1), (Ok(0), 0.8, false));
    assert_eq!(
        calls(&noted),
        ["event 0.7", "tick [1, 2]", "update", "step 0.7 0.8"]
    );
}

#[test]
fn steps_of_one_length_cannot_end_at_a_tick() {
    let (mut own, noted) = begun(Script::default(), vec![periodic(3, 0.2, 0.0)], false);
    // At the end of a step they can.
    assert_eq!(step(&mut own, 0.0, 0.2), (Ok(0), 0.2, false));
    assert_eq!(calls(&noted), ["step 0 0.2"]);
    let (refused, time, _) = step(&mut own, 0.2, 0.3);
    let Lost(told) = refused.unwrap_err();
    assert_eq!(
        told,
        "cannot end at the tick of its clock `clock3` at 0.4 s, for it takes steps of one length only; \
         choose a --step that divides the clock's period"
    );
    assert_eq!(time, 0.2);
}

#[test]
fn a_step_ends_at_the_time_event_that_was_announced() {
    let script = || Script {
        announced: vec![0.25, 0.3, 0.5],
        ..Script::default()
    };
    let (mut own, noted) = begun(script(), Vec::new(), true);
    assert_eq!(step(&mut own, 0.0, 0.5), (Ok(0), 0.5, false));
    let expected = [
        "step 0 0.25",
        "event 0.25",
        "update",
        "step 0.25 0.3",
        "event 0.3",
        "update",
        "step 0.3 0.5",
        "event 0.5",
        "update",
    ];
    assert_eq!(calls(&noted), expected);
    // Steps of one length pass it by; the event follows.
    let (mut own, noted) = begun(script(), Vec::new(), false);
    assert_eq!(step(&mut own, 0.0, 0.4), (Ok(0), 0.4, false));
    assert_eq!(calls(&noted), ["step 0 0.4", "event 0.4", "update"]);
    assert_eq!(step(&mut own, 0.4, 0.05), (Ok(0), 0.45, false));
    assert_eq!(calls(&noted), ["step 0.4 0.45"]);
}

#[test]
fn an_early_return_is_an_event_and_the_step_continues() {
    let script = Script {
        early: Some(0.2),
        again: 0,
        ..Script::default()
    };
    let (mut own, noted) = begun(script, Vec::new(), true);
    noted.0.lock().unwrap().again = 2;
    let mut call = Call::plain(Function::DoStep);
    call.numbers = [0.0, 0.3, 0.0];
    // It returns at the same place again and again.
    let Lost(told) = own.call(&mut call).unwrap_err();
    assert_eq!(told, "returned early repeatedly at 0.2 s");
    let all = calls(&noted);
    assert_eq!(all[..2], ["step 0 0.3", "event 0.2"]);
    // The event is iterated until the FMU asks for no repetition.
    assert_eq!(all[2..6], ["update", "update", "update", "step 0.2 0.3"]);
    let steps = all.iter().filter(|call| call.starts_with("step")).count();
    assert_eq!(steps, 2 + MOST_EVENTS);
    assert_eq!(rounded(call.numbers[0]), 0.2);

    // Once, it goes on from there.
    noted.0.lock().unwrap().early = None;
    assert_eq!(step(&mut own, 0.2, 0.1), (Ok(0), 0.3, false));
    assert_eq!(calls(&noted), ["step 0.2 0.3"]);
}

#[test]
fn a_return_outside_of_the_step_is_refused() {
    /// Returns at a time of its own.
    struct Elsewhere(f64);
    impl Endpoint for Elsewhere {
        fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
            if call.function == Function::DoStep {
                call.flags[2] = true;
                call.numbers[0] = self.0;
            }
            Ok(0)
        }
    }
    for (reached, is_refused) in [(0.9, true), (1.6, true), (1.5, false)] {
        let events = Events {
            inputs: Vec::new(),
            outputs: Vec::new(),
            variable_step: true,
        };
        let sink = Arc::new(Noted::default());
        let mut own = WithEvents::new(Box::new(Elsewhere(reached)), events, sink);
        let (outcome, ..) = step(&mut own, 1.0, 0.5);
        let told = format!("returned early at {reached} s from a step to 1.5 s");
        let expected = if is_refused { Err(Lost(told)) } else { Ok(0) };
        assert_eq!(outcome, expected);
    }
}

#[test]
fn a_run_that_the_fmu_ends_in_an_event_stays_ended() {
    let script = Script {
        ends: Some(0.3),
        ..Script::default()
    };
    let (mut own, noted) = begun(script, vec![periodic(1, 0.2, 0.1)], true);
    assert_eq!(step(&mut own, 0.0, 0.5), (Ok(0), 0.3, true));
    let expected = [
        "step 0 0.1",
        "event 0.1",
        "tick [1]",
        "update",
        "step 0.1 0.3",
        "event 0.3",
        "tick [1]",
        "update",
    ];
    assert_eq!(calls(&noted), expected);
    assert_eq!(step(&mut own, 0.3, 0.5), (Ok(0), 0.3, true));
    assert_eq!(calls(&noted), [""; 0]);
}

#[test]
fn a_discarded_step_reports_how_far_it_came() {
    let script = Script {
        discards: Some(0.15),
        needs_event: true,
        ..Script::default()
    };
    let (mut own, noted) = begun(script, Vec::new(), true);
    assert_eq!(step(&mut own, 0.0, 0.1), (Ok(0), 0.1, false));
    assert_eq!(calls(&noted), ["step 0 0.1", "event 0.1", "update"]);
    assert_eq!(step(&mut own, 0.1, 0.1), (Ok(DISCARD), 0.15, false));
    assert_eq!(calls(&noted), ["step 0.1 0.2"]);
}

#[test]
fn an_event_that_does_not_settle_or_fails_names_the_call() {
    let script = Script {
        needs_event: true,
        ..Script::default()
    };
    let (mut own, noted) = begun(script, Vec::new(), true);
    let failed = |own: &mut WithEvents| {
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [0.0, 0.1, 0.0];
        let outcome = own.call(&mut call);
        let culprit = call.culprit.map(|culprit| culprit.function);
        (outcome, rounded(call.numbers[0]), culprit)
    };
    noted.0.lock().unwrap().again = usize::MAX;
    let told = "still iterates after 1000 repetitions".to_string();
    let update = Some(Function::UpdateDiscreteStates);
    assert_eq!(failed(&mut own), (Err(Lost(told)), 0.1, update));
    assert_eq!(calls(&noted).len(), 2 + MOST_EVENTS);
    // A warning is not a failure, an error is one.
    noted.0.lock().unwrap().again = 0;
    for (status, expected) in [(1, (Ok(0), 0.1, None)), (3, (Ok(3), 0.1, update))] {
        noted.0.lock().unwrap().status = status;
        assert_eq!(failed(&mut own), expected);
    }
}

#[test]
fn a_tick_within_a_step_is_reported_once_and_read_once() {
    let script = Script {
        announced: vec![0.1, 0.2, 0.3],
        ..Script::default()
    };
    let (mut own, noted) = begun(script, Vec::new(), true);
    let read = |own: &mut WithEvents| {
        let mut tick = [5];
        let mut call = Call::plain(Function::Get(Scalar::Clock));
        call.references = &[9];
        call.values = Values::Out(&mut tick);
        assert_eq!(own.call(&mut call), Ok(0));
        tick[0]
    };
    assert_eq!(read(&mut own), 0);
    noted.0.lock().unwrap().is_ticking = true;
    assert_eq!(step(&mut own, 0.0, 0.3), (Ok(0), 0.3, false));
    let messages = noted.0.lock().unwrap().messages.clone();
    assert_eq!(
        messages,
        [
            "1: its clock `pulse` ticked at 0.1 s, between communication points: others see such ticks at the \
             next point; a shorter --step brings it nearer"
        ]
    );
    noted.0.lock().unwrap().is_ticking = false;
    // For everybody who reads at this point, until the next step.
    assert_eq!([read(&mut own), read(&mut own)], [1, 1]);
    assert_eq!(step(&mut own, 0.3, 0.1), (Ok(0), 0.4, false));
    assert_eq!(read(&mut own), 0);
}

#[test]
fn a_countdown_ticks_once_after_the_interval_that_the_fmu_gives() {
    let clock = InputClock {
        ticks: Ticks::Countdown,
        ..periodic(5, 1.0, 0.0)
    };
    let script = Script {
        countdown: Some(0.12),
        ..Script::default()
    };
    let (mut own, noted) = begun(script, vec![clock], true);
    assert_eq!(step(&mut own, 0.0, 0.3), (Ok(0), 0.3, false));
    let expected = [
        "step 0 0.12",
        "event 0.12",
        "tick [5]",
        "update",
        "step 0.12 0.3",
    ];
    assert_eq!(calls(&noted), expected);
}

#[test]
fn a_triggered_clock_ticks_once_where_another_triggers_it() {
    let clock = InputClock {
        ticks: Ticks::Triggered,
        ..periodic(6, 1.0, 0.0)
    };
    let (mut own, noted) = begun(Script::default(), vec![clock], true);
    let trigger = |own: &mut WithEvents, value: u8| {
        let values = [value];
        let mut call = Call::plain(Function::Set(Scalar::Clock));
        call.references = &[6];
        call.values = Values::In(&values);
        assert_eq!(own.call(&mut call), Ok(0));
    };
    let event = |own: &mut WithEvents| {
        for function in [Function::EnterEventMode, Function::EnterStepMode] {
            assert_eq!(own.call(&mut Call::plain(function)), Ok(0));
        }
    };
    trigger(&mut own, 0);
    event(&mut own);
    assert_eq!(calls(&noted), ["event 0", "update"]);
    trigger(&mut own, 1);
    event(&mut own);
    assert_eq!(calls(&noted), ["event 0", "tick [6]", "update"]);
    // Not a second time at this point.
    trigger(&mut own, 1);
    assert_eq!(step(&mut own, 0.0, 0.1), (Ok(0), 0.1, false));
    assert_eq!(calls(&noted), ["step 0 0.1"]);
    trigger(&mut own, 1);
    assert_eq!(step(&mut own, 0.1, 0.1), (Ok(0), 0.2, false));
    assert_eq!(
        calls(&noted),
        ["event 0.1", "tick [6]", "update", "step 0.1 0.2"]
    );
}

#[test]
fn an_fmu_without_clocks_could_handle_its_events_itself() {
    let events = |inputs: Vec<InputClock>, outputs: Vec<(String, u32)>| Events {
        inputs,
        outputs,
        variable_step: true,
    };
    let output = vec![("pulse".to_string(), 9)];
    assert!(events(Vec::new(), Vec::new()).has_no_clocks());
    assert!(!events(Vec::new(), output).has_no_clocks());
    assert!(!events(vec![periodic(1, 0.1, 0.0)], Vec::new()).has_no_clocks());
}
