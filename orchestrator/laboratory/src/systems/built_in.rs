//! The systems that come with the program. A rig (plant and specimen) and a controller are files
//! of their own; a system is a controller on a rig, with aids behind the controller where its name says
//! so: `three-variable+friction`.

use std::path::Path;
use units::vocabulary;

use bridges::opensees;
use plant::specimens::YieldingSpecimen;
use plant::specimens::linear::LinearSpecimen;
use units::hint;

use super::biaxial;
use super::catalogue::{CONTROLLERS, Part, part};
use super::tuning::{self, Wanted};
use fmi_system::{Link, Origin, SystemError, SystemFile, VariableName};

/// Tables with their actuators.
const PLANTS: [Part; 2] = [
    part!("plant/", "identified"),
    part!("plant/", "servohydraulic"),
];
/// What controllers may know of a specimen: one storey or nothing.
type Known = fn() -> Option<YieldingSpecimen>;
/// What stands on the table.
const SPECIMENS: [(Part, Known); 5] = [
    (part!("specimen/", "linear"), || {
        Some(LinearSpecimen::appendix_a().into())
    }),
    (part!("specimen/", "yielding"), || {
        Some(YieldingSpecimen::default())
    }),
    (part!("specimen/", "storeys"), || None),
    (part!("specimen/", "storeys-tuned-mass"), || None),
    (part!("specimen/", "storeys-damped"), || None),
];
/// Computed structures between the ground and the specimen.
const STRUCTURES: [Part; 1] = [part!("structure/", "two-storeys")];
/// What a controller's command passes on its way to the valve where one of [`AIDS`] is on.
const AID_STAGE: &str = include_str!("../../systems/aids.toml");
/// What may follow a controller's name behind a `+`, and the switch of the component that it turns on.
const AIDS: [(&str, &str); 6] = [
    ("friction", vocabulary::FRICTION_COMPENSATION),
    ("specimen", vocabulary::SPECIMEN_COMPENSATION),
    ("delta-p", tuning::PRESSURE_STABILISATION),
    ("amplitude-phase", vocabulary::AMPLITUDE_PHASE_CONTROL),
    ("harmonics", vocabulary::HARMONIC_CANCELLATION),
    (VALVE, "valve_compensation"),
];
/// The aid that every controller has on a model whose valve is not an ideal one.
const VALVE: &str = "valve";
/// A structure that OpenSees computes: `opensees:MODEL.py`.
const OPENSEES: Part = part!("specimen/", "opensees");
/// Component that stands on the table.
const SPECIMEN: &str = "specimen";
/// No specimen, no structure.
pub const NONE: &str = "none";

/// The system run when none is named.
pub const DEFAULT_SYSTEM: &str = "three-variable";
/// The plant when none is named.
pub const DEFAULT_PLANT: &str = "identified";
/// The specimen when none is named.
pub const DEFAULT_SPECIMEN: &str = "linear";

/// Names of the built-in systems.
pub fn names() -> impl Iterator<Item = &'static str> {
    CONTROLLERS.iter().map(|part| part.name)
}

/// Names of the aids that may follow a system's name, each behind a `+`.
pub fn aids() -> impl Iterator<Item = &'static str> {
    AIDS.iter().map(|(name, _)| *name)
}

/// Checks the name of a built-in system, such as `three-variable+friction+delta-p`.
///
/// # Errors
/// A controller or an aid that is unknown.
pub fn check(name: &str) -> Result<(), SystemError> {
    let unknown = |what, name: &str, hint| SystemError::Unknown {
        what,
        name: name.to_string(),
        hint,
    };
    let mut parts = name.split('+');
    let controller = parts.next().unwrap_or_default();
    if !names().any(|known| known == controller) {
        return Err(unknown("system", controller, other_file(controller)));
    }
    match parts.find(|part| !aids().any(|known| known == *part)) {
        Some(aid) => Err(unknown("aid", aid, hint(aid, aids()))),
        None => Ok(()),
    }
}

/// What `name` could be where it is not a system.
fn other_file(name: &str) -> String {
    let path = Path::new(name);
    let is_motion = path.extension().is_some_and(|ending| {
        ["csv", "at2"].map(|own| ending.eq_ignore_ascii_case(own)) != [false; 2]
    });
    if is_motion {
        return "; pass a motion with --record or --reference".to_string();
    }
    if path.is_dir() {
        return ": it is a folder; expected a built-in system, or a .toml, .ssp or .fmu file"
            .to_string();
    }
    hint(name, names())
}

