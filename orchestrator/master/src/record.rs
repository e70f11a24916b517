//! The recorded signals: one row per sample.

use std::ops::Range;

use fmi_import::Datum;

/// Signals over time, SI units.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Record {
    /// Names of the columns, the first is `time`.
    pub columns: Vec<String>,
    values: Vec<f64>,
    /// Names of columns that numbers do not hold: texts, binaries, whole numbers of 64 bits.
    pub exact_columns: Vec<String>,
    exact: Vec<Datum>,
}

impl Record {
    /// Makes room for so many rows, so that filling them allocates nothing.
    pub fn with_capacity(columns: Vec<String>, rows: usize) -> Self {
        let values = Vec::with_capacity(rows * columns.len());
        Self {
            columns,
            values,
            ..Self::default()
        }
    }

    /// The same with columns that numbers do not hold.
    pub fn beside(mut self, names: &[String]) -> Self {
        self.exact_columns = names.to_vec();
        self
    }

    /// Adds the rows of a record with the same columns.
    pub fn append(&mut self, other: &Self) {
        self.values.extend_from_slice(&other.values);
        self.exact.extend_from_slice(&other.exact);
    }

    /// The rows from `row` on, as one: numbers, and values that numbers do not hold.
    pub fn rows_from(&self, row: usize) -> (&[f64], &[Datum]) {
        let numbers = self.values.get(row * self.columns.len()..);
        let exact = self.exact.get(row * self.exact_columns.len()..);
        (numbers.unwrap_or_default(), exact.unwrap_or_default())
    }

    /// A record of whole rows; none where the numbers do not fill them.
    pub fn of(
        columns: Vec<String>,
        values: Vec<f64>,
        exact_columns: Vec<String>,
        exact: Vec<Datum>,
    ) -> Option<Self> {
        let whole = values.len().is_multiple_of(columns.len().max(1));
        let rows = values.len() / columns.len().max(1);
        (whole && exact.len() == rows * exact_columns.len()).then_some(Self {
            columns,
            values,
            exact_columns,
            exact,
        })
    }

    /// Adds a row.
    pub fn push(&mut self, time: f64, signals: &[f64], exact: &[Datum]) {
        self.push_with(
            time,
            signals,
            std::slice::from_ref(&(0..signals.len())),
            &[],
            exact,
        );
    }

    /// Adds a row: of the signals those at the places `kept`, and some once more behind.
    pub fn push_with(
        &mut self,
        time: f64,
        signals: &[f64],
        kept: &[Range<usize>],
        again: &[usize],
        exact: &[Datum],
    ) {
        self.values.push(time);
        for places in kept {
            self.values.extend_from_slice(&signals[places.clone()]);
        }
        self.values
            .extend(again.iter().map(|&signal| signals[signal]));
        self.exact.extend_from_slice(exact);
    }

    /// Adds a column behind the others, with a value for each row.
    pub(crate) fn add_column(&mut self, name: &str, values: &[f64]) {
        let width = self.columns.len().max(1);
        let rows = self.values.chunks_exact(width).zip(values);
        self.values = rows
            .flat_map(|(row, value)| row.iter().chain(std::iter::once(value)))
            .copied()
            .collect();
        self.columns.push(name.to_string());
    }

    /// Forgets all rows but the first `rows`.
    pub(crate) fn truncate(&mut self, rows: usize) {
        self.values.truncate(rows * self.columns.len());
        self.exact.truncate(rows * self.exact_columns.len());
    }

    /// The values of a row that numbers do not hold, in the order of `exact_columns`.
    pub fn exact(&self, row: usize) -> &[Datum] {
        let width = self.exact_columns.len();
        self.exact
            .get(row * width..(row + 1) * width)
            .unwrap_or_default()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns.len().max(1)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The rows.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.columns.len().max(1))
    }

    /// The history of a column.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.columns.iter().position(|column| column == name)?;
        Some(self.rows().map(|row| row[place]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns besides the time, and one of whole numbers: `row` has 10 row + 1 and 10 row + 2.
    fn record(rows: usize) -> Record {
        let columns = ["time", "a", "b"].map(String::from).to_vec();
        let mut record = Record::with_capacity(columns, rows).beside(&["n".to_string()]);
        for row in 0..rows {
            let first = 10.0 * row as f64;
            let exact = [Datum::Signed(row as i64)];
            record.push(row as f64, &[first + 1.0, first + 2.0], &exact);
        }
        record
    }

    #[test]
    fn rows_have_a_value_for_each_column_and_are_found_from_any_on() {
        let own = record(3);
        assert_eq!((own.len(), own.is_empty()), (3, false));
        assert_eq!(own.column("b"), Some(vec![2.0, 12.0, 22.0]));
        assert_eq!(own.column("n"), None);
        let (numbers, exact) = own.rows_from(1);
        assert_eq!(numbers, [1.0, 11.0, 12.0, 2.0, 21.0, 22.0]);
        assert_eq!(exact, [Datum::Signed(1), Datum::Signed(2)]);
        assert_eq!(own.rows_from(4), (&[][..], &[][..]));
        assert_eq!(own.exact(2), [Datum::Signed(2)]);
        assert!(own.exact(3).is_empty() && Record::default().is_empty());
    }

    #[test]
    fn a_record_is_put_together_of_its_parts() {
        let whole = record(4);
        let mut first = record(4);
        first.truncate(2);
        assert_eq!(first, record(2));
        let (numbers, exact) = whole.rows_from(2);
        let (columns, names) = (whole.columns.clone(), whole.exact_columns.clone());
        let rest = Record::of(
            columns.clone(),
            numbers.to_vec(),
            names.clone(),
            exact.to_vec(),
        );
        first.append(&rest.unwrap());
        assert_eq!(first, whole);
        // Part of a row, and a value too few.
        let part = Record::of(columns.clone(), vec![0.0; 4], names.clone(), Vec::new());
        assert_eq!(part, None);
        assert_eq!(Record::of(columns, vec![0.0; 3], names, Vec::new()), None);
    }

    #[test]
    fn a_row_has_the_signals_that_are_kept_and_some_again() {
        let mut own = Record::with_capacity(vec![String::new(); 5], 1);
        own.push_with(0.5, &[1.0, 2.0, 3.0, 4.0], &[0..1, 2..4], &[1], &[]);
        let rows: Vec<&[f64]> = own.rows().collect();
        assert_eq!(rows, [[0.5, 1.0, 3.0, 4.0, 2.0]]);
        own.add_column("more", &[7.0]);
        assert_eq!(own.column("more"), Some(vec![7.0]));
        assert_eq!(own.len(), 1);
    }
}
