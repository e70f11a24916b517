//! A frame of one or two storeys on a table, with a device such as a damper between table and first floor.
//!
//! Motion of the table and command of the device to the drift of the first storey. The drift of the second and the
//! force of the device are compared as well where the data hold them.
//!
//! Nominal, with drifts d_1, d_2, base acceleration a_g and force F of the device:
//! `m_1 (d_1'' + a_g) = F_0 - k_1 d_1 - c_1 d_1' - F + k_2 d_2 + c_2 d_2'`,
//! `m_2 (d_2'' + d_1'' + a_g) = - k_2 d_2 - c_2 d_2'`,
//! `F = c d_1' + (F_d + g w) z`, `z' = d_1' / s - z |d_1'| / s` (Dahl 1968) with the command w. Mechanics are
//! integrated by the velocity Verlet method, friction exactly over each of its steps.
//!
//! A recorded force of another device acts as it is (`device_force`) in place of F.
//!
//! Effects are counted in natural units: the deviation X of the drift, the force k_1 X, the time (m_1/k_1)^{1/2},
//! the deviation of the command.

use super::between::between;
use super::friction::Friction;
use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Equations, Natural, RigRecording};
use recordings::Channel;

/// The rig.
pub struct Frame;

const DRIFT: Channel = Channel::Other {
    name: "drift",
    unit: "m",
};
const UPPER_DRIFT: Channel = Channel::Other {
    name: "upper_drift",
    unit: "m",
};
const FORCE: Channel = Channel::Other {
    name: "force",
    unit: "N",
};
const DEVICE_FORCE: Channel = Channel::Other {
    name: "device_force",
    unit: "N",
};
const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "V",
};

/// Radians of the fastest oscillation in a step at most, and steps in a sample.
const RADIANS: f64 = 0.25;
const STEPS: usize = 16;

nominal_parameters! {
    /// m_1: of the first floor.
    mass: "kg",
    /// k_1: of the first storey.
    stiffness: "N/m",
    /// c_1: of the first storey.
    damping: "N s/m",
    /// Friction in the first storey.
    friction: "N" = 0.0,
    /// m_2: of the second floor; 0 without one.
    upper_mass: "kg" = 0.0,
    /// k_2: of the second storey.
    upper_stiffness: "N/m" = 0.0,
    /// c_2: of the second storey.
    upper_damping: "N s/m" = 0.0,
    /// F_d: friction of the device without a command.
    device_friction: "N" = 0.0,
    /// g: growth of that friction with the command.
    friction_by_command: "N/V" = 0.0,
    /// c: of the device.
    device_damping: "N s/m" = 0.0,
    /// s: displacement over which every friction builds up.
    build_up: "m" = 0.0005,
    /// F_0: steady force on the first floor, such as of a table out of level.
    offset: "N" = 0.0,
}

session_parameters! {
    /// Of the drift's transducer.
    zero: "m" within 0.5 as Setup,
    /// Of the upper drift's.
    upper_zero: "m" within 0.5 as Setup,
    /// Of the load cell.
    force_zero: "N" within 0.5 as Setup,
    /// Drift at the first sample, at rest.
    start: "m" within 0.3 as Start,
}

