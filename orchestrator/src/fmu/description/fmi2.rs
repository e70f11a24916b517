//! `modelDescription.xml` of FMI 2.0.

use std::collections::HashMap;

use fmi_rs::model_description::fmi2;

use super::{
    Causality, Description, FmiVersion, Item, Kind, Variability, Variable, depend, preferred_step,
};

/// Reads the text.
pub(super) fn read(text: &str) -> Result<Description, String> {
    let file = fmi2::ModelDescription::from_string(text).map_err(|error| error.to_string())?;
    let Some(interface) = &file.coSimulation else {
        return Err("no <CoSimulation>: the FMU offers model exchange only".to_string());
    };
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    for variable in &file.modelVariables {
        use fmi2::{Causality as C, Variability as V, VariableType as T};
        let items = |declared: &str| match file.get_type_definition(declared) {
            Some(fmi2::SimpleType::Enumeration { items, .. }) => items
                .iter()
                .map(|item| Item {
                    name: item.name.clone(),
                    value: i64::from(item.value),
                    description: item.description.clone().unwrap_or_default(),
                })
                .collect(),
            _ => Vec::new(),
        };
        let display_unit = match &variable.variableType {
            T::Real { displayUnit, .. } => displayUnit.clone(),
            _ => None,
        };
        variables.push(Variable {
            name: variable.name.clone(),
            reference: variable.valueReference,
            kind: match &variable.variableType {
                T::Real { .. } => Kind::Float64,
                T::Integer { .. } => Kind::Int32,
                T::Boolean { .. } => Kind::Boolean,
                T::String { .. } => Kind::String,
                T::Enumeration { declaredType, .. } => Kind::Enumeration(items(declaredType)),
            },
            causality: match variable.causality {
                C::Parameter => Causality::Parameter,
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
            start: variable.variableType.start().clone(),
            description: variable.description.clone().unwrap_or_default(),
            dependencies: Vec::new(),
        });
    }
    for output in &file.outputs {
        // Counted from 1 by position.
        let known = output.dependencies.as_ref();
        let known = known.map(|all| all.iter().map(|&index| index.wrapping_sub(1) as usize));
        depend(&mut variables, output.index.wrapping_sub(1) as usize, known)?;
    }
    let remarks = file.validate().into_iter().map(|problem| problem.message);
    Ok(Description {
        version: FmiVersion::V2,
        model_identifier: interface.modelIdentifier.clone(),
        saves_state: interface.canGetAndSetFMUstate,
        variable_step: interface.canHandleVariableCommunicationStepSize,
        offers_model_exchange: file.modelExchange.is_some(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        remarks: remarks.collect(),
        model_name: file.modelName,
        token: file.guid,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
    })
}
