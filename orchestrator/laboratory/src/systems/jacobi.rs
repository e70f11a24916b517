//! What a master that steps all components from the same values adds to a loop.

use std::collections::BTreeMap;
use units::vocabulary;

use fmi_system::Origin;
use fmi_system::Setting;
use fmi_system::SystemFile;

/// Tells the controllers in `file` that predict over a delay how many samples a master adds that
/// steps all components from the same values. There is one for each sampled component that a value
/// passes between measurement and valve. What a file says itself stays, but for a built-in system,
/// whose delay is that of its rig.
///
/// A component is one of these by its parameters: `has` says whether an FMU has one.
pub fn know_jacobi(
    file: &mut SystemFile,
    is_built_in: bool,
    has: &mut dyn FnMut(&str, &str) -> bool,
) {
    const LOOP: &str = vocabulary::LOOP_DELAY_SAMPLES;
    const COMMAND: &str = vocabulary::COMMAND_DELAY_SAMPLES;
    /// Of a law that predicts the sampled law below it: its loop begins there.
    const LAW_BELOW: &str = "continuous_law";
    let sampled = |name: &String| {
        file.components
            .get(name)
            .is_some_and(|part| part.period.is_some())
    };
    let mut next: BTreeMap<&String, Vec<&String>> = BTreeMap::new();
    for link in &file.connections {
        if let Origin::Output(from) = &link.from {
            next.entry(&from.component)
                .or_default()
                .push(&link.to.component);
        }
    }
    let mut found = Vec::new();
    for (name, part) in &file.components {
        if !sampled(name) || !has(&part.fmu, LOOP) {
            continue;
        }
        let through = !has(&part.fmu, LAW_BELOW);
        let longest = |start: &String| longest_path(start, &next, &sampled, name, through);
        let starts = file.components.keys().filter(|name| !sampled(name));
        let hops = starts.filter_map(longest).max();
        if let Some(hops) = hops {
            let mut told = vec![(LOOP, hops)];
            if has(&part.fmu, COMMAND) {
                told.push((COMMAND, 1));
            }
            found.push((name.clone(), told));
        }
    }
    for (name, told) in found {
        let Some(part) = file.components.get_mut(&name) else {
            continue;
        };
        for (parameter, samples) in told {
            let own = match part.parameters.get(parameter) {
                Some(Setting::Integer(own)) if is_built_in => *own,
                Some(_) => continue,
                None => 0,
            };
            part.set(parameter, own + samples);
        }
    }
}

/// Sampled components on the longest way from `at` to a component that is none, through the
/// component `by` where `through` is set and past it otherwise.
fn longest_path(
    at: &String,
    next: &BTreeMap<&String, Vec<&String>>,
    sampled: &impl Fn(&String) -> bool,
    by: &String,
    through: bool,
) -> Option<i64> {
    fn walk<'a>(
        at: &'a String,
        next: &BTreeMap<&'a String, Vec<&'a String>>,
        sampled: &impl Fn(&String) -> bool,
        seen: &mut Vec<&'a String>,
        fits: &impl Fn(&[&String]) -> bool,
    ) -> Option<i64> {
        let mut most = None;
        for &to in next.get(at).into_iter().flatten() {
            if !sampled(to) {
                if !seen.is_empty() && fits(seen) {
                    most = most.max(Some(seen.len() as i64));
                }
                continue;
            }
            if seen.contains(&to) {
                continue;
            }
            seen.push(to);
            most = most.max(walk(to, next, sampled, seen, fits));
            seen.pop();
        }
        most
    }
    let fits = |seen: &[&String]| seen.contains(&by) == through;
    walk(at, next, sampled, &mut Vec::new(), &fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_system::{ComponentFile, Link};

    const LOOP: &str = vocabulary::LOOP_DELAY_SAMPLES;

    /// Sensors, a controller, an interlock and a table, of which the table alone is continuous.
    fn file(own: Option<i64>) -> SystemFile {
        let mut file = SystemFile::default();
        for (name, is_sampled) in [
            ("sensors", true),
            ("control", true),
            ("interlock", true),
            ("table", false),
        ] {
            let mut part = ComponentFile::new(name);
            if is_sampled {
                part = part.period(Setting::Text("2 ms".into()));
            }
            file.add(name, part);
        }
        if let (Some(own), Some(control)) = (own, file.components.get_mut("control")) {
            control.set(LOOP, own);
        }
        let links = [
            "table.displacement -> sensors.displacement",
            "sensors.measured_displacement -> control.displacement",
            "control.valve_command -> interlock.controller_command",
            "interlock.valve_command -> table.valve_command",
            "interlock.tripped -> control.tripped",
        ];
        file.connections = links
            .map(|text| Link::try_from(text.to_string()).unwrap())
            .to_vec();
        file
    }

    fn told(mut file: SystemFile, is_built_in: bool, known: &[(&str, &str)]) -> Vec<(String, i64)> {
        know_jacobi(&mut file, is_built_in, &mut |fmu, parameter| {
            known.contains(&(fmu, parameter))
        });
        let control = &file.components["control"].parameters;
        let whole = control.iter().filter_map(|(name, value)| match value {
            Setting::Integer(samples) => Some((name.clone(), *samples)),
            _ => None,
        });
        whole.collect()
    }

    #[test]
    fn every_sampled_component_of_the_loop_is_a_sample_late() {
        let own = ("control", LOOP);
        let samples = |count| vec![(LOOP.to_string(), count)];
        assert_eq!(told(file(None), false, &[own]), samples(3));
        // What a file says stays; a built-in system says the delay of its rig.
        assert_eq!(told(file(Some(2)), false, &[own]), samples(2));
        assert_eq!(told(file(Some(2)), true, &[own]), samples(5));
        // A component that knows no delay is told none.
        assert_eq!(told(file(None), false, &[("sensors", LOOP)]), []);
        let command = ("control", vocabulary::COMMAND_DELAY_SAMPLES);
        let mut both = samples(3);
        both.push((command.1.to_string(), 1));
        both.sort();
        assert_eq!(told(file(None), false, &[own, command]), both);
        // Of a law that predicts the law below it, ways past it count: there is none here.
        assert_eq!(
            told(file(None), false, &[own, ("control", "continuous_law")]),
            []
        );
    }
}
