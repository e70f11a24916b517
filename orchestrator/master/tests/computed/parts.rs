//! Components that are computed here, and systems of them.

use std::collections::HashMap;
use std::error::Error;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use fmi_import::{Behaviour, BehaviourError, Fmu, Options};
use fmi_master::{Outcome, Pace, Plan, Samples, Simulation};
use fmi_system::{Library, SystemFile, assemble};
use zip::{ZipWriter, write::SimpleFileOptions};

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

/// The simulation of a system that its text describes.
pub fn planned(text: &str, parts: &mut Parts, samples: &Samples, plan: &Plan) -> Simulation {
    let file = SystemFile::parse("loop", text).unwrap();
    let system = assemble(&file, &[], parts).unwrap();
    Simulation::planned(&system, samples, plan, &Options::default()).unwrap()
}

pub fn run(text: &str, parts: &mut Parts, samples: &Samples, plan: &Plan, rows: usize) -> Outcome {
    planned(text, parts, samples, plan).run(rows, Pace::Fastest, &mut |_| {})
}

/// What a component does: time, step, inputs, own state and outputs.
pub type Equations = fn(f64, f64, &[f64], &mut [f64], &mut [f64]);

/// A component with numbers for its state; it fails where an output is not a number.
struct Own {
    state: Vec<f64>,
    equations: Equations,
}

impl Behaviour for Own {
    fn step(
        &mut self,
        time: f64,
        step: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        (self.equations)(time, step, inputs, &mut self.state, outputs);
        match outputs.iter().any(|value| value.is_nan()) {
            true => Err("has no value".into()),
            false => Ok(()),
        }
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        Ok(self
            .state
            .iter()
            .flat_map(|one| one.to_le_bytes())
            .collect())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), BehaviourError> {
        for (own, bytes) in self.state.iter_mut().zip(state.chunks_exact(8)) {
            *own = f64::from_le_bytes(bytes.try_into().map_err(|_| "has another state")?);
        }
        Ok(())
    }
}

/// A component with these variables (FMI 3.0), attributes of its interface, and state.
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
    let state = state.to_vec();
    let begin = move |_: &str| {
        let state = state.clone();
        Ok(Box::new(Own { state, equations }) as Box<dyn Behaviour>)
    };
    Arc::new(fmu.computed_by(&[], is_sampled, Arc::new(begin)))
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
