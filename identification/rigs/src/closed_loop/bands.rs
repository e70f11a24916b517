//! Spectra in narrow bands, projected on the reference.
//!
//! The reference of a closed loop is independent of every noise in it. What is left of a channel
//! after the projection on the reference is therefore free of the noise of all channels, the
//! command's included, whatever the controller does. The projection is local: over a band of some
//! lines the leakage of the transients is a polynomial of the frequency, to which the instrument is
//! made orthogonal (the local polynomial method, Pintelon and Schoukens, System Identification: A
//! Frequency Domain Approach, 2nd ed., 2012, Chapter 7). What the reference does not explain gives
//! the covariance of the noise, stochastic distortions included.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use realfft::RealFftPlanner;

use recordings::IdentificationError;

/// Lines of a band.
const LINES: usize = 20;
/// Order of the polynomials of leakage and response over a band.
const ORDER: usize = 2;
/// Bands to either side whose noise is averaged.
const POOLED: usize = 2;

/// One band of an experiment.
#[derive(Debug, Clone)]
pub struct Band {
    /// Its lines among those of a record's spectrum.
    pub lines: std::ops::Range<usize>,
    /// Their angular frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Spectra, `[channel][line]`, each over its channel's scale.
    pub spectra: Vec<Vec<Complex<f64>>>,
    /// The instruments: what of each cause is neither a transient nor in the causes before, of
    /// unit length.
    pub instruments: Vec<Vec<Complex<f64>>>,
    /// Covariance of the channels' noise on a line, in units of their scales.
    pub noise: DMatrix<Complex<f64>>,
}

/// Bands of one experiment.
#[derive(Debug, Clone)]
pub struct Bands {
    /// The bands that the reference stirs.
    pub bands: Vec<Band>,
    /// Root mean square of each channel about its mean, the unit of its spectra.
    pub scale: Vec<f64>,
    /// Sampling period, s.
    pub period: f64,
}

/// Spectrum of a record about its mean, over the root of its samples.
pub(super) fn spectrum(values: &[f64]) -> Result<Vec<Complex<f64>>, IdentificationError> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let mut input: Vec<f64> = values.iter().map(|v| v - mean).collect();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(input.len());
    let mut output = transform.make_output_vec();
    transform
        .process(&mut input, &mut output)
        .map_err(|error| IdentificationError::NotConverged {
            method: "the Fourier transform",
            reason: error.to_string(),
        })?;
    let scale = 1.0 / (values.len().max(1) as f64).sqrt();
    Ok(output.into_iter().map(|v| v * scale).collect())
}

type Vector = Vec<Complex<f64>>;

fn inner(a: &[Complex<f64>], b: &[Complex<f64>]) -> Complex<f64> {
    a.iter().zip(b).map(|(a, b)| a.conj() * b).sum()
}

/// Adds what of `vector` is new to the orthonormal `basis`; says whether there was something.
fn extend(basis: &mut Vec<Vector>, mut vector: Vector) -> bool {
    let before = inner(&vector, &vector).re;
    remove(&mut vector, basis);
    remove(&mut vector, basis);
    let left = inner(&vector, &vector).re;
    if left.is_nan() || left <= 1e-12 * before || left <= 0.0 {
        return false;
    }
    let scale = 1.0 / left.sqrt();
    basis.push(vector.into_iter().map(|v| v * scale).collect());
    true
}

fn remove(vector: &mut [Complex<f64>], basis: &[Vector]) {
    for b in basis {
        let part = inner(b, vector);
        for (v, b) in vector.iter_mut().zip(b) {
            *v -= part * b;
        }
    }
}

impl Bands {
    /// Projects `channels` (equal length, sampled every `period` s) on `causes`, between two
    /// frequencies (Hz). The first cause is the reference, further ones are functions of it alone.
    /// The first channel is the command: bands in which the reference does not stir it are left
    /// out.
    ///
    /// # Errors
    /// Fewer lines than two bands need, or no band that the reference stirs.
    pub fn new(
        name: &str,
        causes: &[&[f64]],
        channels: &[&[f64]],
        period: f64,
        (low, high): (f64, f64),
    ) -> Result<Self, IdentificationError> {
        let count = causes.first().map_or(0, |cause| cause.len());
        let step = 1.0 / (count.max(1) as f64 * period);
        let (first, last) = lines_between(count, step, low, high);
        if last < first + 3 * LINES {
            let needed = (4 * LINES) as f64 / (high - low).max(f64::MIN_POSITIVE);
            return Err(IdentificationError::TooShort {
                recording: name.to_string(),
                samples: count,
                parameters: 4 * LINES,
                needed: (needed / period).ceil() as usize,
                seconds: needed,
            });
        }
        let scale: Vec<f64> = channels
            .iter()
            .map(|c| recordings::mean_and_deviation(c).1.max(f64::MIN_POSITIVE))
            .collect();
        let wanted: Vec<Vector> = causes
            .iter()
            .map(|c| spectrum(c))
            .collect::<Result<_, _>>()?;
        let mut all = Vec::new();
        for (channel, scale) in channels.iter().zip(&scale) {
            let own: Vector = spectrum(channel)?.into_iter().map(|v| v / *scale).collect();
            all.push(own);
        }
        let mut bands: Vec<Band> = (first..=last - LINES)
            .step_by(LINES)
            .filter_map(|from| band(&wanted, &all, from, step))
            .collect();
        pool_noise(&mut bands);
        bands.retain(is_stirred);
        if bands.len() < 4 {
            return Err(IdentificationError::NoExcitation {
                recording: name.to_string(),
                what: format!(
                    "the reference excites the command in {} bands of {:.2} Hz between {low:.2} \
                     and \
                     {high:.1} Hz",
                    bands.len(),
                    LINES as f64 * step
                ),
            });
        }
        Ok(Self {
            bands,
            scale,
            period,
        })
    }
}

