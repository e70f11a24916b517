//! A run from its first sample to its last.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::action::Moment;
use super::clock::{Clock, RealTime};
use super::{Change, EndSignals, MasterError, Record, Simulation, StepsTaken, comes};
use fmi_import::{Kind, Message};

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
    /// A component failed, or the run ran away.
    Failed,
    /// The user ended it.
    Interrupted,
}

impl Ending {
    /// `complete`, `interlock`, `terminated`, `failed` or `interrupted`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Interlock => "interlock",
            Self::Terminated => "terminated",
            Self::Failed => "failed",
            Self::Interrupted => "interrupted",
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
    /// The user ended it.
    Interrupted {
        /// When, s.
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
            Self::Interrupted { .. } => Ending::Interrupted,
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
            | Self::Interrupted { time }
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
                format!("`{component}` requested the end of the run at {time} s")
            }
            Self::Stopped { error, time } => format!(
                "{error}; the interlock was stopped at {time:.3} s and brought the valve to null"
            ),
            Self::Failed(error) => error.to_string(),
            Self::Interrupted { time } => format!("interrupted at {time} s"),
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
    /// Coupling step, s; the greatest one where it varied.
    pub step: f64,
    /// Time that was simulated, s.
    pub simulated: f64,
    /// How the steps were, where they varied.
    pub variable: Option<StepsTaken>,
    /// Time that the stepping took, s.
    pub wall: f64,
    /// Time that the steps of each component took, s.
    pub spent: Vec<(String, f64)>,
    /// What the FMUs logged.
    pub messages: Vec<LogLine>,
    /// What the user should know of the order of calls.
    pub notes: Vec<String>,
    /// How real time was kept; of a run in real time.
    pub real_time: Option<RealTime>,
    /// Parameters that were changed during the run, in order.
    pub changes: Vec<Change>,
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
    /// Plays `samples` samples; `progress` receives the number of samples reached from time to
    /// time. What was computed is returned however the run ends.
    pub fn run(mut self, samples: usize, pace: Pace, progress: &mut dyn FnMut(usize)) -> Outcome {
        let rows = samples.div_ceil(self.keep_every);
        let mut record = Record::with_capacity(self.columns(), rows).beside(&self.exact_names);
        self.first_tick = self.tick;
        let resumed = self.resumed.take();
        let before = resumed.as_ref().map_or(0.0, |resumed| resumed.wall);
        if let Some(resumed) = resumed {
            record.append(&resumed.record);
        }
        self.clock = (pace == Pace::RealTime).then(|| Clock::new(self.step, self.tick));
        let clock = Stopwatch {
            begin: Instant::now(),
            before,
        };
        let ended = self.play(samples, progress, &mut record, &clock);
        let wall = clock.read();
        progress(record.len());
        let ended = ended.unwrap_or_else(Ended::Failed);
        self.outcome(record, ended, wall)
    }

