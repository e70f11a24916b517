//! From an extended model to the drive with which the rig follows a motion that was not recorded.

use std::path::Path;

use hidden_effects::case::{Case, Kind, Settings};
use identification::diagnosis::case::Nominal;
use laboratory::iteration::circle::{Plan, close, write};
use laboratory::iteration::on_model::{ModelledRig, Search};
use laboratory::results::Out;
use motion::{self, Motion, Options};
use plant::identified::rig::IdentifiedRig;
use units::constants::{G, INCH};

fn law_of(case: &Case) -> Nominal {
    Nominal::parse(&case.nominal()).unwrap()
}

/// A model that knows the delay drives a rig that shares no code with it, noise and disturbance on, better
/// than one that does not.
#[test]
fn a_drive_that_knows_the_effect_is_better_on_an_independent_rig() {
    let case = Case::draw(20_262, &Settings::new(Kind::This("command_delay")));
    let nominal = law_of(&case);
    let law = nominal.controller.unwrap();
    let believed = IdentifiedRig {
        shake_table: nominal.shake_table,
        specimen: nominal.specimen,
        ..IdentifiedRig::default()
    };
    let truth = &case.truth.effects[0].parameters["delay"];
    assert_eq!(truth.unit, "s");
    let mut known = believed;
    known.effects.valve.command_delay = truth.value;
    let options = Options {
        scaling: Some(motion::Scaling::PeakAcceleration(0.2 * G)),
        ..Options::default()
    };
    let wanted = motion::built_in(3, &options).unwrap();
    let search = Search {
        corrections: 4,
        ..Search::default()
    };
    let [plain, aware] = [believed, known].map(|rig| {
        let rig = ModelledRig::new(&rig, &law, 0.002).unwrap();
        rig.drive(&wanted, &search).unwrap()
    });
    println!("{:.2?} and {:.2?} %", plain.errors, aware.errors);
    assert!(plain.tracking.time_domain_percent < 0.2 * plain.errors[0]);
    let on_rig = |drive: &Motion| {
        let reference: Vec<f64> = drive.displacement.iter().map(|x| x / INCH).collect();
        let table = case.follow(&reference, 5);
        let column = |i: usize| -> Vec<f64> { table.iter().map(|row| row[i] * INCH).collect() };
        let tracking = motion::metrics::tracking(&wanted, &column(0), &column(1)).unwrap();
        tracking.time_domain_percent
    };
    let [itself, unaware, found] = [&wanted, &plain.drive, &aware.drive].map(on_rig);
    println!("{itself:.2}, {unaware:.2}, {found:.2} %");
    assert!(
        found < 0.5 * unaware && unaware < itself,
        "{found} {unaware} {itself}"
    );
}

#[test]
fn what_makes_no_drive_is_said_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let case = Case::draw(11, &Settings::new(Kind::Nothing));
    let place = folder.path().join("case");
    case.write(&place).unwrap();
    let model = folder.path().join("model.toml");
    let plan = |case: &Path| Plan {
        case: case.to_path_buf(),
        model: model.clone(),
        record: None,
        reference: None,
        scaling: None,
        seed: 3,
        search: Search {
            corrections: 1,
            ..Search::default()
        },
    };
    let fault = |case: &Path| close(&plan(case)).unwrap_err().to_string();
    assert!(fault(folder.path()).contains("nominal.toml"));
    assert!(fault(&place).contains("model.toml"));
    let nominal = case.nominal();
    std::fs::write(
        &model,
        format!("{nominal}\n[effects.valve_dead_bant]\nhalf_width = 0.1\n"),
    )
    .unwrap();
    assert!(
        fault(&place).contains("valve_dead_band"),
        "{}",
        fault(&place)
    );
    let text = format!("{nominal}\n[effects.valve_dead_band]\nhalf_width = 0.1\n");
    std::fs::write(&model, &text).unwrap();
    let without = nominal.replace("[controller]", "[controller_of_old]");
    std::fs::write(place.join("nominal.toml"), without).unwrap();
    assert!(fault(&place).contains("controller"));
    std::fs::write(place.join("nominal.toml"), nominal).unwrap();
    let found = close(&plan(&place)).unwrap();
    let [itself, .., extended] = found.expected().map(|(_, e)| e.time_domain_percent);
    assert!(extended < itself && found.effects == ["valve_dead_band"]);
    let out = folder.path().join("out");
    write(&found, &Out::new(&out)).unwrap();
    let drive = motion::load_reference(&out.join("drive.csv"), &Options::default()).unwrap();
    assert_eq!(drive.len(), found.drive.unwrap().len());
}
