//! `MODEL.toml`: the parameter set of a rig, as identification writes it and the table's FMU and
//! the diagnosis read it.
//!
//! The layout is that of a nominal rig: `[actuator]` with the monic `denominator` of G1 and G2 and
//! their numerators, `[table]`, `[specimen]`, in one consistent set of units that `units` names.
//! A diagnosis adds the effects it found, `[effects.valve_dead_band]`, always in SI.
//! Tables that are not known here are left alone.

mod sections;

use std::path::Path;
use units::vocabulary;

use plant::identified::actuator::IdentifiedActuator;
use plant::identified::shake_table::ShakeTable;
use plant::identified::table::Table;
use plant::specimens::linear::LinearSpecimen;
use serde::{Deserialize, Serialize};

use crate::identify::identified::RigIdentification;
use crate::identify::parameters::Physical;
use recordings::IdentificationError;
use recordings::OUTPUT_NAMES;

pub use sections::{
    ActuatorSection, BodySection, CovarianceSection, EffectSections, HydraulicSection, INCH_POUND,
    SI, StandardErrors, UncertaintySection, Units,
};

/// A rig's parameters with their standard errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelFile {
    /// [`INCH_POUND`] or [`SI`].
    #[serde(default = "inch_pound")]
    pub units: String,
    /// Sampling rate of the data, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_rate: Option<f64>,
    /// Delay of the command in s, where one was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_delay: Option<f64>,
    /// The part of `command_delay` by which the measurements are late, s; absent: all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_delay: Option<f64>,
    /// The actuator; absent where the data do not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actuator: Option<ActuatorSection>,
    /// The table.
    pub table: BodySection,
    /// The specimen, if one stood on the table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specimen: Option<BodySection>,
    /// Effects of the catalogue that the rig has, each with its parameters as the FMUs name them
    /// (`effect.parameter`), SI whatever `units` says.
    #[serde(default, skip_serializing_if = "EffectSections::is_empty")]
    pub effects: EffectSections,
    /// The law that made the command, as a `nominal.toml` states it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<toml::Table>,
    /// One standard deviation of the white noise of each channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<toml::Table>,
    /// Valve, oil, seals and sensors beyond the form of Eq 2-4, where they were identified, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hydraulics: Option<HydraulicSection>,
    /// How far a diagnosis may take the parameters from their values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<UncertaintySection>,
    /// How the errors of the hydraulic rig's parameters go together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceSection>,
    /// Standard errors of everything above, in the same layout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_errors: Option<StandardErrors>,
    /// The nominal model that a diagnosis began from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub described: Option<Box<ModelFile>>,
}

fn inch_pound() -> String {
    INCH_POUND.to_string()
}

