//! Names and texts as in the archive's files.

use super::super::BEFORE;
use fmi_system::{Component, Quantity};

/// The output of the motion's component for a tap.
pub(super) fn tap(quantity: Quantity, ahead: isize) -> String {
    match ahead {
        0 => quantity.name().to_string(),
        -1 => format!("{}{BEFORE}", quantity.name()),
        ahead => format!("{}[{ahead}]", quantity.name()),
    }
}

/// The name of a variable, or of the array that it is an element of.
pub(super) fn connector_name(part: &Component, position: usize) -> String {
    let variable = &part.fmu.description.variables[position];
    match variable.name.rsplit_once('[') {
        Some((array, _)) if variable.is_element => array.to_string(),
        _ => variable.name.clone(),
    }
}

/// A file's name as part of a URI.
pub(super) fn uri(name: &str) -> String {
    const KEPT: &percent_encoding::AsciiSet = &percent_encoding::NON_ALPHANUMERIC
        .remove(b'-')
        .remove(b'_')
        .remove(b'.')
        .remove(b'~');
    percent_encoding::utf8_percent_encode(name, KEPT).to_string()
}

/// A text in an attribute.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\n' => out += "&#10;",
            '\r' => out += "&#13;",
            '\t' => out += "&#9;",
            // XML has no place for these.
            character if character.is_control() => out.push('\u{fffd}'),
            character => out.push(character),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_any_characters_are_attributes() {
        for (text, expected) in [
            ("plain \u{e9}", "plain \u{e9}"),
            ("a & b < \"c\" > d", "a &amp; b &lt; &quot;c&quot; &gt; d"),
            ("a\n\r\tb", "a&#10;&#13;&#9;b"),
            ("\u{1}\u{7f}", "\u{fffd}\u{fffd}"),
        ] {
            assert_eq!(escape(text), expected);
        }
    }

    #[test]
    fn a_file_s_name_is_part_of_a_uri() {
        assert_eq!(uri("A-b_c.1~2"), "A-b_c.1~2");
        assert_eq!(uri("a b#c%d/e"), "a%20b%23c%25d%2Fe");
    }
}