    /// What came of it; the instances are freed.
    pub(super) fn outcome(mut self, mut record: Record, ended: Ended, wall: f64) -> Outcome {
        self.record_changes(&mut record);
        let changes = self.tuning.changes();
        let control = self.variable.as_ref();
        let variable = control.map(|control| control.taken(self.step, &self.names));
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
            steps: match &self.variable {
                Some(control) => control.progress.made,
                None => self.tick,
            },
            step: variable
                .as_ref()
                .map_or(self.step, |taken| taken.greatest_s),
            simulated: self.tick as f64 * self.step,
            variable,
            wall,
            messages: messages.collect(),
            notes,
            real_time: self.clock.take().map(Clock::statistics),
            changes,
            ended,
        }
    }

    /// Whether the system asks to end the run at the present tick.
    pub(super) fn tripped_now(&self) -> Option<Ended> {
        let end = self.end.as_ref()?;
        let numbers = &self.signals.numbers;
        (numbers[end.when] != 0.0).then(|| Ended::Interlock {
            signal: self.names[end.when].clone(),
            time: self.time(),
            cause: end.cause_in_words(numbers),
        })
    }

    fn play(
        &mut self,
        samples: usize,
        progress: &mut dyn FnMut(usize),
        record: &mut Record,
        stopwatch: &Stopwatch,
    ) -> Result<Ended, MasterError> {
        while self.tick < samples * self.ticks_per_row {
            if let Some(clock) = &mut self.clock {
                clock.wait(self.tick);
            }
            if self
                .interrupt
                .is_some_and(|asked| asked.load(Ordering::Relaxed))
            {
                if self.tick > self.first_tick {
                    self.keep_checkpoint(record, stopwatch.read())?;
                }
                return Ok(Ended::Interrupted { time: self.time() });
            }
            if self.is_checkpoint_due() {
                self.keep_checkpoint(record, stopwatch.read())?;
            }
            if self.arrive(record)? {
                break;
            }
            if let Some(sample) = self
                .whole_sample()
                .filter(|sample| sample.is_multiple_of(1024))
            {
                progress(sample);
            }
            self.advance()?;
            if let Some(ended) = self.terminated(record)? {
                return Ok(ended);
            }
        }
        Ok(self.ended())
    }

    /// The sample of the motion at the present tick; none between two.
    fn whole_sample(&self) -> Option<usize> {
        comes(self.tick, self.ticks_per_row).then(|| self.sample())
    }

    /// Makes the present tick known and keeps its row; gives whether the run ends here, because what
    /// tripped has had its time.
    ///
    /// # Errors
    /// A call that an FMU did not complete, or a run that diverges.
    pub(super) fn arrive(&mut self, record: &mut Record) -> Result<bool, MasterError> {
        if let Some(sample) = self.whole_sample() {
            self.change_parameters(sample)?;
        }
        self.observe()?;
        if let Some(sample) = self.whole_sample() {
            if comes(sample, self.keep_every) {
                self.keep(self.time(), record);
            }
            self.check_bounds()?;
        }
        if let Some((part, input)) = self.stop
            && !self.is_stopped
            && self.parts.iter().any(|part| part.failure.is_some())
        {
            // The guard acts on it when it is called next, at the sample after this one.
            self.parts[part]
                .instance
                .set(&Kind::Boolean, &[input], &[1.0])?;
            self.is_stopped = true;
        }
        if let Some(end) = &self.end {
            let numbers = &self.signals.numbers;
            if self.tripped.is_none() && numbers[end.when] != 0.0 {
                self.tripped = Some(Tripped {
                    time: self.time(),
                    end: self.time() + end.after,
                    signal: self.names[end.when].clone(),
                    cause: end.cause_in_words(numbers),
                });
            }
            return Ok(self.tripped.as_ref().is_some_and(|t| self.time() >= t.end));
        }
        Ok(false)
    }

    /// How a run that goes no further ended.
    pub(super) fn ended(&mut self) -> Ended {
        let tripped = self.tripped.take();
        let time = tripped.as_ref().map_or(self.time(), |t| t.time);
        if let Some(error) = self.parts.iter_mut().find_map(|part| part.failure.take()) {
            return Ended::Stopped { error, time };
        }
        tripped.map_or(Ended::Complete, |t| Ended::Interlock {
            signal: t.signal,
            time: t.time,
            cause: t.cause,
        })
    }
}

/// Time that the stepping takes, with what it took before a checkpoint.
struct Stopwatch {
    begin: Instant,
    /// s.
    before: f64,
}

impl Stopwatch {
    /// s.
    fn read(&self) -> f64 {
        self.before + self.begin.elapsed().as_secs_f64()
    }
}

/// The system asked to end the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Tripped {
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
    /// Ends the run where it is, with what was computed, when `asked` becomes true.
    pub fn heed(&mut self, asked: &'static AtomicBool) {
        self.interrupt = Some(asked);
    }

    /// Columns of its record; the first is `time`.
    pub(super) fn columns(&self) -> Vec<String> {
        let numbers = self
            .kept
            .iter()
            .flat_map(|places| &self.names[places.clone()]);
        let all = std::iter::once("time").chain(numbers.map(String::as_str));
        let all = all.chain(self.alias_names.iter().map(String::as_str));
        all.map(str::to_string).collect()
    }

    /// Keeps a row in every so many samples only.
    pub fn keep_every(&mut self, samples: usize) {
        self.keep_every = samples.max(1);
    }

    /// Keeps a row.
    pub(super) fn keep(&self, time: f64, record: &mut Record) {
        let (numbers, exact) = (&self.signals.numbers, &self.signals.exact);
        record.push_with(time, numbers, &self.kept, &self.alias_signals, exact);
        if let Some(observer) = &self.observer {
            observer.row(time, numbers);
        }
    }

    /// Values that no physical quantity has are a run that diverges.
    pub(super) fn check_bounds(&self) -> Result<(), MasterError> {
        let numbers = &self.signals.numbers;
        // All of them, so that nothing branches.
        let fits = |all, value: &f64| all & (value.abs() < DIVERGED);
        let mut kept = self.kept.iter();
        if kept.all(|places| numbers[places.clone()].iter().fold(true, fits)) {
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
    pub(super) fn terminated(&mut self, record: &mut Record) -> Result<Option<Ended>, MasterError> {
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
        let control = self.variable.as_ref();
        let length = self.step * control.map_or(1.0, |control| control.progress.last as f64);
        if (is_alone && time > self.time() - length) || at_end {
            let time = if at_end { self.time() } else { time };
            let at = Moment {
                tick: self.tick,
                time,
                step: self.step,
                calls: false,
            };
            let sample = self.sample();
            self.reference
                .sample(sample, time, &mut self.signals.numbers);
            for action in &mut self.actions {
                action.perform(at, &mut self.parts, &mut self.signals, &self.names)?;
            }
            self.keep(time, record);
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
        self.end_tuning();
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.close();
    }
}
