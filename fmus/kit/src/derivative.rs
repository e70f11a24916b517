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
                    "`{}` is not an unknown: expected an output or the derivative of a state",
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
                    "`{}` is not a known: expected an input or a continuous state",
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

#[cfg(test)]
mod tests {
    use crate::{
        oscillator::{ACCELERATION, FORCE, MASS, POSITION, VELOCITY, refusal, running},
        phase::Kind,
    };

    #[test]
    fn directional_and_adjoint_derivatives_are_the_jacobian_times_the_seed() {
        let mut instance = running(Kind::ModelExchange);
        let (unknowns, knowns) = ([POSITION, ACCELERATION], [POSITION, VELOCITY, FORCE]);
        // Rows: position, acceleration; m = 2, k = 50.
        let jacobian = [[1.0, 0.0, 0.0], [-25.0, 0.0, 0.5]];
        let (v, w) = ([3.0, 5.0, 7.0], [2.0, -1.0]);
        let mut forward = [0.0; 2];
        instance
            .directional_derivative(&unknowns, &knowns, &v, &mut forward)
            .unwrap();
        let mut backward = [0.0; 3];
        instance
            .adjoint_derivative(&unknowns, &knowns, &w, &mut backward)
            .unwrap();
        for i in 0..2 {
            assert_eq!(forward[i], (0..3).map(|j| jacobian[i][j] * v[j]).sum());
        }
        for j in 0..3 {
            assert_eq!(backward[j], (0..2).map(|i| jacobian[i][j] * w[i]).sum());
        }
    }

    #[test]
    fn knowns_and_unknowns_are_checked() {
        let mut instance = running(Kind::CoSimulation);
        let mut one = |unknown, known| {
            refusal(instance.directional_derivative(&[unknown], &[known], &[1.0], &mut [0.0]))
        };
        assert!(one(FORCE, FORCE).contains("`force` is not an unknown"));
        assert!(one(ACCELERATION, MASS).contains("`mass` is not a known"));
        assert!(one(ACCELERATION, 99).contains("value reference 99"));
    }
}
