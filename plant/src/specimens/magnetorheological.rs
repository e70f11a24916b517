//! A magnetorheological damper (B. F. Spencer, S. J. Dyke, M. K. Sain and J. D. Carlson, Journal of
//! Engineering Mechanics 123, 1997).

use units::Parameters;

use crate::ModelError;

/// Parameters of
/// `f = c1 y' + k1 x`, `(c0 + c1) y' = alpha z + c0 x' + k0 (x - y)`,
/// `z' = A (x' - y') - |x' - y'| z |z| gamma - (x' - y') z² beta`, `u' = -eta (u - v)`,
/// with `c0`, `c1` and `alpha` that rise with the driver's voltage `u`, SI; the exponent n is 2.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, Parameters)]
#[parameters(prefix = "damper_")]
pub struct MagnetorheologicalDamper {
    /// Factor on the damper's force.
    #[parameter(min = 0.0, non_negative)]
    pub size: f64,
    /// c0 without voltage, N.s/m.
    #[parameter("N.s/m", min = 0.0, non_negative)]
    pub damping: f64,
    /// Rise of c0 with voltage, N.s/(m.V).
    #[parameter("N.s/(m.V)", min = 0.0, non_negative)]
    pub damping_rise: f64,
    /// c1 without voltage, N.s/m.
    #[parameter("N.s/m", min = 0.0, positive)]
    pub roll_off_damping: f64,
    /// Rise of c1 with voltage, N.s/(m.V).
    #[parameter("N.s/(m.V)", min = 0.0, non_negative)]
    pub roll_off_damping_rise: f64,
    /// k0, N/m.
    #[parameter("N/m", min = 0.0, non_negative)]
    pub stiffness: f64,
    /// k1, stiffness of the accumulator, N/m.
    #[parameter("N/m", min = 0.0, non_negative)]
    pub accumulator_stiffness: f64,
    /// alpha without voltage, N/m.
    #[parameter("N/m", min = 0.0, non_negative)]
    pub hysteresis: f64,
    /// Rise of alpha with voltage, N/(m.V).
    #[parameter("N/(m.V)", min = 0.0, non_negative)]
    pub hysteresis_rise: f64,
    /// gamma, 1/m2.
    #[parameter("1/m2", min = 0.0, positive)]
    pub gamma: f64,
    /// beta, 1/m2.
    #[parameter("1/m2", min = 0.0, non_negative)]
    pub beta: f64,
    /// A.
    #[parameter(min = 0.0, non_negative)]
    pub sharpness: f64,
    /// eta, rate of the current's driver, 1/s.
    #[parameter("1/s", min = 0.0, positive)]
    pub driver_rate: f64,
    /// Largest voltage that counts, V.
    #[parameter("V", min = 0.0, positive)]
    pub largest_voltage: f64,
}

/// State of [`MagnetorheologicalDamper`].
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct DamperState {
    /// y, displacement behind the roll-off damper, m.
    pub inner: f64,
    /// z, hysteretic displacement, m.
    pub hysteretic: f64,
    /// u, voltage at the damper, V.
    pub voltage: f64,
}

impl Default for MagnetorheologicalDamper {
    /// The prototype of S. J. Dyke, B. F. Spencer, M. K. Sain and J. D. Carlson, Smart Materials and Structures 5,
    /// 1996: 1 kN at 2.25 V.
    fn default() -> Self {
        Self {
            damping: 2_100.0,
            damping_rise: 350.0,
            roll_off_damping: 28_300.0,
            roll_off_damping_rise: 295.0,
            stiffness: 4_690.0,
            accumulator_stiffness: 500.0,
            hysteresis: 14_000.0,
            hysteresis_rise: 69_500.0,
            gamma: 3.63e6,
            beta: 3.63e6,
            sharpness: 301.0,
            driver_rate: 190.0,
            largest_voltage: 2.25,
            size: 1.0,
        }
    }
}

impl MagnetorheologicalDamper {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// `y'`, m/s, at a displacement (m) and its rate (m/s).
    fn inner_rate(&self, state: &DamperState, [x, rate]: [f64; 2]) -> f64 {
        let u = state.voltage;
        let c0 = self.damping + self.damping_rise * u;
        let c1 = self.roll_off_damping + self.roll_off_damping_rise * u;
        let alpha = self.hysteresis + self.hysteresis_rise * u;
        let pushed = alpha * state.hysteretic + c0 * rate + self.stiffness * (x - state.inner);
        pushed / (c0 + c1)
    }

    /// Force against the motion, N.
    pub fn force(&self, state: &DamperState, motion: [f64; 2]) -> f64 {
        let c1 = self.roll_off_damping + self.roll_off_damping_rise * state.voltage;
        let roll_off = c1 * self.inner_rate(state, motion);
        self.size * (roll_off + self.accumulator_stiffness * motion[0])
    }

