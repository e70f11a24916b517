//! Transfer functions with delay: how many poles and zeros, and the numbers in them.

use nalgebra::{Complex, DMatrix, DVector};
use plant::linear::{StateSpace, TransferFunction};

use recordings::IdentificationError;
use sysid::instrumental_variables::stabilised;
use sysid::state_variable_filter::Between;

/// A model's poles and zeros by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Structure {
    /// Poles beside the one at zero.
    pub poles: usize,
    /// Zeros, fewer than poles.
    pub zeros: usize,
    /// Whether there is a pole at zero: a valve that opens makes a speed.
    pub integrates: bool,
}

impl Structure {
    /// Coefficients and delay.
    pub fn parameters(self) -> usize {
        self.poles + self.zeros + 2
    }

    /// Those that are tried, the simplest first.
    pub fn candidates(may_integrate: bool) -> Vec<Self> {
        const ZEROS: usize = 2;
        let mut all = Vec::new();
        for integrates in [true, false] {
            if integrates && !may_integrate {
                continue;
            }
            // A pole at zero counts.
            let most = if may_integrate && !integrates { 5 } else { 4 };
            for poles in 1..=most {
                for zeros in 0..=ZEROS.min(poles - 1) {
                    all.push(Self {
                        poles,
                        zeros,
                        integrates,
                    });
                }
            }
        }
        all.sort_by_key(|own| own.parameters());
        all
    }
}

/// `y = G(s) exp(-delay s) u`.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayedTransferFunction {
    /// Descending powers; SI of the output over that of the input.
    pub numerator: Vec<f64>,
    /// Monic, descending powers.
    pub denominator: Vec<f64>,
    /// s.
    pub delay: f64,
    /// How the input runs between samples.
    pub between: Between,
}

impl DelayedTransferFunction {
    /// Its response at `omega` (rad/s) to an input sampled every `period` s.
    pub fn response(&self, omega: f64, period: f64) -> Complex<f64> {
        let s = Complex::new(0.0, omega);
        let value = |all: &[f64]| {
            all.iter()
                .fold(Complex::new(0.0, 0.0), |sum, c| sum * s + c)
        };
        let rational = value(&self.numerator) / value(&self.denominator);
        rational * (-s * self.delay).exp() * interpolation(omega, period, self.between)
    }

    /// Poles, 1/s.
    pub fn poles(&self) -> Vec<Complex<f64>> {
        self.rational().poles()
    }

    fn rational(&self) -> TransferFunction {
        TransferFunction {
            numerator: self.numerator.clone(),
            denominator: self.denominator.clone(),
        }
    }

    /// The same with time counted in the mean of its time constants, and their rate in 1/s: without
    /// it the powers of `s` would lose the matrix exponential its digits.
    fn in_own_time(&self) -> (TransferFunction, f64) {
        let order = self.denominator.len() - 1;
        let last = self.denominator.iter().rposition(|c| *c != 0.0);
        let rate = match last {
            Some(place @ 1..) => self.denominator[place].abs().powf(1.0 / place as f64),
            _ => 1.0,
        };
        let power = |i: usize| rate.powi(i as i32);
        let numerator = self.numerator.iter().rev().enumerate();
        let mut numerator: Vec<f64> = numerator.map(|(own, c)| c / power(order - own)).collect();
        numerator.reverse();
        let denominator = self.denominator.iter().enumerate();
        let denominator = denominator.map(|(i, c)| c / power(i)).collect();
        let rational = TransferFunction {
            numerator,
            denominator,
        };
        (rational, rate)
    }

    /// The output from rest for an input sampled every `period` s.
    ///
    /// # Errors
    /// Coefficients that make no state space.
    pub fn simulate(&self, input: &[f64], period: f64) -> Result<Vec<f64>, IdentificationError> {
        let (rational, rate) = self.in_own_time();
        let system = rational
            .to_state_space()
            .map_err(|error| IdentificationError::Unstable {
                what: error.to_string(),
                remedy: "record more periods of the slowest motion".into(),
            })?;
        let sampled = WithSlope::new(&system, period * rate);
        let first = input.first().copied().unwrap_or(0.0);
        let samples = self.delay / period;
        let at = |k: usize| {
            let place = k as f64 - samples;
            let before = place.floor();
            let value = |index: f64| {
                if index < 0.0 {
                    first
                } else {
                    input[(index as usize).min(input.len() - 1)]
                }
            };
            let share = place - before;
            // The mean over a sample of what is held, or the line itself.
            (1.0 - share) * value(before) + share * value(before + 1.0)
        };
        let held = self.between == Between::Held;
        let mut state = DVector::zeros(system.order());
        let mut output = Vec::with_capacity(input.len());
        let mut now = at(0) - first;
        for k in 0..input.len() {
            output.push((&system.c * &state)[(0, 0)]);
            // A held command that arrives within a sample: its mean over that sample.
            let next = at(k + 1) - first;
            let (begin, end) = if held { (now, now) } else { (now, next) };
            state = sampled.advance(&state, begin, end);
            now = next;
        }
        Ok(output)
    }
}

/// What sampling makes of a continuous signal at `omega`: the hold, or a straight line.
fn interpolation(omega: f64, period: f64, between: Between) -> Complex<f64> {
    let half = 0.5 * omega * period;
    let sinc = if half == 0.0 { 1.0 } else { half.sin() / half };
    match between {
        Between::Held => Complex::new(0.0, -half).exp() * sinc,
        Between::Straight => Complex::new(sinc * sinc, 0.0),
    }
}

