//! Functions that both C interfaces share: saved states and model exchange.
//!
//! # Safety
//! All functions: pointers are as the standard prescribes; lengths belong to their arrays.
#![allow(
    unsafe_code,
    missing_docs,
    reason = "the signatures and their meaning are the standard's"
)]
#![allow(clippy::missing_safety_doc)]

/// Saved states.
pub mod states {
    use crate::{
        component::Component,
        fault::{Fault, Status},
        fmi2::Handle,
        guard::entry,
        pointers::{slice, slice_mut, target},
    };

    pub unsafe fn get<C: Component>(c: Handle, name: &'static str, slot: *mut Handle) -> Status {
        unsafe {
            entry::<C>(c, name, |instance| {
                instance.get_state(target(slot, "state")?)
            })
        }
    }

    pub unsafe fn set<C: Component>(c: Handle, name: &'static str, state: Handle) -> Status {
        unsafe { entry::<C>(c, name, |instance| instance.set_state(state)) }
    }

    pub unsafe fn free<C: Component>(c: Handle, name: &'static str, slot: *mut Handle) -> Status {
        if slot.is_null() {
            return Status::Ok;
        }
        unsafe {
            entry::<C>(c, name, |instance| {
                instance.free_state(target(slot, "state")?)
            })
        }
    }

    pub unsafe fn size<C: Component>(
        c: Handle,
        name: &'static str,
        state: Handle,
        size: *mut usize,
    ) -> Status {
        unsafe {
            entry::<C>(c, name, |instance| {
                *target(size, "size")? = instance.serialize_state(state)?.len();
                Ok(())
            })
        }
    }

    pub unsafe fn serialize<C: Component>(
        c: Handle,
        name: &'static str,
        state: Handle,
        bytes: *mut u8,
        size: usize,
    ) -> Status {
        unsafe {
            entry::<C>(c, name, |instance| {
                let state = instance.serialize_state(state)?;
                if size != state.len() {
                    let problem = format!("{size} bytes given for a state of {}", state.len());
                    return Err(Fault::error(problem));
                }
                slice_mut(bytes, size, "serializedState")?.copy_from_slice(&state);
                Ok(())
            })
        }
    }

    pub unsafe fn deserialize<C: Component>(
        c: Handle,
        name: &'static str,
        bytes: *const u8,
        size: usize,
        slot: *mut Handle,
    ) -> Status {
        unsafe {
            entry::<C>(c, name, |instance| {
                let bytes = slice(bytes, size, "serializedState")?;
                instance.deserialize_state(bytes, target(slot, "state")?)
            })
        }
    }
}

/// Model exchange.
pub mod exchanges {
    use crate::{
        component::Component,
        fault::Status,
        fmi2::Handle,
        guard::entry,
        pointers::{slice, slice_mut},
    };

    pub unsafe fn set_time<C: Component>(c: Handle, name: &'static str, time: f64) -> Status {
        unsafe { entry::<C>(c, name, |instance| instance.set_time(time)) }
    }

    pub unsafe fn set_states<C: Component>(
        c: Handle,
        name: &'static str,
        x: *const f64,
        n: usize,
    ) -> Status {
        unsafe {
            entry::<C>(c, name, |instance| {
                instance.set_states(slice(x, n, "states")?)
            })
        }
    }

    macro_rules! filled {
        ($($function:ident $method:ident;)*) => {$(
            pub unsafe fn $function<C: Component>(
                c: Handle,
                name: &'static str,
                x: *mut f64,
                n: usize,
            ) -> Status {
                unsafe {
                    entry::<C>(c, name, |instance| instance.$method(slice_mut(x, n, "values")?))
                }
            }
        )*};
    }

    filled! {
        states get_states;
        derivatives get_derivatives;
        nominals get_nominals;
        indicators get_event_indicators;
    }
}
