//! Servo-hydraulic actuator in a closed displacement loop: command to displacement.
//!
//! Nominal: `τ u' = g r + o - u`, `e = u - x`, `x' = K e` (Merritt, Hydraulic Control Systems,
//! 1967: a valve-controlled cylinder integrates, the loop closes it to one pole).

use super::table::{effects, nominal_parameters, size};
use super::{Equations, RigRecording};
use crate::data::Channel;

/// The rig.
pub struct ClosedLoopActuator;

const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "m",
};

const STEPS: usize = 1;

nominal_parameters! {
    loop_gain: "1/s",
    command_lag: "s",
    scale: "1",
    offset: "m",
}

effects! {
    /// r(t - T): conversion, computation and valve electronics.
    delay: Delay {
        delay: size("s", 1e-3, (0.0, 0.05)),
    } from [[2e-3], [6e-3]], like ["valve_lag"];
    /// Overlapped valve: x' = K (e - b sgn e) beyond |e| > b (Merritt 1967, section 5-2).
    dead_band: DeadBand {
        half_width: size("m", 5e-6, (0.0, 1e-3)),
    } from [[3e-5], [2e-4]];
    /// Unequal piston areas: x' = K e (1 + a sgn e) (Viersma, Analysis, Synthesis and Design
    /// of Hydraulic Servosystems, 1980).
    asymmetric_gain: AsymmetricGain {
        asymmetry: size("1", 0.01, (-0.8, 0.8)),
    } from [[0.03], [-0.03]];
    /// Spool: T w' = K e - w, x' = w.
    valve_lag: ValveLag {
        time_constant: size("s", 1e-3, (0.0, 0.02)),
    } from [[2e-3]], like ["delay"];
    /// Flow falls with speed as the load pressure rises: x' = w / (1 + |w| / s).
    flow_saturation: FlowSaturation {
        compression: size("s/m", 0.2, (0.0, 50.0)),
    } from [[1.0]];
    /// Transducer: y = x (1 + c x).
    sensor_curvature: SensorCurvature {
        curvature: size("1/m", 2.0, (-200.0, 200.0)),
    } from [[3.0], [-3.0]];
    /// Transducer linkage: y follows x only beyond a gap.
    free_play: FreePlay {
        gap: size("m", 1e-5, (0.0, 1e-3)),
    } from [[4e-5]];
    /// Disturbance n that command and output share in the recorder: the loop gets r - n, the
    /// record y = x + c n; n is what a median of five samples takes out of the command.
    shared_disturbance: SharedDisturbance {
        coupling: size("1", 0.1, (-5.0, 5.0)),
    } from [[1.0]];
}

impl Equations for ClosedLoopActuator {
    const KIND: &'static str = "closed_loop_actuator";
    type Nominal = Nominal;
    type Effects = Effects;
    const INPUTS: &'static [Channel] = &[COMMAND];
    const OUTPUT: Channel = Channel::Displacement;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        out: &mut [f64],
    ) {
        let Nominal {
            loop_gain: gain,
            command_lag: lag,
            scale,
            offset,
        } = *nominal;
        let Effects {
            delay: Delay { delay },
            dead_band: DeadBand {
                half_width: dead_band,
            },
            asymmetric_gain: AsymmetricGain { asymmetry },
            valve_lag: ValveLag {
                time_constant: valve,
            },
            flow_saturation: FlowSaturation { compression },
            sensor_curvature: SensorCurvature { curvature },
            free_play: FreePlay { gap },
            shared_disturbance: SharedDisturbance { coupling },
        } = *effects;
        let command = recording.input(COMMAND);
        let clean = &recording.cleaned;
        let loop_input = if coupling == 0.0 { command } else { clean };
        let Some(&first) = loop_input.first() else {
            return;
        };
        let h = recording.period() / STEPS as f64;
        let keep = |time: f64| if time > 1e-5 { (-h / time).exp() } else { 0.0 };
        let (keep_command, keep_valve) = (keep(lag), keep(valve));
        let mut u = scale * first + offset;
        let mut x = u;
        let mut speed = 0.0;
        let mut shown = x;
        let last = loop_input.len() - 1;
        for (k, y) in out.iter_mut().enumerate() {
            shown = shown.clamp(x - 0.5 * gap, x + 0.5 * gap);
            *y = shown * (1.0 + curvature * shown);
            if coupling != 0.0 {
                *y += coupling * (command[k] - clean[k]);
            }
            for step in 0..STEPS {
                let place =
                    k as f64 + (step as f64 + 0.5) / STEPS as f64 - delay / recording.period();
                let place = place.max(0.0);
                let before = (place as usize).min(last);
                let share = place - before as f64;
                let after = (before + 1).min(last);
                let r = loop_input[before] * (1.0 - share) + loop_input[after] * share;
                u = keep_command * u + (1.0 - keep_command) * (scale * r + offset);
                let error = u - x;
                let open = (error.abs() - dead_band).max(0.0).copysign(error);
                let flow = gain * (open + asymmetry * open.abs());
                let flow = flow / (1.0 + compression * flow.abs());
                speed = keep_valve * speed + (1.0 - keep_valve) * flow;
                x += h * speed;
            }
        }
    }
}
