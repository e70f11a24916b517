//! From a record of acceleration to a motion that a table can play.
//!
//! 1. The mean and the linear trend of the acceleration are removed (least squares).
//! 2. The spectrum of the samples is evaluated at the harmonics k/T of a long period. This period T
//!    is a whole number of table samples, and longer than the record by several periods of the
//!    lower corner on either side. This is exact for any time step of the record, so that
//!    resampling needs no interpolation formula.
//! 3. It is multiplied by the zero-phase band `|H(f)|^2`, H a four-pole Butterworth high-pass at
//!    the lower and low-pass at the upper corner: what a Butterworth filter does when run forward
//!    and backward. Nothing is kept above 2.5 times the upper corner or the record's Nyquist
//!    frequency.
//! 4. Displacement and velocity are the spectrum over (i w)^2 and (i w): one trigonometric
//!    polynomial and its derivatives, sampled at the table's rate.
//! 5. The displacement x is tapered by a window w that is three times continuously
//!    differentiable, and velocity and acceleration follow from the product rule. They are
//!    (w x)' = w' x + w v, (w x)'' = w'' x + 2 w' v + w a.
//!
//! So velocity and acceleration are the exact derivatives of the displacement at the samples, and
//! all three are zero in the first and the last one. No quiet time is added: the motion spans
//! the record.

use std::array;
use std::f64::consts::TAU;

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

use super::accelerogram::Record;
use super::csv_file::rounded;
use super::error::MotionError;
use super::options::{Options, Scaling};
use super::playable::{Motion, peak};
use units::{INCH, STANDARD_GRAVITY};

/// Poles of each of the two Butterworth filters.
const POLES: i32 = 4;
/// Nothing is kept above this many times the upper corner.
const BAND_END: f64 = 2.5;
/// Quiet periods of the lower corner on either side while filtering.
const QUIET_PERIODS: f64 = 4.0;
/// Harmonics evaluated at a time: each sum waits for its own last term alone.
const TOGETHER: usize = 8;
/// Largest number of samples of a motion with its quiet time.
const MOST_SAMPLES: f64 = 2e7;
/// Largest acceleration of a record, g: beyond any motion of the ground or of equipment.
const MOST_G: f64 = 1e4;

/// Processes a record into a motion; `notes` lists every step.
///
/// # Errors
/// Options that make no sense, a record that is zero throughout, or a motion beyond the stroke.
pub fn process(record: &Record, options: &Options) -> Result<Motion, MotionError> {
    Unscaled::new(record, options)?.scaled(options)
}

/// A record made playable but for its scale.
#[derive(Debug, Clone)]
pub struct Unscaled {
    name: String,
    seed: Option<u64>,
    notes: Vec<String>,
    /// Displacement, velocity and acceleration, SI.
    histories: [Vec<f64>; 3],
}

impl Unscaled {
    /// Processes a record but for its scale, which is all that is not used of `options`.
    ///
    /// # Errors
    /// Options that make no sense, a record that is zero throughout.
    pub fn new(record: &Record, options: &Options) -> Result<Self, MotionError> {
        unscaled(record, options)
    }

    /// The motion at the scale of `options`, whose other values are those with which it was made.
    ///
    /// # Errors
    /// A motion beyond the stroke, a record at rest.
    pub fn scaled(&self, options: &Options) -> Result<Motion, MotionError> {
        let scaling = options.scaling.unwrap_or(Options::DEFAULT_SCALING);
        self.scaled_by(self.factor(scaling)?, &scaling.describe(), options)
    }

    /// This motion with `other` along a second axis, both at one scale: with limits the largest at which both
    /// keep them, with a peak that at which the larger component has it.
    ///
    /// # Errors
    /// As [`Unscaled::scaled`], of either.
    pub fn pair_scaled(&self, other: &Self, options: &Options) -> Result<Motion, MotionError> {
        let scaling = options.scaling.unwrap_or(Options::DEFAULT_SCALING);
        let factor = self.factor(scaling)?.min(other.factor(scaling)?);
        let words = format!("{}, as the other axis", scaling.describe());
        let [own, other] = [self, other].map(|one| one.scaled_by(factor, &words, options));
        Ok(own?.along_two_axes(other?))
    }

