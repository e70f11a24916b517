//! Steps, their statuses, kept states, and the order of calls.

use std::path::MAIN_SEPARATOR;
use std::sync::Arc;

use fmi_import::{CURE, FmiVersion, Fmu, Instance, Kind, Progress, State};

use crate::made::{
    ANSWER, BOTH, EARLY, GAIN, OVER, U, X, Y, answer, begin, compile, description, instance,
    library, logged, pack, packed, running, set, source, stepped, texts, value,
};

#[test]
fn steps_of_any_length_follow_the_solution() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        let mut time = 0.0;
        // The last one is shorter.
        for step in [0.25, 0.25, 0.125] {
            assert_eq!(own.do_step(time, step).unwrap(), Progress::Whole);
            time += step;
            let x = value(&mut own, X);
            assert!((x - (-time).exp()).abs() < 1e-15, "{time} s: {x}");
        }
        // The FMU is at another time.
        let refused = own.do_step(0.5, 0.25).unwrap_err();
        assert_eq!((refused.time, &*refused.outcome), (0.5, "returned error"));
    }
}

#[test]
fn a_warning_is_kept_and_the_run_goes_on() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        own.take_messages();
        answer(&mut own, 1);
        assert_eq!(own.do_step(0.0, 0.5).unwrap(), Progress::Whole);
        let messages = own.take_messages();
        let kept: Vec<_> = messages
            .iter()
            .map(|own| (own.status, &*own.category, &*own.text))
            .collect();
        assert_eq!(kept, [("warning", "calls", "the step is rough")]);
        assert_eq!(own.do_step(0.5, 0.5).unwrap(), Progress::Whole);
    }
}

#[test]
fn a_discarded_step_says_how_far_it_came() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        own.do_step(0.0, 0.5).unwrap();
        answer(&mut own, 2);
        let error = own.do_step(0.5, 0.5).unwrap_err();
        assert_eq!(error.outcome, "returned discard (it came to 0.75 s)");
        assert!(error.may_be_of_the_step && error.time == 0.5);
        // The instance lives; a shorter step may do.
        answer(&mut own, 0);
        assert_eq!(own.do_step(0.5, 0.25).unwrap(), Progress::Whole);
        answer(&mut own, 2);
        own.set(&Kind::Boolean, &[OVER], &[1.0]).unwrap();
        assert_eq!(own.do_step(0.75, 0.5).unwrap(), Progress::Ended(1.0));
    }
}

#[test]
fn an_error_ends_the_run_and_a_fatal_one_forbids_every_call() {
    for version in BOTH {
        for (status, outcome, last) in [
            (3, "returned error", &["FreeInstance"][..]),
            (4, "returned fatal", &[]),
            (
                -1,
                "returned -1, which is not a status of the standard",
                &["Terminate", "FreeInstance"],
            ),
            (
                7,
                "returned 7, which is not a status of the standard",
                &["FreeInstance"],
            ),
        ] {
            let mut own = running(&stepped(version, "", ""), &[]);
            own.take_messages();
            answer(&mut own, status);
            let error = own.do_step(0.0, 0.5).unwrap_err();
            assert_eq!(error.outcome, outcome);
            assert_eq!(error.messages, ["the step is 100 % wrong"]);
            let next = own.get(&Kind::Float64, &[X], &mut [0.0]);
            if status == 4 {
                let set = own.set(&Kind::Float64, &[U], &[1.0]).unwrap_err();
                let whole = own.set(&Kind::Int32, &[ANSWER], &[0.0]).unwrap_err();
                let step = own.do_step(0.5, 0.5).unwrap_err();
                for error in [set, whole, step] {
                    assert_eq!(error.outcome, "cannot follow a fatal error");
                }
            }
            let after = next.err().map(|error| error.outcome);
            let forbidden = (status == 4).then(|| "cannot follow a fatal error".to_string());
            assert_eq!(after, forbidden);
            own.close();
            assert_eq!(texts(&own), last, "{version}, {status}");
        }
    }
}

#[test]
fn an_early_return_that_was_not_allowed_is_an_error_and_an_end_is_none() {
    let fmu = stepped(FmiVersion::V3, "", "");
    let mut own = running(&fmu, &[]);
    own.set(&Kind::Boolean, &[EARLY], &[1.0]).unwrap();
    let error = own.do_step(0.0, 0.5).unwrap_err();
    assert_eq!(
        error.outcome,
        "returned early at 0.25 s, which is not allowed"
    );
    let mut own = running(&fmu, &[]);
    own.set(&Kind::Boolean, &[EARLY, OVER], &[1.0, 1.0])
        .unwrap();
    assert_eq!(own.do_step(0.0, 0.5).unwrap(), Progress::Ended(0.25));
}

