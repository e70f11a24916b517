//! The identified hydraulic rig in the time domain: what its recordings would be.

use nalgebra::{Matrix2, Vector2};
use plant::identified::valve_curve::ValveCurve;
use plant::integration::{inner_steps, runge_kutta_4};

use super::equations::HydraulicRig;
use super::friction::SealShape;
use super::specimen::SpecimenOverMass;

/// Longest inner step, s.
const LONGEST_STEP: f64 = 1e-4;
/// States beside the spool: part of the inner step that is over, oil's force, displacement, velocity, drift, drift
/// velocity, hysteretic deformation.
const STATES: usize = 7;

/// What a spool that follows a constant command is away from it, and its rate, after `time` (s) over those before.
pub(super) fn spool_transition(rig: &HydraulicRig, time: f64) -> Matrix2<f64> {
    let rates = Matrix2::new(
        0.0,
        1.0,
        -1.0 / rig.spool_inertia,
        -rig.spool_lag / rig.spool_inertia,
    );
    (rates * time).exp()
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
    shape: SealShape,
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
            shape,
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
        self.state[2] = displacement;
        self
    }

    fn seal_force(&self, v: f64) -> f64 {
        self.rig.seal_damping * v + self.rig.seal_friction * self.shape.force(self.seal, v)
    }

    fn accelerations(&self, s: &[f64; STATES]) -> (f64, f64, f64) {
        let force = s[1] - self.seal_force(s[3]);
        let carried = self
            .specimen
            .map_or(0.0, |own| own.force([s[4], s[5], s[6]]));
        let pushed = force + self.rig.specimen_mass * carried
            - self.rig.damping * s[3]
            - self.rig.stiffness * s[2];
        (pushed / self.mass, -carried, force)
    }

    fn rates(&self, s: &[f64; STATES], inner: f64, openings: &[f64; 3]) -> [f64; STATES] {
        let r = &self.rig;
        let (a, carried, _) = self.accelerations(s);
        let opening = openings[(2.0 * s[0]).round().clamp(0.0, 2.0) as usize];
        let mut rates = [0.0; STATES];
        rates[0] = 1.0 / inner;
        rates[1] = r.force_rate * opening - r.oil_stiffness * s[3] - r.leakage_rate * s[1];
        rates[2] = s[3];
        rates[3] = a;
        if let Some(own) = self.specimen {
            rates[4] = s[5];
            rates[5] = carried - a;
            rates[6] = own.hysteretic_rate(s[5], s[6]);
        }
        rates
    }

    /// What the sensors show now. Call it once a sample, before [`Self::step`].
    pub fn shown(&mut self) -> Shown {
        let (a, carried, force) = self.accelerations(&self.state);
        // The accelerometers are late by less than a sample, as a rule.
        let part = (self.rig.accelerometer_delay / self.period).clamp(0.0, 1.0);
        let late = |now: f64, before: f64| now + part * (before - now);
        let shown = Shown {
            displacement: self.state[2],
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
                // side (Strang).
                let half = 0.5 * piece.inner;
                self.seal = self.shape.advance(self.seal, self.state[3], half);
                self.state[0] = 0.0;
                self.state = runge_kutta_4(&self.state, piece.inner, |s| {
                    self.rates(s, piece.inner, &openings)
                });
                self.seal = self.shape.advance(self.seal, self.state[3], half);
            }
        }
    }
}
