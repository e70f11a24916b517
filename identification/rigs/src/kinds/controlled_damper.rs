//! Damper, perhaps with a magnet or a valve that a voltage commands: displacement and velocity to
//! force.
//!
//! Nominal: `f = c v + k x + F_0` (Spencer, Dyke, Sain and Carlson, J. Eng. Mech. 123, 1997, compare
//! such models of a magnetorheological damper).
//!
//! Effects are counted in natural units: the standard deviations of displacement, velocity, force and
//! command.

use super::between::between;
use super::friction::Friction;
use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Equations, Natural, RigRecording};
use recordings::Channel;

/// The rig.
pub struct ControlledDamper;

const FORCE: Channel = Channel::Other {
    name: "force",
    unit: "N",
};
const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "V",
};

nominal_parameters! {
    /// c.
    damping: "N s/m",
    /// k: of an accumulator or the like.
    stiffness: "N/m" = 0.0,
    /// F_0: steady force.
    offset: "N" = 0.0,
}

session_parameters! {
    /// Of the load cell; of the first file the offset tells it.
    zero: "N" within 0.02 as AgainstFirst,
    /// Share of the friction that is taken up at the first sample.
    taken_up: "1" within 0.5 as Start,
}

effects! {
    /// A friction z F_h that builds up over a displacement: z' = v (1 - z sgn v) / d (Dahl 1968).
    hysteretic_friction: HystereticFriction {
        force: size("N", 0.01, (0.0, 30.0)),
        build_up: shape("m", 0.05, 1.0),
    } from [[0.1, 0.05], [0.5, 0.05], [0.5, 0.2]];
    /// That friction creeps and yields at once and not little by little: z' = v / d (1 - |z|^p z sgn v) - r z while
    /// it grows, z' = v / d - r z where it falls.
    friction_creep: FrictionCreep {
        rate: size("1/s", 0.05, (0.0, 300.0)),
        exponent: shape("1", 4.0, 0.7),
    } from [[2.0, 4.0], [10.0, 4.0]];
    /// The friction grows with the command, F_h (1 + g (w - 1 V)): F_h is that at one volt.
    friction_by_command: FrictionByCommand {
        growth: size("1/V", 0.02, (-3.0, 3.0)),
    } from [[0.1], [0.5]];
    /// The damping grows with the command, c + g w.
    damping_by_command: DampingByCommand {
        growth: size("N s/m/V", 0.01, (-30.0, 30.0)),
    } from [[0.05], [0.3]];
    /// What the command does follows it with T w' = u - w: inductance of a magnet, eddy currents.
    command_lag: CommandLag {
        time_constant: size("s", 0.02, (0.0, 10.0)),
    } from [[0.2], [1.0]];
    /// What the command does saturates, w / (1 + s w).
    command_saturation: CommandSaturation {
        curvature: size("1/V", 0.02, (0.0, 10.0)),
    } from [[0.1]];
    /// The damping falls with speed, c v / (1 + |v| / s).
    shear_thinning: ShearThinning {
        curvature: size("s/m", 0.02, (0.0, 10.0)),
    } from [[0.1], [0.5]];
    /// c_2 |v| v: orifices.
    quadratic_damping: QuadraticDamping {
        damping: size("N s2/m2", 0.01, (-10.0, 10.0)),
    } from [[0.03], [-0.03]];
    /// Forces are (1 + a) of themselves forward and (1 - a) backward.
    asymmetry: Asymmetry {
        share: size("1", 0.01, (-0.9, 0.9)),
    } from [[0.03], [-0.03]];
    /// k_3 x^3.
    cubic_stiffness: CubicStiffness {
        stiffness: size("N/m3", 0.01, (-10.0, 10.0)),
    } from [[0.03], [-0.03]];
    /// m v': what moves between damper and load cell.
    inertia: Inertia {
        mass: size("kg", 0.01, (-10.0, 10.0)),
    } from [[0.03], [-0.03]];
    /// T s' = f - s: the force is filtered or acts on a compliance.
    force_lag: ForceLag {
        time_constant: size("s", 0.01, (0.0, 3.0)),
    } from [[0.03], [0.2]], like ["force_delay"];
    /// f(t - T): recorded late.
    force_delay: ForceDelay {
        delay: size("s", 0.01, (0.0, 3.0)),
    } from [[0.03], [0.2]], like ["force_lag"];
}

impl Equations for ControlledDamper {
    const KIND: &'static str = "controlled_damper";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[Channel::Displacement, Channel::Velocity];
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[(
        COMMAND,
        &[
            "friction_by_command",
            "damping_by_command",
            "command_lag",
            "command_saturation",
        ],
    )];
    const OUTPUT: Channel = FORCE;
    const IS_HYSTERETIC: bool = true;
    const IS_SCALED: bool = true;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        e: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let (x, v) = (
            recording.input(Channel::Displacement),
            recording.input(Channel::Velocity),
        );
        let command = recording.input(COMMAND);
        let h = recording.period();
        let keep = |time: f64| {
            if time > 0.01 * h {
                (-h / time).exp()
            } else {
                0.0
            }
        };
        let (keep_command, keep_force) = (
            keep(e.command_lag.time_constant),
            keep(e.force_lag.time_constant),
        );
        let friction = &e.hysteretic_friction;
        let shared = Friction {
            build_up: friction.build_up,
            creep: e.friction_creep.rate,
            exponent: e.friction_creep.exponent,
        };
        let mut taken_up = session.taken_up.clamp(-1.0, 1.0);
        let mut acting = command.first().copied().unwrap_or(0.0);
        let mut shown = f64::NAN;
        let last = x.len().min(v.len()).saturating_sub(1);
        for (k, y) in out.iter_mut().enumerate().take(last + 1) {
            let (place, speed) = (x[k], v[k]);
            let wanted = command.get(k).copied().unwrap_or(0.0);
            acting = keep_command * acting + (1.0 - keep_command) * wanted;
            let strength = acting / (1.0 + e.command_saturation.curvature * acting.abs());
            let mut damping = nominal.damping + e.damping_by_command.growth * strength;
            damping /= 1.0 + e.shear_thinning.curvature * speed.abs();
            damping += e.quadratic_damping.damping * speed.abs();
            let mut force = damping * speed;
            if friction.force > 0.0 {
                let moved = if k == 0 { 0.0 } else { place - x[k - 1] };
                taken_up = shared.after(taken_up, moved, h);
                let growth = 1.0 + e.friction_by_command.growth * (strength - 1.0);
                force += friction.force * growth.max(0.0) * taken_up;
            }
            force *= 1.0 + e.asymmetry.share * speed.signum();
            force += nominal.offset
                + place * (nominal.stiffness + e.cubic_stiffness.stiffness * place * place);
            if e.inertia.mass != 0.0 {
                let (before, after) = (v[k.saturating_sub(1)], v[(k + 1).min(last)]);
                force += e.inertia.mass * (after - before) / (2.0 * h);
            }
            shown = if shown.is_nan() {
                force
            } else {
                keep_force * shown + (1.0 - keep_force) * force
            };
            *y = shown + session.zero;
        }
        let late = e.force_delay.delay / h;
        if late > 0.0 {
            let in_time = out.to_vec();
            for (k, y) in out.iter_mut().enumerate() {
                *y = between(&in_time, k as f64 - late);
            }
        }
    }

    fn natural(_nominal: &Nominal, channels: Natural) -> Natural {
        channels
    }
}
