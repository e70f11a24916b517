//! Maximum likelihood for one structure, from linear regressions over a grid of delays.

use nalgebra::{Complex, DMatrix, DVector};

use super::Response;
use super::structure::{Coefficients, DelayedTransferFunction, Structure};
use crate::closed_loop::bands::{Band, Bands};
use sysid::nonlinear::{Coordinate, Optimum, Residuals, minimise};
use sysid::state_variable_filter::Between;

/// Delays from which the search starts, s.
const DELAYS: [f64; 5] = [0.0, 2e-3, 5e-3, 12e-3, 30e-3];
/// Longest delay, s.
const LONGEST: f64 = 0.2;
/// Starts that are refined, the best of them.
const STARTS: usize = 2;
/// A pole that a richer structure begins with, over the highest frequency.
const FAST: f64 = 3.0;
/// Fastest growth of a pole of a rig that is driven by a valve, 1/s.
const GROWTH: f64 = 5.0;
/// Regressions, each weighted with the denominator of the one before (Sanathanan and Koerner 1963).
const REGRESSIONS: usize = 8;

/// A band with the recording it comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Own<'a> {
    pub bands: &'a Bands,
    pub band: &'a Band,
    /// Deviation of the error, the same for every band of a recording; the noise's own without it.
    pub even: Option<f64>,
}

/// `G U - Y` of a band on its instrument, and the deviation that the noise gives it.
fn error(model: &DelayedTransferFunction, own: Own) -> (Complex<f64>, f64) {
    let Own { bands, band, .. } = own;
    let [u, y] = [bands.scale[0], bands.scale[1]];
    let lines = band.omega.iter().zip(&band.instruments[0]).enumerate();
    let sum = lines
        .map(|(line, (&omega, instrument))| {
            let g = model.response(omega, bands.period);
            instrument.conj() * (g * band.spectra[0][line] * u - band.spectra[1][line] * y)
        })
        .sum();
    (
        sum,
        deviation(model.response(band.middle(), bands.period), own),
    )
}

/// Deviation of `g U - Y` by the noise of both, or the even one.
fn deviation(g: Complex<f64>, own: Own) -> f64 {
    own.even.unwrap_or_else(|| by_noise(g, own))
}

fn by_noise(g: Complex<f64>, Own { bands, band, .. }: Own) -> f64 {
    let [u, y] = [bands.scale[0], bands.scale[1]];
    let variance = g.norm_sqr() * band.noise[(0, 0)].re * u * u + band.noise[(1, 1)].re * y * y
        - 2.0 * (g * band.noise[(0, 1)]).re * u * y;
    // Rounding of what a noiseless channel leaves.
    let floor = 1e-8 * y * band.projected(1).norm();
    variance.max(0.0).sqrt().hypot(floor).max(f64::MIN_POSITIVE)
}

/// The response of a band as measured.
pub(super) fn measured(own: Own) -> Response {
    let Own { bands, band, .. } = own;
    let [u, y] = [bands.scale[0], bands.scale[1]];
    let input = band.projected(0) * u;
    let value = band.projected(1) * y / input;
    Response {
        omega: band.middle(),
        value,
        deviation: by_noise(value, own) / input.norm(),
    }
}

/// Squared whitened error of each band, of mean two for a model that is right.
pub(super) fn squares(model: &DelayedTransferFunction, bands: &[Own]) -> Vec<f64> {
    let of = |own: &Own| {
        let (sum, deviation) = error(model, *own);
        2.0 * sum.norm_sqr() / (deviation * deviation)
    };
    bands.iter().map(of).collect()
}

/// Power of what the model misses of a band, as far as the instrument explains it, m².
pub(super) fn missed(model: &DelayedTransferFunction, own: Own) -> f64 {
    error(model, own).0.norm_sqr()
}

/// What is left over what the output does, both as projected.
pub(super) fn relative_error(model: &DelayedTransferFunction, bands: &[Own]) -> f64 {
    let (mut left, mut size) = (0.0, 0.0);
    for own in bands {
        left += error(model, *own).0.norm_sqr();
        size += (own.band.projected(1) * own.bands.scale[1]).norm_sqr();
    }
    (left / size).sqrt()
}

struct Fit<'a> {
    bands: &'a [Own<'a>],
    coefficients: &'a Coefficients,
    /// Where the deviations are held; they go with the model otherwise.
    held: Option<Vec<f64>>,
}

