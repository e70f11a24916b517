//! Model exchange: an FMU that gives derivatives is stepped here and looks like one that steps
//! itself. Dormand and Prince's method of order 5(4) with their continuous output (Hairer, Norsett,
//! Wanner, *Solving Ordinary Differential Equations I*, II.4 and II.6). State events are located on
//! it by bisection; time events end a step exactly.

use bytemuck::{cast_slice, cast_slice_mut};

use super::super::call::{Call, Culprit, Endpoint, Function, Lost, Scalar, Values};
use super::solver_state::{KeptStates, SolverState};

/// Error of a step relative to the states.
const TOLERANCE: f64 = 1e-9;
/// Steps within one communication step; a stiff model needs more.
const MOST_STEPS: usize = 1_000_000;
/// Events at one moment.
const MOST_EVENTS: usize = 1000;

/// An FMU for model exchange with its solver.
pub(super) struct Stepped {
    fmu: Box<dyn Endpoint>,
    /// The standard's version has functions that count states and indicators.
    counts: bool,
    now: SolverState,
    kept: KeptStates,
}

/// A call that did not go well: its outcome, and which it was.
struct Failed(Function, Result<i32, Lost>);

type Done<T = ()> = Result<T, Failed>;

/// How an integration ended.
enum Reached {
    End,
    /// A state event at that time.
    Event(f64),
    Terminated(f64),
}

impl Stepped {
    /// With as many states and event indicators as the description says (FMI 3.0: as the instance
    /// says).
    pub(super) fn new(
        fmu: Box<dyn Endpoint>,
        counts: bool,
        states: usize,
        indicators: usize,
    ) -> Self {
        Self {
            fmu,
            counts,
            now: SolverState {
                states: vec![0.0; states],
                indicators: vec![0.0; indicators],
                ..SolverState::default()
            },
            kept: KeptStates::default(),
        }
    }

    fn call(&mut self, call: &mut Call) -> Done {
        match self.fmu.call(call) {
            Ok(0 | 1) => Ok(()),
            outcome => Err(Failed(call.function, outcome)),
        }
    }

