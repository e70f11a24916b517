//! What a study says: endings and quantiles, fragility, which factor matters, and the worst runs.

mod endings;
mod explained;
mod fragility;
mod groups;
mod importance;
mod invalid;
mod percentile;
mod probit;
mod quantiles;
mod ranking;
mod sobol_indices;
mod worst;

use serde::Serialize;

pub use endings::{Ended, Endings};
pub use fragility::{Curve, Fit, Fragility, Lognormal, Observed, Why};
pub use groups::Group;
pub use importance::{Importance, Method, Share};
pub use invalid::{Invalid, without_invalid};
pub(crate) use percentile::percentile;
pub use quantiles::{Over, Quantiles};
pub use ranking::{Pair, Ranked, Ranking, Spread, Standing};
pub use worst::Worst;

use super::table::Table;
use endings::Runs;

/// The figure by which runs are called better or worse: the time-domain error of the acceleration, %.
pub const ERROR: &str = "time_domain_percent";

/// What the study says of itself, beside its table.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Column against which fragility is drawn.
    pub intensity: String,
    /// Limits, in the order of the study.
    pub limits: Vec<Limit>,
    /// How the rows came about.
    pub design: Design,
    /// Which factor's values are ranked, where one is crossed with every point.
    pub ranked: Option<Ranked>,
    /// Seed of resampling and shuffling.
    pub seed: u64,
}

/// A limit of a study.
#[derive(Debug, Clone)]
pub struct Limit {
    /// As the study calls it, such as `specimen.displacement`.
    pub name: String,
    /// Column that is compared, such as `peak.specimen.displacement`.
    pub column: String,
    /// What is exceeded, in the column's unit.
    pub above: f64,
}

/// How the rows of a table came about, as far as the analysis asks.
#[derive(Debug, Clone, Default)]
pub enum Design {
    /// Rows of a design for Sobol' indices: for each base sample `A_j`, the `k` mixed samples in
    /// which one factor comes from `B_j`, then `B_j`.
    Saltelli {
        /// The `k` factors, in the order of the mixed samples.
        sampled: Vec<String>,
        /// Factors that are crossed with every sample.
        crossed: Vec<String>,
        /// Runs of a sample: one for each combination of crossed values, one after the other.
        crossings: usize,
        /// The table's row of each run of the design: runs that are the same share one, and those that
        /// are missing have none.
        rows: Vec<Option<usize>>,
    },
    /// Any other.
    #[default]
    Other,
}

/// What came of a study.
#[derive(Debug, Clone, Serialize)]
pub struct Findings {
    /// All runs together, then the runs of each value of each factor that is a list.
    pub groups: Vec<Group>,
    /// Column against which fragility is drawn.
    pub intensity: String,
    /// Its unit.
    pub intensity_unit: Option<String>,
    /// Share of runs beyond each limit, and of runs that were stopped, against intensity.
    pub fragility: Vec<Fragility>,
    /// Which factor matters, for the error and whatever else varies.
    pub importance: Vec<Importance>,
    /// The values of a crossed factor on the points that they share.
    pub ranking: Option<Ranking>,
    /// The ten worst runs, the worst first.
    pub worst: Vec<Worst>,
    /// Runs that could not begin. Nothing else counts them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub invalid: Vec<Invalid>,
    /// Seed of what was resampled.
    pub seed: u64,
}

/// What `table` says. `command` gives the command that repeats the run of a number.
pub fn analyse(table: &Table, settings: &Settings, command: &dyn Fn(usize) -> String) -> Findings {
    let runs = Runs::of(table);
    let mut columns = table.columns.iter();
    let intensity = columns.find(|column| column.name == settings.intensity);
    let unit = intensity.and_then(|column| column.unit.as_ref());
    Findings {
        groups: groups::groups(&runs, &settings.intensity),
        intensity: settings.intensity.clone(),
        intensity_unit: unit.cloned(),
        fragility: fragility::fragility(&runs, settings),
        importance: importance::importance(&runs, settings),
        ranking: settings
            .ranked
            .as_ref()
            .map(|ranked| ranking::ranking(table, ranked, ERROR, settings.seed)),
        worst: worst::worst(&runs, command),
        invalid: Vec::new(),
        seed: settings.seed,
    }
}

#[cfg(test)]
pub(super) mod tests;
