//! The runs together, and those of each value of a list.

use serde::Serialize;

use super::endings::{Endings, Runs};
use super::quantiles::{self, Quantiles};

/// Runs that have something in common.
#[derive(Debug, Clone, Serialize)]
pub struct Group {
    /// The factor; absent for all runs.
    pub factor: Option<String>,
    /// Its value; empty for all runs.
    pub value: String,
    /// How they ended.
    pub endings: Endings,
    /// Quantiles of each figure.
    pub figures: Vec<Quantiles>,
}

impl Group {
    /// The quantiles of a figure.
    #[must_use]
    pub fn figure(&self, name: &str) -> Option<&Quantiles> {
        self.figures.iter().find(|own| own.figure == name)
    }
}

/// All runs first, then each value of each factor that is a list.
pub(super) fn groups(runs: &Runs, intensity: &str) -> Vec<Group> {
    let group = |factor: Option<&str>, value: &str, rows: &[usize]| Group {
        factor: factor.map(str::to_string),
        value: value.to_string(),
        endings: runs.endings(rows),
        figures: quantiles::quantiles(runs, rows, intensity),
    };
    let mut all = vec![group(None, "", &runs.all())];
    for name in runs.varied() {
        let Some(list) = runs.list(name) else {
            continue;
        };
        for (place, value) in list.values.iter().enumerate() {
            all.push(group(Some(name), value, &list.rows(place)));
        }
    }
    all
}
