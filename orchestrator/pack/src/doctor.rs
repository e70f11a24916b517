//! The parts of this installation, missing parts, and what to do.

use std::collections::BTreeMap;
use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::PackedFmu;
use crate::program::{self, VERSION};
use crate::supply::{self, Installation, Origin};
use fmi_import::{FmiVersion, Fmu, Instance, Isolation, Options, Processes};

/// How an examined part is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// As it should be.
    Good,
    /// Not there, and only needed for what `needed_for` says.
    Absent,
    /// At fault: the program does not do its work.
    Bad,
}

/// A part that was examined.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The part.
    pub part: &'static str,
    /// How it is.
    pub state: State,
    /// What was found, in a clause.
    pub found: String,
    /// What it is needed for.
    pub needed_for: &'static str,
    /// What to do, if anything.
    pub cure: Option<String>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Examination {
    /// Version of the program.
    pub shakebench: &'static str,
    /// Processor and operating system.
    pub platform: String,
    /// The program's file.
    pub program: Option<PathBuf>,
    /// Where components come from.
    pub fmus: Option<PathBuf>,
    /// Why from there.
    pub origin: Option<Origin>,
    /// Whether the program can do its work.
    pub ready: bool,
    /// The parts.
    pub findings: Vec<Finding>,
}

/// Packages of Python: the purpose of each, and its requirement for pip.
const PACKAGES: [(&str, &str, &str); 4] = [
    ("fmpy", "running the FMUs from Python", "fmpy"),
    ("ecospy", "running the FMUs in ecos", "ecospy tbb"),
    ("libcosimpy", "running the FMUs in libcosim", "libcosimpy"),
    (
        "shakebench",
        "driving this program from Python",
        "the wheel of the release",
    ),
];

/// Examines the installation.
pub fn examine(installation: &Installation) -> Examination {
    let mut findings = vec![folder_for_results(), temporary_folder()];
    let folder = installation.folder().ok();
    findings.extend(components(installation));
    findings.push(own_process(installation));
    findings.push(cargo());
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_string());
    findings.extend(packages(&python));
    findings.push(opensees());
    Examination {
        shakebench: VERSION,
        platform: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        program: program::file().ok(),
        origin: folder.as_ref().map(|folder| folder.origin),
        fmus: folder.map(|folder| folder.path),
        ready: findings.iter().all(|finding| finding.state != State::Bad),
        findings,
    }
}

/// Whether files can be made in a folder.
fn writable(folder: &Path) -> io::Result<()> {
    let tried = tempfile::Builder::new()
        .prefix(".shakebench-doctor-")
        .tempfile_in(folder);
    tried.map(drop)
}

fn folder_for_results() -> Finding {
    let here = std::env::current_dir().unwrap_or_default();
    let tried = writable(&here);
    let is_good = tried.is_ok();
    Finding {
        part: "present folder",
        state: if is_good { State::Good } else { State::Absent },
        found: tried.map_or_else(|error| error.to_string(), |()| "can be written".to_string()),
        needed_for: "results without --out",
        cure: (!is_good).then(|| "change to another folder, or give --out".to_string()),
    }
}

fn temporary_folder() -> Finding {
    let folder = std::env::temp_dir();
    let tried = writable(&folder);
    let is_good = tried.is_ok();
    Finding {
        part: "temporary folder",
        state: if is_good { State::Good } else { State::Bad },
        found: match tried {
            Ok(()) => format!("{} can be written", folder.display()),
            Err(error) => format!("{}: {error}", folder.display()),
        },
        needed_for: "unpacking FMUs",
        cure: (!is_good).then(|| "set TMPDIR to a writable folder".to_string()),
    }
}

/// The components: those that are there, whole, of this version, and that can be loaded here.
fn components(installation: &Installation) -> Vec<Finding> {
    let finding = |part, state, found, cure: Option<&str>| Finding {
        part,
        state,
        found,
        needed_for: "run, compare, diagnose",
        cure: cure.map(String::from),
    };
    let all = match installation.fmus() {
        Ok(all) => all,
        Err(error) => {
            let reason = error.to_string();
            return vec![finding("components", State::Bad, reason, None)];
        }
    };
    let count = |version| all.iter().filter(|fmu| fmu.version == version).count();
    let (two, three) = (count(FmiVersion::V2), count(FmiVersion::V3));
    let counted = format!("{two} for FMI 2.0, {three} for FMI 3.0");
    let (state, cure) = match (two, three) {
        (_, 0) | (0, _) => (
            State::Absent,
            Some(
                "one FMI version is missing, so `--fmi` has no choice; install again to have \
                both",
            ),
        ),
        _ => (State::Good, None),
    };
    let mut findings = vec![finding("components", state, counted, cure)];
    let (faults, platforms) = tallied(all.iter().map(|fmu| load(fmu, installation)));
    let hint = "install again; if a library cannot be mapped, set TMPDIR to a folder from which \
        programs may run";
    findings.extend(
        faults
            .into_iter()
            .map(|fault| finding("component", State::Bad, fault, Some(hint))),
    );
    if let Some(platforms) = platforms {
        findings.push(finding("platforms", State::Good, platforms, None));
    }
    findings
}

