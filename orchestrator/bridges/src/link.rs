//! A connection that carries messages of known lengths, over TCP or UDP, with a time limit for a peer
//! that goes silent.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use thiserror::Error;

/// How often a wait looks whether it is to end.
const LOOK: Duration = Duration::from_millis(100);
/// UDP messages are cut into pieces of this many bytes, as OpenSees does.
const DATAGRAM: usize = 9126;
/// Shorter datagrams are ignored.
pub(crate) const SHORTEST: usize = 4;

/// Why nothing goes over a connection any more.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The peer closed it between two messages.
    #[error("the peer closed the connection")]
    Closed,
    /// The peer closed it in the middle of a message.
    #[error("the peer closed the connection in the middle of a message: {got} of {expected} bytes")]
    Half {
        /// Bytes that came.
        got: usize,
        /// Bytes of the message.
        expected: usize,
    },
    /// Nothing came for too long.
    #[error(
        "the peer was silent for {limit_s} s ({got} of {expected} bytes of a message had come)"
    )]
    Silent {
        /// The time limit, s.
        limit_s: f64,
        /// Bytes that came.
        got: usize,
        /// Bytes of the message.
        expected: usize,
    },
    /// A datagram that is longer than a message.
    #[error("a datagram brought {got} bytes more than the {expected} expected")]
    TooLong {
        /// Bytes beyond.
        got: usize,
        /// Bytes of the message.
        expected: usize,
    },
    /// The wait was ended on this side.
    #[error("interrupted")]
    Interrupted,
    /// What the system says.
    #[error("the connection failed: {0}")]
    Failed(#[from] io::Error),
}

/// What carries the bytes.
enum Wire {
    Tcp(TcpStream),
    Udp {
        socket: UdpSocket,
        peer: SocketAddr,
        /// A datagram that is not wholly read yet.
        kept: Vec<u8>,
        /// How much of it is read.
        used: usize,
        /// Text for other peers.
        word: String,
    },
}

/// A connection to a peer.
pub struct Link {
    wire: Wire,
    /// How long the peer may be silent.
    limit: Duration,
    /// Ends a wait when it becomes true.
    interrupt: Option<&'static AtomicBool>,
}

impl Link {
    /// Over a TCP connection, without Nagle's algorithm.
    ///
    /// # Errors
    /// The connection does not take its options.
    pub fn tcp(stream: TcpStream, limit: Duration) -> Result<Self, LinkError> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(LOOK.min(limit)))?;
        stream.set_write_timeout(Some(limit))?;
        Ok(Self {
            wire: Wire::Tcp(stream),
            limit,
            interrupt: None,
        })
    }

    /// Over UDP with one peer, which has sent `first` already; other peers get the text `word`.
    ///
    /// # Errors
    /// The socket does not take its options.
    pub fn udp(
        socket: UdpSocket,
        peer: SocketAddr,
        first: &[u8],
        word: &str,
        limit: Duration,
    ) -> Result<Self, LinkError> {
        socket.set_nonblocking(false)?;
        socket.set_read_timeout(Some(LOOK.min(limit)))?;
        Ok(Self {
            wire: Wire::Udp {
                socket,
                peer,
                kept: first.to_vec(),
                used: 0,
                word: word.to_string(),
            },
            limit,
            interrupt: None,
        })
    }

    /// Ends every wait soon after `asked` becomes true.
    pub fn heed(&mut self, asked: Option<&'static AtomicBool>) {
        self.interrupt = asked;
    }

    /// Lets the peer be silent for so long from now on.
    ///
    /// # Errors
    /// The connection does not take it.
    pub fn limit(&mut self, limit: Duration) -> Result<(), LinkError> {
        self.limit = limit;
        let look = Some(LOOK.min(limit));
        match &self.wire {
            Wire::Tcp(stream) => stream.set_read_timeout(look)?,
            Wire::Udp { socket, .. } => socket.set_read_timeout(look)?,
        }
        Ok(())
    }

    /// Fills `message`.
    ///
    /// # Errors
    /// The peer is gone, silent for too long, or the wait was interrupted.
    pub fn receive(&mut self, message: &mut [u8]) -> Result<(), LinkError> {
        let expected = message.len();
        let mut got = 0;
        let mut since = Instant::now();
        while got < expected {
            match self.wire.read(&mut message[got..]) {
                Ok(0) if got == 0 => return Err(LinkError::Closed),
                Ok(0) => return Err(LinkError::Half { got, expected }),
                Ok(count) => {
                    got += count;
                    since = Instant::now();
                }
                Err(error) if is_a_look(&error) => {
                    if self.interrupt.is_some_and(|i| i.load(Ordering::Relaxed)) {
                        return Err(LinkError::Interrupted);
                    }
                    if since.elapsed() >= self.limit {
                        return Err(LinkError::Silent {
                            limit_s: self.limit.as_secs_f64(),
                            got,
                            expected,
                        });
                    }
                }
                Err(error) if is_gone(&error) => {
                    return Err(match got {
                        0 => LinkError::Closed,
                        got => LinkError::Half { got, expected },
                    });
                }
                Err(error) => return Err(error.into()),
            }
        }
        let beyond = self.wire.unread();
        if beyond > 0 {
            return Err(LinkError::TooLong {
                got: beyond,
                expected,
            });
        }
        Ok(())
    }

    /// Sends `message`.
    ///
    /// # Errors
    /// The peer is gone, or takes nothing for too long.
    pub fn send(&mut self, message: &[u8]) -> Result<(), LinkError> {
        let sent = match &mut self.wire {
            Wire::Tcp(stream) => stream.write_all(message),
            Wire::Udp { socket, peer, .. } => message
                .chunks(DATAGRAM)
                .try_for_each(|piece| socket.send_to(piece, *peer).map(drop)),
        };
        sent.map_err(|error| {
            if is_gone(&error) {
                LinkError::Closed
            } else if is_a_look(&error) {
                LinkError::Silent {
                    limit_s: self.limit.as_secs_f64(),
                    got: 0,
                    expected: message.len(),
                }
            } else {
                error.into()
            }
        })
    }
}

