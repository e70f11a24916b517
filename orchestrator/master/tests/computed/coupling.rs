//! How continuous components are coupled over a step.

use std::sync::Arc;

use fmi_import::{Fmu, Options};
use fmi_master::{Algorithm, MasterError, Outcome, Plan, Samples, Simulation, VariableStep};
use fmi_system::{SystemFile, assemble};

use crate::parts::{Parts, RATE, RING, STEP, named, own, parts, planned, run};

/// The parts of [`RING`] with inputs in mm and outputs in m, and all without units.
fn rings() -> [Parts; 2] {
    let variables = |start: &str| {
        format!(
            r#"<Float64 name="u" valueReference="1" causality="input" start="0"/>
            <Float64 name="y" valueReference="2" causality="output" initial="exact" start="{start}"/>"#
        )
    };
    let any = r#"canHandleVariableCommunicationStepSize="true""#;
    let body = own(&variables("1"), any, false, &[1.0], |_, step, u, own, y| {
        own[0] += step * u[0];
        y[0] = own[0];
    });
    let back = own(&variables("0"), any, false, &[0.0], |_, step, u, own, y| {
        own[0] -= step * RATE * u[0];
        y[0] = own[0];
    });
    [parts(10.0), named(vec![("Body", body), ("Back", back)])]
}

/// `x' = v`, `v' = -RATE x`, with the input held at the mean of both ends.
#[test]
fn the_iterative_coupling_is_the_trapezoidal_rule() {
    let plan = Plan {
        algorithm: Algorithm::Iterative,
        ..Plan::fixed(STEP, 2.0)
    };
    for mut parts in rings() {
        is_trapezoidal(&run(RING, &mut parts, &Samples::none(STEP), &plan, 20));
    }
}

fn is_trapezoidal(outcome: &Outcome) {
    let (mut x, mut v) = (1.0, 0.0);
    let found = ["x.y", "v.y"].map(|name| outcome.record.column(name).unwrap());
    let half = 0.5 * STEP;
    for n in 0..20 {
        assert!(
            (found[0][n] - x).abs() < 1e-11 && (found[1][n] - v).abs() < 1e-11,
            "{n}"
        );
        // (1 + h2 RATE) v' = (1 - h2 RATE) v - h RATE x, with h2 = h² / 4.
        let share = half * half * RATE;
        let next = ((1.0 - share) * v - STEP * RATE * x) / (1.0 + share);
        (x, v) = (x + half * (v + next), next);
    }
}

/// The input over a step is its value at the middle, on the line through the last two.
#[test]
fn the_coupling_in_order_extrapolates_to_the_middle_of_the_step() {
    for plan in [Plan::fixed(STEP, 2.0), varying(1e-3, Some(STEP))] {
        for mut parts in rings() {
            extrapolates(&run(RING, &mut parts, &Samples::none(STEP), &plan, 20));
        }
    }
}

fn extrapolates(outcome: &Outcome) {
    let [x, v] = ["x.y", "v.y"].map(|name| outcome.record.column(name).unwrap());
    for n in 1..19 {
        let middle = 1.5 * v[n] - 0.5 * v[n - 1];
        assert!((x[n + 1] - x[n] - STEP * middle).abs() < 1e-12, "{n}");
        let middle = 1.5 * x[n] - 0.5 * x[n - 1];
        assert!(
            (v[n + 1] - v[n] + STEP * RATE * middle).abs() < 1e-12,
            "{n}"
        );
    }
}

fn varying(tolerance: f64, least: Option<f64>) -> Plan {
    Plan {
        variable: Some(VariableStep { tolerance, least }),
        ..Plan::fixed(STEP, 1.0)
    }
}

#[test]
fn steps_without_coupling_are_the_longest() {
    let text = "[components.x]\nfmu = \"Body\"\n";
    let outcome = run(
        text,
        &mut parts(10.0),
        &Samples::none(STEP),
        &varying(1e-3, Some(STEP / 4.0)),
        10,
    );
    let taken = outcome.variable.unwrap();
    assert_eq!((outcome.steps, taken.repeated, taken.over), (10, 0, 0));
    let lengths = [
        taken.least_s,
        taken.greatest_s,
        taken.shortest_s,
        taken.longest_s,
    ];
    for (length, expected) in lengths.into_iter().zip([STEP / 4.0, STEP, STEP, STEP]) {
        assert!((length - expected).abs() < 1e-15, "{lengths:?}");
    }
    assert_eq!((taken.worst_percent, taken.worst_signal), (0.0, None));
    assert!(
        outcome
            .notes
            .iter()
            .any(|note| note.contains("every step is the longest"))
    );
    assert!((outcome.simulated - 1.0).abs() < 1e-12 && outcome.step == taken.greatest_s);
}

#[test]
fn a_variable_step_that_cannot_vary_is_reported() {
    let notes = |plan: &Plan| run(RING, &mut parts(10.0), &Samples::none(STEP), plan, 10).notes;
    let all = notes(&varying(1e-3, Some(STEP)));
    assert_eq!(all.len(), 1);
    assert!(all[0].starts_with("the shortest step is as long as the longest"));
    assert!(notes(&varying(1e-3, Some(STEP / 2.0))).is_empty());
}

