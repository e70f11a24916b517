//! Tables of three kinds in closed loops, SI.

use std::f64::consts::TAU;

use crate::dice::Dice;
use crate::hydraulic::{Bristles, Rig, State};

/// Of the voltage, V.
const RAIL: f64 = 10.0;

/// What moves a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// Servo valve and cylinder; no spring under the table.
    Hydraulic,
    /// Voice coil with a suspension, on a voltage amplifier.
    Shaker,
    /// Motor and screw on rails.
    Motor,
}

/// Laws of control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// On displacement alone.
    Gain,
    /// With integral and derivative.
    Pid,
    /// With feedforward of velocity and feedback of acceleration.
    ThreeVariable,
}

/// A sampled loop on displacement.
#[derive(Debug, Clone)]
pub struct Loop {
    pub kind: Kind,
    /// V/m.
    pub gain: f64,
    /// Share of the velocity that feedforward sends.
    feedforward: f64,
    integral: f64,
    derivative: f64,
    acceleration: f64,
    /// Hz.
    pub rate: f64,
}

/// A coil or a motor on its amplifier: `F = b i`, `L di/dt = u - R i - b v`.
#[derive(Debug, Clone, Copy)]
struct Electric {
    mass: f64,
    resistance: f64,
    inductance: f64,
    constant: f64,
    stiffness: f64,
    viscous: f64,
    coulomb: f64,
    /// Width of the friction's tanh, m/s.
    width: f64,
}

#[derive(Debug, Clone)]
enum Body {
    Hydraulic(Box<Rig>),
    Electric(Electric),
}

/// A table in its loop.
#[derive(Debug, Clone)]
pub struct Table {
    body: Body,
    drive: Drive,
    pub control: Loop,
}

impl Table {
    /// Drawn.
    pub fn draw(drive: Drive, dice: &mut Dice) -> Self {
        let (body, speed) = match drive {
            Drive::Hydraulic => {
                let usual = Rig::default();
                let size = dice.between(1.0, 15.0);
                let rig = Rig {
                    flow_coefficient: size * usual.flow_coefficient * dice.between(0.7, 1.5),
                    area: size * usual.area,
                    volume: size * usual.volume,
                    bulk_modulus: usual.bulk_modulus * dice.between(2.0, 6.0),
                    leakage: size * usual.leakage,
                    viscous: size * usual.viscous,
                    coulomb: size * usual.coulomb,
                    breakaway: size * usual.breakaway,
                    deflection: dice.between(1e-5, 6e-5),
                    bristles: dice.pick(&[Bristles::LuGre, Bristles::ElastoPlastic]),
                    table_mass: size * usual.table_mass * dice.between(0.7, 1.5),
                    table_stiffness: 0.0,
                    table_damping: 0.0,
                    disturbance: dice.between(5e-4, 3e-3),
                    disturbance_frequency: dice.between(5.0, 40.0),
                    ..usual
                };
                let speed = rig.flow_coefficient * (rig.supply / 2.0).sqrt() / rig.area;
                (Body::Hydraulic(Box::new(rig)), speed)
            }
            Drive::Shaker | Drive::Motor => {
                let mass = dice.between(10.0, 60.0);
                let is_motor = drive == Drive::Motor;
                let constant = dice.between(40.0, 120.0);
                let electric = Electric {
                    mass,
                    resistance: dice.between(0.5, 2.0),
                    inductance: dice.between(5e-4, 3e-3),
                    constant,
                    stiffness: if is_motor {
                        0.0
                    } else {
                        mass * (TAU * dice.between(0.8, 2.0)).powi(2)
                    },
                    viscous: mass * dice.between(0.2, 2.0),
                    coulomb: mass
                        * if is_motor {
                            dice.between(0.2, 0.6)
                        } else {
                            dice.between(0.02, 0.1)
                        },
                    width: dice.between(1e-3, 5e-3),
                };
                (Body::Electric(electric), 1.0 / constant)
            }
        };
        let gain = TAU * dice.between(3.0, 7.0) / speed;
        let kind = dice.pick(&[Kind::Gain, Kind::Pid, Kind::ThreeVariable]);
        let control = Loop {
            kind,
            gain,
            feedforward: if kind == Kind::ThreeVariable {
                0.85 / speed
            } else {
                0.0
            },
            integral: if kind == Kind::Pid {
                gain * dice.between(0.3, 1.5)
            } else {
                0.0
            },
            derivative: if kind == Kind::Pid { 0.1 / speed } else { 0.0 },
            acceleration: if kind == Kind::ThreeVariable {
                // A third of what an electric drive's own lag allows, or a sampled loop rings.
                let lag = match &body {
                    Body::Hydraulic(_) => 1e-3,
                    Body::Electric(e) => {
                        (0.3 * e.mass * e.resistance / (e.constant * e.constant)).min(1e-3)
                    }
                };
                lag / speed
            } else {
                0.0
            },
            rate: dice.pick(&[1000.0, 2000.0]),
        };
        Self {
            body,
            drive,
            control,
        }
    }

