//! Hydraulic supply: a pressure-compensated pump and an accumulator.

use crate::ModelError;
use units::Parameters as _;
use units::constants::{INCH, PSI};
use units::vocabulary;

/// A pump that delivers in proportion to the missing pressure, up to its largest flow, into a
/// gas-charged accumulator from which the valve draws. Assumed values: at a mean demand of
/// 4 in³/s the pressure sinks by 80 psi with a time constant of about half a second.
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Supply {
    /// Pressure at which the pump stops delivering, Pa.
    #[parameter("Pa" => "psi", name = vocabulary::PUMP_PRESSURE, positive)]
    pub pressure: f64,
    /// Pump flow per missing pressure, m3/(s.Pa).
    #[parameter("m3/(s.Pa)" => "in3/(s.psi)", positive)]
    pub pump_gain: f64,
    /// Largest flow of the pump, m3/s.
    #[parameter("m3/s" => "in3/s", positive)]
    pub pump_limit: f64,
    /// Gas volume of the accumulator at the pump's pressure, m3.
    #[parameter("m3" => "in3", name = "accumulator_gas_volume", positive)]
    pub gas_volume: f64,
    /// Polytropic exponent of the gas.
    #[parameter(positive)]
    pub polytropic_exponent: f64,
    /// Time constant at which a lost supply drains to the tank, s.
    pub drain_time: f64,
}

impl Default for Supply {
    fn default() -> Self {
        let cubic_inch = INCH.powi(3);
        Self {
            pressure: 3000.0 * PSI,
            pump_gain: 0.05 * cubic_inch / PSI,
            pump_limit: 12.0 * cubic_inch,
            gas_volume: 120.0 * cubic_inch,
            polytropic_exponent: 1.4,
            drain_time: 0.05,
        }
    }
}

impl Supply {
    /// Name of the parameter `supply_drain_time`.
    pub const SUPPLY_DRAIN_TIME: &'static str = "supply_drain_time";

    /// Checks the parameters.
    ///
    /// # Errors
    /// Names the first that is not positive.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.check()?;
        ModelError::require_positive(Self::SUPPLY_DRAIN_TIME, self.drain_time)
    }

    /// Flow of the pump at `pressure` (Pa), m³/s.
    pub fn pump_flow(&self, pressure: f64) -> f64 {
        (self.pump_gain * (self.pressure - pressure)).clamp(0.0, self.pump_limit)
    }

    /// Rate of the pressure, Pa/s, while the valve draws `demand` (m³/s). A supply that is `lost`
    /// has no pump and is opened to the tank.
    pub fn pressure_rate(&self, pressure: f64, demand: f64, lost: bool) -> f64 {
        if lost {
            return -pressure / self.drain_time;
        }
        // p V^n = constant, dV/dt = demand - pump flow. The floor keeps an empty accumulator from
        // becoming infinitely stiff.
        let pressure_in_gas = pressure.max(0.01 * self.pressure);
        let n = self.polytropic_exponent;
        let volume = self.gas_volume * (self.pressure / pressure_in_gas).powf(1.0 / n);
        n * pressure_in_gas / volume * (self.pump_flow(pressure) - demand)
    }

    /// Pressure at rest with a valve that leaks `leakage` (m³/(s Pa)) from the supply, Pa.
    pub fn rest_pressure(&self, leakage: f64) -> f64 {
        let at_rest = self.pressure * self.pump_gain / (self.pump_gain + leakage);
        if self.pump_gain * (self.pressure - at_rest) <= self.pump_limit {
            return at_rest;
        }
        self.pump_limit / leakage
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_accumulator_without_pump_follows_the_polytropic_law() {
        let supply = Supply {
            pump_gain: 1e-30,
            ..Supply::default()
        };
        let demand = 10.0 * INCH.powi(3);
        let mut pressure = supply.pressure;
        let count = 20_000;
        for _ in 0..count {
            pressure += supply.pressure_rate(pressure, demand, false) * 2.0 / f64::from(count);
        }
        // 20 in³ drawn from 120 in³ of gas at 3000 psi.
        let expected = supply.pressure * (120.0_f64 / 140.0).powf(1.4);
        assert!(
            (pressure / expected - 1.0).abs() < 1e-5,
            "{}",
            pressure / PSI
        );
    }

    #[test]
    fn the_rest_pressure_is_an_equilibrium() {
        let supply = Supply::default();
        for leakage in [1e-15, 1e-11] {
            let pressure = supply.rest_pressure(leakage);
            let rate = supply.pressure_rate(pressure, leakage * pressure, false);
            assert!(rate.abs() < 1e-6 * pressure, "{rate}");
        }
    }
}
