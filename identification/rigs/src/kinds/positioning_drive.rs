//! Motor-driven linear axis under its known two-loop controller: reference to motor voltage.
//!
//! Nominal: `M v' = G u - F_v v - F_c sgn v - o`, `u = k_p k_v (r - q) - k_v Δq/h`, sampled
//! (Janot, Gautier and Brunot, Data set and reference models of EMPS, 2019). A voltage may be added
//! behind the controller: where the record has no column of it, steps that the controller's law cannot
//! have put out are read from the record.

use super::carriage::{Carriage, Effects, Mechanics, ripple_starts, start_speed};
use super::table::{nominal_parameters, session_parameters};
use super::{Equations, RigRecording};
use recordings::Channel;

/// The rig.
pub struct PositioningDrive;

const POSITION: Channel = Channel::Other {
    name: "position",
    unit: "m",
};
const MOTOR_VOLTAGE: Channel = Channel::Other {
    name: "motor_voltage",
    unit: "V",
};

/// Voltage added behind the controller.
const ADDED_VOLTAGE: Channel = Channel::Other {
    name: "added_voltage",
    unit: "V",
};

/// Samples over which the speed at the begin is measured.
const BEGIN: usize = 8;
/// An added step is this many deviations of what the law leaves while nothing is added, this share of
/// the greatest voltage, and this many samples long at least.
const CLEAR: f64 = 8.0;
const WORTH: f64 = 0.1;
const SHORTEST: usize = 10;
/// Lower quartile of the size of a normal deviate.
const QUARTILE: f64 = 0.318_6;

nominal_parameters! {
    /// M: all that moves.
    mass: "kg",
    /// F_v.
    viscous_friction: "N s/m",
    /// F_c.
    coulomb_friction: "N",
    /// o: steady force against the motion forward.
    offset: "N",
    /// G: motor force over voltage.
    force_gain: "N/V",
    /// k_p of the position loop.
    position_gain: "1/s",
    /// k_v of the velocity loop.
    velocity_gain: "V s/m",
    /// Of the amplifier.
    voltage_limit: "V",
}

session_parameters! {
    /// Shift of the position's zero against the screw.
    screw_shift: "m" within 0.01 as AgainstFirst,
}

