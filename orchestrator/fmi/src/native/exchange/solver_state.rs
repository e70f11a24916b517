//! The state of an FMU that is stepped here: the FMU's own, and its solver's.

use std::collections::HashMap;

use super::super::super::call::{Call, Endpoint, Function, Lost, Values};

/// What a solver knows between two steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SolverState {
    pub states: Vec<f64>,
    pub indicators: Vec<f64>,
    /// When the next event is, s.
    pub next_event: Option<f64>,
    /// The last good step, s; where the next one begins.
    pub step: f64,
    /// Whether the FMU is in continuous-time mode.
    pub is_running: bool,
    /// Whether inputs were set since the last step.
    pub inputs_changed: bool,
    /// Whether the implicit method is used.
    pub is_stiff: bool,
    /// Steps after which the other method would have done better.
    pub limited: u32,
    /// Steps since the last of these.
    pub others: u32,
    /// The Jacobian that the implicit method uses, column after column; empty where it needs a new one.
    pub jacobian: Vec<f64>,
}

/// Numbers before the states in a solver's bytes.
const HEAD: usize = 10;

impl SolverState {
    /// As numbers: how many states, indicators and entries of the Jacobian, flags, next event, step, counts,
    /// states, indicators, Jacobian.
    fn numbers(&self) -> Vec<f64> {
        let flag = |is: bool| if is { 1.0 } else { 0.0 };
        let mut all = vec![
            self.states.len() as f64,
            self.indicators.len() as f64,
            flag(self.is_running),
            flag(self.inputs_changed),
            self.next_event.unwrap_or(f64::NAN),
            self.step,
            self.jacobian.len() as f64,
            flag(self.is_stiff),
            f64::from(self.limited),
            f64::from(self.others),
        ];
        all.extend(&self.states);
        all.extend(&self.indicators);
        all.extend(&self.jacobian);
        all
    }

    /// From numbers, with how many of them it took.
    fn of_numbers(all: &[f64]) -> Option<(Self, usize)> {
        let [
            states,
            indicators,
            running,
            changed,
            next,
            step,
            entries,
            stiff,
            limited,
            others,
        ] = *all.first_chunk::<HEAD>()?;
        let (states, indicators) = (states as usize, indicators as usize);
        let end = HEAD.checked_add(states)?;
        let middle = end.checked_add(indicators)?;
        let last = middle.checked_add(entries as usize)?;
        let state = Self {
            states: all.get(HEAD..end)?.to_vec(),
            indicators: all.get(end..middle)?.to_vec(),
            next_event: (!next.is_nan()).then_some(next),
            step,
            is_running: running != 0.0,
            inputs_changed: changed != 0.0,
            is_stiff: stiff != 0.0,
            limited: limited as u32,
            others: others as u32,
            jacobian: all.get(middle..last)?.to_vec(),
        };
        Some((state, last))
    }

    fn size(&self) -> usize {
        8 * (HEAD + self.states.len() + self.indicators.len() + self.jacobian.len())
    }
}

/// States that were kept: the FMU's handle and the solver's state, by the handle that was given out.
#[derive(Default)]
pub(super) struct KeptStates {
    all: HashMap<u64, (u64, SolverState)>,
    given: u64,
}

impl KeptStates {
    /// Carries out a call that concerns states; none where it is another call. `now` is the solver's
    /// state.
    pub(super) fn carry_out(
        &mut self,
        call: &mut Call,
        fmu: &mut dyn Endpoint,
        now: &mut SolverState,
    ) -> Option<Result<i32, Lost>> {
        Some(match call.function {
            Function::GetState => self.get(call, fmu, now),
            Function::SetState => self.set(call, fmu, now),
            Function::FreeState => {
                let outcome = self.pass_on(call, fmu).map(|(status, _)| status);
                self.all.remove(&call.handle);
                call.handle = 0;
                outcome
            }
            Function::SizeOfState => self.size(call, fmu),
            Function::WriteState => self.write(call, fmu),
            Function::ReadState => self.read(call, fmu),
            _ => return None,
        })
    }

