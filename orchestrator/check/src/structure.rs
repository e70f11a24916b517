//! What a description refers to: outputs and unknowns of its structure, derivatives, clocks, aliases.

use std::collections::{HashMap, HashSet};

use roxmltree::Node;

use super::Findings;
use super::rules::Variable;

/// Kinds of dependencies.
const KINDS: &[&str] = &["dependent", "constant", "fixed", "tunable", "discrete"];

/// Checks the references of a description.
pub(super) fn check(findings: &mut Findings, root: Node, all: &[Variable], is_second: bool) {
    // By the number that the structure uses: counted from 1 in FMI 2.0, value references in FMI 3.0.
    let mut by_number: HashMap<u64, &Variable> = HashMap::with_capacity(all.len());
    for (at, variable) in all.iter().enumerate() {
        let number = match is_second {
            true => Some(at as u64 + 1),
            false => variable.reference(),
        };
        if let Some(number) = number {
            by_number.entry(number).or_insert(variable);
        }
    }
    derivatives(findings, all, &by_number, is_second);
    clocks(findings, all, &by_number);
    if is_second {
        alias_starts(findings, all);
    }
    let Some(structure) = root
        .children()
        .find(|node| node.has_tag_name("ModelStructure"))
    else {
        return;
    };
    let lists: Vec<(&str, Vec<Node>)> = match is_second {
        true => structure
            .children()
            .filter(Node::is_element)
            .map(|list| {
                let unknowns = list.children().filter(|node| node.has_tag_name("Unknown"));
                (list.tag_name().name(), unknowns.collect())
            })
            .collect(),
        false => {
            let mut lists: Vec<(&str, Vec<Node>)> = Vec::new();
            for node in structure.children().filter(Node::is_element) {
                let name = node.tag_name().name();
                match lists.iter_mut().find(|(known, _)| *known == name) {
                    Some((_, list)) => list.push(node),
                    None => lists.push((name, vec![node])),
                }
            }
            lists
        }
    };
    initial_unknowns(findings, &lists, (all, &by_number), is_second);
    let mut listed: HashSet<u64> = HashSet::new();
    for (name, unknowns) in &lists {
        let mut seen: HashSet<u64> = HashSet::new();
        for unknown in unknowns {
            let attribute = if is_second { "index" } else { "valueReference" };
            let number = unknown.attribute(attribute);
            let Some(number) = number.and_then(|text| text.trim().parse::<u64>().ok()) else {
                continue;
            };
            let is_output = matches!(*name, "Outputs" | "Output");
            if !seen.insert(number) {
                let place = findings.place(*unknown);
                findings.error(&place, format!("{attribute} {number} is in <{name}> twice"));
            }
            // Event indicators may be anything; those of no variable are found here.
            match by_number.get(&number) {
                None => {
                    let place = findings.place(*unknown);
                    let message = format!("{attribute} {number} in <{name}> is not a variable");
                    findings.error(&place, message);
                }
                Some(variable) if is_output && variable.causality != "output" => {
                    let place = findings.place(*unknown);
                    let message = format!(
                        "`{}` in <{name}> has the causality {}, expected output",
                        variable.name, variable.causality
                    );
                    findings.error(&place, message);
                }
                Some(_) => {}
            }
            if is_output {
                listed.insert(number);
            }
            dependencies(findings, *unknown, &by_number);
        }
    }
    for (at, variable) in all.iter().enumerate() {
        let number = match is_second {
            true => Some(at as u64 + 1),
            false => variable.reference(),
        };
        if variable.causality == "output" && number.is_some_and(|number| !listed.contains(&number))
        {
            let place = findings.place(variable.node);
            let message = format!("the output `{}` is not in <ModelStructure>", variable.name);
            findings.error(&place, message);
        }
    }
}

