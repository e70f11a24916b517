use std::path::PathBuf;

use super::*;
use crate::units::convert;

/// The shared records, or none (told plainly) where they are not present.
fn shared_records() -> Option<PathBuf> {
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    let records = shared.join("records");
    if records.is_dir() {
        return Some(records);
    }
    println!("skipped: no shared records at {}", records.display());
    None
}

/// Writes `text` to a file of that name and reads it as a record.
fn record(name: &str, text: &str) -> Result<Record, MotionError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_record(&path)
}

/// The message of the error, without the temporary folder.
fn message(name: &str, text: &str) -> String {
    let text = record(name, text).unwrap_err().to_string();
    text[text.find(name).unwrap()..].to_string()
}

fn reference(text: &str, options: &Options) -> Result<Motion, MotionError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.csv");
    std::fs::write(&path, text).unwrap();
    load_reference(&path, options)
}

fn reference_message(text: &str) -> String {
    let text = reference(text, &Options::default())
        .unwrap_err()
        .to_string();
    text[text.find("reference").unwrap()..].to_string()
}

/// Plain trapezoidal integral from rest.
fn trapezoid(values: &[f64], dt: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut integral = vec![0.0];
    for pair in values.windows(2) {
        sum += 0.5 * dt * (pair[0] + pair[1]);
        integral.push(sum);
    }
    integral
}

/// A record of `points` values of a decaying 2 Hz burst, as rows of `t_s,a_g`.
fn burst(points: usize, dt: f64) -> String {
    let mut text = String::from("# a burst\nt_s,a_g\n");
    for n in 0..points {
        let t = n as f64 * dt;
        let a = 0.2 * (t / 3.0).powi(2) * (2.0 - t).exp() * (12.5 * t).sin();
        text.push_str(&format!("{t:.4},{a:.8}\n"));
    }
    text
}

#[test]
fn shared_records_have_the_peaks_of_their_table() {
    let Some(folder) = shared_records() else {
        return;
    };
    // Points, dt in s, PGA in g, PGV in cm/s, PGD in cm, as printed in the table of the records.
    let table = [
        (
            "Nahanni_Canada_1985_NS1-280.csv",
            4113,
            0.005,
            1.096,
            46.1,
            14.5,
        ),
        ("Coalinga_1983_PVB-045.csv", 7690, 0.005, 0.380, 32.4, 6.4),
        (
            "Kobe_Japan_1995_TAK-090.csv",
            4015,
            0.01,
            0.616,
            120.7,
            32.7,
        ),
        (
            "Morgan_Hill_1984_CYC-285.csv",
            5723,
            0.005,
            1.298,
            80.7,
            9.6,
        ),
        ("Northridge_1994_PAC-175.csv", 1000, 0.02, 0.415, 45.1, 5.0),
        (
            "Imperial_Valley_1979_BCR-230.csv",
            7348,
            0.005,
            0.775,
            45.9,
            15.0,
        ),
        ("RSN1633_MANJIL_ABBAR--L.AT2", 2676, 0.02, 0.515, 42.4, 14.9),
        (
            "Friuli_Italy_1976_TMZ-000.csv",
            6959,
            0.005,
            0.351,
            21.8,
            9.1,
        ),
    ];
    for (name, points, dt, pga, pgv, pgd) in table {
        let record = read_record(&folder.join(name)).unwrap();
        assert_eq!(
            (record.acceleration.len(), record.dt),
            (points, dt),
            "{name}"
        );
        let velocity = trapezoid(&record.acceleration, dt);
        let displacement = trapezoid(&velocity, dt);
        let found = [
            convert(peak(&record.acceleration), "m/s^2", "g").unwrap(),
            100.0 * peak(&velocity),
            100.0 * peak(&displacement),
        ];
        println!("{name}: {found:.4?}");
        for (found, printed, half_unit) in [
            (found[0], pga, 5e-4),
            (found[1], pgv, 0.05),
            (found[2], pgd, 0.05),
        ] {
            assert!(
                (found - printed).abs() <= half_unit * 1.001,
                "{name}: {found} for {printed}"
            );
        }
    }
}

