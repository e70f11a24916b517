//! FMUs with a library: loops that their own derivatives solve, and ends that they ask for.

use std::sync::Arc;

use fmi_import::{FmiVersion, Fmu, Options};
use fmi_master::{Algorithm, Ending, Pace, Plan, Samples, Simulation};
use fmi_system::{Between, InputTable, SystemFile, assemble};

use crate::made::{BOTH, answering, description, exchanged, library, packed, stepped};
use crate::parts::{STEP, named, planned, run};

const VARIABLE: &str = r#"canHandleVariableCommunicationStepSize="true""#;

fn iterative() -> Plan {
    Plan {
        algorithm: Algorithm::Iterative,
        ..Plan::fixed(STEP, 1.0)
    }
}

/// `a = 2 b`, `b = 2 (0.3 a + 1)`: changes come back 1.2 times as large, and a is -20.
const TOGETHER: &str = "connections = [\"b.y -> a.u\", { connect = \"a.y -> b.u\", factor = 0.3, offset = 1.0 }]\n\
    [components.a]\nfmu = \"A\"\n[components.b]\nfmu = \"B\"\n";

fn pair(fmu: &Arc<Fmu>) -> Vec<(&'static str, Arc<Fmu>)> {
    vec![("A", fmu.clone()), ("B", fmu.clone())]
}

