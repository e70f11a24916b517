//! Chapter 2 as a tool: from measured data to a model, and what is refused.

mod bad_input;
mod command;
mod measured;
mod rig;
mod subspace;
mod to_fmu;
