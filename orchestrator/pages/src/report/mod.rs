//! Reports: figures, tables and plots in one HTML file that opens without a network, and single
//! plots as SVG.
//!
//! A [`Report`] is plain data; [`render`] makes its page, [`svg`] renders one [`Panel`]. [`run`] makes
//! the report of a run; comparisons, designs, identification and diagnosis fill the same data.

mod bars;
mod chart_data;
pub mod columns;
mod html;
pub mod identity;
pub mod number;
mod page;
mod run;
mod svg;
pub mod units;

use std::sync::Arc;

pub use bars::{Bar, BarGroup, Bars};
pub use html::html;
pub use page::{FILE, PageError, render};
pub use run::{AxisRun, Changed, Component, Run, SpecimenHistory, run, run_along};
pub use svg::svg;
pub use units::{UnitSystem, Units};

/// A report, top to bottom.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Heading and title of the page.
    pub title: String,
    /// One sentence that says how it went.
    pub summary: String,
    /// What was run, in few words: system, plant, specimen, motion, version.
    pub identity: Vec<(String, Cell)>,
    /// The few figures that matter most, shown large.
    pub facts: Vec<Fact>,
    /// Everything else.
    pub sections: Vec<Section>,
    /// Last line: versions, seed, how to repeat.
    pub footer: String,
}

/// One figure, shown large.
#[derive(Debug, Clone)]
pub struct Fact {
    /// What it is.
    pub label: String,
    /// Its value.
    pub value: Cell,
    /// A few words of explanation; may be empty.
    pub note: String,
}

/// A part of a report.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// A list.
    pub notes: Vec<String>,
    /// Bars, above everything else.
    pub bars: Vec<Bars>,
    /// Tables, below the plots.
    pub tables: Vec<Table>,
    /// Plots.
    pub panels: Vec<Panel>,
}

/// A table; every row has as many cells as there are columns.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// What it shows; may be empty.
    pub caption: String,
    /// Headings.
    pub columns: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// Of cells in columns of these headings.
    #[must_use]
    pub fn of<const N: usize, C: Into<Cell>>(
        caption: &str,
        columns: [&str; N],
        rows: impl IntoIterator<Item = [C; N]>,
    ) -> Self {
        Self {
            caption: caption.to_string(),
            columns: columns.map(str::to_string).to_vec(),
            rows: rows
                .into_iter()
                .map(|row| row.map(Into::into).to_vec())
                .collect(),
        }
    }

    /// Of rows as a terminal shows them too: the first are the headings.
    #[must_use]
    pub fn headed<C: Into<Cell>>(caption: &str, rows: Vec<Vec<C>>) -> Self {
        let mut rows = rows.into_iter();
        let heads = rows.next().unwrap_or_default().into_iter();
        Self {
            caption: caption.to_string(),
            columns: heads.map(|head| head.into().text(UnitSystem::Us)).collect(),
            rows: rows
                .map(|row| row.into_iter().map(Into::into).collect())
                .collect(),
        }
    }

    /// As [`Table::headed`], with the units of the columns, or nothing, in the second row.
    #[must_use]
    pub fn headed_with_units(caption: &str, mut rows: Vec<Vec<String>>) -> Self {
        if rows.len() > 1 {
            let units = rows.remove(1);
            let heads = rows[0].iter_mut().zip(units);
            heads
                .filter(|(_, unit)| !unit.is_empty())
                .for_each(|(name, unit)| *name += &format!(" ({unit})"));
        }
        Self::headed(caption, rows)
    }
}

/// One cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number without units, shown with so many significant digits.
    Number(f64, usize),
    /// A value in SI units, shown with so many significant digits and the reader's units.
    Quantity(f64, Units, usize),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Cell::Text(text.to_string())
    }
}

impl Cell {
    /// As text in a system of units, for a terminal.
    #[must_use]
    pub fn text(&self, system: UnitSystem) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, digits) => number::significant(*value, *digits),
            Self::Quantity(value, units, digits) => {
                let (shown, unit) = units.shown(*value, system);
                format!("{} {unit}", number::significant(shown, *digits))
                    .trim_end()
                    .to_string()
            }
        }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Cell::Text(text)
    }
}

