//! Values of other types on their way, tables, further names, and what ends a run.

use fmi_import::Datum;
use fmi_master::{Ended, Ending, Plan, Samples};
use fmi_system::{Between, InputTable, SystemFile};

use crate::parts::{STEP, named, own, run};

/// Every type that an output can have, counted by the steps.
const SOURCE: &str = r#"
<Float32 name="f" valueReference="1" causality="output" initial="exact" start="0"/>
<Int16 name="i" valueReference="2" causality="output" initial="exact" start="0"/>
<Boolean name="b" valueReference="3" causality="output" initial="exact" start="false"/>
<Int64 name="l" valueReference="4" causality="output" initial="exact" start="0"/>
<Float64 name="a" valueReference="5" causality="output" initial="exact" start="0 0 0"><Dimension start="3"/></Float64>
<Enumeration name="cause" declaredType="Cause" valueReference="6" causality="output" initial="exact" start="0"/>"#;

/// Adds what comes in.
const SINK: &str = r#"
<Float32 name="f" valueReference="1" causality="input" start="0"/>
<Int32 name="i" valueReference="2" causality="input" start="0"/>
<Boolean name="b" valueReference="3" causality="input" start="false"/>
<Int64 name="l" valueReference="4" causality="input" start="0"/>
<Float64 name="a" valueReference="5" causality="input" start="0 7 0"><Dimension start="3"/></Float64>
<Float64 name="scaled" valueReference="6" causality="input" start="0"/>
<Float64 name="seen" valueReference="7" causality="output" initial="exact" start="0 0 0 0 0 0 0 0"><Dimension
start="8"/></Float64>"#;

#[test]
fn values_of_every_type_reach_the_inputs_that_they_are_connected_to() {
    let source = own(SOURCE, "", false, &[0.0], |_, _, _, count, y| {
        count[0] += 1.0;
        let n = count[0];
        let odd = f64::from(u8::from(n % 2.0 == 1.0));
        y.copy_from_slice(&[0.5 * n, -n, odd, 1e3 * n, n, 2.0 * n, 3.0 * n, 0.0]);
    });
    let sink = own(SINK, "", true, &[], |_, _, u, _, y| y.copy_from_slice(u));
    let text = r#"connections = ["source.f -> sink.f", "source.i -> sink.i", "source.b -> sink.b",
        "source.l -> sink.l", "source.a[1] -> sink.a[1]", "source.a[2] -> sink.a[3]",
        { connect = "source.a[3] -> sink.scaled", factor = 2.0, offset = -1.0 }]
        [components.source]
        fmu = "Source"
        aliases = { third = "a[3]" }
        [components.sink]
        fmu = "Sink"
        period = "0.1 s"
        "#;
    let mut parts = named(vec![("Source", source), ("Sink", sink)]);
    let outcome = run(
        text,
        &mut parts,
        &Samples::none(STEP),
        &Plan::fixed(STEP, 0.5),
        5,
    );
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    let record = &outcome.record;
    for n in 0..5 {
        let count = n as f64;
        let odd = f64::from(u8::from(n % 2 == 1));
        let seen: Vec<f64> = (1..=8)
            .map(|at| record.column(&format!("sink.seen[{at}]")).unwrap()[n])
            .collect();
        let scaled = 6.0 * count - 1.0;
        assert_eq!(
            seen,
            [
                0.5 * count,
                -count,
                odd,
                1e3 * count,
                count,
                7.0,
                2.0 * count,
                scaled
            ]
        );
        assert_eq!(record.exact(n), [Datum::Signed(1000 * n as i64)]);
        assert_eq!(record.column("source.third").unwrap()[n], 3.0 * count);
    }
    assert_eq!(record.exact_columns, ["source.l"]);
}

const ENDING: &str = r#"
<Boolean name="tripped" valueReference="1" causality="output" initial="exact" start="false"/>
<Enumeration name="cause" declaredType="Cause" valueReference="2" causality="output" initial="exact" start="0"/>"#;

