//! Events of co-simulation (FMI 3.0): an FMU that declares event mode is stepped through its events here
//! and looks like one that has none. In another process the whole step, with its events, is one call.
//!
//! A step ends at each tick of an input clock, at the time event that the FMU has announced, and where
//! the FMU returns early; events are then iterated until nothing changes.

mod clocks;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::super::InputClock;
use super::super::call::{AHEAD, Call, Culprit, Endpoint, Function, Lost, Scalar};
use super::kept_states::KeptStates;
use super::{DISCARD, Sink};
use clocks::EventState;

/// How often events may follow each other at one moment.
const MOST_EVENTS: usize = 1000;

/// What has to be known of an FMU whose events are handled here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct Events {
    /// Clocks that somebody has to tick.
    pub inputs: Vec<InputClock>,
    /// Clocks that the FMU ticks: names and value references.
    pub outputs: Vec<(String, u32)>,
    /// Whether its steps may have any length.
    pub variable_step: bool,
}

impl Events {
    /// Whether the FMU could handle its events itself.
    pub(in super::super) fn has_no_clocks(&self) -> bool {
        self.inputs.is_empty() && self.outputs.is_empty()
    }
}

/// An FMU with event mode, and what drives it.
pub(in super::super) struct WithEvents {
    fmu: Box<dyn Endpoint>,
    sink: Arc<dyn Sink>,
    events: Events,
    now: EventState,
    kept: KeptStates<EventState>,
    /// Of each output clock: a tick within a step has been reported.
    reported: Vec<bool>,
}

/// A call of the FMU that did not go well.
struct Failed {
    function: Function,
    references: Vec<u32>,
    outcome: Result<i32, Lost>,
}

type Done<T = ()> = Result<T, Failed>;

/// How a step ended.
enum Reached {
    /// At its end, or at the end of the run.
    Good { time: f64, is_over: bool },
    /// The FMU discarded the rest of it.
    Discarded { time: f64, is_over: bool },
}

/// A failure that the FMU has not reported as a status.
fn refused(function: Function, references: &[u32], reason: String) -> Failed {
    Failed {
        function,
        references: references.to_vec(),
        outcome: Err(Lost(reason)),
    }
}

impl WithEvents {
    pub(in super::super) fn new(
        fmu: Box<dyn Endpoint>,
        events: Events,
        sink: Arc<dyn Sink>,
    ) -> Self {
        Self {
            fmu,
            sink,
            now: EventState::new(events.inputs.len(), events.outputs.len()),
            kept: KeptStates::default(),
            reported: vec![false; events.outputs.len()],
            events,
        }
    }

    /// A call of the FMU that has to go well.
    fn pass(&mut self, call: &mut Call) -> Done {
        match self.fmu.call(call) {
            Ok(0 | 1) => Ok(()),
            outcome => Err(Failed {
                function: call.function,
                references: call.references.to_vec(),
                outcome,
            }),
        }
    }

    fn plain(&mut self, function: Function) -> Done {
        self.pass(&mut Call::plain(function))
    }

    /// After initialization, which ends in event mode.
    fn begin(&mut self) -> Done {
        self.begin_clocks()?;
        self.leave_event(false)?;
        self.now.is_stepping = true;
        Ok(())
    }

    /// Enters event mode and ticks what is due.
    fn enter_event(&mut self) -> Done {
        self.plain(Function::EnterEventMode)?;
        self.now.next_event = None;
        let due = self.now.take_due();
        self.tick(&due)
    }

    /// Iterates the event until nothing changes, and leaves event mode unless the FMU asks to end the
    /// run. `within`: a step is under way.
    fn leave_event(&mut self, within: bool) -> Done {
        for _ in 0..MOST_EVENTS {
            self.read_output_clocks(within)?;
            let mut call = Call::plain(Function::UpdateDiscreteStates);
            self.pass(&mut call)?;
            let [again, end, _, _, is_timed] = call.flags;
            self.now.next_event = is_timed.then_some(call.numbers[0]);
            self.now.is_over |= end;
            if end {
                return Ok(());
            }
            if !again {
                self.ask_for_intervals(false)?;
                return self.plain(Function::EnterStepMode);
            }
        }
        let reason = format!("still iterates after {MOST_EVENTS} repetitions");
        Err(refused(Function::UpdateDiscreteStates, &[], reason))
    }

    fn event(&mut self, within: bool) -> Done {
        self.enter_event()?;
        self.leave_event(within)
    }

