//! From a record to a motion: band, integration, rest at both ends, scale, stroke.

use super::*;

#[needs::shared("records")]
#[test]
fn shared_records_become_motions_at_rest_at_both_ends() {
    let folder = shared_records();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "md") {
            continue;
        }
        let motion = load(&path, &Options::default()).unwrap();
        println!("{}\n  {}", motion.name, motion.notes.join("\n  "));
        check_motion(&motion);
        let pga = motion.peak_acceleration() / STANDARD_GRAVITY;
        let pgd = motion.peak_displacement() / INCH;
        let reached = (pga - 0.3).abs().min((pgd - 1.2).abs());
        assert!(
            pga < 0.3 + 1e-9 && pgd < 1.2 + 1e-9 && reached < 1e-9,
            "{pga} g, {pgd} in"
        );
        // The strong motion is still there: the raw record, scaled, has most of the same history.
        let raw = read_record(&path).unwrap();
        let every = (raw.dt / motion.dt).round() as usize;
        if (raw.dt / motion.dt - every as f64).abs() < 1e-9 {
            let (mut both, mut one, mut other) = (0.0, 0.0, 0.0);
            for (n, a) in raw.acceleration.iter().enumerate() {
                let played = motion.acceleration[n * every];
                both += a * played;
                one += a * a;
                other += played * played;
            }
            let likeness = both / (one * other).sqrt();
            assert!(likeness > 0.9, "{}: correlation {likeness}", motion.name);
        }
    }
}

/// A tone within the band passes with its gain and its phase; the closed form of its
/// displacement is known. Far from the ends the taper is one.
#[test]
fn a_tone_is_integrated_as_in_closed_form() {
    for (dt, frequency) in [(0.005, 2.0), (0.01, 3.0), (0.02, 5.0), (0.0078125, 2.5)] {
        let w = 2.0 * std::f64::consts::PI * frequency;
        let points = (40.0 / dt) as usize + 1;
        let swell = |t: f64| (std::f64::consts::PI * t / 40.0).sin().powi(8);
        let record = Record {
            name: "tone".into(),
            dt,
            acceleration: (0..points)
                .map(|n| swell(n as f64 * dt) * (w * n as f64 * dt).sin())
                .collect(),
            origin: "tone".into(),
            seed: None,
        };
        let options = Options {
            scaling: Some(Scaling::Factor(1.0)),
            ..Options::default()
        };
        let motion = process(&record, &options).unwrap();
        check_motion(&motion);
        let gain = 1.0 / (1.0 + (0.25 / frequency).powi(8)) / (1.0 + (frequency / 20.0).powi(8));
        for n in (7000..13000).step_by(37) {
            let t = n as f64 * 0.002;
            let expected = gain * swell(t) * (w * t).sin();
            let found = motion.acceleration[n];
            assert!(
                (found - expected).abs() < 1e-5,
                "dt {dt}: {found} for {expected} at {t}"
            );
            // The envelope is slow: x = -a/w^2 but for terms of its slope over the frequency.
            let displacement = motion.displacement[n] * w * w;
            assert!(
                (displacement + expected).abs() < 0.15,
                "{displacement} for {expected}"
            );
        }
    }
}

#[test]
fn what_lies_outside_the_band_is_removed() {
    let dt = 0.005;
    let tone = |frequency: f64| {
        let w = 2.0 * std::f64::consts::PI * frequency;
        let acceleration = (0..12001)
            .map(|n| {
                let t = n as f64 * dt;
                (std::f64::consts::PI * t / 60.0).sin().powi(4) * (w * t).sin()
            })
            .collect();
        let record = Record {
            name: "tone".into(),
            dt,
            acceleration,
            origin: String::new(),
            seed: None,
        };
        let scaling = Some(Scaling::Factor(1.0));
        let options = Options {
            scaling,
            stroke: 10.0,
            ..Options::default()
        };
        process(&record, &options).unwrap().peak_acceleration()
    };
    // |H|^2 of the two Butterworth filters at these frequencies.
    for (frequency, expected) in [(20.0, 0.5), (40.0, 1.0 / 257.0), (60.0, 0.0), (5.0, 1.0)] {
        let found = tone(frequency);
        assert!(
            (found - expected).abs() < 2e-3,
            "{found} for {expected} at {frequency} Hz"
        );
    }
    assert!(tone(0.1) < 0.02, "{}", tone(0.1));
}

#[test]
fn the_same_file_gives_the_same_motion_to_the_bit() {
    let text = burst(2000, 0.01);
    let motion = || process(&record("burst.csv", &text).unwrap(), &Options::default()).unwrap();
    assert_eq!(motion(), motion());
}

