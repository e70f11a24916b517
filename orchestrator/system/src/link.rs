//! Connections by names, `"table.displacement -> control.measured_displacement"`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::passage::Way;
use fmi_import::BaseUnit;
use units::hint;

/// A variable of a component, `component.variable`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "String")]
pub struct VariableName {
    /// The component's name in the system.
    pub component: String,
    /// The variable's name, which may have points in it.
    pub variable: String,
}

/// Where a connection begins.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Origin {
    /// The motion that the table is asked for.
    Reference {
        /// What of it.
        quantity: Quantity,
        /// How many samples ahead of the present one; negative: before it.
        ahead: isize,
    },
    /// An output of a component.
    Output(VariableName),
}

/// What of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// Displacement, m.
    Displacement,
    /// Velocity, m/s.
    Velocity,
    /// Acceleration, m/s².
    Acceleration,
    /// Displacement along a second axis, m.
    DisplacementY,
    /// Velocity along a second axis, m/s.
    VelocityY,
    /// Acceleration along a second axis, m/s².
    AccelerationY,
}

impl Quantity {
    /// All of them, in the order of their results: one axis after the other.
    pub const ALL: [Self; 6] = [
        Self::Displacement,
        Self::Velocity,
        Self::Acceleration,
        Self::DisplacementY,
        Self::VelocityY,
        Self::AccelerationY,
    ];
    /// Those of the first axis, or of a reference with a single one.
    pub const FIRST_AXIS: [Self; 3] = [Self::Displacement, Self::Velocity, Self::Acceleration];

    /// Whether it is along the second axis.
    pub fn is_second(self) -> bool {
        !Self::FIRST_AXIS.contains(&self)
    }

    /// The same along the second axis.
    #[must_use]
    pub fn second(self) -> Self {
        match self {
            Self::Displacement | Self::DisplacementY => Self::DisplacementY,
            Self::Velocity | Self::VelocityY => Self::VelocityY,
            Self::Acceleration | Self::AccelerationY => Self::AccelerationY,
        }
    }

    /// Its name as an output of `reference`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::DisplacementY => "displacement_y",
            Self::VelocityY => "velocity_y",
            Self::AccelerationY => "acceleration_y",
        }
    }

    /// Its unit in SI.
    pub fn base_unit(self) -> BaseUnit {
        let seconds = match self {
            Self::Displacement | Self::DisplacementY => 0,
            Self::Velocity | Self::VelocityY => -1,
            Self::Acceleration | Self::AccelerationY => -2,
        };
        BaseUnit {
            exponents: [0, 1, seconds, 0, 0, 0, 0],
            factor: 1.0,
            offset: 0.0,
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Displacement | Self::DisplacementY => "m",
            Self::Velocity | Self::VelocityY => "m/s",
            Self::Acceleration | Self::AccelerationY => "m/s2",
        }
    }
}

/// A connection by names, before they are looked up in the FMUs; as text `from -> to`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Link {
    /// Where the value comes from.
    pub from: Origin,
    /// The input that takes it.
    pub to: VariableName,
    /// What is done to the value on its way, besides conversions between the FMUs' units.
    pub way: Way,
    /// Its line in the file.
    pub line: Option<usize>,
}

/// Samples further ahead or behind are mistakes.
const FARTHEST: isize = 100_000;

impl VariableName {
    /// The variable of a component.
    pub fn new(component: &str, variable: &str) -> Self {
        Self {
            component: component.to_string(),
            variable: variable.to_string(),
        }
    }
}

/// Why a text is not a connection, or an end of one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// An end without a component.
    #[error("`{0}` should read component.variable")]
    Name(String),
    /// A quantity that the reference does not have.
    #[error("the reference has no `{name}`{hint} (or `displacement[3]`, three samples ahead)")]
    Reference {
        /// What was looked for.
        name: String,
        /// The nearest name.
        hint: String,
    },
    /// No arrow between two ends.
    #[error("expected \"component.output -> component.input\"")]
    Arrow,
    /// Ranges of two lengths.
    #[error("{left} values on the left and {right} on the right")]
    Counts {
        /// Values on the left.
        left: usize,
        /// Values on the right.
        right: usize,
    },
    /// A range that cannot be read.
    #[error("`{0}` has no range such as [1..15]")]
    Range(String),
}

impl FromStr for VariableName {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let (component, variable) = text
            .split_once('.')
            .ok_or_else(|| LinkError::Name(text.to_string()))?;
        Ok(Self::new(component, variable))
    }
}

impl TryFrom<String> for VariableName {
    type Error = LinkError;

    fn try_from(text: String) -> Result<Self, LinkError> {
        text.parse()
    }
}

impl fmt::Display for VariableName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.component, self.variable)
    }
}

