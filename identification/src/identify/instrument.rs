//! Whether noise on the recorded command biased a result: the reference as instrument says so.
//!
//! A predictor that is driven by the recorded command takes its noise for voltage that acted, and
//! finds too small a gain (errors in variables). What the reference explains of command,
//! displacement and force is free of that noise ([`crate::closed_loop::bands`]): the actuator's
//! equation `F = G1 u + G2 dx/dt` between these parts must hold with the coefficients found.

use nalgebra::{Complex, DMatrix, DVector};

use super::identified::RigIdentification;
use super::parameters::{Physical, PhysicalValues};
use crate::closed_loop::bands::{Band, Bands};
use crate::data::{Channel, Recording};

/// Frequencies between which the equation is looked at, Hz: above what drift makes, where force and
/// velocity stand clear of their noise.
const BAND: (f64, f64) = (0.3, 20.0);
/// Standard deviations of the statistic beyond which a difference is none of chance.
const CLEAR: f64 = 5.0;

/// What the reference, as instrument, makes of the actuator's coefficients.
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
                "the part of the recordings that the reference explains asks for other coefficients of \
                 the actuator (chi-square {:.0}, expected {:.0}; {} by {:.1} %): noise on the recorded \
                 command biases this result by more than its standard errors; record the command as \
                 the computer holds it",
                self.statistic,
                self.expected,
                self.moved.0,
                100.0 * self.moved.1,
            )
        })
    }
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