/// Puts the aids between the controller in `file` and the valve.
fn add_aids(file: &mut SystemFile, wanted: &[&str]) -> Result<(), SystemError> {
    if wanted.is_empty() {
        return Ok(());
    }
    let mut stage = SystemFile::parse("the built-in aids", AID_STAGE)?;
    for (name, switch) in AIDS {
        if wanted.contains(&name)
            && let Some(component) = stage.components.get_mut("aids")
        {
            component.set(switch, true);
        }
    }
    file.redirect(&std::mem::take(&mut stage.instead));
    file.description += &format!("; {}", wanted.join(", "));
    file.extend(stage);
    Ok(())
}

/// The interlock's parameter for the mass that moves.
const MOVING_MASS: &str = "moving_mass";

/// Names of the plants.
pub fn plants() -> impl Iterator<Item = &'static str> {
    let one_axis = PLANTS.iter().map(|part| part.name);
    one_axis.chain(std::iter::once(biaxial::PLANT))
}

/// Whether controllers on `plant` are tuned on the commissioned model of the physical rig.
pub fn is_commissioned(plant: &str) -> bool {
    [biaxial::RIG, biaxial::PLANT].contains(&plant)
}

/// Names of the specimens, `none` among them.
pub fn specimens() -> impl Iterator<Item = &'static str> {
    std::iter::once(NONE).chain(SPECIMENS.iter().map(|(part, _)| part.name))
}

/// Names of the computed structures, `none` among them.
pub fn structures() -> impl Iterator<Item = &'static str> {
    std::iter::once(NONE).chain(STRUCTURES.iter().map(|part| part.name))
}

/// Puts the computed structure `name` between the reference, which then is the ground's motion, and
/// whatever follows it in the built-in system `file`, whose sensors are those of `plant`.
///
/// # Errors
/// A name that is unknown.
pub fn add_structure(file: &mut SystemFile, name: &str, plant: &str) -> Result<(), SystemError> {
    if name == NONE {
        return Ok(());
    }
    if plant == biaxial::PLANT {
        let reason = "a computed structure has a single axis; expected another plant".to_string();
        return Err(file.at_fault("structure", reason));
    }
    let part = STRUCTURES.iter().find(|part| part.name == name);
    let mut structure = read("structure", part, name, structures())?;
    if !file.components.contains_key("specimen") {
        structure.disconnect("specimen");
    }
    structure.redirect(&plant_of(plant)?.instead);
    file.follow("structure");
    let adjust = std::mem::take(&mut file.adjust);
    file.extend(structure);
    file.extend(SystemFile {
        adjust,
        ..SystemFile::default()
    });
    file.name = format!("{}-on-{name}", file.name);
    Ok(())
}

/// Whether a plant is a file, written as the built-in ones are: components `table` and what belongs to
/// it, `instead` for what controllers are connected to.
fn is_plant_file(plant: &str) -> bool {
    plant.ends_with(".toml")
}

/// The plant of a name or a file.
fn plant_of(plant: &str) -> Result<SystemFile, SystemError> {
    if is_plant_file(plant) {
        return SystemFile::read(Path::new(plant));
    }
    let rig = PLANTS.iter().find(|part| part.name == plant);
    read("plant", rig, plant, plants())
}

/// A specimen's name as it is; the path of a model in OpenSees absolute, so that it stays true elsewhere.
pub fn specimen_path(specimen: &str) -> String {
    let absolute = opensees::model_of(specimen).and_then(|model| std::path::absolute(model).ok());
    absolute.map_or(specimen.to_string(), |path| {
        format!("{}{}", opensees::PREFIX, path.display())
    })
}

/// A plant's name as it is; a file's path absolute, so that it stays true elsewhere.
pub fn plant_path(plant: &str) -> String {
    let absolute = is_plant_file(plant).then(|| std::path::absolute(plant).ok());
    let absolute = absolute.flatten();
    absolute.map_or(plant.to_string(), |path| path.display().to_string())
}

