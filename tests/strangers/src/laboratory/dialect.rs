//! How laboratories write tables of numbers down.

use std::fmt::Write as _;

use crate::dice::Dice;

/// A language with its habits.
#[derive(Debug, Clone)]
pub struct Dialect {
    language: usize,
    separator: char,
    decimal_comma: bool,
    /// Millimetres and g, or inches and g, or metres and m/s².
    units: usize,
    milliseconds: bool,
    titles: usize,
    unit_row: bool,
    latin: bool,
}

/// Headers by language: time, command, displacement, acceleration, force.
const HEADERS: [[&str; 5]; 3] = [
    ["Time", "Command", "Displacement", "Acceleration", "Force"],
    ["Zeit", "Sollwert", "Weg", "Beschleunigung", "Kraft"],
    ["Temps", "Consigne", "Déplacement", "Accélération", "Effort"],
];

const TITLES: [[&str; 2]; 3] = [
    ["Shake table test", "Operator: J. Smith"],
    ["Rütteltisch, Versuch", "Prüfer: Müller"],
    ["Essai table vibrante n°", "Opérateur : Lefèvre"],
];

/// Name and factor from SI, of length, acceleration and force.
const UNITS: [[(&str, f64); 3]; 3] = [
    [("mm", 1e3), ("g", 1.0 / 9.806_65), ("kN", 1e-3)],
    [
        ("in", 1.0 / 0.0254),
        ("g", 1.0 / 9.806_65),
        ("lbf", 1.0 / 4.448_221_615),
    ],
    [("m", 1.0), ("m/s²", 1.0), ("N", 1.0)],
];

impl Dialect {
    /// Drawn.
    pub fn draw(dice: &mut Dice) -> Self {
        let language = dice.pick(&[0, 1, 2]);
        let continental = language > 0;
        Self {
            language,
            separator: if continental {
                dice.pick(&[';', ';', '\t'])
            } else {
                dice.pick(&[',', ',', '\t'])
            },
            decimal_comma: continental && dice.chance(0.8),
            units: if continental {
                dice.pick(&[0, 0, 2])
            } else {
                dice.pick(&[0, 1, 1])
            },
            milliseconds: dice.chance(0.3),
            titles: dice.pick(&[0, 0, 1, 2]),
            unit_row: dice.chance(0.25),
            latin: continental && dice.chance(0.3),
        }
    }

    /// Names of the files.
    pub fn files(&self) -> [&'static str; 3] {
        [
            ["test01.csv", "test02.csv", "test03.csv"],
            ["Versuch_1.csv", "Versuch_2.csv", "Versuch_3.csv"],
            ["essai_1.csv", "essai_2.csv", "essai_3.csv"],
        ][self.language]
    }

    /// The file of rows in SI.
    pub fn write(&self, rows: &[Vec<f64>], rate: f64, width: usize, number: usize) -> Vec<u8> {
        let separator = self.separator.to_string();
        let mut text = String::new();
        for title in &TITLES[self.language][..self.titles] {
            let _ = writeln!(text, "{title} {}", number + 1);
        }
        let [length, acceleration, force] = UNITS[self.units];
        let time = if self.milliseconds {
            ("ms", 1e3)
        } else {
            ("s", 1.0)
        };
        let columns = [time, length, length, acceleration, force];
        let columns = &columns[..=width];
        let headers = HEADERS[self.language]
            .iter()
            .zip(columns)
            .map(|(name, (unit, _))| {
                if self.unit_row {
                    (*name).to_string()
                } else if self.language == 0 {
                    format!("{name} ({unit})")
                } else {
                    format!("{name} [{unit}]")
                }
            });
        let _ = writeln!(text, "{}", headers.collect::<Vec<_>>().join(&separator));
        if self.unit_row {
            let units: Vec<&str> = columns.iter().map(|(unit, _)| *unit).collect();
            let _ = writeln!(text, "{}", units.join(&separator));
        }
        // Times are printed with as many digits as a logger has.
        let digits = if self.milliseconds || rate == 100.0 {
            2
        } else {
            4
        };
        for row in rows {
            let cells = row
                .iter()
                .zip(columns)
                .enumerate()
                .map(|(i, (value, (_, factor)))| {
                    let cell = if i == 0 {
                        format!("{:.digits$}", value * factor)
                    } else {
                        format!("{:.6}", value * factor)
                    };
                    if self.decimal_comma {
                        cell.replace('.', ",")
                    } else {
                        cell
                    }
                });
            let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join(&separator));
        }
        if self.latin {
            return text
                .chars()
                .map(|c| u8::try_from(u32::from(c)).unwrap_or(b'?'))
                .collect();
        }
        text.into_bytes()
    }
}
