//! Progress on a terminal, for whatever takes longer than two seconds; nothing where it is piped or
//! `--quiet` was given; lines with `--verbose`.

use std::sync::OnceLock;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How much of the progress is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Detail {
    /// Nothing.
    Quiet,
    /// Bars on a terminal.
    #[default]
    Usual,
    /// A line for each step.
    Verbose,
}

static DETAIL: OnceLock<Detail> = OnceLock::new();

/// Chooses how much is printed; before any progress.
pub(super) fn choose(detail: Detail) {
    // Nobody chooses twice.
    let _ = DETAIL.set(detail);
}

fn detail() -> Detail {
    DETAIL.get().copied().unwrap_or_default()
}

/// Whether `--quiet` was given.
pub(super) fn is_quiet() -> bool {
    detail() == Detail::Quiet
}

/// Whether `--verbose` was given.
pub(super) fn is_verbose() -> bool {
    detail() == Detail::Verbose
}

/// Tells a step: beside the sign, or as a line of its own.
pub(super) fn say(bar: &ProgressBar, words: impl Into<String>) {
    let words = words.into();
    match is_verbose() {
        true => eprintln!("{words}"),
        false => bar.set_message(words),
    }
}

fn target() -> ProgressDrawTarget {
    match detail() {
        Detail::Usual => ProgressDrawTarget::stderr(),
        Detail::Quiet | Detail::Verbose => ProgressDrawTarget::hidden(),
    }
}

fn styled(bar: ProgressBar, template: &str) -> ProgressBar {
    // A template that cannot be read leaves the plain bar.
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// A turning sign with words and the time so far.
pub(super) fn spinner(words: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, target()).with_message(words.to_string());
    let bar = styled(bar, "{spinner} {wide_msg} {elapsed}");
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A bar for a known number of parts.
pub(super) fn bar(parts: usize, template: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(parts as u64), target());
    styled(bar, template)
}

/// A bar that [`show`] makes visible when the number of parts is known.
pub(super) fn hidden_bar(template: &str) -> ProgressBar {
    styled(ProgressBar::hidden(), template)
}

/// Shows a hidden bar.
pub(super) fn show(bar: &ProgressBar, parts: usize) {
    bar.set_length(parts as u64);
    bar.reset();
    bar.set_draw_target(target());
}