/// What is wrong with components, and the number of those that can be loaded by platform, in a clause.
fn tallied<E: ToString>(
    loaded: impl Iterator<Item = Result<Vec<String>, E>>,
) -> (Vec<String>, Option<String>) {
    let mut platforms: BTreeMap<String, usize> = BTreeMap::new();
    let mut faults = Vec::new();
    for outcome in loaded {
        match outcome {
            Ok(found) => {
                for platform in found {
                    *platforms.entry(platform).or_default() += 1;
                }
            }
            Err(error) => faults.push(error.to_string()),
        }
    }
    let counted = platforms
        .iter()
        .map(|(platform, count)| format!("{platform} ({count})"));
    let counted = counted.collect::<Vec<_>>().join(", ");
    (faults, Some(counted).filter(|counted| !counted.is_empty()))
}

/// The platforms of a component that is whole and can be instantiated here.
fn load(fmu: &PackedFmu, installation: &Installation) -> Result<Vec<String>, Box<dyn Error>> {
    supply::check(fmu)?;
    let opened = Fmu::open_own(&fmu.path)?;
    Instance::new(&opened, "doctor", &installation.options())?;
    Ok(opened.platforms.clone())
}

/// Whether FMUs can be run in a process of their own.
fn own_process(installation: &Installation) -> Finding {
    let options = Options {
        isolation: Isolation::All,
        ..installation.options()
    };
    let tried = installation
        .fmus()
        .map_err(|error| error.to_string())
        .and_then(|all| all.first().ok_or_else(|| "no FMU for the test".to_string()))
        .and_then(|fmu| Fmu::open_own(&fmu.path).map_err(|error| error.to_string()))
        .and_then(|fmu| {
            let mut processes = Processes::new(&options);
            let made = Instance::within(&fmu, "doctor", &mut processes, true);
            made.map(drop).map_err(|error| error.to_string())
        });
    let is_good = tried.is_ok();
    Finding {
        part: "processes for FMUs",
        state: if is_good { State::Good } else { State::Absent },
        found: tried.map_or_else(|error| error, |()| "can be started".to_string()),
        needed_for: "--isolate",
        cure: (!is_good).then(|| "run with --isolate none".to_string()),
    }
}

fn cargo() -> Finding {
    let version = first_line(Command::new("cargo").arg("--version"));
    Finding {
        part: "cargo",
        state: found_or_absent(version.is_some()),
        cure: version
            .is_none()
            .then(|| "install Rust, https://rustup.rs".to_string()),
        found: version.unwrap_or_else(|| "not found".to_string()),
        needed_for: "build, from sources",
    }
}

/// The packages of the interpreter `python`.
fn packages(python: &str) -> Vec<Finding> {
    PACKAGES
        .into_iter()
        .map(|(package, needed_for, wanted)| {
            let script = format!("import importlib.metadata as m; print(m.version('{package}'))");
            let version = first_line(Command::new(python).args(["-c", &script]));
            Finding {
                part: package,
                state: found_or_absent(version.is_some()),
                cure: version
                    .is_none()
                    .then(|| format!("{python} -m pip install {wanted}")),
                found: match version {
                    Some(version) => format!("{version}, of {python}"),
                    None => format!("not found by {python}"),
                },
                needed_for,
            }
        })
        .collect()
}

/// Whether a structure can be computed in OpenSees.
fn opensees() -> Finding {
    let found = bridges::opensees::find_python(None);
    Finding {
        part: "openseespy",
        state: found_or_absent(found.is_ok()),
        cure: found.is_err().then(|| bridges::opensees::CURE.to_string()),
        found: match found {
            Ok(python) => format!(
                "{}, of {}",
                python.openseespy.unwrap_or_default(),
                python.program.display()
            ),
            Err(bridges::opensees::OpenSeesError::NoPython { tried }) => {
                format!("not found ({tried})")
            }
            Err(error) => error.to_string(),
        },
        needed_for: "--specimen opensees:MODEL.py",
    }
}

fn found_or_absent(is_found: bool) -> State {
    match is_found {
        true => State::Good,
        false => State::Absent,
    }
}