#[test]
fn calls_come_in_the_order_of_the_standard_with_their_arguments() {
    for version in BOTH {
        let mut fmu = (*stepped(version, "", "")).clone();
        fmu.tolerance = Some(1e-4);
        let fmu = Arc::new(fmu);
        let mut own = instance(&fmu);
        begin(&mut own, &[]);
        let mut given = [0.0; 2];
        own.get(&Kind::Float64, &[9, 10], &mut given).unwrap();
        assert_eq!(given, [1e-4, 10.0]);
        own.do_step(0.0, 1.0).unwrap();
        own.close();
        let texts = texts(&own);
        let (first, rest) = texts.split_first().unwrap();
        // A URI, and a path with the separator at its end.
        let (begin, end) = match version {
            FmiVersion::V2 => ("one with file:///", "/resources".to_string()),
            FmiVersion::V3 => ("one with ", format!("resources{MAIN_SEPARATOR}")),
        };
        assert!(first.starts_with(begin) && first.ends_with(&end), "{first}");
        let setup: &[&str] = if version == FmiVersion::V2 {
            &["SetupExperiment"]
        } else {
            &[]
        };
        let all = [
            setup,
            &[
                "EnterInitializationMode",
                "ExitInitializationMode",
                "Terminate",
                "FreeInstance",
            ],
        ];
        assert_eq!(rest, all.concat(), "{version}");
    }
}

#[test]
fn an_instance_that_is_not_initialized_is_freed_and_not_terminated() {
    for version in BOTH {
        let mut own = instance(&stepped(version, "", ""));
        own.take_messages();
        own.close();
        assert_eq!(texts(&own), ["FreeInstance"]);
        let error = own.do_step(0.0, 1.0).unwrap_err();
        assert_eq!(error.outcome, "came after the instance was freed");
    }
}

#[test]
fn structural_parameters_have_a_mode_of_their_own() {
    let mut own = instance(&stepped(FmiVersion::V3, "", ""));
    own.enter_configuration().unwrap();
    own.exit_configuration().unwrap();
    begin(&mut own, &[]);
    let modes = [
        "EnterConfigurationMode",
        "ExitConfigurationMode",
        "EnterInitializationMode",
    ];
    assert_eq!(texts(&own)[1..4], modes);
    assert!(own.enter_configuration().is_err());
}

#[test]
fn a_refusal_to_be_instantiated_has_the_fmu_s_reasons() {
    for version in BOTH {
        let fmu = stepped(version, "", "");
        let refused = Instance::new(&fmu, "refused", &logged());
        let text = refused.err().unwrap().to_string();
        assert!(
            text.contains("`refused` could not be instantiated"),
            "{text}"
        );
        assert!(
            text.ends_with("; it says: no instance has this name"),
            "{text}"
        );
    }
}

#[test]
fn a_library_without_the_functions_is_refused_with_their_names() {
    let empty = compile(&source().join("empty.rs"));
    for (version, names) in [
        (
            r#"fmiVersion="2.0" guid="1""#,
            ["fmi2Instantiate", "fmi2SetupExperiment", "fmi2DoStep"],
        ),
        (
            r#"fmiVersion="3.0" instantiationToken="1""#,
            [
                "fmi3EnterInitializationMode",
                "fmi3FreeInstance",
                "fmi3DoStep",
            ],
        ),
    ] {
        let description = format!(
            r#"<fmiModelDescription {version} modelName="minimal"><CoSimulation modelIdentifier="minimal"/>
            <ModelVariables/><ModelStructure/></fmiModelDescription>"#
        );
        let refused = Instance::new(&packed(&description, &empty), "one", &logged());
        let text = refused.err().unwrap().to_string();
        assert!(names.iter().all(|name| text.contains(name)), "{text}");
    }
}

#[test]
fn log_categories_that_are_refused_are_reported() {
    let mut options = logged();
    options.log_categories = Some(vec!["other".to_string()]);
    for version in BOTH {
        let own = Instance::new(&stepped(version, "", ""), "one", &options).unwrap();
        let last = texts(&own).pop().unwrap();
        assert_eq!(
            last,
            "the log categories were not accepted: the call returned error"
        );
    }
}

