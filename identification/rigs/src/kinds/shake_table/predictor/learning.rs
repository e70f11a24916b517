//! The noises that the records themselves show, from the spectra of the predictor's innovations.
//!
//! The innovations of a predictor with any stable gain are a known linear filter of the noises that act
//! on the rig. Their spectrum follows from the densities of those noises, and Whittle's likelihood
//! (Whittle, Ark. Mat. 2, 1953) of the innovations' periodograms is maximised over those, without another
//! walk through the records.
//!
//! No shape is assumed. Every source, the unseen voltage and each sensor, begins with a level and takes one
//! part after another, slow or resonant, wherever the spectra ask for it most, until no further part
//! pays. Corners reach down to the record's length, which makes 1/f, and dampings down to that of a line.

use nalgebra::{Complex, DMatrix, DVector, Matrix4, SMatrix, Vector4};
use plant::identified::rig::IdentifiedRig;
use realfft::RealFftPlanner;

use super::linear::Linear;
use super::noise::{Disturbance, Noise};

/// Lines of a periodogram are averaged over bands of this share of their frequency.
const BAND: f64 = 0.02;
/// Lines of the lowest frequencies that are left to offsets of the rig and its sensors.
const OFFSETS: usize = 1;
/// Fewest samples of a record from which noise is learned.
const LEAST_SAMPLES: usize = 64;
/// Rounds of a fit, and of one that only tells which part to add.
const ROUNDS: usize = 40;
const ROUNDS_OF_A_TRIAL: usize = 8;
/// Twice the log likelihood that one more round must gain.
const SETTLED: f64 = 0.05;
const SETTLED_OF_A_TRIAL: f64 = 1.0;
/// Twice the log likelihood that a further part must gain: it has up to three parameters.
const PRICE: f64 = 16.0;
/// Parts that are added at most, over all sources.
const MOST_PARTS: usize = 12;
/// Ratio of neighbouring frequencies at which a further part is tried.
const GRID: f64 = 1.08;
/// Damping ratios of the resonances that are tried, and those that a fit may reach.
const DAMPINGS: [f64; 3] = [0.02, 0.1, 0.4];
const DAMPING: (f64, f64) = (2e-3, 0.7);
/// A part of a sensor's noise in what is stated, at most. A slow voltage moves the table as a drift of its sensor
/// would seem to, and other channels hardly tell which it is.
const LOUDEST_PART: f64 = 10.0;

/// What is expected of a level and its spread, on the logarithm: the laboratory states the sensors'
/// noise, of the rest next to nothing is known.
const SPREAD_OF_WHITE: f64 = 0.5;
const SPREAD_OF_PART: f64 = 2.0;
const SPREAD_OF_UNSEEN: f64 = 1.5;
const SPREAD_OF_FREQUENCY: f64 = 1.5;
const SPREAD_OF_DAMPING: f64 = 1.5;
const USUAL_FREQUENCY: f64 = 15.0;
const USUAL_DAMPING: f64 = 0.1;
const USUAL_PART: f64 = 0.3;

/// Sources: the unseen voltage, then the four sensors.
const SOURCES: usize = 5;
type C = Complex<f64>;

