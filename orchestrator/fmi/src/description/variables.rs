//! `<ModelVariables>` of a description, with what their types say of them.

use std::collections::HashMap;
use std::ops::Range;

use roxmltree::Node;

use super::attribute::{Remarks, Value, at, child, children, missing, needed, optional, word};
use super::structure::{DescriptionError, MOST_ELEMENTS, element_names, units};
use super::{
    BaseUnit, Causality, FmiVersion, InputClock, Item, Kind, Sizes, Ticks, Variability, Variable,
};

const CAUSALITIES_2: &str = "parameter calculatedParameter input output local independent";
const CAUSALITIES_3: &str =
    "structuralParameter parameter calculatedParameter input output local independent";
const VARIABILITIES: &str = "constant fixed tunable discrete continuous";
const INITIALS: &str = "exact approx calculated";
const INTERVALS: &str = "constant fixed tunable changing countdown triggered";

/// The variables of a description.
#[derive(Default)]
pub(super) struct Variables {
    /// Each element of an array is one.
    pub(super) all: Vec<Variable>,
    /// Their positions, by what `<ModelStructure>` calls them: the number from 1 in FMI 2.0, the value
    /// reference in FMI 3.0.
    pub(super) places: HashMap<u32, Range<usize>>,
    /// What the floating-point variables at these positions are derivatives of, called as in `places`.
    pub(super) derivatives: HashMap<usize, u32>,
    /// Clocks that are inputs, those of the highest priority (the lowest number) first.
    pub(super) clocks: Vec<InputClock>,
}

/// What is declared for all variables.
struct Declared<'a> {
    version: FmiVersion,
    types: HashMap<&'a str, (Quantity<'a>, Vec<Item>)>,
    units: HashMap<&'a str, BaseUnit>,
    /// Structural parameters by value reference.
    structural: HashMap<u32, Node<'a, 'a>>,
}

/// What a floating-point variable and its type can both say.
#[derive(Clone, Copy, Default)]
struct Quantity<'a> {
    unit: Option<&'a str>,
    display_unit: Option<&'a str>,
    is_relative: bool,
    bounds: [Option<f64>; 2],
}

impl<'a> Quantity<'a> {
    /// Without content if the element is of another type.
    fn read(node: Node<'a, 'a>, remarks: &mut Remarks) -> Self {
        let bounds = ["min", "max"];
        let bounds = match node.tag_name().name() {
            "Real" | "Float64" | "Float64Type" => bounds.map(|name| remarks.lenient(node, name)),
            "Float32" | "Float32Type" => {
                bounds.map(|name| remarks.lenient::<f32>(node, name).map(f64::from))
            }
            _ => return Self::default(),
        };
        Self {
            unit: node.attribute("unit"),
            display_unit: node.attribute("displayUnit"),
            is_relative: remarks.lenient(node, "relativeQuantity") == Some(true),
            bounds,
        }
    }

    fn or(self, declared: Self) -> Self {
        Self {
            unit: self.unit.or(declared.unit),
            display_unit: self.display_unit.or(declared.display_unit),
            is_relative: self.is_relative || declared.is_relative,
            bounds: [0, 1].map(|side: usize| self.bounds[side].or(declared.bounds[side])),
        }
    }
}

