//! The extended model of a diagnosis: effects and corrected parameters as a `MODEL.toml` that
//! `--set table.model=` reads, and as FMUs that start with them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use identification::IdentificationError;
use identification::diagnosis::engine::NamedEffect;
use identification::diagnosis::rigs::shake_table::ExtendedModel as Estimated;
use identification::diagnosis::rigs::shake_table::catalogue::NUISANCE;
use identification::identify::model_file::{
    BodySection, EffectSections, ModelFile, SI, StandardErrors, Units,
};
use plant::identified::actuator::IdentifiedActuator;

use crate::pack::{PackError, PackedFmu, StartValue, file_error, write_variant};
use crate::system::model::{component_of, shake_table_values, specimen_values};

/// A parameter of the extended model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value, SI.
    pub value: f64,
    /// Its standard error, SI; none where it was not estimated.
    pub standard_error: Option<f64>,
}

/// What a diagnosis makes of the nominal model.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedModel {
    /// Component (`ShakeTable`, `Specimen`, `Instrumentation`), parameter of its FMU
    /// (`table_mass`, `valve_dead_band.half_width`), estimate.
    pub parameters: BTreeMap<&'static str, BTreeMap<String, Estimate>>,
    /// The same as a model file, SI.
    pub file: ModelFile,
}

/// Where the FMUs have a parameter of a catalogue effect; none for what they do not need.
fn fmu_parameter<'a>(effect: &'a str, parameter: &'a str) -> Option<(&'a str, &'a str)> {
    match (effect, parameter) {
        // Stribeck's law is a bump on Coulomb's.
        ("stribeck_friction", "coulomb_force" | "transition_velocity") => {
            Some(("coulomb_friction", parameter))
        }
        // What the sensor of a missing specimen shows belongs to no component.
        ("specimen_absent", "sensor_share") => None,
        same => Some(same),
    }
}

impl ExtendedModel {
    /// The model with `effects`, which are those in `model`.
    pub fn new(model: &Estimated, effects: &[NamedEffect]) -> Self {
        let error = |name: &str| model.standard_errors.get(name).copied();
        let mut parameters: BTreeMap<&'static str, BTreeMap<String, Estimate>> = BTreeMap::new();
        let mut put = |component, name: &str, value, standard_error| {
            let estimate = Estimate {
                value,
                standard_error,
            };
            let set = parameters.entry(component).or_default();
            set.insert(name.to_string(), estimate);
        };
        for (name, value) in shake_table_values(&model.shake_table) {
            put("ShakeTable", name, value, error(nominal_name(name)));
        }
        if let Some(specimen) = &model.specimen {
            for (name, value) in specimen_values(specimen) {
                let error = error(&format!("specimen.{name}"));
                put("Specimen", name, value, error);
            }
        }
        let (mut values, mut errors) = (EffectSections::new(), EffectSections::new());
        let mut put_effect = |effect: &str, name: &str, value, standard_error: Option<f64>| {
            let full = format!("{effect}.{name}");
            put(component_of(effect), &full, value, standard_error);
            let section = values.entry(effect.to_string()).or_default();
            section.insert(name.to_string(), value);
            if let Some(error) = standard_error {
                let section = errors.entry(effect.to_string()).or_default();
                section.insert(name.to_string(), error);
            }
        };
        for NamedEffect {
            effect, parameters, ..
        } in effects
        {
            for p in parameters {
                let known = p.standard_error.is_finite() && p.standard_error > 0.0;
                let value = match (*effect, p.name.as_str()) {
                    // The rig keeps it off zero, where its formula ends.
                    ("supply_pressure_droop", "form") => model.effects.hydraulics.droop_form,
                    _ => p.value,
                };
                if let Some((effect, name)) = fmu_parameter(effect, &p.name) {
                    put_effect(effect, name, value, known.then_some(p.standard_error));
                }
            }
            match *effect {
                "specimen_absent" => put_effect(effect, "absent", 1.0, None),
                "mains_hum" => put_effect(effect, "frequency", model.sensors.hum_frequency, None),
                _ => {}
            }
        }
        let file = model_file(model, values, errors);
        Self { parameters, file }
    }

    /// The text of the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn toml(&self) -> Result<String, IdentificationError> {
        Ok(format!(
            "# What `shakebench diagnose` made of the nominal model. Effects are in SI; play it with\n\
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

/// The diagnosis's name of a parameter of the FMU `ShakeTable`.
fn nominal_name(parameter: &str) -> &'static str {
    const NAMES: [&str; 12] = [
        "actuator_a2",
        "actuator_a1",
        "actuator_a0",
        "actuator_b2",
        "actuator_b1",
        "actuator_b0",
        "actuator_e2",
        "actuator_e1",
        "actuator_e0",
        "table_mass",
        "table_damping",
        "table_stiffness",
    ];
    let place = NAMES.iter().position(|name| *name == parameter);
    place.map_or("", |place| NUISANCE[place])
}

fn model_file(model: &Estimated, effects: EffectSections, errors: EffectSections) -> ModelFile {
    let error = |place: usize| model.standard_errors.get(NUISANCE[place]).copied();
    let three = |first: usize| [0, 1, 2].map(|i| error(first + i).unwrap_or(0.0));
    let section = |actuator: &IdentifiedActuator| ModelFile::actuator_section(actuator, Units::SI);
    let body = |values: [f64; 3]| -> BodySection { ModelFile::body_section(values, Units::SI) };
    let mut actuator_errors = section(&IdentifiedActuator {
        denominator: three(0),
        voltage_to_force: three(3),
        velocity_to_force: three(6),
    });
    actuator_errors.denominator[0] = 0.0;
    let table = model.shake_table.table;
    ModelFile {
        units: SI.to_string(),
        sample_rate: None,
        command_delay: None,
        actuator: Some(section(&model.shake_table.actuator)),
        table: body([table.mass, table.damping, table.stiffness]),
        specimen: model
            .specimen
            .map(|s| body([s.mass, s.damping, s.stiffness])),
        effects,
        noise: None,
        hydraulics: None,
        uncertainty: None,
        standard_errors: Some(StandardErrors {
            actuator: Some(actuator_errors),
            table: body(three(9)),
            specimen: model.specimen.map(|_| body(three(12))),
            command_delay: None,
            effects: errors,
        }),
    }
}