impl Wire {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Tcp(stream) => {
                acknowledge_at_once(stream);
                stream.read(into)
            }
            Self::Udp {
                socket,
                peer,
                kept,
                used,
                word,
            } => {
                if *used == kept.len() {
                    kept.resize(1 << 16, 0);
                    *used = 0;
                    let came = socket.recv_from(kept);
                    let (count, from) = match came {
                        Ok(came) => came,
                        Err(error) => {
                            kept.clear();
                            return Err(error);
                        }
                    };
                    // Datagrams of other peers are not part of this conversation. Shorter ones only
                    // announce a client.
                    if from != *peer || count < SHORTEST {
                        kept.clear();
                        if from != *peer {
                            let _ = socket.send_to(word.as_bytes(), from);
                        }
                        return Err(io::ErrorKind::WouldBlock.into());
                    }
                    kept.truncate(count);
                }
                let count = into.len().min(kept.len() - *used);
                into[..count].copy_from_slice(&kept[*used..*used + count]);
                *used += count;
                Ok(count)
            }
        }
    }

    /// Bytes of a datagram behind the end of a message.
    fn unread(&self) -> usize {
        match self {
            Self::Tcp(_) => 0,
            Self::Udp { kept, used, .. } => kept.len() - used,
        }
    }
}

/// Acknowledges what comes without delay: a client with Nagle's algorithm on waits for that, 40 ms a
/// message.
fn acknowledge_at_once(stream: &TcpStream) {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    {
        use std::os::linux::net::TcpStreamExt;
        // A system that does not take it is slow, no more.
        let _ = stream.set_quickack(true);
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    let _ = stream;
}

/// Whether a read ended to look round.
fn is_a_look(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

/// Whether the peer is no more.
fn is_gone(error: &io::Error) -> bool {
    use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset};
    matches!(
        error.kind(),
        BrokenPipe | ConnectionAborted | ConnectionReset
    )
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    const LIMIT: Duration = Duration::from_millis(20);

    /// Both ends of a connection over TCP.
    fn connected() -> (Link, TcpStream) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (own, _) = listener.accept().unwrap();
        (Link::tcp(own, LIMIT).unwrap(), peer)
    }

    fn socket() -> (UdpSocket, SocketAddr) {
        let socket = UdpSocket::bind(("127.0.0.1", 0)).unwrap();
        let address = socket.local_addr().unwrap();
        socket
            .set_read_timeout(Some(Duration::from_secs(5)))
            .unwrap();
        (socket, address)
    }

    #[test]
    fn what_is_missing_of_a_message_is_told() {
        let (mut link, mut peer) = connected();
        let mut message = [0; 8];
        peer.write_all(&[1, 2, 3, 4, 5, 6, 7, 8, 9]).unwrap();
        link.receive(&mut message).unwrap();
        assert_eq!(message, [1, 2, 3, 4, 5, 6, 7, 8]);
        let silent = link.receive(&mut message);
        assert!(
            matches!(silent, Err(LinkError::Silent { got: 1, expected: 8, limit_s }) if limit_s == 0.02),
            "{silent:?}"
        );
        peer.write_all(&[1, 2]).unwrap();
        drop(peer);
        let half = link.receive(&mut message);
        assert!(
            matches!(
                half,
                Err(LinkError::Half {
                    got: 2,
                    expected: 8
                })
            ),
            "{half:?}"
        );
        let closed = link.receive(&mut message);
        assert!(matches!(closed, Err(LinkError::Closed)), "{closed:?}");
    }

    /// Four pieces in 1.6 s, with a limit of 1 s.
    #[test]
    fn a_silence_begins_with_the_last_piece_of_a_message() {
        let (mut link, mut peer) = connected();
        link.limit(Duration::from_secs(1)).unwrap();
        let slow = std::thread::spawn(move || {
            for piece in 1..=4 {
                std::thread::sleep(Duration::from_millis(400));
                peer.write_all(&[piece; 2]).unwrap();
            }
        });
        let mut message = [0; 8];
        link.receive(&mut message).unwrap();
        assert_eq!(message, [1, 1, 2, 2, 3, 3, 4, 4]);
        slow.join().unwrap();
    }

    #[test]
    fn a_wait_ends_where_that_is_asked_for() {
        static ASKED: AtomicBool = AtomicBool::new(true);
        let (mut link, _peer) = connected();
        link.limit(Duration::from_secs(60)).unwrap();
        link.heed(Some(&ASKED));
        let begun = Instant::now();
        let ended = link.receive(&mut [0; 8]);
        assert!(matches!(ended, Err(LinkError::Interrupted)), "{ended:?}");
        assert!(begun.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_long_message_goes_in_pieces_and_is_put_together() {
        let ((one, its), (other, to)) = (socket(), socket());
        let mut link = Link::udp(one, to, &[], "", LIMIT).unwrap();
        let long: Vec<u8> = (0..20_000_u32).map(|n| (n % 251) as u8).collect();
        link.send(&long).unwrap();
        let mut got = vec![0; 1 << 16];
        for expected in [DATAGRAM, DATAGRAM, 20_000 - 2 * DATAGRAM] {
            assert_eq!(other.recv(&mut got).unwrap(), expected);
        }
        let mut back = Link::udp(other, its, &long[..5000], "", LIMIT).unwrap();
        link.send(&long[5000..]).unwrap();
        let mut message = vec![0; 20_000];
        back.receive(&mut message).unwrap();
        assert!(message == long);
        // What is longer than a message is not the next one.
        link.send(&[7; 12]).unwrap();
        let long = back.receive(&mut message[..8]);
        assert!(
            matches!(
                long,
                Err(LinkError::TooLong {
                    got: 4,
                    expected: 8
                })
            ),
            "{long:?}"
        );
    }

    #[test]
    fn datagrams_of_others_are_answered_with_a_word_and_announcements_are_skipped() {
        let ((one, its), (peer, of_peer), (stranger, _)) = (socket(), socket(), socket());
        let mut link = Link::udp(one, of_peer, &[], "busy", LIMIT).unwrap();
        stranger.send_to(&[9; 8], its).unwrap();
        peer.send_to(&[0; SHORTEST - 1], its).unwrap();
        peer.send_to(&[5; 8], its).unwrap();
        let mut message = [0; 8];
        link.receive(&mut message).unwrap();
        assert_eq!(message, [5; 8]);
        let mut word = [0; 16];
        let count = stranger.recv(&mut word).unwrap();
        assert_eq!(&word[..count], b"busy");
    }

    #[test]
    fn a_peer_that_is_gone_is_told_from_other_failures() {
        use io::ErrorKind::{AddrInUse, BrokenPipe, ConnectionReset, PermissionDenied};
        for (kind, expected) in [
            (BrokenPipe, true),
            (ConnectionReset, true),
            (PermissionDenied, false),
            (AddrInUse, false),
        ] {
            assert_eq!(is_gone(&kind.into()), expected, "{kind}");
        }
        // Without leave nothing goes to everybody.
        let nowhere = SocketAddr::from(([255, 255, 255, 255], 9));
        let mut link = Link::udp(socket().0, nowhere, &[], "", LIMIT).unwrap();
        let failed = link.send(&[1]);
        assert!(matches!(failed, Err(LinkError::Failed(_))), "{failed:?}");
    }
}
