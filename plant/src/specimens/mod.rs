//! Specimens beyond the linear one: yielding, and of several storeys.

mod storeys;
mod yielding;

pub use storeys::{MAX_STOREYS, Storeys, StoreysState};
pub use yielding::{YieldingSpecimen, YieldingState};
