//! Runs that are interrupted or killed and go on from their checkpoints: the results are those of a run
//! that was left alone, to the bit, and no file is ever there in part.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{refused, shakebench, stderr};

const SEED: u64 = 50;

/// A rig with noise, delays, friction and a specimen that yields: everything has a state.
const RUN: [&str; 9] = [
    "run",
    "sliding-mode",
    "--plant",
    "servohydraulic",
    "--specimen",
    "yielding",
    "--step",
    "0.1 ms",
    "--json",
];

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_shakebench"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Whatever files of a run there are, they are whole.
fn check_files(folder: &Path, whole: &[u8]) {
    if let Ok(results) = fs::read(folder.join("results.csv")) {
        assert!(results == whole, "results.csv is not that of the whole run");
    }
    for name in ["summary.json", "manifest.json", "checkpoint/run.json"] {
        if let Ok(text) = fs::read_to_string(folder.join(name)) {
            let read: Result<serde_json::Value, _> = serde_json::from_str(&text);
            assert!(read.is_ok(), "{name} is there in part");
        }
    }
    if let Ok(page) = fs::read_to_string(folder.join("report.html")) {
        assert!(
            page.trim_end().ends_with("</html>"),
            "half a page was written"
        );
    }
}

/// Kills runs so often: one after its first checkpoint, the next at a moment drawn over the time that a
/// whole run takes.
fn killed(kills: usize) {
    println!("seed {SEED}");
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let begin = Instant::now();
    let output = shakebench(folder, &[&RUN[..], &["--out", "whole"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let takes = begin.elapsed();
    let whole = fs::read(folder.join("whole/results.csv")).unwrap();
    let (mut count, mut chains, mut resumed) = (0, 0, 0);
    while count < kills {
        chains += 1;
        let out = format!("run-{chains}");
        let place = folder.join(&out);
        loop {
            let can_resume = place.join("checkpoint/state").is_file();
            let every = ["--checkpoint-every", "0.1 s", "--out", &out];
            let arguments = match can_resume {
                true => vec!["run", "--resume", &out],
                false => [&RUN[..], &every].concat(),
            };
            resumed += usize::from(can_resume);
            // The last ones go to their end.
            if count == kills {
                let output = shakebench(folder, &arguments);
                assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
                break;
            }
            let mut child = start(folder, &arguments);
            if count.is_multiple_of(2) {
                // As soon as there is something to go on from.
                while !can_resume
                    && !place.join("checkpoint/state").is_file()
                    && child.try_wait().unwrap().is_none()
                {
                    std::thread::sleep(Duration::from_millis(1));
                }
            } else {
                std::thread::sleep(takes.mul_f64(random.random_range(0.0..1.1)));
            }
            child.kill().unwrap();
            if child.wait().unwrap().success() {
                break;
            }
            count += 1;
            check_files(&place, &whole);
        }
        check_files(&place, &whole);
        assert!(place.join("results.csv").is_file());
        assert!(!place.join("checkpoint").exists(), "the checkpoint stays");
    }
    println!("{count} kills in {chains} runs, {resumed} times resumed, a run takes {takes:?}");
    assert!(resumed > 0);
}

#[test]
fn a_run_that_is_killed_goes_on_to_the_bit() {
    killed(4);
}

#[test]
#[ignore = "takes a minute"]
fn a_run_that_is_killed_fifty_times_goes_on_to_the_bit() {
    killed(50);
}

/// In a file system of `$1` kB: a run, then, with room again, the same run resumed. Prints both statuses, and
/// `lost` where a part of the results is not the beginning of the whole.
#[cfg(target_os = "linux")]
const ON_A_SMALL_DISK: &str = r#"
mkdir -p disk && mount -t tmpfs -o size=${1}k tmpfs disk || exit 99
program=$2; whole=$3; shift 3
cd disk
"$program" "$@" > ../said 2>&1; first=$?
for part in out/results.csv.part out/results.csv; do
    [ -f $part ] || continue
    head -c $(stat -c %s $part) "$whole" | cmp -s - $part || echo lost
done
mount -o remount,size=64m "$PWD"
again=none
if [ -f out/checkpoint/state ]; then
    "$program" run --resume out > ../again 2>&1; again=$?
    cmp -s out/results.csv "$whole" || echo lost
fi
echo $first $again
"#;

/// Runs whose disk is full at a moment drawn over all that they write.
#[cfg(target_os = "linux")]
fn on_full_disks(trials: usize) {
    let may_mount = Command::new("unshare").args(["-rm", "true"]).output();
    if !may_mount.is_ok_and(|done| done.status.success()) {
        println!("no file system can be mounted here: nothing was tried");
        return;
    }
    println!("seed {SEED}");
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = [&RUN[..6], &["--duration", "0.6 s"]].concat();
    let output = shakebench(folder, &[&run[..], &["--out", "whole"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let whole = folder.join("whole/results.csv");
    let all = fs::read_dir(folder.join("whole")).unwrap();
    let bytes: u64 = all
        .map(|file| file.unwrap().metadata().unwrap().len())
        .sum();
    let (mut full, mut resumed) = (0, 0);
    for trial in 0..trials {
        let size = random.random_range(40..bytes / 1024 + 200);
        let mut command = Command::new("unshare");
        command.args(["-rm", "sh", "-c", ON_A_SMALL_DISK, "sh", &size.to_string()]);
        command.args([Path::new(env!("CARGO_BIN_EXE_shakebench")), &whole]);
        command
            .args(&run)
            .args(["--checkpoint-every", "0.05 s", "--out", "out"]);
        let done = command.current_dir(folder).output().unwrap();
        let said = fs::read_to_string(folder.join("said")).unwrap();
        let found = crate::stdout(&done);
        let place = format!("trial {trial}, {size} kB: {found}{said}{}", stderr(&done));
        assert!(!found.contains("lost"), "{place}");
        let (first, again) = found
            .trim()
            .split_once(' ')
            .unwrap_or_else(|| panic!("{place}"));
        match first {
            "0" => continue,
            "1" => full += 1,
            _ => panic!("{place}"),
        }
        for words in [
            "cannot be written",
            "No space left",
            "complete",
            "Free some space",
        ] {
            assert!(said.contains(words), "`{words}` is not in {place}");
        }
        // What was kept is named, and goes on.
        assert_eq!(
            again != "none",
            said.contains("run --resume out"),
            "{place}"
        );
        assert!(["none", "0"].contains(&again), "{place}");
        resumed += usize::from(again == "0");
    }
    println!("{trials} trials, {full} disks were full, {resumed} runs resumed");
    assert!(full > trials / 2 && resumed > trials / 3);
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_whose_disk_is_full_goes_on_to_the_bit() {
    on_full_disks(3);
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "takes half a minute"]
fn a_run_whose_disk_is_full_fifty_times_goes_on_to_the_bit() {
    on_full_disks(50);
}

#[cfg(unix)]
#[test]
fn a_run_that_is_interrupted_goes_on_to_the_bit_in_whatever_process() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let short = [&RUN[..6], &["--duration", "1 s"]].concat();
    let output = shakebench(folder, &[&short[..], &["--out", "whole"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // In real time, so that there is time for a signal.
    let apart = [
        "--isolate",
        "all",
        "--real-time",
        "--checkpoint-every",
        "0.05 s",
        "--out",
        "out",
    ];
    let mut child = start(folder, &[&short[..], &apart].concat());
    let begin = Instant::now();
    while !folder.join("out/checkpoint/state").is_file() {
        assert!(begin.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    let pid = child.id().to_string();
    let signalled = Command::new("kill").args(["-INT", &pid]).status();
    assert!(signalled.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let whole = fs::read(folder.join("whole/results.csv")).unwrap();
    let part = fs::read(folder.join("out/results.csv")).unwrap();
    assert!(part.len() < whole.len() && whole.starts_with(&part));

    // Another run does not go into the same folder.
    let other = shakebench(folder, &["run", "--duration", "0.1 s", "--out", "out"]);
    assert_eq!(other.status.code(), Some(2));
    assert!(
        stderr(&other).contains("--resume out"),
        "{}",
        stderr(&other)
    );

    let output = shakebench(folder, &["run", "--resume", "out", "--isolate", "none"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("continues from its checkpoint at 0."));
    assert!(fs::read(folder.join("out/results.csv")).unwrap() == whole);
    assert!(!folder.join("out/checkpoint").exists());
    let sums = ["out", "whole"].map(|run| {
        let text = fs::read_to_string(folder.join(run).join("manifest.json")).unwrap();
        let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
        manifest["results_sha256"].clone()
    });
    assert_eq!(sums[0], sums[1]);
}

#[cfg(unix)]
#[test]
fn checkpoints_that_cannot_be_kept_or_gone_on_from_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let none = shakebench(folder, &["run", "--resume", "nowhere"]);
    assert_eq!(none.status.code(), Some(2));
    assert!(stderr(&none).contains("nowhere: holds no checkpoint"));

    // An FMU that does not write its state.
    crate::hostile::pack(folder, "HONEST", "");
    fs::write(folder.join("rig.toml"), crate::hostile::ALONE).unwrap();
    let every = ["run", "rig.toml", "--checkpoint-every", "1 s"];
    refused(folder, &every, &["`it`", "canSerializeFMUState"]);

    // One byte of a checkpoint differs.
    let arguments = [
        "run",
        "--duration",
        "1 s",
        "--real-time",
        "--checkpoint-every",
        "0.05 s",
        "--out",
        "out",
    ];
    let mut child = start(folder, &arguments);
    let state = folder.join("out/checkpoint/state");
    let begin = Instant::now();
    while !state.is_file() {
        assert!(begin.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    for name in ["state", "rows"] {
        let file = folder.join("out/checkpoint").join(name);
        let sound = fs::read(&file).unwrap();
        let mut damaged = sound.clone();
        damaged[sound.len() / 2] ^= 1;
        // What lies behind the moment does not count.
        damaged.iter_mut().take(60).for_each(|byte| *byte ^= 1);
        fs::write(&file, &damaged).unwrap();
        let output = shakebench(folder, &["run", "--resume", "out"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(&format!("checkpoint/{name}: is ")), "{said}");
        fs::write(&file, &sound).unwrap();
    }
    let output = shakebench(folder, &["run", "--resume", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}