/// A sampled system whose input runs straight from begin to end of a sample.
struct WithSlope {
    a: DMatrix<f64>,
    b: DVector<f64>,
    slope: DVector<f64>,
}

impl WithSlope {
    fn new(system: &StateSpace, period: f64) -> Self {
        let n = system.order();
        // x' = A x + B (u + t r): input and its slope as states.
        let mut a = DMatrix::zeros(n + 1, n + 1);
        a.view_mut((0, 0), (n, n)).copy_from(&system.a);
        a.view_mut((0, n), (n, 1)).copy_from(&system.b.column(0));
        let mut b = DMatrix::zeros(n + 1, 1);
        b[(n, 0)] = 1.0 / period;
        let whole = StateSpace {
            a,
            b,
            c: DMatrix::zeros(1, n + 1),
            d: DMatrix::zeros(1, 1),
        }
        .sample(period);
        Self {
            a: whole.a.view((0, 0), (n, n)).into_owned(),
            b: whole.a.view((0, n), (n, 1)).column(0).into_owned(),
            slope: whole.b.view((0, 0), (n, 1)).column(0).into_owned(),
        }
    }

    fn advance(&self, state: &DVector<f64>, begin: f64, end: f64) -> DVector<f64> {
        &self.a * state + &self.b * begin + &self.slope * (end - begin)
    }
}

/// Coefficients of a [`Structure`] in powers of `s/scale`, then the delay over `1/scale`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Coefficients {
    pub structure: Structure,
    /// rad/s.
    pub scale: f64,
    pub between: Between,
    /// The fastest growth of a pole, 1/s: a valve-driven rig may drift off without its loop.
    pub growth: f64,
    /// The frequency below which the data hold next to nothing, rad/s. A slower zero goes with a slower
    /// pole: the two take up some misfit at the low end and make a drift below it.
    pub slowest: f64,
}

impl Coefficients {
    /// Whether the poles of a monic polynomial grow slowly enough.
    fn is_held(&self, denominator: &[f64]) -> bool {
        denominator.iter().all(|c| c.is_finite())
            && poles(denominator).iter().all(|pole| pole.re < self.growth)
    }

    /// Whether no zero is slower than the data show.
    fn is_shown(&self, numerator: &[f64]) -> bool {
        let Some((constant, others)) = numerator.split_last() else {
            return true;
        };
        // Roots of the reversed polynomial are one over the zeros; one at infinity is none.
        let mut reversed = vec![1.0];
        reversed.extend(others.iter().rev().map(|c| c / constant));
        // What lies on the limit is within it.
        let most = (1.0 + 1e-9) / self.slowest.max(f64::MIN_POSITIVE);
        reversed.iter().all(|c| c.is_finite())
            && poles(&reversed)
                .iter()
                .all(|inverse| inverse.norm() <= most)
    }

    /// The model of these values: denominator without its 1, numerator, delay; `None` where a pole
    /// grows faster than [`Self::growth`] or a zero is slower than [`Self::slowest`].
    pub fn model(&self, values: &[f64]) -> Option<DelayedTransferFunction> {
        let Structure {
            poles,
            zeros,
            integrates,
        } = self.structure;
        let (own, rest) = values.split_at(poles);
        let (numerator, delay) = rest.split_at(zeros + 1);
        let power = |i: usize| self.scale.powi(i as i32);
        let mut denominator = vec![1.0];
        denominator.extend(own.iter().enumerate().map(|(i, c)| c * power(i + 1)));
        if !self.is_held(&denominator) {
            return None;
        }
        let order = poles + usize::from(integrates);
        if integrates {
            denominator.push(0.0);
        }
        let numerator = numerator.iter().enumerate();
        let numerator: Vec<f64> = numerator
            .map(|(i, c)| c * power(order - zeros + i))
            .collect();
        if !self.is_shown(&numerator) {
            return None;
        }
        Some(DelayedTransferFunction {
            numerator,
            denominator,
            delay: delay.first()? / self.scale,
            between: self.between,
        })
    }

    /// Values whose poles are mirrored into the left half plane and whose zeros are hastened to the lowest
    /// frequency of the data where they are slower.
    pub fn stable(&self, values: &[f64]) -> Vec<f64> {
        let Structure { poles, zeros, .. } = self.structure;
        let mut denominator = vec![1.0];
        denominator.extend(&values[..poles]);
        let mut all = stabilised(&denominator)[1..].to_vec();
        let (numerator, rest) = values[poles..].split_at(zeros + 1);
        all.extend(hastened(numerator, self.slowest / self.scale));
        all.extend(rest);
        all
    }
}

/// A polynomial whose roots are of `limit` at least.
fn hastened(numerator: &[f64], limit: f64) -> Vec<f64> {
    let lead = numerator[0];
    let monic: Vec<f64> = numerator.iter().map(|c| c / lead).collect();
    if !monic.iter().all(|c| c.is_finite()) {
        return numerator.to_vec();
    }
    let mut polynomial = vec![Complex::new(lead, 0.0)];
    for root in poles(&monic) {
        let size = root.norm().max(f64::MIN_POSITIVE);
        let root = root * (limit / size).max(1.0);
        polynomial.push(Complex::new(0.0, 0.0));
        for i in (1..polynomial.len()).rev() {
            let before = polynomial[i - 1];
            polynomial[i] -= root * before;
        }
    }
    polynomial.iter().map(|c| c.re).collect()
}

/// Roots of a monic polynomial, highest power first.
fn poles(denominator: &[f64]) -> Vec<Complex<f64>> {
    TransferFunction {
        numerator: vec![1.0],
        denominator: denominator.to_vec(),
    }
    .poles()
}
