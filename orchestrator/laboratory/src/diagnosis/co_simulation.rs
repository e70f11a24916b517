//! The gain in closed loop: the FMUs of the nominal and of the extended rig play the reference of
//! the validation record under the laboratory's own control law (R5), for comparison with the
//! measurement. The rig is unstable without its controller, so that nothing else would compare
//! models over a whole record.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use units::vocabulary;

use identification::data::{Channel, OUTPUT_NAMES, Recording, mean_and_deviation};
use identification::diagnosis::case::{ControlLaw, Nominal};
use identification::diagnosis::engine::resampling::{running, share_gone};
use identification::diagnosis::rigs::shake_table::ExtendedModel as Estimated;
use identification::diagnosis::{GainAgainstNoise, GainReport};

use crate::run::experiment::samples;
use fmi_master::{Algorithm, Ended, MasterError, Pace, Simulation};
use fmi_system::{
    ComponentFile, Files, Origin, Quantity, SystemError, SystemFile, VariableName, assemble,
};
use motion::Motion;
use pack::extended_model::{Estimate, ExtendedModel};

/// Coupling steps of table and specimen in a sample, the finest that the rig's delays allow (they
/// last at most thirty steps).
const STEPS_A_SAMPLE: [f64; 3] = [4.0, 2.0, 1.0];
/// Runs with the sensors' noise that the floor is the mean of.
const SEEDS: [i32; 4] = [1, 2, 3, 4];

/// The sensors' readings of [`Channel::OUTPUTS`], SI.
pub type Channels = [Vec<f64>; 4];

/// Why the FMUs do not play a reference.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// A law that the component cannot express.
    #[error("controller.velocity_filter = {0}, expected more than 0 and at most 1")]
    VelocityFilter(f64),
    /// FMUs that do not make a system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// A run that cannot begin.
    #[error(transparent)]
    Master(#[from] MasterError),
    /// A run that ends early: how it ended.
    #[error("{}", .0.message())]
    Ended(Box<Ended>),
    /// A channel that the run did not record.
    #[error("`{0}` was not recorded")]
    NotRecorded(String),
}

/// FMUs of a rig.
#[derive(Debug, Clone, Default)]
pub struct RigFmus {
    /// `ShakeTable`.
    pub table: PathBuf,
    /// `Specimen`, if one is meant to stand on the table.
    pub specimen: Option<PathBuf>,
    /// `Instrumentation`.
    pub sensors: PathBuf,
    /// `ThreeVariableControl`.
    pub control: PathBuf,
    /// What is set on top of the start values, by the component's name.
    pub values: BTreeMap<&'static str, BTreeMap<String, Estimate>>,
}

impl RigFmus {
    /// The same FMUs with the parameters of the nominal model and the effects that it knows.
    #[must_use]
    pub fn nominal(mut self, nominal: &Nominal) -> Self {
        self.values = ExtendedModel::new(&Estimated::known(nominal), &[]).parameters;
        self
    }
}

/// What a rig measures while its law follows `reference` (m), sampled every `period` s; with
/// `noise` (one standard deviation of each channel, and a seed) as its sensors add it.
///
/// # Errors
/// A law that the component cannot express, FMUs at fault, a run that ends early.
pub fn play(
    rig: &RigFmus,
    law: &ControlLaw,
    reference: &[f64],
    period: f64,
    noise: Option<([f64; 4], i32)>,
) -> Result<Channels, PlayError> {
    let file = system(rig, law, period, noise)?;
    let system = assemble(&file, &[], &mut Files::default())?;
    let samples = samples(&motion(reference, period));
    let run = |steps: f64| {
        let simulation =
            Simulation::new(&system, &samples, Algorithm::GaussSeidel, period / steps)?;
        let outcome = simulation.run(reference.len(), Pace::Fastest, &mut |_| {});
        match outcome.ended {
            Ended::Complete => Ok(outcome),
            other => Err(PlayError::Ended(Box::new(other))),
        }
    };
    let [finest, coarser @ ..] = STEPS_A_SAMPLE;
    let outcome = coarser.into_iter().fold(run(finest), |outcome, steps| {
        outcome.or_else(|_| run(steps))
    })?;
    let column = |name: &str| {
        let name = format!("sensors.{name}");
        let column = outcome.record.column(&name);
        column.ok_or(PlayError::NotRecorded(name))
    };
    Ok([
        column(vocabulary::MEASURED_DISPLACEMENT)?,
        column(vocabulary::MEASURED_ACCELERATION)?,
        column(vocabulary::MEASURED_FORCE)?,
        column(vocabulary::MEASURED_SPECIMEN_ACCELERATION)?,
    ])
}

