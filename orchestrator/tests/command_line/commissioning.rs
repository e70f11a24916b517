//! From a rig to its controllers: the page's commands, and that controllers know recordings alone.

use std::path::Path;

use fmi_import::FmiVersion;
use identification::data::Channel;
use laboratory::commission::{Request, record_excitation};
use laboratory::run::experiment::{self, prepare};
use laboratory::systems::built_in;

use super::{refused, shakebench, stderr, stdout};

const PAGE: &str = include_str!("../../../docs/commissioning.md");

/// The commands of the page, in order.
fn commands() -> Vec<Vec<String>> {
    let blocks = PAGE.split("```sh\n").skip(1);
    let lines = blocks.flat_map(|block| block.split("```").next().unwrap_or("").lines());
    lines
        .map(|line| line.split_whitespace().map(String::from).collect())
        .collect()
}

#[test]
fn the_commands_of_the_page_lead_from_a_rig_to_its_controllers() {
    let folder = tempfile::tempdir().unwrap();
    let commands = commands();
    assert!(commands.len() >= 6, "{commands:?}");
    for command in commands {
        let words: Vec<&str> = command[1..].iter().map(String::as_str).collect();
        assert_eq!(command[0], "shakebench");
        let output = shakebench(folder.path(), &words);
        assert!(output.status.success(), "{words:?}: {}", stderr(&output));
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("RIG/commission.json")).unwrap();
    // The growth is gentle: at most twofold, and never tripped.
    let growth = json["growth"].as_array().unwrap();
    assert!(growth.len() >= 3, "{growth:?}");
    for pair in growth.windows(2) {
        let [before, after] = [&pair[0], &pair[1]].map(|t| t["reference_m"].as_f64().unwrap());
        assert!(after < 2.001 * before && pair[1]["ended"].is_null());
    }
    for own in json["predictions"].as_array().unwrap() {
        if own["motion"] != "triangle" {
            let largest = own["largest_percent"].as_f64().unwrap();
            assert!(largest < 10.0, "{own}");
        }
    }
    for own in json["design"]["loops"].as_array().unwrap() {
        assert_eq!(own["robust"], true, "{own}");
        let margin = own["gain_margin_db"].as_f64().unwrap();
        let band = &own["gain_margin_band_db"];
        let [low, high] = ["low", "high"].map(|key| band[key].as_f64().unwrap());
        assert!(low <= margin + 0.5 && margin - 0.5 <= high, "{own}");
    }
    // What `identify` makes of the recording is what `commission` made of it.
    let model = |name: &str| -> toml::Table { read(name).parse().unwrap() };
    let (a, b) = (model("identified.toml"), model("RIG/model.toml"));
    for (section, key) in [("table", "mass"), ("hydraulics", "oil_stiffness")] {
        let [a, b] = [&a, &b].map(|file| file[section][key].as_float().unwrap());
        assert!((a / b - 1.0).abs() < 1e-3, "{section} {key}: {a} {b}");
    }
    assert!(read("RIG/report.html").contains("Growth of the excitation"));
}

/// Parameters of the controller's components, as the FMUs are given them.
fn given(controller: &str, set: &[String]) -> Vec<String> {
    let prepared = prepare(&experiment::Request {
        plant: "servohydraulic".into(),
        specimen: "yielding".into(),
        set: set.to_vec(),
        ..experiment::Request::built_in(controller)
    })
    .unwrap();
    let rig = ["table", "sensors", "interlock", "specimen"];
    let components = prepared.system.components.iter();
    components
        .filter(|component| !rig.contains(&component.name.as_str()))
        .map(|component| format!("{} {:?}", component.name, component.parameters))
        .collect()
}

#[test]
fn a_rig_changed_behind_the_controllers_backs_changes_recordings_only() {
    let changed = [
        "table.added_payload=10 kg",
        "table.flow_coefficient=1e-8",
        "table.bulk_modulus=2e8 Pa",
        "table.coulomb_friction=12 N",
        "sensors.acceleration_noise=0.1 m/s2",
    ]
    .map(String::from);
    for controller in built_in::names() {
        let as_it_was = given(controller, &[]);
        assert!(!as_it_was.is_empty());
        assert_eq!(as_it_was, given(controller, &changed), "{controller}");
    }
    let record = |set: &[String]| {
        let recording = record_excitation(&Request {
            plant: "servohydraulic".into(),
            specimen: "none".into(),
            set: set.to_vec(),
            level: 0.5,
            stroke: 0.0381,
            duration: 20.0,
            seed: 4,
            sensor_delay: 0.002,
            record: None,
            reference: None,
            played: 10.0,
            fmi: FmiVersion::V3,
            installation: pack::Installation::default(),
        })
        .unwrap();
        recording.samples(Channel::ActuatorForce).to_vec()
    };
    assert_ne!(record(&[]), record(&changed[..1]));
}

#[test]
fn what_cannot_be_commissioned_or_designed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let weak = "table.pump_pressure=493 psi";
    refused(
        folder.path(),
        &["commission", "--set", weak],
        &["--plant", "the supply's pressure is below its limit"],
    );
    refused(
        folder.path(),
        &["commission", "--plant", "press"],
        &["plant", "press"],
    );
    refused(
        folder.path(),
        &["commission", "--level", "9 g"],
        &["--level", "expected 0.02 to 2 g"],
    );
    let model = include_str!("../../laboratory/systems/plant/servohydraulic-model.toml");
    std::fs::write(folder.path().join("m.toml"), model).unwrap();
    refused(
        folder.path(),
        &["design", "--model", "m.toml", "--crossover", "900"],
        &["--crossover", "no controller crosses at 900"],
    );
    refused(
        folder.path(),
        &["design", "--model", "m.toml", "--loop", "pid"],
        &["--loop", "expected one of displacement-pid"],
    );
    let output = shakebench(
        folder.path(),
        &[
            "design",
            "--model",
            "m.toml",
            "--crossover",
            "25",
            "--loop",
            "loop-shaping",
            "--json",
        ],
    );
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let reached = json["loops"][0]["crossover_rad_s"].as_f64().unwrap();
    assert!((reached / 25.0 - 1.0).abs() < 0.1, "{reached}");
    assert!(Path::new(json["report"].as_str().unwrap()).ends_with("report.html"));
}

#[test]
fn the_system_file_of_mpc_holds_every_sample_of_shift_and_gives_the_same_run() {
    use laboratory::systems::tuning::Wanted;
    let folder = tempfile::tempdir().unwrap();
    let wanted = Wanted::default();
    let file = built_in::system("mpc", "servohydraulic", "yielding", wanted).unwrap();
    let text = file.to_toml();
    // The rig's measurements are a sample late, so the reference that they are compared with is too.
    for quantity in ["displacement", "velocity", "acceleration"] {
        for link in [
            format!("\"reference.{quantity}[-1] -> mpc.reference_{quantity}\""),
            format!("\"reference.{quantity} -> mpc.reference_{quantity}[1]\""),
        ] {
            assert!(text.contains(&link), "{link} is not in\n{text}");
        }
    }
    std::fs::write(folder.path().join("own.toml"), text).unwrap();
    let short = ["--duration", "6s", "--json", "--out"];
    let own = ["run", "own.toml"];
    let usual = [
        "run",
        "mpc",
        "--plant",
        "servohydraulic",
        "--specimen",
        "yielding",
    ];
    let checksum = |arguments: &[&str], out: &str| {
        let output = shakebench(folder.path(), &[arguments, &short, &[out]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        std::fs::read(folder.path().join(out).join("results.csv")).unwrap()
    };
    assert!(checksum(&own, "own") == checksum(&usual, "usual"));
}