/// The variables; structural parameters take the values in `sizes`, if given.
///
/// # Errors
/// The first one that cannot be used.
pub(super) fn read(
    root: Node,
    version: FmiVersion,
    sizes: &Sizes,
    remarks: &mut Remarks,
) -> Result<Variables, DescriptionError> {
    let list = child(root, "ModelVariables");
    let list = list.ok_or_else(|| at(root, "<ModelVariables> is missing".to_string()))?;
    let outer = |node: &Node| match version {
        FmiVersion::V2 => node.has_tag_name("ScalarVariable"),
        FmiVersion::V3 => node.is_element(),
    };
    let is_structural =
        |node: &Node| node.attribute("causality").map(str::trim) == Some("structuralParameter");
    let structural = list.children().filter(is_structural);
    let declared = Declared {
        version,
        types: types(root, version, remarks),
        units: units(root, remarks),
        structural: structural
            .filter_map(|node| Some((optional(node, "valueReference").ok()??, node)))
            .collect(),
    };
    let mut found = Variables::default();
    let mut clocks = Vec::new();
    for (number, node) in (1..).zip(list.children().filter(outer)) {
        let (inner, kind) = typed(node, version)?;
        let one = scalar(node, inner, kind, &declared, remarks)?;
        let first = found.all.len();
        if matches!(one.kind, Kind::Float64 | Kind::Float32)
            && let Some(of) = optional(inner, "derivative")?
        {
            found.derivatives.insert(first, of);
        }
        if one.kind == Kind::Clock {
            let (priority, clock) = clock(node, &one)?;
            if one.causality == Causality::Input {
                clocks.push((priority, clock));
            }
        }
        let key = match version {
            FmiVersion::V2 => {
                let start = inner.attribute("start").map(str::to_string);
                found.all.push(Variable { start, ..one });
                number
            }
            FmiVersion::V3 => {
                let reference = one.reference;
                add(&mut found.all, node, one, &declared, sizes)?;
                reference
            }
        };
        found.places.insert(key, first..found.all.len());
    }
    clocks.sort_by_key(|(priority, _)| *priority);
    found.clocks = clocks.into_iter().map(|(_, clock)| clock).collect();
    Ok(found)
}

/// Declared types by name.
fn types<'a>(
    root: Node<'a, 'a>,
    version: FmiVersion,
    remarks: &mut Remarks,
) -> HashMap<&'a str, (Quantity<'a>, Vec<Item>)> {
    let list = child(root, "TypeDefinitions");
    let all = list.into_iter().flat_map(|list| list.children());
    let mut types = HashMap::new();
    for node in all.filter(Node::is_element) {
        let inner = match version {
            FmiVersion::V2 => node.first_element_child(),
            FmiVersion::V3 => Some(node),
        };
        if let (Some(name), Some(inner)) = (node.attribute("name"), inner) {
            let items = children(Some(inner), "Item").filter_map(|item| {
                Some(Item {
                    name: item.attribute("name")?.to_string(),
                    value: remarks.lenient(item, "value")?,
                    description: item.attribute("description").unwrap_or("").to_string(),
                })
            });
            let items = items.collect();
            types.insert(name, (Quantity::read(inner, remarks), items));
        }
    }
    types
}

/// The element that has the attributes of the variable's type, and the type, without choices.
fn typed<'a>(
    node: Node<'a, 'a>,
    version: FmiVersion,
) -> Result<(Node<'a, 'a>, Kind), DescriptionError> {
    let known = match version {
        FmiVersion::V2 => node
            .children()
            .find_map(|inner| Some((inner, kind(version, inner)?))),
        FmiVersion::V3 => kind(version, node).map(|kind| (node, kind)),
    };
    let expected = match version {
        FmiVersion::V2 => "in it <Real>, <Integer>, <Boolean>, <String> or <Enumeration>",
        FmiVersion::V3 => "a type such as <Float64>",
    };
    known.ok_or_else(|| at(node, format!("no known type; expected {expected}")))
}

fn kind(version: FmiVersion, node: Node) -> Option<Kind> {
    use FmiVersion::{V2, V3};
    Some(match (version, node.tag_name().name()) {
        (V2, "Real") | (V3, "Float64") => Kind::Float64,
        (V2, "Integer") | (V3, "Int32") => Kind::Int32,
        (_, "Boolean") => Kind::Boolean,
        (_, "String") => Kind::String,
        (_, "Enumeration") => Kind::Enumeration(Vec::new()),
        (V3, "Float32") => Kind::Float32,
        (V3, "Int8") => Kind::Int8,
        (V3, "UInt8") => Kind::UInt8,
        (V3, "Int16") => Kind::Int16,
        (V3, "UInt16") => Kind::UInt16,
        (V3, "UInt32") => Kind::UInt32,
        (V3, "Int64") => Kind::Int64,
        (V3, "UInt64") => Kind::UInt64,
        (V3, "Binary") => Kind::Binary,
        (V3, "Clock") => Kind::Clock,
        _ => return None,
    })
}

