//! What a run shows during its steps: a few of its signals, written by the steps and read by
//! whoever watches.
//!
//! Room for every row of the run is made before it begins. A step stores its values there and then
//! counts the row; nobody locks, waits or allocates, and a reader sees whole rows only.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use fmi_master::Observer;

/// Signals of a run, row by row, as 32-bit floats in SI units.
#[derive(Debug)]
pub struct Tap {
    /// Places of the shown signals among the signals of the simulation.
    places: Vec<usize>,
    /// Row after row: time, then the signals.
    values: Vec<AtomicU32>,
    rows: AtomicUsize,
    /// How the run ended, in words.
    ended: Mutex<Option<String>>,
}

impl Tap {
    /// Room for so many rows of the signals at these places.
    #[must_use]
    pub fn new(places: Vec<usize>, rows: usize) -> Self {
        let width = 1 + places.len();
        Self {
            places,
            values: (0..rows * width).map(|_| AtomicU32::new(0)).collect(),
            rows: AtomicUsize::new(0),
            ended: Mutex::new(None),
        }
    }

    /// Adds a row: the time (s) and the signals of the simulation. A row beyond the room is left out.
    pub fn push(&self, time: f64, signals: &[f64]) {
        let row = self.rows.load(Ordering::Relaxed);
        let width = 1 + self.places.len();
        let Some(room) = self.values.get(row * width..(row + 1) * width) else {
            return;
        };
        let signals = self.places.iter().map(|&place| signals[place]);
        for (cell, value) in room.iter().zip(std::iter::once(time).chain(signals)) {
            cell.store((value as f32).to_bits(), Ordering::Relaxed);
        }
        self.rows.store(row + 1, Ordering::Release);
    }

    /// Rows from `from` on, at most so many; each is time and signals.
    #[must_use]
    pub fn rows(&self, from: usize, most: usize) -> Vec<Vec<f32>> {
        let width = 1 + self.places.len();
        let end = self
            .rows
            .load(Ordering::Acquire)
            .min(from.saturating_add(most));
        (from..end)
            .map(|row| {
                let cells = &self.values[row * width..(row + 1) * width];
                let bits = cells.iter().map(|cell| cell.load(Ordering::Relaxed));
                bits.map(f32::from_bits).collect()
            })
            .collect()
    }

    /// Number of rows so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.load(Ordering::Acquire)
    }

    /// Whether there is none yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Says how the run ended.
    pub fn finish(&self, words: &str) {
        if let Ok(mut ended) = self.ended.lock() {
            *ended = Some(words.to_string());
        }
    }

    /// How the run ended; none during the run.
    #[must_use]
    pub fn ended(&self) -> Option<String> {
        self.ended.lock().ok()?.clone()
    }
}

impl Observer for Tap {
    fn row(&self, time: f64, signals: &[f64]) {
        self.push(time, signals);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    /// A reader beside the writer sees the rows in their order and never half of one.
    #[test]
    fn rows_are_whole_while_they_are_written() {
        let tap = Arc::new(Tap::new(vec![2, 0], 20_000));
        let writer = {
            let tap = Arc::clone(&tap);
            std::thread::spawn(move || {
                for n in 0..20_001 {
                    let x = f64::from(n);
                    tap.push(x, &[-x, 0.5, x + 1.0]);
                }
                tap.finish("complete");
            })
        };
        let mut seen = 0;
        while seen < 20_000 {
            for row in tap.rows(seen, 700) {
                let n = seen as f32;
                assert_eq!(row, [n, n + 1.0, -n]);
                seen += 1;
            }
        }
        writer.join().unwrap();
        assert_eq!(
            (tap.len(), tap.ended().as_deref()),
            (20_000, Some("complete"))
        );
        assert!(tap.rows(20_000, 10).is_empty());
    }
}
