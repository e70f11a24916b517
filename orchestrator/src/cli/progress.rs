//! Progress on a terminal, for whatever takes longer than two seconds; nothing where it is piped.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// A turning sign with words and the time so far.
pub(super) fn spinner(words: &str) -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message(words.to_string());
    // A template that cannot be read leaves the plain sign.
    if let Ok(style) = ProgressStyle::with_template("{spinner} {wide_msg} {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
