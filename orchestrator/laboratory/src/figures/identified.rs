//! Figures of the identification: 2-6, 2-7, 2-9, 2-10.

use pack::Installation;
use std::f64::consts::TAU;
use std::fmt::Write;
use units::vocabulary;

use identification::data::Recording;
use identification::identify::rig;
use plant::linear::log_space;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Figure;
use super::tracking::{Run, over_time};
use crate::error::Error;
use crate::run::experiment::{Request, prepare};
use motion::Motion;
use pages::report::{Abscissa, Panel, Series, Style, Units};
use units::{INCH, POUND_FORCE};

/// Seed of the sensors' noise.
const SEED: u64 = 1;
/// Name in the recording, signal and unit of every channel, with the noise of a laboratory's sensor:
/// 5e-4 in, 1.5 in/s², 0.3 lbf.
const CHANNELS: [(&str, &str, &str, f64); 6] = [
    (vocabulary::VALVE_COMMAND, "control.valve_command", "V", 0.0),
    ("displacement", "table.displacement", "m", 5e-4 * INCH),
    ("acceleration", "table.acceleration", "m/s^2", 1.5 * INCH),
    (
        vocabulary::ACTUATOR_FORCE,
        "table.actuator_force",
        "N",
        0.3 * POUND_FORCE,
    ),
    (
        vocabulary::SPECIMEN_ACCELERATION,
        "specimen.acceleration",
        "m/s^2",
        1.0 * INCH,
    ),
    ("reference", "reference.displacement", "m", 0.0),
];

/// Length of the excitation, s, its frequencies, Hz, and its largest displacement, m.
const LENGTH: f64 = 60.0;
const BAND: (f64, f64, usize) = (0.02, 30.0, 120);
const PEAK: f64 = 0.8 * INCH;

/// Sines of random phase over the whole band of the rig, beginning at rest.
fn excitation(dt: f64) -> Motion {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let sines: Vec<[f64; 3]> = log_space(BAND.0, BAND.1, BAND.2)
        .into_iter()
        .map(|frequency| {
            let size = 1.0 / (1.0 + (frequency / 0.6).powi(2));
            [TAU * frequency, random.random_range(0.0..TAU), size]
        })
        .collect();
    let samples = (LENGTH / dt) as usize;
    let mut motion = Motion {
        name: "sines of 0.02 to 30 Hz".into(),
        dt,
        displacement: Vec::with_capacity(samples),
        velocity: Vec::with_capacity(samples),
        acceleration: Vec::with_capacity(samples),
        notes: Vec::new(),
        seed: Some(SEED),
        across: None,
    };
    for sample in 0..samples {
        let t = sample as f64 * dt;
        let [mut s, mut s1, mut s2] = [0.0; 3];
        for [omega, phase, size] in &sines {
            let (sine, cosine) = (omega * t + phase).sin_cos();
            s += size * sine;
            s1 += size * omega * cosine;
            s2 -= size * omega * omega * sine;
        }
        // Faded in by w = 1 - exp(-t²/2), with its derivatives.
        let fade = (-0.5 * t * t).exp();
        let [w, w1, w2] = [1.0 - fade, t * fade, (1.0 - t * t) * fade];
        motion.displacement.push(w * s);
        motion.velocity.push(w1 * s + w * s1);
        motion.acceleration.push(w2 * s + 2.0 * w1 * s1 + w * s2);
    }
    let factor = PEAK / motion.peak_displacement().max(f64::MIN_POSITIVE);
    for history in [
        &mut motion.displacement,
        &mut motion.velocity,
        &mut motion.acceleration,
    ] {
        history.iter_mut().for_each(|value| *value *= factor);
    }
    motion
}

/// The rig under three-variable control and the excitation.
fn rig(installation: &Installation) -> Result<Run, Error> {
    let request = Request {
        installation: installation.clone(),
        ..Request::built_in("three-variable")
    };
    let mut prepared = prepare(&request)?;
    prepared.motion = excitation(prepared.motion.dt);
    prepared.samples = prepared.motion.len();
    let outcome = prepared.run(prepared.algorithm)?;
    Ok(Run {
        motion: prepared.motion,
        record: outcome.record,
    })
}

