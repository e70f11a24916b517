//! Real OpenSees on both sides: as a client of `serve`, and as a specimen. Skipped, with a word on it,
//! where `openseespy` cannot be had.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bridges::Client;
use bridges::protocol::{Action, Quantities, Sizes};
use serde_json::Value;

use super::{shakebench, stderr, stdout};

/// Folder of the scripts and the environment's requirements.
fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/opensees")
}

/// A Python with OpenSees, if there is one.
pub fn python() -> Option<&'static Path> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let script = scripts().join("environment.py");
        let output = Command::new("python3").arg(script).output();
        let (done, said) = match output {
            Ok(output) => (output.status.success(), (stdout(&output), stderr(&output))),
            Err(error) => (false, (String::new(), error.to_string())),
        };
        let (python, problem) = said;
        if done {
            return Some(PathBuf::from(python.trim()));
        }
        let must = std::env::var_os("SHAKEBENCH_REQUIRE_OPENSEES").is_some();
        assert!(!must, "no OpenSees: {problem}");
        println!("SKIPPED: no OpenSees: {problem}");
        None
    });
    made.as_deref()
}

/// A served system.
struct Service {
    child: Child,
    port: u16,
    /// Address of its live page, where it has one.
    page: Option<String>,
    said: JoinHandle<String>,
}

impl Service {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_shakebench"))
            .args([
                "serve",
                arguments[0],
                "--openfresco",
                "127.0.0.1:0",
                "--json",
            ])
            .args(&arguments[1..])
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stderr.take().unwrap());
        let mut text = String::new();
        let mut page = None;
        let port = loop {
            let mut line = String::new();
            let count = lines.read_line(&mut line).unwrap();
            text += &line;
            assert!(count > 0, "it does not listen: {text}");
            if let Some(url) = line.strip_prefix("watch it at ") {
                page = Some(url.trim().to_string());
            }
            if let Some(rest) = line.strip_prefix("listening at 127.0.0.1:") {
                break rest.split(' ').next().unwrap().parse().unwrap();
            }
        };
        let said = std::thread::spawn(move || {
            let _ = lines.read_to_string(&mut text);
            text
        });
        Self {
            child,
            port,
            page,
            said,
        }
    }

    /// Exit status, summary and what was said.
    fn end(mut self) -> (i32, Value, String) {
        let mut json = String::new();
        let mut stdout = self.child.stdout.take().unwrap();
        stdout.read_to_string(&mut json).unwrap();
        let status = self.child.wait().unwrap().code().unwrap_or(-1);
        let said = self.said.join().unwrap();
        let summary = serde_json::from_str(&json).unwrap_or(Value::Null);
        (status, summary, said)
    }
}

/// A spring of 2.8 kip/in with more in its parameters.
fn element(folder: &Path, more: &str) -> &'static str {
    let text = format!(
        "name = \"element\"\n[components.element]\nfmu = \"RestoringForce\"\n\
         parameters = {{ stiffness = \"2.8 kip/in\"{more} }}\n[experiment]\nstep = \"2 ms\"\n\
         [openfresco]\nunits = \"in,kip\"\ncommand = [\"element.displacement\"]\n\
         force = [\"element.force\"]\nstiffness = [2.8]\n"
    );
    fs::write(folder.join("element.toml"), text).unwrap();
    "element.toml"
}

/// The model with one of its springs at `port`, beside the model alone.
fn remote(port: u16, arguments: &[&str]) -> (bool, Value) {
    let output = Command::new(python().unwrap())
        .arg(scripts().join("remote_element.py"))
        .arg(port.to_string())
        .args(arguments)
        .output()
        .unwrap();
    let said = stdout(&output);
    let line = said.lines().find(|line| line.starts_with('{'));
    let found = line.and_then(|line| serde_json::from_str(line).ok());
    (output.status.success(), found.unwrap_or(Value::Null))
}

