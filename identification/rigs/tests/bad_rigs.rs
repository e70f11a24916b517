//! Descriptions, data and models of rigs that cannot be used: each is refused by file and place, with
//! what was expected.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::fmt::Write;
use std::path::Path;

use diagnosis::Observer;
use recordings::Channel;
use rigs::kinds::{Description, ExtendedRig, diagnose, renamed};

const FORCE: Channel = Channel::Other {
    name: "force",
    unit: "N",
};

const RIG: &str = r#"name = "Isolator"
kind = "oscillator"
data = ["record.csv"]
columns.time = { column = "Time (s)", unit = "s" }
columns.force = { column = "Load (kN)", unit = "kN" }
columns.displacement = { column = "Stroke (mm)", unit = "mm" }
nominal.mass = { value = 10.0, plus_minus = 0.5, unit = "kg" }
nominal.damping = { value = 20.0, plus_minus = 10.0, unit = "N s/m" }
nominal.stiffness = { value = 12.0, plus_minus = 2.0, unit = "kN/m" }
left_out = { second_half = true }
"#;

const MODEL: &str = r#"name = "Isolator"
kind = "oscillator"
[columns]
time = { column = "Time (s)", unit = "s" }
force = { column = "Load (kN)", unit = "kN" }
displacement = { column = "Stroke (mm)", unit = "mm" }
[described]
mass = { value = 10.0, unit = "kg" }
damping = { value = 20.0, unit = "N s/m" }
stiffness = { value = 12.0, unit = "kN/m" }
[refitted]
mass = { value = 10.0, unit = "kg" }
damping = { value = 20.0, unit = "N s/m" }
stiffness = { value = 12.0, unit = "kN/m" }
[nominal]
mass = { value = 10.0, unit = "kg" }
damping = { value = 20.0, unit = "N s/m" }
stiffness = { value = 12.0, unit = "kN/m" }
[effects.cubic_stiffness]
stiffness = { value = 5e6, unit = "N/m3" }
[session]
zero = { value = 0.0, unit = "mm" }
"#;

fn record() -> String {
    let mut text = String::from("Time (s),Load (kN),Stroke (mm)\n");
    for k in 0..400 {
        let t = 0.01 * f64::from(k);
        let phase = 9.0 * t + 0.4 * t * t;
        writeln!(
            text,
            "{t:.2},{:.6},{:.6}",
            0.1 * phase.sin(),
            8.0 * (phase - 0.3).sin()
        )
        .unwrap();
    }
    text
}

/// Puts `by` in the place of `what`, which must be there.
fn with(text: &str, what: &str, by: &str) -> String {
    assert!(text.contains(what), "{what}");
    text.replacen(what, by, 1)
}

