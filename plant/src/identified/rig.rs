//! The identified rig with every catalogue effect: what "extend the model" turns on.

use std::f64::consts::TAU;

use crate::ModelError;
use crate::delay_line::{DelayLine, require_delay};
use crate::identified::effects::valve::CommandPath;
use crate::identified::effects::{self, Effects, Memory, TableMotion};
use crate::identified::extended_table::{self, ExtendedTable};
use crate::identified::shake_table::ShakeTable;
use crate::integration::runge_kutta_4;
use crate::sensors::instrumentation::Instrumentation;
use crate::specimens::extended::{self as extended_specimen, ExtendedSpecimen};
use crate::specimens::linear::LinearSpecimen;
use units::constants::G;

/// Actuator, table and specimen of the thesis with effects and sensors (Eq 2-13, 2-14, A-3).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IdentifiedRig {
    /// Actuator and table.
    pub shake_table: ShakeTable,
    /// The specimen, if one stands on the table.
    pub specimen: Option<LinearSpecimen>,
    /// What the linear model lacks.
    pub effects: Effects,
    /// What the sensors do to the channels; the velocity, noise, ranges and faults are not of
    /// this rig.
    pub sensors: Instrumentation,
}

/// Number of continuous states of [`IdentifiedRig`].
pub const STATES: usize = 16;
const DISPLACEMENT: usize = 3;
const VELOCITY: usize = 4;
const SPOOL: usize = 7;
const FOUNDATION: usize = 10;
const SECOND_MODE: usize = 12;
const HYSTERETIC: usize = 14;
const LAGGED: usize = 15;

/// State of [`IdentifiedRig`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct IdentifiedRigState {
    /// The actuator's three, displacement and velocity (relative to the foundation), drift and
    /// drift velocity; then spool (2), mean demand, foundation (2), second mode (2), hysteretic
    /// deformation, lagged displacement.
    pub continuous: [f64; STATES],
    /// Delay and play of the command.
    pub path: CommandPath,
    /// Largest drift so far, m.
    pub peak_drift: f64,
    /// What the effects remember of the table's motion.
    pub memory: Memory,
    /// Past accelerations, m/s².
    accelerations: DelayLine,
    disturbance: f64,
}

/// What the rig does, without sensors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigMotion {
    /// Displacement of the table relative to the foundation, m.
    pub displacement: f64,
    /// Absolute acceleration of the table, m/s².
    pub acceleration: f64,
    /// Force of the actuator, N.
    pub actuator_force: f64,
    /// Absolute acceleration of the specimen's mass, m/s².
    pub specimen_acceleration: f64,
}

impl IdentifiedRig {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first of table, specimen, effects or sensors that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.shake_table.validate()?;
        if let Some(specimen) = &self.specimen {
            specimen.validate()?;
        }
        self.effects.validate()?;
        self.sensors.validate_values()
    }

    /// The rig without what is not linear about rest: offsets, thresholds, friction, yielding.
    pub fn linear_part(&self) -> Self {
        let mut rig = *self;
        for effect in effects::all().filter(|effect| !effect.is_linear) {
            effect.turn_off(&mut rig.effects, &mut rig.sensors);
        }
        rig
    }

    /// True when an effect is on that needs finer steps than the rig without it.
    pub fn is_fast(&self) -> bool {
        effects::all().any(|effect| effect.is_fast && effect.is_on(&self.effects, &self.sensors))
    }

    /// Indices into [`IdentifiedRigState::continuous`] of the states that move in the linear part.
    pub fn active_states(&self) -> Vec<usize> {
        let mut active = vec![0, 1, 2, 3, 4];
        if self.has_specimen() {
            active.extend([5, 6]);
        }
        if self.effects.valve.spool_frequency > 0.0 {
            active.extend([SPOOL, SPOOL + 1]);
        }
        if self.effects.foundation.frequency > 0.0 {
            active.extend([FOUNDATION, FOUNDATION + 1]);
        }
        if self.has_specimen() && self.effects.specimen.second_mode_frequency > 0.0 {
            active.extend([SECOND_MODE, SECOND_MODE + 1]);
        }
        if self.sensors.displacement.corner > 0.0 {
            active.push(LAGGED);
        }
        active
    }

    /// Index of the state that follows the drift as long as nothing yields.
    pub fn follower(&self) -> Option<usize> {
        self.has_specimen().then_some(HYSTERETIC)
    }

    /// True when a specimen stands on the table.
    pub fn has_specimen(&self) -> bool {
        self.specimen.is_some() && !self.effects.specimen.is_absent()
    }

    /// The rig ready to step with `period` s between samples, each in `substeps` Runge-Kutta
    /// steps of fourth order.
    ///
    /// # Errors
    /// What [`Self::validate`] refuses, and delays longer than
    /// [`MAX_DELAY_SAMPLES`](crate::delay_line::MAX_DELAY_SAMPLES) periods.
    pub fn sample(&self, period: f64, substeps: usize) -> Result<SampledRig, ModelError> {
        self.validate()?;
        ModelError::require_positive("period", period)?;
        self.effects.valve.validate_delay(period)?;
        require_delay(
            "accelerometer_delay",
            self.sensors.acceleration.delay,
            period,
        )?;
        Ok(SampledRig::new(*self, period, substeps.max(1)))
    }
}

