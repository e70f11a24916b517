//! `"table.displacement -> control.measured_displacement"`.

/// Where a connection's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Source {
    /// The motion that the table is asked for.
    Reference {
        /// What of it.
        quantity: Quantity,
        /// How many samples ahead of the present one.
        ahead: usize,
    },
    /// An output of a component.
    Output {
        /// The component.
        component: usize,
        /// Position of the variable.
        variable: usize,
    },
}

/// What of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Displacement, m.
    Displacement,
    /// Velocity, m/s.
    Velocity,
    /// Acceleration, m/s².
    Acceleration,
}

impl Quantity {
    /// All of them, in the order of their results.
    pub const ALL: [Self; 3] = [Self::Displacement, Self::Velocity, Self::Acceleration];

    /// Its name as an output of `reference`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        }
    }

    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Displacement => "m",
            Self::Velocity => "m/s",
            Self::Acceleration => "m/s2",
        }
    }
}

/// The two ends of a connection as written; `[a..b]` on both sides stands for several.
///
/// # Errors
/// What was expected.
pub(super) fn parse(text: &str) -> Result<Vec<(String, String)>, String> {
    let (from, to) = text
        .split_once("->")
        .ok_or("expected \"component.output -> component.input\"")?;
    let (from, to) = (expand(from.trim())?, expand(to.trim())?);
    if from.len() != to.len() {
        return Err(format!(
            "{} values on the left and {} on the right",
            from.len(),
            to.len()
        ));
    }
    Ok(from.into_iter().zip(to).collect())
}

fn expand(end: &str) -> Result<Vec<String>, String> {
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
        _ => Err(format!("`{end}` has no range such as [1..15]")),
    }
}

/// `displacement` or `displacement[3]` of the reference.
pub(super) fn reference(variable: &str) -> Option<Source> {
    let (name, ahead) = match variable.strip_suffix(']') {
        None => (variable, 0),
        Some(rest) => {
            let (name, index) = rest.split_once('[')?;
            (
                name,
                index.trim().parse().ok().filter(|&ahead| ahead < 100_000)?,
            )
        }
    };
    let quantity = Quantity::ALL.into_iter().find(|q| q.name() == name)?;
    Some(Source::Reference { quantity, ahead })
}