/// The initial unknowns are those that the standards name (FMI 2.0, section 2.2.8; FMI 3.0, section 2.4.8):
/// outputs, continuous states and their derivatives with initial approx or calculated, and calculated
/// parameters. What clocks govern is none. Whether a clock itself is one is left open.
fn initial_unknowns(
    findings: &mut Findings,
    lists: &[(&str, Vec<Node>)],
    (all, by_number): (&[Variable], &HashMap<u64, &Variable>),
    is_second: bool,
) {
    let (attribute, name, derivatives) = match is_second {
        true => ("index", "InitialUnknowns", "Derivatives"),
        false => (
            "valueReference",
            "InitialUnknown",
            "ContinuousStateDerivative",
        ),
    };
    let number = |node: &Node| node.attribute(attribute)?.trim().parse::<u64>().ok();
    let unknowns = |name: &'static str| {
        let named = lists.iter().filter(move |(list, _)| *list == name);
        named.flat_map(move |(_, unknowns)| unknowns.iter().copied())
    };
    let mut states: HashSet<u64> = HashSet::new();
    for number in unknowns(derivatives).filter_map(|node| number(&node)) {
        states.insert(number);
        let typed = by_number.get(&number).map(|derivative| derivative.typed);
        let state = typed.and_then(|typed| typed.attribute("derivative"));
        states.extend(state.and_then(|text| text.trim().parse::<u64>().ok()));
    }
    let listed: HashSet<u64> = unknowns(name).filter_map(|node| number(&node)).collect();
    for (at, variable) in all.iter().enumerate() {
        let own = match is_second {
            true => Some(at as u64 + 1),
            false => variable.reference(),
        };
        let Some(own) = own.filter(|_| variable.kind != "Clock") else {
            continue;
        };
        let is_unknown = variable.causality == "calculatedParameter"
            || variable.is_computed_initially()
                && (states.contains(&own)
                    || variable.causality == "output" && !variable.node.has_attribute("clocks"));
        let (place, variable) = (findings.place(variable.node), variable.name);
        match (is_unknown, listed.contains(&own)) {
            (true, false) => {
                let message = format!("`{variable}` is computed initially, but is not in <{name}>");
                findings.error(&place, message);
            }
            (false, true) => {
                let message = format!(
                    "`{variable}` is in <{name}>; expected an output, state or derivative with initial approx or \
                     calculated, or a calculated parameter"
                );
                findings.error(&place, message);
            }
            _ => {}
        }
    }
}

/// Dependencies of an unknown and their kinds.
fn dependencies(findings: &mut Findings, unknown: Node, by_number: &HashMap<u64, &Variable>) {
    let list = |name: &str| unknown.attribute(name).map(|text| text.split_whitespace());
    let kinds = list("dependenciesKind");
    let count = list("dependencies").map(Iterator::count);
    if let Some(kinds) = kinds {
        let kinds: Vec<&str> = kinds.collect();
        if count != Some(kinds.len()) {
            let place = findings.place(unknown);
            let message = format!(
                "{} dependencies have {} kinds",
                count.unwrap_or(0),
                kinds.len()
            );
            findings.error(&place, message);
        }
        if let Some(other) = kinds.iter().find(|kind| !KINDS.contains(kind)) {
            let place = findings.place(unknown);
            findings.error(
                &place,
                format!("the kind of dependency `{other}` is unknown"),
            );
        }
    }
    for text in list("dependencies").into_iter().flatten() {
        let number = text.parse::<u64>().ok();
        if number.is_none_or(|number| !by_number.contains_key(&number)) {
            let place = findings.place(unknown);
            findings.error(&place, format!("the dependency `{text}` is not a variable"));
        }
    }
}

/// A derivative is that of another variable, which is continuous.
fn derivatives(
    findings: &mut Findings,
    all: &[Variable],
    by_number: &HashMap<u64, &Variable>,
    is_second: bool,
) {
    for (at, variable) in all.iter().enumerate() {
        let Some(text) = variable.typed.attribute("derivative") else {
            continue;
        };
        let own = if is_second {
            Some(at as u64 + 1)
        } else {
            variable.reference()
        };
        let state = text.trim().parse::<u64>().ok();
        let name = variable.name;
        let message = match state.and_then(|state| by_number.get(&state)) {
            _ if state.is_some() && state == own => format!("`{name}` is its own derivative"),
            None => format!("`{name}` is the derivative of `{text}`, which is not a variable"),
            Some(state) if state.variability != "continuous" => {
                let state = state.name;
                format!("`{name}` is the derivative of `{state}`, which is not continuous")
            }
            Some(_) => continue,
        };
        let place = findings.place(variable.node);
        findings.error(&place, message);
    }
}

/// The clocks of a variable are clocks.
fn clocks(findings: &mut Findings, all: &[Variable], by_number: &HashMap<u64, &Variable>) {
    for variable in all {
        let clocks = variable.node.attribute("clocks").unwrap_or_default();
        for text in clocks.split_whitespace() {
            let found = text
                .parse()
                .ok()
                .and_then(|number: u64| by_number.get(&number));
            if found.is_none_or(|clock| clock.kind != "Clock") {
                let place = findings.place(variable.node);
                let message = format!("`{}`: the clock `{text}` is not a clock", variable.name);
                findings.error(&place, message);
            }
        }
    }
}

/// One variable of an alias set has a start value at most (FMI 2.0).
fn alias_starts(findings: &mut Findings, all: &[Variable]) {
    let mut started: HashMap<(&str, u64), &Variable> = HashMap::new();
    for variable in all.iter().filter(|variable| variable.has_start) {
        let Some(reference) = variable.reference() else {
            continue;
        };
        // Constants of one value may share a reference.
        if variable.variability == "constant" {
            continue;
        }
        if let Some(first) = started.insert((variable.kind, reference), variable) {
            let place = findings.place(variable.node);
            let message = format!(
                "`{}` and `{}` are aliases and both have a start value",
                first.name, variable.name
            );
            findings.error(&place, message);
        }
    }
}
