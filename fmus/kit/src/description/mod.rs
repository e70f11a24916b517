//! The published interface: `modelDescription.xml` of both versions and the documentation page.

mod fmi2;
mod fmi3;
mod html;
mod terminals;
mod xml;

use std::collections::BTreeMap;

use crate::{
    checksum::fingerprint,
    component::Component,
    model::{Model, State},
    variable::{Causality, Declaration, Dependency, Enumeration, Row, Type, Value, Variability},
};
use units::{BaseUnit, Unit};
use xml::Element;

/// End of the default experiment, s.
const STOP_TIME: f64 = 10.0;

/// The model description of FMI 2.0.
pub fn fmi2<C: Component>(model: &Model<C>) -> String {
    fmi2::text(&Interface::of(model, &mut C::default()), token(model))
}

/// The model description of FMI 3.0.
pub fn fmi3<C: Component>(model: &Model<C>) -> String {
    fmi3::text(&Interface::of(model, &mut C::default()), token(model))
}

/// A page that says what the component is and lists its variables.
pub fn html<C: Component>(model: &Model<C>) -> String {
    html::text(&Interface::of(model, &mut C::default()))
}

/// `terminalsAndIcons.xml` of FMI 3.0.
pub fn terminals<C: Component>(_model: &Model<C>) -> String {
    terminals::text(C::TERMINALS)
}

/// The instantiation token (FMI 3.0) and GUID (FMI 2.0): a fingerprint of the interface.
pub fn token<C: Component>(model: &Model<C>) -> &str {
    let text = || fmi3::text(&Interface::of(model, &mut C::default()), "");
    model.token.get_or_init(|| fingerprint(&text()))
}

/// All that is published of a component: its model without the ways to its fields, so that the
/// descriptions are compiled once and not for every component.
struct Interface<'a> {
    name: &'static str,
    description: &'static str,
    documentation: &'static str,
    version: &'static str,
    step_size: f64,
    any_step_size: bool,
    partial_derivatives: bool,
    saves_state: bool,
    needs_execution_tool: bool,
    event_indicators: usize,
    rows: Vec<Row<'a>>,
    dependencies: &'a [Vec<(usize, Dependency)>],
    initial_dependencies: &'a [Vec<usize>],
    states: &'a [State],
}

impl<'a> Interface<'a> {
    fn of<C: Component>(model: &'a Model<C>, start: &mut C) -> Self {
        Self {
            name: C::NAME,
            description: C::DESCRIPTION,
            documentation: C::DOCUMENTATION,
            version: C::VERSION,
            step_size: C::STEP_SIZE,
            any_step_size: C::ANY_STEP_SIZE,
            partial_derivatives: C::PARTIAL_DERIVATIVES,
            saves_state: C::SAVES_STATE,
            needs_execution_tool: C::NEEDS_EXECUTION_TOOL,
            event_indicators: C::EVENT_INDICATORS,
            rows: model.variables.iter().map(|v| v.row(start)).collect(),
            dependencies: &model.dependencies,
            initial_dependencies: &model.initial_dependencies,
            states: &model.states,
        }
    }

    fn offers_model_exchange(&self) -> bool {
        !self.states.is_empty()
    }

    /// The value reference of the state whose derivative the variable at `index` is.
    fn state_of(&self, index: usize) -> Option<usize> {
        let mut states = self.states.iter();
        states.find(|s| s.derivative == index).map(|s| s.state + 1)
    }

    /// Positions of the outputs.
    fn outputs(&self) -> impl Iterator<Item = usize> {
        (0..self.rows.len()).filter(|i| self.rows[*i].declaration.causality == Causality::Output)
    }
}

/// The description's root, with the attributes that both versions have.
fn root(interface: &Interface, version: &str, token_attribute: &str, token: &str) -> Element {
    Element::new("fmiModelDescription")
        .attribute("fmiVersion", version)
        .attribute("modelName", interface.name)
        .attribute(token_attribute, token)
        .attribute("description", interface.description)
        .attribute("version", interface.version)
        .attribute("license", env!("CARGO_PKG_LICENSE"))
        .attribute(
            "generationTool",
            concat!("fmu-kit ", env!("CARGO_PKG_VERSION")),
        )
        .attribute("variableNamingConvention", "structured")
}

