//! Actuator, table, specimen, foundation and sensors as one system of first order, inch, pound-force,
//! second, volt.
//!
//! `F = G1 u + G2 v` has one observer form for both paths. Classical Runge-Kutta at 25 µs or less; a
//! sample is cut where a late command arrives.

use std::f64::consts::TAU;

use crate::table::hidden::{Friction, Hidden, Laws, Outside};

const GRAVITY: f64 = 386.088_58;
const LARGEST_STEP: f64 = 25e-6;

/// Parameters of a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plant {
    /// `s³ + a s² + b s + c`.
    pub denominator: [f64; 3],
    /// Valve command to force, numerator.
    pub voltage_to_force: [f64; 3],
    /// Velocity to force, numerator.
    pub velocity_to_force: [f64; 3],
    /// Mass, damping, stiffness.
    pub table: [f64; 3],
    /// Mass, damping, stiffness.
    pub specimen: [f64; 3],
}

/// What the laboratory believes.
pub const NOMINAL: Plant = Plant {
    denominator: [56.18, 1.333e4, 178.2],
    voltage_to_force: [3430.0, 3.86e4, 403.3],
    velocity_to_force: [565.1, -1818.0, 3.12e5],
    table: [0.1212, 0.2465, 23.3189],
    specimen: [0.258_799_172, 0.162_608_315, 10.216_981_782],
};

impl Plant {
    /// Every parameter off by a normal share of `mismatch`.
    pub fn perturbed(mut self, mut gauss: impl FnMut() -> f64, mismatch: f64) -> Self {
        for group in [
            &mut self.denominator,
            &mut self.voltage_to_force,
            &mut self.velocity_to_force,
            &mut self.table,
            &mut self.specimen,
        ] {
            group
                .iter_mut()
                .for_each(|v| *v *= 1.0 + mismatch * gauss());
        }
        self
    }
}

const N: usize = 20;
const FORCE: usize = 0;
const X: usize = 3;
const V: usize = 4;
const D: usize = 5;
const DV: usize = 6;
const D2: usize = 7;
const D2V: usize = 8;
const Y: usize = 9;
const YV: usize = 10;
const SPOOL: usize = 11;
const SPOOL_RATE: usize = 12;
const DEMAND: usize = 13;
const SEEN_X: usize = 14;
const BRISTLE: usize = 15;
const BOUC_WEN: usize = 16;
const SLACK: f64 = 0.3;

type State = [f64; N];

/// What sensors would show at an instant: displacement, acceleration, force, specimen acceleration.
pub type Reading = [f64; 4];

const SLIDERS: usize = 7;

/// A rig in motion.
#[derive(Debug, Clone)]
pub struct Rig {
    plant: Plant,
    hidden: Hidden,
    laws: Laws,
    state: State,
    time: f64,
    commands: Vec<f64>,
    plays: [f64; 2],
    sliders: [f64; SLIDERS],
    largest_drift: f64,
    /// Readings since one sample and one sensor's delay ago, with their times.
    readings: Vec<(f64, Reading)>,
}

struct Now {
    derivative: State,
    table: f64,
    specimen: f64,
}

fn beyond(value: f64, half_width: f64) -> f64 {
    value - value.clamp(-half_width, half_width)
}

impl Rig {
    /// At rest.
    pub fn new(plant: Plant, hidden: Hidden, laws: Laws) -> Self {
        Self {
            plant,
            hidden,
            laws,
            state: [0.0; N],
            time: 0.0,
            commands: Vec::new(),
            plays: [0.0; 2],
            sliders: [0.0; SLIDERS],
            largest_drift: 0.0,
            readings: vec![(0.0, [0.0; 4])],
        }
    }

    /// Largest command so far, V.
    pub fn peak_command(&self) -> f64 {
        self.commands.iter().fold(0.0f64, |m, u| m.max(u.abs()))
    }

    /// What the sensors show `early` seconds before now.
    pub fn sample(&self, early: f64) -> Reading {
        let [x, mut a, f, s] = self.read(self.time - early);
        let h = &self.hidden;
        if h.accelerometer_delay > 0.0 {
            a = self.read(self.time - early - h.accelerometer_delay)[1];
        }
        let t = self.time - early;
        a = a * (1.0 + h.accelerometer_scale)
            + h.accelerometer_bias
            + GRAVITY * h.accelerometer_tilt * x
            + h.hum * (TAU * 60.0 * t + self.laws.mains_phase).sin();
        let shown = if h.displacement_lag.is_some() {
            self.state[SEEN_X]
        } else {
            x
        };
        let f = f * (1.0 + h.load_cell_scale) + h.load_cell_bias;
        [shown * (1.0 + h.displacement_scale), a, f, s]
    }

