//! Saved states: copies of an instance, and their serialized form.
#![allow(unsafe_code, reason = "a state is handed out as a pointer")]

use std::{
    any::TypeId,
    collections::HashMap,
    ffi::c_void,
    sync::{Mutex, MutexGuard, PoisonError},
};

use crate::{
    checksum::{SEED, checksum},
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
        if !C::SAVES_STATE {
            return Err(Fault::error(format!(
                "{} cannot save its state, part of which is in another program",
                C::NAME
            )));
        }
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
    bytes.extend(checksum(SEED, &body).to_le_bytes());
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
    if checksum(SEED, body) != u64::from_le_bytes(*sum) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        oscillator::{FORCE, Oscillator, POSITION, VELOCITY, instance, refusal, running},
        phase::Kind,
    };

    fn advance(instance: &mut Instance<Oscillator>, steps: usize) -> Vec<u64> {
        let mut seen = Vec::new();
        for k in 0..steps {
            instance.set_real(FORCE, (k as f64 * 0.7).sin()).unwrap();
            instance.do_step(instance.now.time, 0.002).unwrap();
            for reference in [POSITION, VELOCITY] {
                seen.push(instance.get_real(reference).unwrap().to_bits());
            }
        }
        seen
    }

    #[test]
    fn restored_state_goes_on_to_the_bit_even_in_another_instance() {
        let mut first = running(Kind::CoSimulation);
        advance(&mut first, 50);
        let mut state = std::ptr::null_mut();
        first.get_state(&mut state).unwrap();
        let bytes = first.serialize_state(state).unwrap();
        let expected = advance(&mut first, 50);

        let mut second = instance(Kind::CoSimulation);
        let mut restored = std::ptr::null_mut();
        second.deserialize_state(&bytes, &mut restored).unwrap();
        second.set_state(restored).unwrap();
        assert_eq!(
            second.now.time.to_bits(),
            (0..50).fold(0.0f64, |t, _| t + 0.002).to_bits()
        );
        assert_eq!(advance(&mut second, 50), expected);

        // A state that is given is overwritten, not leaked.
        let before = restored;
        second.get_state(&mut restored).unwrap();
        assert_eq!(before, restored);
        second.free_state(&mut restored).unwrap();
        assert!(restored.is_null());
        second.free_state(&mut restored).unwrap();
        first.free_state(&mut state).unwrap();
    }

    #[test]
    fn foreign_and_freed_states_are_refused() {
        let mut instance = running(Kind::CoSimulation);
        let mut number = 7u64;
        let foreign = (&raw mut number).cast::<c_void>();
        assert!(refusal(instance.set_state(foreign)).contains("not a saved state"));
        let mut state = std::ptr::null_mut();
        instance.get_state(&mut state).unwrap();
        let mut again = state;
        instance.free_state(&mut state).unwrap();
        assert!(refusal(instance.free_state(&mut again)).contains("already freed"));
    }

    #[test]
    fn state_of_the_other_kind_is_refused() {
        let exchange = running(Kind::ModelExchange);
        let mut state = std::ptr::null_mut();
        exchange.get_state(&mut state).unwrap();
        let mut cosim = running(Kind::CoSimulation);
        assert!(refusal(cosim.set_state(state)).contains("a state of ModelExchange"));
        exchange.free_state(&mut state).unwrap();
    }

    #[test]
    fn any_changed_byte_is_found() {
        let instance = running(Kind::CoSimulation);
        let bytes = serialize(&instance.now).unwrap();
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(deserialize::<Oscillator>(&damaged).is_err(), "byte {at}");
            assert!(
                deserialize::<Oscillator>(&bytes[..at]).is_err(),
                "cut at {at}"
            );
        }
        assert!(deserialize::<Oscillator>(&bytes).is_ok());
    }

    #[test]
    fn state_of_another_component_is_named() {
        let body = postcard::to_allocvec(&("Pump", "9.9.9", 0u8)).unwrap();
        let mut bytes = MAGIC.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(&body);
        bytes.extend(checksum(SEED, &body).to_le_bytes());
        let problem = deserialize::<Oscillator>(&bytes).err().unwrap().message;
        let own = Oscillator::VERSION;
        assert_eq!(
            problem,
            format!("serialized state: of Pump 9.9.9, expected Oscillator {own}")
        );
    }
}