    fn factor(&self, scaling: Scaling) -> Result<f64, MotionError> {
        let [displacement, _, acceleration] = &self.histories;
        scaling.factor(&self.name, peak(acceleration), peak(displacement))
    }

    fn scaled_by(
        &self,
        factor: f64,
        words: &str,
        options: &Options,
    ) -> Result<Motion, MotionError> {
        let [displacement, velocity, acceleration] = &self.histories;
        let scaled = |history: &[f64]| history.iter().map(|value| value * factor).collect();
        let mut motion = Motion {
            name: self.name.clone(),
            dt: options.sample_time,
            displacement: scaled(displacement),
            velocity: scaled(velocity),
            acceleration: scaled(acceleration),
            notes: self.notes.clone(),
            seed: self.seed,
            across: None,
        };
        motion.notes.push(format!(
            "scaled by {} ({}): peak {:.3} g, {:.2} in/s ({:.1} mm/s), {:.3} in ({:.2} mm)",
            shown(factor),
            words,
            motion.peak_acceleration() / STANDARD_GRAVITY,
            peak(&motion.velocity) / INCH,
            1e3 * peak(&motion.velocity),
            motion.peak_displacement() / INCH,
            1e3 * motion.peak_displacement()
        ));
        check_stroke(&motion, options.stroke, factor)?;
        Ok(motion)
    }
}

fn unscaled(record: &Record, options: &Options) -> Result<Unscaled, MotionError> {
    check_options(&record.name, options)?;
    let fault = |reason: String| MotionError::Option {
        name: record.name.clone(),
        reason,
    };
    let [low, high] = options.band_hz;
    let nyquist = 0.5 / record.dt;
    if low >= nyquist {
        return Err(fault(format!(
            "the band begins at {low} Hz, above the record's Nyquist frequency of {nyquist:.3} Hz"
        )));
    }
    let h = options.sample_time;
    let span = (record.acceleration.len() - 1) as f64 * record.dt;
    let samples = (span / h * (1.0 + 1e-12)).floor() as usize + 1;
    let quiet = (QUIET_PERIODS / low / h).ceil();
    if samples as f64 + 2.0 * quiet > MOST_SAMPLES {
        return Err(fault(format!(
            "{span:.0} s at {h} s with a band from {low} Hz is too long"
        )));
    }
    if span < 2.0 * options.taper {
        return Err(fault(format!(
            "the record lasts {span:.3} s, shorter than its two tapers of {} s",
            options.taper
        )));
    }

    let mut notes = vec![format!(
        "{}: {} points at {} s ({span:.2} s), peak {:.3} g",
        record.origin,
        record.acceleration.len(),
        rounded(record.dt),
        peak(&record.acceleration) / STANDARD_GRAVITY
    )];
    if peak(&record.acceleration) > MOST_G * STANDARD_GRAVITY {
        return Err(fault(format!(
            "the record reaches {:.3e} g; expected at most {MOST_G:.0} g: check its unit",
            peak(&record.acceleration) / STANDARD_GRAVITY
        )));
    }
    let (detrended, mean, slope) = detrend(&record.acceleration, record.dt);
    notes.push(format!(
        "mean and trend removed ({:.2e} g, {:.2e} g/s)",
        mean / STANDARD_GRAVITY,
        slope / STANDARD_GRAVITY
    ));
    // What rounding leaves of a constant is no motion.
    if peak(&detrended) <= 1e-9 * peak(&record.acceleration) {
        return Err(fault(
            "nothing moves: without mean and trend the acceleration is zero".to_string(),
        ));
    }
    let mut histories = integrate(&detrended, record.dt, samples, quiet as usize, options);
    notes.push(format!(
        "band-limited to {low} to {high} Hz, zero phase (four-pole Butterworth forward and \
         backward), integrated and resampled to {:.0} Hz as one Fourier series",
        1.0 / h
    ));
    if BAND_END * high > nyquist {
        notes.push(format!(
            "nothing above the record's Nyquist frequency of {nyquist:.0} Hz"
        ));
    }
    taper(&mut histories, h, options.taper);
    notes.push(format!(
        "tapered over {} s at either end, so that it starts and ends at rest",
        options.taper
    ));
    Ok(Unscaled {
        name: record.name.clone(),
        seed: record.seed,
        notes,
        histories,
    })
}

