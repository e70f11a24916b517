//! The rig, written a second time: inch, pound-force, second, volt.

mod specimen;

use std::f64::consts::TAU;

use crate::form::{Degradation, Droop};
use crate::hidden::Hidden;
use crate::outside::Outside;
use crate::plant::Plant;

/// Standard gravity in in/s².
pub const GRAVITY: f64 = 386.088_58;
/// Samples a second.
pub const RATE: f64 = 500.0;
const SUBSTEPS: usize = 20;
const STEP: f64 = 1.0 / (RATE * SUBSTEPS as f64);

/// Noise-free channels at one sample, after the sensors' own effects.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Displacement in in.
    pub x: f64,
    /// Acceleration in in/s².
    pub a: f64,
    /// Actuator force in lbf.
    pub f: f64,
    /// Specimen acceleration in in/s².
    pub s: f64,
}

const STATES: usize = 22;
type State = [f64; STATES];
// Companion states of the two paths to force.
const VALVE_PATH: usize = 0;
const VELOCITY_PATH: usize = 3;
const X: usize = 6;
const V: usize = 7;
const D: usize = 8;
const DV: usize = 9;
const D2: usize = 10;
const D2V: usize = 11;
const Y: usize = 12;
const YV: usize = 13;
const HYSTERETIC: usize = 14;
const SPOOL: usize = 15;
const SPOOL_RATE: usize = 16;
const DEMAND: usize = 17;
const LAGGED_X: usize = 18;
const PARASITE: usize = 19;
const PARASITE_RATE: usize = 20;
const SLIDER: usize = 21;

/// The rig in motion.
#[derive(Debug, Clone)]
pub struct Rig {
    plant: Plant,
    hidden: Hidden,
    state: State,
    time: f64,
    disturbance: f64,
    play: f64,
    spring_play: f64,
    largest_drift: f64,
    largest_excursion: f64,
    commands: Vec<f64>,
    accelerations: Vec<f64>,
}

struct Forces {
    actuator: f64,
    table_acceleration: f64,
    specimen_acceleration: f64,
    derivative: State,
}

fn outside_band(value: f64, half_width: f64) -> f64 {
    value - value.clamp(-half_width, half_width)
}

impl Rig {
    /// At rest.
    pub fn new(plant: Plant, hidden: Hidden) -> Self {
        Self {
            plant,
            hidden,
            state: [0.0; STATES],
            time: 0.0,
            disturbance: 0.0,
            play: 0.0,
            spring_play: 0.0,
            largest_drift: 0.0,
            largest_excursion: 0.0,
            commands: Vec::new(),
            accelerations: Vec::new(),
        }
    }

    /// What the sensors show now, without noise.
    pub fn sample(&self) -> Sample {
        let h = &self.hidden;
        let forces = self.forces(&self.state, self.flow_command());
        let table = forces.table_acceleration;
        let mut x = if h.holds("displacement_lag") {
            self.state[LAGGED_X]
        } else {
            self.state[X]
        };
        x *= 1.0 + h.value("displacement_scale");
        if let Some(curve) = h.outside(Outside::CurvedDisplacementSensor) {
            x += curve * x.powi(3);
        }
        let delay = h.value("accelerometer_delay");
        let heard = if delay > 0.0 {
            delayed(&self.accelerations, delay, table)
        } else {
            table
        };
        let mut a = heard * (1.0 + h.value("accelerometer_scale"))
            + h.value("accelerometer_bias")
            + GRAVITY * h.value("accelerometer_tilt") * self.state[X];
        a += h.value("mains_hum") * (TAU * 60.0 * self.time + h.form.mains_phase).sin();
        let mut f =
            forces.actuator * (1.0 + h.value("load_cell_scale")) + h.value("load_cell_bias");
        f += h.outside(Outside::LoadCellCrosstalk).unwrap_or(0.0) * table;
        Sample {
            x,
            a,
            f,
            s: forces.specimen_acceleration,
        }
    }

    /// What the table does, which no sensor tells as it is: displacement (in) and acceleration (in/s²).
    pub fn table_motion(&self) -> [f64; 2] {
        let forces = self.forces(&self.state, self.flow_command());
        [self.state[X], forces.table_acceleration]
    }

