//! The soft stop: from the velocity of a trip to rest, then null.
//!
//! A servo valve's opening commands a velocity, so a command that falls to zero at once shakes the table
//! harder than the motion did. The stop lets the velocity fall along half a cosine,
//!
//! ```text
//! v(t) = v0 (1 + cos(pi t / T)) / 2,   largest deceleration pi/2 |v0| / T
//! ```
//!
//! without feedback, so that no sensor is trusted after a trip. The command that belongs to `v0` comes from
//! the regression of the command on the velocity in the seconds before; what the last command was beyond
//! it fades within the ramp time.

use std::f64::consts::{FRAC_PI_2, PI};

use units::constants::G;

use super::{Interlock, InterlockInput};

/// Time constant of the regression of the command on the velocity, s.
const LEARNT: f64 = 2.0;
/// Samples over which the displacement is differenced.
const DIFFERENCED: usize = 10;
/// A stop need not be softer than this, m/s².
const SOFT: f64 = 0.05 * G;

/// What the soft stop knows of the run, and where it is.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SoftStop {
    /// Means of command times velocity, of velocity squared and of command squared.
    moments: [f64; 3],
    /// Commands to the valve as a lag of half the window of differences shows them, V.
    lagged: f64,
    /// The latest displacements, the latest first, m.
    displacement: [f64; DIFFERENCED + 1],
    /// The two references before the present one, m, and how many there were.
    reference: [f64; 2],
    samples: usize,
    /// Largest acceleration that the reference asked for, m/s².
    asked: f64,
    /// Velocity before the trip, m/s.
    velocity: f64,
    /// Command of the velocity at the trip, V.
    of_velocity: f64,
    /// What the last command was beyond it, V.
    excess: f64,
    /// Duration, s.
    duration: f64,
    /// Time since the trip, s.
    elapsed: f64,
}

impl SoftStop {
    /// Learns from a sample without a trip: its measurements and the `command` of the sample before (V).
    pub(super) fn learn(&mut self, input: &InterlockInput, command: f64, period: f64) {
        let y = &input.measured;
        if self.samples == 0 {
            self.displacement = [y.displacement; DIFFERENCED + 1];
            self.reference = [input.reference_displacement; 2];
        }
        self.displacement.rotate_right(1);
        self.displacement[0] = y.displacement;
        let [last, before] = self.reference;
        if self.samples >= 2 {
            let bend = input.reference_displacement - 2.0 * last + before;
            self.asked = self.asked.max(bend.abs() / (period * period));
        }
        self.reference = [input.reference_displacement, last];
        let window = DIFFERENCED as f64 * period;
        self.lagged += period / (period + 0.5 * window) * (command - self.lagged);
        let difference = (self.displacement[0] - self.displacement[DIFFERENCED]) / window;
        let weight = period / (period + LEARNT);
        let now = [
            self.lagged * difference,
            difference.powi(2),
            self.lagged.powi(2),
        ];
        for (mean, now) in self.moments.iter_mut().zip(now) {
            *mean += weight * (now - *mean);
        }
        self.samples = self.samples.saturating_add(1);
        // Three views of the velocity: one that a wrong sensor spoils is not in the middle.
        let commanded = self.lagged * self.ratio(2);
        let mut views = [y.velocity, difference, commanded];
        views.sort_by(f64::total_cmp);
        self.velocity = views[1];
    }

    /// Mean of command times velocity over that of a square.
    fn ratio(&self, square: usize) -> f64 {
        match self.moments[square] > 0.0 {
            true => self.moments[0] / self.moments[square],
            false => 0.0,
        }
    }

    /// Begins to stop from `command` (V).
    pub(super) fn begin(&mut self, command: f64, limits: &Interlock, period: f64) {
        let (x, v) = (self.displacement[0], self.velocity);
        let speed = v.abs();
        let ramp = limits.ramp_time.max(period);
        let bearable = limits.stop_acceleration.min(self.asked.max(SOFT));
        let room = limits.displacement_limit - x * v.signum();
        let mut duration = (FRAC_PI_2 * speed / bearable).min(limits.stop_time);
        if speed > 0.0 {
            duration = duration.min(2.0 * (room / speed - limits.reaction_time));
        }
        let largest = limits.saturation_level;
        self.of_velocity = (v * self.ratio(1)).clamp(-largest, largest);
        self.excess = command - self.of_velocity;
        self.duration = duration.max(ramp);
        self.elapsed = 0.0;
    }

    /// The command of the next sample while it stops, V; zero at its end.
    pub(super) fn command(&mut self, ramp_time: f64, period: f64) -> f64 {
        self.elapsed += period;
        let left = |whole: f64| match self.elapsed < whole * (1.0 - 1e-9) {
            true => self.elapsed / whole,
            false => 1.0,
        };
        let (stop, ramp) = (left(self.duration), left(ramp_time.max(period)));
        let fall = match stop < 1.0 {
            true => 0.5 * (1.0 + (PI * stop).cos()),
            false => 0.0,
        };
        self.of_velocity * fall + self.excess * (1.0 - ramp)
    }
}
