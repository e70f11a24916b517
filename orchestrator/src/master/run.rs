//! A run from its first sample to its last.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::action::Moment;
use super::{EndSignals, MasterError, Record, Simulation};
use crate::fmu::{Kind, Message};

/// A run with a value of this size diverges.
const DIVERGED: f64 = 1e30;

/// How a run ended, in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// It was played to its end.
    Complete,
    /// The system asked to end it.
    Interlock,
    /// A component asked to end it, as the standard lets it.
    Terminated,
    /// A component failed.
    Failed,
}

impl Ending {
    /// `complete`, `interlock`, `terminated` or `failed`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Interlock => "interlock",
            Self::Terminated => "terminated",
            Self::Failed => "failed",
        }
    }
}

/// How a run ended.
#[derive(Debug)]
pub enum Ended {
    /// It was played to its end.
    Complete,
    /// The system asked to end it (an interlock tripped).
    Interlock {
        /// The output that became true.
        signal: String,
        /// When, s.
        time: f64,
        /// Why, in words, where the component says it.
        cause: Option<String>,
    },
    /// A component asked to end the run, as the standard lets it.
    Terminated {
        /// The component.
        component: String,
        /// When, s.
        time: f64,
    },
    /// A component failed.
    Failed(MasterError),
    /// A sampled component failed and the interlock brought the valve to null.
    Stopped {
        /// What failed.
        error: MasterError,
        /// When the valve began to be brought to null, s.
        time: f64,
    },
}

impl Ended {
    /// In a word.
    pub fn kind(&self) -> Ending {
        match self {
            Self::Complete => Ending::Complete,
            Self::Interlock { .. } => Ending::Interlock,
            Self::Terminated { .. } => Ending::Terminated,
            Self::Failed(_) | Self::Stopped { .. } => Ending::Failed,
        }
    }

    /// Why it ended early; none where it is complete.
    pub fn reason(&self) -> Option<String> {
        (self.kind() != Ending::Complete).then(|| self.message())
    }

    /// When the run was stopped before its end, s.
    pub fn time(&self) -> Option<f64> {
        match self {
            Self::Interlock { time, .. }
            | Self::Stopped { time, .. }
            | Self::Terminated { time, .. } => Some(*time),
            Self::Complete | Self::Failed(_) => None,
        }
    }

    /// Whether the run came to its regular end.
    pub fn is_regular(&self) -> bool {
        matches!(self, Self::Complete | Self::Terminated { .. })
    }

    /// What happened, for people.
    pub fn message(&self) -> String {
        match self {
            Self::Complete => "complete".to_string(),
            Self::Interlock {
                signal,
                time,
                cause,
            } => {
                let cause = cause.as_ref();
                let cause = cause.map_or(String::new(), |cause| format!(": {cause}"));
                format!("`{signal}` became true at {time:.3} s{cause}")
            }
            Self::Terminated { component, time } => {
                format!("`{component}` asked to end the run at {time} s")
            }
            Self::Stopped { error, time } => format!(
                "{error}; the interlock was told to stop at {time:.3} s and brought the valve to null"
            ),
            Self::Failed(error) => error.to_string(),
        }
    }
}

/// What came of a run.
#[derive(Debug)]
pub struct Outcome {
    /// The signals, a row for each sample that was reached.
    pub record: Record,
    /// How it ended.
    pub ended: Ended,
    /// Coupling steps made.
    pub steps: usize,
    /// Coupling step, s.
    pub step: f64,
    /// Time that the stepping took, s.
    pub wall: f64,
    /// Time that the steps of each component took, s.
    pub spent: Vec<(String, f64)>,
    /// What the FMUs logged.
    pub messages: Vec<LogLine>,
    /// What the user should know of the order of calls.
    pub notes: Vec<String>,
}

/// A line logged by a component's FMU.
#[derive(Debug)]
pub struct LogLine {
    /// The component.
    pub component: String,
    /// What it logged.
    pub message: Message,
}

/// How fast a run is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Pace {
    /// As fast as it goes.
    #[default]
    Fastest,
    /// Never ahead of wall-clock time.
    RealTime,
}

impl Simulation {
    /// Plays `samples` samples; `progress` is told the number of samples reached now and then.
    /// What was computed is returned however the run ends.
    pub fn run(mut self, samples: usize, pace: Pace, progress: &mut dyn FnMut(usize)) -> Outcome {
        let mut record = Record::with_capacity(&self.names, samples).beside(&self.exact_names);
        let begin = Instant::now();
        let ended = self.play(samples, pace, progress, &mut record);
        let wall = begin.elapsed().as_secs_f64();
        progress(record.len());
        self.close();
        let notes = std::mem::take(&mut self.notes);
        let messages = self.parts.iter().flat_map(|part| {
            let component = &part.instance.name;
            part.instance
                .take_messages()
                .into_iter()
                .map(|message| LogLine {
                    component: component.clone(),
                    message,
                })
        });
        let spent = self.parts.iter().map(|part| {
            let name = part.instance.name.clone();
            (name, part.wall())
        });
        Outcome {
            record,
            spent: spent.collect(),
            steps: self.tick,
            step: self.step,
            wall,
            messages: messages.collect(),
            notes,
            ended: match ended {
                Ok(ended) => ended,
                Err(error) => Ended::Failed(error),
            },
        }
    }

