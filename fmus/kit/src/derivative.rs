//! Directional and adjoint derivatives from a component's partial derivatives.

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    instance::Instance,
    model::ValueReference,
    variable::Causality,
};

impl<C: Component> Instance<C> {
    /// `J v`: the change of the unknowns when the knowns change by `seed`.
    pub(crate) fn directional_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Outcome {
        self.prepare_derivatives(unknowns, knowns)?;
        for (unknown, value) in unknowns.iter().zip(sensitivity) {
            *value = knowns
                .iter()
                .zip(seed)
                .map(|(k, v)| self.partial(*unknown, *k) * v)
                .sum();
        }
        Ok(())
    }

    /// `v J`: the gradient with respect to the knowns of the unknowns weighted by `seed`.
    pub(crate) fn adjoint_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Outcome {
        self.prepare_derivatives(unknowns, knowns)?;
        for (known, value) in knowns.iter().zip(sensitivity) {
            *value = unknowns
                .iter()
                .zip(seed)
                .map(|(u, v)| self.partial(*u, *known) * v)
                .sum();
        }
        Ok(())
    }

    fn prepare_derivatives(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
    ) -> Outcome {
        if !C::PARTIAL_DERIVATIVES {
            return Err(Fault::error(format!(
                "{} offers no partial derivatives",
                C::NAME
            )));
        }
        self.require_running()?;
        for unknown in unknowns {
            let variable = &self.model.variables[self.model.position(*unknown)?];
            if !variable.is_computed() || !variable.access.is_real() {
                return Err(Fault::error(format!(
                    "`{}` is no unknown: expected an output or the derivative of a state",
                    variable.name
                )));
            }
        }
        for known in knowns {
            let index = self.model.position(*known)?;
            let variable = &self.model.variables[index];
            let is_state = self.model.states.iter().any(|s| s.state == index);
            if (variable.causality != Causality::Input && !is_state) || !variable.access.is_real() {
                return Err(Fault::error(format!(
                    "`{}` is no known: expected an input or a continuous state",
                    variable.name
                )));
            }
        }
        self.refresh()
    }

    fn partial(&self, unknown: ValueReference, known: ValueReference) -> f64 {
        let (unknown, known) = (unknown as usize - 1, known as usize - 1);
        if unknown == known {
            return 1.0;
        }
        if !self.model.dependencies[unknown]
            .iter()
            .any(|(on, _)| *on == known)
        {
            return 0.0;
        }
        let name = |index: usize| self.model.variables[index].name.as_str();
        self.now
            .component
            .partial_derivative(name(unknown), name(known))
    }
}
