//! The book's commands are run, and the figures that it prints compared.
//!
//! A line `<!-- run -->` before a block of `sh` or `python` has it run, `<!-- run fails N -->` expects
//! the exit status N, `<!-- file NAME -->` writes the block as a file, and `<!-- prints -->` says that the
//! block stands in what was printed last: line by line, `...` for anything, numbers as exact as they
//! are printed; what stands behind `<!-- try -->` needs other tools and is left to `dist/walk`. The blocks of a page run one after the other in a folder of their own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is done with a block.
enum Marked {
    Run { fails: i32 },
    File(String),
    Prints,
}

fn mark(line: &str) -> Option<Marked> {
    let words = line.trim().strip_prefix("<!-- ")?.strip_suffix(" -->")?;
    let mut words = words.split(' ');
    match (words.next()?, words.next(), words.next()) {
        ("run", None, _) => Some(Marked::Run { fails: 0 }),
        ("run", Some("fails"), Some(status)) => Some(Marked::Run {
            fails: status.parse().unwrap(),
        }),
        ("file", Some(name), None) => Some(Marked::File(name.to_string())),
        ("prints", None, _) => Some(Marked::Prints),
        ("try", None, _) => None,
        _ => panic!("`{line}` is no mark of the book"),
    }
}

/// The marked blocks of a page: line, mark, language and text.
fn blocks(page: &str) -> Vec<(usize, Marked, String, String)> {
    let lines: Vec<&str> = page.lines().collect();
    let mut found = Vec::new();
    for (n, line) in lines.iter().enumerate() {
        let Some(mark) = mark(line) else { continue };
        let fence = lines.get(n + 1).and_then(|line| line.strip_prefix("```"));
        let language = fence.unwrap_or_else(|| panic!("line {}: no block follows", n + 1));
        let body = lines[n + 2..].iter().take_while(|line| **line != "```");
        let body: Vec<&str> = body.copied().collect();
        found.push((n + 1, mark, language.to_string(), body.join("\n") + "\n"));
    }
    found
}

/// A folder in which the program is called `shakebench`.
fn program_folder(folder: &Path) -> PathBuf {
    let place = folder.join("bin");
    fs::create_dir(&place).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_shakebench"));
    let script = format!("#!/bin/sh\nexec '{}' \"$@\"\n", program.display());
    let file = place.join("shakebench");
    fs::write(&file, script).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    }
    place
}

/// Pieces of a line: numbers apart from the words between them, blanks as one.
fn pieces(line: &str) -> Vec<String> {
    let mut pieces: Vec<String> = Vec::new();
    for word in line.split_whitespace() {
        let number = word.trim_end_matches(['%', ',', ';', ':', ')', ']']);
        let number = number.trim_start_matches(['(', '[']);
        if number.parse::<f64>().is_ok() && number != word {
            pieces.push(number.to_string());
            pieces.push(word.replacen(number, "#", 1));
        } else {
            pieces.push(word.to_string());
        }
    }
    pieces
}

/// Whether a printed piece is the expected one: a number to the last digit that the book gives.
fn is_same(expected: &str, found: &str) -> bool {
    let (Ok(a), Ok(b)) = (expected.parse::<f64>(), found.parse::<f64>()) else {
        return expected == found;
    };
    let decimals = |text: &str| {
        let mantissa = text.split(['e', 'E']).next().unwrap_or(text);
        mantissa.split_once('.').map_or(0, |(_, rest)| rest.len())
    };
    let last = 0.1_f64.powi(decimals(expected).min(decimals(found)) as i32);
    // One in the last place, for another machine may round the other way.
    (a - b).abs() <= 1.01 * last.max(1e-12 * a.abs())
}

fn matches(expected: &str, found: &str) -> bool {
    let (expected, found) = (pieces(expected), pieces(found));
    let mut found = found.iter().peekable();
    let mut expected = expected.iter().peekable();
    while let Some(piece) = expected.next() {
        if piece == "..." {
            match expected.peek() {
                None => return true,
                Some(next) => {
                    while found.peek().is_some_and(|own| !is_same(next, own)) {
                        found.next();
                    }
                }
            }
            continue;
        }
        if !found.next().is_some_and(|own| is_same(piece, own)) {
            return false;
        }
    }
    found.next().is_none()
}

