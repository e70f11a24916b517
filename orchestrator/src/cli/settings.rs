//! What is given twice: values of `--set`, of whatever command, and files.

use std::path::PathBuf;

use clap::ArgMatches;

/// A variable that is set to two values.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("--set: `{name}` is set twice, to `{first}` and to `{second}`; expected one value")]
pub struct SetTwice {
    /// The variable.
    name: String,
    /// Its first value.
    first: String,
    /// Its second value.
    second: String,
}

/// Whether no variable is given two values: which of them counts would be a guess.
///
/// # Errors
/// The variable and its values.
pub fn agree(words: &ArgMatches) -> Result<(), SetTwice> {
    let Some((_, command)) = words.subcommand() else {
        return Ok(());
    };
    // Commands without `--set` have none.
    let Ok(Some(all)) = command.try_get_many::<String>("set") else {
        return Ok(());
    };
    let all: Vec<(&str, &str)> = all.filter_map(|setting| setting.split_once('=')).collect();
    for (place, (name, value)) in all.iter().enumerate() {
        let before = all[..place]
            .iter()
            .find(|(other, _)| other.trim() == name.trim());
        if let Some((_, other)) = before.filter(|(_, other)| other != value) {
            return Err(SetTwice {
                name: name.trim().to_string(),
                first: (*other).to_string(),
                second: (*value).to_string(),
            });
        }
    }
    Ok(())
}

/// A file that is given twice, under whatever name.
pub fn twice(files: &[PathBuf]) -> Option<&PathBuf> {
    let whole: Vec<_> = files.iter().map(|file| file.canonicalize().ok()).collect();
    let known = |place: usize| whole[place].is_some() && whole[..place].contains(&whole[place]);
    (0..files.len())
        .find(|&place| known(place))
        .map(|place| &files[place])
}
