//! Saved states: copies of an instance, and their serialized form.
#![allow(unsafe_code, reason = "a state is handed out as a pointer")]

use std::{
    any::TypeId,
    collections::HashMap,
    ffi::c_void,
    sync::{Mutex, MutexGuard, PoisonError},
};

use crate::{
    component::Component,
    fault::{Fault, Outcome},
    instance::{Instance, Snapshot},
};

/// First bytes of a serialized state.
const MAGIC: &[u8; 8] = b"FMUSTATE";
/// Version of the layout behind the first bytes.
const FORMAT: u32 = 1;

/// The states handed out and not yet freed, so that a foreign or freed pointer is refused instead
/// of followed.
static STATES: Mutex<Option<HashMap<usize, TypeId>>> = Mutex::new(None);

fn states() -> MutexGuard<'static, Option<HashMap<usize, TypeId>>> {
    STATES.lock().unwrap_or_else(PoisonError::into_inner)
}

fn hand_out<C: Component>(snapshot: Snapshot<C>) -> *mut c_void {
    let state = Box::into_raw(Box::new(snapshot)).cast::<c_void>();
    states()
        .get_or_insert_default()
        .insert(state as usize, TypeId::of::<C>());
    state
}

/// The snapshot behind a pointer handed out before.
fn look_up<'a, C: Component>(state: *mut c_void) -> Outcome<&'a mut Snapshot<C>> {
    let known = states()
        .as_ref()
        .and_then(|s| s.get(&(state as usize)).copied());
    if known == Some(TypeId::of::<C>()) {
        // SAFETY: the pointer came from `hand_out::<C>` and was not freed since; the importer
        // uses a state from one thread at a time.
        return Ok(unsafe { &mut *state.cast::<Snapshot<C>>() });
    }
    Err(Fault::error(format!(
        "not a saved state of {}, or already freed",
        C::NAME
    )))
}

impl<C: Component> Instance<C> {
    /// Saves the state into `*slot`: into the state that it holds, or a new one if it is NULL.
    pub(crate) fn get_state(&self, slot: &mut *mut c_void) -> Outcome {
        if slot.is_null() {
            *slot = hand_out(self.now.clone());
        } else {
            look_up::<C>(*slot)?.clone_from(&self.now);
        }
        Ok(())
    }

    pub(crate) fn set_state(&mut self, state: *mut c_void) -> Outcome {
        let snapshot = look_up::<C>(state)?;
        if snapshot.kind != self.now.kind {
            return Err(Fault::error(format!(
                "a state of {:?}, but the instance is for {:?}",
                snapshot.kind, self.now.kind
            )));
        }
        self.now.clone_from(snapshot);
        Ok(())
    }

    pub(crate) fn free_state(&self, slot: &mut *mut c_void) -> Outcome {
        if slot.is_null() {
            return Ok(());
        }
        look_up::<C>(*slot)?;
        states().get_or_insert_default().remove(&(*slot as usize));
        // SAFETY: checked above to come from `hand_out::<C>`, and freed only here.
        drop(unsafe { Box::from_raw((*slot).cast::<Snapshot<C>>()) });
        *slot = std::ptr::null_mut();
        Ok(())
    }

    pub(crate) fn serialize_state(&self, state: *mut c_void) -> Outcome<Vec<u8>> {
        let snapshot = look_up::<C>(state)?;
        serialize(snapshot)
    }

    pub(crate) fn deserialize_state(&self, bytes: &[u8], slot: &mut *mut c_void) -> Outcome {
        let snapshot = deserialize::<C>(bytes)?;
        if slot.is_null() {
            *slot = hand_out(snapshot);
        } else {
            *look_up::<C>(*slot)? = snapshot;
        }
        Ok(())
    }
}

/// Layout: magic, format, length of the rest less checksum, name and version, snapshot, checksum.
fn serialize<C: Component>(snapshot: &Snapshot<C>) -> Outcome<Vec<u8>> {
    let fail = |e: postcard::Error| Fault::error(format!("cannot serialize the state: {e}"));
    let body = postcard::to_allocvec(&(C::NAME, C::VERSION, snapshot)).map_err(fail)?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(&body);
    bytes.extend(checksum(&body).to_le_bytes());
    Ok(bytes)
}

fn deserialize<C: Component>(bytes: &[u8]) -> Outcome<Snapshot<C>> {
    let fail = |problem: String| Fault::error(format!("serialized state: {problem}"));
    let Some((magic, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(fail(format!("{} bytes are too few", bytes.len())));
    };
    if magic != MAGIC {
        return Err(fail("does not begin like one".into()));
    }
    let Some((format, rest)) = rest.split_first_chunk::<4>() else {
        return Err(fail("cut off".into()));
    };
    let format = u32::from_le_bytes(*format);
    if format != FORMAT {
        return Err(fail(format!("layout {format}, expected {FORMAT}")));
    }
    let Some((length, rest)) = rest.split_first_chunk::<8>() else {
        return Err(fail("cut off".into()));
    };
    let Some((body, sum)) = rest.split_last_chunk::<8>() else {
        return Err(fail("cut off".into()));
    };
    if body.len() as u64 != u64::from_le_bytes(*length) {
        return Err(fail(format!(
            "{} bytes are not its whole length",
            bytes.len()
        )));
    }
    if checksum(body) != u64::from_le_bytes(*sum) {
        return Err(fail("damaged, the checksum differs".into()));
    }
    let unreadable = |e: postcard::Error| fail(format!("cannot be read: {e}"));
    let ((name, version), body) =
        postcard::take_from_bytes::<(String, String)>(body).map_err(unreadable)?;
    if name != C::NAME || version != C::VERSION {
        let (own, its) = (C::NAME, C::VERSION);
        return Err(fail(format!("of {name} {version}, expected {own} {its}")));
    }
    postcard::from_bytes(body).map_err(unreadable)
}

/// FNV-1a.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
