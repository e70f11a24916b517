//! `modelDescription.xml` of FMI 2.0.

use std::collections::HashMap;

use fmi_rs::model_description::fmi2;
use roxmltree::Node;

use super::structure::{Dependencies, DescriptionError, units};
use super::{
    Causality, Description, FmiVersion, Interface, Item, Kind, Variability, Variable, default_stop,
    preferred_step,
};

/// Declared types by name: the element of each that says its kind. `fmi-rs` reads only the first type.
fn types<'a>(root: Node<'a, 'a>) -> HashMap<&'a str, Node<'a, 'a>> {
    root.children()
        .filter(|node| node.has_tag_name("TypeDefinitions"))
        .flat_map(|node| node.children())
        .filter(|node| node.has_tag_name("SimpleType"))
        .filter_map(|node| Some((node.attribute("name")?, node.first_element_child()?)))
        .collect()
}

/// Choices of a type; none where it is not an enumeration.
fn items(declared: &Node) -> Vec<Item> {
    let items = declared.children().filter(|node| node.has_tag_name("Item"));
    items
        .filter_map(|item| {
            Some(Item {
                name: item.attribute("name")?.to_string(),
                value: item.attribute("value")?.parse().ok()?,
                description: item.attribute("description").unwrap_or("").to_string(),
            })
        })
        .collect()
}