effects! {
    /// The friction of the device creeps, - r z, and yields at once and not little by little: by |z|^p z |d_1'| / s
    /// while it grows and by nothing where it falls.
    device_creep: DeviceCreep {
        rate: size("1/s", 0.05, (0.0, 300.0)),
        exponent: shape("1", 4.0, 0.7),
    } from [[2.0, 4.0], [10.0, 4.0]];
    /// The damping of the device grows with the command.
    damping_by_command: DampingByCommand {
        growth: size("N s/m/V", 0.01, (-30.0, 30.0)),
    } from [[0.1], [-0.1]];
    /// Friction in the second storey.
    upper_friction: UpperFriction {
        force: size("N", 0.005, (0.0, 30.0)),
    } from [[0.1], [0.3]];
    /// A force P d_1 / (|d_1| + d_0) back to the middle: the storey is stiffer there.
    centring: Centring {
        force: size("N", 0.01, (-30.0, 30.0)),
        width: shape("m", 0.3, 1.0),
    } from [[0.3, 0.3], [-0.1, 0.3]];
    /// k_3 d_1^3: grows or falls with drift.
    cubic_stiffness: CubicStiffness {
        stiffness: size("N/m3", 0.003, (-3.0, 30.0)),
    } from [[0.01], [-0.01]];
    /// c_2 |d_1'| d_1': damping of the first storey that grows with speed.
    quadratic_damping: QuadraticDamping {
        damping: size("N s2/m2", 0.002, (-10.0, 10.0)),
    } from [[0.01], [-0.01]];
    /// The table moves (1 + a) of what was recorded.
    motion_gain: MotionGain {
        share: size("1", 0.005, (-0.9, 2.0)),
    } from [[0.03], [-0.03]];
    /// The motion of the table was recorded late by T, or early.
    motion_delay: MotionDelay {
        delay: size("s", 0.01, (-1.0, 1.0)),
    } from [[0.05], [-0.05]];
    /// The force of the device was recorded late by T, or early.
    force_delay: ForceDelay {
        delay: size("s", 0.01, (-1.0, 1.0)),
    } from [[0.05], [-0.05]];
}

/// Drifts, speeds, and the shares of friction taken up in the device and the storeys.
#[derive(Clone, Copy, Default)]
struct State {
    drift: [f64; 2],
    speed: [f64; 2],
    device: f64,
    friction: [f64; 2],
}

struct Law<'a> {
    nominal: &'a Nominal,
    effects: &'a Effects,
    has_upper: bool,
    device_friction: Friction,
    storey_friction: Friction,
}

impl Law<'_> {
    /// Force of the device at the command `w`.
    fn device(&self, s: &State, w: f64) -> f64 {
        let n = self.nominal;
        let damping = n.device_damping + self.effects.damping_by_command.growth * w;
        let friction = n.device_friction + n.friction_by_command * w;
        damping * s.speed[0] + friction.max(0.0) * s.device
    }

    /// Force of the first storey's springs.
    fn spring(&self, drift: f64) -> f64 {
        let (n, e) = (self.nominal, self.effects);
        let centring = e.centring.force * drift / (drift.abs() + e.centring.width);
        drift * (n.stiffness + e.cubic_stiffness.stiffness * drift * drift) + centring
    }

    /// Second derivatives of the drifts under the `base` acceleration and the `device`'s force.
    fn slope(&self, s: &State, base: f64, device: f64) -> [f64; 2] {
        let (n, e) = (self.nominal, self.effects);
        let v = s.speed[0];
        let damping = n.damping + e.quadratic_damping.damping * v.abs();
        let mut held = n.offset - self.spring(s.drift[0]) - damping * v - device;
        held -= n.friction * s.friction[0];
        if !self.has_upper {
            return [held / n.mass - base, 0.0];
        }
        let upper = n.upper_stiffness * s.drift[1]
            + n.upper_damping * s.speed[1]
            + e.upper_friction.force * s.friction[1];
        let floor = (held + upper) / n.mass;
        [floor - base, -upper / n.upper_mass - floor]
    }

    /// Friction over `h` at the speeds of `s`.
    fn rub(&self, s: &mut State, h: f64) {
        s.device = self.device_friction.after(s.device, h * s.speed[0], h);
        for i in 0..2 {
            s.friction[i] = self.storey_friction.after(s.friction[i], h * s.speed[i], h);
        }
    }

    /// Steps that a sample of length `h` needs, for commands up to `most`.
    fn steps(&self, h: f64, most: f64) -> usize {
        let (n, e) = (self.nominal, self.effects);
        let device = n.device_friction + n.friction_by_command * most;
        let upper = n.upper_stiffness + e.upper_friction.force / n.build_up;
        let floor = n.stiffness
            + upper
            + (n.friction + device.max(0.0)) / n.build_up
            + e.centring.force.max(0.0) / e.centring.width;
        let mut fastest = floor / n.mass;
        if self.has_upper {
            fastest += upper / n.upper_mass;
        }
        ((h * fastest.sqrt() / RADIANS).ceil() as usize).clamp(2, STEPS)
    }
}

