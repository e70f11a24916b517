//! Dependencies and derivatives through the C interface of FMI 3.0.
//!
//! # Safety
//! All functions: pointers are as the standard prescribes; lengths belong to their arrays.

use super::Handle;
use crate::{
    component::Component,
    fault::{Fault, Outcome, Status},
    guard::entry,
    model::ValueReference,
    pointers::{slice, slice_mut, target},
    variable::Dependency,
};

pub unsafe fn dependencies<C: Component>(
    handle: Handle,
    reference: ValueReference,
    count: *mut usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetNumberOfVariableDependencies", |instance| {
            let index = instance.model.position(reference)?;
            *target(count, "nDependencies")? = instance.model.dependencies[index].len();
            Ok(())
        })
    }
}

pub unsafe fn list_dependencies<C: Component>(
    handle: Handle,
    reference: ValueReference,
    dependent_elements: *mut usize,
    independents: *mut ValueReference,
    independent_elements: *mut usize,
    kinds: *mut i32,
    count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetVariableDependencies", |instance| {
            let on = &instance.model.dependencies[instance.model.position(reference)?];
            if on.len() != count {
                let problem = format!("{count} places for {} dependencies", on.len());
                return Err(Fault::error(problem));
            }
            slice_mut(dependent_elements, count, "elementIndicesOfDependent")?.fill(0);
            slice_mut(independent_elements, count, "elementIndicesOfIndependents")?.fill(0);
            let independents = slice_mut(independents, count, "independents")?;
            let kinds = slice_mut(kinds, count, "dependencyKinds")?;
            for (i, (index, kind)) in on.iter().enumerate() {
                independents[i] = *index as ValueReference + 1;
                kinds[i] = match kind {
                    Dependency::Constant => 1,
                    Dependency::Fixed => 2,
                    Dependency::Dependent => 5,
                };
            }
            Ok(())
        })
    }
}

pub unsafe fn directional_derivative<C: Component>(
    handle: Handle,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetDirectionalDerivative", |instance| {
            same_length("seed", seed_count, known_count)?;
            same_length("sensitivity", sensitivity_count, unknown_count)?;
            instance.directional_derivative(
                slice(unknowns, unknown_count, "unknowns")?,
                slice(knowns, known_count, "knowns")?,
                slice(seed, known_count, "seed")?,
                slice_mut(sensitivity, unknown_count, "sensitivity")?,
            )
        })
    }
}

pub unsafe fn adjoint_derivative<C: Component>(
    handle: Handle,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetAdjointDerivative", |instance| {
            same_length("seed", seed_count, unknown_count)?;
            same_length("sensitivity", sensitivity_count, known_count)?;
            instance.adjoint_derivative(
                slice(unknowns, unknown_count, "unknowns")?,
                slice(knowns, known_count, "knowns")?,
                slice(seed, unknown_count, "seed")?,
                slice_mut(sensitivity, known_count, "sensitivity")?,
            )
        })
    }
}

fn same_length(name: &str, length: usize, expected: usize) -> Outcome {
    if length == expected {
        return Ok(());
    }
    Err(Fault::error(format!(
        "`{name}` has length {length}, expected {expected}"
    )))
}