/// A page's answer to a request for its rows.
fn rows(page: &str) -> Value {
    let (host, path) = page
        .strip_prefix("http://")
        .unwrap()
        .split_once('/')
        .unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    write!(
        stream,
        "GET /{path}rows?from=0 HTTP/1.1\r\nHost: {host}\r\n\r\n"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
}

#[test]
fn a_service_is_watched_step_by_step() {
    let folder = tempfile::tempdir().unwrap();
    let system = element(folder.path(), "");
    let options = [
        system,
        "--mode",
        "ideal",
        "--watch",
        "--out",
        "out",
        "--units",
        "m,N",
        "--interval",
        "0.01 s",
    ];
    let service = Service::start(folder.path(), &options);
    let page = service.page.clone().unwrap();
    let one = |trial: bool| Quantities {
        displacement: usize::from(trial),
        force: usize::from(!trial),
        ..Quantities::default()
    };
    let sizes = Sizes {
        trial: one(true),
        wanted: one(false),
        length: 64,
    };
    let address = ([127, 0, 0, 1], service.port).into();
    let mut client = Client::connect(address, sizes, Duration::from_secs(10)).unwrap();
    // 2.8 kip/in.
    let stiffness = 2.8e3 * 4.448_221_615_260_5 / 0.0254;
    for trial in [0.5e-3, 1e-3] {
        client.send(Action::SetTrial, &[trial]).unwrap();
        let force = client.ask(Action::GetForce).unwrap()[0];
        assert!((force / (stiffness * trial) - 1.0).abs() < 1e-9, "{force}");
    }
    client.send(Action::Commit, &[]).unwrap();
    let limit = Instant::now() + Duration::from_secs(10);
    let shown = loop {
        let shown = rows(&page);
        if shown["rows"][0].is_array() {
            break shown;
        }
        assert!(Instant::now() < limit, "{shown}");
        std::thread::sleep(Duration::from_millis(5));
    };
    let row: Vec<f64> = serde_json::from_value(shown["rows"][0].clone()).unwrap();
    let [_, step, trials, round_trip, trial, measured, force] = row[..] else {
        panic!("{row:?}");
    };
    assert_eq!((step, trials), (1.0, 2.0));
    assert!(round_trip > 0.0 && round_trip < 10.0, "{round_trip}");
    assert!((trial - 1e-3).abs() < 1e-9 && (measured - 1e-3).abs() < 1e-9);
    assert!((force / (stiffness * 1e-3) - 1.0).abs() < 1e-6, "{force}");
    client.send(Action::End, &[]).unwrap();
    let limit = Instant::now() + Duration::from_secs(10);
    while rows(&page)["ended"] != "complete" {
        assert!(Instant::now() < limit, "it does not end");
        std::thread::sleep(Duration::from_millis(5));
    }
    let (status, summary, said) = service.end();
    assert_eq!((status, &summary["steps"]), (0, &Value::from(1)), "{said}");
}

const YIELDING: &str = ", yield_force = \"1.5 kip\", hardening = 0.02";

#[test]
fn in_ideal_mode_a_thousand_steps_are_those_of_opensees_alone() {
    if python().is_none() {
        return;
    }
    for (kind, more) in [("linear", ""), ("yielding", YIELDING)] {
        let folder = tempfile::tempdir().unwrap();
        let system = element(folder.path(), more);
        let service = Service::start(folder.path(), &[system, "--mode", "ideal", "--out", "out"]);
        let (done, found) = remote(service.port, &[kind, "1000"]);
        let (status, summary, said) = service.end();
        assert!(done, "{found} {said}");
        assert_eq!(status, 0, "{said}");
        println!("{kind}: {found}\n{summary}");
        assert_eq!(summary["steps"], 1000);
        let peak = found["peak"].as_f64().unwrap();
        assert!(peak > 0.5, "{found}");
        let difference = found["difference"].as_f64().unwrap();
        assert!(difference <= 1e-12 * peak, "{kind}: {found}");
        let rows = fs::read_to_string(folder.path().join("out/exchanges.csv")).unwrap();
        assert_eq!(rows.lines().count(), 1001);
    }
}

/// The table of integrators in the book.
#[test]
fn integrators_do_in_both_modes_what_the_book_says() {
    if python().is_none() {
        return;
    }
    // Those that use a tangent stiffness get the initial one from the laboratory and the yielded one from
    // OpenSees alone: they differ by their own error of integration.
    const TANGENT: f64 = 0.01;
    const EXACT: f64 = 1e-12;
    type Case = (&'static str, &'static [&'static str], bool, f64);
    let five = &["--mode", "rig", "--iterations", "5", "--interval", "0.01 s"];
    let cases: [Case; 6] = [
        ("Newmark", &["--mode", "rig"], false, EXACT),
        ("NewmarkHSFixedNumIter", five, true, TANGENT),
        ("HHTHSFixedNumIter", five, true, TANGENT),
        ("AlphaOS", &["--mode", "rig"], true, TANGENT),
        ("NewmarkExplicit", &["--mode", "rig"], true, EXACT),
        ("CentralDifference", &["--mode", "rig"], true, EXACT),
    ];
    for (integrator, options, suits, limit) in cases {
        let folder = tempfile::tempdir().unwrap();
        let system = element(folder.path(), YIELDING);
        let ideal = ["--mode", "ideal", "--interval", "0.01 s"];
        for (options, suits) in [(options, suits), (&ideal[..], true)] {
            let mut arguments = vec![system, "--out", "out", "--force"];
            arguments.extend(options);
            let service = Service::start(folder.path(), &arguments);
            let (done, found) = remote(service.port, &["yielding", "200", integrator, "5"]);
            let (status, summary, said) = service.end();
            println!("{integrator} {options:?}: {status} {found}");
            if !suits {
                assert_eq!(status, 1, "{integrator}: {said}");
                assert!(said.contains("an integrator that iterates"), "{said}");
                assert!(summary["steps"].as_u64().unwrap() < 200);
                continue;
            }
            assert!(done, "{integrator}: {found} {said}");
            assert_eq!(status, 0, "{integrator}: {said}");
            assert_eq!(summary["steps"], 200);
            let rms = found["rms"].as_f64().unwrap();
            assert!(rms < limit, "{integrator} {options:?}: {found}");
        }
    }
}

const FRAME: &str = r#"
import openseespy.opensees as ops
units = "in,kip"
ops.wipe()
ops.model("basic", "-ndm", 2, "-ndf", 3)
for line, x in ((1, 0.0), (2, 40.0)):
    ops.node(line, x, 0.0)
    ops.node(line + 2, x, 30.0)
    ops.fix(line, 1, 1, 1)
    ops.mass(line + 2, 1.3e-4, 1.3e-4, 0.0)
ops.geomTransf("Linear", 1)
ops.element("elasticBeamColumn", 1, 1, 3, 1.0, 29000.0, 0.0035, 1)
ops.element("elasticBeamColumn", 2, 2, 4, 1.0, 29000.0, 0.0035, 1)
ops.element("elasticBeamColumn", 3, 3, 4, 1.0, 29000.0, 1.0, 1)
ops.rayleigh(0.5, 0.0, 0.0, 0.0005)
"#;

/// Runs with the Python that has OpenSees.
fn run(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let output = Command::new(env!("CARGO_BIN_EXE_shakebench"))
        .args(arguments)
        .current_dir(folder)
        .env("SHAKEBENCH_PYTHON", python().unwrap())
        .output();
    output.unwrap()
}

/// The columns of a run's results.
fn results(folder: &Path) -> impl Fn(&str) -> Vec<f64> + use<> {
    let text = fs::read_to_string(folder.join("results.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<String> = lines
        .next()
        .unwrap()
        .split(',')
        .map(str::to_string)
        .collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| {
            line.split(',')
                .map(|cell| cell.parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect();
    move |name| {
        let place = names.iter().position(|own| own.trim_matches('"') == name);
        let place = place.unwrap_or_else(|| panic!("no column {name} in {names:?}"));
        rows.iter().map(|row| row[place]).collect()
    }
}

#[test]
fn a_frame_on_the_table_gives_the_force_of_opensees_moved_alike() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("frame.py"), FRAME).unwrap();
    let specimen = [
        "--specimen",
        "opensees:frame.py",
        "--duration",
        "4 s",
        "--out",
        "out",
    ];
    let mut arguments = vec!["run", "three-variable", "--json"];
    arguments.extend(specimen);
    let output = run(folder.path(), &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let summary: Value = serde_json::from_str(&stdout(&output)).unwrap();
    println!("real time {}", summary["real_time_factor"]);
    let column = results(&folder.path().join("out"));
    // Where the base was asked to be at the end of each step.
    let h = 0.002;
    let (u, v, a) = (
        column("table.displacement"),
        column("table.velocity"),
        column("table.acceleration"),
    );
    let base: Vec<f64> = (0..u.len())
        .map(|k| u[k] + h * (v[k] + 0.5 * h * a[k]))
        .collect();
    let force = column("specimen.force");
    fs::write(
        folder.path().join("base.json"),
        serde_json::to_string(&base).unwrap(),
    )
    .unwrap();
    let alone = Command::new(python)
        .arg(scripts().join("moved_base.py"))
        .args(["frame.py", "base.json", "0.002"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let expected: Vec<f64> = serde_json::from_str(stdout(&alone).trim())
        .unwrap_or_else(|e| panic!("{e}: {}", stderr(&alone)));
    let peak = expected.iter().fold(0.0_f64, |peak, f| peak.max(f.abs()));
    let pairs = expected.iter().zip(&force[1..]);
    let worst = pairs.fold(0.0_f64, |worst, (e, f)| worst.max((e - f).abs()));
    println!("peak {peak} N, largest difference {} of it", worst / peak);
    assert!(peak > 10.0 && worst < 1e-6 * peak, "{worst} of {peak}");
}

#[test]
fn models_at_fault_are_refused_with_the_line() {
    if python().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("import openseespy.opensees as ops\nops.nod(1)\n", "line 2"),
        ("x = (\n", "SyntaxError"),
        ("units = 'in,kip'\n", "no nodes"),
        (
            "import openseespy.opensees as ops\nops.model('basic', '-ndm', 1, '-ndf', 1)\n\
             ops.node(1, 0.0)\nops.fix(1, 1)\nops.node(2, 0.0)\nops.mass(2, 1.0)\n",
            "units",
        ),
        (
            "import openseespy.opensees as ops\nunits = 'in,kip'\n\
             ops.model('basic', '-ndm', 1, '-ndf', 1)\nops.node(1, 0.0)\nops.mass(1, 1.0)\n",
            "no node is fixed",
        ),
    ];
    for (model, word) in cases {
        fs::write(folder.path().join("model.py"), model).unwrap();
        let specimen = ["run", "--specimen", "opensees:model.py", "--out", "out"];
        let output = run(folder.path(), &specimen);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains("model.py") && said.contains(word),
            "{word}: {said}"
        );
        assert!(!folder.path().join("out").exists());
    }
    let missing = ["run", "--specimen", "opensees:none.py", "--out", "out"];
    let said = stderr(&run(folder.path(), &missing));
    assert!(said.contains("none.py"), "{said}");
}

#[test]
fn what_ends_opensees_ends_the_run_with_what_was_computed() {
    if python().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // A test that no iteration passes once the base has moved.
    let never = format!(
        "{FRAME}\ndef analysis():\n    ops.constraints('Transformation')\n    ops.numberer('RCM')\n    \
         ops.system('UmfPack')\n    ops.test('NormDispIncr', 1e-30, 3)\n    ops.algorithm('Newton')\n    \
         ops.integrator('Newmark', 0.5, 0.25)\n    ops.analysis('Transient')\n"
    );
    fs::write(folder.path().join("never.py"), never).unwrap();
    let arguments = ["run", "--specimen", "opensees:never.py", "--out", "out"];
    let output = run(folder.path(), &arguments);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("found no solution in step"), "{said}");
    assert!(folder.path().join("out/results.csv").is_file());
}

/// Processes of OpenSees that a shakebench of this test has started.
fn analysing(marker: &str) -> Vec<u32> {
    let all = fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = all.filter_map(|entry| entry.file_name().to_string_lossy().parse::<u32>().ok());
    let ours = numbers.filter(|pid| {
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        let command = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&environment).contains(marker)
            && String::from_utf8_lossy(&command).contains("SHAKEBENCH_OPENSEES_DRIVER")
    });
    ours.collect()
}

fn kill(pid: u32) {
    let _ = Command::new("kill").args(["-9", &pid.to_string()]).status();
}

/// Random moments, the same every time.
struct Moments(u64);

impl Moments {
    fn next(&mut self, limit_ms: u64) -> Duration {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        Duration::from_millis(self.0 % limit_ms)
    }
}

/// 50 kills: of OpenSees as a specimen, of the program that it is the specimen of, of OpenSees as a
/// client, and of the server.
#[test]
#[ignore = "takes minutes"]
#[cfg(target_os = "linux")]
fn fifty_kills_leave_no_process_and_keep_the_record() {
    if python().is_none() {
        return;
    }
    let seed = 0x5eed_0f0e_2026;
    println!("seed {seed:#x}");
    let mut moments = Moments(seed);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("frame.py"), FRAME).unwrap();
    let system = element(folder.path(), YIELDING);
    let wait = |child: &mut Child| {
        let limit = Instant::now() + Duration::from_secs(60);
        loop {
            if let Some(status) = child.try_wait().unwrap() {
                return status.code();
            }
            assert!(Instant::now() < limit, "it hangs");
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    for round in 0..50 {
        let out = format!("out-{round}");
        let marker = format!("SHAKEBENCH_TEST_ROUND={round}-{}", std::process::id());
        let (name, value) = marker.split_once('=').unwrap();
        let is_specimen = round % 2 == 0;
        let kills_opensees = round % 4 < 2;
        if is_specimen {
            let mut child = Command::new(env!("CARGO_BIN_EXE_shakebench"))
                .args([
                    "run",
                    "--specimen",
                    "opensees:frame.py",
                    "--real-time",
                    "--out",
                    &out,
                ])
                .current_dir(folder.path())
                .env("SHAKEBENCH_PYTHON", python().unwrap())
                .env(name, value)
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            let limit = Instant::now() + Duration::from_secs(60);
            while analysing(&marker).len() < 2 && Instant::now() < limit {
                std::thread::sleep(Duration::from_millis(20));
            }
            std::thread::sleep(moments.next(2500));
            let processes = analysing(&marker);
            if kills_opensees {
                let number = moments.next(1000).as_millis() as usize;
                if let Some(pid) = processes.get(number % processes.len().max(1)) {
                    kill(*pid);
                }
                let status = wait(&mut child);
                let mut said = String::new();
                child
                    .stderr
                    .take()
                    .unwrap()
                    .read_to_string(&mut said)
                    .unwrap();
                // Before the first step nothing is there to be saved.
                assert!(matches!(status, Some(1 | 2)), "{round}: {status:?} {said}");
                assert!(said.contains("OpenSees"), "{round}: {said}");
                let results = folder.path().join(&out).join("results.csv");
                assert!(status == Some(2) || results.is_file(), "{round}: {said}");
            } else {
                kill(child.id());
                wait(&mut child);
            }
        } else {
            let mut service =
                Service::start(folder.path(), &[system, "--mode", "ideal", "--out", &out]);
            let mut client = Command::new(python().unwrap())
                .arg(scripts().join("remote_element.py"))
                .args([&service.port.to_string(), "yielding", "20000"])
                .env(name, value)
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_millis(300) + moments.next(2500));
            let file = folder.path().join(&out).join("exchanges.csv");
            if kills_opensees {
                kill(client.id());
                wait(&mut client);
                // One that was killed before it came leaves the server waiting.
                drop(
                    TcpStream::connect(("127.0.0.1", service.port)).map(|mut other| {
                        let _ = other.write_all(&[0; 44]);
                    }),
                );
                let limit = Instant::now() + Duration::from_secs(5);
                while service.child.try_wait().unwrap().is_none() && Instant::now() < limit {
                    std::thread::sleep(Duration::from_millis(20));
                }
                let _ = Command::new("kill")
                    .arg(service.child.id().to_string())
                    .status();
                let (status, _, said) = service.end();
                assert_eq!(status, 1, "{round}: {said}");
                assert!(folder.path().join(&out).join("results.csv").is_file());
            } else {
                kill(service.child.id());
                wait(&mut service.child);
                // OpenSees itself may wait for ever: that is its own.
                kill(client.id());
                wait(&mut client);
            }
            let rows = fs::read_to_string(file).unwrap();
            assert!(rows.ends_with('\n'), "{round}: {rows}");
        }
        let limit = Instant::now() + Duration::from_secs(10);
        while !analysing(&marker).is_empty() && Instant::now() < limit {
            std::thread::sleep(Duration::from_millis(50));
        }
        assert_eq!(
            analysing(&marker),
            Vec::<u32>::new(),
            "{round}: left behind"
        );
    }
}

#[test]
fn units_and_ports_at_fault_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let system = element(folder.path(), "");
    let refused = |arguments: &[&str], words: &[&str]| {
        let mut all = vec!["serve"];
        all.extend(arguments);
        all.extend(["--out", "out"]);
        let output = shakebench(folder.path(), &all);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{all:?}: {said}");
        for word in words {
            assert!(said.contains(word), "`{word}` is not in: {said}");
        }
        assert!(!folder.path().join("out").exists());
    };
    let at = ["--openfresco", "127.0.0.1:0"];
    let with = |more: &[&'static str]| -> Vec<&'static str> {
        let mut all = vec![system];
        all.extend(at);
        all.extend(more);
        all
    };
    refused(&with(&["--units", "in,s"]), &["--units", "in,kip"]);
    refused(
        &["three-variable", at[0], at[1]],
        &["--units", "never guessed"],
    );
    refused(
        &with(&["--force-signal", "element.forse"]),
        &["element.force"],
    );
    refused(&with(&["--command", "displacement"]), &["component.input"]);
    refused(
        &with(&["--stiffness", "1,2"]),
        &["--stiffness", "expected 1"],
    );
    refused(
        &[
            "mpc",
            at[0],
            at[1],
            "--units",
            "in,kip",
            "--set",
            "control.preview=true",
        ],
        &[],
    );
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    refused(&[system, "--openfresco", &address], &[&address]);
    refused(&[system, "--openfresco", "0.0.0.0:0"], &["--allow"]);
}
