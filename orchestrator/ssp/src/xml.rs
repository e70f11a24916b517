//! XML as the formats of SSP use it: elements by their local names, attributes with types.

use roxmltree::{Document, Node, ParsingOptions};

use super::error::Fault;

/// Larger documents are mistakes or attacks.
const MOST_NODES: u32 = 5_000_000;
/// Deeper ones, too.
const DEEPEST: usize = 200;

/// Parses a document.
///
/// # Errors
/// No UTF-8, XML that is not well-formed, or too large.
pub(super) fn parse(text: &str) -> Result<Document<'_>, Fault> {
    if deepest(text) > DEEPEST {
        return Err(Fault::new(format!(
            "elements within elements deeper than {DEEPEST}"
        )));
    }
    fmi_import::archive::check_attributes(text).map_err(|doubt| Fault::new(doubt.to_string()))?;
    let options = ParsingOptions {
        nodes_limit: MOST_NODES,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options)
        .map_err(|error| Fault::new(format!("not well-formed XML: {error}")))
}

/// How deep elements lie in each other at most, by a look at the tags alone.
fn deepest(text: &str) -> usize {
    let (mut depth, mut most) = (0_usize, 0);
    let bytes = text.as_bytes();
    for (place, _) in text.match_indices('<') {
        match bytes.get(place + 1) {
            Some(b'/') => depth = depth.saturating_sub(1),
            Some(b'!' | b'?') | None => {}
            Some(_) => {
                let end = text[place..].find('>').map_or(text.len(), |at| place + at);
                if bytes.get(end.wrapping_sub(1)) != Some(&b'/') {
                    depth += 1;
                    most = most.max(depth);
                }
            }
        }
        if most > DEEPEST {
            break;
        }
    }
    most
}

/// The line of a node, counted from 1.
pub(super) fn line(node: Node) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

/// What is wrong at a node.
pub(super) fn fault(node: Node, reason: impl Into<String>) -> Fault {
    Fault {
        line: Some(line(node)),
        reason: reason.into(),
    }
}

/// The children with that local name.
pub(super) fn children<'a, 'd: 'a>(
    node: Node<'a, 'd>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children()
        .filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The first child with that local name.
pub(super) fn child<'a, 'd: 'a>(node: Node<'a, 'd>, name: &'static str) -> Option<Node<'a, 'd>> {
    children(node, name).next()
}

/// An attribute that has to be there.
///
/// # Errors
/// It is not.
pub(super) fn required<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, Fault> {
    node.attribute(name).ok_or_else(|| {
        let element = node.tag_name().name();
        fault(
            node,
            format!("<{element}> has no attribute `{name}`, which it must have"),
        )
    })
}

/// An attribute that is a number, or `usual`.
///
/// # Errors
/// It is none.
pub(super) fn number(node: Node, name: &str, usual: f64) -> Result<f64, Fault> {
    match node.attribute(name) {
        None => Ok(usual),
        Some(text) => real(text).ok_or_else(|| {
            fault(
                node,
                format!(
                    "{name}=\"{text}\" is not a finite \
                number"
                ),
            )
        }),
    }
}

/// A finite number.
pub(super) fn real(text: &str) -> Option<f64> {
    text.trim()
        .parse()
        .ok()
        .filter(|value: &f64| value.is_finite())
}

/// A truth value.
pub(super) fn truth(text: &str) -> Option<bool> {
    match text.trim() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// An attribute that is a truth value, or false.
///
/// # Errors
/// It is none.
pub(super) fn flag(node: Node, name: &str) -> Result<bool, Fault> {
    match node.attribute(name) {
        None => Ok(false),
        Some(text) => truth(text)
            .ok_or_else(|| fault(node, format!("{name}=\"{text}\" is neither true nor false"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_that_of_the_elements_alone() {
        for (text, depth) in [
            ("", 0),
            ("<a/>", 0),
            ("<a></a>", 1),
            (
                "<?xml version=\"1.0\"?><!-- <x> --><a><b/><c><d></d></c></a>",
                4,
            ),
            ("<a><b></b><b></b><b></b></a>", 2),
            ("<a x='1'\n y='2'><b z='/'/></a>", 1),
        ] {
            assert_eq!(deepest(text), depth, "{text}");
        }
        let nested = |depth: usize| "<a>".repeat(depth) + &"</a>".repeat(depth);
        assert!(parse(&nested(DEEPEST)).is_ok());
        assert!(parse(&nested(DEEPEST + 1)).is_err());
    }

    #[test]
    fn a_fault_has_the_line_of_its_element() {
        let text = "<a>\n <b/>\n <c\n x='1'/></a>";
        let document = parse(text).unwrap();
        let lines: Vec<u32> = document
            .root_element()
            .children()
            .filter(Node::is_element)
            .map(line)
            .collect();
        assert_eq!(lines, [2, 3]);
        let last = document.root_element().last_element_child().unwrap();
        let told = fault(last, "is wrong");
        assert_eq!((told.line, told.reason.as_str()), (Some(3), "is wrong"));
    }
}
