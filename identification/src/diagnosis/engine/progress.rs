//! What a diagnosis tells on its way.

use std::fmt;

/// An event of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub enum Progress {
    /// These records are fitted from now on.
    Fitting(String),
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
    /// An earlier search found it under other noises.
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

/// Who is told, if anyone.
#[derive(Clone, Copy, Default)]
pub struct Observer<'a>(Option<&'a dyn Fn(&Progress)>);

impl<'a> Observer<'a> {
    /// Tells nobody.
    #[must_use]
    pub const fn none() -> Self {
        Self(None)
    }

    /// Calls `told` at every event.
    #[must_use]
    pub const fn new(told: &'a dyn Fn(&Progress)) -> Self {
        Self(Some(told))
    }

    /// Tells an event, which is only made where somebody listens.
    pub fn tell(&self, event: impl FnOnce() -> Progress) {
        if let Some(told) = self.0 {
            told(&event());
        }
    }
}
