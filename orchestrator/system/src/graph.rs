//! The order of calls at a sample, from what the FMUs' `ModelStructure` declares.
//!
//! An output of a continuous component is known as soon as the inputs on which it depends directly
//! are known. A sampled component can be called as soon as all inputs are known on which any of its
//! outputs depends directly. Other inputs of a sampled component take the value of the last sample,
//! if no newer one is known.

use std::collections::{BTreeSet, HashMap};

use super::checked::{Connection, Source, System};
use super::error::SystemError;
use fmi_import::Causality;

/// A thing to do at a sample.
#[derive(Debug, Clone, PartialEq)]
pub enum Operation {
    /// Set the inputs that these outputs of a continuous component depend on, then read them.
    Read {
        /// The component.
        component: usize,
        /// Positions of the outputs.
        outputs: Vec<usize>,
    },
    /// Set the inputs of a sampled component, step it over its period, read its outputs.
    Call {
        /// The component.
        component: usize,
    },
    /// Find values for these that agree with each other.
    Iterate {
        /// What is done in a pass.
        operations: Vec<Operation>,
        /// The variables round a loop among them, the first one again at the end.
        round: Vec<String>,
    },
}

/// What is done at a sample, in order; afterwards the continuous components step.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// The operations.
    pub operations: Vec<Operation>,
}

/// Outputs of a continuous component that depend on the same inputs, or a whole sampled one.
#[derive(Debug, Clone)]
struct Node {
    component: usize,
    /// Positions; none for a sampled component.
    outputs: Option<Vec<usize>>,
}

impl System {
    /// The order in which outputs become known and components are called at a sample.
    ///
    /// # Errors
    /// A loop of direct feedthrough, unless `iterate` is set.
    pub fn schedule(&self, iterate: bool) -> Result<Schedule, SystemError> {
        schedule(self, iterate)
    }
}

fn schedule(system: &System, iterate: bool) -> Result<Schedule, SystemError> {
    let nodes = nodes(system);
    let graph = Graph::new(system, &nodes);
    let predecessors: Vec<Vec<usize>> = nodes
        .iter()
        .map(|node| {
            let sources = graph.drivers(node).into_iter();
            let mut before: Vec<usize> = sources
                .filter_map(|connection| graph.node_of(connection.source))
                .collect();
            before.sort_unstable();
            before.dedup();
            before
        })
        .collect();
    let groups = strongly_connected(&predecessors);
    let mut level = vec![0; nodes.len()];
    let mut operations: Vec<(usize, Operation)> = Vec::new();
    // Each group comes after those that it depends on.
    for group in groups {
        let own = |p: &usize| group.binary_search(p).is_ok();
        let is_loop = group.len() > 1 || predecessors[group[0]].contains(&group[0]);
        if is_loop && !iterate {
            return Err(SystemError::Cycle {
                system: system.name.clone(),
                variables: variables_round(&graph, &predecessors, &group),
            });
        }
        let before = group
            .iter()
            .flat_map(|&n| &predecessors[n])
            .filter(|p| !own(p));
        let at = before.map(|&p| level[p] + 1).max().unwrap_or(0);
        for &node in &group {
            level[node] = at;
        }
        let mut parts: Vec<_> = group.iter().map(|&n| operation(&nodes[n])).collect();
        if is_loop {
            let round = variables_round(&graph, &predecessors, &group);
            let of_loop = Operation::Iterate {
                operations: parts,
                round,
            };
            operations.push((at, of_loop));
        } else {
            operations.push((at, parts.remove(0)));
        }
    }
    operations.sort_by_key(|(level, operation)| (*level, order(operation)));
    let mut merged: Vec<(usize, Operation)> = Vec::new();
    for (at, next) in operations {
        if let (
            Some((level, Operation::Read { component, outputs })),
            Operation::Read {
                component: same,
                outputs: more,
            },
        ) = (merged.last_mut(), &next)
            && *level == at
            && component == same
        {
            outputs.extend(more);
            continue;
        }
        merged.push((at, next));
    }
    for (_, operation) in &mut merged {
        if let Operation::Read { outputs, .. } = operation {
            outputs.sort_unstable();
        }
    }
    Ok(Schedule {
        operations: merged.into_iter().map(|(_, operation)| operation).collect(),
    })
}

fn nodes(system: &System) -> Vec<Node> {
    let mut nodes = Vec::new();
    for (component, part) in system.components.iter().enumerate() {
        if part.period.is_some() {
            nodes.push(Node {
                component,
                outputs: None,
            });
            continue;
        }
        let description = &part.fmu.description;
        // Outputs with the same list of dependencies share it.
        let mut alike: HashMap<*const usize, usize> = HashMap::new();
        for output in description.of(Causality::Output) {
            let variable = &description.variables[output];
            let place = *alike
                .entry(variable.dependencies.as_ptr())
                .or_insert_with(|| {
                    nodes.push(Node {
                        component,
                        outputs: Some(Vec::new()),
                    });
                    nodes.len() - 1
                });
            if let Some(outputs) = &mut nodes[place].outputs {
                outputs.push(output);
            }
        }
    }
    nodes
}

/// Nodes and connections, found by what they belong to.
struct Graph<'a> {
    system: &'a System,
    nodes: &'a [Node],
    /// Connections to an input.
    incoming: HashMap<(usize, usize), &'a Connection>,
    /// The node of a continuous component's output.
    of_output: HashMap<(usize, usize), usize>,
    /// The node of a sampled component.
    of_component: HashMap<usize, usize>,
}

