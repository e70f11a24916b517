//! Checks that [`export!`](crate::export) adds to the unit tests of every component: what the
//! table promises, the component keeps.
#![allow(unsafe_code, reason = "an allocator that counts")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use crate::{component::Component, model::Model, variable::Causality};

#[cfg(test)]
mod tests;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, counting what the present thread asks of it.
pub struct CountingAllocator;

// SAFETY: everything is passed on to the system's allocator.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is that of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Number of heap allocations of the present thread while `body` runs, if [`CountingAllocator`] is
/// the global allocator.
pub fn allocations(body: impl FnOnce()) -> usize {
    let before = ALLOCATIONS.with(Cell::get);
    body();
    ALLOCATIONS.with(Cell::get) - before
}

/// Checks the component.
///
/// # Panics
/// With what the component does not keep.
pub fn check<C: Component>() {
    let model = Model::<C>::get().expect("the table is sound");
    let mut component = C::default();
    component
        .initialize()
        .expect("the defaults can be initialized");
    let first = bytes(&component);
    component.initialize().expect("it can be initialized again");
    assert_eq!(
        bytes(&component),
        first,
        "initializing again gives the same"
    );

    let mut numbers = Numbers(1);
    for _ in 0..5 {
        excite(model, &mut component, &mut numbers);
        check_dependencies(model, &component);
    }
    check_initial_dependencies(model);
    check_replay(model, &component, &mut numbers);

    let mut inputs = |component: &mut C| set_inputs(model, component, &mut numbers);
    inputs(&mut component);
    let counted = allocations(|| {
        for k in 0..1000 {
            let time = f64::from(k) * C::STEP_SIZE;
            component.update_outputs(time);
            inputs(&mut component);
            component
                .step(time, C::STEP_SIZE)
                .expect("the step succeeds");
        }
    });
    assert_eq!(counted, 0, "heap allocations in 1000 steps");
}

/// Sets the component's Float64 variables named one after the other to 1, 2, 3, ..., so that a test
/// sees where each of them arrives.
///
/// # Panics
/// When one of them is not in the table.
pub fn number<C: Component>(component: &mut C, names: &[&str]) {
    let model = Model::<C>::get().expect("the table is sound");
    for (i, name) in names.iter().enumerate() {
        let (_, variable) = model.find(name).expect("the variable is in the table");
        *variable
            .access
            .real(component)
            .expect("the variable is a Float64") = (i + 1) as f64;
    }
}

/// Checks that each of the values alone, of a Float64 or Int32 variable, is refused by the variable's name.
///
/// # Panics
/// When one of them is not refused, or not by its name.
pub fn refuses<C: Component>(values: &[(&str, f64)]) {
    let model = Model::<C>::get().expect("the table is sound");
    for &(name, value) in values {
        let mut component = C::default();
        let (_, variable) = model.find(name).expect("the variable is in the table");
        let access = &variable.access;
        match access.real(&mut component) {
            Some(place) => *place = value,
            // What is below zero is not even set.
            None if access.counts() && value < 0.0 => continue,
            None => access
                .set_integer(&mut component, value as i32)
                .expect("the variable is a number"),
        }
        let refused = component.initialize().expect_err("it is refused");
        let error = refused.to_string();
        assert!(error.contains(&format!("`{name}`")), "{name}: {error}");
    }
}

fn bytes<C: Component>(component: &C) -> Vec<u8> {
    postcard::to_allocvec(component).expect("the component can be serialized")
}

/// Equally distributed numbers in -1 to 1 (splitmix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Sets the inputs to about a hundredth of their nominal value.
fn set_inputs<C: Component>(model: &Model<C>, component: &mut C, numbers: &mut Numbers) {
    for variable in model
        .variables
        .iter()
        .filter(|v| v.causality == Causality::Input)
    {
        let size = 0.01 * variable.nominal.unwrap_or(1.0);
        let (min, max) = (variable.min.unwrap_or(-size), variable.max.unwrap_or(size));
        if let Some(value) = variable.access.real(component) {
            *value = (size * numbers.next()).clamp(min, max);
        }
    }
}

fn excite<C: Component>(model: &Model<C>, component: &mut C, numbers: &mut Numbers) {
    for k in 0..20 {
        set_inputs(model, component, numbers);
        component
            .step(f64::from(k) * C::STEP_SIZE, C::STEP_SIZE)
            .expect("the step succeeds");
    }
    component.update_outputs(0.0);
}

