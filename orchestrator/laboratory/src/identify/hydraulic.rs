//! A hydraulic rig, identified with the reference as instrument if the general form does not fit.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use identification::IdentificationError;
use identification::closed_loop::equations::NAMES;
use identification::closed_loop::{self, Check, Found, Settings};
use identification::data::{Channel, Recording};
use identification::identify::model_file::ModelFile;

use super::parameters::{Parameter, Uncertainty, parameter_table};
use super::poles;
use super::summary::Summary;
use pages::report::{Report, Section, Table, identity};

/// What was found from the first part of the recordings, and how the rest obeys it.
pub struct HydraulicIdentification {
    /// What was found.
    pub found: Found,
    /// How the rest obeys it.
    pub check: Check,
    /// The model file.
    pub file: ModelFile,
}

/// Columns of [`HydraulicIdentification::equations`].
pub const EQUATION_COLUMNS: [&str; 4] = [
    "equation",
    "residual over noise, fitted",
    "not fitted",
    "residual over largest term",
];

/// Units of [`NAMES`].
const UNITS: [&str; NAMES.len()] = [
    "s", "s^2", "N/(V s)", "N/m", "1/s", "N s/m", "N", "kg", "N s/m", "N/m", "kg", "s", "s", "s",
    "1",
];

impl HydraulicIdentification {
    /// Fits the first `part` of `recordings` and checks the rest.
    ///
    /// # Errors
    /// Every way in which data give no model, see [`IdentificationError`].
    pub fn new(recordings: &[Recording], part: f64) -> Result<Self, IdentificationError> {
        let settings = Settings::default();
        let split = |recording: &Recording| (recording.len() as f64 * part) as usize;
        let fitted: Vec<Recording> = recordings.iter().map(|r| r.cut(0, split(r))).collect();
        let rest = recordings.iter().map(|r| r.cut(split(r), r.len()));
        let rest: Vec<Recording> = rest.collect();
        let found = closed_loop::identify(&fitted, settings)?;
        if !found.holds() && recordings.len() > 1 {
            let settings = Settings {
                replay: false,
                ..settings
            };
            let alone = |r: &Recording| closed_loop::identify(std::slice::from_ref(r), settings);
            if fitted.iter().all(|r| alone(r).is_ok_and(|own| own.holds())) {
                return Err(IdentificationError::Unstable {
                    what: "each recording fits a hydraulic rig, but not all of them together"
                        .into(),
                    remedy: "use recordings of one rig that differ only in payload".into(),
                });
            }
        }
        let check = closed_loop::check(&found, &rest, settings)?;
        let file = found.model_file()?;
        Ok(Self { found, check, file })
    }

    /// Whether both parts obey the equations.
    pub fn holds(&self) -> bool {
        const MOST: f64 = 4.0;
        self.found.holds() && self.check.mean_squares.iter().all(|square| *square < MOST)
    }

