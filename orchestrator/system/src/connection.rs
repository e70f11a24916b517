//! Connections checked against the FMUs: names, types and units.

use super::checked::{Component, Connection, Source};
use super::error::Misfit;
use super::link::{Link, Origin};
use super::lookup::{component_index, find};
use super::passage::{End, WayError};
use super::table::InputTable;
use fmi_import::{Causality, Kind, Ticks, Variable};

/// Why a connection does not hold.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConnectionError {
    /// An end whose type cannot drive the other's.
    #[error("`{from}` is a {kind} and cannot drive the {other} `{to}`")]
    Types {
        /// Where it begins.
        from: String,
        /// The type there.
        kind: &'static str,
        /// Where it ends.
        to: String,
        /// The type there.
        other: &'static str,
    },
    /// Units or values that cannot be converted.
    #[error("`{from}` does not fit `{to}`: {reason}")]
    Way {
        /// Where it begins.
        from: String,
        /// Where it ends.
        to: String,
        /// Why not.
        reason: Box<WayError>,
    },
    /// A clock that nothing can trigger.
    #[error(
        "the clock `{component}.{clock}` ticks at its own times, expected one with \
         intervalVariability=\"triggered\"; remove the connection"
    )]
    OwnTimes {
        /// The component.
        component: String,
        /// The clock.
        clock: String,
    },
    /// A clock of an FMU without event mode.
    #[error(
        "the clock `{component}.{clock}` can be connected in co-simulation with hasEventMode=\"true\" only; \
         export the FMU with event mode"
    )]
    NoEventMode {
        /// The component.
        component: String,
        /// The clock.
        clock: String,
    },
}

/// The connection of a link, after its names, types and units were checked.
///
/// # Errors
/// What does not hold.
pub(super) fn connect(
    components: &[Component],
    tables: &[InputTable],
    link: &Link,
) -> Result<Connection, Misfit> {
    let Link { from, to, .. } = link;
    let component = component_index(components, &to.component)?;
    let input = find(&components[component].fmu, &to.variable, Causality::Input)?;
    let target = &components[component].fmu.description.variables[input];
    if target.kind == Kind::Clock {
        triggers(&components[component], input)?;
    }

    let (source, start) = match from {
        Origin::Reference { quantity, ahead } => {
            let source = Source::Reference {
                quantity: *quantity,
                ahead: *ahead,
            };
            let start = End {
                kind: &Kind::Float64,
                unit: Some(quantity.unit()),
                base: Some(quantity.base_unit()),
            };
            (source, start)
        }
        Origin::Output(name) => {
            let table = tables.iter().position(|table| table.name == name.component);
            if let Some(table) = table {
                let column = tables[table].find(&name.variable)?;
                // What a table holds, it holds for this input: whole numbers and truth values too.
                let start = End {
                    kind: match target.kind {
                        Kind::String | Kind::Binary | Kind::Clock => &Kind::Float64,
                        ref kind => kind,
                    },
                    unit: tables[table].units[column].as_deref(),
                    base: None,
                };
                (Source::Table { table, column }, start)
            } else {
                let component = component_index(components, &name.component)?;
                let fmu = &components[component].fmu;
                let variable = find(fmu, &name.variable, Causality::Output)?;
                let output = &fmu.description.variables[variable];
                if output.kind == Kind::Clock {
                    has_events(&components[component], variable)?;
                }
                let source = Source::Output {
                    component,
                    variable,
                };
                (source, end(output))
            }
        }
    };
    if !link.way.maps() && !start.kind.drives(&target.kind) {
        let types = ConnectionError::Types {
            from: from.to_string(),
            kind: start.kind.name(),
            to: to.to_string(),
            other: target.kind.name(),
        };
        return Err(types.into());
    }
    let passage = link
        .way
        .between(start, end(target))
        .map_err(|reason| ConnectionError::Way {
            from: from.to_string(),
            to: to.to_string(),
            reason: Box::new(reason),
        })?;
    Ok(Connection {
        source,
        component,
        input,
        passage,
    })
}

/// A variable as an end of a way.
fn end(variable: &Variable) -> End<'_> {
    End {
        kind: &variable.kind,
        unit: variable.unit.as_deref(),
        base: variable.base_unit,
    }
}

/// Whether an input clock ticks when another one does.
fn triggers(component: &Component, input: usize) -> Result<(), ConnectionError> {
    has_events(component, input)?;
    let description = &component.fmu.description;
    if description.ticks(input) == Some(Ticks::Triggered) {
        return Ok(());
    }
    Err(ConnectionError::OwnTimes {
        component: component.name.clone(),
        clock: description.variables[input].name.clone(),
    })
}

fn has_events(component: &Component, clock: usize) -> Result<(), ConnectionError> {
    let description = &component.fmu.description;
    if description.has_stepped_events() {
        return Ok(());
    }
    Err(ConnectionError::NoEventMode {
        component: component.name.clone(),
        clock: description.variables[clock].name.clone(),
    })
}