    /// Friction times a factor; returns it in N while it slides and where it breaks away, and the position error (m)
    /// that either holds: what a coil's or a motor's resistance needs of the voltage at rest, or what the leak takes
    /// of the valve's flow.
    pub fn rub(&mut self, factor: f64) -> [(f64, f64); 2] {
        let held = match &mut self.body {
            Body::Hydraulic(rig) => {
                rig.coulomb *= factor;
                rig.breakaway *= factor;
                [rig.coulomb, rig.breakaway].map(|force| {
                    let load = force / rig.area;
                    let flow = rig.flow_coefficient * ((rig.supply - load) / 2.0).sqrt();
                    (force, rig.leakage * load / flow)
                })
            }
            Body::Electric(electric) => {
                electric.coulomb *= factor;
                let current = electric.coulomb / electric.constant;
                [(electric.coulomb, electric.resistance * current); 2]
            }
        };
        held.map(|(force, voltage)| (force, voltage / self.control.gain))
    }

    /// By what share an orifice's flow falls per speed, s/m: `v = w sqrt(1 - p / P)` at the load pressure
    /// `p = c v / A` of viscous seals, to first order; 0 without a valve.
    pub fn flow_falls(&self) -> f64 {
        match &self.body {
            Body::Hydraulic(rig) => rig.viscous / (2.0 * rig.area * rig.supply),
            Body::Electric(_) => 0.0,
        }
    }

    /// Overlap of the valve, V; returns what it became.
    pub fn overlap(&mut self, width: f64) -> f64 {
        let Body::Hydraulic(rig) = &mut self.body else {
            return 0.0;
        };
        rig.overlap = width;
        width
    }

    /// Asymmetry of the valve; returns what it became.
    pub fn asymmetry(&mut self, q: f64) -> f64 {
        let Body::Hydraulic(rig) = &mut self.body else {
            return 0.0;
        };
        rig.asymmetry = q;
        q
    }

    /// kg.
    pub fn mass(&self) -> f64 {
        match &self.body {
            Body::Hydraulic(rig) => rig.table_mass,
            Body::Electric(electric) => electric.mass,
        }
    }

