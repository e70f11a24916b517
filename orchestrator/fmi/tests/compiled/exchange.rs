//! Model exchange: the FMU gives derivatives and indicators and is stepped by the crate's solver.

use std::f64::consts::LN_2;

use fmi_import::{FmiVersion, Interface, Kind, Progress, State};

use crate::made::{
    BOTH, COUNT, EARLY, FLOOR, GAIN, OVER, PERIOD, U, X, Y, answer, exchanged, one, running, set,
    stepped, texts, value,
};

fn directional(version: FmiVersion) -> &'static str {
    match version {
        FmiVersion::V2 => r#"providesDirectionalDerivative="true""#,
        FmiVersion::V3 => r#"providesDirectionalDerivatives="true""#,
    }
}

#[test]
fn the_solver_follows_the_solution_through_state_events() {
    for version in BOTH {
        for attributes in ["", directional(version)] {
            let fmu = exchanged(version, attributes);
            assert_eq!(fmu.description.interface, Interface::ModelExchange);
            let mut own = running(&fmu, &[(FLOOR, 0.5)]);
            for at in 0..5 {
                let time = 0.5 * f64::from(at);
                assert_eq!(own.do_step(time, 0.5).unwrap(), Progress::Whole);
                let falls = ((time + 0.5) / LN_2).floor();
                let x = (falls * LN_2 - time - 0.5).exp();
                let found = value(&mut own, X);
                assert!((found - x).abs() < 1e-7, "{version}, {time} s: {found} {x}");
                assert_eq!(one(&mut own, &Kind::Int32, COUNT), falls);
            }
        }
    }
}

#[test]
fn time_events_and_inputs_take_effect() {
    for version in BOTH {
        let mut own = running(&exchanged(version, ""), &[(PERIOD, 0.25), (GAIN, 5.0)]);
        set(&mut own, U, 2.0);
        own.do_step(0.0, 0.6).unwrap();
        assert_eq!(one(&mut own, &Kind::Int32, COUNT), 2.0);
        assert_eq!(value(&mut own, Y), 10.0);
        assert!((value(&mut own, X) - (-0.6_f64).exp()).abs() < 1e-8);
    }
}

#[test]
fn what_is_not_continuous_is_set_in_event_mode() {
    for version in BOTH {
        let mut own = running(&exchanged(version, ""), &[]);
        own.do_step(0.0, 0.5).unwrap();
        own.take_messages();
        set(&mut own, U, 1.0);
        assert!(texts(&own).is_empty());
        answer(&mut own, 0);
        assert_eq!(texts(&own), ["EnterEventMode", "EnterContinuousTimeMode"]);
        own.do_step(0.5, 0.5).unwrap();
        assert!((value(&mut own, X) - (-1.0_f64).exp()).abs() < 1e-8);
    }
}

#[test]
fn the_fmu_ends_the_run_and_asks_for_events_after_a_step_of_the_solver() {
    for version in BOTH {
        let mut own = running(&exchanged(version, ""), &[]);
        own.set(&Kind::Boolean, &[EARLY], &[1.0]).unwrap();
        own.take_messages();
        own.do_step(0.0, 0.5).unwrap();
        let all = own.take_messages();
        let events = all.iter().find(|own| own.text == "EnterEventMode");
        assert!(events.is_some_and(|own| own.times >= 1), "{version}");
        own.set(&Kind::Boolean, &[EARLY], &[0.0]).unwrap();
        own.set(&Kind::Boolean, &[OVER], &[1.0]).unwrap();
        let ended = own.do_step(0.5, 0.5).unwrap();
        assert!(matches!(ended, Progress::Ended(_)), "{ended:?}");
    }
}

#[test]
fn a_kept_state_holds_the_solver_s() {
    for version in BOTH {
        let fmu = exchanged(version, "");
        let mut own = running(&fmu, &[(FLOOR, 0.5)]);
        own.do_step(0.0, 0.5).unwrap();
        let mut state = State::default();
        own.save_state(&mut state).unwrap();
        own.do_step(0.5, 0.5).unwrap();
        let first = value(&mut own, X);
        own.restore_state(&state).unwrap();
        own.do_step(0.5, 0.5).unwrap();
        assert_eq!(value(&mut own, X), first);
        // Another one is kept beside it.
        let mut later = State::default();
        own.save_state(&mut later).unwrap();
        own.restore_state(&state).unwrap();
        own.do_step(0.5, 0.5).unwrap();
        assert_eq!(value(&mut own, X), first);
        own.free_state(later).unwrap();
        let bytes = own.state_as_bytes(&state).unwrap();
        let mut other = running(&fmu, &[(FLOOR, 0.5)]);
        let read = other.state_of_bytes(&bytes).unwrap();
        other.restore_state(&read).unwrap();
        other.do_step(0.5, 0.5).unwrap();
        assert_eq!(value(&mut other, X), first);
        own.free_state(state).unwrap();
    }
}

#[test]
fn an_fmu_without_model_exchange_is_refused_for_it() {
    for version in BOTH {
        let refused = stepped(version, "", "").for_model_exchange().unwrap_err();
        assert!(
            refused
                .to_string()
                .ends_with("it does not offer model exchange")
        );
    }
}

#[test]
fn many_events_are_borne_and_endless_ones_are_not() {
    let mut own = running(&exchanged(FmiVersion::V3, ""), &[(PERIOD, 1e-3)]);
    own.do_step(0.0, 1.5005).unwrap();
    assert_eq!(one(&mut own, &Kind::Int32, COUNT), 1500.0);
    let mut own = running(&exchanged(FmiVersion::V3, ""), &[(PERIOD, 1e-16)]);
    let error = own.do_step(0.0, 1.0).unwrap_err();
    let front = "has endless events at 0.000000000000";
    assert!(error.outcome.starts_with(front), "{error}");
}