/// A variable without its start value and elements.
fn scalar(
    node: Node,
    inner: Node,
    mut kind: Kind,
    declared: &Declared,
    remarks: &mut Remarks,
) -> Result<Variable, DescriptionError> {
    let name = needed(node, "name")?;
    let causalities = match declared.version {
        FmiVersion::V2 => CAUSALITIES_2,
        FmiVersion::V3 => CAUSALITIES_3,
    };
    let causality = word(node, "causality", causalities)?.unwrap_or("local");
    let is_floating = matches!(kind, Kind::Float64 | Kind::Float32);
    let default = match causality {
        _ if declared.version == FmiVersion::V2 => "continuous",
        "parameter" | "calculatedParameter" | "structuralParameter" => "fixed",
        _ if is_floating => "continuous",
        _ => "discrete",
    };
    let variability = word(node, "variability", VARIABILITIES)?.unwrap_or(default);
    let is_exact = match (word(node, "initial", INITIALS)?, variability, causality) {
        (Some(initial), ..) => initial != "calculated",
        (None, "constant", "output" | "local")
        | (None, "fixed" | "tunable", "parameter" | "structuralParameter")
        | (None, "discrete" | "continuous", "input") => true,
        (None, "fixed" | "tunable", "calculatedParameter" | "local")
        | (None, "discrete" | "continuous", "output" | "local")
        | (None, _, "independent") => false,
        _ => {
            let both = format!("causality {causality} with variability {variability}");
            return Err(at(node, format!("{both} is not possible")));
        }
    };
    let mut quantity = Quantity::read(inner, remarks);
    let declared_type = match kind {
        Kind::Enumeration(_) => Some(needed::<String>(inner, "declaredType")?),
        _ => optional(inner, "declaredType")?,
    };
    let declared_type = declared_type.and_then(|name| declared.types.get(name.as_str()));
    if let Some((of_type, items)) = declared_type {
        match &mut kind {
            Kind::Enumeration(own) => own.clone_from(items),
            _ if is_floating => quantity = quantity.or(*of_type),
            _ => {}
        }
    }
    let base_unit = quantity.unit.and_then(|unit| declared.units.get(unit));
    Ok(Variable {
        name,
        reference: needed(node, "valueReference")?,
        kind,
        causality: match causality {
            "parameter" | "structuralParameter" => Causality::Parameter,
            "input" => Causality::Input,
            "output" => Causality::Output,
            _ => Causality::Local,
        },
        is_settable: variability != "constant"
            && causality != "independent"
            && (causality == "input" || is_exact),
        is_structural: causality == "structuralParameter",
        variability: match variability {
            "constant" | "fixed" => Variability::Fixed,
            "tunable" => Variability::Tunable,
            "discrete" => Variability::Discrete,
            _ => Variability::Continuous,
        },
        base_unit: base_unit.map(|base| base.of_variable(quantity.is_relative)),
        unit: quantity.unit.map(str::to_string),
        display_unit: quantity.display_unit.map(str::to_string),
        bounds: quantity.bounds,
        start: None,
        clocks: match declared.version {
            FmiVersion::V2 => Vec::new(),
            FmiVersion::V3 => optional(node, "clocks")?.unwrap_or_default(),
        },
        element: (0, 1),
        is_element: false,
        description: node.attribute("description").unwrap_or("").to_string(),
        dependencies: [].into(),
    })
}

