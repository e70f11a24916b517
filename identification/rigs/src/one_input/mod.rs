//! Rigs of which a command and the displacement alone are recorded: a transfer function with delay.
//!
//! The command is a valve's voltage, or the displacement that was asked of a rig with a loop of its
//! own, such as a press. Where both are recorded the reference is the instrument: what of voltage
//! and displacement it does not explain is noise, the recorded voltage's included, and leaves no
//! bias (see [`crate::closed_loop::bands`]). Poles, zeros and a pole at zero are chosen by how a
//! model that was fitted to every second band predicts the others.

mod controller;
mod explained;
mod fit;
mod model_file;
mod structure;

use nalgebra::{Complex, DMatrix};

use self::fit::{Fitted, Own, fit, measured, relative_error, squares};
use crate::closed_loop::bands::Bands;
use crate::closed_loop::velocity::noise_floor;
use recordings::IdentificationError;
use recordings::{Channel, Recording, fit_percent};
use sysid::state_variable_filter::Between;

pub use controller::Controller;
pub use explained::Explained;
pub use structure::{DelayedTransferFunction, Structure};

/// Frequencies between which a model is fitted, Hz.
const BAND: (f64, f64) = (0.05, 40.0);
/// Mean square of the whitened errors above which there is a warning.
const CLEAR: f64 = 1.6;

/// What of the displacement a valve's command is to explain, %, where a recorded reference may explain more.
const WELL: f64 = 90.0;

/// A structure that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The structure.
    pub structure: Structure,
    /// Mean square of the whitened errors in the bands that were not fitted: one for noise; in percent of
    /// the displacement, squared, where all count evenly.
    pub predicted: f64,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct OneInput {
    /// The command: [`Channel::ValveCommand`] (V) or [`Channel::Reference`] (m).
    pub input: Channel,
    /// Poles and zeros by number.
    pub structure: Structure,
    /// Input to displacement (m).
    pub model: DelayedTransferFunction,
    /// Standard errors of the denominator without its 1, the numerator, and the delay (s).
    pub standard_error: Vec<f64>,
    /// Whether all frequencies count alike, since no structure is within the noise.
    pub evenly: bool,
    /// Mean square of the whitened errors that were fitted: one for a rig that obeys the model.
    pub mean_square: f64,
    /// The same for the parts of the recordings that were not fitted.
    pub check: f64,
    /// What is left of the displacement there over its size, as far as the instrument explains it.
    pub relative_error: f64,
    /// Simulated from the command alone, the worst recording, %: [`fit_percent`].
    pub simulated_percent: f64,
    /// What is explained, and what could be.
    pub explained: Explained,
    /// The controller where reference and command were recorded and it is a gain.
    pub controller: Option<Controller>,
    /// What was tried, the simplest first.
    pub candidates: Vec<Candidate>,
    /// One standard deviation of the white noise of command and displacement, SI.
    pub noise: [f64; 2],
    /// Sampling period of the first recording, s.
    pub period: f64,
    /// What a reader should know, the gravest first.
    pub warnings: Vec<String>,
    /// The rest of each recording: measured and simulated displacement, m.
    pub rest: Vec<Rest>,
    /// The response that was measured, band by band.
    pub response: Vec<Response>,
}

/// The response of a band: displacement over command, as far as the instrument explains both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// rad/s.
    pub omega: f64,
    /// m over the command's unit.
    pub value: Complex<f64>,
    /// One standard deviation that the noise gives it.
    pub deviation: f64,
}

/// The part of a recording that was not fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// The recording.
    pub recording: String,
    /// Time of its first sample, s.
    pub start: f64,
    /// s.
    pub period: f64,
    /// m.
    pub measured: Vec<f64>,
    /// m.
    pub simulated: Vec<f64>,
}

const NEEDED: &str = "valve_command or reference, and displacement";

