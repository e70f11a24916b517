//! The double-ended cylinder: two chambers of compressible oil with a leak between them.

use crate::ModelError;
use units::Parameters as _;
use units::constants::{INCH, PSI};
use units::vocabulary;

/// A symmetrical cylinder. Each chamber obeys `V dp/dt = β (q - dV/dt)` with its own volume; at
/// the middle position and with matched flows this is `V_t/(4 β) dP_L/dt = q_L - A v - C_l P_L`
/// for the load pressure `P_L = p_a - p_b` (Merritt 1967, chapter 6).
#[derive(
    Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize, units::Parameters,
)]
pub struct Cylinder {
    /// Area of the piston, m2.
    #[parameter("m2" => "in2", name = "piston_area", positive)]
    pub area: f64,
    /// Volume of both chambers with hoses, m3.
    #[parameter("m3" => "in3", name = vocabulary::OIL_VOLUME)]
    pub volume: f64,
    /// Effective bulk modulus, Pa.
    #[parameter("Pa" => "psi", positive)]
    pub bulk_modulus: f64,
    /// Leakage past the piston, m3/(s.Pa).
    #[parameter("m3/(s.Pa)" => "in3/(s.psi)", name = vocabulary::PISTON_LEAKAGE, non_negative)]
    pub leakage: f64,
    /// Flow of the anti-cavitation valves per missing pressure, m3/(s.Pa).
    #[parameter("m3/(s.Pa)" => "in3/(s.psi)", name = "make_up_flow", non_negative)]
    pub make_up: f64,
}

impl Default for Cylinder {
    fn default() -> Self {
        // Values chosen so that the rig comes near Eq 2-13 and 2-14. Of the leakage of
        // 4e-4 in³/s/psi one tenth is that of the valve at null.
        let per_psi = INCH.powi(3) / PSI;
        Self {
            area: 0.40 * INCH * INCH,
            volume: 24.0 * INCH.powi(3),
            bulk_modulus: 4e4 * PSI,
            leakage: 3.6e-4 * per_psi,
            make_up: 0.1 * per_psi,
        }
    }
}

impl Cylinder {
    /// Checks the parameters for a piston that moves `reach` (m) either way.
    ///
    /// # Errors
    /// Names the first that cannot be simulated.
    pub fn validate(&self, reach: f64) -> Result<(), ModelError> {
        self.check()?;
        if self.volume.is_finite() && self.volume > 2.2 * self.area * reach {
            return Ok(());
        }
        Err(ModelError::Parameter {
            name: vocabulary::OIL_VOLUME,
            value: self.volume,
            expected: "more than the piston sweeps over its stroke",
        })
    }

    /// Volumes of the chambers with the piston at `displacement` (m), m³. The floor keeps a piston
    /// that is pressed far into a stop from turning a chamber inside out.
    pub fn volumes(&self, displacement: f64) -> [f64; 2] {
        let (half, swept) = (0.5 * self.volume, self.area * displacement);
        let least = 0.02 * self.volume;
        [(half + swept).max(least), (half - swept).max(least)]
    }

    /// Flow past the piston from A to B, m³/s.
    pub fn leak(&self, [a, b]: [f64; 2]) -> f64 {
        self.leakage * (a - b)
    }

    /// Flow of the check valve from the tank into a chamber at `pressure`, m³/s.
    pub fn make_up_flow(&self, pressure: f64) -> f64 {
        self.make_up * (-pressure).max(0.0)
    }

    /// Rates of the chamber pressures, Pa/s, with `into` each chamber from the valve (m³/s).
    pub fn pressure_rates(
        &self,
        pressures: [f64; 2],
        into: [f64; 2],
        displacement: f64,
        velocity: f64,
    ) -> [f64; 2] {
        let [volume_a, volume_b] = self.volumes(displacement);
        let (leak, swept) = (self.leak(pressures), self.area * velocity);
        let [a, b] = pressures;
        [
            self.bulk_modulus / volume_a * (into[0] + self.make_up_flow(a) - leak - swept),
            self.bulk_modulus / volume_b * (into[1] + self.make_up_flow(b) + leak + swept),
        ]
    }

    /// Elastic energy of oil per volume at `pressure`, J/m³: `β (e^(p/β) - 1 - p/β)`, of which
    /// `p²/(2 β)` is the first term.
    pub fn energy_density(&self, pressure: f64) -> f64 {
        let ratio = pressure / self.bulk_modulus;
        self.bulk_modulus * (ratio.exp_m1() - ratio)
    }
}