/// Reads the text; `exchange`: model exchange goes before co-simulation.
pub(super) fn read(
    text: &str,
    root: Node,
    exchange: bool,
) -> Result<Description, DescriptionError> {
    let file = fmi2::ModelDescription::from_string(text)?;
    let types = types(root);
    let units = units(root);
    let mut variables = Vec::with_capacity(file.modelVariables.len());
    for variable in &file.modelVariables {
        use fmi2::{Causality as C, Initial as I, Variability as V, VariableType as T};
        let (mut unit, mut display_unit, mut is_relative) = (None, None, false);
        let mut bounds = [None; 2];
        if let T::Real {
            unit: own,
            displayUnit,
            declaredType,
            relativeQuantity,
            min,
            max,
            ..
        } = &variable.variableType
        {
            let number = |text: Option<&str>| text?.trim().parse::<f64>().ok();
            bounds = [min, max].map(|own| number(own.as_deref()));
            (unit, display_unit, is_relative) =
                (own.clone(), displayUnit.clone(), *relativeQuantity);
            if let Some(declared) = declaredType.as_deref().and_then(|name| types.get(name)) {
                let text = |name| declared.attribute(name).map(str::to_string);
                unit = unit.or_else(|| text("unit"));
                display_unit = display_unit.or_else(|| text("displayUnit"));
                is_relative |= matches!(declared.attribute("relativeQuantity"), Some("true" | "1"));
                let declared = ["min", "max"].map(|name| number(declared.attribute(name)));
                bounds = [0, 1].map(|side: usize| bounds[side].or(declared[side]));
            }
        }
        let start = variable.variableType.start().clone();
        let is_exact = match variable.initial {
            Some(I::Exact | I::Approx) => true,
            Some(I::Calculated) => false,
            None => start.is_some(),
        };
        variables.push(Variable {
            name: variable.name.clone(),
            reference: variable.valueReference,
            kind: match &variable.variableType {
                T::Real { .. } => Kind::Float64,
                T::Integer { .. } => Kind::Int32,
                T::Boolean { .. } => Kind::Boolean,
                T::String { .. } => Kind::String,
                T::Enumeration { declaredType, .. } => Kind::Enumeration(
                    types
                        .get(declaredType.as_str())
                        .map_or_else(Vec::new, items),
                ),
            },
            causality: match variable.causality {
                C::Parameter => Causality::Parameter,
                C::Input => Causality::Input,
                C::Output => Causality::Output,
                _ => Causality::Local,
            },
            is_settable: variable.variability != V::Constant
                && variable.causality != C::Independent
                && (variable.causality == C::Input || is_exact),
            is_structural: false,
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
            bounds,
            start,
            clocks: Vec::new(),
            element: (0, 1),
            is_element: false,
            description: variable.description.clone().unwrap_or_default(),
            dependencies: [].into(),
        });
    }
    let mut dependencies = Dependencies::default();
    for output in &file.outputs {
        // Counted from 1 by position.
        let known = output.dependencies.as_ref();
        let known = known.map(|all| all.iter().map(|&index| index.wrapping_sub(1) as usize));
        let known = known.map(Iterator::collect);
        dependencies.note(&mut variables, output.index.wrapping_sub(1) as usize, known)?;
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
    let Some(model_identifier) = steps
        .map(|it| &it.modelIdentifier)
        .or(exchange.map(|it| &it.modelIdentifier))
    else {
        return Err(DescriptionError::NoInterface2);
    };
    let flag = |co: fn(&fmi2::CoSimulation) -> bool, me: fn(&fmi2::ModelExchange) -> bool| {
        steps.map(co).or(exchange.map(me)).unwrap_or(false)
    };
    Ok(Description {
        version: FmiVersion::V2,
        model_identifier: model_identifier.clone(),
        interface: match steps {
            Some(_) => Interface::CoSimulation,
            None => Interface::ModelExchange,
        },
        has_event_mode: false,
        only_one_per_process: flag(
            |it| it.canBeInstantiatedOnlyOncePerProcess,
            |it| it.canBeInstantiatedOnlyOncePerProcess,
        ),
        needs_execution_tool: flag(|it| it.needsExecutionTool, |it| it.needsExecutionTool),
        log_categories: file.logCategories.iter().map(|c| c.name.clone()).collect(),
        saves_state: flag(|it| it.canGetAndSetFMUstate, |it| it.canGetAndSetFMUstate),
        writes_state: flag(|it| it.canSerializeFMUstate, |it| it.canSerializeFMUstate),
        directional_derivatives: flag(
            |it| it.providesDirectionalDerivative,
            |it| it.providesDirectionalDerivative,
        ),
        adjoint_derivatives: false,
        variable_step: steps.is_none_or(|it| it.canHandleVariableCommunicationStepSize),
        internal_step: None,
        input_clocks: Vec::new(),
        offers_model_exchange: exchange.is_some(),
        event_indicators: file.numberOfEventIndicators as usize,
        states: file.derivatives.len(),
        terminals: Vec::new(),
        state_pairs: state_pairs(&file).unwrap_or_default(),
        preferred_step: preferred_step(file.defaultExperiment.as_ref()),
        default_stop: default_stop(file.defaultExperiment.as_ref()),
        remarks,
        model_name: file.modelName,
        token: file.guid,
        about: file.description.unwrap_or_default(),
        generation_tool: file.generationTool.unwrap_or_default(),
        variables,
        positions: HashMap::new(),
        arrays: HashMap::new(),
    })
}

/// States and their derivatives; none where one is not told.
fn state_pairs(file: &fmi2::ModelDescription) -> Option<Vec<(u32, u32)>> {
    // Counted from 1 by position.
    let variable = |index: u32| file.modelVariables.get((index as usize).checked_sub(1)?);
    let pair = |unknown: &fmi2::Unknown| {
        let rate = variable(unknown.index)?;
        let fmi2::VariableType::Real { derivative, .. } = &rate.variableType else {
            return None;
        };
        let state = variable((*derivative)?)?;
        Some((state.valueReference, rate.valueReference))
    };
    file.derivatives.iter().map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `fmi-rs` 0.3 alone finds the first type and no other, and no unit.
    #[test]
    fn every_declared_type_and_unit_is_read() {
        let text = r#"<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">
            <CoSimulation modelIdentifier="m"/>
            <UnitDefinitions>
              <Unit name="m"><BaseUnit m="1"/></Unit>
              <Unit name="km"><BaseUnit m="1" factor="1000"/></Unit>
              <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
            </UnitDefinitions>
            <TypeDefinitions>
              <SimpleType name="Length"><Real unit="m" displayUnit="mm" relativeQuantity="true"/></SimpleType>
              <SimpleType name="Gear"><Enumeration>
                <Item name="low" value="1" description="slow"/><Item name="high" value="2"/>
              </Enumeration></SimpleType>
              <SimpleType name="Stroke"><Real unit="km"/></SimpleType>
            </TypeDefinitions>
            <ModelVariables>
              <ScalarVariable name="gear" valueReference="0"><Enumeration declaredType="Gear" start="1"/></ScalarVariable>
              <ScalarVariable name="stroke" valueReference="1"><Real declaredType="Stroke"/></ScalarVariable>
              <ScalarVariable name="length" valueReference="2"><Real declaredType="Length"/></ScalarVariable>
              <ScalarVariable name="oil" valueReference="3"><Real unit="degC"/></ScalarVariable>
              <ScalarVariable name="rise" valueReference="4"><Real unit="degC" relativeQuantity="true"/></ScalarVariable>
            </ModelVariables>
            <ModelStructure/>
          </fmiModelDescription>"#;
        let document = roxmltree::Document::parse(text).unwrap();
        let description = read(text, document.root_element(), false).unwrap();
        let [gear, stroke, length, oil, rise] = &description.variables[..] else {
            panic!("{:?}", description.variables);
        };
        let Kind::Enumeration(items) = &gear.kind else {
            panic!("{:?}", gear.kind);
        };
        let items: Vec<(&str, i64, &str)> = items
            .iter()
            .map(|item| (item.name.as_str(), item.value, item.description.as_str()))
            .collect();
        assert_eq!(items, [("low", 1, "slow"), ("high", 2, "")]);
        assert_eq!(stroke.unit.as_deref(), Some("km"));
        assert_eq!(length.unit.as_deref(), Some("m"));
        assert_eq!(length.display_unit.as_deref(), Some("mm"));
        let base = |variable: &Variable| {
            let unit = variable.base_unit.unwrap();
            (
                unit.exponents[1],
                unit.exponents[4],
                unit.factor,
                unit.offset,
            )
        };
        assert_eq!(base(stroke), (1, 0, 1000.0, 0.0));
        assert_eq!(base(oil), (0, 1, 1.0, 273.15));
        assert_eq!(base(rise), (0, 1, 1.0, 0.0));
    }
}
