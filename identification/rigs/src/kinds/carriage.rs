//! Carriage of a motor-driven axis: motor voltage to position.
//!
//! `M v' = G u - F_v v - F_c sgn v - o` (Janot, Gautier and Brunot, Data set and reference models of
//! EMPS, 2019), and the effects that such axes have. The voltage is held from sample to sample.

use super::hypotheses::Inside;
use super::table::{effects, shape, size};

/// Steps of a sample.
const STEPS: usize = 2;
/// Most samples by which the voltage may be late.
const LATEST: usize = 64;
/// Samples while moving that a ripple is looked for in: at least, and about as many at most.
const FEWEST: usize = 1000;
const LOOKED_AT: usize = 10_000;
/// Periods that fits of a ripple begin from.
const PEAKS: usize = 4;
/// Damping ratio of a flexible load.
const FLEXIBLE_DAMPING: f64 = 0.05;

effects! {
    /// F± = (F_v (1 ± a) |v| + F_c) sgn v + o: friction of a worn screw (Janot, Gautier and
    /// Brunot 2019, section 4). The nominal offset is the Coulomb part of the asymmetry.
    asymmetric_friction: AsymmetricFriction {
        viscous_asymmetry: size("1", 0.03, (-0.9, 0.9)),
    } from [[0.1], [-0.1]];
    /// F_c (1 + s e^{-|v|/v_s}): s > 0 is Stribeck's fall, s < 0 a friction that builds up
    /// with speed (Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994).
    speed_dependent_coulomb: SpeedDependentCoulomb {
        excess: size("1", 0.03, (-0.99, 3.0)),
        speed: shape("m/s", 0.01, 1.0),
    } from [[0.2, 0.01], [-0.3, 0.01]];
    /// A cos(2π q / p) + B sin(2π q / p): screw and motor poles.
    force_ripple: ForceRipple {
        cosine: size("N", 0.2, (-20.0, 20.0)),
        sine: size("N", 0.2, (-20.0, 20.0)),
        period: shape("m", 5e-3, 1.5),
    } from [[0.5, 0.5, 5e-3]];
    /// Current loop: T F' = G u - F.
    actuation_lag: ActuationLag {
        time_constant: size("s", 1e-4, (0.0, 0.02)),
    } from [[5e-4]], like ["delay"];
    /// u acts late.
    delay: Delay {
        delay: size("s", 1e-4, (0.0, 0.02)),
    } from [[5e-4]], like ["actuation_lag"];
    /// F_c (1 + c (q - q_0)), q_0 in the middle of the travel: misalignment.
    position_dependent_friction: PositionDependentFriction {
        slope: size("1/m", 0.1, (-5.0, 5.0)),
    } from [[0.3], [-0.3]];
    /// -D |v| v.
    quadratic_drag: QuadraticDrag {
        drag: size("N s2/m2", 20.0, (-2000.0, 2000.0)),
    } from [[100.0], [-100.0]];
    /// Load on a spring: a share m of the mass hangs on k and d = 2 ζ (k m)^{1/2}, ζ = 0.05.
    flexibility: Flexibility {
        share: size("1", 0.02, (0.0, 0.9)),
        frequency: shape("rad/s", 300.0, 0.7),
    } from [[0.1, 150.0], [0.1, 400.0]];
}

/// Nominal parameters of the mechanics, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mechanics {
    /// M.
    pub mass: f64,
    /// F_v.
    pub viscous: f64,
    /// F_c.
    pub coulomb: f64,
    /// o.
    pub offset: f64,
    /// G.
    pub force_gain: f64,
    /// Of a spring about the position zero.
    pub stiffness: f64,
}

/// The carriage while it moves.
#[derive(Debug, Clone)]
pub struct Carriage<'a> {
    mechanics: Mechanics,
    effects: &'a Effects,
    /// Sampling period, s.
    sample: f64,
    /// Middle of the travel, m.
    pub middle: f64,
    /// Shift of the position's zero against the screw, m.
    pub screw_shift: f64,
    /// Position of the motor's side, m.
    pub position: f64,
    speed: f64,
    load_position: f64,
    load_speed: f64,
    /// Of the motor; not a number before the first sample.
    force: f64,
    /// Voltages that may still be on their way, the newest at the place of its sample.
    voltages: [f64; LATEST + 2],
    now: usize,
}