    fn read(&self, time: f64) -> Reading {
        let after = self.readings.partition_point(|(t, _)| *t < time);
        let Some(&(t1, second)) = self.readings.get(after) else {
            return self.readings[self.readings.len() - 1].1;
        };
        let Some(&(t0, first)) = after.checked_sub(1).map(|i| &self.readings[i]) else {
            return second;
        };
        let share = (time - t0) / (t1 - t0);
        std::array::from_fn(|i| first[i] + share * (second[i] - first[i]))
    }

    /// Goes on by `period` with `command` held and the unseen voltage going from `before` to `after`.
    pub fn advance(&mut self, command: f64, period: f64, (before, after): (f64, f64)) {
        self.commands.push(command);
        let late = self.hidden.delay / period;
        let whole = late.floor() as usize;
        let arrival = late.fract() * period;
        let back = |k: usize| {
            self.commands
                .len()
                .checked_sub(k + 1)
                .map_or(0.0, |i| self.commands[i])
        };
        let (earlier, later) = (back(whole + 1), back(whole));
        let oldest = self.time - period - self.hidden.accelerometer_delay - 1e-9;
        let keep = self.readings.partition_point(|(t, _)| *t < oldest);
        self.readings.drain(..keep.saturating_sub(1));
        let begin = self.time;
        for (from, to, u) in [(0.0, arrival, earlier), (arrival, period, later)] {
            let steps = ((to - from) / LARGEST_STEP).ceil() as usize;
            let h = (to - from) / steps.max(1) as f64;
            let u = self.through_plays(u);
            for i in 0..steps {
                let t = from + h * i as f64;
                let unseen = |t: f64| u + before + (after - before) * t / period;
                self.time = begin + t;
                self.step(h, [unseen(t), unseen(t + h / 2.0), unseen(t + h)]);
                self.time = begin + t + h;
                let now = self.now(&self.state, unseen(t + h), self.state[D]);
                let reading = [self.state[X], now.table, self.state[FORCE], now.specimen];
                self.readings.push((self.time, reading));
            }
        }
        self.time = begin + period;
    }

    fn through_plays(&mut self, u: f64) -> f64 {
        let width = self.hidden.hysteresis;
        if width == 0.0 {
            return u;
        }
        let widths = match (self.laws.two_plays, self.hidden.outside) {
            (_, Some(Outside::TwoPlays(_))) => [0.2 * width, 1.8 * width],
            (true, _) => [0.6 * width, 1.4 * width],
            _ => [width; 2],
        };
        for (play, width) in self.plays.iter_mut().zip(widths) {
            *play = play.clamp(u - width, u + width);
        }
        (self.plays[0] + self.plays[1]) / 2.0
    }

    fn step(&mut self, h: f64, u: [f64; 3]) {
        let y = self.state;
        let drift = y[D];
        let along = |k: &State, by: f64| std::array::from_fn(|i| y[i] + by * k[i]);
        let k1 = self.now(&y, u[0], drift).derivative;
        let k2 = self.now(&along(&k1, h / 2.0), u[1], drift).derivative;
        let k3 = self.now(&along(&k2, h / 2.0), u[1], drift).derivative;
        let k4 = self.now(&along(&k3, h), u[2], drift).derivative;
        self.state =
            std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        let moved = self.state[D] - drift;
        for i in 0..SLIDERS {
            self.sliders[i] = self.slid(i, moved);
        }
        self.largest_drift = self.largest_drift.max(self.state[D].abs());
    }

    /// Where slider `i` is after a further drift.
    fn slid(&self, i: usize, moved: f64) -> f64 {
        let mean = self.hidden.specimen_yield.unwrap_or(0.0);
        let spread = if matches!(self.hidden.outside, Some(Outside::IwanSpecimen(_))) {
            0.8
        } else {
            0.4
        };
        let place = 2.0 * i as f64 / (SLIDERS - 1) as f64 - 1.0;
        let limit = mean * (1.0 + spread * place);
        (self.sliders[i] + moved).clamp(-limit, limit)
    }