impl Equations for Frame {
    const KIND: &'static str = "frame";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[Channel::Acceleration];
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[
        (Channel::Displacement, &[]),
        (COMMAND, &["damping_by_command"]),
        (DEVICE_FORCE, &[]),
    ];
    const OUTPUT: Channel = DRIFT;
    const ALSO: &'static [Channel] = &[UPPER_DRIFT, FORCE];
    const IS_SCALED: bool = true;
    const SCREENED: usize = 8192;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let law = Law {
            nominal,
            effects,
            has_upper: nominal.upper_mass > 0.0,
            device_friction: Friction {
                build_up: nominal.build_up,
                creep: effects.device_creep.rate,
                exponent: effects.device_creep.exponent,
            },
            storey_friction: Friction {
                build_up: nominal.build_up,
                creep: 0.0,
                exponent: 0.0,
            },
        };
        let base = recording.input(Channel::Acceleration);
        let (command, given) = (recording.input(COMMAND), recording.input(DEVICE_FORCE));
        let (samples, period) = (base.len(), recording.period());
        let most = command.iter().copied().fold(0.0, f64::max);
        let steps = law.steps(period, most);
        let h = period / steps as f64;
        let delay = effects.motion_delay.delay / period;
        let moved = |place: f64| (1.0 + effects.motion_gain.share) * between(base, place + delay);
        // What holds it where it starts is friction.
        let mut s = State::default();
        s.drift[0] = session.start;
        if nominal.friction > 0.0 {
            let pull = nominal.offset - law.spring(session.start);
            s.friction[0] = (pull / nominal.friction).clamp(-1.0, 1.0);
        }
        let simulated = samples.min(out.len());
        let mut forces = vec![0.0; simulated];
        let place_of = |channel: Channel| {
            let also = recording.also().iter();
            let found = also.enumerate().find(|(_, (own, _))| *own == channel);
            found.map(|(i, (_, size))| ((1 + i) * samples, *size))
        };
        let (upper, force) = (place_of(UPPER_DRIFT), place_of(FORCE));
        for k in 0..simulated {
            let w = command.get(k).copied().unwrap_or(0.0);
            let device = |s: &State, place: f64| {
                if given.is_empty() {
                    law.device(s, w)
                } else {
                    between(given, place)
                }
            };
            out[k] = s.drift[0] + session.zero;
            forces[k] = device(&s, k as f64);
            if let Some((from, size)) = upper
                && let Some(y) = out.get_mut(from + k)
            {
                *y = (s.drift[1] + session.upper_zero) / size;
            }
            let mut place = k as f64;
            let mut acting = moved(place);
            for _ in 0..steps {
                let slope = law.slope(&s, acting, device(&s, place));
                for i in 0..2 {
                    s.speed[i] += 0.5 * h * slope[i];
                    s.drift[i] += h * s.speed[i];
                }
                law.rub(&mut s, h);
                place += 1.0 / steps as f64;
                acting = moved(place);
                let slope = law.slope(&s, acting, device(&s, place));
                for i in 0..2 {
                    s.speed[i] += 0.5 * h * slope[i];
                }
            }
        }
        if let Some((from, size)) = force {
            let late = effects.force_delay.delay / period;
            for k in 0..simulated {
                if let Some(y) = out.get_mut(from + k) {
                    *y = (between(&forces, k as f64 - late) + session.force_zero) / size;
                }
            }
        }
    }

    fn natural(nominal: &Nominal, channels: Natural) -> Natural {
        Natural {
            force: nominal.stiffness * channels.length,
            time: (nominal.mass / nominal.stiffness).sqrt(),
            ..channels
        }
    }
}
