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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Heard(Mutex<Vec<String>>);

    impl Sink for Heard {
        fn message(&self, status: i32, category: &str, text: &str) {
            let line = format!("{status} {category:?} {text}");
            self.0.lock().unwrap().push(line);
        }
    }

    /// What two instances hear of a stream while the second one is called.
    fn heard(text: &str) -> ([Vec<String>; 2], bool) {
        let all = [Arc::new(Heard::default()), Arc::new(Heard::default())];
        let sinks = Sinks::default();
        for own in &all {
            sinks.all.lock().unwrap().push(own.clone());
        }
        sinks.current.store(1, Ordering::Relaxed);
        let stream = std::io::Cursor::new(text.as_bytes().to_vec());
        let thread = listen(Some(stream), "standard output", sinks.clone());
        thread.unwrap().join().unwrap();
        let lines = all.map(|own| own.0.lock().unwrap().clone());
        (lines, sinks.heard.load(Ordering::Relaxed))
    }

    #[test]
    fn lines_are_words_of_the_instance_that_was_called_last() {
        let ([first, second], is_heard) = heard("one  \n\nlast without an end");
        assert!(is_heard && first.is_empty());
        let front = "1 \"\" printed on standard output:";
        let expected = [
            format!("{front} one"),
            format!("{front} "),
            format!("{front} last without an end"),
        ];
        assert_eq!(second, expected);
        assert_eq!(heard(""), ([Vec::new(), Vec::new()], false));
        assert!(listen(None::<std::io::Empty>, "nothing", Sinks::default()).is_none());
    }

    #[test]
    fn very_many_lines_are_passed_over_and_very_long_ones_are_cut() {
        let ([_, second], _) = heard(&"x\n".repeat(LINES + 500));
        assert_eq!(second.len(), LINES);
        let ([_, second], _) = heard(&"y".repeat(20_000));
        let lengths: Vec<usize> = second
            .iter()
            .map(|line| line.matches('y').count())
            .collect();
        assert_eq!(lengths, [16_000, 4_000]);
    }

    #[test]
    fn a_message_for_nobody_is_dropped() {
        Sinks::default().message(3, 1, "", "text");
    }
}
