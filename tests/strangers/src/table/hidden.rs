//! What a case hides, inch, pound-force, second, volt.

use hidden_effects::catalogue::Effect;
use serde::{Deserialize, Serialize};

use crate::dice::Dice;

/// How friction goes through zero velocity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Friction {
    /// `tanh(v / w)`.
    Tanh {
        /// Width w, in/s.
        width: f64,
    },
    /// LuGre: bristles that give way at a deflection.
    LuGre {
        /// That deflection, in.
        deflection: f64,
    },
}

/// Laws that the catalogue leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Laws {
    /// Friction about zero velocity.
    pub friction: Friction,
    /// Stribeck's velocity, in/s.
    pub stribeck_velocity: f64,
    /// Yielding by Iwan's sliders in place of Bouc and Wen's.
    pub iwan: bool,
    /// Exponent of Bouc and Wen, and stiffness that is left.
    pub yielding: (f64, f64),
    /// Play of two widths in place of one.
    pub two_plays: bool,
    /// Droop by an accumulator's pressure and a root in place of a hyperbola.
    pub root_droop: bool,
    /// Stiffness beyond uplift.
    pub uplift_ratio: f64,
    /// Drift of degradation, in.
    pub degradation_drift: f64,
    /// Phase of the mains, rad.
    pub mains_phase: f64,
}

impl Laws {
    /// Drawn; `foreign` for laws that are not the catalogue's.
    pub fn draw(foreign: bool, dice: &mut Dice) -> Self {
        Self {
            friction: if foreign {
                Friction::LuGre {
                    deflection: dice.between(5e-4, 3e-3),
                }
            } else {
                Friction::Tanh {
                    width: dice.between(0.05, 0.2),
                }
            },
            stribeck_velocity: dice.between(0.3, 1.0),
            iwan: foreign,
            yielding: (dice.between(2.0, 5.0), dice.between(0.03, 0.1)),
            two_plays: foreign,
            root_droop: foreign,
            uplift_ratio: dice.between(0.1, 0.4),
            degradation_drift: 0.8,
            mains_phase: dice.even(0.0, std::f64::consts::TAU),
        }
    }
}

/// Something outside the catalogue with its size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Outside {
    /// Drag in proportion to `v |v|`, lbf s²/in².
    QuadraticDrag(f64),
    /// Force that repeats every 0.4 in along the rails, lbf.
    RailRipple(f64),
    /// Slack of the specimen about the origin, in.
    SpecimenSlack(f64),
    /// Flow gain that drifts by the clock: its change over 20 s.
    WarmingOil(f64),
    /// Stop on one side from 0.35 in on, lbf/in.
    OneSidedStop(f64),
    /// Load cell that reads this mass's inertia as well, lbf s²/in.
    LoadCellCrosstalk(f64),
    /// Columns that slide by Iwan's law with sliders from 0.2 to 1.8 of the mean yield (in).
    IwanSpecimen(f64),
    /// Friction (lbf) whose bristles give way only at 0.03 in.
    BristleFriction(f64),
    /// Play between command and spool of two widths, 0.2 and 1.8 of this half width (V).
    TwoPlays(f64),
    /// Flow through orifices that the load stalls at this force (lbf), with a laminar part.
    OrificeValve(f64),
}

impl Outside {
    /// Drawn.
    pub fn draw(dice: &mut Dice) -> Self {
        match dice.pick(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]) {
            0 => Self::QuadraticDrag(dice.between(0.02, 0.1)),
            1 => Self::RailRipple(dice.between(0.6, 4.0)),
            2 => Self::SpecimenSlack(dice.between(0.08, 0.4)),
            3 => Self::WarmingOil(dice.sign() * dice.between(0.1, 0.4)),
            4 => Self::OneSidedStop(dice.between(10.0, 60.0)),
            5 => Self::LoadCellCrosstalk(dice.between(0.01, 0.06)),
            6 => Self::IwanSpecimen(dice.between(0.35, 1.0)),
            7 => Self::BristleFriction(dice.between(0.8, 4.0)),
            8 => Self::TwoPlays(dice.between(0.06, 0.25)),
            _ => Self::OrificeValve(dice.between(28.0, 60.0)),
        }
    }

    /// Effects of the catalogue whose cause it shares: naming one of them is right, too.
    pub fn relatives(self) -> &'static [&'static str] {
        match self {
            Self::IwanSpecimen(_) => &["specimen_yielding"],
            Self::BristleFriction(_) => &["coulomb_friction", "stribeck_friction"],
            Self::TwoPlays(_) => &["valve_hysteresis"],
            Self::OrificeValve(_) => &["valve_flow_saturation"],
            _ => &[],
        }
    }
}