/// A variable's element, with the attributes that both versions have.
fn described(element: &str, index: usize, variable: &Declaration) -> Element {
    Element::new(element)
        .attribute("name", &variable.name)
        .attribute("valueReference", index + 1)
        .attribute("description", &variable.description)
        .attribute("causality", causality(variable.causality))
        .attribute("variability", variability(variable.variability))
        .optional("initial", initial(variable))
}

fn causality(causality: Causality) -> &'static str {
    match causality {
        Causality::Parameter => "parameter",
        Causality::Input => "input",
        Causality::Output => "output",
        Causality::Local => "local",
    }
}

fn variability(variability: Variability) -> &'static str {
    match variability {
        Variability::Fixed => "fixed",
        Variability::Tunable => "tunable",
        Variability::Discrete => "discrete",
        Variability::Continuous => "continuous",
    }
}

fn kind(dependency: Dependency) -> &'static str {
    match dependency {
        Dependency::Dependent => "dependent",
        Dependency::Constant => "constant",
        Dependency::Fixed => "fixed",
    }
}

/// Attribute `initial`; inputs have none.
fn initial(variable: &Declaration) -> Option<&'static str> {
    match variable.causality {
        Causality::Parameter => Some("exact"),
        Causality::Input => None,
        Causality::Output | Causality::Local => Some("calculated"),
    }
}

/// The start value, for variables that have one.
fn start(row: &Row) -> Option<String> {
    if row.declaration.is_computed() {
        return None;
    }
    match &row.start {
        Value::Real(value) => Some(value.to_string()),
        Value::Integer(value) => Some(value.to_string()),
        Value::Boolean(value) => Some(value.to_string()),
        Value::Text(value) => Some(value.clone()),
        Value::Missing => None,
    }
}

fn range(row: &Row, mut element: Element) -> Element {
    element = element
        .optional("min", row.declaration.min)
        .optional("max", row.declaration.max);
    if row.kind == Type::Real {
        element = element.optional("nominal", row.declaration.nominal);
    }
    element
}

/// The units that the table uses, each with the display units that go with it.
fn unit_definitions(rows: &[Row]) -> Option<Element> {
    let mut units: BTreeMap<&str, Vec<&str>> = BTreeMap::from([("s", vec![])]);
    for Row { declaration, .. } in rows {
        if let Some(unit) = declaration.unit {
            let shown = units.entry(unit).or_default();
            shown.extend(declaration.display_unit);
            shown.sort_unstable();
            shown.dedup();
        }
    }
    let mut definitions = Element::new("UnitDefinitions");
    for (name, shown) in units {
        // The table was checked: its units can be read and converted.
        let unit = Unit::parse(name).ok()?;
        let BaseUnit { exponents, factor } = unit.base_unit()?;
        let mut base = Element::new("BaseUnit");
        for (name, exponent) in BaseUnit::NAMES.iter().zip(exponents) {
            base = base.optional(name, (exponent != 0).then_some(exponent));
        }
        base = base.optional("factor", (factor != 1.0).then_some(factor));
        let mut element = Element::new("Unit").attribute("name", name).child(base);
        for name in shown {
            let factor = unit.factor_to(&Unit::parse(name).ok()?).ok()?;
            element = element.child(
                Element::new("DisplayUnit")
                    .attribute("name", name)
                    .attribute("factor", factor),
            );
        }
        definitions = definitions.child(element);
    }
    Some(definitions)
}

/// The distinct enumeration types of the table.
fn enumerations(rows: &[Row]) -> Vec<Enumeration> {
    let mut types: Vec<Enumeration> = Vec::new();
    for row in rows {
        if let Type::Choice(choices) = row.kind
            && !types.iter().any(|t| t.name == choices.name)
        {
            types.push(choices);
        }
    }
    types
}

fn items(mut element: Element, choices: &Enumeration) -> Element {
    for item in choices.items {
        element = element.child(
            Element::new("Item")
                .attribute("name", item.name)
                .attribute("value", item.value)
                .attribute("description", item.description),
        );
    }
    element
}

