//! Servo-hydraulic actuator in a closed displacement loop: command to displacement.
//!
//! Nominal: `τ u' = g r + o - u`, `e = u - x`, `x' = K e` (Merritt, Hydraulic Control Systems,
//! 1967: a valve-controlled cylinder integrates, the loop closes it to one pole). The command runs
//! evenly from sample to sample; the equations are integrated by the classical Runge-Kutta method.
//!
//! Effects are counted in natural units: the standard deviation of the displacement and `1/K`.

use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Equations, Natural, RigRecording};
use crate::data::Channel;

/// The rig.
pub struct ClosedLoopActuator;

const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "m",
};

/// The fastest pole times a step at most, and the most steps of a sample.
const STIFFNESS: f64 = 0.5;
const MOST_STEPS: f64 = 64.0;

nominal_parameters! {
    /// K: speed over position error.
    loop_gain: "1/s",
    /// τ: lag of the command before the loop.
    command_lag: "s",
    /// g: steady displacement over command.
    scale: "1" = 1.0,
    /// o: shift of the command.
    offset: "m" = 0.0,
}

session_parameters! {
    /// Of the displacement's transducer; of the first file the offset tells it.
    zero: "m" within 0.05 as AgainstFirst,
}

effects! {
    /// r(t - T): conversion, computation and valve electronics.
    delay: Delay {
        delay: size("s", 0.05, (0.0, 5.0)),
    } from [[0.1], [0.3], [1.0]], like ["valve_lag"];
    /// Overlapped valve: x' = K (e - b sgn e) beyond |e| > b (Merritt 1967, section 5-2).
    dead_band: DeadBand {
        half_width: size("m", 3e-3, (0.0, 3.0)),
    } from [[0.02], [0.15]], like ["reduced_null_gain"];
    /// Lands that overlap and leak, so that the flow gain is lower around null (higher where
    /// they underlap): x' = K (e - s w tanh(e / w)) (Merritt 1967, section 5-2).
    reduced_null_gain: ReducedNullGain {
        reduction: size("1", 0.05, (-1.0, 1.0)),
        width: shape("m", 0.1, 1.0),
    } from [[0.4, 0.1], [-0.3, 0.1]], like ["dead_band"];
    /// Unequal piston areas: x' = K e (1 + a sgn e) (Viersma, Analysis, Synthesis and Design
    /// of Hydraulic Servosystems, 1980).
    asymmetric_gain: AsymmetricGain {
        asymmetry: size("1", 0.01, (-0.8, 0.8)),
    } from [[0.03], [-0.03]];
    /// Spool: T w' = K e - w, x' = w.
    valve_lag: ValveLag {
        time_constant: size("s", 0.05, (0.0, 1.0)),
    } from [[0.1], [0.3]], like ["delay"];
    /// Flow falls with speed as the load pressure rises: x' = w / (1 + |w| / s).
    flow_saturation: FlowSaturation {
        compression: size("s/m", 0.01, (0.0, 5.0)),
    } from [[0.05]];
    /// Transducer: y = x (1 + c x).
    sensor_curvature: SensorCurvature {
        curvature: size("1/m", 3e-3, (-0.3, 0.3)),
    } from [[5e-3], [-5e-3]];
    /// Transducer linkage: y follows x only beyond a gap.
    free_play: FreePlay {
        gap: size("m", 5e-3, (0.0, 1.0)),
    } from [[0.03]];
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
    type Session = Session;
    const INPUTS: &'static [Channel] = &[COMMAND];
    const OUTPUT: Channel = Channel::Displacement;
    const IS_SCALED: bool = true;

    fn natural(nominal: &Nominal, channels: Natural) -> Natural {
        Natural {
            time: 1.0 / nominal.loop_gain,
            ..channels
        }
    }

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
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
            reduced_null_gain: null,
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
        let sample = recording.period();
        // A lag that the finest step does not see is none.
        let shortest = sample / MOST_STEPS / STIFFNESS;
        let pole = |time: f64| if time > shortest { 1.0 / time } else { 0.0 };
        let (command_pole, valve_pole) = (pole(lag), pole(valve));
        let fastest = (gain * (1.0 + asymmetry.abs()))
            .max(command_pole)
            .max(valve_pole);
        let steps = (sample * fastest / STIFFNESS).ceil().clamp(1.0, MOST_STEPS);
        let h = sample / steps;
        let last = loop_input.len() - 1;
        let at = |place: f64| {
            let place = (place - delay / sample).max(0.0);
            let before = (place as usize).min(last);
            let share = (place - before as f64).min(1.0);
            let after = (before + 1).min(last);
            scale * (loop_input[before] * (1.0 - share) + loop_input[after] * share) + offset
        };
        // Lagging command, displacement, flow of the valve.
        let slope = |[u, x, w]: [f64; 3], r: f64| {
            let u_now = if command_pole > 0.0 { u } else { r };
            let error = u_now - x;
            let mut open = (error.abs() - dead_band).max(0.0).copysign(error);
            if null.reduction != 0.0 {
                open -= null.reduction * null.width * (error / null.width).tanh();
            }
            let flow = gain * (open + asymmetry * open.abs());
            let flow = flow / (1.0 + compression * flow.abs());
            let moving = if valve_pole > 0.0 { w } else { flow };
            [command_pole * (r - u), moving, valve_pole * (flow - w)]
        };
        let mut state = [scale * first + offset, scale * first + offset, 0.0];
        let mut shown = state[1];
        for (k, y) in out.iter_mut().enumerate() {
            let x = state[1];
            // Not `clamp`, which panics where a model has left the finite.
            shown = shown.max(x - 0.5 * gap).min(x + 0.5 * gap);
            *y = shown * (1.0 + curvature * shown) + session.zero;
            if coupling != 0.0 {
                *y += coupling * (command[k] - clean[k]);
            }
            for step in 0..steps as usize {
                let place = k as f64 + step as f64 / steps;
                let ends = [0.0, 0.5, 1.0].map(|part| at(place + part / steps));
                state = runge_kutta(state, h, ends, slope);
            }
        }
    }
}