/// Noises that fit the records.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned {
    /// Them.
    pub noise: Noise,
    /// By how much they lower twice the negative log likelihood.
    pub gain: f64,
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
        bands.extend(bands_of(linear, record)?);
    }
    let measured = &designed.first()?.1.measured;
    if designed
        .iter()
        .any(|(_, other)| other.measured != *measured)
    {
        return None;
    }
    let unit: [f64; SOURCES] = std::array::from_fn(|source| match source {
        0 => 1.0,
        _ => assumed.white[source - 1],
    });
    let spectra = Spectra {
        lowest: bands.iter().map(|b: &Band| b.cycles).fold(0.5, f64::min) / period,
        bands,
        period,
    };
    let sources = || std::iter::once(0).chain(measured.iter().map(|channel| channel + 1));
    let expected = |source: usize| match source {
        0 => super::noise::total(&stated.unseen),
        _ => stated.white[source - 1] / unit[source],
    };

    // What the assumed noise costs as it is.
    let mut was = Parts::default();
    for source in sources() {
        let parts = match source {
            0 => &assumed.unseen,
            _ => &assumed.coloured[source - 1],
        };
        if source > 0 {
            was.add(Part::white(source, expected(source)), &[0.0]);
        }
        for part in parts {
            let own = Disturbance {
                sigma: part.sigma / unit[source],
                ..*part
            };
            was.add_known(source, own);
        }
    }
    let before = spectra.misfit(&was.densities(&spectra))?;

    let usual = stated.unseen.first()?.corner(period);
    let mut parts = Parts::default();
    for source in sources().filter(|source| *source > 0) {
        parts.add(Part::white(source, expected(source)), &[0.0]);
    }
    // What was learned before is a start.
    let mut is_first = true;
    for source in sources() {
        let known = match source {
            0 => &assumed.unseen,
            _ => &assumed.coloured[source - 1],
        };
        for known in known {
            let size = (known.sigma / unit[source]).ln();
            let usual_size = USUAL_PART * expected(source);
            match known.resonance(period) {
                Some((frequency, damping)) => parts.add(
                    Part::resonance(source, usual_size),
                    &[size, frequency.ln(), damping.ln()],
                ),
                None => {
                    let part = if source == 0 && is_first {
                        Part::slow(0, expected(0), SPREAD_OF_UNSEEN, usual)
                    } else {
                        Part::slow(source, usual_size, SPREAD_OF_PART, USUAL_FREQUENCY)
                    };
                    is_first &= source != 0;
                    parts.add(part, &[size, known.corner(period).ln()]);
                }
            }
        }
    }
    let mut cost = spectra.solve(&mut parts, ROUNDS, SETTLED_OF_A_TRIAL)?;
    while let Some((fewer, reached)) = spectra.fewer(&parts, cost) {
        (parts, cost) = (fewer, reached);
    }
    while parts.coloured() < MOST_PARTS {
        let Some((further, reached)) = spectra.further(&parts, cost, sources(), &expected) else {
            break;
        };
        (parts, cost) = (further, reached);
    }
    spectra.solve(&mut parts, ROUNDS, SETTLED)?;
    let after = spectra.misfit(&parts.densities(&spectra))?;

    let mut noise = Noise {
        white: stated.white,
        coloured: Default::default(),
        unseen: Vec::new(),
    };
    for (part, at) in parts.iter() {
        let found = part.disturbance(at, period);
        let own = found.map(|own| Disturbance {
            sigma: own.sigma * unit[part.source],
            ..own
        });
        match (part.source, own) {
            (0, own) => noise.unseen.extend(own),
            (source, None) => noise.white[source - 1] = unit[source] * at[0].exp(),
            (source, own) => noise.coloured[source - 1].extend(own),
        }
    }
    Some(Learned {
        noise,
        gain: before - after,
    })
}

/// A band with what was observed and the responses of the whitened innovations to a unit of each source.
/// Channels that are missing have a unit of noise of their own.
struct Band {
    cycles: f64,
    back: C,
    count: f64,
    observed: Matrix4<C>,
    responses: SMatrix<C, 4, SOURCES>,
    missing: Matrix4<C>,
}