    /// Rates of the state at `motion` (m, m/s) under the voltage `wanted` (V), which is held within 0
    /// and the largest.
    pub fn rates(&self, state: &DamperState, motion: [f64; 2], wanted: f64) -> DamperState {
        let inner = self.inner_rate(state, motion);
        let through = motion[1] - inner;
        let z = state.hysteretic;
        let wanted = wanted.clamp(0.0, self.largest_voltage);
        DamperState {
            inner,
            hysteretic: self.sharpness * through
                - self.gamma * through.abs() * z * z.abs()
                - self.beta * through * z * z,
            voltage: -self.driver_rate * (state.voltage - wanted),
        }
    }

    /// Longest step (s) that follows the turn of the force at a speed (m/s): a part of the time that `z` takes
    /// to its limit.
    pub fn longest_step(&self, speed: f64) -> f64 {
        const PART: f64 = 0.2;
        const SHORTEST: f64 = 1e-5;
        let limit = (self.sharpness / (self.gamma + self.beta)).sqrt();
        (PART * limit / (self.sharpness * speed).max(f64::MIN_POSITIVE)).max(SHORTEST)
    }

    /// The rates' own derivatives, which are stiff: of `z` and `u`, 1/s.
    pub fn stiffness_of(&self, state: &DamperState, motion: [f64; 2]) -> DamperState {
        let through = motion[1] - self.inner_rate(state, motion);
        let z = state.hysteretic;
        let own = 2.0 * (self.gamma * through.abs() * z.abs() + self.beta * through * z);
        DamperState {
            inner: 0.0,
            hysteretic: -own.max(0.0),
            voltage: -self.driver_rate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: [f64; 2] = [0.004, 0.07];

    fn states() -> [DamperState; 2] {
        [0.0, 1.6].map(|voltage| DamperState {
            inner: 0.001,
            hysteretic: 0.003,
            voltage,
        })
    }

    #[test]
    fn both_sides_of_the_roll_off_damper_carry_the_same_force() {
        let damper = MagnetorheologicalDamper::default();
        for state in states() {
            let u = state.voltage;
            let [x, rate] = MOTION;
            let inner = damper.rates(&state, MOTION, 0.0).inner;
            // Eq 12 and 13 of Spencer et al.: alpha z + c0 (x' - y') + k0 (x - y) = c1 y'.
            let outer = (14_000.0 + 69_500.0 * u) * state.hysteretic
                + (2_100.0 + 350.0 * u) * (rate - inner)
                + 4_690.0 * (x - state.inner);
            let roll_off = (28_300.0 + 295.0 * u) * inner;
            assert!((outer / roll_off - 1.0).abs() < 1e-12, "{outer} {roll_off}");
            let force = roll_off + 500.0 * x;
            assert!((damper.force(&state, MOTION) / force - 1.0).abs() < 1e-12);
            let twice = MagnetorheologicalDamper {
                size: 2.0,
                ..damper
            };
            assert!((twice.force(&state, MOTION) / force - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_voltage_lags_what_is_wanted_within_its_range() {
        let damper = MagnetorheologicalDamper::default();
        let state = states()[1];
        for (wanted, held) in [(1.0, 1.0), (-3.0, 0.0), (9.0, 2.25)] {
            let rate = damper.rates(&state, MOTION, wanted).voltage;
            assert!((rate - 190.0 * (held - state.voltage)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_slide_saturates_the_hysteretic_displacement_in_the_time_that_steps_must_follow() {
        let damper = MagnetorheologicalDamper::default();
        let limit = (301.0_f64 / 7.26e6).sqrt();
        for direction in [1.0, -1.0] {
            let mut state = DamperState::default();
            let rate: f64 = 0.05 * direction;
            let step = damper.longest_step(rate.abs());
            let (mut time, mut x) = (0.0, 0.0);
            while time < 0.5 {
                let rates = damper.rates(&state, [x, rate], 0.0);
                state.hysteretic += step * rates.hysteretic;
                state.inner += step * rates.inner;
                x += step * rate;
                time += step;
            }
            assert!((state.hysteretic / (direction * limit) - 1.0).abs() < 1e-6);
        }
        // A fifth of limit / (A v); no shorter than 10 us.
        assert!((damper.longest_step(0.05) / (0.2 * limit / (301.0 * 0.05)) - 1.0).abs() < 1e-12);
        assert_eq!(damper.longest_step(1e3), 1e-5);
    }

    #[test]
    fn the_stiff_diagonal_is_the_slope_of_the_rates() {
        // Without alpha the inner rate does not depend on z.
        let damper = MagnetorheologicalDamper {
            hysteresis: 0.0,
            hysteresis_rise: 0.0,
            beta: 1.2e6,
            ..MagnetorheologicalDamper::default()
        };
        for hysteretic in [0.004, -0.004] {
            let at = |change: f64| {
                let state = DamperState {
                    hysteretic: hysteretic + change,
                    ..states()[1]
                };
                (state, damper.rates(&state, MOTION, 1.0).hysteretic)
            };
            let (state, _) = at(0.0);
            let slope = (at(1e-7).1 - at(-1e-7).1) / 2e-7;
            let own = damper.stiffness_of(&state, MOTION);
            assert!((own.hysteretic / slope - 1.0).abs() < 1e-6, "{slope}");
            assert_eq!((own.inner, own.voltage), (0.0, -190.0));
        }
    }
}
