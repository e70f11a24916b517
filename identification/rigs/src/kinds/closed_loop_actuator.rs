//! Servo-hydraulic actuator in a closed displacement loop: command to displacement.
//!
//! Nominal: `τ u' = g r(t - D) + o - u`, `e = u - x`, `z' = i e`, `c = e + z + f u' / K`, `T/2 q' = K c - q`,
//! `T/2 w' = q - w`, `P² v'' + 2 d P v' + v = w - K y x`, `x' = v` (Merritt, Hydraulic Control Systems, 1967: a
//! valve-controlled cylinder integrates, the table's mass swings on the oil, the loop closes). Without a resonance
//! `T/2 v' = q - K y x - v`. What a valve passes is `w`, or that `q`: its effects act there, behind the spool, and a rail on
//! `K c`. A motor or a shaker on a voltage amplifier in such a loop has the same form; its mass is part of `T`. A spring
//! `y` under the table without an integral is a larger gain and a smaller scale: as `i` goes to 0, `K` and `g` are those
//! of the table as it moves, so that `y` shows in what bounds the flow alone. Two lags in a row are nearer to a spool, and
//! to a coil before a mass, than one and a delay. Between samples the command follows a curve, of which a step takes
//! the chord. The linear equations are solved exactly, and what is not linear by steps.
//!
//! Effects are counted in natural units: the standard deviation of the displacement and `1/K`.

use std::cell::Cell;

use units::vocabulary;

use super::between::between;
use super::hypotheses::Inside;
use super::linear_loop::LinearLoop;
use super::loop_step::{Course, Law, Loop, Rubbing, State, tanh};
use super::sensors::accelerometer_scale;
use super::table::{effects, nominal_parameters, session_parameters, shape, size};
use super::{Begun, Cause, Equations, INTERVAL_95, NamedValue, Natural, RigRecording};
use recordings::Channel;

/// The rig.
pub struct ClosedLoopActuator;

const COMMAND: Channel = Channel::Other {
    name: "command",
    unit: "m",
};

/// The loop's gain times a step at most, where it is not linear, and the most steps of a sample.
const FINE: f64 = 0.25;
const MOST_STEPS: f64 = 16.0;
/// The fewest: between samples the command follows a curve, and friction is even over a step.
const SMOOTH: f64 = 2.0;
/// The fewest at a rail, where what is fed back runs straight over a step, at most.
const RAILED: f64 = 4.0;
/// Share of the damping that the controller feeds back, where a search begins, and the most.
const FED_BACK: f64 = 0.02;
const MOST_FED_BACK: f64 = 0.5;
/// Integral below which it does not make up for a spring, 1/s: gain and scale are then those of a table that the
/// spring holds back.
const SLOW: f64 = 0.1;

