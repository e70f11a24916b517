//! Motor-driven linear axis without its controller: motor voltage to position.
//!
//! Nominal: `M v' = G u - F_v v - F_c sgn v - o` (Janot, Gautier and Brunot, Data set and reference
//! models of EMPS, 2019). Nothing brings such an axis back: what a model misses adds up. It
//! restarts wherever the recording states it, from the known positions.

use super::carriage::{Carriage, Effects, Mechanics, ripple_starts, start_speed};
use super::hypotheses::Inside;
use super::table::{nominal_parameters, session_parameters};
use super::{Equations, RigRecording};
use recordings::Channel;

/// The rig.
pub struct LinearAxis;

const MOTOR_VOLTAGE: Channel = Channel::Other {
    name: "motor_voltage",
    unit: "V",
};
const POSITION: Channel = Channel::Other {
    name: "position",
    unit: "m",
};

/// Known positions that are used at most; passes in which they tell position and speed.
const USED: usize = 64;
const PASSES: usize = 2;

nominal_parameters! {
    /// M: all that moves.
    mass: "kg",
    /// F_v.
    viscous_friction: "N s/m",
    /// F_c.
    coulomb_friction: "N",
    /// o: steady force against the motion forward.
    offset: "N" = 0.0,
    /// G: motor force over voltage.
    force_gain: "N/V",
    /// k: a spring that brings it back, such as flexures, about the position zero.
    stiffness: "N/m" = 0.0,
}

session_parameters! {
    /// Shift of the position's zero against the screw.
    screw_shift: "m" within 0.01 as AgainstFirst,
}

