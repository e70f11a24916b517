//! The extended model of a diagnosis: as parameters of the FMUs, as a model file, in closed loop
//! and in fmpy the same rig as the engine that estimated it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use acceptance::python::run_script;
use fmi_import::{FmiVersion, Fmu};
use fmi_system::{SystemFile, Value, assemble};
use hidden_effects::case::{Case as Generated, Kind, Settings};
use identification::data::{OUTPUT_NAMES, mean_and_deviation};
use identification::diagnosis::case::{ControlLaw, Nominal};
use identification::diagnosis::engine::{NamedEffect, ParameterEstimate, Role};
use identification::diagnosis::rigs::shake_table::ExtendedModel as Estimated;
use identification::diagnosis::rigs::shake_table::catalogue::catalogue;
use laboratory::diagnosis::co_simulation::{Channels, RigFmus, play};
use pack::extended_model::ExtendedModel;
use pack::library::FmuLibrary;
use pack::{self, PackedFmu};
use plant::identified::rig::{IdentifiedRig, IdentifiedRigState};
use plant::specimens::linear::LinearSpecimen;

const PERIOD: f64 = 0.002;

/// An effect of a plain size with the rig that has it.
fn with_effect(name: &str) -> (IdentifiedRig, NamedEffect) {
    let all = catalogue(2.0, PERIOD);
    let (candidate, effect) = all.iter().find(|(c, _)| c.effect == name).unwrap();
    let values = effect.examples(2.0).pop().unwrap();
    let mut rig = IdentifiedRig {
        specimen: Some(LinearSpecimen::default()),
        ..IdentifiedRig::default()
    };
    effect.apply(&mut rig.effects, &mut rig.sensors, &values);
    let parameters = candidate.parameters.iter().zip(&values);
    let mut parameters: Vec<ParameterEstimate> = parameters
        .map(|(p, &value)| ParameterEstimate {
            name: p.name.into(),
            value,
            unit: p.unit,
            standard_error: 0.01 * value.abs(),
            is_shape: matches!(p.role, Role::Shape { .. }),
        })
        .collect();
    if name == "mains_hum" {
        // As a diagnosis reports its two quadratures.
        for (p, (name, value)) in parameters.iter_mut().zip([
            ("amplitude", rig.sensors.acceleration.hum_amplitude),
            ("phase", rig.sensors.acceleration.hum_phase),
        ]) {
            (p.name, p.value) = (name.into(), value);
        }
    }
    let effect = NamedEffect {
        effect: candidate.effect,
        parameters,
        confidence: 1.0,
    };
    (rig, effect)
}

fn extended(rig: &IdentifiedRig, effects: &[NamedEffect]) -> ExtendedModel {
    let estimated = Estimated {
        shake_table: rig.shake_table,
        specimen: rig.specimen,
        effects: rig.effects,
        sensors: rig.sensors,
        standard_errors: BTreeMap::from([("table.mass".to_string(), 0.25)]),
    };
    ExtendedModel::new(&estimated, effects)
}

fn names() -> Vec<&'static str> {
    let all = catalogue(2.0, PERIOD);
    all.into_iter().map(|(c, _)| c.effect).collect()
}

#[test]
fn every_effect_is_a_set_of_parameters_that_the_fmus_have() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../modelDescription/fmi3");
    let read = |name: &str| std::fs::read_to_string(folder.join(format!("{name}.xml"))).unwrap();
    for name in names() {
        let (rig, effect) = with_effect(name);
        let model = extended(&rig, &[effect]);
        let mut found = 0;
        for (component, parameters) in &model.parameters {
            let description = read(component);
            for (parameter, _) in parameters.iter().filter(|(name, _)| name.contains('.')) {
                assert!(
                    description.contains(&format!("name=\"{parameter}\"")),
                    "{component} has no {parameter}"
                );
                found += 1;
            }
        }
        assert!(found > 0, "{name} is nowhere");
    }
}

