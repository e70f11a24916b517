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

/// Functions that go through their references one by one: the name in the standard, the arrays with as many
/// values, and what is done at each place.
macro_rules! one_by_one {
    ($(fn $name:ident($function:literal, $($array:ident: $pointer:ty = $open:ident $label:literal),+)
       |$instance:ident, $reference:ident, $at:ident| $one:block)+) => {$(
        pub unsafe fn $name<C: Extended>(
            handle: Handle,
            references: *const ValueReference,
            count: usize,
            $($array: $pointer),+
        ) -> Status {
            unsafe {
                entry::<C>(handle, $function, |$instance| {
                    let references = slice(references, count, "valueReferences")?;
                    $(let $array = $open($array, count, $label)?;)+
                    for ($at, &$reference) in references.iter().enumerate() $one
                    Ok(())
                })
            }
        }
    )+};
}

one_by_one! {
    fn get_uint64("fmi3GetUInt64", values: *mut u64 = slice_mut "values") |instance, reference, at| {
        match instance.now.component.place(reference) {
            Some((Place::Size(own), ..)) => values[at] = *own,
            _ => return Err(unknown::<C>(reference, "UInt64")),
        }
    }

    fn set_uint64("fmi3SetUInt64", values: *const u64 = slice "values") |instance, reference, at| {
        check(instance, reference)?;
        match instance.now.component.place(reference) {
            Some((Place::Size(own), ..)) => *own = values[at],
            _ => return Err(unknown::<C>(reference, "UInt64")),
        }
    }

    fn get_binary("fmi3GetBinary", sizes: *mut usize = slice_mut "valueSizes", values: *mut *const u8 = slice_mut "values") |instance, reference, at| {
        match fresh(instance, reference)? {
            Place::Binary(own) => (sizes[at], values[at]) = (own.len(), own.as_ptr()),
            _ => return Err(unknown::<C>(reference, "Binary")),
        }
    }

    fn set_binary("fmi3SetBinary", sizes: *const usize = slice "valueSizes", values: *const *const u8 = slice "values") |instance, reference, at| {
        check(instance, reference)?;
        let given = slice(values[at], sizes[at], "value")?;
        match instance.now.component.place(reference) {
            Some((Place::Binary(own), ..)) => *own = given.to_vec(),
            _ => return Err(unknown::<C>(reference, "Binary")),
        }
        instance.now.stale = true;
    }

    fn get_clock("fmi3GetClock", values: *mut bool = slice_mut "values") |instance, reference, at| {
        instance.require(&[Phase::Event])?;
        match instance.now.component.place(reference) {
            Some((Place::Clock(own), Causality::Output, _)) => values[at] = *own,
            _ => return Err(unknown::<C>(reference, "output clock")),
        }
    }

    fn set_clock("fmi3SetClock", values: *const bool = slice "values") |instance, reference, at| {
        check(instance, reference)?;
        match instance.now.component.place(reference) {
            Some((Place::Clock(own), ..)) => *own = values[at],
            _ => return Err(unknown::<C>(reference, "input clock")),
        }
    }

    fn get_interval("fmi3GetIntervalDecimal", intervals: *mut f64 = slice_mut "intervals", qualifiers: *mut i32 = slice_mut "qualifiers") |instance, reference, at| {
        let interval = instance.now.component.interval(reference);
        (intervals[at], qualifiers[at]) =
            interval.ok_or_else(|| unknown::<C>(reference, "clock with an interval"))?;
    }
}
