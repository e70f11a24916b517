//! A run between its steps: kept, gone on from, moved from outside, changed and ended.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use fmi_master::{
    Asked, Checkpoint, Column, Driven, Ended, Ending, MasterError, Observer, Pace, Panel, Plan,
    Record, Samples, Simulation, Stepwise, Tunable, VariableStep,
};

use crate::parts::{LOOP, RATE, RING, STEP, named, own, parts, planned};

/// 20 samples of a body under its law.
fn fresh() -> Simulation {
    planned(
        LOOP,
        &mut parts(10.0),
        &Samples::none(STEP),
        &Plan::fixed(STEP, 2.0),
    )
}

fn whole(simulation: Simulation) -> Record {
    let outcome = simulation.run(20, Pace::Fastest, &mut |_| {});
    assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
    outcome.record
}

#[test]
fn time_and_signals_are_those_of_the_present_step() {
    let text = format!("{LOOP}[experiment]\nstart = 5.0\n");
    let half = Plan::fixed(STEP / 2.0, 2.0);
    let mut own = planned(&text, &mut parts(10.0), &Samples::none(STEP), &half);
    assert_eq!((own.time(), own.step()), (5.0, STEP / 2.0));
    own.observe().unwrap();
    for _ in 0..3 {
        own.advance().unwrap();
        own.observe().unwrap();
    }
    assert!((own.time() - 5.15).abs() < 1e-12);
    let body = own.names().iter().position(|name| name == "body.y");
    // The law's command is that of the sample: 1 is held twice, then what is there.
    let sampled = 1.0 - STEP * RATE;
    let expected = sampled - 0.5 * STEP * RATE * sampled;
    assert!((own.signals()[body.unwrap()] - expected).abs() < 1e-12);
    assert_eq!(own.exchanges(), 0);
}

/// Checkpoints that were kept, with the rows until then.
type Kept = Arc<Mutex<Vec<(Checkpoint, Record)>>>;

fn keeping(simulation: &mut Simulation, every: usize) -> Kept {
    let kept = Kept::default();
    let into = kept.clone();
    let keep = move |checkpoint: &Checkpoint, record: &Record| {
        into.lock()
            .unwrap()
            .push((checkpoint.clone(), record.clone()));
        Ok(())
    };
    simulation.keep_checkpoints(every, Box::new(keep)).unwrap();
    kept
}

#[test]
fn a_run_goes_on_from_a_checkpoint_to_the_bit() {
    let all = whole(fresh());
    let mut first = fresh();
    let kept = keeping(&mut first, 8);
    whole(first);
    let kept = kept.lock().unwrap();
    let rows: Vec<(usize, usize)> = kept
        .iter()
        .map(|(at, record)| (at.tick, record.len()))
        .collect();
    assert_eq!(rows, [(8, 8), (16, 16)]);
    for (checkpoint, record) in kept.iter() {
        let mut second = fresh();
        second.resume(checkpoint, record.clone()).unwrap();
        assert!((checkpoint.time - STEP * checkpoint.tick as f64).abs() < 1e-12);
        assert_eq!(whole(second), all);
    }
    let mut other = planned(
        RING,
        &mut parts(10.0),
        &Samples::none(STEP),
        &Plan::fixed(STEP, 2.0),
    );
    let refused = other.resume(&kept[0].0, kept[0].1.clone());
    assert!(matches!(refused, Err(MasterError::OtherCheckpoint)));
}

#[test]
fn a_run_with_variable_steps_goes_on_to_the_bit() {
    let fresh = || {
        let plan = Plan {
            variable: Some(VariableStep {
                tolerance: 1e-3,
                least: None,
            }),
            ..Plan::fixed(STEP, 2.0)
        };
        planned(RING, &mut parts(10.0), &Samples::none(STEP), &plan)
    };
    let mut first = fresh();
    let kept = keeping(&mut first, 7);
    let all = whole(first);
    let kept = kept.lock().unwrap();
    let (checkpoint, record) = &kept[1];
    assert_eq!(record.len(), 14);
    let mut second = fresh();
    second.resume(checkpoint, record.clone()).unwrap();
    assert_eq!(whole(second), all);
}

#[test]
fn a_run_goes_on_where_no_checkpoint_can_be_kept() {
    let mut own = fresh();
    let mut tried = 0;
    let keep = move |_: &Checkpoint, _: &Record| {
        tried += 1;
        assert_eq!(tried, 1);
        Err("the disk is full".into())
    };
    own.keep_checkpoints(5, Box::new(keep)).unwrap();
    let outcome = own.run(20, Pace::Fastest, &mut |_| {});
    assert_eq!(outcome.record.len(), 20);
    let note = "no checkpoints are saved from 0.5 s on: the disk is full";
    assert_eq!(outcome.notes, [note]);
}