/// What a program prints first, if it can be started and ends well.
fn first_line(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().next().map(str::to_string);
    line.filter(|_| output.status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn installation(files: &[&str]) -> (tempfile::TempDir, Installation) {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let own = Installation::new(Some(folder.path().into()), None);
        (folder, own)
    }

    #[test]
    fn components_are_counted_by_version_and_damaged_ones_are_named() {
        let (_one, own) = installation(&["fmi2/A.fmu", "fmi2/B.fmu", "fmi3/A.fmu"]);
        let found = components(&own);
        assert_eq!(found.len(), 4);
        assert_eq!(
            (found[0].state, &*found[0].found, &found[0].cure),
            (State::Good, "2 for FMI 2.0, 1 for FMI 3.0", &None)
        );
        for fault in &found[1..] {
            assert_eq!((fault.part, fault.state), ("component", State::Bad));
            assert!(
                fault.found.contains(".fmu") && fault.cure.is_some(),
                "{fault:?}"
            );
        }
        let (_two, own) = installation(&["fmi3/A.fmu"]);
        let found = components(&own);
        assert_eq!(
            (found[0].state, &*found[0].found),
            (State::Absent, "0 for FMI 2.0, 1 for FMI 3.0")
        );
        assert!(
            found[0]
                .cure
                .as_ref()
                .unwrap()
                .contains("one FMI version is missing")
        );
        let (_none, own) = installation(&[]);
        let found = components(&own);
        assert_eq!((found.len(), found[0].state), (1, State::Bad));
        assert!(
            found[0].found.contains("no FMUs in this folder"),
            "{found:?}"
        );
        let process = own_process(&own);
        assert_eq!(
            (process.state, process.cure.as_deref()),
            (State::Absent, Some("run with --isolate none"))
        );
    }

    #[test]
    fn platforms_are_counted_over_the_components_that_load() {
        let all = |platforms: &[&str]| -> Result<Vec<String>, String> {
            Ok(platforms.iter().map(|own| (*own).to_string()).collect())
        };
        let (faults, platforms) = tallied(
            [
                all(&["x86_64-windows", "x86_64-linux"]),
                Err("One.fmu: is damaged".to_string()),
                all(&["x86_64-linux"]),
                all(&["x86_64-linux"]),
            ]
            .into_iter(),
        );
        assert_eq!(faults, ["One.fmu: is damaged"]);
        let platforms = platforms.unwrap();
        assert_eq!(platforms, "x86_64-linux (3), x86_64-windows (1)");
        let (faults, platforms) = tallied(std::iter::once(Err("no library")));
        assert_eq!((faults, platforms), (vec!["no library".to_string()], None));
    }

    /// The interpreter is a script that has some packages, in versions that it makes of their names.
    #[cfg(unix)]
    #[test]
    fn packages_are_those_of_the_interpreter() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let python = folder.path().join("python");
        let script = "#!/bin/sh\ncase \"$2\" in\n*version\\(\\'fmpy\\'\\)*) echo 0.3.2;;\n\
            *version\\(\\'shakebench\\'\\)*) echo 0.1.0; echo more;;\n*) echo lost; exit 1;;\nesac\n";
        std::fs::write(&python, script).unwrap();
        std::fs::set_permissions(&python, std::fs::Permissions::from_mode(0o755)).unwrap();
        let python = python.to_str().unwrap();
        let table: Vec<String> = packages(python)
            .iter()
            .map(|own| {
                let cure = own.cure.as_deref().unwrap_or("nothing to do");
                format!(
                    "{} | {:?} | {} | {} | {cure}",
                    own.part, own.state, own.found, own.needed_for
                )
                .replace(python, "PYTHON")
            })
            .collect();
        assert_eq!(
            table,
            [
                "fmpy | Good | 0.3.2, of PYTHON | running the FMUs from Python | nothing to do",
                "ecospy | Absent | not found by PYTHON | running the FMUs in ecos | PYTHON -m pip \
                 install ecospy tbb",
                "libcosimpy | Absent | not found by PYTHON | running the FMUs in libcosim | PYTHON -m \
                 pip install libcosimpy",
                "shakebench | Good | 0.1.0, of PYTHON | driving this program from Python | nothing to \
                 do",
            ]
        );
    }

    #[test]
    fn folders_are_tried_by_making_a_file() {
        assert!(writable(&std::env::temp_dir()).is_ok());
        assert!(writable(Path::new("/no/such/folder")).is_err());
        let own = temporary_folder();
        assert_eq!((own.state, own.cure), (State::Good, None));
        assert!(own.found.ends_with(" can be written"), "{}", own.found);
        let own = folder_for_results();
        assert_eq!(
            (own.state, &*own.found, own.cure),
            (State::Good, "can be written", None)
        );
    }

    #[test]
    fn a_program_says_its_version_in_its_first_line() {
        let line = |script: &str| first_line(Command::new("sh").args(["-c", script]));
        assert_eq!(line("echo one; echo two").as_deref(), Some("one"));
        assert_eq!(line("echo one; exit 1"), None);
        assert_eq!(line("true"), None);
        assert_eq!(first_line(&mut Command::new("/no/such/program")), None);
        assert_eq!(
            (found_or_absent(true), found_or_absent(false)),
            (State::Good, State::Absent)
        );
        let own = cargo();
        assert_eq!(own.state == State::Good, own.cure.is_none());
        assert!(
            own.found.starts_with("cargo ") || own.found == "not found",
            "{}",
            own.found
        );
    }
}
