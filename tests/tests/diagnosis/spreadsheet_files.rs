//! A case that a laboratory's spreadsheet has saved again gives the same data and the same verdict.

use std::path::{Path, PathBuf};

use acceptance::shared;
use hidden_effects::{Case as Generated, Kind, Settings};
use identification::data::{Channel, Recording};
use identification::diagnosis::engine::Observer;
use identification::diagnosis::{Subject, diagnose};

/// How a spreadsheet saves a file.
#[derive(Debug, Clone, Copy)]
struct Spreadsheet {
    separator: &'static str,
    decimal_comma: bool,
    byte_order_mark: bool,
    windows_line_ends: bool,
    /// Text cells stand in quotes, and numbers too where they hold the separator.
    quotes: bool,
    milliseconds: bool,
    units_in_a_row: bool,
}

const PLAIN: Spreadsheet = Spreadsheet {
    separator: ",",
    decimal_comma: false,
    byte_order_mark: false,
    windows_line_ends: false,
    quotes: false,
    milliseconds: false,
    units_in_a_row: false,
};

/// Set to German, as saved on Windows; time in ms.
const GERMAN: Spreadsheet = Spreadsheet {
    separator: ";",
    decimal_comma: true,
    byte_order_mark: true,
    windows_line_ends: true,
    quotes: true,
    milliseconds: true,
    units_in_a_row: false,
};

const SPREADSHEETS: [Spreadsheet; 5] = [
    GERMAN,
    Spreadsheet {
        windows_line_ends: true,
        quotes: true,
        ..PLAIN
    },
    // Commas part the cells and the decimals, so that numbers are quoted.
    Spreadsheet {
        decimal_comma: true,
        quotes: true,
        ..PLAIN
    },
    Spreadsheet {
        separator: "\t",
        units_in_a_row: true,
        ..PLAIN
    },
    Spreadsheet {
        separator: ";",
        milliseconds: true,
        byte_order_mark: true,
        ..PLAIN
    },
];

impl Spreadsheet {
    /// The text of a plain file as this one saves it.
    fn save(self, plain: &str) -> String {
        let end = if self.windows_line_ends { "\r\n" } else { "\n" };
        let mut text = String::from(if self.byte_order_mark { "\u{feff}" } else { "" });
        let mut put = |cells: &[String]| {
            let quoted = |cell: &String| {
                let is_text = cell.replace(',', ".").parse::<f64>().is_err();
                let must = cell.contains(self.separator);
                match self.quotes && (is_text || must) {
                    true => format!("\"{cell}\""),
                    false => cell.clone(),
                }
            };
            let cells: Vec<String> = cells.iter().map(quoted).collect();
            text += &cells.join(self.separator);
            text += end;
        };
        for (row, line) in plain.lines().enumerate() {
            let mut cells: Vec<String> = line.split(',').map(String::from).collect();
            if row == 0 {
                if self.milliseconds {
                    cells[0] = "Time (ms)".into();
                }
                if self.units_in_a_row {
                    let part = |cell: &String| {
                        let (name, unit) = cell.split_once(" [").unwrap();
                        (name.to_string(), unit.trim_end_matches(']').to_string())
                    };
                    let (names, units): (Vec<_>, Vec<_>) = cells.iter().map(part).unzip();
                    put(&names);
                    cells = units;
                }
            } else {
                if self.milliseconds {
                    let seconds: f64 = cells[0].parse().unwrap();
                    cells[0] = format!("{}", (seconds * 1e6).round() / 1e3);
                }
                if self.decimal_comma {
                    cells
                        .iter_mut()
                        .for_each(|cell| *cell = cell.replace('.', ","));
                }
            }
            put(&cells);
        }
        text
    }
}

/// Saves all of a case again.
fn save_case(from: &Path, to: &Path, by: Spreadsheet) {
    for entry in std::fs::read_dir(from).unwrap() {
        let file = entry.unwrap().path();
        let text = std::fs::read_to_string(&file).unwrap();
        let text = match file.extension().is_some_and(|e| e == "csv") {
            true => by.save(&text),
            false => text,
        };
        std::fs::write(to.join(file.file_name().unwrap()), text).unwrap();
    }
}

fn is_the_same(plain: &Recording, other: &Recording, what: &str) {
    assert_eq!(other.notes, plain.notes, "{what}");
    for channel in Channel::KNOWN {
        let bits = |recording: &Recording| -> Vec<u64> {
            recording
                .samples(channel)
                .iter()
                .map(|v| v.to_bits())
                .collect()
        };
        assert!(bits(other) == bits(plain), "{what}: {}", channel.name());
    }
    let (before, after) = (plain.stamps().unwrap(), other.stamps().unwrap());
    assert_eq!(before.len(), after.len(), "{what}");
    for (before, after) in before.iter().zip(after) {
        // A thousandth of a whole number and a decimal fraction may round apart in the last digit.
        assert!((before - after).abs() <= 1e-15 * before.abs(), "{what}");
    }
}

fn every_file_reads_the_same(case: &Path) {
    for entry in std::fs::read_dir(case).unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_none_or(|e| e != "csv") {
            continue;
        }
        let text = std::fs::read_to_string(&file).unwrap();
        let plain = Recording::read(&file, "plain").unwrap();
        let folder = tempfile::tempdir().unwrap();
        for spreadsheet in SPREADSHEETS {
            let saved = folder.path().join("saved.csv");
            std::fs::write(&saved, spreadsheet.save(&text)).unwrap();
            let other = Recording::read(&saved, "plain").unwrap();
            is_the_same(
                &plain,
                &other,
                &format!("{}: {spreadsheet:?}", file.display()),
            );
        }
    }
}

fn verdict(case: &Path) -> String {
    let subject = Subject::read(case, &[], None).unwrap();
    let diagnosis = diagnose(&subject, Observer::none()).unwrap();
    serde_json::to_string(&diagnosis.report()).unwrap()
}

/// A generated case.
fn write_case(folder: &Path) {
    let settings = Settings {
        duration: 8.0,
        ..Settings::new(Kind::This("load_cell_bias"))
    };
    println!("seed 1");
    Generated::draw(1, &settings).write(folder).unwrap();
}

#[test]
fn a_case_saved_by_a_spreadsheet_holds_the_same_numbers() {
    let case = tempfile::tempdir().unwrap();
    write_case(case.path());
    every_file_reads_the_same(case.path());
}

#[needs::shared("hidden-effects/cases")]
#[test]
fn the_practice_cases_saved_by_a_spreadsheet_hold_the_same_numbers() {
    let entries = std::fs::read_dir(shared::folder().join("hidden-effects/cases")).unwrap();
    let cases: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    for case in cases.iter().filter(|case| case.is_dir()) {
        every_file_reads_the_same(case);
    }
}

#[test]
fn a_case_saved_by_a_spreadsheet_gives_the_same_verdict_to_the_digit() {
    let generated = tempfile::tempdir().unwrap();
    let case = generated.path();
    write_case(case);
    let saved = tempfile::tempdir().unwrap();
    save_case(case, saved.path(), GERMAN);
    assert_eq!(verdict(saved.path()), verdict(case));
}