/// Line `line` of the record, counted from one, in another form.
fn with_line(line: usize, by: &str) -> String {
    let text = record();
    let lines = text.lines().enumerate();
    let lines = lines.map(|(i, old)| if i + 1 == line { by } else { old });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

/// The record with `word` for the force in `count` lines from `line` on.
fn with_empty(line: usize, count: usize, word: &str) -> String {
    let text = record();
    let lines = text.lines().enumerate().map(|(i, old)| {
        let cells: Vec<&str> = old.split(',').collect();
        match (line..line + count).contains(&(i + 1)) {
            true => format!("{},{word},{}\n", cells[0], cells[2]),
            false => format!("{old}\n"),
        }
    });
    lines.collect()
}

/// What the description and its data are refused with.
fn refused(folder: &Path, rig: &str, data: &[u8]) -> Option<String> {
    let path = folder.join("rig.toml");
    std::fs::write(&path, rig).unwrap();
    std::fs::write(folder.join("record.csv"), data).unwrap();
    let read = Description::read(&path).and_then(|description| {
        let measurement = description.measurement(&[])?;
        diagnose(&description, &measurement, Observer::none())
    });
    read.err().map(|error| error.to_string())
}

/// Each with the words by which place and cure are told.
fn tell(all: &[(&str, Option<String>, &[&str])]) {
    let mut wrong = String::new();
    for (case, error, words) in all {
        let said = error.as_deref().unwrap_or("nothing was wrong with it");
        for word in *words {
            if !said.to_lowercase().contains(&word.to_lowercase()) {
                writeln!(wrong, "{case}: `{word}` is not said: {said}").unwrap();
            }
        }
        println!("{case}: {said}\n");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn descriptions_are_refused_by_place_with_a_cure() {
    let folder = tempfile::tempdir().unwrap();
    let data = record();
    let changed =
        |what: &str, by: &str| refused(folder.path(), &with(RIG, what, by), data.as_bytes());
    let missing = folder.path().join("none.toml");
    tell(&[
        (
            "no file",
            Description::read(&missing).err().map(|e| e.to_string()),
            &["none.toml"],
        ),
        (
            "no TOML",
            changed("name = \"Isolator\"", "name : Isolator"),
            &["rig.toml", "line 1"],
        ),
        (
            "unknown key",
            changed("data = [", "files = [\"a.csv\"]\ndata = ["),
            &["rig.toml", "line 3", "files", "expected"],
        ),
        (
            "unknown kind",
            changed("\"oscillator\"", "\"ocsillator\""),
            &["rig.toml", "ocsillator", "expected one of", "oscillator"],
        ),
        (
            "no kind",
            changed("kind = \"oscillator\"\n", ""),
            &["rig.toml", "missing field `kind`"],
        ),
        (
            "no data",
            changed("[\"record.csv\"]", "[]"),
            &["rig.toml", "`data`"],
        ),
        (
            "data that are not there",
            changed("record.csv", "other.csv"),
            &["other.csv"],
        ),
        (
            "data that are a folder",
            changed("\"record.csv\"", "\".\""),
            &["folder"],
        ),
        (
            "no column for an input",
            changed(
                "columns.force = { column = \"Load (kN)\", unit = \"kN\" }\n",
                "",
            ),
            &["rig.toml", "columns.force", "found displacement, time"],
        ),
        (
            "a channel misspelt",
            changed("columns.force", "columns.forse"),
            &["rig.toml", "columns.forse", "did you mean `force`"],
        ),
        (
            "a header that is not in the file",
            changed("Load (kN)", "Force (kN)"),
            &["record.csv", "Force (kN)", "Load (kN)"],
        ),
        (
            "an unknown unit",
            changed("unit = \"kN\" }", "unit = \"kNn\" }"),
            &["rig.toml", "columns.force", "kNn"],
        ),
        (
            "a unit of another quantity",
            changed("unit = \"kN\" }", "unit = \"mm\" }"),
            &["rig.toml", "columns.force", "mm", "N"],
        ),
        (
            "another unit than the header's",
            changed("unit = \"kN\" }", "unit = \"N\" }"),
            &["record.csv", "line 1", "Load (kN)", "its header, kN"],
        ),
        (
            "a column without a unit",
            changed(
                "column = \"Load (kN)\", unit = \"kN\"",
                "column = \"Load (kN)\"",
            ),
            &["rig.toml", "line 5", "unit"],
        ),
        (
            "a parameter that is missing",
            changed(
                "nominal.mass = { value = 10.0, plus_minus = 0.5, unit = \"kg\" }\n",
                "",
            ),
            &["rig.toml", "nominal.mass", "kg", "found damping, stiffness"],
        ),
        (
            "a parameter misspelt",
            changed("nominal.mass", "nominal.mas"),
            &["rig.toml", "nominal.mas", "did you mean `mass`"],
        ),
        (
            "a parameter in a unit of another quantity",
            changed("unit = \"kN/m\"", "unit = \"kN\""),
            &["rig.toml", "nominal.stiffness", "kN"],
        ),
        (
            "a parameter left at nan",
            changed("value = 10.0", "value = nan"),
            &["rig.toml", "nominal.mass", "is not a number"],
        ),
        (
            "a negative uncertainty",
            changed("plus_minus = 0.5", "plus_minus = -0.5"),
            &["rig.toml", "nominal.mass", "uncertainty"],
        ),
        (
            "a parameter as text",
            changed("value = 10.0", "value = \"10.0\""),
            &["rig.toml", "line 7"],
        ),
        (
            "a parameter with an unknown key",
            changed("plus_minus = 0.5", "sigma = 0.5"),
            &["rig.toml", "line 7", "sigma", "plus_minus"],
        ),
        (
            "a mass of zero",
            changed("value = 10.0, plus_minus = 0.5", "value = 0.0"),
            &["rig.toml", "no finite output", "`nominal`"],
        ),
        (
            "nothing left out",
            changed("left_out = { second_half = true }\n", ""),
            &["rig.toml", "missing field `left_out`"],
        ),
        (
            "a half that is not left out",
            changed("second_half = true", "second_half = false"),
            &["rig.toml", "left_out.second_half", "expected true"],
        ),
        (
            "an unknown way of leaving out",
            changed("second_half = true", "first_half = true"),
            &["rig.toml", "line 10", "first_half", "second_half"],
        ),
        (
            "a file left out that is none",
            changed("second_half = true", "files = [\"tuesday.csv\"]"),
            &["rig.toml", "left_out.files", "tuesday.csv"],
        ),
        (
            "everything left out",
            changed("second_half = true", "files = [\"record.csv\"]"),
            &["rig.toml", "left_out", "fewer than"],
        ),
        (
            "a block of no length",
            changed(
                "second_half = true",
                "every_second_block = { value = 2.0, unit = \"m\" }",
            ),
            &["rig.toml", "left_out.every_second_block"],
        ),
        (
            "no time",
            changed(
                "columns.time = { column = \"Time (s)\", unit = \"s\" }\n",
                "",
            ),
            &["rig.toml", "columns.time", "time_step"],
        ),
    ]);
}

#[test]
fn columns_are_called_with_or_without_their_unit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, with(RIG, "\"Load (kN)\"", "\"Load\"")).unwrap();
    std::fs::write(folder.path().join("record.csv"), record()).unwrap();
    let measurement = Description::read(&path).unwrap().measurement(&[]).unwrap();
    let force = measurement.recordings[0].input(FORCE);
    let largest = force.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    assert!((99.0..101.0).contains(&largest), "{largest} N");
}

#[test]
fn data_are_refused_by_line_with_a_cure() {
    let folder = tempfile::tempdir().unwrap();
    let read = |data: &str| refused(folder.path(), RIG, data.as_bytes());
    let header = "Time (s),Load (kN),Stroke (mm)\n";
    let constant: String = (0..400).fold(header.to_owned(), |mut text, k| {
        writeln!(text, "{:.2},{},1.0", 0.01 * f64::from(k), k % 7).unwrap();
        text
    });
    let fixed_step = with(
        RIG,
        "columns.time = { column = \"Time (s)\", unit = \"s\" }",
        "time_step = { value = 0.0, unit = \"s\" }",
    );
    tell(&[
        ("an empty file", read(""), &["record.csv"]),
        ("a header alone", read(header), &["record.csv"]),
        (
            "a word in a cell",
            read(&with_line(50, "0.48,broken,1.0")),
            &["record.csv", "line 50", "broken"],
        ),
        (
            "more empty cells than are bridged",
            read(&with_empty(50, 6, "")),
            &["record.csv", "line 50", "force"],
        ),
        (
            "no numbers",
            read(&with_empty(50, 6, "nan")),
            &["record.csv", "line 50", "force"],
        ),
        (
            "an infinite output",
            read(&with_line(50, "0.48,0.1,inf")),
            &["record.csv", "line 50", "Stroke (mm)"],
        ),
        (
            "a row that is short",
            read(&with_line(50, "0.48")),
            &["record.csv", "line 50"],
        ),
        (
            "a gap in time",
            read(&with_line(50, "0.60,0.1,1.0")),
            &["record.csv", "line", "times", "evenly"],
        ),
        (
            "time that runs back",
            read(&with_line(50, "-3.0,0.1,1.0")),
            &["record.csv", "line"],
        ),
        (
            "few samples",
            read(&record().lines().take(60).collect::<Vec<_>>().join("\n")),
            &["record.csv", "59 samples", "at least 128"],
        ),
        (
            "a column twice",
            read(
                &record()
                    .replace('\n', ",0.0\n")
                    .replacen("0.0", "Load (kN)", 1),
            ),
            &["record.csv", "Load (kN)"],
        ),
        (
            "an output that stands still",
            read(&constant),
            &["record", "displacement", "constant"],
        ),
        (
            "no text",
            refused(
                folder.path(),
                RIG,
                &[0xff, 0xfe, 0x00, 0x9f, 0x92, 0x96, 0x0a, 0x80],
            ),
            &["record.csv"],
        ),
        (
            "a step of no length",
            refused(folder.path(), &fixed_step, record().as_bytes()),
            &["rig.toml", "time_step", "expected"],
        ),
    ]);
}

#[test]
fn models_and_maps_are_refused_by_place_with_a_cure() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("later.csv");
    std::fs::write(&data, record()).unwrap();
    let path = folder.path().join("extended.toml");
    let validated = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let read =
            ExtendedRig::read(&path).and_then(|model| model.validate(std::slice::from_ref(&data)));
        read.err().map(|error| error.to_string())
    };
    assert_eq!(validated(MODEL), None);
    // A description is a model without effects.
    assert_eq!(validated(RIG), None);
    let changed = |what: &str, by: &str| validated(&with(MODEL, what, by));
    let map = folder.path().join("map.toml");
    let mapped = |text: &str| {
        std::fs::write(&map, text).unwrap();
        let description = Description::parse(&path, RIG).unwrap();
        renamed(&description.columns, &map)
            .err()
            .map(|error| error.to_string())
    };
    tell(&[
        (
            "an unknown effect",
            changed("[effects.cubic_stiffness]", "[effects.cubic_stifness]"),
            &[
                "extended.toml",
                "effects.cubic_stifness",
                "did you mean `cubic_stiffness`",
            ],
        ),
        (
            "an effect without its parameter",
            changed("stiffness = { value = 5e6, unit = \"N/m3\" }\n", ""),
            &[
                "extended.toml",
                "effects.cubic_stiffness.stiffness",
                "missing",
                "N/m3",
            ],
        ),
        (
            "an effect with another",
            changed(
                "value = 5e6, unit = \"N/m3\" }",
                "value = 5e6, unit = \"N/m3\" }\ndamping = { value = 1.0, unit = \"1\" }",
            ),
            &[
                "extended.toml",
                "effects.cubic_stiffness.damping",
                "expected stiffness",
            ],
        ),
        (
            "an effect in another unit",
            changed("N/m3", "N/m"),
            &["extended.toml", "effects.cubic_stiffness.stiffness", "N/m3"],
        ),
        (
            "an effect that is infinite",
            changed("5e6", "inf"),
            &[
                "extended.toml",
                "effects.cubic_stiffness.stiffness",
                "finite",
            ],
        ),
        (
            "an unknown session parameter",
            changed("zero =", "nil ="),
            &["extended.toml", "session.nil", "expected zero"],
        ),
        (
            "another kind",
            changed("\"oscillator\"", "\"controlled_damper\""),
            &["extended.toml", "session.zero", "N"],
        ),
        (
            "a header that later files do not have",
            changed("Load (kN)", "Force (kN)"),
            &["later.csv", "Force (kN)", "Load (kN)"],
        ),
        (
            "a map of a channel that is none",
            mapped("forse = \"Load\"\n"),
            &["map.toml", "forse", "displacement, force, time"],
        ),
        (
            "a map that is none",
            mapped("force = 3\n"),
            &["map.toml", "expected \"header\", or { column = \"header\""],
        ),
    ]);
}
