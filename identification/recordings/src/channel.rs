//! The quantities that a rig's recording may hold: name, SI unit and what else people call them.

use units::Unit;
use units::vocabulary;

/// A quantity of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Time stamps, s.
    Time,
    /// Command to the servo valve, V.
    ValveCommand,
    /// Displacement of the table, m.
    Displacement,
    /// Velocity of the table, m/s.
    Velocity,
    /// Acceleration of the table, m/s².
    Acceleration,
    /// Force of the actuator on the table, N.
    ActuatorForce,
    /// Absolute acceleration of the specimen, m/s².
    SpecimenAcceleration,
    /// Displacement that was asked for, m.
    Reference,
    /// A quantity of another kind of rig.
    Other {
        /// Its name.
        name: &'static str,
        /// Its SI unit.
        unit: &'static str,
    },
}

/// Names of [`Channel::OUTPUTS`].
pub const OUTPUT_NAMES: [&str; 4] = [
    Channel::OUTPUTS[0].name(),
    Channel::OUTPUTS[1].name(),
    Channel::OUTPUTS[2].name(),
    Channel::OUTPUTS[3].name(),
];

impl Channel {
    /// What the sensors of a shake table measure, in the order in which models put their outputs
    /// out.
    pub const OUTPUTS: [Self; 4] = [
        Self::Displacement,
        Self::Acceleration,
        Self::ActuatorForce,
        Self::SpecimenAcceleration,
    ];

    /// The channels that are known by name.
    pub const KNOWN: [Self; 8] = [
        Self::Time,
        Self::ValveCommand,
        Self::Displacement,
        Self::Velocity,
        Self::Acceleration,
        Self::ActuatorForce,
        Self::SpecimenAcceleration,
        Self::Reference,
    ];

    /// Name, SI unit, and other names, in lower case with `_` for blanks.
    const fn properties(self) -> (&'static str, &'static str, &'static [&'static str]) {
        match self {
            Self::Time => ("time", "s", &["t"]),
            Self::ValveCommand => (
                vocabulary::VALVE_COMMAND,
                "V",
                &["u", "command", "valve_voltage"],
            ),
            Self::Displacement => (
                "displacement",
                "m",
                &[
                    "x",
                    "disp",
                    "position",
                    vocabulary::TABLE_DISPLACEMENT,
                    "x_meas",
                    vocabulary::MEASURED_DISPLACEMENT,
                ],
            ),
            Self::Velocity => ("velocity", "m/s", &["v", "vel", vocabulary::TABLE_VELOCITY]),
            Self::Acceleration => (
                "acceleration",
                "m/s^2",
                &["a", "acc", "accel", vocabulary::TABLE_ACCELERATION],
            ),
            Self::ActuatorForce => (
                vocabulary::ACTUATOR_FORCE,
                "N",
                &["f", "force", "load_cell"],
            ),
            Self::SpecimenAcceleration => (
                vocabulary::SPECIMEN_ACCELERATION,
                "m/s^2",
                &["a_s", "specimen_accel"],
            ),
            Self::Reference => (
                "reference",
                "m",
                &[
                    "x_ref",
                    "ref",
                    "setpoint",
                    vocabulary::REFERENCE_DISPLACEMENT,
                    "x_cmd",
                    "displacement_command",
                ],
            ),
            Self::Other { name, unit } => (name, unit, &[]),
        }
    }

    /// Its name in files and messages.
    pub const fn name(self) -> &'static str {
        self.properties().0
    }

    /// Its SI unit.
    pub const fn unit(self) -> &'static str {
        self.properties().1
    }

    /// Other names that a header may use.
    pub const fn aliases(self) -> &'static [&'static str] {
        self.properties().2
    }

    /// The known channel of a name or other name, in any capitals, with blanks or hyphens for `_`.
    pub fn named(name: &str) -> Option<Self> {
        let name = normalised(name);
        Self::KNOWN
            .into_iter()
            .find(|channel| channel.name() == name || channel.aliases().contains(&name.as_str()))
    }
}

