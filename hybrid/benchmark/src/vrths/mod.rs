//! The single-axis benchmark of virtual real-time hybrid simulation (see [`hybrid::vrths`]):
//! tracking laws on the same plants, motions and noise, scored as the benchmark scores them.

pub mod command;
pub mod criteria;
pub mod hidden;
pub mod motions;
pub mod outcome;
pub mod page;
pub mod published;
pub mod roster;
pub mod simulation;
pub mod study;
