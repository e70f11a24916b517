//! The table's velocity from displacement and acceleration, without lag.

use std::f64::consts::TAU;

use nalgebra::Complex;
use realfft::RealFftPlanner;

use recordings::IdentificationError;

/// White noise under a smooth signal, one standard deviation, by third differences.
#[must_use]
pub fn noise_floor(values: &[f64]) -> f64 {
    let square: f64 = values
        .windows(4)
        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2))
        .sum();
    (square / (20.0 * values.len().max(1) as f64)).sqrt()
}

/// Velocity (m/s) from `displacement` (m) and `acceleration` (m/s²) sampled every `period` s: the
/// one's derivative at low frequencies and the other's integral at high ones, weighed by their
/// noise, over the whole record at once.
///
/// # Errors
/// The transform refuses the record.
pub fn velocity(
    displacement: &[f64],
    acceleration: &[f64],
    period: f64,
) -> Result<Vec<f64>, IdentificationError> {
    let count = displacement.len();
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(count);
    let inverse = planner.plan_fft_inverse(count);
    let refused = |error: realfft::FftError| IdentificationError::NotConverged {
        method: "the Fourier transform",
        reason: error.to_string(),
    };
    let (first, last) = (
        displacement.first().copied().unwrap_or(0.0),
        displacement.last().copied().unwrap_or(0.0),
    );
    // The record is periodic to the transform: take the way from end to end out of it.
    let slope = (last - first) / count.max(1) as f64;
    let mut flat: Vec<f64> = displacement
        .iter()
        .enumerate()
        .map(|(k, x)| x - first - slope * k as f64)
        .collect();
    let mean = acceleration.iter().sum::<f64>() / count.max(1) as f64;
    let mut pushed: Vec<f64> = acceleration.iter().map(|a| a - mean).collect();
    let mut x = forward.make_output_vec();
    let mut a = forward.make_output_vec();
    forward.process(&mut flat, &mut x).map_err(refused)?;
    forward.process(&mut pushed, &mut a).map_err(refused)?;
    let ratio = noise_floor(acceleration) / noise_floor(displacement).max(f64::MIN_POSITIVE);
    let crossover = ratio.max(f64::MIN_POSITIVE).powi(2);
    for (line, (x, a)) in x.iter_mut().zip(&a).enumerate() {
        let omega = TAU * line as f64 / (count as f64 * period);
        let share = omega.powi(4) / (omega.powi(4) + crossover);
        let s = Complex::new(0.0, omega);
        *x = if line == 0 {
            Complex::new(0.0, 0.0)
        } else {
            (*x * s * (1.0 - share) + *a / s * share) / count as f64
        };
    }
    // The last line of an even count has no imaginary part.
    if count.is_multiple_of(2)
        && let Some(last) = x.last_mut()
    {
        last.im = 0.0;
    }
    let mut v = inverse.make_output_vec();
    inverse.process(&mut x, &mut v).map_err(refused)?;
    Ok(v.into_iter().map(|v| v + slope / period).collect())
}
