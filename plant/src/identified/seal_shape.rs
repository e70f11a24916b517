//! Dry friction of seals as recordings show it: a force over its Coulomb force with a deflection
//! before they slide.

use units::Parameters;

use crate::ModelError;

/// Shape of the friction over its Coulomb force, with presliding `z_c`, excess `e`, Stribeck
/// velocity `v_s`, sharpness `n` and relaxation `τ`: `z' = v (1 - |z/z_s|^n)` while it is loaded
/// further and `z' = v` while it is unloaded, `z_s = z_c (1 + e exp(-(v/v_s)²))`, force
/// `(z + τ exp(-(v/v_s)²) z')/z_c`. Dahl's law for `n = 1` and `e = 0` (Dahl, Aerospace Report TOR-158, 1968), with the bump of
/// Stribeck that the LuGre model has; a larger `n` slides more abruptly.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "seal_")]
pub struct SealShape {
    /// Their deflection before they slide, m.
    #[parameter("m" => "in", positive)]
    pub presliding: f64,
    /// Breakaway force over the Coulomb force, less one.
    #[parameter(non_negative)]
    pub excess: f64,
    /// Stribeck velocity, m/s.
    #[parameter("m/s" => "in/s", positive)]
    pub stribeck_velocity: f64,
    /// Exponent with which they begin to slide.
    #[parameter(positive)]
    pub sharpness: f64,
    /// Damping of their deflection over its stiffness, s.
    #[parameter("s", non_negative)]
    pub relaxation: f64,
}

impl SealShape {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
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

#[cfg(test)]
mod tests {
    use super::*;

    const DAHL: SealShape = SealShape {
        presliding: 1e-4,
        excess: 0.0,
        stribeck_velocity: 0.01,
        sharpness: 1.0,
        relaxation: 0.0,
    };

    #[test]
    fn an_even_slide_builds_up_by_dahls_closed_form() {
        // dz/dx = 1 - z: z = 1 - exp(-x).
        let (velocity, period) = (0.01, 2e-4);
        for (k, force) in DAHL.history(&[velocity; 400], period).iter().enumerate() {
            let way = (k + 1) as f64 * period * velocity / DAHL.presliding;
            assert!((force - (1.0 - (-way).exp())).abs() < 2e-3, "{k}: {force}");
        }
    }

    #[test]
    fn a_reversal_unloads_along_the_elastic_slope_and_slides_the_other_way() {
        let loaded = 0.8;
        // A tenth of the presliding back takes a tenth off.
        let back = DAHL.advance(loaded, -0.01, 0.1 * DAHL.presliding / 0.01);
        assert!((back - 0.7).abs() < 1e-12);
        // Past zero it is loaded the other way, from zero: 1 - exp(-0.5).
        let past = DAHL.advance(loaded, -0.01, 1.3 * DAHL.presliding / 0.01);
        assert!((past + 1.0 - (-0.5_f64).exp()).abs() < 0.03, "{past}");
    }

    #[test]
    fn the_breakaway_force_exceeds_the_coulomb_force_by_the_bump_of_stribeck() {
        let shape = SealShape {
            excess: 0.4,
            sharpness: 3.0,
            ..DAHL
        };
        for velocity in [0.002, 0.01, 0.05] {
            let forces = shape.history(&[velocity; 3000], 2e-4);
            let expected = 1.0 + 0.4 * (-(velocity / 0.01_f64).powi(2)).exp();
            assert!((forces[2999] / expected - 1.0).abs() < 1e-3, "{velocity}");
        }
    }
}
