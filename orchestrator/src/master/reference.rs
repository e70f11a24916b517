//! What comes from outside: the motion that the table is asked for and input tables, as sources of
//! signals.

use crate::motion::Motion;
use crate::system::{Between, InputTable, Quantity};

/// Histories of the motion, input tables, and the signals that are taken from them.
pub(super) struct Reference {
    histories: [Vec<f64>; 3],
    tables: Vec<InputTable>,
    /// What each of the first signals is.
    taps: Vec<Tap>,
    /// Where each tap's table was last looked up.
    rows: Vec<usize>,
    /// The taps of the motion, those that follow each other together.
    spans: Vec<Span>,
    /// How many taps the spans were made of.
    planned: usize,
}

/// Signals side by side that are samples of one history side by side.
struct Span {
    history: usize,
    /// Samples ahead of the first.
    ahead: isize,
    /// The first signal.
    first: usize,
    count: usize,
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
            spans: Vec::new(),
            planned: 0,
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

    /// Whether a signal is one that lies ahead or behind: the same history some samples later.
    pub(super) fn is_shifted(&self, signal: usize) -> bool {
        matches!(self.taps.get(signal), Some(Tap::Motion(_, ahead)) if *ahead != 0)
    }

    /// Finds the spans of all taps.
    fn plan(&mut self) {
        self.spans.clear();
        for (signal, tap) in self.taps.iter().enumerate() {
            let Tap::Motion(history, ahead) = *tap else {
                continue;
            };
            if let Some(last) = self.spans.last_mut()
                && last.history == history
                && last.first + last.count == signal
                && last.ahead + last.count as isize == ahead
            {
                last.count += 1;
                continue;
            }
            self.spans.push(Span {
                history,
                ahead,
                first: signal,
                count: 1,
            });
        }
        self.planned = self.taps.len();
    }

    /// Puts the values at `sample` of the motion and at `time`, s, of the tables into the first
    /// signals; before its beginning the motion rests at zero, after its end at its last
    /// displacement.
    pub(super) fn sample(&mut self, sample: usize, time: f64, signals: &mut [f64]) {
        if self.planned != self.taps.len() {
            self.plan();
        }
        for span in &self.spans {
            let values = &self.histories[span.history];
            let signals = &mut signals[span.first..span.first + span.count];
            let from = sample.checked_add_signed(span.ahead);
            let there = from.and_then(|from| values.get(from..from + span.count));
            if let Some(there) = there {
                signals.copy_from_slice(there);
                continue;
            }
            let at_rest = match span.history {
                0 => values.last().copied().unwrap_or(0.0),
                _ => 0.0,
            };
            for (signal, ahead) in signals.iter_mut().zip(span.ahead..) {
                let place = sample.checked_add_signed(ahead);
                *signal = place.map_or(0.0, |place| values.get(place).copied().unwrap_or(at_rest));
            }
        }
        self.look_up(time, signals, |_| true);
    }

    /// Puts what tables hold on straight lines a moment before `time`, s, into their signals: where two
    /// rows have that time, it is what the first says.
    pub(super) fn ahead(&mut self, time: f64, signals: &mut [f64]) {
        let before = time - 4e-9 * time.abs().max(1e-3);
        self.look_up(before, signals, |table| table.between == Between::Linear);
    }

    #[inline]
    fn look_up(&mut self, time: f64, signals: &mut [f64], is_wanted: fn(&InputTable) -> bool) {
        if self.tables.is_empty() {
            return;
        }
        let taps = self.taps.iter().zip(&mut self.rows);
        for (signal, (tap, row)) in signals.iter_mut().zip(taps) {
            if let Tap::Table(table, column) = *tap
                && is_wanted(&self.tables[table])
            {
                *signal = self.tables[table].at(column, time, row);
            }
        }
    }
}