#[test]
fn the_system_ends_the_run_some_time_after_it_asked_for_it() {
    for (after, rows) in [("", 5), ("end_after = \"0.25 s\"\n", 8)] {
        // True from 0.4 s on.
        let fmu = own(ENDING, "", false, &[], |time, step, _, _, y| {
            let is_over = time + step > 0.35;
            (y[0], y[1]) = (
                f64::from(u8::from(is_over)),
                if is_over { 4.0 } else { 0.0 },
            );
        });
        let text = format!(
            "[experiment]\nend_when = \"part.tripped\"\nend_cause = \"part.cause\"\n{after}\
            [components.part]\nfmu = \"Own\"\n"
        );
        let plan = Plan::fixed(STEP, 2.0);
        let outcome = run(
            &text,
            &mut named(vec![("Own", fmu)]),
            &Samples::none(STEP),
            &plan,
            20,
        );
        let Ended::Interlock {
            signal,
            time,
            cause,
        } = &outcome.ended
        else {
            panic!("{:?}", outcome.ended);
        };
        assert_eq!(
            (signal.as_str(), cause.as_deref()),
            ("part.tripped", Some("too far"))
        );
        assert!((time - 0.4).abs() < 1e-12);
        assert_eq!(
            (outcome.ended.kind(), outcome.record.len()),
            (Ending::Interlock, rows)
        );
        let said = "`part.tripped` became true at 0.400 s: too far";
        assert_eq!(outcome.ended.message(), said);
    }
}

#[test]
fn a_value_that_nothing_physical_has_is_a_run_that_diverges() {
    let y =
        r#"<Float64 name="y" valueReference="1" causality="output" initial="exact" start="1"/>"#;
    let fmu = own(y, "", false, &[], |_, _, _, _, y| y[0] *= -1e12);
    let text = "[components.part]\nfmu = \"Own\"\n";
    let plan = Plan::fixed(STEP, 2.0);
    let outcome = run(
        text,
        &mut named(vec![("Own", fmu)]),
        &Samples::none(STEP),
        &plan,
        20,
    );
    // 1e24 at 0.2 s, -1e36 at 0.3 s.
    assert_eq!(
        (outcome.ended.kind(), outcome.record.len()),
        (Ending::Failed, 4)
    );
    let said = outcome.ended.message();
    assert!(said.contains("part.y") && said.contains("0.3"), "{said}");
}

#[test]
fn a_table_is_followed_as_it_is_between_its_rows() {
    for (between, expected) in [
        (Between::Linear, [1.0, 2.0, 3.0, 2.0, 1.0, 1.0]),
        (Between::Hold, [1.0, 1.0, 3.0, 3.0, 1.0, 1.0]),
    ] {
        let variables = r#"<Float64 name="u" valueReference="1" causality="input" start="0"/>
            <Float64 name="y" valueReference="2" causality="output" initial="exact" start="0"/>"#;
        let fmu = own(variables, "", true, &[], |_, _, u, _, y| y[0] = u[0]);
        let text = "connections = [\"force.load -> part.u\"]\n[components.part]\nfmu = \"Own\"\nperiod = \"0.1 s\"\n";
        let mut file = SystemFile::parse("own", text).unwrap();
        file.own_tables.push(InputTable {
            name: "force".into(),
            columns: vec!["load".into()],
            units: vec![None],
            times: vec![0.0, 0.2, 0.4],
            values: vec![vec![1.0, 3.0, 1.0]],
            between,
        });
        let system = fmi_system::assemble(&file, &[], &mut named(vec![("Own", fmu)])).unwrap();
        let plan = Plan::fixed(STEP, 0.6);
        let options = fmi_import::Options::default();
        let own = fmi_master::Simulation::planned(&system, &Samples::none(STEP), &plan, &options);
        let outcome = own.unwrap().run(6, fmi_master::Pace::Fastest, &mut |_| {});
        let y = outcome.record.column("part.y").unwrap();
        let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
        assert!(y.iter().zip(&expected).all(same), "{between:?}: {y:?}");
    }
}

#[test]
fn arrays_and_exact_values_of_several_types_are_set_as_a_whole() {
    for is_sampled in [false, true] {
        arrays_are_set(is_sampled);
    }
}

