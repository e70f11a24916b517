//! Whether noise on the recorded command biased a result.
//!
//! A predictor that is driven by the recorded command takes its noise for voltage that acted, and
//! finds too small a gain (errors in variables): by the noise's share of what is new in the command
//! at a sample. What is new is what the past of all channels leaves of it; noise is what their
//! present and the reference leave besides, for a command that a computer makes is a function of
//! those.
//!
//! Where the reference was recorded it is an instrument, too: what it explains of command,
//! displacement and force is free of that noise ([`crate::closed_loop::bands`]), and the actuator's
//! equation `F = G1 u + G2 dx/dt` between these parts must hold with the coefficients found.

use nalgebra::{Complex, DMatrix, DVector};

use super::identified::RigIdentification;
use super::parameters::{Physical, PhysicalValues};
use crate::closed_loop::bands::{Band, Bands};
use recordings::{Channel, Recording};
use sysid::least_squares::reduce;

/// Frequencies between which the equation is looked at, Hz: above the drift, where force and
/// velocity exceed their noise.
const BAND: (f64, f64) = (0.3, 20.0);
/// Standard deviations of the statistic beyond which a difference is none of chance.
const CLEAR: f64 = 5.0;

/// The actuator's coefficients with the reference as instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentTest {
    /// By how much the squared whitened errors of the actuator's equation fall with coefficients
    /// of the instrument's own.
    pub statistic: f64,
    /// What noise and the errors claimed make of that.
    pub expected: f64,
    /// Coefficients that move independently.
    pub freedom: usize,
    /// The coefficient of G1 that would move most, and by how much of itself.
    pub moved: (&'static str, f64),
}

impl InstrumentTest {
    /// Whether the result is biased beyond chance and the errors claimed.
    pub fn is_bias(&self) -> bool {
        self.statistic > self.expected + CLEAR * (2.0 * self.freedom as f64).sqrt()
    }

    /// What a reader should know, where there is a bias.
    pub fn warning(&self) -> Option<String> {
        self.is_bias().then(|| {
            format!(
                "the part of the recordings that the reference explains gives different \
                 coefficients of the actuator (chi-square {:.0}, expected {:.0}; {} by {:.1} %). \
                 This result is biased by more than its standard errors, probably by noise on the \
                 recorded command",
                self.statistic,
                self.expected,
                self.moved.0,
                100.0 * self.moved.1,
            )
        })
    }
}

/// Noise on the recorded command and what it does to the gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandNoise {
    /// One standard deviation, V.
    pub deviation: f64,
    /// By which share the gain from command to force comes out too small at most: that of a fit to
    /// what is new alone. A predictor that sees further back loses less (between a half and a tenth
    /// of it on the identified rig).
    pub attenuation: f64,
    /// Relative standard error of that gain.
    pub claimed: f64,
}

impl CommandNoise {
    /// Whether the bias is more than the standard error.
    pub fn is_bias(&self) -> bool {
        const LESS: f64 = 3.0;
        self.attenuation > LESS * self.claimed
    }

    /// What a reader should know, where there is a bias.
    pub fn warning(&self) -> Option<String> {
        self.is_bias().then(|| {
            format!(
                "noise on the recorded command ({:.1e} V, which neither the other channels nor the \
                 reference explain) makes the gain from command to force up to {:.1} % too small, \
                 with a standard error of {:.2} %. Record the command from the computer, or also \
                 record the reference",
                self.deviation,
                100.0 * self.attenuation,
                100.0 * self.claimed
            )
        })
    }
}

/// Estimates the noise on the commands of `recordings`, of which `found` was identified; the
/// recording that suffers most.
pub fn command_noise(found: &RigIdentification, recordings: &[Recording]) -> Option<CommandNoise> {
    let claimed = found.standard_error[Physical::B1] / found.physical[Physical::B1].abs();
    let all = recordings.iter().filter_map(noise_and_news);
    let worst = all.max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)))?;
    found.identifiable.then(|| CommandNoise {
        deviation: worst.0.sqrt(),
        attenuation: worst.0 / worst.1,
        claimed,
    })
}

/// Variances (V²) of what past, present and reference leave of the command, and of what the past
/// alone leaves.
fn noise_and_news(recording: &Recording) -> Option<(f64, f64)> {
    // Enough for a law of some states, and to extrapolate a reference that was not recorded.
    const LAGS: usize = 6;
    let command = recording.channel(Channel::ValveCommand)?;
    let outputs: Vec<&[f64]> = Channel::OUTPUTS
        .into_iter()
        .filter_map(|channel| recording.channel(channel))
        .collect();
    let reference = recording.channel(Channel::Reference);
    let past = 1 + LAGS * (1 + outputs.len());
    let present = outputs.len() + if reference.is_some() { LAGS } else { 0 };
    let count = command.len().checked_sub(LAGS)?;
    if count < 20 * (past + present) {
        return None;
    }
    let reduced = reduce(count, past + present, 1, |k, row| {
        let k = k + LAGS;
        let mut values = Vec::with_capacity(row.len());
        values.push(1.0);
        values.extend((1..=LAGS).map(|back| command[k - back]));
        for output in &outputs {
            values.extend((1..=LAGS).map(|back| output[k - back]));
        }
        values.extend(outputs.iter().map(|output| output[k]));
        if let Some(reference) = reference {
            values.extend((0..LAGS).map(|back| reference[k - back]));
        }
        values.push(command[k]);
        row.copy_from_slice(&values);
    });
    let of = |columns: usize| reduced.left(columns) / count as f64;
    let (noise, news) = (of(past + present), of(past));
    (news > 0.0).then_some((noise, news))
}

