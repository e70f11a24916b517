//! Files of hypotheses.

use std::path::Path;

use super::Hypotheses;
use crate::kinds::DescriptionError;

/// Names for a message.
pub(super) fn listed(names: &[&str]) -> String {
    let all: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match all.as_slice() {
        [] => "nothing".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// Reads a file of effects: a table `[NAME]` each.
///
/// # Errors
/// A file that cannot be read, is not TOML, has an unknown key, or has no effect; by line.
pub fn read(path: &Path) -> Result<Hypotheses, DescriptionError> {
    let text = recordings::read_written(path).map_err(|source| DescriptionError::Read {
        path: path.to_owned(),
        source,
    })?;
    let wrong = |what: String| DescriptionError::Description {
        path: path.to_owned(),
        what,
    };
    let all: Hypotheses = toml::from_str(&text).map_err(|error| {
        wrong(format!(
            "not a file of effects, each of which is a table `[NAME]` with `at`, `value`, `sentence` and \
             `[NAME.parameters]`: {error}"
        ))
    })?;
    if all.is_empty() {
        return Err(wrong(
            "no effect: expected a table `[NAME]` for each".to_owned(),
        ));
    }
    Ok(all)
}

/// The line of `text` on which the effect `name` has the key of this path, counted from 1: of its last part
/// within the effect's tables. None where it is written in another form.
pub fn line_of(text: &str, name: &str, key: &str) -> Option<usize> {
    let last = key.rsplit('.').next().unwrap_or_default();
    let mut is_within = false;
    let mut head = None;
    let mut best = None;
    for (i, line) in text.lines().enumerate() {
        let line = line.trim_start();
        if let Some(table) = line.strip_prefix('[') {
            let table = table
                .trim_start_matches('[')
                .split(']')
                .next()
                .unwrap_or_default();
            let mut parts = table.split('.').map(|part| part.trim().trim_matches('"'));
            is_within = parts.clone().any(|part| part == name);
            if is_within {
                head = head.or(Some(i + 1));
                if parts.next_back() == Some(last) {
                    best = best.or(Some(i + 1));
                }
            }
        } else if is_within {
            // `key = ...`, or the table that holds it in one line.
            let own = line.split('=').next().unwrap_or_default().trim();
            let parent = key.rsplit('.').nth(1);
            let is_own = !key.is_empty() && (own == last || own == key);
            let holds = parent.is_some_and(|parent| own == parent && line.contains(last));
            if is_own || holds {
                best = best.or(Some(i + 1));
            }
        }
    }
    if key.is_empty() { head } else { best.or(head) }
}