/// What the native engine measures of `rig` in closed loop.
fn native(rig: &IdentifiedRig, law: &ControlLaw, reference: &[f64]) -> Channels {
    let sampled = rig.sample(PERIOD, 8).unwrap();
    let mut state = IdentifiedRigState::default();
    let mut control = law.start(PERIOD);
    let mut channels = Channels::default();
    for k in 0..reference.len() {
        let measured = sampled.measure(&mut state, PERIOD * k as f64);
        let [x, a, ..] = measured;
        for (channel, value) in channels.iter_mut().zip(measured) {
            channel.push(value);
        }
        sampled.step(&mut state, control.command(reference, k, x, a));
    }
    channels
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

fn file(fmus: &[PackedFmu], name: &str) -> Option<PathBuf> {
    let mut all = fmus.iter();
    all.find(|fmu| fmu.name == name && fmu.version == pack::FmiVersion::V3)
        .map(|fmu| fmu.path.clone())
}

#[test]
fn fmus_with_an_effect_move_in_closed_loop_like_the_engine_that_finds_it() {
    let originals = &pack::all_fmus().unwrap_or_else(|e| panic!("{e}"));
    let case = Generated::draw(1, &Settings::new(Kind::Nothing));
    let nominal = Nominal::parse(&case.nominal()).unwrap();
    let law = nominal.controller.unwrap();
    // Sines below and above the specimen's frequency, up to 0.8 in.
    let reference: Vec<f64> = (0..4000)
        .map(|k| {
            let t = PERIOD * f64::from(k);
            let grow = (t / 2.0).min(1.0);
            0.0254
                * grow
                * (0.5 * (4.0 * t).sin() + 0.25 * (9.0 * t).sin() + 0.05 * (33.0 * t).sin())
        })
        .collect();
    let without = IdentifiedRig {
        specimen: Some(LinearSpecimen::default()),
        ..IdentifiedRig::default()
    };
    let plain = native(&without, &law, &reference);
    let played_with = |changed: &[PackedFmu]| {
        let path = |name| {
            let found = file(changed, name).or_else(|| file(originals, name));
            found.unwrap()
        };
        let fmus = RigFmus {
            table: path("ShakeTable"),
            specimen: Some(path("Specimen")),
            sensors: path("Instrumentation"),
            control: path("ThreeVariableControl"),
            ..RigFmus::default()
        };
        play(&fmus, &law, &reference, PERIOD, None).unwrap()
    };
    // What the coupling alone makes of the healthy rig is no matter of an effect.
    let coupled = played_with(&[]);
    let mut worst = (0.0, "");
    for name in names() {
        let (rig, effect) = with_effect(name);
        let model = extended(&rig, &[effect]);
        let folder = tempfile::tempdir().unwrap();
        let changed = model.write_fmus(originals, folder.path()).unwrap();
        let played = played_with(&changed);
        let expected = native(&rig, &law, &reference);
        // In units of the channel's own variation.
        let (mut off, mut effect) = (0.0f64, 0.0f64);
        for i in 0..OUTPUT_NAMES.len() {
            // The sensor of a specimen that is not there shows nothing.
            let size = mean_and_deviation(&plain[i]).1;
            let change = |with: &[f64], without: &[f64]| -> Vec<f64> {
                with.iter().zip(without).map(|(a, b)| a - b).collect()
            };
            let brought = change(&played[i], &coupled[i]);
            off = off.max(rms(&brought, &change(&expected[i], &plain[i])) / size);
            effect = effect.max(rms(&plain[i], &expected[i]) / size);
        }
        println!("{name}: changes {off:.1e} unlike in the engine, effect {effect:.1e}");
        assert!(effect > 3e-3, "{name} does nothing: {effect}");
        assert!(off < 0.1 * effect && off < 2.5e-3, "{name}: {off}");
        if off > worst.0 {
            worst = (off, name);
        }
    }
    println!("worst: {worst:?}");
}

/// The system with one component that `--set` gives a model file.
fn set_from_file(component: &str, inputs: &str, model: &Path) -> BTreeMap<String, f64> {
    let text =
        format!("[components.part]\nfmu = '{component}'\n[components.part.inputs]\n{inputs}");
    let file = SystemFile::parse("test", &text).unwrap();
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let asked = [format!("part.model={}", model.display())];
    let system = assemble(&file, &asked, &mut library).unwrap();
    let part = &system.components[0];
    let values = part.parameters.iter().map(|(index, value)| {
        let Value::Number(value) = value else {
            panic!("{value:?} is not a number");
        };
        (part.fmu.description.variables[*index].name.clone(), *value)
    });
    values.collect()
}

#[test]
fn a_model_file_sets_what_the_fmus_start_with() {
    let (mut rig, yielding) = with_effect("specimen_yielding");
    let (friction_rig, friction) = with_effect("stribeck_friction");
    let (bias_rig, bias) = with_effect("accelerometer_bias");
    rig.effects.friction = friction_rig.effects.friction;
    rig.sensors = bias_rig.sensors;
    rig.shake_table.table.mass *= 1.01;
    let model = extended(&rig, &[yielding, friction, bias]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("extended_model.toml");
    std::fs::write(&path, model.toml().unwrap()).unwrap();
    for (component, inputs) in [
        ("ShakeTable", "valve_command = 0.0\nspecimen_force = 0.0\n"),
        ("Specimen", "table_acceleration = 0.0\n"),
        (
            "Instrumentation",
            "displacement = 0.0\nvelocity = 0.0\nacceleration = 0.0\nactuator_force = 0.0\n\
             specimen_acceleration = 0.0\n",
        ),
    ] {
        let set = set_from_file(component, inputs, &path);
        let wanted = &model.parameters[component];
        assert_eq!(
            set.keys().collect::<Vec<_>>(),
            wanted.keys().collect::<Vec<_>>()
        );
        for (name, value) in &set {
            let wanted = wanted[name].value;
            assert!((value - wanted).abs() <= 1e-12 * wanted.abs(), "{name}");
        }
    }
    // A slip of the pen in the file is named.
    let text = model
        .toml()
        .unwrap()
        .replace("yield_displacement", "yield_displacment");
    std::fs::write(&path, text).unwrap();
    let file = SystemFile::parse(
        "test",
        "[components.part]\nfmu = 'Specimen'\n[components.part.inputs]\ntable_acceleration = 0.0\n",
    )
    .unwrap();
    let mut library = FmuLibrary::new(FmiVersion::V3, None);
    let asked = [format!("part.model={}", path.display())];
    let error = assemble(&file, &asked, &mut library).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("[effects.specimen_yielding]")
            && error.contains("did you mean `specimen_yielding.yield_displacement`?"),
        "{error}"
    );
}

/// Outputs of FMUs of both versions that fmpy plays `inputs` through, nothing set but their starts.
fn fmpy(path: &Path, inputs: &serde_json::Value, outputs: &[&str]) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.json");
    let text = serde_json::json!({ "parameters": {}, "inputs": inputs, "outputs": outputs });
    std::fs::write(&job, text.to_string()).unwrap();
    let said = run_script("fmpy_model.py", [&job, &path.to_path_buf()]);
    let line = said.lines().find_map(|line| line.strip_prefix("RESULT "));
    serde_json::from_str(line.unwrap()).unwrap()
}

