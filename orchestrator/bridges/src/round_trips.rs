//! How long exchanges take: a histogram that keeps its size however many there are.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Bins to a factor of ten.
const TO_A_DECADE: f64 = 20.0;
/// The first bin ends here, s.
const FIRST: f64 = 1e-6;
/// Bins: from 1 µs to 1000 s.
const BINS: usize = 181;

/// Durations by size, each bin 12 % wider than the one before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundTrips {
    bins: Vec<u64>,
    count: u64,
    /// The longest, s.
    pub longest_s: f64,
}

impl Default for RoundTrips {
    fn default() -> Self {
        Self {
            bins: vec![0; BINS],
            count: 0,
            longest_s: 0.0,
        }
    }
}

/// A bin that is not empty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Durations up to here, s.
    pub up_to_s: f64,
    /// So many.
    pub count: u64,
}

impl RoundTrips {
    /// Counts one.
    pub fn add(&mut self, took: Duration) {
        let took = took.as_secs_f64();
        let place = (TO_A_DECADE * (took / FIRST).log10()).ceil();
        // A cast saturates: what is below the first bin falls into it.
        let place = (place as usize).min(BINS - 1);
        self.bins[place] += 1;
        self.count += 1;
        self.longest_s = self.longest_s.max(took);
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// What this share of them stays below, s, to the width of a bin.
    #[must_use]
    pub fn below(&self, share: f64) -> f64 {
        let wanted = (share * self.count as f64).ceil() as u64;
        let mut seen = 0;
        let place = self.bins.iter().position(|count| {
            seen += count;
            seen >= wanted.max(1)
        });
        place.map_or(0.0, |place| end_of(place).min(self.longest_s))
    }

    /// How many took longer, to the width of a bin.
    #[must_use]
    pub fn above(&self, limit_s: f64) -> u64 {
        let all = self.bins.iter().enumerate();
        let above = all.filter(|(place, _)| end_of(*place) > limit_s * 1.13);
        above.map(|(_, count)| count).sum()
    }

    /// The bins that are not empty.
    #[must_use]
    pub fn histogram(&self) -> Vec<Bin> {
        let all = self.bins.iter().enumerate();
        let filled = all.filter(|(_, count)| **count > 0);
        let bins = filled.map(|(place, count)| Bin {
            up_to_s: end_of(place),
            count: *count,
        });
        bins.collect()
    }
}

/// Where a bin ends, s.
fn end_of(place: usize) -> f64 {
    FIRST * 10_f64.powf(place as f64 / TO_A_DECADE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_found_to_the_width_of_a_bin() {
        let mut trips = RoundTrips::default();
        assert_eq!(trips.below(0.5), 0.0);
        for k in 1..=1000_u64 {
            trips.add(Duration::from_micros(k));
        }
        assert_eq!(trips.count(), 1000);
        for (share, exact) in [(0.5, 500e-6), (0.99, 990e-6), (0.001, 1e-6)] {
            let found = trips.below(share);
            assert!(
                found >= 0.999 * exact && found <= 1.13 * exact,
                "{share}: {found}"
            );
        }
        assert_eq!(trips.longest_s, 1e-3);
        assert_eq!(trips.above(1e-3), 0);
        // Bins end at 501 us, 562 us and 631 us: those from 562 us on are longer for sure.
        assert_eq!(trips.above(500e-6), 1000 - 562);
        let counted: u64 = trips.histogram().iter().map(|bin| bin.count).sum();
        assert_eq!(counted, 1000);
        trips.add(Duration::from_millis(41));
        assert_eq!(trips.above(0.02), 1);
    }
}
