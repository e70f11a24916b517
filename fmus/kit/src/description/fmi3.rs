//! `modelDescription.xml` of FMI 3.0.

use super::{
    Interface, default_experiment, described, enumerations, initial_unknown, initial_unknowns,
    items, log_categories, range, root, start, unit_definitions, unknown, xml::Element,
};
use crate::variable::{Row, Type};

/// The model description of FMI 3.0 with a token.
pub(super) fn text(interface: &Interface, token: &str) -> String {
    let mut root = root(interface, "3.0", "instantiationToken", token);
    if interface.offers_model_exchange() {
        root = root.child(abilities(interface, "ModelExchange"));
    }
    let mut types = Element::new("TypeDefinitions");
    for choices in enumerations(&interface.rows) {
        types = types.child(items(
            Element::new("EnumerationType").attribute("name", choices.name),
            &choices,
        ));
    }
    let rows = interface.rows.iter().enumerate();
    let co_simulation = abilities(interface, "CoSimulation")
        .attribute(
            "canHandleVariableCommunicationStepSize",
            interface.any_step_size,
        )
        .optional(
            "fixedInternalStepSize",
            (!interface.any_step_size).then_some(interface.step_size),
        );
    root.child(co_simulation)
        .children(unit_definitions(&interface.rows))
        .children((!types.is_empty()).then_some(types))
        .child(log_categories())
        .child(default_experiment(interface))
        .child(
            Element::new("ModelVariables")
                .child(
                    Element::new("Float64")
                        .attribute("name", "time")
                        .attribute("valueReference", 0)
                        .attribute("description", "Simulation time")
                        .attribute("causality", "independent")
                        .attribute("variability", "continuous")
                        .attribute("unit", "s"),
                )
                .children(rows.map(|(i, row)| typed(interface, i, row))),
        )
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
        .attribute("canGetAndSetFMUState", interface.saves_state)
        .attribute("canSerializeFMUState", interface.saves_state)
        .attribute(
            "providesDirectionalDerivatives",
            interface.partial_derivatives,
        )
        .attribute("providesAdjointDerivatives", interface.partial_derivatives)
}

fn typed(interface: &Interface, index: usize, row: &Row) -> Element {
    let mut element = described(row.kind.name(), index, row.declaration)
        .optional("unit", row.declaration.unit)
        .optional("displayUnit", row.declaration.display_unit);
    if let Type::Choice(choices) = row.kind {
        element = element.attribute("declaredType", choices.name);
    }
    element = range(row, element).optional("derivative", interface.state_of(index));
    match (row.kind, start(row)) {
        (Type::Text, Some(text)) => element.child(Element::new("Start").attribute("value", text)),
        (_, start) => element.optional("start", start),
    }
}

fn structure(interface: &Interface) -> Element {
    let entry = |element: &str, index: usize| {
        let on = interface.dependencies[index].iter().copied();
        unknown(element, "valueReference", index, on)
    };
    let outputs = interface.outputs().map(|i| entry("Output", i));
    let derivatives = interface
        .states
        .iter()
        .map(|s| entry("ContinuousStateDerivative", s.derivative));
    let initial = initial_unknowns(interface)
        .into_iter()
        .map(|index| initial_unknown(interface, "InitialUnknown", "valueReference", index));
    Element::new("ModelStructure")
        .children(outputs)
        .children(derivatives)
        .children(initial)
}
