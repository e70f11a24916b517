//! Rigs drawn about the physical one within stated spreads.

use plant::sensors::channel;
use plant::servo_hydraulic::ServoHydraulicTable;
use serde::Serialize;
use units::constants::{INCH, LBF};

/// A rig that differs from the one the nominal design knows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rig {
    /// Its number in the draw.
    pub number: u64,
    /// Mass bolted to the table over the table's: 0 to 0.5, even.
    pub payload: f64,
    /// Bulk modulus over the nominal: 0.8 to 1.2, even.
    pub oil_stiffness: f64,
    /// Flow of the valve over the nominal: 0.8 to 1.2, even.
    pub valve_gain: f64,
    /// Dry friction of the seals over the nominal: 0.5 to 2, even in its logarithm.
    pub friction: f64,
    /// Pressure of the supply over the nominal: 0.85 to 1.15, even.
    pub supply: f64,
    /// Noise of the sensors over the nominal: 0.5 to 2, even in its logarithm.
    pub noise: f64,
}

/// Noise of the sensors of the built-in rig, by the names of their parameters, SI.
const NOISE: [(&str, f64, &str); 4] = [
    ("displacement_noise", 5e-4 * INCH, "m"),
    ("acceleration_noise", 1.5 * INCH, "m/s2"),
    ("actuator_force_noise", 0.3 * LBF, "N"),
    ("specimen_acceleration_noise", INCH, "m/s2"),
];

impl Rig {
    /// The rig of a number in the draw of `seed`.
    pub fn draw(seed: u64, number: u64) -> Self {
        // A Gaussian's distribution function makes it even.
        let even = |channel: u64| {
            let noise = channel::Noise {
                seed,
                channel,
                sample: number,
            };
            phi(noise.gaussian())
        };
        let between = |channel, low: f64, high: f64| low + (high - low) * even(channel);
        let factor = |channel| 4f64.powf(even(channel) - 0.5);
        Self {
            number,
            payload: between(0, 0.0, 0.5),
            oil_stiffness: between(1, 0.8, 1.2),
            valve_gain: between(2, 0.8, 1.2),
            friction: factor(3),
            supply: between(4, 0.85, 1.15),
            noise: factor(5),
        }
    }

    /// The parameters that make it, as `--set` takes them.
    pub fn settings(&self) -> Vec<String> {
        let nominal = ServoHydraulicTable::default();
        let table = [
            ("added_payload", self.payload * nominal.table.mass, "kg"),
            (
                "bulk_modulus",
                self.oil_stiffness * nominal.cylinder.bulk_modulus,
                "Pa",
            ),
            (
                "flow_coefficient",
                self.valve_gain * nominal.valve.flow_coefficient,
                "",
            ),
            (
                "coulomb_friction",
                self.friction * nominal.friction.coulomb,
                "N",
            ),
            (
                "static_friction",
                self.friction * nominal.friction.static_force,
                "N",
            ),
            ("pump_pressure", self.supply * nominal.supply.pressure, "Pa"),
        ];
        let table = table.map(|(name, value, unit)| format!("table.{name}={value} {unit}"));
        let noise = NOISE
            .map(|(name, value, unit)| format!("sensors.{name}={} {unit}", self.noise * value));
        let seed = format!("sensors.seed={}", 1 + self.number);
        table.into_iter().chain(noise).chain([seed]).collect()
    }
}

/// Distribution function of the standard normal (Abramowitz and Stegun 26.2.17, error below 1e-7).
fn phi(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let poly = t
        * (0.319_381_530
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt() * poly;
    if x >= 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draws_fill_their_spreads_evenly() {
        let rigs: Vec<Rig> = (0..2000).map(|n| Rig::draw(7, n)).collect();
        let mean = |of: fn(&Rig) -> f64| rigs.iter().map(of).sum::<f64>() / 2000.0;
        assert!((mean(|r| r.payload) - 0.25).abs() < 0.01);
        assert!((mean(|r| r.oil_stiffness) - 1.0).abs() < 0.01);
        assert!(mean(|r| r.friction.ln()).abs() < 0.03);
        assert!(rigs.iter().all(|r| (0.5..=2.0).contains(&r.noise)));
        assert!(rigs.iter().any(|r| r.payload < 0.01) && rigs.iter().any(|r| r.payload > 0.49));
        assert_eq!(Rig::draw(7, 3), rigs[3]);
    }
}