    /// Advances one sample with `command` held and an unseen voltage `disturbance` beside it.
    pub fn advance(&mut self, command: f64, disturbance: f64) {
        let before_play = self.hidden.form.disturbed_before_play;
        let command = command + if before_play { disturbance } else { 0.0 };
        self.disturbance = if before_play { 0.0 } else { disturbance };
        for _ in 0..SUBSTEPS {
            self.commands.push(command);
            let u = self.flow_command();
            let play = self.hidden.value("valve_hysteresis");
            let delayed_command = self.delayed_command();
            self.play = self
                .play
                .clamp(delayed_command - play, delayed_command + play);
            if let Some(gap) = self.hidden.outside(Outside::SpringPlay) {
                let x = self.state[X];
                self.spring_play = self.spring_play.clamp(x - gap, x + gap);
            }
            self.integrate(u);
            self.time += STEP;
            self.largest_drift = self.largest_drift.max(self.state[D].abs());
            self.largest_excursion = self.largest_excursion.max(self.state[X].abs());
            let table = self.forces(&self.state, u).table_acceleration;
            self.accelerations.push(table);
        }
    }

    /// Kutta's 3/8 rule.
    fn integrate(&mut self, u: f64) {
        let y = self.state;
        let along = |terms: &[(f64, &State)]| {
            let mut next = y;
            for (weight, slope) in terms {
                for i in 0..STATES {
                    next[i] += STEP * weight * slope[i];
                }
            }
            next
        };
        let k1 = self.forces(&y, u).derivative;
        let k2 = self.forces(&along(&[(1.0 / 3.0, &k1)]), u).derivative;
        let k3 = self
            .forces(&along(&[(-1.0 / 3.0, &k1), (1.0, &k2)]), u)
            .derivative;
        let k4 = self
            .forces(&along(&[(1.0, &k1), (-1.0, &k2), (1.0, &k3)]), u)
            .derivative;
        self.state = along(&[(0.125, &k1), (0.375, &k2), (0.375, &k3), (0.125, &k4)]);
    }

    fn delayed_command(&self) -> f64 {
        let command = self.commands.last().copied().unwrap_or(0.0);
        let delay = self.hidden.value("command_delay");
        let mut command = if delay > 0.0 {
            delayed(&self.commands, delay, command)
        } else {
            command
        };
        if let Some(step) = self.hidden.outside(Outside::CoarseConverter) {
            command = (command / step).round() * step;
        }
        command
    }

    /// The command after delay and play: what drives the spool.
    fn flow_command(&self) -> f64 {
        self.disturbance + self.played_command()
    }

    fn played_command(&self) -> f64 {
        if self.hidden.holds("valve_hysteresis") {
            let width = self.hidden.value("valve_hysteresis");
            let command = self.delayed_command();
            return self.play.clamp(command - width, command + width);
        }
        self.delayed_command()
    }

    /// Spool position in volts to flow in volts, before leakage and compliance.
    fn flow(&self, spool: f64, demand: f64, force: f64) -> f64 {
        let h = &self.hidden;
        let mut u = spool;
        if let Some(limit) = h.get("valve_spool_saturation", 0) {
            u = u.clamp(-limit, limit);
        }
        u += h.value("valve_null_bias");
        u = outside_band(u, h.value("valve_dead_band"));
        if let Some(width) = h.outside(Outside::UnderlappedSpool) {
            u += u.clamp(-width, width);
        }
        if let Some(curve) = h.outside(Outside::SoftValve) {
            u /= 1.0 + curve * u.abs();
        }
        u *= 1.0 + h.value("valve_flow_gain");
        u *= 1.0 + h.value("valve_asymmetric_gain") * u.signum();
        let loss = h.value("supply_pressure_droop") * demand;
        u *= match h.form.droop {
            Droop::Hyperbola => 1.0 / (1.0 + loss),
            Droop::Line => (1.0 - loss).max(h.form.droop_floor),
            Droop::Exponential => (-loss).exp(),
            Droop::Root => (1.0 - loss).max(0.0).sqrt().max(h.form.droop_floor),
        };
        if let Some(drift) = h.outside(Outside::WarmingOil) {
            u *= 1.0 + drift * (self.time / 20.0 - 0.3);
        }
        if let Some(stall) = h.get("valve_flow_saturation", 0) {
            u *= (1.0 - u.signum() * force / stall).max(0.0).sqrt();
        }
        u
    }

