//! Rules that a `modelDescription.xml` keeps beyond its shape: causality with variability and
//! initial value, start values and their limits, units, types, default experiment.

use std::collections::{HashMap, HashSet};

use roxmltree::{Document, Node};

use super::{DESCRIPTION, Findings, structure};

/// A variable as the rules see it.
pub(super) struct Variable<'a> {
    pub node: Node<'a, 'a>,
    /// The element with type and start value.
    pub typed: Node<'a, 'a>,
    pub name: &'a str,
    pub kind: &'a str,
    pub causality: &'a str,
    pub variability: &'a str,
    initial: Option<&'a str>,
    pub has_start: bool,
}

impl Variable<'_> {
    /// The value reference.
    pub(super) fn reference(&self) -> Option<u64> {
        self.node.attribute("valueReference")?.trim().parse().ok()
    }

    /// Whether its initial value is computed, by what it says or by the standards' defaults.
    pub(super) fn is_computed_initially(&self) -> bool {
        match self.initial {
            Some(initial) => initial != "exact",
            None => {
                let may_be = ["output", "local", "calculatedParameter"].contains(&self.causality);
                may_be && self.variability != "constant"
            }
        }
    }
}

/// Checks the description's rules.
pub(super) fn check(findings: &mut Findings, text: &str) {
    let document = match Document::parse(text) {
        Ok(document) => document,
        Err(error) => {
            findings.error(DESCRIPTION, format!("not well-formed XML: {error}"));
            return;
        }
    };
    let root = document.root_element();
    let is_second = root.attribute("fmiVersion") == Some("2.0");
    let all = root
        .children()
        .find(|node| node.has_tag_name("ModelVariables"));
    let all: Vec<Variable> = all
        .into_iter()
        .flat_map(|all| all.children())
        .filter(Node::is_element)
        .filter_map(|node| variable(node, is_second))
        .collect();
    experiment(findings, root);
    steps(findings, root);
    let units = definitions(findings, root);
    names(findings, &all, root);
    let sizes = sizes(&all);
    structure::check(findings, root, &all, is_second);
    for variable in &all {
        combination(findings, variable, is_second);
        start(findings, variable);
        numbers(findings, variable, &sizes);
        limits(findings, variable);
        if let Some(unit) = variable.typed.attribute("unit")
            && !units.contains(unit)
        {
            let message = format!("`{}`: the unit `{unit}` is not defined", variable.name);
            findings.warning(&findings.place(variable.node), message);
        }
    }
    findings.check(format!(
        "modelDescription.xml: rules of {} variables",
        all.len()
    ));
}

fn variable<'a>(node: Node<'a, 'a>, is_second: bool) -> Option<Variable<'a>> {
    let typed = match is_second {
        true => node
            .children()
            .find(|child| child.is_element() && !child.has_tag_name("Annotations"))?,
        false => node,
    };
    let kind = typed.tag_name().name();
    let causality = node.attribute("causality").unwrap_or("local");
    let is_real = ["Real", "Float32", "Float64"].contains(&kind);
    let usual = match causality {
        _ if is_second => "continuous",
        "parameter" | "calculatedParameter" | "structuralParameter" => "fixed",
        _ if is_real => "continuous",
        _ => "discrete",
    };
    Some(Variable {
        node,
        typed,
        name: node.attribute("name").unwrap_or_default(),
        kind,
        causality,
        variability: node.attribute("variability").unwrap_or(usual),
        initial: node.attribute("initial"),
        has_start: typed.has_attribute("start")
            || typed.children().any(|child| child.has_tag_name("Start")),
    })
}

