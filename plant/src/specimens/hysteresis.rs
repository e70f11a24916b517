//! Hysteresis of the Bouc-Wen family: yielding with hardening, degradation and pinching.

use crate::ModelError;
use units::Parameters;
use units::constants::{INCH, LBF};

/// Restoring force of a yielding spring (Bouc 1967, Wen 1976; degradation after Baber and Wen
/// 1981, pinching after Baber and Noori 1985):
/// `F = r k d + (1 - r) F_y z + h F_y (d/d_y)³`, `k = F_y/d_y`,
/// `dz/dt = d'/d_y · p(z) [1 - ν |z|^n (γ + β sign(d' z))] / η`,
/// `ν = 1 + δ_ν ε`, `η = 1 + δ_η ε`,
/// `p(z) = 1 - ζ (1 - e^(-2 ε)) exp(-((z sign(d') - q)/ψ)²)`, where `ε` is the work done on the
/// hysteretic part in units of `F_y d_y`. The fields are `F_y`, `d_y`, `r`, `n`, `β`, `γ`, `h`, `δ_ν`,
/// `δ_η`, `ζ`, `q` and `ψ` in this order. Off by default: h, δ_ν, δ_η, ζ.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
pub struct BoucWen {
    /// Yield force, N.
    #[parameter("N" => "lbf", positive)]
    pub yield_force: f64,
    /// Yield displacement, m.
    #[parameter("m" => "in", positive)]
    pub yield_displacement: f64,
    /// Stiffness after yielding over that before.
    ///
    /// Kinematic hardening.
    #[parameter(finite)]
    pub post_yield_ratio: f64,
    /// n of the Bouc-Wen model.
    ///
    /// Sharpness of the yield point, at least 1.
    #[parameter]
    pub sharpness: f64,
    /// beta of the Bouc-Wen model.
    #[parameter]
    pub beta: f64,
    /// gamma of the Bouc-Wen model.
    #[parameter]
    pub gamma: f64,
    /// Cubic hardening: force at the yield displacement over the yield force.
    ///
    /// Plates that begin to pull as membranes.
    #[parameter(non_negative)]
    pub hardening: f64,
    /// Loss of strength with hysteretic work.
    #[parameter(non_negative)]
    pub strength_degradation: f64,
    /// Loss of stiffness with hysteretic work.
    #[parameter(non_negative)]
    pub stiffness_degradation: f64,
    /// Loss of slope in the pinched range.
    ///
    /// After much work, below 1.
    #[parameter]
    pub pinching: f64,
    /// Middle of the pinched range over the yield force.
    #[parameter(finite)]
    pub pinching_level: f64,
    /// Width of the pinched range over the yield force.
    #[parameter(positive)]
    pub pinching_width: f64,
}

/// State of a [`BoucWen`] spring besides its deformation.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Hysteresis {
    /// `z`, force of the hysteretic part over its yield force.
    pub z: f64,
    /// `ε`, work done on the hysteretic part over `F_y d_y`.
    pub work: f64,
}

impl Default for BoucWen {
    fn default() -> Self {
        // Chosen values of the yielding specimen: 6 lbf, 0.147 in, 0.05, n = 1.5, 0.5, 0.5.
        Self {
            yield_force: 6.0 * LBF,
            yield_displacement: 0.147 * INCH,
            post_yield_ratio: 0.05,
            sharpness: 1.5,
            beta: 0.5,
            gamma: 0.5,
            hardening: 0.0,
            strength_degradation: 0.0,
            stiffness_degradation: 0.0,
            pinching: 0.0,
            pinching_level: 0.1,
            pinching_width: 0.2,
        }
    }
}

