//! Components, systems and records that tests are made of.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use fmi_import::{Behaviour, BehaviourError, FmiVersion, Fmu, Options};
use fmi_master::{Algorithm, Ending, Record};
use fmi_system::{Component, Link, System, SystemFile, assemble};
use identification::diagnosis::rigs::RigDiagnosis;
use motion::{Motion, metrics};
use pack::library::FmuLibrary;

use crate::run::experiment::{Prepared, Request};
use crate::run::manifest::Manifest;
use crate::run::signals::{RESULTS, write_csv};
use crate::run::summary::{MotionSummary, Summary};

/// An FMU without a library, which has these variables as XML of FMI 3.0.
pub fn fmu(name: &str, variables: &str) -> Arc<Fmu> {
    let text = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
        <CoSimulation modelIdentifier="{name}"/>
        <TypeDefinitions><EnumerationType name="Word"><Item name="none" value="0"/>
        <Item name="near" value="2" description="near a limit"/><Item name="far" value="5"/></EnumerationType>
        </TypeDefinitions><ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"#
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("{name}.fmu"));
    let entries = [("modelDescription.xml".to_string(), text.into_bytes())];
    pack::write_archive(&path, &entries.into(), None).unwrap();
    Fmu::open(&path).unwrap()
}

/// A real variable with this causality, `more` of its attributes and a number of its own.
pub fn real(reference: u32, name: &str, causality: &str, more: &str) -> String {
    format!(
        r#"<Float64 name="{name}" valueReference="{reference}" causality="{causality}" {more} description="about {name}"/>"#
    )
}

/// An instance of an FMU of the same name.
pub fn component(name: &str, variables: &str) -> Component {
    Component {
        name: name.into(),
        fmu: fmu(name, variables),
        period: None,
        parameters: Vec::new(),
        inputs: Vec::new(),
        aliases: Vec::new(),
    }
}

/// A system of components without connections.
pub fn system(components: Vec<Component>) -> System {
    System {
        name: "bench".into(),
        description: String::new(),
        components,
        connections: Vec::new(),
        tables: Vec::new(),
        start: 0.0,
        end: None,
        notes: Vec::new(),
        stop: None,
    }
}

/// Connections as in a system file.
pub fn links(texts: &[&str]) -> Vec<Link> {
    let texts = texts.iter().map(|text| (*text).to_string());
    texts.map(|text| Link::try_from(text).unwrap()).collect()
}

