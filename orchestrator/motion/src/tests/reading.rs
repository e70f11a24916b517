//! Files are read as they are meant, and every fault is named with its place.

use super::*;
use recordings::Text;

#[needs::shared("records")]
#[test]
fn shared_records_have_the_peaks_of_their_table() {
    let folder = shared_records();
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
    let filtered = top.replace("OF G", "OF G. FILTER POINTS: HP=0.1 Hz LP=46.0 Hz");
    let found = record("a.AT2", &format!("{filtered}20 .01 NPTS, DT\n{numbers}")).unwrap();
    assert_eq!(found.acceleration[1], -0.002 * STANDARD_GRAVITY);
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
        "a.csv, line 4, column 2 (`a_g`): \"one\" is not a finite number; expected one in every cell"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0.01\n"),
        "a.csv, line 3: 1 cells; expected 2, as in the header"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0.01,1\n0.02,1\n0.05,1\n0.06,1\n"),
        "a.csv, line 5: uneven time stamps: a step of 0.03 s, expected 0.01 s"
    );
    assert_eq!(
        say("t_s,a_g\n0,1\n0,1\n0,1\n"),
        "a.csv, line 3: the time does not grow: a step of 0 s; expected rising, even time stamps"
    );
    assert_eq!(
        say("t_s,a_g\n0.02,1\n0.01,1\n0,1\n"),
        "a.csv, line 3: the time does not grow: a step of -0.01 s; expected rising, even time \
         stamps"
    );
    assert_eq!(
        say("a_g\n1\n2\n"),
        format!("a.csv, line 1: dt is missing: no column of time; expected {columns}")
    );
    assert_eq!(
        say("t_s,heave\n0,1\n"),
        format!("a.csv, line 1: unknown column `heave` (column 2); expected {columns}")
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
        format!("a.csv, line 1: numbers instead of a header; expected {columns}")
    );
    assert_eq!(
        say("t_s,t_s\n0,1\n"),
        "a.csv, line 1: column `time` occurs twice; rename or delete one"
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
    assert!(error.contains("it is a folder; expected a file"), "{error}");
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
    // The scale that fits is that of the file, whatever scale was asked for.
    let twice = Options {
        scaling: Some(Scaling::Factor(2.0)),
        ..options
    };
    let error = reference(&sine_reference(0.002, 1000, 1.707), &twice).unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("3.414 in exceeds") && told.ends_with("(--scale 0.8787)"),
        "{told}"
    );
}

proptest::proptest! {
    /// Any text in a file: a record or an error, never a panic.
    #[test]
    fn no_text_breaks_the_readers(text in "(t_s,a_g|time \\[s\\]|NPTS= |DT= |[-0-9., \n#=abc]){0,60}") {
        let path = Path::new("a");
        let _ = crate::at2::parse(path, &text);
        for kind in [crate::csv_file::Kind::Record, crate::csv_file::Kind::Reference] {
            let text = Text { text: text.clone(), note: None };
            let _ = crate::csv_file::CsvFile::parse(path, text, kind).map(|file| file.sample_time());
        }
    }
}