nominal_parameters! {
    /// K: speed over position error.
    loop_gain: "1/s",
    /// τ: lag of the command before the loop.
    command_lag: "s",
    /// g: steady displacement over command.
    scale: "1" = 1.0,
    /// o: shift of the command, or of the displacement's zero.
    offset: "m" = 0.0,
    /// D: the command arrives late by this.
    command_delay: "s" = 0.0,
    /// T: lag of what moves the table, inside the loop: of two in a row, half each.
    loop_lag: "s" = 0.0,
    /// f: share of the command's speed that the controller sends ahead.
    feedforward: "1" = 0.0,
    /// i: integral over proportional gain.
    integral: "1/s" = 0.0,
    /// y: share of the displacement by which a spring under the table holds it back, behind what bounds the flow.
    spring_droop: "1" = 0.0,
    /// P: one over the angular frequency of the mass on the oil, or of a second lag; 0 for none.
    resonance: "s" = 0.0,
    /// d: its damping ratio.
    resonance_damping: "1" = 0.5,
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
    /// Friction of the table: beside the flow, `v + K b tanh(v / s)` (Armstrong-Hélouvry and others,
    /// Automatica 30, 1994): with `s` at zero it moves beyond a position error of `b`. With a resonance it
    /// acts on the mass: `P v' = q - K b tanh(v / s) / 2d` for `P q' = w - v - 2d q`.
    friction: Friction {
        breakaway_error: size("m", 3e-3, (0.0, 3.0)),
        sliding_speed: shape("m/s", 0.02, 1.0),
    } from [[0.02, 0.02], [0.1, 0.05]], like [vocabulary::DEAD_BAND, "reduced_null_gain", "bristle_friction"];
    /// Friction as [`Friction`], of bristles that bend before they slide: `z' = v / d (1 - z sgn v)` in the place of the
    /// tanh (Dahl 1968; Canudas de Wit and others, IEEE Transactions on Automatic Control 40, 1995).
    bristle_friction: BristleFriction {
        breakaway_error: size("m", 3e-3, (0.0, 3.0)),
        deflection: shape("m", 0.01, 0.5),
    } from [[0.01, 0.005], [0.05, 0.02]], like [vocabulary::DEAD_BAND, "reduced_null_gain", "friction", "free_play"];
    /// Overlapped valve: it passes w - K b sgn w beyond |w| > K b (Merritt 1967, section 5-2).
    dead_band: DeadBand {
        half_width: size("m", 3e-3, (0.0, 3.0)),
    } from [[0.02], [0.15]], like ["reduced_null_gain", "friction"];
    /// Lands that overlap and leak, so that the flow gain is lower around null (higher where
    /// they underlap): it passes w - s K b tanh(w / K b) with b the width (Merritt 1967, section 5-2).
    reduced_null_gain: ReducedNullGain {
        reduction: size("1", 0.05, (-1.0, 1.0)),
        // Wider, it is how the flow falls at speed.
        width: shape("m", 0.1, 1.0).at_most(0.3),
    } from [[0.4, 0.1], [-0.3, 0.1]], like [vocabulary::DEAD_BAND, "friction", "bristle_friction"];
    /// Unequal piston areas: the flow is w (1 + a sgn w) (Viersma, Analysis, Synthesis and Design
    /// of Hydraulic Servosystems, 1980).
    asymmetric_gain: AsymmetricGain {
        asymmetry: size("1", 0.01, (-0.8, 0.8)),
    } from [[0.03], [-0.03]];
    /// Spool: T/2 q' = K c - q, T/2 w' = q - w.
    valve_lag: ValveLag {
        time_constant: size("s", 0.05, (0.0, 1.0)),
    } from [[0.1], [0.3]], like ["delay"];
    /// Flow falls with speed as the load pressure rises: w / (1 + s |w|).
    flow_saturation: FlowSaturation {
        compression: size("s/m", 0.01, (0.0, 5.0)),
    } from [[0.05]], like ["speed_limit"];
    /// What drives the table is at its rail: |x'| is 1 / r at most. Of the damping `d` the controller feeds back the share
    /// `s` as acceleration, which ends there.
    speed_limit: SpeedLimit {
        slowness: size("s/m", 0.1, (0.0, 50.0)),
        fed_back: shape("1", FED_BACK, 1.0),
    } from [[1.0, FED_BACK], [2.5, FED_BACK]], like ["flow_saturation"];
    /// Transducer: y = x (1 + c x).
    sensor_curvature: SensorCurvature {
        curvature: size("1/m", 3e-3, (-0.3, 0.3)),
    } from [[5e-3], [-5e-3]], like ["sensor_asymmetry"];
    /// Transducer of two halves, as the coils of a differential transformer: y = x (1 + a sgn x).
    sensor_asymmetry: SensorAsymmetry {
        asymmetry: size("1", 3e-3, (-0.5, 0.5)),
    } from [[0.02], [-0.02]], like ["sensor_curvature"];
    /// Transducer that is worn around its middle: y = x - b sgn x beyond |x| > b.
    sensor_dead_band: SensorDeadBand {
        half_width: size("m", 5e-3, (0.0, 1.0)),
    } from [[0.03]];
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
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[(Channel::Acceleration, &[])];
    const OUTPUT: Channel = Channel::Displacement;
    const IS_SCALED: bool = true;
    const SCREENED: usize = 8192;
    const PLACES: &'static [&'static str] = &["valve"];
    const SAID_BY: &'static [(&'static str, &'static str)] =
        &[("delay", "command_delay"), ("valve_lag", "loop_lag")];
    const CAUSES: &'static [&'static str] = &["command_delay", "scale", "offset"];
    // Beyond, with any loop gain, it makes up for a delay.
    const LIMITS: &'static [(&'static str, f64)] = &[("feedforward", 1.2)];

    fn natural(nominal: &Nominal, channels: Natural) -> Natural {
        Natural {
            time: 1.0 / nominal.loop_gain,
            ..channels
        }
    }

    fn starts(
        &self,
        recording: &RigRecording,
        _nominal: &Nominal,
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        // A rail is hardly above the fastest motion that it lets through.
        let places: Vec<usize> = (0..errors.len())
            .filter(|k| errors[*k].is_finite())
            .collect();
        let speeds = speeds(recording.output(), &places);
        let fastest = speeds.map(|(_, most)| most).filter(|most| *most > 0.0);
        let start = fastest.map(|most| ("speed_limit", vec![recording.period() / most, FED_BACK]));
        start.into_iter().collect()
    }

    fn read_off(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &Nominal,
    ) -> Vec<Begun> {
        let rail = rail(recording.input(COMMAND), recording.output(), places);
        let begun = rail.map(|samples| Begun {
            nominal: vec![
                nominal.loop_gain,
                nominal.command_lag,
                nominal.scale,
                nominal.offset,
                nominal.command_delay,
                nominal.loop_lag,
                nominal.feedforward,
                nominal.integral,
                nominal.spring_droop,
                nominal.resonance,
                nominal.resonance_damping,
            ],
            session: vec![0.0],
            effect: Some(("speed_limit", vec![samples * recording.period(), FED_BACK])),
        });
        begun.into_iter().collect()
    }

    fn estimated(
        &self,
        recording: &RigRecording,
        places: &[usize],
        nominal: &Nominal,
    ) -> Option<Vec<f64>> {
        // What an equation gives no sign of is small: no fit comes back from nothing.
        const SMALL: f64 = 0.05;
        let own = LinearLoop::of(recording, COMMAND, places)?;
        let or_small = |value: f64, stated: f64| value.max(SMALL * stated);
        let has_second = own.lag > 0.0 && own.second_lag > 0.0;
        let resonance = own.second_lag.max(0.0).sqrt();
        Some(vec![
            own.gain,
            nominal.command_lag,
            own.scale,
            nominal.offset,
            own.delay,
            or_small(if has_second { 0.0 } else { own.lag }, nominal.loop_lag),
            or_small(own.feedforward, nominal.feedforward),
            or_small(own.integral, nominal.integral),
            nominal.spring_droop,
            or_small(resonance, nominal.resonance),
            if has_second {
                (0.5 * own.lag / resonance).clamp(0.05, 3.0)
            } else {
                nominal.resonance_damping
            },
        ])
    }

    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause> {
        // Calibrations of accelerometer and transducer agree within this. Without a filter before the converter an
        // accelerometer shows shocks beyond half of the rate as slow motion, at all frequencies alike: that may change
        // its scale by as much where samples are so many a second, in 95 of 100 cases.
        const CALIBRATED: f64 = 0.01;
        const ENOUGH: f64 = 200.0;
        let slowest = recordings
            .iter()
            .map(|one| one.recorded_period)
            .fold(0.0, f64::max);
        let folded = CALIBRATED * (slowest * ENOUGH).max(1.0).powi(2);
        let scale = accelerometer_scale(recordings, COMMAND).map(|own| NamedValue {
            standard_error: own.standard_error.hypot(folded / INTERVAL_95),
            ..own
        });
        let cause = scale.and_then(|scale| Cause::perhaps(scale, (1.0, CALIBRATED)));
        cause.into_iter().collect()
    }

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let mut inside = Inside::default();
        self.simulate_with(recording, nominal, effects, session, &mut inside, out);
    }

    fn simulate_with(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        inside: &mut Inside<'_>,
        out: &mut [f64],
    ) {
        let Nominal {
            loop_gain,
            command_lag: lag,
            scale,
            offset,
            command_delay,
            loop_lag,
            feedforward,
            integral,
            spring_droop,
            resonance,
            resonance_damping,
        } = *nominal;
        let Effects {
            delay: Delay { delay },
            dead_band: DeadBand {
                half_width: dead_band,
            },
            friction:
                Friction {
                    breakaway_error,
                    sliding_speed,
                },
            bristle_friction:
                BristleFriction {
                    breakaway_error: held_by_bristles,
                    deflection,
                },
            reduced_null_gain: null,
            asymmetric_gain: AsymmetricGain { asymmetry },
            valve_lag: ValveLag {
                time_constant: valve,
            },
            flow_saturation: FlowSaturation { compression },
            speed_limit: SpeedLimit { slowness, fed_back },
            sensor_curvature: SensorCurvature { curvature },
            sensor_asymmetry: SensorAsymmetry { asymmetry: halves },
            sensor_dead_band: SensorDeadBand { half_width: unseen },
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
        let delay = (delay + command_delay) / sample;
        // The spring shows in the steady displacement, as a gain and a scale, or in what the integral makes up for.
        let idle = SLOW / (integral + SLOW);
        let held = 1.0 + spring_droop * idle;
        let gain = loop_gain / held;
        let friction = if held_by_bristles > 0.0 {
            Some((held_by_bristles, Law::Bristles(deflection)))
        } else {
            (breakaway_error > 0.0).then_some((breakaway_error, Law::Sliding(sliding_speed)))
        };
        let friction = friction.map(|(held, law)| Rubbing {
            most: gain * held,
            law,
        });
        let form = Loop {
            gain,
            command_lag: lag,
            loop_lag: valve + loop_lag,
            feedforward,
            integral,
            spring_droop,
            resonance,
            resonance_damping,
            fed_back: if slowness > 0.0 {
                fed_back.min(MOST_FED_BACK)
            } else {
                0.0
            },
            friction,
        };
        let fastest = if slowness > 0.0 {
            1.0 / slowness
        } else {
            f64::INFINITY
        };
        let has_effect =
            dead_band != 0.0 || null.reduction != 0.0 || asymmetry != 0.0 || compression != 0.0;
        let is_linear = !has_effect
            && inside.valves.is_empty()
            && fastest == f64::INFINITY
            && form.friction.is_none();
        let steps = if is_linear {
            SMOOTH
        } else {
            let most = gain * (1.0 + asymmetry.abs());
            let smooth = if slowness > 0.0 && resonance > 0.0 {
                (sample / resonance).ceil().clamp(SMOOTH, RAILED)
            } else {
                SMOOTH
            };
            (sample * most / FINE).ceil().clamp(smooth, MOST_STEPS)
        };
        let step = form.step(sample / steps, sample);
        let at = |place: f64| held * (scale * between(loop_input, place - delay) + offset);
        let (share, per_length) = (1.0 / steps, 1.0 / step.length);
        let now = Cell::new(0.0);
        // The flow through the valve where the spool would give this one.
        let through = |linear: f64| {
            let passed = linear / gain;
            let mut open = (passed.abs() - dead_band).max(0.0).copysign(passed);
            if null.reduction != 0.0 {
                open -= null.reduction * null.width * tanh(passed / null.width);
            }
            let flow = gain * (open + asymmetry * open.abs());
            if compression == 0.0 {
                flow
            } else {
                flow / (1.0 + compression * flow.abs())
            }
        };
        let is_bounded = fastest < f64::INFINITY || !inside.valves.is_empty();
        let asked = |sent: f64| {
            let flow = gain * inside.valve(now.get(), sent);
            flow.min(fastest).max(-fastest)
        };
        // What either is beyond that of the linear loop.
        let has_spool = has_effect.then_some(step.spool).flatten();
        let beyond = |sent: f64| {
            let flow = asked(sent);
            let flow = if has_effect && has_spool.is_none() {
                through(flow)
            } else {
                flow
            };
            flow - gain * sent
        };
        let beyond = (is_bounded || has_effect && has_spool.is_none()).then_some(&beyond);
        let passed = |spool: f64| through(spool) - spool;
        let passed = has_spool.map(|at| (at, &passed));
        let start = scale * first + offset;
        let made_up = spring_droop * (1.0 - idle) * start;
        let against = gain * spring_droop * start;
        let mut state: State = [
            held * start,
            start,
            against,
            made_up,
            0.0,
            0.0,
            against,
            0.0,
        ];
        let mut shown = state[1];
        let mut begin = at(0.0);
        for (k, y) in out.iter_mut().enumerate() {
            let x = state[1];
            // Not `clamp`, which panics where a model has left the finite.
            shown = shown.max(x - 0.5 * gap).min(x + 0.5 * gap);
            let seen = (shown.abs() - unseen).max(0.0).copysign(shown);
            *y = seen * (1.0 + curvature * seen) + halves * seen.abs() + session.zero;
            if coupling != 0.0 {
                *y += coupling * (command[k] - clean[k]);
            }
            for part in 0..steps as usize {
                let place = k as f64 + part as f64 * share;
                now.set(place * sample);
                let end = at(place + share);
                let course = Course {
                    ends: [begin, end],
                    slope: (end - begin) * per_length,
                };
                state = step.advance(state, &course, beyond, passed);
                begin = end;
            }
        }
    }
}

