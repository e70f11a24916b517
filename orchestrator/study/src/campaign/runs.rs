//! What can be carried out as the runs of a study.

use super::journal::Head;
use super::table::Row;
use laboratory::error::Error;

/// Runs that can be carried out: those of a study, or others that want its journal, shards and table.
pub trait Runs: Sync {
    /// Finds what is wrong before the first run.
    ///
    /// # Errors
    /// What is wrong.
    fn check(&self) -> Result<(), Error>;

    /// Which rows may be in one table with theirs, and the columns.
    ///
    /// # Errors
    /// As [`Runs::check`].
    fn head(&self) -> Result<Head, Error>;

    /// How many there are.
    fn count(&self) -> u64;

    /// The name of a run: what it is, not where it stands.
    fn name(&self, number: u64) -> String;

    /// Carries a run out; one that fails is a row too.
    fn run(&self, number: u64) -> Row;
}
