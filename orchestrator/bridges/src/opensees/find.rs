//! A Python that has OpenSees, found and not assumed.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use super::OpenSeesError;

/// The variable that names a Python.
pub const PYTHON: &str = "SHAKEBENCH_PYTHON";

/// A Python and whether OpenSees is in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// What is started.
    pub program: PathBuf,
    /// Why it is looked at.
    pub because: &'static str,
    /// The version of openseespy, or why there is none.
    pub openseespy: Result<String, String>,
}

/// What is asked of a Python.
const QUESTION: &str = "\
import openseespy.opensees as ops, importlib.metadata as m
print('openseespy', m.version('openseespy'))";

/// Looks at the Pythons in order, `named` first (alone where it is there), until one has OpenSees.
///
/// # Errors
/// None has; with what each said.
pub fn find_python(named: Option<&str>) -> Result<Candidate, OpenSeesError> {
    let mut tried = Vec::new();
    for (program, because) in candidates(named) {
        let candidate = look(program, because);
        match &candidate.openseespy {
            Ok(_) => return Ok(candidate),
            Err(reason) => tried.push(format!("{}: {reason}", candidate.program.display())),
        }
    }
    Err(OpenSeesError::NoPython {
        tried: tried.join("; "),
    })
}

fn candidates(named: Option<&str>) -> Vec<(PathBuf, &'static str)> {
    if let Some(named) = named.filter(|named| !named.is_empty()) {
        return vec![(PathBuf::from(named), "named")];
    }
    if let Some(named) = std::env::var_os(PYTHON).filter(|named| !named.is_empty()) {
        return vec![(PathBuf::from(named), PYTHON)];
    }
    let mut all = Vec::new();
    // The Python package names the one that started the program.
    if let Some(own) = std::env::var_os("PYTHON").filter(|own| !own.is_empty()) {
        all.push((PathBuf::from(own), "PYTHON"));
    }
    if let Some(environment) = std::env::var_os("VIRTUAL_ENV") {
        let inside = if cfg!(windows) {
            "Scripts/python.exe"
        } else {
            "bin/python"
        };
        all.push((PathBuf::from(environment).join(inside), "VIRTUAL_ENV"));
    }
    all.push((PathBuf::from("python3"), "on the path"));
    all.push((PathBuf::from("python"), "on the path"));
    all
}

fn look(program: PathBuf, because: &'static str) -> Candidate {
    let asked = Command::new(&program)
        .args(["-c", QUESTION])
        .stdin(Stdio::null())
        .output();
    let openseespy = match asked {
        Err(error) => Err(error.to_string()),
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stdout);
            let version = text
                .lines()
                .find_map(|line| line.strip_prefix("openseespy "));
            match version {
                Some(version) => Ok(version.trim().to_string()),
                None => {
                    let said = String::from_utf8_lossy(&output.stderr);
                    let last = said.lines().rev().find(|line| !line.trim().is_empty());
                    Err(last.unwrap_or("it said nothing").trim().to_string())
                }
            }
        }
    };
    Candidate {
        program,
        because,
        openseespy,
    }
}
