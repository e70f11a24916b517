//! Instances that the host computes itself, through the calls of any other FMU.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use fmi_import::{Behaviour, BehaviourError, Fmu, Instance, Kind, Options, State};
use zip::{ZipWriter, write::SimpleFileOptions};

const DESCRIPTION: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="Sum" instantiationToken="1">
<CoSimulation modelIdentifier="Sum"/><ModelVariables>
<Float64 name="u" valueReference="0" causality="input" start="3"/>
<Float64 name="pair" valueReference="1" causality="output" initial="calculated"><Dimension start="2"/></Float64>
<Float64 name="t" valueReference="2" causality="output" initial="calculated"/>
<Int32 name="count" valueReference="3" causality="output" initial="calculated" variability="discrete"/>
</ModelVariables><ModelStructure>
<Output valueReference="1"/><Output valueReference="2"/><Output valueReference="3"/>
</ModelStructure></fmiModelDescription>"#;

/// Adds `step * u + extra`; its outputs are the sum, its double, the time and the number of steps.
#[derive(Default)]
struct Sum {
    total: f64,
    steps: f64,
}

impl Behaviour for Sum {
    fn step(
        &mut self,
        time: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        if inputs[0] > 100.0 {
            return Err("has an input above 100".into());
        }
        self.total += step * inputs[0] + inputs[1];
        self.steps += 1.0;
        outputs.copy_from_slice(&[self.total, 2.0 * self.total, time, self.steps]);
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        Ok([self.total.to_le_bytes(), self.steps.to_le_bytes()].concat())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        let (total, steps) = state.split_at(8);
        self.total = f64::from_le_bytes(total.try_into().map_err(|_| "has no total")?);
        self.steps = f64::from_le_bytes(steps.try_into().map_err(|_| "has no steps")?);
        Ok(())
    }
}

fn fmu(folder: &Path) -> Arc<Fmu> {
    let path = folder.join("Sum.fmu");
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    let options = SimpleFileOptions::default();
    archive.start_file("modelDescription.xml", options).unwrap();
    archive.write_all(DESCRIPTION.as_bytes()).unwrap();
    archive.finish().unwrap();
    Fmu::open(&path).unwrap()
}

fn computed(folder: &Path) -> Arc<Fmu> {
    let begin = Arc::new(|_: &str| Ok(Box::new(Sum::default()) as Box<dyn Behaviour>));
    Arc::new(fmu(folder).computed_by(&["extra".to_string()], true, begin))
}

fn running(fmu: &Arc<Fmu>) -> Instance {
    let mut instance = Instance::new(fmu, "sum", &Options::default()).unwrap();
    instance.enter_initialization(0.0, 1.0).unwrap();
    instance.exit_initialization().unwrap();
    instance
}

/// The pair, the time and the number of steps.
fn outputs(instance: &mut Instance) -> [f64; 4] {
    let mut all = [f64::NAN; 4];
    instance
        .get(&Kind::Float64, &[1, 2], &mut all[..3])
        .unwrap();
    instance.get(&Kind::Int32, &[3], &mut all[3..]).unwrap();
    all
}

#[test]
fn values_of_arrays_and_scalars_come_and_go_in_the_order_of_their_references() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = computed(folder.path());
    let extra = fmu.description.variable("extra").unwrap().reference;
    let mut instance = running(&fmu);
    // The input's start value is 3.
    instance.do_step(0.0, 0.5).unwrap();
    assert_eq!(outputs(&mut instance), [1.5, 3.0, 0.0, 1.0]);
    instance
        .set(&Kind::Float64, &[extra, 0], &[10.0, 4.0])
        .unwrap();
    instance.do_step(0.5, 0.25).unwrap();
    assert_eq!(outputs(&mut instance), [12.5, 25.0, 0.5, 2.0]);
    // A scalar first, then the array.
    let mut turned = [0.0; 3];
    instance.get(&Kind::Float64, &[2, 1], &mut turned).unwrap();
    assert_eq!(turned, [0.5, 12.5, 25.0]);
}

#[test]
fn a_kept_state_holds_inputs_outputs_and_the_own_state() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = computed(folder.path());
    let mut instance = running(&fmu);
    instance.do_step(0.0, 0.5).unwrap();
    let mut state = State::default();
    instance.save_state(&mut state).unwrap();
    instance.set(&Kind::Float64, &[0], &[50.0]).unwrap();
    instance.do_step(0.5, 0.5).unwrap();
    assert_eq!(outputs(&mut instance)[0], 26.5);
    instance.restore_state(&state).unwrap();
    assert_eq!(outputs(&mut instance), [1.5, 3.0, 0.0, 1.0]);
    // The input is 3 again.
    instance.do_step(0.5, 0.5).unwrap();
    assert_eq!(outputs(&mut instance), [3.0, 6.0, 0.5, 2.0]);

    let bytes = instance.state_as_bytes(&state).unwrap();
    let mut other = running(&fmu);
    let read = other.state_of_bytes(&bytes).unwrap();
    other.restore_state(&read).unwrap();
    assert_eq!(outputs(&mut other), [1.5, 3.0, 0.0, 1.0]);
    let short = other.state_of_bytes(&bytes[..8]).unwrap();
    let refused = other.restore_state(&short).unwrap_err();
    assert!(
        refused.outcome.contains("state of another component"),
        "{refused}"
    );
}

#[test]
fn reasons_of_what_computes_reach_the_caller() {
    let folder = tempfile::tempdir().unwrap();
    let mut instance = running(&computed(folder.path()));
    instance.set(&Kind::Float64, &[0], &[101.0]).unwrap();
    let failed = instance.do_step(0.0, 0.5).unwrap_err();
    assert!(
        failed.outcome.contains("has an input above 100"),
        "{failed}"
    );

    let begin = Arc::new(|name: &str| Err(format!("`{name}` has no function").into()));
    let fmu = Arc::new(fmu(folder.path()).computed_by(&[], true, begin));
    let Err(refused) = Instance::new(&fmu, "sum", &Options::default()) else {
        panic!("an instance");
    };
    let text = refused.to_string();
    assert!(
        text.ends_with("`sum` could not be instantiated: `sum` has no function"),
        "{text}"
    );
}
