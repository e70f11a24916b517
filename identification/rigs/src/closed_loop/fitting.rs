//! Fits of the equations: from linear regressions, with the friction's shape, and again behind a valve.

use nalgebra::DMatrix;
use rayon::prelude::*;

use plant::identified::valve_curve::ValveCurve;
use recordings::{Channel, IdentificationError, Recording, mean_and_deviation};

use super::equations::{EQUATIONS, Equations, HydraulicRig, PARAMETERS};
use super::friction::{SHAPE, SealShape, Searched};
use super::specimen::{self, SpecimenFit};
use super::{
    Channels, Found, Histories, LEAST_INERTIA, Settings, lateness, start, valve, velocity,
};
use sysid::nonlinear::{Coordinate, Derivatives, Effort, Optimum, WHOLE, minimise_with};

/// Overlaps over the command (rms) from which the search for one starts.
const OVERLAPS: [f64; 4] = [0.2, 0.4, 0.6, 0.9];
/// Least Coulomb force over the actuator's (rms), and least damping over that of the critical oil column, from which
/// the seals' start.
const SEALS: f64 = 0.05;
/// How a fit with a held covariance, and the one after it, is sought.
const APPROACHED: Effort = Effort {
    part: 1e-4,
    derivatives: Derivatives::Trusted,
    ..WHOLE
};
const FITTED: Effort = Effort {
    derivatives: Derivatives::Carried,
    ..WHOLE
};

/// A fit of the equations.
#[derive(Clone)]
pub(super) struct Fit {
    pub optimum: Optimum,
    pub equations: Equations,
    pub histories: Histories,
}

/// What equations are fitted to.
pub(super) struct Fitting<'a> {
    channels: Vec<Channels<'a>>,
    settings: Settings,
    /// Whether a specimen's acceleration is recorded.
    pub specimen: bool,
    /// Root mean squares of displacement (m), actuator force (N) and command (V).
    way: f64,
    force: f64,
    pub command: f64,
    /// Mean of the command, V: the spool's null has the other sign.
    null: f64,
}

impl<'a> Fitting<'a> {
    pub fn new(
        recordings: &'a [Recording],
        settings: Settings,
    ) -> Result<Self, IdentificationError> {
        let channels: Vec<Channels> = recordings
            .iter()
            .map(Channels::new)
            .collect::<Result<_, _>>()?;
        let count = channels.len().max(1) as f64;
        let of = |channel: Channel| {
            let all = channels.iter().filter_map(move |own| {
                let values = own.recording.channel(channel)?;
                Some(mean_and_deviation(values))
            });
            all.collect::<Vec<_>>()
        };
        let size = |channel: Channel| {
            let squares = of(channel).iter().map(|own| own.1 * own.1).sum::<f64>();
            (squares / count).sqrt()
        };
        let null = of(Channel::ValveCommand)
            .iter()
            .map(|own| own.0)
            .sum::<f64>()
            / count;
        Ok(Self {
            specimen: recordings
                .iter()
                .all(|r| r.channel(Channel::SpecimenAcceleration).is_some()),
            way: size(Channel::Displacement),
            force: size(Channel::ActuatorForce),
            command: size(Channel::ValveCommand),
            null,
            settings,
            channels,
        })
    }

    pub fn equations(&self, histories: Histories) -> Result<Equations, IdentificationError> {
        let experiments = self
            .channels
            .iter()
            .map(|own| own.bands(histories, &self.settings, self.specimen))
            .collect::<Result<_, _>>()?;
        Ok(Equations::new(experiments, histories.shape))
    }

    /// The shape from which the search of the friction's begins.
    pub fn usual_shape(&self) -> SealShape {
        SealShape {
            presliding: 0.01 * self.way,
            excess: 0.2,
            stribeck_velocity: 4e-3,
            sharpness: 3.0,
            relaxation: 0.0,
        }
    }