impl Origin {
    /// An output of a component.
    pub fn output(component: &str, variable: &str) -> Self {
        Self::Output(VariableName::new(component, variable))
    }

    /// The reference at the present sample.
    pub fn reference(quantity: Quantity) -> Self {
        Self::Reference { quantity, ahead: 0 }
    }
}

impl FromStr for Origin {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let name: VariableName = text.parse()?;
        if name.component != "reference" {
            return Ok(Self::Output(name));
        }
        reference(&name.variable).ok_or_else(|| {
            let known = Quantity::ALL.into_iter().map(Quantity::name);
            LinkError::Reference {
                hint: hint(&name.variable, known),
                name: name.variable,
            }
        })
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reference { quantity, ahead: 0 } => write!(f, "reference.{}", quantity.name()),
            Self::Reference { quantity, ahead } => {
                write!(f, "reference.{}[{ahead}]", quantity.name())
            }
            Self::Output(name) => name.fmt(f),
        }
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} -> {}", self.from, self.to)
    }
}

impl From<Link> for String {
    fn from(link: Link) -> Self {
        link.to_string()
    }
}

impl TryFrom<String> for Link {
    type Error = LinkError;

    fn try_from(text: String) -> Result<Self, LinkError> {
        let (from, to) = ends(&text)?;
        Ok(Self {
            from: from.parse()?,
            to: to.parse()?,
            way: Way::default(),
            line: None,
        })
    }
}

impl Link {
    /// Where it stands, for messages.
    pub(super) fn place(&self) -> String {
        match self.line {
            Some(line) => format!("connection `{self}` (line {line})"),
            None => format!("connection `{self}`"),
        }
    }
}

/// Both sides of a connection.
fn ends(text: &str) -> Result<(&str, &str), LinkError> {
    let (from, to) = text.split_once("->").ok_or(LinkError::Arrow)?;
    Ok((from.trim(), to.trim()))
}

/// The connections that a text stands for; `[a..b]` on both sides stands for several.
///
/// # Errors
/// What was expected.
pub(super) fn parse(text: &str, line: usize) -> Result<Vec<Link>, LinkError> {
    let (from, to) = ends(text)?;
    let (from, to) = (expand(from)?, expand(to)?);
    if from.len() != to.len() {
        let (left, right) = (from.len(), to.len());
        return Err(LinkError::Counts { left, right });
    }
    let link = |(from, to): (String, String)| {
        Ok(Link {
            from: from.parse()?,
            to: to.parse()?,
            way: Way::default(),
            line: Some(line),
        })
    };
    from.into_iter().zip(to).map(link).collect()
}

fn expand(end: &str) -> Result<Vec<String>, LinkError> {
    let range = end
        .strip_suffix(']')
        .and_then(|rest| rest.rsplit_once('['))
        .and_then(|(name, range)| Some((name, range.split_once("..")?)));
    let Some((name, (first, last))) = range else {
        return Ok(vec![end.to_string()]);
    };
    let bound = |text: &str| text.trim().parse::<usize>().ok().filter(|&n| n < 100_000);
    match (bound(first), bound(last)) {
        (Some(first), Some(last)) if first <= last => Ok((first..=last)
            .map(|index| format!("{name}[{index}]"))
            .collect()),
        _ => Err(LinkError::Range(end.to_string())),
    }
}

/// `displacement` or `displacement[3]` of the reference.
fn reference(variable: &str) -> Option<Origin> {
    let (name, ahead) = match variable.strip_suffix(']') {
        None => (variable, 0),
        Some(rest) => {
            let (name, index) = rest.split_once('[')?;
            let ahead: isize = index.trim().parse().ok()?;
            (name, Some(ahead).filter(|ahead| ahead.abs() < FARTHEST)?)
        }
    };
    let quantity = Quantity::ALL.into_iter().find(|q| q.name() == name)?;
    Some(Origin::Reference { quantity, ahead })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_has_two_axes() {
        for text in [
            "reference.displacement",
            "reference.velocity_y",
            "reference.acceleration_y[3]",
        ] {
            let origin: Origin = text.parse().unwrap();
            assert_eq!(origin.to_string(), text);
        }
        let Origin::Reference { quantity, ahead } = "reference.acceleration_y[3]".parse().unwrap()
        else {
            panic!("a reference")
        };
        assert_eq!((quantity, ahead), (Quantity::Acceleration.second(), 3));
        assert!(quantity.is_second() && !Quantity::Acceleration.is_second());
        let refused = "reference.displacement_z".parse::<Origin>().unwrap_err();
        assert!(
            matches!(&refused, LinkError::Reference { name, .. } if name == "displacement_z"),
            "{refused}"
        );
    }
}