/// [`IdentifiedRig`] prepared for one sampling period.
#[derive(Debug, Clone, Copy)]
pub struct SampledRig {
    rig: IdentifiedRig,
    period: f64,
    substeps: usize,
    table: ExtendedTable,
    specimen: ExtendedSpecimen,
    lag_rate: f64,
    products: Option<Products>,
}

/// Stages of a Runge-Kutta step.
const STAGES: usize = 4;
/// What a step follows from: states, the inputs of both pieces of a period, the resisting force at each stage.
const CAUSES: usize = STATES + 2 + STAGES;

/// `N` values for a unit of each cause.
type Responses<const N: usize> = [[f64; N]; CAUSES];

/// Matrix products in the place of the Runge-Kutta steps of a rig whose states follow the flow linearly, but for forces
/// that resist the table's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Products {
    /// Places of the states that move, the first `count` of them; displacement and velocity stay in theirs.
    places: [usize; STATES],
    count: usize,
    /// The input is what drives the spool; elsewhere it is the flow.
    has_spool: bool,
    /// Whether a force resists: then there is one for a step of each piece of a period, else the first is that of
    /// a period.
    is_resisted: bool,
    of_piece: [Product; 2],
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Product {
    /// How often it is used in a period.
    times: usize,
    next: Responses<STATES>,
    /// Displacement and velocity at the second and further stages.
    stages: [Responses<2>; STAGES - 1],
}

impl Product {
    /// From unit perturbations of what runs through the states at the second and further stages to the next ones.
    fn of(
        times: usize,
        run: impl Fn(&[f64; STATES], [f64; 2], [f64; STAGES]) -> [[f64; STATES]; STAGES],
    ) -> Self {
        let mut own = Self {
            times,
            next: [[0.0; STATES]; CAUSES],
            stages: [[[0.0; 2]; CAUSES]; STAGES - 1],
        };
        for cause in 0..CAUSES {
            let unit = |first: usize| f64::from(u8::from(cause == first));
            let ends = run(
                &std::array::from_fn(unit),
                std::array::from_fn(|i| unit(STATES + i)),
                std::array::from_fn(|i| unit(STATES + 2 + i)),
            );
            for (stage, at) in own.stages.iter_mut().zip(ends) {
                stage[cause] = [at[DISPLACEMENT], at[VELOCITY]];
            }
            own.next[cause] = ends[STAGES - 1];
        }
        own
    }