/// A built-in system: the controller `name`, with the aids in that name, on a rig of `plant` and
/// `specimen` (or `none`). It has the `wanted` parameters, by default tuned for the physical rig
/// and as printed for the identified one.
///
/// # Errors
/// A name that is unknown, or a rig for which there is no tuning.
pub fn system(
    name: &str,
    plant: &str,
    specimen: &str,
    wanted: Wanted<'_>,
) -> Result<SystemFile, SystemError> {
    if plant == biaxial::PLANT {
        let one_axis = system(name, biaxial::RIG, specimen, wanted)?;
        return Ok(biaxial::on_two_axes(one_axis));
    }
    check(name)?;
    let (controller, aids) = name.split_once('+').unwrap_or((name, ""));
    let part = CONTROLLERS.iter().find(|part| part.name == controller);
    let mut file = read("system", part, controller, names())?;
    let mut aids: Vec<&str> = aids.split('+').filter(|aid| !aid.is_empty()).collect();
    let curved = wanted
        .has_curve()
        .map_err(|reason| file.at_fault("tuning", reason))?;
    if curved && !aids.contains(&VALVE) {
        aids.push(VALVE);
    }
    add_aids(&mut file, &aids)?;
    file.origin = format!("{name} (built-in)");
    let rig = plant_of(plant)?;
    if is_plant_file(plant) {
        file.directory.clone_from(&rig.directory);
    }
    let mut on_table = None;
    if let Some(model) = opensees::model_of(specimen) {
        if model.as_os_str().is_empty() {
            return Err(SystemError::Unreadable {
                path: specimen.into(),
                reason: "no model is named; expected opensees:MODEL.py".to_string(),
            });
        }
        let mut part = read("specimen", Some(&OPENSEES), specimen, specimens())?;
        if let Some(component) = part.components.get_mut("specimen") {
            component.set(super::opensees::MODEL, model.display().to_string().as_str());
        }
        on_table = Some((part, None));
    } else if specimen != NONE {
        let found = SPECIMENS.iter().find(|(part, _)| part.name == specimen);
        let part = read(
            "specimen",
            found.map(|found| &found.0),
            specimen,
            specimens(),
        )?;
        on_table = Some((part, found.and_then(|found| found.1())));
    }
    let wanted = Wanted {
        inside: wanted.inside || on_table.is_none() && has_specimen_inside(&rig),
        ..wanted
    };
    if on_table.is_none() && !wanted.inside {
        file.disconnect(SPECIMEN);
    }
    let own = on_table.as_ref().and_then(|(_, own)| own.as_ref());
    tuning::apply(&mut file, &rig, own, wanted)
        .map_err(|reason| file.at_fault("tuning", reason))?;
    file.redirect(&rig.instead);
    let mass =
        tuning::rigid_mass(&rig, wanted).map_err(|reason| file.at_fault("tuning", reason))?;
    file.extend(rig);
    // Of a computed structure nobody states the mass.
    let mass = mass.filter(|_| opensees::model_of(specimen).is_none());
    if let (Some(mass), Some(interlock)) = (mass, file.components.get_mut("interlock"))
        && interlock.fmu == "Interlock"
        && !interlock.parameters.contains_key(MOVING_MASS)
    {
        interlock.set(MOVING_MASS, mass);
    }
    match on_table {
        None => file.disconnect(SPECIMEN),
        Some((specimen, _)) => {
            file.adjust.extend(specimen.adjust.clone());
            file.extend(specimen);
        }
    }
    file.name = name.to_string();
    Ok(file)
}

/// Whether a plant measures a specimen's acceleration, but not of a component that others put on it.
fn has_specimen_inside(plant: &SystemFile) -> bool {
    let own = VariableName::new(SPECIMEN, "acceleration");
    let is_outside =
        |link: &Link| matches!(&link.from, Origin::Output(from) if from.component == SPECIMEN);
    plant.instead.contains_key(&own) && !plant.connections.iter().any(is_outside)
}

