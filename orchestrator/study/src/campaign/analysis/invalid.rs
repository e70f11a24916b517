//! Runs whose input a component refuses. They say nothing about the rig, and no figure counts them.

use serde::Serialize;

use crate::campaign::table::{INVALID, Table};

/// Runs that have the same fault.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Invalid {
    /// What is wrong, as the first of them has it.
    pub reason: String,
    /// How many they are.
    pub runs: usize,
    /// Number of the first.
    pub first: usize,
}

/// `table` without runs that could not begin, and these by their fault, the most frequent first.
pub fn without_invalid(table: &Table) -> (Table, Vec<Invalid>) {
    let (ended, reasons) = (table.texts("ended"), table.texts("reason"));
    let numbers = table.numbers("number");
    let mut valid = Table {
        columns: table.columns.clone(),
        rows: Vec::new(),
    };
    let mut found: Vec<(String, Invalid)> = Vec::new();
    for (row, cells) in table.rows.iter().enumerate() {
        if ended.get(row) != Some(&INVALID) {
            valid.rows.push(cells.clone());
            continue;
        }
        let reason = reasons.get(row).copied().unwrap_or_default();
        let fault = without_numbers(reason);
        match found.iter_mut().find(|(known, _)| *known == fault) {
            Some((_, known)) => known.runs += 1,
            None => found.push((
                fault,
                Invalid {
                    reason: reason.to_string(),
                    runs: 1,
                    first: numbers.get(row).map_or(row, |number| *number as usize),
                },
            )),
        }
    }
    found.sort_by_key(|(_, own)| std::cmp::Reverse(own.runs));
    (valid, found.into_iter().map(|(_, own)| own).collect())
}

/// Two runs have the same fault where its words are the same.
fn without_numbers(reason: &str) -> String {
    let words = reason.split_whitespace();
    let words = words.filter(|word| !word.contains(|letter: char| letter.is_ascii_digit()));
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table::{Cell, Column, Kind, Role};

    #[test]
    fn runs_that_cannot_begin_are_counted_by_their_fault_and_left_out() {
        let column = |name: &str, role, kind| Column {
            name: name.into(),
            unit: None,
            role,
            kind,
        };
        let columns = vec![
            column("number", Role::Run, Kind::Number),
            column("ended", Role::Ending, Kind::Text),
            column("reason", Role::Ending, Kind::Text),
        ];
        let row = |number: f64, ended: &str, reason: &str| {
            vec![Cell::Number(number), ended.into(), reason.into()]
        };
        let rows = vec![
            row(0.0, "complete", ""),
            row(3.0, "invalid", "mass is 0 kg"),
            row(4.0, "invalid", "overlap is 1.5 V, expected less than 1"),
            row(5.0, "failed", "overlap is 1.5 V"),
            row(9.0, "invalid", "overlap is 2.5 V, expected less than 1"),
        ];
        let (valid, invalid) = without_invalid(&Table { columns, rows });
        assert_eq!(valid.numbers("number"), [0.0, 5.0]);
        let found: Vec<(&str, usize, usize)> = invalid
            .iter()
            .map(|own| (own.reason.as_str(), own.runs, own.first))
            .collect();
        assert_eq!(
            found,
            [
                ("overlap is 1.5 V, expected less than 1", 2, 4),
                ("mass is 0 kg", 1, 3)
            ]
        );
    }
}
