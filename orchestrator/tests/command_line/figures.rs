//! Random runs: headline, cards, table and JSON agree with what `results.csv` gives.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{shakebench, stderr, stdout};

const RUNS: u64 = 8;
const INCH: f64 = 0.0254;
const GRAVITY: f64 = 9.80665;

/// Peaks of reference and table, the largest error, and the RMS error over the reference's peak (%).
fn computed(results: &Path, signal: &str) -> [f64; 4] {
    let mut csv = csv::Reader::from_path(results).unwrap();
    let rows: Vec<BTreeMap<String, f64>> = csv.deserialize().map(Result::unwrap).collect();
    let of = |component: &str| -> Vec<f64> {
        let name = format!("{component}.{signal}");
        rows.iter().map(|row| row[&name]).collect()
    };
    let peak = |values: &[f64]| values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let (wanted, table) = (of("reference"), of("table"));
    let errors: Vec<f64> = table.iter().zip(&wanted).map(|(a, b)| a - b).collect();
    let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    let size = peak(&wanted);
    [
        size,
        peak(&table),
        peak(&errors),
        100.0 * square.sqrt() / size,
    ]
}

/// The first numbers of the cells of a printed line that begins with `label`.
fn printed(text: &str, label: &str) -> Vec<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(label));
    let cells = line.unwrap_or_else(|| panic!("no `{label}` in: {text}"));
    let words = cells.split_whitespace();
    words.filter_map(|word| word.parse().ok()).collect()
}

/// The number that follows `before` in a page.
fn shown(page: &str, before: &str) -> Option<f64> {
    let rest = page.split_once(before)?.1;
    let number: String = rest
        .chars()
        .take_while(|c| c.is_ascii_digit() || ".e-".contains(*c))
        .collect();
    number.parse().ok()
}

/// `said` has at least `digits` digits of `truth`.
#[track_caller]
fn close(what: &str, said: f64, truth: f64, digits: i32) {
    let room = 0.51 * 10_f64.powi(1 - digits) * truth.abs();
    assert!((said - truth).abs() <= room, "{what}: {said}, {truth}");
}

fn checked(folder: &Path, text: &str) {
    let results = folder.join("results.csv");
    let [wanted_x, table_x, largest_x, error_x] = computed(&results, "displacement");
    let [wanted_a, table_a, largest_a, error_a] = computed(&results, "acceleration");
    let summary = fs::read_to_string(folder.join("summary.json")).unwrap();
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let card = |name: &str| format!("<dt>{name}</dt><dd>");
    let inches = "<span class=\"laboratory\">";
    let peak_x = shown(&page, &(card("Peak displacement") + inches)).unwrap();
    let peak_a = shown(&page, &card("Peak acceleration")).unwrap();
    close("card of the peak displacement", peak_x, table_x / INCH, 3);
    close(
        "card of the peak acceleration",
        peak_a,
        table_a / GRAVITY,
        3,
    );
    let tracking = &json["tracking"];
    if json["ended"] != "complete" {
        assert!(tracking.is_null(), "{tracking}");
        assert!(shown(&page, &card("Acceleration error")).is_none());
        assert!(page.contains("It has no tracking error.") && !text.contains("RMS"));
        return;
    }
    for (name, truth) in [
        ("time_domain_percent", error_a),
        ("displacement_percent", error_x),
        ("peak_displacement_m", table_x),
        ("peak_displacement_error_m", largest_x),
        ("peak_acceleration_m_s2", table_a),
        ("peak_acceleration_error_m_s2", largest_a),
    ] {
        close(name, tracking[name].as_f64().unwrap(), truth, 10);
    }
    for (label, unit, truths) in [
        ("displacement, peak", INCH, [wanted_x, table_x, largest_x]),
        (
            "acceleration, peak",
            GRAVITY,
            [wanted_a, table_a, largest_a],
        ),
    ] {
        let cells = printed(text, label);
        assert_eq!(cells.len(), 3, "{cells:?}");
        for (cell, truth) in cells.into_iter().zip(truths) {
            close(label, cell, truth / unit, 4);
        }
    }
    for (label, truth) in [
        ("normalised RMS acceleration error", error_a),
        ("normalised RMS displacement error", error_x),
    ] {
        close(label, printed(text, label)[0], truth, 4);
    }
    let headline = shown(&page, "a normalised RMS acceleration error of ").unwrap();
    close("headline", headline, error_a, 2);
    let own = shown(&page, &card("Acceleration error")).unwrap();
    close("card of the error", own, error_a, 3);
}

#[test]
fn headline_cards_table_and_json_agree_with_the_results() {
    let seed: u64 = 20_261_124;
    println!("seed {seed}");
    let dice = &mut ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().unwrap();
    for run in 0..RUNS {
        let controllers = ["displacement-pid", "three-variable", "mpc", "preview"];
        let controller = controllers[dice.random_range(0..controllers.len())];
        let duration = format!("{:.3} s", dice.random_range(0.4..9.0));
        let out = format!("run-{run}");
        let mut arguments = vec!["run", controller, "--duration", &duration, "--out", &out];
        let stops = run % 4 == 3;
        let limit = format!(
            "interlock.displacement_limit={:.3} in",
            dice.random_range(0.02..0.2)
        );
        if stops || dice.random_bool(0.5) {
            arguments.extend(["--plant", "servohydraulic", "--specimen", "none"]);
        }
        if stops {
            arguments.extend(["--set", &limit]);
        }
        println!("{arguments:?}");
        let output = shakebench(folder.path(), &arguments);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 1)), "{}", stderr(&output));
        checked(&folder.path().join(&out), &stdout(&output));
    }
}
