//! Dry friction of the seals with a deflection before they slide.

/// Shape of the friction over its Coulomb force: `z' = v (1 - |z/z_s|^n)` while it is loaded
/// further and `z' = v` while it is unloaded, `z_s = z_c (1 + e exp(-(v/v_s)²))`, force
/// `(z + τ exp(-(v/v_s)²) z')/z_c`. Dahl's law for `n = 1` and `e = 0` (Dahl, Aerospace Report TOR-158, 1968), with the bump of
/// Stribeck that the LuGre model has; a larger `n` slides more abruptly.
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// Number of [`SealShape`]'s parameters.
pub const SHAPE: usize = 5;

impl SealShape {
    /// What is known of seals before any data, as residuals of unit variance: an excess of
    /// 0.25 ± 0.25, a Stribeck velocity of 4 mm/s and a sharpness of 3, each within a factor of
    /// two to three.
    pub fn surprise(&self) -> [f64; 3] {
        [
            (self.excess - 0.25) / 0.25,
            (self.stribeck_velocity / 4e-3).ln(),
            (self.sharpness / 3.0).ln() / 0.7,
        ]
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

    /// The shape `changes` away: logarithms, but excess and relaxation (ms) themselves.
    pub fn changed(&self, changes: &[f64]) -> Self {
        let at = |i: usize| changes.get(i).copied().unwrap_or(0.0);
        Self {
            presliding: self.presliding * at(0).exp(),
            excess: (self.excess + at(1)).max(0.0),
            stribeck_velocity: self.stribeck_velocity * at(2).exp(),
            sharpness: (self.sharpness * at(3).exp()).clamp(1.0, 12.0),
            relaxation: (self.relaxation + 1e-3 * at(4)).max(0.0),
        }
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

    /// Friction over its Coulomb force along `velocity` (m/s, a sample every `period` s).
    pub fn history(&self, velocity: &[f64], period: f64) -> Vec<f64> {
        const PARTS: usize = 8;
        let mut z = 0.0;
        let mut before = velocity.first().copied().unwrap_or(0.0);
        velocity
            .iter()
            .map(|&v| {
                for part in 0..PARTS {
                    let share = (part as f64 + 0.5) / PARTS as f64;
                    z = self.advance(z, before + share * (v - before), period / PARTS as f64);
                }
                before = v;
                self.force(z, v)
            })
            .collect()
    }

    /// The history and its derivatives by [`Self::changed`]'s changes.
    pub fn histories(&self, velocity: &[f64], period: f64) -> Vec<Vec<f64>> {
        const CHANGE: f64 = 0.05;
        let mut all = vec![self.history(velocity, period)];
        for i in 0..SHAPE {
            let beside = |sign: f64| {
                let mut changes = [0.0; SHAPE];
                changes[i] = sign * CHANGE;
                let shape = self.changed(&changes);
                (shape, shape.history(velocity, period))
            };
            // Upwards only: what may not be negative may be zero.
            let (_, up) = beside(1.0);
            let slope = up.iter().zip(&all[0]).map(|(a, b)| (a - b) / CHANGE);
            let slope = slope.collect();
            all.push(slope);
        }
        all
    }
}