/// What is hidden in a rig; neutral by default.
#[derive(Debug, Clone, PartialEq, Default)]
#[allow(missing_docs, reason = "the names are the catalogue's")]
pub struct Hidden {
    pub null_bias: f64,
    pub dead_band: f64,
    pub flow_gain: f64,
    pub asymmetry: f64,
    pub spool_lag: Option<f64>,
    pub delay: f64,
    pub stall_force: Option<f64>,
    pub spool_limit: Option<f64>,
    pub hysteresis: f64,
    pub droop: f64,
    pub coulomb: f64,
    pub stribeck: f64,
    pub leakage: f64,
    pub compliance: f64,
    pub payload: f64,
    pub damping: f64,
    pub cubic: f64,
    pub foundation: Option<f64>,
    pub accelerometer_bias: f64,
    pub accelerometer_scale: f64,
    pub accelerometer_tilt: f64,
    pub accelerometer_delay: f64,
    pub displacement_scale: f64,
    pub displacement_lag: Option<f64>,
    pub load_cell_scale: f64,
    pub load_cell_bias: f64,
    pub hum: f64,
    pub specimen_yield: Option<f64>,
    pub specimen_stiffness: f64,
    pub specimen_damping: f64,
    pub second_mode: Option<f64>,
    pub degradation: f64,
    pub uplift: Option<f64>,
    pub absent: bool,
    pub outside: Option<Outside>,
}

impl Hidden {
    /// Puts an effect of the catalogue in.
    ///
    /// # Panics
    /// Where the catalogue has an effect that this rig has not.
    pub fn put(&mut self, effect: &Effect) {
        let value = effect.values.first().copied().unwrap_or_default();
        match effect.entry.name {
            "valve_null_bias" => self.null_bias = value,
            "valve_dead_band" => self.dead_band = value,
            "valve_flow_gain" => self.flow_gain = value,
            "valve_asymmetric_gain" => self.asymmetry = value,
            "valve_spool_lag" => self.spool_lag = Some(value),
            "command_delay" => self.delay = value,
            "valve_flow_saturation" => self.stall_force = Some(value),
            "valve_spool_saturation" => self.spool_limit = Some(value),
            "valve_hysteresis" => self.hysteresis = value,
            "supply_pressure_droop" => self.droop = value,
            "coulomb_friction" => self.coulomb = value,
            "stribeck_friction" => (self.coulomb, self.stribeck) = (value, effect.values[1]),
            "internal_leakage" => self.leakage = value,
            "oil_column_compliance" => self.compliance = value,
            "added_payload" => self.payload = value,
            "viscous_damping" => self.damping = value,
            "cubic_stiffness" => self.cubic = value,
            "foundation_compliance" => self.foundation = Some(value),
            "accelerometer_bias" => self.accelerometer_bias = value,
            "accelerometer_scale" => self.accelerometer_scale = value,
            "accelerometer_tilt" => self.accelerometer_tilt = value,
            "accelerometer_delay" => self.accelerometer_delay = value,
            "displacement_scale" => self.displacement_scale = value,
            "displacement_lag" => self.displacement_lag = Some(value),
            "load_cell_scale" => self.load_cell_scale = value,
            "load_cell_bias" => self.load_cell_bias = value,
            "mains_hum" => self.hum = value,
            "specimen_yielding" => self.specimen_yield = Some(value),
            "specimen_stiffness" => self.specimen_stiffness = value,
            "specimen_damping" => self.specimen_damping = value,
            "specimen_second_mode" => self.second_mode = Some(value),
            "specimen_degradation" => self.degradation = value,
            "specimen_uplift" => self.uplift = Some(value),
            "specimen_absent" => self.absent = true,
            name => unreachable!("`{name}` has no equation here"),
        }
    }

    /// Puts something outside the catalogue in, as laws where it is one.
    pub fn put_outside(&mut self, outside: Outside, laws: &mut Laws) {
        match outside {
            Outside::BristleFriction(force) => {
                self.coulomb = force;
                laws.friction = Friction::LuGre { deflection: 0.03 };
            }
            Outside::IwanSpecimen(drift) => {
                self.specimen_yield = Some(drift);
                laws.iwan = true;
            }
            Outside::TwoPlays(width) => {
                self.hysteresis = width;
                laws.two_plays = true;
            }
            _ => {}
        }
        self.outside = Some(outside);
    }
}