/// The command of these recordings.
///
/// # Errors
/// Recordings without one, or with different ones.
fn input_of(recordings: &[Recording]) -> Result<Channel, IdentificationError> {
    let has = |channel: Channel| recordings.iter().all(|r| r.channel(channel).is_some());
    let Some(first) = recordings.first() else {
        return Err(IdentificationError::Unreadable {
            recording: "no recording".into(),
            what: "nothing to fit".into(),
            expected: "at least one recording",
        });
    };
    if has(Channel::ValveCommand) {
        return Ok(Channel::ValveCommand);
    }
    if has(Channel::Reference) {
        return Ok(Channel::Reference);
    }
    let lacking = recordings.iter().find(|r| {
        r.channel(Channel::ValveCommand).is_none() && r.channel(Channel::Reference).is_none()
    });
    lacking
        .unwrap_or(first)
        .require(Channel::ValveCommand, NEEDED)?;
    Err(IdentificationError::Unreadable {
        recording: first.name.clone(),
        what: "the recordings hold different commands".into(),
        expected: "`valve_command` in all of them, or `reference` in all",
    })
}

/// Bands of a recording.
fn bands(recording: &Recording, input: Channel) -> Result<Bands, IdentificationError> {
    let command = recording.require(input, NEEDED)?;
    let displacement = recording.require(Channel::Displacement, NEEDED)?;
    let cause = match recording.channel(Channel::Reference) {
        Some(_) => recording.require(Channel::Reference, NEEDED)?,
        None => command,
    };
    let highest = 0.35 / recording.period();
    let mut bands = Bands::new(
        &recording.name,
        &[cause],
        &[command, displacement],
        recording.period(),
        (BAND.0, BAND.1.min(highest)),
    )?;
    if input == Channel::ValveCommand {
        // What a drift makes of a band that is wide beside its frequency is no polynomial.
        bands.bands.retain(|band| {
            let ends = (band.omega.first(), band.omega.last());
            matches!(ends, (Some(first), Some(last)) if 2.0 * first >= *last)
        });
    }
    if std::ptr::eq(cause, command) {
        // A command explains itself wholly, its noise too: there nothing is told of the rig.
        const STIRRED: f64 = 10.0;
        let noise = command_noise(&bands, command);
        bands.bands.retain(|band| {
            band.projected(0).norm_sqr() > STIRRED * noise * band.omega.len() as f64
        });
    }
    Ok(bands)
}

/// Bands of all recordings: one that stirs few of them may come with others.
fn bands_of_all(
    recordings: &[Recording],
    input: Channel,
) -> Result<Vec<Bands>, IdentificationError> {
    const FEWEST: usize = 4;
    let all: Vec<Bands> = recordings
        .iter()
        .map(|own| bands(own, input))
        .collect::<Result<_, _>>()?;
    let count: usize = all.iter().map(|own| own.bands.len()).sum();
    if count < FEWEST {
        let names: Vec<&str> = recordings.iter().map(|own| own.name.as_str()).collect();
        return Err(IdentificationError::NoExcitation {
            recording: names.join(", "),
            what: format!(
                "`{}` exceeds its noise in {count} bands between {:.2} and {:.0} Hz, and a transfer \
                 function needs {FEWEST}; `shakebench diagnose` of the same files also fits a model of mass \
                 and friction to a sine",
                input.name(),
                BAND.0,
                BAND.1
            ),
        });
    }
    Ok(all)
}

/// Power of a line of the noise on a command that is its own instrument, in units of its scale: what
/// its fastest changes may be, and no more than what the displacement does not follow in any band.
fn command_noise(bands: &Bands, command: &[f64]) -> f64 {
    // A command that is nearly as rough as it is large was sent so: that is no noise.
    const ROUGH: f64 = 0.3;
    let (_, size) = recordings::mean_and_deviation(command);
    let floor = noise_floor(command);
    if floor > ROUGH * size {
        return 0.0;
    }
    let fastest = (floor / bands.scale[0]).powi(2);
    let own = bands.bands.iter().map(|band| {
        let lines = band.omega.len() as f64;
        let [power, followed] = [0, 1].map(|i| band.projected(i).norm_sqr() / lines);
        let noise = band.noise[(1, 1)].re;
        power * noise / (noise + followed).max(f64::MIN_POSITIVE)
    });
    own.fold(fastest, f64::min)
}