fn arrays_are_set(is_sampled: bool) {
    let source = own(
        r#"<Float64 name="first" valueReference="1" causality="output" initial="exact" start="0"/>
        <Float64 name="a" valueReference="2" causality="output" initial="exact" start="0 0 0"><Dimension start="3"/>
        </Float64>
        <Int64 name="l" valueReference="3" causality="output" initial="exact" start="0"/>
        <UInt64 name="m" valueReference="4" causality="output" initial="exact" start="0"/>
        <Int64 name="n" valueReference="5" causality="output" initial="exact" start="0"/>"#,
        "",
        is_sampled,
        &[0.0],
        |_, _, _, count, y| {
            count[0] += 1.0;
            for (y, factor) in y.iter_mut().zip([1.0, 10.0, 20.0, 30.0, -5.0, 6.0, -7.0]) {
                *y = factor * count[0];
            }
        },
    );
    let sink = own(
        r#"<Float64 name="before" valueReference="1" causality="input" start="0"/>
        <Float64 name="a" valueReference="2" causality="input" start="0 0 0"><Dimension start="3"/></Float64>
        <Int64 name="n" valueReference="3" causality="input" start="0"/>
        <UInt64 name="m" valueReference="4" causality="input" start="0"/>
        <Int64 name="l" valueReference="5" causality="input" start="0"/>
        <Float64 name="seen" valueReference="7" causality="output" initial="exact" start="0 0 0 0 0 0 0"><Dimension
        start="7"/></Float64>"#,
        "",
        true,
        &[],
        |_, _, u, _, y| y.copy_from_slice(u),
    );
    let period = if is_sampled { "period = 0.1" } else { "" };
    let text = r#"connections = ["source.first -> sink.before", "source.a -> sink.a", "source.l -> sink.l",
        "source.m -> sink.m", "source.n -> sink.n"]
        [components.source]
        fmu = "Source"
        PERIOD
        [components.sink]
        fmu = "Sink"
        period = "0.1 s"
        "#
    .replace("PERIOD", period);
    let mut parts = named(vec![("Source", source), ("Sink", sink)]);
    let plan = Plan::fixed(STEP, 0.4);
    let outcome = run(&text, &mut parts, &Samples::none(STEP), &plan, 4);
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    for n in 0..4 {
        // A sampled one is called at a sample before what takes its values.
        let count = if is_sampled { n + 1 } else { n } as f64;
        let seen: Vec<f64> = (1..=7)
            .map(|at| outcome.record.column(&format!("sink.seen[{at}]")).unwrap()[n])
            .collect();
        let expected = [1.0, 10.0, 20.0, 30.0, -7.0, 6.0, -5.0];
        assert_eq!(seen, expected.map(|factor| factor * count));
    }
    // Each trivial step takes less than this by far.
    let names: Vec<&str> = outcome
        .spent
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(names, ["sink", "source"]);
    assert!(
        outcome
            .spent
            .iter()
            .all(|(_, time)| (0.0..0.5).contains(time))
    );
}

/// A controller that fails at its fourth call, and a guard that trips a call after it is told to.
#[test]
fn a_sampled_component_that_fails_is_followed_by_the_guard() {
    let law = own(
        r#"<Float64 name="y" valueReference="1" causality="output" initial="exact" start="0"/>"#,
        "",
        true,
        &[0.0],
        |_, _, _, count, y| {
            count[0] += 1.0;
            y[0] = if count[0] > 3.0 {
                f64::NAN
            } else {
                10.0 * count[0]
            };
        },
    );
    let guard = own(
        r#"<Boolean name="stop" valueReference="1" causality="input" start="false"/>
        <Boolean name="tripped" valueReference="2" causality="output" initial="exact" start="false"/>"#,
        "",
        true,
        &[],
        |_, _, u, _, y| y[0] = u[0],
    );
    let text = |more: &str| {
        format!(
            "[experiment]\nend_when = \"guard.tripped\"\n{more}[components.law]\nfmu = \"Law\"\n\
            period = \"0.1 s\"\n[components.guard]\nfmu = \"Guard\"\nperiod = \"0.1 s\"\n"
        )
    };
    let mut parts = named(vec![("Law", law), ("Guard", guard)]);
    let plan = Plan::fixed(STEP, 2.0);
    let mut of = |more: &str| run(&text(more), &mut parts, &Samples::none(STEP), &plan, 20);
    let outcome = of("stop = \"guard.stop\"\n");
    let Ended::Stopped { error, time } = &outcome.ended else {
        panic!("{:?}", outcome.ended);
    };
    assert!(error.to_string().contains("has no value") && (time - 0.4).abs() < 1e-12);
    // Its output keeps the value of the last call that went well.
    let [law, guard] = ["law.y", "guard.tripped"].map(|name| outcome.record.column(name).unwrap());
    assert_eq!(law, [10.0, 20.0, 30.0, 30.0, 30.0]);
    assert_eq!(guard, [0.0, 0.0, 0.0, 0.0, 1.0]);
    // Without a guard the run ends there.
    let outcome = of("");
    assert_eq!(
        (outcome.ended.kind(), outcome.record.len()),
        (Ending::Failed, 3)
    );
    assert!(outcome.ended.message().contains("has no value"));
}