#[test]
fn a_loop_of_fmus_is_solved_by_their_derivatives_or_by_differences() {
    for (version, derivatives) in [
        (FmiVersion::V2, ""),
        (FmiVersion::V2, r#"providesDirectionalDerivative="true""#),
        (FmiVersion::V3, ""),
        (FmiVersion::V3, r#"providesDirectionalDerivatives="true""#),
        (FmiVersion::V3, r#"providesAdjointDerivatives="true""#),
    ] {
        let fmu = stepped(version, &format!("{VARIABLE} {derivatives}"), "");
        let mut parts = named(pair(&fmu));
        let outcome = run(TOGETHER, &mut parts, &Samples::none(STEP), &iterative(), 3);
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        let [a, b] = ["a.y", "b.y"].map(|name| outcome.record.column(name).unwrap());
        for (a, b) in a.iter().zip(&b) {
            assert!(
                (a + 20.0).abs() < 1e-8 && (b + 10.0).abs() < 1e-8,
                "{a} {b}"
            );
        }
    }
}

#[test]
fn a_loop_without_a_solution_names_its_round_and_why() {
    // a = 2 b, b = 2 (0.25 a + 1): b = b + 2.
    let text = TOGETHER.replace("0.3", "0.25");
    let fmu = stepped(FmiVersion::V3, VARIABLE, "");
    let file = SystemFile::parse("loop", &text).unwrap();
    let system = assemble(&file, &[], &mut named(pair(&fmu))).unwrap();
    let options = Options::default();
    let made = Simulation::planned(&system, &Samples::none(STEP), &iterative(), &options);
    let said = match made {
        Err(error) => error.to_string(),
        Ok(own) => {
            let outcome = own.run(3, Pace::Fastest, &mut |_| {});
            outcome.ended.message()
        }
    };
    assert!(
        said.contains("returns at its full size") && said.contains("a.y"),
        "{said}"
    );
}

#[test]
fn a_component_that_asks_for_the_end_is_heard() {
    for version in BOTH {
        for (fmu, time) in [
            (stepped(version, VARIABLE, ""), 0.05),
            (exchanged(version, ""), 0.1),
        ] {
            let has_steps = fmu.description.interface == fmi_import::Interface::CoSimulation;
            let text =
                "[components.a]\nfmu = \"A\"\n[components.a.parameters]\nanswer = 2\nover = true\n";
            let mut parts = named(vec![("A", fmu)]);
            let text = if has_steps {
                text.to_string()
            } else {
                text.replace("answer = 2\n", "")
            };
            let plan = Plan::fixed(STEP, 1.0);
            let outcome = planned(&text, &mut parts, &Samples::none(STEP), &plan);
            let outcome = outcome.run(10, Pace::Fastest, &mut |_| {});
            assert_eq!(
                outcome.ended.kind(),
                Ending::Terminated,
                "{}",
                outcome.ended.message()
            );
            assert!(outcome.ended.is_regular());
            let ended = outcome.ended.time().unwrap();
            assert!(ended <= time + 1e-12, "{ended}");
            // It is alone, so that its last row is at that time.
            let times = outcome.record.column("time").unwrap();
            assert_eq!(times.last(), Some(&ended));
        }
    }
}

#[test]
fn a_component_that_cannot_write_its_state_keeps_no_checkpoints() {
    let text = "[components.a]\nfmu = \"A\"\n";
    for (attributes, is_kept) in [
        ("", false),
        (r#"canGetAndSetFMUState="true""#, false),
        (
            r#"canGetAndSetFMUState="true" canSerializeFMUState="true""#,
            true,
        ),
    ] {
        let fmu = stepped(FmiVersion::V3, attributes, "");
        let plan = Plan::fixed(STEP, 1.0);
        let mut own = planned(
            text,
            &mut named(vec![("A", fmu)]),
            &Samples::none(STEP),
            &plan,
        );
        let kept = own.keep_checkpoints(1, Box::new(|_, _| Ok(())));
        assert_eq!(kept.is_ok(), is_kept);
        if let Err(error) = kept {
            assert!(error.to_string().contains("`a`"), "{error}");
        }
    }
}

/// `b.u` is `a.y`, which is declared to depend directly on `a.u`, a table that rises by 1 in a second.
#[test]
fn what_an_fmu_does_with_a_reading_after_a_setting_is_found_out() {
    for (version, answer, note) in [
        (FmiVersion::V2, 0, None),
        (FmiVersion::V3, 0, None),
        (
            FmiVersion::V2,
            108,
            Some("computes it only in its steps: a delay of 100 ms is added"),
        ),
        (
            FmiVersion::V3,
            108,
            Some("computes it only in its steps: a delay of 100 ms is added"),
        ),
        (
            FmiVersion::V2,
            109,
            Some("`a` refuses to give outputs once inputs are set"),
        ),
    ] {
        let described = description(version, [Some(VARIABLE), None], "");
        let own = packed(&answering(&described, answer), library());
        let all = vec![("A", own), ("B", stepped(version, VARIABLE, ""))];
        let text = "connections = [\"load.force -> a.u\", \"a.y -> b.u\"]\n[components.a]\nfmu = \"A\"\n\
            [components.b]\nfmu = \"B\"\n";
        let mut file = SystemFile::parse("two", text).unwrap();
        file.own_tables.push(InputTable {
            name: "load".into(),
            columns: vec!["force".into()],
            units: vec![None],
            times: vec![0.0, 2.0],
            values: vec![vec![0.0, 2.0]],
            between: Between::Linear,
        });
        let system = assemble(&file, &[], &mut named(all)).unwrap();
        let plan = Plan::fixed(STEP, 1.0);
        let made = Simulation::planned(&system, &Samples::none(STEP), &plan, &Options::default());
        let outcome = made.unwrap().run(8, Pace::Fastest, &mut |_| {});
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        let found = outcome
            .notes
            .iter()
            .any(|own| note.is_some_and(|note| own.contains(note)));
        assert_eq!(
            (found, outcome.notes.len()),
            (note.is_some(), usize::from(note.is_some()))
        );
        // Late by a step where it cannot be otherwise.
        let y = outcome.record.column("a.y").unwrap();
        let late = if note.is_some() { 1.0 } else { 0.0 };
        for (n, y) in y.iter().enumerate().skip(1) {
            let expected = 2.0 * STEP * (n as f64 - late);
            assert!((y - expected).abs() < 1e-12, "{version} {answer} {n}: {y}");
        }
    }
}