#[test]
fn an_interrupted_run_ends_at_once_with_a_checkpoint() {
    static ASKED: AtomicBool = AtomicBool::new(false);
    struct Asks;
    impl Observer for Asks {
        fn row(&self, time: f64, _: &[f64]) {
            ASKED.store(time > 0.45, Ordering::Relaxed);
        }
    }
    let mut own = fresh();
    own.heed(&ASKED);
    own.watch(Arc::new(Asks));
    let kept = keeping(&mut own, 100);
    let outcome = own.run(20, Pace::Fastest, &mut |_| {});
    assert_eq!(
        (outcome.ended.kind(), outcome.record.len()),
        (Ending::Interrupted, 6)
    );
    assert!((outcome.ended.time().unwrap() - 0.6).abs() < 1e-12);
    let (checkpoint, record) = kept.lock().unwrap().remove(0);
    assert_eq!((checkpoint.tick, record.len()), (6, 6));
    // Asked for before the first step: there is nothing to keep.
    ASKED.store(true, Ordering::Relaxed);
    let mut own = fresh();
    own.heed(&ASKED);
    let kept = keeping(&mut own, 1);
    let outcome = own.run(20, Pace::Fastest, &mut |_| {});
    assert_eq!(outcome.ended.message(), "interrupted at 0 s");
    assert!(outcome.record.is_empty() && kept.lock().unwrap().is_empty());
}

#[test]
fn rows_are_kept_in_every_so_many_samples_and_progress_is_reported() {
    let mut own = fresh();
    own.keep_every(3);
    let mut reached = Vec::new();
    let outcome = own.run(20, Pace::Fastest, &mut |samples| reached.push(samples));
    let times = outcome.record.column("time").unwrap();
    let expected: Vec<f64> = (0..7).map(|row| 0.3 * f64::from(row)).collect();
    let same = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
    assert!(
        times.len() == 7 && times.iter().zip(&expected).all(same),
        "{times:?}"
    );
    assert_eq!(reached, [0, 7]);
    assert_eq!((outcome.steps, outcome.step), (20, STEP));
    assert!(outcome.wall >= 0.0 && (outcome.simulated - 2.0).abs() < 1e-12);
}

#[test]
fn a_run_in_real_time_is_not_ahead_of_it() {
    let plan = Plan::fixed(STEP / 50.0, 0.02);
    let text = LOOP.replace("0.1 s", "2 ms");
    let own = planned(&text, &mut parts(10.0), &Samples::none(STEP / 50.0), &plan);
    let begun = std::time::Instant::now();
    let outcome = own.run(10, Pace::RealTime, &mut |_| {});
    // The last step begins at 18 ms.
    assert!(begun.elapsed().as_secs_f64() >= 0.018);
    assert!(outcome.wall >= 0.018);
    assert_eq!(outcome.real_time.unwrap().deadlines, 9);
}

#[test]
fn a_simulation_goes_back_to_a_moment_and_on_the_same_way() {
    let all = whole(fresh());
    let mut own = Stepwise::new(fresh(), 20).unwrap();
    for _ in 0..5 {
        assert!(own.step());
    }
    let moment = own.save().unwrap();
    assert!((moment.time() - 0.5).abs() < 1e-12);
    while own.step() {}
    assert!(own.is_over() && matches!(own.ended(), Some(Ended::Complete)));
    assert!(matches!(own.save(), Err(MasterError::Ended { .. })));
    assert_eq!(own.record(), &all);
    own.restore(&moment).unwrap();
    assert_eq!(own.record().len(), 6);
    assert!(!own.is_over() && (own.simulation().time() - 0.5).abs() < 1e-12);
    while own.step() {}
    assert!(!own.step());
    assert_eq!(own.record(), &all);
    let mut own = Stepwise::new(fresh(), 20).unwrap();
    own.step();
    assert_eq!(own.finish().ended.kind(), Ending::Interrupted);
}

const FOLLOWER: &str =
    "connections = [\"reference.displacement -> body.u\"]\n[components.body]\nfmu = \"Rest\"\n";

fn driven() -> Driven {
    let column = Column {
        values: vec![0.0; 8],
        after: 0.0,
    };
    let samples = Samples {
        period: STEP,
        columns: vec![column; 3],
    };
    assert_eq!((samples.len(), samples.is_empty()), (8, false));
    let plan = Plan::fixed(STEP, 1.0);
    Driven::new(planned(FOLLOWER, &mut parts(0.5), &samples, &plan)).unwrap()
}

fn asked(displacement: f64) -> Asked {
    Asked {
        displacement,
        ..Asked::default()
    }
}

#[test]
fn what_is_asked_for_from_outside_moves_the_system_a_step_later() {
    let mut own = driven();
    own.advance(&asked(1.0)).unwrap();
    own.advance(&asked(2.0)).unwrap();
    own.save().unwrap();
    own.advance(&asked(-3.0)).unwrap();
    own.restore().unwrap();
    assert!((own.simulation().time() - 0.2).abs() < 1e-12);
    // Another value at the same moment takes the place of its row.
    own.place(&asked(1.5)).unwrap();
    own.advance(&asked(0.0)).unwrap();
    let outcome = own.finish(Ended::Complete);
    let [asked, body] =
        ["reference.displacement", "body.y"].map(|name| outcome.record.column(name).unwrap());
    assert_eq!(asked, [0.0, 1.0, 1.5, 0.0]);
    for (found, expected) in body.iter().zip([0.0, 0.0, 0.1, 0.25]) {
        assert!((found - expected).abs() < 1e-12, "{body:?}");
    }
}

