//! A magnetorheological damper (B. F. Spencer, S. J. Dyke, M. K. Sain and J. D. Carlson, Journal of
//! Engineering Mechanics 123, 1997).

use crate::ModelError;

/// Parameters of
/// `f = c1 y' + k1 x`, `(c0 + c1) y' = alpha z + c0 x' + k0 (x - y)`,
/// `z' = A (x' - y') - |x' - y'| z |z| gamma - (x' - y') z² beta`, `u' = -eta (u - v)`,
/// with `c0`, `c1` and `alpha` that rise with the driver's voltage `u`, SI; the exponent n is 2.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MagnetorheologicalDamper {
    /// `c0` without voltage, N s/m.
    pub damping: f64,
    /// Its rise with voltage, N s/(m V).
    pub damping_rise: f64,
    /// `c1` without voltage, N s/m.
    pub roll_off_damping: f64,
    /// Its rise with voltage, N s/(m V).
    pub roll_off_damping_rise: f64,
    /// `k0`, N/m.
    pub stiffness: f64,
    /// `k1`, the accumulator, N/m; its preload is taken off.
    pub accumulator_stiffness: f64,
    /// `alpha` without voltage, N/m.
    pub hysteresis: f64,
    /// Its rise with voltage, N/(m V).
    pub hysteresis_rise: f64,
    /// `gamma`, 1/m².
    pub gamma: f64,
    /// `beta`, 1/m².
    pub beta: f64,
    /// `A`.
    pub sharpness: f64,
    /// `eta`, lag of the current's driver, 1/s.
    pub driver_rate: f64,
    /// Largest voltage, V.
    pub largest_voltage: f64,
    /// Factor on the force: a damper of another size.
    pub size: f64,
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
        for (name, value) in [
            ("damper_damping", self.damping),
            ("damper_damping_rise", self.damping_rise),
            ("damper_roll_off_damping_rise", self.roll_off_damping_rise),
            ("damper_stiffness", self.stiffness),
            ("damper_accumulator_stiffness", self.accumulator_stiffness),
            ("damper_hysteresis", self.hysteresis),
            ("damper_hysteresis_rise", self.hysteresis_rise),
            ("damper_beta", self.beta),
            ("damper_sharpness", self.sharpness),
            ("damper_size", self.size),
        ] {
            ModelError::require_non_negative(name, value)?;
        }
        for (name, value) in [
            ("damper_roll_off_damping", self.roll_off_damping),
            ("damper_gamma", self.gamma),
            ("damper_driver_rate", self.driver_rate),
            ("damper_largest_voltage", self.largest_voltage),
        ] {
            ModelError::require_positive(name, value)?;
        }
        Ok(())
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
