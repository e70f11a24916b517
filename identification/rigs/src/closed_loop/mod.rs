//! Identification of hydraulic rigs from closed-loop recordings, with the reference as instrument.
//!
//! 1. [`bands`]: every channel is projected on the reference, band by band.
//! 2. [`start`]: linear regressions over a grid of spools, leakages and delays.
//! 3. [`equations`], [`least_squares`]: maximum likelihood with errors in all channels, from
//!    several starts (Pintelon and Schoukens 2012, Chapters 9 and 12).

pub mod bands;
pub mod equations;
pub mod friction;
mod lateness;
pub mod least_squares;
mod model_section;
pub mod replay;
pub mod simulation;
pub mod specimen;
pub mod start;
pub mod thesis_form;
pub mod valve;
pub mod velocity;

use nalgebra::DMatrix;

use self::bands::Bands;
use self::equations::{EQUATIONS, Equations, HydraulicRig, PARAMETERS};
use self::friction::{SHAPE, SealShape, Searched};
use self::least_squares::{Coordinate, Optimum, minimise};
use self::specimen::SpecimenFit;
use self::valve::Valve;
use plant::identified::valve_curve::ValveCurve;
use recordings::IdentificationError;
use recordings::{Channel, Recording, mean_and_deviation};

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Frequencies between which the equations are fitted, Hz.
    pub band: (f64, f64),
    /// Whether a dry friction of the seals is looked for.
    pub friction: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            band: (0.05, 35.0),
            friction: true,
        }
    }
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// The rig.
    pub rig: HydraulicRig,
    /// Its standard errors, in the order of [`equations::NAMES`].
    pub standard_error: [f64; PARAMETERS],
    /// Covariance of the rig's parameters.
    pub covariance: DMatrix<f64>,
    /// Payload of each further experiment over the first, kg.
    pub payloads: Vec<f64>,
    /// Shape of the friction.
    pub shape: SealShape,
    /// The valve, where it is not an ideal one.
    pub valve: Option<Valve>,
    /// Mean squares of the whitened equations: one for a rig that obeys them.
    pub mean_squares: [f64; EQUATIONS],
    /// The specimen, where one stood on the table.
    pub specimen: Option<SpecimenFit>,
    /// Whether the search came to its end.
    pub converged: bool,
    /// One standard deviation of the noise of displacement (m), acceleration (m/s²), actuator force
    /// (N), specimen acceleration (m/s²; zero without) and command (V), by what is rough in them.
    pub noise: [f64; 5],
    /// Sampling period of the first recording, s.
    pub period: f64,
    /// Everything the reader should know, the gravest first.
    pub warnings: Vec<String>,
}

impl Found {
    /// What its equations hold as histories.
    fn histories(&self) -> Histories {
        Histories {
            shape: Some(self.shape),
            valve: self.valve.as_ref().map(|own| (self.rig, own.curve)),
        }
    }

    /// The opening of its valve by the position of its spool.
    pub fn curve(&self) -> ValveCurve {
        self.valve
            .as_ref()
            .map_or_else(ValveCurve::default, |own| own.curve)
    }

    /// Whether the rig obeys its equations: their residual is mostly noise.
    pub fn holds(&self) -> bool {
        const MOST: f64 = 3.0;
        self.mean_squares.iter().all(|square| *square < MOST)
    }
}

/// What of a rig goes into its equations as a history of its own.
#[derive(Debug, Clone, Copy, Default)]
struct Histories {
    /// Dry friction of this shape.
    shape: Option<SealShape>,
    /// The opening of this valve behind the spool of this rig.
    valve: Option<(HydraulicRig, ValveCurve)>,
}

/// Inertia of a spool of 250 Hz, s²: what is quicker is a lag.
const LEAST_INERTIA: f64 = 4.05e-7;

/// Channels of a recording as the equations take them.
struct Channels<'a> {
    recording: &'a Recording,
    velocity: Vec<f64>,
}

const NEEDED: &str = "valve_command, displacement, acceleration, actuator_force and, with a \
                      specimen, specimen_acceleration";

impl<'a> Channels<'a> {
    fn new(recording: &'a Recording) -> Result<Self, IdentificationError> {
        let x = recording.require(Channel::Displacement, NEEDED)?;
        let a = recording.require(Channel::Acceleration, NEEDED)?;
        Ok(Self {
            recording,
            velocity: velocity::velocity(x, a, recording.period())?,
        })
    }

