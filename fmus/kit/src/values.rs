//! Reading and writing variables.

use std::ffi::{CStr, CString, c_char};

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    instance::Instance,
    log::c_text,
    model::ValueReference,
    phase::Phase,
    variable::{Access, Causality, Type, Variable},
};

impl<C: Component> Instance<C> {
    #[inline]
    fn look_up(&mut self, reference: ValueReference) -> Outcome<&'static Variable<C>> {
        let variable = &self.model.variables[self.model.position(reference)?];
        if self.now.stale && variable.is_computed() {
            self.refresh()?;
        }
        Ok(variable)
    }

    #[inline]
    fn settable(&self, reference: ValueReference) -> Outcome<&'static Variable<C>> {
        let variable = &self.model.variables[self.model.position(reference)?];
        if self
            .now
            .phase
            .accepts(variable.causality, variable.variability)
        {
            return Ok(variable);
        }
        Err(Fault::error(format!(
            "variable `{}` ({:?} {:?}) cannot be set {}",
            variable.name,
            variable.variability,
            variable.causality,
            self.now.phase.name()
        )))
    }

    #[inline]
    fn touch(&mut self, causality: Causality) {
        self.now.stale = true;
        if causality == Causality::Parameter {
            self.now.unprepared = true;
        }
    }

    /// The value of a Float64.
    #[inline]
    pub(crate) fn get_real(&mut self, reference: ValueReference) -> Outcome<f64> {
        let variable = self.look_up(reference)?;
        let Some(&mut value) = variable.access.real(&mut self.now.component) else {
            return Err(wrong_type(variable, "Float64"));
        };
        if value.is_finite() {
            return Ok(value);
        }
        Err(Fault::error(format!(
            "variable `{}` became {value} at t = {} s",
            variable.name, self.now.time
        )))
    }

    /// Whether a Float64 may be set to `value` now.
    #[inline]
    pub(crate) fn check_real(&self, reference: ValueReference, value: f64) -> Outcome {
        let variable = self.settable(reference)?;
        if !variable.access.is_real() {
            return Err(wrong_type(variable, "Float64"));
        }
        let above = variable.min.is_none_or(|min| value >= min);
        let below = variable.max.is_none_or(|max| value <= max);
        if value.is_finite() && above && below {
            return Ok(());
        }
        Err(out_of_range(variable, value))
    }

    /// Sets a Float64 that was checked.
    #[inline]
    pub(crate) fn set_real(&mut self, reference: ValueReference, value: f64) -> Outcome {
        let variable = &self.model.variables[self.model.position(reference)?];
        let Some(place) = variable.access.real(&mut self.now.component) else {
            return Err(wrong_type(variable, "Float64"));
        };
        *place = value;
        self.touch(variable.causality);
        Ok(())
    }

    /// The value of an Int32; with `choices` (FMI 2.0) also that of an enumeration.
    pub(crate) fn get_integer(&mut self, reference: ValueReference, choices: bool) -> Outcome<i32> {
        let variable = self.look_up(reference)?;
        let access = &variable.access;
        let fits = choices || !matches!(access, Access::Choice(..));
        let value = fits.then(|| access.integer(&mut self.now.component));
        value.flatten().ok_or_else(|| wrong_type(variable, "Int32"))
    }

    /// The value of an enumeration.
    pub(crate) fn get_choice(&mut self, reference: ValueReference) -> Outcome<i32> {
        let variable = self.look_up(reference)?;
        match &variable.access {
            Access::Choice(field, _) => Ok(*field(&mut self.now.component)),
            _ => Err(wrong_type(variable, "Enumeration")),
        }
    }

    /// Whether an Int32 or enumeration may be set to `value` now.
    pub(crate) fn check_integer(&self, reference: ValueReference, value: i64) -> Outcome {
        let variable = self.settable(reference)?;
        let access = &variable.access;
        let fits = match access {
            Access::Choice(_, choices) => choices
                .items
                .iter()
                .any(|item| i64::from(item.value) == value),
            _ => {
                variable.min.is_none_or(|min| value as f64 >= min)
                    && variable.max.is_none_or(|max| value as f64 <= max)
                    && i32::try_from(value).is_ok()
                    && (value >= 0 || !access.counts())
            }
        };
        if fits {
            Ok(())
        } else {
            Err(out_of_range(variable, value as f64))
        }
    }

    /// Sets an Int32 that was checked; with `choices` (FMI 2.0) also an enumeration.
    pub(crate) fn set_integer(
        &mut self,
        reference: ValueReference,
        value: i32,
        choices: bool,
    ) -> Outcome {
        let variable = self.settable(reference)?;
        let access = &variable.access;
        let fits = choices || !matches!(access, Access::Choice(..));
        let set = fits.then(|| access.set_integer(&mut self.now.component, value));
        if set.flatten().is_none() {
            return Err(wrong_type(variable, "Int32"));
        }
        self.touch(variable.causality);
        Ok(())
    }

    /// Sets an enumeration that was checked.
    pub(crate) fn set_choice(&mut self, reference: ValueReference, value: i64) -> Outcome {
        let variable = self.settable(reference)?;
        let Access::Choice(field, _) = &variable.access else {
            return Err(wrong_type(variable, "Enumeration"));
        };
        *field(&mut self.now.component) = value as i32;
        self.touch(variable.causality);
        Ok(())
    }

    /// The value of a Boolean.
    pub(crate) fn get_boolean(&mut self, reference: ValueReference) -> Outcome<bool> {
        let variable = self.look_up(reference)?;
        let value = variable.access.boolean(&mut self.now.component);
        value
            .map(|value| *value)
            .ok_or_else(|| wrong_type(variable, "Boolean"))
    }

    /// Whether a Boolean may be set now.
    pub(crate) fn check_boolean(&self, reference: ValueReference) -> Outcome {
        let variable = self.settable(reference)?;
        match variable.access.kind() {
            Type::Boolean => Ok(()),
            _ => Err(wrong_type(variable, "Boolean")),
        }
    }

    /// Sets a Boolean.
    pub(crate) fn set_boolean(&mut self, reference: ValueReference, value: bool) -> Outcome {
        let variable = self.settable(reference)?;
        let Some(place) = variable.access.boolean(&mut self.now.component) else {
            return Err(wrong_type(variable, "Boolean"));
        };
        *place = value;
        self.touch(variable.causality);
        Ok(())
    }

    /// A text; the pointer is valid until the same variable is read again.
    pub(crate) fn get_text(&mut self, reference: ValueReference) -> Outcome<*const c_char> {
        let variable = self.look_up(reference)?;
        let Access::Text(field) = &variable.access else {
            return Err(wrong_type(variable, "String"));
        };
        let slot: &mut CString = &mut self.texts[reference as usize - 1];
        *slot = c_text(field(&mut self.now.component));
        Ok(slot.as_ptr())
    }

    /// Whether a text may be set to `value` now.
    pub(crate) fn check_text(&self, reference: ValueReference, value: &CStr) -> Outcome {
        let variable = self.settable(reference)?;
        match &variable.access {
            Access::Text(_) if value.to_str().is_ok() => Ok(()),
            Access::Text(_) => Err(Fault::error(format!(
                "variable `{}`: text is not UTF-8",
                variable.name
            ))),
            _ => Err(wrong_type(variable, "String")),
        }
    }

    /// Sets a text that was checked.
    pub(crate) fn set_text(&mut self, reference: ValueReference, value: &CStr) -> Outcome {
        let variable = self.settable(reference)?;
        let Access::Text(field) = &variable.access else {
            return Err(wrong_type(variable, "String"));
        };
        *field(&mut self.now.component) = value.to_string_lossy().into_owned();
        self.touch(variable.causality);
        Ok(())
    }

    /// Whether the instance runs, so that partial derivatives make sense.
    pub(crate) fn require_running(&self) -> Outcome {
        self.require(&[
            Phase::Initialization,
            Phase::Step,
            Phase::Event,
            Phase::ContinuousTime,
        ])
    }
}

