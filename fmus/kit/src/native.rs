//! A component without FMI: its descriptions for the packer, and a run that a test compares with
//! the same run through an importer.
#![allow(unsafe_code, reason = "called through C from outside the library")]

use std::ffi::{CString, c_char};

use crate::{
    component::Component,
    description,
    guard::catch,
    log::c_text,
    model::{Model, ValueReference},
};

/// Argument of `shakebench_describe`: `modelDescription.xml` of FMI 2.0.
pub const FMI2: i32 = 2;
/// Argument of `shakebench_describe`: `modelDescription.xml` of FMI 3.0.
pub const FMI3: i32 = 3;
/// Argument of `shakebench_describe`: the documentation page.
pub const DOCUMENTATION: i32 = 0;
/// Argument of `shakebench_describe`: the name of the model.
pub const NAME: i32 = 1;

/// Argument of `shakebench_describe`: `terminalsAndIcons.xml` of FMI 3.0.
pub const TERMINALS: i32 = 4;

/// A description as text to be freed with [`free_text`]; text beginning with `error: ` if the
/// component's table is wrong.
pub fn describe<C: Component>(what: i32) -> *mut c_char {
    let text = catch(|| match (Model::<C>::get(), what) {
        (Err(e), _) => format!("error: {e}"),
        (Ok(model), FMI2) => description::fmi2(model),
        (Ok(model), FMI3) => description::fmi3(model),
        (Ok(model), DOCUMENTATION) => description::html(model),
        (Ok(model), TERMINALS) => description::terminals(model),
        (Ok(_), NAME) => C::NAME.into(),
        (Ok(_), other) => format!("error: no description {other}"),
    });
    c_text(&text.unwrap_or_else(|e| format!("error: {e}"))).into_raw()
}

/// Frees a text.
///
/// # Safety
/// The text came from this library and was not freed.
pub unsafe fn free_text(text: *mut c_char) {
    if !text.is_null() {
        // SAFETY: the caller's promise.
        drop(unsafe { CString::from_raw(text) });
    }
}

/// A run: fixed parameters, then one row of Float64 inputs a step and one of outputs after it.
#[repr(C)]
pub struct Job {
    parameters: *const ValueReference,
    parameter_values: *const f64,
    parameter_count: usize,
    inputs: *const ValueReference,
    input_values: *const f64,
    input_count: usize,
    outputs: *const ValueReference,
    output_values: *mut f64,
    output_count: usize,
    steps: usize,
    start_time: f64,
    step_size: f64,
}

/// Runs the component by its trait alone. Returns NULL or what went wrong.
///
/// # Safety
/// Value references and values are arrays of the counts given; input and output values have as
/// many rows as there are steps.
pub unsafe fn run<C: Component>(job: *const Job) -> *mut c_char {
    // SAFETY: the caller's promise.
    let outcome = catch(|| unsafe { job.as_ref() }.map_or(Err("no job".into()), simulate::<C>));
    match outcome {
        Ok(Ok(())) => std::ptr::null_mut(),
        Ok(Err(problem)) => c_text(&problem.to_string()).into_raw(),
        Err(panic) => c_text(&panic.to_string()).into_raw(),
    }
}

fn simulate<C: Component>(job: &Job) -> Result<(), Box<dyn std::error::Error>> {
    let variables = C::variables();
    let field = |component: &mut C, reference: ValueReference| -> *mut f64 {
        let access = &variables[reference as usize - 1].access;
        let place = access.real(component);
        place.unwrap_or_else(|| panic!("value reference {reference} is not a Float64"))
    };
    let mut component = C::default();
    // SAFETY: arrays as promised to `run`; fields belong to `component`, which outlives them.
    unsafe {
        for i in 0..job.parameter_count {
            *field(&mut component, *job.parameters.add(i)) = *job.parameter_values.add(i);
        }
        component.initialize()?;
        component.update_outputs(job.start_time);
        for step in 0..job.steps {
            let time = job.start_time + step as f64 * job.step_size;
            for i in 0..job.input_count {
                let value = *job.input_values.add(step * job.input_count + i);
                *field(&mut component, *job.inputs.add(i)) = value;
            }
            component.update_outputs(time);
            component.step(time, job.step_size)?;
            component.update_outputs(time + job.step_size);
            for i in 0..job.output_count {
                let value = *field(&mut component, *job.outputs.add(i));
                *job.output_values.add(step * job.output_count + i) = value;
            }
        }
    }
    Ok(())
}
