//! The motion that the table is asked for, as a source of signals.

use crate::motion::Motion;
use crate::system::Quantity;

/// Histories of the motion and the signals that are taken from them.
pub(super) struct Reference {
    histories: [Vec<f64>; 3],
    /// Which history and how many samples ahead, one for each of the first signals.
    taps: Vec<(usize, isize)>,
}

impl Reference {
    pub(super) fn new(motion: &Motion) -> Self {
        Self {
            histories: [
                motion.displacement.clone(),
                motion.velocity.clone(),
                motion.acceleration.clone(),
            ],
            taps: Vec::new(),
        }
    }

    /// The signal of a quantity `ahead` samples ahead.
    pub(super) fn tap(&mut self, quantity: Quantity, ahead: isize) -> usize {
        let history = Quantity::ALL
            .iter()
            .position(|&q| q == quantity)
            .unwrap_or(0);
        let known = self.taps.iter().position(|&tap| tap == (history, ahead));
        known.unwrap_or_else(|| {
            self.taps.push((history, ahead));
            self.taps.len() - 1
        })
    }

    /// Number of signals.
    pub(super) fn len(&self) -> usize {
        self.taps.len()
    }

    /// Puts the values at `sample` into the first signals; before its beginning the motion rests at
    /// zero, after its end at its last displacement.
    pub(super) fn sample(&self, sample: usize, signals: &mut [f64]) {
        for (signal, &(history, ahead)) in signals.iter_mut().zip(&self.taps) {
            let values = &self.histories[history];
            let at_rest = if history == 0 {
                values.last().copied().unwrap_or(0.0)
            } else {
                0.0
            };
            *signal = sample
                .checked_add_signed(ahead)
                .map_or(0.0, |place| values.get(place).copied().unwrap_or(at_rest));
        }
    }
}