#[test]
fn a_component_that_fails_is_reported_to_whoever_moves_it() {
    let mut own = driven();
    own.advance(&asked(6.0)).unwrap();
    let failed = own.advance(&asked(0.0)).unwrap_err().to_string();
    assert!(failed.contains("leaves its limit of 0.5 m"), "{failed}");
}

const SCALED: &str = r#"<Float64 name="gain" valueReference="1" causality="parameter" variability="tunable" start="3"/>
<Float64 name="bias" valueReference="4" causality="parameter" variability="tunable" start="3"/>
<Int32 name="whole" valueReference="5" causality="parameter" variability="tunable" start="3"/>
<Float64 name="fixed" valueReference="2" causality="parameter" variability="fixed" start="3"/>
<Float64 name="y" valueReference="3" causality="output" initial="exact" start="0"/>"#;

#[test]
fn a_parameter_moves_along_its_line_and_the_run_can_be_repeated() {
    let fresh = || {
        let fmu = own(SCALED, "", false, &[], |time, step, _, _, y| {
            y[0] = time + step
        });
        let text = "[components.part]\nfmu = \"Own\"\n";
        let plan = Plan::fixed(STEP, 1.0);
        planned(
            text,
            &mut named(vec![("Own", fmu)]),
            &Samples::none(STEP),
            &plan,
        )
    };
    let tunable = |variable: &str| Tunable {
        variable: variable.to_string(),
        start: 3.0,
        low: 0.0,
        high: 10.0,
    };
    let all = vec![tunable("part.bias"), tunable("part.gain")];
    let panel = Arc::new(Panel::new(all, 4));
    assert_eq!((panel.samples(), panel.tunables().len()), (4, 2));
    assert_eq!(Panel::new(Vec::new(), 0).samples(), 1);
    let mut first = fresh();
    first.tune(panel.clone()).unwrap();
    assert_eq!(panel.ask("part.gain", 5.0), Ok(5.0));
    let outcome = first.run(10, Pace::Fastest, &mut |_| {});
    let gain = outcome.record.column("part.gain").unwrap();
    assert_eq!(gain, [3.0, 3.5, 4.0, 4.5, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0]);
    assert_eq!(outcome.record.column("part.bias"), None);
    assert_eq!(panel.values(), [3.0, 5.0]);
    assert_eq!(panel.changes(), outcome.changes);
    let [change] = &outcome.changes[..] else {
        panic!("{:?}", outcome.changes);
    };
    assert_eq!(
        (change.sample, change.samples, change.from, change.to),
        (0, 4, 3.0, 5.0)
    );
    assert!(panel.ask("part.gain", 1.0).is_err());

    let mut later = change.clone();
    later.sample = 7;
    let mut second = fresh();
    let mut other = later.clone();
    (other.variable, other.sample) = ("part.bias".to_string(), 1);
    second.repeat(&[later, other]).unwrap();
    let outcome = second.run(10, Pace::Fastest, &mut |_| {});
    let gain = outcome.record.column("part.gain").unwrap();
    assert_eq!(gain[6..], [3.0, 3.0, 3.5, 4.0]);
    let bias = outcome.record.column("part.bias").unwrap();
    assert_eq!(bias[..6], [3.0, 3.0, 3.5, 4.0, 4.5, 5.0]);
    for (name, reason) in [
        ("part.other", "no such parameter"),
        ("other.gain", "no such parameter"),
        ("part.fixed", "does not declare it as a tunable parameter"),
        ("part.whole", "only single real numbers can be changed"),
    ] {
        let panel = Arc::new(Panel::new(vec![tunable(name)], 4));
        let refused = fresh().tune(panel).unwrap_err().to_string();
        assert!(refused.contains(reason), "{refused}");
    }
}

#[test]
fn endings_have_a_word_a_time_and_a_reason() {
    let fault = || MasterError::Over("part".to_string());
    for (ended, word, time, is_regular) in [
        (Ended::Complete, "complete", None, true),
        (
            Ended::Interrupted { time: 2.5 },
            "interrupted",
            Some(2.5),
            false,
        ),
        (
            Ended::Terminated {
                component: "part".to_string(),
                time: 1.5,
            },
            "terminated",
            Some(1.5),
            true,
        ),
        (
            Ended::Interlock {
                signal: "part.tripped".to_string(),
                time: 0.5,
                cause: None,
            },
            "interlock",
            Some(0.5),
            false,
        ),
        (Ended::Failed(fault()), "failed", None, false),
        (
            Ended::Stopped {
                error: fault(),
                time: 3.5,
            },
            "failed",
            Some(3.5),
            false,
        ),
    ] {
        assert_eq!((ended.kind().word(), ended.time()), (word, time));
        assert_eq!(ended.is_regular(), is_regular);
        let reason = ended.reason();
        assert_eq!(reason.is_none(), word == "complete");
        let said = reason.unwrap_or_default();
        let is_named = time.is_none_or(|time| said.contains(&format!("{time}")));
        assert!(is_named, "{said}");
    }
}