/// The bands, weighed by their noise, or evenly.
fn all(experiments: &[Bands], evenly: bool) -> Vec<Own<'_>> {
    let of = |bands: &Bands| {
        let powers = bands.bands.iter().map(|band| band.projected(1).norm_sqr());
        let mean = powers.sum::<f64>() / bands.bands.len().max(1) as f64;
        // Whitened errors are then in percent of the displacement.
        evenly.then_some(0.01 * bands.scale[1] * mean.sqrt())
    };
    let own = experiments.iter();
    own.flat_map(|bands| {
        let even = of(bands);
        bands
            .bands
            .iter()
            .map(move |band| Own { bands, band, even })
    })
    .collect()
}

/// Identifies a rig: orders and check come from the first `part` of each recording and the rest, the
/// coefficients from everything. Of a table in a loop whose reference was recorded beside a voltage, and that
/// follows the reference rather than the voltage, the loop is identified.
///
/// # Errors
/// Every way in which data give no model, see [`IdentificationError`].
pub fn identify(recordings: &[Recording], part: f64) -> Result<OneInput, IdentificationError> {
    let input = input_of(recordings)?;
    let found = identify_from(recordings, part, input)?;
    let has_reference = |r: &Recording| r.channel(Channel::Reference).is_some();
    let is_driven = input == Channel::ValveCommand
        && (found.structure.integrates || found.simulated_percent > WELL);
    if input == Channel::Reference || is_driven || !recordings.iter().all(has_reference) {
        return Ok(found);
    }
    let Ok(mut closed) = identify_from(recordings, part, Channel::Reference) else {
        return Ok(found);
    };
    if closed.simulated_percent < found.simulated_percent {
        return Ok(found);
    }
    closed.controller = Controller::of(recordings, BAND);
    let sentence = closed.controller.map(|own| own.sentence());
    closed.warnings.extend(sentence);
    Ok(closed)
}

fn identify_from(
    recordings: &[Recording],
    part: f64,
    input: Channel,
) -> Result<OneInput, IdentificationError> {
    let between = match input {
        Channel::ValveCommand => Between::Held,
        _ => Between::Straight,
    };
    let split = |recording: &Recording| (recording.len() as f64 * part) as usize;
    let fitted: Vec<Recording> = recordings.iter().map(|r| r.cut(0, split(r))).collect();
    let rest: Vec<Recording> = recordings
        .iter()
        .map(|r| r.cut(split(r), r.len()))
        .collect();
    let of = |all: &[Recording]| -> Result<Vec<Bands>, IdentificationError> {
        all.iter().map(|own| bands(own, input)).collect()
    };
    let experiments = bands_of_all(&fitted, input)?;
    let mut own = all(&experiments, false);
    let may_integrate = input == Channel::ValveCommand;
    let mut chosen = choose(between, &own, may_integrate)?;
    // No transfer function is within the noise of a rig with friction. Weights by the noise then let the
    // bands that hold most of the motion be missed; what simulates best counts them as they are.
    let best = chosen.candidates.iter().map(|own| own.predicted);
    let evenly = !may_integrate && best.fold(f64::INFINITY, f64::min) > CLEAR;
    if evenly {
        own = all(&experiments, true);
        chosen = choose(between, &own, may_integrate)?;
    }
    let Chosen {
        candidates,
        structure,
        found,
    } = chosen;
    let found = fit(structure, between, &own, &found).ok_or_else(no_model)?;
    let unseen = of(&rest)?;
    let unseen = all(&unseen, false);
    let by_noise = all(&experiments, false);
    let mean = |all: Vec<f64>| all.iter().sum::<f64>() / (2 * all.len().max(1)) as f64;
    let mean_square = mean(squares(&found.model, &by_noise));
    let rest: Result<Vec<Rest>, _> = rest
        .iter()
        .map(|r| played(&found.model, r, input))
        .collect();
    let rest = rest?;
    let fits = rest.iter().map(|r| fit_percent(&r.measured, &r.simulated));
    let floor = |channel: Channel| {
        let first = recordings.first().and_then(|r| r.channel(channel));
        first.map_or(0.0, noise_floor)
    };
    let simulated_percent = fits.fold(f64::INFINITY, f64::min);
    let check = mean(squares(&found.model, &unseen));
    let relative_error = relative_error(&found.model, &unseen);
    let explained = Explained::of(&found.model, &unseen, &rest, floor(Channel::Displacement));
    // What was validated is then fitted to everything there is.
    let everything = of(recordings)?;
    let everything = all(&everything, evenly);
    let found = fit(
        structure,
        between,
        &everything,
        std::slice::from_ref(&found),
    )
    .unwrap_or(found);
    let mut one = OneInput {
        input,
        structure,
        standard_error: standard_errors(
            &found,
            mean(squares(&found.model, &everything)).max(if evenly { 0.0 } else { 1.0 }),
        ),
        evenly,
        mean_square,
        check,
        relative_error,
        simulated_percent,
        explained,
        controller: None,
        model: found.model,
        candidates,
        noise: [input, Channel::Displacement].map(floor),
        period: recordings.first().map_or(0.0, Recording::period),
        warnings: Vec::new(),
        rest,
        response: everything.iter().map(|own| measured(*own)).collect(),
    };
    one.warnings = remarks(&one, recordings);
    Ok(one)
}

