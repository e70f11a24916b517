//! The seals' dry friction ([`SealShape`]) with tables in place of its transcendental functions, for replays that
//! evaluate it some hundred million times.

use std::sync::LazyLock;

use super::friction::SealShape;

/// Stribeck velocities from which on a seal that slides has its Coulomb force, to rounding.
const FAST: f64 = 6.0;
/// Deflections over that of a steady slide between which its powers are tabulated: those near rest have no fourth
/// derivative.
const LOADED: [f64; 2] = [0.0625, 1.25];
/// Exponent below which `(1 - exp(-x))/x` is `1/x` within a part in 1e9.
const GROWN: f64 = 20.0;

/// A function on a range from zero, as cubics between values and slopes at equal steps.
#[derive(Debug, Clone)]
struct Table {
    steps: f64,
    cubics: Vec<[f64; 4]>,
}

impl Table {
    /// `of` gives value and slope; `steps` are those to one.
    fn new(range: f64, steps: f64, of: impl Fn(f64) -> (f64, f64)) -> Self {
        let count = (range * steps).ceil() as usize;
        let cubics = (0..count).map(|i| {
            let at = |i: usize| of(i as f64 / steps);
            let ((a, da), (b, db)) = (at(i), at(i + 1));
            let (da, db) = (da / steps, db / steps);
            [
                a,
                da,
                3.0 * (b - a) - 2.0 * da - db,
                2.0 * (a - b) + da + db,
            ]
        });
        Self {
            steps,
            cubics: cubics.collect(),
        }
    }

    /// The function at `x`; `None` beyond the range.
    #[inline]
    fn at(&self, x: f64) -> Option<f64> {
        let place = x * self.steps;
        let i = place as usize;
        let [a, b, c, d] = self.cubics.get(i)?;
        let t = place - i as f64;
        Some(a + t * (b + t * (c + t * d)))
    }
}

/// `exp(-r²)`.
static BUMP: LazyLock<Table> = LazyLock::new(|| {
    Table::new(FAST, 32.0, |r| {
        let bump = (-r * r).exp();
        (bump, -2.0 * r * bump)
    })
});

/// `(1 - exp(-x))/x`.
static GROWTH: LazyLock<Table> = LazyLock::new(|| {
    Table::new(GROWN, 16.0, |x| {
        if x == 0.0 {
            return (1.0, -0.5);
        }
        let growth = -(-x).exp_m1() / x;
        (growth, ((-x).exp() - growth) / x)
    })
});

/// Seals of a shape: force and deflection are those of [`SealShape`] within 1e-6 of the Coulomb force.
#[derive(Debug, Clone)]
pub(super) struct Seals {
    shape: SealShape,
    /// One over presliding (1/m) and Stribeck velocity (s/m).
    stiffness: f64,
    slowness: f64,
    bump: &'static Table,
    growth: &'static Table,
    /// Powers of the deflection over that of a steady slide.
    powers: Table,
}

impl Seals {
    pub fn new(shape: SealShape) -> Self {
        let n = shape.sharpness;
        Self {
            shape,
            stiffness: 1.0 / shape.presliding,
            slowness: 1.0 / shape.stribeck_velocity,
            bump: &BUMP,
            growth: &GROWTH,
            powers: Table::new(LOADED[1], 128.0, |y| (y.powf(n), n * y.powf(n - 1.0))),
        }
    }

    #[inline]
    fn bump(&self, velocity: f64) -> f64 {
        self.bump.at(velocity.abs() * self.slowness).unwrap_or(0.0)
    }

    #[inline]
    fn power(&self, y: f64) -> f64 {
        let known = if y < LOADED[0] {
            None
        } else {
            self.powers.at(y)
        };
        known.unwrap_or_else(|| y.powf(self.shape.sharpness))
    }

    /// As [`SealShape::force`].
    #[inline]
    pub fn force(&self, z: f64, velocity: f64) -> f64 {
        let own = &self.shape;
        if own.relaxation == 0.0 {
            return z;
        }
        let bump = self.bump(velocity);
        if bump == 0.0 {
            return z;
        }
        let rate = velocity * self.stiffness;
        let loaded = if z * velocity <= 0.0 {
            0.0
        } else {
            self.power(z.abs() / (1.0 + own.excess * bump)).min(1.0)
        };
        z + own.relaxation * bump * rate * (1.0 - loaded)
    }

    /// As [`SealShape::advance`].
    #[inline]
    pub fn advance(&self, z: f64, velocity: f64, step: f64) -> f64 {
        const ROUNDING: f64 = 1e-12;
        let own = &self.shape;
        let rate = velocity * self.stiffness;
        let (mut z, mut step) = (z, step);
        if z * velocity <= 0.0 {
            let moved = rate * step;
            if z.abs() > moved.abs() || z == 0.0 {
                return z + moved;
            }
            // Past zero it is loaded the other way.
            step += z / rate;
            z = 1e-12 * velocity.signum();
        }
        let bump = self.bump(velocity);
        if bump == 0.0 && (z.abs() - 1.0).abs() < ROUNDING {
            return z;
        }
        let steady = 1.0 + own.excess * bump;
        let part = self.power(z.abs() / steady);
        let slope = rate.abs() * own.sharpness * part / z.abs().max(1e-12);
        let x = slope * step;
        let growth = self.growth.at(x).unwrap_or(1.0 / x);
        let next = z + rate * (1.0 - part) * step * growth;
        // From below the level is met, not passed.
        if z.abs() <= steady && next.abs() > steady {
            steady * next.signum()
        } else {
            next
        }
    }

    /// As [`SealShape::history`].
    pub fn history(&self, velocity: &[f64], period: f64) -> Vec<f64> {
        const PARTS: usize = 8;
        let mut z = 0.0;
        let mut before = velocity.first().copied().unwrap_or(0.0);
        let at = |v: &f64| {
            for part in 0..PARTS {
                let share = (part as f64 + 0.5) / PARTS as f64;
                z = self.advance(z, before + share * (v - before), period / PARTS as f64);
            }
            before = *v;
            self.force(z, *v)
        };
        velocity.iter().map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shapes from the softest to the most abrupt, under motions that stick, creep, slide and reverse.
    #[test]
    fn tables_follow_the_law() {
        for (excess, sharpness, relaxation) in [
            (0.0, 1.0, 0.0),
            (0.3, 1.7, 2e-3),
            (0.8, 3.0, 0.0),
            (0.2, 12.0, 1e-3),
            (1.5, 5.5, 4e-3),
        ] {
            let shape = SealShape {
                presliding: 3e-5,
                excess,
                stribeck_velocity: 5e-3,
                sharpness,
                relaxation,
            };
            let seals = Seals::new(shape);
            let (mut exact, mut own) = (0.0, 0.0);
            let mut largest = 0.0_f64;
            for k in 0..200_000 {
                let t = f64::from(k) * 5e-4;
                let size = 0.08 * (0.11 * t).sin().powi(4);
                let v = size * ((7.3 * t).sin() + 0.4 * (31.0 * t).cos());
                exact = shape.advance(exact, v, 5e-4);
                own = seals.advance(own, v, 5e-4);
                largest = largest.max((shape.force(exact, v) - seals.force(own, v)).abs());
            }
            assert!(
                largest < 1e-6,
                "{excess} {sharpness} {relaxation}: {largest:e}"
            );
        }
    }
}
