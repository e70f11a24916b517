//! What comes from outside: the motion that the table is asked for and input tables, as sources of
//! signals.

use super::samples::{Column, Samples};
use fmi_system::{Between, InputTable, Quantity};

/// Histories of the motion, input tables, and the signals that are taken from them.
pub(super) struct Reference {
    histories: Vec<Column>,
    tables: Vec<InputTable>,
    /// What each of the first signals is.
    taps: Vec<Tap>,
    /// Where each tap's table was last looked up.
    rows: Vec<usize>,
    /// The taps of the motion, those that follow each other together.
    spans: Vec<Span>,
    /// How many taps the spans were made of.
    planned: usize,
    /// Displacement, velocity and acceleration along the first axis, where somebody outside says them; a second
    /// axis rests then.
    now: Option<[f64; 3]>,
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
    pub(super) fn new(motion: &Samples, tables: &[InputTable]) -> Self {
        Self {
            histories: motion.columns.clone(),
            tables: tables.to_vec(),
            taps: Vec::new(),
            rows: Vec::new(),
            spans: Vec::new(),
            planned: 0,
            now: None,
        }
    }

    /// From now on somebody outside says what is asked for.
    pub(super) fn take_from_outside(&mut self) {
        self.now = Some([0.0; 3]);
    }

    /// What somebody outside asks for: displacement, velocity, acceleration, and what the only row of
    /// the table `name` holds.
    pub(super) fn set_now(&mut self, now: [f64; 3], name: &str, columns: &[f64]) {
        self.now = Some(now);
        if columns.is_empty() {
            return;
        }
        let table = self.tables.iter_mut().find(|table| table.name == name);
        for (column, value) in table.into_iter().flat_map(|t| &mut t.values).zip(columns) {
            column.fill(*value);
        }
    }

    /// A signal that is wanted before its time.
    pub(super) fn ahead_of_time(&self) -> Option<usize> {
        let ahead = |tap: &Tap| matches!(tap, Tap::Motion(_, ahead) if *ahead != 0);
        self.taps.iter().position(ahead)
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
    /// signals; before its beginning a history is zero, after its end what it says
    /// itself.
    pub(super) fn sample(&mut self, sample: usize, time: f64, signals: &mut [f64]) {
        if self.planned != self.taps.len() {
            self.plan();
        }
        for span in &self.spans {
            let history = self.histories.get(span.history);
            let (values, at_rest) =
                history.map_or((&[][..], 0.0), |own| (&own.values[..], own.after));
            let signals = &mut signals[span.first..span.first + span.count];
            if let Some(now) = self.now {
                signals.fill(now.get(span.history).copied().unwrap_or(0.0));
                continue;
            }
            let from = sample.checked_add_signed(span.ahead);
            let there = from.and_then(|from| values.get(from..from + span.count));
            if let Some(there) = there {
                signals.copy_from_slice(there);
                continue;
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Three histories of four samples that rest at 9 afterwards: 10, 11...; 20, 21...; 30, 31...
    fn reference() -> Reference {
        let history = |first: f64| Column {
            values: (0..4).map(|at| first + f64::from(at)).collect(),
            after: 9.0,
        };
        let samples = Samples {
            period: 0.1,
            columns: [10.0, 20.0, 30.0].map(history).to_vec(),
        };
        Reference::new(&samples, &[])
    }

    #[test]
    fn signals_are_samples_ahead_and_behind_of_their_histories() {
        let mut own = reference();
        let taps = [
            (Quantity::Displacement, 0),
            (Quantity::Displacement, 1),
            (Quantity::Displacement, 2),
            (Quantity::Velocity, -1),
            (Quantity::Acceleration, 0),
        ];
        for (at, (quantity, ahead)) in taps.into_iter().enumerate() {
            assert_eq!(own.tap(quantity, ahead), at);
        }
        // One that is there already.
        assert_eq!((own.tap(Quantity::Displacement, 1), own.len()), (1, 5));
        assert_eq!(own.ahead_of_time(), Some(1));
        let shifted: Vec<bool> = (0..6).map(|signal| own.is_shifted(signal)).collect();
        assert_eq!(shifted, [false, true, true, true, false, false]);
        for (sample, expected) in [
            (0, [10.0, 11.0, 12.0, 0.0, 30.0]),
            (1, [11.0, 12.0, 13.0, 20.0, 31.0]),
            (3, [13.0, 9.0, 9.0, 22.0, 33.0]),
            (5, [9.0, 9.0, 9.0, 9.0, 9.0]),
        ] {
            let mut signals = [f64::NAN; 5];
            own.sample(sample, 0.1 * sample as f64, &mut signals);
            assert_eq!(signals, expected, "{sample}");
        }
        own.take_from_outside();
        own.set_now([1.0, 2.0, 3.0], "", &[]);
        let mut signals = [f64::NAN; 5];
        own.sample(2, 0.2, &mut signals);
        assert_eq!(signals, [1.0, 1.0, 1.0, 2.0, 3.0]);
    }
}
