//! Components that are computed here, and systems of them.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use fmi_import::{Behaviour, BehaviourError, Fmu, Options};
use fmi_master::{Outcome, Pace, Plan, Samples, Simulation};
use fmi_system::{Library, SystemFile, assemble};

use super::made;

pub const STEP: f64 = 0.1;
pub const RATE: f64 = 0.5;

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
    opened(folder, name, &text)
}

/// An FMU of this description.
fn opened(folder: &Path, name: &str, text: &str) -> Fmu {
    let path = folder.join(format!("{name}.fmu"));
    made::write(&path, &[("modelDescription.xml", text.as_bytes())]);
    Arc::unwrap_or_clone(Fmu::open(&path).unwrap())
}

/// What a component does: time, step, inputs, own state and outputs.
pub type Equations = fn(f64, f64, &[f64], &mut [f64], &mut [f64]);

/// As [`Equations`], of a component that may fail.
type Law =
    dyn Fn(f64, f64, &[f64], &mut [f64], &mut [f64]) -> Result<(), BehaviourError> + Send + Sync;

/// A component with numbers for its state.
struct Own {
    state: Vec<f64>,
    law: Arc<Law>,
}

impl Behaviour for Own {
    fn step(
        &mut self,
        time: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        (self.law)(time, step, inputs, &mut self.state, outputs)
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        let all = self.state.iter();
        Ok(all.flat_map(|one| one.to_le_bytes()).collect())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        for (own, bytes) in self.state.iter_mut().zip(state.chunks_exact(8)) {
            *own = f64::from_le_bytes(bytes.try_into().map_err(|_| "has another state")?);
        }
        Ok(())
    }
}

/// Instances that begin with `state`.
fn begin(state: &[f64], law: Arc<Law>) -> Arc<fmi_import::Begin> {
    let state = state.to_vec();
    Arc::new(move |_: &str| {
        let (state, law) = (state.clone(), law.clone());
        Ok(Box::new(Own { state, law }) as Box<dyn Behaviour>)
    })
}

/// `y + step gain u`, with `u` in mm; it fails where it would pass `limit`.
fn integrator(y: f64, gain: f64, limit: f64) -> Arc<fmi_import::Begin> {
    let law: Arc<Law> = Arc::new(move |_, step, inputs, state, outputs| {
        let next = state[0] + step * gain * 1e-3 * inputs[0];
        if next.abs() > limit {
            return Err(format!("leaves its limit of {limit} m").into());
        }
        state[0] = next;
        outputs[0] = next;
        Ok(())
    });
    begin(&[y], law)
}

/// `-RATE u` at every sample, with `u` in mm.
fn law() -> Arc<fmi_import::Begin> {
    let law: Arc<Law> = Arc::new(|_, _, inputs, _, outputs| {
        outputs[0] = -RATE * 1e-3 * inputs[0];
        Ok(())
    });
    begin(&[], law)
}

pub struct Parts(pub HashMap<&'static str, Arc<Fmu>>);

impl Library for Parts {
    fn fmu(&mut self, name: &str) -> Result<Arc<Fmu>, Box<dyn Error>> {
        self.0
            .get(name)
            .cloned()
            .ok_or_else(|| name.to_string().into())
    }
}

pub fn parts(limit: f64) -> Parts {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &'static str, start: &str, is_sampled: bool, begin| {
        let fmu = described(folder.path(), name, start).computed_by(&[], is_sampled, begin);
        (name, Arc::new(fmu))
    };
    named(vec![
        of("Body", "1", false, integrator(1.0, 1.0, limit)),
        of("Rest", "0", false, integrator(0.0, 1.0, limit)),
        of("Back", "0", false, integrator(0.0, -RATE, limit)),
        of("Law", "0", true, law()),
    ])
}

/// The simulation of a system that its text describes.
pub fn planned(text: &str, parts: &mut Parts, samples: &Samples, plan: &Plan) -> Simulation {
    let file = SystemFile::parse("loop", text).unwrap();
    let system = assemble(&file, &[], parts).unwrap();
    Simulation::planned(&system, samples, plan, &Options::default()).unwrap()
}

pub fn run(text: &str, parts: &mut Parts, samples: &Samples, plan: &Plan, rows: usize) -> Outcome {
    planned(text, parts, samples, plan).run(rows, Pace::Fastest, &mut |_| {})
}

/// A component with these variables (FMI 3.0), attributes of its interface, and state; it fails where an output is not a
/// number.
pub fn own(
    variables: &str,
    attributes: &str,
    is_sampled: bool,
    state: &[f64],
    equations: Equations,
) -> Arc<Fmu> {
    let text = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="Own" instantiationToken="1"><CoSimulation
        modelIdentifier="Own" {attributes}/><TypeDefinitions><EnumerationType name="Cause"><Item name="none" value="0"/>
        <Item name="far" value="4" description="too far"/></EnumerationType></TypeDefinitions><ModelVariables>
        {variables}</ModelVariables><ModelStructure/></fmiModelDescription>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let fmu = opened(folder.path(), "Own", &text);
    let law: Arc<Law> = Arc::new(move |time, step, inputs, state, outputs| {
        equations(time, step, inputs, state, outputs);
        match outputs.iter().any(|value| value.is_nan()) {
            true => Err("has no value".into()),
            false => Ok(()),
        }
    });
    Arc::new(fmu.computed_by(&[], is_sampled, begin(state, law)))
}

/// Named components.
pub fn named(all: Vec<(&'static str, Arc<Fmu>)>) -> Parts {
    Parts(all.into_iter().collect())
}

/// A body under a sampled law.
pub const LOOP: &str = "connections = [\"body.y -> law.u\", \"law.y -> body.u\"]\n\
                    [components.body]\nfmu = \"Body\"\n[components.law]\nfmu = \"Law\"\nperiod = \"0.1 s\"\n";

/// `x' = v`, `v' = -RATE x`: two integrators exchange their values.
pub const RING: &str = "connections = [\"x.y -> v.u\", \"v.y -> x.u\"]\n\
                    [components.x]\nfmu = \"Body\"\n[components.v]\nfmu = \"Back\"\n";
