//! Variables that are read and set, and derivatives by them.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use super::model::*;
use super::{References, Texts, list, own, places};

/// Calls `one` with each reference and its place; an error where it gives none.
unsafe fn each(
    references: References,
    n: usize,
    mut one: impl FnMut(u32, usize) -> Option<()>,
) -> c_int {
    let all = unsafe { list(references, n) }.iter().enumerate();
    for (at, &reference) in all {
        if one(reference, at).is_none() {
            return ERROR;
        }
    }
    OK
}

/// Scalars that are kept: the references of each type are its own.
macro_rules! kept {
    ($($get:literal, $set:literal, $module:ident, $kind:ty, $first:literal;)*) => {
        $(mod $module {
            use super::*;
            fn one(c: &mut Instance, reference: u32) -> Option<&mut $kind> {
                c.kept.$module.get_mut(reference.checked_sub($first)? as usize)
            }
            shared! {
                $get => get(c, references: References, n: usize, values: *mut $kind, count: usize) {
                    let values = unsafe { places(values, count) };
                    unsafe { each(references, n, |reference, at| {
                        *values.get_mut(at)? = *one(c, reference)?;
                        Some(())
                    }) }
                }
                $set => set(c, references: References, n: usize, values: *const $kind, count: usize) {
                    let values = unsafe { list(values, count) };
                    unsafe { each(references, n, |reference, at| {
                        *one(c, reference)? = *values.get(at)?;
                        Some(())
                    }) }
                }
            }
        })*
    };
}
kept! {
    "fmi3GetFloat32", "fmi3SetFloat32", float32, f32, 10;
    "fmi3GetInt8", "fmi3SetInt8", int8, i8, 20;
    "fmi3GetUInt8", "fmi3SetUInt8", uint8, u8, 30;
    "fmi3GetInt16", "fmi3SetInt16", int16, i16, 40;
    "fmi3GetUInt16", "fmi3SetUInt16", uint16, u16, 50;
    "fmi3GetUInt32", "fmi3SetUInt32", uint32, u32, 60;
    "fmi3GetInt64", "fmi3SetInt64", int64, i64, 80;
    "fmi3GetUInt64", "fmi3SetUInt64", uint64, u64, 90;
}

fn string(c: &mut Instance, reference: u32) -> Option<&mut CString> {
    c.kept.string.get_mut(reference.checked_sub(100)? as usize)
}

fn binary(c: &mut Instance, reference: u32) -> Option<&mut Vec<u8>> {
    c.kept.binary.get_mut(reference.checked_sub(110)? as usize)
}

