//! The wall between the C interface and a component: no panic gets through.
#![allow(unsafe_code, reason = "the instance is behind a C pointer")]

use std::{
    any::Any,
    ffi::c_void,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Mutex, Once, PoisonError},
    thread::{self, ThreadId},
};

use crate::{
    component::Component,
    fault::{Fault, Outcome, Status},
    instance::Instance,
};

/// Runs the body of an FMI function on the instance behind `handle`.
///
/// A panic is caught and logged; the instance then answers errors until it is freed.
///
/// # Safety
/// `handle` is NULL or an instance of `C` made by this library, not freed, and used by no other
/// thread during the call.
#[inline]
pub(crate) unsafe fn entry<C: Component>(
    handle: *mut c_void,
    function: &'static str,
    body: impl FnOnce(&mut Instance<C>) -> Outcome,
) -> Status {
    // SAFETY: the caller's promise.
    let Some(instance) = (unsafe { handle.cast::<Instance<C>>().as_mut() }) else {
        return Status::Error;
    };
    if instance.poisoned {
        let fault = Fault::error("the instance panicked earlier and can only be freed");
        return report(instance, function, &fault);
    }
    match catch_unwind(AssertUnwindSafe(|| body(&mut *instance))) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(fault)) => report(instance, function, &fault),
        Err(payload) => {
            instance.poisoned = true;
            let fault = Fault::error(describe(payload));
            report(instance, function, &fault)
        }
    }
}

#[cold]
fn report<C: Component>(instance: &Instance<C>, function: &str, fault: &Fault) -> Status {
    instance
        .log
        .fault(fault.status, &format!("{} {function}: {fault}", C::NAME));
    fault.status
}

/// A panic that was caught: its message, with the place if it is known.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Panic(String);

/// Runs something that has no instance yet or no longer.
pub(crate) fn catch<T>(body: impl FnOnce() -> T) -> Result<T, Panic> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| Panic(describe(payload)))
}

static PANICS: Mutex<Vec<(ThreadId, String)>> = Mutex::new(Vec::new());

/// Keeps the place of a panic for the log instead of printing it. A library has its own hook, so
/// that the host's is not touched.
pub fn collect_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        std::panic::set_hook(Box::new(|info| {
            let place = info
                .location()
                .map(|l| format!(" at {}:{}", l.file(), l.line()));
            let mut panics = PANICS.lock().unwrap_or_else(PoisonError::into_inner);
            panics.push((thread::current().id(), place.unwrap_or_default()));
        }));
    });
}

#[cold]
fn describe(payload: Box<dyn Any + Send>) -> String {
    let text = payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_string())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_default();
    // Dropping a payload of unknown type could panic again.
    std::mem::forget(payload);
    let mut panics = PANICS.lock().unwrap_or_else(PoisonError::into_inner);
    let own = panics
        .iter()
        .rposition(|(id, _)| *id == thread::current().id());
    let place = own.map(|at| panics.swap_remove(at).1).unwrap_or_default();
    format!("panic{place}: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        oscillator::{FORCE, Oscillator, running},
        phase::Kind,
    };

    #[test]
    fn panic_is_caught_and_poisons_only_its_instance() {
        let mut hit = running(Kind::CoSimulation);
        let mut beside = running(Kind::CoSimulation);
        let handle = (&raw mut hit).cast::<c_void>();
        let other = (&raw mut beside).cast::<c_void>();
        hit.set_real(FORCE, 666.0).unwrap();
        let step = |handle| {
            // SAFETY: both instances live to the end of the test.
            unsafe { entry::<Oscillator>(handle, "step", |i| i.do_step(i.now.time, 0.002)) }
        };
        assert_eq!(step(handle), Status::Error);
        assert!(hit.poisoned);
        assert_eq!(step(handle), Status::Error);
        assert_eq!(step(other), Status::Ok);
        assert_eq!(step(std::ptr::null_mut()), Status::Error);
    }

    #[test]
    fn message_of_a_panic_is_kept() {
        assert!(
            catch(|| panic!("number {}", 7))
                .unwrap_err()
                .0
                .ends_with("number 7")
        );
        assert!(catch(|| panic!("plain")).unwrap_err().0.ends_with("plain"));
        assert_eq!(catch(|| 5), Ok(5));
    }

    #[test]
    fn the_place_of_a_panic_is_that_of_its_own_thread() {
        let other = thread::spawn(|| thread::current().id()).join().unwrap();
        let own = thread::current().id();
        let places = [(own, " at here:1"), (other, " at elsewhere:2")];
        let places = places.map(|(id, place)| (id, place.to_string()));
        PANICS.lock().unwrap().extend(places);
        assert_eq!(describe(Box::new("why")), "panic at here:1: why");
        // It was told; that of the other thread is not ours.
        assert_eq!(describe(Box::new("again")), "panic: again");
    }
}
