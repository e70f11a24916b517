//! Who watches a run.

/// Sees every row of the record during the run. It is called between two steps, so it should
/// return at once.
pub trait Observer: Send + Sync {
    /// A row: the time, s, and the signals, SI, in the order of
    /// [`Simulation::names`](crate::Simulation::names).
    fn row(&self, time: f64, signals: &[f64]);
}
