//! The noises that the records themselves show, from the spectra of the predictor's innovations.
//!
//! The innovations of a predictor with any stable gain are a known linear filter of the noises that act
//! on the rig. Their spectrum follows from the level and corner of each noise, and Whittle's likelihood
//! (Whittle, Ark. Mat. 2, 1953) of the innovations' periodogram is maximised over those, without another
//! walk through the records.

use nalgebra::{Complex, DMatrix, DVector};
use plant::identified::rig::IdentifiedRig;
use realfft::RealFftPlanner;

use super::linear::Linear;
use super::noise::{Disturbance, Noise};

/// Bands, evenly spaced on the logarithm from [`LOWEST`] to half the sampling rate.
const BANDS: usize = 64;
/// Hz; what is slower is the model's business (offsets, drift), not the noise's.
const LOWEST: f64 = 0.25;
/// Corners that are tried, Hz.
const CORNERS: (f64, f64) = (0.5, 150.0);
const ROUNDS: usize = 40;
/// A slow noise whose density at zero is less than this share of the white one's is none.
const SLOW_MATTERS: f64 = 0.1;

/// What is expected of a level and its spread, on the logarithm: the laboratory states the sensors'
/// noise, of the rest next to nothing is known.
const SPREAD_OF_WHITE: f64 = 0.5;
const SPREAD_OF_SLOW: f64 = 2.0;
const SPREAD_OF_UNSEEN: f64 = 1.5;
const SPREAD_OF_CORNER: f64 = 1.2;
const USUAL_CORNER: f64 = 15.0;
const USUAL_SLOW: f64 = 0.1;

type Complexes = DMatrix<Complex<f64>>;

/// Noises that fit the records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learned {
    /// Them.
    pub noise: Noise,
    /// By how much they lower twice the negative log likelihood.
    pub gain: f64,
}

/// A parameter on the logarithm.
#[derive(Clone, Copy)]
struct Parameter {
    /// Of which source: the unseen voltage, then each output's white noise, then each output's slow one.
    source: usize,
    is_corner: bool,
    expected: f64,
    spread: f64,
}

/// A band with what was observed and what a unit of each source's density gives.
struct Band {
    cycles: f64,
    count: f64,
    observed: Complexes,
    of_source: Vec<Complexes>,
}

/// Density of a coloured noise of unit variance at `cycles` per sample.
fn density(phi: f64, cycles: f64) -> f64 {
    let turn = Complex::from_polar(1.0, -std::f64::consts::TAU * cycles);
    (1.0 - phi * phi) / (Complex::from(1.0) - turn * phi).norm_sqr()
}

/// What the predictor of a rig made of a record.
pub struct Innovations<'a> {
    /// The rig, of which the predictor follows the linear part.
    pub rig: IdentifiedRig,
    /// Whitened innovations, four a sample.
    pub whitened: &'a [f64],
    /// Power that an unseen voltage leaves in them, over that on the linear part: less where the supply
    /// droops or friction holds the table.
    pub passed: f64,
}