/// The block stands in the text, its lines in their order.
fn stands_in(expected: &str, printed: &str) -> Result<(), String> {
    let mut lines = printed.lines();
    for wanted in expected.lines() {
        if wanted.trim().is_empty() || wanted.trim() == "..." {
            continue;
        }
        if !lines.any(|line| matches(wanted, line)) {
            return Err(format!(
                "`{wanted}` is not in (or not in this order):\n{printed}"
            ));
        }
    }
    Ok(())
}

fn run_page(name: &str) {
    run_page_with(name, None, &[]);
}

/// The pages on measured rigs need their records.
fn run_page_on_records(name: &str, records: &Path) {
    let files = fs::read_dir(records).unwrap();
    let files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    run_page_with(name, None, &files);
}

/// The pages on OpenSees need it, and are skipped with a word on it without.
fn run_page_on_opensees(name: &str) {
    if let Some(python) = super::opensees::python() {
        run_page_with(name, Some(python), &[]);
    }
}

fn run_page_with(name: &str, python: Option<&Path>, files: &[PathBuf]) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../docs")
        .join(name);
    let text = fs::read_to_string(&page).unwrap();
    let blocks = blocks(&text);
    assert!(!blocks.is_empty(), "{name} has nothing that is run");
    let folder = tempfile::tempdir().unwrap();
    let programs = program_folder(folder.path());
    let work = folder.path().join("work");
    fs::create_dir(&work).unwrap();
    for file in files {
        fs::copy(file, work.join(file.file_name().unwrap())).unwrap();
    }
    let others = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(programs).chain(std::env::split_paths(&others));
    let paths = std::env::join_paths(paths).unwrap();
    let mut printed = String::new();
    for (line, mark, language, body) in blocks {
        match mark {
            Marked::File(file) => fs::write(work.join(file), body).unwrap(),
            Marked::Prints => stands_in(&body, &printed)
                .unwrap_or_else(|fault| panic!("docs/{name}:{line}: {fault}")),
            Marked::Run { fails } => {
                let mut command = match language.as_str() {
                    "sh" => Command::new("sh"),
                    "python" => Command::new("python3"),
                    other => panic!("docs/{name}:{line}: `{other}` is not run"),
                };
                if language == "sh" {
                    command.arg("-e");
                }
                let output = command
                    .arg("-c")
                    .arg(&body)
                    .current_dir(&work)
                    .env("PATH", &paths)
                    .envs(python.map(|python| ("SHAKEBENCH_PYTHON", python)))
                    .output()
                    .unwrap();
                printed = String::from_utf8_lossy(&output.stdout).into_owned();
                let errors = String::from_utf8_lossy(&output.stderr);
                assert_eq!(
                    output.status.code(),
                    Some(fails),
                    "docs/{name}:{line}: {body}{printed}{errors}"
                );
            }
        }
    }
}

#[test]
fn start_in_five_minutes() {
    run_page("start.md");
}

#[test]
fn seismic_qualification() {
    run_page("qualification.md");
}

#[test]
fn system_files() {
    run_page("system-files.md");
}

#[test]
fn your_own_parts() {
    run_page("your-own-parts.md");
}

#[test]
fn your_own_rig() {
    run_page("your-own-rig.md");
}

#[needs::shared("measured")]
#[test]
#[ignore = "half a minute of a core"]
fn a_motor_driven_table() {
    run_page_on_records(
        "motor-table.md",
        &super::ssp_of_others::shared().join("measured/motor_table"),
    );
}

#[test]
fn your_own_effects() {
    run_page("your-own-effects.md");
}

#[test]
fn reports_and_comparing_runs() {
    run_page("reports.md");
}

#[test]
fn campaigns() {
    run_page("campaigns.md");
}

#[test]
fn tuning() {
    run_page("tuning.md");
}

#[test]
fn iterative_control() {
    run_page("iterative-control.md");
}

#[test]
fn ssp_archives() {
    run_page("ssp.md");
}

#[test]
fn opensees_on_a_table() {
    run_page_on_opensees("opensees-on-a-table.md");
}

#[test]
fn our_rig_behind_opensees() {
    run_page_on_opensees("our-rig-behind-opensees.md");
}

#[test]
fn from_your_csv_to_a_diagnosis() {
    run_page("from-csv-to-diagnosis.md");
}

