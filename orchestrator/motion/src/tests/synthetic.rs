//! The built-in motion.

use super::*;

#[test]
fn the_built_in_motion_is_synthetic_and_says_so() {
    for seed in 0..5 {
        let motion = built_in(seed, &Options::default()).unwrap();
        check_motion(&motion);
        assert_eq!(motion.name, format!("synthetic-{seed}"));
        assert_eq!(motion.seed, Some(seed));
        assert!(motion.notes[0].contains("synthetic") && motion.notes[0].contains("seed"));
        assert!((20.0..=30.0).contains(&motion.duration()));
        println!("{}", motion.notes.join("\n"));
    }
    let motion = |seed| built_in(seed, &Options::default()).unwrap();
    assert_eq!(motion(1), motion(1));
    assert_ne!(motion(1).acceleration, motion(2).acceleration);
}

/// The density against the absolute square of the two transfer functions it comes from: the
/// absolute acceleration of one oscillator, the relative acceleration of the other.
#[test]
fn the_density_is_that_of_two_oscillators() {
    use realfft::num_complex::Complex64;
    let process = CloughPenzien::default();
    for w in [0.3, 2.0, 2.6, 10.0, 25.0, 80.0] {
        let s = Complex64::new(0.0, w);
        let (wg, zg) = (process.soil_frequency, process.soil_damping);
        let (wf, zf) = (process.filter_frequency, process.filter_damping);
        let soil = (2.0 * zg * wg * s + wg * wg) / (s * s + 2.0 * zg * wg * s + wg * wg);
        let filter = s * s / (s * s + 2.0 * zf * wf * s + wf * wf);
        let expected = (soil * filter).norm_sqr();
        assert!(
            (process.density(w) / expected - 1.0).abs() < 1e-12,
            "at {w} rad/s"
        );
    }
}

/// The mean periodogram of the strong phase over many seeds has the shape of the spectrum.
#[test]
fn the_synthetic_process_has_the_spectrum_it_is_named_for() {
    let process = CloughPenzien {
        rise: 0.0,
        strong: 1e9,
        ..CloughPenzien::default()
    };
    let seeds = 200;
    let frequencies = [1.0, 2.0, 2.5, 4.0, 8.0];
    let mut power = [0.0; 5];
    for seed in 0..seeds {
        let record = process.record(seed);
        // Each record is scaled to one peak; undo it by its own variance.
        let variance = record.acceleration.iter().map(|a| a * a).sum::<f64>();
        for (power, frequency) in power.iter_mut().zip(frequencies) {
            let w = 2.0 * std::f64::consts::PI * frequency;
            let (mut re, mut im) = (0.0, 0.0);
            for (n, a) in record.acceleration.iter().enumerate() {
                let (s, c) = (w * n as f64 * record.dt).sin_cos();
                re += a * c;
                im += a * s;
            }
            *power += (re * re + im * im) / variance;
        }
    }
    for (power_at, frequency) in power.iter().zip(frequencies) {
        let w = 2.0 * std::f64::consts::PI * frequency;
        let expected = process.density(w) / process.density(4.0 * std::f64::consts::PI);
        let found = power_at / power[1];
        assert!(
            (found / expected - 1.0).abs() < 0.35,
            "{frequency} Hz: {found} for {expected}"
        );
    }
}
