//! `modelDescription.xml` of FMI 3.0.

use super::{
    default_experiment, described, enumerations, initial_unknown, initial_unknowns, items,
    log_categories, range, root, start, token, unit_definitions, unknown, xml::Element,
};
use crate::{
    component::Component,
    model::Model,
    variable::{Access, Causality, Variable},
};

/// The model description of FMI 3.0.
pub fn fmi3<C: Component>(model: &Model<C>) -> String {
    with_token(model, token(model))
}

/// The same with any token.
pub(super) fn with_token<C: Component>(model: &Model<C>, token: &str) -> String {
    let mut root = root::<C>("3.0", "instantiationToken", token);
    if model.offers_model_exchange() {
        root = root.child(abilities::<C>("ModelExchange"));
    }
    let mut types = Element::new("TypeDefinitions");
    for choices in enumerations(model) {
        types = types.child(items(
            Element::new("EnumerationType").attribute("name", choices.name),
            &choices,
        ));
    }
    root.child(
        abilities::<C>("CoSimulation")
            .attribute("canHandleVariableCommunicationStepSize", C::ANY_STEP_SIZE),
    )
    .children(unit_definitions(model))
    .children((!types.is_empty()).then_some(types))
    .child(log_categories())
    .child(default_experiment::<C>())
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
            .children(
                model
                    .variables
                    .iter()
                    .enumerate()
                    .map(|(i, v)| typed(model, i, v)),
            ),
    )
    .child(structure(model))
    .document()
}

fn abilities<C: Component>(name: &str) -> Element {
    Element::new(name)
        .attribute("modelIdentifier", C::NAME)
        .attribute("canGetAndSetFMUState", true)
        .attribute("canSerializeFMUState", true)
        .attribute("providesDirectionalDerivatives", C::PARTIAL_DERIVATIVES)
        .attribute("providesAdjointDerivatives", C::PARTIAL_DERIVATIVES)
}

fn typed<C: Component>(model: &Model<C>, index: usize, variable: &Variable<C>) -> Element {
    let state = model.state_of(index).map(|state| state + 1);
    let mut element = described(variable.access.type_name(), index, variable)
        .optional("unit", variable.unit)
        .optional("displayUnit", variable.display_unit);
    if let Access::Choice(_, choices) = &variable.access {
        element = element.attribute("declaredType", choices.name);
    }
    element = range(variable, element).optional("derivative", state);
    match (&variable.access, start(variable)) {
        (Access::Text(_), Some(text)) => {
            element.child(Element::new("Start").attribute("value", text))
        }
        (_, start) => element.optional("start", start),
    }
}

fn structure<C: Component>(model: &Model<C>) -> Element {
    let entry = |element: &str, index: usize| {
        unknown(
            element,
            "valueReference",
            index,
            model.dependencies[index].iter().copied(),
        )
    };
    let outputs = (0..model.variables.len())
        .filter(|i| model.variables[*i].causality == Causality::Output)
        .map(|i| entry("Output", i));
    let derivatives = model
        .states
        .iter()
        .map(|s| entry("ContinuousStateDerivative", s.derivative));
    let initial = initial_unknowns(model)
        .into_iter()
        .map(|index| initial_unknown(model, "InitialUnknown", "valueReference", index));
    Element::new("ModelStructure")
        .children(outputs)
        .children(derivatives)
        .children(initial)
}
