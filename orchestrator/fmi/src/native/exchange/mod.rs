//! Model exchange: an FMU that gives derivatives is stepped here and looks like one that steps
//! itself. The explicit method is used until stability limits its steps, then the implicit one until the
//! system is mild again. State events are located on the methods' continuous output; time events end a
//! step exactly.

mod explicit;
mod implicit;
mod model;
mod solver_state;
mod step;

use super::super::call::{Call, Culprit, Endpoint, Function, Lost, Scalar};
use super::kept_states::KeptStates;
use model::{Done, Failed, Model};
use solver_state::SolverState;
use step::{Start, Taken, Trial, Way};

/// Error of a step relative to the states, where nothing else is asked for.
const TOLERANCE: f64 = 1e-9;
/// Steps within one communication step.
const MOST_STEPS: usize = 1_000_000;
/// Events at one moment.
const MOST_EVENTS: usize = 1000;
/// Explicit steps at the limit of stability after which a system counts as stiff.
const STIFF: u32 = 15;
/// Explicit steps in between that are not, after which counting begins again.
const PARDON: u32 = 6;
/// Implicit steps in mild parts after which the explicit method is used again.
const MILD: u32 = 100;
/// Tries to end a step at an event.
const MOST_TRIES: u32 = 10;

/// An FMU for model exchange with its solver.
pub(super) struct Stepped {
    model: Model,
    newton: implicit::Newton,
    /// The standard's version has functions that count states and indicators.
    counts: bool,
    now: SolverState,
    kept: KeptStates<SolverState>,
}

/// How an integration ended.
enum Reached {
    End,
    /// A state event at that time.
    Event(f64),
    Terminated(f64),
}

impl Stepped {
    /// With as many states and event indicators as the description says (FMI 3.0: as the instance
    /// says). `pairs` are the value references of each state and its derivative, where the FMU gives
    /// directional derivatives.
    pub(super) fn new(
        fmu: Box<dyn Endpoint>,
        counts: bool,
        (states, indicators): (usize, usize),
        pairs: &[(u32, u32)],
    ) -> Self {
        Self {
            model: Model {
                fmu,
                pairs: pairs.to_vec(),
                nominals: Vec::new(),
                tolerance: TOLERANCE,
            },
            newton: implicit::Newton::default(),
            counts,
            now: SolverState {
                states: vec![0.0; states],
                indicators: vec![0.0; indicators],
                ..SolverState::default()
            },
            kept: KeptStates::default(),
        }
    }

    fn indicators(&mut self, time: f64, states: &[f64]) -> Done<Vec<f64>> {
        let mut values = vec![0.0; self.now.indicators.len()];
        self.model.indicators(time, states, &mut values)?;
        Ok(values)
    }

    /// In event mode, until nothing changes any more; gives whether the run ends.
    fn settle(&mut self) -> Done<bool> {
        for _ in 0..MOST_EVENTS {
            let call = self.model.plain(Function::UpdateDiscreteStates)?;
            let [again, end, _, _, defined] = call.flags;
            self.now.next_event = defined.then_some(call.numbers[0]);
            if end {
                return Ok(true);
            }
            if !again {
                return Ok(false);
            }
        }
        let reason = format!("still iterates after {MOST_EVENTS} repetitions");
        Err(Failed(Function::UpdateDiscreteStates, Err(Lost(reason))))
    }

    /// From event mode on.
    fn resume(&mut self) -> Done {
        self.model.plain(Function::EnterContinuousTimeMode)?;
        self.now.is_running = true;
        let mut states = std::mem::take(&mut self.now.states);
        let done = self.model.read(Function::GetContinuousStates, &mut states);
        self.model.read_nominals(states.len());
        self.now.states = states;
        done?;
        let mut values = std::mem::take(&mut self.now.indicators);
        let done = self.model.read(Function::GetEventIndicators, &mut values);
        self.now.indicators = values;
        done
    }

    /// After initialization the instance is in event mode.
    fn begin(&mut self) -> Done<bool> {
        if self.counts {
            let states = self
                .model
                .plain(Function::GetNumberOfContinuousStates)?
                .handle;
            let indicators = self
                .model
                .plain(Function::GetNumberOfEventIndicators)?
                .handle;
            self.now.states = vec![0.0; states as usize];
            self.now.indicators = vec![0.0; indicators as usize];
        }
        let end = self.settle()?;
        if !end {
            self.resume()?;
        }
        Ok(end)
    }

    /// Handles an event; gives whether the run ends.
    fn event(&mut self) -> Done<bool> {
        self.model.plain(Function::EnterEventMode)?;
        self.now.is_running = false;
        if self.settle()? {
            return Ok(true);
        }
        self.resume()?;
        Ok(false)
    }

