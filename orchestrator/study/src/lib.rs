//! Studies of many runs, what they show, and parameters searched over a study.

pub mod campaign;
pub mod tune;
