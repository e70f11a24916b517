//! Parameters that are changed during a run.
//!
//! A change begins at a sample and moves the parameter along a straight line over some samples, so that
//! a controller's command does not jump. The value at a sample follows from the list of changes alone: a
//! run with the same list is the same run.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::{MasterError, Record, Simulation};
use fmi_import::Kind;
use units::hint;

/// A change of a parameter during a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// The parameter, as `component.variable`.
    pub variable: String,
    /// Its time, s.
    pub time_s: f64,
    /// The sample of the motion at which it begins.
    pub sample: usize,
    /// Samples until the parameter has its new value.
    pub samples: usize,
    /// Value before, in the variable's unit.
    pub from: f64,
    /// Value after, in the variable's unit.
    pub to: f64,
}

impl Change {
    /// The value at a sample that is not before its own.
    fn at(&self, sample: usize) -> f64 {
        let passed = sample.saturating_sub(self.sample);
        if passed >= self.samples {
            return self.to;
        }
        self.from + (self.to - self.from) * (passed as f64 / self.samples as f64)
    }
}

/// A parameter that may be changed, with its bounds, in the variable's unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Tunable {
    /// Its name, as `component.variable`.
    pub variable: String,
    /// Its value at the beginning.
    pub start: f64,
    /// The smallest value accepted.
    pub low: f64,
    /// The largest value accepted.
    pub high: f64,
}

/// Why a change is not made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refused {
    /// It is not among the parameters that may be changed.
    #[error("`{variable}` cannot be changed during this run{hint}")]
    Unknown {
        /// What was named.
        variable: String,
        /// A name that is near.
        hint: String,
    },
    /// A value outside of the bounds.
    #[error("`{variable}` = {value} is outside of its bounds; expected {low} to {high}")]
    Outside {
        /// The parameter.
        variable: String,
        /// What was asked for.
        value: f64,
        /// The smallest value accepted.
        low: f64,
        /// The largest value accepted.
        high: f64,
    },
    /// Nothing steps any more.
    #[error("the run has ended; `{0}` keeps its value")]
    Over(String),
}

/// The parameters that may be changed during a run, shared by the run and those who ask for changes.
/// The run neither waits for them nor locks anything unless something was asked for.
#[derive(Debug)]
pub struct Panel {
    tunables: Vec<Tunable>,
    samples: usize,
    is_asked: AtomicBool,
    is_over: AtomicBool,
    asked: Mutex<Vec<(usize, f64)>>,
    values: Vec<AtomicU64>,
    changes: Mutex<Vec<Change>>,
}

impl Panel {
    /// Changes take so many samples.
    #[must_use]
    pub fn new(tunables: Vec<Tunable>, samples: usize) -> Self {
        let values = tunables
            .iter()
            .map(|own| AtomicU64::new(own.start.to_bits()));
        Self {
            samples: samples.max(1),
            is_asked: AtomicBool::new(false),
            is_over: AtomicBool::new(false),
            asked: Mutex::default(),
            values: values.collect(),
            changes: Mutex::default(),
            tunables,
        }
    }

    /// The parameters.
    #[must_use]
    pub fn tunables(&self) -> &[Tunable] {
        &self.tunables
    }

