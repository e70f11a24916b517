//! What stands on the table.

pub mod extended;
pub mod hysteresis;
pub mod linear;
mod storeys;
mod yielding;

pub use storeys::{MAX_STOREYS, Storeys, StoreysState};
pub use yielding::{YieldingSpecimen, YieldingState};
