//! A mass on a spring with a damper: force to displacement.
//!
//! Nominal: `m y'' + c y' + k y = F + F_0`. Between its samples the force is the band-limited signal
//! through them; the equation is integrated by the classical Runge-Kutta method with steps of at
//! most an eighth of a radian of the undamped oscillation.
//!
//! Effects are counted in natural units: the standard deviation of the displacement `X`, the force
//! `k X`, the time `(m/k)^{1/2}`.

use std::f64::consts::PI;

use super::hypotheses::Inside;
use super::restoring_force::read_off;
use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Begun, Equations, Natural, RigRecording};
use crate::kinds::recording::PLACES;
use recordings::Channel;

/// The rig.
pub struct Oscillator;

const FORCE: Channel = Channel::Other {
    name: "force",
    unit: "N",
};

/// Radians of the undamped oscillation in a step at most.
const RADIANS: f64 = 0.125;
/// Passes of a periodic record at most, and the share of the motion that may still change.
const PASSES: usize = 200;
const SETTLED: f64 = 1e-9;

nominal_parameters! {
    /// m.
    mass: "kg",
    /// c.
    damping: "N s/m",
    /// k.
    stiffness: "N/m",
    /// F_0: steady force.
    offset: "N" = 0.0,
}

session_parameters! {
    /// Of the displacement's transducer.
    zero: "m" within 0.05 as Setup,
    /// Displacement at the first sample.
    start: "m" within 1.0 as Start,
    /// Velocity at the first sample.
    start_speed: "m/s" within 1.0 as Start,
}

effects! {
    /// k_3 y^3: grows or falls with displacement (Duffing 1918).
    cubic_stiffness: CubicStiffness {
        stiffness: size("N/m3", 3e-3, (-30.0, 30.0)),
    } from [[0.01], [-0.01], [0.1]];
    /// k_2 y^2: stiffer on one side.
    quadratic_stiffness: QuadraticStiffness {
        stiffness: size("N/m2", 3e-3, (-30.0, 30.0)),
    } from [[0.01], [-0.01]];
    /// k (1 ± a): two springs that meet at rest.
    asymmetric_stiffness: AsymmetricStiffness {
        asymmetry: size("1", 3e-3, (-0.9, 0.9)),
    } from [[0.01], [-0.01]];
    /// k_s (|y| - g) beyond |y| > g: buffers on both sides.
    stops: Stops {
        stiffness: size("N/m", 0.01, (0.0, 1000.0)),
        gap: shape("m", 1.5, 0.5),
    } from [[0.05, 1.0], [0.05, 2.0], [0.5, 1.5]];
    /// The spring takes hold only beyond a gap of this width.
    free_play: FreePlay {
        gap: size("m", 3e-3, (0.0, 3.0)),
    } from [[0.02], [0.3]];
    /// F_c v / (v^2 + v_r^2)^{1/2}.
    coulomb_friction: CoulombFriction {
        force: size("N", 3e-3, (0.0, 30.0)),
        rounding: shape("m/s", 0.05, 1.0),
    } from [[0.01, 0.05], [0.1, 0.1]];
    /// c_2 |v| v: drag.
    quadratic_damping: QuadraticDamping {
        damping: size("N s2/m2", 2e-3, (-10.0, 10.0)),
    } from [[0.005], [-0.005]];
    /// c_x y^2 v: damping that grows with displacement (van der Pol 1926).
    displacement_damping: DisplacementDamping {
        damping: size("N s/m3", 2e-3, (-10.0, 10.0)),
    } from [[0.005], [-0.005]];
    /// A force z with memory beside the spring, `z' = A v (1 - (b sgn(v z) + g) |z / A|)`: an
    /// exponent n other than one on the size of the bracket's second term (Bouc 1967, Wen 1976).
    hysteresis: Hysteresis {
        stiffness: size("N/m", 0.01, (0.0, 10.0)),
        dissipation: size("1/m", 0.01, (0.0, 100.0)),
        hardening: size("1/m", 0.01, (-100.0, 100.0)),
        exponent: shape("1", 1.0, 0.3),
    } from [[0.1, 0.5, 0.5, 1.0], [0.4, 0.5, 0.5, 1.0], [0.4, 0.5, -0.5, 1.0], [0.3, 3.0, 0.0, 1.0]];
    /// F(t - T).
    delay: Delay {
        delay: size("s", 2e-3, (0.0, 6.0)),
    } from [[0.02], [0.2]], like ["force_lag", "sensor_lag"];
    /// T f' = F - f.
    force_lag: ForceLag {
        time_constant: size("s", 2e-3, (0.0, 6.0)),
    } from [[0.02], [0.2]], like ["delay", "sensor_lag"];
    /// The transducer follows with T s' = y - s.
    sensor_lag: SensorLag {
        time_constant: size("s", 2e-3, (0.0, 6.0)),
    } from [[0.02], [0.2]], like ["delay", "force_lag"];
    /// A share of the force is a staircase between samples, as a converter without a
    /// filter holds it.
    held_force: HeldForce {
        share: size("1", 0.02, (-1.0, 2.0)),
    } from [[0.1]];
    /// A share of the mass on a spring of its own.
    second_mode: SecondMode {
        share: size("1", 3e-3, (0.0, 0.9)),
        frequency: shape("rad/s", 1.5, 0.7),
        damping_ratio: shape("1", 0.05, 0.7),
    } from [[0.02, 0.7, 0.05], [0.02, 1.5, 0.05], [0.02, 3.0, 0.05]];
}

