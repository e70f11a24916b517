//! The values of all sources of connections and all outputs.

use fmi_import::Datum;

/// Where a signal stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// Among the numbers.
    Number(usize),
    /// Among the values that a number does not hold.
    Exact(usize),
}

/// Values of signals.
#[derive(Debug, Clone, Default)]
pub(super) struct Signals {
    /// Numbers, SI.
    pub numbers: Vec<f64>,
    /// Texts, binaries, and whole numbers of 64 bits.
    pub exact: Vec<Datum>,
}

impl Signals {
    /// Takes the values of others of the same length.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.numbers.copy_from_slice(&other.numbers);
        self.exact.clone_from_slice(&other.exact);
    }
}
