//! Effects between the valve's opening and the force: supply and oil.

use super::quantity::{FLOW_PER_FORCE, FLOW_PER_FORCE_RATE, FORCE, PER_VOLT, RATIO, TIME_CONSTANT};
use super::valve::VALVE_FLOW;
use super::{AtStart, Component, Effect, Family, Parameter, Scale};
use crate::ModelError;
use units::constants::LBF;

/// Supply pressure, leakage and compressibility, all as a loss of flow in V of an ideal valve.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HydraulicEffects {
    /// Force at which the flow stops, N: `u sqrt(1 - sign(u) F / F_stall)`; 0 is none.
    pub stall_force: f64,
    /// Relative loss of flow per V of recent mean demand, 1/V.
    pub droop_loss: f64,
    /// Time constant of the accumulator, s: `T dm/dt = |u| - m`.
    pub droop_time: f64,
    /// Form of the droop: flow times `(1 - c L m)^(1/c)`; 1 is a straight line, -1 is
    /// `1/(1 + L m)`.
    pub droop_form: f64,
    /// Share of the flow that the droop leaves at least.
    pub droop_floor: f64,
    /// Flow lost in proportion to force, V/N.
    pub leakage: f64,
    /// Flow lost in proportion to the rate of force, V s/N.
    pub compliance: f64,
}

impl Default for HydraulicEffects {
    fn default() -> Self {
        Self {
            stall_force: 0.0,
            droop_loss: 0.0,
            droop_time: 0.5,
            droop_form: 1.0,
            droop_floor: 0.0,
            leakage: 0.0,
            compliance: 0.0,
        }
    }
}

impl Family for HydraulicEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[
        Effect {
            equation: "u_f sqrt(1 - sign(u_f) F / F_stall)",
            sentence: "the flow falls with the load and stops at {}",
            parameters: &[Parameter::new(
                "stall_force",
                FORCE,
                "Force at which the flow stops, flow times sqrt(1 - sign(u) F / stall_force); 0 is none",
            )
            .inverse(90.0 * LBF, 28.0 * LBF)
            .on_table(|e| &mut e.hydraulics.stall_force)
            .min(0.0)],
            starts: &[&[60.0 * LBF]],
            law: VALVE_FLOW,
            ..Effect::new("valve_flow_saturation", Component::ShakeTable)
        },
        Effect {
            equation: "u_f max((1 - c L m)^(1/c), floor), T m' = |u_f| - m",
            sentence: "the supply droops, with {} of the flow lost",
            parameters: &[
                Parameter::new(
                    "loss_per_volt",
                    PER_VOLT,
                    "Relative loss of flow per volt of recent mean demand; 0 is off",
                )
                .positive(0.15, 0.6)
                .on_table(|e| &mut e.hydraulics.droop_loss)
                .min(0.0),
                Parameter::new(
                    "accumulator_time",
                    TIME_CONSTANT,
                    "Time constant of the accumulator",
                )
                .shape(Scale::Logarithmic, 0.5, 0.2, (0.1, 2.0))
                .on_table(|e| &mut e.hydraulics.droop_time)
                .min(1e-3),
                Parameter::new(
                    "form",
                    RATIO,
                    "c of the flow's factor (1 - c loss mean)^(1/c); 1 is a straight line, not 0",
                )
                .shape(Scale::Linear(1.0), 0.0, 1.0, (-3.0, 2.5))
                .on_table(|e| &mut e.hydraulics.droop_form),
                Parameter::new(
                    "floor",
                    RATIO,
                    "Share of the flow that the droop leaves at least",
                )
                .shape(Scale::Linear(1.0), 0.15, 0.1, (0.0, 0.4))
                .on_table(|e| &mut e.hydraulics.droop_floor)
                .min(0.0)
                .max(1.0),
            ],
            starts: &[
                &[0.15, 0.5, 0.0, 0.1],
                &[0.4, 0.5, -1.0, 0.1],
                &[0.4, 0.5, 1.0, 0.1],
            ],
            confounded_with: &["valve_flow_gain"],
            needs_co_simulation: true,
            // The formula ends at zero.
            settle: |effects, _, _| {
                let form = &mut effects.hydraulics.droop_form;
                if form.abs() < 1e-6 {
                    *form = 1e-6;
                }
            },
            ..Effect::new("supply_pressure_droop", Component::ShakeTable)
        },
        Effect {
            equation: "u_f - l F",
            sentence: "oil leaks past the piston, {}",
            parameters: &[Parameter::new(
                "leakage",
                FLOW_PER_FORCE,
                "Flow lost in proportion to force; 0 is off",
            )
            .positive(0.01 / LBF, 0.1 / LBF)
            .on_table(|e| &mut e.hydraulics.leakage)],
            starts: &[&[0.02 / LBF], &[0.06 / LBF]],
            is_linear: true,
            ..Effect::new("internal_leakage", Component::ShakeTable)
        },
        Effect {
            equation: "u_f - c dF/dt",
            sentence: "the oil column is compressible, {}",
            parameters: &[Parameter::new(
                "compliance",
                FLOW_PER_FORCE_RATE,
                "Flow lost in proportion to the rate of force; 0 is off",
            )
            .positive(5e-5 / LBF, 4e-4 / LBF)
            .on_table(|e| &mut e.hydraulics.compliance)
            .min(0.0)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[1e-4 / LBF], &[3e-4 / LBF]],
            is_linear: true,
            is_fast: true,
            ..Effect::new("oil_column_compliance", Component::ShakeTable)
        },
    ];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_non_negative("stall_force", self.stall_force)?;
        ModelError::require_finite("droop_loss", self.droop_loss)?;
        ModelError::require_positive("droop_time", self.droop_time)?;
        ModelError::require_finite("droop_form", self.droop_form)?;
        ModelError::require_non_negative("droop_floor", self.droop_floor)?;
        ModelError::require_finite("leakage", self.leakage)?;
        ModelError::require_finite("compliance", self.compliance)
    }

    fn is_active(&self) -> bool {
        [
            self.stall_force,
            self.droop_loss,
            self.leakage,
            self.compliance,
        ]
        .into_iter()
        .any(|size| size != 0.0)
    }
}

impl HydraulicEffects {
    /// What is left of the flow `u` (V) under `force` (N) and mean demand (V).
    #[inline]
    pub fn available_flow(&self, mut u: f64, force: f64, demand: f64) -> f64 {
        if self.stall_force > 0.0 {
            u *= (1.0 - u.signum() * force / self.stall_force)
                .max(0.0)
                .sqrt();
        }
        if self.droop_loss != 0.0 {
            let loss = self.droop_loss * demand;
            let left = if self.droop_form == 1.0 {
                1.0 - loss
            } else {
                (1.0 - self.droop_form * loss)
                    .max(0.0)
                    .powf(1.0 / self.droop_form)
            };
            u *= left.max(self.droop_floor);
        }
        u - self.leakage * force
    }
}
