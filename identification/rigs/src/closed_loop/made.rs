//! Signals for tests.

/// Noise from -1 to 1.
pub(super) fn noise(samples: usize, seed: u32) -> Vec<f64> {
    let mut state = seed;
    let next = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    (0..samples).map(next).collect()
}
