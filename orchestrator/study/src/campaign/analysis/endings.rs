//! How runs ended, and the runs of a table by what was varied.

use serde::Serialize;

use crate::campaign::table::{Cell, Kind, Role, Table};
use fmi_master::Ending;
use pages::report::number::significant;

/// Numbers with more distinct values than this are not a list.
const MOST_VALUES: usize = 12;
/// Columns that name the controller, and the motion.
const CONTROLLERS: [&str; 2] = ["controller", "system"];
const MOTIONS: [&str; 2] = ["record", "seed"];

/// How a run ended, as far as a study counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// Played to its end.
    Complete,
    /// Stopped by the interlock.
    Interlock,
    /// It could not be computed, or ran away.
    Failed,
}

/// Runs by their ending.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Endings {
    /// All of them.
    pub runs: usize,
    /// Played to their end.
    pub complete: usize,
    /// Stopped by the interlock.
    pub interlock: usize,
    /// Not computed, or run away.
    pub failed: usize,
}

/// A table with what is asked of it again and again.
pub(super) struct Runs<'a> {
    pub table: &'a Table,
    /// A run's ending.
    pub ended: Vec<Ended>,
}

/// A factor with few values: what a run has of them.
pub(super) struct List {
    /// The values in words, numbers in their order, texts in that of the table.
    pub values: Vec<String>,
    /// Place of each run's value; none where the cell is empty.
    pub places: Vec<Option<usize>>,
}

impl List {
    /// The runs with the value at `place`.
    pub fn rows(&self, place: usize) -> Vec<usize> {
        let runs = 0..self.places.len();
        runs.filter(|&run| self.places[run] == Some(place))
            .collect()
    }
}

impl<'a> Runs<'a> {
    pub fn of(table: &'a Table) -> Self {
        let known = |word: &str| match word {
            word if word == Ending::Complete.word() => Ended::Complete,
            word if word == Ending::Interlock.word() => Ended::Interlock,
            _ => Ended::Failed,
        };
        Self {
            table,
            ended: table.texts("ended").into_iter().map(known).collect(),
        }
    }

    pub fn len(&self) -> usize {
        self.table.rows.len()
    }

    /// Every row's number.
    pub fn all(&self) -> Vec<usize> {
        (0..self.len()).collect()
    }

    pub fn ended(&self, run: usize) -> Ended {
        self.ended.get(run).copied().unwrap_or(Ended::Failed)
    }

    pub fn endings(&self, rows: &[usize]) -> Endings {
        let count = |ending| {
            rows.iter()
                .filter(|&&run| self.ended(run) == ending)
                .count()
        };
        Endings {
            runs: rows.len(),
            complete: count(Ended::Complete),
            interlock: count(Ended::Interlock),
            failed: count(Ended::Failed),
        }
    }

