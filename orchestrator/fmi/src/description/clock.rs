//! Clocks that an FMU (FMI 3.0) gets from outside.

use serde::{Deserialize, Serialize};

/// An input clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputClock {
    /// Its name.
    pub name: String,
    /// Value reference.
    pub reference: u32,
    /// When it ticks.
    pub ticks: Ticks,
    /// Time of the first tick after the start, s; of a periodic clock.
    pub shift: f64,
}

/// When a clock ticks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Ticks {
    /// At a period that stays, s; where there is none the FMU says it when it is initialized.
    Periodic(Option<f64>),
    /// At a period that the FMU may change in every tick.
    Changing,
    /// Once, as long after an event as the FMU says there.
    Countdown,
    /// When another clock says so.
    Triggered,
}