#[test]
fn a_kept_state_is_gone_back_to_here_and_in_another_instance() {
    for version in BOTH {
        let fmu = stepped(version, "", "");
        let mut own = running(&fmu, &[(GAIN, 3.0)]);
        set(&mut own, U, 2.0);
        own.do_step(0.0, 0.5).unwrap();
        let mut state = State::default();
        own.save_state(&mut state).unwrap();
        set(&mut own, U, 1.0);
        own.do_step(0.5, 0.5).unwrap();
        own.restore_state(&state).unwrap();
        assert_eq!(
            (value(&mut own, X), value(&mut own, Y)),
            ((-0.5_f64).exp(), 6.0)
        );
        // From there on again.
        own.do_step(0.5, 0.25).unwrap();
        let later = value(&mut own, X);
        assert!((later - (-0.75_f64).exp()).abs() < 1e-15);
        // It is kept in the same place.
        own.save_state(&mut state).unwrap();
        let bytes = own.state_as_bytes(&state).unwrap();
        let mut other = running(&fmu, &[]);
        let read = other.state_of_bytes(&bytes).unwrap();
        other.restore_state(&read).unwrap();
        assert_eq!((value(&mut other, X), value(&mut other, Y)), (later, 6.0));
        other.do_step(0.75, 0.25).unwrap();
        own.take_messages();
        own.free_state(state).unwrap();
        own.free_state(State::default()).unwrap();
        let messages = own.take_messages();
        assert_eq!(
            (messages.len(), &*messages[0].text, messages[0].times),
            (1, "FreeState", 1)
        );
        // Bytes of something else.
        assert!(other.state_of_bytes(&bytes[1..]).is_err());
    }
}

/// Of the host's own computing, whatever the FMU did to the unit that computes.
#[test]
fn an_fmu_does_not_change_how_the_host_rounds() {
    for version in BOTH {
        let mut own = running(&stepped(version, "", ""), &[]);
        answer(&mut own, 103);
        own.do_step(0.0, 0.5).unwrap();
        let [two, three] = [2.0, 3.0].map(std::hint::black_box::<f64>);
        // The nearest number is above two thirds.
        assert_eq!((two / three).to_bits(), 0x3fe5_5555_5555_5555);
        assert_eq!((3.0 * (two / three)).to_bits(), 2.0_f64.to_bits());
        answer(&mut own, 0);
        own.do_step(0.5, 0.5).unwrap();
    }
}

#[test]
fn an_instance_in_this_process_takes_no_requests() {
    let mut own = running(&stepped(FmiVersion::V3, "", ""), &[]);
    assert!(!own.is_apart() && own.process().is_none() && own.is_settled());
    assert!(!own.request_step(0.0, 1.0, false));
    let step = (0.0, 1.0, false);
    assert_eq!(own.request_wired_step(step, &[], (&[Y], 1)), None);
    let read = (&Kind::Float64, &[Y][..], 1);
    assert_eq!(
        (own.foresee((&[], &[], &[]), read), own.exchanges()),
        (None, 0)
    );
    let error = own.finish_step().unwrap_err();
    assert_eq!(error.outcome, "was not requested");
}

#[test]
fn a_library_that_is_missing_is_named_with_what_to_do_for_a_component_of_this_project() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("Own.fmu");
    let text = description(FmiVersion::V3, [Some(""), None], "");
    let text = text.replace(r#"modelIdentifier="minimal""#, r#"modelIdentifier="other""#);
    pack(&path, &text, library(), &[]);
    for (fmu, is_own) in [(Fmu::open(&path), false), (Fmu::open_own(&path), true)] {
        let fmu = fmu.unwrap();
        let refused = Instance::new(&fmu, "one", &logged())
            .err()
            .unwrap()
            .to_string();
        assert!(
            refused.contains("is missing (is the modelIdentifier right?)"),
            "{refused}"
        );
        assert_eq!(refused.contains(CURE), is_own);
        assert!(fmu.hold().is_none());
    }
    assert!(stepped(FmiVersion::V3, "", "").hold().is_none());
    let text = description(FmiVersion::V3, [Some(""), None], "");
    pack(&path, &text, library(), &[]);
    assert!(Fmu::open_own(&path).unwrap().hold().is_some());
}
