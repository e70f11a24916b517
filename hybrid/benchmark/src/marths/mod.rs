//! The two-actuator benchmark (see [`hybrid::marths`]): tracking laws on the same plants, motions and
//! noise, scored as the benchmark scores them.

pub mod command;
pub mod outcome;
pub mod page;
pub mod roster;
pub mod study;
