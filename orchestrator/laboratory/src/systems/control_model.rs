//! What controllers are designed on: a rig as its recordings show it.

use std::path::Path;

use controllers::preview::model::Hydraulics;
use controllers::tuning::suite::{Measurements, Suite};
use identification::IdentificationError;
use identification::closed_loop::equations::{HydraulicRig, PARAMETERS};
use identification::closed_loop::friction::SealShape;
use identification::identify::model_file::{ModelFile, Units};
use nalgebra::{DMatrix, DVector};
use plant::identified::shake_table::ShakeTable;
use plant::identified::valve_curve::ValveCurve;
use plant::sensors::channel;
use plant::specimens::linear::LinearSpecimen;
use units::constants::{G, INCH, SAMPLING_PERIOD};

use super::tuning::hydraulics;

/// The model of the physical rig that comes with the program, as its commissioning found it.
const COMMISSIONED: &str = include_str!("../../systems/plant/servohydraulic-model.toml");

/// One standard deviation of what is measured, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// m.
    pub displacement: f64,
    /// m/s.
    pub velocity: f64,
    /// m/s².
    pub acceleration: f64,
}

/// An identified rig with the delay and noise of its measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlModel {
    /// Actuator and table.
    pub rig: ShakeTable,
    /// Samples by which measurements are late behind the command's effect.
    pub delay: usize,
    /// The same to a part of a sample, s.
    pub late: f64,
    /// Noise of the measurements.
    pub noise: Noise,
    /// The specimen of the recordings.
    pub specimen: Option<LinearSpecimen>,
    /// Valve, oil and seals beyond the form of Eq 2-4, where they were identified.
    pub hydraulics: Option<(HydraulicRig, SealShape)>,
    /// The valve's curve, where it is not an ideal one.
    pub curve: Option<ValveCurve>,
    /// Samples by which the valve acts late: of `delay`, those that are not the sensors'.
    pub command_delay: usize,
    /// By how much it acts later than that, s; negative for earlier.
    pub fraction: f64,
    uncertainty: Uncertainty,
}

/// What is known of the errors of a model.
#[derive(Debug, Clone, PartialEq)]
enum Uncertainty {
    /// Nothing.
    Unknown,
    /// A factor of the covariance of the hydraulic rig's parameters.
    Hydraulic(DMatrix<f64>),
    /// Standard errors of the coefficients of actuator and table, taken as independent.
    Coefficients(Box<ShakeTable>),
}

/// A rig as the model's uncertainty allows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Draw {
    /// Actuator and table.
    pub rig: ShakeTable,
    /// Delay, s.
    pub late: f64,
}

impl Noise {
    /// With white noise of displacement (m) and acceleration (m/s²), and the velocity estimated from
    /// the two.
    fn of(displacement: f64, acceleration: f64) -> Self {
        // Below these sensors err in other ways than by noise (as for the velocity's filter of the
        // instrumentation).
        let displacement = displacement.max(1e-4 * INCH);
        let acceleration = acceleration.max(0.01 * G);
        // Steady Kalman filter of a double integrator: sqrt(2) Q^(3/4) R^(1/4) is the variance of
        // the velocity for densities Q of the acceleration's noise and R of the displacement's.
        let [q, r] = [acceleration, displacement].map(|own| own * own * SAMPLING_PERIOD);
        let velocity = (std::f64::consts::SQRT_2 * q.powf(0.75) * r.powf(0.25)).sqrt();
        Self {
            displacement,
            velocity,
            acceleration,
        }
    }
}

impl ControlModel {
    /// Reads a model file; a sentence says what is wrong.
    ///
    /// # Errors
    /// A file at fault, or one whose data did not determine the actuator.
    pub fn read(path: &Path) -> Result<Self, IdentificationError> {
        let file = ModelFile::read(path)?;
        Self::new(&file, &path.display().to_string())
    }

