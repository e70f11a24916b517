//! What is wrong with a channel: constant, clipped, stuck.

use std::fmt;

use super::clipping::Clipped;
use super::{Recording, is_constant};

/// Something about a recording that its reader should know.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The recording.
    pub recording: String,
    /// What was found, with its place.
    pub what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.recording, self.what)
    }
}

/// A stretch of one repeated value this long, in a channel that otherwise moves, is a drop-out.
const STUCK_RUN: usize = 25;

impl Recording {
    /// Constant, clipped and stuck channels.
    pub fn faults(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        let mut tell = |what: String| {
            findings.push(Finding {
                recording: self.name.clone(),
                what,
            });
        };
        for (channel, values) in self.channels() {
            let name = channel.name();
            if is_constant(values) {
                tell(format!("`{name}` is constant"));
                continue;
            }
            let clipped = Clipped::of(values, f64::INFINITY);
            let [low, high] = clipped.extremes;
            if clipped.samples > 0 {
                tell(format!(
                    "`{name}` is clipped: {} samples are at {low:.4e} or {high:.4e} (SI)",
                    clipped.samples
                ));
            }
            let stuck: Vec<(usize, usize)> = stuck_runs(values)
                .into_iter()
                .filter(|run| ![low, high, 0.0].contains(&values[run.0]))
                .collect();
            if let Some(&(first, end)) = stuck.first() {
                tell(format!(
                    "drop-out in `{name}`: the value repeats for {:.3} s from {:.3} s ({} such \
                     places)",
                    (end - first) as f64 * self.period(),
                    self.time_at(first),
                    stuck.len()
                ));
            }
        }
        findings
    }
}

fn stuck_runs(values: &[f64]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut first = 0;
    for at in 1..=values.len() {
        if at == values.len() || values[at] != values[first] {
            if at - first >= STUCK_RUN {
                found.push((first, at));
            }
            first = at;
        }
    }
    found
}
