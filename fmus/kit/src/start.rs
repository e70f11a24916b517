//! Making an instance: name, token, kind and start values.

#![allow(unsafe_code, reason = "the arguments are C strings")]

use std::{
    ffi::{CStr, c_char, c_void},
    ptr,
};

use crate::{
    component::Component,
    description,
    fault::Status,
    guard::catch,
    instance::Instance,
    log::{Log, Sink},
    model::Model,
    phase::Kind,
    resources::{self, Location},
};

/// An instance on the heap, or NULL with the reason in the log.
///
/// # Safety
/// The strings are NULL or valid C strings.
pub(crate) unsafe fn make<C: Component>(
    function: &str,
    name: *const c_char,
    kind: Kind,
    token: *const c_char,
    location: Location<'_>,
    sink: Sink,
    debug: bool,
) -> *mut c_void {
    // SAFETY: the caller's promise.
    let (name, token) = unsafe { (text(name), text(token)) };
    let made = catch(|| {
        let log = Log::new(sink, name.unwrap_or_default(), debug);
        prepare::<C>(name, kind, token, location, log)
    });
    match made {
        Ok(Ok(instance)) => Box::into_raw(Box::new(instance)).cast(),
        Ok(Err(problem)) | Err(problem) => {
            let log = Log::new(sink, name.unwrap_or_default(), debug);
            log.fault(Status::Error, &format!("{} {function}: {problem}", C::NAME));
            ptr::null_mut()
        }
    }
}

fn prepare<C: Component>(
    name: Option<&CStr>,
    kind: Kind,
    token: Option<&CStr>,
    location: Location<'_>,
    log: Log,
) -> Result<Instance<C>, String> {
    let model = Model::<C>::get().map_err(|e| e.to_string())?;
    if name.is_none_or(CStr::is_empty) {
        return Err("an instance needs a name".into());
    }
    let start_values = resources::start_values(location)?;
    let expected = match &start_values {
        Some((_, text)) => resources::variant_token(description::token(model), text),
        None => description::token(model).to_string(),
    };
    let token = token.map(CStr::to_string_lossy).unwrap_or_default();
    if token != expected {
        return Err(format!(
            "token `{token}`, but the library with its resources has {expected}"
        ));
    }
    if kind == Kind::ModelExchange && !model.offers_model_exchange() {
        return Err("offers co-simulation only, no model exchange".into());
    }
    let mut start = C::default();
    if let Some(folder) = location.folder() {
        start.load(&folder).map_err(|problem| problem.to_string())?;
    }
    if let Some((file, text)) = start_values {
        resources::apply(model, &mut start, &text, &file)?;
    }
    Ok(Instance::new(model, start, kind, log))
}

/// A C string, unless it is NULL.
///
/// # Safety
/// The pointer is NULL or a valid C string that outlives the result.
pub(crate) unsafe fn text<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: the caller's promise.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}
