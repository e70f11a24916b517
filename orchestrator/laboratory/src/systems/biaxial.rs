//! A system on two axes: the physical rig twice under one platen, a controller for each, and a payload that may couple
//! them.

use fmi_system::{ComponentFile, Link, Origin, Setting, SystemFile, VariableName};

/// Name of the plant.
pub const PLANT: &str = "biaxial";
/// The rig along each axis.
pub(super) const RIG: &str = "servohydraulic";
/// What the names of components along the second axis end in.
const SECOND: &str = "_y";
/// The component that stands on the table.
const SPECIMEN: &str = "specimen";
/// The noise of the sensors along the second axis.
const SECOND_SEED: i64 = 2;

/// The single-axis system `file` along both axes. Components along the second axis have the name of those along the
/// first with `_y` after it. The specimen of one storey becomes one payload on both axes, which couples them by
/// its eccentricity; of any other each axis has its own.
///
/// If one interlock trips, both axes stop and the run ends.
pub(super) fn on_two_axes(mut file: SystemFile) -> SystemFile {
    let second = |name: &VariableName| {
        VariableName::new(&format!("{}{SECOND}", name.component), &name.variable)
    };
    let mut links: Vec<Link> = file.connections.clone();
    for link in &mut links {
        link.to = second(&link.to);
        link.from = match &link.from {
            Origin::Reference { quantity, ahead } => Origin::Reference {
                quantity: quantity.second(),
                ahead: *ahead,
            },
            Origin::Output(name) => Origin::Output(second(name)),
        };
    }
    file.connections.extend(links);
    let copies: Vec<(String, ComponentFile)> = file
        .components
        .iter()
        .map(|(name, component)| {
            let mut copy = component.clone();
            if copy.fmu == "Instrumentation" {
                copy.set("seed", SECOND_SEED);
            }
            (format!("{name}{SECOND}"), copy)
        })
        .collect();
    file.components.extend(copies);
    if file
        .components
        .get(SPECIMEN)
        .is_some_and(|own| own.fmu == "Specimen")
    {
        share_payload(&mut file);
    }
    let interlock = VariableName::new("interlock", "stop");
    if file.experiment.stop.as_ref() == Some(&interlock) {
        if let Some(own) = file.components.get_mut(&interlock.component) {
            own.inputs.remove(&interlock.variable);
        }
        file.connect(
            Origin::output(&format!("interlock{SECOND}"), "tripped"),
            interlock,
        );
        // The other axis has no one to stop it softly.
        file.experiment.stop = None;
        file.experiment.end_after = None;
    }
    file.description += ", along two axes";
    file
}

/// One payload in place of the two specimens of one storey.
fn share_payload(file: &mut SystemFile) {
    let other = format!("{SPECIMEN}{SECOND}");
    file.components.remove(&other);
    let mut payload = ComponentFile::new("EccentricPayload");
    for name in ["eccentricity_x", "eccentricity_y"] {
        payload.set(name, Setting::from("0 in"));
    }
    file.components.insert(SPECIMEN.to_string(), payload);
    let rename = |name: &mut VariableName| {
        let axis = match &name.component {
            own if own == SPECIMEN => "x",
            own if *own == other => "y",
            _ => return,
        };
        name.component = SPECIMEN.to_string();
        name.variable = format!("{}_{axis}", name.variable);
    };
    for link in &mut file.connections {
        rename(&mut link.to);
        if let Origin::Output(name) = &mut link.from {
            rename(name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: &str = r#"
name = "one"
description = "a table"
[components.control]
fmu = "DisplacementPid"
period = "2 ms"
[components.table]
fmu = "ServoHydraulicTable"
[components.sensors]
fmu = "Instrumentation"
parameters = { seed = 1 }
[components.specimen]
fmu = "SPECIMEN"
[components.interlock]
fmu = "Interlock"
inputs = { stop = false }
[experiment]
stop = "interlock.stop"
"#;

    fn both(specimen: &str) -> SystemFile {
        let links = [
            "reference.displacement[2] -> control.reference_displacement",
            "control.valve_command -> table.valve_command",
            "specimen.force -> table.specimen_force",
            "table.acceleration -> specimen.table_acceleration",
        ];
        let links: Vec<String> = links.iter().map(|link| format!("{link:?}")).collect();
        let head = format!("connections = [{}]\n", links.join(", "));
        let text = head + &AXIS.replace("SPECIMEN", specimen);
        on_two_axes(SystemFile::parse("one", &text).unwrap())
    }

    fn connections(file: &SystemFile) -> Vec<String> {
        file.connections.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_specimen_of_one_storey_becomes_a_payload_on_both_axes() {
        let file = both("Specimen");
        let names: Vec<&str> = file.components.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                "control",
                "control_y",
                "interlock",
                "interlock_y",
                "sensors",
                "sensors_y",
                "specimen",
                "table",
                "table_y"
            ]
        );
        let payload = &file.components["specimen"];
        assert_eq!(payload.fmu, "EccentricPayload");
        assert_eq!(
            payload.parameters["eccentricity_y"],
            Setting::Text("0 in".into())
        );
        assert_eq!(
            file.components["sensors_y"].parameters["seed"],
            Setting::Integer(2)
        );
        assert_eq!(
            file.components["sensors"].parameters["seed"],
            Setting::Integer(1)
        );
        assert_eq!(
            connections(&file),
            [
                "reference.displacement[2] -> control.reference_displacement",
                "control.valve_command -> table.valve_command",
                "specimen.force_x -> table.specimen_force",
                "table.acceleration -> specimen.table_acceleration_x",
                "reference.displacement_y[2] -> control_y.reference_displacement",
                "control_y.valve_command -> table_y.valve_command",
                "specimen.force_y -> table_y.specimen_force",
                "table_y.acceleration -> specimen.table_acceleration_y",
                "interlock_y.tripped -> interlock.stop",
            ]
        );
        assert!(file.experiment.stop.is_none());
        assert!(file.components["interlock"].inputs.is_empty());
        assert!(!file.components["interlock_y"].inputs.is_empty());
        assert_eq!(file.description, "a table, along two axes");
    }

    #[test]
    fn of_another_specimen_each_axis_has_its_own() {
        let file = both("StoreysSpecimen");
        let of = |name: &str| &*file.components[name].fmu;
        assert_eq!(
            (of("specimen"), of("specimen_y")),
            ("StoreysSpecimen", "StoreysSpecimen")
        );
        assert!(
            connections(&file).contains(&"specimen_y.force -> table_y.specimen_force".to_string())
        );
    }
}