impl Residuals for Fit<'_> {
    fn residuals(&self, values: &[f64]) -> Option<Vec<f64>> {
        let model = self.coefficients.model(values)?;
        let weigher = match &self.held {
            Some(held) => self.coefficients.model(held)?,
            None => model.clone(),
        };
        let mut all = Vec::with_capacity(2 * self.bands.len());
        for own in self.bands {
            let (sum, _) = error(&model, *own);
            let middle = weigher.response(own.band.middle(), own.bands.period);
            let whitened = sum * (std::f64::consts::SQRT_2 / deviation(middle, *own));
            all.extend([whitened.re, whitened.im]);
        }
        all.iter().all(|value| value.is_finite()).then_some(all)
    }

    fn ignores_bounds(&self) -> bool {
        true
    }
}

/// What a fit of one structure found.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub coefficients: Coefficients,
    pub optimum: Optimum,
    pub model: DelayedTransferFunction,
}

impl Fitted {
    /// Values of `richer` coefficients, with a pole, a zero, both or neither more, that make the same model but
    /// for a pole at `fast` rad/s; the delay makes up for its lag.
    fn grown(&self, richer: &Coefficients, fast: f64) -> Option<Vec<f64>> {
        let own = self.coefficients.structure;
        let poles = richer.structure.poles.checked_sub(own.poles)?;
        let zeros = richer.structure.zeros.checked_sub(own.zeros)?;
        if richer.structure.integrates != own.integrates || poles > 1 || zeros > 1 {
            return None;
        }
        // Time is counted otherwise there.
        let ratio = self.coefficients.scale / richer.scale;
        let order = own.poles + usize::from(own.integrates);
        let (denominator, rest) = self.optimum.values.split_at(own.poles);
        let (numerator, delay) = rest.split_at(own.zeros + 1);
        let power = |i: usize| ratio.powi(i as i32);
        let counted = denominator.iter().enumerate();
        let mut denominator: Vec<f64> = counted.map(|(i, c)| c * power(i + 1)).collect();
        let counted = numerator.iter().enumerate();
        let counted = counted.map(|(i, c)| c * power(order - own.zeros + i));
        let mut numerator: Vec<f64> = std::iter::repeat_n(0.0, zeros).chain(counted).collect();
        let mut delay = *delay.first()? / ratio;
        if poles == 1 {
            let fast = fast / richer.scale;
            let before = [&[1.0], denominator.as_slice()].concat();
            denominator.push(0.0);
            for (slot, lower) in denominator.iter_mut().zip(&before) {
                *slot += fast * lower;
            }
            numerator.iter_mut().for_each(|c| *c *= fast);
            delay = (delay - 1.0 / fast).max(0.0);
        }
        Some([denominator, numerator, vec![delay]].concat())
    }
}

/// The frequency (rad/s) below which a hundredth of the input's power lies: what is slower is not shown.
fn lowest(bands: &[Own]) -> f64 {
    let mut powers: Vec<(f64, f64)> = bands
        .iter()
        .map(
            |Own {
                 bands: all, band, ..
             }| {
                let power = (band.projected(0) * all.scale[0]).norm_sqr();
                (band.omega.first().copied().unwrap_or(0.0), power)
            },
        )
        .collect();
    powers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let enough = 0.01 * powers.iter().map(|own| own.1).sum::<f64>();
    let mut sum = 0.0;
    for (omega, power) in powers {
        sum += power;
        if sum >= enough {
            return omega;
        }
    }
    0.0
}

/// The best model of a structure; `None` where no start makes one. A richer structure begins from what
/// `simpler` ones found in the same bands as well, so that it is not worse than these there.
pub(super) fn fit(
    structure: Structure,
    between: Between,
    bands: &[Own],
    simpler: &[Fitted],
) -> Option<Fitted> {
    if 2 * bands.len() < 2 * structure.parameters() {
        return None;
    }
    let middles = bands.iter().map(|own| own.band.middle().ln());
    let coefficients = Coefficients {
        structure,
        scale: (middles.sum::<f64>() / bands.len() as f64).exp(),
        between,
        growth: match between {
            Between::Held => GROWTH,
            Between::Straight => 0.0,
        },
        slowest: lowest(bands),
    };
    let weigh = |start: Vec<f64>| {
        let model = coefficients.model(&start)?;
        let cost = squares(&model, bands).iter().sum::<f64>();
        cost.is_finite().then_some((cost, start))
    };
    let mut starts: Vec<(f64, Vec<f64>)> = DELAYS
        .iter()
        .filter_map(|delay| weigh(regress(&coefficients, bands, *delay)?))
        .collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.truncate(STARTS);
    let fastest = bands
        .iter()
        .map(|own| own.band.middle())
        .fold(0.0, f64::max);
    let grown = simpler
        .iter()
        .filter_map(|own| weigh(own.grown(&coefficients, FAST * fastest)?));
    starts.extend(grown.min_by(|a, b| a.0.total_cmp(&b.0)));
    let mut best: Option<Optimum> = None;
    for (_, start) in &starts {
        if let Some(found) = approach(&coefficients, bands, start)
            && best.as_ref().is_none_or(|own| found.cost < own.cost)
        {
            best = Some(found);
        }
    }
    let optimum = best?;
    let model = coefficients.model(&optimum.values)?;
    Some(Fitted {
        coefficients,
        optimum,
        model,
    })
}