/// A header cell that names a known channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Heading<'a> {
    /// The channel.
    pub channel: Channel,
    /// Its name as written.
    pub name: &'a str,
    /// The text of the unit, if it is there.
    pub unit: Option<&'a str>,
}

impl<'a> Heading<'a> {
    /// Reads `name [unit]`, `name (unit)`, `name`, `name / unit` or `name_unit`; none where the
    /// name is not that of a known channel.
    pub fn parse(cell: &'a str) -> Option<Self> {
        let cell = cell.trim();
        let heading = |name: &'a str, unit: Option<&'a str>| {
            let (name, unit) = (name.trim(), unit.map(str::trim));
            let channel = Channel::named(name)?;
            let unit = unit.filter(|unit| !unit.is_empty());
            Some(Self {
                channel,
                name,
                unit,
            })
        };
        let square = cell
            .strip_suffix(']')
            .and_then(|rest| rest.rsplit_once('['));
        let round = || cell.strip_suffix(')')?.split_once('(');
        if let Some((name, unit)) = square.or_else(round) {
            return heading(name, Some(unit));
        }
        if let Some(found) = heading(cell, None) {
            return Some(found);
        }
        if let Some((name, unit)) = cell.split_once('/')
            && Unit::parse(unit).is_ok()
            && let Some(found) = heading(name, Some(unit))
        {
            return Some(found);
        }
        cell.match_indices('_').find_map(|(at, _)| {
            let unit = &cell[at + 1..];
            (!unit.is_empty() && Unit::parse(&underscored(unit)).is_ok())
                .then(|| heading(&cell[..at], Some(unit)))?
        })
    }

    /// Whether the name is the channel's own, not another one for it.
    pub fn is_own_name(&self) -> bool {
        normalised(self.name) == self.channel.name()
    }

    /// The unit in the grammar of units.
    pub fn unit_text(&self) -> Option<String> {
        self.unit.map(underscored)
    }
}

/// `mm_s` of `v_mm_s` is `mm/s`.
fn underscored(unit: &str) -> String {
    unit.replace('_', "/")
}

fn normalised(name: &str) -> String {
    let words: Vec<String> = name
        .split(|c: char| c.is_whitespace() || c == '_' || c == '-')
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
        .collect();
    words.join("_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_as_laboratories_write_them() {
        let read = |cell: &'static str| {
            Heading::parse(cell).map(|h| (h.channel, h.unit_text().unwrap_or_default()))
        };
        let cases = [
            ("time [s]", Channel::Time, "s"),
            ("Time (ms)", Channel::Time, "ms"),
            ("TIME[ms]", Channel::Time, "ms"),
            ("t_s", Channel::Time, "s"),
            ("a_g", Channel::Acceleration, "g"),
            ("t / s", Channel::Time, "s"),
            ("Valve Command [V]", Channel::ValveCommand, "V"),
            ("valve-command [V]", Channel::ValveCommand, "V"),
            ("valve_command_mV", Channel::ValveCommand, "mV"),
            ("v_mm_s", Channel::Velocity, "mm/s"),
            ("acceleration_m_s2", Channel::Acceleration, "m/s2"),
            ("actuator_force", Channel::ActuatorForce, ""),
            ("Actuator Force (kN)", Channel::ActuatorForce, "kN"),
            ("displacement []", Channel::Displacement, ""),
            ("x_ref [mm]", Channel::Reference, "mm"),
            ("x_cmd_mm", Channel::Reference, "mm"),
        ];
        for (cell, channel, unit) in cases {
            assert_eq!(read(cell), Some((channel, unit.to_string())), "{cell}");
        }
        for cell in [
            "remark",
            "u[1] [V]",
            "displacement_left [mm]",
            "",
            "12.5",
            "_",
        ] {
            assert_eq!(read(cell), None, "{cell}");
        }
    }
}
