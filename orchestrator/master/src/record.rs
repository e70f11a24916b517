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
