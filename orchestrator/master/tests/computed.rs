//! Runs of components that are computed here, against recurrences in closed form.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::HashMap;
use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use fmi_import::{Behaviour, BehaviourError, Fmu, Options};
use fmi_master::{
    Algorithm, Column, Ended, Ending, Outcome, Pace, Plan, Samples, Simulation, VariableStep,
};
use fmi_system::{Library, SystemFile, assemble};
use zip::{ZipWriter, write::SimpleFileOptions};

const STEP: f64 = 0.1;
const RATE: f64 = 0.5;

/// A description with an input in mm and an output in m.
fn described(folder: &Path, name: &str, start: &str) -> Fmu {
    let text = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
        <CoSimulation modelIdentifier="{name}" canGetAndSetFMUState="true"
        canHandleVariableCommunicationStepSize="true"/>
        <UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit>
        <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions><ModelVariables>
        <Float64 name="u" valueReference="1" causality="input" unit="mm" start="0"/>
        <Float64 name="y" valueReference="2" causality="output" unit="m" initial="exact" start="{start}"/>
        </ModelVariables><ModelStructure><Output valueReference="2"/></ModelStructure></fmiModelDescription>"#
    );
    let path = folder.join(format!("{name}.fmu"));
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    archive
        .start_file("modelDescription.xml", SimpleFileOptions::default())
        .unwrap();
    archive.write_all(text.as_bytes()).unwrap();
    archive.finish().unwrap();
    Arc::unwrap_or_clone(Fmu::open(&path).unwrap())
}

/// `y + step gain u`, with `u` in mm; it fails where it would pass `limit`.
struct Integrator {
    y: f64,
    gain: f64,
    limit: f64,
}

impl Behaviour for Integrator {
    fn step(
        &mut self,
        _: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        let next = self.y + step * self.gain * 1e-3 * inputs[0];
        if next.abs() > self.limit {
            return Err(format!("leaves its limit of {} m", self.limit).into());
        }
        self.y = next;
        outputs[0] = self.y;
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        Ok(self.y.to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        self.y = f64::from_le_bytes(state.try_into().map_err(|_| "has another state")?);
        Ok(())
    }
}

/// `-RATE u` at every sample, with `u` in mm.
struct Law;

impl Behaviour for Law {
    fn step(
        &mut self,
        _: f64,
        _: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        outputs[0] = -RATE * 1e-3 * inputs[0];
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        Ok(Vec::new())
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), BehaviourError> {
        Ok(())
    }
}

struct Parts(HashMap<&'static str, Arc<Fmu>>);

impl Library for Parts {
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        self.0
            .get(name)
            .cloned()
            .ok_or_else(|| name.to_string().into())
    }
}

fn parts(limit: f64) -> Parts {
    let folder = tempfile::tempdir().unwrap();
    let integrator = move |y: f64, gain: f64| -> Arc<fmi_import::Begin> {
        Arc::new(move |_: &str| Ok(Box::new(Integrator { y, gain, limit }) as Box<dyn Behaviour>))
    };
    let law: Arc<fmi_import::Begin> = Arc::new(|_: &str| Ok(Box::new(Law) as Box<dyn Behaviour>));
    let folder = folder.path();
    Parts(HashMap::from([
        (
            "Body",
            Arc::new(described(folder, "Body", "1").computed_by(&[], false, integrator(1.0, 1.0))),
        ),
        (
            "Rest",
            Arc::new(described(folder, "Rest", "0").computed_by(&[], false, integrator(0.0, 1.0))),
        ),
        (
            "Back",
            Arc::new(described(folder, "Back", "0").computed_by(
                &[],
                false,
                integrator(0.0, -RATE),
            )),
        ),
        (
            "Law",
            Arc::new(described(folder, "Law", "0").computed_by(&[], true, law)),
        ),
    ]))
}

fn run(text: &str, parts: &mut Parts, samples: &Samples, plan: &Plan, rows: usize) -> Outcome {
    let file = SystemFile::parse("loop", text).unwrap();
    let system = assemble(&file, &[], parts).unwrap();
    let simulation = Simulation::planned(&system, samples, plan, &Options::default()).unwrap();
    simulation.run(rows, Pace::Fastest, &mut |_| {})
}

const LOOP: &str = "connections = [\"body.y -> law.u\", \"law.y -> body.u\"]\n\
                    [components.body]\nfmu = \"Body\"\n[components.law]\nfmu = \"Law\"\nperiod = \"0.1 s\"\n";

#[test]
fn a_controlled_body_decays_as_the_recurrence_of_its_order_of_calls() {
    for algorithm in [Algorithm::GaussSeidel, Algorithm::Jacobi] {
        let plan = Plan {
            algorithm,
            ..Plan::fixed(STEP, 2.0)
        };
        let outcome = run(LOOP, &mut parts(10.0), &Samples::none(STEP), &plan, 20);
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        assert_eq!(outcome.record.len(), 20);
        let body = outcome.record.column("body.y").unwrap();
        assert_eq!(body[0], 1.0);
        for n in 2..19 {
            let (now, before) = (body[n], body[n - 1]);
            // In the order of dependencies the law sees this sample; all at once, the one before.
            let seen = match algorithm {
                Algorithm::Jacobi => before,
                _ => now,
            };
            let expected = now - STEP * RATE * seen;
            assert!(
                (body[n + 1] - expected).abs() < 1e-12,
                "{algorithm} {n}: {body:?}"
            );
        }
        let time = outcome.record.column("time").unwrap();
        assert!((time[19] - 1.9).abs() < 1e-12);
    }
}

#[test]
fn a_motion_is_followed_ahead_of_time_and_rests_after_its_end() {
    let text = "connections = [\"reference.displacement[1] -> body.u\"]\n[components.body]\nfmu = \"Rest\"\n";
    let values = vec![0.001, 0.004, -0.002];
    let column = |values: &[f64], after| Column {
        values: values.to_vec(),
        after,
    };
    let samples = Samples {
        period: STEP,
        columns: vec![
            column(&values, 0.003),
            column(&[0.0; 3], 0.0),
            column(&[0.0; 3], 0.0),
        ],
    };
    let outcome = run(text, &mut parts(10.0), &samples, &Plan::fixed(STEP, 0.6), 6);
    let body = outcome.record.column("body.y").unwrap();
    // A sample ahead, m as mm, and a body that takes them for m per s: the sum of the reference from its second
    // sample on.
    let mut sum = 0.0;
    for (n, value) in [0.004, -0.002, 0.003, 0.003, 0.003].into_iter().enumerate() {
        sum += STEP * value;
        assert!((body[n + 1] - sum).abs() < 1e-15, "{n}: {body:?}");
    }
}

#[test]
fn a_run_ends_with_the_component_that_fails() {
    // y = 1 + 0.1 n 0.4: above 1.1 at the third step.
    let text = "[components.body]\nfmu = \"Body\"\n[components.body.inputs]\nu = \"0.4 m\"\n";
    let outcome = run(
        text,
        &mut parts(1.1),
        &Samples::none(STEP),
        &Plan::fixed(STEP, 1.0),
        10,
    );
    assert_eq!(outcome.ended.kind(), Ending::Failed);
    assert!(matches!(outcome.ended, Ended::Failed(_)));
    let said = outcome.ended.message();
    assert!(
        said.contains("`body`") && said.contains("leaves its limit of 1.1 m"),
        "{said}"
    );
    let body = outcome.record.column("body.y").unwrap();
    let expected = [1.0, 1.04, 1.08];
    assert_eq!(body.len(), 3);
    for (value, expected) in body.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-12, "{body:?}");
    }
}