fn read(
    what: &'static str,
    part: Option<&Part>,
    name: &str,
    known: impl Iterator<Item = &'static str>,
) -> Result<SystemFile, SystemError> {
    let part = part.ok_or_else(|| SystemError::Unknown {
        what,
        name: name.to_string(),
        hint: hint(name, known),
    })?;
    let mut file = SystemFile::parse(&format!("the built-in {what} {name}"), part.text)?;
    file.name = name.to_string();
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_system_reads_back_as_the_same() {
        for name in names() {
            let file = system(name, "servohydraulic", "yielding", Wanted::default()).unwrap();
            let text = file.to_toml();
            let again = SystemFile::parse(name, &text).unwrap();
            assert_eq!(again.to_toml(), text, "{name}");
            let links = |file: &SystemFile| -> Vec<String> {
                file.connections.iter().map(ToString::to_string).collect()
            };
            assert_eq!(links(&again), links(&file));
            assert_eq!(again.experiment.end_when, file.experiment.end_when);
            for (name, component) in &file.components {
                assert_eq!(again.components[name].parameters, component.parameters);
                assert_eq!(again.components[name].inputs, component.inputs);
            }
        }
    }

    /// A plant that measures the acceleration of a specimen of its own, its model, and a controller on both.
    fn with_a_specimen_inside(plant: &str, specimen: &str) -> SystemFile {
        const OUTSIDE: &str = "specimen.acceleration  ->";
        let folder = tempfile::tempdir().unwrap();
        let text = PLANTS[1].text;
        assert!(text.contains(OUTSIDE));
        let inside = folder.path().join("inside.toml");
        let own = text.replace(OUTSIDE, "table.specimen_acceleration ->");
        std::fs::write(&inside, own).unwrap();
        let model = folder.path().join("model.toml");
        let carried = "[specimen]\nmass = 0.08\ndamping = 0.2\nstiffness = 100.0\n\n[hydraulics]\n";
        let own = include_str!("../../systems/plant/servohydraulic-model.toml");
        std::fs::write(&model, own.replacen("[hydraulics]\n", carried, 1)).unwrap();
        let plant = match plant {
            "inside" => inside.to_str().unwrap(),
            other => other,
        };
        let wanted = Wanted {
            model: Some(&model),
            ..Wanted::default()
        };
        system("adaptive-preview", plant, specimen, wanted).unwrap()
    }

    #[test]
    fn a_specimen_inside_of_a_plant_is_the_models() {
        let pounds = |value: f64| value * 4.448_221_615_260_5 / 0.0254;
        let number = |file: &SystemFile, name: &str| {
            let own = &file.components["control"].parameters[name];
            own.to_string().parse::<f64>().unwrap()
        };
        let stiffness = |file: &SystemFile| {
            number(file, "specimen_yield_force") / number(file, "specimen_yield_displacement")
        };
        let measured = |file: &SystemFile| {
            let mut links = file.connections.iter().map(ToString::to_string);
            links.any(|link| {
                link == "sensors.measured_specimen_acceleration -> control.specimen_acceleration"
            })
        };
        let known = |file: &SystemFile| {
            let own = &file.components["control"].parameters["specimen_known"];
            own == &fmi_system::Setting::Boolean(true)
        };
        let inside = with_a_specimen_inside("inside", NONE);
        assert!(known(&inside) && measured(&inside));
        assert!((number(&inside, "specimen_mass") / pounds(0.08) - 1.0).abs() < 1e-9);
        assert!((stiffness(&inside) / pounds(100.0) - 1.0).abs() < 1e-9);
        // Nothing stands on a bare table, whatever stood there before.
        let bare = with_a_specimen_inside("servohydraulic", NONE);
        assert!(!known(&bare) && !measured(&bare));
        // One that is named is known before the test within a fifth.
        let named = with_a_specimen_inside("servohydraulic", "linear");
        let own = LinearSpecimen::appendix_a();
        assert!(known(&named) && measured(&named));
        assert!((stiffness(&named) / own.stiffness - 0.8).abs() < 1e-9);
    }

    /// Components, parameters by name, and connections of a system.
    fn outline(file: &SystemFile) -> String {
        let mut text = format!("{} ({}): {}\n", file.name, file.origin, file.description);
        for (name, own) in &file.components {
            let period = own
                .period
                .as_ref()
                .map_or(String::new(), |period| format!(" every {period}"));
            let parameters: Vec<&str> = own.parameters.keys().map(String::as_str).collect();
            text += &format!("  {name}: {}{period}, {}\n", own.fmu, parameters.join(" "));
        }
        for link in &file.connections {
            text += &format!("  {link}\n");
        }
        text
    }

    #[test]
    fn systems_have_the_parts_of_their_names() {
        let on = |name: &str, plant: &str, specimen: &str| {
            system(name, plant, specimen, Wanted::default()).unwrap()
        };
        let mut text = String::new();
        for name in [
            "displacement-pid",
            "three-variable",
            "loop-shaping",
            "sliding-mode",
            "mpc",
        ] {
            text += &outline(&on(name, "identified", "linear"));
        }
        text += &outline(&on("displacement-pid", "servohydraulic", NONE));
        text += &outline(&on("displacement-pid", "servohydraulic", "storeys"));
        text += &outline(&on(
            "displacement-pid+friction+delta-p",
            "servohydraulic",
            "yielding",
        ));
        text += &outline(&on("displacement-pid", biaxial::PLANT, "linear"));
        let mut file = on("displacement-pid", "servohydraulic", "yielding");
        add_structure(&mut file, "two-storeys", "servohydraulic").unwrap();
        text += &outline(&file);
        let mut file = on("displacement-pid", "servohydraulic", NONE);
        let before = outline(&file);
        add_structure(&mut file, NONE, "servohydraulic").unwrap();
        assert_eq!(outline(&file), before);
        add_structure(&mut file, "two-storeys", "servohydraulic").unwrap();
        text += &outline(&file);
        expected::compare(env!("CARGO_MANIFEST_DIR"), "systems.txt", &text);
    }

    #[test]
    fn unknown_names_are_refused_with_what_there_is() {
        let told = |name: &str| check(name).map_err(|error| error.to_string());
        assert_eq!(told("mpc+friction+delta-p"), Ok(()));
        for (name, expected) in [
            ("mcp", "mpc"),
            ("mpc+fricton", "friction"),
            ("wave.AT2", "pass a motion with --record or --reference"),
            ("wave.csv", "pass a motion with --record or --reference"),
            (".", "it is a folder"),
        ] {
            let told = told(name).unwrap_err();
            assert!(told.contains(expected), "{name}: {told}");
        }
        assert!(system("mpc", "identifed", NONE, Wanted::default()).is_err());
        assert!(system("mpc", "identified", "linar", Wanted::default()).is_err());
        assert!(system("mpc", "identified", "opensees:", Wanted::default()).is_err());
        let mut file = system("mpc", "identified", NONE, Wanted::default()).unwrap();
        assert!(add_structure(&mut file, "three-storeys", "identified").is_err());
        let told = add_structure(&mut file, "two-storeys", biaxial::PLANT)
            .unwrap_err()
            .to_string();
        assert!(
            told.contains("a computed structure has a single axis"),
            "{told}"
        );
        assert_eq!(
            plants().collect::<Vec<_>>(),
            ["identified", "servohydraulic", "biaxial"]
        );
        assert_eq!(
            ["identified", "servohydraulic", "biaxial"].map(is_commissioned),
            [false, true, true]
        );
        assert_eq!(
            (specimens().next(), structures().collect::<Vec<_>>()),
            (Some(NONE), vec![NONE, "two-storeys"])
        );
        assert_eq!(
            (specimen_path("linear"), plant_path("identified")),
            ("linear".into(), "identified".into())
        );
        let here = std::path::absolute("a.toml").unwrap();
        assert_eq!(plant_path("a.toml"), here.display().to_string());
        assert!(specimen_path("opensees:a.py").ends_with("/a.py"));
    }

    #[test]
    fn printed_parameters_are_those_of_the_identified_plant() {
        use crate::systems::tuning::Tuning;
        let wanted = |tuning, model| Wanted {
            tuning,
            model,
            ..Wanted::default()
        };
        let gain = |plant: &str, tuning| {
            let file = system("displacement-pid", plant, NONE, wanted(tuning, None)).unwrap();
            file.components["control"]
                .parameters
                .get("proportional_gain")
                .map(ToString::to_string)
        };
        let printed = Some(Tuning::Printed);
        assert_eq!(gain("servohydraulic", printed), gain("identified", None));
        assert_ne!(
            gain("servohydraulic", Some(Tuning::Tuned)),
            gain("servohydraulic", printed)
        );
        assert_eq!(
            gain("servohydraulic", Some(Tuning::Tuned)),
            gain("servohydraulic", None)
        );
        let told = |plant: &str, wanted| {
            system("displacement-pid", plant, NONE, wanted)
                .unwrap_err()
                .to_string()
        };
        let none = told("identified", wanted(Some(Tuning::Tuned), None));
        assert!(
            none.contains("there is no tuning for the plant `identified`"),
            "{none}"
        );
        let model = Path::new("model.toml");
        let both = told("servohydraulic", wanted(printed, Some(model)));
        assert!(
            both.contains("printed parameters do not use `--control-model`"),
            "{both}"
        );
        let gone = told(
            "servohydraulic",
            wanted(None, Some(Path::new("/no/such/model.toml"))),
        );
        assert!(gone.contains("/no/such/model.toml"), "{gone}");
    }
}
