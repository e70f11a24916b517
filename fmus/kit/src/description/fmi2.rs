//! `modelDescription.xml` of FMI 2.0.
//!
//! The optional variable `time` is left out, and variables are identified in the model structure
//! by their position, which is their value reference, too.

use super::{
    causality, default_experiment, enumerations, initial, initial_unknown, initial_unknowns, items,
    log_categories, range, start, token, unit_definitions, unknown, variability, xml::Element,
};
use crate::{
    component::Component,
    model::Model,
    variable::{Access, Causality, Variable},
};

/// The model description of FMI 2.0.
pub fn fmi2<C: Component>(model: &Model<C>) -> String {
    let mut root = Element::new("fmiModelDescription")
        .attribute("fmiVersion", "2.0")
        .attribute("modelName", C::NAME)
        .attribute("guid", token(model))
        .attribute("description", C::DESCRIPTION)
        .attribute("version", C::VERSION)
        .attribute("license", env!("CARGO_PKG_LICENSE"))
        .attribute(
            "generationTool",
            concat!("fmu-kit ", env!("CARGO_PKG_VERSION")),
        )
        .attribute("variableNamingConvention", "structured");
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
    let state = model
        .states
        .iter()
        .find(|s| s.derivative == index)
        .map(|s| s.state + 1);
    Element::new("ScalarVariable")
        .attribute("name", &variable.name)
        .attribute("valueReference", index + 1)
        .attribute("description", &variable.description)
        .attribute("causality", causality(variable.causality))
        .attribute("variability", variability(variable.variability))
        .optional("initial", initial(variable))
        .child(
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
