//! A vote over redundant sensors: the displacement against the acceleration.
//!
//! An observer integrates the acceleration twice and follows the displacement with two equal poles at
//! `p = exp(-omega h)`:
//!
//! ```text
//! x- = x + h v + h^2/2 a,  v- = v + h a,  r = x_measured - x-
//! x = x- + (1 - p^2) r,    v = v- + (1 - p)^2/h r
//! d = (1 - p)^2/h^2 r
//! ```
//!
//! `d` is the difference of the displacement's second derivative and the acceleration behind a lag of second order: the
//! displacement's noise is damped by `omega^2 h^2` where a plain second difference would amplify it.
//!
//! - A residual `r` or an acceleration that changes at once by more than sensors can is a wrong sample: the
//!   observer's prediction takes its place, for at most a bridge time.
//! - A `d` that lasts is an accelerometer that is frozen, reversed, offset or wrongly scaled, or a displacement that is.
//!   It is not judged where the acceleration jumps from sample to sample, as in a loop that chatters.

use std::f64::consts::TAU;

use units::Parameters;
use units::constants::{G, INCH};

use crate::{Controller, ModelError, Motion};

/// Deviations that the measured velocity may have from the observer's until it is trusted again.
const TRUSTED: f64 = 3.0;

/// What is in doubt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[repr(i32)]
pub enum Doubt {
    /// Nothing.
    #[default]
    None = 0,
    /// The displacement jumped; the observer's is given.
    Displacement = 1,
    /// The acceleration jumped; the last one is given.
    Acceleration = 2,
    /// A reading is not a number; the observer's motion is given.
    NotFinite = 3,
    /// Accelerometer and displacement contradict each other.
    Disagreement = 4,
}

impl Doubt {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 5] = [
        Self::None,
        Self::Displacement,
        Self::Acceleration,
        Self::NotFinite,
        Self::Disagreement,
    ];

    /// Its short name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Displacement => "displacement",
            Self::Acceleration => "acceleration",
            Self::NotFinite => "not-finite",
            Self::Disagreement => "disagreement",
        }
    }

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::None => "nothing is in doubt",
            Self::Displacement => "a displacement jumped and was replaced",
            Self::Acceleration => "an acceleration jumped and was replaced",
            Self::NotFinite => "a reading was not a number and was replaced",
            Self::Disagreement => "the accelerometer contradicts the displacement",
        }
    }
}

/// The vote's thresholds and memory.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct SensorVote {
    /// Corner of the observer, Hz.
    #[parameter("Hz", positive)]
    pub observer_corner: f64,
    /// Largest change of the displacement from sample to sample beyond what the acceleration predicts, m.
    #[parameter("m" => "in", positive)]
    pub displacement_jump: f64,
    /// Largest change of the acceleration from sample to sample, m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub acceleration_jump: f64,
    /// Longest time for which wrong samples are replaced, s.
    #[parameter("s", positive)]
    pub bridge_time: f64,
    /// Largest mean difference of the accelerations, m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub offset_limit: f64,
    /// Largest difference of the accelerations as a share of the motion's, both as RMS behind the observer.
    #[parameter(positive)]
    pub disagreement_limit: f64,
    /// RMS of the difference below which it is not judged, m/s2.
    #[parameter("m/s2" => "g", positive)]
    pub disagreement_floor: f64,
    /// Time constant of those means, s.
    #[parameter("s", positive)]
    pub averaging_time: f64,
    /// What the vote remembers.
    pub memory: VoteMemory,
}

/// Memory of [`SensorVote`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct VoteMemory {
    started: bool,
    /// The observer's displacement and velocity.
    estimate: [f64; 2],
    /// The last residual that was trusted, m.
    residual: f64,
    /// The last readings, and the last acceleration that was trusted.
    reading: Motion,
    acceleration: f64,
    force: f64,
    /// How long each of displacement, acceleration and numbers has been replaced, s.
    replaced: [f64; 3],
    /// How long the displacement has been repeated to the bit, s.
    repeated: f64,
    /// The acceleration behind the two lags of the observer.
    lagged: [f64; 2],
    /// Means of the difference, of its square and of the motion's square.
    means: [f64; 3],
    /// Time left until the means go on after an acceleration that jumped, s.
    unsettled: f64,
    /// Mean square difference of the measured velocity and the observer's.
    velocity: f64,
    /// Whether the measured velocity still has a wrong displacement in it.
    velocity_doubted: bool,
}

/// The input of the vote.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VoteInput {
    /// Measured motion.
    pub measured: Motion,
    /// Measured force of the actuator, N.
    pub measured_force: f64,
    /// Whether all readings are numbers.
    pub valid: bool,
}

/// The output of the vote.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Voted {
    /// The motion to be used: the measured one to the bit where nothing is in doubt.
    pub motion: Motion,
    /// The force to be used, N.
    pub force: f64,
    /// Whether all readings were numbers within the bridge time.
    pub valid: bool,
    /// What is in doubt now.
    pub doubt: Doubt,
    /// Whether accelerometer and displacement contradict each other.
    pub disagree: bool,
    /// Whether the displacement jumped for longer than the bridge time.
    pub jumped: bool,
}

impl SensorVote {
    /// Thresholds for the laboratory's sensors, assumed: a jump is a hundred standard deviations of the displacement's
    /// noise, and the difference's noise behind 5 Hz is 0.0013 g.
    pub fn laboratory() -> Self {
        Self {
            observer_corner: 5.0,
            displacement_jump: 0.05 * INCH,
            acceleration_jump: 1.0 * G,
            bridge_time: 0.012,
            offset_limit: 0.03 * G,
            disagreement_limit: 0.5,
            disagreement_floor: 0.01 * G,
            averaging_time: 0.25,
            memory: VoteMemory::default(),
        }
    }

