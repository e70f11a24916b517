//! Friction of the piston's seals, with stiction that holds.

use crate::ModelError;
use units::Parameters as _;
use units::constants::{INCH, LBF, LBF_PER_INCH, LBF_S_PER_INCH};
use units::vocabulary;

/// The elasto-plastic bristle model (Dupont, Hayward, Armstrong and Altpeter, IEEE Transactions on
/// Automatic Control 47, 2002) with the Stribeck curve of the LuGre model (Canudas de Wit, Olsson,
/// Åström and Lischinsky, ibid. 40, 1995):
/// `dz/dt = v (1 - α(z, v) s0 z sign(v) / g(v))`, `F = s0 z + s1(v) dz/dt + s2 v`,
/// `g(v) = Fc + (Fs - Fc) exp(-(v/vs)²)`.
/// Below the break-away deflection α is zero: the seal is a spring and does not creep under a
/// load that alternates, as it would in the LuGre model.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct SealFriction {
    /// Coulomb friction of the seals, N.
    #[parameter("N" => "lbf", name = vocabulary::COULOMB_FRICTION, non_negative)]
    pub coulomb: f64,
    /// Static friction of the seals, N.
    #[parameter("N" => "lbf", name = "static_friction")]
    pub static_force: f64,
    /// Stribeck velocity, m/s.
    #[parameter("m/s" => "in/s", positive)]
    pub stribeck_velocity: f64,
    /// Viscous friction of the seals, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", name = "seal_viscous_friction", non_negative)]
    pub viscous: f64,
    /// Stiffness of the seals before they slide, N/m.
    #[parameter("N/m" => "lbf/in", name = "seal_stiffness", positive)]
    pub stiffness: f64,
    /// Damping of the seals at rest, N.s/m.
    #[parameter("N.s/m" => "lbf.s/in", non_negative)]
    pub presliding_damping: f64,
}

impl Default for SealFriction {
    fn default() -> Self {
        // Forces and velocity: chosen values of the physical rig, lbf and in/s. Seal stiffness: full
        // friction at a deflection of 0.001 in, assumed, as for elastomers; damping a third of
        // critical with the table's mass.
        Self {
            coulomb: 3.0 * LBF,
            static_force: 4.0 * LBF,
            stribeck_velocity: 0.1 * INCH,
            viscous: 5.0 * LBF_S_PER_INCH,
            stiffness: 4000.0 * LBF_PER_INCH,
            presliding_damping: 14.0 * LBF_S_PER_INCH,
        }
    }
}

/// Part of the Coulomb deflection at which sliding sets in.
const BREAK_AWAY: f64 = 0.7;

impl SealFriction {
    /// Viscous friction alone: the seals as a linear model sees them.
    pub fn viscous_only(viscous: f64) -> Self {
        Self {
            coulomb: 0.0,
            static_force: 0.0,
            viscous,
            ..Self::default()
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated, such as a static friction below the Coulomb
    /// friction.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        let dry = self.coulomb > 0.0 && self.static_force >= self.coulomb;
        if self.static_force.is_finite() && (dry || self.static_force == self.coulomb) {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: Self::STATIC_FRICTION,
            value: self.static_force,
            expected: "at least the Coulomb friction, and zero if that is zero",
        })
    }

    fn is_dry(&self) -> bool {
        self.static_force > 0.0
    }

    /// One over the time (1/s) in which a table that reverses with `acceleration` (m/s²) moves by half of the
    /// deflection at which the seals slide; 0 without dry friction.
    pub(super) fn reversal_rate(&self, acceleration: f64) -> f64 {
        if !self.is_dry() {
            return 0.0;
        }
        (acceleration * self.stiffness / self.coulomb).sqrt()
    }

    fn bump(&self, velocity: f64) -> f64 {
        let square = (velocity / self.stribeck_velocity).powi(2);
        // Beyond this the exponential is below a rounding of 1, and most of the time is spent there.
        if square > 40.0 { 0.0 } else { (-square).exp() }
    }