    /// Steps from `time` to `end`; gives where it was ended, if it was.
    fn advance(&mut self, time: f64, end: f64) -> Done<Option<f64>> {
        if !self.now.is_running {
            return Ok(Some(time));
        }
        let mut now = time;
        if self.now.inputs_changed {
            // What has been set may have moved an indicator without an event in time.
            self.now.inputs_changed = false;
            let states = self.now.states.clone();
            let fresh = self.indicators(now, &states)?;
            if crossed(&self.now.indicators, &fresh) && self.event()? {
                return Ok(Some(now));
            }
            self.now.indicators = self.indicators(now, &self.now.states.clone())?;
        }
        let mut events = 0;
        let small = 1e-12 * end.abs().max(1e-3);
        while end - now > small {
            let stop = self.now.next_event.map_or(end, |next| next.min(end));
            let reached = match stop > now + small {
                true => self.integrate(now, stop)?,
                false => Reached::End,
            };
            let before = now;
            let is_event = match reached {
                Reached::Terminated(at) => return Ok(Some(at)),
                Reached::Event(at) => {
                    now = at;
                    true
                }
                Reached::End => {
                    now = stop.max(now);
                    self.now.next_event.is_some_and(|next| next <= now + small)
                }
            };
            if is_event && self.event()? {
                return Ok(Some(now));
            }
            events = if now > before + small { 0 } else { events + 1 };
            if events > MOST_EVENTS {
                let reason = format!("has endless events at {now} s");
                return Err(Failed(Function::DoStep, Err(Lost(reason))));
            }
        }
        let states = self.now.states.clone();
        self.model.set(end, &states)?;
        Ok(None)
    }

    /// Integrates from `from` to `to` or the first state event.
    fn integrate(&mut self, from: f64, to: f64) -> Done<Reached> {
        let (mut time, mut state) = (from, self.now.states.clone());
        let mut slope = vec![0.0; state.len()];
        self.model.derivatives(time, &state, &mut slope)?;
        self.newton.begin();
        let mut before: Option<(f64, Vec<f64>, Way)> = None;
        let mut step = if self.now.step > 0.0 {
            self.now.step
        } else {
            1e-3 * (to - from)
        };
        let mut tries = 0;
        for _ in 0..MOST_STEPS {
            let is_last = step >= (to - time) * (1.0 - 1e-10);
            let size = if is_last { to - time } else { step };
            let start = Start {
                time,
                states: &state,
                slope: &slope,
            };
            let last = before
                .as_ref()
                .map(|(size, from, way)| (*size, from.as_slice(), way));
            let trial = match self.now.is_stiff {
                true => {
                    let jacobian = &mut self.now.jacobian;
                    self.newton
                        .attempt(&mut self.model, jacobian, &start, size, last)?
                }
                false => explicit::attempt(&mut self.model, &start, size)?,
            };
            let taken = match trial {
                Trial::Taken(taken) => taken,
                Trial::Refused(smaller) => {
                    step = smaller;
                    if step < 1e-15 * time.abs().max(1.0) {
                        let reason = format!("cannot be integrated beyond {time} s");
                        return Err(Failed(Function::GetDerivatives, Err(Lost(reason))));
                    }
                    continue;
                }
            };
            let end = if is_last { to } else { time + size };
            let indicators = self.indicators(end, &taken.next)?;
            let is_event = crossed(&self.now.indicators, &indicators);
            if is_event {
                let share = self.locate(&start, size, &taken.way)?;
                let left = (1.0 - share) * size;
                let is_close = left <= 1e-9 * size || left <= 1e-14 * end.abs();
                let at = time + share * size;
                if !self.now.is_stiff {
                    let located = taken.way.between(&state, size, share);
                    self.now.step = size;
                    return self.arrive(at, located);
                }
                // The implicit method is more accurate at the ends of its steps than within them.
                if !is_close && tries < MOST_TRIES && at > time {
                    step = share * size;
                    tries += 1;
                    continue;
                }
            }
            self.count(&taken);
            if is_event {
                self.now.step = size;
                return self.arrive(end, taken.next);
            }
            self.model.set(end, &taken.next)?;
            let [event, terminate, ..] = self.completed()?;
            self.now.indicators = indicators;
            self.now.states.copy_from_slice(&taken.next);
            if !is_last {
                self.now.step = size;
            } else if self.now.is_stiff {
                // The last step is as long as what was left; the next may be longer.
                self.now.step = self.now.step.max(taken.proposed);
            }
            if terminate {
                return Ok(Reached::Terminated(end));
            }
            if event {
                return Ok(Reached::Event(end));
            }
            if is_last {
                return Ok(Reached::End);
            }
            step = taken.proposed;
            match taken.slope {
                Some(there) => slope = there,
                None => self.model.derivatives(end, &taken.next, &mut slope)?,
            }
            before = Some((size, std::mem::replace(&mut state, taken.next), taken.way));
            time = end;
        }
        let reason = format!("needs more than {MOST_STEPS} steps up to {to} s");
        Err(Failed(Function::DoStep, Err(Lost(reason))))
    }

