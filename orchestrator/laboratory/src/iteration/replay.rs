//! The next drive from rounds that a laboratory has recorded, without a run of ours.
//!
//! A round is a file with the drive that was played and the displacement that was measured; drive and wanted
//! motion need no common clock. All rounds together give the transfer function; the best of them is the base.
//! The effect of a change of the drive is predicted from the base's own response, so that nonlinear parts that
//! repeat themselves cancel. Every later round is predicted from those before it, which shows how accurate such
//! a prediction is.

use std::path::{Path, PathBuf};

use identification::data::{Called, Channel, Recording};
use motion::Motion;
use motion::metrics::{rms, spectrum};
use realfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use super::correction::{Inverse, Response, from_spectrum, padded};
use super::drive;
use crate::error::Error;
use crate::results::{Out, Results};

/// Files in the folder.
const DRIVE: &str = "drive.csv";
const FIGURES: &str = "replay.json";
/// Shares of the largest correction that are tried.
const TRIED: usize = 20;
/// Coherence below which nothing is corrected.
const COHERENT: f64 = 0.5;
/// Share of the displacement that a drive of a table that follows it may leave unexplained, %.
const UNEXPLAINED: f64 = 50.0;
/// Samples in a row at the largest value that show a rail.
const RAIL: usize = 3;
/// Share of the record by which two clocks may differ.
const APART: f64 = 0.25;

/// What is replayed.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What the rig is called.
    pub rig: Option<String>,
    /// The rounds in their order.
    pub rounds: Vec<PathBuf>,
    /// Names of their columns.
    pub columns: Vec<Called>,
    /// The wanted motion; the first drive without it.
    pub wanted: Option<PathBuf>,
    /// Factor of the wanted motion, 1 without it.
    pub scale: Option<f64>,
    /// Frequencies between which errors are corrected, Hz.
    pub band: [f64; 2],
    /// Largest part of the inverse that a correction applies.
    pub gain: f64,
    /// Rail of the recorded command, in its SI unit.
    pub limit: Option<f64>,
}

/// A recorded round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Its file.
    pub file: PathBuf,
    /// `100 ||wanted - measured|| / ||wanted||` after the delay, %.
    pub error_percent: f64,
    /// Delay of the displacement after the drive, s.
    pub delay_s: f64,
    /// What the linear response to the drive leaves of the displacement, %.
    pub unexplained_percent: f64,
    /// Largest recorded command, SI.
    pub peak_command: Option<f64>,
}

/// A round that was predicted from those before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Its file.
    pub file: PathBuf,
    /// What the prediction left of its displacement, %.
    pub displacement_percent: f64,
    /// Its predicted error.
    pub predicted_percent: f64,
    /// Its measured error.
    pub measured_percent: f64,
}

/// The next drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Next {
    /// The round that is corrected.
    pub corrected: PathBuf,
    /// Part of the inverse that is applied.
    pub gain: f64,
    /// Frequencies that are corrected, Hz.
    pub band_hz: [f64; 2],
    /// Predicted error, %.
    pub predicted_percent: f64,
    /// The part of it that remains if the rig is linear, %.
    pub linear_percent: f64,
    /// Largest displacement of the drive, m.
    pub peak_drive_m: f64,
    /// Predicted largest command, SI.
    pub peak_command: Option<f64>,
    /// What keeps the correction from being larger.
    pub limited_by: Option<String>,
}

/// What came out: `replay.json`, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Replay {
    /// The rig.
    pub rig: Option<String>,
    /// The wanted motion.
    pub wanted: String,
    /// Mean coherence of drive and displacement over the band.
    pub coherence: f64,
    /// The rounds.
    pub rounds: Vec<Round>,
    /// Predictions of known rounds.
    pub checks: Vec<Check>,
    /// The next drive.
    pub next: Next,
    /// The next drive as a motion.
    #[serde(skip)]
    pub drive: Option<Motion>,
}

