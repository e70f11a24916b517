//! An identified hydraulic rig as a model file.

use std::collections::BTreeMap;
use units::vocabulary;

use nalgebra::DMatrix;
use plant::identified::valve_curve::ValveCurve;

use super::Found;
use super::equations::{HydraulicRig, NAMES, PARAMETERS};
use super::friction::SealShape;
use super::thesis_form::{coefficients, standard_errors};
use crate::identify::model_file::{
    ActuatorSection, BodySection, CovarianceSection, EffectSections, HydraulicSection, INCH_POUND,
    ModelFile, StandardErrors, UncertaintySection, Units,
};
use plant::identified::actuator::IdentifiedActuator;
use recordings::IdentificationError;

impl CovarianceSection {
    fn new(covariance: &DMatrix<f64>) -> Self {
        let rows = covariance.row_iter();
        Self {
            parameters: NAMES.map(|name| name.replace(' ', "_")).to_vec(),
            matrix: rows.map(|row| row.iter().copied().collect()).collect(),
        }
    }

    /// The covariance in the order of [`NAMES`]; `None` where the section is of other parameters.
    pub fn ordered(&self) -> Option<DMatrix<f64>> {
        let names = NAMES.map(|name| name.replace(' ', "_"));
        let known = self.parameters == names && self.matrix.len() == PARAMETERS;
        let square = self.matrix.iter().all(|row| row.len() == PARAMETERS);
        (known && square)
            .then(|| DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| self.matrix[i][j]))
    }
}

impl ModelFile {
    /// The hydraulic rig and the shape of its friction, SI, where the file holds one.
    ///
    /// # Errors
    /// Unknown units.
    pub fn hydraulic_rig(
        &self,
        name: &str,
    ) -> Result<Option<(HydraulicRig, SealShape)>, IdentificationError> {
        let Some(own) = &self.hydraulics else {
            return Ok(None);
        };
        let table = self.table(name)?;
        let rig = HydraulicRig {
            spool_lag: own.spool_lag,
            spool_inertia: own.spool_inertia,
            force_rate: own.force_rate,
            oil_stiffness: own.oil_stiffness,
            leakage_rate: own.leakage_rate,
            seal_damping: own.seal_damping,
            seal_friction: own.seal_friction,
            mass: table.mass,
            damping: table.damping,
            stiffness: table.stiffness,
            specimen_mass: self.specimen(name)?.map_or(0.0, |body| body.mass),
            command_delay: self.command_delay.unwrap_or(0.0),
            accelerometer_delay: own.accelerometer_delay,
            load_cell_delay: own.load_cell_delay,
            accelerometer_scale: own.accelerometer_scale,
        };
        let shape = SealShape {
            presliding: own.seal_presliding,
            excess: own.seal_excess,
            stribeck_velocity: own.seal_stribeck_velocity,
            sharpness: own.seal_sharpness,
            relaxation: own.seal_relaxation,
        };
        Ok(Some((rig, shape)))
    }

    /// The valve's curve, where the file holds one.
    pub fn valve_curve(&self) -> Option<ValveCurve> {
        self.hydraulics.as_ref().and_then(|own| own.valve_curve)
    }
}

/// The section of a rig with friction of `shape`.
fn hydraulic_section(found: &Found) -> HydraulicSection {
    let (rig, shape) = (&found.rig, &found.shape);
    HydraulicSection {
        valve_curve: found.valve.as_ref().map(|own| own.curve),
        spool_lag: rig.spool_lag,
        spool_inertia: rig.spool_inertia,
        force_rate: rig.force_rate,
        oil_stiffness: rig.oil_stiffness,
        leakage_rate: rig.leakage_rate,
        seal_damping: rig.seal_damping,
        seal_friction: rig.seal_friction,
        seal_presliding: shape.presliding,
        seal_excess: shape.excess,
        seal_stribeck_velocity: shape.stribeck_velocity,
        seal_sharpness: shape.sharpness,
        seal_relaxation: shape.relaxation,
        accelerometer_delay: rig.accelerometer_delay,
        load_cell_delay: rig.load_cell_delay,
        accelerometer_scale: rig.accelerometer_scale,
    }
}

