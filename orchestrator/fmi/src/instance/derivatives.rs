//! Derivatives of outputs by inputs, as the FMU itself gives them.

use super::super::call::{Call, Function, Values};
use super::super::native::DISCARD;
use super::{Instance, Outcome};

impl Instance {
    /// Whether it says that it can give [`Instance::derivative`].
    pub fn gives_derivatives(&self) -> bool {
        let description = &self.fmu.description;
        description.directional_derivatives || description.adjoint_derivatives
    }

    /// What changes of the inputs `knowns` by `seed` change of the outputs `unknowns`, all Float64, at
    /// the present inputs: `sensitivity = (d unknowns / d knowns) seed`. From directional derivatives,
    /// or from adjoint ones where it gives only those. False where the FMU does not give them here.
    ///
    /// # Errors
    /// An error of the FMU.
    pub fn derivative(
        &mut self,
        (unknowns, sensitivity): (&[u32], &mut [f64]),
        (knowns, seed): (&[u32], &[f64]),
    ) -> Outcome<bool> {
        if self.fmu.description.directional_derivatives {
            let given = self.differentiate(
                Function::GetDirectionalDerivative,
                (unknowns, knowns),
                seed,
                sensitivity,
            )?;
            if given {
                return Ok(true);
            }
        }
        if !self.fmu.description.adjoint_derivatives {
            return Ok(false);
        }
        // A row of the derivative at a time.
        let mut weights = vec![0.0; sensitivity.len()];
        let mut row = vec![0.0; seed.len()];
        for at in 0..sensitivity.len() {
            weights[at] = 1.0;
            let function = Function::GetAdjointDerivative;
            if !self.differentiate(function, (unknowns, knowns), &weights, &mut row)? {
                return Ok(false);
            }
            weights[at] = 0.0;
            sensitivity[at] = row.iter().zip(seed).map(|(by, change)| by * change).sum();
        }
        Ok(true)
    }

    fn differentiate(
        &mut self,
        function: Function,
        (unknowns, knowns): (&[u32], &[u32]),
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Outcome<bool> {
        let references: Vec<u32> = unknowns.iter().chain(knowns).copied().collect();
        let mut numbers: Vec<f64> = seed.to_vec();
        numbers.resize(seed.len() + sensitivity.len(), 0.0);
        let mut call = Call::plain(function);
        call.references = &references;
        call.handle = unknowns.len() as u64;
        call.count = seed.len();
        call.values = Values::Both(bytemuck::cast_slice_mut(&mut numbers));
        match self.carry_out(&mut call) {
            Ok(0 | 1) => {}
            Ok(DISCARD) => return Ok(false),
            outcome => {
                self.judge(outcome, &call)?;
                return Ok(false);
            }
        }
        sensitivity.copy_from_slice(&numbers[seed.len()..]);
        Ok(sensitivity.iter().all(|value| value.is_finite()))
    }
}