fn log_categories() -> Element {
    let mut categories = Element::new("LogCategories");
    for (name, description) in crate::log::CATEGORIES {
        categories = categories.child(
            Element::new("Category")
                .attribute("name", name.to_string_lossy())
                .attribute("description", description),
        );
    }
    categories
}

fn default_experiment(interface: &Interface) -> Element {
    Element::new("DefaultExperiment")
        .attribute("startTime", 0)
        .attribute("stopTime", STOP_TIME)
        .attribute("stepSize", interface.step_size)
}

/// Positions of the unknowns at initialization: outputs, states, derivatives.
fn initial_unknowns(interface: &Interface) -> Vec<usize> {
    let mut unknowns: Vec<usize> = interface.outputs().collect();
    let states = interface.states.iter();
    unknowns.extend(states.flat_map(|s| [s.state, s.derivative]));
    unknowns.sort_unstable();
    unknowns.dedup();
    unknowns
}

/// An unknown with its dependencies; `reference` is the name of the identifying attribute.
fn unknown(
    element: &str,
    reference: &str,
    index: usize,
    on: impl Iterator<Item = (usize, Dependency)>,
) -> Element {
    let (mut dependencies, mut kinds) = (Vec::new(), Vec::new());
    for (on, dependency) in on {
        dependencies.push((on + 1).to_string());
        kinds.push(kind(dependency));
    }
    Element::new(element)
        .attribute(reference, index + 1)
        .attribute("dependencies", dependencies.join(" "))
        .attribute("dependenciesKind", kinds.join(" "))
}

