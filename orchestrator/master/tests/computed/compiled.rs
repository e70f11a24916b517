//! FMUs with a library: loops that their own derivatives solve, and ends that they ask for.

use std::sync::Arc;

use fmi_import::{FmiVersion, Fmu};
use fmi_master::{Algorithm, Ending, Plan, Samples};

use crate::made::{BOTH, exchanged, stepped};
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
    let file = fmi_system::SystemFile::parse("loop", &text).unwrap();
    let system = fmi_system::assemble(&file, &[], &mut named(pair(&fmu))).unwrap();
    let options = fmi_import::Options::default();
    let made =
        fmi_master::Simulation::planned(&system, &Samples::none(STEP), &iterative(), &options);
    let said = match made {
        Err(error) => error.to_string(),
        Ok(own) => {
            let outcome = own.run(3, fmi_master::Pace::Fastest, &mut |_| {});
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
            let outcome = outcome.run(10, fmi_master::Pace::Fastest, &mut |_| {});
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
