//! Reading and setting variables of the types that the table of a component has not, and arrays.

use super::{Extended, Place};
use crate::{
    component::Component,
    fault::{Fault, Outcome, Status},
    fmi2::Handle,
    guard::entry,
    instance::Instance,
    model::ValueReference,
    phase::Phase,
    pointers::{slice, slice_mut},
    variable::{Causality, Variability},
};

fn unknown<C: Component>(reference: ValueReference, kind: &str) -> Box<Fault> {
    let name = C::NAME;
    Fault::error(format!(
        "value reference {reference} of {name} is not a {kind}"
    ))
}

/// Whether a variable may be set now; discrete ones in events only, once the importer handles these.
fn check<C: Extended>(instance: &mut Instance<C>, reference: ValueReference) -> Outcome {
    let (phase, importer) = (instance.now.phase, instance.importer);
    let Some((place, causality, variability)) = instance.now.component.place(reference) else {
        return Err(unknown::<C>(reference, "variable"));
    };
    let may_be_set = match place {
        Place::Size(_) => phase == Phase::Configuration,
        Place::Clock(_) => causality == Causality::Input && phase == Phase::Event,
        _ => {
            let waits =
                variability == Variability::Discrete && importer.event_mode && phase == Phase::Step;
            phase.accepts(causality, variability) && !waits
        }
    };
    match may_be_set {
        true => Ok(()),
        false => Err(Fault::error(format!(
            "value reference {reference} ({variability:?} {causality:?}) cannot be set {}",
            phase.name()
        ))),
    }
}

/// Brings computed variables up to date before one is read.
fn fresh<C: Extended>(instance: &mut Instance<C>, reference: ValueReference) -> Outcome<Place<'_>> {
    instance.refresh()?;
    let place = instance.now.component.place(reference);
    place.map_or_else(
        || Err(unknown::<C>(reference, "variable")),
        |(place, ..)| Ok(place),
    )
}

pub unsafe fn get_float64<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetFloat64", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let values = slice_mut(values, value_count, "values")?;
            let mut at = 0;
            for &reference in references {
                let own = match reference {
                    0 => vec![instance.now.time],
                    _ if reference as usize <= instance.model.variables.len() => {
                        vec![instance.get_real(reference)?]
                    }
                    _ => match fresh(instance, reference)? {
                        Place::Reals(own) => own.clone(),
                        _ => return Err(unknown::<C>(reference, "Float64")),
                    },
                };
                let room = values.get_mut(at..at + own.len());
                let room = room.ok_or_else(|| Fault::error("fewer values than the arrays have"))?;
                room.copy_from_slice(&own);
                at += own.len();
            }
            match at == value_count {
                true => Ok(()),
                false => Err(Fault::error("more values than the arrays have")),
            }
        })
    }
}

pub unsafe fn set_float64<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3SetFloat64", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let values = slice(values, value_count, "values")?;
            let mut at = 0;
            for &reference in references {
                if reference as usize <= instance.model.variables.len() {
                    let value = values
                        .get(at)
                        .ok_or_else(|| Fault::error("too few values"))?;
                    instance.check_real(reference, *value)?;
                    instance.set_real(reference, *value)?;
                    at += 1;
                    continue;
                }
                check(instance, reference)?;
                let Some((Place::Reals(own), ..)) = instance.now.component.place(reference) else {
                    return Err(unknown::<C>(reference, "Float64"));
                };
                let given = values.get(at..at + own.len());
                let given =
                    given.ok_or_else(|| Fault::error("fewer values than the arrays have"))?;
                own.copy_from_slice(given);
                at += given.len();
                instance.now.stale = true;
            }
            match at == value_count {
                true => Ok(()),
                false => Err(Fault::error("more values than the arrays have")),
            }
        })
    }
}

pub unsafe fn get_uint64<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *mut u64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetUInt64", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let values = slice_mut(values, count, "values")?;
            for (&reference, value) in references.iter().zip(values) {
                match instance.now.component.place(reference) {
                    Some((Place::Size(own), ..)) => *value = *own,
                    _ => return Err(unknown::<C>(reference, "UInt64")),
                }
            }
            Ok(())
        })
    }
}

pub unsafe fn set_uint64<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *const u64,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3SetUInt64", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let values = slice(values, count, "values")?;
            for (&reference, value) in references.iter().zip(values) {
                check(instance, reference)?;
                match instance.now.component.place(reference) {
                    Some((Place::Size(own), ..)) => *own = *value,
                    _ => return Err(unknown::<C>(reference, "UInt64")),
                }
            }
            Ok(())
        })
    }
}

pub unsafe fn get_binary<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    sizes: *mut usize,
    values: *mut *const u8,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetBinary", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let sizes = slice_mut(sizes, count, "valueSizes")?;
            let values = slice_mut(values, count, "values")?;
            for (at, &reference) in references.iter().enumerate() {
                match fresh(instance, reference)? {
                    Place::Binary(own) => (sizes[at], values[at]) = (own.len(), own.as_ptr()),
                    _ => return Err(unknown::<C>(reference, "Binary")),
                }
            }
            Ok(())
        })
    }
}

pub unsafe fn set_binary<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    sizes: *const usize,
    values: *const *const u8,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3SetBinary", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let sizes = slice(sizes, count, "valueSizes")?;
            let values = slice(values, count, "values")?;
            for (at, &reference) in references.iter().enumerate() {
                check(instance, reference)?;
                let given = slice(values[at], sizes[at], "value")?;
                match instance.now.component.place(reference) {
                    Some((Place::Binary(own), ..)) => *own = given.to_vec(),
                    _ => return Err(unknown::<C>(reference, "Binary")),
                }
                instance.now.stale = true;
            }
            Ok(())
        })
    }
}

pub unsafe fn get_clock<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *mut bool,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetClock", |instance| {
            instance.require(&[Phase::Event])?;
            let references = slice(references, count, "valueReferences")?;
            let values = slice_mut(values, count, "values")?;
            for (&reference, value) in references.iter().zip(values) {
                match instance.now.component.place(reference) {
                    Some((Place::Clock(own), Causality::Output, _)) => *value = *own,
                    _ => return Err(unknown::<C>(reference, "output clock")),
                }
            }
            Ok(())
        })
    }
}

pub unsafe fn set_clock<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    values: *const bool,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3SetClock", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let values = slice(values, count, "values")?;
            for (&reference, value) in references.iter().zip(values) {
                check(instance, reference)?;
                match instance.now.component.place(reference) {
                    Some((Place::Clock(own), ..)) => *own = *value,
                    _ => return Err(unknown::<C>(reference, "input clock")),
                }
            }
            Ok(())
        })
    }
}

pub unsafe fn get_interval<C: Extended>(
    handle: Handle,
    references: *const ValueReference,
    count: usize,
    intervals: *mut f64,
    qualifiers: *mut i32,
) -> Status {
    unsafe {
        entry::<C>(handle, "fmi3GetIntervalDecimal", |instance| {
            let references = slice(references, count, "valueReferences")?;
            let intervals = slice_mut(intervals, count, "intervals")?;
            let qualifiers = slice_mut(qualifiers, count, "qualifiers")?;
            for (at, &reference) in references.iter().enumerate() {
                let interval = instance.now.component.interval(reference);
                (intervals[at], qualifiers[at]) =
                    interval.ok_or_else(|| unknown::<C>(reference, "clock with an interval"))?;
            }
            Ok(())
        })
    }
}
