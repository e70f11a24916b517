//! What comes from outside: the motion that the table is asked for and input tables, as sources of
//! signals.

use crate::motion::Motion;
use crate::system::{InputTable, Quantity};

/// Histories of the motion, input tables, and the signals that are taken from them.
pub(super) struct Reference {
    histories: [Vec<f64>; 3],
    tables: Vec<InputTable>,
    /// What each of the first signals is.
    taps: Vec<Tap>,
    /// Where each tap's table was last looked up.
    rows: Vec<usize>,
}

/// A signal from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tap {
    /// Which history of the motion, and how many samples ahead.
    Motion(usize, isize),
    /// Which column of which table.
    Table(usize, usize),
}

impl Reference {
    pub(super) fn new(motion: &Motion, tables: &[InputTable]) -> Self {
        Self {
            histories: [
                motion.displacement.clone(),
                motion.velocity.clone(),
                motion.acceleration.clone(),
            ],
            tables: tables.to_vec(),
            taps: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// The signal of a quantity `ahead` samples ahead.
    pub(super) fn tap(&mut self, quantity: Quantity, ahead: isize) -> usize {
        let history = Quantity::ALL
            .iter()
            .position(|&q| q == quantity)
            .unwrap_or(0);
        self.place(Tap::Motion(history, ahead))
    }

    /// The signal of a column of an input table.
    pub(super) fn tap_table(&mut self, table: usize, column: usize) -> usize {
        self.place(Tap::Table(table, column))
    }

    fn place(&mut self, tap: Tap) -> usize {
        let known = self.taps.iter().position(|&known| known == tap);
        known.unwrap_or_else(|| {
            self.taps.push(tap);
            self.rows.push(0);
            self.taps.len() - 1
        })
    }

    /// Number of signals.
    pub(super) fn len(&self) -> usize {
        self.taps.len()
    }

    /// Puts the values at `sample` of the motion and at `time`, s, of the tables into the first
    /// signals; before its beginning the motion rests at zero, after its end at its last
    /// displacement.
    pub(super) fn sample(&mut self, sample: usize, time: f64, signals: &mut [f64]) {
        let taps = self.taps.iter().zip(&mut self.rows);
        for (signal, (tap, row)) in signals.iter_mut().zip(taps) {
            *signal = match *tap {
                Tap::Table(table, column) => self.tables[table].at(column, time, row),
                Tap::Motion(history, ahead) => {
                    let values = &self.histories[history];
                    let at_rest = if history == 0 {
                        values.last().copied().unwrap_or(0.0)
                    } else {
                        0.0
                    };
                    sample
                        .checked_add_signed(ahead)
                        .map_or(0.0, |place| values.get(place).copied().unwrap_or(at_rest))
                }
            };
        }
    }
}