/// Outputs and derivatives change only with what the table says, and as it says.
fn check_dependencies<C: Component>(model: &Model<C>, component: &C) {
    let unknowns: Vec<usize> = (0..model.variables.len())
        .filter(|i| {
            let is_derivative = model.states.iter().any(|s| s.derivative == *i);
            let variable = &model.variables[*i];
            variable.access.is_real() && (variable.causality == Causality::Output || is_derivative)
        })
        .collect();
    let knowns = (0..model.variables.len()).filter(|i| {
        let is_state = model.states.iter().any(|s| s.state == *i);
        model.variables[*i].causality == Causality::Input || is_state
    });
    for known in knowns {
        let variable = &model.variables[known];
        let slopes = |amount: f64| -> Option<Vec<f64>> {
            let mut values = [Vec::new(), Vec::new()];
            for (sign, values) in [-1.0, 1.0].into_iter().zip(&mut values) {
                let mut changed = component.clone();
                *variable.access.real(&mut changed)? += sign * amount;
                changed.update_outputs(0.0);
                for unknown in &unknowns {
                    values.push(*model.variables[*unknown].access.real(&mut changed)?);
                }
            }
            let [low, high] = values;
            Some(
                low.iter()
                    .zip(high)
                    .map(|(l, h)| (h - l) / (2.0 * amount))
                    .collect(),
            )
        };
        let Some(slopes) = slopes(1e-3 * variable.nominal.unwrap_or(1.0)) else {
            continue;
        };
        for (unknown, slope) in unknowns.iter().zip(slopes) {
            if *unknown == known {
                continue;
            }
            let name = &model.variables[*unknown].name;
            let declared = model.dependencies[*unknown]
                .iter()
                .any(|(on, _)| *on == known);
            assert!(
                declared || slope == 0.0,
                "`{name}` depends on `{}`",
                variable.name
            );
            if C::PARTIAL_DERIVATIVES && declared {
                let partial = component.partial_derivative(name, &variable.name);
                let error = (partial - slope).abs();
                assert!(
                    error <= 1e-6 * slope.abs().max(1e-3),
                    "d {name} / d {}: {partial}, by differences {slope}",
                    variable.name
                );
            }
        }
    }
}

/// Initial outputs change only with what the table says.
fn check_initial_dependencies<C: Component>(model: &Model<C>) {
    let start = |change: Option<usize>| -> Option<C> {
        let mut component = C::default();
        // Away from zero, where products could hide a dependency.
        for variable in model
            .variables
            .iter()
            .filter(|v| v.causality == Causality::Input)
        {
            if let Some(value) = variable.access.real(&mut component) {
                *value = 0.01 * variable.nominal.unwrap_or(1.0);
            }
        }
        if let Some(index) = change {
            let value = model.variables[index].access.real(&mut component)?;
            *value = if *value == 0.0 { 1e-3 } else { *value * 1.001 };
        }
        component.initialize().ok()?;
        component.update_outputs(0.0);
        Some(component)
    };
    let mut base = start(None).expect("the defaults can be initialized");
    for (known, variable) in model.variables.iter().enumerate() {
        if variable.is_computed() {
            continue;
        }
        let Some(mut changed) = start(Some(known)) else {
            continue;
        };
        for (unknown, output) in model.variables.iter().enumerate() {
            let (Some(before), true) =
                (output.access.real(&mut base).copied(), output.is_computed())
            else {
                continue;
            };
            let after = output.access.real(&mut changed).copied();
            let declared = model.initial_dependencies[unknown].contains(&known);
            assert!(
                declared || after == Some(before),
                "`{}` depends initially on `{}`",
                output.name,
                variable.name
            );
        }
    }
}

/// A copy made through its serialized form goes on exactly like the original.
fn check_replay<C: Component>(model: &Model<C>, component: &C, numbers: &mut Numbers) {
    let mut original = component.clone();
    let mut restored: C =
        postcard::from_bytes(&bytes(component)).expect("the component can be restored");
    for k in 0..50 {
        set_inputs(model, &mut original, numbers);
        for variable in model
            .variables
            .iter()
            .filter(|v| v.causality == Causality::Input)
        {
            if let Some(value) = variable.access.real(&mut original).copied()
                && let Some(copy) = variable.access.real(&mut restored)
            {
                *copy = value;
            }
        }
        for copy in [&mut original, &mut restored] {
            copy.step(f64::from(k) * C::STEP_SIZE, C::STEP_SIZE)
                .expect("the step succeeds");
            copy.update_outputs(f64::from(k + 1) * C::STEP_SIZE);
        }
        assert_eq!(bytes(&original), bytes(&restored), "replay, step {k}");
    }
}
