//! What stands on the table.

mod controlled;
pub mod extended;
pub mod hysteresis;
pub mod linear;
mod magnetorheological;
mod storeys;
mod yielding;

pub use controlled::{ControlledState, ControlledStoreys, TunedMass};
pub use magnetorheological::{DamperState, MagnetorheologicalDamper};
pub use storeys::{MAX_STOREYS, Storeys, StoreysState};
pub use yielding::{YieldingSpecimen, YieldingState};