impl Equations for PositioningDrive {
    const KIND: &'static str = "positioning_drive";
    type Nominal = Nominal;
    type Effects = Effects;
    type Session = Session;
    const INPUTS: &'static [Channel] = &[Channel::Reference, POSITION];
    const OPTIONAL: &'static [(Channel, &'static [&'static str])] = &[(ADDED_VOLTAGE, &[])];
    const OUTPUT: Channel = MOTOR_VOLTAGE;

    fn simulate(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        effects: &Effects,
        session: &Session,
        out: &mut [f64],
    ) {
        let Nominal {
            mass,
            viscous_friction: viscous,
            coulomb_friction: coulomb,
            offset,
            force_gain,
            position_gain: kp,
            velocity_gain: kv,
            voltage_limit: limit,
        } = *nominal;
        let (reference, position) = (
            recording.input(Channel::Reference),
            recording.input(POSITION),
        );
        if reference.len() < BEGIN || position.len() < BEGIN {
            return;
        }
        let sample = recording.period();
        // The record may begin in motion: where and how fast is measured.
        let start = position[0] - effects.position_zero.zero;
        let first = (start, start_speed(&position[..BEGIN], sample));
        let mechanics = Mechanics {
            mass,
            viscous,
            coulomb,
            offset,
            force_gain,
            stiffness: 0.0,
        };
        let mut carriage = Carriage::new(mechanics, effects, sample, first, &[]);
        carriage.middle = recording.middle;
        carriage.screw_shift = session.screw_shift;
        let added = added_voltage(recording, nominal);
        let mut before = first.0 - first.1 * sample;
        for (k, y) in out.iter_mut().enumerate() {
            let q = carriage.position;
            let law = kp * kv * (reference[k] - q) - kv * (q - before) / sample;
            let u = (law + added.get(k).copied().unwrap_or(0.0)).clamp(-limit, limit);
            *y = u;
            before = q;
            carriage.advance(u);
        }
    }

    fn starts(
        &self,
        recording: &RigRecording,
        nominal: &Nominal,
        errors: &[f64],
    ) -> Vec<(&'static str, Vec<f64>)> {
        ripple_starts(nominal.coulomb_friction, recording.input(POSITION), errors)
    }

    fn notes(&self, recording: &RigRecording, nominal: &Nominal) -> Vec<String> {
        if !recording.input(ADDED_VOLTAGE).is_empty() {
            return Vec::new();
        }
        let added = added_voltage(recording, nominal);
        let begins = added
            .iter()
            .enumerate()
            .filter(|&(k, u)| *u != 0.0 && (k == 0 || added[k - 1] != *u));
        let levels: Vec<f64> = begins.map(|(_, u)| *u).collect();
        if levels.is_empty() {
            return Vec::new();
        }
        let low = levels.iter().copied().fold(f64::INFINITY, f64::min);
        let high = levels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        vec![format!(
            "{}: the controller's law does not explain all of the voltage: {} steps of {low:.2} \
             to {high:.2} V were added to it and are used as an input. To give them in a column \
             use `columns.{}`",
            recording.name(),
            levels.len(),
            ADDED_VOLTAGE.name(),
        )]
    }
}

/// The voltage that was added behind the controller, as measured or as steps that its law with the
/// measured position leaves; empty where nothing was.
fn added_voltage(recording: &RigRecording, nominal: &Nominal) -> Vec<f64> {
    let measured = recording.input(ADDED_VOLTAGE);
    if !measured.is_empty() {
        return measured.to_vec();
    }
    let (reference, position) = (
        recording.input(Channel::Reference),
        recording.input(POSITION),
    );
    let (kp, kv, sample) = (
        nominal.position_gain,
        nominal.velocity_gain,
        recording.period(),
    );
    let voltage = recording.output();
    let mut left: Vec<f64> = (1..voltage.len())
        .map(|k| {
            let speed = (position[k] - position[k - 1]) / sample;
            let law = kp * kv * (reference[k] - position[k]) - kv * speed;
            let limit = nominal.voltage_limit;
            // At its limit the amplifier hides what was added.
            if voltage[k].abs() < 0.999 * limit {
                voltage[k] - law
            } else {
                0.0
            }
        })
        .collect();
    let most = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let worth = WORTH * most(voltage);
    // Not so where a voltage is missing.
    if !left.iter().all(|v| v.is_finite()) || most(&left) < worth {
        return Vec::new();
    }
    // The speed before the first sample is not known.
    left.insert(0, left.first().copied().unwrap_or(0.0));
    let mut sizes: Vec<f64> = left.iter().map(|v| v.abs()).collect();
    let quarter = sizes.len() / 4;
    let (_, quartile, _) = sizes.select_nth_unstable_by(quarter, f64::total_cmp);
    let threshold = (CLEAR * *quartile / QUARTILE).max(worth);
    let mut added = vec![0.0; left.len()];
    let mut k = 0;
    while k < left.len() {
        let is_step = |v: &f64| v.abs() > threshold && v.signum() == left[k].signum();
        let length = left[k..].iter().take_while(|v| is_step(v)).count();
        if length >= SHORTEST {
            let level = left[k..k + length].iter().sum::<f64>() / length as f64;
            added[k..k + length].fill(level);
        }
        k += length.max(1);
    }
    added
}

#[cfg(test)]
mod tests {
    use super::super::EffectTable;
    use super::*;
    use recordings::Recording;

    const NOMINAL: Nominal = Nominal {
        mass: 90.0,
        viscous_friction: 200.0,
        coulomb_friction: 20.0,
        offset: -3.0,
        force_gain: 35.0,
        position_gain: 160.0,
        velocity_gain: 240.0,
        voltage_limit: 10.0,
    };
    const SAMPLES: usize = 4000;

    fn recording(channels: Vec<(Channel, Vec<f64>)>) -> RigRecording {
        let recording = Recording::new("steps", 1e-3, channels).unwrap();
        RigRecording::new(recording, PositioningDrive::INPUTS, MOTOR_VOLTAGE)
    }

    fn simulated(recording: &RigRecording) -> Vec<f64> {
        let mut out = vec![0.0; SAMPLES];
        let off = Effects::off().unwrap();
        let session = Session::default();
        PositioningDrive.simulate(recording, &NOMINAL, &off, &session, &mut out);
        out
    }