    /// Names of the factors that take more than one value.
    pub fn varied(&self) -> Vec<&'a str> {
        let columns = self.table.columns.iter().enumerate();
        let factors = columns.filter(|(_, column)| column.role == Role::Factor);
        factors
            .filter(|(place, _)| {
                let mut cells = self.table.rows.iter().map(|row| &row[*place]);
                let first = cells.next();
                cells.any(|cell| Some(cell) != first)
            })
            .map(|(_, column)| column.name.as_str())
            .collect()
    }

    /// A factor as a list: at least two values, each on two runs on average and, for numbers, few.
    pub fn list(&self, name: &str) -> Option<List> {
        let place = self.table.place(name)?;
        let cells = || self.table.rows.iter().map(|row| &row[place]);
        if self.table.columns[place].kind == Kind::Number {
            let mut numbers: Vec<f64> = cells().filter_map(Cell::number).collect();
            numbers.sort_by(f64::total_cmp);
            numbers.dedup();
            let few = (2..=MOST_VALUES).contains(&numbers.len()) && 2 * numbers.len() <= self.len();
            return few.then(|| List {
                values: numbers
                    .iter()
                    .map(|own| match own.fract() == 0.0 && own.abs() < 1e6 {
                        // A seed or a count.
                        true => format!("{own}"),
                        false => significant(*own, 4),
                    })
                    .collect(),
                places: cells()
                    .map(|cell| {
                        let own = cell.number()?;
                        numbers.iter().position(|number| *number == own)
                    })
                    .collect(),
            });
        }
        let mut values: Vec<String> = Vec::new();
        let mut known = std::collections::HashMap::new();
        let places = cells()
            .map(|cell| {
                let text = cell.text()?;
                Some(*known.entry(text).or_insert_with(|| {
                    values.push(text.to_string());
                    values.len() - 1
                }))
            })
            .collect();
        // As many texts as runs are no list.
        (values.len() > 1 && 2 * values.len() <= self.len()).then_some(List { values, places })
    }

    /// The controllers, where several were compared.
    pub fn controllers(&self) -> Option<List> {
        self.factor_among(&CONTROLLERS)
    }

    /// The motions, where several were played.
    pub fn motions(&self) -> Option<List> {
        self.factor_among(&MOTIONS)
    }

    fn factor_among(&self, names: &[&str]) -> Option<List> {
        let is_factor = |name: &str| {
            let mut columns = self.table.columns.iter();
            columns.any(|column| column.name == name && column.role == Role::Factor)
        };
        let mut names = names.iter().filter(|name| is_factor(name));
        names.find_map(|name| self.list(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table::Column;

    fn table(columns: &[(&str, Role, Kind)], rows: Vec<Vec<Cell>>) -> Table {
        let column = |(name, role, kind): &(&str, Role, Kind)| Column {
            name: (*name).to_string(),
            unit: None,
            role: *role,
            kind: *kind,
        };
        Table {
            columns: columns.iter().map(column).collect(),
            rows,
        }
    }

    fn numbers(values: &[f64]) -> Table {
        let rows = values.iter().map(|value| vec![Cell::from(*value)]);
        table(&[("x", Role::Factor, Kind::Number)], rows.collect())
    }

    fn texts(values: &[&str]) -> Table {
        let cell = |value: &str| match value {
            "" => Cell::Missing,
            text => text.into(),
        };
        let rows = values.iter().map(|value| vec![cell(value)]);
        table(&[("controller", Role::Factor, Kind::Text)], rows.collect())
    }

    #[test]
    fn numbers_are_a_list_if_they_are_few_and_repeat() {
        let list = |table: &Table| {
            let runs = Runs::of(table);
            runs.list("x").map(|list| (list.values, list.places))
        };
        let (values, places) = list(&numbers(&[
            2.0,
            1.0,
            f64::NAN,
            0.25,
            2e6,
            1.0,
            2.0,
            -3.0,
            1.0,
            2.0,
        ]))
        .unwrap();
        assert_eq!(values, ["-3", "0.2500", "1", "2", "2000000"]);
        let at = |n| Some(n);
        assert_eq!(
            places,
            [
                at(3),
                at(2),
                None,
                at(1),
                at(4),
                at(2),
                at(3),
                at(0),
                at(2),
                at(3)
            ]
        );
        // Whole numbers from a million on are shown in four digits.
        assert_eq!(
            list(&numbers(&[1.5e6 + 0.5, 1e7, 1.5e6 + 0.5, 1e7]))
                .unwrap()
                .0,
            ["1500000", "1.000e7"]
        );
        assert!(list(&numbers(&[1.0, 1.0])).is_none(), "one value");
        assert!(list(&numbers(&[1.0, 2.0, 1.0])).is_none(), "too few runs");
        assert!(list(&numbers(&[1.0, 2.0, 1.0, 2.0])).is_some());
        let many =
            |count: usize| -> Vec<f64> { (0..2 * count).map(|n| (n % count) as f64).collect() };
        assert!(list(&numbers(&many(MOST_VALUES))).is_some());
        assert!(list(&numbers(&many(MOST_VALUES + 1))).is_none());
        assert!(Runs::of(&numbers(&[1.0])).list("y").is_none());
    }

    #[test]
    fn texts_are_a_list_in_their_order_if_they_repeat() {
        let own = texts(&["mpc", "lqg", "", "mpc", "lqg"]);
        let runs = Runs::of(&own);
        let list = runs.controllers().unwrap();
        assert_eq!(list.values, ["mpc", "lqg"]);
        assert_eq!((list.rows(0), list.rows(1)), (vec![0, 3], vec![1, 4]));
        assert!(runs.motions().is_none());
        assert!(Runs::of(&texts(&["a", "b", "c"])).controllers().is_none());
        assert!(Runs::of(&texts(&["a", "a"])).controllers().is_none());
        assert!(
            Runs::of(&texts(&["a", "b", "a", "b"]))
                .controllers()
                .is_some()
        );
        // A column that is not a factor does not tell controllers apart.
        let mut result = own.clone();
        result.columns[0].role = Role::Result;
        assert!(Runs::of(&result).controllers().is_none());
    }

    #[test]
    fn endings_are_counted_by_their_words() {
        let words = ["complete", "interlock", "failed", "invalid", "complete"];
        let rows = words.iter().map(|word| vec![Cell::from(*word)]);
        let own = table(&[("ended", Role::Ending, Kind::Text)], rows.collect());
        let runs = Runs::of(&own);
        assert_eq!(
            runs.endings(&runs.all()),
            Endings {
                runs: 5,
                complete: 2,
                interlock: 1,
                failed: 2
            }
        );
        assert_eq!(runs.endings(&[1, 4]).complete, 1);
        assert_eq!(
            (runs.ended(1), runs.ended(9)),
            (Ended::Interlock, Ended::Failed)
        );
        assert!(runs.varied().is_empty(), "an ending is not a factor");
        assert_eq!(Runs::of(&numbers(&[1.0, 1.0, 2.0])).varied(), ["x"]);
        assert!(Runs::of(&numbers(&[1.0, 1.0])).varied().is_empty());
    }
}