/// Offset of a line from the middle of its band, in half widths.
fn offset(line: usize) -> f64 {
    (line as f64 - 0.5 * (LINES - 1) as f64) / (0.5 * LINES as f64)
}

/// First and last line between two frequencies.
fn lines_between(count: usize, step: f64, low: f64, high: f64) -> (usize, usize) {
    let first = ((low / step).ceil() as usize).max(2);
    (first, ((high / step) as usize).min(count / 2))
}

/// The leakage that transients may cause over a band, orthonormal.
fn transients() -> Vec<Vector> {
    let mut basis = Vec::new();
    for power in 0..=ORDER {
        let polynomial = (0..LINES)
            .map(|i| Complex::new(offset(i).powi(power as i32), 0.0))
            .collect();
        extend(&mut basis, polynomial);
    }
    basis
}

/// Adds what a response that varies over the band makes of `cause` besides a multiple of it.
fn respond(basis: &mut Vec<Vector>, cause: &[Complex<f64>]) {
    for power in 1..=ORDER {
        let response = cause
            .iter()
            .enumerate()
            .map(|(i, value)| value * offset(i).powi(power as i32))
            .collect();
        extend(basis, response);
    }
}

/// What `reference` explains of `signal` between two frequencies (Hz), as a time history.
///
/// # Errors
/// The transform refuses the record.
pub fn explained(
    reference: &[f64],
    signal: &[f64],
    period: f64,
    (low, high): (f64, f64),
) -> Result<Vec<f64>, IdentificationError> {
    let count = signal.len();
    let step = 1.0 / (count.max(1) as f64 * period);
    let (first, last) = lines_between(count, step, low, high);
    let (wanted, own) = (spectrum(reference)?, spectrum(signal)?);
    let mut kept = vec![Complex::new(0.0, 0.0); own.len()];
    let slow = first.min(own.len());
    kept[..slow].copy_from_slice(&own[..slow]);
    let mut from = first;
    while from + LINES <= last {
        let lines = from..from + LINES;
        let mut basis = transients();
        let transient = basis.len();
        extend(&mut basis, wanted[lines.clone()].to_vec());
        respond(&mut basis, &wanted[lines.clone()]);
        for b in &basis[transient..] {
            let part = inner(b, &own[lines.clone()]);
            for (slot, b) in kept[lines.clone()].iter_mut().zip(b) {
                *slot += part * b;
            }
        }
        from += LINES;
    }
    kept[0].im = 0.0;
    if count.is_multiple_of(2)
        && let Some(last) = kept.last_mut()
    {
        last.im = 0.0;
    }
    let inverse = RealFftPlanner::<f64>::new().plan_fft_inverse(count);
    let mut history = inverse.make_output_vec();
    inverse.process(&mut kept, &mut history).map_err(|error| {
        IdentificationError::NotConverged {
            method: "the Fourier transform",
            reason: error.to_string(),
        }
    })?;
    let scale = 1.0 / (count.max(1) as f64).sqrt();
    Ok(history.into_iter().map(|v| v * scale).collect())
}

/// A band of lines from `from`; `None` where the reference has nothing that is not smooth.
fn band(wanted: &[Vector], all: &[Vector], from: usize, step: f64) -> Option<Band> {
    let lines = from..from + LINES;
    let mut basis = transients();
    let transient = basis.len();
    let (reference, further) = wanted.split_first()?;
    if !extend(&mut basis, reference[lines.clone()].to_vec()) {
        return None;
    }
    for cause in further {
        extend(&mut basis, cause[lines.clone()].to_vec());
    }
    let instruments = basis[transient..].to_vec();
    respond(&mut basis, &reference[lines.clone()]);
    let freedom = (LINES - basis.len()) as f64;
    let spectra: Vec<Vector> = all.iter().map(|own| own[lines.clone()].to_vec()).collect();
    let rest: Vec<Vector> = spectra
        .iter()
        .map(|own| {
            let mut own = own.clone();
            remove(&mut own, &basis);
            own
        })
        .collect();
    let noise = DMatrix::from_fn(all.len(), all.len(), |i, j| {
        inner(&rest[j], &rest[i]) / freedom
    });
    Some(Band {
        lines: lines.clone(),
        omega: lines.map(|line| TAU * line as f64 * step).collect(),
        spectra,
        instruments,
        noise,
    })
}