fn experiment(findings: &mut Findings, root: Node) {
    let Some(node) = root
        .children()
        .find(|node| node.has_tag_name("DefaultExperiment"))
    else {
        findings.note(DESCRIPTION, "there is no default experiment");
        return;
    };
    let number = |name: &str| {
        node.attribute(name)
            .and_then(|text| text.trim().parse::<f64>().ok())
    };
    let start = number("startTime").unwrap_or(0.0);
    if let Some(stop) = number("stopTime")
        && stop <= start
    {
        findings.error(
            &findings.place(node),
            format!("it stops at {stop} s, not after {start} s"),
        );
    }
    for name in ["stepSize", "tolerance"] {
        if let Some(value) = number(name)
            && !(value > 0.0 && value.is_finite())
        {
            findings.error(
                &findings.place(node),
                format!("{name} is {value}, expected more than 0"),
            );
        }
    }
}

/// Step sizes and intervals are greater than 0, shifts not negative.
fn steps(findings: &mut Findings, root: Node) {
    for node in root.descendants().filter(Node::is_element) {
        for (name, may_be_zero) in [
            ("fixedInternalStepSize", false),
            ("intervalDecimal", false),
            ("intervalCounter", false),
            ("resolution", false),
            ("shiftDecimal", true),
        ] {
            let value = node
                .attribute(name)
                .and_then(|text| text.trim().parse::<f64>().ok());
            let Some(value) = value else { continue };
            if !value.is_finite() || value < 0.0 || (value == 0.0 && !may_be_zero) {
                let place = findings.place(node);
                let more = if may_be_zero {
                    "not less than"
                } else {
                    "more than"
                };
                findings.error(&place, format!("{name} is {value}, expected {more} 0"));
            }
        }
    }
}

/// Names of the units; types and units that occur twice.
fn definitions<'a>(findings: &mut Findings, root: Node<'a, 'a>) -> HashSet<&'a str> {
    let below = |name: &'static str| {
        let found = root.children().find(move |node| node.has_tag_name(name));
        found
            .into_iter()
            .flat_map(|node| node.children())
            .filter(Node::is_element)
    };
    let mut units = HashSet::new();
    for unit in below("UnitDefinitions") {
        let name = unit.attribute("name").unwrap_or_default();
        if !units.insert(name) {
            findings.error(
                &findings.place(unit),
                format!("the unit `{name}` occurs twice"),
            );
        }
        let base = unit.children().find(|node| node.has_tag_name("BaseUnit"));
        match base {
            None => findings.note(
                &findings.place(unit),
                format!("the unit `{name}` has no base units"),
            ),
            Some(base) if base.attribute("factor") == Some("0") => {
                findings.error(
                    &findings.place(unit),
                    format!("the factor of the unit `{name}` is 0"),
                );
            }
            Some(_) => {}
        }
    }
    let mut types = HashSet::new();
    for kind in below("TypeDefinitions") {
        let name = kind.attribute("name").unwrap_or_default();
        if !types.insert(name) {
            findings.error(
                &findings.place(kind),
                format!("the type `{name}` occurs twice"),
            );
        }
        let items = kind.descendants().filter(|node| node.has_tag_name("Item"));
        let mut values = HashSet::new();
        for item in items {
            if !values.insert(item.attribute("value")) {
                findings.error(
                    &findings.place(item),
                    format!("two items of `{name}` have one value"),
                );
            }
        }
    }
    for node in root.descendants() {
        if let Some(name) = node.attribute("declaredType")
            && !types.contains(name)
        {
            findings.error(
                &findings.place(node),
                format!("the type `{name}` is not defined"),
            );
        }
    }
    units
}

