//! Clocks (FMI 3.0). Input clocks tick in event mode, when their time has come or when another clock
//! triggers them; output clocks are read there.
//!
//! A tick at a communication point waits until inputs are set or outputs are read there, so that it
//! takes the newest inputs. An output clock that ticks within a step is seen by others at its end.

use super::super::call::{Call, Function, Scalar, Values};
use super::super::messages::Messages;
use super::super::native::Sink;
use super::super::{Causality, Description, InputClock, Interface, Kind, Ticks};
use super::{Instance, Outcome, Phase};

/// The clocks of an instance.
#[derive(Debug, Default)]
pub(super) struct Clocks {
    all: Vec<Scheduled>,
    /// Places of those that tick at the present time.
    pub due: Vec<usize>,
    /// The FMU asked to end the run in a tick.
    pub is_over: bool,
    outputs: Vec<OutputClock>,
}

/// An output clock, and what is known of it since the last communication point.
#[derive(Debug)]
struct OutputClock {
    name: String,
    reference: u32,
    ticked: Ticked,
    /// A tick within a step has been reported.
    is_reported: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ticked {
    No,
    /// Nobody has read it yet.
    Unread,
    Read,
}

#[derive(Debug)]
struct Scheduled {
    clock: InputClock,
    /// Period of a periodic clock, s.
    interval: f64,
    /// The next tick of one that is not, s.
    next: Option<f64>,
    /// When another clock triggered it last, s.
    triggered: Option<f64>,
}

impl Clocks {
    /// The clocks that somebody has to tick, and those that the FMU ticks.
    ///
    /// # Errors
    /// Clocks that cannot be ticked: what there is instead.
    pub(super) fn of(description: &Description, has_events: bool) -> Result<Self, String> {
        let is_stepped = has_events && description.interface == Interface::CoSimulation;
        let mut all = description.input_clocks.iter();
        if !is_stepped && let Some(clock) = all.find(|clock| clock.ticks != Ticks::Triggered) {
            return Err(format!(
                "its input clock `{}` has to be ticked from outside, which is possible in \
                 co-simulation with hasEventMode=\"true\" only; export it with event mode",
                clock.name
            ));
        }
        if !is_stepped {
            return Ok(Self::default());
        }
        let all = description.input_clocks.iter().map(|clock| Scheduled {
            clock: clock.clone(),
            interval: f64::INFINITY,
            next: None,
            triggered: None,
        });
        let outputs = description.of(Causality::Output);
        let outputs = outputs.map(|at| &description.variables[at]);
        let outputs = outputs.filter(|variable| variable.kind == Kind::Clock);
        Ok(Self {
            all: all.collect(),
            due: Vec::new(),
            is_over: false,
            outputs: outputs
                .map(|variable| OutputClock {
                    name: variable.name.clone(),
                    reference: variable.reference,
                    ticked: Ticked::No,
                    is_reported: false,
                })
                .collect(),
        })
    }

    /// At the beginning of a step: ticks that were read are over.
    pub(super) fn begin_step(&mut self) {
        for clock in &mut self.outputs {
            if clock.ticked == Ticked::Read {
                clock.ticked = Ticked::No;
            }
        }
    }

    /// Everything here that a saved state has to hold, as numbers.
    pub(super) fn save(&self, into: &mut Vec<f64>) {
        into.clear();
        for one in &self.all {
            into.push(one.next.unwrap_or(f64::NAN));
            into.push(one.triggered.unwrap_or(f64::NAN));
        }
        let ticked = self.outputs.iter().map(|clock| clock.ticked);
        into.extend(ticked.map(|ticked| f64::from(ticked as u8)));
    }

    /// How many numbers [`Clocks::save`] gives.
    pub(super) fn saved(&self) -> usize {
        2 * self.all.len() + self.outputs.len()
    }