#[test]
fn in_fmpy_the_extended_fmus_start_with_the_effects() {
    let originals = &pack::all_fmus().unwrap_or_else(|e| panic!("{e}"));
    let (mut rig, dead_band) = with_effect("valve_dead_band");
    let (stiff, stiffness) = with_effect("specimen_stiffness");
    rig.effects.specimen = stiff.effects.specimen;
    let model = extended(&rig, &[dead_band, stiffness]);
    let folder = tempfile::tempdir().unwrap();
    let changed = model.write_fmus(originals, folder.path()).unwrap();
    assert_eq!(changed.len(), 4, "table and specimen in both versions");

    let command: Vec<f64> = (0..1000)
        .map(|k| 0.6 * (0.03 * f64::from(k)).sin())
        .collect();
    let still = vec![0.0; command.len()];
    let bare = IdentifiedRig {
        specimen: None,
        ..rig
    };
    // Displacement, acceleration and force after each step.
    let open_loop = |rig: &IdentifiedRig| -> Vec<Vec<f64>> {
        let sampled = rig.sample(PERIOD, 8).unwrap();
        let mut state = IdentifiedRigState::default();
        let mut columns = vec![Vec::new(); 3];
        for &u in &command {
            sampled.step(&mut state, u);
            let motion = sampled.motion(&state);
            let row = [
                motion.displacement,
                motion.acceleration,
                motion.actuator_force,
            ];
            columns.iter_mut().zip(row).for_each(|(c, v)| c.push(v));
        }
        columns
    };
    let (with, without) = (open_loop(&bare), open_loop(&IdentifiedRig::default()));
    for fmu in &changed {
        let description = Fmu::open(&fmu.path).unwrap();
        let xml = zip::ZipArchive::new(std::fs::File::open(&fmu.path).unwrap())
            .and_then(|mut archive| {
                let entry = archive.by_name("modelDescription.xml")?;
                Ok(std::io::read_to_string(entry).unwrap())
            })
            .unwrap();
        assert!(xml.contains("estimated, standard error"), "{:?}", fmu.path);
        assert_eq!(
            description.description.model_name,
            format!("Extended{}", fmu.name)
        );
        if fmu.name == "Specimen" {
            assert!(xml.contains("specimen_stiffness.relative_change"));
            continue;
        }
        let inputs = serde_json::json!({ "valve_command": command, "specimen_force": still });
        let outputs = ["displacement", "acceleration", "actuator_force"];
        let played = fmpy(&fmu.path, &inputs, &outputs);
        for (i, name) in outputs.iter().enumerate() {
            let size = mean_and_deviation(&with[i]).1;
            let own = rms(&played[i], &with[i]) / size;
            let nominal = rms(&played[i], &without[i]) / size;
            println!(
                "{:?} {name}: {own:.1e} from the engine, {nominal:.1e} from nominal",
                fmu.version
            );
            assert!(own < 1e-3, "{name}: {own}");
            assert!(nominal > 0.02, "{name}: {nominal}");
        }
    }
}