    fn plain(&mut self, function: Function) -> Done<Call<'static>> {
        let mut call = Call::plain(function);
        self.call(&mut call)?;
        Ok(call)
    }

    fn read(&mut self, function: Function, into: &mut [f64]) -> Done {
        if into.is_empty() {
            return Ok(());
        }
        let mut call = Call::plain(function);
        call.count = into.len();
        call.values = Values::Out(cast_slice_mut(into));
        self.call(&mut call)
    }

    fn set(&mut self, time: f64, states: &[f64]) -> Done {
        let mut call = Call::plain(Function::SetTime);
        call.numbers[0] = time;
        self.call(&mut call)?;
        if states.is_empty() {
            return Ok(());
        }
        let mut call = Call::plain(Function::SetContinuousStates);
        call.count = states.len();
        call.values = Values::In(cast_slice(states));
        self.call(&mut call)
    }

    fn derivatives(&mut self, time: f64, states: &[f64], into: &mut [f64]) -> Done {
        self.set(time, states)?;
        self.read(Function::GetDerivatives, into)
    }

    fn indicators(&mut self, time: f64, states: &[f64]) -> Done<Vec<f64>> {
        let mut values = vec![0.0; self.now.indicators.len()];
        if !values.is_empty() {
            self.set(time, states)?;
            self.read(Function::GetEventIndicators, &mut values)?;
        }
        Ok(values)
    }

    /// In event mode, until nothing changes any more; gives whether the run ends.
    fn settle(&mut self) -> Done<bool> {
        for _ in 0..MOST_EVENTS {
            let call = self.plain(Function::UpdateDiscreteStates)?;
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
        self.plain(Function::EnterContinuousTimeMode)?;
        self.now.is_running = true;
        let mut states = std::mem::take(&mut self.now.states);
        let done = self.read(Function::GetContinuousStates, &mut states);
        self.now.states = states;
        done?;
        let mut values = std::mem::take(&mut self.now.indicators);
        let done = self.read(Function::GetEventIndicators, &mut values);
        self.now.indicators = values;
        done
    }

    /// After initialization the instance is in event mode.
    fn begin(&mut self) -> Done<bool> {
        if self.counts {
            let states = self.plain(Function::GetNumberOfContinuousStates)?.handle;
            let indicators = self.plain(Function::GetNumberOfEventIndicators)?.handle;
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
        self.plain(Function::EnterEventMode)?;
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
        self.set(end, &states)?;
        Ok(None)
    }

    /// Integrates from `from` to `to` or the first state event.
    fn integrate(&mut self, from: f64, to: f64) -> Done<Reached> {
        let n = self.now.states.len();
        let (mut time, mut state) = (from, self.now.states.clone());
        let mut slopes = vec![vec![0.0; n]; 7];
        self.derivatives(time, &state, &mut slopes[0])?;
        let mut step = if self.now.step > 0.0 {
            self.now.step
        } else {
            1e-3 * (to - from)
        };
        for _ in 0..MOST_STEPS {
            let is_last = step >= (to - time) * (1.0 - 1e-10);
            let size = if is_last { to - time } else { step };
            let mut next = state.clone();
            for stage in 1..7 {
                for i in 0..n {
                    let sum: f64 = (0..stage).map(|j| A[stage][j] * slopes[j][i]).sum();
                    next[i] = state[i] + size * sum;
                }
                let (done, rest) = slopes.split_at_mut(stage);
                let _ = done;
                self.derivatives(time + C[stage] * size, &next, &mut rest[0])?;
            }
            let mut error: f64 = 0.0;
            for i in 0..n {
                let e: f64 = size * (0..7).map(|j| E[j] * slopes[j][i]).sum::<f64>();
                let scale = TOLERANCE * (1e-3 + state[i].abs().max(next[i].abs()));
                error = error.max((e / scale).abs());
            }
            if !error.is_finite() || error > 1.0 {
                let shrink = if error.is_finite() {
                    0.9 * error.powf(-0.2)
                } else {
                    0.1
                };
                step = size * shrink.clamp(0.1, 0.9);
                if step < 1e-15 * time.abs().max(1.0) {
                    let reason = format!("cannot be integrated beyond {time} s");
                    return Err(Failed(Function::GetDerivatives, Err(Lost(reason))));
                }
                continue;
            }
            let end = if is_last { to } else { time + size };
            let indicators = self.indicators(end, &next)?;
            if crossed(&self.now.indicators, &indicators) {
                let (at, located) = self.locate(time, size, &state, &slopes)?;
                self.set(at, &located)?;
                self.now.indicators = self.indicators(at, &located)?;
                self.now.states = located;
                self.now.step = size;
                let done = self.completed()?;
                return Ok(if done[1] {
                    Reached::Terminated(at)
                } else {
                    Reached::Event(at)
                });
            }
            self.set(end, &next)?;
            let [event, terminate, ..] = self.completed()?;
            self.now.indicators = indicators;
            self.now.states.copy_from_slice(&next);
            if !is_last {
                self.now.step = size;
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
            step = size * (0.9 * error.max(1e-10).powf(-0.2)).clamp(0.2, 5.0);
            // The last slope of a step is the first of the next.
            slopes.swap(0, 6);
            (time, state) = (end, next);
        }
        let reason = format!("needs more than {MOST_STEPS} steps up to {to} s: it is stiff");
        Err(Failed(Function::DoStep, Err(Lost(reason))))
    }

    fn completed(&mut self) -> Done<[bool; 5]> {
        let mut call = Call::plain(Function::CompletedIntegratorStep);
        call.flags[0] = true;
        self.call(&mut call)?;
        Ok(call.flags)
    }

    /// The first moment in a step at which an indicator has crossed zero, and the states then.
    fn locate(
        &mut self,
        time: f64,
        size: f64,
        state: &[f64],
        slopes: &[Vec<f64>],
    ) -> Done<(f64, Vec<f64>)> {
        let (mut low, mut high) = (0.0, 1.0);
        let before = self.now.indicators.clone();
        while high - low > 1e-14_f64.max(1e-15 * time.abs() / size) {
            let middle = 0.5 * (low + high);
            let there = between(state, slopes, size, middle);
            let indicators = self.indicators(time + middle * size, &there)?;
            match crossed(&before, &indicators) {
                true => high = middle,
                false => low = middle,
            }
            if middle == low && middle == high {
                break;
            }
        }
        Ok((time + high * size, between(state, slopes, size, high)))
    }
}

/// Whether an indicator has another sign.
fn crossed(before: &[f64], after: &[f64]) -> bool {
    before
        .iter()
        .zip(after)
        .any(|(a, b)| (*a > 0.0) != (*b > 0.0))
}

/// States at the share `theta` of a step (continuous output of order 4).
fn between(state: &[f64], slopes: &[Vec<f64>], size: f64, theta: f64) -> Vec<f64> {
    let (t, rest) = (theta, 1.0 - theta);
    (0..state.len())
        .map(|i| {
            let whole: f64 = size * (0..6).map(|j| A[6][j] * slopes[j][i]).sum::<f64>();
            let r2 = size * slopes[0][i] - whole;
            let r3 = whole - size * slopes[6][i] - r2;
            let r4: f64 = size * (0..7).map(|j| D[j] * slopes[j][i]).sum::<f64>();
            state[i] + t * (whole + rest * (r2 + t * (r3 + rest * r4)))
        })
        .collect()
}

impl Endpoint for Stepped {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let fmu = self.fmu.as_mut();
        if let Some(outcome) = self.kept.carry_out(call, fmu, &mut self.now) {
            return outcome;
        }
        let done = match call.function {
            Function::ExitInitializationMode => {
                let status = self.fmu.call(call)?;
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
                    return self.fmu.call(call);
                }
                // Others may change at events only.
                let begun = self.plain(Function::EnterEventMode);
                let status = match begun {
                    Ok(_) => self.fmu.call(call)?,
                    Err(Failed(_, outcome)) => return outcome,
                };
                if !(0..=1).contains(&status) {
                    return Ok(status);
                }
                self.settle().and_then(|_| self.resume()).map(|()| None)
            }
            _ => return self.fmu.call(call),
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

/// Places of the stages.
const C: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];

/// Weights of the slopes at the stages; the last row is the step itself.
const A: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
        0.0,
        0.0,
    ],
    [
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
        0.0,
    ],
    [
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];

/// Weights of the error.
const E: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Weights of the continuous output.
const D: [f64; 7] = [
    -12715105075.0 / 11282082432.0,
    0.0,
    87487479700.0 / 32700410799.0,
    -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0,
    -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0,
];