/// Averaged periodograms of a record's innovations, with the predictor's responses to every source.
fn bands_of(linear: &Linear, record: &Innovations<'_>) -> Option<Vec<Band>> {
    let n = record.whitened.len() / 4;
    if n < LEAST_SAMPLES {
        return None;
    }
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut spectra = Vec::new();
    for channel in 0..4 {
        let series = record.whitened.iter().skip(channel).step_by(4);
        let mut series: Vec<f64> = series.copied().collect();
        series.truncate(n);
        let mut spectrum = transform.make_output_vec();
        transform.process(&mut series, &mut spectrum).ok()?;
        spectra.push(spectrum);
    }
    let order = linear.a.nrows();
    let complex = |matrix: &DMatrix<f64>| matrix.map(Complex::from);
    let correction = &linear.gain * &linear.c;
    let kept = complex(&(&linear.a * (DMatrix::identity(order, order) - correction)));
    let from_voltage = &linear.from_voltage * record.passed.sqrt();
    let from_noise = complex(&(&linear.a * &linear.gain));
    let outputs = linear.measured.len();
    let inputs = DMatrix::from_fn(order, 1 + outputs, |i, j| match j {
        0 => Complex::from(from_voltage[i]),
        _ => from_noise[(i, j - 1)],
    });
    let whiten = complex(&linear.whiten);
    let seen = &whiten * complex(&linear.c);
    let missing = Matrix4::from_fn(|i, j| {
        let is_missing = i == j && !linear.measured.contains(&i);
        Complex::from(f64::from(u8::from(is_missing)))
    });

    let mut bands = Vec::new();
    let end = n.div_ceil(2);
    let mut line = 1 + OFFSETS;
    while line < end {
        let next = (line + 1)
            .max((line as f64 * (1.0 + BAND)) as usize)
            .min(end);
        let count = (next - line) as f64;
        let mut observed = missing;
        for at in line..next {
            for i in 0..4 {
                for j in 0..4 {
                    let product = spectra[i][at] * spectra[j][at].conj();
                    observed[(i, j)] += Complex::new(product.re, product.im) / (n as f64 * count);
                }
            }
        }
        let cycles = 0.5 * (line + next - 1) as f64 / n as f64;
        let turn = Complex::from_polar(1.0, std::f64::consts::TAU * cycles);
        let resolvent = (DMatrix::identity(order, order) * turn - &kept).lu();
        let through = &seen * resolvent.solve(&inputs)?;
        let mut responses = SMatrix::<C, 4, SOURCES>::zeros();
        for (i, &channel) in linear.measured.iter().enumerate() {
            responses[(channel, 0)] = through[(i, 0)];
            for (j, &source) in linear.measured.iter().enumerate() {
                responses[(channel, 1 + source)] = whiten[(i, j)] - through[(i, 1 + j)];
            }
        }
        bands.push(Band {
            cycles,
            back: turn.conj(),
            count,
            observed,
            responses,
            missing,
        });
        line = next;
    }
    (bands.len() > 8).then_some(bands)
}

/// How the density of a part depends on its coordinates: its size, and corner or frequency and damping, all
/// on the logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    White,
    Slow,
    Resonance,
    Known(Disturbance),
}

/// A part of a source with what is expected of its coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    source: usize,
    shape: Shape,
    /// Expected value and spread of every coordinate.
    priors: [(f64, f64); 3],
}

impl Part {
    fn white(source: usize, size: f64) -> Self {
        Self {
            source,
            shape: Shape::White,
            priors: [(size.ln(), SPREAD_OF_WHITE); 3],
        }
    }

    fn slow(source: usize, size: f64, spread: f64, corner: f64) -> Self {
        let at_corner = (corner.ln(), SPREAD_OF_FREQUENCY);
        Self {
            source,
            shape: Shape::Slow,
            priors: [(size.ln(), spread), at_corner, at_corner],
        }
    }

    fn resonance(source: usize, size: f64) -> Self {
        Self {
            source,
            shape: Shape::Resonance,
            priors: [
                (size.ln(), SPREAD_OF_PART),
                (USUAL_FREQUENCY.ln(), SPREAD_OF_FREQUENCY),
                (USUAL_DAMPING.ln(), SPREAD_OF_DAMPING),
            ],
        }
    }

    /// Its largest size: that of coloured noise of a sensor; its prior alone holds another one.
    fn largest(&self) -> f64 {
        if self.source == 0 || self.shape == Shape::White {
            return f64::INFINITY;
        }
        LOUDEST_PART / USUAL_PART * self.priors[0].0.exp()
    }

    fn coordinates(&self) -> usize {
        match self.shape {
            Shape::Known(_) => 0,
            Shape::White => 1,
            Shape::Slow => 2,
            Shape::Resonance => 3,
        }
    }

