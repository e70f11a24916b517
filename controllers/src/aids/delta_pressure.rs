//! Stabilisation by differential pressure (H. E. Merritt, Hydraulic Control Systems, 1967, section 6-6: dynamic pressure
//! feedback).

use units::Parameters;

use crate::ModelError;

/// `u = -k s/(s + w) F`: the actuator's force, which is the differential pressure times the piston's
/// area less friction, makes the valve yield and so damps the oil column. The high pass keeps static
/// loads out (gain `k`, corner `w`); without it (`w = 0`) the actuator is softer.
#[derive(
    Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize, Parameters,
)]
#[parameters(prefix = "pressure_")]
pub struct DeltaPressure {
    /// Stabilisation: command per force, V/N.
    #[parameter("V/N" => "V/lbf", min = 0.0, non_negative)]
    pub gain: f64,
    /// Stabilisation: corner below which forces count for nothing, rad/s.
    #[parameter("rad/s" => "Hz", min = 0.0, non_negative)]
    pub high_pass: f64,
    /// The slow part of the force, N.
    pub slow: f64,
}

impl DeltaPressure {
    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that is negative.
    pub fn validate(&self) -> Result<(), ModelError> {
        Ok(self.check()?)
    }

    /// What is added to the valve command of this sample under the measured `force` (N), V.
    #[inline]
    pub fn step(&mut self, force: f64, period: f64) -> f64 {
        self.slow += -(-self.high_pass * period).exp_m1() * (force - self.slow);
        -self.gain * (force - self.slow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aids::rig::KnownRig;

    /// Merritt's closed form: with a quick valve the feedback adds `g k` to the leakage, so that
    /// `w² = (K + (p + g k) c)/m` and `2 D w = c/m + p + g k`.
    #[test]
    fn the_oil_column_is_damped_as_the_closed_form_has_it() {
        let mut rig = KnownRig::default();
        // Free to the ground: the oil column alone.
        rig.table.stiffness = 1e-3;
        let mut more = rig;
        more.hydraulics.leakage_rate += 28.0;
        let own = &rig.hydraulics;
        let (_, before) = rig.oil_column(0.0);
        let (_, expected) = more.oil_column(0.0);
        let mut law = DeltaPressure {
            gain: 28.0 / own.force_rate,
            ..DeltaPressure::default()
        };
        // Rings freely from a force in the oil, in steps so small that holding does not count.
        let period = 2e-6;
        let (mut oil, mut x, mut v) = (100.0_f64, 0.0_f64, 0.0_f64);
        let damping = rig.table.damping + own.seal_damping;
        let mut peaks = Vec::new();
        let mut last = 0.0;
        for _ in 0..200_000 {
            let opening = law.step(oil, period);
            let acceleration = (oil - damping * v - rig.table.stiffness * x) / rig.table.mass;
            oil += period
                * (own.force_rate * opening - own.leakage_rate * oil - own.oil_stiffness * v);
            v += period * acceleration;
            x += period * v;
            // Maxima and minima of the velocity.
            if acceleration * last < 0.0 {
                peaks.push(v.abs());
            }
            last = acceleration;
        }
        let decrement = (peaks[1] / peaks[3]).ln();
        let ratio = decrement / (decrement.powi(2) + std::f64::consts::TAU.powi(2)).sqrt();
        println!("{before}, then {ratio}");
        assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio} {expected}");
        assert!(expected > before + 0.1);
    }

    #[test]
    fn static_loads_pass_the_high_pass_by() {
        let mut law = DeltaPressure {
            gain: 1e-3,
            high_pass: 5.0,
            slow: 0.0,
        };
        let first = law.step(200.0, 0.002);
        let last = (0..2000).map(|_| law.step(200.0, 0.002)).last().unwrap();
        assert!((first + 0.2).abs() < 0.01 && last.abs() < 1e-6);
    }
}