    /// An ideal valve, of which no more is known than where its null is.
    pub fn centred(&self) -> ValveCurve {
        ValveCurve {
            null_bias: -self.null,
            ..ValveCurve::default()
        }
    }

    /// The best fit from regressions; `table` gives the table, `payloads` the further experiments' (kg).
    pub fn started(
        &self,
        equations: Equations,
        histories: Histories,
        table: &HydraulicRig,
        payloads: &[f64],
    ) -> Result<Fit, IdentificationError> {
        let friction = self.settings.friction;
        let starts = start::actuators(&equations.experiments, table)?;
        let all = starts.iter().filter_map(|rig| {
            let own = coordinates(rig, payloads, self.force, self.specimen, friction);
            approach(&equations, &own)
        });
        let best = all.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let Some(optimum) = best else {
            return Err(IdentificationError::NotConverged {
                method: "the fit of the hydraulic rig",
                reason: "no start value gives a model".into(),
            });
        };
        Ok(Fit {
            optimum,
            equations,
            histories,
        })
    }

    /// The fit again from `from`, with other histories, and the friction's shape `free` or as it is.
    fn again(&self, from: &Optimum, histories: Histories, free: bool) -> Option<Fit> {
        let equations = self.equations(histories).ok()?;
        let rig = HydraulicRig::at(&from.values)?;
        let payloads = &from.values[PARAMETERS + SHAPE..];
        let mut own = coordinates(&rig, payloads, self.force, self.specimen, true);
        for coordinate in &mut own[PARAMETERS..PARAMETERS + SHAPE] {
            coordinate.free = free;
        }
        // What began near its end needs no approach.
        let optimum = if free {
            minimise_with(&equations, &own, FITTED)
        } else {
            approach(&equations, &own)
        };
        Some(Fit {
            optimum: optimum?,
            equations,
            histories,
        })
    }

    /// The fit of what was found, with what its equations hold as histories.
    pub fn refit(&self, found: &Found) -> Option<(Optimum, Equations)> {
        let equations = self.equations(found.histories()).ok()?;
        let own = coordinates(&found.rig, &found.payloads, self.force, self.specimen, true);
        Some((approach(&equations, &own)?, equations))
    }

    /// The fit with the friction's shape that its equations obey best.
    pub fn with_friction(&self, first: Fit) -> Fit {
        let mut best = first;
        let Some(usual) = best.histories.shape.filter(|_| self.settings.friction) else {
            return best;
        };
        let shaped = |histories: Histories, shape: SealShape| Histories {
            shape: Some(shape),
            ..histories
        };
        for part in [0.002, 0.05] {
            let trial = SealShape {
                presliding: part * self.way,
                ..usual
            };
            if let Some(found) = self.again(&best.optimum, shaped(best.histories, trial), false)
                && found.optimum.cost < best.optimum.cost
            {
                best = found;
            }
        }
        for round in 0..2 {
            for _ in 0..6 {
                let Some(found) = self.again(&best.optimum, best.histories, true) else {
                    break;
                };
                let changes = found.optimum.values[PARAMETERS..PARAMETERS + SHAPE].to_vec();
                let shape = best.histories.shape.unwrap_or(usual).changed(&changes);
                best = found;
                best.histories.shape = Some(shape);
                if changes.iter().all(|c| c.abs() < 0.03) {
                    break;
                }
            }
            // As long as the friction's shape was not known spool and delay may have been mistaken.
            let rivals = lateness::divisions(&best.optimum.values);
            if round > 0 || rivals.is_empty() {
                break;
            }
            let own = self.again(&best.optimum, best.histories, false);
            let rivals = rivals.iter().filter_map(|rig| {
                let mut from = best.optimum.clone();
                from.values[..PARAMETERS].copy_from_slice(&rig.coordinates());
                self.again(&from, best.histories, false)
            });
            let rival = rivals.min_by(|a, b| a.optimum.cost.total_cmp(&b.optimum.cost));
            let Some(rival) = rival else {
                break;
            };
            if own.is_some_and(|own| own.optimum.cost <= rival.optimum.cost) {
                break;
            }
            best = rival;
        }
        best
    }