    /// What the people say of it.
    pub fn words(&self) -> &'static str {
        match self.drive {
            Drive::Hydraulic => "Servo-hydraulic table on bearings, no spring.",
            Drive::Shaker => "Table on an electrodynamic shaker with a voltage amplifier.",
            Drive::Motor => "Table on rails, moved by a motor and a screw.",
        }
    }

    /// Whether a spring holds it, and no integral makes up for that.
    pub fn gives_way(&self) -> bool {
        let is_sprung = matches!(&self.body, Body::Electric(electric) if electric.stiffness > 0.0);
        is_sprung && self.control.integral == 0.0
    }

    /// Steady displacement over the command: below one where a spring holds the table and no integral makes up for it.
    pub fn reaches(&self) -> f64 {
        match &self.body {
            Body::Electric(electric) if self.gives_way() => {
                let push = self.control.gain * electric.constant / electric.resistance;
                push / (push + electric.stiffness)
            }
            _ => 1.0,
        }
    }

    /// Displacement, acceleration and force at every sample of a reference that reaches the loop late and by
    /// another scale, and the share of the time at the voltage's rail. The acceleration is that of a converter
    /// with a flat filter, half a sample late, and the reference is smooth between the recorded samples.
    pub fn play(
        &self,
        reference: &[f64],
        rate: f64,
        delay: f64,
        scale: f64,
    ) -> (Vec<[f64; 3]>, f64) {
        let control = &self.control;
        let ticks = (control.rate / rate).round().max(1.0) as usize;
        let period = 1.0 / (rate * ticks as f64);
        let at = |t: f64| {
            let place = (t - delay) * rate;
            if place < 0.0 {
                return 0.0;
            }
            let (k, s) = (place.floor() as usize, place.fract());
            let value = |k: usize| reference[k.min(reference.len() - 1)];
            let [a, b, c, d] = [k.saturating_sub(1), k, k + 1, k + 2].map(value);
            // Hermite's cubic with the slopes of neighbours: a controller makes its reference at its own rate.
            let (first, last) = (0.5 * (c - a), 0.5 * (d - b));
            let bend = 3.0 * (c - b) - 2.0 * first - last;
            let turn = 2.0 * (b - c) + first + last;
            (1.0 + scale) * (b + s * (first + s * (bend + s * turn)))
        };
        let mut state = match &self.body {
            Body::Hydraulic(rig) => Moving::Hydraulic(Box::new(rig.rest())),
            Body::Electric(_) => Moving::Electric([0.0; 3]),
        };
        let (mut sum, mut before, mut command) = (0.0, 0.0, 0.0);
        let mut readings = Vec::with_capacity(reference.len());
        let mut railed = 0.0;
        let mut speed = 0.0;
        for k in 0..reference.len() * ticks {
            let t = k as f64 * period;
            let [x, v, a, f] = self.reading(&state, command);
            // The mean over all instants of a sample: those at which the controller steps are no fair choice of them.
            if k % ticks == 0 {
                readings.push([x, (v - speed) * rate, f]);
                speed = v;
            }
            let r = at(t);
            let rate_of = |t: f64| (at(t + period) - at(t - period)) / (2.0 * period);
            let error = r - x;
            sum += control.integral * error * period;
            command = control.gain * error
                + sum
                + control.derivative * (error - before) / period
                + control.feedforward * rate_of(t)
                - control.acceleration * a;
            if command.abs() > RAIL {
                railed += 1.0 / (reference.len() * ticks) as f64;
            }
            command = command.clamp(-RAIL, RAIL);
            before = error;
            match (&self.body, &mut state) {
                (Body::Hydraulic(rig), Moving::Hydraulic(state)) => {
                    rig.advance(state, t, period, command, 0.0)
                }
                (Body::Electric(electric), Moving::Electric(state)) => {
                    electric.advance(state, period, command)
                }
                _ => unreachable!("a body has its own state"),
            }
        }
        // What the mean over a sample takes of fast motion is given back, to the third order.
        let means: Vec<f64> = readings.iter().map(|own| own[1]).collect();
        for (k, three) in means.windows(3).enumerate() {
            readings[k + 1][1] -= (three[0] - 2.0 * three[1] + three[2]) / 24.0;
        }
        (readings, railed)
    }

    /// Displacement, velocity, acceleration and force.
    fn reading(&self, state: &Moving, command: f64) -> [f64; 4] {
        match (&self.body, state) {
            (Body::Hydraulic(rig), Moving::Hydraulic(state)) => {
                let now = rig.now(&state.values, command, 0.0);
                let [.., x, v, _, _, _] = state.values;
                [x, v, now.acceleration, now.force]
            }
            (Body::Electric(electric), Moving::Electric(state)) => [
                state[1],
                state[2],
                electric.slope(state, command)[2],
                electric.constant * state[0],
            ],
            _ => unreachable!("a body has its own state"),
        }
    }
}

