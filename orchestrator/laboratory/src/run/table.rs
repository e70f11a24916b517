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
        let valve = |name: &str| {
            let mut links = connections.iter();
            links
                .find(|link| {
                    link.to.component == name && link.to.variable == vocabulary::VALVE_COMMAND
                })
                .map(|link| &link.from)
        };
        let moves = |name: &str| {
            let mut outputs = ["displacement", "velocity", "acceleration"].into_iter();
            outputs.all(|output| record.columns.contains(&format!("{name}.{output}")))
                && valve(name).is_some()
        };
        let name = match names.clone().find(|name| *name == "table") {
            Some(name) => name,
            None => names.find(|name| moves(name))?,
        };
        // Back from the valve: an interlock takes the controller's command.
        let mut commands = Vec::new();
        let mut at = valve(name);
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
        Some(Self {
            name,
            valve: commands,
        })
    }

    /// The signal that is an output of it.
    pub fn name(&self, output: &str) -> String {
        format!("{}.{output}", self.name)
    }
}
