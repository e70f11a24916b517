//! Negative values behind options.

use std::ffi::OsString;

/// The arguments with `--duration "-1 s"` as `--duration=-1 s`. The option then reports what is
/// wrong with the value, which would otherwise be mistaken for another option.
pub fn joined(arguments: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut all: Vec<OsString> = Vec::new();
    for argument in arguments {
        let option = all.last_mut().filter(|last| is_option(last));
        match option {
            Some(option) if is_negative(&argument) => {
                option.push("=");
                option.push(&argument);
            }
            _ => all.push(argument),
        }
    }
    all
}

fn is_option(argument: &OsString) -> bool {
    let text = argument.to_str();
    text.is_some_and(|text| text.len() > 2 && text.starts_with("--") && !text.contains('='))
}

fn is_negative(argument: &OsString) -> bool {
    let number = argument.to_str().and_then(|text| text.strip_prefix('-'));
    let number = number.map(|text| text.strip_prefix('.').unwrap_or(text));
    number.is_some_and(|text| text.starts_with(|first: char| first.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_values_belong_to_the_option_before() {
        let read = |words: &str| {
            let words = words.split('|').map(OsString::from);
            joined(words)
                .iter()
                .map(|word| word.to_string_lossy().into_owned())
                .collect::<Vec<_>>()
                .join("|")
        };
        assert_eq!(read("run|--scale|-1|--json"), "run|--scale=-1|--json");
        assert_eq!(read("run|--duration|-.5 s"), "run|--duration=-.5 s");
        let others = "run|--set=a.b=1|-5|--|-5|--out|-|--band|1|-2";
        assert_eq!(read(others), "run|--set=a.b=1|-5|--|-5|--out|-|--band|1|-2");
    }
}
