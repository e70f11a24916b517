//! The extended model of a diagnosis: effects and corrected parameters as a `MODEL.toml` that
//! `--set table.model=` reads, and as FMUs that start with them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use identification::IdentificationError;
use identification::data::{Channel, OUTPUT_NAMES};
use identification::diagnosis::case::{ControlLaw, Nominal};
use identification::diagnosis::engine::NamedEffect;
use identification::diagnosis::rigs::shake_table::ExtendedModel as Estimated;
use identification::identify::model_file::{
    EffectSections, ModelFile, SI, StandardErrors, UncertaintySection, Units,
};
use plant::identified::effects::{self, Variable};
use plant::identified::nominal::{NominalRig, PARAMETERS};
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;

use crate::supply;
use crate::{PackError, PackedFmu, StartValue, file_error, write_variant};

/// A parameter of the extended model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value, SI.
    pub value: f64,
    /// Its standard error, SI; none where it was not estimated.
    pub standard_error: Option<f64>,
}

/// The nominal model after a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedModel {
    /// Component, parameter of its FMU (`table_mass`, `valve_dead_band.half_width`), estimate.
    pub parameters: BTreeMap<&'static str, BTreeMap<String, Estimate>>,
    /// The same as a model file, SI.
    pub file: ModelFile,
}

impl ExtendedModel {
    /// The model with the effects `named`, which are those in `model`.
    pub fn new(model: &Estimated, named: &[NamedEffect]) -> Self {
        let error = |name: &str| model.standard_errors.get(name).copied();
        let mut parameters: BTreeMap<&'static str, BTreeMap<String, Estimate>> = BTreeMap::new();
        let nominal = NominalRig {
            shake_table: model.shake_table,
            specimen: model.specimen,
        };
        for (parameter, value) in nominal.parameters() {
            let own = parameters.entry(parameter.component().name()).or_default();
            let standard_error = error(parameter.name);
            own.insert(
                parameter.variable.to_string(),
                Estimate {
                    value,
                    standard_error,
                },
            );
        }
        let (mut values, mut errors) = (EffectSections::new(), EffectSections::new());
        let (mut on_rig, mut on_sensors) = (model.effects, model.sensors);
        for effect in effects::all() {
            let named = named.iter().find(|named| named.effect == effect.name);
            // What was known before stays in the model beside what was found.
            if named.is_none() && !effect.is_on(&model.effects, &model.sensors) {
                continue;
            }
            for parameter in effect.parameters {
                let home = match parameter.variable {
                    Variable::Own => effect.name,
                    Variable::Of(other) => other,
                    Variable::None => continue,
                };
                let Some(field) = parameter.field else {
                    continue;
                };
                let value = *field.of(&mut on_rig, &mut on_sensors);
                let estimates = named.map_or(&[][..], |named| &named.parameters);
                let standard_error = estimates
                    .iter()
                    .find(|p| p.name == parameter.name)
                    .map(|p| p.standard_error)
                    .filter(|error| error.is_finite() && *error > 0.0);
                let full = format!("{home}.{}", parameter.name);
                let own = parameters.entry(effect.component.name()).or_default();
                if standard_error.is_none() && own.contains_key(&full) {
                    continue;
                }
                own.insert(
                    full,
                    Estimate {
                        value,
                        standard_error,
                    },
                );
                let section = values.entry(home.to_string()).or_default();
                section.insert(parameter.name.to_string(), value);
                if let Some(error) = standard_error {
                    let section = errors.entry(home.to_string()).or_default();
                    section.insert(parameter.name.to_string(), error);
                }
            }
        }
        let file = model_file(model, values, errors);
        Self { parameters, file }
    }

    /// The same with what a later record is looked at by: the rate, law and noise that `nominal` states,
    /// and its parameters as they were described.
    #[must_use]
    pub fn beside(mut self, nominal: &Nominal) -> Self {
        let described = Self::new(&Estimated::known(nominal), &[]).file;
        let channels = OUTPUT_NAMES.into_iter().zip(nominal.noise);
        let noise = channels.chain([(Channel::ValveCommand.name(), nominal.command_noise)]);
        self.file.sample_rate = Some(nominal.sample_rate);
        self.file.controller = nominal.controller.as_ref().map(law_section);
        self.file.noise = Some(
            noise
                .map(|(name, value)| (name.to_owned(), value.into()))
                .collect(),
        );
        self.file.uncertainty = Some(UncertaintySection {
            relative: nominal.uncertainty,
        });
        self.file.described = Some(Box::new(ModelFile {
            standard_errors: None,
            ..described
        }));
        self
    }

