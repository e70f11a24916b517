//! A synthetic ground motion: Gaussian noise of the Clough-Penzien spectrum under an envelope.
//!
//! R. W. Clough and J. Penzien, *Dynamics of Structures*, 1975: the spectrum of Kanai and Tajimi
//! (soil as one oscillator) with a second filter that makes displacements finite. The envelope is
//! that of Jennings, Housner and Tsai (1968): parabolic rise, strong phase, exponential decay.

use std::f64::consts::PI;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

use super::accelerogram::Record;
use super::playable::peak;
use units::STANDARD_GRAVITY;

/// The seed of the built-in motion when none is asked for.
pub const DEFAULT_SEED: u64 = 1;

/// Parameters of the process; the default is the rock or stiff soil of G. Deodatis, *Probabilistic
/// Engineering Mechanics* 11 (1996).
#[derive(Debug, Clone, PartialEq)]
pub struct CloughPenzien {
    /// Frequency of the soil, rad/s.
    pub soil_frequency: f64,
    /// Damping ratio of the soil.
    pub soil_damping: f64,
    /// Frequency of the high-pass filter, rad/s.
    pub filter_frequency: f64,
    /// Damping ratio of the high-pass filter.
    pub filter_damping: f64,
    /// End of the rise, s.
    pub rise: f64,
    /// End of the strong phase, s.
    pub strong: f64,
    /// Rate of the decay, 1/s.
    pub decay: f64,
    /// Whole duration, s.
    pub duration: f64,
}

impl Default for CloughPenzien {
    fn default() -> Self {
        Self {
            soil_frequency: 8.0 * PI,
            soil_damping: 0.6,
            filter_frequency: 0.8 * PI,
            filter_damping: 0.6,
            rise: 4.0,
            strong: 12.0,
            decay: 0.35,
            duration: 25.0,
        }
    }
}

impl CloughPenzien {
    /// Sample time of the generated record, s.
    const DT: f64 = 0.005;

    /// Two-sided power spectral density at the angular frequency `w`, rad/s, for a white bedrock
    /// motion of density one.
    #[must_use]
    pub fn density(&self, w: f64) -> f64 {
        let soil = 4.0 * (self.soil_damping * w / self.soil_frequency).powi(2);
        let r = (w / self.soil_frequency).powi(2);
        let q = (w / self.filter_frequency).powi(2);
        let pass = 4.0 * (self.filter_damping * w / self.filter_frequency).powi(2);
        (1.0 + soil) / ((1.0 - r).powi(2) + soil) * q * q / ((1.0 - q).powi(2) + pass)
    }

    /// The envelope at time `t`, s; at most one.
    #[must_use]
    pub fn envelope(&self, t: f64) -> f64 {
        if t < self.rise {
            (t / self.rise).powi(2)
        } else if t < self.strong {
            1.0
        } else {
            (-self.decay * (t - self.strong)).exp()
        }
    }

    /// A record with a peak of 0.4 g; the same seed always gives the same record.
    #[must_use]
    pub fn record(&self, seed: u64) -> Record {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let points = (self.duration / Self::DT).round() as usize + 1;
        // Twice the duration: the series' end must not resemble its beginning.
        let period = 2 * points;
        let inverse = RealFftPlanner::<f64>::new().plan_fft_inverse(period);
        let mut spectrum = inverse.make_input_vec();
        let lines = spectrum.len();
        for (k, line) in spectrum.iter_mut().enumerate().take(lines - 1).skip(1) {
            let w = 2.0 * PI * k as f64 / (period as f64 * Self::DT);
            let (re, im) = (random.sample(StandardNormal), random.sample(StandardNormal));
            *line = Complex64::new(re, im) * self.density(w).sqrt();
        }
        let mut acceleration = inverse.make_output_vec();
        // The lengths come from the plan itself, and the first and last lines are zero.
        let done = inverse.process(&mut spectrum, &mut acceleration);
        debug_assert!(done.is_ok());
        acceleration.truncate(points);
        for (n, value) in acceleration.iter_mut().enumerate() {
            *value *= self.envelope(n as f64 * Self::DT);
        }
        let scale = 0.4 * STANDARD_GRAVITY / peak(&acceleration).max(f64::MIN_POSITIVE);
        acceleration.iter_mut().for_each(|value| *value *= scale);
        Record {
            name: format!("synthetic-{seed}"),
            dt: Self::DT,
            acceleration,
            origin: format!("synthetic motion, Clough-Penzien process, seed {seed}"),
            seed: Some(seed),
        }
    }
}
