//! The results of a study as a table: one row per run, one column per factor or result.

use serde::{Deserialize, Serialize};

/// How a run ended that could not begin: a component or its motion refuses the input.
pub const INVALID: &str = "invalid";

/// A row of the results.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The run's name.
    pub run: String,
    /// Its cells, one a column but for those that say which run it is.
    pub cells: Vec<Cell>,
}

/// Content of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// A number, SI where the column has a unit.
    Number(f64),
    /// A text.
    Text(String),
    /// Nothing: what a run that failed does not have.
    Missing,
}

impl From<f64> for Cell {
    /// JSON has only finite numbers.
    fn from(number: f64) -> Self {
        match number.is_finite() {
            true => Self::Number(number),
            false => Self::Missing,
        }
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Missing, Self::from)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_string())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Cell {
    /// The number, where there is one.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            _ => None,
        }
    }

    /// The text, where there is one.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }
}

/// What a column is to the study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The run's number or name.
    Run,
    /// What was varied.
    Factor,
    /// What came of it.
    Result,
    /// How the run ended (`complete`, `interlock`, `failed`, `invalid`), and why.
    Ending,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Numbers.
    Number,
    /// Texts.
    Text,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name: that of the factor, or of the figure with its unit at the end as in `summary.json`.
    pub name: String,
    /// Unit of the numbers, SI; none for plain numbers and texts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// What it is.
    pub role: Role,
    /// What it holds.
    pub kind: Kind,
}

/// One row per run, in the order of their numbers.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, one cell per column.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// The place of the column called `name`.
    #[must_use]
    pub fn place(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// The numbers of a column, NaN where there is none; empty for an unknown name.
    #[must_use]
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let Some(place) = self.place(name) else {
            return Vec::new();
        };
        let rows = self.rows.iter();
        rows.map(|row| row[place].number().unwrap_or(f64::NAN))
            .collect()
    }

    /// The texts of a column, empty where there is none; none for an unknown name.
    #[must_use]
    pub fn texts(&self, name: &str) -> Vec<&str> {
        let Some(place) = self.place(name) else {
            return Vec::new();
        };
        let rows = self.rows.iter();
        rows.map(|row| row[place].text().unwrap_or_default())
            .collect()
    }
}