    /// The text of the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn toml(&self) -> Result<String, IdentificationError> {
        Ok(format!(
            "# The nominal model, extended by `shakebench diagnose`. Effects are in SI. Play it \
             with\n\
             # shakebench run --set table.model=FILE --set specimen.model=FILE\n{}",
            self.file.to_toml()?
        ))
    }

    /// Writes, for each of `originals` that the model speaks of, an FMU that starts with its
    /// values and tells their standard errors, as `folder/fmi2/NAME.fmu` or `folder/fmi3/NAME.fmu`.
    ///
    /// # Errors
    /// A parameter that the component does not have; files that cannot be written.
    pub fn write_fmus(
        &self,
        originals: &[PackedFmu],
        folder: &Path,
    ) -> Result<Vec<PackedFmu>, PackError> {
        let mut written = Vec::new();
        for original in originals {
            let Some(values) = self.parameters.get(original.name.as_str()) else {
                continue;
            };
            supply::check(original)?;
            let starts: Vec<StartValue> = values
                .iter()
                .map(|(name, estimate)| StartValue {
                    name: name.clone(),
                    value: estimate.value,
                    note: estimate.standard_error.map_or(String::new(), |error| {
                        format!("estimated, standard error {error:.3e}")
                    }),
                })
                .collect();
            let below = folder.join(original.version.folder());
            std::fs::create_dir_all(&below).map_err(file_error(&below))?;
            let path: PathBuf = below.join(format!("{}.fmu", original.name));
            let title = format!("Extended{}", original.name);
            write_variant(&original.path, &path, &title, &starts)?;
            written.push(PackedFmu {
                path,
                ..original.clone()
            });
        }
        Ok(written)
    }
}

fn model_file(model: &Estimated, effects: EffectSections, errors: EffectSections) -> ModelFile {
    // The errors stand where the parameters do.
    let mut error = NominalRig {
        shake_table: model.shake_table,
        specimen: model.specimen,
    };
    for parameter in PARAMETERS {
        if let Some(place) = error.place(parameter) {
            *place = model
                .standard_errors
                .get(parameter.name)
                .copied()
                .unwrap_or(0.0);
        }
    }
    let actuator = |rig: &ShakeTable| ModelFile::actuator_section(&rig.actuator, Units::SI);
    let table = |rig: &ShakeTable| {
        let table = rig.table;
        ModelFile::body_section([table.mass, table.damping, table.stiffness], Units::SI)
    };
    let specimen = |specimen: LinearSpecimen| {
        let values = [specimen.mass, specimen.damping, specimen.stiffness];
        ModelFile::body_section(values, Units::SI)
    };
    let mut actuator_errors = actuator(&error.shake_table);
    actuator_errors.denominator[0] = 0.0;
    ModelFile {
        units: SI.to_string(),
        sample_rate: None,
        command_delay: None,
        sensor_delay: None,
        actuator: Some(actuator(&model.shake_table)),
        table: table(&model.shake_table),
        specimen: model.specimen.map(specimen),
        effects,
        controller: None,
        noise: None,
        hydraulics: None,
        covariance: None,
        uncertainty: None,
        standard_errors: Some(StandardErrors {
            actuator: Some(actuator_errors),
            table: table(&error.shake_table),
            specimen: error.specimen.map(specimen),
            command_delay: None,
            hydraulics: Default::default(),
            effects: errors,
        }),
        described: None,
    }
}

/// The law in the words of a `nominal.toml`, SI.
fn law_section(law: &ControlLaw) -> toml::Table {
    let mut section = toml::Table::new();
    section.insert("kind".into(), "three_variable_control".into());
    for (name, value) in [
        ("proportional", law.proportional),
        ("integral", law.integral),
        ("velocity_feedforward", law.velocity_feedforward),
        ("acceleration_feedforward", law.acceleration_feedforward),
        ("velocity_feedback", law.velocity_feedback),
        ("acceleration_feedback", law.acceleration_feedback),
        ("velocity_filter", law.velocity_filter),
        ("limit", law.limit),
    ] {
        section.insert(name.into(), value.into());
    }
    section
}

#[cfg(test)]
mod tests {
    use super::*;
    use identification::diagnosis::engine::ParameterEstimate;

    const NOISE: [f64; 4] = [1e-5, 0.04, 1.3, 0.025];

    fn law() -> ControlLaw {
        ControlLaw {
            proportional: 120.0,
            integral: 5.0,
            velocity_feedforward: 2.0,
            acceleration_feedforward: 0.03,
            velocity_feedback: 0.2,
            acceleration_feedback: 0.004,
            velocity_filter: 0.5,
            limit: 10.0,
        }
    }

