//! Data, to a model file, to an FMU's parameters, to fmpy: the same response as the identified
//! model without FMI.

use acceptance::python::run_script;
use acceptance::recordings::{PERIOD, Test};
use fmi_import::{Causality, FmiVersion};
use fmi_system::{SystemFile, Value, assemble};
use identification::data::{Channel, mean_and_deviation};
use identification::identify::model_file::ModelFile;
use identification::identify::rig::{Options, identify};
use nalgebra::{DVector, dvector};
use pack::library::FmuLibrary;
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;

const OUTPUTS: [&str; 4] = ["displacement", "velocity", "acceleration", "actuator_force"];

/// Outputs after each held sample of the command.
fn native(shake_table: ShakeTable, command: &[f64]) -> Vec<Vec<f64>> {
    let rig = Rig {
        shake_table,
        specimen: None,
    };
    let system = rig.state_space().sample(PERIOD);
    let mut state = DVector::zeros(system.a.nrows());
    let mut outputs = vec![Vec::new(); OUTPUTS.len()];
    for &u in command {
        state = system.advance(&state, &dvector![u]);
        let y = &system.c * &state;
        for (output, value) in outputs.iter_mut().zip(y.iter()) {
            output.push(*value);
        }
    }
    outputs
}

/// Largest difference of a channel over its standard deviation.
fn difference(got: &[Vec<f64>], want: &[Vec<f64>]) -> f64 {
    assert_eq!(got.len(), want.len());
    let mut largest = 0.0f64;
    for (got, want) in got.iter().zip(want) {
        assert_eq!(got.len(), want.len());
        let size = mean_and_deviation(want).1;
        for (a, b) in got.iter().zip(want) {
            largest = largest.max((a - b).abs() / size);
        }
    }
    largest
}

#[test]
fn an_fmu_with_the_identified_model_moves_like_the_identified_rig() {
    let recording = Test::default().record();
    let found = identify(std::slice::from_ref(&recording), Options::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let text = ModelFile::from_identification(&found).to_toml().unwrap();
    std::fs::write(folder.path().join("MODEL.toml"), text).unwrap();

    let out = pack::default_folder()
        .unwrap()
        .with_file_name("fmus-for-tests");
    let packed = pack::build_component("fmus/shake_table", &out, &pack::FmiVersion::ALL).unwrap();
    let command = &recording.channel(Channel::ValveCommand).unwrap()[..2500];
    let expected = native(found.rig().shake_table, command);
    for fmu in packed {
        let path = fmu.path.display().to_string();
        let mut file = SystemFile::parse(
            "test",
            &format!(
                "[components.table]\nfmu = '{path}'\nmodel = 'MODEL.toml'\n\
                 [components.table.inputs]\nvalve_command = '0 V'\nspecimen_force = '0 N'\n"
            ),
        )
        .unwrap();
        file.directory = Some(folder.path().to_path_buf());
        let mut library = FmuLibrary::new(FmiVersion::V3, None);
        let system = assemble(&file, &[], &mut library).unwrap();
        let table = &system.components[0];
        let description = &table.fmu.description;
        let parameters: serde_json::Map<String, serde_json::Value> = table
            .parameters
            .iter()
            .map(|(index, value)| {
                let Value::Number(value) = value else {
                    panic!("{value:?} is not a number");
                };
                (description.variables[*index].name.clone(), (*value).into())
            })
            .collect();
        let known = description.of(Causality::Parameter).count();
        assert!(parameters.len() == 12 && known >= 12);
        // The command line sets the same.
        let asked = format!("table.model={}", folder.path().join("MODEL.toml").display());
        file.components.get_mut("table").unwrap().model = None;
        let again = assemble(&file, &[asked], &mut library).unwrap();
        assert_eq!(
            format!("{:?}", again.components[0].parameters),
            format!("{:?}", table.parameters)
        );

        let job = serde_json::json!({
            "parameters": parameters,
            "inputs": { "valve_command": command },
            "outputs": OUTPUTS,
        });
        let job_file = folder.path().join("job.json");
        std::fs::write(&job_file, job.to_string()).unwrap();
        let said = run_script("fmpy_model.py", [job_file.display().to_string(), path]);
        let line = said.lines().find_map(|line| line.strip_prefix("RESULT "));
        let played: Vec<Vec<f64>> = serde_json::from_str(line.unwrap()).unwrap();

        let own = difference(&played, &expected);
        let truth = difference(&played, &native(ShakeTable::default(), command));
        println!(
            "{:?}: {own:.1e} from the identified rig, {truth:.1e} from the truth",
            fmu.version
        );
        assert!(own < 1e-6, "{own}");
        // The identified rig is not the default one, and near it.
        assert!(truth > 1e-4 && truth < 0.2, "{truth}");
    }
}
