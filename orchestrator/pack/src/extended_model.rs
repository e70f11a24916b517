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
