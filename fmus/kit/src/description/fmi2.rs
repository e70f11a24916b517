//! `modelDescription.xml` of FMI 2.0.
//!
//! The optional variable `time` is left out, and variables are identified in the model structure
//! by their position, which is their value reference, too.

use super::{
    Interface, default_experiment, described, enumerations, initial_unknown, initial_unknowns,
    items, log_categories, range, root, start, unit_definitions, unknown, xml::Element,
};
use crate::variable::{Row, Type};

/// The model description of FMI 2.0 with a token.
pub(super) fn text(interface: &Interface, token: &str) -> String {
    let mut root = root(interface, "2.0", "guid", token);
    if interface.offers_model_exchange() {
        root = root
            .attribute("numberOfEventIndicators", interface.event_indicators)
            .child(
                abilities(interface, "ModelExchange")
                    .attribute("completedIntegratorStepNotNeeded", true),
            );
    }
    let mut types = Element::new("TypeDefinitions");
    for choices in enumerations(&interface.rows) {
        types = types.child(
            Element::new("SimpleType")
                .attribute("name", choices.name)
                .child(items(Element::new("Enumeration"), &choices)),
        );
    }
    let rows = interface.rows.iter().enumerate();
    let variables = rows.map(|(i, row)| scalar(interface, i, row));
    root.child(abilities(interface, "CoSimulation").attribute(
        "canHandleVariableCommunicationStepSize",
        interface.any_step_size,
    ))
    .children(unit_definitions(&interface.rows))
    .children((!types.is_empty()).then_some(types))
    .child(log_categories())
    .child(default_experiment(interface))
    .child(Element::new("ModelVariables").children(variables))
    .child(structure(interface))
    .document()
}

fn abilities(interface: &Interface, name: &str) -> Element {
    Element::new(name)
        .attribute("modelIdentifier", interface.name)
        .optional(
            "needsExecutionTool",
            interface.needs_execution_tool.then_some(true),
        )
        .attribute("canNotUseMemoryManagementFunctions", true)
        .attribute("canGetAndSetFMUstate", interface.saves_state)
        .attribute("canSerializeFMUstate", interface.saves_state)
        .attribute(
            "providesDirectionalDerivative",
            interface.partial_derivatives,
        )
}

fn scalar(interface: &Interface, index: usize, row: &Row) -> Element {
    let typed = match row.kind {
        Type::Real => Element::new("Real")
            .optional("unit", row.declaration.unit)
            .optional("displayUnit", row.declaration.display_unit),
        Type::Integer => Element::new("Integer"),
        Type::Boolean => Element::new("Boolean"),
        Type::Text => Element::new("String"),
        Type::Choice(choices) => {
            Element::new("Enumeration").attribute("declaredType", choices.name)
        }
    };
    described("ScalarVariable", index, row.declaration).child(
        range(row, typed)
            .optional("start", start(row))
            .optional("derivative", interface.state_of(index)),
    )
}

fn structure(interface: &Interface) -> Element {
    let entry = |index: usize| {
        let on = interface.dependencies[index].iter().copied();
        unknown("Unknown", "index", index, on)
    };
    let derivatives = interface.states.iter().map(|s| entry(s.derivative));
    let initial = initial_unknowns(interface)
        .into_iter()
        .map(|index| initial_unknown(interface, "Unknown", "index", index));
    let lists = [
        Element::new("Outputs").children(interface.outputs().map(entry)),
        Element::new("Derivatives").children(derivatives),
        Element::new("InitialUnknowns").children(initial),
    ];
    Element::new("ModelStructure").children(lists.into_iter().filter(|list| !list.is_empty()))
}
