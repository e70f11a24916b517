//! What a diagnosis tells on its way.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// An event of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// These records are fitted from now on.
    Fitting(String),
    /// This is tried now.
    Trying(String),
    /// A model was looked at.
    Model {
        /// Why.
        step: Step,
        /// Its effects with their parameters' values, SI.
        effects: Vec<(&'static str, Vec<f64>)>,
        /// What it achieves, by name.
        figures: Vec<(&'static str, f64)>,
    },
    /// The noises were learned.
    Noise {
        /// By how much they lower twice the negative log likelihood.
        gain: f64,
        /// What was learned, by name.
        figures: Vec<(&'static str, f64)>,
    },
}

/// Why a search looks at a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// It is the nominal one, with its parameters estimated.
    Nominal,
    /// A candidate's sensitivity promises to pay.
    Screened,
    /// It is fitted under noises of its own.
    Refitted,
    /// It has one more effect.
    Extended,
    /// It lacks an effect, or what one has beyond its special case, that no longer pays.
    Reduced,
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fitting(records) => write!(f, "fitting {records}"),
            Self::Trying(what) => write!(f, "  trying {what}"),
            Self::Noise { gain, figures } => {
                write!(f, "  noise learned: gain {gain:.4e}")?;
                for (name, value) in figures {
                    write!(f, ", {name} {value:.3}")?;
                }
                Ok(())
            }
            Self::Model {
                step,
                effects,
                figures,
            } => {
                f.write_str(match step {
                    Step::Nominal => "  nominal",
                    Step::Screened => "    screened",
                    Step::Refitted => "  refitted",
                    Step::Extended => "  extended",
                    Step::Reduced => "  reduced",
                })?;
                for (i, (effect, values)) in effects.iter().enumerate() {
                    let values: Vec<String> = values.iter().map(|v| format!("{v:.4e}")).collect();
                    let sign = if i == 0 { ":" } else { " +" };
                    write!(f, "{sign} {effect} [{}]", values.join(", "))?;
                }
                for (i, (name, value)) in figures.iter().enumerate() {
                    write!(f, "{} {name} {value:.4e}", if i == 0 { ";" } else { "," })?;
                }
                Ok(())
            }
        }
    }
}

/// When a search ends with the best that it has found so far.
#[derive(Debug)]
pub struct Deadline {
    at: Option<Instant>,
    has_cut: AtomicBool,
}

impl Deadline {
    /// `limit` from now on; none where the clock does not reach so far.
    #[must_use]
    pub fn after(limit: Duration) -> Self {
        Self {
            at: Instant::now().checked_add(limit),
            has_cut: AtomicBool::new(false),
        }
    }

    /// Whether a search left something out because of it.
    pub fn has_cut(&self) -> bool {
        self.has_cut.load(Ordering::Relaxed)
    }
}

/// The receiver and the deadline, if any.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a> {
    told: Option<&'a dyn Fn(&Progress)>,
    deadline: Option<&'a Deadline>,
}

impl<'a> Observer<'a> {
    /// Tells nobody.
    #[must_use]
    pub const fn none() -> Self {
        Self {
            told: None,
            deadline: None,
        }
    }

    /// Calls `told` at every event.
    #[must_use]
    pub const fn new(told: &'a dyn Fn(&Progress)) -> Self {
        Self {
            told: Some(told),
            deadline: None,
        }
    }

    /// The same with a `deadline`.
    #[must_use]
    pub const fn until(self, deadline: &'a Deadline) -> Self {
        Self {
            deadline: Some(deadline),
            ..self
        }
    }

    /// Whether the deadline has passed. Whoever asks leaves out the rest of its search then.
    pub fn is_over(&self) -> bool {
        let Some(deadline) = self.deadline else {
            return false;
        };
        let is_over = deadline.at.is_some_and(|at| Instant::now() >= at);
        if is_over {
            deadline.has_cut.store(true, Ordering::Relaxed);
        }
        is_over
    }

    /// Whether a search has left something out because of the deadline.
    pub fn has_cut(&self) -> bool {
        self.deadline.is_some_and(Deadline::has_cut)
    }

    /// Tells an event, which is only made where somebody listens.
    pub fn tell(&self, event: impl FnOnce() -> Progress) {
        if let Some(told) = self.told {
            told(&event());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_lines_with_their_figures() {
        let model = |step, effects: &[(&'static str, &[f64])]| Progress::Model {
            step,
            effects: effects
                .iter()
                .map(|(name, own)| (*name, own.to_vec()))
                .collect(),
            figures: vec![("score", -12.5), ("gain", 3.0)],
        };
        for (event, line) in [
            (Progress::Fitting("a, b".into()), "fitting a, b"),
            (Progress::Trying("a delay".into()), "  trying a delay"),
            (
                Progress::Noise {
                    gain: 120.0,
                    figures: vec![("level", 0.5), ("corner", 2.0)],
                },
                "  noise learned: gain 1.2000e2, level 0.500, corner 2.000",
            ),
            (
                model(Step::Nominal, &[]),
                "  nominal; score -1.2500e1, gain 3.0000e0",
            ),
            (
                model(Step::Screened, &[("delay", &[0.002])]),
                "    screened: delay [2.0000e-3]; score -1.2500e1, gain 3.0000e0",
            ),
            (
                model(Step::Extended, &[("delay", &[0.002]), ("dry", &[4.0, 1.0])]),
                "  extended: delay [2.0000e-3] + dry [4.0000e0, 1.0000e0]; score -1.2500e1, gain 3.0000e0",
            ),
            (
                model(Step::Refitted, &[]),
                "  refitted; score -1.2500e1, gain 3.0000e0",
            ),
            (
                model(Step::Reduced, &[]),
                "  reduced; score -1.2500e1, gain 3.0000e0",
            ),
        ] {
            assert_eq!(event.to_string(), line);
        }
    }

    #[test]
    fn a_search_that_asks_after_the_deadline_has_been_cut() {
        let far = Deadline::after(Duration::MAX);
        let observer = Observer::none().until(&far);
        assert!(!observer.is_over() && !observer.has_cut());
        let passed = Deadline::after(Duration::ZERO);
        let observer = Observer::none().until(&passed);
        assert!(!observer.has_cut(), "nobody has asked");
        assert!(observer.is_over() && observer.has_cut() && passed.has_cut());
        assert!(!Observer::none().is_over());
    }
}
