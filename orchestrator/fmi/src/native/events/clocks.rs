//! Clocks (FMI 3.0). Input clocks tick in event mode, when their time has come or when another clock
//! triggers them; output clocks are read there.
//!
//! A tick at a communication point waits until inputs are set or outputs are read there, so that it
//! takes the newest inputs. An output clock that ticks within a step is seen by others at its end.

use super::super::super::Ticks;
use super::super::super::call::{Call, Function, Scalar, Values};
use super::super::kept_states::Numbers;
use super::{Done, Events, WithEvents, refused, report_tick};

/// What is known between two calls of the events of an FMU; it belongs to the FMU's state.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EventState {
    /// Where the run begins and where the FMU is, s.
    pub start: f64,
    pub time: f64,
    /// The next time event, s, as the FMU says.
    pub next_event: Option<f64>,
    /// It is initialized.
    pub is_stepping: bool,
    /// The FMU asked to end the run.
    pub is_over: bool,
    inputs: Vec<Scheduled>,
    outputs: Vec<Ticked>,
}

/// An input clock.
#[derive(Debug, Clone, PartialEq)]
struct Scheduled {
    /// Period of a periodic clock, s.
    interval: f64,
    /// The next tick of one that is not, s.
    next: Option<f64>,
    /// When another clock triggered it last, s.
    triggered: Option<f64>,
    /// It ticks at the present time.
    is_due: bool,
}

/// An output clock since the last communication point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ticked {
    No,
    /// Nobody has read it yet.
    Unread,
    Read,
}

impl EventState {
    pub(super) fn new(inputs: usize, outputs: usize) -> Self {
        let clock = Scheduled {
            interval: f64::INFINITY,
            next: None,
            triggered: None,
            is_due: false,
        };
        Self {
            start: 0.0,
            time: 0.0,
            next_event: None,
            is_stepping: false,
            is_over: false,
            inputs: vec![clock; inputs],
            outputs: vec![Ticked::No; outputs],
        }
    }

    /// At the beginning of a step: ticks that were read are over.
    pub(super) fn begin_step(&mut self) {
        for clock in self.outputs.iter_mut().filter(|it| **it == Ticked::Read) {
            *clock = Ticked::No;
        }
    }

    #[inline]
    pub(super) fn has_due(&self) -> bool {
        self.inputs.iter().any(|clock| clock.is_due)
    }

    /// Places of the clocks that are due, which they are no longer.
    pub(super) fn take_due(&mut self) -> Vec<usize> {
        let inputs = self.inputs.iter_mut().enumerate();
        let due = inputs.filter(|(_, clock)| clock.is_due);
        due.map(|(at, clock)| {
            clock.is_due = false;
            at
        })
        .collect()
    }

    /// Lets others tick triggered clocks at the present communication point: each once there.
    pub(super) fn trigger(&mut self, events: &Events, call: &Call) {
        let Values::In(values) = &call.values else {
            return;
        };
        let pairs = call.references.iter().zip(*values);
        for (reference, _) in pairs.filter(|(_, value)| **value != 0) {
            let found = events
                .inputs
                .iter()
                .position(|it| it.reference == *reference);
            let clock = found.and_then(|at| self.inputs.get_mut(at));
            if let Some(clock) = clock.filter(|_| self.is_stepping)
                && clock.triggered != Some(self.time)
            {
                clock.triggered = Some(self.time);
                clock.is_due = true;
            }
        }
    }

    /// Whether output clocks have ticked since the communication point before.
    pub(super) fn have_ticked(&mut self, events: &Events, call: &mut Call) {
        let Values::Out(values) = &mut call.values else {
            return;
        };
        for (reference, value) in call.references.iter().zip(values.iter_mut()) {
            let found = events.outputs.iter().position(|(_, own)| own == reference);
            let clock = found.and_then(|at| self.outputs.get_mut(at));
            *value = clock.map_or(0, |clock| {
                if *clock == Ticked::Unread {
                    *clock = Ticked::Read;
                }
                u8::from(*clock == Ticked::Read)
            });
        }
    }
}

/// Numbers of an event state before those of its clocks, and of an input clock.
const HEAD: usize = 7;
const EACH: usize = 4;

impl Numbers for EventState {
    fn numbers(&self) -> Vec<f64> {
        let flag = |is: bool| f64::from(u8::from(is));
        let maybe = |number: Option<f64>| number.unwrap_or(f64::NAN);
        let mut all = vec![
            self.inputs.len() as f64,
            self.outputs.len() as f64,
            self.start,
            self.time,
            maybe(self.next_event),
            flag(self.is_stepping),
            flag(self.is_over),
        ];
        for one in &self.inputs {
            let (next, triggered) = (maybe(one.next), maybe(one.triggered));
            all.extend([one.interval, next, triggered, flag(one.is_due)]);
        }
        all.extend(self.outputs.iter().map(|ticked| f64::from(*ticked as u8)));
        all
    }