/// Data of the identified rig with noise, and the result of `shakebench identify`.
pub(super) fn figures(installation: &Installation) -> Result<Vec<Figure>, Error> {
    let rig = rig(installation)?;
    let velocity = rig.history("velocity", "table.velocity", 2);
    let mut figures = vec![
        Figure {
            number: "2-6",
            text:
                "Input and output data of the actuator model: valve command and table velocity in, \
                   force out. The thesis measured them under the Hokkaido record; these are of the \
                   identified rig under three-variable control and sines of 0.02 to 30 Hz."
                    .into(),
            panels: vec![
                over_time(
                    "Input: valve command",
                    "command",
                    Units::VOLTAGE,
                    vec![rig.history("valve command", "control.valve_command", 3)],
                ),
                over_time(
                    "Input: velocity",
                    "velocity",
                    Units::VELOCITY,
                    vec![velocity],
                ),
                over_time(
                    "Output: force of the actuator",
                    "force",
                    Units::FORCE,
                    vec![rig.history("force", "table.actuator_force", 1)],
                ),
            ],
        },
        Figure {
            number: "2-9",
            text: "Input and output data of the table model: force in, displacement out.".into(),
            panels: vec![
                over_time(
                    "Input: force of the actuator",
                    "force",
                    Units::FORCE,
                    vec![rig.history("force", "table.actuator_force", 1)],
                ),
                over_time(
                    "Output: displacement",
                    "displacement",
                    Units::DISPLACEMENT,
                    vec![rig.history("displacement", "table.displacement", 2)],
                ),
            ],
        },
    ];
    figures.extend(fits(&rig)?);
    Ok(figures)
}

/// Simulation of the part that was not fitted by the identified models.
fn fits(run: &Run) -> Result<Vec<Figure>, Error> {
    let fault = |error: std::io::Error| Error::Option {
        option: "--figures",
        reason: error.to_string(),
    };
    let folder = tempfile::tempdir().map_err(fault)?;
    let data = folder.path().join("recording.csv");
    std::fs::write(&data, recording(run)).map_err(fault)?;
    let (pieces, _) = Recording::read(&data, "recording")?.on_even_base()?;
    let found = rig::identify(&pieces, rig::Options::default())?;
    let period = found
        .model
        .experiments
        .first()
        .map_or(1.0, |own| own.period);
    let figure = |number, channel: &str, label: &str, units: Units| -> Option<Figure> {
        let fit = found.fits.iter().find(|fit| fit.channel == channel)?;
        let line = |name: &str, values: &[f64]| {
            let step = Abscissa::Even {
                start: fit.start,
                step: period,
            };
            Series::line(name, step, values.to_vec())
        };
        let panel: Panel = over_time(
            &format!("{label}, fit {:.2} %", fit.simulated),
            label,
            units,
            vec![
                line("measured", &fit.measured).coloured(0),
                line("simulated", &fit.model)
                    .styled(Style::Dashed)
                    .coloured(2),
            ],
        );
        Some(Figure {
            number,
            text: format!(
                "Measured and simulated {label} on the part of the recording that was not fitted, \
                 with laboratory sensor noise (seed {SEED})."
            ),
            panels: vec![panel],
        })
    };
    let figures = [
        figure("2-7", vocabulary::ACTUATOR_FORCE, "force", Units::FORCE),
        figure("2-10", "displacement", "displacement", Units::DISPLACEMENT),
    ];
    Ok(figures.into_iter().flatten().collect())
}

/// A recording of the rig with noise, as a laboratory would have it.
fn recording(rig: &Run) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let columns: Vec<Vec<f64>> = CHANNELS
        .iter()
        .map(|(_, signal, _, size)| {
            let mut values = rig.column(signal);
            for value in &mut values {
                let noise: f64 = StandardNormal.sample(&mut random);
                *value += size * noise;
            }
            values
        })
        .collect();
    let mut text = "time [s]".to_string();
    for (name, _, unit, _) in CHANNELS {
        let _ = write!(text, ",{name} [{unit}]");
    }
    for sample in 0..columns.iter().map(Vec::len).min().unwrap_or(0) {
        let _ = write!(text, "\n{}", sample as f64 * rig.motion.dt);
        for column in &columns {
            let _ = write!(text, ",{}", column[sample]);
        }
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Velocity and acceleration against central differences.
    #[test]
    fn the_excitation_is_faded_in_with_its_own_derivatives() {
        let dt = 0.0005;
        let own = excitation(dt);
        assert_eq!(own.len(), (LENGTH / dt) as usize);
        assert!((own.peak_displacement() - PEAK).abs() < 1e-12);
        assert_eq!((own.displacement[0], own.velocity[0]), (0.0, 0.0));
        let slope = |values: &[f64], n: usize| (values[n + 1] - values[n - 1]) / (2.0 * dt);
        let (v, a) = (own.peak_velocity(), own.peak_acceleration());
        for n in [200, 1000, 2000, 4000, 50_000] {
            assert!(
                (slope(&own.displacement, n) - own.velocity[n]).abs() < 2e-3 * v,
                "{n}"
            );
            assert!(
                (slope(&own.velocity, n) - own.acceleration[n]).abs() < 4e-3 * a,
                "{n}"
            );
        }
    }
}
