//! Effects between the valve command and the flow.

use std::f64::consts::TAU;
use units::vocabulary;

use super::quantity::{DELAY, FREQUENCY, RATIO, VOLTAGE};
use super::{AtStart, Component, Effect, Family, Parameter, Scale};
use crate::ModelError;
use crate::delay_line::{DelayLine, MAX_DELAY_SAMPLES, require_delay};

/// The law of the flow over the spool's travel.
pub(super) const VALVE_FLOW: &str = "flow of the valve";

/// The valve: `command -> delay -> play -> spool lag -> offset -> travel limit -> overlap -> gain`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ValveEffects {
    /// Constant offset at the spool, V.
    pub null_bias: f64,
    /// Half width of the spool's overlap, V: `sign(u) max(|u| - w, 0)`.
    pub dead_band: f64,
    /// Relative change of the flow gain: `(1 + g) u`.
    pub flow_gain: f64,
    /// `(1 + q) u` for positive and `(1 - q) u` for negative commands.
    pub asymmetry: f64,
    /// Natural frequency of the second-order spool, Hz; 0 is an ideal spool.
    pub spool_frequency: f64,
    /// Damping ratio of the spool.
    pub spool_damping: f64,
    /// Pure delay of the command, s; at most [`MAX_DELAY_SAMPLES`] steps.
    pub command_delay: f64,
    /// Travel limit of the spool, V; 0 is none.
    pub spool_limit: f64,
    /// Half width of the play between command and spool, V.
    pub hysteresis: f64,
}

/// What lies between the command and the spool's drive: delay and play.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct CommandPath {
    /// Spool behind its play, V.
    pub play: f64,
    /// Past commands, V.
    commands: DelayLine,
}

impl CommandPath {
    /// Takes the `command` (V) held over the next `period` (s) and gives what drives the spool:
    /// two pieces of voltage (V) and duration (s); the first has no duration unless the delay
    /// falls between samples.
    #[inline]
    pub fn advance(&mut self, valve: &ValveEffects, command: f64, period: f64) -> [(f64, f64); 2] {
        self.commands.push(command);
        if valve.command_delay == 0.0 {
            self.play = valve.play(self.play, command);
            return [(self.play, 0.0), (self.play, period)];
        }
        let samples = valve.command_delay / period;
        let whole = (samples as usize).min(MAX_DELAY_SAMPLES);
        let split = (samples - whole as f64) * period;
        let (earlier, later) = (self.commands.ago(whole + 1), self.commands.ago(whole));
        let first = valve.play(self.play, earlier);
        self.play = valve.play(first, later);
        [(first, split), (self.play, period - split)]
    }
}

impl Default for ValveEffects {
    fn default() -> Self {
        Self {
            null_bias: 0.0,
            dead_band: 0.0,
            flow_gain: 0.0,
            asymmetry: 0.0,
            spool_frequency: 0.0,
            spool_damping: 0.7,
            command_delay: 0.0,
            spool_limit: 0.0,
            hysteresis: 0.0,
        }
    }
}

impl Family for ValveEffects {
    type Memory = ();