    fn of_numbers(all: &[f64]) -> Option<(Self, usize)> {
        let known = |number: f64| Some(number).filter(|number| !number.is_nan());
        let [inputs, outputs, start, time, next, stepping, over] = *all.first_chunk::<HEAD>()?;
        let clocks = (inputs as usize).checked_mul(EACH)?;
        let middle = HEAD.checked_add(clocks)?;
        let last = middle.checked_add(outputs as usize)?;
        let inputs = all.get(HEAD..middle)?.chunks_exact(EACH);
        let outputs = all.get(middle..last)?.iter();
        let state = Self {
            start,
            time,
            next_event: known(next),
            is_stepping: stepping != 0.0,
            is_over: over != 0.0,
            inputs: inputs
                .map(|numbers| Scheduled {
                    interval: numbers[0],
                    next: known(numbers[1]),
                    triggered: known(numbers[2]),
                    is_due: numbers[3] != 0.0,
                })
                .collect(),
            outputs: outputs
                .map(|number| match number {
                    1.0 => Ticked::Unread,
                    2.0 => Ticked::Read,
                    _ => Ticked::No,
                })
                .collect(),
        };
        Some((state, last))
    }
}

/// Times of the same tick.
fn is_same(a: f64, b: f64) -> bool {
    a.is_finite() && (a - b).abs() <= 1e-9 * a.abs().max(1e-3)
}

/// The first tick after `now` of a clock, s.
fn next(events: &Events, state: &EventState, at: usize, now: f64) -> f64 {
    let (Some(clock), Some(one)) = (events.inputs.get(at), state.inputs.get(at)) else {
        return f64::INFINITY;
    };
    match clock.ticks {
        Ticks::Periodic(_) => {
            let since = now - state.start - clock.shift;
            // A tick that is `now` is over.
            let count = (since / one.interval + 1e-9).floor() + 1.0;
            state.start + clock.shift + count.max(0.0) * one.interval
        }
        _ => one.next.unwrap_or(f64::INFINITY),
    }
}

impl WithEvents {
    /// The first tick after `now`, s.
    pub(super) fn next_tick(&self, now: f64) -> f64 {
        let all = 0..self.events.inputs.len();
        let all = all.map(|at| next(&self.events, &self.now, at, now));
        all.fold(f64::INFINITY, f64::min)
    }

    /// The name of the clock that ticks at `time`.
    pub(super) fn name_of(&self, now: f64, time: f64) -> &str {
        let mut all = self.events.inputs.iter().enumerate();
        let found = all.find(|(at, _)| is_same(next(&self.events, &self.now, *at, now), time));
        found.map_or("", |(_, clock)| &clock.name)
    }

    /// Notes the clocks that tick at `time`, seen from `before`.
    pub(super) fn arrive(&mut self, before: f64, time: f64) {
        for at in 0..self.events.inputs.len() {
            let ticks = is_same(next(&self.events, &self.now, at, before), time);
            self.now.inputs[at].is_due |= ticks;
        }
    }

    /// In event mode, before its update: which output clocks tick. `within`: a step is under way.
    pub(super) fn read_output_clocks(&mut self, within: bool) -> Done {
        if self.events.outputs.is_empty() {
            return Ok(());
        }
        let outputs = self.events.outputs.iter();
        let references: Vec<u32> = outputs.map(|(_, reference)| *reference).collect();
        let mut ticks = vec![0_u8; references.len()];
        let mut call = Call::plain(Function::Get(Scalar::Clock));
        call.references = &references;
        call.count = ticks.len();
        call.values = Values::Out(&mut ticks);
        self.pass(&mut call)?;
        for (at, _) in ticks.iter().enumerate().filter(|(_, tick)| **tick != 0) {
            self.now.outputs[at] = Ticked::Unread;
            if within && !std::mem::replace(&mut self.reported[at], true) {
                report_tick(&*self.sink, &self.events.outputs[at].0, self.now.time);
            }
        }
        Ok(())
    }

    /// In initialization's event mode: asks for the periods, and ticks what ticks at the start.
    pub(super) fn begin_clocks(&mut self) -> Done {
        let mut due = Vec::new();
        for at in 0..self.events.inputs.len() {
            let clock = self.events.inputs[at].clone();
            let interval = match clock.ticks {
                Ticks::Periodic(Some(interval)) => interval,
                Ticks::Periodic(None) => self.interval(clock.reference)?.unwrap_or(f64::NAN),
                Ticks::Changing | Ticks::Countdown | Ticks::Triggered => continue,
            };
            if !(interval > 0.0 && interval.is_finite()) {
                let reason = format!("gave no period for the clock `{}`", clock.name);
                let function = Function::GetIntervalDecimal;
                return Err(refused(function, &[clock.reference], reason));
            }
            self.now.inputs[at].interval = interval;
            if clock.shift.abs() <= 1e-9 * interval {
                due.push(at);
            }
        }
        self.tick(&due)?;
        self.ask_for_intervals(true)
    }