/// Fits with the deviations held at the start, then going with the model.
fn approach(coefficients: &Coefficients, bands: &[Own], start: &[f64]) -> Option<Optimum> {
    let mut values = start.to_vec();
    let coordinates = |values: &[f64]| -> Vec<Coordinate> {
        let last = values.len() - 1;
        let own = values.iter().enumerate();
        own.map(|(i, &value)| Coordinate {
            start: value,
            scale: if i == last {
                0.01
            } else {
                0.01 + 0.1 * value.abs()
            },
            free: true,
            bounds: if i == last {
                (0.0, LONGEST * coefficients.scale)
            } else {
                (f64::NEG_INFINITY, f64::INFINITY)
            },
        })
        .collect()
    };
    let mut fit = Fit {
        bands,
        coefficients,
        held: None,
    };
    fit.held = Some(values.clone());
    values = minimise(&fit, &coordinates(&values))?.values;
    fit.held = None;
    minimise(&fit, &coordinates(&values))
}

/// Linear least squares of `D Y = N U exp(-s delay)` over the bands, reweighted.
fn regress(coefficients: &Coefficients, bands: &[Own], delay: f64) -> Option<Vec<f64>> {
    let Structure {
        poles,
        zeros,
        integrates,
    } = coefficients.structure;
    let columns = poles + zeros + 1;
    let mut denominator = vec![Complex::new(1.0, 0.0); bands.len()];
    let mut values = Vec::new();
    for round in 0..REGRESSIONS {
        let mut rows = DMatrix::zeros(2 * bands.len(), columns);
        let mut right = DVector::zeros(2 * bands.len());
        for (i, own) in bands.iter().enumerate() {
            let Own {
                bands: all, band, ..
            } = *own;
            let omega = band.middle();
            let p = Complex::new(0.0, omega / coefficients.scale);
            let shift = DelayedTransferFunction {
                numerator: vec![1.0],
                denominator: vec![1.0],
                delay,
                between: coefficients.between,
            }
            .response(omega, all.period);
            let u = band.projected(0) * all.scale[0] * shift;
            let mut y = band.projected(1) * all.scale[1];
            let deviation = deviation(y / u * shift, *own);
            if integrates {
                y *= p;
            }
            let power = |n: usize| p.powi(n as i32);
            let weight = 1.0 / (denominator[i].norm() * deviation);
            let mut put = |column: usize, value: Complex<f64>| {
                rows[(2 * i, column)] = value.re * weight;
                rows[(2 * i + 1, column)] = value.im * weight;
            };
            for column in 0..poles {
                put(column, -power(poles - 1 - column) * y);
            }
            for column in 0..=zeros {
                put(poles + column, power(zeros - column) * u);
            }
            let left = power(poles) * y * weight;
            (right[2 * i], right[2 * i + 1]) = (left.re, left.im);
        }
        let norms: Vec<f64> = rows.column_iter().map(|c| c.norm()).collect();
        for (mut column, norm) in rows.column_iter_mut().zip(&norms) {
            column /= norm.max(f64::MIN_POSITIVE);
        }
        let solution = rows.svd(true, true).solve(&right, 1e-12).ok()?;
        values = solution.iter().zip(&norms).map(|(v, n)| v / n).collect();
        values.push(delay * coefficients.scale);
        if !values.iter().all(|value: &f64| value.is_finite()) {
            return None;
        }
        if round + 1 < REGRESSIONS {
            for (slot, own) in denominator.iter_mut().zip(bands) {
                let p = Complex::new(0.0, own.band.middle() / coefficients.scale);
                let own = values[..poles].iter();
                *slot = own.fold(Complex::new(1.0, 0.0), |sum, c| sum * p + c);
                if integrates {
                    *slot *= p;
                }
            }
        }
    }
    // A start that may be refined as it stands is not moved.
    Some(match coefficients.model(&values) {
        Some(_) => values,
        None => coefficients.stable(&values),
    })
}