    /// The part at its coordinates; none for a white one.
    fn disturbance(&self, at: &[f64], period: f64) -> Option<Disturbance> {
        match (self.shape, at) {
            (Shape::Known(known), _) => Some(known),
            (Shape::Slow, [size, corner]) => {
                Some(Disturbance::below(size.exp(), corner.exp(), period))
            }
            (Shape::Resonance, [size, frequency, damping]) => Some(Disturbance::around(
                size.exp(),
                frequency.exp(),
                damping.exp(),
                period,
            )),
            _ => None,
        }
    }

    /// Its density, in units of its source's variance, at the frequencies of `spectra`.
    fn density(&self, at: &[f64], spectra: &Spectra) -> Vec<f64> {
        let bands = spectra.bands.iter();
        match self.disturbance(at, spectra.period) {
            Some(part) => bands.map(|band| part.density_at(band.back)).collect(),
            None => vec![at.first().map_or(0.0, |size| (2.0 * size).exp()); bands.len()],
        }
    }
}

/// The parts of all sources with their coordinates, one part after another.
#[derive(Debug, Clone, Default)]
struct Parts {
    parts: Vec<Part>,
    at: Vec<f64>,
}

impl Parts {
    fn add(&mut self, part: Part, at: &[f64]) {
        self.parts.push(part);
        self.at.extend_from_slice(at);
    }

    fn without(&self, place: usize) -> Self {
        let mut fewer = Self::default();
        let rest = self.iter().enumerate().filter(|(i, _)| *i != place);
        rest.for_each(|(_, (part, at))| fewer.add(*part, at));
        fewer
    }

    fn add_known(&mut self, source: usize, known: Disturbance) {
        let shape = Shape::Known(known);
        self.add(
            Part {
                shape,
                ..Part::white(source, 1.0)
            },
            &[],
        );
    }

    fn iter(&self) -> impl Iterator<Item = (&Part, &[f64])> {
        let mut rest = self.at.as_slice();
        self.parts.iter().map(move |part| {
            let (mine, others) = rest.split_at(part.coordinates());
            rest = others;
            (part, mine)
        })
    }

    fn coloured(&self) -> usize {
        let parts = self.parts.iter();
        parts.filter(|part| part.shape != Shape::White).count()
    }

    /// Density of every source in every band.
    fn densities(&self, spectra: &Spectra) -> Vec<[f64; SOURCES]> {
        let mut sums = vec![[0.0; SOURCES]; spectra.bands.len()];
        for (part, at) in self.iter() {
            for (sum, own) in sums.iter_mut().zip(part.density(at, spectra)) {
                sum[part.source] += own;
            }
        }
        sums
    }

    /// Expected value and spread of every coordinate.
    fn priors(&self) -> Vec<(f64, f64)> {
        let own = |part: &Part| part.priors.into_iter().take(part.coordinates());
        self.parts.iter().flat_map(own).collect()
    }

    fn prior_cost(&self) -> f64 {
        let pairs = self.priors().into_iter().zip(&self.at);
        pairs
            .map(|((expected, spread), value)| ((value - expected) / spread).powi(2))
            .sum()
    }

    /// Moves by `-step`, no coordinate by more than one, in the bounds of frequencies and dampings.
    fn moved(&self, step: &DVector<f64>, spectra: &Spectra) -> Self {
        let mut next = self.clone();
        let mut place = 0;
        for part in &self.parts {
            for coordinate in 0..part.coordinates() {
                let value = &mut next.at[place];
                *value -= step[place].clamp(-1.0, 1.0);
                let (low, high) = match coordinate {
                    0 => (0.0, part.largest()),
                    1 => (0.5 * spectra.lowest, 0.45 / spectra.period),
                    _ => DAMPING,
                };
                *value = value.clamp(low.ln(), high.ln());
                place += 1;
            }
        }
        next
    }
}

/// Observed spectra of all records.
struct Spectra {
    bands: Vec<Band>,
    period: f64,
    /// Lowest frequency, Hz.
    lowest: f64,
}

