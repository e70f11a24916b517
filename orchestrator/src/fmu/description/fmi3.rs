//! `modelDescription.xml` of FMI 3.0.

use std::collections::HashMap;

use fmi_rs::model_description::fmi3;

use super::{
    Causality, Description, FmiVersion, Item, Kind, Variability, Variable, depend, preferred_step,
};

/// Reads the text.
pub(super) fn read(text: &str) -> Result<Description, String> {
    let file = fmi3::ModelDescription::from_string(text).map_err(|error| error.to_string())?;
    let Some(interface) = &file.coSimulation else {
        return Err("no <CoSimulation>: the FMU does not offer co-simulation".to_string());
    };
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    for variable in &file.modelVariables {
        use fmi3::{Causality as C, Variability as V, VariableType as T};
        let items = |declared: &str| match file.get_type_definition(declared) {
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
        let display_unit = match &variable.variableType {
            T::Float64 { displayUnit, .. } => displayUnit.clone(),
            _ => None,
        };
        variables.push(Variable {
            name: variable.name.clone(),
            reference: variable.valueReference,
            kind: match &variable.variableType {
                other if !variable.dimensions.is_empty() => {
                    Kind::Other(format!("array of {}", other.name()))
                }
                T::Float64 { .. } => Kind::Float64,
                T::Int32 { .. } => Kind::Int32,
                T::Boolean { .. } => Kind::Boolean,
                T::String { .. } => Kind::String,
                T::Enumeration { declaredType, .. } => Kind::Enumeration(items(declaredType)),
                other => Kind::Other(other.name().to_string()),
            },
            causality: match variable.causality {
                C::Parameter | C::StructuralParameter => Causality::Parameter,
                C::Input => Causality::Input,
                C::Output => Causality::Output,
                _ => Causality::Local,
            },
            variability: match variable.variability {
                V::Constant | V::Fixed => Variability::Fixed,
                V::Tunable => Variability::Tunable,
                V::Discrete => Variability::Discrete,
                V::Continuous => Variability::Continuous,
            },
            unit: file.get_unit(variable).map(str::to_string),
            display_unit,
            start: variable.variableType.start().map(|all| all.join(" ")),
            description: variable.description.clone().unwrap_or_default(),
            dependencies: Vec::new(),
        });
    }
    let positions: HashMap<u32, usize> = (0..variables.len())
        .map(|index| (variables[index].reference, index))
        .collect();
    let position = |reference: u32| positions.get(&reference).copied().unwrap_or(usize::MAX);
    for output in &file.outputs {
        let known = output.dependencies.as_ref();
        let known = known.map(|all| all.iter().map(|&reference| position(reference)));
        depend(&mut variables, position(output.valueReference), known)?;
    }
    let remarks = file.validate().into_iter().map(|problem| problem.message);
    Ok(Description {
        version: FmiVersion::V3,
        model_identifier: interface.modelIdentifier.clone(),
        saves_state: interface.canGetAndSetFMUState,
        variable_step: interface.canHandleVariableCommunicationStepSize,
        offers_model_exchange: file.modelExchange.is_some(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        remarks: remarks.collect(),
        model_name: file.modelName,
        token: file.instantiationToken,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
    })
}