    fn get(
        &mut self,
        call: &mut Call,
        fmu: &mut dyn Endpoint,
        now: &SolverState,
    ) -> Result<i32, Lost> {
        let known = self.all.get(&call.handle).map(|kept| kept.0);
        let mut own = Call::plain(Function::GetState);
        own.handle = known.unwrap_or(0);
        let status = fmu.call(&mut own)?;
        if known.is_none() {
            self.given += 1;
            call.handle = self.given;
        }
        self.all.insert(call.handle, (own.handle, now.clone()));
        Ok(status)
    }

    /// Passes the call on with the FMU's own handle; gives the status and the handle that came back.
    fn pass_on(&self, call: &Call, fmu: &mut dyn Endpoint) -> Result<(i32, u64), Lost> {
        let (own, _) = self.all.get(&call.handle).ok_or_else(unknown)?;
        let mut inner = Call::plain(call.function);
        inner.handle = *own;
        let status = fmu.call(&mut inner)?;
        Ok((status, inner.handle))
    }

    fn set(&self, call: &Call, fmu: &mut dyn Endpoint, now: &mut SolverState) -> Result<i32, Lost> {
        let (status, _) = self.pass_on(call, fmu)?;
        if let Some((_, kept)) = self.all.get(&call.handle) {
            now.clone_from(kept);
        }
        Ok(status)
    }

    fn size(&self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let (status, own) = self.pass_on(call, fmu)?;
        let solver = self.all.get(&call.handle).map_or(0, |kept| kept.1.size());
        call.handle = own.saturating_add(solver as u64);
        Ok(status)
    }

    fn write(&self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let (own, solver) = self.all.get(&call.handle).ok_or_else(unknown)?;
        let solver = solver.numbers();
        let Values::Out(bytes) = &mut call.values else {
            return Err(unknown());
        };
        let (head, rest) = bytes
            .split_at_mut_checked(8 * solver.len())
            .ok_or_else(unknown)?;
        head.copy_from_slice(bytemuck::cast_slice(&solver));
        let mut inner = Call::plain(Function::WriteState);
        inner.handle = *own;
        inner.count = rest.len();
        inner.values = Values::Out(rest);
        fmu.call(&mut inner)
    }

    fn read(&mut self, call: &mut Call, fmu: &mut dyn Endpoint) -> Result<i32, Lost> {
        let Values::In(bytes) = &call.values else {
            return Err(unknown());
        };
        let whole = &bytes[..bytes.len() / 8 * 8];
        let numbers: &[f64] = bytemuck::try_cast_slice(whole).map_err(|_| unknown())?;
        let (solver, length) = SolverState::of_numbers(numbers).ok_or_else(unknown)?;
        let rest = &bytes[8 * length..];
        let mut own = Call::plain(Function::ReadState);
        own.count = rest.len();
        own.values = Values::In(rest);
        let status = fmu.call(&mut own)?;
        self.given += 1;
        call.handle = self.given;
        self.all.insert(call.handle, (own.handle, solver));
        Ok(status)
    }
}

fn unknown() -> Lost {
    Lost("is of a state that was not kept".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solver_s_state_survives_its_numbers() {
        for next_event in [None, Some(0.25)] {
            let state = SolverState {
                states: vec![1.0, -0.0, 1e-300],
                indicators: vec![2.0],
                next_event,
                step: 1e-3,
                is_running: true,
                inputs_changed: false,
                is_stiff: true,
                limited: 3,
                others: 1,
                jacobian: vec![0.5; 9],
            };
            let numbers = state.numbers();
            assert_eq!(8 * numbers.len(), state.size());
            assert_eq!(SolverState::of_numbers(&numbers), Some((state, 23)));
        }
    }

    #[test]
    fn bytes_of_something_else_are_refused() {
        assert_eq!(SolverState::of_numbers(&[1.0; 5]), None);
        assert_eq!(
            SolverState::of_numbers(&[1e300, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            None
        );
    }
}