#[test]
fn a_record_is_scaled_as_asked() {
    let raw = record("burst.csv", &burst(2000, 0.01)).unwrap();
    let play = |scaling| {
        process(
            &raw,
            &Options {
                scaling,
                ..Options::default()
            },
        )
        .unwrap()
    };
    let pga = play(Some(Scaling::PeakAcceleration(1.5)));
    assert!((pga.peak_acceleration() - 1.5).abs() < 1e-12);
    let peak = play(Some(Scaling::PeakDisplacement(0.02)));
    assert!((peak.peak_displacement() - 0.02).abs() < 1e-14);
    let (one, half) = (
        play(Some(Scaling::Factor(1.0))),
        play(Some(Scaling::Factor(0.5))),
    );
    assert!((one.peak_velocity() / half.peak_velocity() - 2.0).abs() < 1e-12);
    let usual = play(None);
    assert!((usual.peak_acceleration() / STANDARD_GRAVITY - 0.3).abs() < 1e-12);
    assert!(
        usual
            .notes
            .iter()
            .any(|note| note.contains("to the smaller of 0.3 g and 1.2 in"))
    );
    let none = Options {
        scaling: Some(Scaling::Factor(0.0)),
        ..Options::default()
    };
    assert_eq!(
        process(&raw, &none).unwrap_err().to_string(),
        "burst: the scale, peak acceleration or peak displacement must be a positive number"
    );
}

#[test]
fn a_motion_beyond_the_stroke_says_by_how_much_and_what_fits() {
    let raw = record("burst.csv", &burst(2000, 0.01)).unwrap();
    let play = |scaling| {
        process(
            &raw,
            &Options {
                scaling: Some(scaling),
                ..Options::default()
            },
        )
    };
    let error = play(Scaling::PeakDisplacement(1.707 * INCH)).unwrap_err();
    let text = error.to_string();
    assert!(
        text.starts_with(
            "burst: the peak displacement 1.707 in exceeds the stroke of 1.5 in by 0.207 in; \
             a scale of at most "
        ),
        "{text}"
    );
    let MotionError::Stroke { fitting_scale, .. } = error else {
        panic!("{text}")
    };
    let fitting = play(Scaling::Factor(fitting_scale)).unwrap();
    assert!(fitting.peak_displacement() <= 1.5 * INCH);
    assert!(
        fitting.peak_displacement() > 1.498 * INCH,
        "the scale gives stroke away"
    );
    assert!(play(Scaling::Factor(1.002 * fitting_scale)).is_err());
}

#[test]
fn a_record_without_motion_is_refused() {
    let mut text = String::from("t_s,a_g\n");
    (0..2000).for_each(|n| text.push_str(&format!("{:.2},0\n", 0.01 * f64::from(n))));
    let still = record("still.csv", &text).unwrap();
    assert_eq!(
        process(&still, &Options::default())
            .unwrap_err()
            .to_string(),
        "still: nothing moves: without mean and trend the acceleration is zero"
    );
    let short = record("short.csv", &burst(100, 0.01)).unwrap();
    assert_eq!(
        process(&short, &Options::default())
            .unwrap_err()
            .to_string(),
        "short: the record lasts 0.990 s, shorter than its two tapers of 2 s"
    );
}

/// Both components of a pair have one scale, by which the larger one meets what was asked for; the shorter one rests.
#[test]
fn a_pair_has_one_scale() {
    let tone = |amplitude: f64, seconds: f64| Record {
        name: "tone".into(),
        dt: 0.01,
        acceleration: (0..(100.0 * seconds) as usize)
            .map(|n| amplitude * (0.2 * f64::from(n as u32)).sin())
            .collect(),
        origin: "tone".into(),
        seed: None,
    };
    let options = Options {
        scaling: Some(Scaling::PeakAcceleration(1.0)),
        ..Options::default()
    };
    let [small, large] =
        [tone(0.5, 30.0), tone(2.0, 20.0)].map(|record| Unscaled::new(&record, &options).unwrap());
    for (first, second, order) in [(&small, &large, [0, 1]), (&large, &small, [1, 0])] {
        let pair = first.pair_scaled(second, &options).unwrap();
        let axes = [&pair, pair.across.as_deref().unwrap()];
        let [small, large] = order.map(|n| axes[n]);
        assert!((large.peak_acceleration() - 1.0).abs() < 1e-12);
        assert!((small.peak_acceleration() - 0.25).abs() < 0.01);
        assert_eq!(axes[0].len(), axes[1].len());
        assert_eq!(large.acceleration.last(), Some(&0.0));
    }
}
