//! What goes over the wire: eleven sizes, then vectors of float64, little-endian, with no framing.

mod action;
mod sizes;

pub use action::{Action, Matrix};
pub use sizes::{Quantities, Sizes};

use thiserror::Error;

/// Longest vector that is accepted, in float64.
pub const LONGEST: usize = 1 << 16;

/// What a peer sent that is not the protocol.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProtocolError {
    /// Text of another protocol.
    #[error(
        "the first bytes are an HTTP request; expected 11 int32 with the sizes of OpenFresco's \
         protocol (a browser does not belong at this port)"
    )]
    Http,
    /// An encrypted connection.
    #[error(
        "the first bytes are a TLS handshake, which is not offered; connect without `-ssl`, from \
         this machine or through a tunnel"
    )]
    Tls,
    /// A vector where the sizes belong.
    #[error(
        "a vector of float64 (action {action}) came before the setup; expected 11 int32 with the \
         sizes first"
    )]
    NotSetUp {
        /// Its first entry.
        action: f64,
    },
    /// Sizes that cannot be.
    #[error(
        "the sizes are {sizes:?}: {reason}; expected five counts of what the client sends \
         (displacement, velocity, acceleration, force, time), five of what it wants, and the \
         length of every later vector, as little-endian int32"
    )]
    Sizes {
        /// As they came.
        sizes: [i32; 11],
        /// What does not fit.
        reason: &'static str,
    },
    /// Sizes that do not fit what is served.
    #[error("the client has {given} of {quantity}, but the system served has {expected}")]
    Components {
        /// Which quantity.
        quantity: &'static str,
        /// As the client says.
        given: usize,
        /// As the system has.
        expected: usize,
    },
    /// A first entry that names no action.
    #[error(
        "the first entry of a vector is {0}, which is not an action; expected 1 to 15 or 99 (does the \
         client send vectors of the length that it said?)"
    )]
    Action(f64),
    /// A number that no quantity has.
    #[error("the {quantity} of a trial is {value}, not a finite number")]
    NotFinite {
        /// Which quantity.
        quantity: &'static str,
        /// What came.
        value: f64,
    },
    /// A matrix that the vectors have no room for.
    #[error(
        "a matrix of {entries} entries does not fit vectors of {length} float64; give the client \
         longer ones (`-dataSize {entries}`)"
    )]
    MatrixSize {
        /// Entries of the matrix.
        entries: usize,
        /// Length of every vector.
        length: usize,
    },
}