/// One step of the classical Runge-Kutta method with the input at begin, middle and end.
fn runge_kutta(
    state: [f64; 3],
    h: f64,
    input: [f64; 3],
    slope: impl Fn([f64; 3], f64) -> [f64; 3],
) -> [f64; 3] {
    let ahead = |by: f64, d: [f64; 3]| [0, 1, 2].map(|i| state[i] + by * d[i]);
    let a = slope(state, input[0]);
    let b = slope(ahead(0.5 * h, a), input[1]);
    let c = slope(ahead(0.5 * h, b), input[1]);
    let d = slope(ahead(h, c), input[2]);
    [0, 1, 2].map(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]))
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use crate::data::Recording;

    #[test]
    fn a_step_is_the_closed_form_at_any_rate() {
        // 1 / ((1 + τ s)(1 + s / K)) at 1 kHz and at 25 Hz, where K h = 2.
        let (gain, lag) = (50.0, 0.005);
        for rate in [1000.0, 100.0, 25.0] {
            let n = 200;
            let ramp: Vec<f64> = (0..n).map(|k| f64::from(k) / rate).collect();
            let channels = vec![
                (COMMAND, ramp),
                (Channel::Displacement, vec![0.0; n as usize]),
            ];
            let recording = Recording::new("ramp", 1.0 / rate, channels).unwrap();
            let recording =
                RigRecording::new(recording, ClosedLoopActuator::INPUTS, Channel::Displacement);
            let nominal = Nominal {
                loop_gain: gain,
                command_lag: lag,
                scale: 1.0,
                offset: 0.0,
            };
            let mut out = vec![0.0; n as usize];
            let off = Effects::off().unwrap();
            let session = Session::default();
            ClosedLoopActuator.simulate(&recording, &nominal, &off, &session, &mut out);
            let slow = 1.0 / gain;
            for (k, y) in out.iter().enumerate() {
                let t = k as f64 / rate;
                let fading = |time: f64| time * time * (-t / time).exp();
                let exact = t - slow - lag + (fading(slow) - fading(lag)) / (slow - lag);
                assert!(
                    (y - exact).abs() < 2e-4 * slow,
                    "{rate} Hz, {k}: {y} {exact}"
                );
            }
        }
    }

    #[test]
    fn around_null_the_loop_is_slower_and_far_from_it_as_ever() {
        // A step: half the gain while the error is small against the width of null.
        let (gain, rate, n) = (40.0, 1000.0, 60);
        let moved = |step: f64, at: usize| {
            let command: Vec<f64> = (0..n).map(|k| if k > 0 { step } else { 0.0 }).collect();
            let channels = vec![(COMMAND, command), (Channel::Displacement, vec![0.0; n])];
            let recording = Recording::new("step", 1.0 / rate, channels).unwrap();
            let recording =
                RigRecording::new(recording, ClosedLoopActuator::INPUTS, Channel::Displacement);
            let nominal = Nominal {
                loop_gain: gain,
                command_lag: 0.0,
                scale: 1.0,
                offset: 0.0,
            };
            let effects = Effects {
                reduced_null_gain: ReducedNullGain {
                    reduction: 0.5,
                    width: 1e-4,
                },
                ..Effects::off().unwrap()
            };
            let mut out = vec![0.0; n];
            let session = Session::default();
            ClosedLoopActuator.simulate(&recording, &nominal, &effects, &session, &mut out);
            out[at] / step
        };
        // The command rises over the first sample.
        let closed = |gain: f64, at: usize| 1.0 - (-gain * (at as f64 - 0.5) / rate).exp();
        assert!((moved(1e-6, 50) - closed(0.5 * gain, 50)).abs() < 1e-3);
        assert!((moved(1.0, 50) - closed(gain, 50)).abs() < 1e-3);
    }
}