/// Displacement, velocity, force with memory, lagging force, sensor, second mass.
type State = [f64; 7];

struct Law<'a> {
    nominal: &'a Nominal,
    effects: &'a Effects,
    /// `|b| + |g|` over `|A|`, and their share in the bracket.
    memory: (f64, f64, f64),
    /// Mass, spring and damper of the second mode.
    second: (f64, f64, f64),
}

impl<'a> Law<'a> {
    fn new(nominal: &'a Nominal, effects: &'a Effects) -> Self {
        let h = &effects.hysteresis;
        let sum = h.dissipation.abs() + h.hardening.abs();
        let memory = if h.stiffness != 0.0 && sum > 0.0 {
            (
                sum / h.stiffness.abs(),
                h.dissipation / sum,
                h.hardening / sum,
            )
        } else {
            (0.0, 0.0, 0.0)
        };
        let mode = &effects.second_mode;
        let mass = mode.share * nominal.mass;
        Self {
            nominal,
            effects,
            memory,
            second: (
                mass,
                mass * mode.frequency.powi(2),
                2.0 * mode.damping_ratio * mass * mode.frequency,
            ),
        }
    }

    /// Rates of the state under `force` before it lags, and what is `added` on the mass.
    fn slope(&self, s: &State, force: f64, added: f64) -> State {
        let (n, e) = (self.nominal, self.effects);
        let [y, v, z, lagging, seen, y2, v2] = *s;
        let mut slope = [0.0; 7];
        let force = if e.force_lag.time_constant > 0.0 {
            slope[3] = (force - lagging) / e.force_lag.time_constant;
            lagging
        } else {
            force
        };
        let play = 0.5 * e.free_play.gap;
        let stretch = if play > 0.0 {
            (y.abs() - play).max(0.0).copysign(y)
        } else {
            y
        };
        let mut resisting =
            n.stiffness * (stretch + e.asymmetric_stiffness.asymmetry * stretch.abs());
        resisting += y * y * (e.quadratic_stiffness.stiffness + e.cubic_stiffness.stiffness * y);
        if e.stops.stiffness > 0.0 {
            resisting += e.stops.stiffness * (y.abs() - e.stops.gap).max(0.0).copysign(y);
        }
        resisting += v
            * (n.damping
                + e.quadratic_damping.damping * v.abs()
                + e.displacement_damping.damping * y * y);
        if e.coulomb_friction.force > 0.0 {
            resisting += e.coulomb_friction.force * v / v.hypot(e.coulomb_friction.rounding);
        }
        let h = &e.hysteresis;
        if h.stiffness != 0.0 {
            resisting += z;
            let (scale, b, g) = self.memory;
            let size = z.abs() * scale;
            let size = if h.exponent == 1.0 {
                size
            } else {
                size.powf(h.exponent)
            };
            slope[2] = h.stiffness * v * (1.0 - (b * (v * z).signum() + g) * size);
        }
        let (mass, spring, damper) = self.second;
        if mass > 0.0 {
            let pull = spring * (y2 - y) + damper * (v2 - v);
            resisting -= pull;
            slope[5] = v2;
            slope[6] = -pull / mass;
        }
        if e.sensor_lag.time_constant > 0.0 {
            slope[4] = (y - seen) / e.sensor_lag.time_constant;
        }
        slope[0] = v;
        slope[1] = (force + added + n.offset - resisting) / (n.mass - mass);
        slope
    }

