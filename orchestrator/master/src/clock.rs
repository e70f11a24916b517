//! Real time: when a step may begin, and how well that was kept.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// Times up to this many microseconds are counted one by one.
const COUNTED: usize = 20_000;

/// Keeps a run from going ahead of real time.
#[derive(Debug)]
pub(super) struct Clock {
    begin: Instant,
    /// Coupling step, s.
    step: f64,
    /// The tick at which the clock starts.
    first: usize,
    ticks: usize,
    missed: usize,
    worst: Duration,
    /// How often a step began so many microseconds late.
    late: Vec<u32>,
}

/// How real time was kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RealTime {
    /// Steps that had to be computed in time.
    pub deadlines: usize,
    /// Steps that were not done when the next one was due.
    pub missed: usize,
    /// By how much the latest step was late.
    pub worst_s: f64,
    /// By how much a step began late: the median, and what 99 of 100 stay below.
    pub jitter_median_s: f64,
    /// See [`RealTime::jitter_median_s`].
    pub jitter_p99_s: f64,
}

impl Clock {
    pub(super) fn new(step: f64, first: usize) -> Self {
        Self {
            begin: Instant::now(),
            step,
            first,
            ticks: 0,
            missed: 0,
            worst: Duration::ZERO,
            late: vec![0; COUNTED + 1],
        }
    }

    /// Waits until the tick is due.
    pub(super) fn wait(&mut self, tick: usize) {
        if tick == self.first {
            self.begin = Instant::now();
        }
        let since = tick - self.first;
        let due = Duration::from_secs_f64(since as f64 * self.step);
        let now = self.begin.elapsed();
        if now < due {
            std::thread::sleep(due - now);
        } else if since > 0 {
            self.missed += 1;
            self.worst = self.worst.max(now - due);
        }
        let late = self.begin.elapsed().saturating_sub(due);
        let place = (late.as_micros() as usize).min(COUNTED);
        self.late[place] = self.late[place].saturating_add(1);
        self.ticks += 1;
    }

    pub(super) fn statistics(self) -> RealTime {
        let below = |share: f64| {
            let wanted = (share * self.ticks as f64).ceil() as usize;
            let mut seen = 0;
            let place = self.late.iter().position(|&count| {
                seen += count as usize;
                seen >= wanted
            });
            1e-6 * place.unwrap_or(COUNTED) as f64
        };
        RealTime {
            deadlines: self.ticks.saturating_sub(1),
            missed: self.missed,
            worst_s: self.worst.as_secs_f64(),
            jitter_median_s: below(0.5),
            jitter_p99_s: below(0.99),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_late_ticks_are_counted_in_microseconds() {
        let mut clock = Clock::new(1.0, 0);
        clock.ticks = 200;
        clock.missed = 3;
        clock.worst = Duration::from_millis(7);
        (clock.late[10], clock.late[40], clock.late[400]) = (150, 47, 3);
        let found = clock.statistics();
        assert_eq!((found.deadlines, found.missed), (199, 3));
        assert!((found.worst_s - 7e-3).abs() < 1e-12);
        assert!((found.jitter_median_s - 10e-6).abs() < 1e-12);
        // 197 of 200 are no later than 40 us, which is less than 99 of 100.
        assert!((found.jitter_p99_s - 400e-6).abs() < 1e-12);
    }
}
