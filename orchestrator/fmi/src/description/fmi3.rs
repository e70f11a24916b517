//! `modelDescription.xml` of FMI 3.0.

use std::collections::HashMap;

use fmi_rs::model_description::fmi3;
use roxmltree::Node;

use super::structure::{Dependencies, DescriptionError, MOST_ELEMENTS, element_names, units};
use super::{
    BaseUnit, Causality, Description, FmiVersion, InputClock, Interface, Item, Kind, Sizes, Ticks,
    Variability, Variable, default_stop, preferred_step,
};

/// Reads the text; structural parameters take the values in `sizes`, if given. `exchange`: model exchange
/// goes before co-simulation.
pub(super) fn read(
    text: &str,
    root: Node,
    sizes: &Sizes,
    exchange: bool,
) -> Result<Description, DescriptionError> {
    let file = fmi3::ModelDescription::from_string(text)?;
    let types: HashMap<&str, &fmi3::TypeDefinition> = file
        .typeDefinitions
        .iter()
        .map(|known| (known.name(), known))
        .collect();
    let units = units(root);
    let structural: HashMap<u32, &fmi3::ModelVariable> = file
        .modelVariables
        .iter()
        .filter(|variable| variable.causality == fmi3::Causality::StructuralParameter)
        .map(|variable| (variable.valueReference, variable))
        .collect();
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    // The elements of each variable, by value reference.
    let mut places: HashMap<u32, std::ops::Range<usize>> = HashMap::new();
    for variable in &file.modelVariables {
        let mut dimensions = Vec::new();
        for dimension in &variable.dimensions {
            dimensions.push(match dimension {
                fmi3::Dimension::Fixed { start } => *start,
                fmi3::Dimension::Variable { valueReference } => {
                    size(&variable.name, *valueReference, &structural, sizes)?
                }
            });
        }
        let count = dimensions
            .iter()
            .try_fold(1_usize, |a, &b| a.checked_mul(b));
        let count = count.filter(|count| variables.len() + count <= MOST_ELEMENTS);
        let Some(count) = count else {
            return Err(DescriptionError::Elements);
        };
        let first = variables.len();
        let one = scalar(variable, &types, &units);
        let starts = starts(variable, count);
        if dimensions.is_empty() {
            let start = starts.into_iter().next().flatten();
            variables.push(Variable { start, ..one });
        } else {
            let names = element_names(&variable.name, &dimensions);
            for (at, (name, start)) in names.into_iter().zip(starts).enumerate() {
                variables.push(Variable {
                    name,
                    start,
                    element: (at, count),
                    is_element: true,
                    ..one.clone()
                });
            }
        }
        places.insert(variable.valueReference, first..variables.len());
    }
    let position = |reference: u32| places.get(&reference).cloned();
    let mut dependencies = Dependencies::default();
    for output in &file.outputs {
        let known: Option<Vec<usize>> = output.dependencies.as_ref().map(|all| {
            let all = all.iter().filter_map(|&reference| position(reference));
            all.flatten().collect()
        });
        let elements = position(output.valueReference).unwrap_or(usize::MAX - 1..usize::MAX);
        for element in elements {
            dependencies.note(&mut variables, element, known.clone())?;
        }
    }
    let remarks = file
        .validate()
        .into_iter()
        .map(|problem| problem.message)
        .collect();
    let wants_exchange = exchange;
    let exchange = file.modelExchange.as_ref();
    let steps = file.coSimulation.as_ref();
    let steps = steps.filter(|_| !wants_exchange || exchange.is_none());
    let scheduled = file.scheduledExecution.as_ref();
    let identifier = steps
        .map(|it| &it.modelIdentifier)
        .or(exchange.map(|it| &it.modelIdentifier))
        .or(scheduled.map(|it| &it.modelIdentifier));
    let Some(identifier) = identifier else {
        return Err(DescriptionError::NoInterface3);
    };
    let flag = |co: fn(&fmi3::CoSimulation) -> bool, me: fn(&fmi3::ModelExchange) -> bool| {
        steps.map(co).or(exchange.map(me)).unwrap_or(false)
    };
    Ok(Description {
        version: FmiVersion::V3,
        model_identifier: identifier.clone(),
        interface: match (steps, exchange) {
            (Some(_), _) => Interface::CoSimulation,
            (None, Some(_)) => Interface::ModelExchange,
            (None, None) => Interface::ScheduledExecution,
        },
        has_event_mode: steps.is_some_and(|it| it.hasEventMode),
        only_one_per_process: flag(
            |it| it.canBeInstantiatedOnlyOncePerProcess,
            |it| it.canBeInstantiatedOnlyOncePerProcess,
        ),
        needs_execution_tool: flag(|it| it.needsExecutionTool, |it| it.needsExecutionTool),
        log_categories: file.logCategories.iter().map(|c| c.name.clone()).collect(),
        saves_state: flag(|it| it.canGetAndSetFMUState, |it| it.canGetAndSetFMUState),
        writes_state: flag(|it| it.canSerializeFMUState, |it| it.canSerializeFMUState),
        directional_derivatives: flag(
            |it| it.providesDirectionalDerivatives,
            |it| it.providesDirectionalDerivatives,
        ),
        adjoint_derivatives: flag(
            |it| it.providesAdjointDerivatives,
            |it| it.providesAdjointDerivatives,
        ),
        variable_step: steps.is_none_or(|it| it.canHandleVariableCommunicationStepSize),
        internal_step: steps
            .and_then(|it| it.fixedInternalStepSize.as_ref()?.parse().ok())
            .filter(|step: &f64| *step > 0.0 && step.is_finite()),
        offers_model_exchange: exchange.is_some(),
        input_clocks: input_clocks(&file.modelVariables),
        event_indicators: file.eventIndicators.len(),
        states: file.derivatives.len(),
        terminals: Vec::new(),
        state_pairs: state_pairs(&file).unwrap_or_default(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        default_stop: default_stop(file.defaultExperiment.as_ref()),
        remarks,
        model_name: file.modelName,
        token: file.instantiationToken,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
        arrays: HashMap::new(),
    })
}

/// States and their derivatives, all of them scalar Float64; none where one is not.
fn state_pairs(file: &fmi3::ModelDescription) -> Option<Vec<(u32, u32)>> {
    let variables: HashMap<u32, &fmi3::ModelVariable> = file
        .modelVariables
        .iter()
        .map(|variable| (variable.valueReference, variable))
        .collect();
    let pair = |unknown: &fmi3::Unknown| {
        let derivative = variables.get(&unknown.valueReference)?;
        let state = derivative.variableType.derivative()?;
        let is_scalar = derivative.dimensions.is_empty();
        let is_real = matches!(derivative.variableType, fmi3::VariableType::Float64 { .. });
        (is_scalar && is_real).then_some((state, unknown.valueReference))
    };
    file.derivatives.iter().map(pair).collect()
}

/// Clocks that are inputs, those of the highest priority (the lowest number) first.
fn input_clocks(variables: &[fmi3::ModelVariable]) -> Vec<InputClock> {
    use fmi3::IntervalVariability as V;
    let clocks = variables
        .iter()
        .filter(|variable| variable.causality == fmi3::Causality::Input);
    let mut clocks: Vec<(u32, InputClock)> = clocks
        .filter_map(|variable| {
            let fmi3::VariableType::Clock {
                priority,
                intervalVariability,
                intervalDecimal,
                shiftDecimal,
                resolution,
                intervalCounter,
                shiftCounter,
                ..
            } = &variable.variableType
            else {
                return None;
            };
            let seconds =
                |count: u64| resolution.map(|per_second| count as f64 / per_second as f64);
            let interval = intervalDecimal.or(intervalCounter.and_then(seconds));
            let shift = match *shiftCounter {
                0 => *shiftDecimal,
                count => seconds(count).unwrap_or(*shiftDecimal),
            };
            let clock = InputClock {
                name: variable.name.clone(),
                reference: variable.valueReference,
                ticks: match intervalVariability {
                    V::Constant | V::Fixed => Ticks::Periodic(interval),
                    V::Tunable => Ticks::Periodic(None),
                    V::Changing => Ticks::Changing,
                    V::Countdown => Ticks::Countdown,
                    V::Triggered => Ticks::Triggered,
                },
                shift,
            };
            Some((priority.unwrap_or(u32::MAX), clock))
        })
        .collect();
    clocks.sort_by_key(|(priority, _)| *priority);
    clocks.into_iter().map(|(_, clock)| clock).collect()
}

/// The value of the structural parameter `reference`, which is a size of the array of that name.
fn size(
    array: &str,
    reference: u32,
    structural: &HashMap<u32, &fmi3::ModelVariable>,
    sizes: &Sizes,
) -> Result<usize, DescriptionError> {
    let variable = structural.get(&reference);
    let array = || array.to_string();
    let variable = variable.ok_or_else(|| DescriptionError::NotStructural { array: array() })?;
    let size = match sizes.get(&reference) {
        Some(&size) => size,
        None => {
            let start = variable.variableType.start().unwrap_or_default();
            let start = start.first().and_then(|text| text.parse().ok());
            start.ok_or_else(|| DescriptionError::NoSize {
                array: array(),
                size: variable.name.clone(),
            })?
        }
    };
    usize::try_from(size).map_err(|_| DescriptionError::Size {
        array: array(),
        size,
    })
}

/// Start values of the elements; one value stands for all.
fn starts(variable: &fmi3::ModelVariable, count: usize) -> Vec<Option<String>> {
    let written = variable.variableType.start().unwrap_or_default();
    match written.as_slice() {
        [one] => vec![Some(one.clone()); count],
        all if all.len() == count => all.iter().cloned().map(Some).collect(),
        _ => vec![None; count],
    }
}

/// The smallest and the largest value of a real variable, its own or its type's.
fn bounds(
    kind: &fmi3::VariableType,
    types: &HashMap<&str, &fmi3::TypeDefinition>,
) -> [Option<f64>; 2] {
    use fmi3::{TypeDefinition as D, VariableType as T};
    let (own, declared) = match kind {
        T::Float32 {
            min,
            max,
            declaredType,
            ..
        } => ([min.map(f64::from), max.map(f64::from)], declaredType),
        T::Float64 {
            min,
            max,
            declaredType,
            ..
        } => ([*min, *max], declaredType),
        _ => return [None; 2],
    };
    let of_type = match declared.as_deref().and_then(|name| types.get(name)) {
        Some(D::Float32 { min, max, .. }) => [min.map(f64::from), max.map(f64::from)],
        Some(D::Float64 { min, max, .. }) => [*min, *max],
        _ => [None; 2],
    };
    [own[0].or(of_type[0]), own[1].or(of_type[1])]
}

/// A variable without its start value and elements.
fn scalar(
    variable: &fmi3::ModelVariable,
    types: &HashMap<&str, &fmi3::TypeDefinition>,
    units: &HashMap<&str, BaseUnit>,
) -> Variable {
    use fmi3::{Causality as C, Initial as I, Variability as V, VariableType as T};
    let items = |declared: &str| match types.get(declared) {
        Some(fmi3::TypeDefinition::Enumeration { items, .. }) => items
            .iter()
            .map(|item| Item {
                name: item.name.clone(),
                value: item.value,
                description: item.description.clone().unwrap_or_default(),
            })
            .collect(),
        _ => Vec::new(),
    };
    let (mut unit, mut display_unit, mut is_relative) = (None, None, false);
    if let T::Float32 {
        unit: own,
        displayUnit,
        declaredType,
        relativeQuantity,
        ..
    }
    | T::Float64 {
        unit: own,
        displayUnit,
        declaredType,
        relativeQuantity,
        ..
    } = &variable.variableType
    {
        (unit, display_unit, is_relative) = (own.clone(), displayUnit.clone(), *relativeQuantity);
        if let Some(
            fmi3::TypeDefinition::Float32 {
                unit: declared,
                displayUnit,
                relativeQuantity,
                ..
            }
            | fmi3::TypeDefinition::Float64 {
                unit: declared,
                displayUnit,
                relativeQuantity,
                ..
            },
        ) = declaredType.as_deref().and_then(|name| types.get(name))
        {
            unit = unit.or(declared.clone());
            display_unit = display_unit.or(displayUnit.clone());
            is_relative |= relativeQuantity;
        }
    }
    let is_exact = match variable.initial {
        Some(I::Exact | I::Approx) => true,
        Some(I::Calculated) => false,
        None => variable.variableType.has_start(),
    };
    Variable {
        name: variable.name.clone(),
        reference: variable.valueReference,
        kind: match &variable.variableType {
            T::Float64 { .. } => Kind::Float64,
            T::Float32 { .. } => Kind::Float32,
            T::Int8 { .. } => Kind::Int8,
            T::UInt8 { .. } => Kind::UInt8,
            T::Int16 { .. } => Kind::Int16,
            T::UInt16 { .. } => Kind::UInt16,
            T::Int32 { .. } => Kind::Int32,
            T::UInt32 { .. } => Kind::UInt32,
            T::Int64 { .. } => Kind::Int64,
            T::UInt64 { .. } => Kind::UInt64,
            T::Boolean { .. } => Kind::Boolean,
            T::String { .. } => Kind::String,
            T::Binary { .. } => Kind::Binary,
            T::Clock { .. } => Kind::Clock,
            T::Enumeration { declaredType, .. } => Kind::Enumeration(items(declaredType)),
        },
        causality: match variable.causality {
            C::Parameter | C::StructuralParameter => Causality::Parameter,
            C::Input => Causality::Input,
            C::Output => Causality::Output,
            _ => Causality::Local,
        },
        is_settable: variable.variability != V::Constant
            && variable.causality != C::Independent
            && (variable.causality == C::Input || is_exact),
        is_structural: variable.causality == C::StructuralParameter,
        variability: match variable.variability {
            V::Constant | V::Fixed => Variability::Fixed,
            V::Tunable => Variability::Tunable,
            V::Discrete => Variability::Discrete,
            V::Continuous => Variability::Continuous,
        },
        base_unit: unit
            .as_deref()
            .and_then(|unit| units.get(unit))
            .map(|base| base.of_variable(is_relative)),
        unit,
        display_unit,
        bounds: bounds(&variable.variableType, types),
        start: None,
        clocks: variable.clocks.clone(),
        element: (0, 1),
        is_element: false,
        description: variable.description.clone().unwrap_or_default(),
        dependencies: [].into(),
    }
}
