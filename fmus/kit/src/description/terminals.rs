//! `terminalsAndIcons/terminalsAndIcons.xml` of FMI 3.0.

use super::xml::Element;
use crate::terminal::Terminal;

/// Half the side of the square that the icon is drawn in.
const EXTENT: i32 = 100;

/// The icon's place, and the terminals of a component.
pub(super) fn text(terminals: &[Terminal]) -> String {
    let square = |name: &str| {
        Element::new(name)
            .attribute("x1", -EXTENT)
            .attribute("y1", -EXTENT)
            .attribute("x2", EXTENT)
            .attribute("y2", EXTENT)
    };
    let picture = Element::new("GraphicalRepresentation")
        .child(square("CoordinateSystem").attribute("suggestedScalingFactorTo_mm", 0.1))
        .child(square("Icon"));
    let terminals = terminals.iter().map(|terminal| {
        let members = terminal.members.iter().map(|(member, variable)| {
            Element::new("TerminalMemberVariable")
                .attribute("variableName", variable)
                .attribute("memberName", member)
                .attribute("variableKind", "signal")
        });
        Element::new("Terminal")
            .attribute("name", terminal.name)
            .attribute("matchingRule", terminal.rule.name())
            .attribute("terminalKind", terminal.kind)
            .children(members)
    });
    let terminals = Element::new("Terminals").children(terminals);
    Element::new("fmiTerminalsAndIcons")
        .attribute("fmiVersion", "3.0")
        .child(picture)
        .children((!terminals.is_empty()).then_some(terminals))
        .document()
}