/// The reference with its derivatives as the law takes them: central differences.
fn motion(reference: &[f64], period: f64) -> Motion {
    let last = reference.len().saturating_sub(1);
    let around = |k: usize| {
        let (behind, ahead) = (k.saturating_sub(1), (k + 1).min(last));
        (reference[behind], reference[k], reference[ahead])
    };
    let velocity = |k| {
        let (behind, _, ahead) = around(k);
        (ahead - behind) / (2.0 * period)
    };
    let acceleration = |k| {
        let (behind, here, ahead) = around(k);
        (ahead - 2.0 * here + behind) / (period * period)
    };
    Motion {
        name: "validation".into(),
        dt: period,
        displacement: reference.to_vec(),
        velocity: (0..reference.len()).map(velocity).collect(),
        acceleration: (0..reference.len()).map(acceleration).collect(),
        notes: Vec::new(),
        seed: None,
        across: None,
    }
}

/// The closed loop as a system.
fn system(
    rig: &RigFmus,
    law: &ControlLaw,
    period: f64,
    noise: Option<([f64; 4], i32)>,
) -> Result<SystemFile, PlayError> {
    let share = law.velocity_filter;
    if !(share > 0.0 && share <= 1.0) {
        return Err(PlayError::VelocityFilter(share));
    }
    let mut sensors = vec![(vocabulary::VELOCITY_LAG, period * (1.0 - share) / share)];
    if let Some((noise, _)) = noise {
        let names = [
            "displacement_noise",
            "acceleration_noise",
            "actuator_force_noise",
            "specimen_acceleration_noise",
        ];
        let finite = names.into_iter().zip(noise).filter(|(_, n)| n.is_finite());
        sensors.extend(finite);
    }
    // The component feeds back the errors of velocity and acceleration, the law the motion itself.
    let control = [
        (vocabulary::PROPORTIONAL_GAIN, law.proportional),
        (vocabulary::INTEGRAL_GAIN, law.integral),
        ("velocity_feedback_gain", law.velocity_feedback),
        ("acceleration_feedback_gain", law.acceleration_feedback),
        ("displacement_feedforward_gain", 0.0),
        (
            "velocity_feedforward_gain",
            law.velocity_feedforward - law.velocity_feedback,
        ),
        (
            "acceleration_feedforward_gain",
            law.acceleration_feedforward - law.acceleration_feedback,
        ),
        (vocabulary::VALVE_LIMIT, law.limit),
    ];
    let component = |fmu: &Path, parameters: &[(&str, f64)]| {
        let mut component = ComponentFile::new(&fmu.display().to_string());
        for (parameter, value) in parameters {
            component.set(parameter, *value);
        }
        component
    };
    let of_rig = |fmu: &Path, name: &str, parameters: &[(&str, f64)]| {
        let mut component = component(fmu, parameters);
        for (parameter, estimate) in rig.values.get(name).into_iter().flatten() {
            component.set(parameter, estimate.value);
        }
        component
    };
    let mut table = of_rig(&rig.table, "ShakeTable", &[]);
    let mut sensors = of_rig(&rig.sensors, "Instrumentation", &sensors).period(period);
    if let Some((_, seed)) = noise {
        sensors.set("seed", i64::from(seed));
    }
    let mut system = SystemFile::new("closed loop");
    let mut connect = |from: Origin, component: &str, variable: &str| {
        system.connect(from, VariableName::new(component, variable));
    };
    for quantity in Quantity::FIRST_AXIS {
        let name = quantity.name();
        connect(
            Origin::reference(quantity),
            "control",
            &format!("reference_{name}"),
        );
        let measured = format!("measured_{name}");
        connect(Origin::output("sensors", &measured), "control", &measured);
        connect(Origin::output("table", name), "sensors", name);
    }
    for (from, output, to, input) in [
        (
            "table",
            vocabulary::ACTUATOR_FORCE,
            "sensors",
            vocabulary::ACTUATOR_FORCE,
        ),
        (
            "control",
            vocabulary::VALVE_COMMAND,
            "table",
            vocabulary::VALVE_COMMAND,
        ),
    ] {
        connect(Origin::output(from, output), to, input);
    }
    if let Some(fmu) = &rig.specimen {
        for (from, output, to, input) in [
            (
                "table",
                "acceleration",
                "specimen",
                vocabulary::TABLE_ACCELERATION,
            ),
            ("specimen", "force", "table", vocabulary::SPECIMEN_FORCE),
            (
                "specimen",
                "acceleration",
                "sensors",
                vocabulary::SPECIMEN_ACCELERATION,
            ),
        ] {
            connect(Origin::output(from, output), to, input);
        }
        system.add("specimen", of_rig(fmu, "Specimen", &[]));
    } else {
        table = table.input(vocabulary::SPECIMEN_FORCE, 0.0);
        sensors = sensors.input(vocabulary::SPECIMEN_ACCELERATION, 0.0);
    }
    system.add("table", table);
    system.add("sensors", sensors);
    system.add("control", component(&rig.control, &control).period(period));
    Ok(system)
}