/// Played motion: starts and ends at rest; velocity and acceleration are the derivatives of the
/// displacement. Independent of how they were made: an eighth-order difference formula, and the
/// sum of the acceleration (Simpson) ends at zero velocity.
fn check_motion(motion: &Motion) {
    let h = motion.dt;
    let derivative = |f: &[f64], n: usize| {
        let pair = |k: usize| f[n + k] - f[n - k];
        (672.0 * pair(1) - 168.0 * pair(2) + 32.0 * pair(3) - 3.0 * pair(4)) / (840.0 * h)
    };
    for (of, rate) in [
        (&motion.displacement, &motion.velocity),
        (&motion.velocity, &motion.acceleration),
    ] {
        let size = peak(rate);
        let worst = (4..of.len() - 4)
            .map(|n| (derivative(of, n) - rate[n]).abs())
            .fold(0.0, f64::max);
        assert!(
            worst < 2e-4 * size,
            "{}: {} of the peak",
            motion.name,
            worst / size
        );
    }
    for history in [&motion.displacement, &motion.velocity, &motion.acceleration] {
        assert_eq!(history.len(), motion.len());
        assert!(history.iter().all(|value| value.is_finite()));
        assert!(history[0].abs() < 1e-12 && history[history.len() - 1].abs() < 1e-12);
    }
    let velocity = trapezoid(&motion.acceleration, h);
    let displacement = trapezoid(&velocity, h);
    assert!(velocity[velocity.len() - 1].abs() < 1e-6 * motion.peak_velocity());
    assert!(displacement[displacement.len() - 1].abs() < 1e-4 * motion.peak_displacement());
}

