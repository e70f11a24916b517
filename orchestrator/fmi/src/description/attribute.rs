//! Elements and attributes of a description, and where one is not as expected.

use roxmltree::Node;

use super::structure::DescriptionError;

/// The first child of that name.
pub(super) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The children of that name, of a node that may be absent.
pub(super) fn children<'a>(
    node: Option<Node<'a, 'a>>,
    name: &'a str,
) -> impl Iterator<Item = Node<'a, 'a>> {
    let all = node.into_iter().flat_map(|node| node.children());
    all.filter(move |child| child.has_tag_name(name))
}

/// What an attribute can be.
pub(super) trait Value: Sized {
    /// What is expected of its text.
    const EXPECTED: &'static str;

    /// The value of a text, if it is one.
    fn read(text: &str) -> Option<Self>;
}

macro_rules! numbers {
    ($($number:ty: $expected:literal),*) => {$(
        impl Value for $number {
            const EXPECTED: &'static str = $expected;

            fn read(text: &str) -> Option<Self> {
                text.trim().parse().ok()
            }
        }
    )*};
}

numbers! {
    u32: "a whole number from 0 to 4294967295",
    u64: "a whole number from 0 to 18446744073709551615",
    i64: "a whole number",
    f32: "a number",
    f64: "a number"
}

impl Value for bool {
    const EXPECTED: &'static str = "true or false";

    fn read(text: &str) -> Option<Self> {
        match text.trim() {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            _ => None,
        }
    }
}

/// Value references or positions.
impl Value for Vec<u32> {
    const EXPECTED: &'static str = "a list of whole numbers from 0 to 4294967295";

    fn read(text: &str) -> Option<Self> {
        text.split_whitespace().map(u32::read).collect()
    }
}

impl Value for String {
    const EXPECTED: &'static str = "a text";

    fn read(text: &str) -> Option<Self> {
        Some(text.to_string())
    }
}

/// An attribute that may be absent.
///
/// # Errors
/// It is not as expected.
pub(super) fn optional<T: Value>(node: Node, name: &str) -> Result<Option<T>, DescriptionError> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    let value = T::read(text);
    value
        .ok_or_else(|| unexpected(node, name, text, T::EXPECTED))
        .map(Some)
}

/// An attribute that must be there.
///
/// # Errors
/// It is absent or not as expected.
pub(super) fn needed<T: Value>(node: Node, name: &str) -> Result<T, DescriptionError> {
    optional(node, name)?.ok_or_else(|| missing(node, name, T::EXPECTED))
}

/// An attribute that is one of a few `words`, with a blank between them, or absent.
///
/// # Errors
/// It is another word.
pub(super) fn word(
    node: Node,
    name: &str,
    words: &'static str,
) -> Result<Option<&'static str>, DescriptionError> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    let known = words.split(' ').find(|word| *word == text.trim());
    let expected = || format!("one of {}", words.replace(' ', ", "));
    known
        .ok_or_else(|| unexpected(node, name, text, &expected()))
        .map(Some)
}

/// An attribute is absent.
pub(super) fn missing(node: Node, name: &str, expected: &str) -> DescriptionError {
    let reason = format!("the attribute {name} is missing; expected {expected}");
    at(node, reason)
}

fn unexpected(node: Node, name: &str, text: &str, expected: &str) -> DescriptionError {
    /// Characters of a value at most.
    const LONGEST: usize = 60;
    let mut shown: String = text.chars().take(LONGEST).collect();
    if shown.len() < text.len() {
        shown += "...";
    }
    at(node, format!("{name}=\"{shown}\" is not {expected}"))
}

/// What is wrong with an element, with its place in the file.
pub(super) fn at(node: Node, reason: String) -> DescriptionError {
    let shown = |node: Node| {
        let tag = node.tag_name().name().to_string();
        match node.attribute("name") {
            Some(name) => format!("<{tag} name=\"{name}\">"),
            None => format!("<{tag}>"),
        }
    };
    let mut element = shown(node);
    let parent = node.parent().filter(|parent| parent.has_attribute("name"));
    if let Some(parent) = parent.filter(|_| !node.has_attribute("name")) {
        element += &format!(" of {}", shown(parent));
    }
    DescriptionError::At {
        line: node.document().text_pos_at(node.range().start).row,
        element,
        reason,
    }
}

/// What is against the standard in a description that can be used nevertheless.
#[derive(Default)]
pub(super) struct Remarks(pub(super) Vec<String>);

impl Remarks {
    /// To find each one's line takes time; further ones are not listed.
    const MOST: usize = 100;

    /// Notes what `wrong` says.
    pub(super) fn note(&mut self, wrong: impl FnOnce() -> DescriptionError) {
        if self.0.len() < Self::MOST {
            self.0.push(wrong().to_string());
        }
    }

    /// An attribute that counts as absent if it is not as expected.
    pub(super) fn lenient<T: Value>(&mut self, node: Node, name: &str) -> Option<T> {
        let text = node.attribute(name)?;
        let value = T::read(text);
        if value.is_none() {
            self.note(|| unexpected(node, name, text, T::EXPECTED));
        }
        value
    }
}
