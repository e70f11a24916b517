//! Motor-driven linear axis under its known two-loop controller: reference to motor voltage.
//!
//! Nominal: `M v' = G u - F_v v - F_c sgn v - o`, `u = k_p k_v (r - q) - k_v Δq/h`, sampled
//! (Janot, Gautier and Brunot, Data set and reference models of EMPS, 2019).

use super::table::{effects, nominal_parameters, shape, size};
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
/// Nominal leads of ball screws, m (ISO 3408-2).
const LEADS: [f64; 12] = [
    1e-3, 1.25e-3, 2e-3, 2.5e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3, 10e-3, 12e-3, 20e-3,
];

nominal_parameters! {
    mass: "kg",
    viscous_friction: "N s/m",
    coulomb_friction: "N",
    offset: "N",
    force_gain: "N/V",
    position_gain: "1/s",
    velocity_gain: "V s/m",
    voltage_limit: "V",
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
        period: shape("m", 3e-3, 1.0),
    } from LEADS.map(|lead| [0.5, 0.5, lead]);
    /// Current loop: T F' = G u - F.
    actuation_lag: ActuationLag {
        time_constant: size("s", 1e-4, (0.0, 0.02)),
    } from [[5e-4]], like ["delay"];
    /// u acts late.
    delay: Delay {
        delay: size("s", 1e-4, (0.0, 2e-3)),
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
    const INPUTS: &'static [Channel] = &[Channel::Reference, POSITION];
    const OUTPUT: Channel = MOTOR_VOLTAGE;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
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
        let mut last = 0.0;
        for (k, y) in out.iter_mut().enumerate() {
            let u =
                (kp * kv * (reference[k] - q) - kv * (q - before) / sample).clamp(-limit, limit);
            *y = u;
            before = q;
            if k == 0 {
                last = u;
                force = force_gain * u;
            }
            for step in 0..STEPS {
                // The voltage of the last sample acts until the delay is over.
                let (from, to) = (step as f64 * h, (step + 1) as f64 * h);
                let late = ((delay - from) / (to - from)).clamp(0.0, 1.0);
                let wanted = force_gain * (late * last + (1.0 - late) * u);
                force = keep * force + (1.0 - keep) * wanted;
                let mut drive = force - offset;
                if cosine != 0.0 || sine != 0.0 {
                    let angle = std::f64::consts::TAU * q / period;
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
            last = u;
        }
    }
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
