//! What a solver knows between two steps, which belongs to the state of its FMU.

use super::super::kept_states::Numbers;

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

impl Numbers for SolverState {
    /// How many states, indicators and entries of the Jacobian, flags, next event, step, counts,
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