impl ModelFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// The file cannot be read; the text is not TOML of this layout (with line and key); numbers
    /// that make no rig.
    pub fn read(path: &Path) -> Result<Self, IdentificationError> {
        let name = path.display().to_string();
        let text =
            recordings::read_written(path).map_err(|error| IdentificationError::ModelFile {
                path: name.clone(),
                what: error.to_string(),
                expected: "a model file from `shakebench identify`",
            })?;
        Self::parse(&text, &name)
    }

    /// Reads and checks text; `name` is what messages call it.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub fn parse(text: &str, name: &str) -> Result<Self, IdentificationError> {
        let wrong = |what: String, expected| IdentificationError::ModelFile {
            path: name.to_string(),
            what,
            expected,
        };
        let is_one_input = toml::from_str::<toml::Table>(text)
            .is_ok_and(|all| all.contains_key("transfer_function") && !all.contains_key("table"));
        if is_one_input {
            return Err(wrong(
                "only [transfer_function], which does not determine mass and force".into(),
                "a model that was also identified from acceleration and actuator_force",
            ));
        }
        let file: Self = toml::from_str(text).map_err(|error| {
            let line = error
                .span()
                .map(|span| text[..span.start.min(text.len())].lines().count().max(1));
            let place = line.map_or(String::new(), |line| format!("line {line}: "));
            wrong(
                format!("{place}{}", error.message()),
                "[actuator] denominator, voltage_to_force, velocity_to_force and [table] mass, \
                 damping, stiffness",
            )
        })?;
        file.units(name)?;
        if let Some(actuator) = &file.actuator {
            for (key, values, length) in [
                ("denominator", &actuator.denominator, 4),
                ("voltage_to_force", &actuator.voltage_to_force, 3),
                ("velocity_to_force", &actuator.velocity_to_force, 3),
            ] {
                if values.len() != length {
                    return Err(wrong(
                        format!(
                            "[actuator] {key} has {} numbers, not {length}",
                            values.len()
                        ),
                        "a monic cubic denominator and two quadratic numerators, highest power \
                         first",
                    ));
                }
            }
            if actuator.denominator[0] == 0.0 {
                return Err(wrong(
                    "[actuator] denominator begins with 0".into(),
                    "a cubic, highest power first",
                ));
            }
        }
        if let Some(specimen) = file.specimen(name)? {
            specimen
                .validate()
                .map_err(|error| wrong(format!("[specimen]: {error}"), "a mass on a spring"))?;
        }
        let table = file.table(name)?;
        table
            .validate()
            .map_err(|error| wrong(format!("[table]: {error}"), "a mass on a spring"))?;
        Ok(file)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, IdentificationError> {
        toml::to_string(self).map_err(|error| IdentificationError::ModelFile {
            path: "model file".into(),
            what: error.to_string(),
            expected: "finite numbers",
        })
    }

    /// The factors of its units.
    ///
    /// # Errors
    /// Units other than the two known sets.
    pub fn units(&self, name: &str) -> Result<Units, IdentificationError> {
        Units::named(&self.units, name)
    }

    /// The table in SI.
    ///
    /// # Errors
    /// Unknown units.
    pub fn table(&self, name: &str) -> Result<Table, IdentificationError> {
        let per_length = self.units(name)?;
        let factor = per_length.force / per_length.length;
        Ok(Table {
            mass: self.table.mass * factor,
            damping: self.table.damping * factor,
            stiffness: self.table.stiffness * factor,
        })
    }

    /// The specimen in SI, if there is one.
    ///
    /// # Errors
    /// Unknown units.
    pub fn specimen(&self, name: &str) -> Result<Option<LinearSpecimen>, IdentificationError> {
        let units = self.units(name)?;
        let factor = units.force / units.length;
        Ok(self.specimen.map(|body| LinearSpecimen {
            mass: body.mass * factor,
            damping: body.damping * factor,
            stiffness: body.stiffness * factor,
        }))
    }

    /// Actuator and table in SI, checked for simulation.
    ///
    /// # Errors
    /// No actuator in the file (its data did not determine it); coefficients that must not be
    /// simulated.
    pub fn shake_table(&self, name: &str) -> Result<ShakeTable, IdentificationError> {
        let Units { length, force } = self.units(name)?;
        let wrong = |what: String, expected| IdentificationError::ModelFile {
            path: name.to_string(),
            what,
            expected,
        };
        let Some(section) = &self.actuator else {
            return Err(wrong(
                "no [actuator]: the data of this model did not determine it".into(),
                "a model identified with a specimen or two payloads",
            ));
        };
        let lead = section.denominator[0];
        let three = |values: &[f64], factor: f64| {
            let mut out = [0.0; 3];
            for (slot, value) in out.iter_mut().zip(values) {
                *slot = value * factor / lead;
            }
            out
        };
        let shake_table = ShakeTable {
            actuator: IdentifiedActuator {
                denominator: three(&section.denominator[1..], 1.0),
                voltage_to_force: three(&section.voltage_to_force, force),
                velocity_to_force: three(&section.velocity_to_force, force / length),
            },
            table: self.table(name)?,
        };
        shake_table
            .validate()
            .map_err(|error| wrong(error.to_string(), "a rig that can be simulated"))?;
        Ok(shake_table)
    }

    /// What an identification found, in inch and pound-force. The actuator is left out where the
    /// data do not determine it.
    pub fn from_identification(found: &RigIdentification) -> Self {
        let units = Units::INCH_POUND;
        let (rig, errors) = (found.rig(), found.standard_error.rig(0.0, found.specimen));
        let body = |own: LinearSpecimen| [own.mass, own.damping, own.stiffness];
        let (table, table_errors) = (rig.shake_table.table, errors.shake_table.table);
        let mut actuator_errors = Self::actuator_section(&errors.shake_table.actuator, units);
        actuator_errors.denominator[0] = 0.0;
        let delay = found.physical[Physical::CommandDelay];
        Self {
            units: INCH_POUND.to_string(),
            sample_rate: found
                .model
                .experiments
                .first()
                .map(|experiment| 1.0 / experiment.period),
            command_delay: (delay > 0.0).then_some(delay),
            sensor_delay: None,
            actuator: found
                .identifiable
                .then(|| Self::actuator_section(&rig.shake_table.actuator, units)),
            table: Self::body_section([table.mass, table.damping, table.stiffness], units),
            specimen: rig.specimen.map(|own| Self::body_section(body(own), units)),
            effects: EffectSections::new(),
            controller: None,
            noise: Some(noise(found)),
            hydraulics: None,
            uncertainty: Some(UncertaintySection {
                relative: uncertainty(found),
            }),
            covariance: None,
            standard_errors: Some(StandardErrors {
                hydraulics: Default::default(),
                effects: EffectSections::new(),
                actuator: found.identifiable.then_some(actuator_errors),
                table: Self::body_section(
                    [
                        table_errors.mass,
                        table_errors.damping,
                        table_errors.stiffness,
                    ],
                    units,
                ),
                specimen: errors
                    .specimen
                    .map(|own| Self::body_section(body(own), units)),
                command_delay: (delay > 0.0)
                    .then_some(found.standard_error[Physical::CommandDelay]),
            }),
            described: None,
        }
    }

    /// The actuator's section from SI coefficients, in `units`.
    pub fn actuator_section(actuator: &IdentifiedActuator, units: Units) -> ActuatorSection {
        let mut denominator = vec![1.0];
        denominator.extend(actuator.denominator);
        ActuatorSection {
            denominator,
            voltage_to_force: actuator.voltage_to_force.map(|b| b / units.force).to_vec(),
            velocity_to_force: actuator
                .velocity_to_force
                .map(|e| e * units.length / units.force)
                .to_vec(),
        }
    }

    /// A body's section from SI mass, damping and stiffness, in `units`.
    pub fn body_section(body: [f64; 3], units: Units) -> BodySection {
        let factor = units.length / units.force;
        BodySection {
            mass: body[0] * factor,
            damping: body[1] * factor,
            stiffness: body[2] * factor,
        }
    }
}

