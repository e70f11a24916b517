//! Co-simulation with event mode (FMI 3.0): what the FMU asks for while it is stepped.

use std::f64::consts::LN_2;

use fmi_import::{FmiVersion, Instance, Kind};

use crate::made::{
    COUNT, FAILS, FLOOR, PERIOD, TICKS, X, begin, instance, logged, one, running, set, stepped,
    texts, value,
};

const EVENTS: &str = r#"hasEventMode="true" canHandleVariableCommunicationStepSize="true""#;

#[test]
fn time_events_are_met_within_steps_and_at_their_ends() {
    let mut own = running(&stepped(FmiVersion::V3, EVENTS, ""), &[(PERIOD, 0.25)]);
    assert!(own.has_events());
    for (time, step, count) in [(0.0, 0.125, 0.0), (0.125, 0.125, 1.0), (0.25, 0.875, 4.0)] {
        own.do_step(time, step).unwrap();
        assert_eq!(one(&mut own, &Kind::Int32, COUNT), count);
    }
}

#[test]
fn a_step_goes_on_from_an_early_return_at_an_event() {
    let mut own = running(&stepped(FmiVersion::V3, EVENTS, ""), &[(FLOOR, 0.5)]);
    for at in 0..3 {
        let time = f64::from(at);
        own.do_step(time, 1.0).unwrap();
        // It falls to a half in ln 2.
        let falls = ((time + 1.0) / LN_2).floor();
        let x = (falls * LN_2 - time - 1.0).exp();
        assert!((value(&mut own, X) - x).abs() < 1e-12);
        assert_eq!(one(&mut own, &Kind::Int32, COUNT), falls);
    }
    own.take_messages();
    own.begin_event().unwrap();
    own.end_event().unwrap();
    assert_eq!(texts(&own), ["EnterEventMode", "EnterStepMode"]);
}

#[test]
fn an_fmu_that_refuses_its_event_mode_handles_its_events_itself() {
    let fmu = stepped(FmiVersion::V3, EVENTS, "");
    let mut own = Instance::new(&fmu, "stepped", &logged()).unwrap();
    let all = texts(&own);
    assert!(
        all.iter()
            .any(|text| text.starts_with("it declares event mode")),
        "{all:?}"
    );
    begin(&mut own, &[(FLOOR, 0.5)]);
    assert!(!own.has_events());
    own.do_step(0.0, 1.0).unwrap();
    assert!((value(&mut own, X) - (LN_2 - 1.0).exp()).abs() < 1e-12);
    // There is no event to enter.
    own.begin_event().unwrap();
    own.end_event().unwrap();
}

#[test]
fn an_input_clock_ticks_at_the_fmu_s_interval_and_an_output_clock_is_read() {
    let clocks = r#"<Clock name="tick" valueReference="130" causality="input" intervalVariability="tunable"
        intervalDecimal="1"/><Clock name="tock" valueReference="131" causality="output"
        intervalVariability="triggered"/>"#;
    let fmu = stepped(FmiVersion::V3, EVENTS, clocks);
    let mut own = instance(&fmu);
    begin(&mut own, &[(FLOOR, 0.5)]);
    for (time, step, ticks, tock) in [
        (0.0, 0.6, 3.0, 0.0),
        (0.6, 0.15, 4.0, 1.0),
        (0.75, 0.25, 5.0, 0.0),
    ] {
        own.do_step(time, step).unwrap();
        assert_eq!(one(&mut own, &Kind::Int32, TICKS), ticks, "{time}");
        assert_eq!(one(&mut own, &Kind::Clock, 131), tock, "{time}");
    }
    let all = texts(&own);
    assert!(
        all.iter()
            .any(|text| text.starts_with("its clock `tock` ticked at 0.69")),
        "{all:?}"
    );
}

#[test]
fn clocks_of_an_fmu_without_event_mode_do_not_tick() {
    let clocks = r#"<Clock name="tock" valueReference="131" causality="output" intervalVariability="triggered"/>"#;
    let mut own = running(&stepped(FmiVersion::V3, "", clocks), &[]);
    let all = texts(&own);
    assert!(
        all.iter()
            .any(|text| text.starts_with("its output clock `tock` is not read")),
        "{all:?}"
    );
    own.set(&Kind::Clock, &[131], &[1.0]).unwrap();
    assert_eq!(one(&mut own, &Kind::Clock, 131), 0.0);
}

#[test]
fn a_failure_between_two_events_has_the_time_of_the_first() {
    let mut own = running(
        &stepped(FmiVersion::V3, EVENTS, ""),
        &[(PERIOD, 0.25), (FAILS, 0.5)],
    );
    let error = own.do_step(0.0, 1.0).unwrap_err();
    assert_eq!((&*error.call, error.time), ("fmi3DoStep", 0.5));
}

#[test]
fn events_and_clocks_count_from_the_start_of_the_run() {
    let clock = r#"<Clock name="tick" valueReference="130" causality="input" intervalVariability="fixed"
        intervalDecimal="0.5" shiftDecimal="0.25"/>"#;
    let mut own = instance(&stepped(FmiVersion::V3, EVENTS, clock));
    own.enter_initialization(5.125, 10.0).unwrap();
    set(&mut own, PERIOD, 0.25);
    own.exit_initialization().unwrap();
    // At 5.375 and 5.875; events at 5.375, 5.625, 5.875 and 6.125.
    own.do_step(5.125, 1.0).unwrap();
    assert_eq!(one(&mut own, &Kind::Int32, TICKS), 2.0);
    assert_eq!(one(&mut own, &Kind::Int32, COUNT), 4.0);
}
