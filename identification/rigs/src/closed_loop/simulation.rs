//! The identified hydraulic rig in the time domain: what its recordings would be.

use plant::identified::valve_curve::ValveCurve;
use plant::integration::{inner_steps, runge_kutta_4};

use super::equations::HydraulicRig;
use super::friction::SealShape;
use super::specimen::SpecimenOverMass;

/// Longest inner step, s.
const LONGEST_STEP: f64 = 1e-4;
/// States: spool and its rate, oil's force, displacement, velocity, drift, drift velocity,
/// hysteretic deformation.
const STATES: usize = 8;

/// A rig ready to be simulated.
#[derive(Debug, Clone)]
pub struct Simulation {
    rig: HydraulicRig,
    mass: f64,
    shape: SealShape,
    curve: ValveCurve,
    specimen: Option<SpecimenOverMass>,
    period: f64,
    state: [f64; STATES],
    /// Deflection of the seals over that at which they slide.
    seal: f64,
    commands: Vec<f64>,
    before: [f64; 2],
    longest_step: f64,
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
            state: [0.0; STATES],
            commands: Vec::new(),
            before: [0.0; 2],
            longest_step: LONGEST_STEP,
        }
    }

    /// The same with inner steps of at most `longest` s.
    #[must_use]
    pub fn with_steps_of(mut self, longest: f64) -> Self {
        self.longest_step = longest;
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
        self.state[3] = displacement;
        self
    }

    fn seal_force(&self, v: f64) -> f64 {
        self.rig.seal_damping * v + self.rig.seal_friction * self.shape.force(self.seal, v)
    }

    fn accelerations(&self, s: &[f64; STATES]) -> (f64, f64, f64) {
        let force = s[2] - self.seal_force(s[4]);
        let carried = self
            .specimen
            .map_or(0.0, |own| own.force([s[5], s[6], s[7]]));
        let pushed = force + self.rig.specimen_mass * carried
            - self.rig.damping * s[4]
            - self.rig.stiffness * s[3];
        (pushed / self.mass, -carried, force)
    }

    fn rates(&self, s: &[f64; STATES], command: f64) -> [f64; STATES] {
        let r = &self.rig;
        let (a, carried, _) = self.accelerations(s);
        let mut rates = [0.0; STATES];
        rates[0] = s[1];
        rates[1] = (command - s[0] - r.spool_lag * s[1]) / r.spool_inertia;
        rates[2] = r.force_rate * self.curve.opening(s[0])
            - r.oil_stiffness * s[4]
            - r.leakage_rate * s[2];
        rates[3] = s[4];
        rates[4] = a;
        if let Some(own) = self.specimen {
            rates[5] = s[6];
            rates[6] = carried - a;
            rates[7] = own.hysteretic_rate(s[6], s[7]);
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
            displacement: self.state[3],
            acceleration: self.rig.accelerometer_scale * late(a, self.before[0]),
            actuator_force: force,
            specimen_acceleration: self.rig.accelerometer_scale * late(carried, self.before[1]),
        };
        self.before = [a, carried];
        shown
    }

    /// One period under `command` (V), which acts late by the rig's delay.
    pub fn step(&mut self, command: f64) {
        self.commands.push(command);
        let late = (self.rig.command_delay / self.period).max(0.0);
        let (whole, part) = (late.floor() as usize, late.fract());
        let at = |back: usize| {
            let latest = self.commands.len() - 1;
            latest.checked_sub(back).map_or(0.0, |k| self.commands[k])
        };
        let pieces = [(at(whole + 1), part), (at(whole), 1.0 - part)];
        for (command, share) in pieces {
            if share > 0.0 {
                let duration = share * self.period;
                let count = inner_steps(duration, self.longest_step);
                let inner = duration / f64::from(count);
                for _ in 0..count {
                    // The seals are stiff: they move on by themselves, half a step to either
                    // side (Strang).
                    let half = 0.5 * inner;
                    self.seal = self.shape.advance(self.seal, self.state[4], half);
                    self.state = runge_kutta_4(&self.state, inner, |s| self.rates(s, command));
                    self.seal = self.shape.advance(self.seal, self.state[4], half);
                }
            }
        }
    }
}
