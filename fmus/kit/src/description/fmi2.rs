//! `modelDescription.xml` of FMI 2.0.
//!
//! The optional variable `time` is left out, and variables are identified in the model structure
//! by their position, which is their value reference, too.

use super::{
    default_experiment, described, enumerations, initial_unknown, initial_unknowns, items,
    log_categories, range, root, start, token, unit_definitions, unknown, xml::Element,
};
use crate::{
    component::Component,
    model::Model,
    variable::{Access, Causality, Variable},
};

/// The model description of FMI 2.0.
pub fn fmi2<C: Component>(model: &Model<C>) -> String {
    let mut root = root::<C>("2.0", "guid", token(model));
    if model.offers_model_exchange() {
        root = root
            .attribute("numberOfEventIndicators", C::EVENT_INDICATORS)
            .child(
                abilities::<C>("ModelExchange").attribute("completedIntegratorStepNotNeeded", true),
            );
    }
    let mut types = Element::new("TypeDefinitions");
    for choices in enumerations(model) {
        types = types.child(
            Element::new("SimpleType")
                .attribute("name", choices.name)
                .child(items(Element::new("Enumeration"), &choices)),
        );
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
        Element::new("ModelVariables").children(
            model
                .variables
                .iter()
                .enumerate()
                .map(|(i, v)| scalar(model, i, v)),
        ),
    )
    .child(structure(model))
    .document()
}

fn abilities<C: Component>(name: &str) -> Element {
    Element::new(name)
        .attribute("modelIdentifier", C::NAME)
        .attribute("canNotUseMemoryManagementFunctions", true)
        .attribute("canGetAndSetFMUstate", true)
        .attribute("canSerializeFMUstate", true)
        .attribute("providesDirectionalDerivative", C::PARTIAL_DERIVATIVES)
}

fn scalar<C: Component>(model: &Model<C>, index: usize, variable: &Variable<C>) -> Element {
    let typed = match &variable.access {
        Access::Real(_) | Access::Within(_) | Access::Element(..) => Element::new("Real")
            .optional("unit", variable.unit)
            .optional("displayUnit", variable.display_unit),
        Access::Integer(_) => Element::new("Integer"),
        Access::Boolean(_) => Element::new("Boolean"),
        Access::Text(_) => Element::new("String"),
        Access::Choice(_, choices) => {
            Element::new("Enumeration").attribute("declaredType", choices.name)
        }
    };
    let state = model.state_of(index).map(|state| state + 1);
    described("ScalarVariable", index, variable).child(
        range(variable, typed)
            .optional("start", start(variable))
            .optional("derivative", state),
    )
}

fn structure<C: Component>(model: &Model<C>) -> Element {
    let entry = |index: usize| {
        unknown(
            "Unknown",
            "index",
            index,
            model.dependencies[index].iter().copied(),
        )
    };
    let outputs = (0..model.variables.len())
        .filter(|i| model.variables[*i].causality == Causality::Output)
        .map(entry);
    let derivatives = model.states.iter().map(|s| entry(s.derivative));
    let initial = initial_unknowns(model)
        .into_iter()
        .map(|index| initial_unknown(model, "Unknown", "index", index));
    let lists = [
        Element::new("Outputs").children(outputs),
        Element::new("Derivatives").children(derivatives),
        Element::new("InitialUnknowns").children(initial),
    ];
    Element::new("ModelStructure").children(lists.into_iter().filter(|list| !list.is_empty()))
}
