//! A report as one HTML file that needs nothing else.

use minijinja::syntax::SyntaxConfig;
use minijinja::{AutoEscape, Environment, Value, context};

use super::chart_data::json_for_script;
use super::number::typeset;
use super::{Cell, Report, Section, Table, UnitSystem, bars};

const TEMPLATE: &str = include_str!("assets/report.html");
const STYLE: &str = include_str!("assets/report.css");
const SCRIPT: &str = concat!(
    include_str!("assets/inspector.js"),
    include_str!("assets/report.js")
);
const UPLOT_STYLE: &str = include_str!("assets/uPlot.min.css");
const UPLOT_SCRIPT: &str = include_str!("assets/uPlot.iife.min.js");
const UPLOT_LICENSE: &str = include_str!("assets/uPlot.LICENSE");

/// Letters of a cell that fits in one line.
const WORD: usize = 10;

/// Renders the report in the units that were asked for; none: in the laboratory's, with buttons to switch. All text
/// is escaped; the file refers to nothing outside itself.
///
/// # Errors
/// Only a fault of the template itself.
pub fn html(report: &Report, units: Option<UnitSystem>) -> Result<String, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    let mut syntax = SyntaxConfig::builder();
    environment.set_syntax(syntax.trim_blocks(true).lstrip_blocks(true).build()?);
    environment.add_template("report", TEMPLATE)?;
    let mut next_panel = 0;
    let sections: Vec<_> = report
        .sections
        .iter()
        .map(|s| section(s, &mut next_panel))
        .collect();
    let facts: Vec<_> = report
        .facts
        .iter()
        .map(|fact| context! { label => fact.label.as_str(), note => fact.note.as_str(), value => cell(&fact.value) })
        .collect();
    let identity: Vec<_> = report
        .identity
        .iter()
        .map(|(name, value)| context! { name => name.as_str(), value => cell(value) })
        .collect();
    let panels = report.sections.iter().flat_map(|section| &section.panels);
    environment.get_template("report")?.render(context! {
        title => report.title.as_str(),
        summary => report.summary.as_str(),
        footer => report.footer.as_str(),
        facts,
        identity,
        sections,
        units => units.unwrap_or_default().key(),
        units_asked => units.is_some(),
        has_panels => next_panel > 0,
        data => json_for_script(panels),
        style => STYLE,
        script => SCRIPT,
        uplot_style => UPLOT_STYLE,
        uplot_script => UPLOT_SCRIPT,
        uplot_license => UPLOT_LICENSE,
    })
}

fn section(section: &Section, next_panel: &mut usize) -> Value {
    let panels: Vec<_> = section
        .panels
        .iter()
        .map(|panel| {
            let number = *next_panel;
            *next_panel += 1;
            context! { number, title => panel.title.as_str() }
        })
        .collect();
    let bars: Vec<_> = section
        .bars
        .iter()
        .map(|one| context! { title => one.title.as_str(), html => bars::html(one) })
        .collect();
    let tables: Vec<_> = section.tables.iter().map(table).collect();
    context! {
        heading => section.heading.as_str(),
        text => section.text.clone(),
        notes => section.notes.clone(),
        bars,
        tables,
        panels,
    }
}

fn table(table: &Table) -> Value {
    let numeric = |column: usize| {
        let mut cells = table.rows.iter().filter_map(|row| row.get(column));
        let is_words = |cell: &Cell| matches!(cell, Cell::Text(text) if !text.is_empty());
        !cells.clone().any(is_words) && cells.any(|cell| !matches!(cell, Cell::Text(_)))
    };
    let columns: Vec<_> = table
        .columns
        .iter()
        .enumerate()
        .map(|(n, name)| context! { name => name.as_str(), numeric => numeric(n) })
        .collect();
    let rows: Vec<Vec<Value>> = table
        .rows
        .iter()
        .map(|row| row.iter().map(cell).collect())
        .collect();
    context! { caption => table.caption.as_str(), columns, rows }
}

/// A cell as text in the two systems of units.
fn cell(cell: &Cell) -> Value {
    let (laboratory, si) = match cell {
        Cell::Text(text) => (text.clone(), text.clone()),
        Cell::Number(value, digits) => {
            let text = typeset(*value, *digits);
            (text.clone(), text)
        }
        Cell::Quantity(value, units, digits) => {
            let text = |factor: f64, name: &str| {
                let number = typeset(value / factor, *digits);
                if name.is_empty() {
                    number
                } else {
                    format!("{number}\u{a0}{name}")
                }
            };
            let [us, si] = [UnitSystem::Us, UnitSystem::Si].map(|system| {
                let (factor, name) = units.unit(system);
                text(factor, name)
            });
            (us, si)
        }
    };
    // A word of a table that is not to be broken.
    let short = (1..=WORD).contains(&si.chars().count());
    context! { one => laboratory == si, short, laboratory, si }
}
