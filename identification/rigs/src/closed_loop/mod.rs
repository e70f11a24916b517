//! Identification of hydraulic rigs from closed-loop recordings, with the reference as instrument.
//!
//! 1. [`bands`]: every channel is projected on the reference, band by band.
//! 2. [`start`]: linear regressions over a grid of spools, leakages and delays.
//! 3. [`equations`], [`sysid::nonlinear`]: maximum likelihood with errors in all channels, from
//!    several starts (Pintelon and Schoukens 2012, Chapters 9 and 12).
//! 4. [`replay`], [`valve`]: the recorded command on the simulated rig, for the friction and for what the valve lacks
//!    to an ideal one.

pub mod bands;
pub mod equations;
mod fitting;
pub mod friction;
mod lateness;
#[cfg(test)]
mod made;
mod model_section;
pub mod replay;
mod seals;
pub mod simulation;
pub mod specimen;
pub mod start;
pub mod thesis_form;
pub mod valve;
pub mod velocity;

use nalgebra::DMatrix;

use self::bands::Bands;
use self::equations::{EQUATIONS, Equations, HydraulicRig, PARAMETERS};
use self::fitting::Fitting;
use self::friction::{SHAPE, SealShape, Searched};
use self::specimen::SpecimenFit;
use self::valve::Valve;
use plant::identified::valve_curve::ValveCurve;
use recordings::IdentificationError;
use recordings::clipping::Clipped;
use recordings::{Channel, Recording, mean_and_deviation};

/// How to identify.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Frequencies between which the equations are fitted, Hz.
    pub band: (f64, f64),
    /// Whether a dry friction of the seals is looked for.
    pub friction: bool,
    /// Whether the recorded command is replayed for the friction and the valve; otherwise the equations say all.
    pub replay: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            band: (0.05, 35.0),
            friction: true,
            replay: true,
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
            let (mean, _) = mean_and_deviation(command);
            let mut wanted = bands::explained(reference, command, period, band)?;
            wanted.iter_mut().for_each(|value| *value += mean);
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
    let equations = Equations::new(experiments, None);
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
    let fitting = Fitting::new(recordings, settings)?;
    let histories = Histories {
        shape: settings.friction.then_some(fitting.usual_shape()),
        valve: None,
    };
    let equations = fitting.equations(histories)?;
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
    let (table, payloads) = start::table(&equations.experiments, fitting.specimen)?;
    let first = fitting.started(equations, histories, &table, &payloads)?;
    let fit = fitting.with_friction(first);
    let equations = fit.equations.clone();
    let mut found = fitting.found(fit);
    if settings.friction && settings.replay {
        let lapped = fitting.lapped(&equations, &found.rig);
        if let (Err(_), Some((rig, _))) = (refuse_nonsense(&found.rig), lapped.first()) {
            // Lost flow was taken for soft oil: there is a rig only if its valve is found.
            let mut own = Found {
                rig: *rig,
                ..found.clone()
            };
            own.replay_valve(recordings, &lapped, &fitting);
            if own.valve.is_some() {
                found = own;
            }
        } else {
            found.replay_friction(recordings, &fitting);
            found.replay_valve(recordings, &lapped, &fitting);
        }
    }
    refuse_nonsense(&found.rig)?;
    found.warnings = remarks(&found, recordings);
    Ok(found)
}

/// Refuses a recording whose channels stay at their limits: it says nothing of what is beyond.
fn refuse_clipped(recording: &Recording) -> Result<(), IdentificationError> {
    /// The part of all samples that is too much.
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
        let Clipped {
            samples: clipped,
            extremes: [low, high],
            ..
        } = Clipped::of(values, f64::INFINITY);
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