    /// The physical rig's.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn commissioned() -> Result<Self, IdentificationError> {
        const NAME: &str = "the built-in model of the physical rig";
        let file = ModelFile::parse(COMMISSIONED, NAME)?;
        Self::new(&file, NAME)
    }

    /// From a file; `name` is what messages call it.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn new(file: &ModelFile, name: &str) -> Result<Self, IdentificationError> {
        let rig = file.shake_table(name)?;
        let units: Units = file.units(name)?;
        let noise = |channel: &str| {
            let value = file.noise.as_ref().and_then(|noise| noise.get(channel));
            value.and_then(toml::Value::as_float).unwrap_or(0.0) * units.length
        };
        let late = file.command_delay.unwrap_or(0.0);
        let command = (late - file.sensor_delay.unwrap_or(late)).max(0.0);
        let samples = (command / SAMPLING_PERIOD).round();
        Ok(Self {
            rig,
            late: late.max(0.0),
            delay: (late / SAMPLING_PERIOD).round().max(0.0) as usize,
            noise: Noise::of(noise("displacement"), noise("acceleration")),
            specimen: file.specimen(name)?,
            hydraulics: file.hydraulic_rig(name)?,
            curve: file.valve_curve(),
            command_delay: samples as usize,
            fraction: command - samples * SAMPLING_PERIOD,
            uncertainty: Uncertainty::of(file, units),
        })
    }

    /// The identified plant as the thesis prints it (Eq 2-13, 2-14, 2-28): nothing is late there, and
    /// its sensors have no noise.
    pub fn identified() -> Self {
        Self {
            rig: ShakeTable::default(),
            delay: 0,
            late: 0.0,
            noise: Noise::of(0.0, 0.0),
            specimen: None,
            hydraulics: None,
            curve: None,
            command_delay: 0,
            fraction: 0.0,
            uncertainty: Uncertainty::Unknown,
        }
    }

    /// Valve and oil for controllers that count whole samples of delay, where the model has them: what is more or less
    /// than those is in the spool, `(1 + l s + j s²) exp(τ s)` to the second order.
    pub fn whole_samples(&self) -> Option<Hydraulics> {
        /// Least lag and damping ratio of a spool that acts earlier.
        const LEAST: f64 = 5e-4;
        const LEAST_DAMPING: f64 = 0.3;
        let (own, _) = self.hydraulics.as_ref()?;
        let late = self.fraction.max(LEAST - own.spool_lag);
        let lag = own.spool_lag + late;
        let inertia = own.spool_inertia + own.spool_lag * late + 0.5 * late * late;
        // A spool that acts earlier may have no inertia left, one that acts later too little damping.
        let least = (0.05 * lag * lag).min(own.spool_inertia);
        let most = (0.5 * lag / LEAST_DAMPING).powi(2).max(own.spool_inertia);
        Some(Hydraulics {
            spool_lag: lag,
            spool_inertia: inertia.clamp(least, most),
            ..hydraulics(own)
        })
    }

    /// Delay and noise for the rules of the controllers.
    pub fn measurements(&self) -> Measurements {
        Measurements {
            late: self.late,
            noise: [
                self.noise.displacement,
                self.noise.velocity,
                self.noise.acceleration,
            ],
            period: SAMPLING_PERIOD,
        }
    }

    /// All controllers by their rules.
    pub fn suite(&self) -> Suite {
        Suite::new(&self.rig, &self.measurements())
    }

    /// Rigs as likely as the model's errors make them; draws that are not a valid rig are omitted.
    /// Without errors, none.
    pub fn draws(&self, count: u64, seed: u64) -> Vec<Draw> {
        let gaussian = |sample: u64, channel: u64| {
            channel::Noise {
                seed,
                channel,
                sample,
            }
            .gaussian()
        };
        (0..count)
            .filter_map(|sample| match (&self.uncertainty, &self.hydraulics) {
                (Uncertainty::Hydraulic(factor), Some((rig, _))) => {
                    let own: [f64; PARAMETERS] = (*rig).into();
                    let z = DVector::from_fn(PARAMETERS, |i, _| gaussian(sample, i as u64));
                    let change = factor * z;
                    let moved = HydraulicRig::from(std::array::from_fn(|i| own[i] + change[i]));
                    let late = moved.command_delay.max(0.0);
                    let spool = moved.spool_lag > 0.0 && moved.spool_inertia > 0.0;
                    let sound = spool && moved.is_sound();
                    let rig = sound.then(|| moved.shake_table()).flatten()?;
                    Some(Draw { rig, late })
                }
                (Uncertainty::Coefficients(errors), _) => {
                    let mut rig = self.rig;
                    let mut place = 0;
                    let mut move_by = |value: &mut f64, error: f64| {
                        *value += error * gaussian(sample, place);
                        place += 1;
                    };
                    let (own, other) = (&mut rig.actuator, &errors.actuator);
                    for i in 0..3 {
                        move_by(&mut own.denominator[i], other.denominator[i]);
                        move_by(&mut own.voltage_to_force[i], other.voltage_to_force[i]);
                        move_by(&mut own.velocity_to_force[i], other.velocity_to_force[i]);
                    }
                    let (own, other) = (&mut rig.table, &errors.table);
                    move_by(&mut own.mass, other.mass);
                    move_by(&mut own.damping, other.damping);
                    move_by(&mut own.stiffness, other.stiffness);
                    let late = self.late;
                    Some(Draw { rig, late })
                }
                _ => None,
            })
            .filter(|draw| draw.rig.validate().is_ok())
            .collect()
    }
}