    /// The band of the fit, Hz.
    fn band(&self, settings: &Settings) -> (f64, f64) {
        let highest = 0.35 / self.recording.period();
        (settings.band.0, settings.band.1.min(highest))
    }

    fn bands(
        &self,
        histories: Histories,
        settings: &Settings,
        specimen: bool,
    ) -> Result<Bands, IdentificationError> {
        let recording = self.recording;
        let period = recording.period();
        let command = recording.require(Channel::ValveCommand, NEEDED)?;
        let reference = recording.channel(Channel::Reference).unwrap_or(command);
        let band = self.band(settings);
        let nothing = vec![0.0; recording.len()];
        let mut friction = vec![nothing.clone(); 1 + SHAPE];
        // The friction that the reference alone would have made: instruments for its harmonics.
        let mut instruments = Vec::new();
        let mut opening = nothing.clone();
        if let Some((rig, curve)) = &histories.valve {
            opening = valve::distortion(rig, curve, command, period);
            let wanted = bands::explained(reference, command, period, band)?;
            instruments.push(valve::distortion(rig, curve, &wanted, period));
        }
        if let Some(shape) = histories.shape {
            friction = shape.histories(&self.velocity, period);
            let wanted = bands::explained(reference, &self.velocity, period, band)?;
            instruments.extend(shape.histories(&wanted, period));
        }
        let mut channels = vec![
            command,
            recording.require(Channel::Displacement, NEEDED)?,
            recording.require(Channel::Acceleration, NEEDED)?,
            recording.require(Channel::ActuatorForce, NEEDED)?,
            &friction[0],
        ];
        channels.push(if specimen {
            recording.require(Channel::SpecimenAcceleration, NEEDED)?
        } else {
            &nothing
        });
        channels.extend(friction[1..].iter().map(Vec::as_slice));
        channels.push(&opening);
        let mut causes = vec![reference];
        causes.extend(instruments.iter().map(Vec::as_slice));
        Bands::new(&recording.name, &causes, &channels, period, band)
    }
}

/// How recordings that were not fitted obey a rig's equations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Mean squares of the whitened equations (motion, table, actuator).
    pub mean_squares: [f64; EQUATIONS],
    /// What is left of each equation over its largest term.
    pub relative_errors: [f64; EQUATIONS],
}

/// Checks `found` on other recordings with the same payloads.
///
/// # Errors
/// Recordings that make no bands, see [`IdentificationError`].
pub fn check(
    found: &Found,
    recordings: &[Recording],
    settings: Settings,
) -> Result<Check, IdentificationError> {
    let specimen = found.rig.specimen_mass > 0.0;
    let mut experiments = Vec::new();
    for recording in recordings {
        let channels = Channels::new(recording)?;
        experiments.push(channels.bands(found.histories(), &settings, specimen)?);
    }
    let equations = Equations {
        experiments,
        held: None,
        shape: None,
    };
    let mut values = found.rig.coordinates().to_vec();
    values.extend([0.0; SHAPE]);
    values.extend(&found.payloads);
    let nothing = [f64::NAN; EQUATIONS];
    Ok(Check {
        mean_squares: equations.mean_squares(&values).unwrap_or(nothing),
        relative_errors: equations.relative_errors(&values).unwrap_or(nothing),
    })
}

