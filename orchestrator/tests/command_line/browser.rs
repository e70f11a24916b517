//! The pages in a real browser: `tests/browser/` drives a headless Chromium. Without one the tests are
//! ignored, unless `SHAKEBENCH_REQUIRE_BROWSER` is set, as `.ci/run` does.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::{shakebench, stderr};

/// What a script says.
fn script(name: &str, arguments: &[&str]) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/browser");
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let output = Command::new(&python)
        .arg(folder.join(name))
        .args(arguments)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap_or_else(|error| panic!("{python}: {error}"));
    let said = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.status.success(), "{name}:\n{said}");
    println!("{said}");
    said
}

fn done(folder: &Path, arguments: &[&str], code: i32) {
    let output = shakebench(folder, arguments);
    assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
}

/// The shared folder's first case with its nominal model.
fn case() -> PathBuf {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let shared = std::env::var_os("SHAKEBENCH_SHARED").map_or(beside, PathBuf::from);
    let cases = std::fs::read_dir(shared.join("hidden-effects/cases")).unwrap();
    let mut cases: Vec<PathBuf> = cases.flatten().map(|entry| entry.path()).collect();
    cases.retain(|case| case.join("nominal.toml").is_file());
    cases.sort();
    cases.swap_remove(0)
}

/// Opens the pages and looks at what they draw.
fn look_at(pages: &[PathBuf]) {
    let pages: Vec<String> = pages
        .iter()
        .map(|page| page.display().to_string())
        .collect();
    let mut arguments: Vec<&str> = pages.iter().map(String::as_str).collect();
    // To look at them: SHAKEBENCH_PICTURES=FOLDER.
    let pictures = std::env::var("SHAKEBENCH_PICTURES").ok();
    // axe-core, which `.ci/run` takes from a package that carries it.
    let axe = std::env::var("SHAKEBENCH_AXE").ok();
    match &axe {
        Some(axe) => drop(arguments.splice(0..0, ["--axe", axe])),
        None => println!("SKIPPED: accessibility; SHAKEBENCH_AXE names no axe.min.js"),
    }
    if let Some(pictures) = &pictures {
        arguments.splice(0..0, ["--pictures", pictures]);
    }
    script("pages.py", &arguments);
    for page in &pages {
        let bytes = std::fs::metadata(page).unwrap().len();
        assert!(bytes < 3_000_000, "{page}: {bytes} bytes");
    }
}

/// A mass on a hardening spring, recorded at 250 Hz, with what is believed of it; the description's file.
fn described(folder: &Path) -> PathBuf {
    use std::fmt::Write;
    let mut record = String::from("time,force,displacement\n");
    let (mut y, mut v) = (0.0_f64, 0.0_f64);
    for k in 0..40_000 {
        let t = f64::from(k) * 2.5e-4;
        let lines = (0..20).map(|i| 0.3 + 0.31 * f64::from(i));
        let force: f64 = lines.map(|f| 2.0 * (6.0 * f * t + f * f).sin()).sum();
        if k % 16 == 0 {
            // Rounded as a converter does.
            let shown = (1e3 * y / 0.002).round() * 0.002;
            writeln!(record, "{t},{force},{shown}").unwrap();
        }
        v += 2.5e-4 * (force - 40.0 * v - 5600.0 * y - 3e7 * y.powi(3)) / 8.0;
        y += 2.5e-4 * v;
    }
    std::fs::write(folder.join("record.csv"), record).unwrap();
    let description = r#"
        name = "mass on a spring"
        kind = "oscillator"
        data = ["record.csv"]
        left_out.second_half = true
        [columns]
        time = { column = "time", unit = "s" }
        force = { column = "force", unit = "N" }
        displacement = { column = "displacement", unit = "mm" }
        [nominal]
        mass = { value = 8.0, plus_minus = 0.2, unit = "kg" }
        damping = { value = 36.0, plus_minus = 8.0, unit = "N s/m" }
        stiffness = { value = 5500.0, plus_minus = 300.0, unit = "N/m" }
    "#;
    std::fs::write(folder.join("rig.toml"), description).unwrap();
    folder.join("rig.toml")
}

