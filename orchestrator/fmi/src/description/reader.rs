//! Reads a `modelDescription.xml` of FMI 2.0 or 3.0.

use std::collections::HashMap;
use std::ops::Range;

use roxmltree::Node;

use super::attribute::{Remarks, at, child, children, needed, optional};
use super::structure::{Dependencies, DescriptionError};
use super::{Description, FmiVersion, Interface, Kind, Sizes, variables};

/// Reads the document. Structural parameters take the values in `sizes`, if given; `exchange`: model
/// exchange goes before co-simulation.
///
/// # Errors
/// The first place that makes the FMU unusable.
pub(super) fn read(
    root: Node,
    version: FmiVersion,
    sizes: &Sizes,
    exchange: bool,
) -> Result<Description, DescriptionError> {
    use FmiVersion::{V2, V3};
    let mut remarks = Remarks::default();
    let found = variables::read(root, version, sizes, &mut remarks)?;
    let mut variables = found.all;

    let structure = child(root, "ModelStructure");
    let (key, outputs, derivatives, indicators) = match version {
        V2 => {
            let list = |name| children(structure.and_then(|node| child(node, name)), "Unknown");
            let indicators = optional::<u32>(root, "numberOfEventIndicators")?;
            let indicators = indicators.unwrap_or(0) as usize;
            let (outputs, derivatives) = (list("Outputs"), list("Derivatives"));
            ("index", outputs, derivatives, indicators)
        }
        V3 if structure.is_none() => {
            return Err(at(root, "<ModelStructure> is missing".to_string()));
        }
        V3 => (
            "valueReference",
            children(structure, "Output"),
            children(structure, "ContinuousStateDerivative"),
            children(structure, "EventIndicator").count(),
        ),
    };
    let mut dependencies = Dependencies::default();
    for output in outputs {
        let elements = found.places.get(&needed(output, key)?);
        let elements = elements.ok_or_else(|| {
            let reason = "<ModelStructure> lists an output that is not among the variables";
            at(output, reason.to_string())
        })?;
        let known = optional::<Vec<u32>>(output, "dependencies")?.map(|all| {
            let all = all.iter().filter_map(|key| found.places.get(key));
            all.cloned().flatten().collect::<Vec<usize>>()
        });
        for element in elements.clone() {
            dependencies.note(&mut variables, element, known.clone());
        }
    }
    let pair = |place: &Range<usize>| {
        let rate = variables.get(place.start)?;
        let state = found.places.get(found.derivatives.get(&place.start)?)?;
        let is_scalar = !rate.is_element && rate.kind == Kind::Float64;
        is_scalar.then_some((variables.get(state.start)?.reference, rate.reference))
    };
    let pairs = derivatives
        .map(|rate| Ok(found.places.get(&needed(rate, key)?).and_then(pair)))
        .collect::<Result<Vec<Option<(u32, u32)>>, DescriptionError>>()?;

    let (interface, element) = interface(root, version, exchange)?;
    let flag = |name: &str| optional::<bool>(element, name).map(Option::unwrap_or_default);
    let third = |name: &str| Ok::<_, DescriptionError>(version == V3 && flag(name)?);
    let [token, saves, writes, directional] = match version {
        V2 => [
            "guid",
            "canGetAndSetFMUstate",
            "canSerializeFMUstate",
            "providesDirectionalDerivative",
        ],
        V3 => [
            "instantiationToken",
            "canGetAndSetFMUState",
            "canSerializeFMUState",
            "providesDirectionalDerivatives",
        ],
    };
    let steps = interface == Interface::CoSimulation;
    let internal_step = match version {
        V3 if steps => remarks.lenient(element, "fixedInternalStepSize"),
        _ => None,
    };
    let mut experiment = |name: &str| {
        let experiment = child(root, "DefaultExperiment")?;
        remarks.lenient::<f64>(experiment, name)
    };
    let is_length = |length: &f64| *length > 0.0 && length.is_finite();
    let stop = experiment("stopTime");
    let length = stop.map(|stop| stop - experiment("startTime").unwrap_or(0.0));
    let preferred_step = experiment("stepSize").filter(is_length);
    let text = |name: &str| root.attribute(name).unwrap_or("").to_string();
    let categories = children(child(root, "LogCategories"), "Category");
    Ok(Description {
        version,
        model_name: needed(root, "modelName")?,
        model_identifier: needed(element, "modelIdentifier")?,
        token: needed(root, token)?,
        about: text("description"),
        generation_tool: text("generationTool"),
        interface,
        has_event_mode: steps && third("hasEventMode")?,
        only_one_per_process: flag("canBeInstantiatedOnlyOncePerProcess")?,
        needs_execution_tool: flag("needsExecutionTool")?,
        log_categories: categories
            .filter_map(|category| category.attribute("name").map(str::to_string))
            .collect(),
        saves_state: flag(saves)?,
        writes_state: flag(writes)?,
        directional_derivatives: flag(directional)?,
        adjoint_derivatives: third("providesAdjointDerivatives")?,
        offers_model_exchange: child(root, "ModelExchange").is_some(),
        states: pairs.len(),
        // None as soon as one is not of scalars.
        state_pairs: pairs.into_iter().collect::<Option<_>>().unwrap_or_default(),
        event_indicators: indicators,
        preferred_step,
        default_stop: length.filter(is_length),
        variable_step: !steps || flag("canHandleVariableCommunicationStepSize")?,
        internal_step: internal_step.filter(is_length),
        variables,
        terminals: Vec::new(),
        input_clocks: found.clocks,
        remarks: remarks.0,
        positions: HashMap::new(),
        arrays: HashMap::new(),
    })
}

/// How the FMU is run, and the element that says so.
fn interface<'a>(
    root: Node<'a, 'a>,
    version: FmiVersion,
    exchange: bool,
) -> Result<(Interface, Node<'a, 'a>), DescriptionError> {
    let mut order = [
        (Interface::CoSimulation, "CoSimulation"),
        (Interface::ModelExchange, "ModelExchange"),
        (Interface::ScheduledExecution, "ScheduledExecution"),
    ];
    if exchange {
        order.swap(0, 1);
    }
    let (known, refusal) = match version {
        FmiVersion::V2 => (&order[..2], DescriptionError::NoInterface2),
        FmiVersion::V3 => (&order[..], DescriptionError::NoInterface3),
    };
    let mut known = known.iter();
    let found = known.find_map(|&(interface, name)| Some((interface, child(root, name)?)));
    found.ok_or(refusal)
}