/// Simulation of a record by the co-simulated models.
#[derive(Debug, Clone)]
pub(super) struct Comparison {
    /// Readings of the nominal FMUs.
    pub before: Channels,
    /// Readings of the extended FMUs.
    pub after: Channels,
    /// Deviation that the sensors' noise makes by itself, through the loop and in the readings.
    pub floor: [f64; 4],
    /// The figures.
    pub gain: GainReport,
}

/// Plays the reference of `recording` through the FMUs of both rigs and holds them against it.
///
/// # Errors
/// As [`play`].
pub(super) fn compare(
    recording: &Recording,
    nominal: &Nominal,
    law: &ControlLaw,
    before: &RigFmus,
    after: &RigFmus,
) -> Result<Comparison, PlayError> {
    let period = 1.0 / nominal.sample_rate;
    let reference = recording.samples(Channel::Reference);
    let played = |rig: &RigFmus, noise| play(rig, law, reference, period, noise);
    let (before, after) = (played(before, None)?, {
        let clean = played(after, None)?;
        let mut floor = [0.0; 4];
        for seed in SEEDS {
            let noisy = played(after, Some((nominal.noise, seed)))?;
            for (sum, (noisy, clean)) in floor.iter_mut().zip(noisy.iter().zip(&clean)) {
                *sum += mean_square(noisy, clean) / SEEDS.len() as f64;
            }
        }
        (clean, floor.map(f64::sqrt))
    });
    let (after, floor) = after;
    let gain = gain(recording, &before, &after, &floor);
    Ok(Comparison {
        before,
        after,
        floor,
        gain,
    })
}

fn mean_square(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    sum / a.len().min(b.len()).max(1) as f64
}

