//! Histories that come from outside, sampled with one period.

/// A history.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Column {
    /// Its samples, SI.
    pub values: Vec<f64>,
    /// What it is after its last sample; before the first it is zero.
    pub after: f64,
}

/// What the whole system follows: histories of equal length. A connection takes a sample of one, at the
/// present tick or some samples before or after it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Time between two samples, s.
    pub period: f64,
    /// The histories, in the order of [`Quantity::ALL`](fmi_system::Quantity::ALL): three of one axis,
    /// six of two; none where the system follows nothing.
    pub columns: Vec<Column>,
}

impl Samples {
    /// No histories; rows of the record are `period` seconds apart.
    #[must_use]
    pub fn none(period: f64) -> Self {
        Self {
            period,
            columns: Vec::new(),
        }
    }

    /// Samples of each history.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