#[cold]
fn wrong_type<C>(variable: &Variable<C>, asked: &str) -> Box<Fault> {
    let is = variable.access.kind().name();
    Fault::error(format!(
        "variable `{}` is a {is}, not a {asked}",
        variable.name
    ))
}

#[cold]
fn out_of_range<C>(variable: &Variable<C>, value: f64) -> Box<Fault> {
    let expected = match &variable.access {
        Access::Choice(_, choices) => {
            let items: Vec<_> = choices
                .items
                .iter()
                .map(|i| format!("{} ({})", i.value, i.name))
                .collect();
            format!("one of {}", items.join(", "))
        }
        _ => match (variable.min, variable.max) {
            (Some(min), Some(max)) => format!("{min} to {max}"),
            (Some(min), None) => format!("at least {min}"),
            (None, Some(max)) => format!("at most {max}"),
            (None, None) if variable.access.counts() => "zero or more".into(),
            (None, None) => "a finite number".into(),
        },
    };
    let unit = variable
        .unit
        .map_or(String::new(), |unit| format!(" {unit}"));
    Fault::error(format!(
        "variable `{}`: {value}{unit}, expected {expected}",
        variable.name
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        log::{Log, Sink},
        model::Model,
        oscillator::{FORCE, MASS, NOTE, POSITION, STEPS, instance, refusal, running},
        panel::{A, COUNT, INNER, MODE, OFFSET_2, ON, Panel, SOUND},
        phase::Kind,
    };

    fn panel() -> Instance<Panel<SOUND>> {
        Instance::new(
            Model::get().unwrap(),
            Panel::default(),
            Kind::CoSimulation,
            Log::new(Sink::None, c"panel", false),
        )
    }

    #[test]
    fn a_value_below_the_least_is_refused_by_name_and_the_least_itself_is_not() {
        let instance = instance(Kind::CoSimulation);
        for value in [0.0999, 0.0, -3.0] {
            let message = refusal(instance.check_real(MASS, value));
            assert!(message.contains("`mass`"), "{message}");
            assert!(
                message.contains(&format!("{value} kg, expected at least 0.1")),
                "{message}"
            );
        }
        assert_eq!(instance.check_real(MASS, 0.1), Ok(()));
        assert_eq!(instance.check_real(MASS, 1e9), Ok(()));
        // Without bounds, every finite number.
        assert_eq!(instance.check_real(FORCE, -1e300), Ok(()));
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(refusal(instance.check_real(FORCE, value)).contains("a finite number"));
            assert!(refusal(instance.check_real(MASS, value)).contains("`mass`"));
        }
    }

    #[test]
    fn outputs_and_fixed_parameters_are_refused_while_the_instance_runs() {
        let instance = running(Kind::CoSimulation);
        assert!(refusal(instance.check_real(POSITION, 0.0)).contains("`position` (Continuous"));
        assert!(refusal(instance.check_real(MASS, 1.0)).contains("cannot be set in step mode"));
        assert_eq!(instance.check_real(FORCE, 1.0), Ok(()));
    }

    #[test]
    fn a_variable_is_read_and_written_as_its_own_type_only() {
        let mut instance = instance(Kind::CoSimulation);
        assert!(refusal(instance.get_real(STEPS)).contains("`steps` is a Int32, not a Float64"));
        assert!(refusal(instance.get_integer(FORCE, true)).contains("not a Int32"));
        assert!(refusal(instance.get_choice(STEPS)).contains("not a Enumeration"));
        assert!(refusal(instance.get_boolean(FORCE)).contains("not a Boolean"));
        assert!(refusal(instance.get_text(FORCE)).contains("not a String"));
        assert!(refusal(instance.check_real(NOTE, 1.0)).contains("not a Float64"));
        assert!(refusal(instance.check_boolean(FORCE)).contains("not a Boolean"));
        assert!(refusal(instance.set_boolean(FORCE, true)).contains("not a Boolean"));
        assert!(refusal(instance.set_integer(FORCE, 1, true)).contains("not a Int32"));
        assert!(refusal(instance.set_choice(FORCE, 1)).contains("not a Enumeration"));
        assert!(refusal(instance.check_text(FORCE, c"x")).contains("not a String"));
        assert!(refusal(instance.set_text(FORCE, c"x")).contains("not a String"));
        assert!(refusal(instance.set_real(NOTE, 1.0)).contains("not a Float64"));
    }

    #[test]
    fn a_text_comes_back_as_it_was_set_and_must_be_utf_8() {
        let mut instance = instance(Kind::CoSimulation);
        let text = c"ein Maß";
        assert_eq!(instance.check_text(NOTE, text), Ok(()));
        instance.set_text(NOTE, text).unwrap();
        let got = instance.get_text(NOTE).unwrap();
        let slot = &instance.texts[NOTE as usize - 1];
        assert_eq!(got, slot.as_ptr());
        assert_eq!(slot.as_c_str(), text);
        let broken = c"\xff";
        assert!(refusal(instance.check_text(NOTE, broken)).contains("not UTF-8"));
    }

    #[test]
    fn integers_have_their_range_and_enumerations_their_choices() {
        let mut instance = panel();
        for value in [0, 6, i64::from(i32::MAX) + 1] {
            let message = refusal(instance.check_integer(COUNT, value));
            assert!(message.contains("expected 1 to 5"), "{message}");
        }
        assert_eq!(instance.check_integer(COUNT, 1), Ok(()));
        assert_eq!(instance.check_integer(COUNT, 5), Ok(()));
        instance.set_integer(COUNT, 5, false).unwrap();
        assert_eq!(instance.get_integer(COUNT, false), Ok(5));
        assert_eq!(instance.now.component.count, 5);

        let message = refusal(instance.check_integer(MODE, 2));
        assert!(message.contains("one of 1 (slow), 4 (fast)"), "{message}");
        assert_eq!(instance.check_integer(MODE, 1), Ok(()));
        instance.set_choice(MODE, 1).unwrap();
        assert_eq!(instance.get_choice(MODE), Ok(1));
        // FMI 2.0 reads and writes an enumeration as an integer, FMI 3.0 does not.
        instance.set_integer(MODE, 4, true).unwrap();
        assert_eq!(instance.get_integer(MODE, true), Ok(4));
        assert!(refusal(instance.set_integer(MODE, 1, false)).contains("not a Int32"));
        assert!(refusal(instance.get_integer(MODE, false)).contains("not a Int32"));
        assert_eq!(instance.now.component.mode, 4);
    }

    #[test]
    fn elements_and_parts_are_reached_where_they_are() {
        let mut instance = panel();
        for (reference, value) in [(A, 1.0), (OFFSET_2, 2.0), (INNER, 3.0)] {
            instance.set_real(reference, value).unwrap();
            assert_eq!(instance.get_real(reference), Ok(value));
        }
        let component = &instance.now.component;
        assert_eq!(component.offsets, [0.0, 2.0]);
        assert_eq!((component.a, component.inner), (1.0, (0.0, 3.0)));
        assert_eq!(instance.check_boolean(ON), Ok(()));
        instance.set_boolean(ON, true).unwrap();
        assert_eq!(instance.get_boolean(ON), Ok(true));
    }

    #[test]
    fn a_value_that_is_set_makes_outputs_be_computed_anew() {
        let mut instance = panel();
        instance.set_up(0.0, None).unwrap();
        instance.enter_initialization().unwrap();
        instance.exit_initialization().unwrap();
        instance.refresh().unwrap();
        assert!(!instance.now.stale && !instance.now.unprepared);
        instance.set_real(A, 1.0).unwrap();
        assert!(instance.now.stale && !instance.now.unprepared);
        instance.refresh().unwrap();
        instance.set_real(INNER, 1.0).unwrap();
        assert!(instance.now.stale && instance.now.unprepared);
    }
}