    /// Ends a step at a state event.
    fn arrive(&mut self, at: f64, states: Vec<f64>) -> Done<Reached> {
        self.model.set(at, &states)?;
        self.now.indicators = self.indicators(at, &states)?;
        self.now.states = states;
        let [_, terminate, ..] = self.completed()?;
        Ok(match terminate {
            true => Reached::Terminated(at),
            false => Reached::Event(at),
        })
    }

    /// Counts what a step says of the system, and changes the method.
    fn count(&mut self, taken: &Taken) {
        let now = &mut self.now;
        let (limited, others) = (&mut now.limited, &mut now.others);
        if taken.is_limited {
            (*limited, *others) = (*limited + 1, 0);
        } else {
            *others += 1;
            if *others >= PARDON {
                *limited = 0;
            }
        }
        if *limited >= if now.is_stiff { MILD } else { STIFF } {
            now.is_stiff = !now.is_stiff;
            (now.limited, now.others) = (0, 0);
            now.jacobian.clear();
            self.newton.forget();
        }
    }

    fn completed(&mut self) -> Done<[bool; 5]> {
        let mut call = Call::plain(Function::CompletedIntegratorStep);
        call.flags[0] = true;
        self.model.call(&mut call)?;
        Ok(call.flags)
    }

    /// The first share of a step after which an indicator has crossed zero.
    fn locate(&mut self, start: &Start, size: f64, way: &Way) -> Done<f64> {
        let (mut low, mut high) = (0.0, 1.0);
        let before = self.now.indicators.clone();
        while high - low > 1e-14_f64.max(1e-15 * start.time.abs() / size) {
            let middle = 0.5 * (low + high);
            let there = way.between(start.states, size, middle);
            let indicators = self.indicators(start.time + middle * size, &there)?;
            match crossed(&before, &indicators) {
                true => high = middle,
                false => low = middle,
            }
            if middle == low && middle == high {
                break;
            }
        }
        Ok(high)
    }
}

/// Whether an indicator has another sign.
fn crossed(before: &[f64], after: &[f64]) -> bool {
    before
        .iter()
        .zip(after)
        .any(|(a, b)| (*a > 0.0) != (*b > 0.0))
}

impl Endpoint for Stepped {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let fmu = self.model.fmu.as_mut();
        if let Some(outcome) = self.kept.carry_out(call, fmu, &mut self.now) {
            if matches!(call.function, Function::SetState) {
                self.newton.forget();
            }
            return outcome;
        }
        let done = match call.function {
            Function::SetupExperiment | Function::EnterInitializationMode => {
                if call.flags[1] {
                    self.model.tolerance = call.numbers[2].clamp(1e-12, 1e-2);
                }
                return self.model.fmu.call(call);
            }
            Function::ExitInitializationMode => {
                let status = self.model.fmu.call(call)?;
                if !(0..=1).contains(&status) {
                    return Ok(status);
                }
                // An end before the beginning shows in the first step.
                self.begin().map(|_| None)
            }
            Function::DoStep => {
                let (time, end) = (call.numbers[0], call.numbers[0] + call.numbers[1]);
                self.advance(time, end).map(|ended| {
                    call.numbers[0] = ended.unwrap_or(end);
                    call.flags = [false, ended.is_some(), false, false, false];
                    Some(())
                })
            }
            Function::Set(scalar) if self.now.is_running => {
                self.now.inputs_changed = true;
                if scalar == Scalar::Float64 || scalar == Scalar::Float32 {
                    return self.model.fmu.call(call);
                }
                // Others may change at events only.
                let begun = self.model.plain(Function::EnterEventMode);
                let status = match begun {
                    Ok(_) => self.model.fmu.call(call)?,
                    Err(Failed(_, outcome)) => return outcome,
                };
                if !(0..=1).contains(&status) {
                    return Ok(status);
                }
                self.settle().and_then(|_| self.resume()).map(|()| None)
            }
            _ => return self.model.fmu.call(call),
        };
        match done {
            Ok(_) => Ok(0),
            Err(Failed(function, outcome)) => {
                call.culprit = Some(Box::new(Culprit {
                    function,
                    references: Vec::new(),
                }));
                outcome
            }
        }
    }
}

#[cfg(test)]
mod tests;