    fn forces(&self, s: &State, spool_command: f64) -> Forces {
        let (p, h) = (&self.plant, &self.hidden);
        let mut d = [0.0; STATES];
        let path = |start: usize, n: &[f64; 3]| {
            n[2] * s[start] + n[1] * s[start + 1] + n[0] * s[start + 2]
        };
        let actuator =
            path(VALVE_PATH, &p.voltage_to_force) + path(VELOCITY_PATH, &p.velocity_to_force);

        // Valve and oil.
        let lag = h.get("valve_spool_lag", 0);
        let spool = if lag.is_some() {
            s[SPOOL]
        } else {
            spool_command
        };
        if let Some(frequency) = lag {
            let omega = TAU * frequency;
            d[SPOOL] = s[SPOOL_RATE];
            d[SPOOL_RATE] = omega
                * (omega * (spool_command - s[SPOOL]) - 2.0 * h.form.spool_damping * s[SPOOL_RATE]);
        }
        d[DEMAND] = (spool.abs() - s[DEMAND]) / h.form.droop_time;
        let mut flow = self.flow(spool, s[DEMAND], actuator);
        flow -= h.value("internal_leakage") * actuator;
        let companion = |d: &mut State, start: usize, input: f64| {
            let [a2, a1, a0] = p.denominator;
            d[start] = s[start + 1];
            d[start + 1] = s[start + 2];
            d[start + 2] = input - a0 * s[start] - a1 * s[start + 1] - a2 * s[start + 2];
        };
        companion(&mut d, VELOCITY_PATH, s[V]);
        companion(&mut d, VALVE_PATH, flow);
        let compliance = h.value("oil_column_compliance");
        if compliance > 0.0 {
            // dF/dt holds the flow itself: solve for it.
            let rate = path_rate(&d, VALVE_PATH, &p.voltage_to_force)
                + path_rate(&d, VELOCITY_PATH, &p.velocity_to_force);
            let true_rate = rate / (1.0 + compliance * p.voltage_to_force[0]);
            companion(&mut d, VALVE_PATH, flow - compliance * true_rate);
        }

        // Specimen.
        let (restoring, on_second) = self.specimen(s, &mut d);

        // Table and foundation.
        let v = s[V];
        let sign = h.form.friction_sign.at(v, h.form.friction_width);
        let mut friction = h.value("coulomb_friction");
        if let (Some(coulomb), Some(bump)) =
            (h.get("stribeck_friction", 0), h.get("stribeck_friction", 1))
        {
            friction += coulomb
                + bump
                    * (-(v / h.form.stribeck_velocity)
                        .abs()
                        .powf(h.form.stribeck_exponent))
                    .exp();
        }
        if let (Some(mean), Some(difference)) = (
            h.get("directional_friction", 0),
            h.get("directional_friction", 1),
        ) {
            friction += mean + difference * sign;
        }
        if let (Some(fresh), Some(loss)) =
            (h.get("fading_friction", 0), h.get("fading_friction", 1))
        {
            let worn = self.largest_excursion.max(s[X].abs()) / h.form.fading_displacement;
            friction += fresh * (1.0 - loss + loss * (-worn).exp());
        }
        if let Some(rise) = h.outside(Outside::PositionDependentFriction) {
            friction += rise * s[X] * s[X];
        }
        let mut spring = p.table[2] * s[X] + h.value("cubic_stiffness") * s[X].powi(3);
        if h.outside(Outside::SpringPlay).is_some() {
            spring = p.table[2] * self.spring_play;
        }
        if let Some(stiffness) = h.outside(Outside::OneSidedStop) {
            spring += stiffness * (s[X] - 0.35).max(0.0);
        }
        let damping = (p.table[1] + h.value("viscous_damping")) * v
            + h.outside(Outside::QuadraticDrag).unwrap_or(0.0) * v * v.abs()
            + friction * sign;
        let mass = p.table[0] + h.value("added_payload");
        let mut on_table = restoring;
        if let Some(share) = h.outside(Outside::ParasiticOscillator) {
            let (m, omega) = (share * p.table[0], TAU * 9.0);
            on_table += m * (omega * omega * s[PARASITE] + 0.06 * omega * s[PARASITE_RATE]);
        }
        let inner = actuator - damping - spring;
        let absolute = (inner + on_table) / mass;
        let mut foundation = 0.0;
        if let Some(frequency) = h.get("foundation_compliance", 0) {
            let (m, omega) = (h.form.foundation_mass * p.table[0], TAU * frequency);
            foundation =
                -inner / m - omega * omega * s[Y] - 2.0 * h.form.foundation_damping * omega * s[YV];
            d[Y] = s[YV];
            d[YV] = foundation;
        }
        d[X] = v;
        d[V] = absolute - foundation;
        let omega = TAU * 9.0;
        d[PARASITE] = s[PARASITE_RATE];
        d[PARASITE_RATE] =
            -absolute - omega * omega * s[PARASITE] - 0.06 * omega * s[PARASITE_RATE];
        d[LAGGED_X] = h
            .get("displacement_lag", 0)
            .map_or(0.0, |f| TAU * f * (s[X] - s[LAGGED_X]));

        let specimen_acceleration = if h.holds("specimen_absent") {
            h.form.absent_share * absolute
        } else {
            let main = self.specimen_masses().0;
            let acceleration = (on_second - restoring) / main;
            d[D] = s[DV];
            d[DV] = acceleration - absolute;
            d[D2] = s[D2V];
            let second = self.specimen_masses().1;
            d[D2V] = if second > 0.0 {
                -on_second / second - acceleration
            } else {
                0.0
            };
            acceleration
        };
        Forces {
            actuator,
            table_acceleration: absolute,
            specimen_acceleration,
            derivative: d,
        }
    }
}

