//! What the channels show of the rig.

pub mod channel;
pub mod instrumentation;