    /// Takes the step: the first `N` of `s`.
    #[inline]
    fn advance<const N: usize>(
        &self,
        s: [f64; N],
        inputs: [f64; 2],
        resistance: Option<impl Fn([f64; 2]) -> f64>,
    ) -> [f64; N] {
        let mut forces = [0.0; STAGES];
        if let Some(resistance) = &resistance {
            forces[0] = resistance([s[DISPLACEMENT], s[VELOCITY]]);
            for (i, responses) in self.stages.iter().enumerate() {
                forces[i + 1] = resistance(sum(responses, &s, &inputs, &forces[..=i]));
            }
        }
        let count = if resistance.is_some() { STAGES } else { 0 };
        sum(&self.next, &s, &inputs, &forces[..count])
    }
}

/// The first `N` values that follow from all causes.
#[inline]
fn sum<const N: usize, const M: usize>(
    responses: &Responses<M>,
    states: &[f64],
    inputs: &[f64; 2],
    forces: &[f64],
) -> [f64; N] {
    let mut sum = [0.0; N];
    let inputs = responses[STATES..].iter().zip(inputs);
    let forces = responses[STATES + 2..].iter().zip(forces);
    for (row, cause) in inputs.chain(forces).chain(responses.iter().zip(states)) {
        for i in 0..N {
            sum[i] += row[i] * cause;
        }
    }
    sum
}

/// Rates of the states that move by a unit of each of them, of the input and of the resisting force.
struct Flow {
    count: usize,
    by_state: [[f64; STATES]; STATES],
    by_input: [f64; STATES],
    by_force: [f64; STATES],
}

impl Flow {
    /// Of a linear `rig` and its `active` states, which come first.
    fn of(rig: IdentifiedRig, active: &[usize]) -> Self {
        let rates = |rig: IdentifiedRig, place: Option<usize>, input: f64| {
            let mut state = [0.0; STATES];
            if let Some(place) = place {
                state[place] = 1.0;
            }
            let sampled = SampledRig::stepwise(rig, 1.0, 1);
            let rates = sampled.derivative(&state, &Memory::default(), 0.0, input);
            let mut packed = [0.0; STATES];
            for (own, &place) in packed.iter_mut().zip(active) {
                *own = rates[place];
            }
            packed
        };
        let mut by_state = [[0.0; STATES]; STATES];
        for (row, &place) in by_state.iter_mut().zip(active) {
            *row = rates(rig, Some(place), 0.0);
        }
        // A damper resists, too; a strong one leaves no rounding.
        let damping = 1e6;
        let mut damped = rig;
        damped.effects.table.viscous_damping += damping;
        let damped = rates(damped, Some(VELOCITY), 0.0);
        Self {
            count: active.len(),
            by_state,
            by_input: rates(rig, None, 1.0),
            by_force: std::array::from_fn(|i| (damped[i] - by_state[VELOCITY][i]) / damping),
        }
    }

    fn rates(&self, s: &[f64; STATES], input: f64, force: f64) -> [f64; STATES] {
        std::array::from_fn(|i| {
            let states = self.by_state.iter().zip(s).take(self.count);
            let states: f64 = states.map(|(row, own)| row[i] * own).sum();
            states + self.by_input[i] * input + self.by_force[i] * force
        })
    }

    /// A Runge-Kutta step of fourth order, of `h` s, with the resisting force given at each stage: the states at the
    /// second and further stages, then the next ones.
    fn step(
        &self,
        s: &[f64; STATES],
        input: f64,
        forces: [f64; STAGES],
        h: f64,
    ) -> [[f64; STATES]; STAGES] {
        let moved = |rates: &[f64; STATES], h: f64| std::array::from_fn(|i| s[i] + h * rates[i]);
        let first = self.rates(s, input, forces[0]);
        let at_second = moved(&first, 0.5 * h);
        let second = self.rates(&at_second, input, forces[1]);
        let at_third = moved(&second, 0.5 * h);
        let third = self.rates(&at_third, input, forces[2]);
        let at_fourth = moved(&third, h);
        let fourth = self.rates(&at_fourth, input, forces[3]);
        let mean =
            std::array::from_fn(|i| (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]) / 6.0);
        [at_second, at_third, at_fourth, moved(&mean, h)]
    }
}