/// A round on an even base, m; its command if it was recorded.
struct Recorded {
    file: PathBuf,
    dt: f64,
    drive: Vec<f64>,
    displacement: Vec<f64>,
    command: Option<Vec<f64>>,
}

fn fault(path: &Path, reason: impl Into<String>) -> Error {
    Error::File {
        path: path.into(),
        reason: reason.into(),
    }
}

/// A file on an even base.
fn recording(path: &Path, columns: &[Called]) -> Result<Recording, Error> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let read = Recording::read_called(path, &name, columns)?;
    let (mut pieces, _) = read
        .on_even_base()
        .map_err(|error| fault(path, error.to_string()))?;
    match (pieces.pop(), pieces.is_empty()) {
        (Some(whole), true) => Ok(whole),
        _ => Err(fault(
            path,
            "a gap in its times; expected one uninterrupted record",
        )),
    }
}

/// Samples without their mean; cells that are empty are between their neighbours.
fn centred(values: &[f64]) -> Vec<f64> {
    let known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let mut last = 0.0;
    let all = values.iter().map(|value| {
        if value.is_finite() {
            last = value - mean;
        }
        last
    });
    all.collect()
}

impl Recorded {
    fn read(path: &Path, columns: &[Called]) -> Result<Self, Error> {
        let own = recording(path, columns)?;
        let channel = |channel: Channel, what: &str| {
            own.channel(channel).map(centred).ok_or_else(|| {
                fault(
                    path,
                    format!(
                        "no `{}`, {what}; name its column with --columns MAP.toml",
                        channel.name()
                    ),
                )
            })
        };
        let drive = channel(Channel::Reference, "the drive that was played")?;
        let displacement = channel(Channel::Displacement, "what was measured")?;
        if rms(&drive) == 0.0 || rms(&displacement) == 0.0 {
            return Err(fault(path, "drive or displacement does not move"));
        }
        Ok(Self {
            file: path.to_owned(),
            dt: own.period(),
            command: own.channel(Channel::ValveCommand).map(<[f64]>::to_vec),
            drive,
            displacement,
        })
    }
}

/// A motion by its displacement, m.
fn motion_of(name: &str, dt: f64, displacement: Vec<f64>) -> Motion {
    let rate = |values: &[f64]| -> Vec<f64> {
        let last = values.len().saturating_sub(1);
        let at = |k: usize| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            (values[after] - values[before]) / ((after - before).max(1) as f64 * dt)
        };
        (0..values.len()).map(at).collect()
    };
    let velocity = rate(&displacement);
    Motion {
        name: name.into(),
        dt,
        acceleration: rate(&velocity),
        velocity,
        displacement,
        notes: Vec::new(),
        seed: None,
        across: None,
    }
}

/// By how many samples `later` is behind `signal`, where they are most alike.
fn lag(signal: &[f64], later: &[f64]) -> f64 {
    let length = (signal.len() + later.len()).next_power_of_two();
    let (a, b) = (spectrum(signal, length), spectrum(later, length));
    let products = a.iter().zip(&b).map(|(a, b)| b * a.conj()).collect();
    let alike = from_spectrum(products, length);
    let most = (APART * signal.len().min(later.len()) as f64) as isize;
    let at = |lag: isize| alike[lag.rem_euclid(length as isize) as usize];
    let best = (-most..=most).max_by(|a, b| at(*a).total_cmp(&at(*b)));
    let best = best.unwrap_or(0);
    // The vertex of the parabola through the three largest.
    let (low, top, high) = (at(best - 1), at(best), at(best + 1));
    let bend = low - 2.0 * top + high;
    let part = if bend < 0.0 {
        0.5 * (low - high) / bend
    } else {
        0.0
    };
    best as f64 + part.clamp(-0.5, 0.5)
}

