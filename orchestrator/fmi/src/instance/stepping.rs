//! Steps, and the events on the way.

use super::super::FmiVersion;
use super::super::call::{Call, Function, Lost, MEASURED, Stepped};
use super::{Instance, Outcome, Phase};

/// How often events may follow each other at one moment.
const MOST_EVENT_ITERATIONS: usize = 1000;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// At its end.
    Whole,
    /// The FMU asked to end the run at that time, s.
    Ended(f64),
}

impl Instance {
    /// Steps from `time` to `time + step`, s.
    ///
    /// # Errors
    /// A step that was not completed.
    #[inline]
    pub fn do_step(&mut self, time: f64, step: f64) -> Outcome<Progress> {
        self.time = time;
        if self.has_events {
            return self.step_with_events(time, step);
        }
        if self.trace.is_none()
            && let Some(stepped) = self.endpoint.step(time, step)
        {
            if matches!(stepped.status, 0 | 1) && !stepped.end && !stepped.early {
                return Ok(Progress::Whole);
            }
            return self.stepped_otherwise(stepped);
        }
        self.step_by_call(time, step)
    }

    /// Requests a step from `time` to `time + step`, s, whose outcome [`Instance::finish_step`] gives:
    /// the steps of all instances in one other process travel there together. False where
    /// [`Instance::do_step`] has to be called. `measured`: how long it takes is asked for.
    pub fn request_step(&mut self, time: f64, step: f64, measured: bool) -> bool {
        if self.has_events || self.trace.is_some() {
            return false;
        }
        self.time = time;
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [time, step, 0.0];
        call.flags[MEASURED] = measured;
        self.endpoint.request(&call)
    }

    /// What came of the step that was requested, and how long it took, s, where that was asked for.
    ///
    /// # Errors
    /// A step that was not completed.
    pub fn finish_step(&mut self) -> Outcome<(Progress, f64)> {
        let mut call = Call::plain(Function::DoStep);
        let done = self.endpoint.answer(&mut call);
        let [_, end, early, ..] = call.flags;
        let [last, _, taken] = call.numbers;
        let progress = self.stepped(done, (end, early, last), &call)?;
        Ok((progress, taken))
    }

    #[inline(never)]
    fn step_by_call(&mut self, time: f64, step: f64) -> Outcome<Progress> {
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [time, step, 0.0];
        let done = self.carry_out(&mut call);
        let [_, end, early, ..] = call.flags;
        let last = call.numbers[0];
        self.stepped(done, (end, early, last), &call)
    }

    /// A step that did not go as most do.
    #[cold]
    fn stepped_otherwise(&mut self, stepped: Stepped) -> Outcome<Progress> {
        let outcome = (stepped.end, stepped.early, stepped.last);
        let call = Call::plain(Function::DoStep);
        self.stepped(Ok(stepped.status), outcome, &call)
    }

    /// What came of a step: whether the FMU asks to end the run, came back early, and how far it came.
    fn stepped(
        &mut self,
        done: Result<i32, Lost>,
        (end, early, last): (bool, bool, f64),
        call: &Call,
    ) -> Outcome<Progress> {
        match done {
            Ok(0 | 1) if end => Ok(Progress::Ended(last)),
            Ok(0 | 1) if !early => Ok(Progress::Whole),
            Ok(0 | 1) => {
                let outcome = format!("returned early at {last} s, which is not allowed");
                Err(self.failure(Function::DoStep, &[], outcome))
            }
            Ok(2) => self.discarded(end, last),
            outcome => self.judge(outcome, call).map(|()| Progress::Whole),
        }
    }