impl<'a> Graph<'a> {
    fn new(system: &'a System, nodes: &'a [Node]) -> Self {
        let connections = system.connections.iter();
        let mut graph = Self {
            system,
            nodes,
            incoming: connections.map(|c| ((c.component, c.input), c)).collect(),
            of_output: HashMap::new(),
            of_component: HashMap::new(),
        };
        for (place, node) in nodes.iter().enumerate() {
            match &node.outputs {
                None => {
                    graph.of_component.insert(node.component, place);
                }
                Some(outputs) => {
                    let all = outputs
                        .iter()
                        .map(|&output| ((node.component, output), place));
                    graph.of_output.extend(all);
                }
            }
        }
        graph
    }

    /// The connections that must have been carried out before `node`.
    fn drivers(&self, node: &Node) -> Vec<&'a Connection> {
        let description = &self.system.components[node.component].fmu.description;
        let driver = |input: &usize| self.incoming.get(&(node.component, *input)).copied();
        match &node.outputs {
            Some(outputs) => {
                let first = outputs
                    .first()
                    .map(|&output| &description.variables[output]);
                let inputs = first.map_or(&[][..], |output| &output.dependencies[..]);
                inputs.iter().filter_map(driver).collect()
            }
            None => {
                let outputs = description.of(Causality::Output);
                let mut lists = HashMap::new();
                for output in outputs {
                    let list = &description.variables[output].dependencies;
                    lists.insert(list.as_ptr(), list);
                }
                let inputs: BTreeSet<usize> = lists
                    .values()
                    .flat_map(|list| list.iter().copied())
                    .collect();
                inputs.iter().filter_map(driver).collect()
            }
        }
    }

    fn node_of(&self, source: Source) -> Option<usize> {
        let Source::Output {
            component,
            variable,
        } = source
        else {
            return None;
        };
        let sampled = self.of_component.get(&component);
        sampled
            .or_else(|| self.of_output.get(&(component, variable)))
            .copied()
    }
}

fn operation(node: &Node) -> Operation {
    let component = node.component;
    match &node.outputs {
        None => Operation::Call { component },
        Some(outputs) => Operation::Read {
            component,
            outputs: outputs.clone(),
        },
    }
}

fn order(operation: &Operation) -> (usize, usize) {
    match operation {
        Operation::Read { component, outputs } => (*component, outputs[0]),
        Operation::Call { component } => (*component, 0),
        Operation::Iterate { operations, .. } => {
            operations.iter().map(order).min().unwrap_or_default()
        }
    }
}

/// Tarjan's algorithm over edges to predecessors: groups come after what they depend on.
fn strongly_connected(predecessors: &[Vec<usize>]) -> Vec<Vec<usize>> {
    struct Search<'a> {
        edges: &'a [Vec<usize>],
        index: Vec<Option<usize>>,
        low: Vec<usize>,
        stack: Vec<usize>,
        on_stack: Vec<bool>,
        next: usize,
        groups: Vec<Vec<usize>>,
    }
    impl Search<'_> {
        fn visit(&mut self, node: usize) {
            (self.index[node], self.low[node]) = (Some(self.next), self.next);
            self.next += 1;
            self.stack.push(node);
            self.on_stack[node] = true;
            for &to in &self.edges[node] {
                match self.index[to] {
                    None => {
                        self.visit(to);
                        self.low[node] = self.low[node].min(self.low[to]);
                    }
                    Some(index) if self.on_stack[to] => {
                        self.low[node] = self.low[node].min(index);
                    }
                    Some(_) => {}
                }
            }
            if Some(self.low[node]) == self.index[node] {
                let mut group = Vec::new();
                while let Some(member) = self.stack.pop() {
                    self.on_stack[member] = false;
                    group.push(member);
                    if member == node {
                        break;
                    }
                }
                group.sort_unstable();
                self.groups.push(group);
            }
        }
    }
    let n = predecessors.len();
    let mut search = Search {
        edges: predecessors,
        index: vec![None; n],
        low: vec![0; n],
        stack: Vec::new(),
        on_stack: vec![false; n],
        next: 0,
        groups: Vec::new(),
    };
    for node in 0..n {
        if search.index[node].is_none() {
            search.visit(node);
        }
    }
    search.groups
}

/// Names the variables round a loop in the group, in the direction in which values travel.
fn variables_round(graph: &Graph, predecessors: &[Vec<usize>], group: &[usize]) -> Vec<String> {
    // Walk against the direction of the values until a node comes again.
    let mut path = vec![group[0]];
    let start = loop {
        let last = path[path.len() - 1];
        let Some(&before) = predecessors[last].iter().find(|p| group.contains(p)) else {
            break 0;
        };
        if let Some(at) = path.iter().position(|&node| node == before) {
            break at;
        }
        path.push(before);
    };
    let system = graph.system;
    let round: Vec<usize> = path[start..].iter().rev().copied().collect();
    let mut variables = Vec::new();
    for (step, &node) in round.iter().enumerate() {
        let from = round[(step + round.len() - 1) % round.len()];
        let drivers = graph.drivers(&graph.nodes[node]);
        let mut drivers = drivers.into_iter();
        let connection = drivers.find(|c| graph.node_of(c.source) == Some(from));
        if let Some(connection) = connection {
            variables.push(system.origin(connection.source).to_string());
            let input = system.variable_name(connection.component, connection.input);
            variables.push(input.to_string());
        }
    }
    variables.extend(variables.first().cloned());
    variables
}
