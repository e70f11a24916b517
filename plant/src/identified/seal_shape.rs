//! Dry friction of seals as recordings show it: a force over its Coulomb force with a deflection
//! before they slide.

use crate::ModelError;

/// Shape of the friction over its Coulomb force: `z' = v (1 - |z/z_s|^n)` while it is loaded
/// further and `z' = v` while it is unloaded, `z_s = z_c (1 + e exp(-(v/v_s)²))`, force
/// `(z + τ exp(-(v/v_s)²) z')/z_c`. Dahl's law for `n = 1` and `e = 0` (Dahl, Aerospace Report TOR-158, 1968), with the bump of
/// Stribeck that the LuGre model has; a larger `n` slides more abruptly.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SealShape {
    /// `z_c`, m.
    pub presliding: f64,
    /// `e`.
    pub excess: f64,
    /// `v_s`, m/s.
    pub stribeck_velocity: f64,
    /// `n`.
    pub sharpness: f64,
    /// `τ`, damping of the deflection over its stiffness, s.
    pub relaxation: f64,
}

impl SealShape {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_positive("seal_presliding", self.presliding)?;
        ModelError::require_non_negative("seal_excess", self.excess)?;
        ModelError::require_positive("seal_stribeck_velocity", self.stribeck_velocity)?;
        ModelError::require_positive("seal_sharpness", self.sharpness)?;
        ModelError::require_non_negative("seal_relaxation", self.relaxation)
    }

    fn bump(&self, velocity: f64) -> f64 {
        let ratio = velocity / self.stribeck_velocity;
        (-ratio * ratio).exp()
    }

    /// Force over the Coulomb force at a deflection `z` (over `z_c`) and `velocity` (m/s).
    pub fn force(&self, z: f64, velocity: f64) -> f64 {
        let bump = self.bump(velocity);
        let rate = velocity / self.presliding;
        let loaded = if z * velocity <= 0.0 {
            0.0
        } else {
            (z.abs() / (1.0 + self.excess * bump))
                .powf(self.sharpness)
                .min(1.0)
        };
        z + self.relaxation * bump * rate * (1.0 - loaded)
    }

    /// The deflection over `z_c` after `step` s at `velocity` (m/s), from `z` (over `z_c`).
    pub fn advance(&self, z: f64, velocity: f64, step: f64) -> f64 {
        let rate = velocity / self.presliding;
        if z * velocity <= 0.0 {
            // Unloading, at most to zero in one go: beyond, it is loaded the other way.
            let moved = rate * step;
            return if z.abs() > moved.abs() || z == 0.0 {
                z + moved
            } else {
                self.advance(1e-12 * velocity.signum(), velocity, step - (-z / rate))
            };
        }
        let steady = 1.0 + self.excess * self.bump(velocity);
        let n = self.sharpness;
        let part = (z.abs() / steady).powf(n);
        let slope = -rate.abs() * n * part / z.abs().max(1e-12);
        let f = rate * (1.0 - part);
        let x = slope * step;
        let growth = if x.abs() < 1e-9 { 1.0 } else { x.exp_m1() / x };
        let next = z + f * step * growth;
        // From below the level is met, not passed.
        if z.abs() <= steady && next.abs() > steady {
            steady * next.signum()
        } else {
            next
        }
    }

    /// The deflection over `z_c` after `period` s in which the velocity goes evenly from the first to
    /// the second of `velocities` (m/s), from `z` (over `z_c`).
    pub fn follow(&self, mut z: f64, [before, after]: [f64; 2], period: f64) -> f64 {
        const PARTS: usize = 8;
        for part in 0..PARTS {
            let share = (part as f64 + 0.5) / PARTS as f64;
            let velocity = before + share * (after - before);
            z = self.advance(z, velocity, period / PARTS as f64);
        }
        z
    }

    /// Friction over its Coulomb force along `velocity` (m/s, a sample every `period` s).
    pub fn history(&self, velocity: &[f64], period: f64) -> Vec<f64> {
        let mut z = 0.0;
        let mut before = velocity.first().copied().unwrap_or(0.0);
        velocity
            .iter()
            .map(|&v| {
                z = self.follow(z, [before, v], period);
                before = v;
                self.force(z, v)
            })
            .collect()
    }
}
