//! Ports of a component that belong together, so that tools connect them by name (FMI 3.0).

use units::vocabulary;

/// A group of variables that is connected as a whole.
///
/// Two terminals fit when kind and members do, whatever their variables are called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Terminal {
    /// Its name, unique in the component.
    pub name: &'static str,
    /// How two of them are matched.
    pub rule: MatchingRule,
    /// What it carries; only terminals of one kind fit.
    pub kind: &'static str,
    /// Members: name in the terminal, and the variable.
    pub members: &'static [(&'static str, &'static str)],
}

/// How the members of two connected terminals are matched by their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MatchingRule {
    /// Both have the same members.
    Plug,
    /// Members that both have are connected.
    Bus,
}

impl MatchingRule {
    /// Its name in the standard.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plug => "plug",
            Self::Bus => "bus",
        }
    }
}

impl Terminal {
    /// The motion that a table is asked for.
    pub const REFERENCE: Self = Self::bus(
        "reference",
        "reference",
        &[
            ("displacement", vocabulary::REFERENCE_DISPLACEMENT),
            ("velocity", vocabulary::REFERENCE_VELOCITY),
            ("acceleration", vocabulary::REFERENCE_ACCELERATION),
        ],
    );

    /// The motion of a table, as measured.
    pub const MEASURED: Self = Self::bus(
        "measured",
        "motion",
        &[
            ("displacement", vocabulary::MEASURED_DISPLACEMENT),
            ("velocity", vocabulary::MEASURED_VELOCITY),
            ("acceleration", vocabulary::MEASURED_ACCELERATION),
        ],
    );

    /// The command that the valve takes.
    pub const VALVE: Self = Self::plug("valve", "valve", &[("command", vocabulary::VALVE_COMMAND)]);

    /// The command of the controller before.
    pub const CONTROLLER: Self = Self::plug(
        "controller",
        "valve",
        &[("command", vocabulary::CONTROLLER_COMMAND)],
    );

    /// The displacement that an actuator is asked for.
    pub const DESIRED_DISPLACEMENT: Self = Self::bus(
        "reference",
        "reference",
        &[("displacement", "desired_displacement")],
    );

    /// The displacement that an actuator reaches, as measured.
    pub const MEASURED_DISPLACEMENT: Self = Self::bus(
        "measured",
        "motion",
        &[("displacement", vocabulary::MEASURED_DISPLACEMENT)],
    );

    /// The command that an actuator takes.
    pub const ACTUATOR: Self = Self::plug("command", "actuator-command", &[("command", "command")]);

    /// A terminal whose members have to be the same on both sides.
    pub const fn plug(
        name: &'static str,
        kind: &'static str,
        members: &'static [(&'static str, &'static str)],
    ) -> Self {
        Self {
            name,
            rule: MatchingRule::Plug,
            kind,
            members,
        }
    }

    /// A terminal of which each side takes the members it has.
    pub const fn bus(
        name: &'static str,
        kind: &'static str,
        members: &'static [(&'static str, &'static str)],
    ) -> Self {
        Self {
            rule: MatchingRule::Bus,
            ..Self::plug(name, kind, members)
        }
    }
}