    /// α and its slope with respect to `|z|`.
    fn plasticity(&self, z: f64, velocity: f64, steady: f64) -> (f64, f64) {
        let start = BREAK_AWAY * self.coulomb / self.stiffness;
        if z * velocity <= 0.0 || z.abs() <= start {
            return (0.0, 0.0);
        }
        let s = (z.abs() - start) / (steady - start);
        if s >= 1.0 {
            return (1.0, 0.0);
        }
        (
            s * s * (3.0 - 2.0 * s),
            6.0 * s * (1.0 - s) / (steady - start),
        )
    }

    /// Force of the seals on the piston against its motion (N) and rate of the deflection (m/s)
    /// at deflection `z` (m) and `velocity` (m/s).
    pub fn force_and_rate(&self, z: f64, velocity: f64) -> (f64, f64) {
        if !self.is_dry() {
            return (self.viscous * velocity, 0.0);
        }
        let bump = self.bump(velocity);
        let level = self.coulomb + (self.static_force - self.coulomb) * bump;
        let steady = level / self.stiffness;
        let (alpha, _) = self.plasticity(z, velocity, steady);
        let rate = velocity * (1.0 - alpha * z.abs() / steady);
        let force =
            self.stiffness * z + self.presliding_damping * bump * rate + self.viscous * velocity;
        (force, rate)
    }

    /// `d(dz/dt)/dz`, 1/s: up to 1e5 at full speed, the stiffest equation of the rig.
    pub fn rate_slope(&self, z: f64, velocity: f64) -> f64 {
        if !self.is_dry() {
            return 0.0;
        }
        let level = self.coulomb + (self.static_force - self.coulomb) * self.bump(velocity);
        let steady = level / self.stiffness;
        let (alpha, slope) = self.plasticity(z, velocity, steady);
        -velocity.abs() * (alpha + z.abs() * slope) / steady
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integration::{Dynamics, advance};

    /// A block of 1 kg on dry seals under a force.
    struct Block {
        friction: SealFriction,
        force: f64,
    }

    impl Dynamics<3> for Block {
        fn derivatives(&self, &[_, v, z]: &[f64; 3]) -> [f64; 3] {
            let (force, rate) = self.friction.force_and_rate(z, v);
            [v, self.force - force, rate]
        }

        fn stiff_diagonal(&self, &[_, v, z]: &[f64; 3]) -> [f64; 3] {
            [0.0, 0.0, self.friction.rate_slope(z, v)]
        }
    }

    #[test]
    fn stiction_holds_under_an_alternating_load_without_creep() {
        let mut block = Block {
            friction: SealFriction::default(),
            force: 0.0,
        };
        let mut x = [0.0; 3];
        let mut after_first = 0.0;
        for cycle in 0..50 {
            // A load with a mean: 30 % ± 30 % of the Coulomb force.
            for part in [0.6, 0.0] {
                block.force = part * block.friction.coulomb;
                x = advance(&block, &x, 0.1, 2e-4);
            }
            if cycle == 0 {
                after_first = x[0];
            }
        }
        assert!(
            (x[0] - after_first).abs() < 1e-9,
            "crept by {:e} m",
            x[0] - after_first
        );
        assert!(x[1].abs() < 1e-6);
    }

    #[test]
    fn sliding_breaks_away_between_static_and_coulomb_force_and_follows_the_stribeck_curve() {
        let friction = SealFriction::default();
        let mut block = Block {
            friction,
            force: 0.95 * friction.coulomb,
        };
        let held = advance(&block, &[0.0; 3], 2.0, 2e-4);
        assert!(held[0] < 1.5 * friction.static_force / friction.stiffness);
        block.force = 1.02 * friction.static_force;
        let slid = advance(&block, &held, 2.0, 2e-4);
        // Steady sliding: force = g(v) + s2 v.
        let g = friction.coulomb
            + (friction.static_force - friction.coulomb)
                * (-(slid[1] / friction.stribeck_velocity).powi(2)).exp();
        let steady = g + friction.viscous * slid[1];
        assert!(slid[0] > 2e-3, "{slid:?}");
        assert!(
            (steady / block.force - 1.0).abs() < 1e-6,
            "{steady} of {}",
            block.force
        );
    }
}