    /// One step of the classical Runge-Kutta method.
    fn step(
        &self,
        s: &State,
        h: f64,
        forces: [f64; 3],
        mut added: impl FnMut(f64, &State) -> f64,
    ) -> State {
        let ahead = |by: f64, slope: &State| {
            let mut next = *s;
            for (n, d) in next.iter_mut().zip(slope) {
                *n += by * d;
            }
            next
        };
        let mut slope =
            |by: f64, state: State, force: f64| self.slope(&state, force, added(by, &state));
        let a = slope(0.0, *s, forces[0]);
        let b = slope(0.5 * h, ahead(0.5 * h, &a), forces[1]);
        let c = slope(0.5 * h, ahead(0.5 * h, &b), forces[1]);
        let d = slope(h, ahead(h, &c), forces[2]);
        let mut next = *s;
        for i in 0..next.len() {
            next[i] += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        }
        next
    }
}

impl Equations for Oscillator {
    const KIND: &'static str = "oscillator";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[FORCE];
    const OUTPUT: Channel = Channel::Displacement;
    const IS_SCALED: bool = true;
    const SCREENED: usize = 8192;
    const PLACES: &'static [&'static str] = &["force"];

    fn natural(nominal: &Nominal, channels: Natural) -> Natural {
        Natural {
            force: nominal.stiffness * channels.length,
            time: (nominal.mass / nominal.stiffness).sqrt(),
            ..channels
        }
    }

    fn read_off(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &Nominal,
    ) -> Vec<Begun> {
        let period = 2.0 * PI * (nominal.mass / nominal.stiffness).sqrt();
        read_off(recording, FORCE, places, nominal.mass, period)
            .into_iter()
            .map(|own| Begun {
                nominal: vec![own.mass, own.damping, own.stiffness, own.offset],
                session: vec![0.0, own.start.0, own.start.1],
                effect: own.effect,
            })
            .collect()
    }

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let mut inside = Inside::default();
        self.simulate_with(recording, nominal, effects, session, &mut inside, out);
    }

    fn simulate_with(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        inside: &mut Inside<'_>,
        out: &mut [f64],
    ) {
        let between = recording.between_samples(FORCE);
        if between.is_empty() || out.is_empty() {
            return;
        }
        let law = Law::new(nominal, effects);
        let sample = recording.period();
        let springs = nominal.stiffness
            + effects.hysteresis.stiffness.abs()
            + effects.stops.stiffness
            + hardened(nominal, effects, between);
        let fast = [
            springs / nominal.mass,
            effects.second_mode.frequency.powi(2) * f64::from(u8::from(law.second.0 > 0.0)),
        ];
        let radians = fast.into_iter().fold(0.0, f64::max).sqrt() * sample;
        // A divisor of the places between two samples, every second of which is a middle.
        let steps = [1, 2, 4, 8]
            .into_iter()
            .find(|&steps| radians <= RADIANS * steps as f64)
            .unwrap_or(8);
        let stride = PLACES / (2 * steps);
        let late = effects.delay.delay / sample * PLACES as f64;
        let held = effects.held_force.share;
        let count = between.len();
        let at = |place: usize| {
            let smooth = |place: f64| {
                let before = place as usize;
                let share = place - before as f64;
                let here = between[before.min(count - 1)];
                here + share * (between[(before + 1).min(count - 1)] - here)
            };
            let wanted = place as f64 - late;
            let wanted = if wanted >= 0.0 {
                wanted
            } else if recording.is_periodic {
                wanted.rem_euclid(count as f64)
            } else {
                0.0
            };
            let mut force = if late == 0.0 {
                between[place.min(count - 1)]
            } else {
                smooth(wanted)
            };
            if held != 0.0 {
                let last = (wanted as usize).min(count - 1) / PLACES * PLACES;
                force += held * (between[last] - force);
            }
            force
        };
        let h = sample / steps as f64;
        let first = between[0];
        let start = session.start;
        let mut state: State = [
            start,
            session.start_speed,
            0.0,
            first,
            start,
            start,
            session.start_speed,
        ];
        let shown = |state: &State| {
            let y = if effects.sensor_lag.time_constant > 0.0 {
                state[4]
            } else {
                state[0]
            };
            y + session.zero
        };
        let mut pass = |state: &mut State, samples: usize, out: &mut [f64]| {
            inside.restart(0.0, state[0], state[1]);
            for k in 0..samples {
                if let Some(y) = out.get_mut(k) {
                    *y = shown(state);
                }
                for i in 0..steps {
                    let place = k * PLACES + 2 * i * stride;
                    // A staircase jumps at the end of its step, where the old stair still acts.
                    let mut forces = [place, place + stride, place + 2 * stride].map(at);
                    if held != 0.0 && late == 0.0 {
                        forces[2] += held
                            * (at_stair(between, k)
                                - at_stair(between, (place + 2 * stride) / PLACES));
                    }
                    if inside.has_no_force() {
                        *state = law.step(state, h, forces, |_, _| 0.0);
                        continue;
                    }
                    let time = (k * steps + i) as f64 * h;
                    inside.begin(h, time, state[0], state[1]);
                    *state = law.step(state, h, forces, |ahead, at| {
                        inside.force(ahead, time + ahead, at[0], at[1])
                    });
                    inside.end(h, time, state[0], state[1]);
                }
            }
        };
        let samples = count / PLACES;
        if recording.is_periodic {
            // Round and round until the start has died away.
            for _ in 0..PASSES {
                let before = state;
                pass(&mut state, samples, &mut []);
                let moved = (state[0] - before[0]).abs()
                    / (state[0].abs() + before[0].abs()).max(f64::MIN_POSITIVE);
                let turned = (state[1] - before[1]).abs()
                    / (state[1].abs() + before[1].abs()).max(f64::MIN_POSITIVE);
                if moved < SETTLED && turned < SETTLED {
                    break;
                }
            }
        }
        let wanted = out.len().min(samples);
        pass(&mut state, wanted, out);
    }
}