impl Band {
    /// The innovations' expected spectrum where the sources have `densities`.
    fn expected(&self, densities: &[f64; SOURCES]) -> Matrix4<C> {
        let mut sum = self.missing;
        for (source, density) in densities.iter().enumerate() {
            let response: Vector4<C> = self.responses.column(source).into_owned();
            sum += response * response.adjoint() * Complex::from(*density);
        }
        sum
    }
}

impl Spectra {
    /// Twice the negative log likelihood, without priors.
    fn misfit(&self, densities: &[[f64; SOURCES]]) -> Option<f64> {
        let mut cost = 0.0;
        for (band, densities) in self.bands.iter().zip(densities) {
            let factor = band.expected(densities).cholesky()?;
            let diagonal = factor.l_dirty().diagonal();
            let determinant: f64 = diagonal.iter().map(|d| 2.0 * d.re.ln()).sum();
            let trace = factor.solve(&band.observed).trace().re;
            cost += 2.0 * band.count * (determinant + trace);
        }
        cost.is_finite().then_some(cost)
    }

    fn cost(&self, parts: &Parts) -> Option<f64> {
        Some(self.misfit(&parts.densities(self))? + parts.prior_cost())
    }

    /// Of every band: the pull on each source's density and the information about each pair.
    fn slopes(&self, parts: &Parts) -> Option<Vec<Slope>> {
        let all = self.bands.iter().zip(parts.densities(self));
        all.map(|(band, densities)| {
            let factor = band.expected(&densities).cholesky()?;
            let solved = factor.solve(&band.responses);
            let products = band.responses.adjoint() * solved;
            let excess = solved.adjoint() * band.observed * solved;
            Some(Slope {
                pull: std::array::from_fn(|i| {
                    2.0 * band.count * (products[(i, i)].re - excess[(i, i)].re)
                }),
                information: SMatrix::from_fn(|i, j| {
                    2.0 * band.count * products[(i, j)].norm_sqr()
                }),
            })
        })
        .collect()
    }