    const EFFECTS: &'static [Effect] = &[
        Effect {
            equation: "u_s = u + b",
            sentence: "the spool is off its null by {}",
            parameters: &[
                Parameter::new("offset", VOLTAGE, "Offset at the spool; 0 is off")
                    .signed(0.03, 0.3)
                    .on_table(|e| &mut e.valve.null_bias)
                    .at_start(AtStart::ActuatorRates),
            ],
            starts: &[&[0.0]],
            ..Effect::new(vocabulary::VALVE_NULL_BIAS, Component::ShakeTable)
        },
        Effect {
            equation: "u_f = sign(u_s) max(|u_s| - w, 0)",
            sentence: "the spool has a dead band of {} to either side",
            parameters: &[Parameter::new(
                "half_width",
                VOLTAGE,
                "Half width of the spool's overlap; 0 is off",
            )
            .positive(0.03, 0.25)
            .on_table(|e| &mut e.valve.dead_band)
            .min(0.0)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[0.04], &[0.15]],
            law: VALVE_FLOW,
            ..Effect::new("valve_dead_band", Component::ShakeTable)
        },
        Effect {
            equation: "u_f = (1 + g) u_s",
            sentence: "the valve's flow gain is off by {}",
            parameters: &[Parameter::new(
                "relative_change",
                RATIO,
                "Relative change of the flow gain; 0 is off",
            )
            .relative(0.05, 0.25)
            .on_table(|e| &mut e.valve.flow_gain)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[0.0]],
            confounded_with: &["supply_pressure_droop", "load_cell_scale"],
            is_linear: true,
            ..Effect::new("valve_flow_gain", Component::ShakeTable)
        },
        Effect {
            equation: "u_f = (1 + q sign(u_s)) u_s",
            sentence: "the valve's flow gain is off by {} one way and by as much less the other",
            parameters: &[Parameter::new(
                "asymmetry",
                RATIO,
                "q of the gains 1 + q for positive and 1 - q for negative flow; 0 is off",
            )
            .signed(0.05, 0.25)
            .on_table(|e| &mut e.valve.asymmetry)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[0.0]],
            law: VALVE_FLOW,
            ..Effect::new("valve_asymmetric_gain", Component::ShakeTable)
        },
        Effect {
            equation: "u_s'' + 2 zeta w u_s' + w² u_s = w² u, w = 2 pi f",
            sentence: "the spool lags its command, with a natural frequency of {}",
            parameters: &[
                Parameter::new(
                    "frequency",
                    FREQUENCY,
                    "Natural frequency of the second-order spool; 0 is an ideal spool",
                )
                .size(Scale::Inverse(60.0), 60.0, (4.0, 110.0))
                .on_table(|e| &mut e.valve.spool_frequency)
                .min(0.0)
                .at_start(AtStart::ActuatorRates),
                Parameter::new(
                    vocabulary::DAMPING_RATIO,
                    RATIO,
                    "Damping ratio of the spool",
                )
                .shape(Scale::Logarithmic, 0.7, 0.15, (0.3, 1.5))
                .on_table(|e| &mut e.valve.spool_damping)
                .min(1e-3),
            ],
            starts: &[&[40.0, 0.7], &[18.0, 0.7]],
            is_linear: true,
            is_fast: true,
            needs_co_simulation: true,
            ..Effect::new("valve_spool_lag", Component::ShakeTable)
        },
        Effect {
            equation: "u_s(t) = u(t - T)",
            sentence: "the command reaches the valve {} late",
            parameters: &[Parameter::new(
                "delay",
                DELAY,
                "Pure delay of the command, at most 30 steps; 0 is off",
            )
            .delay()
            .on_table(|e| &mut e.valve.command_delay)
            .min(0.0)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[0.005], &[0.013]],
            is_linear: true,
            needs_co_simulation: true,
            ..Effect::new("command_delay", Component::ShakeTable)
        },
        Effect {
            equation: "u_f = clamp(u_s, -L, L)",
            sentence: "the spool's travel ends at {}",
            parameters: &[
                Parameter::new("limit", VOLTAGE, "Travel limit of the spool; 0 is none")
                    .in_peak_commands(0.9, (0.05, 1.0))
                    .on_table(|e| &mut e.valve.spool_limit)
                    .min(0.0)
                    .at_start(AtStart::ActuatorRates),
            ],
            starts: &[
                &[0.85],
                &[0.72],
                &[0.6],
                &[0.5],
                &[0.42],
                &[0.35],
                &[0.28],
                &[0.2],
            ],
            law: VALVE_FLOW,
            ..Effect::new("valve_spool_saturation", Component::ShakeTable)
        },
        Effect {
            equation: "u_s = clamp(u_s before, u - w, u + w)",
            sentence: "the spool has a play of {} to either side",
            parameters: &[Parameter::new(
                "half_width",
                VOLTAGE,
                "Half width of the play between command and spool; 0 is off",
            )
            .positive(0.03, 0.25)
            .on_table(|e| &mut e.valve.hysteresis)
            .min(0.0)
            .at_start(AtStart::ActuatorRates)],
            starts: &[&[0.04], &[0.15]],
            needs_co_simulation: true,
            law: VALVE_FLOW,
            ..Effect::new("valve_hysteresis", Component::ShakeTable)
        },
    ];

    fn validate(&self) -> Result<(), ModelError> {
        ModelError::require_finite("null_bias", self.null_bias)?;
        ModelError::require_finite("flow_gain", self.flow_gain)?;
        ModelError::require_finite("asymmetry", self.asymmetry)?;
        ModelError::require_non_negative(vocabulary::DEAD_BAND, self.dead_band)?;
        ModelError::require_non_negative("spool_frequency", self.spool_frequency)?;
        ModelError::require_positive("spool_damping", self.spool_damping)?;
        ModelError::require_non_negative("command_delay", self.command_delay)?;
        ModelError::require_non_negative("spool_limit", self.spool_limit)?;
        ModelError::require_non_negative("hysteresis", self.hysteresis)
    }

    fn is_active(&self) -> bool {
        let Self {
            null_bias,
            dead_band,
            flow_gain,
            asymmetry,
            spool_frequency,
            spool_damping: _,
            command_delay,
            spool_limit,
            hysteresis,
        } = *self;
        [null_bias, dead_band, flow_gain, asymmetry, spool_frequency]
            .into_iter()
            .chain([command_delay, spool_limit, hysteresis])
            .any(|size| size != 0.0)
    }
}