    /// A rig whose delay is known.
    fn nominal() -> Nominal {
        let mut own = Nominal {
            sample_rate: 500.0,
            shake_table: ShakeTable::default(),
            specimen: Some(LinearSpecimen::default()),
            controller: Some(law()),
            noise: NOISE,
            command_noise: 1e-3,
            uncertainty: 0.02,
            effects: Default::default(),
            sensors: Default::default(),
        };
        own.effects.valve.command_delay = 3.3e-3;
        own
    }

    /// What a diagnosis found: a heavier table, and a dead band of the valve.
    fn found() -> ExtendedModel {
        let mut model = Estimated::known(&nominal());
        model.shake_table.table.mass *= 1.1;
        model.effects.valve.dead_band = 0.1;
        let error = 0.01 * model.shake_table.table.mass;
        model.standard_errors.insert("table.mass".into(), error);
        let named = NamedEffect {
            effect: "valve_dead_band",
            parameters: vec![ParameterEstimate {
                name: "half_width".into(),
                value: 0.1,
                unit: "V",
                standard_error: 2e-3,
                is_shape: false,
            }],
            confidence: 0.99,
        };
        ExtendedModel::new(&model, &[named])
    }

    fn close(found: f64, expected: f64) -> bool {
        (found - expected).abs() <= 1e-9 * expected.abs()
    }

    #[test]
    fn a_model_file_is_the_nominal_model_of_the_next_diagnosis() {
        let before = nominal();
        let text = found().beside(&before).toml().unwrap();
        let read = Nominal::parse(&text).unwrap();
        let rig = |own: &Nominal| NominalRig {
            shake_table: own.shake_table,
            specimen: own.specimen,
        };
        let (all, known) = (rig(&read), rig(&before));
        for ((parameter, value), (_, before)) in all.parameters().zip(known.parameters()) {
            let factor = if parameter.name == "table.mass" {
                1.1
            } else {
                1.0
            };
            assert!(close(value, factor * before), "{}: {value}", parameter.name);
        }
        assert!(close(read.effects.valve.dead_band, 0.1));
        assert!(close(read.effects.valve.command_delay, 3.3e-3));
        assert_eq!((read.sample_rate, read.uncertainty), (500.0, 0.02));
        for (found, expected) in read.noise.iter().zip(NOISE) {
            assert!(close(*found, expected), "{:?}", read.noise);
        }
        assert!(close(read.command_noise, 1e-3));
        let (own, expected) = (read.controller.unwrap(), law());
        for (found, expected) in [
            (own.proportional, expected.proportional),
            (own.integral, expected.integral),
            (own.velocity_feedforward, expected.velocity_feedforward),
            (
                own.acceleration_feedforward,
                expected.acceleration_feedforward,
            ),
            (own.velocity_feedback, expected.velocity_feedback),
            (own.acceleration_feedback, expected.acceleration_feedback),
            (own.velocity_filter, expected.velocity_filter),
            (own.limit, expected.limit),
        ] {
            assert!(close(found, expected), "{own:?}");
        }
        // What the diagnosis began from is there, too.
        let described = found().beside(&before).file.described.unwrap();
        assert!(described.standard_errors.is_none() && described.described.is_none());
        assert!(close(1.1 * described.table.mass, found().file.table.mass));
        assert!(
            described
                .effects
                .values()
                .all(|own| !own.contains_key("half_width"))
        );
    }

    #[test]
    fn estimates_have_their_errors_and_what_was_known_has_none() {
        let model = found();
        let of = |component: &str, name: &str| model.parameters[component][name];
        let band = of("ShakeTable", "valve_dead_band.half_width");
        assert_eq!((band.value, band.standard_error), (0.1, Some(2e-3)));
        let mass = of("ShakeTable", "table_mass");
        assert!(close(mass.standard_error.unwrap(), 0.01 * mass.value));
        assert_eq!(of("ShakeTable", "table_stiffness").standard_error, None);
        assert_eq!(of("Specimen", "mass").value, LinearSpecimen::default().mass);
        let delays: Vec<f64> = model.parameters["ShakeTable"]
            .iter()
            .filter(|(name, own)| name.contains("delay") && own.value != 0.0)
            .map(|(_, own)| own.value)
            .collect();
        assert_eq!(delays, [3.3e-3]);
        // The file has them where the parameters are.
        let errors = model.file.standard_errors.as_ref().unwrap();
        assert_eq!(errors.effects["valve_dead_band"]["half_width"], 2e-3);
        assert!(close(errors.table.mass, 0.01 * model.file.table.mass));
        assert_eq!(errors.table.stiffness, 0.0);
        let actuator = errors.actuator.as_ref().unwrap();
        assert!(actuator.denominator.iter().all(|error| *error == 0.0));
        // Effects that are not on are not in the model.
        let sections: Vec<&String> = model.file.effects.keys().collect();
        assert_eq!(sections.len(), 2, "{sections:?}");
    }
}