/// Rate of a path's output from the derivatives of its companion states.
fn path_rate(d: &State, start: usize, n: &[f64; 3]) -> f64 {
    n[2] * d[start] + n[1] * d[start + 1] + n[0] * d[start + 2]
}

/// The value `delay` seconds ago in a history of one entry a substep; zero before its start.
fn delayed(history: &[f64], delay: f64, now: f64) -> f64 {
    let steps = delay / STEP;
    let whole = steps.floor() as usize;
    let share = steps - steps.floor();
    let at = |back: usize| {
        if back == 0 {
            return now;
        }
        history
            .len()
            .checked_sub(back + 1)
            .map_or(0.0, |i| history[i])
    };
    at(whole) * (1.0 - share) + at(whole + 1) * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::NOMINAL;

    #[test]
    fn specimen_on_a_heavy_table_rings_at_its_period_and_damping() {
        let heavy = Plant {
            table: [1e9, 0.2465, 23.3189],
            ..NOMINAL
        };
        let mut rig = Rig::new(heavy, Hidden::default());
        rig.state[D] = 1.0;
        let (omega, ratio) = (TAU, 0.05f64);
        let damped = omega * (1.0 - ratio * ratio).sqrt();
        for k in 1..=2000 {
            rig.advance(0.0, 0.0);
            let t = f64::from(k) / RATE;
            let expected = (-ratio * omega * t).exp()
                * ((damped * t).cos() + ratio * omega / damped * (damped * t).sin());
            assert!(
                (rig.state[D] - expected).abs() < 2e-5,
                "{} at {t} s",
                rig.state[D]
            );
        }
    }

    #[test]
    fn force_under_a_sine_matches_the_transfer_function() {
        // A heavy table stands still: F = G1 u alone.
        let heavy = Plant {
            table: [1e9, 0.2465, 23.3189],
            ..NOMINAL
        };
        let mut rig = Rig::new(heavy, Hidden::default());
        let frequency = 8.0;
        let mut sums = [0.0; 2];
        // Two seconds to settle, two seconds to project on the sine held between samples.
        for k in 0..2000 {
            let phase = TAU * frequency * f64::from(k) / RATE;
            if k >= 1000 {
                let f = rig.sample().f;
                sums[0] += f * phase.sin() / 500.0;
                sums[1] += f * phase.cos() / 500.0;
            }
            rig.advance(phase.sin(), 0.0);
        }
        let w = TAU * frequency;
        let (nr, ni) = (403.3 - 3430.0 * w * w, 3.86e4 * w);
        let (dr, di) = (178.2 - 56.18 * w * w, 1.333e4 * w - w * w * w);
        let gain = nr.hypot(ni) / dr.hypot(di);
        let hold = (w / RATE / 2.0).sin() / (w / RATE / 2.0);
        let got = sums[0].hypot(sums[1]);
        // Images of the hold at 492 and 508 Hz add up to 0.3 %.
        assert!(
            (got / (gain * hold) - 1.0).abs() < 0.005,
            "{got} against {}",
            gain * hold
        );
    }
}