/// Identifies a hydraulic rig from recordings of one rig.
///
/// # Errors
/// Every way in which data give no model, see [`IdentificationError`].
pub fn identify(
    recordings: &[Recording],
    settings: Settings,
) -> Result<Found, IdentificationError> {
    for recording in recordings {
        refuse_clipped(recording)?;
    }
    let channels: Vec<Channels> = recordings
        .iter()
        .map(Channels::new)
        .collect::<Result<_, _>>()?;
    let specimen = recordings
        .iter()
        .all(|r| r.channel(Channel::SpecimenAcceleration).is_some());
    let with = |histories: Histories| -> Result<Equations, IdentificationError> {
        let experiments = channels
            .iter()
            .map(|c| c.bands(histories, &settings, specimen))
            .collect::<Result<_, _>>()?;
        Ok(Equations {
            experiments,
            held: None,
            shape: histories.shape,
        })
    };
    let bands = |shape| with(Histories { shape, valve: None });
    let root_mean_square = |of: &dyn Fn(&Channels) -> f64| {
        let sum: f64 = channels.iter().map(|c| of(c).powi(2)).sum();
        (sum / channels.len().max(1) as f64).sqrt()
    };
    let size = |channel: Channel| {
        root_mean_square(&|c: &Channels| {
            c.recording
                .channel(channel)
                .map_or(0.0, |v| mean_and_deviation(v).1)
        })
    };
    let (way, force) = (size(Channel::Displacement), size(Channel::ActuatorForce));

    let mut shape = SealShape {
        presliding: 0.01 * way,
        excess: 0.2,
        stribeck_velocity: 4e-3,
        sharpness: 3.0,
        relaxation: 0.0,
    };
    let mut equations = bands(settings.friction.then_some(shape))?;
    let ratio = start::motion_ratio(&equations.experiments);
    if !(0.6..1.6).contains(&ratio) {
        return Err(IdentificationError::Unstable {
            what: format!(
                "`acceleration` is {ratio:.3e} times the second derivative of `displacement` \
                 instead of once"
            ),
            remedy: "check the units in the header, the signs, and that no channels are swapped"
                .into(),
        });
    }
    let (table, payloads) = start::table(&equations.experiments, specimen)?;
    let mut best: Option<Optimum> = None;
    for rig in start::actuators(&equations.experiments, &table)? {
        let coordinates = coordinates(&rig, &payloads, force, specimen, settings.friction);
        if let Some(optimum) = approach(&equations, &coordinates)
            && best.as_ref().is_none_or(|b| optimum.cost < b.cost)
        {
            best = Some(optimum);
        }
    }
    let Some(mut optimum) = best else {
        return Err(IdentificationError::NotConverged {
            method: "the fit of the hydraulic rig",
            reason: "no start value gives a model".into(),
        });
    };
    if settings.friction {
        let refit = |shape: SealShape, from: &Optimum, free: bool| {
            let trial = bands(Some(shape)).ok()?;
            let rig = HydraulicRig::at(&from.values)?;
            let mut own = coordinates(
                &rig,
                &from.values[PARAMETERS + SHAPE..],
                force,
                specimen,
                true,
            );
            for coordinate in &mut own[PARAMETERS..PARAMETERS + SHAPE] {
                coordinate.free = free;
            }
            Some((approach(&trial, &own)?, trial))
        };
        for part in [0.002, 0.05] {
            let trial = SealShape {
                presliding: part * way,
                ..shape
            };
            if let Some((found, own)) = refit(trial, &optimum, false)
                && found.cost < optimum.cost
            {
                (optimum, equations, shape) = (found, own, trial);
            }
        }
        for round in 0..2 {
            for _ in 0..6 {
                let Some((found, own)) = refit(shape, &optimum, true) else {
                    break;
                };
                let changes = found.values[PARAMETERS..PARAMETERS + SHAPE].to_vec();
                (optimum, equations) = (found, own);
                shape = shape.changed(&changes);
                if changes.iter().all(|c| c.abs() < 0.03) {
                    break;
                }
            }
            // As long as the friction's shape was not known spool and delay may have been mistaken.
            let rivals = lateness::divisions(&optimum.values);
            if round > 0 || rivals.is_empty() {
                break;
            }
            let own = refit(shape, &optimum, false);
            let rivals = rivals.iter().filter_map(|rig| {
                let mut from = optimum.clone();
                from.values[..PARAMETERS].copy_from_slice(&rig.coordinates());
                refit(shape, &from, false)
            });
            let Some((rival, other)) = rivals.min_by(|a, b| a.0.cost.total_cmp(&b.0.cost)) else {
                break;
            };
            if own.is_some_and(|(own, _)| own.cost <= rival.cost) {
                break;
            }
            (optimum, equations) = (rival, other);
        }
    }
    let rig = HydraulicRig::at(&optimum.values).unwrap_or(table);
    let mean_squares = equations
        .mean_squares(&optimum.values)
        .unwrap_or([f64::NAN; EQUATIONS]);
    // Where the rig does more than its equations the errors are larger than their noise says.
    let excess = mean_squares.iter().copied().fold(1.0, f64::max);
    let slopes = rig.slopes();
    let covariance = DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| {
        excess * optimum.covariance[(i, j)] * slopes[i] * slopes[j]
    });
    let floor = |channel: Channel| {
        let own = channels.first().and_then(|c| c.recording.channel(channel));
        own.map_or(0.0, velocity::noise_floor)
    };
    let mut found = Found {
        rig,
        standard_error: std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt()),
        covariance,
        payloads: optimum.values[PARAMETERS + SHAPE..].to_vec(),
        shape,
        valve: None,
        mean_squares,
        specimen: specimen.then(|| carried(&channels, &equations)).flatten(),
        converged: optimum.converged,
        noise: [
            Channel::Displacement,
            Channel::Acceleration,
            Channel::ActuatorForce,
            Channel::SpecimenAcceleration,
            Channel::ValveCommand,
        ]
        .map(floor),
        period: channels.first().map_or(0.0, |c| c.recording.period()),
        warnings: Vec::new(),
    };
    if settings.friction {
        let again = |shape| bands(Some(shape)).ok();
        found.replay_friction(recordings, &optimum.values, &again);
        let refit = |own: &Found| {
            let equations = with(own.histories()).ok()?;
            let start = coordinates(&own.rig, &own.payloads, force, specimen, true);
            Some((approach(&equations, &start)?, equations))
        };
        found.replay_valve(recordings, &refit);
    }
    refuse_nonsense(&found.rig)?;
    found.warnings = remarks(&found, recordings);
    Ok(found)
}