/// Names that occur twice, aliases that differ.
fn names(findings: &mut Findings, all: &[Variable], root: Node) {
    let mut known = HashMap::new();
    let mut by_reference: HashMap<(&str, &str), &Variable> = HashMap::new();
    for variable in all {
        if let Some(first) = known.insert(variable.name, variable.node) {
            let message = format!(
                "`{}` is in {} already",
                variable.name,
                findings.place(first)
            );
            findings.error(&findings.place(variable.node), message);
        }
        if variable.name.is_empty() {
            findings.error(&findings.place(variable.node), "the name is empty");
        }
        let reference = variable
            .node
            .attribute("valueReference")
            .unwrap_or_default();
        let key = match root.attribute("fmiVersion") {
            Some("2.0") => (variable.kind, reference),
            // References are unique over all types.
            _ => ("", reference),
        };
        let Some(first) = by_reference.insert(key, variable) else {
            continue;
        };
        if key.0.is_empty() {
            let message = format!(
                "`{}` has the value reference of `{}`",
                variable.name, first.name
            );
            findings.error(&findings.place(variable.node), message);
            continue;
        }
        // Aliases: at most one may be set.
        let is_set = |variable: &Variable| ["input", "parameter"].contains(&variable.causality);
        if is_set(variable) && is_set(first) {
            let message = format!(
                "`{}` and `{}` are aliases and can both be set",
                first.name, variable.name
            );
            findings.error(&findings.place(variable.node), message);
        }
        if variable.typed.attribute("unit") != first.typed.attribute("unit") {
            let message = format!(
                "`{}` and `{}` are aliases with different units",
                first.name, variable.name
            );
            findings.error(&findings.place(variable.node), message);
        }
    }
}

/// Causality, variability and initial value as the standard's tables combine them.
fn combination(findings: &mut Findings, variable: &Variable, is_second: bool) {
    let Variable {
        node,
        name,
        kind,
        causality,
        variability,
        initial,
        ..
    } = variable;
    let allowed: &[&str] = match *causality {
        "parameter" | "calculatedParameter" | "structuralParameter" => &["fixed", "tunable"],
        "input" => &["discrete", "continuous"],
        "output" => &["constant", "discrete", "continuous"],
        "local" | "dependent" => &["constant", "fixed", "tunable", "discrete", "continuous"],
        "independent" => &["continuous"],
        other => {
            findings.error(
                &findings.place(*node),
                format!("`{name}`: causality=\"{other}\" is unknown"),
            );
            return;
        }
    };
    let is_clock = *kind == "Clock";
    if !allowed.contains(variability) && !is_clock {
        findings.error(
            &findings.place(*node),
            format!("`{name}`: causality {causality} with variability {variability}"),
        );
    }
    let is_real = ["Real", "Float32", "Float64"].contains(kind);
    if *variability == "continuous" && !is_real && !is_clock {
        findings.error(
            &findings.place(*node),
            format!("`{name}`: a {kind} cannot be continuous"),
        );
    }
    let Some(initial) = initial else {
        return;
    };
    if !["exact", "approx", "calculated"].contains(initial) {
        findings.error(
            &findings.place(*node),
            format!("`{name}`: initial=\"{initial}\" is unknown"),
        );
        return;
    }
    let fits = match *causality {
        // FMI 2.0 lets inputs have none, FMI 3.0 an exact one.
        "input" => !is_second && *initial == "exact",
        "independent" => false,
        "parameter" | "structuralParameter" => *initial == "exact",
        "calculatedParameter" => *initial != "exact",
        _ if *variability == "constant" => *initial == "exact",
        _ => true,
    };
    if !fits {
        findings.error(
            &findings.place(*node),
            format!("`{name}`: causality {causality} with initial {initial}"),
        );
    }
}

/// Start values where they must and must not be.
fn start(findings: &mut Findings, variable: &Variable) {
    let Variable {
        node,
        name,
        causality,
        variability,
        initial,
        has_start,
        kind,
        ..
    } = variable;
    if *kind == "Clock" {
        return;
    }
    let must = ["input", "parameter", "structuralParameter"].contains(causality)
        || *variability == "constant"
        || matches!(initial, Some("exact" | "approx"));
    if must && !has_start {
        findings.error(
            &findings.place(*node),
            format!("`{name}` must have a start value"),
        );
    }
    let may_not = *initial == Some("calculated") || *causality == "independent";
    if may_not && *has_start {
        findings.error(
            &findings.place(*node),
            format!("`{name}` must not have a start value"),
        );
    }
}

/// Values of structural parameters, by value reference.
fn sizes(all: &[Variable]) -> HashMap<u64, usize> {
    let structural = all
        .iter()
        .filter(|variable| variable.causality == "structuralParameter");
    structural
        .filter_map(|variable| {
            let start = variable.typed.attribute("start")?;
            Some((variable.reference()?, start.trim().parse().ok()?))
        })
        .collect()
}

