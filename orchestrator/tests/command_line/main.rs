//! The program as scripts and people use it: files, exit status, and what it says of bad input.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod archives;
mod bad_input;
mod book;
mod browser;
mod campaign;
mod checkpoints;
mod clocks;
mod commissioning;
mod contract;
mod diagnosis;
mod events;
mod failures;
mod fault_table;
mod figures;
mod group;
mod hostile;
mod installation;
mod iteration;
mod json;
mod loops;
mod motions;
mod opensees;
mod physical_rig;
mod qualification;
mod reports;
mod rigs;
mod ssp_of_others;
mod systems;
mod tuning;
mod validation;
mod variable_step;

use std::path::Path;
use std::process::{Command, Output};

/// Runs `shakebench` in `folder`.
fn shakebench(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_shakebench");
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    output.unwrap_or_else(|error| panic!("{program}: {error}"))
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The run is refused with status 2 and a message that has all the `words`; nothing is written.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str], words: &[&str]) {
    let out = folder.join("out");
    let mut all = arguments.to_vec();
    all.extend(["--out", "out"]);
    let output = shakebench(folder, &all);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(stdout(&output), "", "{arguments:?}");
    assert!(said.starts_with("error: "), "{said}");
    for word in words {
        assert!(said.contains(word), "`{word}` is not in: {said}");
    }
    assert!(!out.exists(), "{arguments:?}: something was written");
    let left = std::fs::read_dir(folder).unwrap().flatten();
    let hidden = left.filter(|entry| {
        entry
            .file_name()
            .to_string_lossy()
            .starts_with(".shakebench")
    });
    assert_eq!(hidden.count(), 0, "{arguments:?}: something was left");
}
