//! Friction that builds up over a displacement.

/// Parts of a build-up's displacement over which the bracket of a sharp yield is constant, and most parts of a step.
const PARTS: f64 = 4.0;
const MOST: usize = 16;

/// The share z of a friction that is taken up, `z' = v / d (1 - z sgn v)` (Dahl 1968). One that creeps yields
/// sharply: `z' = v / d (1 - |z|^p z sgn v) - r z` while it grows and `z' = v / d - r z` where it falls.
pub(super) struct Friction {
    /// d, m.
    pub build_up: f64,
    /// r, 1/s; 0 where it does not creep.
    pub creep: f64,
    /// p.
    pub exponent: f64,
}

impl Friction {
    /// The share after `z`, when it has `moved` in `h`: exact but for the sharp yield.
    pub fn after(&self, z: f64, moved: f64, h: f64) -> f64 {
        let path = moved.abs() / self.build_up;
        if self.creep <= 0.0 {
            return relaxed(z, path.copysign(moved), path);
        }
        let parts = ((PARTS * path).ceil() as usize).clamp(1, MOST) as f64;
        let (own, crept) = (path / parts, self.creep * h / parts);
        let mut z = z;
        for _ in 0..parts as usize {
            let held = if z * moved > 0.0 {
                own * z.abs().powf(self.exponent)
            } else {
                0.0
            };
            z = relaxed(z, own.copysign(moved), held + crept).clamp(-1.0, 1.0);
        }
        z
    }
}

/// `z` at 1 of `z' = drive - gone z`.
fn relaxed(z: f64, drive: f64, gone: f64) -> f64 {
    if gone < 1e-9 {
        return z + drive;
    }
    let left = (-gone).exp();
    left * z + (1.0 - left) * (drive / gone)
}

#[cfg(test)]
mod tests {
    use super::Friction;

    /// The same equation by many small explicit steps.
    fn integrated(of: &Friction, mut z: f64, moved: f64, h: f64) -> f64 {
        let steps = 200_000;
        let (own, dt) = (moved / of.build_up / f64::from(steps), h / f64::from(steps));
        for _ in 0..steps {
            let bracket = if of.creep == 0.0 {
                1.0 - z * moved.signum()
            } else if z * moved < 0.0 {
                1.0
            } else {
                1.0 - z.abs().powf(of.exponent) * z * moved.signum()
            };
            z += own * bracket - of.creep * z * dt;
        }
        z
    }

    #[test]
    fn a_step_is_that_of_the_equation() {
        for (creep, exponent, near) in [(0.0, 3.0, 1e-5), (2.0, 3.0, 0.02), (20.0, 3.0, 0.02)] {
            let of = Friction {
                build_up: 4e-4,
                creep,
                exponent,
            };
            for (z, moved) in [(0.0, 1e-4), (0.9, -3e-4), (-0.5, 9e-4), (0.7, 1e-5)] {
                let (own, other) = (of.after(z, moved, 0.01), integrated(&of, z, moved, 0.01));
                assert!(
                    (own - other).abs() < near,
                    "{creep} {exponent} {z}: {own}, {other}"
                );
            }
        }
    }
}