/// White noise of the first recording's channels and command, in inch and pound-force: what a
/// diagnosis takes for it.
fn noise(found: &RigIdentification) -> toml::Table {
    let units = Units::INCH_POUND;
    let acceleration = found.noise(0, 1);
    let mut noise = toml::Table::new();
    for (i, name) in OUTPUT_NAMES.iter().enumerate() {
        let factor = if *name == vocabulary::ACTUATOR_FORCE {
            units.force
        } else {
            units.length
        };
        let first = found.model.experiments.first();
        let is_measured = first.is_some_and(|own| own.measured[i]);
        // A channel that is missing is as noisy as the table's accelerometer: a diagnosis wants one.
        let own = if is_measured {
            found.noise(0, i)
        } else {
            acceleration
        };
        noise.insert((*name).to_string(), (own / factor).into());
    }
    noise.insert(
        vocabulary::VALVE_COMMAND.into(),
        found.command_noise(0).into(),
    );
    noise
}

/// The largest relative standard error of what makes the loops: oil column, gain, velocity path,
/// mass.
fn uncertainty(found: &RigIdentification) -> f64 {
    use Physical::*;
    let relative = |name: Physical| found.standard_error[name] / found.physical[name].abs();
    [A1, B1, E0, TableMass]
        .map(relative)
        .into_iter()
        .filter(|error| error.is_finite())
        .fold(0.005, f64::max)
        .min(0.3)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOMINAL: &str = "sample_rate = 500.0\n[actuator]\n\
        denominator = [1.0, 56.18, 13330.0, 178.2]\n\
        voltage_to_force = [3430.0, 38600.0, 403.3]\n\
        velocity_to_force = [565.1, -1818.0, 312000.0]\n\
        [table]\nmass = 0.1212415\ndamping = 0.246605\nstiffness = 23.32687\n";

    #[test]
    fn a_nominal_rig_is_the_thesis_model() {
        let rig = ModelFile::parse(NOMINAL, "nominal.toml").unwrap();
        let rig = rig.shake_table("nominal.toml").unwrap();
        let thesis = ShakeTable::default();
        assert_eq!(rig.actuator, thesis.actuator);
        assert!((rig.table.mass / thesis.table.mass - 1.0).abs() < 1e-4);
    }

    #[test]
    fn writing_and_reading_is_the_identity() {
        let file = ModelFile::parse(NOMINAL, "a").unwrap();
        assert_eq!(
            ModelFile::parse(&file.to_toml().unwrap(), "b").unwrap(),
            file
        );
    }

    #[test]
    fn faults_are_named_with_their_place() {
        let message = |text: &str| ModelFile::parse(text, "m.toml").unwrap_err().to_string();
        let text = NOMINAL.replace("mass = 0.1212415", "mass = \"heavy\"");
        let error = message(&text);
        assert!(error.starts_with("m.toml: line 7: invalid type"), "{error}");
        let error = message(&NOMINAL.replace(", 178.2", ""));
        assert!(
            error.contains("[actuator] denominator has 3 numbers, not 4"),
            "{error}"
        );
        let error = message(&NOMINAL.replace("mass = 0.", "mass = -0."));
        assert!(
            error.contains("[table]: parameter `table_mass` is -21"),
            "{error}"
        );
        let error = message("[transfer_function]\ndelay = 0.0\n");
        assert!(
            error.contains("does not determine mass and force"),
            "{error}"
        );
        let error = message(&format!("units = \"furlong\"\n{NOMINAL}"));
        assert!(error.contains("units = \"furlong\""), "{error}");
        let without = format!("[table]{}", NOMINAL.split("[table]").nth(1).unwrap());
        let file = ModelFile::parse(&without, "m.toml").unwrap();
        let error = file.shake_table("m.toml").unwrap_err().to_string();
        assert!(error.contains("no [actuator]"), "{error}");
        let unstable = NOMINAL.replace("403.3", "-403.3");
        let file = ModelFile::parse(&unstable, "m.toml").unwrap();
        let error = file.shake_table("m.toml").unwrap_err().to_string();
        assert!(error.contains("zero in the right half plane"), "{error}");
    }
}