/// Start values and limits are numbers of their type, and as many as there are elements.
fn numbers(findings: &mut Findings, variable: &Variable, sizes: &HashMap<u64, usize>) {
    let Variable {
        typed, name, kind, ..
    } = variable;
    let fits = |text: &str| match *kind {
        "Real" | "Float64" | "Float32" => {
            ["INF", "-INF", "NaN"].contains(&text)
                || (text.parse::<f64>().is_ok() && !text.to_lowercase().contains(['n', 'i']))
        }
        "Boolean" => ["true", "false", "0", "1"].contains(&text),
        "Int8" => text.parse::<i8>().is_ok(),
        "UInt8" => text.parse::<u8>().is_ok(),
        "Int16" => text.parse::<i16>().is_ok(),
        "UInt16" => text.parse::<u16>().is_ok(),
        "Integer" | "Int32" => text.parse::<i32>().is_ok(),
        "UInt32" => text.parse::<u32>().is_ok(),
        "Enumeration" | "Int64" => text.parse::<i64>().is_ok(),
        "UInt64" => text.parse::<u64>().is_ok(),
        _ => true,
    };
    let is_text = ["String", "Binary", "Clock"].contains(kind);
    for attribute in ["start", "min", "max"] {
        let Some(text) = typed.attribute(attribute).filter(|_| !is_text) else {
            continue;
        };
        if let Some(wrong) = text.split_whitespace().find(|text| !fits(text)) {
            let place = findings.place(variable.node);
            let message = format!("`{name}`: {attribute} `{wrong}` is not a value of {kind}");
            findings.error(&place, message);
        }
    }
    let starts = match typed.attribute("start") {
        Some(text) if !is_text => text.split_whitespace().count(),
        None if is_text && variable.has_start => {
            let starts = typed.children().filter(|node| node.has_tag_name("Start"));
            starts.count()
        }
        _ => return,
    };
    let mut elements = 1_usize;
    let mut is_array = false;
    for dimension in typed
        .children()
        .filter(|node| node.has_tag_name("Dimension"))
    {
        is_array = true;
        let fixed = dimension
            .attribute("start")
            .and_then(|text| text.trim().parse().ok());
        let reference = dimension.attribute("valueReference");
        let reference = reference.and_then(|text| text.trim().parse::<u64>().ok());
        let size = fixed.or_else(|| sizes.get(&reference?).copied());
        let Some(size) = size else {
            let place = findings.place(variable.node);
            findings.error(&place, format!("`{name}`: a dimension has no size"));
            return;
        };
        elements = elements.saturating_mul(size);
    }
    // One value stands for all elements.
    if starts != elements && !(is_array && starts == 1) {
        let place = findings.place(variable.node);
        let message = format!("`{name}`: {starts} start values for {elements} elements");
        findings.error(&place, message);
    }
}

/// `min <= start <= max`, and a nominal value above 0.
fn limits(findings: &mut Findings, variable: &Variable) {
    let number = |name: &str| {
        let text = variable.typed.attribute(name)?;
        text.trim().parse::<f64>().ok()
    };
    let name = variable.name;
    let at = findings.place(variable.node);
    let (min, max) = (number("min"), number("max"));
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        findings.error(&at, format!("`{name}`: min {min} above max {max}"));
    }
    let starts = variable.typed.attribute("start").unwrap_or_default();
    for start in starts
        .split_whitespace()
        .filter_map(|text| text.parse::<f64>().ok())
    {
        if min.is_some_and(|min| start < min) || max.is_some_and(|max| start > max) {
            findings.warning(
                &at,
                format!("`{name}` starts at {start}, beyond its limits"),
            );
            break;
        }
    }
    if let Some(nominal) = number("nominal")
        && nominal <= 0.0
    {
        findings.error(
            &at,
            format!("`{name}`: nominal {nominal}, expected more than 0"),
        );
    }
}
