//! Pythons with what `tests/importers` pins, made once under `target/`: the importers of
//! `requirements.txt`, and apart from them SIPPY of `requirements-sippy.txt` and Dask of
//! `requirements-dask.txt`.

use std::{
    ffi::OsStr,
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

/// Folder of the importers' scripts and requirements.
pub fn importers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("importers")
}

/// A command that runs Python with the importers installed; give it a script and arguments.
///
/// # Panics
/// When the environment cannot be made, with what to install.
pub fn python() -> Command {
    static ENVIRONMENT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let made = ENVIRONMENT.get_or_init(|| make_environment("python", "requirements.txt"));
    let environment = match made {
        Ok(environment) => environment,
        Err(problem) => panic!("no Python for the importers: {problem}"),
    };
    let mut command = Command::new(program(environment));
    // The importers bring libraries of their own (tbb) that their loaders do not find by themselves.
    let lib = environment.join("lib");
    let others = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let paths = std::iter::once(lib).chain(std::env::split_paths(&others));
    command
        .env(
            "LD_LIBRARY_PATH",
            std::env::join_paths(paths).unwrap_or(others),
        )
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("PYTHONUNBUFFERED", "1");
    command
}

/// A command that runs Python with SIPPY installed.
///
/// # Panics
/// When the environment cannot be made, with what to install.
pub fn sippy() -> Command {
    match make_environment("sippy", "requirements-sippy.txt") {
        Ok(environment) => Command::new(program(&environment)),
        Err(problem) => panic!("no Python with SIPPY: {problem}"),
    }
}

/// A command that runs Python with Dask installed, and fmpy beside it.
///
/// # Panics
/// When the environment cannot be made, with what to install.
pub fn dask() -> Command {
    match make_environment("dask", "requirements-dask.txt") {
        Ok(environment) => Command::new(program(&environment)),
        Err(problem) => panic!("no Python with Dask: {problem}"),
    }
}

/// Runs a script of `tests/importers` and returns what it printed.
///
/// # Panics
/// When the script fails, with all of its output.
pub fn run_script<S: AsRef<OsStr>>(script: &str, arguments: impl IntoIterator<Item = S>) -> String {
    finish(python(), script, arguments)
}

/// As [`run_script`], with a Python of its own: `name`, with what the file `pinned` lists.
///
/// # Panics
/// As [`run_script`], or when the environment cannot be made.
pub fn run_script_in<S: AsRef<OsStr>>(
    name: &str,
    pinned: &str,
    script: &str,
    arguments: impl IntoIterator<Item = S>,
) -> String {
    match make_environment(name, pinned) {
        Ok(environment) => finish(Command::new(program(&environment)), script, arguments),
        Err(problem) => panic!("no Python `{name}`: {problem}"),
    }
}

fn finish<S: AsRef<OsStr>>(
    mut command: Command,
    script: &str,
    arguments: impl IntoIterator<Item = S>,
) -> String {
    command.arg(importers().join(script)).args(arguments);
    let output = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let text = text(&output);
    assert!(
        output.status.success(),
        "{script} failed ({}):\n{text}",
        output.status
    );
    text
}

fn text(output: &Output) -> String {
    format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

fn program(environment: &Path) -> PathBuf {
    environment.join(if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    })
}

/// An environment `name` under `target/importers` with what the file `pinned` lists.
fn make_environment(name: &str, pinned: &str) -> Result<PathBuf, String> {
    let requirements_file = importers().join(pinned);
    let requirements = fs::read_to_string(&requirements_file)
        .map_err(|e| format!("{}: {e}", requirements_file.display()))?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/importers");
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let folder = folder
        .canonicalize()
        .map_err(|e| format!("{}: {e}", folder.display()))?;
    let lock = File::create(folder.join("lock")).map_err(|e| format!("lock: {e}"))?;
    lock.lock().map_err(|e| format!("lock: {e}"))?;

    let environment = folder.join(name);
    // Written last: there only if everything before it succeeded.
    let done = environment.join("requirements.txt");
    if fs::read_to_string(&done).is_ok_and(|text| text == requirements) {
        return Ok(environment);
    }
    let _ = fs::remove_dir_all(&environment);
    let base = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    if let Err(first) = run(Command::new(&base).args(["-m", "venv"]).arg(&environment)) {
        // Debian splits `venv` off; `virtualenv` from PyPI needs nothing of the system but pip.
        let _ = fs::remove_dir_all(&environment);
        let tools = folder.join("tools");
        run(Command::new(&base)
            .args(["-m", "pip", "install", "--quiet", "--target"])
            .arg(&tools)
            .arg("virtualenv==20.35.4"))
        .and_then(|()| {
            let mut command = Command::new(&base);
            run(command
                .env("PYTHONPATH", &tools)
                .args(["-m", "virtualenv"])
                .arg(&environment))
        })
        .map_err(|second| {
            format!(
                "neither `venv` nor `virtualenv` works; install python3-venv (Debian: `apt-get \
                 install python3-venv`) or name another Python in PYTHON\n{first}\n{second}"
            )
        })?;
    }
    run(Command::new(program(&environment))
        .args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "-r",
        ])
        .arg(&requirements_file))?;
    fs::write(&done, requirements).map_err(|e| format!("{}: {e}", done.display()))?;
    Ok(environment)
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{command:?}: {}\n{}", output.status, text(&output)))
}
