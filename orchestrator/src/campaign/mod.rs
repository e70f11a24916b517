//! Studies of many runs: factors, a design, runs on all cores, a table, and what it says.

pub mod analysis;
pub mod page;
pub mod table;
