//! Motor-driven linear axis under its known two-loop controller: reference to motor voltage.
//!
//! Nominal: `M v' = G u - F_v v - F_c sgn v - o`, `u = k_p k_v (r - q) - k_v Δq/h`, sampled
//! (Janot, Gautier and Brunot, Data set and reference models of EMPS, 2019).

use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Equations, RigRecording};
use crate::data::Channel;

/// The rig.
pub struct PositioningDrive;

const POSITION: Channel = Channel::Other {
    name: "position",
    unit: "m",
};
const MOTOR_VOLTAGE: Channel = Channel::Other {
    name: "motor_voltage",
    unit: "V",
};

const STEPS: usize = 2;
/// Samples while moving that a ripple is looked for in: at least, and about as many at most.
const FEWEST: usize = 1000;
const LOOKED_AT: usize = 10_000;
/// Periods that fits of a ripple begin from.
const PEAKS: usize = 4;
/// Most samples by which the voltage may be late.
const LATEST: usize = 64;

nominal_parameters! {
    /// M: all that moves.
    mass: "kg",
    /// F_v.
    viscous_friction: "N s/m",
    /// F_c.
    coulomb_friction: "N",
    /// o: steady force against the motion forward.
    offset: "N",
    /// G: motor force over voltage.
    force_gain: "N/V",
    /// k_p of the position loop.
    position_gain: "1/s",
    /// k_v of the velocity loop.
    velocity_gain: "V s/m",
    /// Of the amplifier.
    voltage_limit: "V",
}

session_parameters! {
    /// Shift of the position's zero against the screw.
    screw_shift: "m" within 0.01 as AgainstFirst,
}

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

impl Equations for PositioningDrive {
    const KIND: &'static str = "positioning_drive";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[Channel::Reference, POSITION];
    const OUTPUT: Channel = MOTOR_VOLTAGE;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let Nominal {
            mass,
            viscous_friction: viscous,
            coulomb_friction: coulomb,
            offset,
            force_gain,
            position_gain: kp,
            velocity_gain: kv,
            voltage_limit: limit,
        } = *nominal;
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
        } = *effects;
        let (reference, position) = (
            recording.input(Channel::Reference),
            recording.input(POSITION),
        );
        if reference.len() < 8 || position.len() < 8 {
            return;
        }
        let sample = recording.period();
        let h = sample / STEPS as f64;
        // The record may begin in motion: where and how fast is measured, over eight samples.
        let mut q = position[0];
        let mut v = start_speed(&position[..8], sample);
        let mut before = q - v * sample;
        let middle = recording.middle;
        let (mut load_q, mut load_v) = (q, v);
        let load = share * mass;
        let motor = mass - load;
        let (spring, damper) = (load * frequency * frequency, 2.0 * 0.05 * load * frequency);
        let keep = if lag > 1e-6 { (-h / lag).exp() } else { 0.0 };
        let mut force = f64::NAN;
        // The voltages that may still be on their way, the newest at its sample's place.
        let mut voltages = [0.0; LATEST + 2];
        let late = (delay / sample).clamp(0.0, LATEST as f64);
        for (k, y) in out.iter_mut().enumerate() {
            let u =
                (kp * kv * (reference[k] - q) - kv * (q - before) / sample).clamp(-limit, limit);
            *y = u;
            before = q;
            if k == 0 {
                voltages.fill(u);
                force = force_gain * u;
            }
            let ring = voltages.len();
            voltages[k % ring] = u;
            for step in 0..STEPS {
                // Held from sample to sample: what acts in this step began to act this many samples
                // ago at its begin and at its end.
                let from = late - step as f64 / STEPS as f64;
                let to = from - 1.0 / STEPS as f64;
                let held = |ago: f64| voltages[(k + ring - (ago.ceil().max(0.0) as usize)) % ring];
                let (older, newer) = (held(from), held(to));
                // Share of the step until the newer one arrives.
                let until = ((from - to.ceil().max(0.0)) * STEPS as f64).clamp(0.0, 1.0);
                let wanted = force_gain * (until * older + (1.0 - until) * newer);
                force = keep * force + (1.0 - keep) * wanted;
                let mut drive = force - offset;
                if cosine != 0.0 || sine != 0.0 {
                    let angle = std::f64::consts::TAU * (q - session.screw_shift) / period;
                    drive -= cosine * angle.cos() + sine * angle.sin();
                }
                if load > 0.0 {
                    let pull = spring * (load_q - q) + damper * (load_v - v);
                    load_v -= h / load * pull;
                    load_q += h * load_v;
                    drive += pull;
                }
                let mut level = coulomb * (1.0 + slope * (q - middle));
                if excess != 0.0 {
                    level *= 1.0 + excess * (-v.abs() / slow).exp();
                }
                // Implicit in the friction, so that it holds at standstill.
                let free = v + h / motor * drive;
                let side = free.signum();
                let threshold = h / motor * level;
                let linear = viscous * (1.0 + side * viscous_asymmetry) + drag * v.abs();
                v = if free.abs() > threshold {
                    (free - side * threshold) / (1.0 + h / motor * linear)
                } else {
                    0.0
                };
                q += h * v;
            }
        }
    }

    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        let size = 0.02 * nominal.coulomb_friction.max(f64::MIN_POSITIVE);
        let periods = strongest_periods(recording.input(POSITION), errors).into_iter();
        let phases = [(size, size), (-size, size), (size, -size), (-size, -size)];
        periods
            .flat_map(|period| phases.map(|(c, s)| ("force_ripple", vec![c, s, period])))
            .collect()
    }
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
fn start_speed(positions: &[f64], sample: f64) -> f64 {
    let n = positions.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let (mut top, mut bottom) = (0.0, 0.0);
    for (i, position) in positions.iter().enumerate() {
        top += (i as f64 - middle) * position;
        bottom += (i as f64 - middle).powi(2);
    }
    top / bottom / sample
}