fn no_model() -> IdentificationError {
    IdentificationError::NotConverged {
        method: "the fit of command to displacement",
        reason: "no start value gives a stable model; check the sign of the command, and record a \
             minute \
                 or longer of noise or a sweep of 0.1 to 20 Hz"
            .into(),
    }
}

/// A structure that was chosen.
struct Chosen {
    /// What was tried.
    candidates: Vec<Candidate>,
    structure: Structure,
    /// Models of it, of a part of the bands each.
    found: Vec<Fitted>,
}

/// The simplest structure that predicts bands it was not fitted to as well as the best does: every second
/// one from those between, and the lowest ones from those above, for motions go on below what was
/// excited and a model that reaches down wrongly is of no use there.
fn choose(
    between: Between,
    bands: &[Own],
    may_integrate: bool,
) -> Result<Chosen, IdentificationError> {
    // Those at the low end, where a band is wide beside its frequency, and the last are fitted always:
    // beyond its data a model says nothing.
    const ALWAYS: usize = 2;
    let is_always = |i: usize| i < ALWAYS || i + 1 == bands.len();
    let part = |chosen: &dyn Fn(usize) -> bool| -> Vec<Own> {
        let own = bands.iter().enumerate();
        own.filter(|(i, _)| chosen(*i))
            .map(|(_, own)| *own)
            .collect()
    };
    let mut folds: Vec<(Vec<Own>, Vec<Own>)> = [0, 1]
        .map(|parity| {
            (
                part(&|i| is_always(i) || i % 2 == parity),
                part(&|i| !is_always(i) && i % 2 != parity),
            )
        })
        .into();
    // The lowest octave, an eighth of the bands at least.
    let lowest = bands
        .iter()
        .map(|own| own.band.middle())
        .fold(f64::INFINITY, f64::min);
    let mut by_frequency: Vec<f64> = bands.iter().map(|own| own.band.middle()).collect();
    by_frequency.sort_by(f64::total_cmp);
    let eighth = by_frequency.get(bands.len() / 8).copied().unwrap_or(lowest);
    let is_low = |i: usize| bands[i].band.middle() <= eighth.max(2.0 * lowest);
    if (0..bands.len()).filter(|i| is_low(*i)).count() * 2 < bands.len() {
        folds.push((part(&|i| !is_low(i)), part(&is_low)));
    }
    let unseen = folds.iter().map(|fold| fold.1.len()).sum::<usize>();
    let mut tried: Vec<(Candidate, Vec<f64>)> = Vec::new();
    let mut fitted: Vec<Vec<Fitted>> = vec![Vec::new(); folds.len()];
    for structure in Structure::candidates(may_integrate) {
        let mut predicted = Vec::new();
        for ((seen, unseen), fitted) in folds.iter().zip(&mut fitted) {
            if let Some(own) = fit(structure, between, seen, fitted) {
                predicted.extend(squares(&own.model, unseen));
                fitted.push(own);
            }
        }
        if predicted.len() == unseen && unseen > 0 {
            let mean = predicted.iter().sum::<f64>() / (2 * predicted.len()) as f64;
            let candidate = Candidate {
                structure,
                predicted: mean,
            };
            tried.push((candidate, predicted));
        }
    }
    let best = tried
        .iter()
        .min_by(|a, b| a.0.predicted.total_cmp(&b.0.predicted))
        .ok_or_else(no_model)?;
    // Within the chance of the differences from band to band, with a misfit well below noise, or with an
    // error (root mean square) that is larger by less than a seventh: of a rig that does more than any
    // transfer function that much changes from motion to motion, and what a richer structure gains on
    // one it loses on another.
    const NOISE: f64 = 1.3;
    const ALIKE: f64 = 1.32;
    let as_good = |own: &(Candidate, Vec<f64>)| {
        let differences: Vec<f64> = own.1.iter().zip(&best.1).map(|(a, b)| a - b).collect();
        let (mean, deviation) = recordings::mean_and_deviation(&differences);
        mean <= deviation / (differences.len() as f64).sqrt()
            || own.0.predicted < NOISE
            || own.0.predicted < ALIKE * best.0.predicted
    };
    let simplest = tried.iter().find(|own| as_good(own)).unwrap_or(best);
    let structure = simplest.0.structure;
    let found = fitted.into_iter().flatten();
    Ok(Chosen {
        candidates: tried.iter().map(|own| own.0).collect(),
        structure,
        found: found
            .filter(|own| own.coefficients.structure == structure)
            .collect(),
    })
}