impl<'a> Carriage<'a> {
    /// A carriage at `position` that moves with `speed`; `before` are the voltages until then, if there
    /// are any, the newest at the end.
    pub fn new(
        mechanics: Mechanics,
        effects: &'a Effects,
        sample: f64,
        (position, speed): (f64, f64),
        before: &[f64],
    ) -> Self {
        let mut voltages = [f64::NAN; LATEST + 2];
        let count = voltages.len();
        for (ago, u) in before.iter().rev().take(count - 1).enumerate() {
            voltages[count - 1 - ago] = *u;
        }
        Self {
            mechanics,
            effects,
            sample,
            middle: 0.0,
            screw_shift: 0.0,
            position,
            speed,
            load_position: position,
            load_speed: speed,
            force: f64::NAN,
            voltages,
            now: 0,
        }
    }

    /// Moves through the sample in which the voltage `u` is held.
    pub fn advance(&mut self, u: f64) {
        self.advance_with(u, 0.0, &mut Inside::default());
    }

    /// As [`Self::advance`] from `time` (s), with forces on what moves.
    pub fn advance_with(&mut self, u: f64, time: f64, inside: &mut Inside<'_>) {
        let Mechanics {
            mass,
            viscous,
            coulomb,
            offset,
            force_gain,
            stiffness,
        } = self.mechanics;
        let Effects {
            asymmetric_friction: AsymmetricFriction { viscous_asymmetry },
            speed_dependent_coulomb:
                SpeedDependentCoulomb {
                    excess,
                    speed: slow,
                },
            force_ripple:
                ForceRipple {
                    cosine,
                    sine,
                    period,
                },
            actuation_lag: ActuationLag { time_constant: lag },
            delay: Delay { delay },
            position_dependent_friction: PositionDependentFriction { slope },
            quadratic_drag: QuadraticDrag { drag },
            flexibility: Flexibility { share, frequency },
        } = *self.effects;
        let h = self.sample / STEPS as f64;
        let load = share * mass;
        let motor = mass - load;
        let spring = load * frequency * frequency;
        let damper = 2.0 * FLEXIBLE_DAMPING * load * frequency;
        let keep = if lag > 1e-6 { (-h / lag).exp() } else { 0.0 };
        let late = (delay / self.sample).clamp(0.0, LATEST as f64);
        let ring = self.voltages.len();
        if self.force.is_nan() {
            // Before the first known voltage stood the same.
            let unknown = self.voltages.iter_mut().filter(|old| old.is_nan());
            unknown.for_each(|old| *old = u);
            self.force = force_gain * self.voltages[ring - 1];
        }
        let now = self.now;
        self.voltages[now % ring] = u;
        for step in 0..STEPS {
            // Held from sample to sample: what acts in this step began to act this many samples ago
            // at its begin and at its end.
            let from = late - step as f64 / STEPS as f64;
            let to = from - 1.0 / STEPS as f64;
            let held =
                |ago: f64| self.voltages[(now + ring - (ago.ceil().max(0.0) as usize)) % ring];
            let (older, newer) = (held(from), held(to));
            // Share of the step until the newer one arrives.
            let until = ((from - to.ceil().max(0.0)) * STEPS as f64).clamp(0.0, 1.0);
            let wanted = force_gain * (until * older + (1.0 - until) * newer);
            self.force = keep * self.force + (1.0 - keep) * wanted;
            let mut drive = self.force - offset - stiffness * self.position;
            let time = time + step as f64 * h;
            if !inside.has_no_force() {
                inside.begin(h, time, self.position, self.speed);
                drive += inside.force(0.0, time, self.position, self.speed);
            }
            if cosine != 0.0 || sine != 0.0 {
                let angle = std::f64::consts::TAU * (self.position - self.screw_shift) / period;
                drive -= cosine * angle.cos() + sine * angle.sin();
            }
            if load > 0.0 {
                let pull = spring * (self.load_position - self.position)
                    + damper * (self.load_speed - self.speed);
                self.load_speed -= h / load * pull;
                self.load_position += h * self.load_speed;
                drive += pull;
            }
            // Farther out than the records went it does not drive.
            let mut level = coulomb * (1.0 + slope * (self.position - self.middle)).max(0.0);
            if excess != 0.0 {
                level *= 1.0 + excess * (-self.speed.abs() / slow).exp();
            }
            // Implicit in the friction, so that it holds at standstill.
            let free = self.speed + h / motor * drive;
            let side = free.signum();
            let threshold = h / motor * level;
            let linear = viscous * (1.0 + side * viscous_asymmetry) + drag * self.speed.abs();
            self.speed = if free.abs() > threshold {
                (free - side * threshold) / (1.0 + h / motor * linear)
            } else {
                0.0
            };
            self.position += h * self.speed;
            inside.end(h, time, self.position, self.speed);
        }
        self.now += 1;
    }
}

