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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use crate::run::experiment::Request;

    fn limits(hydraulics: Option<Hydraulics>) -> Limits {
        Limits {
            displacement: 0.1,
            stopping: 0.05,
            velocity: 0.5,
            acceleration: 10.0,
            force: 5000.0,
            mass: 1000.0,
            hydraulics,
        }
    }

    fn motion(displacement: &[f64], velocity: &[f64], acceleration: &[f64]) -> Motion {
        Motion {
            displacement: displacement.to_vec(),
            velocity: velocity.to_vec(),
            acceleration: acceleration.to_vec(),
            ..made::wave("wave", 0)
        }
    }

    fn share(all: &[Use], name: &str) -> (f64, f64) {
        let own = all.iter().find(|own| own.limit == name).unwrap();
        (own.share, own.time_s)
    }

    #[test]
    fn a_motion_uses_its_largest_part_of_each_limit_at_its_time() {
        let motion = motion(&[0.0, -0.04, 0.02], &[0.1, -0.4, 0.3], &[2.0, 1.0, -3.0]);
        let all = limits(None).used(&motion, 0.5);
        let near = |name: &str, wanted: f64, sample: usize| {
            let (found, time) = share(&all, name);
            assert!((found - wanted).abs() < 1e-12, "{name}: {found}");
            assert!(
                (time - 0.002 * sample as f64).abs() < 1e-12,
                "{name}: {time} s"
            );
        };
        near("displacement", 0.2, 1);
        near("stopping distance", 0.5 * (0.04 + 0.4 * 0.05) / 0.1, 1);
        near("velocity", 0.4, 1);
        near("acceleration", 0.15, 2);
        near("force", 1000.0 * 1.5 / 5000.0, 2);
        let shares: Vec<f64> = all.iter().map(|own| own.share).collect();
        assert!(shares.windows(2).all(|two| two[0] >= two[1]), "{shares:?}");
        assert_eq!(all.len(), 5);
    }

    #[test]
    fn of_equal_peaks_the_first_is_told() {
        let motion = motion(&[0.0, -0.04, 0.04], &[0.0; 3], &[0.0, 2.0, -2.0]);
        let all = limits(None).used(&motion, 1.0);
        for limit in ["displacement", "acceleration"] {
            let (_, time) = share(&all, limit);
            assert_eq!(time, motion.dt, "{limit}");
        }
        // What is not used at all is so from the beginning.
        assert_eq!(share(&all, "velocity"), (0.0, 0.0));
    }

    #[test]
    fn valve_and_flow_are_used_by_velocity_and_load() {
        let own = Hydraulics {
            area: 0.01,
            coefficient: 1e-7,
            command: 10.0,
            pressure: 2e7,
            flow: 0.002,
            flow_time: 0.004,
        };
        let motion = motion(&[0.0; 2], &[0.2, -0.2], &[1.0, 4.0]);
        let all = limits(Some(own.clone())).used(&motion, 1.0);
        // The load takes pressure where it drives, and gives some where it brakes.
        let valve = |a: f64| 0.01 * 0.2 / (1e-7 * 10.0 * (0.5 * (2e7 - a * 1000.0 / 0.01)).sqrt());
        let (found, time) = share(&all, "valve");
        assert!(
            (found - valve(1.0)).abs() < 1e-9 && time == 0.0,
            "{found} at {time} s"
        );
        // The mean of a level from rest: 1 - exp(-t/T) of it.
        let part = 1.0 - (-0.004_f64 / 0.004).exp();
        let (found, _) = share(&all, "flow");
        assert!((found - part * 0.01 * 0.2 / 0.002).abs() < 1e-9, "{found}");
        let none = Hydraulics { flow: 0.0, ..own };
        assert!(
            limits(Some(none))
                .used(&motion, 1.0)
                .iter()
                .all(|own| own.limit != "flow")
        );
    }

    #[test]
    fn the_level_uses_85_percent_of_the_first_limit_rounded_down() {
        let small = motion(&[0.01], &[0.0], &[0.0]);
        assert_eq!(limits(None).level(&small), (1.0, None));
        let large = motion(&[0.3], &[0.0], &[0.0]);
        // 0.085 / 0.3 = 0.2833..., to three digits.
        let (level, limit) = limits(None).level(&large);
        assert!((level - 0.283).abs() < 1e-12, "{level}");
        assert!(["displacement", "stopping distance"].contains(&limit.as_deref().unwrap()));
        let fast = motion(&[0.0], &[0.0], &[20.0]);
        assert_eq!(limits(None).level(&fast).1.as_deref(), Some("force"));
    }

    #[test]
    fn limits_are_those_of_the_manifest_or_of_the_laboratory() {
        let mut manifest = made::manifest(&Request::built_in("mpc"), &made::wave("wave", 3));
        let usual = Interlock::laboratory();
        let own = Limits::of(&manifest);
        assert_eq!(
            (own.displacement(), own.force),
            (usual.displacement_limit, usual.force_limit)
        );
        // Table and specimen.
        assert_eq!((own.mass, own.hydraulics), (600.0, None));
        let mut interlock = manifest.components["control"].clone();
        interlock.parameters = [
            ("displacement_limit", 0.05),
            ("reaction_time", 0.1),
            ("ramp_time", 0.3),
            ("saturation_level", 9.0),
        ]
        .map(|(name, value)| (name.to_string(), (value.into(), None)))
        .into();
        manifest.components.insert("interlock".into(), interlock);
        let table = manifest.components.get_mut("table").unwrap();
        for (name, value) in [
            ("piston_area", 0.01),
            ("flow_coefficient", 1e-7),
            (vocabulary::PUMP_PRESSURE, 2e7),
        ] {
            table.parameters.insert(name.into(), (value.into(), None));
        }
        let own = Limits::of(&manifest);
        assert_eq!((own.displacement(), own.stopping), (0.05, 0.1 + 0.5 * 0.3));
        let hydraulics = own.hydraulics.unwrap();
        assert_eq!(
            (hydraulics.area, hydraulics.command, hydraulics.pressure),
            (0.01, 9.0, 2e7)
        );
        assert_eq!(hydraulics.flow, usual.flow_limit);
    }
}
