//! Connections checked against the FMUs: names, types and units.

use super::checked::{Component, Connection, Source};
use super::link::{Link, Origin};
use super::lookup::{component_index, find};
use super::passage::End;
use super::table::InputTable;
use fmi_import::{Causality, Kind, Ticks, Variable};

/// The connection of a link, after its names, types and units were checked.
///
/// # Errors
/// What does not hold.
pub(super) fn connect(
    components: &[Component],
    tables: &[InputTable],
    link: &Link,
) -> Result<Connection, String> {
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
                let column = tables[table].find(&name.variable);
                let column = column.map_err(|error| error.to_string())?;
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
    if !link.way.maps() {
        fits(start.kind, target).map_err(|reason| format!("`{from}` {reason} `{to}`"))?;
    }
    let passage = link
        .way
        .between(start, end(target))
        .map_err(|reason| format!("`{from}` does not fit `{to}`: {reason}"))?;
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
fn triggers(component: &Component, input: usize) -> Result<(), String> {
    has_events(component, input)?;
    let description = &component.fmu.description;
    if description.ticks(input) == Some(Ticks::Triggered) {
        return Ok(());
    }
    let (name, clock) = (&component.name, &description.variables[input].name);
    Err(format!(
        "the clock `{name}.{clock}` ticks at its own times, expected one with \
         intervalVariability=\"triggered\"; remove the connection"
    ))
}

fn has_events(component: &Component, clock: usize) -> Result<(), String> {
    let description = &component.fmu.description;
    if description.has_stepped_events() {
        return Ok(());
    }
    let (name, clock) = (&component.name, &description.variables[clock].name);
    Err(format!(
        "the clock `{name}.{clock}` can be connected in co-simulation with hasEventMode=\"true\" only; \
         export the FMU with event mode"
    ))
}

fn fits(kind: &Kind, target: &Variable) -> Result<(), String> {
    if kind.drives(&target.kind) {
        return Ok(());
    }
    let (from, to) = (kind.name(), target.kind.name());
    Err(format!("is a {from} and cannot drive the {to}"))
}