    /// Whether the sensors contradict each other for long, given the observer's present residual (m).
    fn contradicts(&mut self, residual: f64, pole: f64, period: f64) -> bool {
        let m = &mut self.memory;
        let difference = ((1.0 - pole) / period).powi(2) * residual;
        let mut lagged = m.acceleration;
        for state in &mut m.lagged {
            *state += (1.0 - pole) * (lagged - *state);
            lagged = *state;
        }
        // What jumps from sample to sample, as in a loop that chatters, says nothing about a second derivative.
        if m.unsettled > 0.0 {
            m.unsettled -= period;
            return false;
        }
        let motion = lagged + difference;
        let weight = period / (period + self.averaging_time);
        let now = [difference, difference * difference, motion * motion];
        for (mean, now) in m.means.iter_mut().zip(now) {
            *mean += weight * (now - *mean);
        }
        let [offset, square, motion] = m.means;
        let spread = (square - offset * offset).max(0.0);
        offset.abs() > self.offset_limit
            || spread > self.disagreement_floor.powi(2)
                && spread > self.disagreement_limit.powi(2) * motion
    }
}

impl Default for SensorVote {
    fn default() -> Self {
        Self::laboratory()
    }
}

impl Controller for SensorVote {
    type Input = VoteInput;
    type Output = Voted;

    fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        Ok(())
    }

    fn step(&mut self, input: &VoteInput, period: f64) -> Voted {
        let y = input.measured;
        let finite = [
            y.displacement,
            y.velocity,
            y.acceleration,
            input.measured_force,
        ];
        let numbers = input.valid && finite.iter().all(|value| value.is_finite());
        let h = period;
        let pole = (-TAU * self.observer_corner * h).exp();
        let m = &mut self.memory;
        if !m.started && numbers {
            m.estimate = [y.displacement, y.velocity];
            m.acceleration = y.acceleration;
            m.lagged = [y.acceleration; 2];
            m.reading = y;
            m.force = input.measured_force;
            m.started = true;
        }
        if !m.started {
            let valid = numbers;
            return Voted {
                valid,
                ..Voted::default()
            };
        }
        let within = |replaced: f64| replaced < self.bridge_time - 1e-9;
        let mut doubt = Doubt::None;

        // The acceleration: one that jumps waits for a second opinion.
        let jumps = (y.acceleration - m.acceleration).abs() > self.acceleration_jump;
        let replaces = numbers && jumps && within(m.replaced[1]);
        if numbers && jumps {
            m.unsettled = self.averaging_time;
        }
        let predicted_by = m.acceleration;
        if numbers && !replaces {
            m.acceleration = y.acceleration;
        }
        m.replaced[1] = if replaces { m.replaced[1] + h } else { 0.0 };
        if replaces {
            doubt = Doubt::Acceleration;
        }

        // The displacement against what the acceleration predicts.
        let [x, v] = m.estimate;
        let predicted = x + h * v + 0.5 * h * h * predicted_by;
        let velocity = v + 0.5 * h * (predicted_by + m.acceleration);
        let repeats = numbers && y.displacement == m.reading.displacement;
        m.repeated = if repeats { m.repeated + h } else { 0.0 };
        let residual = y.displacement - predicted;
        let jumps = (residual - m.residual).abs() > self.displacement_jump;
        // One that repeats itself did not come anew; that it does so for long is the interlock's matter.
        let is_old = repeats && within(m.repeated);
        let doubted = numbers && jumps && !repeats;
        m.replaced[0] = if doubted { m.replaced[0] + h } else { 0.0 };
        m.replaced[2] = if numbers { 0.0 } else { m.replaced[2] + h };
        let jumped = m.replaced[0] > self.bridge_time + 1e-9;
        let lost = m.replaced[2] > self.bridge_time + 1e-9;
        if numbers && !doubted && !is_old {
            m.residual = residual;
        }
        let used = m.residual;
        m.estimate = [
            predicted + (1.0 - pole * pole) * used,
            velocity + (1.0 - pole).powi(2) / h * used,
        ];
        if numbers {
            m.reading = y;
        }

        let mut motion = Motion {
            acceleration: m.acceleration,
            ..y
        };
        if !numbers {
            motion.displacement = predicted + used;
            motion.velocity = m.estimate[1];
            doubt = Doubt::NotFinite;
            m.velocity_doubted = true;
        } else if doubted {
            motion.displacement = predicted + used;
            doubt = Doubt::Displacement;
            m.velocity_doubted = true;
        }
        let off = (y.velocity - m.estimate[1]).powi(2);
        if m.velocity_doubted && numbers && !doubted && off <= TRUSTED.powi(2) * m.velocity {
            m.velocity_doubted = false;
        }
        if m.velocity_doubted {
            motion.velocity = m.estimate[1];
        } else {
            m.velocity += h / (h + self.averaging_time) * (off - m.velocity);
        }
        if numbers {
            m.force = input.measured_force;
        }
        let force = m.force;
        let disagree = self.contradicts(used, pole, h);
        if disagree {
            doubt = Doubt::Disagreement;
        }
        Voted {
            motion,
            force,
            valid: !lost,
            doubt,
            disagree,
            jumped,
        }
    }

    fn reset(&mut self) {
        self.memory = VoteMemory::default();
    }
}

#[cfg(test)]
mod tests;