impl Products {
    /// Of `sampled`; none for a rig that is not linear behind the valve's openings but for what resists the table.
    fn of(sampled: &SampledRig) -> Option<Self> {
        let mut rig = sampled.rig;
        let linear = rig.linear_part().effects;
        let valve = &mut rig.effects.valve;
        let has_spool = valve.spool_frequency > 0.0;
        let openings = [
            valve.null_bias,
            valve.dead_band,
            valve.asymmetry,
            valve.spool_limit,
        ];
        if has_spool && openings.iter().any(|size| *size != 0.0) {
            return None;
        }
        valve.hysteresis = 0.0;
        valve.null_bias = 0.0;
        valve.dead_band = 0.0;
        valve.asymmetry = 0.0;
        valve.spool_limit = 0.0;
        let is_resisted = rig.effects != linear;
        rig.effects = rig.effects.without_resistance();
        if rig.effects != linear.without_resistance() {
            return None;
        }
        if !has_spool {
            rig.effects.valve.flow_gain = 0.0;
        }
        let active = rig.active_states();
        let flow = Flow::of(rig, &active);
        let pieces = CommandPath::default().advance(&rig.effects.valve, 0.0, sampled.period);
        let steps = pieces.map(|(_, duration)| duration / sampled.substeps as f64);
        let of_piece = if is_resisted {
            [0, 1].map(|piece| {
                let times = if steps[piece] > 0.0 {
                    sampled.substeps
                } else {
                    0
                };
                Product::of(times, |s, inputs, forces| {
                    flow.step(s, inputs[piece], forces, steps[piece])
                })
            })
        } else {
            let whole = Product::of(1, |s, inputs, _| {
                let mut ends = [*s; STAGES];
                for (input, h) in inputs.into_iter().zip(steps) {
                    for _ in 0..sampled.substeps {
                        ends = flow.step(&ends[STAGES - 1], input, [0.0; STAGES], h);
                    }
                }
                ends
            });
            [whole, Product { times: 0, ..whole }]
        };
        let mut places = [0; STATES];
        places[..active.len()].copy_from_slice(&active);
        Some(Self {
            places,
            count: active.len(),
            has_spool,
            is_resisted,
            of_piece,
        })
    }

    /// A period under the inputs of both its pieces.
    #[inline]
    fn advance<const N: usize>(
        &self,
        effects: &Effects,
        state: &mut IdentifiedRigState,
        inputs: [f64; 2],
    ) {
        let places = &self.places[..self.count];
        let motion = |[displacement, velocity]: [f64; 2]| TableMotion {
            displacement,
            velocity,
        };
        for product in &self.of_piece {
            for _ in 0..product.times {
                let mut own = [0.0; N];
                for (own, place) in own.iter_mut().zip(places) {
                    *own = state.continuous[place % STATES];
                }
                let memory = &mut state.memory;
                let resistance = |at| effects.resisting_force(&motion(at), memory);
                let next = product.advance(own, inputs, self.is_resisted.then_some(resistance));
                for (own, place) in next.iter().zip(places) {
                    state.continuous[place % STATES] = *own;
                }
                if self.is_resisted {
                    effects.remember(memory, &motion([next[DISPLACEMENT], next[VELOCITY]]));
                }
            }
        }
    }
}

/// The states of the table in those of the rig.
#[inline]
fn of_table(s: &[f64; STATES]) -> [f64; extended_table::STATES] {
    [s[0], s[1], s[2], s[3], s[4], s[7], s[8], s[9], s[10], s[11]]
}

/// The states of the specimen in those of the rig.
#[inline]
fn of_specimen(s: &[f64; STATES]) -> [f64; extended_specimen::STATES] {
    [
        s[5],
        s[6],
        s[SECOND_MODE],
        s[SECOND_MODE + 1],
        s[HYSTERETIC],
    ]
}

impl SampledRig {
    fn new(rig: IdentifiedRig, period: f64, substeps: usize) -> Self {
        let mut sampled = Self::stepwise(rig, period, substeps);
        sampled.products = Products::of(&sampled);
        sampled
    }

