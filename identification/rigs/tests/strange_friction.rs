//! Friction whose contact gives way before it slides, on a table with equations of its own
//! (`tests/strangers/src/table`).

use diagnosis::{Observer, Verdict};
use rigs::case::Case;
use rigs::kinds::shake_table::diagnose;
use strangers::table::case::{Case as StrangeCase, Kind};
use units::constants::{INCH, LBF};

/// Bristles by LuGre's equation, integrated with the rig, under noises of another form: 0.5763 lbf and a bump of
/// 0.9865 lbf. It takes half a minute.
#[test]
#[ignore = "slow: half a minute"]
fn bristles_of_another_rig_are_found_as_its_friction() {
    let drawn = StrangeCase::draw(52107, Kind::One, &[]);
    let hidden = &drawn.truth.effects[0];
    assert_eq!(hidden.effect, "stribeck_friction");
    let folder = tempfile::tempdir().unwrap();
    drawn.write(folder.path()).unwrap();
    let case = Case::read(folder.path()).unwrap();
    let diagnosis = diagnose(&case, Observer::none()).unwrap();
    println!("{}", diagnosis.sentence);
    assert_eq!(diagnosis.verdict, Verdict::Named);
    let [found] = diagnosis.effects.as_slice() else {
        panic!("{:?}", diagnosis.effects);
    };
    assert_eq!(found.effect, "stribeck_friction");
    for (name, within) in [("coulomb_force", 0.15), ("stribeck_force", 0.1)] {
        let mut parameters = found.parameters.iter();
        let own = parameters.find(|own| own.name == name).unwrap().value / LBF;
        let there = hidden.parameters[name].value;
        assert!((own / there - 1.0).abs() < within, "{name}: {own}, {there}");
    }
    // The bristles of the rig give way at their own deflection.
    let friction = diagnosis.extended_model.effects.presliding_friction;
    let way = friction.presliding_displacement / INCH;
    assert!((5e-4..3e-3).contains(&way), "{way} in");
}