/// Refuses a recording whose channels stay at their limits: it says nothing of what is beyond.
fn refuse_clipped(recording: &Recording) -> Result<(), IdentificationError> {
    /// Samples in a row at the largest or smallest value that are no chance, and the part of all samples that is
    /// too much.
    const RUN: usize = 4;
    const MOST: f64 = 0.05;
    let channels = [
        Channel::ValveCommand,
        Channel::Displacement,
        Channel::Acceleration,
        Channel::ActuatorForce,
    ];
    for channel in channels {
        let Some(values) = recording.channel(channel) else {
            continue;
        };
        let (low, high) = values
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        let (mut run, mut clipped) = (0, 0);
        for value in values {
            run = if *value == low || *value == high {
                run + 1
            } else {
                0
            };
            clipped += match run {
                0..RUN => 0,
                RUN => RUN,
                _ => 1,
            };
        }
        if clipped as f64 > MOST * values.len() as f64 {
            let percent = 100.0 * clipped as f64 / values.len() as f64;
            return Err(IdentificationError::Unreadable {
                recording: recording.name.clone(),
                what: format!(
                    "`{}` is clipped at {low:.4} or {high:.4} (SI) in {clipped} of {} samples \
                     ({percent:.0} %)",
                    channel.name(),
                    values.len()
                ),
                expected: "at most 5 % of the samples at a limit: record a smaller motion, or with \
                           a larger range of the channel",
            });
        }
    }
    Ok(())
}

/// Refuses a rig whose oil column is none.
fn refuse_nonsense(rig: &HydraulicRig) -> Result<(), IdentificationError> {
    let hertz = (rig.oil_stiffness / rig.mass).sqrt() / std::f64::consts::TAU;
    if (0.05..2000.0).contains(&hertz) {
        return Ok(());
    }
    Err(IdentificationError::Unstable {
        what: format!(
            "oil stiffness {:.2e} N/m under {:.3} kg resonates at {hertz:.1e} Hz",
            rig.oil_stiffness, rig.mass
        ),
        remedy: "check the units in the header, and record a minute or longer with more motion \
                 between 0.1 and 30 Hz"
            .into(),
    })
}

