//! What an FMU calls: its logger and, in FMI 2.0, the allocator.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::Arc;

use super::Sink;

/// What is handed to an FMU as its environment. FMUs keep the pointer, so it stays on the heap for
/// as long as the instance lives.
#[repr(C)]
pub(super) struct Environment {
    /// Where `logger.c` hands a text on; it has to be the first field.
    log: unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char),
    sink: Arc<dyn Sink>,
}

impl Environment {
    pub(super) fn new(sink: Arc<dyn Sink>) -> Box<Self> {
        Box::new(Self { log, sink })
    }

    pub(super) fn pointer(&self) -> *mut c_void {
        std::ptr::from_ref(self).cast_mut().cast()
    }
}

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(super) struct Callbacks {
    logger:
        unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...),
    allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free_memory: unsafe extern "C" fn(*mut c_void),
    step_finished: unsafe extern "C" fn(*mut c_void, c_int),
    environment: *mut c_void,
}

impl Callbacks {
    pub(super) fn new(environment: &Environment) -> Box<Self> {
        Box::new(Self {
            logger: shakebench_fmi2_logger,
            allocate_memory: libc::calloc,
            free_memory: libc::free,
            step_finished,
            environment: environment.pointer(),
        })
    }
}

unsafe extern "C" {
    pub(super) fn shakebench_print_by_the_line();

    fn shakebench_fmi2_logger(
        environment: *mut c_void,
        instance: *const c_char,
        status: c_int,
        category: *const c_char,
        message: *const c_char,
        ...
    );
}

/// Never called, since no step is asked for that goes on by itself; some FMUs refuse a null.
unsafe extern "C" fn step_finished(_environment: *mut c_void, _status: c_int) {}

unsafe extern "C" fn log(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the environment is the one that `Environment::pointer` gave, and lives.
    let environment = unsafe { environment.cast::<Environment>().as_ref() };
    if let Some(environment) = environment {
        // SAFETY: texts of C, or null.
        let (category, text) = unsafe { (words(category), words(text)) };
        let text = text.unwrap_or_else(|| "(a message without a text)".to_string());
        environment
            .sink
            .message(status, &category.unwrap_or_default(), &text);
    }
}

/// FMI 3.0's `logMessage`.
pub(super) unsafe extern "C" fn log_message(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: as the FMU gave them.
    unsafe { log(environment, status, category, text) }
}

/// A text of C; bytes that are no UTF-8 are replaced.
///
/// # Safety
/// `text` is null or ends with a zero.
pub(super) unsafe fn words(text: *const c_char) -> Option<String> {
    if text.is_null() {
        return None;
    }
    // SAFETY: as above.
    let text = unsafe { CStr::from_ptr(text) };
    Some(text.to_string_lossy().into_owned())
}