#[needs::browser]
#[test]
fn pages_are_drawn_whole_and_tell_the_figures_of_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rig = ["--plant", "servohydraulic", "--specimen", "yielding"];
    let run = |system, rest: &[&str], code| {
        let all = [&["run", system, "--duration", "9 s"], &rig[..], rest].concat();
        done(folder, &all, code);
    };
    run("mpc", &["--out", "mpc"], 0);
    let lost = ["--set", "table.supply_loss_time=6 s", "--units", "si"];
    run(
        "three-variable",
        &[&lost[..], &["--out", "lost"]].concat(),
        1,
    );
    done(folder, &["compare", "mpc", "lost", "--out", "runs"], 0);
    done(folder, &["design", "--out", "design"], 0);
    done(
        folder,
        &["design", "--figures", "3-7,5-5", "--out", "figures"],
        0,
    );
    let study = "[study]\nruns = 24\ncross = [\"controller\"]\n\
        [fixed]\nspecimen = \"yielding\"\nplant = \"servohydraulic\"\nduration = \"8 s\"\n\
        [factors]\ncontroller = [\"three-variable\", \"mpc\"]\nseed = [1, 2, 3]\n\
        scale = { uniform = [0.1, 0.5] }\n[limits]\n\"specimen.drift\" = \"0.3 in\"\n";
    std::fs::write(folder.join("study.toml"), study).unwrap();
    done(folder, &["campaign", "study.toml", "--out", "study"], 0);
    let oscillator = described(folder).display().to_string();
    done(folder, &["diagnose", &oscillator, "--out", "rig"], 0);
    let iterate = ["iterate", "three-variable", "--iterations", "1"];
    let brief = ["--out", "iterate"];
    done(folder, &[&iterate[..], &rig, &brief].concat(), 0);
    let qualify = ["qualify", "ac156", "--set", "s_ds=0.3", "--set", "z_h=0"];
    let motion = ["--motion-only", "--out", "qualify"];
    done(folder, &[&qualify[..], &motion].concat(), 0);
    look_at(
        &[
            "mpc", "lost", "runs", "design", "figures", "rig", "study", "iterate", "qualify",
        ]
        .map(|name| folder.join(name).join("report.html")),
    );
}

#[needs::shared("hidden-effects/cases")]
#[needs::browser]
#[test]
fn pages_of_a_practice_case_are_drawn_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let case = case();
    let data = case.join("identification.csv").display().to_string();
    done(folder, &["identify", &data, "--out", "model.toml"], 0);
    let case = case.display().to_string();
    done(folder, &["diagnose", &case, "--out", "diagnosis"], 0);
    look_at(&[
        folder.join("model.html"),
        folder.join("diagnosis/report.html"),
    ]);
}

#[needs::browser]
#[test]
fn a_run_is_watched_until_its_end() {
    let said = watched("watch it at ", &[], &[]);
    assert!(!said.contains("changed"), "{said}");
}

#[needs::browser]
#[test]
fn a_gain_is_changed_on_the_page_of_a_run() {
    let gain = "control.proportional_gain";
    let bounds = format!("{gain}=2 V/in..40 V/in");
    let tune = ["--tune", "all", "--tune", &bounds];
    let said = watched("tune it at ", &tune, &["--tune", gain, "12"]);
    assert!(said.contains(&format!("s: {gain} from")), "{said}");
    assert!(said.contains("to 12 V/in"), "{said}");
}

/// What the browser says of a run's page at the address behind `words`.
fn watched(words: &str, more: &[&str], wish: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "run",
        "three-variable",
        "--plant",
        "servohydraulic",
        "--specimen",
        "yielding",
        "--duration",
        "8 s",
        "--watch",
        "--out",
        "out",
    ];
    let mut run = Command::new(env!("CARGO_BIN_EXE_shakebench"))
        .args(arguments)
        .args(more)
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Kept until the end: the program writes there.
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines();
    let url = lines
        .by_ref()
        .map_while(Result::ok)
        .find_map(|line| Some(line.strip_prefix(words)?.to_string()))
        .unwrap();
    assert!(url.starts_with("http://127.0.0.1:"), "{url}");
    let axe = std::env::var("SHAKEBENCH_AXE").ok();
    let picture = std::env::var("SHAKEBENCH_PICTURES").ok();
    let picture = picture.map(|folder| format!("{folder}/live{}.png", wish.len()));
    let mut arguments = [wish, &[url.as_str()]].concat();
    arguments.extend(picture.as_deref());
    if let Some(axe) = &axe {
        arguments.splice(0..0, ["--axe", axe]);
    }
    let said = script("live.py", &arguments);
    assert!(run.wait().unwrap().success());
    assert!(folder.path().join("out/report.html").is_file());
    assert!(
        said.contains("'running'") && said.contains("complete"),
        "{said}"
    );
    said
}