#[test]
fn shared_records_become_motions_at_rest_at_both_ends() {
    let Some(folder) = shared_records() else {
        return;
    };
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
fn both_headers_of_at2_are_read() {
    let numbers = "  .1000000E-02  -.2000000E-02 0.5 -.5\n".repeat(5);
    let top = "PEER\nSomewhere, 1/1/1999\nACCELERATION TIME SERIES IN UNITS OF G\n";
    for line in [
        "NPTS=     20, DT=   .0100 SEC,",
        "NPTS=20, DT= .0100 SEC",
        "   20   0.0100   NPTS, DT",
        "20 .01 NPTS, DT",
    ] {
        let record = record("a.AT2", &format!("{top}{line}\n{numbers}")).unwrap();
        assert_eq!((record.dt, record.acceleration.len()), (0.01, 20), "{line}");
        assert_eq!(record.acceleration[1], -0.002 * STANDARD_GRAVITY);
    }
    let metric = top.replace("OF G", "OF CM/SEC/SEC");
    let record = record("a.at2", &format!("{metric}20 .01 NPTS, DT\n{numbers}")).unwrap();
    assert!((record.acceleration[2] - 0.005).abs() < 1e-15);
}

#[test]
fn faults_of_at2_files_are_named() {
    let top = "PEER\nSomewhere\nACCELERATION TIME SERIES IN UNITS OF G\n";
    let say = |rest: &str| message("a.AT2", &format!("{top}{rest}"));
    assert_eq!(
        say("NPTS= 20, DT= .01 SEC\n1 2 3\n"),
        "a.AT2: truncated: 3 of 20 points, 17 missing"
    );
    assert_eq!(
        say("NPTS= 20, DT= .01 SEC\n1 2 3\n4 abc 6\n"),
        "a.AT2, line 6, column 2: \"abc\" is not a finite number"
    );
    assert_eq!(
        say("NPTS= 20, DT= .01 SEC\n1 2 NaN\n"),
        "a.AT2, line 5, column 3: \"NaN\" is not a finite number"
    );
    assert_eq!(
        say("NPTS= 2, DT= .01 SEC\n1 2\n3\n"),
        "a.AT2, line 6: more numbers than the 2 points of the header"
    );
    for line in ["NPTS= 20", "NPTS= 20, DT= SEC", "20 NPTS, DT"] {
        assert_eq!(
            say(&format!("{line}\n1 2 3\n")),
            "a.AT2, line 4: dt is missing; expected the time step in s, as in `DT= .005 SEC`"
        );
    }
    assert_eq!(
        say("NPTS= 20, DT= -.01 SEC\n"),
        "a.AT2, line 4: dt = \"-.01\" is not a positive number of seconds"
    );
    assert_eq!(
        say("1 2 3\n"),
        "a.AT2: no line with NPTS and DT among the first 12; \
         expected `NPTS=   2676, DT=   .0200 SEC` or `2676  0.0200  NPTS, DT`"
    );
    assert_eq!(
        message(
            "a.AT2",
            "VELOCITY TIME SERIES IN UNITS OF CM/S\n20 .01 NPTS, DT\n1\n"
        ),
        "a.AT2, line 1: not an acceleration; expected an AT2 record of one"
    );
    assert_eq!(
        message("a.AT2", "IN UNITS OF LBF\n20 .01 NPTS, DT\n1\n"),
        "a.AT2, line 1: unit \"lbf\" (kg m s^-2) does not fit \"m/s^2\" (m s^-2)"
    );
    assert_eq!(
        say(&format!(
            "NPTS= 20, DT= 1000 SEC\n{}",
            "1 2 3 4 5\n".repeat(4)
        )),
        "a.AT2: lasts 20000 s (dt = 1000 s), records of up to 3600 s are played"
    );
    // A number of points beyond all memory is only believed when the points are there.
    assert!(say("NPTS= 18446744073709551615, DT= .01\n1 2\n").contains("truncated: 2 of 1844"));
}

#[test]
fn csv_with_units_in_any_order_is_read() {
    let mut text = String::from("acceleration [in/s^2], time [ms]\n");
    (0..20).for_each(|n| text.push_str(&format!("{n}, {}\n", 5 * n)));
    let record = record("a.csv", &text).unwrap();
    assert_eq!(record.dt, 0.005);
    assert!((record.acceleration[10] - 0.254).abs() < 1e-15);
}

#[test]
fn faults_of_csv_files_are_named() {
    let say = |text: &str| message("a.csv", text);
    let columns = "`t_s,a_g` or `time [s],acceleration [g]`";
    assert_eq!(say(""), "a.csv: the file is empty");
    assert_eq!(say(" \n\n"), "a.csv: the file is empty");
    assert_eq!(
        say("# only\n"),
        format!("a.csv: only comments; expected a header {columns}")
    );
    assert_eq!(say("t_s,a_g\n"), "a.csv: a header and no data");
    assert_eq!(
        say("# x\nt_s,a_g\n0,1\n0.01,one\n"),
        "a.csv, line 4, column 2: \"one\" is not a finite number"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0.01\n"),
        "a.csv, line 3: 1 fields, expected 2"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0.01,1\n0.02,1\n0.05,1\n0.06,1\n"),
        "a.csv, line 5: uneven time stamps: a step of 0.03 s, expected 0.01 s"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0,1\n0,1\n"),
        "a.csv, line 3: uneven time stamps: a step of 0 s, expected 0 s"
    );
    assert_eq!(
        say("a_g\n1\n2\n"),
        format!("a.csv, line 1: dt is missing: no column of time; expected {columns}")
    );
    assert_eq!(
        say("t_s,acc\n0,1\n"),
        format!("a.csv, line 1: unknown column `acc` (column 2); expected {columns}")
    );
    assert_eq!(
        say("time [s],accelration [g]\n0,1\n"),
        format!(
            "a.csv, line 1: unknown column `accelration` (column 2); \
             did you mean `acceleration`? Expected {columns}"
        )
    );
    assert_eq!(
        say("time [s],displacement [in]\n0,1\n"),
        "a.csv, line 1: unknown column `displacement` (column 2); \
         a file with it is a reference (--reference)"
    );
    assert_eq!(
        say("time [s],acceleration [V]\n0,1\n"),
        "a.csv, line 1, column 2 (`acceleration`): \
         unit \"V\" (kg m^2 s^-3 A^-1) does not fit \"m/s^2\" (m s^-2)"
    );
    assert_eq!(
        say("time [s],acceleration\n0,1\n"),
        "a.csv, line 1: column `acceleration` has no unit; \
         expected for example `acceleration [m/s^2]`"
    );
    assert_eq!(
        say("0,1\n0.01,2\n"),
        format!("a.csv, line 1: numbers where a header should be; expected {columns}")
    );
    assert_eq!(
        say("t_s,t_s\n0,1\n"),
        "a.csv, line 1: column `time` stands there twice"
    );
    assert_eq!(
        say("# npts=40\nt_s,a_g\n0,1\n0.01,1\n"),
        "a.csv: truncated: 2 of 40 points, 38 missing"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0.01,1\n"),
        "a.csv: only 2 points, a record needs 16 or more"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\0\n"),
        "a.csv: holds binary data, text was expected"
    );
}

#[test]
fn a_missing_file_is_named() {
    let error = read_record(Path::new("nowhere/a.AT2"))
        .unwrap_err()
        .to_string();
    assert_eq!(error, "nowhere/a.AT2: no such file");
    let error = read_record(Path::new(env!("CARGO_MANIFEST_DIR")))
        .unwrap_err()
        .to_string();
    assert!(error.contains("directory"), "{error}");
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
        "still: nothing moves: the acceleration is zero throughout"
    );
    let short = record("short.csv", &burst(100, 0.01)).unwrap();
    assert_eq!(
        process(&short, &Options::default())
            .unwrap_err()
            .to_string(),
        "short: the record lasts 0.990 s, shorter than its two tapers of 2 s"
    );
}