/// Share of a deformation that loads the hysteretic part elastically, `1 - ν |z|^n w`, from `z` (its
/// force over the yield force), the sharpness `n`, the loss of strength `ν` and the weight
/// `w = γ + β sign(d' z)`.
#[inline]
pub fn elastic_share(z: f64, sharpness: f64, strength: f64, weight: f64) -> f64 {
    if weight == 0.0 {
        return 1.0;
    }
    let ratio = z.abs();
    // The usual sharpnesses have a root where a power would take longer than the rest.
    let power = match sharpness {
        1.0 => ratio,
        1.5 => ratio * ratio.sqrt(),
        2.0 => ratio * ratio,
        n => ratio.powf(n),
    };
    1.0 - strength * power * weight
}

impl BoucWen {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated or that would make energy.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        let checks = [
            (
                Self::POST_YIELD_RATIO,
                self.post_yield_ratio,
                self.post_yield_ratio <= 1.0,
                "a number not above 1",
            ),
            (
                Self::SHARPNESS,
                self.sharpness,
                self.sharpness.is_finite() && self.sharpness >= 1.0,
                "a number of at least 1",
            ),
            (
                Self::BETA,
                self.beta,
                self.beta.is_finite() && self.beta > -self.gamma,
                "a number with beta + gamma above 0",
            ),
            (
                Self::GAMMA,
                self.gamma,
                self.gamma.is_finite() && self.gamma <= self.beta,
                "a number not above beta (the loop would turn backwards)",
            ),
            (
                Self::PINCHING,
                self.pinching,
                (0.0..1.0).contains(&self.pinching),
                "a number from 0 to below 1",
            ),
        ];
        for (name, value, holds, expected) in checks {
            if !holds {
                return Err(ModelError::Parameter {
                    name,
                    value,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Stiffness before yielding, N/m.
    pub fn stiffness(&self) -> f64 {
        self.yield_force / self.yield_displacement
    }

    /// Force of the spring at `deformation` (m), N.
    pub fn force(&self, deformation: f64, state: &Hysteresis) -> f64 {
        let ratio = deformation / self.yield_displacement;
        self.yield_force
            * (self.post_yield_ratio * ratio
                + (1.0 - self.post_yield_ratio) * state.z
                + self.hardening * ratio * ratio * ratio)
    }

    /// Rates of the state at deformation rate `velocity` (m/s), 1/s.
    pub fn rates(&self, velocity: f64, state: &Hysteresis) -> Hysteresis {
        let speed = velocity / self.yield_displacement;
        let (z, work) = (state.z, state.work.max(0.0));
        let strength = 1.0 + self.strength_degradation * work;
        let stiffness = 1.0 + self.stiffness_degradation * work;
        let sign = if velocity * z >= 0.0 { 1.0 } else { -1.0 };
        let weight = self.gamma + self.beta * sign;
        let mut rate = speed * elastic_share(z, self.sharpness, strength, weight) / stiffness;
        if self.pinching > 0.0 {
            let off = (z * velocity.signum() - self.pinching_level) / self.pinching_width;
            rate *= 1.0 - self.pinching * (1.0 - (-2.0 * work).exp()) * (-off * off).exp();
        }
        Hysteresis {
            z: rate,
            work: (1.0 - self.post_yield_ratio) * z * speed,
        }
    }

    /// Energy that the spring can give back, J; exact without degradation and pinching.
    pub fn stored_energy(&self, deformation: f64, state: &Hysteresis) -> f64 {
        let ratio = deformation / self.yield_displacement;
        let scale = self.yield_force * self.yield_displacement;
        scale
            * (0.5 * self.post_yield_ratio * ratio * ratio
                + 0.5 * (1.0 - self.post_yield_ratio) * state.z * state.z
                + 0.25 * self.hardening * ratio.powi(4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integration::{Dynamics, advance};

    /// A spring pulled with constant speed; states deformation, z, work.
    struct Pulled {
        spring: BoucWen,
        velocity: f64,
    }

    impl Dynamics<3> for Pulled {
        fn derivatives(&self, &[_, z, work]: &[f64; 3]) -> [f64; 3] {
            let rates = self.spring.rates(self.velocity, &Hysteresis { z, work });
            [self.velocity, rates.z, rates.work]
        }
    }

    /// Pulls through `amplitudes` (in yield displacements) one after the other; returns ratio and
    /// force at many points.
    fn pull(spring: BoucWen, amplitudes: &[f64]) -> Vec<(f64, f64)> {
        let mut x = [0.0; 3];
        let mut loop_ = Vec::new();
        for &amplitude in amplitudes {
            let target = amplitude * spring.yield_displacement;
            let pulled = Pulled {
                spring,
                velocity: (target - x[0]) / 200.0,
            };
            for _ in 0..200 {
                x = advance(&pulled, &x, 1.0, 0.1);
                let state = Hysteresis {
                    z: x[1],
                    work: x[2],
                };
                let force = spring.force(x[0], &state) / spring.yield_force;
                loop_.push((x[0] / spring.yield_displacement, force));
            }
        }
        loop_
    }

    fn area(loop_: &[(f64, f64)]) -> f64 {
        loop_
            .windows(2)
            .map(|w| 0.5 * (w[0].1 + w[1].1) * (w[1].0 - w[0].0))
            .sum()
    }

    #[test]
    fn loading_with_sharpness_1_follows_its_closed_form() {
        let spring = BoucWen {
            sharpness: 1.0,
            ..BoucWen::default()
        };
        for (ratio, force) in pull(spring, &[4.0]) {
            // dz/dr = 1 - z: z = 1 - exp(-r).
            let expected = 0.05 * ratio + 0.95 * (1.0 - (-ratio).exp());
            assert!(
                (force - expected).abs() < 1e-9,
                "{ratio}: {force} {expected}"
            );
        }
    }

    #[test]
    fn it_starts_and_unloads_with_the_elastic_stiffness_and_yields_at_the_yield_force() {
        let curve = pull(BoucWen::default(), &[8.0, 7.8]);
        let slope = |i: usize| (curve[i + 1].1 - curve[i].1) / (curve[i + 1].0 - curve[i].0);
        assert!((slope(0) - 1.0).abs() < 0.02);
        // Post-yield line 0.05 r + 0.95.
        assert!((slope(195) - 0.05).abs() < 0.005);
        assert!((curve[199].1 - (0.05 * 8.0 + 0.95)).abs() < 0.01);
        assert!((slope(201) - 1.0).abs() < 0.02, "{}", slope(201));
    }

    #[test]
    fn degradation_and_pinching_narrow_the_loop_and_hardening_raises_its_ends() {
        let cycles = [3.0, -3.0, 3.0, -3.0, 3.0];
        let last = |spring: BoucWen| pull(spring, &cycles)[599..].to_vec();
        let plain = last(BoucWen::default());
        let weak = last(BoucWen {
            strength_degradation: 0.05,
            ..BoucWen::default()
        });
        let soft = last(BoucWen {
            stiffness_degradation: 0.1,
            ..BoucWen::default()
        });
        let pinched = last(BoucWen {
            pinching: 0.9,
            ..BoucWen::default()
        });
        let hard = last(BoucWen {
            hardening: 0.02,
            ..BoucWen::default()
        });
        for (name, changed) in [("weak", &weak), ("soft", &soft), ("pinched", &pinched)] {
            assert!(area(changed) < 0.95 * area(&plain), "{name}");
            assert!(area(changed) > 0.0, "{name}");
        }
        // Cubic hardening is elastic: 0.02 * 27 more at the end, the same area.
        let end = plain.len() - 1;
        assert!((hard[end].1 - plain[end].1 - 0.54).abs() < 1e-9);
        assert!((area(&hard) / area(&plain) - 1.0).abs() < 1e-3);
        // Pinched: soft near zero force, as strong at the ends.
        assert!((pinched[end].1 / plain[end].1 - 1.0).abs() < 0.05);
    }

    #[test]
    fn the_spring_is_pinched_on_the_way_in_and_stiff_on_the_way_out() {
        let (pinching, level, work) = (0.8, 0.3, 2.0_f64);
        let spring = BoucWen {
            pinching,
            pinching_level: level,
            pinching_width: 0.1,
            ..BoucWen::default()
        };
        let plain = BoucWen {
            pinching: 0.0,
            ..spring
        };
        let share = |velocity: f64, z: f64| {
            let state = Hysteresis { z, work };
            spring.rates(velocity, &state).z / plain.rates(velocity, &state).z
        };
        // Baber and Noori 1985: the slope is least where the force has the sign of the velocity and
        // reaches the level, 1 - zeta (1 - exp(-2 work)); unloading passes there undisturbed.
        let least = 1.0 - pinching * (1.0 - (-2.0 * work).exp());
        for side in [1.0, -1.0] {
            assert!((share(side, side * level) - least).abs() < 1e-12);
            assert!((share(side, -side * level) - 1.0).abs() < 1e-12);
            // One width beside the level, the bell has fallen to 1/e.
            let beside = share(side, side * (level + 0.1));
            let expected = 1.0 - (1.0 - least) * (-1.0_f64).exp();
            assert!((beside - expected).abs() < 1e-12, "{beside} {expected}");
        }
    }

    #[test]
    fn what_the_loop_encloses_is_the_work_that_degradation_counts() {
        let spring = BoucWen {
            post_yield_ratio: 0.1,
            ..BoucWen::default()
        };
        let mut x = [0.0; 3];
        let mut area = 0.0;
        for target in [4.0, -4.0, 4.0_f64] {
            let velocity = (target * spring.yield_displacement - x[0]) / 400.0;
            let pulled = Pulled { spring, velocity };
            for _ in 0..400 {
                let before = x;
                x = advance(&pulled, &x, 1.0, 0.1);
                area += 0.5 * (before[1] + x[1]) * (x[0] - before[0]);
            }
        }
        let counted = x[2] * spring.yield_displacement;
        assert!(
            (counted / (0.9 * area) - 1.0).abs() < 1e-3,
            "{counted} {area}"
        );
    }

    #[test]
    fn stored_energy_is_the_work_of_a_spring_that_stays_elastic() {
        // With beta = gamma = 0 nothing yields: z = d/d_y, and the force is that of a hardening spring.
        let spring = BoucWen {
            beta: 0.0,
            gamma: 0.0,
            hardening: 0.05,
            ..BoucWen::default()
        };
        let (mut work, n) = (0.0, 2000);
        let most = 2.0 * spring.yield_displacement;
        let at = |part: f64| Hysteresis {
            z: 2.0 * part,
            work: 0.0,
        };
        for i in 0..n {
            let part = (f64::from(i) + 0.5) / f64::from(n);
            work += spring.force(most * part, &at(part)) * most / f64::from(n);
        }
        let stored = spring.stored_energy(most, &at(1.0));
        assert!((stored / work - 1.0).abs() < 1e-6, "{stored} {work}");
    }

    #[test]
    fn worn_columns_follow_the_equation_of_baber_and_wen() {
        let spring = BoucWen {
            sharpness: 2.0,
            beta: 0.7,
            gamma: 0.2,
            strength_degradation: 0.3,
            stiffness_degradation: 0.5,
            ..BoucWen::default()
        };
        let (z, work, velocity) = (0.4, 3.0, 0.01);
        let speed = velocity / spring.yield_displacement;
        // nu = 1 + 0.3 * 3, eta = 1 + 0.5 * 3; gamma + beta while loading, gamma - beta while unloading.
        for (direction, weight) in [(1.0, 0.9), (-1.0, -0.5)] {
            let rates = spring.rates(direction * velocity, &Hysteresis { z, work });
            let expected = direction * speed * (1.0 - 1.9 * z * z * weight) / 2.5;
            assert!((rates.z / expected - 1.0).abs() < 1e-12, "{}", rates.z);
            let work = 0.95 * z * direction * speed;
            assert!((rates.work / work - 1.0).abs() < 1e-12, "{}", rates.work);
        }
    }
}
