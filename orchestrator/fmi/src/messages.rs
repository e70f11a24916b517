//! What FMUs log, kept instead of printed.

use std::sync::{Mutex, PoisonError};

use super::native::Sink;

/// A line that an FMU logged.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// `ok`, `warning`, `discard`, `error`, `fatal` or `pending`.
    pub status: &'static str,
    /// The FMU's log category.
    pub category: String,
    /// The text; characters that steer a terminal are shown, not carried out.
    pub text: String,
    /// How often it came, other lines in between or not.
    pub times: usize,
}

/// Messages of one instance since they were last taken, the first [`Messages::KEPT`] of them.
#[derive(Debug, Default)]
pub(super) struct Messages {
    kept: Mutex<Vec<Message>>,
    /// Only warnings and errors are wanted, also from FMUs that heed no categories.
    is_terse: bool,
}

/// Log categories that say why a call failed.
pub(super) const TELLING: [&str; 4] = [
    "logStatusWarning",
    "logStatusDiscard",
    "logStatusError",
    "logStatusFatal",
];

/// The names of the status codes, which both versions number alike.
pub(super) const STATUS: [&str; 6] = ["ok", "warning", "discard", "error", "fatal", "pending"];

impl Messages {
    /// An FMU that logs without end does not fill the memory.
    const KEPT: usize = 1000;
    /// Among so many of the latest lines the same one is not kept twice.
    const RECENT: usize = 16;
    /// Nor does one line, bytes.
    const LONGEST: usize = 4096;

    pub(super) fn new(is_terse: bool) -> Self {
        Self {
            is_terse,
            ..Self::default()
        }
    }

    pub(super) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut *self.kept.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Sink for Messages {
    fn message(&self, status: i32, category: &str, text: &str) {
        if self.is_terse && status == 0 && !TELLING.contains(&category) {
            return;
        }
        let message = Message {
            status: usize::try_from(status)
                .ok()
                .and_then(|status| STATUS.get(status).copied())
                .unwrap_or("unknown"),
            category: printable(category),
            text: printable(text.trim()),
            times: 1,
        };
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let has_room = kept.len() < Self::KEPT;
        // Lines that take turns are folded, too.
        let recent = kept.len().saturating_sub(Self::RECENT);
        let again = kept[recent..]
            .iter_mut()
            .find(|last| last.text == message.text && last.status == message.status);
        match again {
            Some(last) => last.times += 1,
            None if has_room => kept.push(message),
            None => {}
        }
    }
}

/// The text with control characters written out, such as `\u{1b}`, and cut where it is too long.
pub(super) fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len().min(Messages::LONGEST));
    for character in text.chars() {
        if shown.len() > Messages::LONGEST {
            shown += "...";
            break;
        }
        match character {
            '\n' | '\t' => shown.push(character),
            character if character.is_control() || is_directional(character) => {
                shown.extend(character.escape_default());
            }
            character => shown.push(character),
        }
    }
    shown
}

/// Characters that turn the direction of a line and so hide what it says.
fn is_directional(character: char) -> bool {
    matches!(character, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}
