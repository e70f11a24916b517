//! The identified hydraulic rig in the time domain: what its recordings would be.

use nalgebra::{Matrix2, Vector2};
use plant::identified::valve_curve::ValveCurve;
use plant::integration::inner_steps;

use super::equations::HydraulicRig;
use super::friction::SealShape;
use super::seals::Seals;
use super::specimen::SpecimenOverMass;

/// Longest inner step, s.
const LONGEST_STEP: f64 = 1e-4;
/// States beside the spool: oil's force, displacement, velocity; under a specimen also its drift, drift velocity
/// and hysteretic deformation.
const BARE: usize = 3;
const STATES: usize = 6;

/// [`valve_curve::spool_transition`](plant::identified::valve_curve::spool_transition) of a rig.
pub(super) fn spool_transition(rig: &HydraulicRig, time: f64) -> Matrix2<f64> {
    plant::identified::valve_curve::spool_transition(rig.spool_lag, rig.spool_inertia, time)
}

/// A part of the sampling period under one command.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Samples that the command is late.
    back: usize,
    /// Inner steps and their length, s.
    count: u32,
    inner: f64,
    /// The spool's transition over half of an inner step.
    half: Matrix2<f64>,
}

/// A rig ready to be simulated.
#[derive(Debug, Clone)]
pub struct Simulation {
    rig: HydraulicRig,
    mass: f64,
    seals: Seals,
    curve: ValveCurve,
    specimen: Option<SpecimenOverMass>,
    period: f64,
    spool: Vector2<f64>,
    state: [f64; STATES],
    /// Deflection of the seals over that at which they slide.
    seal: f64,
    commands: Vec<f64>,
    before: [f64; 2],
    longest_step: f64,
    pieces: Option<[Piece; 2]>,
}

/// What the sensors show, SI, on the displacement's clock.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shown {
    /// Displacement, m.
    pub displacement: f64,
    /// Acceleration, m/s².
    pub acceleration: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Acceleration of the specimen, m/s².
    pub specimen_acceleration: f64,
}

impl Simulation {
    /// A rig at rest under `payload` (kg) and `specimen`, sampled every `period` s.
    pub fn new(
        rig: HydraulicRig,
        shape: SealShape,
        payload: f64,
        specimen: Option<SpecimenOverMass>,
        period: f64,
    ) -> Self {
        Self {
            rig,
            mass: rig.mass + payload,
            seals: Seals::new(shape),
            curve: ValveCurve::default(),
            seal: 0.0,
            specimen,
            period,
            spool: Vector2::zeros(),
            state: [0.0; STATES],
            commands: Vec::new(),
            before: [0.0; 2],
            longest_step: LONGEST_STEP,
            pieces: None,
        }
    }

    /// The same with inner steps of at most `longest` s.
    #[must_use]
    pub fn with_steps_of(mut self, longest: f64) -> Self {
        self.longest_step = longest;
        self.pieces = None;
        self
    }

    /// The same with a valve that opens as `curve` has it.
    #[must_use]
    pub fn through(mut self, curve: ValveCurve) -> Self {
        self.curve = curve;
        self
    }

    /// The same at rest at `displacement` (m).
    #[must_use]
    pub fn starting_at(mut self, displacement: f64) -> Self {
        self.state[1] = displacement;
        self
    }

    #[inline]
    fn seal_force(&self, v: f64) -> f64 {
        self.rig.seal_damping * v + self.rig.seal_friction * self.seals.force(self.seal, v)
    }

    /// Moves the seals on.
    #[inline]
    fn advance_seal(&mut self, step: f64) {
        self.seal = self.seals.advance(self.seal, self.state[2], step);
    }

    #[inline]
    fn accelerations<const N: usize>(&self, s: &[f64; N]) -> (f64, f64, f64) {
        let force = s[0] - self.seal_force(s[2]);
        let carried = match &self.specimen {
            Some(own) if N == STATES => own.force([s[3], s[4], s[5]]),
            _ => 0.0,
        };
        let pushed = force + self.rig.specimen_mass * carried
            - self.rig.damping * s[2]
            - self.rig.stiffness * s[1];
        (pushed / self.mass, -carried, force)
    }