/// `signal` delayed by `by` samples, `samples` of it.
fn delayed(signal: &[f64], by: f64, samples: usize, dt: f64) -> Vec<f64> {
    let length = padded(signal.len().max(samples), dt);
    let step = std::f64::consts::TAU / length as f64;
    let lines = spectrum(signal, length).into_iter().enumerate();
    let turned = lines.map(|(k, line)| line * Complex64::from_polar(1.0, -step * k as f64 * by));
    let mut moved = from_spectrum(turned.collect(), length);
    moved.truncate(samples);
    moved
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Whether a command stays at its largest value.
fn rail(command: &[f64]) -> Option<f64> {
    let peak = motion::peak(command);
    let mut run = 0;
    for value in command {
        run = if value.abs() >= peak * (1.0 - 1e-9) {
            run + 1
        } else {
            0
        };
        if run >= RAIL {
            return Some(peak);
        }
    }
    None
}

/// The wanted motion as round `own` would show it, m: delayed until it is most alike.
fn as_shown(wanted: &[f64], own: &Recorded) -> Vec<f64> {
    let by = lag(wanted, &own.displacement);
    delayed(wanted, by, own.displacement.len(), own.dt)
}

/// The next drive from the rounds.
///
/// # Errors
/// Files that cannot be read or have not the columns; rounds of different sampling; a motion too short for a
/// transfer function.
pub fn replay(plan: &Plan) -> Result<Replay, Error> {
    let rounds = plan
        .rounds
        .iter()
        .map(|path| Recorded::read(path, &plan.columns));
    let rounds: Vec<Recorded> = rounds.collect::<Result<_, _>>()?;
    let Some(first) = rounds.first() else {
        return Err(Error::Option {
            option: "--replay",
            reason: "no file; expected the recorded rounds in their order".into(),
        });
    };
    let dt = first.dt;
    let same_rate = |path: &Path, other: f64| {
        if (other / dt - 1.0).abs() < 1e-3 {
            return Ok(());
        }
        let [own, other] = [1.0 / dt, 1.0 / other].map(|rate| format!("{rate:.4} Hz"));
        let reason = format!(
            "sampled at {other}; expected {own} as {}",
            first.file.display()
        );
        Err(fault(path, reason))
    };
    for own in &rounds {
        same_rate(&own.file, own.dt)?;
    }
    let (wanted, name) = match &plan.wanted {
        None => (
            first.drive.clone(),
            format!("the drive of {}", first.file.display()),
        ),
        Some(path) => {
            let own = recording(path, &plan.columns)?;
            same_rate(path, own.period())?;
            let channels = [Channel::Reference, Channel::Displacement];
            let found = channels.into_iter().find_map(|one| own.channel(one));
            let found = found.ok_or_else(|| {
                fault(
                    path,
                    "no `displacement`; expected the wanted motion of the table",
                )
            })?;
            (centred(found), path.display().to_string())
        }
    };
    let (wanted, name) = match plan.scale {
        Some(factor) if factor.is_finite() && factor != 0.0 => (
            wanted.iter().map(|x| factor * x).collect(),
            format!("{factor} times {name}"),
        ),
        Some(factor) => {
            return Err(Error::Option {
                option: "--scale",
                reason: format!("{factor}: expected a factor of the wanted motion other than 0"),
            });
        }
        None => (wanted, name),
    };
    let response = |count: usize| -> Result<Response, Error> {
        let pairs: Vec<[&[f64]; 2]> = rounds[..count]
            .iter()
            .map(|own| [own.drive.as_slice(), &own.displacement])
            .collect();
        Response::new(&pairs, dt).ok_or_else(|| {
            fault(
                &first.file,
                "too short for a transfer function; expected 6 s or more",
            )
        })
    };
    let all = response(rounds.len())?;
    let shown: Vec<Vec<f64>> = rounds.iter().map(|own| as_shown(&wanted, own)).collect();
    let size = rms(&wanted);
    let percent = |error: &[f64]| 100.0 * rms(error) / size;
    let mut described = Vec::new();
    for (own, shown) in rounds.iter().zip(&shown) {
        let linear = all.of(&own.drive, dt);
        let rest = less(&own.displacement, &linear);
        described.push(Round {
            file: own.file.clone(),
            error_percent: percent(&less(shown, &own.displacement)),
            delay_s: dt * lag(&own.drive, &own.displacement),
            unexplained_percent: 100.0 * rms(&rest) / rms(&own.displacement),
            peak_command: own.command.as_deref().map(motion::peak),
        });
    }
    let least = described.iter().map(|own| own.unexplained_percent);
    let least = least.fold(f64::INFINITY, f64::min);
    if least.is_nan() || least >= UNEXPLAINED {
        let reason = format!(
            "no linear response to `reference` explains more than {:.0} % of `displacement`; expected the \
             drive of a table that follows it: check columns and units, or diagnose the table first",
            (100.0 - least).max(0.0)
        );
        return Err(fault(&first.file, reason));
    }
    // Every later round from those before it, and the share of the change by which that is off.
    let mut checks = Vec::new();
    let mut off = Vec::new();
    for k in 1..rounds.len() {
        let (own, before) = (&rounds[k], &rounds[k - 1]);
        let known = response(k)?;
        let by = lag(&before.drive, &own.drive);
        let samples = own.drive.len();
        let moved = |signal: &[f64]| delayed(signal, by, samples, dt);
        let change = known.of(&less(&own.drive, &moved(&before.drive)), dt);
        let predicted = sum(&moved(&before.displacement), &change);
        let missed = less(&own.displacement, &predicted);
        off.push(rms(&missed) / rms(&change).max(f64::MIN_POSITIVE));
        checks.push(Check {
            file: own.file.clone(),
            displacement_percent: 100.0 * rms(&missed) / rms(&own.displacement),
            predicted_percent: percent(&less(&shown[k], &predicted)),
            measured_percent: described[k].error_percent,
        });
    }
    let best = (0..rounds.len())
        .min_by(|a, b| {
            described[*a]
                .error_percent
                .total_cmp(&described[*b].error_percent)
        })
        .unwrap_or(0);
    // The latest prediction is the nearest to the one that is asked for.
    let off = off.last().copied();
    let off = off.unwrap_or(described[best].unexplained_percent / 100.0);
    let base = &rounds[best];
    let inverse = Inverse::of(&all, plan.band, COHERENT);
    let (next, drive) = next(plan, base, &shown[best], &inverse, &all, off)?;
    Ok(Replay {
        rig: plan.rig.clone(),
        wanted: name,
        coherence: inverse.coherence(),
        rounds: described,
        checks,
        next,
        drive: Some(drive),
    })
}

/// The correction of `base` with the least predicted error that the rail allows.
fn next(
    plan: &Plan,
    base: &Recorded,
    shown: &[f64],
    inverse: &Inverse,
    response: &Response,
    off: f64,
) -> Result<(Next, Motion), Error> {
    let dt = base.dt;
    let correction = inverse.correction(&less(shown, &base.displacement), dt);
    let change = response.of(&correction, dt);
    let commands = match &base.command {
        None => None,
        Some(command) => {
            let centred = centred(command);
            let pairs: [[&[f64]; 2]; 1] = [[&base.drive, &centred]];
            let own = Response::new(&pairs, dt);
            own.map(|own| (command, own.of(&correction, dt)))
        }
    };
    let limit = plan
        .limit
        .or_else(|| base.command.as_deref().and_then(rail));
    let size = rms(shown);
    let tried = |gain: f64| {
        let part = |values: &[f64]| -> Vec<f64> { values.iter().map(|v| gain * v).collect() };
        let moved = sum(&base.displacement, &part(&change));
        let linear = rms(&less(shown, &moved)) / size;
        let missed = off * gain * rms(&change) / size;
        let command = commands
            .as_ref()
            .map(|(own, change)| motion::peak(&sum(own, &part(change))));
        (linear, linear.hypot(missed), command)
    };
    let allowed = |command: Option<f64>| match (command, limit) {
        (Some(command), Some(limit)) => command <= limit,
        _ => true,
    };
    let gains = (0..=TRIED).map(|k| plan.gain * k as f64 / TRIED as f64);
    let (mut best, mut free) = ((0.0, tried(0.0)), (0.0, tried(0.0)));
    for gain in gains {
        let own = tried(gain);
        if own.1 < free.1.1 {
            free = (gain, own);
        }
        if own.1 < best.1.1 && allowed(own.2) {
            best = (gain, own);
        }
    }
    let (gain, (linear, predicted, peak_command)) = best;
    let limited_by = if gain < free.0 {
        Some(format!(
            "the rail of the command, {:.3}: a part of {:.2} would be best without it",
            limit.unwrap_or(f64::NAN),
            free.0
        ))
    } else if gain < plan.gain {
        Some("what such a prediction misses, which grows with the correction".into())
    } else {
        None
    };
    let drive: Vec<f64> = base
        .drive
        .iter()
        .zip(&correction)
        .map(|(own, change)| own + gain * change)
        .collect();
    let drive = motion_of("next drive", dt, drive);
    Ok((
        Next {
            corrected: base.file.clone(),
            gain,
            band_hz: inverse.corrected_band(),
            predicted_percent: 100.0 * predicted,
            linear_percent: 100.0 * linear,
            peak_drive_m: drive.peak_displacement(),
            peak_command,
            limited_by,
        },
        drive,
    ))
}

/// Writes the drive and the figures; says where.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(found: &Replay, folder: &Out) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    if let Some(next) = &found.drive {
        results.write_text(DRIVE, &drive::text(next))?;
    }
    results.write_text(FIGURES, &format!("{:#}\n", serde_json::json!(found)))?;
    Ok(results.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.005;
    const SAMPLES: usize = 6000;

    fn wanted() -> Vec<f64> {
        let tones = [0.7, 1.3, 2.1, 3.4, 4.9];
        let at = |k: usize| {
            let t = k as f64 * DT;
            let envelope = (std::f64::consts::PI * t / (SAMPLES as f64 * DT))
                .sin()
                .powi(2);
            let sum: f64 = tones
                .iter()
                .enumerate()
                .map(|(i, f)| (std::f64::consts::TAU * f * t + 2.3 * (i * i) as f64).sin() / f)
                .sum();
            3e-3 * envelope * sum
        };
        (0..SAMPLES).map(at).collect()
    }

    /// A table with a lag of 30 ms, 85 % of the drive and a friction that shows as a dead band, in m; the
    /// amplifier's command is 2 kV/m of the table's speed over 1/s.
    fn table(drive: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut x, mut held) = (0.0, 0.0f64);
        let part = 1.0 - (-DT / 0.03).exp();
        let mut command = Vec::new();
        let shown = drive.iter().map(|u| {
            held = held.max(u - 2e-5).min(u + 2e-5);
            let step = part * (0.85 * held - x);
            x += step;
            command.push(2.0 * step / DT);
            x
        });
        (shown.collect(), command)
    }

    /// Writes a round whose displacement is recorded `behind` samples later.
    fn round(path: &Path, drive: &[f64], behind: usize) {
        let (shown, command) = table(drive);
        let mut text =
            String::from("time [s],reference [mm],valve_command [V],displacement [mm]\n");
        for k in 0..drive.len() {
            let then = k.saturating_sub(behind);
            text += &format!(
                "{:.4},{:.7},{:.6},{:.7}\n",
                k as f64 * DT,
                1e3 * drive[k],
                command[then],
                1e3 * shown[then]
            );
        }
        std::fs::write(path, text).unwrap();
    }

    /// A pulse about `middle`, whose spectrum ends far below half of the sampling rate.
    fn pulse(middle: f64, samples: usize) -> Vec<f64> {
        let at = |k: usize| (-((k as f64 - middle) / 6.0).powi(2)).exp();
        (0..samples).map(at).collect()
    }

    #[test]
    fn a_delay_is_found_and_made_to_a_part_of_a_sample() {
        for by in [0.0, 3.0, 7.25, -4.5, 20.75] {
            let (signal, later) = (pulse(60.0, 160), pulse(60.0 + by, 160));
            let found = lag(&signal, &later);
            assert!((found - by).abs() < 0.02, "{found} of {by}");
            let moved = delayed(&signal, by, 160, DT);
            assert_eq!(moved.len(), 160);
            let off = moved.iter().zip(&later).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{by}");
        }
        // Only so many samples, of a signal that is shorter or longer.
        assert_eq!(delayed(&pulse(20.0, 50), 1.0, 30, DT).len(), 30);
        let longer = delayed(&pulse(20.0, 50), 1.0, 80, DT);
        assert!(longer.len() == 80 && longer[70].abs() < 1e-9);
        // Not farther than a quarter of the shorter signal.
        assert!(lag(&pulse(20.0, 160), &pulse(140.0, 160)).abs() <= 40.5);
    }

    #[test]
    fn samples_are_centred_and_gaps_keep_the_last_value() {
        let values = [f64::NAN, 1.0, 3.0, f64::NAN, 5.0];
        assert_eq!(centred(&values), [0.0, -2.0, 0.0, 0.0, 2.0]);
        assert_eq!(centred(&[f64::NAN; 2]), [0.0, 0.0]);
        assert_eq!(less(&[3.0, 1.0], &[1.0, 5.0]), [2.0, -4.0]);
        assert_eq!(sum(&[3.0, 1.0], &[1.0, 5.0]), [4.0, 6.0]);
    }

    /// Of a parabola central differences are exact, one-sided ones are half a sample beside.
    #[test]
    fn a_motion_has_the_rates_of_its_displacement() {
        let dt = 0.5;
        let displacement: Vec<f64> = (0..5).map(|k| (f64::from(k) * dt).powi(2)).collect();
        let own = motion_of("own", dt, displacement.clone());
        assert_eq!((own.dt, &own.displacement), (dt, &displacement));
        assert_eq!(own.velocity, [0.5, 1.0, 2.0, 3.0, 3.5]);
        assert_eq!(own.acceleration, [1.0, 1.5, 2.0, 1.5, 1.0]);
        assert_eq!(motion_of("point", dt, vec![1.0]).velocity, [0.0]);
    }

    #[test]
    fn a_rail_is_the_largest_value_three_times_in_a_row() {
        assert_eq!(rail(&[0.0, 1.0, 2.0, 2.0, 2.0, 1.0]), Some(2.0));
        assert_eq!(rail(&[-3.0, 3.0, -3.0, 0.0]), Some(3.0));
        assert_eq!(rail(&[2.0, 2.0, 1.0, 2.0, 2.0]), None);
        assert_eq!(rail(&[2.0, 2.0, 1.999, 2.0]), None);
        assert_eq!(rail(&[]), None);
    }

    #[test]
    fn what_cannot_be_replayed_is_refused_with_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, dt: f64, rows: &str| {
            let path = folder.path().join(name);
            let rows = rows.split(';').enumerate();
            let rows = rows.map(|(k, row)| format!("{},{row}\n", k as f64 * dt));
            let text = format!("time [s],reference [mm],displacement [mm]\n{}", {
                rows.collect::<String>()
            });
            std::fs::write(&path, text).unwrap();
            path
        };
        let told = |rounds: &[&PathBuf], scale: Option<f64>| {
            let plan = Plan {
                rig: None,
                rounds: rounds.iter().map(|path| (*path).clone()).collect(),
                columns: Vec::new(),
                wanted: None,
                scale,
                band: [0.1, 30.0],
                gain: 0.9,
                limit: None,
            };
            let told = replay(&plan).unwrap_err().to_string();
            told.replace(&format!("{}/", folder.path().display()), "")
        };
        let short = file("short.csv", 0.01, "0,0;1,1;2,1;0,0");
        let slow = file("slow.csv", 0.02, "0,0;1,1;2,1;0,0");
        let still = file("still.csv", 0.01, "0,5;1,5;2,5;0,5");
        for (rounds, scale, expected) in [
            (
                &[][..],
                None,
                "--replay: no file; expected the recorded rounds in their order",
            ),
            (
                &[&short, &slow],
                None,
                "slow.csv: sampled at 50.0000 Hz; expected 100.0000 Hz as short.csv",
            ),
            (
                &[&still],
                None,
                "still.csv: drive or displacement does not move",
            ),
            (
                &[&short],
                None,
                "short.csv: too short for a transfer function; expected 6 s or more",
            ),
            (
                &[&short],
                Some(0.0),
                "--scale: 0: expected a factor of the wanted motion other than 0",
            ),
        ] {
            assert_eq!(told(rounds, scale), expected);
        }
    }

    #[test]
    fn rounds_give_the_next_drive_and_the_error_that_it_then_has() {
        let folder = std::env::temp_dir().join(format!("replay-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = |k: usize| folder.join(format!("round_{k}.csv"));
        let plan = |count: usize, limit: Option<f64>| Plan {
            rig: None,
            rounds: (0..count).map(path).collect(),
            columns: Vec::new(),
            wanted: None,
            scale: None,
            band: [0.1, 30.0],
            gain: 0.9,
            limit,
        };
        round(&path(0), &wanted(), 7);
        let mut errors = Vec::new();
        for count in 1..4 {
            let found = replay(&plan(count, None)).unwrap();
            let next = found.drive.as_ref().unwrap();
            round(&path(count), &next.displacement, 7);
            let then = replay(&plan(count + 1, None)).unwrap();
            let (predicted, measured) = (
                found.next.predicted_percent,
                then.rounds[count].error_percent,
            );
            println!("round {count}: {predicted:.2} % predicted, {measured:.2} % measured");
            assert!(measured < 1.3 * predicted + 0.2, "{predicted} {measured}");
            errors.push(then.rounds[count].error_percent);
            assert!(
                then.checks[count - 1].displacement_percent < 2.0,
                "{:?}",
                then.checks
            );
        }
        let first = replay(&plan(1, None)).unwrap().rounds[0].error_percent;
        let best = errors.iter().copied().fold(f64::INFINITY, f64::min);
        println!("{first:.2} to {errors:.2?}");
        assert!(best < 0.2 * first, "{first} {errors:?}");
        // A rail that the whole correction would pass leaves a part of it.
        let free = replay(&plan(1, None)).unwrap().next;
        let before = replay(&plan(1, None)).unwrap().rounds[0]
            .peak_command
            .unwrap();
        let most = 0.5 * (before + free.peak_command.unwrap());
        let railed = replay(&plan(1, Some(most))).unwrap().next;
        assert!(
            railed.gain < free.gain && railed.peak_command.unwrap() <= most,
            "{railed:?}"
        );
        assert!(railed.limited_by.unwrap().contains("rail"));
        // Without its drive a round is refused by file and remedy.
        std::fs::write(
            path(0),
            "time [s],displacement [mm]\n0,0\n0.005,1\n0.01,0\n",
        )
        .unwrap();
        let refused = replay(&plan(1, None)).unwrap_err().to_string();
        assert!(
            refused.contains("round_0.csv") && refused.contains("--columns"),
            "{refused}"
        );
        // A drive that the table does not follow is refused, and not inverted.
        let drive = wanted();
        let other: Vec<f64> = drive.iter().map(|x| (4e5 * x * x).sin() * 1e-3).collect();
        let rows = drive.iter().zip(&other).enumerate();
        let text: String = rows
            .map(|(k, (u, y))| format!("{:.4},{:.7},{:.7}\n", k as f64 * DT, 1e3 * u, 1e3 * y))
            .collect();
        std::fs::write(
            path(0),
            format!("time [s],reference [mm],displacement [mm]\n{text}"),
        )
        .unwrap();
        let refused = replay(&plan(1, None)).unwrap_err().to_string();
        assert!(
            refused.contains("no linear response to `reference`"),
            "{refused}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
