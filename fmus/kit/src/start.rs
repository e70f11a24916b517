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
    guard::{Panic, catch},
    instance::Instance,
    log::{Log, Sink},
    model::Model,
    phase::Kind,
    resources::{self, Location, ResourceError},
    structure::TableError,
};

/// Why an instance cannot be made.
#[derive(Debug, thiserror::Error)]
enum StartError {
    /// The component's table is wrong.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The importer gave no name.
    #[error("an instance needs a name")]
    NoName,
    /// The start values cannot be used.
    #[error(transparent)]
    Resources(#[from] ResourceError),
    /// The token is that of another FMU.
    #[error("token `{given}`, but the library with its resources has {expected}")]
    Token { given: String, expected: String },
    /// The component is not continuous.
    #[error("offers co-simulation only, no model exchange")]
    NoModelExchange,
    /// The component refuses its resources.
    #[error("{0}")]
    Load(Box<dyn std::error::Error>),
    /// The component panicked.
    #[error(transparent)]
    Panic(#[from] Panic),
}

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
    match made.map_err(StartError::from).flatten() {
        Ok(instance) => Box::into_raw(Box::new(instance)).cast(),
        Err(problem) => {
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
) -> Result<Instance<C>, StartError> {
    let model = Model::<C>::get()?;
    if name.is_none_or(CStr::is_empty) {
        return Err(StartError::NoName);
    }
    let start_values = resources::start_values(location)?;
    let expected = match &start_values {
        Some((_, text)) => resources::variant_token(description::token(model), text),
        None => description::token(model).to_string(),
    };
    let token = token.map(CStr::to_string_lossy).unwrap_or_default();
    if token != expected {
        let given = token.into_owned();
        return Err(StartError::Token { given, expected });
    }
    if kind == Kind::ModelExchange && !model.offers_model_exchange() {
        return Err(StartError::NoModelExchange);
    }
    let mut start = C::default();
    if let Some(folder) = location.folder() {
        start.load(&folder).map_err(StartError::Load)?;
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