/// Starts of a ripple, from the `errors` of a model without it over `position`.
pub fn ripple_starts(
    coulomb: f64,
    position: &[f64],
    errors: &[f64],
) -> Vec<(&'static str, Vec<f64>)> {
    let size = 0.02 * coulomb.max(f64::MIN_POSITIVE);
    let periods = strongest_periods(position, errors).into_iter();
    let phases = [(size, size), (-size, size), (size, -size), (-size, -size)];
    periods
        .flat_map(|period| phases.map(|(c, s)| ("force_ripple", vec![c, s, period])))
        .collect()
}

/// Periods of the sines over position that explain most of `errors` where the drive moves: peaks of a
/// periodogram over uneven positions (Lomb, Astrophysics and Space Science 39, 1976), forward and
/// backward by themselves, since a loop answers late.
fn strongest_periods(position: &[f64], errors: &[f64]) -> Vec<f64> {
    let low = position.iter().copied().fold(f64::INFINITY, f64::min);
    let high = position.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let travel = high - low;
    let moving = |k: usize| {
        let (before, after) = (k.saturating_sub(5), (k + 5).min(position.len() - 1));
        position[after] - position[before]
    };
    let samples: Vec<(f64, f64, bool)> = errors
        .iter()
        .enumerate()
        .filter(|(k, e)| e.is_finite() && moving(*k).abs() > 1e-4 * travel)
        .map(|(k, e)| (position[k], *e, moving(k) > 0.0))
        .collect();
    if travel.is_nan() || travel <= 0.0 || samples.len() < FEWEST {
        return Vec::new();
    }
    let mean = samples.iter().map(|s| s.1).sum::<f64>() / samples.len() as f64;
    let every = samples.len().div_ceil(LOOKED_AT);
    let power = |cycles: f64| {
        let mut sums = [0.0; 4];
        for (q, e, forward) in samples.iter().step_by(every) {
            let (sine, cosine) = (std::f64::consts::TAU * cycles * (q - low) / travel).sin_cos();
            let side = 2 * usize::from(*forward);
            sums[side] += (e - mean) * cosine;
            sums[side + 1] += (e - mean) * sine;
        }
        sums.iter().map(|s| s * s).sum::<f64>()
    };
    // From ten to two hundred cycles over the travel, in quarters of a cycle.
    let powers: Vec<(f64, f64)> = (40..800)
        .map(|quarters| f64::from(quarters) / 4.0)
        .map(|cycles| (cycles, power(cycles)))
        .collect();
    let mut peaks: Vec<(f64, f64)> = powers
        .windows(3)
        .filter(|w| w[1].1 > w[0].1 && w[1].1 > w[2].1)
        .map(|w| w[1])
        .collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let strongest = peaks.iter().take(PEAKS);
    strongest.map(|(cycles, _)| travel / cycles).collect()
}