impl ValveEffects {
    /// Checks the delay of the command at samples `period` s apart.
    ///
    /// # Errors
    /// A delay that is longer than the memory.
    pub fn validate_delay(&self, period: f64) -> Result<(), ModelError> {
        require_delay("command_delay", self.command_delay, period)
    }

    /// The spool behind its play (V), from its position before and the command now.
    #[inline]
    pub fn play(&self, spool: f64, command: f64) -> f64 {
        spool.clamp(command - self.hysteresis, command + self.hysteresis)
    }

    /// Acceleration of the spool (V/s²) towards `command`.
    #[inline]
    pub fn spool_acceleration(&self, spool: f64, velocity: f64, command: f64) -> f64 {
        let omega = TAU * self.spool_frequency;
        omega * (omega * (command - spool) - 2.0 * self.spool_damping * velocity)
    }

    /// Flow (in V of an ideal valve) through the openings at `spool` (V).
    #[inline]
    pub fn flow(&self, spool: f64) -> f64 {
        let mut u = spool + self.null_bias;
        if self.spool_limit > 0.0 {
            u = u.clamp(-self.spool_limit, self.spool_limit);
        }
        if self.dead_band > 0.0 {
            u = u.signum() * (u.abs() - self.dead_band).max(0.0);
        }
        u * (1.0 + self.flow_gain) * (1.0 + self.asymmetry * u.signum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_and_offset_shift_the_flow() {
        let valve = ValveEffects {
            dead_band: 0.1,
            null_bias: 0.05,
            ..Default::default()
        };
        assert_eq!(valve.flow(0.04), 0.0);
        assert!((valve.flow(0.25) - 0.2).abs() < 1e-15);
        assert!((valve.flow(-0.25) + 0.1).abs() < 1e-15);
    }

    #[test]
    fn play_encloses_the_area_of_its_width() {
        let valve = ValveEffects {
            hysteresis: 0.1,
            ..Default::default()
        };
        let (mut spool, mut area) = (0.0, 0.0);
        let n = 20_000;
        for cycle in 0..2 {
            for i in 0..n {
                let command = (TAU * f64::from(i) / f64::from(n)).sin();
                let next = valve.play(spool, command);
                if cycle == 1 {
                    area += command * (next - spool);
                }
                spool = next;
            }
        }
        // A parallelogram of width 2 w and height 2 (1 - w).
        assert!((area.abs() - 2.0 * 0.1 * 2.0 * 0.9).abs() < 1e-3, "{area}");
    }

    #[test]
    fn each_sign_of_the_opening_has_its_own_gain() {
        let valve = ValveEffects {
            flow_gain: 0.1,
            asymmetry: 0.2,
            ..Default::default()
        };
        // (1 + g)(1 + q) and (1 + g)(1 - q).
        assert!((valve.flow(0.5) - 0.5 * 1.1 * 1.2).abs() < 1e-15);
        assert!((valve.flow(-0.5) + 0.5 * 1.1 * 0.8).abs() < 1e-15);
    }

    #[test]
    fn the_spool_rings_as_a_second_order_lag() {
        // From rest at 1 V: zeta = 0 swings as cos(w t).
        let valve = ValveEffects {
            spool_frequency: 10.0,
            spool_damping: 0.3,
            ..Default::default()
        };
        let w = TAU * 10.0;
        assert!((valve.spool_acceleration(0.0, 0.0, 1.0) - w * w).abs() < 1e-9);
        assert!((valve.spool_acceleration(1.0, 0.0, 0.0) + w * w).abs() < 1e-9);
        assert!((valve.spool_acceleration(0.0, 1.0, 0.0) + 2.0 * 0.3 * w).abs() < 1e-9);
    }
}