    /// Steps from `time` by `length`, s, through the events on the way.
    fn step(&mut self, time: f64, length: f64) -> Done<Reached> {
        let (end, mut now) = (time + length, time);
        if self.now.has_due() && !self.now.is_over {
            self.event(false)?;
        }
        if self.now.is_over {
            return Ok(Reached::Good {
                time: now,
                is_over: true,
            });
        }
        self.now.begin_step();
        let small = 1e-9 * length;
        let mut standing = 0;
        loop {
            let tick = self.next_tick(now);
            let timed = self.now.next_event.filter(|at| *at > now + small);
            let timed = timed.filter(|_| self.events.variable_step);
            let soonest = tick.min(timed.unwrap_or(f64::INFINITY));
            let target = if soonest < end - small { soonest } else { end };
            if target < end && !self.events.variable_step {
                let clock = self.name_of(now, tick);
                let reason = format!(
                    "cannot end at the tick of its clock `{clock}` at {tick} s, for it takes steps of \
                     one length only; choose a --step that divides the clock's period"
                );
                return Err(refused(Function::DoStep, &[], reason));
            }
            let mut call = Call::plain(Function::DoStep);
            call.numbers = [now, target - now, 0.0];
            let outcome = self.fmu.call(&mut call);
            let [is_event, is_over, is_early, ..] = call.flags;
            let reached = if is_early { call.numbers[0] } else { target };
            match outcome {
                Ok(0 | 1) if is_over => {
                    let time = call.numbers[0];
                    return Ok(Reached::Good { time, is_over });
                }
                Ok(0 | 1) => {}
                Ok(DISCARD) => {
                    let time = call.numbers[0];
                    return Ok(Reached::Discarded { time, is_over });
                }
                outcome => {
                    return Err(Failed {
                        function: Function::DoStep,
                        references: Vec::new(),
                        outcome,
                    });
                }
            }
            if !(now - small..=target + small).contains(&reached) {
                let reason = format!("returned early at {reached} s from a step to {target} s");
                return Err(refused(Function::DoStep, &[], reason));
            }
            self.now.time = reached;
            let is_end = end - reached <= small;
            if reached >= tick - small {
                self.arrive(now, tick);
            }
            let is_timed = self.now.next_event.is_some_and(|at| at <= reached + small);
            // A tick at the end waits for the inputs there.
            let ticks = self.now.has_due() && !is_end;
            if is_event || is_early || is_timed || ticks {
                self.event(!is_end)?;
                if self.now.is_over {
                    return Ok(Reached::Good {
                        time: reached,
                        is_over: true,
                    });
                }
            }
            if is_end {
                return Ok(Reached::Good {
                    time: end,
                    is_over: false,
                });
            }
            standing = if reached > now { 0 } else { standing + 1 };
            if standing > MOST_EVENTS {
                let reason = format!("returned early repeatedly at {reached} s");
                return Err(refused(Function::DoStep, &[], reason));
            }
            now = reached;
        }
    }

    fn carry_out(&mut self, call: &mut Call) -> Done<i32> {
        match call.function {
            Function::EnterInitializationMode => {
                (self.now.start, self.now.time) = (call.numbers[0], call.numbers[0]);
            }
            Function::ExitInitializationMode => {
                self.pass(call)?;
                self.begin()?;
                return Ok(0);
            }
            Function::DoStep => {
                let (time, end, status) = match self.step(call.numbers[0], call.numbers[1])? {
                    Reached::Good { time, is_over } => (time, is_over, 0),
                    Reached::Discarded { time, is_over } => (time, is_over, DISCARD),
                };
                call.numbers[0] = time;
                call.flags = [false, end, false, false, false];
                return Ok(status);
            }
            // An event at a communication point, in which inputs are set.
            Function::EnterEventMode => return self.enter_event().map(|()| 0),
            Function::EnterStepMode => return self.leave_event(false).map(|()| 0),
            Function::Set(Scalar::Clock) => {
                self.now.trigger(&self.events, call);
                return Ok(0);
            }
            Function::Get(scalar) => {
                if self.now.has_due() && self.now.is_stepping && !self.now.is_over {
                    // What is read before its time must not tick: inputs may still be set.
                    if call.flags[AHEAD] {
                        return Ok(DISCARD);
                    }
                    self.event(false)?;
                }
                if scalar == Scalar::Clock {
                    self.now.have_ticked(&self.events, call);
                    return Ok(0);
                }
            }
            _ => {}
        }
        self.fmu.call(call).map_err(|lost| Failed {
            function: call.function,
            references: call.references.to_vec(),
            outcome: Err(lost),
        })
    }
}

impl Endpoint for WithEvents {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let fmu = self.fmu.as_mut();
        if let Some(outcome) = self.kept.carry_out(call, fmu, &mut self.now) {
            return outcome;
        }
        self.carry_out(call).or_else(|failed| {
            if call.function == Function::DoStep {
                call.numbers[0] = self.now.time;
            }
            if failed.function != call.function {
                call.culprit = Some(Box::new(Culprit {
                    function: failed.function,
                    references: failed.references,
                }));
            }
            failed.outcome
        })
    }

    #[inline]
    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Option<i32> {
        match self.now.has_due() {
            true => None,
            false => self.fmu.get_reals(references, values),
        }
    }

    #[inline]
    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Option<i32> {
        self.fmu.set_reals(references, values)
    }
}

/// A tick that others see late.
#[cold]
fn report_tick(sink: &dyn Sink, clock: &str, time: f64) {
    let text = format!(
        "its clock `{clock}` ticked at {time} s, between communication points: others see such ticks \
         at the next point; a shorter --step brings it nearer"
    );
    sink.message(1, "", &text);
}

#[cfg(test)]
mod tests;