/// Slope of the least-squares line through `positions`, at their begin.
pub fn start_speed(positions: &[f64], sample: f64) -> f64 {
    let n = positions.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let (mut top, mut bottom) = (0.0, 0.0);
    for (i, position) in positions.iter().enumerate() {
        top += (i as f64 - middle) * position;
        bottom += (i as f64 - middle).powi(2);
    }
    top / bottom / sample
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::super::EffectTable;
    use super::*;

    impl Carriage<'_> {
        /// The same behind samples of `voltages`.
        fn advanced(mut self, voltages: &[f64]) -> Self {
            voltages.iter().for_each(|u| self.advance(*u));
            self
        }
    }

    const MECHANICS: Mechanics = Mechanics {
        mass: 2.0,
        viscous: 6.0,
        coulomb: 5.0,
        offset: 1.0,
        force_gain: 10.0,
        stiffness: 0.0,
    };
    const SAMPLE: f64 = 1e-3;

    /// Speed and position of a carriage that began with 0.5 m/s, after samples under 3 V.
    fn driven(mechanics: Mechanics, samples: usize, set: impl Fn(&mut Effects)) -> (f64, f64) {
        let mut effects = Effects::off().unwrap();
        set(&mut effects);
        let mut carriage = Carriage::new(mechanics, &effects, SAMPLE, (0.0, 0.5), &[]);
        (0..samples).for_each(|_| carriage.advance(3.0));
        (carriage.speed, carriage.position)
    }

    fn near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
    }

    /// `2 v' = 30 - 6 v - 5 - 1` from 0.5 m/s: to 4 m/s within a third of a second.
    #[test]
    fn a_carriage_reaches_its_speed_by_its_mass_and_friction() {
        for samples in [100, 400, 3000] {
            let t = SAMPLE * samples as f64;
            let left = (-3.0 * t).exp();
            let (speed, position) = driven(MECHANICS, samples, |_| ());
            near(speed, 4.0 - 3.5 * left);
            near(position, 4.0 * t - 3.5 * (1.0 - left) / 3.0);
        }
        // Less than friction and offset leaves it at rest.
        let none = Effects::off().unwrap();
        let at_rest = Carriage::new(MECHANICS, &none, SAMPLE, (0.3, 0.0), &[]);
        let mut carriage = at_rest.advanced(&[0.5, -0.3]);
        assert_eq!((carriage.speed, carriage.position), (0.0, 0.3));
        carriage.advance(0.7);
        assert!(carriage.speed > 0.0);
    }

    /// Where the drive of 24 N beside the Coulomb friction meets the rest.
    #[test]
    fn a_steady_speed_balances_each_effect() {
        let speed = |set: fn(&mut Effects)| driven(MECHANICS, 8000, set).0;
        near(
            speed(|e| e.asymmetric_friction.viscous_asymmetry = 0.2),
            24.0 / 7.2,
        );
        // 6 v + 4 v^2 = 24.
        near(
            speed(|e| e.quadratic_drag.drag = 4.0),
            (-6.0 + (36.0_f64 + 16.0 * 24.0).sqrt()) / 8.0,
        );
        // Far above 10 m/s it would be gone; at the balance v it is 5 (1 + 0.8 e^(-v/10)).
        let v = speed(|e| {
            e.speed_dependent_coulomb = SpeedDependentCoulomb {
                excess: 0.8,
                speed: 10.0,
            };
        });
        near(6.0 * v + 5.0 * (1.0 + 0.8 * (-0.1 * v).exp()), 29.0);
        // A lag and a delay take of the way what the speed makes in their time.
        let way = |set: fn(&mut Effects)| {
            let mut effects = Effects::off().unwrap();
            set(&mut effects);
            let at_rest = Carriage::new(MECHANICS, &effects, SAMPLE, (0.0, 0.0), &[0.0; 65]);
            at_rest.advanced(&[3.0; 4000]).position
        };
        let whole = way(|_| ());
        near(whole - way(|e| e.delay.delay = 12.5e-3), 12.5e-3 * 4.0);
        // Until the force is 6 N, after `T ln(30 / 24)`, it does not move at all. Within half of a step's way.
        let behind = whole - way(|e| e.actuation_lag.time_constant = 0.02);
        let expected = 4.0 * 0.02 * (1.0 + (30.0_f64 / 24.0).ln());
        let step = 4.0 * SAMPLE / STEPS as f64;
        assert!(
            (behind - expected).abs() < 0.6 * step,
            "{behind} {expected}"
        );
    }

    /// On a spring of 800 N/m without friction, and with a quarter of the mass on a spring of its own.
    #[test]
    fn a_spring_and_a_load_swing_at_their_frequencies() {
        let free = Mechanics {
            viscous: 0.0,
            coulomb: 0.0,
            offset: 0.0,
            stiffness: 800.0,
            ..MECHANICS
        };
        // 20 rad/s about 30 N / 800 N/m: from 0.5 m/s.
        for samples in [50, 111, 200] {
            let (sin, cos) = (20.0 * SAMPLE * samples as f64).sin_cos();
            let (speed, position) = driven(free, samples, |_| ());
            let expected = 0.0375 * (1.0 - cos) + 0.025 * sin;
            assert!((position - expected).abs() < 5e-4, "{position} {expected}");
            let expected = 0.75 * sin + 0.5 * cos;
            assert!((speed - expected).abs() < 0.02, "{speed} {expected}");
        }
        // With a load the common motion is that of the whole mass: `2 v' = 30`.
        let loose = Mechanics {
            stiffness: 0.0,
            ..free
        };
        let mut effects = Effects::off().unwrap();
        effects.flexibility = Flexibility {
            share: 0.25,
            frequency: 60.0,
        };
        let begun = Carriage::new(loose, &effects, SAMPLE, (0.0, 0.5), &[]);
        let own = begun.advanced(&[3.0; 1000]);
        near(own.speed, 0.5 + 15.0);
        near(own.position, 0.5 + 7.5);
        // The load hangs back by its acceleration over `w^2`.
        let back = (own.position - own.load_position) * 60.0 * 60.0;
        assert!((back - 15.0).abs() < 0.3, "{back}");
    }

    #[test]
    fn the_speed_of_a_begin_is_the_slope_of_its_line() {
        let line: Vec<f64> = (0..7).map(|k| 0.2 + 0.03 * f64::from(k)).collect();
        assert!((start_speed(&line, 0.01) - 3.0).abs() < 1e-12);
        // What turns about the line does not count.
        let turned = [0.0, 1.0, 1.0, 0.0];
        assert_eq!(start_speed(&turned, 0.5), 0.0);
    }

    /// 40 cycles over a travel of 0.2 m, forward and backward.
    #[test]
    fn a_ripple_is_looked_for_where_its_period_is() {
        let turn = |k: usize| 0.1 * (1.0 - (TAU * k as f64 / 4000.0).cos());
        let position: Vec<f64> = (0..4000).map(turn).collect();
        let errors: Vec<f64> = position
            .iter()
            .map(|q| 3.0 + (TAU * q / 5e-3 + 0.4).sin())
            .collect();
        let starts = ripple_starts(50.0, &position, &errors);
        let (name, first) = &starts[0];
        assert_eq!((*name, first[0], first[1]), ("force_ripple", 1.0, 1.0));
        near(first[2], 5e-3);
        let signs: Vec<[f64; 2]> = starts[..4].iter().map(|own| [own.1[0], own.1[1]]).collect();
        assert_eq!(signs, [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]);
        assert!(ripple_starts(50.0, &[0.1; 4000], &errors).is_empty());
        assert!(ripple_starts(50.0, &position[..900], &errors[..900]).is_empty());
    }

    #[test]
    fn friction_that_falls_along_the_travel_never_drives() {
        // At 2 m the line through the fitted travel would be at minus the Coulomb friction.
        let mut effects = Effects::off().unwrap();
        effects.position_dependent_friction.slope = -1.0;
        let mechanics = Mechanics {
            mass: 1.0,
            viscous: 0.1,
            coulomb: 5.0,
            offset: 0.0,
            force_gain: 1.0,
            stiffness: 0.0,
        };
        let mut carriage = Carriage::new(mechanics, &effects, 1e-3, (2.0, 0.1), &[]);
        for _ in 0..2000 {
            carriage.advance(0.0);
        }
        assert!(
            carriage.speed >= 0.0 && carriage.speed < 0.1,
            "{}",
            carriage.speed
        );
    }
}
