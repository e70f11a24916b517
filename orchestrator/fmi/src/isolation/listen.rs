//! What a guest says: its messages by instance, and what its FMUs print.

use std::io::{BufRead, BufReader, Read};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use super::super::native::Sink;

/// Lines that FMUs may print before the rest is passed over.
const LINES: usize = 1000;

/// Where each instance's messages go, and whose call was the last.
#[derive(Clone, Default)]
pub(super) struct Sinks {
    pub all: Arc<Mutex<Vec<Arc<dyn Sink>>>>,
    pub current: Arc<AtomicUsize>,
    /// Something was printed.
    pub heard: Arc<AtomicBool>,
}

impl Sinks {
    pub(super) fn message(&self, instance: usize, status: i32, category: &str, text: &str) {
        let all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sink) = all.get(instance) {
            sink.message(status, category, text);
        }
    }
}

/// Passes on what a guest prints, line by line, as words of the FMU that was called last.
pub(super) fn listen(
    stream: Option<impl Read + Send + 'static>,
    name: &'static str,
    sinks: Sinks,
) -> Option<JoinHandle<()>> {
    let stream = stream?;
    Some(std::thread::spawn(move || {
        let mut lines = BufReader::new(stream);
        let mut line = Vec::new();
        let mut count = 0;
        loop {
            line.clear();
            let read = lines.by_ref().take(16_000).read_until(b'\n', &mut line);
            if !read.is_ok_and(|length| length > 0) {
                return;
            }
            count += 1;
            sinks.heard.store(true, Ordering::Relaxed);
            if count <= LINES {
                let text = String::from_utf8_lossy(&line);
                let text = format!("printed on {name}: {}", text.trim_end());
                let instance = sinks.current.load(Ordering::Relaxed);
                sinks.message(instance, 1, "", &text);
            }
        }
    }))
}
