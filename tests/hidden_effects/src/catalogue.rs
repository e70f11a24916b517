//! The catalogue's effects: parameters, units and ranges from weak to strong.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// One effect of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Name, part of the exchange format.
    pub name: &'static str,
    /// Parameters, none for an effect that is only present or absent.
    pub parameters: &'static [Range],
    /// Part of the rig that it changes; two effects of one part are not drawn together.
    pub part: &'static str,
}

/// A parameter with its plausible range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Name, part of the exchange format.
    pub name: &'static str,
    /// Unit in the truth file.
    pub unit: &'static str,
    /// Value at which the effect is barely there.
    pub weak: f64,
    /// Value at which it dominates.
    pub strong: f64,
    /// Whether either sign occurs.
    pub signed: bool,
}

const fn range(name: &'static str, unit: &'static str, weak: f64, strong: f64) -> Range {
    Range {
        name,
        unit,
        weak,
        strong,
        signed: false,
    }
}

const fn either_sign(name: &'static str, unit: &'static str, weak: f64, strong: f64) -> Range {
    Range {
        name,
        unit,
        weak,
        strong,
        signed: true,
    }
}

macro_rules! entries {
    ($($part:literal: $name:literal [$($parameter:expr),*];)*) => {
        &[$(Entry { name: $name, parameters: &[$($parameter),*], part: $part }),*]
    };
}

/// The catalogue. The range of `valve_spool_saturation` is in shares of the peak command.
pub const CATALOGUE: &[Entry] = entries! {
    "null": "valve_null_bias" [either_sign("offset", "V", 0.03, 0.3)];
    "dead band": "valve_dead_band" [range("half_width", "V", 0.03, 0.25)];
    "flow": "valve_flow_gain" [either_sign("relative_change", "1", 0.05, 0.25)];
    "asymmetry": "valve_asymmetric_gain" [either_sign("asymmetry", "1", 0.05, 0.25)];
    "timing": "valve_spool_lag" [range("frequency", "Hz", 60.0, 12.0)];
    "timing": "command_delay" [range("delay", "s", 0.004, 0.02)];
    "flow": "valve_flow_saturation" [range("stall_force", "lbf", 90.0, 28.0)];
    "saturation": "valve_spool_saturation" [range("limit", "V", 0.75, 0.35)];
    "play": "valve_hysteresis" [range("half_width", "V", 0.03, 0.25)];
    "flow": "supply_pressure_droop" [range("loss_per_volt", "1/V", 0.15, 0.6)];
    "friction": "coulomb_friction" [range("coulomb_force", "lbf", 0.4, 4.0)];
    "friction": "stribeck_friction" [
        range("coulomb_force", "lbf", 0.4, 4.0), range("stribeck_force", "lbf", 0.8, 3.0)];
    "oil": "internal_leakage" [range("leakage", "V/lbf", 0.01, 0.1)];
    "oil": "oil_column_compliance" [range("compliance", "V*s/lbf", 5e-5, 4e-4)];
    "table": "added_payload" [range("mass", "lbf*s^2/in", 0.006, 0.06)];
    "table": "viscous_damping" [range("damping", "lbf*s/in", 0.05, 0.8)];
    "spring": "cubic_stiffness" [range("stiffness", "lbf/in^3", 2.0, 30.0)];
    "foundation": "foundation_compliance" [range("frequency", "Hz", 18.0, 6.0)];
    "accelerometer": "accelerometer_bias" [either_sign("offset", "in/s^2", 1.5, 15.0)];
    "accelerometer": "accelerometer_scale" [either_sign("relative_change", "1", 0.03, 0.2)];
    "accelerometer": "accelerometer_tilt" [either_sign("tilt", "rad/in", 0.004, 0.05)];
    "accelerometer": "accelerometer_delay" [range("delay", "s", 0.004, 0.02)];
    "displacement": "displacement_scale" [either_sign("relative_change", "1", 0.03, 0.15)];
    "displacement": "displacement_lag" [range("frequency", "Hz", 40.0, 6.0)];
    "load cell": "load_cell_scale" [either_sign("relative_change", "1", 0.03, 0.2)];
    "load cell": "load_cell_bias" [either_sign("offset", "lbf", 0.3, 4.0)];
    "hum": "mains_hum" [range("amplitude", "in/s^2", 1.5, 15.0)];
    "specimen": "specimen_yielding" [range("yield_displacement", "in", 1.2, 0.35)];
    "specimen": "specimen_stiffness" [either_sign("relative_change", "1", 0.06, 0.35)];
    "specimen": "specimen_damping" [range("relative_change", "1", 0.5, 3.0)];
    "specimen": "specimen_second_mode" [range("frequency", "Hz", 12.0, 4.0)];
    "specimen": "specimen_degradation" [range("loss", "1", 0.1, 0.5)];
    "specimen": "specimen_uplift" [range("uplift_displacement", "in", 1.0, 0.25)];
    "specimen": "specimen_absent" [];
};

/// Effects that came after the exchange format's: hidden only when asked for by name, so that the
/// cases of a seed stay what they were.
pub const LATER: &[Entry] = entries! {
    "friction": "directional_friction" [
        range("coulomb_force", "lbf", 0.4, 4.0), either_sign("difference", "lbf", 0.2, 2.0)];
    "friction": "fading_friction" [
        range("coulomb_force", "lbf", 0.8, 4.0), range("loss", "1", 0.3, 0.8)];
};

/// The effect of that name.
pub fn entry(name: &str) -> Option<Entry> {
    CATALOGUE
        .iter()
        .chain(LATER)
        .find(|e| e.name == name)
        .copied()
}

/// An effect with its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// The entry it was drawn from.
    pub entry: Entry,
    /// Values in the order of the entry's parameters, inch and pound-force.
    pub values: Vec<f64>,
    /// Position between weak (0) and strong (1).
    pub strength: f64,
}

impl Effect {
    /// Draws log-uniformly from the upper 85 % of the range; all parameters at one strength.
    pub fn draw(entry: Entry, rng: &mut ChaCha8Rng) -> Self {
        let strength: f64 = rng.random_range(0.15..1.0);
        let values = entry
            .parameters
            .iter()
            .map(|p| {
                let sign = if p.signed && rng.random_bool(0.5) {
                    -1.0
                } else {
                    1.0
                };
                sign * p.weak * (p.strong / p.weak).powf(strength)
            })
            .collect();
        Self {
            entry,
            values,
            strength,
        }
    }
}