    /// Sets clocks in event mode.
    pub(super) fn tick(&mut self, due: &[usize]) -> Done {
        if due.is_empty() {
            return Ok(());
        }
        let inputs = &self.events.inputs;
        let references: Vec<u32> = due.iter().map(|&at| inputs[at].reference).collect();
        for &at in due {
            self.now.inputs[at].next = None;
        }
        let ticks = vec![1; references.len()];
        let mut call = Call::plain(Function::Set(Scalar::Clock));
        call.references = &references;
        call.count = ticks.len();
        call.values = Values::In(&ticks);
        self.pass(&mut call)
    }

    /// After an update in event mode: when clocks tick next whose FMU decides it in events.
    pub(super) fn ask_for_intervals(&mut self, is_start: bool) -> Done {
        for at in 0..self.events.inputs.len() {
            let clock = &self.events.inputs[at];
            let (ticks, reference) = (clock.ticks, clock.reference);
            let pending = self.now.inputs[at].next.is_some();
            match ticks {
                Ticks::Periodic(_) | Ticks::Triggered => {}
                Ticks::Changing if pending => {}
                Ticks::Changing | Ticks::Countdown => {
                    let is_shifted = is_start && ticks == Ticks::Changing && clock.shift > 0.0;
                    let interval = match is_shifted {
                        true => Some(clock.shift),
                        false => self.interval(reference)?,
                    };
                    if let Some(interval) = interval {
                        self.now.inputs[at].next = Some(self.now.time + interval.max(0.0));
                    }
                }
            }
        }
        Ok(())
    }

    /// The interval that the FMU gives for a clock, s; none where it gives none or the one that is known.
    fn interval(&mut self, reference: u32) -> Done<Option<f64>> {
        let mut interval = [0.0_f64];
        let mut call = Call::plain(Function::GetIntervalDecimal);
        let references = [reference];
        call.references = &references;
        call.count = 1;
        call.values = Values::Out(bytemuck::cast_slice_mut(&mut interval));
        self.pass(&mut call)?;
        // 0: not yet known; 1: unchanged; 2: changed.
        let qualifier = call.handle;
        let is_old = qualifier == 1 && interval[0] > 0.0 && !self.now.is_stepping;
        Ok((qualifier == 2 || is_old).then_some(interval[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::super::InputClock;
    use super::*;

    fn events() -> Events {
        let clock = |ticks: Ticks, shift: f64| InputClock {
            name: "clock".to_string(),
            reference: 1,
            ticks,
            shift,
        };
        let periodic = Ticks::Periodic(Some(0.2));
        Events {
            inputs: vec![
                clock(periodic, 0.0),
                clock(periodic, 0.1),
                clock(Ticks::Countdown, 0.0),
            ],
            outputs: vec![("out".to_string(), 2)],
            variable_step: true,
        }
    }

    #[test]
    fn the_next_tick_follows_from_the_time_alone() {
        struct Nobody;
        impl super::super::Endpoint for Nobody {
            fn call(&mut self, _: &mut Call) -> Result<i32, super::super::Lost> {
                Ok(0)
            }
        }
        impl super::super::Sink for Nobody {
            fn message(&self, _: i32, _: &str, _: &str) {}
        }
        let sink = std::sync::Arc::new(Nobody);
        let mut it = WithEvents::new(Box::new(Nobody), events(), sink);
        (it.now.inputs[0].interval, it.now.inputs[1].interval) = (0.2, 0.3);
        let (mut now, mut ticks) = (0.0, Vec::new());
        for _ in 0..6 {
            let next = it.next_tick(now);
            it.arrive(now, next);
            ticks.push(((next * 1e6).round() / 1e6, it.now.take_due()));
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
        it.now.start = 10.0;
        assert!((it.next_tick(10.25) - 10.4).abs() < 1e-12);
        it.now.start = 0.0;
        it.now.inputs[2].next = Some(0.85);
        assert_eq!(it.next_tick(now), 0.85);
    }

    #[test]
    fn what_drives_events_survives_its_numbers() {
        let mut state = EventState::new(3, 1);
        (state.start, state.time, state.is_stepping) = (1.0, 1.25, true);
        state.next_event = Some(1.5);
        state.inputs[1].is_due = true;
        state.inputs[2].next = Some(1.3);
        state.inputs[0].triggered = Some(1.25);
        state.outputs[0] = Ticked::Unread;
        let numbers = state.numbers();
        let length = numbers.len();
        assert_eq!(EventState::of_numbers(&numbers), Some((state, length)));
        assert_eq!(EventState::of_numbers(&numbers[..length - 1]), None);
        assert_eq!(EventState::of_numbers(&[1e300; 8]), None);
    }
}