impl Uncertainty {
    fn of(file: &ModelFile, units: Units) -> Self {
        let covariance = file.covariance.as_ref().and_then(|own| own.ordered());
        if let (Some(covariance), Some(_)) = (covariance, &file.hydraulics) {
            // Variances range over twenty decades: factored as correlations.
            let size = covariance.diagonal().map(|value| value.max(0.0).sqrt());
            let correlation = DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| {
                let both = size[i] * size[j];
                if both > 0.0 {
                    covariance[(i, j)] / both
                } else {
                    0.0
                }
            });
            let eigen = correlation.symmetric_eigen();
            let sizes = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
            let factor = eigen.eigenvectors * DMatrix::from_diagonal(&sizes);
            return Self::Hydraulic(DMatrix::from_diagonal(&size) * factor);
        }
        let Some(errors) = &file.standard_errors else {
            return Self::Unknown;
        };
        let Some(actuator) = &errors.actuator else {
            return Self::Unknown;
        };
        let three = |values: &[f64], first: usize, factor: f64| -> [f64; 3] {
            std::array::from_fn(|i| values.get(first + i).copied().unwrap_or(0.0) * factor)
        };
        let per_length = units.force / units.length;
        let mut own = ShakeTable::default();
        own.actuator.denominator = three(&actuator.denominator, 1, 1.0);
        own.actuator.voltage_to_force = three(&actuator.voltage_to_force, 0, units.force);
        own.actuator.velocity_to_force = three(&actuator.velocity_to_force, 0, per_length);
        own.table.mass = errors.table.mass * per_length;
        own.table.damping = errors.table.damping * per_length;
        own.table.stiffness = errors.table.stiffness * per_length;
        Self::Coefficients(Box::new(own))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Complex;

    use super::*;

    /// Parts of a sample either way are in the spool: both act alike where motions are.
    #[test]
    fn a_spool_takes_what_samples_leave_of_a_delay() {
        let mut model = ControlModel::commissioned().unwrap();
        let (own, _) = model.hydraulics.unwrap();
        assert_eq!(model.whole_samples(), Some(hydraulics(&own)));
        for late in [-9e-4, -4e-4, 3e-4, 9e-4] {
            model.fraction = late;
            let spool = model.whole_samples().unwrap();
            for hertz in [0.5, 2.0, 5.0, 10.0] {
                let s = Complex::new(0.0, TAU * hertz);
                let of = |lag: f64, inertia: f64| 1.0 / ((s * inertia + lag) * s + 1.0);
                let wanted = of(own.spool_lag, own.spool_inertia) * (-s * late).exp();
                let got = of(spool.spool_lag, spool.spool_inertia);
                assert!((got / wanted - 1.0).norm() < 3e-3, "{late} s, {hertz} Hz");
            }
        }
    }

    /// `(1 + l s + j s²) exp(τ s)` to the second order is `1 + (l + τ) s + (j + l τ + τ²/2) s²`.
    #[test]
    fn a_spool_with_little_damping_keeps_the_series_of_its_delay() {
        let mut model = ControlModel::commissioned().unwrap();
        let (own, _) = model.hydraulics.as_mut().unwrap();
        (own.spool_lag, own.spool_inertia) = (2e-3, 1e-6);
        model.fraction = 5e-4;
        let spool = model.whole_samples().unwrap();
        assert!((spool.spool_lag - 2.5e-3).abs() < 1e-15);
        assert!((spool.spool_inertia - 2.125e-6).abs() < 1e-18);
        // One that acts much earlier keeps a lag of half a millisecond.
        model.fraction = -5e-3;
        let spool = model.whole_samples().unwrap();
        assert!((spool.spool_lag - 5e-4).abs() < 1e-15);
        assert!(spool.spool_inertia > 0.0);
    }