mod access {
    use super::*;
    shared! {
        "fmi2GetReal" => get_real(c, references: References, n: usize, values: *mut f64) {
            unsafe { c.get_reals(list(references, n), places(values, n)) }
        }
        "fmi2SetReal" => set_real(c, references: References, n: usize, values: *const f64) {
            unsafe { c.set_reals(list(references, n), list(values, n)) }
        }
        "fmi3GetFloat64" => get_float64(c, references: References, n: usize, values: *mut f64, count: usize) {
            unsafe { c.get_reals(list(references, n), places(values, count)) }
        }
        "fmi3SetFloat64" => set_float64(c, references: References, n: usize, values: *const f64, count: usize) {
            unsafe { c.set_reals(list(references, n), list(values, count)) }
        }
        "fmi2GetInteger" => get_integer(c, references: References, n: usize, values: *mut i32) {
            unsafe { get_int32(std::ptr::from_mut(c).cast(), references, n, values, n) }
        }
        "fmi2SetInteger" => set_integer(c, references: References, n: usize, values: *const i32) {
            unsafe { set_int32(std::ptr::from_mut(c).cast(), references, n, values, n) }
        }
        "fmi3GetInt32" => get_int32(c, references: References, n: usize, values: *mut i32, count: usize) {
            let values = unsafe { places(values, count) };
            unsafe { each(references, n, |reference, at| {
                *values.get_mut(at)? = *c.integer(reference)?;
                Some(())
            }) }
        }
        "fmi3SetInt32" => set_int32(c, references: References, n: usize, values: *const i32, count: usize) {
            let values = unsafe { list(values, count) };
            unsafe { each(references, n, |reference, at| {
                *c.integer(reference)? = *values.get(at)?;
                Some(())
            }) }
        }
        "fmi2GetBoolean" => get_truth(c, references: References, n: usize, values: *mut c_int) {
            let values = unsafe { places(values, n) };
            unsafe { each(references, n, |reference, at| {
                values[at] = c_int::from(*c.truth(reference)?);
                Some(())
            }) }
        }
        "fmi2SetBoolean" => set_truth(c, references: References, n: usize, values: *const c_int) {
            let values = unsafe { list(values, n) };
            unsafe { each(references, n, |reference, at| {
                *c.truth(reference)? = values[at] == 1;
                Some(())
            }) }
        }
        "fmi3GetBoolean" => get_boolean(c, references: References, n: usize, values: *mut bool, count: usize) {
            let values = unsafe { places(values, count) };
            unsafe { each(references, n, |reference, at| {
                *values.get_mut(at)? = *c.truth(reference)?;
                Some(())
            }) }
        }
        "fmi3SetBoolean" => set_boolean(c, references: References, n: usize, values: *const bool, count: usize) {
            let values = unsafe { list(values, count) };
            unsafe { each(references, n, |reference, at| {
                *c.truth(reference)? = *values.get(at)?;
                Some(())
            }) }
        }
        "fmi2GetString" => get_text(c, references: References, n: usize, values: *mut *const c_char) {
            unsafe { get_string(std::ptr::from_mut(c).cast(), references, n, values, n) }
        }
        "fmi2SetString" => set_text(c, references: References, n: usize, values: Texts) {
            unsafe { set_string(std::ptr::from_mut(c).cast(), references, n, values, n) }
        }
        "fmi3GetString" => get_string(
            c, references: References, n: usize, values: *mut *const c_char, count: usize
        ) {
            let values = unsafe { places(values, count) };
            unsafe { each(references, n, |reference, at| {
                // An empty text is a null here.
                let own = string(c, reference)?;
                let given = if own.is_empty() { std::ptr::null() } else { own.as_ptr() };
                *values.get_mut(at)? = given;
                Some(())
            }) }
        }
        "fmi3SetString" => set_string(c, references: References, n: usize, values: Texts, count: usize) {
            let values = unsafe { list(values, count) };
            unsafe { each(references, n, |reference, at| {
                *string(c, reference)? = CStr::from_ptr(*values.get(at)?).to_owned();
                Some(())
            }) }
        }
        "fmi3GetBinary" => get_binary(
            c, references: References, n: usize, sizes: *mut usize, values: *mut *const u8, count: usize
        ) {
            let (sizes, values) = unsafe { (places(sizes, count), places(values, count)) };
            unsafe { each(references, n, |reference, at| {
                let own = binary(c, reference)?;
                let given = if own.is_empty() { std::ptr::null() } else { own.as_ptr() };
                (*sizes.get_mut(at)?, *values.get_mut(at)?) = (own.len(), given);
                Some(())
            }) }
        }
        "fmi3SetBinary" => set_binary(
            c, references: References, n: usize, sizes: *const usize, values: *const *const u8, count: usize
        ) {
            let (sizes, values) = unsafe { (list(sizes, count), list(values, count)) };
            unsafe { each(references, n, |reference, at| {
                *binary(c, reference)? = list(*values.get(at)?, *sizes.get(at)?).to_vec();
                Some(())
            }) }
        }
    }
}

mod derivatives_by_variables {
    use super::*;
    shared! {
        "fmi2GetDirectionalDerivative" => two(
            c, unknowns: References, n: usize, knowns: References, m: usize, seed: *const f64, into: *mut f64
        ) {
            unsafe { three(std::ptr::from_mut(c).cast(), unknowns, n, knowns, m, seed, m, into, n) }
        }
        "fmi3GetDirectionalDerivative" => three(
            c, unknowns: References, n: usize, knowns: References, m: usize, seed: *const f64, seeds: usize,
            into: *mut f64, count: usize
        ) {
            let (unknowns, knowns, seed) = unsafe { (list(unknowns, n), list(knowns, m), list(seed, seeds)) };
            match c.answer {
                DISCARD | NO_DERIVATIVE => return DISCARD,
                WRONG_DERIVATIVE => return ERROR,
                _ => {}
            }
            for (place, &unknown) in unsafe { places(into, count) }.iter_mut().zip(unknowns) {
                let terms = knowns.iter().zip(seed);
                *place = terms.map(|(&known, change)| c.partial(unknown, known) * change).sum();
            }
            OK
        }
        "fmi3GetAdjointDerivative" => adjoint(
            c, unknowns: References, n: usize, knowns: References, m: usize, seed: *const f64, seeds: usize,
            into: *mut f64, count: usize
        ) {
            let (unknowns, knowns, seed) = unsafe { (list(unknowns, n), list(knowns, m), list(seed, seeds)) };
            for (place, &known) in unsafe { places(into, count) }.iter_mut().zip(knowns) {
                let terms = unknowns.iter().zip(seed);
                *place = terms.map(|(&unknown, weight)| c.partial(unknown, known) * weight).sum();
            }
            OK
        }
    }
}