enum Moving {
    Hydraulic(Box<State>),
    /// Current, displacement, velocity.
    Electric([f64; 3]),
}

impl Electric {
    fn slope(&self, [i, x, v]: &[f64; 3], u: f64) -> [f64; 3] {
        let resisting =
            self.stiffness * x + self.viscous * v + self.coulomb * (v / self.width).tanh();
        [
            (u - self.resistance * i - self.constant * v) / self.inductance,
            *v,
            (self.constant * i - resisting) / self.mass,
        ]
    }

    fn advance(&self, s: &mut [f64; 3], period: f64, u: f64) {
        let steps = (period / 50e-6).ceil();
        let h = period / steps;
        for _ in 0..steps as usize {
            let along = |k: &[f64; 3], by: f64| std::array::from_fn(|i| s[i] + by * k[i]);
            let k1 = self.slope(s, u);
            let k2 = self.slope(&along(&k1, h / 2.0), u);
            let k3 = self.slope(&along(&k2, h / 2.0), u);
            let k4 = self.slope(&along(&k3, h), u);
            for i in 0..3 {
                s[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_holds_the_table_back_by_its_position_error() {
        for seed in 0..12 {
            let drive = [Drive::Hydraulic, Drive::Motor][seed as usize % 2];
            let mut table = Table::draw(drive, &mut Dice::new(seed, 0));
            let [(force, expected), _] = table.rub(3.0);
            let control = &mut table.control;
            (control.kind, control.integral, control.derivative) = (Kind::Gain, 0.0, 0.0);
            (control.feedforward, control.acceleration) = (0.0, 0.0);
            if let Body::Hydraulic(rig) = &mut table.body {
                rig.disturbance = 0.0;
            }
            // There and back at one speed: what differs is friction and the error of following.
            let (rate, speed) = (100.0, 0.02);
            let motion: Vec<f64> = (0..800)
                .map(|k| speed * (4.0 - (f64::from(k) / rate - 4.0).abs()))
                .collect();
            let held = |table: &Table| {
                let (readings, _) = table.play(&motion, rate, 0.0, 0.0);
                let mean = |from: usize| {
                    let own = (from..from + 100).map(|k| motion[k] - readings[k][0]);
                    own.sum::<f64>() / 100.0
                };
                0.5 * (mean(280) - mean(680))
            };
            let with = held(&table);
            // The load's pressure also takes a share of an orifice's flow, at any speed.
            let share = match &mut table.body {
                Body::Hydraulic(rig) => {
                    (rig.coulomb, rig.breakaway) = (1e-3, 1e-3);
                    0.5 * force / (rig.area * rig.supply)
                }
                Body::Electric(electric) => {
                    electric.coulomb = 0.0;
                    0.0
                }
            };
            let found = with - (1.0 + share) * held(&table);
            assert!(
                (found / expected - 1.0).abs() < 0.05,
                "{seed}: {found} {expected}"
            );
        }
    }

    #[test]
    fn an_accelerometer_shows_the_table_s_motion_between_rails() {
        for (seed, drive) in [(1, Drive::Motor), (2, Drive::Shaker)] {
            let table = Table::draw(drive, &mut Dice::new(seed, 0));
            let rate = 200.0;
            let wave = |k: u32| 0.05 * (TAU * f64::from(k) / rate).sin();
            let motion: Vec<f64> = (0..2000).map(wave).collect();
            let (readings, railed) = table.play(&motion, rate, 0.0, 0.0);
            assert!(railed > 0.1, "{drive:?}: {railed}");
            // At the motion's own frequency, after its begin.
            let line = |i: usize| {
                let own = (1000..2000).map(|k| {
                    let angle = TAU * f64::from(k) / rate;
                    let value = readings[k as usize][i];
                    (value * angle.cos(), value * angle.sin())
                });
                let (re, im) = own.fold((0.0, 0.0), |all, own| (all.0 + own.0, all.1 + own.1));
                f64::hypot(re, im)
            };
            let found = line(1) / (TAU * TAU * line(0));
            assert!((found - 1.0).abs() < 2e-3, "{drive:?}: {found}");
        }
    }

    #[test]
    fn a_table_on_a_spring_comes_to_rest_where_it_holds() {
        for seed in 0..6 {
            let mut table = Table::draw(Drive::Shaker, &mut Dice::new(seed, 0));
            table.control.integral = 0.0;
            let Body::Electric(electric) = &mut table.body else {
                unreachable!("it is a shaker");
            };
            electric.coulomb = 0.0;
            let (readings, _) = table.play(&[1e-3; 1000], 100.0, 0.0, 0.0);
            let (found, expected) = (readings[999][0] / 1e-3, table.reaches());
            assert!(
                (found / expected - 1.0).abs() < 1e-3,
                "{seed}: {found} {expected}"
            );
        }
    }

    #[test]
    fn an_orifice_s_flow_falls_with_speed_by_the_seals_drag() {
        let table = Table::draw(Drive::Hydraulic, &mut Dice::new(3, 0));
        let expected = table.flow_falls();
        let Body::Hydraulic(mut rig) = table.body else {
            unreachable!("it is hydraulic");
        };
        (rig.coulomb, rig.breakaway, rig.disturbance) = (1e-3, 1e-3, 0.0);
        // Long enough to settle, short enough for the stroke.
        let speed = |voltage: f64| {
            let mut state = rig.rest();
            for k in 0..300 {
                rig.advance(&mut state, 1e-3 * f64::from(k), 1e-3, voltage, 0.0);
            }
            state.values[5]
        };
        let (slow, fast) = (speed(0.2), speed(2.0));
        let found = (10.0 * slow / fast - 1.0) / (10.0 * slow - slow);
        assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    }

    #[test]
    fn both_sensors_show_one_motion() {
        for (seed, frequency) in (0..24).flat_map(|seed| [(seed, 2.0), (seed, 10.0)]) {
            let drive = [Drive::Hydraulic, Drive::Shaker, Drive::Motor][seed as usize % 3];
            let table = Table::draw(drive, &mut Dice::new(seed, 0));
            let (rate, omega) = (100.0, TAU * frequency);
            let motion: Vec<f64> = (0..600)
                .map(|k| 0.012 / frequency * (omega * f64::from(k) / rate).sin())
                .collect();
            let (readings, _) = table.play(&motion, rate, 0.0, 0.0);
            // What is in step with a sine, of both.
            let size = |own: &dyn Fn(usize) -> f64| {
                let part = |phase: f64| {
                    let all = 200..600;
                    let all = all.map(|k| own(k) * (omega * k as f64 / rate + phase).sin());
                    all.sum::<f64>() / 200.0
                };
                part(0.0).hypot(part(TAU / 4.0))
            };
            let expected = omega.powi(2) * size(&|k| readings[k][0]);
            let found = size(&|k| readings[k][1]);
            assert!(
                (found / expected - 1.0).abs() < 0.02,
                "{seed}, {frequency} Hz: {found} {expected} {table:?}"
            );
        }
    }

    #[test]
    fn every_loop_follows_a_slow_motion() {
        for seed in 0..24 {
            let drive = [Drive::Hydraulic, Drive::Shaker, Drive::Motor][seed as usize % 3];
            let table = Table::draw(drive, &mut Dice::new(seed, 0));
            let motion: Vec<f64> = (0..2000)
                .map(|k| 0.02 * (TAU * 0.3 * f64::from(k) / 200.0).sin())
                .collect();
            let (readings, _) = table.play(&motion, 200.0, 0.0, 0.0);
            let off = (500..2000)
                .map(|k| (readings[k][0] - motion[k]).abs())
                .fold(0.0, f64::max);
            assert!(off < 0.01, "{seed} {table:?}: {off}");
        }
    }
}
