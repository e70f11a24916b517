//! What a channel shows between its samples.

/// The value at `place`, counted in samples and held at both ends: a cubic through the samples with the slopes of
/// their neighbours (Keys, IEEE Transactions on Acoustics, Speech, and Signal Processing 29, 1981). A line between
/// samples would smooth most in the middle, so that a delay that is estimated with it leans there.
pub(super) fn between(values: &[f64], place: f64) -> f64 {
    let last = values.len().saturating_sub(1);
    let place = place.clamp(0.0, last as f64);
    let before = place as usize;
    let share = place - before as f64;
    let Some(&low) = values.get(before) else {
        return f64::NAN;
    };
    let high = values.get(before + 1).copied().unwrap_or(low);
    // At either end it begins and ends straight.
    let far = before
        .checked_sub(1)
        .map_or(2.0 * low - high, |k| values[k]);
    let beyond = values.get(before + 2).copied().unwrap_or(2.0 * high - low);
    let (begin, end) = (0.5 * (high - far), 0.5 * (beyond - low));
    let rise = high - low;
    low + share
        * (begin + share * (3.0 * rise - 2.0 * begin - end + share * (begin + end - 2.0 * rise)))
}

#[cfg(test)]
mod tests {
    use super::between;

    #[test]
    fn a_wave_of_eight_samples_keeps_its_height_between_them() {
        let wave = |k: f64| (std::f64::consts::TAU * k / 8.0 + 0.3).sin();
        let samples: Vec<f64> = (0..64).map(|k| wave(f64::from(k))).collect();
        let worst = |value: &dyn Fn(f64) -> f64| {
            (40..560)
                .map(|k| 0.1 * f64::from(k))
                .map(|place| (value(place) - wave(place)).abs())
                .fold(0.0, f64::max)
        };
        let line = |place: f64| {
            let k = place as usize;
            samples[k] + place.fract() * (samples[k + 1] - samples[k])
        };
        assert!(worst(&|place| between(&samples, place)) < 0.025);
        assert!(worst(&line) > 0.07);
    }

    #[test]
    fn samples_stay_and_ends_are_held() {
        let samples = [3.0, -1.0, 4.0];
        assert_eq!([0.0, 1.0, 2.0].map(|k| between(&samples, k)), samples);
        assert_eq!([-5.0, 7.0].map(|k| between(&samples, k)), [3.0, 4.0]);
        assert_eq!(between(&[2.0], 0.4), 2.0);
        let line = [1.0, 3.0, 5.0];
        assert_eq!(
            [0.25, 1.5, 1.75].map(|k| between(&line, k)),
            [1.5, 4.0, 4.5]
        );
    }
}