    /// A rig that is integrated throughout.
    fn stepwise(rig: IdentifiedRig, period: f64, substeps: usize) -> Self {
        Self {
            rig,
            period,
            substeps,
            table: ExtendedTable::new(&rig.shake_table, &rig.effects),
            specimen: ExtendedSpecimen::new(rig.specimen, &rig.effects.specimen),
            lag_rate: TAU * rig.sensors.displacement.corner,
            products: None,
        }
    }

    #[inline]
    fn derivative(
        &self,
        s: &[f64; STATES],
        memory: &Memory,
        peak: f64,
        command: f64,
    ) -> [f64; STATES] {
        let (table, specimen) = (of_table(s), of_specimen(s));
        let force = self.specimen.force(&specimen, peak);
        let (t, acceleration) = self.table.rates(&table, memory, command, force);
        let d = self.specimen.rates(&specimen, force, acceleration);
        let mut rate = [
            t[0], t[1], t[2], t[3], t[4], d[0], d[1], t[5], t[6], t[7], t[8], t[9], d[2], d[3],
            d[4], 0.0,
        ];
        if self.lag_rate > 0.0 {
            rate[LAGGED] = self.lag_rate * (s[3] - s[LAGGED]);
        }
        rate
    }

    #[inline]
    fn runge_kutta(&self, state: &mut IdentifiedRigState, command: f64, h: f64) {
        let (memory, peak) = (state.memory, state.peak_drift);
        state.continuous = runge_kutta_4(&state.continuous, h, |s| {
            self.derivative(s, &memory, peak, command)
        });
        self.table
            .remember(&mut state.memory, &of_table(&state.continuous));
        state.peak_drift = peak.max(state.continuous[5].abs());
    }

    /// One sampling period under a held `command` (V).
    #[inline]
    pub fn step(&self, state: &mut IdentifiedRigState, command: f64) {
        let valve = &self.rig.effects.valve;
        let w = state.disturbance;
        let pieces = state.path.advance(valve, command, self.period);
        if let Some(products) = &self.products {
            let input = |(drive, _): (f64, f64)| match products.has_spool {
                true => drive + w,
                false => valve.flow(drive + w),
            };
            let inputs = pieces.map(input);
            if products.count <= 8 {
                products.advance::<8>(&self.rig.effects, state, inputs);
            } else {
                products.advance::<STATES>(&self.rig.effects, state, inputs);
            }
            state.peak_drift = state.peak_drift.max(state.continuous[5].abs());
            return;
        }
        for (drive, duration) in pieces {
            self.piece(state, drive + w, duration);
        }
    }

    /// A piece of a period, `duration` s, with `drive` (V) at the spool.
    #[inline]
    fn piece(&self, state: &mut IdentifiedRigState, drive: f64, duration: f64) {
        if duration > 0.0 {
            for _ in 0..self.substeps {
                self.runge_kutta(state, drive, duration / self.substeps as f64);
            }
        }
    }

    /// [`Self::step`] with `disturbance` (V) added behind delay and play.
    #[inline]
    pub fn step_disturbed(&self, state: &mut IdentifiedRigState, command: f64, disturbance: f64) {
        state.disturbance = disturbance;
        self.step(state, command);
        state.disturbance = 0.0;
    }

    /// Adds `correction` (m/s²) to the acceleration kept from `age` samples ago.
    #[inline]
    pub fn correct_past(&self, state: &mut IdentifiedRigState, age: usize, correction: f64) {
        state.accelerations.correct(age, correction);
    }

    /// What the rig does in `state`.
    #[inline]
    pub fn motion(&self, state: &IdentifiedRigState) -> RigMotion {
        let s = &state.continuous;
        let specimen = of_specimen(s);
        let force = self.specimen.force(&specimen, state.peak_drift);
        let acceleration = self.table.acceleration(&of_table(s), &state.memory, force);
        RigMotion {
            displacement: s[3],
            acceleration,
            actuator_force: s[0],
            specimen_acceleration: self.specimen.acceleration(&specimen, force, acceleration),
        }
    }

