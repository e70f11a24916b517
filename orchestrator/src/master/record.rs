//! What was recorded: a row a sample.

use crate::fmu::Datum;

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
    pub(crate) fn with_capacity(names: &[String], rows: usize) -> Self {
        let mut columns = vec!["time".to_string()];
        columns.extend_from_slice(names);
        let values = Vec::with_capacity(rows * columns.len());
        Self {
            columns,
            values,
            ..Self::default()
        }
    }

    /// The same with columns that numbers do not hold.
    pub(crate) fn beside(mut self, names: &[String]) -> Self {
        self.exact_columns = names.to_vec();
        self
    }

    pub(crate) fn push(&mut self, time: f64, signals: &[f64], exact: &[Datum]) {
        self.values.push(time);
        self.values.extend_from_slice(signals);
        self.exact.extend_from_slice(exact);
    }

    /// As [`Record::push`], with some signals once more behind.
    pub(crate) fn push_with(
        &mut self,
        time: f64,
        signals: &[f64],
        again: &[usize],
        exact: &[Datum],
    ) {
        self.push(time, signals, exact);
        self.values
            .extend(again.iter().map(|&signal| signals[signal]));
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