    #[test]
    fn a_loop_at_rest_needs_no_voltage_whatever_zero_the_record_of_its_position_has() {
        let (reference, shift) = (0.05, 0.012);
        let channels = vec![
            (Channel::Reference, vec![reference; SAMPLES]),
            (POSITION, vec![reference + shift; SAMPLES]),
            (MOTOR_VOLTAGE, vec![0.0; SAMPLES]),
        ];
        let recording = recording(channels);
        let first = |zero: f64| {
            let effects = Effects {
                position_zero: super::super::carriage::PositionZero { zero },
                ..Effects::off().unwrap()
            };
            let mut out = vec![0.0; SAMPLES];
            let session = Session::default();
            PositioningDrive.simulate(&recording, &NOMINAL, &effects, &session, &mut out);
            out[0]
        };
        assert!(first(shift).abs() < 1e-9);
        // The position gain times the velocity gain times the distance, limited.
        assert!((first(0.0) + 10.0).abs() < 1e-9);
        assert!((first(shift - 1e-4) + 160.0 * 240.0 * 1e-4).abs() < 1e-6);
    }

    #[test]
    fn steps_added_to_the_voltage_are_an_input_whether_they_have_a_column_or_not() {
        let reference: Vec<f64> = (0..SAMPLES)
            .map(|k| 0.1 * (1.0 - (1.5 * k as f64 * 1e-3).cos()))
            .collect();
        let added: Vec<f64> = (0..SAMPLES)
            .map(|k| {
                let side = if k % 2000 < 1000 { 3.0 } else { -3.0 };
                if (250..750).contains(&(k % 1000)) {
                    side
                } else {
                    0.0
                }
            })
            .collect();
        let inputs = |position: Vec<f64>| {
            vec![
                (Channel::Reference, reference.clone()),
                (POSITION, position),
            ]
        };
        // The axis by itself, under its own voltage, is where the position comes from.
        let rest = inputs(vec![0.0; SAMPLES]);
        let with_column = |voltage: Vec<f64>| {
            let mut channels = rest.clone();
            channels.push((ADDED_VOLTAGE, added.clone()));
            channels.push((MOTOR_VOLTAGE, voltage));
            recording(channels)
        };
        let column = with_column(vec![0.0; SAMPLES]);
        let voltage = simulated(&column);
        assert!(PositioningDrive.notes(&column, &NOMINAL).is_empty());
        let off = Effects::off().unwrap();
        let mechanics = Mechanics {
            mass: NOMINAL.mass,
            viscous: NOMINAL.viscous_friction,
            coulomb: NOMINAL.coulomb_friction,
            offset: NOMINAL.offset,
            force_gain: NOMINAL.force_gain,
            stiffness: 0.0,
        };
        let mut carriage = Carriage::new(mechanics, &off, 1e-3, (0.0, 0.0), &[]);
        let position = voltage.iter().map(|u| {
            let here = carriage.position;
            carriage.advance(*u);
            here
        });
        let mut channels = inputs(position.collect());
        // A recorder's noise, well below the steps.
        let noise = |k: usize| 0.03 * (k as f64 * 91.7).sin();
        let noisy = voltage.iter().enumerate().map(|(k, u)| u + noise(k));
        channels.push((MOTOR_VOLTAGE, noisy.collect()));
        let read = recording(channels);
        let again = simulated(&read);
        let off = |a: &[f64]| {
            let squares = a.iter().zip(&voltage).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / SAMPLES as f64).sqrt()
        };
        assert!(off(&again) < 0.01, "{}", off(&again));
        let notes = PositioningDrive.notes(&read, &NOMINAL);
        assert!(notes[0].contains("4 steps of -3.00 to 3.00 V"), "{notes:?}");
        // Without steps nothing is read out of the record.
        let calm: Vec<f64> = voltage.iter().zip(&added).map(|(u, a)| u - a).collect();
        let mut channels = inputs(read.input(POSITION).to_vec());
        channels.push((MOTOR_VOLTAGE, calm));
        let calm = recording(channels);
        assert!(added_voltage(&calm, &NOMINAL).is_empty());
    }
}
