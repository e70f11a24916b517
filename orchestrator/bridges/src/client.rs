//! The client's side of the protocol: what a program of analysis does, and how OpenSees' `adapter` is
//! driven.

use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::Duration;

use crate::link::{Link, LinkError};
use crate::protocol::{Action, Sizes};

/// A client that has said its sizes.
pub struct Client {
    link: Link,
    sizes: Sizes,
    message: Vec<u8>,
    reply: Vec<f64>,
}

impl Client {
    /// Connects over TCP and says the sizes; the server may be silent for `limit` at most.
    ///
    /// # Errors
    /// Nobody listens there.
    pub fn connect(address: SocketAddr, sizes: Sizes, limit: Duration) -> Result<Self, LinkError> {
        let stream = TcpStream::connect_timeout(&address, limit)?;
        Self::over(Link::tcp(stream, limit)?, sizes)
    }

    /// Says the sizes over UDP.
    ///
    /// # Errors
    /// A socket cannot be opened.
    pub fn connect_udp(
        address: SocketAddr,
        sizes: Sizes,
        limit: Duration,
    ) -> Result<Self, LinkError> {
        let own: SocketAddr = match address {
            SocketAddr::V4(_) => ([127, 0, 0, 1], 0).into(),
            SocketAddr::V6(_) => ([0, 0, 0, 0, 0, 0, 0, 1], 0).into(),
        };
        let socket = UdpSocket::bind(own)?;
        Self::over(Link::udp(socket, address, &[], "", limit)?, sizes)
    }

    fn over(mut link: Link, sizes: Sizes) -> Result<Self, LinkError> {
        link.send(&sizes.bytes())?;
        Ok(Self {
            link,
            sizes,
            message: vec![0; 8 * sizes.length],
            reply: vec![0.0; sizes.length],
        })
    }

    /// Sends a vector: an action with what belongs to it.
    ///
    /// # Errors
    /// The server is gone.
    pub fn send(&mut self, action: Action, values: &[f64]) -> Result<(), LinkError> {
        self.message.fill(0);
        let all = std::iter::once(action.number()).chain(values.iter().copied());
        for (eight, value) in self.message.chunks_exact_mut(8).zip(all) {
            eight.copy_from_slice(&value.to_le_bytes());
        }
        self.link.send(&self.message)
    }

    /// Sends a vector and waits for the one that comes back.
    ///
    /// # Errors
    /// The server is gone or silent for too long.
    pub fn ask(&mut self, action: Action) -> Result<&[f64], LinkError> {
        self.send(action, &[])?;
        self.receive()
    }

    /// Waits for a vector.
    ///
    /// # Errors
    /// The server is gone or silent for too long.
    pub fn receive(&mut self) -> Result<&[f64], LinkError> {
        self.link.receive(&mut self.message)?;
        for (value, eight) in self.reply.iter_mut().zip(self.message.chunks_exact(8)) {
            let mut own = [0; 8];
            own.copy_from_slice(eight);
            *value = f64::from_le_bytes(own);
        }
        Ok(&self.reply)
    }

    /// The sizes that both sides go by.
    #[must_use]
    pub fn sizes(&self) -> &Sizes {
        &self.sizes
    }
}