fn pool_noise(bands: &mut [Band]) {
    let own: Vec<_> = bands.iter().map(|band| band.noise.clone()).collect();
    for (i, band) in bands.iter_mut().enumerate() {
        let near = i.saturating_sub(POOLED)..(i + POOLED + 1).min(own.len());
        let count = near.len() as f64;
        band.noise = own[near].iter().fold(
            DMatrix::zeros(band.noise.nrows(), band.noise.ncols()),
            |sum, n| sum + n,
        ) / Complex::new(count, 0.0);
    }
}

impl Band {
    /// A channel's projection on the reference, over its scale.
    pub fn projected(&self, channel: usize) -> Complex<f64> {
        inner(&self.instruments[0], &self.spectra[channel])
    }

    /// Angular frequency of the middle, rad/s.
    pub fn middle(&self) -> f64 {
        let count = self.omega.len().max(1) as f64;
        self.omega.iter().sum::<f64>() / count
    }
}

/// Whether the reference shows in the command, over its noise.
fn is_stirred(band: &Band) -> bool {
    const RATIO: f64 = 16.0;
    band.projected(0).norm_sqr() > RATIO * band.noise[(0, 0)].re
}

#[cfg(test)]
mod tests {
    use super::super::made::noise;
    use super::*;

    const PERIOD: f64 = 0.005;

    /// `y = 0.6 r[k] + 0.3 r[k - 1]`.
    fn answer(reference: &[f64]) -> Vec<f64> {
        let before = |k: usize| if k > 0 { reference[k - 1] } else { 0.0 };
        (0..reference.len())
            .map(|k| 0.6 * reference[k] + 0.3 * before(k))
            .collect()
    }

    /// A reference, what follows it, and that with noise.
    fn recorded() -> [Vec<f64>; 3] {
        let reference = noise(4000, 1);
        let clean = answer(&reference);
        let pairs = clean.iter().zip(noise(4000, 9));
        let measured = pairs.map(|(y, n)| y + 0.2 * n).collect();
        [reference, clean, measured]
    }

    fn square(values: &[f64]) -> f64 {
        values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64
    }

    #[test]
    fn projections_on_the_reference_have_the_response_and_the_rest_the_noise() {
        let [reference, _, measured] = recorded();
        let own = Bands::new(
            "a",
            &[&reference],
            &[&reference, &measured],
            PERIOD,
            (1.0, 80.0),
        )
        .unwrap();
        assert_eq!(own.period, PERIOD);
        // From 1 to 80 Hz there are lines every 0.05 Hz, twenty a band.
        assert_eq!(own.bands.len(), 79);
        let (mut off, mut noises) = (Vec::new(), Vec::new());
        for band in &own.bands {
            let scaled = band.projected(1) * own.scale[1] / (band.projected(0) * own.scale[0]);
            let expected = 0.6 + 0.3 * Complex::new(0.0, -band.middle() * PERIOD).exp();
            off.push((scaled - expected).norm());
            noises.push(band.noise[(1, 1)].re * own.scale[1] * own.scale[1]);
            assert!((band.omega[0] / (TAU * 0.05 * band.lines.start as f64) - 1.0).abs() < 1e-9);
        }
        // Noise on a line over the reference's on twenty of them.
        assert!(square(&off).sqrt() < 0.08, "{}", square(&off).sqrt());
        // A third is the variance from -1 to 1.
        let mean = noises.iter().sum::<f64>() / noises.len() as f64;
        assert!((mean / (0.04 / 3.0) - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn what_the_reference_explains_is_free_of_most_of_the_noise() {
        let [reference, clean, measured] = recorded();
        let band = (0.0, 100.0);
        let rest = |signal: &[f64]| {
            let found = explained(&reference, signal, PERIOD, band).unwrap();
            let mean = clean.iter().sum::<f64>() / 4000.0;
            let off = found.iter().zip(&clean).map(|(a, b)| a - (b - mean));
            square(&off.collect::<Vec<_>>())
        };
        // Without noise what is lost is as smooth over a band as transients are: three of twenty lines.
        let lost = rest(&clean) / square(&clean);
        assert!((lost - 0.15).abs() < 0.04, "{lost}");
        // Three instruments of twenty lines keep as much of the noise.
        let kept = (rest(&measured) - rest(&clean)) / (0.04 / 3.0);
        assert!((0.1..0.25).contains(&kept), "{kept}");
    }

    #[test]
    fn records_that_tell_nothing_are_refused() {
        let reference = noise(4000, 1);
        let told = |channel: &[f64], band| {
            let count = channel.len();
            let found = Bands::new("a", &[&reference[..count]], &[channel], PERIOD, band);
            found.unwrap_err().to_string()
        };
        let unrelated = noise(4000, 9);
        assert!(told(&unrelated, (1.0, 80.0)).contains("the reference excites the command in "));
        assert!(told(&reference[..100], (1.0, 10.0)).contains("a: "));
    }
}
