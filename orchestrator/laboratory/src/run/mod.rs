//! A run of a system on a motion: what is asked for, what is played, what is kept.

pub mod checkpoint;
pub mod experiment;
pub mod identity;
pub mod manifest;
mod motions;
pub mod page;
pub mod refinement;
mod request;
pub mod signals;
pub mod summary;
pub mod table;
pub mod text;