    fn flow(&self, spool: f64, demand: f64, force: f64) -> f64 {
        let h = &self.hidden;
        let limit = h.spool_limit.unwrap_or(f64::INFINITY);
        let mut u = beyond(spool.clamp(-limit, limit) + h.null_bias, h.dead_band);
        u *= (1.0 + h.flow_gain) * (1.0 + h.asymmetry * u.signum());
        let loss = h.droop * demand;
        u *= if self.laws.root_droop {
            (1.0 - loss).max(0.05).sqrt()
        } else {
            1.0 / (1.0 + loss)
        };
        let against = u.signum() * force;
        let stalled = |stall: f64| (1.0 - against / stall).max(0.0).sqrt();
        if let Some(stall) = h.stall_force {
            u *= stalled(stall);
        }
        match h.outside {
            Some(Outside::WarmingOil(change)) => u *= 1.0 + change * (self.time / 20.0 - 0.3),
            Some(Outside::OrificeValve(stall)) => {
                // Laminar below 0.2 V of opening, turbulent beyond.
                let share = u * u / (u * u + 0.04);
                u *= share * stalled(stall) + (1.0 - share) * (1.0 - against / stall);
            }
            _ => {}
        }
        u
    }

    /// Derivatives at `s` with `u` volts at the spool; sliders stood as they are at the drift `origin`.
    fn now(&self, s: &State, u: f64, origin: f64) -> Now {
        let (p, h, laws) = (&self.plant, &self.hidden, &self.laws);
        let mut d = [0.0; N];
        let (force, x, v) = (s[FORCE], s[X], s[V]);

        let mut spool = u;
        if let Some(frequency) = h.spool_lag {
            let w = TAU * frequency;
            spool = s[SPOOL];
            d[SPOOL] = s[SPOOL_RATE];
            d[SPOOL_RATE] = w * (w * (u - s[SPOOL]) - 1.4 * s[SPOOL_RATE]);
        }
        d[DEMAND] = (spool.abs() - s[DEMAND]) / 0.5;
        let flow = self.flow(spool, s[DEMAND], force) - h.leakage * force;
        let ([a2, a1, a0], [b2, b1, b0], [c2, c1, c0]) =
            (p.denominator, p.voltage_to_force, p.velocity_to_force);
        let rate = (s[1] - a2 * force + b2 * flow + c2 * v) / (1.0 + h.compliance * b2);
        let flow = flow - h.compliance * rate;
        d[FORCE] = rate;
        d[1] = s[2] - a1 * force + b1 * flow + c1 * v;
        d[2] = -a0 * force + b0 * flow + c0 * v;

        // Specimen: force of the columns on the table, and of a second mass on the first.
        let (drift, drift_rate) = (s[D], s[DV]);
        let mut k = p.specimen[2] * (1.0 + h.specimen_stiffness);
        if h.degradation > 0.0 {
            let largest = self.largest_drift.max(drift.abs());
            k *= 1.0 - h.degradation * (1.0 - (-largest / laws.degradation_drift).exp());
        }
        let mut columns = k * drift;
        if let Some(lift) = h.uplift {
            columns = k * (drift.clamp(-lift, lift) + laws.uplift_ratio * beyond(drift, lift));
        }
        if let Some(Outside::SpecimenSlack(slack)) = h.outside {
            columns = k * (SLACK * drift.clamp(-slack, slack) + beyond(drift, slack));
        }
        if let Some(yielding) = h.specimen_yield {
            let (exponent, left) = laws.yielding;
            let hysteretic = if laws.iwan {
                let moved = drift - origin;
                (0..SLIDERS).map(|i| self.slid(i, moved)).sum::<f64>() / SLIDERS as f64
            } else {
                let z = s[BOUC_WEN];
                let bent =
                    0.5 * (1.0 + (z * drift_rate).signum()) * (z / yielding).abs().powf(exponent);
                d[BOUC_WEN] = drift_rate * (1.0 - bent);
                z
            };
            columns = k * (left * drift + (1.0 - left) * hysteretic);
        }
        columns += p.specimen[1] * (1.0 + h.specimen_damping) * drift_rate;
        let share = if h.second_mode.is_some() { 0.25 } else { 0.0 };
        let (first, second) = ((1.0 - share) * p.specimen[0], share * p.specimen[0]);
        let mut on_first = 0.0;
        if let Some(frequency) = h.second_mode {
            let w = TAU * frequency;
            on_first = second * w * (w * s[D2] + 0.06 * s[D2V]);
        }
        if h.absent {
            columns = 0.0;
        }

        // Table.
        let mut resisting = (p.table[1] + h.damping) * v + p.table[2] * x + h.cubic * x.powi(3);
        let level = h.coulomb + h.stribeck * (-(v / laws.stribeck_velocity).powi(2)).exp();
        if level > 0.0 {
            resisting += match laws.friction {
                Friction::Tanh { width } => level * (v / width).tanh(),
                Friction::LuGre { deflection } => {
                    let z = s[BRISTLE];
                    // Deflection in units of what it gives way at, so that the level may be any.
                    d[BRISTLE] = (v - v.abs() * z) / deflection;
                    level * z + 0.02 * d[BRISTLE] * deflection
                }
            };
        }
        match h.outside {
            Some(Outside::QuadraticDrag(drag)) => resisting += drag * v * v.abs(),
            Some(Outside::RailRipple(ripple)) => resisting += ripple * (TAU * x / 0.4).sin(),
            Some(Outside::OneSidedStop(stiffness)) => resisting += stiffness * (x - 0.35).max(0.0),
            _ => {}
        }
        let inner = force - resisting;
        let table = (inner + columns) / (p.table[0] + h.payload);
        let mut ground = 0.0;
        if let Some(frequency) = h.foundation {
            let (mass, w) = (12.0 * p.table[0], TAU * frequency);
            ground = -inner / mass - w * w * s[Y] - 0.1 * w * s[YV];
            d[Y] = s[YV];
            d[YV] = ground;
        }
        d[X] = v;
        d[V] = table - ground;
        if let Some(frequency) = h.displacement_lag {
            d[SEEN_X] = TAU * frequency * (x - s[SEEN_X]);
        }
        let mut specimen = 0.0;
        if !h.absent {
            specimen = (on_first - columns) / first;
            d[D] = drift_rate;
            d[DV] = specimen - table;
            d[D2] = s[D2V];
            if second > 0.0 {
                d[D2V] = -on_first / second - specimen;
            }
        }
        Now {
            derivative: d,
            table,
            specimen,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dice::Dice;

    fn rig(hidden: Hidden) -> Rig {
        let heavy = Plant {
            table: [1e9, 0.2465, 23.3189],
            ..NOMINAL
        };
        Rig::new(heavy, hidden, Laws::draw(false, &mut Dice::new(1, 0)))
    }

    #[test]
    fn a_late_command_is_late_by_a_part_of_a_sample() {
        let with = |delay| {
            // The delay of the accelerometer keeps the readings that are compared.
            let mut rig = rig(Hidden {
                delay,
                accelerometer_delay: 0.02,
                ..Hidden::default()
            });
            for k in 0..200 {
                rig.advance(if k < 198 { 1.0 } else { -0.5 }, 0.002, (0.0, 0.0));
            }
            rig
        };
        let (early, late) = (with(0.0), with(0.0013));
        for back in [0.0, 0.0004, 0.0011, 0.0021] {
            let expected = early.read(early.time - back - 0.0013)[2];
            assert!((late.read(late.time - back)[2] - expected).abs() < 1e-3);
        }
    }

    #[test]
    fn steady_sine_force_is_that_of_the_transfer_function() {
        let mut rig = rig(Hidden::default());
        let (period, w) = (1e-3, TAU * 8.0);
        let mut sums = [0.0; 2];
        for k in 0..4000 {
            let t = f64::from(k) * period;
            if k >= 2000 {
                sums[0] += rig.sample(0.0)[2] * (w * t).sin() / 1000.0;
                sums[1] += rig.sample(0.0)[2] * (w * t).cos() / 1000.0;
            }
            rig.advance((w * t).sin(), period, (0.0, 0.0));
        }
        let (nr, ni) = (403.3 - 3430.0 * w * w, 3.86e4 * w);
        let (dr, di) = (178.2 - 56.18 * w * w, 1.333e4 * w - w * w * w);
        let gain = nr.hypot(ni) / dr.hypot(di);
        assert!((sums[0].hypot(sums[1]) / gain - 1.0).abs() < 0.003);
    }

    #[test]
    fn specimen_on_a_heavy_table_rings_with_its_period_and_damping() {
        let mut rig = rig(Hidden::default());
        rig.state[D] = 1.0;
        let damped = TAU * (1.0f64 - 0.0025).sqrt();
        for k in 1..=1000 {
            rig.advance(0.0, 0.002, (0.0, 0.0));
            let t = f64::from(k) * 0.002;
            let expected = (-0.05 * TAU * t).exp()
                * ((damped * t).cos() + 0.05 * TAU / damped * (damped * t).sin());
            assert!((rig.state[D] - expected).abs() < 1e-4, "{t}");
        }
    }
}