/// The recorded terminal of the book's first page shows what the program prints.
#[cfg(target_os = "linux")]
#[test]
fn the_recording_shows_what_the_program_prints() {
    let house = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let output = Command::new("python3")
        .arg(house.join("dist/recording"))
        .args(["--check", "--program", env!("CARGO_BIN_EXE_shakebench")])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
}

/// Every page is in the summary, every link leads somewhere within the book, and the summary names nothing
/// else.
#[test]
fn pages_and_links_are_there() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let docs = docs.canonicalize().unwrap();
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let mut pages: Vec<PathBuf> = Vec::new();
    let mut folders = vec![docs.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "md") {
                pages.push(path);
            }
        }
    }
    let mut faults = Vec::new();
    for page in &pages {
        let name = page
            .strip_prefix(&docs)
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/");
        let is_listed = summary.contains(&format!("({name})"));
        if !is_listed && name != "SUMMARY.md" {
            faults.push(format!("{name} is not in SUMMARY.md"));
        }
        let text = fs::read_to_string(page).unwrap();
        for link in text.split("](").skip(1) {
            let target = link.split([')', '#', ' ']).next().unwrap_or_default();
            if target.is_empty() || target.contains("://") {
                continue;
            }
            let found = page.parent().unwrap().join(target);
            if !found.exists() {
                faults.push(format!("{name} links to {target}, which is not there"));
            } else if !found.canonicalize().unwrap().starts_with(&docs) {
                faults.push(format!(
                    "{name} links to {target}, which is not in the book"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Source files of all crates.
fn sources(folder: &Path, found: &mut String) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            let name = path.file_name().unwrap_or_default();
            if name != "target" && name != "tests" {
                sources(&path, found);
            }
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push_str(&fs::read_to_string(&path).unwrap());
        }
    }
}

/// What the page of messages quotes is what the program says: every piece between dots stands in a
/// source file.
#[test]
fn messages_are_those_of_the_program() {
    let house = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut text = String::new();
    for folder in [
        "units",
        "plant",
        "controllers",
        "identification",
        "orchestrator",
        "fmus",
    ] {
        sources(&house.join(folder), &mut text);
    }
    // A message over several lines is one, and what is put in is like dots.
    let mut joined = String::new();
    for line in text.lines() {
        match line.trim_end().strip_suffix('\\') {
            Some(begun) if joined.ends_with('\u{1}') => {
                joined.pop();
                joined.push_str(begun.trim_start());
                joined.push('\u{1}');
            }
            Some(begun) => {
                joined.push_str(begun);
                joined.push('\u{1}');
            }
            None if joined.ends_with('\u{1}') => {
                joined.pop();
                joined.push_str(line.trim_start());
                joined.push('\n');
            }
            None => {
                joined.push_str(line);
                joined.push('\n');
            }
        }
    }
    let mut plain = String::new();
    let mut depth = 0;
    for letter in joined.chars().filter(|letter| *letter != '`') {
        match letter {
            '{' => depth += 1,
            '}' => {
                depth = (depth - 1).max(0);
                plain.push('\u{2}');
            }
            '\n' => {
                depth = 0;
                plain.push('\n');
            }
            other if depth == 0 => plain.push(other),
            _ => {}
        }
    }
    // Messages of the libraries that read TOML and JSON.
    plain.push_str("unknown field");
    let page = fs::read_to_string(house.join("docs/messages.md")).unwrap();
    let mut faults = Vec::new();
    let mut count = 0;
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let cell = row.split(" | ").next().unwrap_or_default();
        for message in cell.split('`').skip(1).step_by(2) {
            count += 1;
            for piece in message.split("...") {
                let piece = piece.trim_matches([' ', ':', ';', ',', '?']);
                if piece.len() > 3 && !plain.contains(piece) {
                    faults.push(format!("`{message}`: nothing says `{piece}`"));
                }
            }
        }
    }
    assert!(count > 40, "{count} messages");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn printed_figures_are_compared_to_their_last_digit() {
    let printed = "a line\nerror  3.387 %   12.0 ms\nother";
    assert!(stands_in("error 3.39 % ... ms", printed).is_ok());
    assert!(stands_in("error 3.37 % 12 ms", printed).is_err());
    assert!(stands_in("other\na line", printed).is_err());
    assert!(stands_in("error 3.387 %", printed).is_err());
}