impl Equations for LinearAxis {
    const KIND: &'static str = "linear_axis";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[MOTOR_VOLTAGE];
    const OUTPUT: Channel = POSITION;
    const BEGINS_ANEW: bool = true;
    const SCREENED: usize = 8192;
    const PLACES: &'static [&'static str] = &["force"];

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
        let (voltage, measured) = (recording.input(MOTOR_VOLTAGE), recording.output());
        let mechanics = Mechanics {
            mass: nominal.mass,
            viscous: nominal.viscous_friction,
            coulomb: nominal.coulomb_friction,
            offset: nominal.offset,
            force_gain: nominal.force_gain,
            stiffness: nominal.stiffness,
        };
        let carriage = |at: usize, state: (f64, f64)| {
            let before = &voltage[..at];
            let sample = recording.period();
            let mut carriage = Carriage::new(mechanics, effects, sample, state, before);
            carriage.screw_shift = session.screw_shift;
            carriage
        };
        let time = |sample: usize| sample as f64 * recording.period();
        let count = out.len().min(voltage.len());
        let mut ends = recording.begins.iter().skip(1).map(|begin| begin.at);
        for begin in &recording.begins {
            let at = begin.at;
            let end = ends.next().unwrap_or(count).min(count);
            if at >= end {
                continue;
            }
            let known = &measured[at..at + begin.known.min(measured.len() - at).min(USED)];
            let mut state = match known {
                [] => (0.0, 0.0),
                [one] => (*one, 0.0),
                _ => (known[0], start_speed(known, recording.period())),
            };
            // Position and speed move what follows by themselves and by themselves times the time, as
            // long as friction leaves them alone.
            for _ in 0..PASSES * usize::from(known.len() > 2) {
                let mut carriage = carriage(at, state);
                let mut errors = Vec::with_capacity(known.len());
                inside.restart(time(at), state.0, state.1);
                for (k, (y, u)) in known.iter().zip(&voltage[at..]).enumerate() {
                    errors.push(y - carriage.position);
                    carriage.advance_with(*u, time(at + k), inside);
                }
                let slope = start_speed(&errors, recording.period());
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                let middle = 0.5 * (errors.len() - 1) as f64 * recording.period();
                state = (state.0 + mean - slope * middle, state.1 + slope);
            }
            let mut carriage = carriage(at, state);
            inside.restart(time(at), state.0, state.1);
            for (k, (y, u)) in out[at..end].iter_mut().zip(&voltage[at..]).enumerate() {
                *y = carriage.position;
                carriage.advance_with(*u, time(at + k), inside);
            }
        }
    }

    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        ripple_starts(nominal.coulomb_friction, recording.output(), errors)
    }
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use recordings::Recording;

    /// Position under a constant voltage from rest, with viscous friction alone.
    fn exact(t: f64) -> f64 {
        let (mass, viscous, force) = (50.0, 200.0, 60.0);
        let time = mass / viscous;
        force / viscous * (t - time * (1.0 - (-t / time).exp()))
    }

    #[test]
    fn an_axis_begins_anew_from_the_positions_that_are_known() {
        let (h, n) = (1e-3, 2000);
        let position: Vec<f64> = (0..n).map(|k| exact(k as f64 * h)).collect();
        let channels = vec![(MOTOR_VOLTAGE, vec![2.0; n]), (POSITION, position.clone())];
        let recording = Recording::new("axis", h, channels).unwrap();
        let mut recording = RigRecording::new(recording, LinearAxis::INPUTS, POSITION);
        let nominal = Nominal {
            mass: 50.0,
            viscous_friction: 200.0,
            coulomb_friction: 0.0,
            offset: 0.0,
            force_gain: 30.0,
            stiffness: 0.0,
        };
        let errors = |recording: &RigRecording, nominal: &Nominal| -> Vec<f64> {
            let mut out = vec![0.0; n];
            let off = Effects::off().unwrap();
            LinearAxis.simulate(recording, nominal, &off, &Session::default(), &mut out);
            out.iter()
                .zip(&position)
                .map(|(y, m)| (y - m).abs())
                .collect()
        };
        let most = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        let travel = position[n - 1];
        assert!(most(&errors(&recording, &nominal)) < 2e-3 * travel);
        // A wrong model drifts off, but not far in a window: the state at its begin is the measured one.
        let wrong = Nominal {
            viscous_friction: 260.0,
            ..nominal
        };
        let whole = most(&errors(&recording, &wrong));
        recording.begin_every(200, 20);
        let windows = errors(&recording, &wrong);
        assert!(whole > 0.15 * travel, "{whole} of {travel}");
        // 60 N s/m too much at 0.25 m/s brake 50 kg by 0.3 m/s2, over 0.2 s.
        assert!(most(&windows) < 0.5 * 0.3 * 0.04, "{}", most(&windows));
        for begin in &recording.begins {
            assert!(windows[begin.at + 10] < 1e-5, "{}", begin.at);
        }
    }

    /// Cogging of magnets 8 mm apart, on an axis that goes to and fro over 25 of them.
    #[test]
    fn a_ripple_is_looked_for_at_the_period_that_the_errors_have_over_the_position() {
        use std::f64::consts::TAU;
        let (h, n) = (2e-3, 4000);
        let position: Vec<f64> = (0..n)
            .map(|k| 0.1 * (1.0 - (0.5 * TAU * h * k as f64).cos()))
            .collect();
        let errors: Vec<f64> = position
            .iter()
            .map(|q| 1e-4 * (TAU * q / 0.008 + 0.7).sin())
            .collect();
        let channels = vec![(MOTOR_VOLTAGE, vec![2.0; n]), (POSITION, position)];
        let recording = Recording::new("axis", h, channels).unwrap();
        let recording = RigRecording::new(recording, LinearAxis::INPUTS, POSITION);
        let nominal = Nominal {
            mass: 50.0,
            viscous_friction: 200.0,
            coulomb_friction: 40.0,
            offset: 0.0,
            force_gain: 30.0,
            stiffness: 0.0,
        };
        let starts = LinearAxis.starts(&recording, &nominal, &errors);
        assert!(starts.len() >= 4 && starts.iter().all(|own| own.0 == "force_ripple"));
        // Every phase at a fiftieth of the friction, the strongest period first.
        for ((_, start), [cosine, sine]) in
            starts
                .iter()
                .zip([[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
        {
            assert!(
                (start[0] - 0.8 * cosine).abs() < 1e-12 && (start[1] - 0.8 * sine).abs() < 1e-12
            );
            assert!((start[2] / 0.008 - 1.0).abs() < 0.02, "{start:?}");
        }
    }
}