/// Adds a variable of FMI 3.0, or all elements of an array.
fn add(
    all: &mut Vec<Variable>,
    node: Node,
    one: Variable,
    declared: &Declared,
    sizes: &Sizes,
) -> Result<(), DescriptionError> {
    let dimensions = children(Some(node), "Dimension")
        .map(|dimension| size(&one.name, dimension, declared, sizes))
        .collect::<Result<Vec<usize>, _>>()?;
    let room = MOST_ELEMENTS.saturating_sub(all.len());
    let count = dimensions
        .iter()
        .try_fold(1_usize, |count, &size| count.checked_mul(size))
        .filter(|count| *count <= room)
        .ok_or(DescriptionError::Elements)?;
    let starts = starts(node)?;
    let start = match starts.len() {
        all if all == count => starts.into_iter().map(Some).collect(),
        // It stands for all.
        1 => vec![starts.into_iter().next(); count],
        _ => vec![None; count],
    };
    if dimensions.is_empty() {
        let start = start.into_iter().next().flatten();
        all.push(Variable { start, ..one });
        return Ok(());
    }
    let names = element_names(&one.name, &dimensions);
    for (place, (name, start)) in names.into_iter().zip(start).enumerate() {
        all.push(Variable {
            name,
            start,
            element: (place, count),
            is_element: true,
            ..one.clone()
        });
    }
    Ok(())
}

/// Start values as FMI 3.0 writes them.
fn starts(node: Node) -> Result<Vec<String>, DescriptionError> {
    match node.tag_name().name() {
        "String" | "Binary" => children(Some(node), "Start")
            .map(|start| needed(start, "value"))
            .collect(),
        "Clock" => Ok(Vec::new()),
        _ => {
            let text = node.attribute("start").unwrap_or_default();
            Ok(text.split_whitespace().map(str::to_string).collect())
        }
    }
}

/// The size of an array in one dimension: a number, or the value of a structural parameter.
fn size(
    array: &str,
    dimension: Node,
    declared: &Declared,
    sizes: &Sizes,
) -> Result<usize, DescriptionError> {
    let wrong = |reason: &str| at(dimension, format!("the size of `{array}` {reason}"));
    let parameter = |reference: u32| {
        let node = declared.structural.get(&reference).copied();
        let node = node.ok_or_else(|| wrong("is not a structural parameter"))?;
        let start = starts(node)?.first().and_then(|text| u64::read(text));
        let size = sizes.get(&reference).copied().or(start);
        size.ok_or_else(|| wrong("is a parameter whose start value is not a whole number"))
    };
    let size: u64 = match optional(dimension, "start")? {
        Some(size) => size,
        None => parameter(needed(dimension, "valueReference")?)?,
    };
    usize::try_from(size).map_err(|_| wrong(&format!("is too large: {size}")))
}

/// A clock with its priority.
fn clock(node: Node, variable: &Variable) -> Result<(u32, InputClock), DescriptionError> {
    let interval = optional::<f64>(node, "intervalDecimal")?;
    let resolution = optional::<u64>(node, "resolution")?;
    let seconds = |count: u64| resolution.map(|per_second| count as f64 / per_second as f64);
    let interval = interval.or(optional(node, "intervalCounter")?.and_then(seconds));
    let shift = optional(node, "shiftDecimal")?.unwrap_or(0.0);
    let counted = optional(node, "shiftCounter")?.filter(|count| *count != 0);
    let ticks = match word(node, "intervalVariability", INTERVALS)? {
        Some("constant" | "fixed") => Ticks::Periodic(interval),
        Some("tunable") => Ticks::Periodic(None),
        Some("changing") => Ticks::Changing,
        Some("countdown") => Ticks::Countdown,
        Some(_) => Ticks::Triggered,
        None => {
            let expected = format!("one of {}", INTERVALS.replace(' ', ", "));
            return Err(missing(node, "intervalVariability", &expected));
        }
    };
    let clock = InputClock {
        name: variable.name.clone(),
        reference: variable.reference,
        ticks,
        shift: counted.and_then(seconds).unwrap_or(shift),
    };
    Ok((optional(node, "priority")?.unwrap_or(u32::MAX), clock))
}