/// Standard errors of the coefficients in `s` by the mean square of the whitened errors.
fn standard_errors(found: &Fitted, mean_square: f64) -> Vec<f64> {
    let covariance: &DMatrix<f64> = &found.optimum.covariance;
    let excess = mean_square.sqrt();
    let structure = found.coefficients.structure;
    let scale = found.coefficients.scale;
    let order = structure.poles + usize::from(structure.integrates);
    let power = |i: usize| scale.powi(i as i32);
    let factors = (0..structure.poles)
        .map(|i| power(i + 1))
        .chain((0..=structure.zeros).map(|i| power(order - structure.zeros + i)))
        .chain([1.0 / scale]);
    factors
        .enumerate()
        .map(|(i, factor)| excess * factor * covariance[(i, i)].max(0.0).sqrt())
        .collect()
}

/// Stretches over which a valve-driven rig is simulated, s: it drifts off without its loop.
const STRETCH: f64 = 2.0;

/// The rest of a recording simulated from its command alone; of a valve-driven rig stretch by
/// stretch. Where the table stood, and what went on before a first sample, are no matter of the
/// model: its free motion is fitted.
fn played(
    model: &DelayedTransferFunction,
    recording: &Recording,
    input: Channel,
) -> Result<Rest, IdentificationError> {
    let period = recording.period();
    let measured = recording.samples(Channel::Displacement).to_vec();
    let bare = model.simulate(recording.samples(input), period)?;
    let length = match input {
        Channel::ValveCommand => (STRETCH / period) as usize,
        _ => bare.len(),
    };
    let poles = model.poles();
    let mut simulated = Vec::with_capacity(bare.len());
    let stretches = measured
        .chunks(length.max(1))
        .zip(bare.chunks(length.max(1)));
    for (measured, bare) in stretches {
        simulated.extend(with_free_motion(measured, bare, &poles, period)?);
    }
    Ok(Rest {
        recording: recording.name.clone(),
        start: recording.time_at(0),
        period,
        measured,
        simulated,
    })
}

