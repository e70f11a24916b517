//! Parameters that are changed during a run, by the page of `--watch`.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::{shakebench, stderr};

const GAIN: &str = "control.proportional_gain";

/// A run that is watched, with its addresses for watching and for tuning.
fn begin(folder: &Path, tune: &str, more: &[&str]) -> (Child, impl BufRead, [String; 2]) {
    let mut run = Command::new(env!("CARGO_BIN_EXE_shakebench"))
        .args(["run", "three-variable", "--duration", "4 s", "--watch"])
        .args(["--tune", tune, "--out", "tuned"])
        .args(more)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap());
    let urls = ["watch it at ", "tune it at "].map(|words| {
        let mut line = String::new();
        while !line.starts_with(words) {
            line.clear();
            assert!(lines.read_line(&mut line).unwrap() > 0, "no `{words}`");
        }
        line[words.len()..].trim().to_string()
    });
    (run, lines, urls)
}

/// What the server answers to a wish.
fn ask(url: &str, variable: &str, value: f64) -> String {
    let (host, path) = url["http://".len()..].split_once('/').unwrap();
    let body = format!("{{\"variable\": \"{variable}\", \"value\": {value}}}");
    let mut stream = TcpStream::connect(host).unwrap();
    let length = body.len();
    write!(
        stream,
        "POST /{path}tune HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n{body}"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// A column of `results.csv`.
fn column(folder: &Path, name: &str) -> Option<Vec<f64>> {
    let text = fs::read_to_string(folder.join("results.csv")).unwrap();
    let mut lines = text.lines();
    let place = lines.next()?.split(',').position(|own| own == name)?;
    let cells = lines.map(|line| line.split(',').nth(place).unwrap());
    Some(cells.map(|cell| cell.parse().unwrap()).collect())
}

#[test]
fn a_parameter_changed_during_a_run_is_recorded_and_repeated_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (mut run, mut lines, [watching, tuning]) = begin(folder, GAIN, &[]);
    let start = 6.15 / 0.0254;
    assert!(ask(&watching, GAIN, 200.0).starts_with("HTTP/1.1 403"));
    let refused = ask(&tuning, GAIN, 2.01 * start);
    assert!(
        refused.starts_with("HTTP/1.1 409") && refused.contains("expected 3.075 to 12.30 V/in"),
        "{refused}"
    );
    let other = ask(&tuning, "control.integral_gain", 1.0);
    assert!(other.starts_with("HTTP/1.1 409"), "{other}");
    assert!(ask(&tuning, GAIN, 1.5 * start).starts_with("HTTP/1.1 200"));
    let mut said = String::new();
    lines.read_to_string(&mut said).unwrap();
    assert!(run.wait().unwrap().success(), "{said}");

    let tuned = folder.join("tuned");
    let manifest = json(&tuned.join("manifest.json"));
    let changes = manifest["changes"].as_array().unwrap();
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert_eq!(changes[0]["variable"], GAIN);
    assert_eq!(changes[0], json(&tuned.join("summary.json"))["changes"][0]);
    let begun = changes[0]["sample"].as_u64().unwrap() as usize;
    // Bumpless: 500 equal steps of 1 s.
    let gain = column(&tuned, GAIN).unwrap();
    for (sample, gain) in gain.iter().enumerate() {
        let share = (sample.saturating_sub(begun) as f64 / 500.0).min(1.0);
        let expected = start * (1.0 + 0.5 * share);
        assert!((gain / expected - 1.0).abs() < 1e-12, "{sample}: {gain}");
    }
    assert!(begun + 500 < gain.len(), "{begun}");

    // The run without the change is another one from that sample on.
    let plain = [
        "run",
        "three-variable",
        "--duration",
        "4 s",
        "--out",
        "plain",
    ];
    let output = shakebench(folder, &plain);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let command = "control.valve_command";
    let both = [&tuned, &folder.join("plain")].map(|place| column(place, command).unwrap());
    let differ = both[0]
        .iter()
        .zip(&both[1])
        .position(|(one, other)| one != other);
    assert_eq!(differ, Some(begun + 1));
    assert_eq!(column(&folder.join("plain"), GAIN), None);

    let again = ["run", "--manifest", "tuned/manifest.json", "--out", "again"];
    let output = shakebench(folder, &again);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let [one, other] =
        [&tuned, &folder.join("again")].map(|place| fs::read(place.join("results.csv")).unwrap());
    assert!(one == other);
    // Without the change it is not the same run.
    let path = tuned.join("manifest.json");
    let mut without = manifest.clone();
    without.as_object_mut().unwrap().remove("changes");
    fs::write(&path, without.to_string()).unwrap();
    let output = shakebench(
        folder,
        &["run", "--manifest", "tuned/manifest.json", "--out", "none"],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
}

#[test]
fn a_run_with_a_change_continues_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let checkpoints = ["--checkpoint-every", "0.2 s"];
    let (mut run, _lines, [_, tuning]) = begin(folder, GAIN, &checkpoints);
    assert!(ask(&tuning, GAIN, 400.0).starts_with("HTTP/1.1 200"));
    // Within the change, which takes 1 s.
    std::thread::sleep(std::time::Duration::from_millis(500));
    let interrupted = Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status();
    assert!(interrupted.unwrap().success());
    assert_eq!(run.wait().unwrap().code(), Some(1));
    let output = shakebench(folder, &["run", "--resume", "tuned"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let changes = &json(&folder.join("tuned/manifest.json"))["changes"];
    assert_eq!(changes.as_array().unwrap().len(), 1);
    let again = ["run", "--manifest", "tuned/manifest.json", "--out", "again"];
    let output = shakebench(folder, &again);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let [one, other] = ["tuned", "again"].map(|name| column(&folder.join(name), GAIN).unwrap());
    assert!(one == other && one.last() == Some(&400.0));
}

#[test]
fn what_cannot_be_tuned_is_refused_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let refuse = |tune: &str, words: &str| {
        let rest = [
            "run",
            "three-variable",
            "--duration",
            "1 s",
            "--watch",
            "--tune",
            tune,
        ];
        let output = shakebench(folder.path(), &rest);
        assert_eq!(output.status.code(), Some(2), "{tune}");
        let said = stderr(&output);
        assert!(
            said.contains("--tune") && said.contains(words),
            "{tune}: {said}"
        );
    };
    refuse(
        "control.valve_limit",
        "`control.valve_limit` is not a tunable parameter",
    );
    refuse("control.proportional_gian", "`control.proportional_gain`");
    refuse("table.table_mass", "not a tunable parameter");
    refuse("control.acceleration_feedforward_gain", "LOW..HIGH");
    refuse("control.proportional_gain=2..8", "has no unit");
    refuse("control.proportional_gain=7 V/in..8 V/in", "outside of");
    refuse(
        "control.proportional_gain=8 V/in..2 V/in",
        "holds no values",
    );
    refuse(
        "control.proportional_gain=2 kg..8 kg",
        "expected control.proportional_gain=",
    );
    refuse("control.proportional_gain=2 V/in", "is not a range");
    let output = shakebench(folder.path(), &["run", "--tune", "all"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--watch"));
}
