//! An FMU that is compiled here, through the calls of both versions of the standard.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod co_simulation;
mod events;
mod exchange;
#[allow(dead_code, reason = "tests of other crates need more")]
mod made;
mod values;
