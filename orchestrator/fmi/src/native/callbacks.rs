//! What an FMU calls: its logger and, in FMI 2.0, the allocator.

use std::cell::Cell;
use std::collections::HashMap;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use super::Sink;

/// Where the messages of each living instance go, by the address that it was handed as its
/// environment. FMUs hand back whatever they like, so an address is looked up and never followed.
static SINKS: Mutex<Option<HashMap<usize, Arc<dyn Sink>>>> = Mutex::new(None);

thread_local! {
    /// The environment of the instance that is called in this thread; 0 where none is.
    static CALLED: Cell<usize> = const { Cell::new(0) };
}

/// What is handed to an FMU as its environment, for as long as the instance lives.
pub(super) struct Environment(Box<u64>);

impl Environment {
    pub(super) fn new(sink: Arc<dyn Sink>) -> Self {
        let environment = Self(Box::new(0));
        let mut sinks = SINKS.lock().unwrap_or_else(PoisonError::into_inner);
        sinks
            .get_or_insert_default()
            .insert(environment.address(), sink);
        environment.enter();
        drop(sinks);
        environment
    }

    fn address(&self) -> usize {
        std::ptr::from_ref(&*self.0).addr()
    }

    pub(super) fn pointer(&self) -> *mut c_void {
        std::ptr::from_ref(&*self.0).cast_mut().cast()
    }

    /// A call of this instance begins: what is logged with a strange environment in this thread comes
    /// from it.
    #[inline]
    pub(super) fn enter(&self) {
        // `set` would look at each call whether the place has a value yet.
        CALLED.with(|called| called.set(self.address()));
    }
}

/// The call has ended.
#[inline]
pub(super) fn leave() {
    CALLED.with(|called| called.set(0));
}

/// From now on, an FMU that ends this process in one of its calls does not end it with the status 0 of
/// a success.
pub(super) fn report_exits() {
    extern "C" fn at_exit() {
        if CALLED.get() == 0 {
            return;
        }
        let text = "error: an FMU ended the program by exit() in one of its calls, and nothing was \
                    saved; leave out --isolate none to run it in a process of its own\n";
        // SAFETY: the text lives; the process ends here.
        unsafe {
            libc::write(2, text.as_ptr().cast(), text.len() as _);
            libc::_exit(1);
        }
    }
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        // SAFETY: the function lives as long as the program.
        unsafe { libc::atexit(at_exit) };
    });
}

impl Drop for Environment {
    fn drop(&mut self) {
        let mut sinks = SINKS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sinks) = sinks.as_mut() {
            sinks.remove(&self.address());
        }
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

/// Takes what an FMU logs.
///
/// # Safety
/// The texts end with a zero or are null; the environment may be anything.
#[unsafe(no_mangle)]
unsafe extern "C" fn shakebench_log(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    let sink = {
        let sinks = SINKS.lock().unwrap_or_else(PoisonError::into_inner);
        let of = |address: usize| sinks.as_ref().and_then(|all| all.get(&address)).cloned();
        of(environment.addr()).or_else(|| of(CALLED.get()))
    };
    if let Some(sink) = sink {
        // SAFETY: the caller's.
        let (category, text) = unsafe { (words(category), words(text)) };
        let text = text.unwrap_or_else(|| "(a message without a text)".to_string());
        sink.message(status, &category.unwrap_or_default(), &text);
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
    unsafe { shakebench_log(environment, status, category, text) }
}

/// FMI 3.0's `intermediateUpdate`: nothing is read, set or ended between communication points. FMUs call it
/// without a look at whether there is one.
pub(super) unsafe extern "C" fn intermediate_update(
    _environment: *mut c_void,
    _time: f64,
    _can_set: u8,
    _can_get: u8,
    _step_finished: u8,
    _can_return_early: u8,
    return_early: *mut u8,
    _early_time: *mut f64,
) {
    if !return_early.is_null() {
        // SAFETY: the FMU's own truth value.
        unsafe { *return_early = 0 };
    }
}

/// A text of C; bytes that are not UTF-8 are replaced.
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
