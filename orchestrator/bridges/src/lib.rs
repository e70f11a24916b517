//! Other programs at the table: OpenFresco's protocol, spoken by OpenSees' elements `genericClient`
//! and `adapter` and by OpenFresco's generic control.
//!
//! [`Server`] answers a client as an experimental element or as a laboratory's controller;
//! [`element`] says what a trial does to a rig, which is anything with the trait
//! [`Rig`](element::Rig). [`Client`] is the other side. Nothing here knows FMI.

pub mod element;
pub mod opensees;
pub mod protocol;

mod client;
mod link;
mod round_trips;
mod scale;
mod server;
mod session;

pub use client::Client;
pub use link::{Link, LinkError};
pub use round_trips::{Bin, RoundTrips};
pub use scale::{Scale, ScaleError};
pub use server::{Admission, BindError, Ending, Event, Server};
pub use session::{Served, SessionError, Step};
