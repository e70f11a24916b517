//! Model exchange: the importer integrates the component's derivatives.

use crate::{
    component::{Component, Event},
    fault::{Fault, Outcome},
    instance::Instance,
    model::{State, ValueReference},
    phase::Phase,
};

const RUNNING: &[Phase] = &[Phase::Event, Phase::ContinuousTime];

impl<C: Component> Instance<C> {
    pub(crate) fn enter_event_mode(&mut self) -> Outcome {
        self.require(RUNNING)?;
        self.enter(Phase::Event);
        Ok(())
    }

    pub(crate) fn enter_continuous_time_mode(&mut self) -> Outcome {
        self.require(&[Phase::Event])?;
        self.now.phase = Phase::ContinuousTime;
        Ok(())
    }

    /// Lets the component handle an event.
    pub(crate) fn update_discrete_states(&mut self) -> Outcome<Event> {
        self.require(&[Phase::Event])?;
        let time = self.now.time;
        let event = self.now.component.handle_event(time).map_err(|problem| {
            self.now.phase = Phase::Failed;
            Fault::error(format!("the event at t = {time} s failed: {problem}"))
        })?;
        self.now.stale = true;
        Ok(event)
    }

    pub(crate) fn completed_integrator_step(&mut self) -> Outcome {
        self.require(&[Phase::ContinuousTime])
    }

    pub(crate) fn set_time(&mut self, time: f64) -> Outcome {
        self.require(RUNNING)?;
        if !time.is_finite() {
            return Err(Fault::error(format!("time {time} is not finite")));
        }
        self.now.time = time;
        self.now.stale = true;
        Ok(())
    }

    fn states(&self, count: usize) -> Outcome<&'static [State]> {
        let states = &self.model.states;
        if states.len() == count {
            return Ok(states);
        }
        Err(Fault::error(format!(
            "an array of length {count} for the {} continuous states of {}",
            states.len(),
            C::NAME
        )))
    }

    pub(crate) fn set_states(&mut self, values: &[f64]) -> Outcome {
        self.require(&[Phase::ContinuousTime])?;
        let states = self.states(values.len())?;
        for (state, value) in states.iter().zip(values) {
            if !value.is_finite() {
                let name = &self.model.variables[state.state].name;
                return Err(Fault::error(format!(
                    "continuous state `{name}` set to {value}"
                )));
            }
        }
        for (state, value) in states.iter().zip(values) {
            self.set_real(reference(state.state), *value)?;
        }
        Ok(())
    }

    pub(crate) fn get_states(&mut self, values: &mut [f64]) -> Outcome {
        self.require_running()?;
        for (state, value) in self.states(values.len())?.iter().zip(values) {
            *value = self.get_real(reference(state.state))?;
        }
        Ok(())
    }

    pub(crate) fn get_derivatives(&mut self, values: &mut [f64]) -> Outcome {
        self.require_running()?;
        for (state, value) in self.states(values.len())?.iter().zip(values) {
            *value = self.get_real(reference(state.derivative))?;
        }
        Ok(())
    }

    pub(crate) fn get_nominals(&self, values: &mut [f64]) -> Outcome {
        for (state, value) in self.states(values.len())?.iter().zip(values) {
            *value = self.model.variables[state.state].nominal.unwrap_or(1.0);
        }
        Ok(())
    }

    pub(crate) fn get_event_indicators(&mut self, values: &mut [f64]) -> Outcome {
        self.require_running()?;
        if values.len() != C::EVENT_INDICATORS {
            return Err(Fault::error(format!(
                "an array of length {} for the {} event indicators of {}",
                values.len(),
                C::EVENT_INDICATORS,
                C::NAME
            )));
        }
        self.refresh()?;
        self.now.component.event_indicators(self.now.time, values);
        Ok(())
    }
}

fn reference(index: usize) -> ValueReference {
    index as ValueReference + 1
}