/// What a reader should know of a result.
fn remarks(found: &Found, recordings: &[Recording]) -> Vec<String> {
    const CLEAR: f64 = 1.6;
    let mut all = Vec::new();
    let names = ["motion", "table", "actuator"];
    for (name, square) in names.iter().zip(found.mean_squares) {
        if square > CLEAR {
            all.push(format!(
                "the residual of the {name}'s equation is not only noise (mean square {square:.2} \
                 times the noise): the model lacks an effect of the rig; the standard errors are \
                 widened by {:.1}",
                square.sqrt()
            ));
        }
    }
    if let Some(valve) = &found.valve {
        all.push(format!(
            "the valve is not an ideal one ({}): with it the replay's error is {:.0} % of that with \
             an ideal valve",
            valve.causes().join(", "),
            100.0 * valve.improvement
        ));
    }
    if !found.converged {
        all.push(
            "the fit did not converge: the friction's shape is not determined; also record a slow \
             triangle of some tenths of an inch"
                .into(),
        );
    }
    for recording in recordings {
        if recording.channel(Channel::Reference).is_none() {
            all.push(format!(
                "{}: no `reference` is recorded; the command is used instead, so noise on the \
                 recorded command and feedback bias the result without notice",
                recording.name
            ));
        }
    }
    let (scale, error) = (found.rig.accelerometer_scale, found.standard_error[14]);
    if (scale - 1.0).abs() > 0.02 + 4.0 * error {
        all.push(format!(
            "the accelerometer shows {scale:.3} of the displacement's second derivative: calibrate \
             one of the two"
        ));
    }
    all
}

/// The specimen of the recordings.
fn carried(channels: &[Channels], equations: &Equations) -> Option<SpecimenFit> {
    let [damping, stiffness] = start::specimen(&equations.experiments)?;
    let of = |channel: Channel| -> Option<Vec<&[f64]>> {
        channels
            .iter()
            .map(|c| c.recording.channel(channel))
            .collect()
    };
    let period = channels.first()?.recording.period();
    let (base, mass) = (
        of(Channel::Acceleration)?,
        of(Channel::SpecimenAcceleration)?,
    );
    specimen::fit(&base, &mass, period, damping, stiffness)
}

/// Fits with the residuals' covariance held where the fit before ended, twice, and then going with
/// the rig: from far away the latter may fit noise to the signal.
fn approach(equations: &Equations, coordinates: &[Coordinate]) -> Option<Optimum> {
    let mut own = coordinates.to_vec();
    let mut held = equations.clone();
    for _ in 0..2 {
        held.held = Some(own.iter().map(|c| c.start).collect());
        let found = minimise(&held, &own)?;
        for (coordinate, value) in own.iter_mut().zip(found.values) {
            coordinate.start = value;
        }
    }
    minimise(equations, &own)
}

/// The fit's coordinates from `rig`; forces are of the size of `force` (N).
fn coordinates(
    rig: &HydraulicRig,
    payloads: &[f64],
    force: f64,
    specimen: bool,
    friction: bool,
) -> Vec<Coordinate> {
    let critical = (rig.oil_stiffness * rig.mass).sqrt();
    let stiffness = rig.stiffness.abs().max(rig.mass * 10.0);
    let scale = [
        1e-3,
        1e-6,
        0.1,
        0.1,
        0.3,
        0.1 * critical,
        0.1 * force,
        0.1,
        0.1 * (stiffness * rig.mass).sqrt(),
        0.1 * stiffness,
        0.1 * rig.mass,
        1e-3,
        1e-3,
        1e-3,
        0.01,
    ];
    let mut all: Vec<Coordinate> = rig
        .coordinates()
        .iter()
        .zip(scale)
        .map(|(&start, scale)| Coordinate {
            start,
            scale,
            free: true,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
        })
        .collect();
    // Dampings and friction take no negative values.
    for i in [0, 5, 6, 8, 11] {
        all[i].bounds.0 = 0.0;
    }
    all[1].bounds.0 = LEAST_INERTIA;
    for coordinate in &mut all {
        coordinate.start = coordinate.start.max(coordinate.bounds.0);
    }
    all[6].free = friction;
    all[10].free = specimen;
    all.extend((0..SHAPE).map(|_| Coordinate {
        start: 0.0,
        scale: 0.1,
        free: false,
        bounds: (-0.5, 0.5),
    }));
    // Relaxation, ms.
    all[PARAMETERS + SHAPE - 1].scale = 0.3;
    all[PARAMETERS + SHAPE - 1].bounds = (-2.0, 2.0);
    all.extend(payloads.iter().map(|&start| Coordinate {
        start,
        scale: 0.1 * rig.mass,
        free: true,
        bounds: (-0.9 * rig.mass, f64::INFINITY),
    }));
    all
}
