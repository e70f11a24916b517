//! Steps, and events at communication points.

use super::super::call::{Call, Foreseen, Function, Lost, MEASURED, Stepped, Wire};
use super::super::{FmiVersion, Kind};
use super::{Instance, Outcome, Phase};

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
        if let Some(stepped) = self.endpoint.step(time, step) {
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
        self.time = time;
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [time, step, 0.0];
        call.flags[MEASURED] = measured;
        self.endpoint.request(&call)
    }

    /// As [`Instance::request_step`], of a step before which inputs have just been set that are not all known
    /// yet. `wires` lead to the Float64 among them from what is read right after earlier steps that travel
    /// along. The inputs are set again before [`Instance::finish_step`], when they are known. `read`: the Float64
    /// variables that are read after the step, and how many values they have. Gives the number of that
    /// reading, itself none where it does not travel along; none where [`Instance::do_step`] has to be
    /// called.
    pub fn request_wired_step(
        &mut self,
        (time, step, measured): (f64, f64, bool),
        wires: &[Wire],
        read: (&[u32], usize),
    ) -> Option<Option<usize>> {
        self.time = time;
        let mut call = Call::plain(Function::DoStep);
        call.numbers = [time, step, 0.0];
        call.flags[MEASURED] = measured;
        self.endpoint.request_wired(&call, wires, read)
    }

    /// Whether all that was set has reached the FMU, and no step been requested whose outcome is not known.
    pub fn is_settled(&self) -> bool {
        self.endpoint.is_settled()
    }

    /// Notes that after each step the Float64 variables `set` will be set, to `values` or along `wires` from
    /// readings noted before in the same process. Then `count` values of `read` will be read, which are of type
    /// `kind`. Gives the number of the reading; none where the instance is not in another process, or nothing
    /// is gained.
    pub fn foresee(
        &mut self,
        (set, values, wires): (&[u32], &[f64], &[Wire]),
        (kind, read, count): (&Kind, &[u32], usize),
    ) -> Option<usize> {
        let scalar = self.scalar(kind);
        self.endpoint.foresee(&Foreseen {
            set,
            values,
            wires,
            read,
            scalar,
            count,
        })
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
        self.note_failure(&done, last);
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
        self.note_failure(&done, last);
        self.stepped(done, (end, early, last), &call)
    }

    /// An FMU whose events are handled failed at an event on the way.
    fn note_failure(&mut self, done: &Result<i32, Lost>, last: f64) {
        if self.has_events && !matches!(done, Ok(0..=2)) && last.is_finite() {
            self.time = last;
        }
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

    /// Begins an event at the present communication point, in which inputs are set; nothing for FMUs
    /// without event mode.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn begin_event(&mut self) -> Outcome {
        self.in_event(Function::EnterEventMode)
    }

    /// Ends what [`Instance::begin_event`] began.
    ///
    /// # Errors
    /// The FMU's refusal.
    pub fn end_event(&mut self) -> Outcome {
        self.in_event(Function::EnterStepMode)
    }

    fn in_event(&mut self, function: Function) -> Outcome {
        match self.has_events && self.phase == Phase::Stepping {
            true => self.plain(function),
            false => Ok(()),
        }
    }
}