    fn play(
        &mut self,
        samples: usize,
        pace: Pace,
        progress: &mut dyn FnMut(usize),
        record: &mut Record,
    ) -> Result<Ended, MasterError> {
        let begin = Instant::now();
        let mut tripped: Option<Tripped> = None;
        let mut stopped = false;
        while self.tick < samples * self.ticks_per_row {
            if pace == Pace::RealTime {
                let ahead = Duration::from_secs_f64(self.time()).saturating_sub(begin.elapsed());
                std::thread::sleep(ahead);
            }
            self.observe()?;
            if self.tick.is_multiple_of(self.ticks_per_row) {
                record.push(self.time(), &self.signals.numbers, &self.signals.exact);
                if let Some(tap) = &self.tap {
                    tap.push(self.time(), &self.signals.numbers);
                }
                self.check_bounds()?;
                let sample = self.tick / self.ticks_per_row;
                if sample.is_multiple_of(1024) {
                    progress(sample);
                }
            }
            if let Some((part, input)) = self.stop
                && !stopped
                && self.parts.iter().any(|part| part.failure.is_some())
            {
                // The guard acts on it when it is called next, at the sample after this one.
                self.parts[part]
                    .instance
                    .set(&Kind::Boolean, &[input], &[1.0])?;
                stopped = true;
            }
            if let Some(end) = &self.end {
                let numbers = &self.signals.numbers;
                if tripped.is_none() && numbers[end.when] != 0.0 {
                    tripped = Some(Tripped {
                        time: self.time(),
                        end: self.time() + end.after,
                        signal: self.names[end.when].clone(),
                        cause: end.cause_in_words(numbers),
                    });
                }
                if tripped.as_ref().is_some_and(|t| self.time() >= t.end) {
                    break;
                }
            }
            self.advance()?;
            if let Some(ended) = self.terminated(record)? {
                return Ok(ended);
            }
        }
        let time = tripped.as_ref().map_or(self.time(), |t| t.time);
        if let Some(error) = self.parts.iter_mut().find_map(|part| part.failure.take()) {
            return Ok(Ended::Stopped { error, time });
        }
        Ok(tripped.map_or(Ended::Complete, |t| Ended::Interlock {
            signal: t.signal,
            time: t.time,
            cause: t.cause,
        }))
    }
}

/// The system asked to end the run.
struct Tripped {
    /// When, s.
    time: f64,
    /// When it ends, s.
    end: f64,
    signal: String,
    cause: Option<String>,
}

impl EndSignals {
    fn cause_in_words(&self, signals: &[f64]) -> Option<String> {
        let (signal, items) = self.cause.as_ref()?;
        let value = signals[*signal];
        let item = items.iter().find(|item| item.value as f64 == value)?;
        Some(if item.description.is_empty() {
            item.name.clone()
        } else {
            item.description.clone()
        })
    }
}

impl Simulation {
    /// Values that no physical quantity has are a run that diverges.
    fn check_bounds(&self) -> Result<(), MasterError> {
        let numbers = &self.signals.numbers;
        if numbers.iter().all(|value| value.abs() < DIVERGED) {
            return Ok(());
        }
        let place = numbers.iter().position(|value| value.abs() >= DIVERGED);
        Err(MasterError::Diverged {
            time: self.time(),
            variable: place.map_or(String::new(), |place| self.names[place].clone()),
            value: place.map_or(0.0, |place| numbers[place]),
        })
    }

    /// Whether a component has asked to end the run; the values at that moment are recorded.
    fn terminated(&mut self, record: &mut Record) -> Result<Option<Ended>, MasterError> {
        let mut asked = self.parts.iter().filter_map(|part| {
            let time = part.ended?;
            Some((part.instance.name.clone(), time))
        });
        let Some((component, time)) = asked.next() else {
            return Ok(None);
        };
        // The others are at the end of the step: a row in between would mix two times.
        let is_alone = self.parts.len() == 1;
        let at_end = (time - self.time()).abs() <= 1e-9 * self.step;
        if (is_alone && time > self.time() - self.step) || at_end {
            let time = if at_end { self.time() } else { time };
            let at = Moment {
                tick: self.tick,
                time,
                step: self.step,
                calls: false,
            };
            self.reference
                .sample(self.tick / self.ticks_per_row, &mut self.signals.numbers);
            for action in &mut self.actions {
                action.perform(at, &mut self.parts, &mut self.signals, &self.names)?;
            }
            record.push(time, &self.signals.numbers, &self.signals.exact);
        }
        Ok(Some(Ended::Terminated { component, time }))
    }

    /// Gives states back, terminates the instances and frees them.
    fn close(&mut self) {
        for part in &mut self.parts {
            // A state that cannot be given back is lost with its instance.
            let _ = part.instance.free_state(std::mem::take(&mut part.state));
        }
        for part in &mut self.parts {
            part.instance.close();
        }
        self.diverted = None;
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.close();
    }
}
