//! What components warned of during a run, such as an interlock near a limit.

use std::collections::BTreeMap;

use fmi_import::{Causality, Kind};
use fmi_master::Outcome;
use fmi_system::System;

/// The output by which a component warns: an enumeration whose 0 is nothing to warn of.
const WARNING: &str = "warning";

/// A sentence for each component and each of its warnings until the run was stopped, if it was.
pub(super) fn warned(system: &System, outcome: &Outcome) -> Vec<String> {
    let times = outcome.record.column("time").unwrap_or_default();
    let end = outcome.ended.time().unwrap_or(f64::INFINITY);
    let mut sentences = Vec::new();
    for component in &system.components {
        let description = &component.fmu.description;
        let output = description
            .position(WARNING)
            .map(|at| &description.variables[at]);
        let Some((variable, items)) = output.and_then(|variable| match &variable.kind {
            Kind::Enumeration(items) => Some((variable, items)),
            _ => None,
        }) else {
            continue;
        };
        let column = format!("{}.{WARNING}", component.name);
        let values = outcome.record.column(&column);
        let Some(values) = values.filter(|_| variable.causality == Causality::Output) else {
            continue;
        };
        // First time and samples of each.
        let mut found = BTreeMap::<i64, (f64, usize)>::new();
        for (time, value) in times.iter().zip(values).filter(|(time, _)| **time < end) {
            if value != 0.0 {
                found.entry(value as i64).or_insert((*time, 0)).1 += 1;
            }
        }
        let mut found: Vec<_> = found.into_iter().collect();
        found.sort_by(|(_, one), (_, other)| one.0.total_cmp(&other.0));
        sentences.extend(found.into_iter().map(|(value, (time, count))| {
            let item = items.iter().find(|item| item.value == value);
            let words = item.map_or(format!("warning {value}"), |item| {
                match item.description.as_str() {
                    "" => item.name.clone(),
                    words => words.to_string(),
                }
            });
            let samples = if count == 1 { "sample" } else { "samples" };
            format!(
                "`{}` warned at {time:.3} s ({count} {samples}): {words}",
                component.name
            )
        }));
    }
    sentences
}