/// What a hardening spring adds to the stiffness where it bears twice the largest force, so that steps stay
/// short against the oscillation there.
fn hardened(nominal: &Nominal, effects: &Effects, forces: &[f64]) -> f64 {
    let cubic = effects.cubic_stiffness.stiffness;
    if cubic <= 0.0 {
        return 0.0;
    }
    let force = 2.0 * forces.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    // Newton's method on k y + k_3 y^3 = F from above, where it cannot overshoot.
    let mut y = (force / cubic).cbrt();
    for _ in 0..8 {
        let slope = nominal.stiffness + 3.0 * cubic * y * y;
        y -= (nominal.stiffness * y + cubic * y.powi(3) - force) / slope;
    }
    3.0 * cubic * y * y
}

/// The force at a sample.
fn at_stair(between: &[f64], sample: usize) -> f64 {
    let place = (sample * PLACES).min(between.len().saturating_sub(1));
    between[place]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::super::table::EffectTable;
    use super::*;

    const NOMINAL: Nominal = Nominal {
        mass: 2.0,
        damping: 3.0,
        stiffness: 50.0,
        offset: 1.0,
    };

    /// Rates of `state` under a force of 7 N, with 0.5 N added on the mass.
    fn rates(state: State, set: impl Fn(&mut Effects)) -> State {
        let mut effects = Effects::off().unwrap();
        set(&mut effects);
        Law::new(&NOMINAL, &effects).slope(&state, 7.0, 0.5)
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }

    /// At -0.3 m and 0.8 m/s, in N.
    #[test]
    fn an_effect_resists_with_its_formula_beside_spring_and_damper() {
        type Case = (fn(&mut Effects), f64);
        let cases: [Case; 11] = [
            (|_| (), 0.0),
            (|e| e.cubic_stiffness.stiffness = 4.0, 4.0 * -0.027),
            (|e| e.quadratic_stiffness.stiffness = 4.0, 4.0 * 0.09),
            (|e| e.asymmetric_stiffness.asymmetry = 0.2, 50.0 * 0.2 * 0.3),
            (
                |e| {
                    e.stops = Stops {
                        stiffness: 100.0,
                        gap: 0.25,
                    };
                },
                -100.0 * 0.05,
            ),
            (
                |e| {
                    e.stops = Stops {
                        stiffness: 100.0,
                        gap: 0.35,
                    };
                },
                0.0,
            ),
            // The spring bears for 0.2 m, or does not bear at all.
            (|e| e.free_play.gap = 0.2, 50.0 * 0.1),
            (|e| e.free_play.gap = 0.8, 50.0 * 0.3),
            (
                |e| {
                    e.coulomb_friction = CoulombFriction {
                        force: 2.0,
                        rounding: 0.6,
                    };
                },
                2.0 * 0.8,
            ),
            (|e| e.quadratic_damping.damping = 1.5, 1.5 * 0.64),
            (|e| e.displacement_damping.damping = 10.0, 10.0 * 0.09 * 0.8),
        ];
        for (n, (set, more)) in cases.into_iter().enumerate() {
            let found = rates([-0.3, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0], set);
            assert_eq!(found[0], 0.8, "{n}");
            close(found[1], (7.5 + 1.0 + 50.0 * 0.3 - 3.0 * 0.8 - more) / 2.0);
            assert_eq!(found[2..], [0.0; 5], "{n}");
        }
    }

    /// `z' = 20 v (1 - (5 sgn(v z) + 2) |z| / 20)` at 1.2 N.
    #[test]
    fn a_force_with_memory_grows_where_it_is_loaded_less_than_where_it_is_unloaded() {
        let of = |v: f64, exponent: f64| {
            let set = |e: &mut Effects| {
                e.hysteresis = Hysteresis {
                    stiffness: 20.0,
                    dissipation: 5.0,
                    hardening: 2.0,
                    exponent,
                };
            };
            let [_, rate, memory, ..] = rates([0.0, v, 1.2, 0.0, 0.0, 0.0, 0.0], set);
            close(rate, (7.5 + 1.0 - 3.0 * v - 1.2) / 2.0);
            memory
        };
        close(of(0.8, 1.0), 16.0 * (1.0 - 7.0 * 0.06));
        close(of(-0.8, 1.0), -16.0 * (1.0 + 3.0 * 0.06));
        close(of(0.8, 2.0), 16.0 * (1.0 - (7.0 * 0.06_f64).powi(2)));
    }

    #[test]
    fn lags_and_a_second_mass_have_states_of_their_own() {
        let state = [-0.3, 0.8, 0.0, 4.0, -0.2, -0.1, 0.3];
        let resisting = -50.0 * 0.3 + 3.0 * 0.8;
        let force = rates(state, |e| e.force_lag.time_constant = 0.1);
        close(force[3], (7.0 - 4.0) / 0.1);
        close(force[1], (4.5 + 1.0 - resisting) / 2.0);
        let sensor = rates(state, |e| e.sensor_lag.time_constant = 0.05);
        close(sensor[4], (-0.3 + 0.2) / 0.05);
        close(sensor[1], (7.5 + 1.0 - resisting) / 2.0);
        // A quarter of the mass at 6 rad/s with a tenth of critical damping: 18 N/m and 0.6 N s/m.
        let second = rates(state, |e| {
            e.second_mode = SecondMode {
                share: 0.25,
                frequency: 6.0,
                damping_ratio: 0.1,
            };
        });
        let pull = 18.0 * 0.2 - 0.6 * 0.5;
        close(second[1], (7.5 + 1.0 - resisting + pull) / 1.5);
        assert_eq!(second[5], 0.3);
        close(second[6], -pull / 0.5);
    }
}