    /// Scoring with Fisher's information, damped, as long as a round gains `enough`; the cost reached.
    fn solve(&self, parts: &mut Parts, rounds: usize, enough: f64) -> Option<f64> {
        let mut cost = self.cost(parts)?;
        let mut damping = 1e-3;
        for _ in 0..rounds {
            let slopes = self.slopes(parts)?;
            let columns = self.columns(parts);
            let count = columns.len();
            let mut information = DMatrix::zeros(count, count);
            let mut gradient = DVector::zeros(count);
            for (i, (source, column)) in columns.iter().enumerate() {
                let pairs = slopes.iter().zip(column);
                gradient[i] = pairs.map(|(slope, own)| slope.pull[*source] * own).sum();
                for (j, (other, against)) in columns.iter().enumerate().take(i + 1) {
                    let sum: f64 = slopes
                        .iter()
                        .zip(column)
                        .zip(against)
                        .map(|((slope, a), b)| slope.information[(*source, *other)] * a * b)
                        .sum();
                    information[(i, j)] = sum;
                    information[(j, i)] = sum;
                }
            }
            for (i, (expected, spread)) in parts.priors().into_iter().enumerate() {
                information[(i, i)] += 2.0 / (spread * spread);
                gradient[i] += 2.0 * (parts.at[i] - expected) / (spread * spread);
            }
            let mut gained = 0.0;
            for _ in 0..8 {
                let mut damped = information.clone();
                for i in 0..count {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let step = damped.cholesky()?.solve(&gradient);
                let next = parts.moved(&step, self);
                if let Some(reached) = self.cost(&next).filter(|reached| *reached < cost) {
                    gained = cost - reached;
                    *parts = next;
                    cost = reached;
                    damping *= 0.1;
                    break;
                }
                damping *= 10.0;
            }
            if gained < enough {
                break;
            }
        }
        Some(cost)
    }

    /// Derivative of its source's density by every coordinate, band by band.
    fn columns(&self, parts: &Parts) -> Vec<(usize, Vec<f64>)> {
        const MOVE: f64 = 1e-5;
        let mut columns = Vec::new();
        for (part, at) in parts.iter() {
            let density = part.density(at, self);
            for coordinate in 0..part.coordinates() {
                let column = if coordinate == 0 {
                    density.iter().map(|own| 2.0 * own).collect()
                } else {
                    let mut moved = at.to_vec();
                    moved[coordinate] += MOVE;
                    let moved = part.density(&moved, self);
                    let pairs = moved.iter().zip(&density);
                    pairs.map(|(a, b)| (a - b) / MOVE).collect()
                };
                columns.push((part.source, column));
            }
        }
        columns
    }

    /// `parts` without the coloured one that pays least, all fitted, and its cost, if that one does not pay.
    fn fewer(&self, parts: &Parts, cost: f64) -> Option<(Parts, f64)> {
        let is_coloured = |part: &Part| matches!(part.shape, Shape::Slow | Shape::Resonance);
        let places = (0..parts.parts.len()).filter(|place| is_coloured(&parts.parts[*place]));
        let without = places.filter_map(|place| {
            let fewer = parts.without(place);
            Some((self.cost(&fewer)?, fewer))
        });
        let (_, mut fewer) = without.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let reached = self.solve(&mut fewer, ROUNDS_OF_A_TRIAL, SETTLED_OF_A_TRIAL)?;
        (reached - cost < PRICE).then_some((fewer, reached))
    }

    /// `parts` with one more where it pays most, all fitted, and its cost.
    fn further(
        &self,
        parts: &Parts,
        cost: f64,
        sources: impl Iterator<Item = usize>,
        expected: &impl Fn(usize) -> f64,
    ) -> Option<(Parts, f64)> {
        let slopes = self.slopes(parts)?;
        let mut tried: Vec<(f64, Parts)> = Vec::new();
        for source in sources {
            let usual = USUAL_PART * expected(source);
            let slow = Part::slow(source, usual, SPREAD_OF_PART, USUAL_FREQUENCY);
            let resonance = Part::resonance(source, usual);
            let mut best: [Option<(f64, Parts)>; 2] = [None, None];
            let mut frequency = self.lowest;
            while frequency < 0.4 / self.period {
                let corner = (slow, vec![0.0, frequency.ln()]);
                let peaks = DAMPINGS
                    .map(|damping: f64| (resonance, vec![0.0, frequency.ln(), damping.ln()]));
                for (part, mut at) in std::iter::once(corner).chain(peaks) {
                    let density = part.density(&at, self);
                    let (mut pull, mut information) = (0.0, 0.0);
                    for (slope, own) in slopes.iter().zip(&density) {
                        pull -= slope.pull[source] * own;
                        information += slope.information[(source, source)] * own * own;
                    }
                    if pull <= 0.0 || information <= 0.0 {
                        continue;
                    }
                    // Twice the log likelihood that it gains to second order.
                    let score = 0.5 * pull * pull / information;
                    let best = &mut best[part.coordinates() - 2];
                    if score > best.as_ref().map_or(0.5 * PRICE, |(gain, _)| *gain) {
                        at[0] = (pull / information).sqrt().min(part.largest()).ln();
                        let mut next = parts.clone();
                        next.add(part, &at);
                        *best = Some((score, next));
                    }
                }
                frequency *= GRID;
            }
            tried.extend(best.into_iter().flatten());
        }
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Mostly the first pays as it promises.
        let mut fitted = tried.into_iter().take(3).filter_map(|(_, mut next)| {
            let reached = self.solve(&mut next, ROUNDS_OF_A_TRIAL, SETTLED_OF_A_TRIAL)?;
            Some((next, reached))
        });
        fitted.find(|(_, reached)| cost - reached > PRICE)
    }
}

/// Derivatives of twice the negative log likelihood by the sources' densities in a band.
struct Slope {
    pull: [f64; SOURCES],
    information: SMatrix<f64, SOURCES, SOURCES>,
}