    /// The parameters, SI.
    pub fn parameters(&self) -> Vec<Parameter> {
        let found = &self.found;
        let values: [f64; NAMES.len()] = found.rig.into();
        let row = |name: &str, value: f64, error: Option<f64>, unit: &'static str| Parameter {
            name: name.to_string(),
            value,
            error: error.map_or(Uncertainty::Without("-"), Uncertainty::Estimated),
            unit,
        };
        let mut rows: Vec<Parameter> = NAMES
            .iter()
            .zip(values)
            .zip(found.standard_error.iter().zip(UNITS))
            .filter(|((name, value), _)| **name != "specimen mass" || *value > 0.0)
            .map(|((name, value), (error, unit))| row(name, value, Some(*error), unit))
            .collect();
        let shape = found.shape;
        if found.rig.seal_friction > 0.0 {
            rows.push(row("seal presliding", shape.presliding, None, "m"));
            rows.push(row("seal excess", shape.excess, None, "1"));
            let velocity = shape.stribeck_velocity;
            rows.push(row("seal Stribeck velocity", velocity, None, "m/s"));
        }
        if let Some(fit) = &found.specimen {
            let s = fit.specimen;
            let error = |i: usize| Some(fit.covariance[(i, i)].max(0.0).sqrt());
            let frequency = s.stiffness.sqrt() / TAU;
            rows.push(row("specimen frequency", frequency, None, "Hz"));
            rows.push(row("specimen damping/mass", s.damping, error(0), "1/s"));
            let stiffness = s.stiffness;
            rows.push(row("specimen stiffness/mass", stiffness, error(1), "1/s^2"));
            if s.yield_displacement.is_finite() {
                let drift = s.yield_displacement;
                rows.push(row("specimen yield displacement", drift, error(2), "m"));
                rows.push(row("stiffness after it", s.post_ratio, error(3), "1"));
            }
        }
        for (index, payload) in found.payloads.iter().enumerate() {
            let name = format!("payload of recording {}", index + 2);
            rows.push(row(&name, *payload, None, "kg"));
        }
        rows
    }

    /// Rows of equation, mean squares of its residual over its noise in the part that was fitted
    /// and in the rest, and the residual over its largest term.
    pub fn equations(&self) -> Vec<[String; 4]> {
        let names = ["motion: a = s^2 x", "table: force", "actuator: command"];
        (0..names.len())
            .map(|i| {
                [
                    names[i].to_string(),
                    format!("{:.2}", self.found.mean_squares[i]),
                    format!("{:.2}", self.check.mean_squares[i]),
                    format!("{:.2} %", 100.0 * self.check.relative_errors[i]),
                ]
            })
            .collect()
    }

    /// The figures; `model` is the file that holds the rig.
    pub(super) fn summary(&self, model: &Path, mut warnings: Vec<String>, wall_s: f64) -> Summary {
        warnings.extend(self.found.warnings.iter().cloned());
        if !self.holds() {
            warnings.insert(
                0,
                "the model does not explain these recordings to their noise: see the residual of \
                 the equations"
                    .into(),
            );
        }
        let channels = [
            Channel::Acceleration,
            Channel::ActuatorForce,
            Channel::ValveCommand,
        ];
        let fit_percent: BTreeMap<String, Option<f64>> = channels
            .iter()
            .zip(self.check.relative_errors)
            .map(|(channel, error)| (channel.name().to_string(), Some(100.0 * (1.0 - error))))
            .collect();
        let rig = self.found.rig.shake_table();
        let pairs =
            |poles: Vec<nalgebra::Complex<f64>>| poles.iter().map(|p| [p.re, p.im]).collect();
        Summary {
            model: model.to_path_buf(),
            actuator_poles_rad_s: rig.map_or(Vec::new(), |rig| pairs(rig.actuator.g1().poles())),
            table_poles_rad_s: rig.map_or(Vec::new(), |rig| {
                pairs(rig.table.transfer_function().poles())
            }),
            fit_percent,
            identifiable: true,
            warnings,
            wall_s,
        }
    }

    /// The report.
    pub(super) fn report(&self, summary: &Summary) -> Report {
        let explained = "The residual of the equations is noise.";
        Report {
            title: "Identified hydraulic rig".into(),
            summary: summary
                .warnings
                .first()
                .cloned()
                .unwrap_or_else(|| explained.into()),
            identity: vec![
                identity::entry("Form", "hydraulic, with friction and late sensors"),
                identity::entry("Model file", summary.model.display().to_string()),
                identity::version(),
            ],
            sections: vec![Section {
                heading: "Model".into(),
                notes: summary.warnings.clone(),
                panels: vec![poles::panel(summary)],
                tables: vec![
                    parameter_table("Parameters", &self.parameters()),
                    Table::of(
                        "Residual of the equations",
                        EQUATION_COLUMNS,
                        self.equations(),
                    ),
                ],
                ..Section::default()
            }],
            footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
            ..Report::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use identification::closed_loop::equations::{HydraulicRig, PARAMETERS};
    use identification::closed_loop::specimen::{SpecimenFit, SpecimenOverMass};
    use nalgebra::DMatrix;
    use plant::identified::seal_shape::SealShape;

    use super::*;

    /// A rig with a specimen of 2 Hz and 5 % of critical damping, and a second payload.
    fn found(seal_friction: f64, yield_displacement: f64) -> HydraulicIdentification {
        let rig = HydraulicRig {
            spool_lag: 3e-3,
            spool_inertia: 4e-6,
            force_rate: 2e6,
            oil_stiffness: 1e6,
            leakage_rate: 4.0,
            seal_damping: 300.0,
            seal_friction,
            mass: 25.0,
            damping: 60.0,
            stiffness: 500.0,
            specimen_mass: 8.0,
            command_delay: 2e-3,
            accelerometer_delay: 0.0,
            load_cell_delay: 0.0,
            accelerometer_scale: 1.0,
        };
        let values: [f64; PARAMETERS] = rig.into();
        let errors = values.map(|value| 0.01 * value);
        let specimen = SpecimenOverMass {
            yield_displacement,
            ..SpecimenOverMass::elastic(1.2566, 157.91)
        };
        let found = Found {
            rig,
            standard_error: errors,
            covariance: DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| {
                if i == j { errors[i] * errors[i] } else { 0.0 }
            }),
            payloads: vec![12.5],
            shape: SealShape {
                presliding: 1e-5,
                excess: 0.2,
                stribeck_velocity: 0.01,
                sharpness: 1.0,
                relaxation: 0.0,
            },
            valve: None,
            mean_squares: [1.0, 1.1, 1.2],
            specimen: Some(SpecimenFit {
                specimen,
                covariance: DMatrix::identity(5, 5) * 0.04,
                misfit: 0.01,
            }),
            converged: true,
            noise: [1e-5, 0.04, 1.3, 0.025, 1e-3],
            period: 0.002,
            warnings: vec!["the record is short".into()],
        };
        HydraulicIdentification {
            file: found.model_file().unwrap(),
            found,
            check: Check {
                mean_squares: [1.5, 2.0, 3.5],
                relative_errors: [0.01, 0.02, 0.04],
            },
        }
    }

    fn row<'a>(all: &'a [Parameter], name: &str) -> Option<&'a Parameter> {
        all.iter().find(|own| own.name == name)
    }

    #[test]
    fn parameters_are_those_of_the_rig_and_of_what_stands_on_it() {
        let all = found(30.0, 0.01).parameters();
        let value = |name: &str| row(&all, name).unwrap().value;
        assert_eq!((value("table mass"), value("force rate")), (25.0, 2e6));
        assert!((value("specimen frequency") - 2.0).abs() < 1e-3);
        assert_eq!(value("specimen damping/mass"), 1.2566);
        let damping = &row(&all, "specimen damping/mass").unwrap().error;
        assert!(matches!(damping, Uncertainty::Estimated(error) if (error - 0.2).abs() < 1e-12));
        assert_eq!(value("specimen yield displacement"), 0.01);
        assert_eq!(value("payload of recording 2"), 12.5);
        assert!(row(&all, "seal Stribeck velocity").is_some());
        // What does not slide or yield has no shape of it.
        let elastic = found(0.0, f64::INFINITY).parameters();
        for name in ["seal Stribeck velocity", "specimen yield displacement"] {
            assert!(row(&elastic, name).is_none(), "{name}");
        }
    }

    #[test]
    fn a_model_that_its_data_contradict_says_so_first() {
        let mut own = found(30.0, 0.01);
        assert!(own.holds());
        let summary = own.summary(Path::new("model.toml"), Vec::new(), 1.0);
        assert_eq!(summary.warnings, ["the record is short"]);
        assert_eq!(summary.fit_percent["acceleration"], Some(99.0));
        assert_eq!(summary.fit_percent["valve_command"], Some(96.0));
        let rows = own.equations();
        assert_eq!(rows[2], ["actuator: command", "1.20", "3.50", "4.00 %"]);
        // Poles of spool, leakage and table.
        assert_eq!(summary.actuator_poles_rad_s.len(), 3);
        assert!(
            summary
                .actuator_poles_rad_s
                .iter()
                .any(|pole| (pole[0] + 4.0).abs() < 1e-6)
        );
        let size = summary.table_poles_rad_s[0][0].hypot(summary.table_poles_rad_s[0][1]);
        assert!((size - 20.0_f64.sqrt()).abs() < 1e-6);
        own.check.mean_squares[2] = 4.5;
        assert!(!own.holds());
        let summary = own.summary(Path::new("model.toml"), Vec::new(), 1.0);
        assert!(summary.warnings[0].starts_with("the model does not explain these recordings"));
        let page = own.report(&summary);
        assert_eq!(page.summary, summary.warnings[0]);
        assert_eq!(page.sections[0].tables.len(), 2);
    }
}
