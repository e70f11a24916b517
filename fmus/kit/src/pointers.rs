//! From the pointers of C to slices and references, with NULL refused.
//!
//! # Safety
//! All functions: a pointer that is not NULL points to as many valid values as its count says and
//! stays valid while the result is used.
#![allow(unsafe_code, reason = "this is where C pointers become slices")]
#![allow(clippy::missing_safety_doc)]

use std::ffi::{CStr, c_char};

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    instance::Instance,
    model::ValueReference,
};

#[cold]
fn null(name: &str) -> Box<Fault> {
    Fault::error(format!("argument `{name}` is NULL"))
}

#[inline]
pub(crate) unsafe fn slice<'a, T>(pointer: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

#[inline]
pub(crate) unsafe fn slice_mut<'a, T>(
    pointer: *mut T,
    count: usize,
    name: &str,
) -> Outcome<&'a mut [T]> {
    if count == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

#[inline]
pub(crate) unsafe fn target<'a, T>(pointer: *mut T, name: &str) -> Outcome<&'a mut T> {
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// A C string that is not NULL.
pub(crate) unsafe fn loaded<'a>(pointer: *const c_char) -> Outcome<&'a CStr> {
    if pointer.is_null() {
        return Err(null("string"));
    }
    // SAFETY: the caller's promise.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

pub(crate) unsafe fn texts<'a>(
    pointers: *const *const c_char,
    count: usize,
    name: &str,
) -> Outcome<Vec<&'a CStr>> {
    // SAFETY: the caller's promise.
    unsafe {
        slice(pointers, count, name)?
            .iter()
            .map(|pointer| loaded(*pointer))
            .collect()
    }
}

#[cold]
fn lengths(references: usize, values: usize) -> Box<Fault> {
    Fault::error(format!(
        "{references} value references, but {values} values"
    ))
}

/// Reads variables one after the other.
#[inline]
pub(crate) unsafe fn load<C: Component, T>(
    instance: &mut Instance<C>,
    references: *const ValueReference,
    count: usize,
    values: *mut T,
    value_count: usize,
    read: impl Fn(&mut Instance<C>, ValueReference) -> Outcome<T>,
) -> Outcome {
    if count != value_count {
        return Err(lengths(count, value_count));
    }
    // SAFETY: the caller's promise.
    let (references, values) = unsafe {
        (
            slice(references, count, "valueReferences")?,
            slice_mut(values, count, "values")?,
        )
    };
    for (reference, value) in references.iter().zip(values) {
        *value = read(instance, *reference)?;
    }
    Ok(())
}

/// Writes variables: all of them, or none if one is refused.
#[inline]
pub(crate) unsafe fn store<C: Component, T>(
    instance: &mut Instance<C>,
    references: *const ValueReference,
    count: usize,
    values: *const T,
    value_count: usize,
    check: impl Fn(&Instance<C>, ValueReference, &T) -> Outcome,
    write: impl Fn(&mut Instance<C>, ValueReference, &T) -> Outcome,
) -> Outcome {
    if count != value_count {
        return Err(lengths(count, value_count));
    }
    // SAFETY: the caller's promise.
    let (references, values) = unsafe {
        (
            slice(references, count, "valueReferences")?,
            slice(values, count, "values")?,
        )
    };
    for (reference, value) in references.iter().zip(values) {
        check(instance, *reference, value)?;
    }
    for (reference, value) in references.iter().zip(values) {
        write(instance, *reference, value)?;
    }
    Ok(())
}