fn initial_unknown(interface: &Interface, element: &str, reference: &str, index: usize) -> Element {
    let on = interface.initial_dependencies[index].iter();
    unknown(
        element,
        reference,
        index,
        on.map(|on| (*on, Dependency::Dependent)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oscillator::Oscillator;
    use roxmltree::{Document, Node};

    fn model() -> &'static Model<Oscillator> {
        Model::get().unwrap()
    }

    fn named<'a>(document: &'a Document, name: &str) -> Node<'a, 'a> {
        document
            .descendants()
            .find(|n| n.attribute("name") == Some(name))
            .unwrap()
    }

    #[test]
    fn both_descriptions_are_well_formed_and_carry_the_token() {
        for (text, token) in [
            (fmi2(model()), "guid"),
            (fmi3(model()), "instantiationToken"),
        ] {
            let document = Document::parse(&text).unwrap();
            assert_eq!(
                document.root_element().attribute(token),
                Some(super::token(model()))
            );
            let note = named(&document, "note");
            assert_eq!(note.attribute("description"), Some("Free text <&>"));
            let start = note.first_element_child().unwrap();
            let text = start.attribute("start").or(start.attribute("value"));
            assert_eq!(text, Some("a < b & \"c\""));
        }
    }

    #[test]
    fn a_type_that_several_variables_have_is_there_once() {
        let of = |name| Type::Choice(Enumeration { name, items: &[] });
        let own = model().variables[0].row(&mut Oscillator::default());
        let rows: Vec<Row> = ["Mode", "Shape", "Mode"]
            .into_iter()
            .map(|name| Row {
                declaration: own.declaration,
                kind: of(name),
                start: own.start.clone(),
            })
            .collect();
        let names: Vec<&str> = enumerations(&rows).iter().map(|own| own.name).collect();
        assert_eq!(names, ["Mode", "Shape"]);
    }

    #[test]
    fn token_changes_with_the_interface() {
        let token = super::token(model());
        assert_eq!(token, super::token(&Model::<Oscillator>::new().unwrap()));
        let mut other = Model::<Oscillator>::new().unwrap();
        other.variables[0].declaration.description += "!";
        assert_ne!(token, super::token(&other));
        assert_eq!(token.len(), 38);
    }

    #[test]
    fn model_structure_names_what_the_table_says() {
        let text = fmi3(model());
        let document = Document::parse(&text).unwrap();
        let entry = |element: &str, reference: &str| {
            let found = document.descendants().find(|n| {
                n.has_tag_name(element) && n.attribute("valueReference") == Some(reference)
            });
            let node = found.unwrap();
            (
                node.attribute("dependencies").unwrap(),
                node.attribute("dependenciesKind").unwrap(),
            )
        };
        assert_eq!(entry("Output", "2"), ("2", "constant"));
        assert_eq!(entry("Output", "4"), ("1 2", "fixed fixed"));
        assert_eq!(entry("Output", "7"), ("", ""));
        assert_eq!(
            entry("ContinuousStateDerivative", "4"),
            ("1 2", "fixed fixed")
        );
        assert_eq!(entry("InitialUnknown", "4"), ("1 5", "dependent dependent"));
        assert_eq!(
            named(&document, "velocity").attribute("derivative"),
            Some("2")
        );
    }

    #[test]
    fn units_are_reduced_to_base_units_with_factors_for_display() {
        let text = fmi2(model());
        let document = Document::parse(&text).unwrap();
        let force = named(&document, "N");
        let base = force.first_element_child().unwrap();
        for (unit, exponent) in [("kg", "1"), ("m", "1"), ("s", "-2")] {
            assert_eq!(base.attribute(unit), Some(exponent));
        }
        let shown = force.last_element_child().unwrap();
        assert_eq!(shown.attribute("name"), Some("lbf"));
        let factor: f64 = shown.attribute("factor").unwrap().parse().unwrap();
        assert!((factor * 4.448_221_615_260_5 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn documentation_page_lists_every_variable() {
        let page = html(model());
        for variable in &model().variables {
            assert!(
                page.contains(&format!("<td>{}</td>", variable.name)),
                "{}",
                variable.name
            );
        }
        assert!(page.contains("Free text &lt;&amp;&gt;"));
    }

    #[test]
    fn terminals_name_their_members_and_how_they_match() {
        use crate::panel::{Panel, SOUND};
        let text = terminals(Model::<Panel<SOUND>>::get().unwrap());
        let document = Document::parse(&text).unwrap();
        let root = document.root_element();
        assert!(root.has_tag_name("fmiTerminalsAndIcons"));
        let found: Vec<_> = root
            .descendants()
            .filter(|node| node.has_tag_name("Terminal"))
            .map(|node| {
                let members: Vec<_> = node
                    .children()
                    .filter(|child| child.has_tag_name("TerminalMemberVariable"))
                    .map(|child| {
                        (
                            child.attribute("memberName"),
                            child.attribute("variableName"),
                        )
                    })
                    .collect();
                (
                    node.attribute("name"),
                    node.attribute("matchingRule"),
                    node.attribute("terminalKind"),
                    members,
                )
            })
            .collect();
        let expected = [
            (
                Some("ports"),
                Some("bus"),
                Some("signals"),
                vec![(Some("first"), Some("a")), (Some("second"), Some("b"))],
            ),
            (
                Some("out"),
                Some("plug"),
                Some("signals"),
                vec![(Some("first"), Some("product"))],
            ),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn choices_are_listed_with_their_values_in_both_versions() {
        use crate::panel::{Panel, SOUND};
        let model = Model::<Panel<SOUND>>::get().unwrap();
        for text in [fmi2(model), fmi3(model)] {
            let document = Document::parse(&text).unwrap();
            let items: Vec<_> = document
                .descendants()
                .filter(|node| node.has_tag_name("Item"))
                .map(|node| (node.attribute("name"), node.attribute("value")))
                .collect();
            assert_eq!(
                items,
                [(Some("slow"), Some("1")), (Some("fast"), Some("4"))]
            );
            let bounds = |name: &str| {
                let node = document
                    .descendants()
                    .find(|node| node.attribute("name") == Some(name))
                    .unwrap();
                let typed = node.children().find(|child| child.is_element());
                let of = |attribute: &str| {
                    let own = node.attribute(attribute);
                    own.or_else(|| typed.and_then(|child| child.attribute(attribute)))
                        .map(str::to_string)
                };
                (of("min"), of("max"), of("start"))
            };
            let text = |text: &str| Some(text.to_string());
            assert_eq!(bounds("count"), (text("1"), text("5"), text("3")));
            assert_eq!(bounds("gain"), (None, text("100"), text("2")));
        }
    }
}
