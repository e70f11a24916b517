//! Dry friction of the seals with a deflection before they slide.

/// Shape of the friction over its Coulomb force: `z' = v (1 - |z/z_s|^n)` while it is loaded
/// further and `z' = v` while it is unloaded, `z_s = z_c (1 + e exp(-(v/v_s)²))`, force `z/z_c`.
/// Dahl's law for `n = 1` and `e = 0` (Dahl, Aerospace Report TOR-158, 1968), with the bump of
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
}

/// Number of [`SealShape`]'s parameters.
pub const SHAPE: usize = 4;

impl SealShape {
    /// The shape `changes` away: logarithms, but the excess itself.
    pub fn changed(&self, changes: &[f64]) -> Self {
        let at = |i: usize| changes.get(i).copied().unwrap_or(0.0);
        Self {
            presliding: self.presliding * at(0).exp(),
            excess: (self.excess + at(1)).max(0.0),
            stribeck_velocity: self.stribeck_velocity * at(2).exp(),
            sharpness: (self.sharpness * at(3).exp()).clamp(1.0, 12.0),
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
        let ratio = velocity / self.stribeck_velocity;
        let steady = 1.0 + self.excess * (-ratio * ratio).exp();
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
                z
            })
            .collect()
    }

    /// The history and its derivatives by [`Self::changed`]'s changes.
    pub fn histories(&self, velocity: &[f64], period: f64) -> Vec<Vec<f64>> {
        const CHANGE: f64 = 0.05;
        let base = self.history(velocity, period);
        let mut all = vec![base];
        for i in 0..SHAPE {
            let beside = |sign: f64| {
                let mut changes = [0.0; SHAPE];
                changes[i] = sign * CHANGE;
                let shape = self.changed(&changes);
                (shape, shape.history(velocity, period))
            };
            let ((_, up), (_, down)) = (beside(1.0), beside(-1.0));
            let slope = up.iter().zip(&down).map(|(a, b)| (a - b) / (2.0 * CHANGE));
            all.push(slope.collect());
        }
        all
    }
}
