//! Reports: figures, tables and plots in one HTML file that opens without a network, and single
//! plots as SVG.
//!
//! A [`Report`] is plain data; [`html`] renders it, [`svg`] renders one [`Panel`]. [`run`] makes
//! the report of a run; comparisons, designs, identification and diagnosis fill the same data.

mod bars;
mod chart_data;
pub(crate) mod columns;
mod html;
pub(crate) mod number;
mod run;
mod svg;

use std::borrow::Cow;
use std::sync::Arc;

pub use bars::{Bar, BarGroup, Bars};
pub use html::html;
pub use run::{Run, Whole, run};
pub use svg::svg;

use crate::units::{INCH, POUND_FORCE, STANDARD_GRAVITY};

/// A report, top to bottom.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Heading and title of the page.
    pub title: String,
    /// One sentence that says how it went.
    pub summary: String,
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
    /// Bars, above the tables.
    pub bars: Vec<Bars>,
    /// Tables.
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

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Cell::Text(text)
    }
}

/// The two units a value can be read in, the laboratory's and SI; the reader of a report chooses.
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    /// Name of the laboratory's unit; empty for none.
    pub laboratory: Cow<'static, str>,
    /// What one of it is in the unit the data are given in.
    pub laboratory_factor: f64,
    /// Name of the SI unit; empty for none.
    pub si: Cow<'static, str>,
    /// What one of it is in the unit the data are given in.
    pub si_factor: f64,
}

impl Units {
    /// Length, data in m: in, mm.
    pub const DISPLACEMENT: Units = Units::pair("in", INCH, "mm", 1e-3);
    /// Data in m/s: in/s, mm/s.
    pub const VELOCITY: Units = Units::pair("in/s", INCH, "mm/s", 1e-3);
    /// Data in m/s^2: g, m/s².
    pub const ACCELERATION: Units = Units::pair("g", STANDARD_GRAVITY, "m/s²", 1.0);
    /// Data in N: lbf, N.
    pub const FORCE: Units = Units::pair("lbf", POUND_FORCE, "N", 1.0);
    /// Data in V.
    pub const VOLTAGE: Units = Units::same("V");
    /// Data in s.
    pub const TIME: Units = Units::same("s");
    /// Data in Hz.
    pub const FREQUENCY: Units = Units::same("Hz");
    /// Data in percent.
    pub const PERCENT: Units = Units::same("%");
    /// Data in dB.
    pub const DECIBEL: Units = Units::same("dB");
    /// Data in degrees.
    pub const DEGREE: Units = Units::same("°");
    /// Plain numbers.
    pub const NONE: Units = Units::same("");

    /// Two units and what one of each is in the unit of the data.
    #[must_use]
    pub const fn pair(
        laboratory: &'static str,
        laboratory_factor: f64,
        si: &'static str,
        si_factor: f64,
    ) -> Self {
        Self {
            laboratory: Cow::Borrowed(laboratory),
            laboratory_factor,
            si: Cow::Borrowed(si),
            si_factor,
        }
    }

    /// One unit for both, that of the data.
    #[must_use]
    pub const fn same(unit: &'static str) -> Self {
        Self::pair(unit, 1.0, unit, 1.0)
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

/// Where the values of a series stand along the horizontal axis.
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