#[test]
fn a_coupled_step_is_divided_and_names_the_worst_signal() {
    let outcome = run(
        RING,
        &mut parts(10.0),
        &Samples::none(STEP),
        &varying(1e-5, None),
        10,
    );
    let taken = outcome.variable.unwrap();
    assert!((taken.least_s - STEP / 1024.0).abs() < 1e-15);
    assert!(taken.shortest_s < STEP && taken.shortest_s >= taken.least_s);
    assert!(
        ["x.y", "v.y"]
            .map(String::from)
            .contains(&taken.worst_signal.unwrap())
    );
    assert!(outcome.ended.is_regular());
}

const PAIR: &str = r#"<Float64 name="u" valueReference="1" causality="input" start="0"/>
<Float64 name="y" valueReference="2" causality="output" initial="exact" start="1"/>"#;

fn still(attributes: &str) -> Arc<Fmu> {
    own(PAIR, attributes, false, &[], |_, _, _, _, _| {})
}

fn refusal(fmu: Arc<Fmu>, plan: &Plan) -> String {
    let file = SystemFile::parse("one", "[components.part]\nfmu = \"Own\"\n").unwrap();
    let system = assemble(&file, &[], &mut named(vec![("Own", fmu)])).unwrap();
    let made = Simulation::planned(&system, &Samples::none(STEP), plan, &Options::default());
    match made.err() {
        Some(MasterError::VariableStep(reason) | MasterError::Step(reason)) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn steps_that_do_not_suit_the_components_are_refused() {
    let any = r#"canHandleVariableCommunicationStepSize="true""#;
    let jacobi = Plan {
        algorithm: Algorithm::Jacobi,
        ..varying(1e-3, None)
    };
    let third = varying(1e-3, Some(STEP / 2.5));
    let more = varying(1e-3, Some(2.0 * STEP));
    let own = r#"canHandleVariableCommunicationStepSize="true" fixedInternalStepSize="0.04""#;
    let odd = varying(1e-3, Some(STEP / 4.0));
    for (attributes, plan, expected) in [
        (any, &jacobi, "jacobi"),
        (
            "",
            &varying(1e-3, None),
            "`part` needs steps of equal length",
        ),
        (any, &third, "does not divide the longest, 0.1 s"),
        (any, &more, "does not divide the longest, 0.1 s"),
        (
            own,
            &varying(1e-3, None),
            "the fixedInternalStepSize of `part`",
        ),
        (own, &odd, "`part` has an internal step of 0.04 s"),
        (
            any,
            &Plan::fixed(0.03, 1.0),
            "does not divide the sample time of the motion, 100 ms",
        ),
        (any, &Plan::fixed(1e-10, 1.0), "shorter than a nanosecond"),
        (any, &Plan::fixed(0.2, 1.0), "a coupling step of 200 ms"),
    ] {
        let reason = refusal(still(attributes), plan);
        assert!(reason.contains(expected), "{expected}: {reason}");
    }
    let own = r#"canHandleVariableCommunicationStepSize="true" fixedInternalStepSize="0.025""#;
    let mut parts: Parts = named(vec![("Own", still(own))]);
    let text = "[components.part]\nfmu = \"Own\"\n";
    let simulation = planned(text, &mut parts, &Samples::none(STEP), &varying(1e-3, None));
    // The least step is its own.
    assert!((simulation.step() - 0.025).abs() < 1e-15);
}

/// `y = c - g u` of each at every call: the loop of two has one solution.
#[test]
fn a_loop_of_direct_feedthrough_is_solved() {
    let law = |constant: &'static str, equations| {
        let variables = format!(
            r#"<Float64 name="u" valueReference="1" causality="input" start="0"/>
            <Float64 name="y" valueReference="2" causality="output" initial="exact" start="{constant}"/>"#
        );
        own(&variables, "", true, &[], equations)
    };
    let text = "connections = [\"a.y -> b.u\", \"b.y -> a.u\"]\n[components.a]\nfmu = \"A\"\nperiod = \"0.1 s\"\n\
        [components.b]\nfmu = \"B\"\nperiod = \"0.1 s\"\n";
    let plan = Plan {
        algorithm: Algorithm::Iterative,
        ..Plan::fixed(STEP, 1.0)
    };
    let outcome = run(
        text,
        &mut named(vec![
            ("A", law("0", |_, _, u, _, y| y[0] = 1.0 - 0.5 * u[0])),
            ("B", law("0", |_, _, u, _, y| y[0] = 2.0 + 3.0 * u[0])),
        ]),
        &Samples::none(STEP),
        &plan,
        5,
    );
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    // a = 1 - 0.5 (2 + 3 a): a = 0, b = 2.
    let [a, b] = ["a.y", "b.y"].map(|name| outcome.record.column(name).unwrap());
    assert!(
        a.iter().all(|a| a.abs() < 1e-9) && b.iter().all(|b| (b - 2.0).abs() < 1e-9),
        "{a:?} {b:?}"
    );
}