    /// Rigs behind valves with overlap, and their valves, for the search to start from: all of an actuator is
    /// found again behind each overlap, for a fit of an ideal valve takes lost flow for soft oil and friction.
    pub fn lapped(
        &self,
        equations: &Equations,
        table: &HydraulicRig,
    ) -> Vec<(HydraulicRig, ValveCurve)> {
        let rigs = OVERLAPS.into_par_iter().filter_map(|part| {
            let curve = ValveCurve {
                overlap: part * self.command,
                ..self.centred()
            };
            let opened = |rig: &HydraulicRig| {
                let of = |own: &Channels| {
                    let command = own.recording.channel(Channel::ValveCommand)?;
                    Some(valve::opening(rig, &curve, command, own.recording.period()))
                };
                self.channels.iter().map(of).collect::<Option<Vec<_>>>()
            };
            let mut rig = start::behind(&equations.experiments, table, opened)?;
            // Both are searched as logarithms: without any none would be found.
            let critical = (rig.oil_stiffness * rig.mass).sqrt();
            rig.seal_friction = rig.seal_friction.max(SEALS * self.force);
            rig.seal_damping = rig.seal_damping.max(SEALS * critical);
            Some((rig, curve))
        });
        rigs.collect()
    }

    /// What a fit says of the rig.
    pub fn found(&self, fit: Fit) -> Found {
        let Fit {
            optimum,
            equations,
            histories,
        } = fit;
        let rig = HydraulicRig::at(&optimum.values).unwrap_or_else(start::empty);
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
            let own = self
                .channels
                .first()
                .and_then(|c| c.recording.channel(channel));
            own.map_or(0.0, velocity::noise_floor)
        };
        Found {
            rig,
            standard_error: std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt()),
            covariance,
            payloads: optimum.values[PARAMETERS + SHAPE..].to_vec(),
            shape: histories.shape.unwrap_or_else(|| self.usual_shape()),
            valve: None,
            mean_squares,
            specimen: self.specimen.then(|| self.carried(&equations)).flatten(),
            converged: optimum.converged,
            noise: [
                Channel::Displacement,
                Channel::Acceleration,
                Channel::ActuatorForce,
                Channel::SpecimenAcceleration,
                Channel::ValveCommand,
            ]
            .map(floor),
            period: self.channels.first().map_or(0.0, |c| c.recording.period()),
            warnings: Vec::new(),
        }
    }

    /// The specimen of the recordings.
    fn carried(&self, equations: &Equations) -> Option<SpecimenFit> {
        let [damping, stiffness] = start::specimen(&equations.experiments)?;
        let of = |channel: Channel| -> Option<Vec<&[f64]>> {
            self.channels
                .iter()
                .map(|c| c.recording.channel(channel))
                .collect()
        };
        let period = self.channels.first()?.recording.period();
        let (base, mass) = (
            of(Channel::Acceleration)?,
            of(Channel::SpecimenAcceleration)?,
        );
        specimen::fit(&base, &mass, period, damping, stiffness)
    }
}

/// Fits with the residuals' covariance held where the fit before ended, twice, and then going with
/// the rig: from far away the latter may fit noise to the signal.
fn approach(equations: &Equations, coordinates: &[Coordinate]) -> Option<Optimum> {
    let mut own = coordinates.to_vec();
    for _ in 0..2 {
        let start: Vec<f64> = own.iter().map(|c| c.start).collect();
        let held = equations.holding(&start)?;
        let found = minimise_with(&held, &own, APPROACHED)?;
        for (coordinate, value) in own.iter_mut().zip(found.values) {
            coordinate.start = value;
        }
    }
    minimise_with(equations, &own, FITTED)
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
