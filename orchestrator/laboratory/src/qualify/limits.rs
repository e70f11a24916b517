//! What a rig can play: stroke, stopping distance, velocity, acceleration, force, valve and flow.

use controllers::interlock::Interlock;
use motion::Motion;
use serde::{Deserialize, Serialize};
use units::vocabulary;

use crate::run::manifest::Manifest;

/// Part of a limit that a motion may use before its drive is corrected.
const MARGIN: f64 = 0.85;

/// Limits of a rig, SI: those of its interlock, or of the laboratory's where it has none, and those of its
/// valve and supply where the plant has them.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    displacement: f64,
    /// Time in which a stopping table goes on at its velocity, s.
    stopping: f64,
    velocity: f64,
    acceleration: f64,
    force: f64,
    /// Moving mass, kg.
    mass: f64,
    hydraulics: Option<Hydraulics>,
}

#[derive(Debug, Clone, PartialEq)]
struct Hydraulics {
    /// m².
    area: f64,
    /// m³/(s V √Pa).
    coefficient: f64,
    /// V.
    command: f64,
    /// Pa.
    pressure: f64,
    /// Mean flow, m³/s; 0 for none.
    flow: f64,
    /// Time of that mean, s.
    flow_time: f64,
}

/// The share of a limit that a motion uses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Use {
    /// Its name.
    pub limit: String,
    /// The largest value over the limit.
    pub share: f64,
    /// When, s.
    pub time_s: f64,
}

impl Limits {
    /// Of the system that a manifest describes.
    #[must_use]
    pub fn of(manifest: &Manifest) -> Self {
        let value = |component: &str, name: &str| {
            let component = manifest.components.get(component)?;
            component.parameters.get(name)?.0.as_f64()
        };
        let laboratory = Interlock::laboratory();
        let lock = |name: &str, usual: f64| value("interlock", name).unwrap_or(usual);
        let specimen = value("specimen", "mass").or(value("specimen", vocabulary::SPECIMEN_MASS));
        let hydraulics = || {
            Some(Hydraulics {
                area: value("table", "piston_area")?,
                coefficient: value("table", "flow_coefficient")?,
                command: lock("saturation_level", laboratory.saturation_level),
                pressure: value("table", vocabulary::PUMP_PRESSURE)?,
                flow: lock("flow_limit", laboratory.flow_limit),
                flow_time: lock("flow_time", laboratory.flow_time),
            })
        };
        Self {
            displacement: lock("displacement_limit", laboratory.displacement_limit),
            stopping: lock("reaction_time", laboratory.reaction_time)
                + 0.5 * lock("ramp_time", laboratory.ramp_time),
            velocity: lock("velocity_limit", laboratory.velocity_limit),
            acceleration: lock("acceleration_limit", laboratory.acceleration_limit),
            force: lock("force_limit", laboratory.force_limit),
            mass: value("table", vocabulary::TABLE_MASS).unwrap_or(0.0) + specimen.unwrap_or(0.0),
            hydraulics: hydraulics(),
        }
    }

    /// Largest displacement, m.
    #[must_use]
    pub fn displacement(&self) -> f64 {
        self.displacement
    }

    /// How much of each limit `level` times a motion uses, the most used first.
    #[must_use]
    pub fn used(&self, motion: &Motion, level: f64) -> Vec<Use> {
        let of = |limit: &str, share: &mut dyn FnMut(f64, f64, f64) -> f64| {
            let mut most = (0.0, 0);
            let length = motion.velocity.len().min(motion.acceleration.len());
            for n in 0..motion.len().min(length) {
                let [x, v, a] = [
                    motion.displacement[n],
                    motion.velocity[n],
                    motion.acceleration[n],
                ];
                let now = share(level * x, level * v, level * a);
                if now > most.0 {
                    most = (now, n);
                }
            }
            Use {
                limit: limit.to_string(),
                share: most.0,
                time_s: most.1 as f64 * motion.dt,
            }
        };
        let mut all = vec![
            of("displacement", &mut |x, _, _| x.abs() / self.displacement),
            of("stopping distance", &mut |x, v, _| {
                (x + v * self.stopping).abs() / self.displacement
            }),
            of("velocity", &mut |_, v, _| v.abs() / self.velocity),
            of("acceleration", &mut |_, _, a| a.abs() / self.acceleration),
            of("force", &mut |_, _, a| self.mass * a.abs() / self.force),
        ];
        if let Some(own) = &self.hydraulics {
            all.push(of("valve", &mut |_, v, a| {
                // The pressure that is left for the edges when the load's is taken away.
                let load = self.mass * a * v.signum() / own.area;
                let left = (0.5 * (own.pressure - load)).max(1.0);
                own.area * v.abs() / (own.coefficient * own.command * left.sqrt())
            }));
            if own.flow > 0.0 {
                let (mut mean, part) = (0.0, 1.0 - (-motion.dt / own.flow_time).exp());
                all.push(of("flow", &mut |_, v, _| {
                    mean += part * (own.area * v.abs() - mean);
                    mean / own.flow
                }));
            }
        }
        all.sort_by(|one, other| other.share.total_cmp(&one.share));
        all
    }

    /// The largest level, at most 1, at which a motion uses at most 0.85 of every limit, to three digits and
    /// rounded down; and the limit that it would exceed at 1.
    #[must_use]
    pub fn level(&self, motion: &Motion) -> (f64, Option<String>) {
        let most = |level: f64| {
            self.used(motion, level)
                .first()
                .map_or(0.0, |own| own.share)
        };
        if most(1.0) <= MARGIN {
            return (1.0, None);
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if most(middle) <= MARGIN {
                low = middle;
            } else {
                high = middle;
            }
        }
        let name = self.used(motion, high).first().map(|own| own.limit.clone());
        let digits = 10_f64.powf(2.0 - low.log10().floor());
        ((low * digits).floor() / digits, name)
    }
}