/// The record without its least-squares line; also the mean, m/s^2, and slope, m/s^3, of the line.
fn detrend(acceleration: &[f64], dt: f64) -> (Vec<f64>, f64, f64) {
    let count = acceleration.len() as f64;
    let middle = (count - 1.0) / 2.0;
    let mean = acceleration.iter().sum::<f64>() / count;
    let (mut moment, mut inertia) = (0.0, 0.0);
    for (index, value) in acceleration.iter().enumerate() {
        let from_middle = index as f64 - middle;
        moment += from_middle * value;
        inertia += from_middle * from_middle;
    }
    let slope = if inertia > 0.0 { moment / inertia } else { 0.0 };
    let line = |index: usize| mean + slope * (index as f64 - middle);
    let detrended = acceleration
        .iter()
        .enumerate()
        .map(|(i, value)| value - line(i))
        .collect();
    (detrended, mean, slope / dt)
}

/// Displacement, velocity and acceleration of the band-limited record at `samples` table samples.
fn integrate(
    acceleration: &[f64],
    dt: f64,
    samples: usize,
    quiet: usize,
    options: &Options,
) -> [Vec<f64>; 3] {
    let [low, high] = options.band_hz;
    let h = options.sample_time;
    let period = (samples + 2 * quiet).next_multiple_of(1000);
    let step = 1.0 / (period as f64 * h);
    let end = (BAND_END * high).min(0.5 / dt).min(0.5 / h);
    let last = ((end / step) as usize).min((period - 1) / 2);

    let mut planner = RealFftPlanner::<f64>::new();
    let inverse = planner.plan_fft_inverse(period);
    let [mut x, mut v, mut a] = [0, 1, 2].map(|_| inverse.make_input_vec());
    for first in (1..=last).step_by(TOGETHER) {
        let frequencies: [f64; TOGETHER] = array::from_fn(|lane| (first + lane) as f64 * step);
        let angles = frequencies.map(|frequency| TAU * frequency * dt);
        let sums = spectrum_at(acceleration, angles);
        for (k, (frequency, sum)) in (first..=last).zip(frequencies.into_iter().zip(sums)) {
            let gain = 1.0
                / (1.0 + (low / frequency).powi(2 * POLES))
                / (1.0 + (frequency / high).powi(2 * POLES));
            // The sum over samples approximates the integral: times dt, over the period.
            let scale = gain * dt * step;
            let line = sum * scale;
            let rate = Complex64::new(0.0, TAU * frequency);
            x[k] = line / (rate * rate);
            v[k] = line / rate;
            a[k] = line;
        }
    }
    [x, v, a].map(|mut spectrum| {
        let mut history = inverse.make_output_vec();
        // The lengths come from the plan itself, and lines 0 and N/2 are zero: it cannot fail.
        let done = inverse.process(&mut spectrum, &mut history);
        debug_assert!(done.is_ok());
        history.truncate(samples);
        history
    })
}

/// Sums of `values[n] exp(-i angle n)` for each angle, by Horner's rule from the last value down.
fn spectrum_at(values: &[f64], angles: [f64; TOGETHER]) -> [Complex64; TOGETHER] {
    let turns = angles.map(|angle| Complex64::from_polar(1.0, -angle));
    let mut sums = [Complex64::ZERO; TOGETHER];
    for value in values.iter().rev() {
        for lane in 0..TOGETHER {
            sums[lane] = sums[lane] * turns[lane] + value;
        }
    }
    sums
}