impl Found {
    /// Standard errors of what `[hydraulics]` holds.
    fn hydraulic_errors(&self) -> BTreeMap<String, f64> {
        let table = [
            vocabulary::TABLE_MASS,
            vocabulary::TABLE_DAMPING,
            vocabulary::TABLE_STIFFNESS,
            vocabulary::SPECIMEN_MASS,
            "command_delay",
        ];
        let names = NAMES.map(|name| name.replace(' ', "_"));
        let mut all: BTreeMap<String, f64> = names
            .into_iter()
            .zip(self.standard_error)
            .filter(|(name, _)| !table.contains(&name.as_str()))
            .collect();
        if let Some(valve) = &self.valve {
            let own = &valve.standard_error;
            all.extend(
                [
                    ("overlap", own.overlap),
                    ("null_loss", own.null_loss),
                    ("null_width", own.null_width),
                    ("asymmetry", own.asymmetry),
                    ("null_bias", own.null_bias),
                ]
                .map(|(name, error)| (format!("valve_{name}"), error)),
            );
        }
        all
    }

    /// The model file, in inch and pound-force: as `diagnose` reads a nominal rig.
    ///
    /// # Errors
    /// A rig that the form of Eq 2-4 cannot hold or that must not be simulated.
    pub fn model_file(&self) -> Result<ModelFile, IdentificationError> {
        let unstable = |what: String| IdentificationError::Unstable {
            what,
            remedy: "record a minute or longer with more motion between 0.1 and 30 Hz".into(),
        };
        let rig = self.rig.shake_table();
        let rig = rig.ok_or_else(|| unstable("the velocity path cannot be fitted".into()))?;
        rig.validate()
            .map_err(|error| unstable(error.to_string()))?;
        let errors = standard_errors(&self.rig, &self.covariance);
        let values = coefficients(&self.rig);
        let (Some(errors), Some(values)) = (errors, values) else {
            return Err(unstable("the velocity path cannot be fitted".into()));
        };
        let units = Units::INCH_POUND;
        let three = |all: &[f64], first: usize| [all[first], all[first + 1], all[first + 2]];
        let actuator = |all: &[f64]| -> ActuatorSection {
            ModelFile::actuator_section(
                &IdentifiedActuator {
                    denominator: three(all, 0),
                    voltage_to_force: three(all, 3),
                    velocity_to_force: three(all, 6),
                },
                units,
            )
        };
        let body = |all: [f64; 3]| -> BodySection { ModelFile::body_section(all, units) };
        let mut actuator_errors = actuator(&errors);
        actuator_errors.denominator[0] = 0.0;
        let mass = (self.rig.specimen_mass, self.standard_error[10]);
        let specimen = self.specimen.as_ref().filter(|_| mass.0 > 0.0).map(|own| {
            let s = own.specimen;
            let error = |value: f64, index: usize| {
                let relative = mass.1 / mass.0;
                let own = own.covariance[(index, index)].max(0.0).sqrt();
                (own * mass.0).hypot(value * mass.0 * relative)
            };
            (
                body([mass.0, s.damping * mass.0, s.stiffness * mass.0]),
                body([mass.1, error(s.damping, 0), error(s.stiffness, 1)]),
            )
        });
        // Of the parameters that make the loops: gain, oil, mass.
        let relative = [2, 3, 7]
            .map(|i| self.standard_error[i] / <[f64; PARAMETERS]>::from(self.rig)[i])
            .into_iter()
            .fold(0.005, f64::max);
        let mut noise = toml::Table::new();
        let keys = [
            ("displacement", units.length),
            ("acceleration", units.length),
            (vocabulary::ACTUATOR_FORCE, units.force),
            (vocabulary::SPECIMEN_ACCELERATION, units.length),
            (vocabulary::VALVE_COMMAND, 1.0),
        ];
        for ((key, factor), own) in keys.into_iter().zip(self.noise) {
            // Without a specimen its channel is as noisy as the table's: a diagnosis wants one.
            let own = if own > 0.0 { own } else { self.noise[1] };
            noise.insert(key.to_string(), (own / factor).into());
        }
        let delay = self.rig.command_delay;
        Ok(ModelFile {
            units: INCH_POUND.to_string(),
            sample_rate: Some(1.0 / self.period),
            command_delay: (delay > 0.0).then_some(delay),
            sensor_delay: None,
            actuator: Some(actuator(&values)),
            table: body(three(&values, 9)),
            specimen: specimen.map(|own| own.0),
            effects: EffectSections::new(),
            controller: None,
            noise: Some(noise),
            hydraulics: Some(hydraulic_section(self)),
            uncertainty: Some(UncertaintySection {
                relative: relative.min(0.3),
            }),
            covariance: Some(CovarianceSection::new(&self.covariance)),
            standard_errors: Some(StandardErrors {
                hydraulics: self.hydraulic_errors(),
                effects: EffectSections::new(),
                actuator: Some(actuator_errors),
                table: body(three(&errors, 9)),
                specimen: specimen.map(|own| own.1),
                command_delay: (delay > 0.0).then_some(self.standard_error[11]),
            }),
            described: None,
        })
    }
}