    /// As [`Instance::do_step`], handling the events on the way.
    #[cold]
    fn step_with_events(&mut self, time: f64, step: f64) -> Outcome<Progress> {
        let (end_time, mut now) = (time + step, time);
        if self.clocks.is_over || (!self.clocks.due.is_empty() && self.tick_now()?) {
            return Ok(Progress::Ended(now));
        }
        self.clocks.begin_step();
        let small = 1e-9 * step;
        let mut standing = 0;
        loop {
            let tick = self.clocks.next(self.start, now);
            let target = if tick < end_time - small {
                tick
            } else {
                end_time
            };
            if target < end_time && !self.fmu.description.variable_step {
                let clock = self.clocks.name_of(self.start, now, tick);
                let outcome = format!(
                    "cannot end at the tick of its clock `{clock}` at {tick} s, for it takes steps of \
                     one length only; choose a --step that divides the clock's period"
                );
                return Err(self.failure(Function::DoStep, &[], outcome));
            }
            let mut call = Call::plain(Function::DoStep);
            call.numbers = [now, target - now, 0.0];
            self.time = now;
            let done = self.carry_out(&mut call);
            let [event, end, early, ..] = call.flags;
            let last = if early { call.numbers[0] } else { target };
            match done {
                Ok(0 | 1) if end => return Ok(Progress::Ended(call.numbers[0])),
                Ok(0 | 1) => {}
                Ok(2) => return self.discarded(end, last),
                outcome => self.judge(outcome, &call)?,
            }
            self.time = last;
            let is_end = end_time - last <= small;
            if last >= tick - small {
                self.clocks.arrive(self.start, now, tick);
            }
            let ticks = !self.clocks.due.is_empty();
            // A tick at the end waits for the inputs there.
            if event || early || (ticks && !is_end) {
                self.enter_event()?;
                if self.update_discrete_states(!is_end)? {
                    return Ok(Progress::Ended(last));
                }
                self.plain(Function::EnterStepMode)?;
            }
            if is_end {
                return Ok(Progress::Whole);
            }
            standing = if last > now { 0 } else { standing + 1 };
            if standing > MOST_EVENT_ITERATIONS {
                let outcome = format!("returned early repeatedly at {last} s");
                return Err(self.failure(Function::DoStep, &[], outcome));
            }
            now = last;
        }
    }

    /// After a step that the FMU discarded: a regular end, or an error that says how far it came.
    #[cold]
    fn discarded(&mut self, end: bool, last: f64) -> Outcome<Progress> {
        let (mut end, mut last) = (end, Some(last));
        if self.version() == FmiVersion::V2 {
            let mut terminated = Call::plain(Function::GetTerminated);
            end = matches!(self.carry_out(&mut terminated), Ok(0 | 1)) && terminated.flags[0];
            let mut reached = Call::plain(Function::GetLastSuccessfulTime);
            last = matches!(self.carry_out(&mut reached), Ok(0 | 1)).then_some(reached.numbers[0]);
        }
        if end {
            return Ok(Progress::Ended(last.unwrap_or(self.time)));
        }
        let reached = last.map_or(String::new(), |last| format!(" (it came to {last} s)"));
        let outcome = format!("returned discard{reached}");
        let mut error = self.failure(Function::DoStep, &[], outcome);
        error.may_be_of_the_step = true;
        Err(error)
    }

    /// Lets an instance whose events are handled from outside take in what was set, as an event at
    /// the present time; nothing for others.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn begin_event(&mut self) -> Outcome {
        if !self.has_events || self.phase != Phase::Stepping {
            return Ok(());
        }
        self.enter_event()
    }

    /// Ends what [`Instance::begin_event`] began; gives whether the FMU asked to end the run.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn end_event(&mut self) -> Outcome<bool> {
        if !self.has_events || self.phase != Phase::Stepping {
            return Ok(false);
        }
        let end = self.update_discrete_states(false)?;
        if !end {
            self.plain(Function::EnterStepMode)?;
        }
        Ok(end)
    }

    /// Until nothing changes any more; gives whether the FMU asked to end the run. `within`: a step is
    /// under way.
    pub(super) fn update_discrete_states(&mut self, within: bool) -> Outcome<bool> {
        for _ in 0..MOST_EVENT_ITERATIONS {
            self.read_output_clocks(within)?;
            let mut call = Call::plain(Function::UpdateDiscreteStates);
            self.call(&mut call)?;
            let [again, end, ..] = call.flags;
            if end || !again {
                if !end && !self.clocks.is_empty() {
                    self.ask_for_intervals(false)?;
                }
                return Ok(end);
            }
        }
        let outcome = format!("still iterates after {MOST_EVENT_ITERATIONS} repetitions");
        Err(self.failure(Function::UpdateDiscreteStates, &[], outcome))
    }
}