/// Windows the displacement by the product rule; `length` in s at either end.
fn taper(histories: &mut [Vec<f64>; 3], h: f64, length: f64) {
    let [displacement, velocity, acceleration] = histories;
    let end = displacement.len() - 1;
    for (n, x) in displacement.iter_mut().enumerate() {
        let (v, a) = (&mut velocity[n], &mut acceleration[n]);
        let from_start = n as f64 * h;
        let from_end = (end - n) as f64 * h;
        let (window, slope, curvature) = if from_start < length && from_start <= from_end {
            let [w, dw, ddw] = smooth_step(from_start / length);
            (w, dw / length, ddw / (length * length))
        } else if from_end < length {
            let [w, dw, ddw] = smooth_step(from_end / length);
            (w, -dw / length, ddw / (length * length))
        } else {
            continue;
        };
        *a = curvature * *x + 2.0 * slope * *v + window * *a;
        *v = slope * *x + window * *v;
        *x *= window;
    }
}

/// The step 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 from 0 to 1 with three derivatives zero at both
/// ends; its value and first two derivatives.
#[must_use]
pub fn smooth_step(s: f64) -> [f64; 3] {
    let rest = 1.0 - s;
    [
        s.powi(4) * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s))),
        140.0 * s.powi(3) * rest.powi(3),
        420.0 * (s * rest).powi(2) * (1.0 - 2.0 * s),
    ]
}

impl Scaling {
    /// The factor for a motion of these peaks (m/s^2, m).
    pub(super) fn factor(
        self,
        name: &str,
        acceleration: f64,
        displacement: f64,
    ) -> Result<f64, MotionError> {
        let fault = |reason: &str| MotionError::Option {
            name: name.into(),
            reason: reason.into(),
        };
        if !(acceleration > 0.0 && displacement > 0.0) {
            return Err(fault("nothing moves: the acceleration is zero throughout"));
        }
        let factor = match self {
            Scaling::Within {
                acceleration: a,
                displacement: d,
            } => (a / acceleration).min(d / displacement),
            Scaling::Factor(factor) => factor,
            Scaling::PeakAcceleration(a) => a / acceleration,
            Scaling::PeakDisplacement(d) => d / displacement,
        };
        if factor.is_finite() && factor > 0.0 {
            return Ok(factor);
        }
        Err(fault(
            "the scale, peak acceleration or peak displacement must be a positive number",
        ))
    }

    fn describe(self) -> String {
        match self {
            Scaling::Within {
                acceleration,
                displacement,
            } => format!(
                "to the smaller of {} g and {} in",
                rounded(acceleration / STANDARD_GRAVITY),
                rounded(displacement / INCH)
            ),
            Scaling::Factor(_) => "as asked".to_string(),
            Scaling::PeakAcceleration(a) => {
                format!("to a peak of {} g", rounded(a / STANDARD_GRAVITY))
            }
            Scaling::PeakDisplacement(d) => format!("to a peak of {} in", rounded(d / INCH)),
        }
    }
}

/// A factor with four decimals, and a small one with four digits.
fn shown(factor: f64) -> String {
    match factor < 0.001 {
        true => format!("{factor:.3e}"),
        false => format!("{factor:.4}"),
    }
}

/// Options that no motion can be made with.
pub(super) fn check_options(name: &str, options: &Options) -> Result<(), MotionError> {
    let [low, high] = options.band_hz;
    let positive = |value: f64| value.is_finite() && value > 0.0;
    let reason = if !positive(options.sample_time) {
        "the sample time must be a positive number of seconds"
    } else if !(positive(low) && positive(high) && low < high) {
        "the band must be two frequencies above zero, the lower first"
    } else if !positive(options.taper) {
        "the taper must be a positive number of seconds"
    } else if !positive(options.stroke) {
        "the stroke must be a positive length"
    } else {
        return Ok(());
    };
    Err(MotionError::Option {
        name: name.to_string(),
        reason: reason.to_string(),
    })
}

/// Refuses a motion beyond the stroke; `factor` is the scale that it was played at.
pub(super) fn check_stroke(motion: &Motion, stroke: f64, factor: f64) -> Result<(), MotionError> {
    let peak = motion.peak_displacement();
    if peak <= stroke {
        return Ok(());
    }
    let fitting = factor * stroke / peak;
    // Four significant digits, rounded down, so that the scale advised does fit.
    let digits = 10_f64.powf(3.0 - fitting.log10().floor());
    Err(MotionError::Stroke {
        name: motion.name.clone(),
        peak,
        stroke,
        fitting_scale: rounded((fitting * digits).floor() / digits),
    })
}