    /// Takes what [`Clocks::save`] gave.
    pub(super) fn restore(&mut self, from: &[f64]) {
        self.due.clear();
        self.is_over = false;
        let known = |number: f64| Some(number).filter(|number| !number.is_nan());
        let (inputs, outputs) = from.split_at((2 * self.all.len()).min(from.len()));
        for (one, numbers) in self.all.iter_mut().zip(inputs.chunks_exact(2)) {
            (one.next, one.triggered) = (known(numbers[0]), known(numbers[1]));
        }
        for (clock, number) in self.outputs.iter_mut().zip(outputs) {
            clock.ticked = match number {
                1.0 => Ticked::Unread,
                2.0 => Ticked::Read,
                _ => Ticked::No,
            };
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The first tick after `now`, s; of ticks since `start`.
    pub(super) fn next(&self, start: f64, now: f64) -> f64 {
        let next = self.all.iter().map(|one| one.next(start, now));
        next.fold(f64::INFINITY, f64::min)
    }

    /// The name of the clock that ticks at `time`.
    pub(super) fn name_of(&self, start: f64, now: f64, time: f64) -> &str {
        let mut all = self.all.iter();
        let found = all.find(|one| is_same(one.next(start, now), time));
        found.map_or("", |one| &one.clock.name)
    }

    /// Notes the clocks that tick at `time`.
    pub(super) fn arrive(&mut self, start: f64, before: f64, time: f64) {
        let due = (0..self.all.len()).filter(|&at| is_same(self.all[at].next(start, before), time));
        self.due = due.collect();
    }
}

/// Times of the same tick.
fn is_same(a: f64, b: f64) -> bool {
    a.is_finite() && (a - b).abs() <= 1e-9 * a.abs().max(1e-3)
}

impl Scheduled {
    /// The first tick after `now`; of ticks since `start`.
    fn next(&self, start: f64, now: f64) -> f64 {
        match self.clock.ticks {
            Ticks::Periodic(_) => {
                let since = now - start - self.clock.shift;
                // A tick that is `now` is over.
                let count = (since / self.interval + 1e-9).floor() + 1.0;
                start + self.clock.shift + count.max(0.0) * self.interval
            }
            _ => self.next.unwrap_or(f64::INFINITY),
        }
    }
}

impl Instance {
    /// Lets others tick triggered clocks at the present communication point: each once there.
    pub(super) fn trigger(&mut self, references: &[u32], values: &[f64]) {
        if self.phase != Phase::Stepping {
            return;
        }
        for (reference, _) in references.iter().zip(values).filter(|(_, v)| **v != 0.0) {
            let mut all = self.clocks.all.iter_mut().enumerate();
            let found = all.find(|(_, one)| one.clock.reference == *reference);
            if let Some((at, one)) = found
                && one.triggered != Some(self.time)
            {
                one.triggered = Some(self.time);
                self.clocks.due.push(at);
            }
        }
    }

    /// Whether output clocks have ticked since the communication point before.
    pub(super) fn have_ticked(&mut self, references: &[u32], values: &mut [f64]) {
        for (reference, value) in references.iter().zip(values) {
            let mut all = self.clocks.outputs.iter_mut();
            let clock = all.find(|clock| clock.reference == *reference);
            *value = f64::from(u8::from(clock.is_some_and(|clock| {
                if clock.ticked == Ticked::Unread {
                    clock.ticked = Ticked::Read;
                }
                clock.ticked == Ticked::Read
            })));
        }
    }

    /// In event mode, before its update: which output clocks tick. `within`: a step is under way.
    pub(super) fn read_output_clocks(&mut self, within: bool) -> Outcome {
        if self.clocks.outputs.is_empty() {
            return Ok(());
        }
        let references: Vec<u32> = self.clocks.outputs.iter().map(|it| it.reference).collect();
        let mut ticks = vec![0_u8; references.len()];
        let mut call = Call::plain(Function::Get(Scalar::Clock));
        call.references = &references;
        call.count = ticks.len();
        call.values = Values::Out(&mut ticks);
        self.call(&mut call)?;
        let clocks = self.clocks.outputs.iter_mut();
        for (clock, _) in clocks.zip(ticks).filter(|(_, tick)| *tick != 0) {
            clock.ticked = Ticked::Unread;
            if within && !std::mem::replace(&mut clock.is_reported, true) {
                report_tick(&self.messages, &clock.name, self.time);
            }
        }
        Ok(())
    }

    /// In initialization's event mode: asks for the periods, and ticks what ticks at the start.
    pub(super) fn begin_clocks(&mut self) -> Outcome {
        let mut due = Vec::new();
        for at in 0..self.clocks.all.len() {
            let clock = self.clocks.all[at].clock.clone();
            let interval = match clock.ticks {
                Ticks::Periodic(Some(interval)) => interval,
                Ticks::Periodic(None) => self.interval(clock.reference)?.unwrap_or(f64::NAN),
                Ticks::Changing | Ticks::Countdown | Ticks::Triggered => continue,
            };
            if !(interval > 0.0 && interval.is_finite()) {
                let outcome = format!("gave no period for the clock `{}`", clock.name);
                return Err(self.failure(
                    Function::GetIntervalDecimal,
                    &[clock.reference],
                    outcome,
                ));
            }
            self.clocks.all[at].interval = interval;
            if clock.shift.abs() <= 1e-9 * interval {
                due.push(at);
            }
        }
        self.start = self.time;
        self.tick(&due)?;
        self.ask_for_intervals(true)
    }

    /// Enters event mode and ticks what is due, without the update that ends it.
    pub(super) fn enter_event(&mut self) -> Outcome {
        self.plain(Function::EnterEventMode)?;
        let due = std::mem::take(&mut self.clocks.due);
        self.tick(&due)
    }

    /// Handles the event of the ticks that are due.
    #[cold]
    pub(super) fn tick_now(&mut self) -> Outcome<bool> {
        if self.phase != Phase::Stepping {
            return Ok(false);
        }
        self.enter_event()?;
        let end = self.update_discrete_states(false)?;
        self.clocks.is_over = end;
        if !end {
            self.plain(Function::EnterStepMode)?;
        }
        Ok(end)
    }

    /// Sets clocks in event mode.
    fn tick(&mut self, due: &[usize]) -> Outcome {
        if due.is_empty() {
            return Ok(());
        }
        let all = &mut self.clocks.all;
        let references: Vec<u32> = due.iter().map(|&at| all[at].clock.reference).collect();
        for &at in due {
            all[at].next = None;
        }
        let ticks = vec![1; references.len()];
        let mut call = Call::plain(Function::Set(Scalar::Clock));
        call.references = &references;
        call.count = ticks.len();
        call.values = Values::In(&ticks);
        self.call(&mut call)
    }

    /// After an update in event mode: when clocks tick next whose FMU decides it in events.
    pub(super) fn ask_for_intervals(&mut self, is_start: bool) -> Outcome {
        for at in 0..self.clocks.all.len() {
            let (ticks, reference) = {
                let clock = &self.clocks.all[at].clock;
                (clock.ticks, clock.reference)
            };
            let pending = self.clocks.all[at].next.is_some();
            match ticks {
                Ticks::Periodic(_) | Ticks::Triggered => {}
                Ticks::Changing if pending => {}
                Ticks::Changing | Ticks::Countdown => {
                    let shift = match is_start && ticks == Ticks::Changing {
                        true => Some(self.clocks.all[at].clock.shift).filter(|shift| *shift > 0.0),
                        false => None,
                    };
                    let interval = match shift {
                        Some(shift) => Some(shift),
                        None => self.interval(reference)?,
                    };
                    if let Some(interval) = interval {
                        self.clocks.all[at].next = Some(self.time + interval.max(0.0));
                    }
                }
            }
        }
        Ok(())
    }

    /// The interval that the FMU gives for a clock, s; none where it gives none or the one that is known.
    fn interval(&mut self, reference: u32) -> Outcome<Option<f64>> {
        let mut interval = [0.0_f64];
        let mut call = Call::plain(Function::GetIntervalDecimal);
        let references = [reference];
        call.references = &references;
        call.count = 1;
        call.values = Values::Out(bytemuck::cast_slice_mut(&mut interval));
        self.call(&mut call)?;
        // 0: not yet known; 1: unchanged; 2: changed.
        let is_told =
            call.handle == 2 || (call.handle == 1 && interval[0] > 0.0 && !self.started());
        Ok(is_told.then_some(interval[0]))
    }

    fn started(&self) -> bool {
        self.phase == Phase::Stepping
    }
}

/// A tick that others see late.
#[cold]
fn report_tick(messages: &Messages, clock: &str, time: f64) {
    let text = format!(
        "its clock `{clock}` ticked at {time} s, between communication points: others see such ticks \
         at the next point; a shorter --step brings it nearer"
    );
    messages.message(1, "", &text);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scheduled(ticks: Ticks, interval: f64, shift: f64) -> Scheduled {
        let clock = InputClock {
            name: "clock".to_string(),
            reference: 1,
            ticks,
            shift,
        };
        Scheduled {
            clock,
            interval,
            next: None,
            triggered: None,
        }
    }

    #[test]
    fn the_next_tick_follows_from_the_time_alone() {
        let periodic = Ticks::Periodic(Some(0.2));
        let mut clocks = Clocks {
            all: vec![
                scheduled(periodic, 0.2, 0.0),
                scheduled(periodic, 0.3, 0.1),
                scheduled(Ticks::Countdown, f64::INFINITY, 0.0),
            ],
            ..Clocks::default()
        };
        let (mut now, mut ticks) = (0.0, Vec::new());
        for _ in 0..6 {
            let next = clocks.next(0.0, now);
            clocks.arrive(0.0, now, next);
            ticks.push(((next * 1e6).round() / 1e6, std::mem::take(&mut clocks.due)));
            now = next;
        }
        let expected = [
            (0.1, vec![1]),
            (0.2, vec![0]),
            (0.4, vec![0, 1]),
            (0.6, vec![0]),
            (0.7, vec![1]),
            (0.8, vec![0]),
        ];
        assert_eq!(ticks, expected);
        // From another start, and one that ticks once.
        assert!((clocks.next(10.0, 10.25) - 10.4).abs() < 1e-12);
        clocks.all[2].next = Some(0.85);
        assert_eq!(clocks.next(0.0, now), 0.85);
    }
}