fn gain(
    recording: &Recording,
    before: &Channels,
    after: &Channels,
    floor: &[f64; 4],
) -> GainReport {
    let measured = Channel::OUTPUTS.map(|channel| recording.samples(channel));
    let live: Vec<usize> = (0..4)
        .filter(|&i| !measured[i].is_empty() && floor[i] > 0.0)
        .collect();
    let scale = |i: usize| mean_and_deviation(measured[i]).1.max(f64::MIN_POSITIVE);
    let rms =
        |simulated: &Channels, i: usize| -> f64 { mean_square(measured[i], &simulated[i]).sqrt() };
    let channels = live
        .iter()
        .map(|&i| {
            let errors = [rms(before, i), rms(after, i), floor[i]];
            (
                OUTPUT_NAMES[i].to_owned(),
                errors.map(|error| error / scale(i)),
            )
        })
        .collect();
    let overall = |of: &dyn Fn(usize) -> f64| {
        let sum: f64 = live.iter().map(|&i| of(i).powi(2)).sum();
        (sum / live.len().max(1) as f64).sqrt()
    };
    // Running sums of the squared error over all channels, in units of their floors.
    let sums = |simulated: &Channels| -> Vec<f64> {
        running((0..recording.len()).map(|k| {
            let error = |&i: &usize| (measured[i][k] - simulated[i][k]) / floor[i];
            live.iter().map(|i| error(i).powi(2)).sum::<f64>()
        }))
    };
    GainReport {
        before_nrmse: overall(&|i| rms(before, i) / scale(i)),
        after_nrmse: overall(&|i| rms(after, i) / scale(i)),
        noise_floor_nrmse: Some(overall(&|i| floor[i] / scale(i))),
        interval_95: share_gone(&sums(before), &sums(after)).into(),
        interval_of: None,
        record: "validation".to_owned(),
        against_noise: Some(GainAgainstNoise {
            before_ratio: overall(&|i| rms(before, i) / floor[i]),
            after_ratio: overall(&|i| rms(after, i) / floor[i]),
            channels,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_system::Setting;

    fn law() -> ControlLaw {
        ControlLaw {
            proportional: 200.0,
            integral: 30.0,
            velocity_feedforward: 9.0,
            acceleration_feedforward: 0.5,
            velocity_feedback: 2.0,
            acceleration_feedback: 0.125,
            velocity_filter: 0.25,
            limit: 10.0,
        }
    }

    /// Of a parabola central differences are exact.
    #[test]
    fn a_reference_has_the_differences_that_the_law_takes() {
        let period = 0.5;
        let reference: Vec<f64> = (0..5).map(|k| (f64::from(k) * period).powi(2)).collect();
        let own = motion(&reference, period);
        assert_eq!((own.dt, &own.displacement), (period, &reference));
        assert_eq!(own.velocity, [0.25, 1.0, 2.0, 3.0, 1.75]);
        // At the ends the sample outside is the one at the end.
        assert_eq!(own.acceleration, [1.0, 2.0, 2.0, 2.0, -7.0]);
    }

    #[test]
    fn the_law_is_set_as_the_component_has_it() {
        let values = [("stiffness", 5.0)].map(|(name, value)| {
            let estimate = Estimate {
                value,
                standard_error: None,
            };
            (name.to_string(), estimate)
        });
        let mut rig = RigFmus {
            table: "Table.fmu".into(),
            specimen: Some("Specimen.fmu".into()),
            sensors: "Sensors.fmu".into(),
            control: "Control.fmu".into(),
            values: BTreeMap::from([("Specimen", BTreeMap::from(values))]),
        };
        let noise = Some(([1e-6, f64::NAN, 3.0, 4.0], 17));
        let file = system(&rig, &law(), 0.002, noise).unwrap();
        let value = |component: &str, name: &str| {
            let found = file.components[component].parameters.get(name);
            found.map(|own| match own {
                Setting::Number(number) => *number,
                Setting::Integer(number) => *number as f64,
                other => panic!("{other:?}"),
            })
        };
        for (name, expected) in [
            ("proportional_gain", 200.0),
            ("integral_gain", 30.0),
            ("velocity_feedback_gain", 2.0),
            ("acceleration_feedback_gain", 0.125),
            ("displacement_feedforward_gain", 0.0),
            // The component feeds back the error, so that the feedback's part comes off.
            ("velocity_feedforward_gain", 7.0),
            ("acceleration_feedforward_gain", 0.375),
            ("valve_limit", 10.0),
        ] {
            assert_eq!(value("control", name), Some(expected), "{name}");
        }
        // A filter that takes a quarter of the newest difference lags by three periods.
        let lag = value("sensors", vocabulary::VELOCITY_LAG).unwrap();
        assert!((lag - 0.006).abs() < 1e-15, "{lag}");
        assert_eq!(value("sensors", "displacement_noise"), Some(1e-6));
        assert_eq!(value("sensors", "acceleration_noise"), None);
        assert_eq!(value("sensors", "actuator_force_noise"), Some(3.0));
        assert_eq!(value("sensors", "specimen_acceleration_noise"), Some(4.0));
        assert_eq!(value("sensors", "seed"), Some(17.0));
        assert_eq!(value("specimen", "stiffness"), Some(5.0));
        let links = |file: &SystemFile| -> Vec<String> {
            let mut all: Vec<String> = file.connections.iter().map(ToString::to_string).collect();
            all.sort();
            all
        };
        let whole = links(&file);
        assert_eq!(
            whole,
            [
                "control.valve_command -> table.valve_command",
                "reference.acceleration -> control.reference_acceleration",
                "reference.displacement -> control.reference_displacement",
                "reference.velocity -> control.reference_velocity",
                "sensors.measured_acceleration -> control.measured_acceleration",
                "sensors.measured_displacement -> control.measured_displacement",
                "sensors.measured_velocity -> control.measured_velocity",
                "specimen.acceleration -> sensors.specimen_acceleration",
                "specimen.force -> table.specimen_force",
                "table.acceleration -> sensors.acceleration",
                "table.acceleration -> specimen.table_acceleration",
                "table.actuator_force -> sensors.actuator_force",
                "table.displacement -> sensors.displacement",
                "table.velocity -> sensors.velocity",
            ]
        );
        // Without a specimen there is nothing of it, and without noise no seed.
        rig.specimen = None;
        let bare = system(&rig, &law(), 0.002, None).unwrap();
        let expected: Vec<String> = whole
            .into_iter()
            .filter(|link| !link.contains("specimen"))
            .collect();
        assert_eq!(links(&bare), expected);
        assert!(!bare.components.contains_key("specimen"));
        assert!(!bare.components["sensors"].parameters.contains_key("seed"));
    }

    #[test]
    fn a_filter_without_a_share_is_refused() {
        for (share, is_known) in [
            (0.0, false),
            (-0.5, false),
            (1.5, false),
            (f64::NAN, false),
            (1.0, true),
            (0.5, true),
        ] {
            let law = ControlLaw {
                velocity_filter: share,
                ..law()
            };
            let told = system(&RigFmus::default(), &law, 0.002, None).err();
            let told = told.map(|error| error.to_string());
            let expected =
                format!("controller.velocity_filter = {share}, expected more than 0 and at most 1");
            assert_eq!(told, (!is_known).then_some(expected));
        }
    }

    /// Errors that stay the same over the record, so that each figure is known.
    #[test]
    fn the_gain_is_in_units_of_the_channels_and_of_their_floors() {
        let turns = |size: f64| -> Vec<f64> {
            (0..1000)
                .map(|k| if k % 2 == 0 { size } else { -size })
                .collect()
        };
        let [first, second, third, _] = Channel::OUTPUTS;
        let channels = vec![
            (Channel::Reference, turns(1.0)),
            (first, turns(1.0)),
            (second, turns(2.0)),
            (third, turns(4.0)),
        ];
        let recording = Recording::new("validation", 0.01, channels).unwrap();
        let off = |errors: [f64; 2]| -> Channels {
            let near = |size: f64, error: f64| turns(size).iter().map(|x| x + error).collect();
            [
                near(1.0, errors[0]),
                near(2.0, errors[1]),
                turns(0.0),
                Vec::new(),
            ]
        };
        // The third channel has no floor, the fourth is not recorded.
        let floor = [0.05, 0.1, 0.0, 1.0];
        let found = gain(&recording, &off([0.5, 0.4]), &off([-0.1, 0.2]), &floor);
        let near = |found: f64, expected: f64| {
            // A deviation over n or n - 1 is the same to three digits here.
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        };
        let mean = |first: f64, second: f64| ((first.powi(2) + second.powi(2)) / 2.0).sqrt();
        near(found.before_nrmse, mean(0.5, 0.2));
        near(found.after_nrmse, mean(0.1, 0.1));
        near(found.noise_floor_nrmse.unwrap(), 0.05);
        let against = found.against_noise.unwrap();
        near(against.before_ratio, mean(10.0, 4.0));
        near(against.after_ratio, mean(2.0, 2.0));
        assert_eq!(against.channels.len(), 2);
        let figures = against.channels[OUTPUT_NAMES[1]];
        for (figure, expected) in figures.into_iter().zip([0.2, 0.1, 0.05]) {
            near(figure, expected);
        }
        let share = 1.0 - (8.0_f64 / 116.0).sqrt();
        let (low, high) = found.interval_95;
        near(low, share);
        near(high, share);
        assert_eq!(mean_square(&[1.0, 2.0, 9.0], &[3.0, 2.0]), 2.0);
        assert_eq!(mean_square(&[], &[]), 0.0);
    }
}