/// A wave of displacement with its derivatives: so many samples, 2 ms apart.
pub fn wave(name: &str, samples: usize) -> Motion {
    let (omega, dt) = (20.0_f64, 0.002);
    let at = |size: f64, shift: f64| -> Vec<f64> {
        let samples = (0..samples).map(|n| size * (omega * dt * n as f64 + shift).sin());
        samples.collect()
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    Motion {
        name: name.into(),
        dt,
        displacement: at(0.01, 0.0),
        velocity: at(0.01 * omega, quarter),
        acceleration: at(-0.01 * omega * omega, 0.0),
        notes: vec!["made of a sine".into()],
        seed: None,
        across: None,
    }
}

/// Table, control and specimen with the parameters that a page and the limits of a rig look for.
pub fn rig() -> System {
    let parameter = |n, name: &str, start: &str, unit: &str| {
        real(
            n,
            name,
            "parameter",
            &format!(r#"variability="fixed" start="{start}" unit="{unit}""#),
        )
    };
    let control = parameter(1, "proportional_gain", "137.8", "V/m")
        + &parameter(2, units::vocabulary::VALVE_LIMIT, "10", "V")
        + &real(3, "valve_command", "output", "");
    let mut control = component("control", &control);
    let gain = control
        .fmu
        .description
        .position("proportional_gain")
        .unwrap();
    control
        .parameters
        .push((gain, fmi_system::Value::Number(196.85)));
    control.period = Some(0.002);
    let outputs = ["displacement", "velocity", "acceleration"]
        .into_iter()
        .zip(10..);
    let outputs: String = outputs
        .map(|(name, n)| real(n, name, "output", ""))
        .collect();
    let table = parameter(1, units::vocabulary::TABLE_MASS, "500", "kg") + &outputs;
    let specimen = parameter(1, "mass", "100", "kg")
        + &real(2, "drift", "output", r#"unit="m""#)
        + &real(3, "force", "output", r#"unit="N""#);
    system(vec![
        control,
        component("specimen", &specimen),
        component("table", &table),
    ])
}

/// The manifest of a run of [`rig`].
pub fn manifest(request: &Request, motion: &Motion) -> Manifest {
    let how = (Algorithm::GaussSeidel, 0.002, motion.len());
    let mut manifest = Manifest::new(request, &rig(), motion, how);
    manifest.connections = links(&[
        "reference.displacement -> control.reference_displacement",
        "control.valve_command -> table.valve_command",
    ]);
    manifest
}

/// What a table shows that follows `motion` two samples late, with a part of its size.
pub fn followed(motion: &Motion, part: f64) -> Record {
    let columns = [
        "time",
        "reference.displacement",
        "reference.velocity",
        "reference.acceleration",
        "table.displacement",
        "table.velocity",
        "table.acceleration",
        "control.valve_command",
        "specimen.drift",
        "specimen.force",
    ];
    let mut record = Record::with_capacity(columns.map(String::from).to_vec(), motion.len());
    for n in 0..motion.len() {
        let own = [
            motion.displacement[n],
            motion.velocity[n],
            motion.acceleration[n],
        ];
        let before = n.saturating_sub(2);
        let late = [
            motion.displacement[before],
            motion.velocity[before],
            motion.acceleration[before],
        ];
        let mut row = own.to_vec();
        row.extend(late.map(|value| part * value));
        row.extend([5.0 * own[1], 0.1 * own[0], -500.0 * own[0]]);
        record.push(n as f64 * motion.dt, &row, &[]);
    }
    record
}

/// A component that computes each output from all inputs, which are those of the same step.
struct Computed(fn(&[f64], &mut [f64]));

impl Behaviour for Computed {
    fn step(
        &mut self,
        _: f64,
        _: f64,
        inputs: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), BehaviourError> {
        (self.0)(inputs, outputs);
        Ok(())
    }

    fn save(&mut self) -> Result<Vec<u8>, BehaviourError> {
        Ok(Vec::new())
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), BehaviourError> {
        Ok(())
    }
}

/// An FMU with these inputs, outputs and parameters that runs here.
pub fn computed(
    name: &str,
    [inputs, outputs]: [&[&str]; 2],
    more: &str,
    is_sampled: bool,
    law: fn(&[f64], &mut [f64]),
) -> Arc<Fmu> {
    let start = |causality: &str| match causality {
        "input" => r#"start="0""#,
        _ => r#"initial="exact" start="0""#,
    };
    let variables = |causality: &str, names: &[&str], first: u32| -> String {
        let names = names.iter().zip(first..);
        names
            .map(|(name, n)| real(n, name, causality, start(causality)))
            .collect()
    };
    let text = variables("input", inputs, 100) + &variables("output", outputs, 200) + more;
    let begin: Arc<fmi_import::Begin> =
        Arc::new(move |_: &str| Ok(Box::new(Computed(law)) as Box<dyn Behaviour>));
    Arc::new(fmu(name, &text).computed_by(&[], is_sampled, begin))
}

/// A rig that runs: a controller, and a table that moves by a part of its reference with the step.
pub fn prepared(motion: Motion, table: fn(&[f64], &mut [f64])) -> Prepared {
    let references = [
        "reference_displacement",
        "reference_velocity",
        "reference_acceleration",
    ];
    let moved = ["displacement", "velocity", "acceleration", "actuator_force"];
    let parameters = real(
        1,
        "proportional_gain",
        "parameter",
        r#"variability="fixed" start="25""#,
    ) + &real(
        2,
        "integral_leak",
        "parameter",
        r#"variability="fixed" start="0.5""#,
    );
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let control = computed(
        "Control",
        [&references[..1], &["valve_command"]],
        &parameters,
        true,
        |inputs, outputs| outputs[0] = 25.0 * inputs[0],
    );
    library.give("Control", control);
    let inputs = [&["valve_command"], &references[..]].concat();
    library.give(
        "Table",
        computed("Table", [&inputs, &moved], "", false, table),
    );
    let text = r#"
name = "rig"
connections = [
    "reference.displacement -> control.reference_displacement",
    "control.valve_command -> table.valve_command",
    "reference.displacement -> table.reference_displacement",
    "reference.velocity -> table.reference_velocity",
    "reference.acceleration -> table.reference_acceleration",
]
[components.control]
fmu = "Control"
period = "2 ms"
[components.table]
fmu = "Table"
"#;
    let file = SystemFile::parse("rig", text).unwrap();
    let system = assemble(&file, &[], &mut library).unwrap();
    Prepared {
        system,
        samples: motion.len(),
        motion,
        algorithm: Algorithm::GaussSeidel,
        step: 0.002,
        variable: None,
        options: Options::default(),
    }
}

/// A table that follows with nine tenths, under a force of 500 kg.
pub fn follows(inputs: &[f64], outputs: &mut [f64]) {
    for (output, input) in outputs.iter_mut().zip(&inputs[1..]) {
        *output = 0.9 * input;
    }
    outputs[3] = 500.0 * outputs[2];
}

/// The summary of a run of the rig that was played to its end.
pub fn summary(motion: &Motion, record: &Record) -> Summary {
    let column = |name: &str| record.column(name).unwrap();
    let tracking = metrics::tracking(
        motion,
        &column("table.displacement"),
        &column("table.acceleration"),
    );
    Summary {
        system: "mpc".into(),
        motion: MotionSummary::of(motion),
        steps: 1234,
        step_s: 0.002,
        fmi: "3.0".into(),
        algorithm: "gauss-seidel".into(),
        wall_s: 0.25,
        real_time_factor: 12.5,
        ended: Ending::Complete,
        ended_because: None,
        trip: None,
        component_wall_s: BTreeMap::from([
            ("table".to_string(), 0.03),
            ("control".to_string(), 0.01),
        ]),
        seeds: BTreeMap::from([("sensors".to_string(), serde_json::json!(7))]),
        tracking: tracking.ok(),
        axes: Vec::new(),
        changes: Vec::new(),
        warnings: Vec::new(),
        real_time: None,
        coupling_error: None,
        variable_step: None,
    }
}

/// Writes the files of a run whose table follows with a part of the motion's size.
pub fn write_run(folder: &Path, request: &Request, part: f64) -> (Summary, Manifest) {
    let motion = wave("wave", 2000);
    let record = followed(&motion, part);
    let (summary, manifest) = (summary(&motion, &record), manifest(request, &motion));
    write_files(folder, &summary, &manifest, &record);
    (summary, manifest)
}

/// Writes the files of a run.
pub fn write_files(folder: &Path, summary: &Summary, manifest: &Manifest, record: &Record) {
    std::fs::create_dir_all(folder).unwrap();
    let mut csv = Vec::new();
    write_csv(record, &mut csv).unwrap();
    std::fs::write(folder.join(RESULTS), csv).unwrap();
    let json = |value: String, name: &str| std::fs::write(folder.join(name), value).unwrap();
    json(serde_json::to_string(summary).unwrap(), "summary.json");
    json(serde_json::to_string(manifest).unwrap(), "manifest.json");
}

/// A diagnosis of a rig of this kind that named friction.
pub fn rig_diagnosis(kind: &str) -> RigDiagnosis {
    let part = serde_json::json!({
        "nominal_error": 0.5, "refitted_error": 0.4, "extended_error": 0.1, "fitted_error": 0.09,
        "gain_interval": [0.5, 0.95], "parameters": [], "effects": [], "explained": 0.9, "rivals": [],
    });
    let found = serde_json::json!({
        "name": "arm", "kind": kind, "output": "position", "verdict": "named", "named": ["friction"],
        "not_confirmed": [], "as_described": part, "swapped": part,
        "confirmed": {
            "error": 0.12, "swapped_error": 0.22, "gain_interval": [0.4, 0.8], "refitted_error": 0.4,
            "fitted_error": 0.1, "refitted": [], "parameters": [], "effects": [],
        },
        "unexplained": 0.123,
    });
    serde_json::from_value(found).unwrap()
}
