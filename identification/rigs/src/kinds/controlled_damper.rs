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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::super::table::EffectTable;
    use super::*;
    use recordings::Recording;

    const PERIOD: f64 = 0.01;
    const NOMINAL: Nominal = Nominal {
        damping: 100.0,
        stiffness: 500.0,
        offset: 3.0,
    };
    const PLACES: [f64; 6] = [0.0, 0.01, 0.03, 0.02, -0.01, -0.02];
    const SPEEDS: [f64; 6] = [0.1, 0.4, -0.2, -0.3, 0.2, 0.5];

    /// The force at `x` and `v` under a command of 1 V, and of 3 V from the second sample on.
    fn force(x: &[f64], v: &[f64], session: &Session, set: impl Fn(&mut Effects)) -> Vec<f64> {
        let mut effects = Effects::off().unwrap();
        set(&mut effects);
        let mut command = vec![3.0; x.len()];
        command[0] = 1.0;
        let channels = vec![
            (Channel::Displacement, x.to_vec()),
            (Channel::Velocity, v.to_vec()),
            (COMMAND, command),
            (FORCE, vec![0.0; x.len()]),
        ];
        let recording = Recording::new("damper", PERIOD, channels).unwrap();
        let inputs = [Channel::Displacement, Channel::Velocity, COMMAND];
        let recording = RigRecording::new(recording, &inputs, FORCE);
        let mut out = vec![0.0; x.len()];
        ControlledDamper.simulate(&recording, &NOMINAL, &effects, session, &mut out);
        out
    }

    fn close(found: &[f64], expected: impl Fn(usize) -> f64) {
        for (k, found) in found.iter().enumerate() {
            let expected = expected(k);
            assert!((found - expected).abs() < 1e-9, "{k}: {found} {expected}");
        }
    }

    fn bare(k: usize) -> f64 {
        100.0 * SPEEDS[k] + 500.0 * PLACES[k] + 3.0
    }

    #[test]
    fn an_effect_adds_its_formula_to_the_force() {
        type Case = (fn(&mut Effects), fn(usize) -> f64);
        fn volts(k: usize) -> f64 {
            if k == 0 { 1.0 } else { 3.0 }
        }
        let cases: [Case; 7] = [
            (|_| (), |_| 0.0),
            (
                |e| e.damping_by_command.growth = 20.0,
                |k| 20.0 * volts(k) * SPEEDS[k],
            ),
            (
                |e| e.shear_thinning.curvature = 2.0,
                |k| 100.0 * SPEEDS[k] * (1.0 / (1.0 + 2.0 * SPEEDS[k].abs()) - 1.0),
            ),
            (
                |e| e.quadratic_damping.damping = 50.0,
                |k| 50.0 * SPEEDS[k].abs() * SPEEDS[k],
            ),
            (|e| e.asymmetry.share = 0.1, |k| 10.0 * SPEEDS[k].abs()),
            (
                |e| e.cubic_stiffness.stiffness = 1e4,
                |k| 1e4 * PLACES[k].powi(3),
            ),
            (
                |e| {
                    e.damping_by_command.growth = 20.0;
                    e.command_saturation.curvature = 0.5;
                },
                |k| 20.0 * volts(k) / (1.0 + 0.5 * volts(k)) * SPEEDS[k],
            ),
        ];
        for (set, more) in cases {
            let found = force(&PLACES, &SPEEDS, &Session::default(), set);
            close(&found, |k| bare(k) + more(k));
        }
        let zero = Session {
            zero: 0.7,
            ..Session::default()
        };
        close(&force(&PLACES, &SPEEDS, &zero, |_| ()), |k| bare(k) + 0.7);
        let found = force(&PLACES, &SPEEDS, &Session::default(), |e| {
            e.inertia.mass = 2.0;
        });
        for k in 1..5 {
            let rate = (SPEEDS[k + 1] - SPEEDS[k - 1]) / (2.0 * PERIOD);
            assert!((found[k] - bare(k) - 2.0 * rate).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn friction_builds_up_over_the_way_and_with_the_command() {
        // 5 mm per sample, a quarter of the way over which it builds up.
        let x: Vec<f64> = (0..8).map(|k| 5e-3 * f64::from(k)).collect();
        let set = |e: &mut Effects| {
            e.hysteretic_friction = HystereticFriction {
                force: 10.0,
                build_up: 0.02,
            };
        };
        let begun = Session {
            taken_up: 0.3,
            ..Session::default()
        };
        let share = |k: usize| 1.0 - 0.7 * (-0.25 * k as f64).exp();
        let found = force(&x, &[0.0; 8], &begun, set);
        close(&found, |k| 3.0 + 500.0 * x[k] + 10.0 * share(k));
        let found = force(&x, &[0.0; 8], &begun, |e| {
            set(e);
            e.friction_by_command.growth = 0.5;
        });
        // Twice as much at 3 V as at 1 V.
        let strength = |k: usize| if k == 0 { 10.0 } else { 20.0 };
        close(&found, |k| 3.0 + 500.0 * x[k] + strength(k) * share(k));
    }

    #[test]
    fn lags_and_delays_are_those_of_steps_and_ramps() {
        let none = Session::default();
        let after = |k: usize| (-PERIOD * k as f64 / 0.02).exp();
        let found = force(&[0.0; 8], &[0.1; 8], &none, |e| {
            e.damping_by_command.growth = 20.0;
            e.command_lag.time_constant = 0.02;
        });
        close(&found, |k| {
            3.0 + 0.1 * (100.0 + 20.0 * (3.0 - 2.0 * after(k)))
        });
        let mut step = [0.01; 8];
        step[0] = 0.0;
        let found = force(&step, &[0.0; 8], &none, |e| {
            e.force_lag.time_constant = 0.02;
        });
        close(&found, |k| 3.0 + 5.0 * (1.0 - after(k)));
        let ramp: Vec<f64> = (0..8).map(|k| 1e-3 * f64::from(k)).collect();
        let found = force(&ramp, &[0.0; 8], &none, |e| {
            e.force_delay.delay = 1.5 * PERIOD;
        });
        close(&found[2..], |k| 3.0 + 0.5 * (k as f64 + 0.5));
    }
}