/// Samples per metre at the speed that the table keeps to where the command is faster; none without one.
fn rail(command: &[f64], displacement: &[f64], places: &[usize]) -> Option<f64> {
    // Of a motion that nothing holds back, few samples are nearly as fast as the fastest.
    const KEPT: f64 = 1.35;
    const FASTER: f64 = 1.3;
    let ((often, most), (_, asked)) = (speeds(displacement, places)?, speeds(command, places)?);
    (most > 0.0 && most < KEPT * often && asked > FASTER * most).then(|| 1.0 / most)
}

/// Speeds per sample that `values` pass seldom (one in twenty) and hardly ever (two in a thousand).
fn speeds(values: &[f64], places: &[usize]) -> Option<(f64, f64)> {
    // Samples on either side.
    const APART: usize = 2;
    let speed = |&k: &usize| {
        let apart = values.get(k + APART)? - values.get(k.checked_sub(APART)?)?;
        Some(apart.abs() / (2 * APART) as f64).filter(|own| own.is_finite())
    };
    let mut speeds: Vec<f64> = places.iter().filter_map(speed).collect();
    speeds.sort_by(f64::total_cmp);
    let at = |share: f64| speeds.get((share * speeds.len() as f64) as usize).copied();
    Some((at(0.95)?, at(0.998)?))
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use recordings::Recording;

    /// A loop without lags.
    fn proportional(loop_gain: f64) -> Nominal {
        Nominal {
            loop_gain,
            command_lag: 0.0,
            scale: 1.0,
            offset: 0.0,
            command_delay: 0.0,
            loop_lag: 0.0,
            feedforward: 0.0,
            integral: 0.0,
            spring_droop: 0.0,
            resonance: 0.0,
            resonance_damping: 0.5,
        }
    }

    /// Root of the squared error over the square of what was measured.
    fn relative_error(out: &[f64], measured: &[f64]) -> f64 {
        let errors = out.iter().zip(measured).map(|(a, b)| (a - b).powi(2));
        let size: f64 = measured.iter().map(|x| x * x).sum();
        (errors.sum::<f64>() / size).sqrt()
    }

    fn answer(rate: f64, command: &[f64], nominal: &Nominal, effects: &Effects) -> Vec<f64> {
        let mut out = vec![0.0; command.len()];
        let channels = vec![
            (COMMAND, command.to_vec()),
            (Channel::Displacement, out.clone()),
        ];
        let recording = Recording::new("command", 1.0 / rate, channels).unwrap();
        let recording =
            RigRecording::new(recording, ClosedLoopActuator::INPUTS, Channel::Displacement);
        let session = Session::default();
        ClosedLoopActuator.simulate(&recording, nominal, effects, &session, &mut out);
        out
    }

    #[test]
    fn the_region_around_null_is_narrow() {
        let mut effects = Effects::table().into_iter();
        let null = effects.find(|own| own.candidate.effect == "reduced_null_gain");
        let parameters = null.unwrap().candidate.parameters;
        let bounds = parameters.iter().map(|own| own.bounds.1);
        assert_eq!(bounds.collect::<Vec<_>>(), [1.0, 0.3]);
    }

    #[test]
    fn a_step_is_the_closed_form_at_any_rate() {
        // 1 / ((1 + τ s)(1 + s / K)) at 1 kHz and at 25 Hz, where K h = 2.
        let (gain, lag) = (50.0, 0.005);
        for rate in [1000.0, 100.0, 25.0] {
            let n = 200;
            let ramp: Vec<f64> = (0..n).map(|k| f64::from(k) / rate).collect();
            let nominal = Nominal {
                command_lag: lag,
                ..proportional(gain)
            };
            let off = Effects::off().unwrap();
            let out = answer(rate, &ramp, &nominal, &off);
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
    fn feedforward_integral_and_rail_have_their_closed_forms() {
        // Into a ramp of 1 m/s the error ends at (1 - f) / K, with an integral at 0; at a rail of 0.5 m/s
        // the table follows at that speed.
        let (rate, n, gain) = (200.0, 800, 20.0);
        let ramp: Vec<f64> = (0..n).map(|k| k as f64 / rate).collect();
        let last = |feedforward: f64, integral: f64, rail: f64, delay: f64| {
            let nominal = Nominal {
                command_delay: delay,
                loop_lag: 0.003,
                feedforward,
                integral,
                ..proportional(gain)
            };
            let off = Effects {
                speed_limit: SpeedLimit {
                    slowness: rail,
                    fed_back: 0.0,
                },
                ..Effects::off().unwrap()
            };
            let out = answer(rate, &ramp, &nominal, &off);
            ramp[n - 1] - out[n - 1]
        };
        assert!((last(0.0, 0.0, 0.0, 0.0) - 0.05).abs() < 1e-9);
        assert!((last(0.8, 0.0, 0.0, 0.0) - 0.01).abs() < 1e-9);
        assert!((last(0.8, 0.0, 0.0, 0.0123) - 0.0223).abs() < 1e-9);
        assert!(last(0.0, 5.0, 0.0, 0.0).abs() < 1e-6);
        let slow = last(0.0, 0.0, 2.0, 0.0);
        assert!((slow - 0.5 * ramp[n - 1]).abs() < 0.01, "{slow}");
    }

    #[test]
    fn a_transducer_shows_its_halves_and_not_its_middle() {
        // So slowly that the table is where it is sent to.
        let (rate, n) = (100.0, 4000);
        let wave: Vec<f64> = (0..n).map(|k| (1e-3 * k as f64).sin()).collect();
        let shown = |asymmetry: f64, half_width: f64| {
            let effects = Effects {
                sensor_asymmetry: SensorAsymmetry { asymmetry },
                sensor_dead_band: SensorDeadBand { half_width },
                ..Effects::off().unwrap()
            };
            answer(rate, &wave, &proportional(1e3), &effects)
        };
        for (asymmetry, half_width) in
            [(0.0, 0.0), (0.1, 0.0), (-0.05, 0.0), (0.0, 0.2), (0.1, 0.2)]
        {
            for (y, x) in shown(asymmetry, half_width).iter().zip(&wave) {
                let exact = match x {
                    x if *x > half_width => (1.0 + asymmetry) * (x - half_width),
                    x if *x < -half_width => (1.0 - asymmetry) * (x + half_width),
                    _ => 0.0,
                };
                assert!(
                    (y - exact).abs() < 3e-4,
                    "{asymmetry} {half_width}: {y} {exact}"
                );
            }
        }
    }

    #[test]
    fn a_rail_is_told_from_a_motion_that_is_only_fast() {
        let n = 4000;
        let places: Vec<usize> = (0..n).collect();
        let wave = |k: usize| (0.01 * k as f64).sin() + 0.4 * (0.037 * k as f64).sin();
        let command: Vec<f64> = (0..n).map(wave).collect();
        assert_eq!(rail(&command, &command, &places), None);
        let most = 4e-3;
        let mut x = 0.0;
        let held = command.iter().map(|r| {
            x += (0.2 * (r - x)).clamp(-most, most);
            x
        });
        let held: Vec<f64> = held.collect();
        let found = rail(&command, &held, &places).unwrap();
        assert!((found * most - 1.0).abs() < 1e-3, "{found}");
    }

    #[test]
    fn friction_on_the_mass_of_a_motor_is_that_of_its_own_equations() {
        // L i' = k (r - x) - R i - b v, m v' = b i - F z, with z of the speed or of bristles, by small steps of its own.
        let (mass, resistance, inductance, constant) = (20.0, 1.0, 2e-3, 80.0);
        let (gain, b, sliding_speed, deflection) = (30.0, 2e-4, 2e-3, 1e-4);
        let force = b * gain * constant * constant / resistance;
        let (rate, n, steps) = (200.0, 2000, 400);
        let wave = |t: f64| 4e-3 * (4.0 * t).sin() + 2e-3 * (13.0 * t).sin();
        let command: Vec<f64> = (0..n).map(|k| wave(k as f64 / rate)).collect();
        let measured = |has_bristles: bool| {
            let (mut current, mut x, mut v, mut z) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            let h = 1.0 / rate / f64::from(steps);
            let mut measured = Vec::new();
            for k in 0..n {
                measured.push(x);
                let next = command[(k + 1).min(n - 1)];
                for part in 0..steps {
                    let r = command[k] + (next - command[k]) * f64::from(part) / f64::from(steps);
                    let voltage = gain * constant * (r - x);
                    current += h * (voltage - resistance * current - constant * v) / inductance;
                    if has_bristles {
                        z += h * (v - z * v.abs()) / deflection;
                    } else {
                        z = (v / sliding_speed).tanh();
                    }
                    v += h * (constant * current - force * z) / mass;
                    x += h * v;
                }
            }
            measured
        };
        let resonance = (mass * inductance).sqrt() / constant;
        let nominal = Nominal {
            resonance,
            resonance_damping: 0.5 * resonance * resistance / inductance,
            ..proportional(gain)
        };
        let off = |measured: &[f64], effects: Effects| {
            let out = answer(rate, &command, &nominal, &effects);
            relative_error(&out, measured)
        };
        let none = Effects::off().unwrap();
        let sliding = Effects {
            friction: Friction {
                breakaway_error: b,
                sliding_speed,
            },
            ..none
        };
        let bristles = Effects {
            bristle_friction: BristleFriction {
                breakaway_error: b,
                deflection,
            },
            ..none
        };
        for (own, has_bristles, other) in [(sliding, false, bristles), (bristles, true, sliding)] {
            let measured = measured(has_bristles);
            let errors = [own, other, none].map(|effects| off(&measured, effects));
            assert!(errors[0] < 1e-3, "{errors:?}");
            assert!(errors[1] > 3.0 * errors[0], "{errors:?}");
            assert!(errors[2] > 0.03, "{errors:?}");
        }
    }

    #[test]
    fn a_spring_under_a_shaker_is_that_of_its_own_equations() {
        // L i' = c - R i - b v, m v' = b i - s x, c of proportion and integral up to a rail, by small steps of its own.
        let (mass, resistance, inductance, constant, stiffness) = (20.0, 1.0, 1e-3, 80.0, 9000.0);
        let gain = 30.0;
        let (rate, n, steps) = (200.0, 4000, 200);
        let wave = |t: f64| 4e-3 * (1.3 * t).sin() + 2e-3 * (9.0 * t).sin();
        let command: Vec<f64> = (0..n).map(|k| wave(k as f64 / rate)).collect();
        let measured = |integral: f64, rail: f64| {
            let (mut current, mut x, mut v, mut sum) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            let h = 1.0 / rate / f64::from(steps);
            let mut measured = Vec::new();
            for k in 0..n {
                measured.push(x);
                for part in 0..steps {
                    let t = k as f64 / rate + f64::from(part) * h;
                    sum += h * integral * (wave(t) - x);
                    let asked = gain * constant * (wave(t) - x + sum);
                    let voltage = asked.clamp(-rail, rail);
                    current += h * (voltage - resistance * current - constant * v) / inductance;
                    v += h * (constant * current - stiffness * x) / mass;
                    x += h * v;
                }
            }
            measured
        };
        let resonance = (mass * inductance).sqrt() / constant;
        let taken = stiffness * resistance / (constant * constant * gain);
        let off = |integral: f64, spring_droop: f64, rail: f64| {
            // Without an integral the scale and the gain hold what the spring takes.
            let held = 1.0 + taken * SLOW / (integral + SLOW);
            let nominal = Nominal {
                scale: 1.0 / held,
                integral,
                spring_droop,
                resonance,
                resonance_damping: 0.5 * resonance * resistance / inductance,
                ..proportional(gain * held)
            };
            let limited = SpeedLimit {
                slowness: constant / rail,
                fed_back: 0.0,
            };
            let effects = Effects {
                speed_limit: limited,
                ..Effects::off().unwrap()
            };
            let out = answer(rate, &command, &nominal, &effects);
            let measured = measured(integral, rail);
            relative_error(&out, &measured)
        };

        let [never, often] = [1e6, 0.9];
        for integral in [0.0, 0.8] {
            assert!(off(integral, taken, never) < 1e-3);
            assert!(off(integral, taken, often) < 3e-3);
            assert!(off(integral, 0.0, often) > 0.02);
        }
        assert!(off(0.8, 0.0, never) > 0.02);
        assert!(off(0.0, 0.0, never) < 1e-3);
    }

    #[test]
    fn feedback_of_the_acceleration_ends_at_the_rail() {
        // L i' = u - R i - b v, m v' = b i - F tanh(v / s), u = k (r - x) + f r' - A v' within a rail, by small steps of
        // its own.
        let (mass, resistance, inductance, constant) = (20.0, 1.0, 2e-3, 80.0);
        let (gain, ahead, held, sliding_speed, fed_back) = (30.0, 0.85, 2e-4, 2e-3, 0.4);
        // Without what is fed back.
        let (own_lag, force) = (
            mass * resistance / (constant * constant),
            held * gain * constant * constant / resistance,
        );
        let lag = own_lag / (1.0 - fed_back);
        let (rate, n, steps) = (200.0, 2000, 400);
        let wave = |t: f64| 0.02 * (3.0 * t).sin() + 0.01 * (23.0 * t).sin();
        let slope = |t: f64| 0.06 * (3.0 * t).cos() + 0.23 * (23.0 * t).cos();
        let command: Vec<f64> = (0..n).map(|k| wave(k as f64 / rate)).collect();
        let measured = |rail: f64, force: f64| {
            let (mut current, mut x, mut v, mut acceleration) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            let h = 1.0 / rate / f64::from(steps);
            let mut measured = Vec::new();
            for k in 0..n {
                measured.push(x);
                for part in 0..steps {
                    let t = k as f64 / rate + f64::from(part) * h;
                    let asked =
                        gain * (wave(t) - x) + ahead * slope(t) - fed_back * lag * acceleration;
                    let voltage = constant * asked.clamp(-rail, rail);
                    current += h * (voltage - resistance * current - constant * v) / inductance;
                    let rubbed = force * (v / sliding_speed).tanh();
                    acceleration = (constant * current - rubbed) / mass;
                    v += h * acceleration;
                    x += h * v;
                }
            }
            measured
        };
        let resonance = (mass * inductance).sqrt() / constant;
        let nominal = Nominal {
            resonance,
            resonance_damping: 0.5 * lag / resonance,
            feedforward: ahead,
            ..proportional(gain)
        };
        let off = |fed_back: f64, rail: f64, held: f64| {
            let effects = Effects {
                speed_limit: SpeedLimit {
                    slowness: 1.0 / rail,
                    fed_back,
                },
                friction: Friction {
                    breakaway_error: held,
                    sliding_speed,
                },
                ..Effects::off().unwrap()
            };
            let out = answer(rate, &command, &nominal, &effects);
            let measured = measured(rail, force * f64::from(held > 0.0));
            relative_error(&out, &measured)
        };
        let (never, often) = (1e3, 0.1);
        for held in [0.0, held] {
            assert!(off(fed_back, never, held) < 1e-4);
            assert!(off(fed_back, often, held) < 1e-3);
            assert!(off(0.0, often, held) > 2e-3);
        }
    }

    #[test]
    fn what_a_valve_passes_is_behind_its_spool_and_a_spring_behind_the_valve() {
        // The equations as they stand, by small steps of their own.
        let (gain, lag, resonance, damping, droop) = (30.0, 0.012, 0.008, 0.3, 0.04);
        let (dead_band, asymmetry) = (3e-4, 0.15);
        let (rate, n, steps) = (200.0, 2000, 400);
        let wave = |t: f64| 0.01 * (3.0 * t).sin() + 2e-3 * (31.0 * t).sin();
        let command: Vec<f64> = (0..n).map(|k| wave(k as f64 / rate)).collect();
        let integral = 8.0;
        let measured = |resonance: f64| {
            let (mut z, mut q, mut w, mut v, mut bend, mut x) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            let h = 1.0 / rate / f64::from(steps);
            let through = |flow: f64| {
                let beyond: f64 = flow - flow.clamp(-gain * dead_band, gain * dead_band);
                beyond * (1.0 + asymmetry * beyond.signum())
            };
            let mut measured = Vec::new();
            for k in 0..n {
                measured.push(x);
                for part in 0..steps {
                    let error = wave(k as f64 / rate + f64::from(part) * h) - x;
                    z += h * integral * error;
                    let spring = gain * droop * x;
                    let half = 2.0 / lag;
                    if resonance > 0.0 {
                        w += h * half * (q - w);
                        let moved = through(w) - spring;
                        bend += h * (moved - v - 2.0 * damping * bend) / resonance;
                        v += h * bend / resonance;
                    } else {
                        v += h * half * (through(q) - spring - v);
                    }
                    q += h * half * (gain * (error + z) - q);
                    x += h * v;
                }
            }
            measured
        };
        for resonance in [0.0, resonance] {
            let nominal = Nominal {
                integral,
                loop_lag: lag,
                spring_droop: droop,
                resonance,
                resonance_damping: damping,
                ..proportional(gain)
            };
            let effects = Effects {
                dead_band: DeadBand {
                    half_width: dead_band,
                },
                asymmetric_gain: AsymmetricGain { asymmetry },
                ..Effects::off().unwrap()
            };
            let out = answer(rate, &command, &nominal, &effects);
            let off = relative_error(&out, &measured(resonance));
            assert!(off < 2e-3, "{resonance}: {off}");
        }
    }

    #[test]
    fn friction_leaves_its_position_error_and_lags_on_the_way_back() {
        // A triangle so slow that only friction counts: after the turn the table waits until the command has come
        // back by twice the breakaway error, then follows at that distance.
        let (rate, n, gain, b) = (200.0, 4000, 30.0, 1e-3);
        let speed = 2e-3;
        let command: Vec<f64> = (0..n)
            .map(|k| {
                let t = k as f64 / rate;
                speed * if t < 10.0 { t } else { 20.0 - t }
            })
            .collect();
        let nominal = Nominal {
            loop_lag: 0.004,
            ..proportional(gain)
        };
        let effects = Effects {
            friction: Friction {
                breakaway_error: b,
                sliding_speed: 2e-5,
            },
            ..Effects::off().unwrap()
        };
        let out = answer(rate, &command, &nominal, &effects);
        let behind = |t: f64| {
            let k = (t * rate) as usize;
            command[k] - out[k]
        };
        let expected = b + speed / gain;
        assert!((behind(9.9) - expected).abs() < 2e-5, "{}", behind(9.9));
        // Stuck: while the command comes back by 1.6 mm, the table creeps by some hundredths of that.
        let [before, after] = [10.1, 10.9].map(|t| (t * rate) as usize);
        let crept = (out[after] - out[before]) / (command[before] - command[after]);
        assert!(crept.abs() < 0.04, "{crept}");
        assert!((behind(19.9) + expected).abs() < 2e-5, "{}", behind(19.9));
    }

    #[test]
    fn around_null_the_loop_is_slower_and_far_from_it_as_ever() {
        // A step: half the gain while the error is small against the width of null.
        let (gain, rate, n) = (40.0, 1000.0, 60);
        let moved = |step: f64, at: usize| {
            let command: Vec<f64> = (0..n).map(|k| if k > 0 { step } else { 0.0 }).collect();
            let nominal = proportional(gain);
            let effects = Effects {
                reduced_null_gain: ReducedNullGain {
                    reduction: 0.5,
                    width: 1e-4,
                },
                ..Effects::off().unwrap()
            };
            let out = answer(rate, &command, &nominal, &effects);
            out[at] / step
        };
        // The command rises over the first sample.
        let closed = |gain: f64, at: usize| 1.0 - (-gain * (at as f64 - 0.5) / rate).exp();
        assert!((moved(1e-6, 50) - closed(0.5 * gain, 50)).abs() < 1e-3);
        assert!((moved(1.0, 50) - closed(gain, 50)).abs() < 1e-3);
    }
}
