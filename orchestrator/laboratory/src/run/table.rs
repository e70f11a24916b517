//! Which component of a system is the table.

use super::manifest::Manifest;
use fmi_master::Record;
use fmi_system::{Link, Origin};
use units::vocabulary;

/// The component that is the table: `table`, or the first with a displacement, velocity and
/// acceleration that takes a valve command.
pub struct Table<'a> {
    name: &'a str,
    /// The outputs that drive the valve, the controller's first, as `component.variable`.
    pub valve: Vec<String>,
}

impl<'a> Table<'a> {
    /// The table of a run that was kept.
    pub fn find(manifest: &'a Manifest, record: &Record) -> Option<Self> {
        let names = manifest.components.keys().map(String::as_str);
        Self::among(names, &manifest.connections, record)
    }

    /// As [`Table::find`], among components of these names, in alphabetical order.
    pub fn among(
        mut names: impl Iterator<Item = &'a str> + Clone,
        connections: &[Link],
        record: &Record,
    ) -> Option<Self> {
        let name = match names.clone().find(|name| *name == "table") {
            Some(name) => name,
            None => names.find(|name| moves(name, connections, record))?,
        };
        Some(Self::of(name, connections))
    }

    /// The table along the second axis: the first whose valve is driven by what follows the reference along that axis.
    pub fn second(
        mut names: impl Iterator<Item = &'a str>,
        connections: &[Link],
        record: &Record,
    ) -> Option<Self> {
        let name = names
            .find(|name| moves(name, connections, record) && follows_second(name, connections))?;
        Some(Self::of(name, connections))
    }

    fn of(name: &'a str, connections: &[Link]) -> Self {
        // Back from the valve: an interlock takes the controller's command.
        let mut commands = Vec::new();
        let mut at = valve(name, connections);
        while let Some(Origin::Output(output)) = at {
            let signal = output.to_string();
            if commands.contains(&signal) || commands.len() > 3 {
                break;
            }
            commands.push(signal);
            at = connections
                .iter()
                .find(|link| {
                    link.to.component == output.component
                        && link.to.variable == vocabulary::CONTROLLER_COMMAND
                })
                .map(|link| &link.from);
        }
        commands.reverse();
        Self {
            name,
            valve: commands,
        }
    }

    /// The signal that is an output of it.
    pub fn name(&self, output: &str) -> String {
        format!("{}.{output}", self.name)
    }
}

/// What drives the valve of the component `name`.
fn valve<'a>(name: &str, connections: &'a [Link]) -> Option<&'a Origin> {
    let mut links = connections.iter();
    links
        .find(|link| link.to.component == name && link.to.variable == vocabulary::VALVE_COMMAND)
        .map(|link| &link.from)
}

/// Whether the component `name` is a table: it takes a valve command and its motion is recorded.
fn moves(name: &str, connections: &[Link], record: &Record) -> bool {
    let mut outputs = ["displacement", "velocity", "acceleration"].into_iter();
    outputs.all(|output| record.columns.contains(&format!("{name}.{output}")))
        && valve(name, connections).is_some()
}

/// Whether the reference that is nearest to the valve of the component `name`, going back along the connections, is
/// that of the second axis alone.
fn follows_second(name: &str, connections: &[Link]) -> bool {
    let Some(Origin::Output(first)) = valve(name, connections) else {
        return false;
    };
    let mut seen = vec![first.component.as_str()];
    let mut from = 0;
    while from < seen.len() {
        let level = from..seen.len();
        from = seen.len();
        let into = |link: &&Link| seen[level.clone()].contains(&link.to.component.as_str());
        let sources: Vec<&Origin> = connections
            .iter()
            .filter(into)
            .map(|link| &link.from)
            .collect();
        let mut axes = sources.iter().filter_map(|source| match source {
            Origin::Reference { quantity, .. } => Some(quantity.is_second()),
            Origin::Output(_) => None,
        });
        if let Some(is_second) = axes.next() {
            return is_second && axes.all(|other| other);
        }
        for source in sources {
            if let Origin::Output(output) = source
                && !seen.contains(&output.component.as_str())
            {
                seen.push(&output.component);
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn links(texts: &[&str]) -> Vec<Link> {
        let texts = texts
            .iter()
            .map(|text| Link::try_from((*text).to_string()).unwrap());
        texts.collect()
    }

    fn record(tables: &[&str]) -> Record {
        let columns = tables.iter().flat_map(|name| {
            let outputs = ["displacement", "velocity", "acceleration"];
            outputs.map(|output| format!("{name}.{output}"))
        });
        Record::with_capacity(
            std::iter::once("time".to_string()).chain(columns).collect(),
            0,
        )
    }

    #[test]
    fn the_table_is_called_so_or_moves_by_a_valve_command() {
        let own = links(&[
            "reference.displacement -> control.reference_displacement",
            "control.valve_command -> interlock.controller_command",
            "interlock.valve_command -> rig.valve_command",
            "control.valve_command -> other.valve_command",
        ]);
        let names = ["control", "interlock", "other", "rig"];
        let among = |names: &[&'static str], record: &Record| {
            let found = Table::among(names.iter().copied(), &own, record)?;
            Some((found.name("displacement"), found.valve))
        };
        let commands = ["control.valve_command", "interlock.valve_command"]
            .map(String::from)
            .to_vec();
        // Back from the valve to the controller.
        let found = among(&names, &record(&["rig"]));
        assert_eq!(found, Some(("rig.displacement".to_string(), commands)));
        let both = among(&names, &record(&["other", "rig"])).unwrap();
        assert_eq!(both.0, "other.displacement");
        // What is called so is the table, even if nothing drives it.
        let named = among(&["other", "table"], &record(&["other"])).unwrap();
        assert_eq!(named, ("table.displacement".to_string(), Vec::new()));
        // A component whose motion is not recorded is none, nor one without a valve.
        assert_eq!(among(&names, &record(&["control"])), None);
        let thinned = Record::with_capacity(vec!["time".into(), "rig.displacement".into()], 0);
        assert_eq!(among(&names, &thinned), None);
    }

    #[test]
    fn the_second_table_follows_the_reference_of_the_second_axis() {
        let own = links(&[
            "reference.displacement -> control.reference_displacement",
            "control.valve_command -> table.valve_command",
            "reference.displacement_y -> control_y.reference_displacement",
            "control_y.valve_command -> table_y.valve_command",
            "table.force -> table_y.force",
        ]);
        let names = ["control", "control_y", "table", "table_y"];
        let recorded = record(&["table", "table_y"]);
        let second = |links: &[Link]| {
            let found = Table::second(names.into_iter(), links, &recorded);
            found.map(|own| own.name("x"))
        };
        assert_eq!(second(&own).as_deref(), Some("table_y.x"));
        // A controller of both axes is not that of the second.
        let mixed = links(&["reference.displacement -> control_y.other"]);
        assert_eq!(second(&[&own[..], &mixed].concat()), None);
        assert_eq!(second(&own[..2]), None);
    }
}