/// `bare` with the offset and the free motion that bring it nearest to `measured`.
fn with_free_motion(
    measured: &[f64],
    bare: &[f64],
    poles: &[Complex<f64>],
    period: f64,
) -> Result<Vec<f64>, IdentificationError> {
    let count = bare.len();
    let time = |k: usize| k as f64 * period;
    let mut columns: Vec<Vec<f64>> = vec![vec![1.0; count]];
    for pole in poles.iter().filter(|pole| pole.im >= 0.0) {
        if pole.norm() * time(count) < 1e-3 {
            columns.push((0..count).map(|k| time(k) / time(count)).collect());
            continue;
        }
        let mode = |k: usize| (pole * time(k)).exp();
        columns.push((0..count).map(|k| mode(k).re).collect());
        if pole.im > 0.0 {
            columns.push((0..count).map(|k| mode(k).im).collect());
        }
    }
    let rows = DMatrix::from_fn(count, columns.len(), |i, j| columns[j][i]);
    let left = nalgebra::DVector::from_fn(count, |i, _| measured[i] - bare[i]);
    let square = rows.transpose() * &rows;
    let weights = square
        .svd(true, true)
        .solve(&(rows.transpose() * left), 1e-12)
        .map_err(|reason| IdentificationError::NotConverged {
            method: "the state at the first sample",
            reason: reason.into(),
        })?;
    let added = &rows * weights;
    Ok(bare.iter().zip(added.iter()).map(|(a, b)| a + b).collect())
}

/// What a reader should know of a result.
fn remarks(found: &OneInput, recordings: &[Recording]) -> Vec<String> {
    let mut all = Vec::new();
    all.extend(found.explained.sentence());
    if all.is_empty() && found.check.max(found.mean_square) > CLEAR {
        all.push(format!(
            "what the model leaves of the displacement is not noise alone (mean square {:.2} of it, {:.2} on \
             the part that was not fitted), though it is small",
            found.mean_square, found.check
        ));
    }
    if let Some(error) = bias(found, recordings) {
        all.push(error);
    }
    if found.input == Channel::ValveCommand {
        let lacking = recordings
            .iter()
            .filter(|r| r.channel(Channel::Reference).is_none());
        for recording in lacking {
            all.push(format!(
                "{}: no `reference` is recorded; the command is used instead, so noise on the \
                 recorded command and feedback bias the result without notice",
                recording.name
            ));
        }
    }
    all.push(
        "command and displacement alone do not determine mass, force and specimen: for a shake \
         table also record acceleration and actuator_force"
            .into(),
    );
    all
}

/// Noise on a command that is its own instrument lowers the gain by its share of the command's power
/// (errors in variables): said where that is more than a standard error.
fn bias(found: &OneInput, recordings: &[Recording]) -> Option<String> {
    let without = recordings
        .iter()
        .filter(|r| found.input == Channel::Reference || r.channel(Channel::Reference).is_none());
    let share = without
        .filter_map(|r| bands(r, found.input).ok().zip(r.channel(found.input)))
        .map(|(bands, command)| {
            let noise = command_noise(&bands, command);
            let (mut power, mut lines) = (0.0, 0.0);
            for band in &bands.bands {
                let own = band.spectra[0].iter().map(|z| z.norm_sqr());
                power += own.sum::<f64>();
                lines += band.omega.len() as f64;
            }
            noise * lines / power.max(noise * lines)
        })
        .fold(0.0, f64::max);
    let first = found.structure.poles;
    let gain = found.standard_error[first..=first + found.structure.zeros]
        .iter()
        .zip(&found.model.numerator)
        .map(|(error, value)| error / value.abs())
        .fold(f64::INFINITY, f64::min);
    (share > gain).then(|| {
        format!(
            "noise of {:.2e} {} on the recorded command may lower the gain by {:.2} %, more than its \
             standard error ({:.2} %): {}",
            found.noise[0],
            found.input.unit(),
            100.0 * share,
            100.0 * gain,
            if found.input == Channel::Reference {
                "record the command from the computer, not from a voltmeter"
            } else {
                "also record the `reference`"
            }
        )
    })
}