/// What speaks for a bias by noise on the recorded command, if anything.
pub fn bias(found: &RigIdentification, recordings: &[Recording]) -> Option<String> {
    let noise = command_noise(found, recordings).and_then(|own| own.warning());
    noise.or_else(|| instrument_test(found, recordings)?.warning())
}

/// The coefficients that the test may move: those of the actuator but its slow pole and zero.
const MOVED: [Physical; 8] = [
    Physical::A2,
    Physical::A1,
    Physical::B2,
    Physical::B1,
    Physical::E2,
    Physical::E1,
    Physical::E0,
    Physical::CommandDelay,
];

/// Tests `found` against what the reference shows in `recordings`; none without a recorded
/// reference, or where it stirs too little (Hausman 1978, for the two estimates of one rig).
pub fn instrument_test(
    found: &RigIdentification,
    recordings: &[Recording],
) -> Option<InstrumentTest> {
    if !found.identifiable {
        return None;
    }
    let is_moved = |name: &Physical| found.standard_error[*name] > 0.0;
    let moved: Vec<Physical> = MOVED.into_iter().filter(is_moved).collect();
    let count = moved.len();
    let mut information = DMatrix::<f64>::zeros(count, count);
    let mut gradient = DVector::<f64>::zeros(count);
    let mut any = false;
    for recording in recordings {
        let channels = [
            Channel::ValveCommand,
            Channel::Displacement,
            Channel::ActuatorForce,
        ]
        .map(|channel| recording.channel(channel));
        let (Some(reference), [Some(u), Some(x), Some(f)]) =
            (recording.channel(Channel::Reference), channels)
        else {
            continue;
        };
        let period = recording.period();
        let band = (BAND.0, BAND.1.min(0.35 / period));
        let Ok(bands) = Bands::new(&recording.name, &[reference], &[u, x, f], period, band) else {
            continue;
        };
        any = true;
        for band in &bands.bands {
            let (error, variance) = equation(&found.physical, &bands, band);
            // In units of the standard errors that are claimed.
            let slopes: Vec<Complex<f64>> = moved
                .iter()
                .map(|name| {
                    let step = 0.1 * found.standard_error[*name];
                    let mut other = found.physical;
                    other[*name] += step;
                    (equation(&other, &bands, band).0 - error) * 10.0
                })
                .collect();
            for i in 0..count {
                gradient[i] += 2.0 * (slopes[i].conj() * error).re / variance;
                for j in 0..count {
                    information[(i, j)] += 2.0 * (slopes[i].conj() * slopes[j]).re / variance;
                }
            }
        }
    }
    if !any {
        return None;
    }
    let claimed = DMatrix::from_fn(count, count, |i, j| {
        let (a, b) = (moved[i], moved[j]);
        found.covariance[(a.place(), b.place())]
            / (found.standard_error[a] * found.standard_error[b])
    });
    let expected_shift = (&information * claimed).trace();
    let eigen = information.symmetric_eigen();
    let floor = 1e-9 * eigen.eigenvalues.max();
    let mut step = DVector::<f64>::zeros(count);
    let (mut statistic, mut freedom) = (0.0, 0);
    for (k, &value) in eigen.eigenvalues.iter().enumerate() {
        if value > floor {
            let vector = eigen.eigenvectors.column(k);
            let along = vector.dot(&gradient);
            statistic += along * along / value;
            step -= vector * (along / value);
            freedom += 1;
        }
    }
    let of_g1 = [Physical::B1, Physical::B2, Physical::A2, Physical::A1];
    let changes = moved.iter().zip(step.iter()).filter_map(|(name, step)| {
        let relative = step * found.standard_error[*name] / found.physical[*name];
        of_g1
            .contains(name)
            .then_some((name.name(), relative, step.abs()))
    });
    let (name, relative, _) = changes.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(InstrumentTest {
        statistic,
        expected: freedom as f64 + expected_shift,
        freedom,
        moved: (name, relative),
    })
}

/// `G1 u + G2 dx/dt - F` of a band, projected on the reference, and the variance that the noise gives
/// it.
fn equation(physical: &PhysicalValues, bands: &Bands, band: &Band) -> (Complex<f64>, f64) {
    let actuator = physical.rig(0.0, false).shake_table.actuator;
    let (g1, g2) = (actuator.g1(), actuator.g2());
    let delay = physical[Physical::CommandDelay];
    let row = |omega: f64| {
        let s = Complex::new(0.0, omega);
        let half = 0.5 * omega * bands.period;
        // The command is held over a sample.
        let hold = Complex::new(0.0, -half).exp() * (half.sin() / half);
        let late = (-s * delay).exp();
        [
            g1.evaluate(s) * hold * late * bands.scale[0],
            g2.evaluate(s) * s * bands.scale[1],
            Complex::new(-bands.scale[2], 0.0),
        ]
    };
    let mut sum = Complex::new(0.0, 0.0);
    for (line, (&omega, instrument)) in band.omega.iter().zip(&band.instruments[0]).enumerate() {
        for (channel, factor) in row(omega).into_iter().enumerate() {
            sum += instrument.conj() * factor * band.spectra[channel][line];
        }
    }
    let error = row(band.middle());
    let mut variance = Complex::new(0.0, 0.0);
    for (i, a) in error.iter().enumerate() {
        for (j, b) in error.iter().enumerate() {
            variance += a * band.noise[(i, j)] * b.conj();
        }
    }
    (sum, variance.re.max(f64::MIN_POSITIVE))
}
