//! Terminals: variables that are connected as a group (FMI 3.0, section 2.4.9; FMI 2.0 archives may
//! have the same file).

use std::path::Path;

use roxmltree::{Document, Node};

use super::structure::{DescriptionError, decode};

/// Terminals within terminals further down are not read.
const DEEPEST: usize = 16;

/// A group of variables that is connected as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Terminal {
    /// Its name; one within another is `outer.inner`.
    pub name: String,
    /// How the members of two of them are matched.
    pub rule: MatchingRule,
    /// What it carries; only terminals of one kind fit.
    pub kind: Option<String>,
    /// Its members.
    pub members: Vec<Member>,
    /// Whether it has streams, which two scalar variables cannot carry.
    pub has_streams: bool,
}

/// How the members of two connected terminals are matched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MatchingRule {
    /// Both have the same members.
    Plug,
    /// Members that both have are connected.
    Bus,
    /// By their order.
    Sequence,
    /// Not by a rule of the standard; its name.
    Other(String),
}

/// A variable of a terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Its name in the terminal.
    pub name: String,
    /// The variable's name.
    pub variable: String,
    /// What flows there.
    pub flow: Flow,
}

/// What a member's value means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// The same on both sides.
    Signal,
    /// A flow, positive into the component: it has the other sign on the other side.
    Inflow,
    /// A flow, positive out of the component.
    Outflow,
}

/// The terminals of an unpacked FMU; none where the file is absent.
///
/// # Errors
/// A file that is not XML.
pub(super) fn read(unpacked: &Path) -> Result<Vec<Terminal>, DescriptionError> {
    let path = unpacked.join("terminalsAndIcons/terminalsAndIcons.xml");
    let Ok(bytes) = std::fs::read(path) else {
        return Ok(Vec::new());
    };
    let text = decode(bytes)?;
    of(&text)
}

fn of(text: &str) -> Result<Vec<Terminal>, DescriptionError> {
    let document = Document::parse(text)?;
    let mut all = Vec::new();
    for list in children(document.root_element(), "Terminals") {
        for terminal in children(list, "Terminal") {
            add(terminal, "", DEEPEST, &mut all);
        }
    }
    Ok(all)
}

fn add(node: Node, before: &str, depth: usize, all: &mut Vec<Terminal>) {
    let name = format!("{before}{}", node.attribute("name").unwrap_or_default());
    let members = children(node, "TerminalMemberVariable").map(|member| {
        let variable = member.attribute("variableName").unwrap_or_default();
        Member {
            name: member
                .attribute("memberName")
                .unwrap_or(variable)
                .to_string(),
            variable: variable.to_string(),
            flow: match member.attribute("variableKind") {
                Some("inflow") => Flow::Inflow,
                Some("outflow") => Flow::Outflow,
                _ => Flow::Signal,
            },
        }
    });
    all.push(Terminal {
        rule: match node.attribute("matchingRule") {
            Some("plug") => MatchingRule::Plug,
            Some("bus") => MatchingRule::Bus,
            Some("sequence") => MatchingRule::Sequence,
            other => MatchingRule::Other(other.unwrap_or("none").to_string()),
        },
        kind: node.attribute("terminalKind").map(str::to_string),
        members: members.collect(),
        has_streams: children(node, "TerminalStreamMemberVariable")
            .next()
            .is_some(),
        name: name.clone(),
    });
    if depth > 0 {
        for inner in children(node, "Terminal") {
            add(inner, &format!("{name}."), depth - 1, all);
        }
    }
}

fn children<'a>(node: Node<'a, 'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children()
        .filter(move |child| child.tag_name().name() == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminals_within_terminals_bear_both_names() {
        let all = of(r#"<fmiTerminalsAndIcons><Terminals>
            <Terminal name="shaft" matchingRule="plug" terminalKind="rotation">
                <TerminalMemberVariable variableName="w" memberName="speed" variableKind="signal"/>
                <TerminalMemberVariable variableName="tau" memberName="torque" variableKind="inflow"/>
                <Terminal name="inner" matchingRule="org.other"/>
            </Terminal></Terminals></fmiTerminalsAndIcons>"#)
        .unwrap();
        let names: Vec<&str> = all.iter().map(|terminal| terminal.name.as_str()).collect();
        assert_eq!(names, ["shaft", "shaft.inner"]);
        assert_eq!(all[0].rule, MatchingRule::Plug);
        assert_eq!(all[0].members[1].variable, "tau");
        assert_eq!(all[0].members[1].flow, Flow::Inflow);
        assert_eq!(all[1].rule, MatchingRule::Other("org.other".to_string()));
        assert!(of("no text").is_err());
    }

    #[test]
    fn flows_and_rules_are_read_and_terminals_are_followed_to_a_depth() {
        let member = |kind: &str| {
            format!(r#"<TerminalMemberVariable variableName="{kind}" variableKind="{kind}"/>"#)
        };
        let kinds = ["inflow", "outflow", "signal"].map(member).concat();
        let deep = (0..DEEPEST + 5).map(|_| r#"<Terminal name="t" matchingRule="bus">"#);
        let ends = "</Terminal>".repeat(DEEPEST + 5);
        let text = format!(
            r#"<fmiTerminalsAndIcons><Terminals><Terminal name="a" matchingRule="sequence">{kinds}
            <TerminalStreamMemberVariable/></Terminal>{}{ends}</Terminals></fmiTerminalsAndIcons>"#,
            deep.collect::<String>()
        );
        let all = of(&text).unwrap();
        let flows: Vec<Flow> = all[0].members.iter().map(|member| member.flow).collect();
        assert_eq!(flows, [Flow::Inflow, Flow::Outflow, Flow::Signal]);
        assert_eq!(all[0].members[1].name, "outflow");
        assert!(all[0].has_streams && !all[1].has_streams);
        assert_eq!(
            (&all[0].rule, &all[1].rule),
            (&MatchingRule::Sequence, &MatchingRule::Bus)
        );
        // The first one, and so many within it.
        assert_eq!(all.len(), 1 + 1 + DEEPEST);
    }
}
