//! Sets of parameters by name: the published models, and files that identification writes.

use std::path::Path;
use units::vocabulary;

use identification::IdentificationError;
use identification::identify::model_file::ModelFile;
use plant::ModelError;
use plant::identified::actuator::PublishedActuator;
use plant::identified::effects::{self, Component};
use plant::identified::nominal::{shake_table_values, specimen_values};
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;

use fmi_import::{Causality, Description};
use fmi_system::Value;
use units::hint;

/// Why a set of parameters does not fit a component.
#[derive(Debug, thiserror::Error)]
pub enum ParameterSetError {
    /// A name that no published model has.
    #[error("`{name}` is neither a published model nor a path to a MODEL.toml{hint}")]
    Unknown {
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// A published model that must not be simulated.
    #[error(transparent)]
    Refused(#[from] ModelError),
    /// A model file that cannot be read.
    #[error(transparent)]
    File(#[from] IdentificationError),
    /// A published model for another component.
    #[error("`{name}` is a model of ShakeTable, not of {component}")]
    NotShakeTable {
        /// The model.
        name: String,
        /// The component.
        component: String,
    },
    /// A file without a specimen for one.
    #[error("{file}: there is no [specimen], and {component} is not a ShakeTable")]
    NoSpecimen {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
    /// A file for other components.
    #[error("{file}: a model of ShakeTable, Specimen and Instrumentation, not of {component}")]
    Component {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
    /// An effect that the component does not know.
    #[error("{file}: [effects.{effect}]: {component} has no parameter `{parameter}`{hint}")]
    NoParameter {
        /// The file.
        file: String,
        /// The effect.
        effect: String,
        /// The component.
        component: String,
        /// Its parameter.
        parameter: String,
        /// The nearest name.
        hint: String,
    },
    /// A file that says nothing of the component.
    #[error("{file}: it has nothing for {component}")]
    Nothing {
        /// The file.
        file: String,
        /// The component.
        component: String,
    },
}

/// Published models of `ShakeTable`.
const PUBLISHED: [(&str, PublishedActuator); 3] = [
    ("equation-2-11", PublishedActuator::Equation2_11),
    ("equation-2-13", PublishedActuator::Equation2_13),
    ("derounded", PublishedActuator::Derounded),
];

/// The parameters that the model `name` gives to a component, as position and value; paths are
/// relative to `directory`. A published model is one of `ShakeTable`; a file gives its actuator
/// and table to `ShakeTable` and its specimen to `Specimen`, and the effects in it to the
/// component that has them.
///
/// # Errors
/// An unknown name, a model that must not be simulated (with the reason), a file at fault, a
/// component that the model says nothing of.
pub fn parameters(
    name: &str,
    component: &Description,
    directory: Option<&Path>,
) -> Result<Vec<(usize, Value)>, ParameterSetError> {
    if name.ends_with(".toml") {
        let path = directory.unwrap_or(Path::new("")).join(name);
        return from_file(&path, component);
    }
    let found = PUBLISHED.iter().find(|(known, _)| *known == name);
    let Some(&(_, published)) = found else {
        let known = PUBLISHED.iter().map(|(known, _)| *known);
        return Err(ParameterSetError::Unknown {
            name: name.to_string(),
            hint: hint(name, known),
        });
    };
    let actuator = published.for_simulation()?;
    let table = match published {
        PublishedActuator::Derounded => Table::derounded(),
        _ => Table::equation_2_28(),
    };
    let values = shake_table_values(&ShakeTable { actuator, table });
    place(&values, component).ok_or_else(|| ParameterSetError::NotShakeTable {
        name: name.to_string(),
        component: component.model_name.clone(),
    })
}

fn from_file(
    path: &Path,
    component: &Description,
) -> Result<Vec<(usize, Value)>, ParameterSetError> {
    let name = path.display().to_string();
    let file = ModelFile::read(path)?;
    let own = COMPONENTS
        .into_iter()
        .find(|(_, mark)| component.position(mark).is_some())
        .map(|(component, _)| component);
    let mut values: Vec<(&str, f64)> = Vec::new();
    if own == Some(Component::ShakeTable) {
        let rig = file.shake_table(&name)?;
        values.extend(shake_table_values(&rig));
    } else if own != Some(Component::Instrumentation) {
        let specimen = file.specimen(&name)?;
        let specimen = specimen.ok_or_else(|| ParameterSetError::NoSpecimen {
            file: name.clone(),
            component: component.model_name.clone(),
        })?;
        values.extend(specimen_values(&specimen));
    }
    let mut placed = place(&values, component).ok_or_else(|| ParameterSetError::Component {
        file: name.clone(),
        component: component.model_name.clone(),
    })?;
    for (effect, parameters) in &file.effects {
        if Some(component_of(effect)) != own {
            continue;
        }
        for (parameter, value) in parameters {
            let parameter = format!("{effect}.{parameter}");
            let known = component
                .of(Causality::Parameter)
                .map(|index| component.variables[index].name.as_str());
            let position = parameter_position(component, &parameter).ok_or_else(|| {
                ParameterSetError::NoParameter {
                    file: name.clone(),
                    effect: effect.to_string(),
                    component: component.model_name.clone(),
                    hint: hint(&parameter, known),
                    parameter,
                }
            })?;
            placed.push((position, Value::Number(*value)));
        }
    }
    if placed.is_empty() {
        return Err(ParameterSetError::Nothing {
            file: name,
            component: component.model_name.clone(),
        });
    }
    Ok(placed)
}

/// Components that a model file speaks of, each with a parameter that only it has.
const COMPONENTS: [(Component, &str); 3] = [
    (Component::ShakeTable, vocabulary::ACTUATOR_A2),
    (Component::Specimen, "specimen_absent.absent"),
    (Component::Instrumentation, "load_cell_bias.offset"),
];

/// The component that has the parameters of an effect; of one that is unknown, the table.
pub fn component_of(effect: &str) -> Component {
    effects::find(effect).map_or(Component::ShakeTable, |effect| effect.component)
}

fn parameter_position(component: &Description, name: &str) -> Option<usize> {
    component
        .of(Causality::Parameter)
        .find(|&index| component.variables[index].name == name)
}

/// Positions of the parameters, or nothing where the component lacks one.
fn place(values: &[(&str, f64)], component: &Description) -> Option<Vec<(usize, Value)>> {
    values
        .iter()
        .map(|&(name, value)| Some((parameter_position(component, name)?, Value::Number(value))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extended_model::ExtendedModel;
    use fmi_import::Fmu;
    use identification::diagnosis::case::Nominal;
    use identification::diagnosis::engine::{NamedEffect, ParameterEstimate};
    use identification::diagnosis::rigs::shake_table::ExtendedModel as Estimated;
    use plant::identified::effects::Effects;
    use plant::sensors::instrumentation::Instrumentation;
    use plant::specimens::linear::LinearSpecimen;

    /// The description of a component with these parameters, behind an output.
    fn description(name: &str, parameters: &[&str]) -> Description {
        let variables = parameters.iter().enumerate().map(|(n, name)| {
            format!(
                r#"<Float64 name="{name}" valueReference="{}" causality="parameter" variability="fixed" start="0"/>"#,
                n + 2
            )
        });
        let text = format!(
            r#"<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="1">
            <CoSimulation modelIdentifier="{name}"/><ModelVariables>
            <Float64 name="y" valueReference="1" causality="output"/>{}</ModelVariables>
            <ModelStructure><Output valueReference="1"/></ModelStructure></fmiModelDescription>"#,
            variables.collect::<String>()
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Own.fmu");
        let entries = [("modelDescription.xml".to_string(), text.into_bytes())];
        crate::write_archive(&path, &entries.into(), None).unwrap();
        Fmu::open(&path).unwrap().description.clone()
    }

    fn nominal() -> Nominal {
        Nominal {
            sample_rate: 500.0,
            shake_table: ShakeTable::default(),
            specimen: Some(LinearSpecimen::appendix_a()),
            controller: None,
            noise: [1e-5, 1e-2, 10.0, 1e-2],
            command_noise: 1e-3,
            uncertainty: 0.05,
            effects: Effects::default(),
            sensors: Instrumentation::default(),
        }
    }

    /// A model file in which the dead band of the valve was found.
    fn file() -> ExtendedModel {
        let mut estimated = Estimated::known(&nominal());
        estimated.effects.valve.dead_band = 0.25;
        let named = NamedEffect {
            effect: "valve_dead_band",
            parameters: vec![ParameterEstimate {
                name: "half_width".into(),
                value: 0.25,
                unit: "V",
                standard_error: 0.01,
                is_shape: false,
            }],
            confidence: 0.99,
        };
        ExtendedModel::new(&estimated, &[named])
    }

    fn names(values: &[(&'static str, f64)]) -> Vec<&'static str> {
        values.iter().map(|(name, _)| *name).collect()
    }

    fn numbers(found: Vec<(usize, Value)>) -> Vec<(usize, f64)> {
        let numbers = found.into_iter().map(|(place, value)| match value {
            Value::Number(number) => (place, number),
            other => panic!("{other:?}"),
        });
        numbers.collect()
    }

    #[test]
    fn published_models_are_those_of_the_table() {
        let values = |actuator: PublishedActuator, table| {
            let actuator = actuator.for_simulation().unwrap();
            shake_table_values(&ShakeTable { actuator, table })
        };
        let printed = values(PublishedActuator::Equation2_13, Table::equation_2_28());
        let own = description("ShakeTable", &names(&printed));
        let found = |name: &str| parameters(name, &own, None);
        // Parameters follow the output, in their order.
        let expected = |values: Vec<(&str, f64)>| -> Vec<(usize, f64)> {
            let values = values.into_iter().enumerate();
            values.map(|(n, (_, value))| (n + 1, value)).collect()
        };
        assert_eq!(numbers(found("equation-2-13").unwrap()), expected(printed));
        let derounded = values(PublishedActuator::Derounded, Table::derounded());
        assert_eq!(numbers(found("derounded").unwrap()), expected(derounded));
        let refused = found("equation-2-11").unwrap_err();
        assert!(
            matches!(refused, ParameterSetError::Refused(_)),
            "{refused}"
        );
        let unknown = found("equation-2-31").unwrap_err().to_string();
        assert!(
            unknown.starts_with("`equation-2-31` is neither a published model")
                && unknown.contains("equation-2-13"),
            "{unknown}"
        );
        let other = parameters("derounded", &description("Specimen", &["mass"]), None);
        assert_eq!(
            other.unwrap_err().to_string(),
            "`derounded` is a model of ShakeTable, not of Specimen"
        );
    }

    #[test]
    fn a_file_gives_each_component_what_it_has_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let text = file().toml().unwrap();
        std::fs::write(folder.path().join("model.toml"), &text).unwrap();
        let found = |own: &Description| parameters("model.toml", own, Some(folder.path()));
        let rig = shake_table_values(&nominal().shake_table);
        let mut table = names(&rig);
        table.push("valve_dead_band.half_width");
        let numbers_of = numbers(found(&description("ShakeTable", &table)).unwrap());
        assert_eq!(numbers_of.len(), rig.len() + 1);
        for ((_, wanted), (_, value)) in rig.iter().zip(&numbers_of) {
            assert!(
                (value - wanted).abs() <= 1e-9 * wanted.abs(),
                "{value} is not {wanted}"
            );
        }
        assert_eq!(numbers_of[rig.len()], (rig.len() + 1, 0.25));
        // A component that lacks the effect.
        let told = found(&description("ShakeTable", &names(&rig))).unwrap_err();
        assert!(
            told.to_string().contains("[effects.valve_dead_band]: ShakeTable has no parameter `valve_dead_band.half_width`"),
            "{told}"
        );
        let body = specimen_values(&LinearSpecimen::appendix_a());
        let mut specimen = vec!["specimen_absent.absent"];
        specimen.extend(names(&body));
        assert_eq!(
            found(&description("Specimen", &specimen)).unwrap().len(),
            body.len()
        );
        let told = found(&description("Instrumentation", &["load_cell_bias.offset"])).unwrap_err();
        assert!(
            told.to_string()
                .ends_with("it has nothing for Instrumentation"),
            "{told}"
        );
        let told = found(&description("Filter", &["gain"])).unwrap_err();
        assert!(
            told.to_string()
                .ends_with("a model of ShakeTable, Specimen and Instrumentation, not of Filter"),
            "{told}"
        );
        let bare = Estimated::known(&Nominal {
            specimen: None,
            ..nominal()
        });
        let bare = ExtendedModel::new(&bare, &[]).toml().unwrap();
        std::fs::write(folder.path().join("model.toml"), bare).unwrap();
        let told = found(&description("Specimen", &specimen)).unwrap_err();
        assert!(
            told.to_string()
                .ends_with("there is no [specimen], and Specimen is not a ShakeTable"),
            "{told}"
        );
        assert!(parameters("gone.toml", &description("Specimen", &specimen), None).is_err());
    }

    #[test]
    fn effects_belong_to_the_component_that_has_them() {
        assert_eq!(component_of("valve_dead_band"), Component::ShakeTable);
        assert_eq!(component_of("load_cell_bias"), Component::Instrumentation);
        assert_eq!(component_of("specimen_absent"), Component::Specimen);
        assert_eq!(component_of("unknown"), Component::ShakeTable);
    }

    #[test]
    fn an_extended_model_has_values_and_errors_of_what_was_found() {
        let model = file();
        let table = &model.parameters["ShakeTable"];
        let band = table["valve_dead_band.half_width"];
        assert_eq!((band.value, band.standard_error), (0.25, Some(0.01)));
        assert_eq!(table["table_mass"].standard_error, None);
        assert!(model.parameters.contains_key("Specimen"));
        assert_eq!(model.file.effects["valve_dead_band"]["half_width"], 0.25);
        let errors = model.file.standard_errors.as_ref().unwrap();
        assert_eq!(errors.effects["valve_dead_band"]["half_width"], 0.01);
        // An effect that was known before stays, without an error.
        let mut known = Estimated::known(&nominal());
        known.effects.valve.dead_band = 0.5;
        let known = ExtendedModel::new(&known, &[]);
        let band = known.parameters["ShakeTable"]["valve_dead_band.half_width"];
        assert_eq!((band.value, band.standard_error), (0.5, None));
        let none = ExtendedModel::new(&Estimated::known(&nominal()), &[]);
        assert!(none.file.effects.is_empty());
    }

    #[test]
    fn a_model_keeps_what_the_next_record_is_looked_at_by() {
        use identification::diagnosis::case::ControlLaw;
        let law = ControlLaw {
            proportional: 1.0,
            integral: 2.0,
            velocity_feedforward: 3.0,
            acceleration_feedforward: 4.0,
            velocity_feedback: 5.0,
            acceleration_feedback: 6.0,
            velocity_filter: 0.7,
            limit: 10.0,
        };
        let nominal = Nominal {
            controller: Some(law),
            ..nominal()
        };
        let text = file().beside(&nominal).toml().unwrap();
        assert!(
            text.starts_with("# The nominal model, extended by `shakebench diagnose`."),
            "{text}"
        );
        let file: toml::Table = toml::from_str(&text).unwrap();
        assert_eq!(file["sample_rate"].as_float(), Some(500.0));
        assert_eq!(file["uncertainty"]["relative"].as_float(), Some(0.05));
        let controller: toml::Table = toml::from_str(
            "kind = \"three_variable_control\"\nproportional = 1.0\nintegral = 2.0\nvelocity_feedforward = 3.0\n\
             acceleration_feedforward = 4.0\nvelocity_feedback = 5.0\nacceleration_feedback = 6.0\n\
             velocity_filter = 0.7\nlimit = 10.0\n",
        )
        .unwrap();
        assert_eq!(file["controller"].as_table(), Some(&controller));
        let noise = file["noise"].as_table().unwrap();
        assert_eq!(noise["valve_command"].as_float(), Some(1e-3));
        assert_eq!(noise["displacement"].as_float(), Some(1e-5));
        // What was described holds no effects, since none was known.
        let described = file["described"].as_table().unwrap();
        assert!(!described.contains_key("standard_errors"));
        assert!(
            described
                .get("effects")
                .and_then(|own| own.as_table())
                .is_none_or(toml::Table::is_empty)
        );
    }
}
