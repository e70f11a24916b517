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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;
    use fmi_master::{Ended, Record};

    #[test]
    fn each_warning_is_told_with_its_first_time_and_samples() {
        let word = r#"<Enumeration name="warning" declaredType="Word" valueReference="1" causality="output"
            variability="discrete"/>"#;
        let real = made::real(1, "warning", "output", "");
        let system = made::system(vec![
            made::component("interlock", word),
            made::component("other", &real),
            made::component("silent", word),
        ]);
        let columns = ["time", "interlock.warning", "other.warning"]
            .map(String::from)
            .to_vec();
        let rows = [0.0, 5.0, 2.0, 5.0, 9.0, 2.0];
        let outcome = |ended: Ended| {
            let mut record = Record::with_capacity(columns.clone(), rows.len());
            for (n, value) in rows.iter().enumerate() {
                record.push(0.25 * n as f64, &[*value, 1.0], &[]);
            }
            fmi_master::Outcome {
                record,
                ended,
                steps: rows.len(),
                step: 0.25,
                simulated: 1.0,
                variable: None,
                wall: 1.0,
                spent: Vec::new(),
                messages: Vec::new(),
                notes: Vec::new(),
                real_time: None,
                changes: Vec::new(),
            }
        };
        assert_eq!(
            warned(&system, &outcome(Ended::Complete)),
            [
                "`interlock` warned at 0.250 s (2 samples): far",
                "`interlock` warned at 0.500 s (2 samples): near a limit",
                "`interlock` warned at 1.000 s (1 sample): warning 9",
            ]
        );
        // What was warned of when the run was stopped is its end.
        let stopped = warned(&system, &outcome(Ended::Interrupted { time: 0.5 }));
        assert_eq!(stopped, ["`interlock` warned at 0.250 s (1 sample): far"]);
    }
}
