//! Details of the effects' forms that the catalogue leaves open. The usual form is what the
//! practice records show where they show it; a stated share of the cases has another one.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::world::World;

/// Share of the cases whose forms are not the usual ones.
pub const SHARE_OF_OTHER_FORMS: f64 = 0.2;

/// How flow falls with the mean demand m and the loss L.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Droop {
    /// `1 / (1 + L m)`.
    Hyperbola,
    /// `max(1 - L m, floor)`.
    Line,
    /// `exp(-L m)`.
    Exponential,
    /// `(1 - L m)^(1/2)`, an orifice's flow under a pressure that falls with the demand; no less than the
    /// floor.
    Root,
}

/// How friction goes through zero velocity, of width w.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    /// `tanh(v/w)`.
    HyperbolicTangent,
    /// `2/pi arctan(pi v / (2 w))`.
    Arctangent,
    /// `v / (v² + w²)^(1/2)`.
    Root,
}

impl Sign {
    /// Its value at velocity `v` with width `w`.
    pub fn at(self, v: f64, w: f64) -> f64 {
        use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
        match self {
            Self::HyperbolicTangent => (v / w).tanh(),
            Self::Arctangent => FRAC_2_PI * (FRAC_PI_2 * v / w).atan(),
            Self::Root => v / v.hypot(w),
        }
    }
}

/// How the hysteretic part z of a drift goes over into yielding at y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Yielding {
    /// Bouc and Wen: `dz = (1 - (1 + sign(z v))/2 |z/y|^n) v`.
    BoucWen,
    /// Elastic, then plastic: `z` stands at `y`.
    Bilinear,
}

/// How stiffness falls with the largest drift so far, from 0 to the full loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degradation {
    /// `1 - exp(-d/d_0)`.
    Exponential,
    /// `d / (d + d_0)`.
    Hyperbola,
    /// `min(d/d_0, 1)`.
    Line,
}

/// Forms of all effects in one case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Form {
    /// True for the usual forms.
    pub usual: bool,
    /// The friction's sign function.
    pub friction_sign: Sign,
    /// Its width, in/s.
    pub friction_width: f64,
    /// Velocity of the Stribeck bump, in/s.
    pub stribeck_velocity: f64,
    /// Exponent in the Stribeck bump.
    pub stribeck_exponent: f64,
    /// Excursion over which friction fades, in.
    pub fading_displacement: f64,
    /// Law of yielding.
    pub yielding: Yielding,
    /// Its sharpness.
    pub yield_exponent: f64,
    /// Stiffness after yielding over stiffness before.
    pub yield_ratio: f64,
    /// Stiffness after uplift over stiffness before.
    pub uplift_ratio: f64,
    /// Damping ratio of the second mode.
    pub second_mode_damping: f64,
    /// Damping ratio of the spool.
    pub spool_damping: f64,
    /// Droop against mean demand.
    pub droop: Droop,
    /// Least share of flow that a linear droop leaves.
    pub droop_floor: f64,
    /// Time constant of the accumulator, s.
    pub droop_time: f64,
    /// Loss of stiffness against the largest drift.
    pub degradation: Degradation,
    /// Its drift, in.
    pub degradation_drift: f64,
    /// Damping ratio of the foundation.
    pub foundation_damping: f64,
    /// Mass of the foundation in masses of the table.
    pub foundation_mass: f64,
    /// Share of the table's acceleration on the channel of a specimen that is absent.
    pub absent_share: f64,
    /// Phase of the mains, rad.
    pub mains_phase: f64,
    /// True where the unseen disturbance enters before the valve's delay and play.
    pub disturbed_before_play: bool,
}

impl Default for Form {
    fn default() -> Self {
        Self {
            usual: true,
            friction_sign: Sign::HyperbolicTangent,
            friction_width: 0.1,
            stribeck_velocity: 0.5,
            stribeck_exponent: 2.0,
            fading_displacement: 0.3,
            yielding: Yielding::BoucWen,
            yield_exponent: 3.0,
            yield_ratio: 0.05,
            uplift_ratio: 0.2,
            second_mode_damping: 0.03,
            spool_damping: 0.7,
            droop: Droop::Hyperbola,
            droop_floor: 0.1,
            droop_time: 0.5,
            degradation: Degradation::Exponential,
            degradation_drift: 0.8,
            foundation_damping: 0.05,
            foundation_mass: 12.0,
            absent_share: 0.0,
            mains_phase: 0.0,
            disturbed_before_play: false,
        }
    }
}

impl Form {
    /// Draws the details: always those that neither the read-me nor the practice records tell,
    /// those that they do tell with the probability [`SHARE_OF_OTHER_FORMS`], or always in the open
    /// world.
    pub fn draw(rng: &mut ChaCha8Rng, world: World) -> Self {
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.random_range(0.0..1.0));
        let untold = Self {
            stribeck_velocity: between(0.3, 1.0),
            uplift_ratio: between(0.1, 0.4),
            droop_floor: between(0.05, 0.3),
            degradation_drift: between(0.5, 1.5),
            mains_phase: between(1e-3, 1.0) * std::f64::consts::TAU,
            ..Self::default()
        };
        let other = Self {
            usual: false,
            friction_width: between(0.03, 0.2),
            yield_exponent: between(1.5, 6.0),
            yield_ratio: between(0.02, 0.15),
            second_mode_damping: between(0.015, 0.06),
            spool_damping: between(0.6, 0.85),
            droop_time: between(0.35, 0.7),
            foundation_damping: between(0.03, 0.08),
            foundation_mass: between(10.0, 14.0),
            ..untold
        };
        let is_other = rng.random_bool(SHARE_OF_OTHER_FORMS) || world == World::Open;
        let chosen = if is_other { other } else { untold };
        let droops = [Droop::Hyperbola, Droop::Line, Droop::Exponential];
        let degradations = [
            Degradation::Exponential,
            Degradation::Hyperbola,
            Degradation::Line,
        ];
        let drawn = Self {
            stribeck_exponent: if rng.random_bool(0.3) { 1.0 } else { 2.0 },
            droop: droops[rng.random_range(0..3)],
            degradation: degradations[rng.random_range(0..3)],
            absent_share: f64::from(rng.random_bool(0.5)),
            disturbed_before_play: rng.random_bool(0.5),
            ..chosen
        };
        if world != World::Open {
            return drawn;
        }
        // Laws that a diagnosis need not hold.
        let signs = [Sign::HyperbolicTangent, Sign::Arctangent, Sign::Root];
        let is_bilinear = rng.random_bool(0.3);
        Self {
            friction_sign: signs[rng.random_range(0..3)],
            yielding: if is_bilinear {
                Yielding::Bilinear
            } else {
                Yielding::BoucWen
            },
            droop: if rng.random_bool(0.25) {
                Droop::Root
            } else {
                drawn.droop
            },
            ..drawn
        }
    }
}
