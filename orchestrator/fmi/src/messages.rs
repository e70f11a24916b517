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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_steer_a_terminal_are_shown() {
        for (text, expected) in [
            ("plain \u{e9}", "plain \u{e9}"),
            ("two\n\tlines", "two\n\tlines"),
            ("\u{1b}[31mred\u{7}", "\\u{1b}[31mred\\u{7}"),
            ("back\rward", "back\\rward"),
            ("\u{202e}txt.exe", "\\u{202e}txt.exe"),
            ("\u{200f}\u{2067}", "\\u{200f}\\u{2067}"),
        ] {
            assert_eq!(printable(text), expected);
        }
        let most = Messages::LONGEST;
        assert_eq!(printable(&"x".repeat(most)), "x".repeat(most));
        let cut = printable(&"x".repeat(3 * most));
        assert_eq!(cut, "x".repeat(most + 1) + "...");
    }

    #[test]
    fn lines_that_take_turns_are_kept_once_with_their_number() {
        let messages = Messages::new(false);
        for _ in 0..3 {
            messages.message(1, "own", "  one  ");
            messages.message(3, "own", "other");
        }
        messages.message(3, "own", "one");
        messages.message(-1, "\u{7}", "strange");
        let kept: Vec<(&str, String, String, usize)> = messages
            .take()
            .into_iter()
            .map(|own| (own.status, own.category, own.text, own.times))
            .collect();
        let line = |status, category: &str, text: &str, times| {
            (status, category.to_string(), text.to_string(), times)
        };
        assert_eq!(
            kept,
            [
                line("warning", "own", "one", 3),
                line("error", "own", "other", 3),
                line("error", "own", "one", 1),
                line("unknown", "\\u{7}", "strange", 1),
            ]
        );
        assert_eq!(messages.take(), []);
    }

    #[test]
    fn a_line_from_long_ago_is_kept_again_and_there_is_a_most() {
        let messages = Messages::new(false);
        let log = |number: usize| messages.message(0, "", &number.to_string());
        (0..=Messages::RECENT).for_each(log);
        // The first is one too far back, the second is the last that counts.
        log(0);
        log(2);
        let kept = messages.take();
        assert_eq!(kept.len(), Messages::RECENT + 2);
        assert_eq!((kept[0].times, kept[2].times), (1, 2));
        (0..Messages::KEPT + 100).for_each(log);
        assert_eq!(messages.take().len(), Messages::KEPT);
    }

    #[test]
    fn who_wants_warnings_only_gets_what_tells_why_a_call_failed() {
        let messages = Messages::new(true);
        messages.message(0, "logAll", "chatter");
        messages.message(0, "logStatusError", "why");
        messages.message(1, "logAll", "careful");
        let kept: Vec<String> = messages.take().into_iter().map(|own| own.text).collect();
        assert_eq!(kept, ["why", "careful"]);
    }
}