/// `x' = v`, `v' = -RATE x`: two integrators exchange their values.
const RING: &str = "connections = [\"x.y -> v.u\", \"v.y -> x.u\"]\n\
                    [components.x]\nfmu = \"Body\"\n[components.v]\nfmu = \"Back\"\n";

#[test]
fn a_variable_step_keeps_its_tolerance_and_a_smaller_one_costs_more_steps() {
    let omega = RATE.sqrt();
    let with = |tolerance: f64| {
        let plan = Plan {
            algorithm: Algorithm::GaussSeidel,
            step: STEP,
            stop: 4.0,
            variable: Some(VariableStep {
                tolerance,
                least: Some(STEP / 1024.0),
            }),
        };
        let outcome = run(RING, &mut parts(10.0), &Samples::none(STEP), &plan, 40);
        assert!(outcome.ended.is_regular(), "{}", outcome.ended.message());
        let x = outcome.record.column("x.y").unwrap();
        let errors = x
            .iter()
            .enumerate()
            .map(|(n, x)| (x - (omega * STEP * n as f64).cos()).abs());
        (
            outcome.steps,
            errors.fold(0.0, f64::max),
            outcome.variable.unwrap(),
        )
    };
    let (coarse, coarse_error, _) = with(0.05);
    let (fine, fine_error, taken) = with(0.0005);
    assert!(fine > 2 * coarse, "{fine} {coarse}");
    assert!(fine_error < coarse_error, "{fine_error} {coarse_error}");
    assert!((taken.tolerance_percent - 0.05).abs() < 1e-12);
    assert!(taken.shortest_s >= taken.least_s && taken.longest_s <= taken.greatest_s);
    assert!(taken.worst_percent <= 0.05 || taken.over > 0, "{taken:?}");
}
