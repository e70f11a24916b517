//! FMUs in another process, so that whatever they do ends as an error of this one.
//!
//! The program starts itself again as a guest that loads the libraries. Calls travel through memory
//! mapped into both processes (`frame`). One number there gives the side whose turn it is. Both sides
//! wait on it (`turn`), spinning for a few microseconds where that pays, then asleep. Settings of
//! variables are kept until the next call that gives something, and travel with it.
#![allow(unsafe_code, reason = "memory is shared with another process")]

mod frame;
mod guest;
mod host;
mod leftovers;
mod listen;
mod parcel;
mod program;
mod remote;
mod requests;
mod ring;
mod turn;

pub use guest::guest;
pub(super) use host::Host;
pub(super) use remote::Remote;

/// The hidden command of the program that makes it a guest.
pub const COMMAND: &str = "fmu-process";
