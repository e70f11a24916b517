//! What a signal does between its samples.

/// Samples on either side that a value between two is made of.
const REACH: usize = 24;
/// Parameter of Kaiser's window: the side lobes lie 80 dB below.
const KAISER: f64 = 8.0;

/// The band-limited signal through `samples` at `places` places each: windowed interpolation by
/// `sin(πt)/(πt)` (Shannon 1949; Kaiser's window, in Oppenheim and Schafer, Discrete-Time Signal
/// Processing, section 7.5). Beyond the ends the first and the last sample stand, or the signal
/// begins again where it is periodic. What comes near half the sampling rate, within 6 %, is
/// attenuated.
pub fn band_limited(samples: &[f64], places: usize, is_periodic: bool) -> Vec<f64> {
    let n = samples.len();
    if n == 0 || places == 0 {
        return Vec::new();
    }
    let reach = REACH as f64;
    let weights: Vec<Vec<f64>> = (0..places)
        .map(|place| {
            let share = place as f64 / places as f64;
            let weights: Vec<f64> = (0..2 * REACH)
                .map(|tap| {
                    let t = tap as f64 - (reach - 1.0) - share;
                    let window = bessel(KAISER * (1.0 - (t / reach).powi(2)).max(0.0).sqrt());
                    let angle = std::f64::consts::PI * t;
                    window * if t == 0.0 { 1.0 } else { angle.sin() / angle }
                })
                .collect();
            let sum: f64 = weights.iter().sum();
            weights.into_iter().map(|w| w / sum).collect()
        })
        .collect();
    let at = |k: isize| {
        let last = n as isize - 1;
        let k = if is_periodic {
            k.rem_euclid(n as isize)
        } else {
            k.clamp(0, last)
        };
        samples[k as usize]
    };
    let mut out = Vec::with_capacity(n * places);
    let mut taps = vec![0.0; 2 * REACH];
    for k in 0..n {
        let first = k as isize - (REACH as isize - 1);
        for (tap, value) in taps.iter_mut().enumerate() {
            *value = at(first + tap as isize);
        }
        out.push(samples[k]);
        for weights in &weights[1..] {
            out.push(weights.iter().zip(&taps).map(|(w, x)| w * x).sum());
        }
    }
    out
}

/// Modified Bessel function of order zero, by its series.
fn bessel(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..40 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_is_itself_between_its_samples() {
        // At a fifth and at four tenths of the sampling rate.
        for share in [0.2, 0.4] {
            let tone = |t: f64| (std::f64::consts::TAU * share * t + 0.3).sin();
            let samples: Vec<f64> = (0..200).map(|k| tone(f64::from(k))).collect();
            let between = band_limited(&samples, 8, false);
            for k in 240..1360 {
                let error = between[k] - tone(k as f64 / 8.0);
                assert!(error.abs() < 2e-4, "{share} {k}: {error}");
            }
        }
    }

    #[test]
    fn nothing_has_nothing_between_its_samples() {
        assert!(band_limited(&[], 3, false).is_empty());
        assert!(band_limited(&[1.0, 2.0], 0, true).is_empty());
        assert_eq!(band_limited(&[1.0, 2.0], 1, false), [1.0, 2.0]);
        // A constant is one everywhere, also beyond its ends.
        let all = band_limited(&[3.0; 5], 4, false);
        assert!(all.len() == 20 && all.iter().all(|value| (value - 3.0).abs() < 1e-12));
    }

    #[test]
    fn a_period_goes_on_beyond_its_end() {
        let tone = |t: f64| (std::f64::consts::TAU * 3.0 * t / 40.0).cos();
        let samples: Vec<f64> = (0..40).map(|k| tone(f64::from(k))).collect();
        let between = band_limited(&samples, 4, true);
        for (k, value) in between.iter().enumerate() {
            assert!((value - tone(k as f64 / 4.0)).abs() < 2e-4, "{k}");
        }
    }
}