/// The noises that fit the innovations of `records`, whose predictors were designed for `assumed`;
/// `stated` is what was known beforehand. None where a rig has no predictor, the rigs do not show the
/// same channels, or the records are too short.
pub fn learn(
    records: &[Innovations<'_>],
    period: f64,
    assumed: &Noise,
    stated: &Noise,
) -> Option<Learned> {
    let mut designed: Vec<(IdentifiedRig, Linear)> = Vec::new();
    let mut bands = Vec::new();
    for record in records {
        if !designed.iter().any(|(rig, _)| *rig == record.rig) {
            let linear = Linear::design(&record.rig, period, assumed).ok()?;
            designed.push((record.rig, linear));
        }
        let (_, linear) = designed.iter().find(|(rig, _)| *rig == record.rig)?;
        bands.extend(bands_of(linear, period, record)?);
    }
    let (_, linear) = designed.first()?;
    if designed
        .iter()
        .any(|(_, other)| other.measured != linear.measured)
    {
        return None;
    }
    let outputs = linear.measured.len();
    let white = |j: usize| assumed.white[linear.measured[j]];
    let mut parameters = Vec::new();
    let mut start = Vec::new();
    let mut add = |source, is_corner, expected: f64, spread, now: f64| {
        parameters.push(Parameter {
            source,
            is_corner,
            expected: expected.ln(),
            spread,
        });
        start.push(now.max(f64::MIN_POSITIVE).ln());
    };
    let unseen = assumed.unseen;
    add(
        0,
        false,
        stated.unseen.sigma,
        SPREAD_OF_UNSEEN,
        unseen.sigma,
    );
    let usual = stated.unseen.corner(period);
    add(0, true, usual, SPREAD_OF_CORNER, unseen.corner(period));
    for j in 0..outputs {
        let own = stated.white[linear.measured[j]] / white(j);
        add(1 + j, false, own, SPREAD_OF_WHITE, 1.0);
    }
    for j in 0..outputs {
        let own = stated.white[linear.measured[j]] / white(j);
        let slow = assumed.slow[linear.measured[j]];
        let size = slow.map_or(USUAL_SLOW * own, |slow| slow.sigma / white(j));
        let corner = slow.map_or(USUAL_CORNER, |slow| slow.corner(period));
        add(
            1 + outputs + j,
            false,
            USUAL_SLOW * own,
            SPREAD_OF_SLOW,
            size,
        );
        add(
            1 + outputs + j,
            true,
            USUAL_CORNER,
            SPREAD_OF_CORNER,
            corner,
        );
    }
    let problem = Problem {
        bands,
        parameters,
        outputs,
        period,
    };
    // What the assumed noise costs, without slow parts that it does not have.
    let mut at_rest = start.clone();
    for (value, parameter) in at_rest.iter_mut().zip(&problem.parameters) {
        let none = parameter.source > outputs
            && !parameter.is_corner
            && assumed.slow[linear.measured[parameter.source - 1 - outputs]].is_none();
        if none {
            *value = f64::NEG_INFINITY;
        }
    }
    let before = problem.misfit(&at_rest)?;
    let found = problem.solve(DVector::from_vec(start))?;
    let after = problem.misfit(found.as_slice())?;
    let value = |source: usize, is_corner: bool| {
        let mut pairs = problem.parameters.iter().zip(found.iter());
        let found = pairs.find(|(p, _)| p.source == source && p.is_corner == is_corner);
        found.map(|(_, value)| value.exp())
    };
    let mut noise = *stated;
    noise.unseen = Disturbance::below(value(0, false)?, value(0, true)?, period);
    for (j, &channel) in linear.measured.iter().enumerate() {
        noise.white[channel] = white(j) * value(1 + j, false)?;
        let sigma = white(j) * value(1 + outputs + j, false)?;
        let slow = Disturbance::below(sigma, value(1 + outputs + j, true)?, period);
        let at_zero = (slow.sigma / noise.white[channel]).powi(2) * density(slow.phi, 0.0);
        noise.slow[channel] = (at_zero > SLOW_MATTERS).then_some(slow);
    }
    Some(Learned {
        noise,
        gain: before - after,
    })
}

/// Averaged periodograms of a record's innovations, with the predictor's responses to every source.
fn bands_of(linear: &Linear, period: f64, record: &Innovations<'_>) -> Option<Vec<Band>> {
    let outputs = linear.measured.len();
    let highest: f64 = 0.5;
    let lowest = LOWEST * period;
    let ratio = (highest / lowest).ln() / BANDS as f64;
    let n = record.whitened.len() / 4;
    if n < 64 {
        return None;
    }
    let mut sums: Vec<(f64, f64, Complexes)> =
        vec![(0.0, 0.0, DMatrix::zeros(outputs, outputs)); BANDS];
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut spectra = Vec::new();
    for &channel in &linear.measured {
        let series = record.whitened.iter().skip(channel).step_by(4);
        let mut series: Vec<f64> = series.copied().collect();
        series.truncate(n);
        let mut spectrum = transform.make_output_vec();
        transform.process(&mut series, &mut spectrum).ok()?;
        spectra.push(spectrum);
    }
    for line in 1..n.div_ceil(2) {
        let cycles = line as f64 / n as f64;
        if cycles < lowest {
            continue;
        }
        let band = (((cycles / lowest).ln() / ratio) as usize).min(BANDS - 1);
        let (count, sum, observed) = &mut sums[band];
        *count += 1.0;
        *sum += cycles;
        for i in 0..outputs {
            for j in 0..outputs {
                let product = spectra[i][line] * spectra[j][line].conj();
                observed[(i, j)] += Complex::new(product.re, product.im) / n as f64;
            }
        }
    }
    let n = linear.a.nrows();
    let complex = |matrix: &DMatrix<f64>| matrix.map(Complex::from);
    let correction = &linear.gain * &linear.c;
    let kept = complex(&(&linear.a * (DMatrix::identity(n, n) - correction)));
    let from_noise = complex(&(&linear.a * &linear.gain));
    let mut from_unseen = linear.a.column(linear.unseen()).into_owned();
    from_unseen[linear.unseen()] = 0.0;
    // The balanced state counts the voltage in units of its scale.
    let share = record.passed.sqrt() / linear.scale[linear.unseen()];
    let from_unseen = from_unseen.map(|value| Complex::from(share * value));
    let whiten = complex(&linear.whiten);
    let seen = &whiten * complex(&linear.c);
    let mut found = Vec::new();
    for (count, sum, observed) in sums {
        if count == 0.0 {
            continue;
        }
        let cycles = sum / count;
        let turn = Complex::from_polar(1.0, std::f64::consts::TAU * cycles);
        let resolvent = (DMatrix::identity(n, n) * turn - &kept).lu();
        let unseen = &seen * resolvent.solve(&from_unseen)?;
        let noises = &whiten - &seen * resolvent.solve(&from_noise)?;
        let mut of_source = vec![&unseen * unseen.adjoint()];
        for _ in 0..2 {
            for j in 0..outputs {
                let column = noises.column(j);
                of_source.push(column * column.adjoint());
            }
        }
        found.push(Band {
            cycles,
            count,
            observed: observed / Complex::from(count),
            of_source,
        });
    }
    (found.len() > 8).then_some(found)
}

struct Problem {
    bands: Vec<Band>,
    parameters: Vec<Parameter>,
    outputs: usize,
    period: f64,
}

impl Problem {
    /// Density of every source at `cycles`: the voltage's in V², the sensors' in their white noise's.
    fn densities(&self, at: &[f64], cycles: f64) -> Vec<f64> {
        let mut sizes = vec![(0.0, None); 1 + 2 * self.outputs];
        for (parameter, &value) in self.parameters.iter().zip(at) {
            let (size, corner) = &mut sizes[parameter.source];
            if parameter.is_corner {
                *corner = Some(value.exp());
            } else {
                *size = (2.0 * value).exp();
            }
        }
        let one = |(size, corner): &(f64, Option<f64>)| {
            let shape = corner.map_or(1.0, |corner| {
                let phi = Disturbance::below(1.0, corner, self.period).phi;
                density(phi, cycles)
            });
            size * shape
        };
        sizes.iter().map(one).collect()
    }

    fn spectrum(&self, band: &Band, densities: &[f64]) -> Complexes {
        let mut sum: Complexes = DMatrix::zeros(self.outputs, self.outputs);
        for (of_source, density) in band.of_source.iter().zip(densities) {
            sum += of_source * Complex::from(*density);
        }
        sum
    }

    /// Twice the negative log likelihood, without priors.
    fn misfit(&self, at: &[f64]) -> Option<f64> {
        let mut cost = 0.0;
        for band in &self.bands {
            let spectrum = self.spectrum(band, &self.densities(at, band.cycles));
            let factor = spectrum.cholesky()?;
            let diagonal = factor.l_dirty().diagonal();
            let determinant: f64 = diagonal.iter().map(|d| 2.0 * d.re.ln()).sum();
            let trace = factor.solve(&band.observed).trace().re;
            cost += 2.0 * band.count * (determinant + trace);
        }
        cost.is_finite().then_some(cost)
    }

    fn priors(&self, at: &[f64]) -> f64 {
        let pairs = self.parameters.iter().zip(at);
        pairs
            .map(|(p, value)| ((value - p.expected) / p.spread).powi(2))
            .sum()
    }

    /// Scoring with Fisher's information, damped.
    fn solve(&self, mut at: DVector<f64>) -> Option<DVector<f64>> {
        let count = self.parameters.len();
        let cost_at = |at: &DVector<f64>| {
            let misfit = self.misfit(at.as_slice())?;
            Some(misfit + self.priors(at.as_slice()))
        };
        let mut cost = cost_at(&at)?;
        let mut damping = 1e-3;
        for _ in 0..ROUNDS {
            let mut information = DMatrix::zeros(count, count);
            let mut gradient = DVector::zeros(count);
            for band in &self.bands {
                let densities = self.densities(at.as_slice(), band.cycles);
                let inverse = self.spectrum(band, &densities).try_inverse()?;
                let relative: Vec<Complexes> =
                    band.of_source.iter().map(|of| &inverse * of).collect();
                let excess = &inverse * &band.observed;
                let slopes: Vec<f64> = (0..count)
                    .map(|i| {
                        let mut moved = at.clone();
                        moved[i] += 1e-4;
                        let source = self.parameters[i].source;
                        let moved = self.densities(moved.as_slice(), band.cycles);
                        (moved[source] - densities[source]) / 1e-4
                    })
                    .collect();
                let sources = relative.len();
                let cross = DMatrix::from_fn(sources, sources, |i, j| {
                    (&relative[i] * &relative[j]).trace().re
                });
                for (i, p) in self.parameters.iter().enumerate() {
                    let own = &relative[p.source];
                    let pull = own.trace().re - (&excess * own).trace().re;
                    gradient[i] += 2.0 * band.count * pull * slopes[i];
                    for (j, other) in self.parameters.iter().enumerate() {
                        information[(i, j)] += 2.0
                            * band.count
                            * cross[(p.source, other.source)]
                            * slopes[i]
                            * slopes[j];
                    }
                }
            }
            for (i, p) in self.parameters.iter().enumerate() {
                information[(i, i)] += 2.0 / p.spread.powi(2);
                gradient[i] += 2.0 * (at[i] - p.expected) / p.spread.powi(2);
            }
            let mut gained = 0.0;
            for _ in 0..8 {
                let mut damped = information.clone();
                for i in 0..count {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let step = damped.cholesky()?.solve(&gradient);
                let mut next = &at - step.map(|s: f64| s.clamp(-1.0, 1.0));
                for (value, p) in next.iter_mut().zip(&self.parameters) {
                    if p.is_corner {
                        *value = value.clamp(CORNERS.0.ln(), CORNERS.1.ln());
                    }
                }
                if let Some(reached) = cost_at(&next).filter(|reached| *reached < cost) {
                    gained = cost - reached;
                    (at, cost) = (next, reached);
                    damping *= 0.1;
                    break;
                }
                damping *= 10.0;
            }
            if gained < 0.05 {
                break;
            }
        }
        Some(at)
    }
}