    /// What the sensors show of `state` at `time` s, without noise: displacement, acceleration,
    /// actuator force, specimen acceleration. Call it once a sample: it keeps the past that a
    /// late channel needs.
    #[inline]
    pub fn measure(&self, state: &mut IdentifiedRigState, time: f64) -> [f64; 4] {
        let sensors = &self.rig.sensors;
        let motion = self.motion(state);
        let mut acceleration = motion.acceleration;
        if sensors.acceleration.delay > 0.0 {
            state.accelerations.push(acceleration);
            let late = sensors.acceleration.delay / self.period;
            acceleration = state.accelerations.behind(late);
        }
        acceleration = sensors.acceleration.scaled(acceleration)
            + G * sensors.accelerometer_tilt * motion.displacement
            + sensors.acceleration.hum(time);
        let displacement = if self.lag_rate > 0.0 {
            state.continuous[LAGGED]
        } else {
            motion.displacement
        };
        [
            sensors.displacement.scaled(displacement),
            acceleration,
            sensors.actuator_force.scaled(motion.actuator_force),
            motion.specimen_acceleration,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::constants::SAMPLING_PERIOD as PERIOD;

    fn command(k: u32) -> f64 {
        (0.05 * f64::from(k)).sin()
    }

    fn disturbance(k: u32) -> f64 {
        0.3 * (0.31 * f64::from(k)).cos()
    }

    #[test]
    fn a_disturbance_is_a_voltage_that_adds_to_the_command() {
        let rig = IdentifiedRig::default().sample(PERIOD, 4).unwrap();
        let (mut disturbed, mut commanded) =
            (IdentifiedRigState::default(), IdentifiedRigState::default());
        for k in 0..200 {
            rig.step_disturbed(&mut disturbed, command(k), disturbance(k));
            rig.step(&mut commanded, command(k) + disturbance(k));
            let [a, b] = [&disturbed, &commanded].map(|state| rig.motion(state));
            assert!((a.displacement - b.displacement).abs() < 1e-15);
            assert!((a.actuator_force - b.actuator_force).abs() < 1e-9);
        }
        assert!(disturbed.continuous[3].abs() > 1e-4, "the table moved");
    }

    #[test]
    fn a_disturbance_passes_by_the_delay_and_the_play_of_the_command() {
        let mut rig = IdentifiedRig::default();
        rig.effects.valve.command_delay = 3.0 * PERIOD;
        rig.effects.valve.hysteresis = 10.0;
        let sampled = rig.sample(PERIOD, 4).unwrap();
        let plain = IdentifiedRig::default().sample(PERIOD, 4).unwrap();
        let (mut disturbed, mut bare) =
            (IdentifiedRigState::default(), IdentifiedRigState::default());
        for k in 0..200 {
            // The command is lost in the play.
            sampled.step_disturbed(&mut disturbed, command(k), disturbance(k));
            plain.step(&mut bare, disturbance(k));
            assert!((disturbed.continuous[3] - bare.continuous[3]).abs() < 1e-12);
        }
    }

    #[test]
    fn products_are_the_integration_where_the_rig_is_linear_but_for_openings_and_resistance() {
        type Turn = fn(&mut IdentifiedRig);
        let linear: [Turn; 9] = [
            |_| (),
            |rig| rig.effects.valve.dead_band = 0.05,
            |rig| {
                rig.effects.valve.command_delay = 3.4 * PERIOD;
                rig.effects.valve.asymmetry = 0.2;
                rig.effects.valve.hysteresis = 0.1;
                rig.effects.valve.flow_gain = -0.1;
            },
            |rig| {
                rig.effects.valve.spool_frequency = 30.0;
                rig.effects.valve.flow_gain = 0.2;
                rig.effects.foundation.frequency = 12.0;
                rig.sensors.displacement.corner = 20.0;
            },
            |rig| rig.effects.hydraulics.compliance = 1e-5,
            |rig| {
                rig.effects.valve.null_bias = 0.1;
                rig.effects.valve.spool_limit = 0.8;
                rig.effects.hydraulics.leakage = 1e-3;
            },
            |rig| {
                rig.effects.friction.coulomb_force = 5.0;
                rig.effects.valve.dead_band = 0.05;
                rig.effects.fading_friction.coulomb_force = 2.0;
            },
            |rig| {
                rig.effects.presliding_friction.coulomb_force = 5.0;
                rig.effects.foundation.frequency = 12.0;
                rig.effects.table.cubic_stiffness = 1e6;
            },
            |rig| {
                rig.effects.friction.stribeck_force = 5.0;
                rig.effects.directional_friction.coulomb_force = 3.0;
                rig.effects.valve.command_delay = 3.4 * PERIOD;
                rig.effects.valve.spool_frequency = 30.0;
            },
        ];
        for turn in linear {
            let mut rig = IdentifiedRig {
                specimen: Some(LinearSpecimen::appendix_a()),
                ..Default::default()
            };
            turn(&mut rig);
            let product = rig.sample(PERIOD, 2).unwrap();
            assert!(product.products.is_some());
            let stepwise = SampledRig::stepwise(rig, PERIOD, 2);
            let (mut one, mut other) =
                (IdentifiedRigState::default(), IdentifiedRigState::default());
            let mut largest = [0.0f64; STATES];
            for k in 0..500 {
                product.step_disturbed(&mut one, command(k), disturbance(k));
                stepwise.step_disturbed(&mut other, command(k), disturbance(k));
                for (most, state) in largest.iter_mut().zip(&other.continuous) {
                    *most = most.max(state.abs());
                }
            }
            for i in 0..STATES {
                let off = (one.continuous[i] - other.continuous[i]).abs();
                assert!(off <= 1e-9 * largest[i], "{i}: {off}");
            }
        }
        let nonlinear: [Turn; 3] = [
            |rig| {
                rig.effects.friction.coulomb_force = 5.0;
                rig.effects.hydraulics.stall_force = 300.0;
            },
            |rig| rig.effects.hydraulics.droop_loss = 0.2,
            |rig| {
                rig.effects.valve.spool_frequency = 30.0;
                rig.effects.valve.dead_band = 0.05;
            },
        ];
        for turn in nonlinear {
            let mut rig = IdentifiedRig::default();
            turn(&mut rig);
            assert!(rig.sample(PERIOD, 2).unwrap().products.is_none());
        }
    }

    #[test]
    fn the_active_states_are_those_that_move() {
        type Turn = fn(&mut IdentifiedRig);
        let turns: [Turn; 6] = [
            |_| (),
            |rig| rig.specimen = Some(LinearSpecimen::appendix_a()),
            |rig| rig.effects.valve.spool_frequency = 40.0,
            |rig| rig.effects.foundation.frequency = 12.0,
            |rig| rig.sensors.displacement.corner = 30.0,
            |rig| {
                rig.specimen = Some(LinearSpecimen::appendix_a());
                rig.effects.specimen.second_mode_frequency = 5.0;
                rig.effects.specimen.second_mode_mass_share = 0.2;
            },
        ];
        let all: Turn = |rig| {
            rig.specimen = Some(LinearSpecimen::appendix_a());
            rig.effects.valve.spool_frequency = 40.0;
            rig.effects.foundation.frequency = 12.0;
            rig.sensors.displacement.corner = 30.0;
        };
        for turn in turns.into_iter().chain([all]) {
            let mut rig = IdentifiedRig::default();
            turn(&mut rig);
            let sampled = rig.sample(PERIOD, 8).unwrap();
            let mut state = IdentifiedRigState::default();
            for k in 0..50 {
                sampled.step(&mut state, 0.1 + command(k));
            }
            let moved: Vec<usize> = (0..STATES)
                .filter(|&i| i != HYSTERETIC && state.continuous[i] != 0.0)
                .collect();
            let mut active = rig.active_states();
            active.sort_unstable();
            assert_eq!(moved, active);
            let is_fast = rig.effects.valve.spool_frequency > 0.0;
            assert!(!is_fast || rig.is_fast());
        }
    }
}
