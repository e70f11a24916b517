//! Studies of many runs: factors, a design, runs on all cores, a table, and what it says.

mod bench;
mod carry_out;
mod design;
mod factor;
mod files;
mod journal;
mod setting;
mod study;
pub mod table;

use std::path::{Path, PathBuf};

pub use bench::{Bench, Row};
pub use carry_out::{Carried, Left, Plan, Progress, Shard, Summary, carry_out, rows};
pub use design::{Design, Points};
pub use factor::{Distribution, Drawn, Values};
pub use journal::Head;
pub use study::{Factor, Limit, Study};

use crate::error::Error;
use crate::results::Results;

/// The table as text.
pub const CSV: &str = "runs.csv";
/// The table as Parquet.
pub const PARQUET: &str = "runs.parquet";
/// The study as it was carried out.
pub const STUDY: &str = "study.toml";

/// Writes what came of a study into its folder. The files follow the journals there, so that those of
/// the study before it was extended are replaced.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(study: &Study, carried: &Carried, folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut results = Results::begin(folder)?;
    if journal::is_there(folder) {
        results.supersede();
    }
    results.write(CSV, |file| files::csv(&carried.table, file))?;
    results.write(PARQUET, |file| files::parquet(&carried.table, file))?;
    results.write_text(STUDY, &study.text)?;
    Ok(results.finish()?)
}
