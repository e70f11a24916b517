//! Motions at fault.

use std::fs;

use crate::refused;

#[track_caller]
fn record(name: &str, content: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), content).unwrap();
    refused(folder.path(), &["run", "--record", name], words);
}

/// A PEER file of `written` points that announces `announced`.
fn at2(announced: usize, written: usize) -> String {
    let mut text =
        format!("PEER\nEVENT\nACCELERATION IN UNITS OF G\nNPTS= {announced}, DT= .02 SEC\n");
    (0..written).for_each(|k| text += &format!(" {:.4E}", 0.1 * (0.3 * k as f64).sin()));
    text + "\n"
}

#[test]
fn a_missing_record() {
    let folder = tempfile::tempdir().unwrap();
    refused(
        folder.path(),
        &["run", "--record", "none.AT2"],
        &["none.AT2", "no such file"],
    );
}

#[test]
fn an_empty_record() {
    record("empty.csv", "", &["empty.csv", "empty"]);
}

#[test]
fn a_truncated_record() {
    record(
        "cut.AT2",
        &at2(500, 321),
        &["cut.AT2", "truncated", "321 of 500"],
    );
}

#[test]
fn a_record_that_is_not_numeric() {
    let text = "t_s,a_g\n0.00,0.01\n0.01,oops\n0.02,0.01\n";
    record("words.csv", text, &["words.csv", "line 3", "oops"]);
}

#[test]
fn a_record_without_time_step() {
    let text = at2(10, 10).replace("DT= .02 SEC", "");
    record("nodt.AT2", &text, &["nodt.AT2", "line 4", "DT"]);
}

#[test]
fn a_unit_that_does_not_fit() {
    let text = "time [s],acceleration [in]\n0.00,0.01\n0.01,0.02\n0.02,0.01\n";
    record("units.csv", text, &["units.csv", "acceleration", "in"]);
}

#[test]
fn a_motion_beyond_the_stroke_says_by_how_much_and_what_would_fit() {
    let folder = tempfile::tempdir().unwrap();
    let words = [
        "exceeds the stroke of 1.5 in by 0.5 in",
        "a scale of at most",
        "--scale",
    ];
    refused(folder.path(), &["run", "--peak", "2 in"], &words);
}

#[test]
fn options_without_a_number() {
    let folder = tempfile::tempdir().unwrap();
    for (option, value, words) in [
        ("--pga", "strong", "strong"),
        ("--peak", "1 s", "does not fit"),
        (
            "--step",
            "3 ms",
            "does not divide the sample time of the motion",
        ),
        ("--duration", "-1 s", "not positive"),
    ] {
        let option_equals = format!("{option}={value}");
        refused(folder.path(), &["run", &option_equals], &[option, words]);
    }
}