    #[inline]
    fn rates<const N: usize>(&self, s: &[f64; N], opening: f64) -> [f64; N] {
        let r = &self.rig;
        let (a, carried, _) = self.accelerations(s);
        let mut rates = [0.0; N];
        rates[0] = r.force_rate * opening - r.oil_stiffness * s[2] - r.leakage_rate * s[0];
        rates[1] = s[2];
        rates[2] = a;
        if let Some(own) = &self.specimen
            && N == STATES
        {
            rates[3] = s[4];
            rates[4] = carried - a;
            rates[5] = own.hysteretic_rate(s[4], s[5]);
        }
        rates
    }

    /// The state after a step of `h` s under the openings at its beginning, middle and end (classical
    /// Runge-Kutta).
    #[inline]
    fn moved<const N: usize>(&self, x: &[f64; N], h: f64, openings: &[f64; 3]) -> [f64; N] {
        let along = |k: &[f64; N], h: f64| -> [f64; N] { std::array::from_fn(|i| x[i] + h * k[i]) };
        let k1 = self.rates(x, openings[0]);
        let k2 = self.rates(&along(&k1, 0.5 * h), openings[1]);
        let k3 = self.rates(&along(&k2, 0.5 * h), openings[1]);
        let k4 = self.rates(&along(&k3, h), openings[2]);
        std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// What the sensors show now. Call it once a sample, before [`Self::step`].
    pub fn shown(&mut self) -> Shown {
        let (a, carried, force) = self.accelerations(&self.state);
        // The accelerometers are late by less than a sample, as a rule.
        let part = (self.rig.accelerometer_delay / self.period).clamp(0.0, 1.0);
        let late = |now: f64, before: f64| now + part * (before - now);
        let shown = Shown {
            displacement: self.state[1],
            acceleration: self.rig.accelerometer_scale * late(a, self.before[0]),
            actuator_force: force,
            specimen_acceleration: self.rig.accelerometer_scale * late(carried, self.before[1]),
        };
        self.before = [a, carried];
        shown
    }

    fn pieces(&self) -> [Piece; 2] {
        let late = (self.rig.command_delay / self.period).max(0.0);
        let (whole, part) = (late.floor() as usize, late.fract());
        [(whole + 1, part), (whole, 1.0 - part)].map(|(back, share)| {
            let duration = share * self.period;
            let count = if share > 0.0 {
                inner_steps(duration, self.longest_step)
            } else {
                0
            };
            let inner = duration / f64::from(count.max(1));
            Piece {
                back,
                count,
                inner,
                half: spool_transition(&self.rig, 0.5 * inner),
            }
        })
    }

    /// One period under `command` (V), which acts late by the rig's delay.
    pub fn step(&mut self, command: f64) {
        self.commands.push(command);
        let pieces = self.pieces.unwrap_or_else(|| self.pieces());
        self.pieces = Some(pieces);
        let mut owed = 0.0;
        for piece in pieces {
            let latest = self.commands.len() - 1;
            let command = latest
                .checked_sub(piece.back)
                .map_or(0.0, |k| self.commands[k]);
            let command = Vector2::new(command, 0.0);
            for _ in 0..piece.count {
                let middle = command + piece.half * (self.spool - command);
                let end = command + piece.half * (middle - command);
                let openings = [self.spool, middle, end].map(|at| self.curve.opening(at.x));
                self.spool = end;
                // The seals are stiff: they move on by themselves, half a step to either
                // side (Strang), in one go from one step to the next.
                let half = 0.5 * piece.inner;
                self.advance_seal(owed + half);
                owed = half;
                if self.specimen.is_some() {
                    self.state = self.moved(&self.state, piece.inner, &openings);
                } else {
                    let [force, way, velocity, ..] = self.state;
                    let bare = [force, way, velocity];
                    let bare: [f64; BARE] = self.moved(&bare, piece.inner, &openings);
                    self.state[..BARE].copy_from_slice(&bare);
                }
            }
        }
        self.advance_seal(owed);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Complex;

    use super::*;

    const SHAPE: SealShape = SealShape {
        presliding: 2e-5,
        excess: 0.2,
        stribeck_velocity: 4e-3,
        sharpness: 3.0,
        relaxation: 1e-3,
    };

    /// A rig that forgets how it began within a tenth of a second, under a tone of 5 Hz.
    #[test]
    fn a_tone_is_answered_by_the_response_of_valve_oil_table_and_specimen() {
        const PERIOD: f64 = 2e-3;
        let rig = HydraulicRig {
            spool_lag: 5e-3,
            spool_inertia: 7e-6,
            force_rate: 2e4,
            oil_stiffness: 2e5,
            leakage_rate: 100.0,
            seal_damping: 900.0,
            seal_friction: 0.0,
            mass: 20.0,
            damping: 40.0,
            stiffness: 4e5,
            specimen_mass: 60.0,
            command_delay: 1.7 * PERIOD,
            accelerometer_delay: 0.6 * PERIOD,
            load_cell_delay: 0.0,
            accelerometer_scale: 1.02,
        };
        let specimen = SpecimenOverMass::elastic(20.0, 900.0);
        let omega = TAU * 5.0;
        for carried in [false, true] {
            let mut own = Simulation::new(rig, SHAPE, 3.0, carried.then_some(specimen), PERIOD);
            let mut found = [Complex::new(0.0_f64, 0.0); 4];
            for k in 0..2000 {
                let phase = omega * PERIOD * f64::from(k);
                let shown = own.shown();
                if k >= 1000 {
                    let all = [
                        shown.displacement,
                        shown.acceleration,
                        shown.actuator_force,
                        shown.specimen_acceleration,
                    ];
                    for (sum, value) in found.iter_mut().zip(all) {
                        *sum += Complex::from_polar(value / 500.0, -phase);
                    }
                }
                own.step(phase.cos());
            }
            let s = Complex::new(0.0, omega);
            let half = 0.5 * omega * PERIOD;
            let late = -half - omega * 1.7 * PERIOD;
            let spool =
                Complex::from_polar(half.sin() / half, late) / (1.0 + s * 5e-3 + s * s * 7e-6);
            // The specimen's acceleration over the table's displacement.
            let spring = s * 20.0 + 900.0;
            let above = if carried {
                spring * s * s / (s * s + spring)
            } else {
                Complex::ZERO
            };
            let load = s * s * 23.0 + s * 40.0 + 4e5 + above * 60.0;
            let oil = s * (2e5 / (s + 100.0) + 900.0);
            let x = spool * 2e4 / (s + 100.0) / (load + oil);
            let sensor = 1.02 * (-s * 0.6 * PERIOD).exp();
            let expected = [x, s * s * x * sensor, load * x, above * x * sensor];
            for (found, expected) in found.iter().zip(expected) {
                let off = (found - expected).norm();
                assert!(off <= 2e-3 * expected.norm(), "{found} {expected}");
            }
        }
    }

    #[test]
    fn a_rig_at_rest_begins_where_it_is_put_and_longer_steps_change_little() {
        let rig = HydraulicRig {
            spool_lag: 4.8e-3,
            spool_inertia: 7e-6,
            ..super::super::start::empty()
        };
        let mut own = Simulation::new(rig, SHAPE, 0.0, None, 1e-3).starting_at(0.02);
        own.step(0.0);
        assert_eq!(own.shown().displacement, 0.02);
        let after = |longest: f64| {
            let mut own = Simulation::new(rig, SHAPE, 0.0, None, 0.01).with_steps_of(longest);
            (0..50).for_each(|_| own.step(1.0));
            own.shown().displacement
        };
        let off = (after(1e-3) / after(1e-4) - 1.0).abs();
        assert!(off > 0.0 && off < 1e-4, "{off}");
    }
}
