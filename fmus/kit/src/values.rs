//! Reading and writing variables.

use std::ffi::{CStr, CString, c_char};

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    instance::Instance,
    log::c_text,
    model::ValueReference,
    phase::Phase,
    variable::{Access, Causality, Variable},
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
        let component = &mut self.now.component;
        let value = match &variable.access {
            Access::Real(field) => *field(component),
            Access::Within(place) => *place(component),
            Access::Element(field, index) => field(component)[*index],
            _ => return Err(wrong_type(variable, "Float64")),
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
        match &variable.access {
            Access::Real(field) => *field(&mut self.now.component) = value,
            Access::Within(place) => *place(&mut self.now.component) = value,
            Access::Element(field, index) => field(&mut self.now.component)[*index] = value,
            _ => return Err(wrong_type(variable, "Float64")),
        }
        self.touch(variable.causality);
        Ok(())
    }

    /// The value of an Int32; with `choices` (FMI 2.0) also that of an enumeration.
    pub(crate) fn get_integer(&mut self, reference: ValueReference, choices: bool) -> Outcome<i32> {
        let variable = self.look_up(reference)?;
        match &variable.access {
            Access::Integer(field) => Ok(*field(&mut self.now.component)),
            Access::Choice(field, _) if choices => Ok(*field(&mut self.now.component)),
            _ => Err(wrong_type(variable, "Int32")),
        }
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
        let fits = match &variable.access {
            Access::Choice(_, choices) => choices
                .items
                .iter()
                .any(|item| i64::from(item.value) == value),
            _ => {
                variable.min.is_none_or(|min| value as f64 >= min)
                    && variable.max.is_none_or(|max| value as f64 <= max)
                    && i32::try_from(value).is_ok()
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
        match &variable.access {
            Access::Integer(field) => *field(&mut self.now.component) = value,
            Access::Choice(field, _) if choices => *field(&mut self.now.component) = value,
            _ => return Err(wrong_type(variable, "Int32")),
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
        match &variable.access {
            Access::Boolean(field) => Ok(*field(&mut self.now.component)),
            _ => Err(wrong_type(variable, "Boolean")),
        }
    }

    /// Whether a Boolean may be set now.
    pub(crate) fn check_boolean(&self, reference: ValueReference) -> Outcome {
        let variable = self.settable(reference)?;
        match &variable.access {
            Access::Boolean(_) => Ok(()),
            _ => Err(wrong_type(variable, "Boolean")),
        }
    }

    /// Sets a Boolean.
    pub(crate) fn set_boolean(&mut self, reference: ValueReference, value: bool) -> Outcome {
        let variable = self.settable(reference)?;
        let Access::Boolean(field) = &variable.access else {
            return Err(wrong_type(variable, "Boolean"));
        };
        *field(&mut self.now.component) = value;
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