    #[test]
    fn draws_have_the_standard_errors_of_the_coefficients() {
        let mut errors = ShakeTable::default();
        let zero = [0.0; 3];
        (
            errors.actuator.denominator,
            errors.actuator.voltage_to_force,
        ) = (zero, zero);
        errors.actuator.velocity_to_force = zero;
        let size = 0.05 * errors.table.mass;
        (errors.table.damping, errors.table.stiffness) = (0.0, 0.0);
        errors.table.mass = size;
        let own = ControlModel {
            uncertainty: Uncertainty::Coefficients(Box::new(errors)),
            late: 0.004,
            ..ControlModel::identified()
        };
        let draws = own.draws(400, 3);
        assert_eq!(draws.len(), 400);
        let masses: Vec<f64> = draws
            .iter()
            .map(|draw| draw.rig.table.mass - own.rig.table.mass)
            .collect();
        let mean = masses.iter().sum::<f64>() / 400.0;
        let deviation = (masses.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        // Four standard errors of mean and deviation.
        let (mean, deviation) = (mean / size, deviation / size);
        assert!(
            mean.abs() < 0.2 && (deviation - 1.0).abs() < 0.15,
            "{mean} {deviation}"
        );
        for draw in &draws {
            assert_eq!((draw.late, draw.rig.actuator), (0.004, own.rig.actuator));
            assert_eq!(draw.rig.table.damping, own.rig.table.damping);
        }
        assert_eq!(own.draws(5, 3), draws[..5]);
        assert_ne!(own.draws(5, 4), draws[..5]);
        assert!(ControlModel::identified().draws(5, 3).is_empty());
    }

    #[test]
    fn draws_of_the_commissioned_rig_are_near_it() {
        let own = ControlModel::commissioned().unwrap();
        let draws = own.draws(40, 1);
        assert!(draws.len() > 30, "{}", draws.len());
        let far = |draw: &Draw| (draw.rig.table.mass / own.rig.table.mass - 1.0).abs();
        let most = draws.iter().map(far).fold(0.0, f64::max);
        assert!(most > 1e-5 && most < 0.2, "{most}");
    }

    /// `sqrt(2) Q^(3/4) R^(1/4)` with densities of the two noises, and floors below which sensors err otherwise.
    #[test]
    fn the_noise_of_the_velocity_is_that_of_a_filter_of_the_others() {
        let own = Noise::of(1e-4, 0.5);
        let densities = [0.5_f64, 1e-4].map(|size| size * size * SAMPLING_PERIOD);
        let variance = 2.0_f64.sqrt() * densities[0].powf(0.75) * densities[1].powf(0.25);
        assert!((own.velocity / variance.sqrt() - 1.0).abs() < 1e-12);
        assert_eq!((own.displacement, own.acceleration), (1e-4, 0.5));
        let least = Noise::of(0.0, 0.0);
        assert_eq!(
            (least.displacement, least.acceleration),
            (1e-4 * INCH, 0.01 * G)
        );
        let model = ControlModel::identified();
        let measured = model.measurements();
        assert_eq!(
            measured.noise,
            [least.displacement, least.velocity, least.acceleration]
        );
        assert_eq!(
            (measured.late, measured.period, model.delay),
            (0.0, SAMPLING_PERIOD, 0)
        );
    }

    #[test]
    fn a_delay_is_split_into_that_of_the_valve_and_of_the_sensors() {
        let mut file = ModelFile::parse(COMMISSIONED, "own").unwrap();
        file.command_delay = Some(3.4 * SAMPLING_PERIOD);
        file.sensor_delay = Some(SAMPLING_PERIOD);
        let own = ControlModel::new(&file, "own").unwrap();
        assert_eq!((own.delay, own.command_delay), (3, 2));
        assert!(
            (own.fraction - 0.4 * SAMPLING_PERIOD).abs() < 1e-12,
            "{}",
            own.fraction
        );
        assert!((own.late - 3.4 * SAMPLING_PERIOD).abs() < 1e-15);
        file.sensor_delay = None;
        let own = ControlModel::new(&file, "own").unwrap();
        assert_eq!((own.command_delay, own.fraction), (0, 0.0));
    }
}
