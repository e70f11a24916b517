//! Motor-driven linear axis under its known two-loop controller: reference to motor voltage.
//!
//! Nominal: `M v' = G u - F_v v - F_c sgn v - o`, `u = k_p k_v (r - q) - k_v Δq/h`, sampled
//! (Janot, Gautier and Brunot, Data set and reference models of EMPS, 2019). A voltage may be added
//! behind the controller: where the record has no column of it, steps that the controller's law cannot
//! have put out are read from the record.

use super::carriage::{Carriage, Effects, Mechanics, ripple_starts, start_speed};
use super::table::{nominal_parameters, session_parameters};
use super::{Cause, Equations, NamedValue, RigRecording};
use diagnosis::resampling::correlation_time;
use diagnosis::squares;
use nalgebra::{Matrix3, Vector3};
use recordings::{Channel, mean_and_deviation};

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
/// Samples from which the controller's law is found at least, passes in which what it does not explain is left out,
/// deviations from which on that is, and the zero over the travel that is worth no word.
const FEWEST: usize = 200;
const PASSES: usize = 30;
const OUTSIDE: f64 = 4.0;
const SMALL: f64 = 5e-3;
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
        let start = position[0] - zero_at_begin(recording, nominal);
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

    fn contradictions(&self, recordings: &[RigRecording]) -> Vec<Cause> {
        let first = recordings.iter().find_map(zero_by_the_law);
        first.into_iter().collect()
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

/// Means over the first samples of how far the recorded position lies above the one that the controller's law needs for
/// its voltages, m; 0 where the voltage is limited, or more is added, or nothing feeds the position back.
fn zero_at_begin(recording: &RigRecording, nominal: &Nominal) -> f64 {
    let (reference, position) = (
        recording.input(Channel::Reference),
        recording.input(POSITION),
    );
    let voltage = recording.output();
    let (gain, sample) = (nominal.velocity_gain, recording.period());
    let is_free = |u: &f64| u.abs() < nominal.voltage_limit;
    if voltage.len() < BEGIN || !recording.input(ADDED_VOLTAGE).is_empty() {
        return 0.0;
    }
    if !voltage[..BEGIN].iter().all(is_free) {
        return 0.0;
    }
    let speed = start_speed(&position[..BEGIN], sample);
    let above = |k: usize| {
        let needed = (voltage[k] + gain * speed) / (gain * nominal.position_gain);
        position[k] - reference[k] + needed
    };
    let mean = (0..BEGIN).map(above).sum::<f64>() / BEGIN as f64;
    if mean.is_finite() { mean } else { 0.0 }
}

/// The zero of the recorded position against the one that the controller reads, from its law: the voltage is linear in
/// error and speed, and what stays is the zero. Samples that the law does not explain, as those at a limit, are left
/// out by and by. None where it is small.
fn zero_by_the_law(recording: &RigRecording) -> Option<Cause> {
    let (reference, position) = (
        recording.input(Channel::Reference),
        recording.input(POSITION),
    );
    let voltage = recording.output();
    let count = voltage.len().min(position.len()).min(reference.len());
    if count < FEWEST || !recording.input(ADDED_VOLTAGE).is_empty() {
        return None;
    }
    let row = |k: usize| {
        let speed = (position[k] - position[k - 1]) / recording.period();
        Vector3::new(reference[k] - position[k], speed, 1.0)
    };
    let mut used: Vec<usize> = (1..count).filter(|&k| voltage[k].is_finite()).collect();
    for _ in 0..PASSES {
        let sums = used.iter().map(|&k| (row(k), voltage[k]));
        let (normal, right) = sums.fold(
            (Matrix3::zeros(), Vector3::zeros()),
            |(normal, right), (row, u)| (normal + row * row.transpose(), right + row * u),
        );
        let inverse = normal.try_inverse()?;
        let law = inverse * right;
        let left: Vec<f64> = used
            .iter()
            .map(|&k| voltage[k] - law.dot(&row(k)))
            .collect();
        let variance = squares(&left) / left.len() as f64;
        let zero = law[2] / law[0];
        let independent = correlation_time(&left);
        let found = NamedValue {
            name: "position_zero".into(),
            value: zero,
            unit: "m".into(),
            standard_error: (inverse[(2, 2)] * variance * independent).sqrt() / law[0].abs(),
        };
        let (_, travel) = mean_and_deviation(position);
        let kept = used.iter().zip(&left);
        let kept = kept.filter(|(_, own)| own.abs() <= OUTSIDE * variance.sqrt());
        let kept: Vec<usize> = kept.map(|(k, _)| *k).collect();
        if kept.len() == used.len() || kept.len() < FEWEST {
            return Cause::of(found, (0.0, SMALL * travel));
        }
        used = kept;
    }
    None
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
    fn the_zero_of_the_recorded_position_is_read_from_the_controllers_law() {
        let reference: Vec<f64> = (0..SAMPLES)
            .map(|k| 0.09 - 0.04 * (4.0 * k as f64 * 1e-3).cos())
            .collect();
        // A loop of its own: by steps of a tenth of a sample, with friction that has no law here.
        let (mut q, mut v) = (0.05, 0.0);
        let (mut positions, mut voltages) = (Vec::new(), Vec::new());
        let mut before = q - v * 1e-3;
        for r in &reference {
            let u = 160.0 * 240.0 * (r - q) - 240.0 * (q - before) / 1e-3;
            positions.push(q);
            voltages.push(u);
            before = q;
            for _ in 0..10 {
                let force = 35.0 * u - 200.0 * v - 30.0 * (v / 0.01).tanh() * (1.0 + 3.0 * q);
                v += 1e-4 * force / 90.0;
                q += 1e-4 * v;
            }
        }
        let found = |shift: f64| {
            let shown = positions.iter().map(|q| q + shift).collect();
            let recording = recording(vec![
                (Channel::Reference, reference.clone()),
                (POSITION, shown),
                (MOTOR_VOLTAGE, voltages.clone()),
            ]);
            let first = simulated(&recording)[0];
            assert!(
                (first - voltages[0]).abs() < 0.05,
                "{first} {}",
                voltages[0]
            );
            Equations::contradictions(&PositioningDrive, &[recording])
        };
        assert_eq!(found(1e-4), []);
        let [cause] = &found(-0.008)[..] else {
            panic!("there is one cause");
        };
        let zero = &cause.found;
        assert!((zero.value + 0.008).abs() < 2e-5, "{zero:?}");
        assert!(zero.standard_error < 1e-4, "{zero:?}");
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