fn sine_reference(dt: f64, points: usize, inches: f64) -> String {
    let mut text =
        String::from("time [s],displacement [in],velocity [in/s],acceleration [in/s^2]\n");
    for n in 0..points {
        let t = n as f64 * dt;
        let (s, c) = (3.0 * t).sin_cos();
        text.push_str(&format!(
            "{t:.4},{:.9},{:.9},{:.9}\n",
            inches * s,
            3.0 * inches * c,
            -9.0 * inches * s
        ));
    }
    text
}

#[test]
fn a_reference_is_used_to_the_letter() {
    let motion = reference(&sine_reference(0.002, 1000, 1.4), &Options::default()).unwrap();
    assert_eq!((motion.len(), motion.dt), (1000, 0.002));
    for n in [0, 17, 999] {
        let t = n as f64 * 0.002;
        assert!((motion.displacement[n] - 1.4 * INCH * (3.0 * t).sin()).abs() < 1e-10);
        assert!((motion.velocity[n] - 4.2 * INCH * (3.0 * t).cos()).abs() < 1e-10);
    }
    assert_eq!(motion.notes.len(), 1, "{:?}", motion.notes);
    let finer = reference(&sine_reference(0.001, 2000, 1.4), &Options::default()).unwrap();
    assert_eq!(finer.len(), 1000);
    assert!((finer.displacement[17] - motion.displacement[17]).abs() < 1e-12);
}

#[test]
fn a_reference_that_contradicts_itself_is_noted() {
    let text = sine_reference(0.002, 1000, 1.4).replace("velocity [in/s]", "velocity [mm/s]");
    let motion = reference(&text, &Options::default()).unwrap();
    assert!(motion.notes[1].starts_with("note: velocity from the slope of displacement differs"));
}

#[test]
fn faults_of_references_are_named() {
    let four = "`time [s],displacement [in],velocity [in/s],acceleration [g]` (any units)";
    assert_eq!(
        reference_message("time [s],displacement [in],acceleration [g]\n0,0,0\n0.002,0,0\n"),
        format!("reference.csv, line 1: no column `velocity`; expected {four}")
    );
    assert_eq!(
        reference_message(&sine_reference(0.005, 100, 1.0)),
        "reference.csv: sampled at 0.005 s; the controllers need 0.002 s \
         (or a whole fraction of it)"
    );
    assert_eq!(
        reference_message(&sine_reference(0.002, 1000, 1.707)),
        "reference: the peak displacement 1.707 in exceeds the stroke of 1.5 in by 0.207 in; \
         a scale of at most 0.8787 fits (--scale 0.8787)"
    );
    let scaling = Some(Scaling::Factor(0.8787));
    let options = Options {
        scaling,
        ..Options::default()
    };
    let fits = reference(&sine_reference(0.002, 1000, 1.707), &options).unwrap();
    assert!(fits.peak_displacement() < 1.5 * INCH);
}

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

proptest::proptest! {
    /// Any text in a file: a record or an error, never a panic.
    #[test]
    fn no_text_breaks_the_readers(text in "(t_s,a_g|time \\[s\\]|NPTS= |DT= |[-0-9., \n#=abc]){0,60}") {
        let path = Path::new("a");
        let _ = super::at2::parse(path, &text);
        for kind in [super::csv_file::Kind::Record, super::csv_file::Kind::Reference] {
            let _ = super::csv_file::CsvFile::parse(path, &text, kind).map(|file| file.sample_time());
        }
    }
}
