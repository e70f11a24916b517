//! The FMU as a system of differential equations: `dx/dt = f(t, x)`, with event indicators.

use bytemuck::{cast_slice, cast_slice_mut};

use super::super::super::call::{Call, Endpoint, Function, Lost, Values};
use super::super::DISCARD;

/// A call that did not go well: its outcome, and which it was.
pub(super) struct Failed(pub Function, pub Result<i32, Lost>);

pub(super) type Done<T = ()> = Result<T, Failed>;

/// Shares of a state's nominal value by which it is measured where it is near zero.
const FLOOR: f64 = 1e-3;

/// An FMU in model exchange.
pub(super) struct Model {
    pub fmu: Box<dyn Endpoint>,
    /// Value references of each state and its derivative; empty where the description does not give them,
    /// or the FMU has no directional derivatives.
    pub pairs: Vec<(u32, u32)>,
    /// Nominal values of the states.
    pub nominals: Vec<f64>,
    /// Relative error of a step.
    pub tolerance: f64,
}

impl Model {
    pub(super) fn call(&mut self, call: &mut Call) -> Done {
        match self.fmu.call(call) {
            Ok(0 | 1) => Ok(()),
            outcome => Err(Failed(call.function, outcome)),
        }
    }

    pub(super) fn plain(&mut self, function: Function) -> Done<Call<'static>> {
        let mut call = Call::plain(function);
        self.call(&mut call)?;
        Ok(call)
    }

    pub(super) fn read(&mut self, function: Function, into: &mut [f64]) -> Done {
        if into.is_empty() {
            return Ok(());
        }
        let mut call = Call::plain(function);
        call.count = into.len();
        call.values = Values::Out(cast_slice_mut(into));
        self.call(&mut call)
    }

    /// Reads the states' nominal values; 1 where the FMU gives none.
    pub(super) fn read_nominals(&mut self, states: usize) {
        let mut nominals = vec![1.0; states];
        let is_read = self.read(Function::GetNominals, &mut nominals).is_ok();
        for nominal in &mut nominals {
            let size = nominal.abs();
            let is_sound = is_read && size.is_finite() && size > 0.0;
            *nominal = if is_sound { size } else { 1.0 };
        }
        self.nominals = nominals;
    }

    pub(super) fn set(&mut self, time: f64, states: &[f64]) -> Done {
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

    /// Derivatives of the states; NaN where the FMU discards the states.
    pub(super) fn derivatives(&mut self, time: f64, states: &[f64], into: &mut [f64]) -> Done {
        let done = self.set(time, states);
        let done = done.and_then(|()| self.read(Function::GetDerivatives, into));
        match done {
            Err(Failed(_, Ok(DISCARD))) => {
                into.fill(f64::NAN);
                Ok(())
            }
            done => done,
        }
    }

    pub(super) fn indicators(&mut self, time: f64, states: &[f64], into: &mut [f64]) -> Done {
        if into.is_empty() {
            return Ok(());
        }
        self.set(time, states)?;
        self.read(Function::GetEventIndicators, into)
    }

    /// The size by which a state between these two values is measured.
    pub(super) fn size(&self, at: usize, before: f64, after: f64) -> f64 {
        let nominal = self.nominals.get(at).copied().unwrap_or(1.0);
        FLOOR * nominal + before.abs().max(after.abs())
    }

    /// The derivative of the derivatives along state `column`, at the states that were set last; false
    /// where the FMU does not give it.
    fn directional(&mut self, column: usize, into: &mut [f64]) -> bool {
        let n = self.pairs.len();
        let Some(&(known, _)) = self.pairs.get(column) else {
            return false;
        };
        let unknowns = self.pairs.iter().map(|pair| pair.1);
        let references: Vec<u32> = unknowns.chain([known]).collect();
        let mut numbers = vec![0.0; 1 + n];
        numbers[0] = 1.0;
        let mut call = Call::plain(Function::GetDirectionalDerivative);
        call.references = &references;
        call.handle = n as u64;
        call.count = 1;
        call.values = Values::Both(cast_slice_mut(&mut numbers));
        if !matches!(self.fmu.call(&mut call), Ok(0 | 1)) {
            return false;
        }
        into.copy_from_slice(&numbers[1..]);
        into.iter().all(|value| value.is_finite())
    }

    /// The Jacobian of the derivatives `slope` at `states`, column after column: by the FMU's directional
    /// derivatives where it has them, otherwise by differences.
    pub(super) fn jacobian(&mut self, time: f64, states: &[f64], slope: &[f64]) -> Done<Vec<f64>> {
        let n = states.len();
        let mut matrix = vec![0.0; n * n];
        if self.pairs.len() == n {
            self.set(time, states)?;
            if (0..n).all(|j| self.directional(j, &mut matrix[j * n..][..n])) {
                return Ok(matrix);
            }
            self.pairs.clear();
        }
        let mut moved = states.to_vec();
        let mut there = vec![0.0; n];
        for j in 0..n {
            // With the flow, which keeps to the side on which the model is defined.
            let step = f64::EPSILON.sqrt() * self.size(j, states[j], states[j]);
            let step = if slope[j] < 0.0 { -step } else { step };
            for step in [step, -step] {
                moved[j] = states[j] + step;
                let step = moved[j] - states[j];
                self.derivatives(time, &moved, &mut there)?;
                for i in 0..n {
                    matrix[j * n + i] = (there[i] - slope[i]) / step;
                }
                if there.iter().all(|value| value.is_finite()) {
                    break;
                }
            }
            moved[j] = states[j];
        }
        Ok(matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x' = (x y, y - 3 x)` where x is not negative, with nominal values that are partly wrong.
    struct Equations {
        states: [f64; 2],
        nominals: [f64; 2],
    }

    impl Endpoint for Equations {
        fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
            let [x, y] = self.states;
            match (call.function, &mut call.values) {
                (Function::SetContinuousStates, Values::In(bytes)) => {
                    self.states.copy_from_slice(cast_slice(bytes));
                }
                (Function::GetDerivatives, Values::Out(_)) if x < 0.0 => return Ok(DISCARD),
                (Function::GetDerivatives, Values::Out(bytes)) => {
                    cast_slice_mut(bytes).copy_from_slice(&[x * y, y - 3.0 * x]);
                }
                (Function::GetNominals, Values::Out(bytes)) => {
                    cast_slice_mut(bytes).copy_from_slice(&self.nominals);
                }
                _ => {}
            }
            Ok(0)
        }
    }

    fn model(nominals: [f64; 2]) -> Model {
        let states = [0.0; 2];
        Model {
            fmu: Box::new(Equations { states, nominals }),
            pairs: Vec::new(),
            nominals: Vec::new(),
            tolerance: 1e-6,
        }
    }

    #[test]
    fn a_nominal_value_that_is_no_size_counts_as_one() {
        for (given, expected) in [
            ([-2.0, 3.0], [2.0, 3.0]),
            ([0.0, f64::NAN], [1.0, 1.0]),
            ([f64::INFINITY, 0.5], [1.0, 0.5]),
        ] {
            let mut model = model(given);
            model.read_nominals(2);
            assert_eq!(model.nominals, expected);
            assert_eq!(model.size(0, -0.25, 0.125), FLOOR * expected[0] + 0.25);
        }
    }

    #[test]
    fn the_jacobian_is_that_of_the_equations_also_at_the_edge_of_where_they_hold() {
        let mut model = model([1.0; 2]);
        model.read_nominals(2);
        for states in [[2.0, 5.0], [0.0, -4.0]] {
            let [x, y] = states;
            let slope = [x * y, y - 3.0 * x];
            let found = model.jacobian(0.0, &states, &slope).unwrap_or_default();
            // Column after column.
            for (found, expected) in found.iter().zip([y, -3.0, x, 1.0]) {
                // Rounding of slopes of size 4 over a step of 1.5e-11.
                assert!((found - expected).abs() < 1e-4, "{found} {expected}");
            }
            assert_eq!(found.len(), 4);
        }
    }
}