    /// Samples that a change takes.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Their present values, in their order.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let bits = self
            .values
            .iter()
            .map(|value| value.load(Ordering::Relaxed));
        bits.map(f64::from_bits).collect()
    }

    /// The changes so far.
    #[must_use]
    pub fn changes(&self) -> Vec<Change> {
        let changes = self.changes.lock().unwrap_or_else(PoisonError::into_inner);
        changes.clone()
    }

    /// Asks for a value, which the parameter approaches from the next sample on; gives the value. A value
    /// that rounding has put outside of a bound is the bound.
    ///
    /// # Errors
    /// A parameter that may not be changed, a value outside of its bounds, a run that has ended.
    pub fn ask(&self, variable: &str, value: f64) -> Result<f64, Refused> {
        const ROUNDING: f64 = 1e-9;
        let found = self
            .tunables
            .iter()
            .position(|own| own.variable == variable);
        let Some(place) = found else {
            let known = self.tunables.iter().map(|own| own.variable.as_str());
            return Err(Refused::Unknown {
                variable: variable.to_string(),
                hint: hint(variable, known),
            });
        };
        if self.is_over.load(Ordering::Relaxed) {
            return Err(Refused::Over(variable.to_string()));
        }
        let Tunable { low, high, .. } = self.tunables[place];
        let margin = ROUNDING * low.abs().max(high.abs());
        // Also not a number.
        if !(value >= low - margin && value <= high + margin) {
            return Err(Refused::Outside {
                variable: variable.to_string(),
                value,
                low,
                high,
            });
        }
        let value = value.clamp(low, high);
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.push((place, value));
        self.is_asked.store(true, Ordering::Release);
        Ok(value)
    }

    /// What was asked for since.
    fn take(&self) -> Vec<(usize, f64)> {
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_asked.store(false, Ordering::Relaxed);
        std::mem::take(&mut asked)
    }

    /// No more changes are made.
    fn close(&self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

/// The changes of a simulation's parameters.
#[derive(Default)]
pub(super) struct Tuning {
    panel: Option<Arc<Panel>>,
    /// Places of the panel's parameters.
    on_panel: Vec<usize>,
    places: Vec<Place>,
    changes: Vec<(usize, Change)>,
    /// The last sample at which a parameter moves.
    until: Option<usize>,
}

/// Where a parameter is.
struct Place {
    name: String,
    part: usize,
    reference: u32,
    kind: Kind,
    start: f64,
}

impl Tuning {
    /// The change of the parameter that rules at a sample.
    fn latest(&self, place: usize, sample: usize) -> Option<&Change> {
        let own = self.changes.iter().rev();
        let mut own = own.filter(|(at, change)| *at == place && change.sample <= sample);
        own.next().map(|(_, change)| change)
    }

    /// The value of the parameter at a sample.
    fn value(&self, place: usize, sample: usize) -> f64 {
        let latest = self.latest(place, sample);
        latest.map_or(self.places[place].start, |change| change.at(sample))
    }

    fn add(&mut self, place: usize, change: Change) {
        let end = change.sample.saturating_add(change.samples);
        self.until = Some(self.until.map_or(end, |until| until.max(end)));
        self.changes.push((place, change));
    }

    /// All changes, in their order.
    pub fn changes(&self) -> Vec<Change> {
        self.changes
            .iter()
            .map(|(_, change)| change.clone())
            .collect()
    }
}

impl Simulation {
    /// Lets the parameters of `panel` be changed during the run.
    ///
    /// # Errors
    /// A parameter that the standard does not let be changed.
    pub fn tune(&mut self, panel: Arc<Panel>) -> Result<(), MasterError> {
        for own in panel.tunables() {
            let place = self.place(&own.variable, own.start)?;
            self.tuning.on_panel.push(place);
        }
        self.tuning.panel = Some(panel);
        Ok(())
    }

    /// Makes the changes of an earlier run at their samples.
    ///
    /// # Errors
    /// A parameter that there is not, or that the standard does not let be changed.
    pub fn repeat(&mut self, changes: &[Change]) -> Result<(), MasterError> {
        for change in changes {
            // The first of its changes begins with the value at the start.
            let place = self.place(&change.variable, change.from)?;
            self.tuning.add(place, change.clone());
        }
        Ok(())
    }

    /// Where a parameter is among the places, whose value at the beginning is `start`.
    fn place(&mut self, variable: &str, start: f64) -> Result<usize, MasterError> {
        let mut known = self.tuning.places.iter();
        if let Some(known) = known.position(|place| place.name == variable) {
            return Ok(known);
        }
        let place = self.place_of(variable, start)?;
        self.tuning.places.push(place);
        Ok(self.tuning.places.len() - 1)
    }

    fn place_of(&self, variable: &str, start: f64) -> Result<Place, MasterError> {
        let fault = |reason: &str| MasterError::NotTunable {
            variable: variable.to_string(),
            reason: reason.to_string(),
        };
        let mut parts = self.parts.iter().enumerate();
        let found = parts.find_map(|(at, part)| {
            let own = variable.strip_prefix(&part.instance.name)?;
            let own = own.strip_prefix('.')?;
            let description = &part.instance.fmu.description;
            Some((at, &description.variables[description.position(own)?]))
        });
        let Some((part, found)) = found else {
            return Err(fault("the system has no such parameter"));
        };
        if !found.is_tunable() {
            return Err(fault("its FMU does not declare it as a tunable parameter"));
        }
        if !found.is_real_number() {
            return Err(fault("only single real numbers can be changed"));
        }
        Ok(Place {
            name: variable.to_string(),
            part,
            reference: found.reference,
            kind: found.kind.clone(),
            start,
        })
    }

    /// Moves the parameters that change at the sample that begins now.
    ///
    /// # Errors
    /// A value that an FMU refuses.
    pub(super) fn change_parameters(&mut self, sample: usize) -> Result<(), MasterError> {
        let time = self.time();
        let tuning = &mut self.tuning;
        if let Some(panel) = tuning.panel.clone()
            && panel.is_asked.load(Ordering::Acquire)
        {
            for (own, to) in panel.take() {
                let place = tuning.on_panel[own];
                let change = Change {
                    variable: tuning.places[place].name.clone(),
                    time_s: time,
                    sample,
                    samples: panel.samples,
                    from: tuning.value(place, sample),
                    to,
                };
                let mut told = panel.changes.lock().unwrap_or_else(PoisonError::into_inner);
                told.push(change.clone());
                tuning.add(place, change);
            }
        }
        if tuning.until.is_none_or(|until| sample > until) {
            return Ok(());
        }
        for (at, place) in tuning.places.iter().enumerate() {
            let Some(change) = tuning.latest(at, sample) else {
                continue;
            };
            // At its own sample a change has not moved anything yet.
            if sample == change.sample || sample > change.sample + change.samples {
                continue;
            }
            let value = change.at(sample);
            let part = &mut self.parts[place.part];
            if part.failure.is_some() {
                continue;
            }
            let instance = &mut part.instance;
            let set = instance.begin_event();
            let set = set.and_then(|()| instance.set(&place.kind, &[place.reference], &[value]));
            match set.and_then(|()| instance.end_event()) {
                Err(error) if part.may_fail => part.failure = Some(error.into()),
                done => done?,
            }
            if let Some(panel) = &tuning.panel
                && let Some(own) = tuning.on_panel.iter().position(|place| *place == at)
                && let Some(shown) = panel.values.get(own)
            {
                shown.store(value.to_bits(), Ordering::Relaxed);
            }
        }
        Ok(())
    }

    /// Nobody can change anything any more.
    pub(super) fn end_tuning(&self) {
        if let Some(panel) = &self.tuning.panel {
            panel.close();
        }
    }

    /// Adds the histories of the parameters that were changed to the record.
    pub(super) fn record_changes(&self, record: &mut Record) {
        let tuning = &self.tuning;
        let period = self.step * self.ticks_per_row as f64;
        for (at, place) in tuning.places.iter().enumerate() {
            if tuning.changes.iter().all(|(of, _)| *of != at) {
                continue;
            }
            let times = record.rows().map(|row| row[0]);
            let samples = times.map(|time| ((time - self.begin) / period + 1e-6) as usize);
            let values: Vec<f64> = samples.map(|sample| tuning.value(at, sample)).collect();
            record.add_column(&place.name, &values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> Panel {
        let gain = Tunable {
            variable: "control.gain".into(),
            start: 3.0,
            low: 1.5,
            high: 6.0,
        };
        Panel::new(vec![gain], 4)
    }

    #[test]
    fn a_change_is_refused_beyond_its_bounds_and_for_what_is_not_listed() {
        let panel = panel();
        assert_eq!(panel.ask("control.gain", 6.0), Ok(6.0));
        assert_eq!(panel.ask("control.gain", 6.0 * (1.0 + 1e-12)), Ok(6.0));
        for value in [6.001, 1.4, -3.0, f64::NAN, f64::INFINITY] {
            let refused = panel.ask("control.gain", value).unwrap_err();
            assert!(
                refused.to_string().contains("expected 1.5 to 6"),
                "{refused}"
            );
        }
        let refused = panel.ask("control.gian", 2.0).unwrap_err().to_string();
        assert!(refused.contains("`control.gain`"), "{refused}");
        assert_eq!(panel.take(), [(0, 6.0), (0, 6.0)]);
        panel.close();
        assert!(matches!(
            panel.ask("control.gain", 2.0),
            Err(Refused::Over(_))
        ));
    }

    #[test]
    fn a_change_is_a_straight_line_that_another_one_may_break() {
        let mut tuning = Tuning::default();
        tuning.places.push(Place {
            name: "control.gain".into(),
            part: 0,
            reference: 0,
            kind: Kind::Float64,
            start: 3.0,
        });
        let change = |sample, from, to| Change {
            variable: "control.gain".into(),
            time_s: 0.0,
            sample,
            samples: 4,
            from,
            to,
        };
        tuning.add(0, change(10, 3.0, 5.0));
        tuning.add(0, change(12, 4.0, 2.0));
        let values: Vec<f64> = (9..18).map(|sample| tuning.value(0, sample)).collect();
        assert_eq!(values, [3.0, 3.0, 3.5, 4.0, 3.5, 3.0, 2.5, 2.0, 2.0]);
        assert_eq!(tuning.until, Some(16));
    }
}