/// A plot.
#[derive(Debug, Clone)]
pub struct Panel {
    /// What it shows.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What is drawn, the last on top.
    pub series: Vec<Series>,
}

/// An axis of a plot.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What is measured along it, without unit.
    pub label: String,
    /// Its units.
    pub units: Units,
    /// Logarithmic; values that are not positive are left out.
    pub logarithmic: bool,
    /// Limits in the unit of the data; none: what the data need.
    pub limits: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis that fits its data.
    #[must_use]
    pub fn linear(label: &str, units: Units) -> Self {
        Self {
            label: label.to_string(),
            units,
            logarithmic: false,
            limits: None,
        }
    }

    /// A logarithmic axis that fits its data.
    #[must_use]
    pub fn logarithmic(label: &str, units: Units) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(label, units)
        }
    }

    /// The same axis between two limits, in the unit of the data.
    #[must_use]
    pub fn between(self, low: f64, high: f64) -> Self {
        Self {
            limits: Some([low, high]),
            ..self
        }
    }
}

/// Positions of the values of a series along the horizontal axis.
#[derive(Debug, Clone)]
pub enum Abscissa {
    /// At `start + n step`.
    Even {
        /// Place of the first value.
        start: f64,
        /// From one value to the next.
        step: f64,
    },
    /// One place a value. Ascending but for [`Style::Path`] and [`Style::Points`].
    At(Arc<[f64]>),
}

/// How a series is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Style {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// Dots, in any order.
    Points,
    /// A line through the values in their order, which may turn back (a hysteresis loop).
    Path,
    /// The area up to these values.
    Band(Vec<f64>),
}

/// Values to draw; a value that is not finite leaves a gap.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Where the values stand.
    pub abscissa: Abscissa,
    /// The values, in the unit of the data of the vertical axis.
    pub values: Vec<f64>,
    /// How they are drawn.
    pub style: Style,
    /// Which colour of the palette; 0 is the neutral one, kept for references. None: by order.
    pub colour: Option<usize>,
}

impl Series {
    /// A line over places that ascend.
    #[must_use]
    pub fn line(name: &str, abscissa: Abscissa, values: Vec<f64>) -> Self {
        Self {
            name: name.to_string(),
            abscissa,
            values,
            style: Style::Line,
            colour: None,
        }
    }

    /// A level across the places from `from` to `to`, dashed and neutral: a limit, an aim.
    #[must_use]
    pub fn level(name: &str, value: f64, [from, to]: [f64; 2]) -> Self {
        Self::line(name, Abscissa::At([from, to].into()), vec![value; 2])
            .styled(Style::Dashed)
            .coloured(0)
    }

    /// A stroke from one point to another: an event, a margin.
    #[must_use]
    pub fn stroke(name: &str, from: [f64; 2], to: [f64; 2]) -> Self {
        Self::line(
            name,
            Abscissa::At([from[0], to[0]].into()),
            vec![from[1], to[1]],
        )
        .styled(Style::Path)
    }

    /// A time history that begins at 0.
    #[must_use]
    pub fn history(name: &str, dt: f64, values: &[f64]) -> Self {
        Self::line(
            name,
            Abscissa::Even {
                start: 0.0,
                step: dt,
            },
            values.to_vec(),
        )
    }

    /// The same with at most so many values, about: the least and the largest of each stretch, so
    /// that no peak is lost.
    #[must_use]
    pub fn thinned(self, most: usize) -> Self {
        if self.values.len() <= most {
            return self;
        }
        chart_data::envelope(&self, (most / 2).max(1))
    }

    /// The same in another style.
    #[must_use]
    pub fn styled(self, style: Style) -> Self {
        Self { style, ..self }
    }

    /// The same in another colour.
    #[must_use]
    pub fn coloured(self, colour: usize) -> Self {
        Self {
            colour: Some(colour),
            ..self
        }
    }

    /// Place of the value `n`.
    pub(crate) fn place(&self, n: usize) -> f64 {
        match &self.abscissa {
            Abscissa::Even { start, step } => start + n as f64 * step,
            Abscissa::At(places) => places.get(n).copied().unwrap_or(f64::NAN),
        }
    }
}

#[cfg(test)]
mod tests;
